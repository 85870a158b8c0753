#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/detectors/merged_walls.h>
#include <plumbline/detectors/same_wall.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

namespace plumbline {
namespace {

using Json = nlohmann::json;

// Walls are sampled this densely, m.
constexpr double kStep = 0.025;
// Coordinates beyond it are garbage, m.
constexpr double kAbsurdCoordinate = 1e7;

// A value of a JSON document with the way to it, for messages.
class Entry {
 public:
  Entry(const std::string& file, const Json& json, std::string path)
      : file_(file), json_(json), path_(std::move(path)) {}

  Entry operator[](const std::string& key) const {
    const std::string path = path_.empty() ? key : path_ + "." + key;
    if (!json_.is_object()) Refuse("is no object", "an object");
    const auto found = json_.find(key);
    if (found == json_.end())
      throw Error(file_, 0, "'" + path + "' is missing", "a value");
    return Entry(file_, *found, path);
  }

  bool Has(const std::string& key) const {
    return json_.is_object() && json_.contains(key);
  }

  std::vector<Entry> Elements() const {
    if (!json_.is_array()) Refuse("is no array", "an array");
    std::vector<Entry> elements;
    elements.reserve(json_.size());
    for (std::size_t i = 0; i < json_.size(); ++i)
      elements.emplace_back(file_, json_[i],
                            path_ + "[" + std::to_string(i) + "]");
    return elements;
  }

  // An array of `count` numbers.
  std::vector<double> Numbers(std::size_t count) const {
    const std::vector<Entry> elements = Elements();
    if (elements.size() != count) {
      Refuse("has " + std::to_string(elements.size()) + " elements",
             std::to_string(count) + " numbers");
    }
    std::vector<double> numbers;
    for (const Entry& element : elements) numbers.push_back(element.Number());
    return numbers;
  }

  double Number() const {
    if (!json_.is_number()) Refuse("is no number", "a number");
    const double value = json_.get<double>();
    if (!std::isfinite(value)) Refuse("is not finite", "a finite number");
    return value;
  }

  // A length or coordinate, m.
  double Metres() const {
    const double value = Number();
    if (std::abs(value) > kAbsurdCoordinate)
      Refuse("is absurd", "metres within 1e7");
    return value;
  }

  std::int64_t Integer() const {
    if (!json_.is_number_integer()) Refuse("is no integer", "an integer");
    return json_.get<std::int64_t>();
  }

  std::string Text() const {
    if (!json_.is_string()) Refuse("is no text", "a text");
    return json_.get<std::string>();
  }

  [[noreturn]] void Refuse(const std::string& what,
                           const std::string& expected) const {
    throw Error(
        file_, 0,
        (path_.empty() ? "the document" : "'" + path_ + "'") + " " + what,
        expected);
  }

 private:
  const std::string& file_;
  const Json& json_;
  std::string path_;
};

// Closures of a map.json; one that names no segment of the map is refused.
void ReadClosures(const Entry& root, StraightMap* map) {
  if (!root.Has("constraints")) return;
  std::set<std::int64_t> segments;
  for (const MapSegment& segment : map->segments) segments.insert(segment.id);
  for (const Entry& entry : root["constraints"].Elements()) {
    if (entry["type"].Text() != kSameWallRelation) continue;
    const std::vector<Entry> features = entry["features"].Elements();
    if (features.size() != 2) {
      entry["features"].Refuse("does not have 2 elements", "two segments");
    }
    MapClosure closure;
    closure.first = features[0].Integer();
    closure.second = features[1].Integer();
    closure.is_live = entry["state"].Text() == "live";
    for (const std::int64_t id : {closure.first, closure.second}) {
      if (segments.count(id) == 0) {
        entry["features"].Refuse("names " + std::to_string(id),
                                 "segments of the map");
      }
    }
    map->closures.push_back(closure);
  }
}

Json ParseJson(InputStream* input, const std::string& expected) {
  const std::string text = input->ReadRest();
  if (!input->damage().empty())
    throw Error(input->name(), 0, input->damage(), "a whole file");
  try {
    return Json::parse(text);
  } catch (const Json::parse_error& error) {
    const std::size_t place = std::min<std::size_t>(error.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + place, '\n');
    throw Error(input->name(), static_cast<int>(line), "is no valid JSON",
                expected);
  }
}

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
struct Wall {
  Eigen::Vector2d begin;
  Eigen::Vector2d direction;
  double angle = 0.0;
  double length = 0.0;
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

}  // namespace

MapTruth ReadMapTruth(const std::string& path) {
  InputStream input(path);
  return ReadMapTruth(&input);
}

MapTruth ReadMapTruth(InputStream* input) {
  const std::string expected = "a truth file of plumbline_simulate";
  const Json json = ParseJson(input, expected);
  const Entry root(input->name(), json, "");
  if (!root.Has("format") || root["format"].Text() != "plumbline-truth")
    root.Refuse("is no truth file", expected);
  if (root["version"].Integer() != 1) {
    root["version"].Refuse("is " + std::to_string(root["version"].Integer()),
                           "1");
  }
  MapTruth truth;
  truth.name = input->name();
  for (const Entry& degrees : root["orientations_deg"].Elements())
    truth.orientations_deg.push_back(degrees.Number());
  for (const Entry& entry : root["walls"].Elements()) {
    TruthWall wall;
    wall.id = static_cast<int>(entry["id"].Integer());
    wall.begin = {entry["x1"].Metres(), entry["y1"].Metres()};
    wall.end = {entry["x2"].Metres(), entry["y2"].Metres()};
    const std::int64_t orientation = entry["orientation"].Integer();
    if (orientation < -1 || orientation >= static_cast<std::int64_t>(
                                               truth.orientations_deg.size())) {
      entry["orientation"].Refuse("is no index into orientations_deg",
                                  "an index or -1");
    }
    wall.orientation = static_cast<int>(orientation);
    for (const Entry& seen : entry["seen"].Elements()) {
      const std::vector<double> ends = seen.Numbers(2);
      if (ends[1] < ends[0])
        seen.Refuse("ends before it begins", "[begin, end]");
      wall.seen.emplace_back(ends[0], ends[1]);
    }
    truth.walls.push_back(wall);
  }
  for (const Entry& entry : root["poses"].Elements()) {
    const std::vector<double> numbers = entry.Numbers(4);
    TimedPose timed;
    timed.timestamp = numbers[0];
    timed.pose = Pose2(numbers[1], numbers[2], numbers[3]);
    if (timed.pose.cwiseAbs().maxCoeff() > kAbsurdCoordinate)
      entry.Refuse("is absurd", "metres and radians within 1e7");
    truth.poses.push_back(timed);
  }
  return truth;
}

StraightMap ReadStraightMap(const std::string& path) {
  InputStream input(path);
  return ReadStraightMap(&input);
}

StraightMap ReadStraightMap(InputStream* input) {
  const Json json = ParseJson(input, "a map.json of plumbline_solve");
  const Entry root(input->name(), json, "");
  if (!root.Has("features"))
    root.Refuse("has no features", "a map.json of plumbline_solve");
  StraightMap map;
  for (const Entry& entry : root["features"].Elements()) {
    const std::string type = entry["type"].Text();
    if (type == "orientation") {
      MapOrientation orientation;
      orientation.id = entry["id"].Integer();
      orientation.angle = entry["parameters"].Numbers(1)[0];
      map.orientations.push_back(orientation);
      continue;
    }
    if (type != "segment" && type != "line") continue;
    MapSegment segment;
    segment.id = entry["id"].Integer();
    if (type == "segment") {
      const std::vector<double> p = entry["parameters"].Numbers(3);
      segment.pose = Pose2(p[0], p[1], p[2]);
    } else {
      // (d, alpha) from the anchor: the foot point is d to the left.
      const std::vector<double> p = entry["parameters"].Numbers(2);
      const std::vector<double> anchor = entry["anchor"].Numbers(2);
      segment.pose = Pose2(anchor[0] - p[0] * std::sin(p[1]),
                           anchor[1] + p[0] * std::cos(p[1]), p[1]);
    }
    const std::vector<double> extent = entry["extent"].Numbers(2);
    segment.begin = std::min(extent[0], extent[1]);
    segment.end = std::max(extent[0], extent[1]);
    if (segment.pose.cwiseAbs().maxCoeff() > kAbsurdCoordinate ||
        segment.end - segment.begin > 1e5)
      entry.Refuse("is absurd", "metres");
    map.segments.push_back(segment);
  }
  ReadClosures(root, &map);
  return map;
}

Pose2 FitRigidTransform(const std::vector<Pose2>& from,
                        const std::vector<Pose2>& to) {
  if (from.size() != to.size() || from.empty()) {
    throw PLUMBLINE_ERROR("poses to align do not pair up",
                          "as many poses on both sides, at least one");
  }
  Eigen::Vector2d from_center = Eigen::Vector2d::Zero();
  Eigen::Vector2d to_center = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    from_center += from[i].head<2>();
    to_center += to[i].head<2>();
  }
  from_center /= static_cast<double>(from.size());
  to_center /= static_cast<double>(to.size());
  double cosine = 0.0;
  double sine = 0.0;
  double heading_cosine = 0.0;
  double heading_sine = 0.0;
  double spread = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector2d a = from[i].head<2>() - from_center;
    const Eigen::Vector2d b = to[i].head<2>() - to_center;
    cosine += a.dot(b);
    sine += a.x() * b.y() - a.y() * b.x();
    spread += b.squaredNorm();
    heading_cosine += std::cos(to[i][2] - from[i][2]);
    heading_sine += std::sin(to[i][2] - from[i][2]);
  }
  // Positions within 10 cm say less about the rotation than headings do.
  const bool in_place = spread <= 0.01 * static_cast<double>(from.size()) ||
                        std::hypot(cosine, sine) == 0.0;
  const double angle = in_place ? std::atan2(heading_sine, heading_cosine)
                                : std::atan2(sine, cosine);
  const Eigen::Vector2d moved =
      TransformPoint(Pose2(0.0, 0.0, angle), from_center);
  return Pose2(to_center.x() - moved.x(), to_center.y() - moved.y(), angle);
}

Pose2 AlignTrajectory(const std::vector<TimedPose>& trajectory,
                      const MapTruth& truth) {
  const TrajectoryIndex index(trajectory);
  std::vector<Pose2> from;
  std::vector<Pose2> to;
  for (const TimedPose& timed : truth.poses) {
    const int match = index.Find(timed.timestamp, 1e-3);
    if (match < 0) continue;
    from.push_back(trajectory[match].pose);
    to.push_back(timed.pose);
  }
  if (from.empty()) {
    throw Error(truth.name, 0,
                "no true pose has the time stamp of a pose of the trajectory",
                "the truth and the trajectory of the same log");
  }
  return FitRigidTransform(from, to);
}

PoseErrors EvaluatePoses(const std::vector<TimedPose>& trajectory,
                         const MapTruth& truth, const Pose2& alignment) {
  const TrajectoryIndex index(trajectory);
  std::vector<double> positions;
  std::vector<double> headings;
  for (const TimedPose& timed : truth.poses) {
    const int match = index.Find(timed.timestamp, 1e-3);
    if (match < 0) continue;
    const Pose2 pose = Compose(alignment, trajectory[match].pose);
    positions.push_back((pose - timed.pose).head<2>().norm());
    headings.push_back(
        std::abs(RadToDeg(NormalizeAngle(pose[2] - timed.pose[2]))));
  }
  return {ComputeStatistics(positions), ComputeStatistics(headings)};
}

MapTruthEvaluation EvaluateMap(const StraightMap& map, const MapTruth& truth,
                               const Pose2& alignment,
                               const MapTruthOptions& options) {
  MapTruthEvaluation evaluation;
  evaluation.alignment = alignment;

  std::vector<Wall> walls;
  for (const TruthWall& truth_wall : truth.walls) {
    Wall wall;
    wall.begin = truth_wall.begin;
    const Eigen::Vector2d along = truth_wall.end - truth_wall.begin;
    wall.length = along.norm();
    wall.direction = wall.length > 0.0 ? Eigen::Vector2d(along / wall.length)
                                       : Eigen::Vector2d(1.0, 0.0);
    wall.angle = std::atan2(wall.direction.y(), wall.direction.x());
    wall.seen = Unite(truth_wall.seen);
    walls.push_back(wall);
  }

  double map_length = 0.0;
  double right_length = 0.0;
  const std::vector<MapSegment> merged = Merged(map);
  std::vector<std::size_t> candidates;
  for (const MapSegment& segment : merged) {
    const Pose2 pose = Compose(alignment, segment.pose);
    const Eigen::Vector2d direction(std::cos(pose[2]), std::sin(pose[2]));
    const double length = segment.end - segment.begin;
    if (!(length > 0.0)) continue;
    const double middle = 0.5 * (segment.begin + segment.end);
    const Eigen::Vector2d center = pose.head<2>() + middle * direction;

    candidates.clear();
    for (std::size_t i = 0; i < walls.size(); ++i) {
      const Wall& wall = walls[i];
      if (std::abs(NormalizeAxial(pose[2] - wall.angle)) >
          DegToRad(options.maximum_angle_deg))
        continue;
      const Eigen::Vector2d wall_center =
          wall.begin + 0.5 * wall.length * wall.direction;
      const double reach = 0.5 * (length + wall.length) + options.end_slack +
                           options.maximum_offset;
      if ((center - wall_center).squaredNorm() <= reach * reach)
        candidates.push_back(i);
    }

    const int samples =
        std::max(1, static_cast<int>(std::ceil(length / kStep)));
    const double step = length / samples;
    double matched = 0.0;
    for (int k = 0; k < samples; ++k) {
      const Eigen::Vector2d point =
          pose.head<2>() + (segment.begin + (k + 0.5) * step) * direction;
      Wall* nearest = nullptr;
      double nearest_offset = options.maximum_offset;
      double nearest_along = 0.0;
      for (const std::size_t i : candidates) {
        Wall& wall = walls[i];
        const Eigen::Vector2d from_begin = point - wall.begin;
        const double along = from_begin.dot(wall.direction);
        if (along < -options.end_slack ||
            along > wall.length + options.end_slack)
          continue;
        const double offset = std::abs(wall.direction.x() * from_begin.y() -
                                       wall.direction.y() * from_begin.x());
        if (offset < nearest_offset ||
            (nearest == nullptr && offset == nearest_offset)) {
          nearest = &wall;
          nearest_offset = offset;
          nearest_along = along;
        }
      }
      if (nearest == nullptr) continue;
      matched += step;
      nearest->covered.emplace_back(nearest_along - 0.5 * step,
                                    nearest_along + 0.5 * step);
      nearest->matched += step;
      const double turn = RadToDeg(NormalizeAxial(pose[2] - nearest->angle));
      nearest->direction_sum += step * std::abs(turn);
      if (length >= options.minimum_length) {
        nearest->long_matched += step;
        nearest->turn_sum += step * turn;
      }
      nearest->offset_sum += step * nearest_offset;
    }
    if (length < options.minimum_length) continue;
    map_length += length;
    right_length += matched;
    if (matched < options.minimum_overlap * length)
      evaluation.false_walls.push_back(segment.id);
  }
  if (map_length > 0.0) evaluation.precision = right_length / map_length;

  double seen_length = 0.0;
  double found_length = 0.0;
  std::vector<double> direction_errors;
  std::vector<double> offset_errors;
  std::set<int> asked_orientations;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    Wall& wall = walls[i];
    WallResult result;
    result.id = truth.walls[i].id;
    result.seen = TotalLength(wall.seen);
    if (result.seen < options.minimum_length) continue;
    if (truth.walls[i].orientation >= 0)
      asked_orientations.insert(truth.walls[i].orientation);
    const auto covered = Unite(wall.covered);
    evaluation.doubled_length += wall.matched - TotalLength(covered);
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
      evaluation.missed_walls.push_back(result.id);
    }
    evaluation.walls.push_back(result);
  }
  if (seen_length > 0.0) evaluation.recall = found_length / seen_length;
  evaluation.direction_error_deg = ComputeStatistics(direction_errors);
  evaluation.offset_error = ComputeStatistics(offset_errors);

  for (std::size_t d = 0; d < truth.orientations_deg.size(); ++d) {
    DirectionResult result;
    result.angle_deg = truth.orientations_deg[d];
    for (std::size_t i = 0; i < walls.size(); ++i) {
      if (truth.walls[i].orientation != static_cast<int>(d)) continue;
      result.length += walls[i].long_matched;
      result.error_deg += walls[i].turn_sum;
    }
    if (!(result.length > 0.0)) continue;
    result.error_deg /= result.length;
    evaluation.directions.push_back(result);
  }
  double directed_length = 0.0;
  for (const DirectionResult& direction : evaluation.directions) {
    directed_length += direction.length;
  }
  for (const DirectionResult& a : evaluation.directions) {
    for (const DirectionResult& b : evaluation.directions) {
      if (std::min(a.length, b.length) < 0.1 * directed_length) continue;
      evaluation.bend_error_deg =
          std::max(evaluation.bend_error_deg, a.error_deg - b.error_deg);
    }
  }

  std::vector<int> matches(truth.orientations_deg.size(), 0);
  for (const MapOrientation& orientation : map.orientations) {
    double degrees = RadToDeg(NormalizeAxial(orientation.angle + alignment[2]));
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
      evaluation.false_orientations_deg.push_back(degrees);
    } else if (matches[nearest]++ > 0) {
      ++evaluation.duplicate_orientations;
    }
  }
  for (const int index : asked_orientations) {
    if (matches[index] == 0)
      evaluation.missed_orientations_deg.push_back(
          truth.orientations_deg[index]);
  }
  return evaluation;
}

}  // namespace plumbline
