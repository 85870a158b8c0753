#include <plumbline/apps/evaluation/map_evaluation.h>
#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/merged_walls.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Walls are sampled this densely, m.
constexpr double kStep = 0.025;
// Of one wall: those of more than 500 m are no walls, and sampled less densely.
constexpr double kMostSamples = 20000.0;
// Directions that hold less of the length than this say nothing of a bend.
constexpr double kBendShare = 0.1;

double Length(const std::pair<double, double>& interval) {
  return interval.second - interval.first;
}

// Sorted and without overlaps.
std::vector<std::pair<double, double>> Unite(
    std::vector<std::pair<double, double>> intervals) {
  std::sort(intervals.begin(), intervals.end());
  std::vector<std::pair<double, double>> united;
  for (const auto& interval : intervals) {
    if (!(Length(interval) > 0.0)) continue;
    if (!united.empty() && interval.first <= united.back().second) {
      united.back().second = std::max(united.back().second, interval.second);
    } else {
      united.push_back(interval);
    }
  }
  return united;
}

double TotalLength(const std::vector<std::pair<double, double>>& intervals) {
  double length = 0.0;
  for (const auto& interval : intervals) length += Length(interval);
  return length;
}

// Length common to two unions.
double CommonLength(const std::vector<std::pair<double, double>>& a,
                    const std::vector<std::pair<double, double>>& b) {
  double length = 0.0;
  std::size_t i = 0;
  std::size_t k = 0;
  while (i < a.size() && k < b.size()) {
    const double begin = std::max(a[i].first, b[k].first);
    const double end = std::min(a[i].second, b[k].second);
    length += std::max(0.0, end - begin);
    if (a[i].second < b[k].second) {
      ++i;
    } else {
      ++k;
    }
  }
  return length;
}

// Smallest difference of two undirected directions, degrees.
double AxialDifferenceDeg(double a_deg, double b_deg) {
  return std::abs(RadToDeg(NormalizeAxial(DegToRad(a_deg - b_deg))));
}

// A truth wall made ready, and what matched it.
struct TrueWall : Wall {
  std::vector<std::pair<double, double>> seen;
  // Parts covered by map segments, m along the wall.
  std::vector<std::pair<double, double>> covered;
  double matched = 0.0;
  double direction_sum = 0.0;
  // Of segments of at least the minimum length: how long, and how far turned.
  double long_matched = 0.0;
  double turn_sum = 0.0;
  double offset_sum = 0.0;
};

// Segments that live closures join as one, under the lowest id.
std::vector<MapSegment> Merged(const StraightMap& map) {
  std::map<std::int64_t, std::size_t> index;
  for (std::size_t i = 0; i < map.segments.size(); ++i) {
    index[map.segments[i].id] = i;
  }
  DisjointSets sets(map.segments.size());
  for (const MapClosure& closure : map.closures) {
    if (!closure.is_live) continue;
    sets.Join(index.at(closure.first), index.at(closure.second));
  }
  std::map<std::size_t, std::vector<WallPiece>> classes;
  for (std::size_t i = 0; i < map.segments.size(); ++i) {
    const MapSegment& segment = map.segments[i];
    classes[sets.Find(i)].push_back({segment.pose, segment.begin, segment.end});
  }
  std::vector<MapSegment> merged;
  for (const auto& [root, pieces] : classes) {
    const WallPiece united = UnitePieces(pieces);
    merged.push_back(
        {map.segments[root].id, united.pose, united.begin, united.end});
  }
  return merged;
}

std::vector<TrueWall> MakeWalls(const MapTruth& truth) {
  std::vector<TrueWall> walls;
  for (const TruthWall& truth_wall : truth.walls) {
    TrueWall wall;
    wall.position = truth_wall.begin;
    const Eigen::Vector2d along = truth_wall.end - truth_wall.begin;
    wall.end = along.norm();
    wall.direction = wall.end > 0.0 ? Eigen::Vector2d(along / wall.end)
                                    : Eigen::Vector2d(1.0, 0.0);
    wall.angle = std::atan2(wall.direction.y(), wall.direction.x());
    wall.seen = Unite(truth_wall.seen);
    walls.push_back(wall);
  }
  return walls;
}

// The walls, parallel and near enough, that some of the segment may lie on.
void FindCandidates(const Wall& segment, const MapTruthOptions& options,
                    std::vector<TrueWall>* walls,
                    std::vector<TrueWall*>* candidates) {
  candidates->clear();
  const Eigen::Vector2d center = segment.Middle();
  for (TrueWall& wall : *walls) {
    if (std::abs(NormalizeAxial(segment.angle - wall.angle)) >
        DegToRad(options.maximum_angle_deg)) {
      continue;
    }
    const double reach = 0.5 * (segment.length() + wall.length()) +
                         options.end_slack + options.maximum_offset;
    if ((center - wall.Middle()).squaredNorm() <= reach * reach) {
      candidates->push_back(&wall);
    }
  }
}

// Where a point lies on the nearest wall; null: on none.
struct Foot {
  TrueWall* wall = nullptr;
  double along = 0.0;
  double offset = 0.0;
};

Foot NearestWall(const Eigen::Vector2d& point, const MapTruthOptions& options,
                 const std::vector<TrueWall*>& candidates) {
  Foot nearest;
  nearest.offset = options.maximum_offset;
  for (TrueWall* wall : candidates) {
    const double along = wall->Along(point);
    if (along < -options.end_slack || along > wall->end + options.end_slack) {
      continue;
    }
    const double offset = std::abs(wall->Across(point));
    if (offset < nearest.offset ||
        (nearest.wall == nullptr && offset == nearest.offset)) {
      nearest = {wall, along, offset};
    }
  }
  return nearest;
}

// Counts every piece of the segment for the wall that it lies on. Returns how
// much of it lies on any, m.
double MatchSegment(const Wall& segment, const MapTruthOptions& options,
                    const std::vector<TrueWall*>& candidates) {
  const int samples = static_cast<int>(
      std::clamp(std::ceil(segment.length() / kStep), 1.0, kMostSamples));
  const double step = segment.length() / samples;
  double matched = 0.0;
  for (int k = 0; k < samples; ++k) {
    const Eigen::Vector2d point = segment.At(segment.begin + (k + 0.5) * step);
    const Foot foot = NearestWall(point, options, candidates);
    if (foot.wall == nullptr) continue;
    matched += step;
    TrueWall& wall = *foot.wall;
    wall.covered.emplace_back(foot.along - 0.5 * step, foot.along + 0.5 * step);
    wall.matched += step;
    const double turn = RadToDeg(NormalizeAxial(segment.angle - wall.angle));
    wall.direction_sum += step * std::abs(turn);
    if (segment.length() >= options.minimum_length) {
      wall.long_matched += step;
      wall.turn_sum += step * turn;
    }
    wall.offset_sum += step * foot.offset;
  }
  return matched;
}

// Precision, false walls, and what each true wall was matched by.
void MatchMap(const StraightMap& map, const MapTruthOptions& options,
              std::vector<TrueWall>* walls, MapTruthEvaluation* evaluation) {
  double map_length = 0.0;
  double right_length = 0.0;
  std::vector<TrueWall*> candidates;
  for (const MapSegment& segment : Merged(map)) {
    // In the world frame.
    const Wall placed = MakeWall(Compose(evaluation->alignment, segment.pose),
                                 segment.begin, segment.end);
    if (!(placed.length() > 0.0)) continue;
    FindCandidates(placed, options, walls, &candidates);
    const double matched = MatchSegment(placed, options, candidates);
    if (placed.length() < options.minimum_length) continue;
    map_length += placed.length();
    right_length += matched;
    if (matched < options.minimum_overlap * placed.length()) {
      evaluation->false_walls.push_back(segment.id);
    }
  }
  evaluation->judged_length = map_length;
  if (map_length > 0.0) evaluation->precision = right_length / map_length;
}

bool IsAskedFor(const TrueWall& wall, const MapTruthOptions& options) {
  return !(TotalLength(wall.seen) < options.minimum_length);
}

// Recall, missed and doubled walls, and errors of those that were found.
void JudgeWalls(const MapTruth& truth, const MapTruthOptions& options,
                const std::vector<TrueWall>& walls,
                MapTruthEvaluation* evaluation) {
  double seen_length = 0.0;
  double found_length = 0.0;
  std::vector<double> direction_errors;
  std::vector<double> offset_errors;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const TrueWall& wall = walls[i];
    if (!IsAskedFor(wall, options)) continue;
    WallResult result;
    result.id = truth.walls[i].id;
    result.seen = TotalLength(wall.seen);
    const auto covered = Unite(wall.covered);
    evaluation->doubled_length += wall.matched - TotalLength(covered);
    result.covered = CommonLength(covered, wall.seen);
    result.found = result.covered >= options.minimum_overlap * result.seen &&
                   wall.matched > 0.0;
    seen_length += result.seen;
    found_length += result.covered;
    if (result.found) {
      result.direction_error_deg = wall.direction_sum / wall.matched;
      result.offset_error = wall.offset_sum / wall.matched;
      direction_errors.push_back(result.direction_error_deg);
      offset_errors.push_back(result.offset_error);
    } else {
      evaluation->missed_walls.push_back(result.id);
    }
    evaluation->walls.push_back(result);
  }
  evaluation->asked_length = seen_length;
  if (seen_length > 0.0) evaluation->recall = found_length / seen_length;
  evaluation->direction_error_deg = ComputeStatistics(direction_errors);
  evaluation->offset_error = ComputeStatistics(offset_errors);
}

// How far the walls of each direction are turned, and how far that bends the
// building.
void JudgeDirections(const MapTruth& truth, const MapTruthOptions& options,
                     const std::vector<TrueWall>& walls,
                     MapTruthEvaluation* evaluation) {
  double all_length = 0.0;
  std::vector<double> lengths;
  std::vector<double> asked;
  for (std::size_t d = 0; d < truth.orientations_deg.size(); ++d) {
    DirectionResult result;
    result.angle_deg = truth.orientations_deg[d];
    asked.push_back(0.0);
    for (std::size_t i = 0; i < walls.size(); ++i) {
      if (truth.walls[i].orientation != static_cast<int>(d)) continue;
      result.length += walls[i].long_matched;
      result.error_deg += walls[i].turn_sum;
      if (IsAskedFor(walls[i], options))
        asked.back() += TotalLength(walls[i].seen);
    }
    lengths.push_back(result.length);
    if (!(result.length > 0.0)) continue;
    result.error_deg /= result.length;
    all_length += result.length;
    evaluation->directions.push_back(result);
  }
  const double all_asked = std::accumulate(asked.begin(), asked.end(), 0.0);
  evaluation->is_bend_known = all_length > 0.0;
  for (std::size_t d = 0; d < lengths.size(); ++d) {
    if (asked[d] > 0.0 && asked[d] >= kBendShare * all_asked &&
        lengths[d] < kBendShare * all_length) {
      evaluation->is_bend_known = false;
    }
  }
  for (const DirectionResult& a : evaluation->directions) {
    for (const DirectionResult& b : evaluation->directions) {
      if (std::min(a.length, b.length) < kBendShare * all_length) continue;
      evaluation->bend_error_deg =
          std::max(evaluation->bend_error_deg, a.error_deg - b.error_deg);
    }
  }
}

// Orientation features against the directions of the building.
void JudgeOrientations(const StraightMap& map, const MapTruth& truth,
                       const MapTruthOptions& options,
                       const std::vector<TrueWall>& walls,
                       MapTruthEvaluation* evaluation) {
  std::vector<int> matches(truth.orientations_deg.size(), 0);
  for (const MapOrientation& orientation : map.orientations) {
    double degrees =
        RadToDeg(NormalizeAxial(orientation.angle + evaluation->alignment[2]));
    if (degrees < 0.0) degrees += 180.0;
    int nearest = -1;
    double nearest_difference = options.maximum_orientation_error_deg;
    for (std::size_t i = 0; i < truth.orientations_deg.size(); ++i) {
      const double difference =
          AxialDifferenceDeg(degrees, truth.orientations_deg[i]);
      if (difference <= nearest_difference) {
        nearest = static_cast<int>(i);
        nearest_difference = difference;
      }
    }
    if (nearest < 0) {
      evaluation->false_orientations_deg.push_back(degrees);
    } else if (matches[nearest]++ > 0) {
      ++evaluation->duplicate_orientations;
    }
  }
  std::set<int> asked;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    if (truth.walls[i].orientation >= 0 && IsAskedFor(walls[i], options)) {
      asked.insert(truth.walls[i].orientation);
    }
  }
  for (const int index : asked) {
    if (matches[index] == 0) {
      evaluation->missed_orientations_deg.push_back(
          truth.orientations_deg[index]);
    }
  }
}

}  // namespace

MapTruthEvaluation EvaluateMap(const StraightMap& map, const MapTruth& truth,
                               const Pose2& alignment,
                               const MapTruthOptions& options) {
  MapTruthEvaluation evaluation;
  evaluation.alignment = alignment;
  std::vector<TrueWall> walls = MakeWalls(truth);
  MatchMap(map, options, &walls, &evaluation);
  JudgeWalls(truth, options, walls, &evaluation);
  JudgeDirections(truth, options, walls, &evaluation);
  JudgeOrientations(map, truth, options, walls, &evaluation);
  return evaluation;
}

}  // namespace plumbline
