#include <plumbline/core/number_text.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/pipeline/plan_placement.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace plumbline {
namespace {

// Points along lines of the plan, along walls in the search, and along walls
// when a place is judged, lie so far apart, m.
constexpr double kLineSpacing = 0.1;
constexpr double kSearchSpacing = 0.4;
constexpr double kJudgeSpacing = 0.5;
// Walls within this of a middle, m, are looked for together; middles lie so far
// apart, m, and there are so many at most.
constexpr double kPartRadius = 12.0;
constexpr double kPartSpacing = 8.0;
constexpr std::size_t kMostParts = 8;
// Parts of fewer points say too little.
constexpr std::size_t kLeastPartPoints = 10;
constexpr double kLeastScore = 0.5;
// They are looked for at turns that give the walls of the map directions of the
// plan: those with this share of what the best turn has, and this much, rad, to
// either side.
constexpr double kSameDirection = DegToRad(15.0);
constexpr double kTurnShare = 0.25;
constexpr double kTurnWindow = DegToRad(3.0);
constexpr double kScoreShare = 0.8;
constexpr int kMostPeaks = 8;
// A wall lies on a line within this, m and rad; and while a place is refined,
// from far to near.
constexpr double kAgreeDistance = 0.15;
constexpr double kAgreeAngle = DegToRad(5.0);
constexpr double kRefineDistances[] = {0.8, 0.5, 0.3, 0.3, 0.2, 0.2};
// Two places of the plan are one when they are so near, m and rad.
constexpr double kSamePlace = 1.5;
constexpr double kSameTurn = DegToRad(8.0);
// A place that is found again, from another part: m and rad.
constexpr double kKnownDistance = 0.4;
constexpr double kKnownTurn = DegToRad(2.0);
// Directions of agreeing walls have to differ by this, rad.
constexpr double kLeastSpread = DegToRad(25.0);
// Lines reach so far beyond their ends, m.
constexpr double kOverhang = 0.2;
// Walls are in the plan's part of the building within this of a box around its
// lines, m.
constexpr double kAroundPlan = 0.5;
// Where so much of the walls agrees the plan is not drawn mirrored.
constexpr double kClearShare = 0.75;
// Units that a drawing may have in place of the one that it says: millimetres,
// centimetres, inches or feet for metres, one of them for another, and the
// other way round. They are looked for where they make the plan between so
// large and so large, in sizes of the map.
constexpr double kUnitRatios[] = {1000.0, 100.0, 39.37, 25.4,
                                  12.0,   10.0,  3.281, 2.54};
constexpr double kLeastSizeRatio = 0.5;
constexpr double kMostSizeRatio = 4.0;
// No building has more lines, m; and the search takes memory with them.
constexpr double kMostLineLength = 1e5;

// Difference of two directions without sense, in [0, pi/2].
double AngleBetween(double a, double b) {
  return std::abs(NormalizeAxial(a - b));
}

// Lengths and angles in notes.
std::string Fixed(double value, int decimals) {
  std::string text;
  AppendFixed(value, decimals, &text);
  return text;
}

// The line nearest to a point of a wall, plan frame, that has its direction
// within `max_angle`; -1 for none within `max_distance`.
int NearestLine(const std::vector<Wall>& lines, const Eigen::Vector2d& point,
                double direction, double max_distance, double max_angle,
                double* distance) {
  int nearest = -1;
  double least = max_distance;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Wall& line = lines[i];
    const double across = line.Across(point);
    if (std::abs(across) >= least ||
        std::abs(line.Along(point)) > line.end + kOverhang ||
        AngleBetween(direction, line.angle) > max_angle) {
      continue;
    }
    least = std::abs(across);
    nearest = static_cast<int>(i);
    *distance = across;
  }
  return nearest;
}

// A point of a wall, map frame, and the wall's direction.
struct WallPoint {
  Eigen::Vector2d position;
  double direction;
  // Every direction that walls have counts the same: along a corridor walls
  // agree wherever the plan lies.
  double weight;
};

void WeighByDirection(std::vector<WallPoint>* points) {
  const auto count_near = [points](double direction) {
    return std::count_if(
        points->begin(), points->end(), [direction](const WallPoint& other) {
          return AngleBetween(direction, other.direction) < kSameDirection;
        });
  };
  // A direction of next to nothing does not decide.
  const double least = 0.05 * static_cast<double>(points->size());
  for (WallPoint& point : *points) {
    point.weight =
        1.0 / std::max(least, static_cast<double>(count_near(point.direction)));
  }
}

// Turns of the map, rad, that give most of its walls a direction of the plan,
// both ways round.
std::vector<double> TurnsOf(const std::vector<WallPoint>& points,
                            const std::vector<Wall>& lines) {
  constexpr int kBins = 180;
  const auto bin_of = [](double angle) {
    const double share = angle / kPi - std::floor(angle / kPi);
    return static_cast<int>(share * kBins) % kBins;
  };
  // The plan's a little blurred.
  std::vector<double> of_plan(kBins, 0.0);
  std::vector<double> of_map(kBins, 0.0);
  for (const Wall& line : lines) {
    for (int k = -2; k <= 2; ++k) {
      of_plan[static_cast<std::size_t>((bin_of(line.angle) + k + kBins) %
                                       kBins)] += line.end / (1 + std::abs(k));
    }
  }
  for (const WallPoint& point : points) {
    of_map[static_cast<std::size_t>(bin_of(point.direction))] += 1.0;
  }
  std::vector<double> sums(kBins, 0.0);
  for (int shift = 0; shift < kBins; ++shift) {
    for (int k = 0; k < kBins; ++k) {
      sums[static_cast<std::size_t>(shift)] +=
          of_map[static_cast<std::size_t>(k)] *
          of_plan[static_cast<std::size_t>((k + shift) % kBins)];
    }
  }
  const double most = *std::max_element(sums.begin(), sums.end());
  std::vector<double> turns;
  for (int shift = 0; shift < kBins; ++shift) {
    bool is_peak = sums[static_cast<std::size_t>(shift)] >= kTurnShare * most;
    for (int k = 1; k <= 3; ++k) {
      const double left =
          sums[static_cast<std::size_t>((shift - k + kBins) % kBins)];
      const double right = sums[static_cast<std::size_t>((shift + k) % kBins)];
      is_peak = is_peak && sums[static_cast<std::size_t>(shift)] > left &&
                sums[static_cast<std::size_t>(shift)] >= right;
    }
    if (!is_peak) continue;
    turns.push_back(NormalizeAngle(shift * kPi / kBins));
    turns.push_back(NormalizeAngle(shift * kPi / kBins + kPi));
  }
  return turns;
}

// Moves the pose of the map in the plan to where points lie on lines.
Pose2 Refined(const std::vector<WallPoint>& points,
              const std::vector<Wall>& lines, Pose2 pose) {
  for (const double reach : kRefineDistances) {
    Eigen::Matrix3d information = 1e-6 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    const PoseTransform transform(pose);
    for (const WallPoint& point : points) {
      const Eigen::Vector2d position = transform.Point(point.position);
      double offset = 0.0;
      const int line = NearestLine(lines, position, point.direction + pose[2],
                                   reach, kAgreeAngle, &offset);
      if (line < 0) continue;
      const double theta = lines[static_cast<std::size_t>(line)].angle;
      const Eigen::Vector2d normal(-std::sin(theta), std::cos(theta));
      const Eigen::Vector2d arm = position - pose.head<2>();
      const Eigen::Vector3d row(normal.x(), normal.y(),
                                normal.dot(Eigen::Vector2d(-arm.y(), arm.x())));
      const double weight = 1.0 / (1.0 + std::pow(offset / 0.1, 2));
      information += weight * row * row.transpose();
      gradient += weight * offset * row;
    }
    pose -= information.ldlt().solve(gradient);
    pose[2] = NormalizeAngle(pose[2]);
  }
  return pose;
}

// Points along the lines of the plan, as a reference to search in.
std::vector<ScanPoint> SamplesOf(const std::vector<Wall>& lines) {
  std::vector<ScanPoint> samples;
  for (const Wall& line : lines) {
    const PoseTransform transform(line.pose());
    const int steps = static_cast<int>(2.0 * line.end / kLineSpacing);
    for (int k = 0; k <= steps; ++k) {
      ScanPoint point;
      point.position =
          transform.Point(Eigen::Vector2d(-line.end + k * kLineSpacing, 0.0));
      point.normal = transform.Direction(Eigen::Vector2d(0.0, 1.0));
      point.range = 1.0;
      point.beam = 0;
      samples.push_back(point);
    }
  }
  return samples;
}

// Points along the walls of the map, by which places of the plan are judged.
std::vector<WallPoint> PointsOn(const std::vector<Wall>& walls) {
  std::vector<WallPoint> points;
  for (const Wall& wall : walls) {
    const int steps =
        std::max(1, static_cast<int>(wall.length() / kJudgeSpacing));
    for (int k = 0; k < steps; ++k) {
      points.push_back({wall.At(wall.begin + (k + 0.5) * wall.length() / steps),
                        wall.angle, 0.0});
    }
  }
  WeighByDirection(&points);
  return points;
}

// Middles of the longest walls, some way apart: parts of the map lie around
// them.
std::vector<Eigen::Vector2d> PartMiddles(std::vector<Wall> walls) {
  std::stable_sort(
      walls.begin(), walls.end(),
      [](const Wall& a, const Wall& b) { return a.length() > b.length(); });
  std::vector<Eigen::Vector2d> middles;
  for (const Wall& wall : walls) {
    const Eigen::Vector2d middle = wall.Middle();
    const bool is_apart = std::all_of(
        middles.begin(), middles.end(), [&](const Eigen::Vector2d& other) {
          return (other - middle).norm() >= kPartSpacing;
        });
    if (is_apart && middles.size() < kMostParts) middles.push_back(middle);
  }
  return middles;
}

// Points of the walls around a middle, seen from there.
std::vector<Eigen::Vector2d> PartAround(const Eigen::Vector2d& middle,
                                        const std::vector<Wall>& walls) {
  std::vector<Eigen::Vector2d> part;
  for (const Wall& wall : walls) {
    for (double s = wall.begin; s <= wall.end; s += kSearchSpacing) {
      const Eigen::Vector2d point = wall.At(s) - middle;
      if (point.norm() <= kPartRadius) part.push_back(point);
    }
  }
  return part;
}

// A box around points.
struct Box {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300);
  Eigen::Vector2d high = Eigen::Vector2d::Constant(-1e300);

  explicit Box(const std::vector<Wall>& walls) {
    for (const Wall& wall : walls) {
      for (const double end : {wall.begin, wall.end}) {
        low = low.cwiseMin(wall.At(end));
        high = high.cwiseMax(wall.At(end));
      }
    }
  }
  double size() const { return (high - low).norm(); }
  bool Has(const Eigen::Vector2d& point) const {
    return ((point - low).array() >= -kAroundPlan).all() &&
           ((high - point).array() >= -kAroundPlan).all();
  }
};

// A place of the map in the plan.
struct Place {
  Pose2 pose = Pose2::Zero();
  // Length of walls that lie on lines, m, and the largest angle between these.
  double agreeing = 0.0;
  double spread = 0.0;
  // Length of walls that lie where the plan is, m.
  double inside = 0.0;
  // That length with its weights.
  double score = 0.0;
};

Place Judged(const std::vector<WallPoint>& points,
             const std::vector<Wall>& lines, const Pose2& pose) {
  Place place;
  place.pose = pose;
  const Box box(lines);
  const PoseTransform transform(place.pose);
  double first = 0.0;
  for (const WallPoint& point : points) {
    const Eigen::Vector2d position = transform.Point(point.position);
    if (box.Has(position)) place.inside += kJudgeSpacing;
    double offset = 0.0;
    if (NearestLine(lines, position, point.direction + place.pose[2],
                    kAgreeDistance, kAgreeAngle, &offset) < 0) {
      continue;
    }
    if (place.agreeing == 0.0) first = point.direction;
    place.spread = std::max(place.spread, AngleBetween(first, point.direction));
    place.agreeing += kJudgeSpacing;
    place.score += point.weight;
  }
  return place;
}

// Whether one of the places puts the middle of a part where a peak does.
bool IsKnown(const std::vector<Place>& places, const Eigen::Vector2d& middle,
             const Pose2& peak) {
  return std::any_of(places.begin(), places.end(), [&](const Place& other) {
    const Eigen::Vector2d there = PoseTransform(other.pose).Point(middle);
    return (there - peak.head<2>()).norm() < kKnownDistance &&
           std::abs(NormalizeAngle(other.pose[2] - peak[2])) < kKnownTurn;
  });
}

// Searches for parts of a map among the lines of a plan.
class PartSearch {
 public:
  PartSearch(const std::vector<Wall>& lines,
             const std::vector<WallPoint>& points,
             const std::function<bool()>& stop)
      : matcher_(MatcherOptions()),
        turns_(TurnsOf(points, lines)),
        stop_(stop) {
    std::vector<ScanPoint> samples = SamplesOf(lines);
    Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300);
    Eigen::Vector2d high = -low;
    for (const ScanPoint& sample : samples) {
      low = low.cwiseMin(sample.position);
      high = high.cwiseMax(sample.position);
    }
    center_ = 0.5 * (low + high);
    window_ = 0.5 * (high - low).maxCoeff() + 2.0;
    matcher_.SetReference(std::move(samples));
  }

  // Middle of the plan.
  const Eigen::Vector2d& center() const { return center_; }

  // Poses of a part in the plan.
  std::vector<Pose2> Find(const std::vector<Eigen::Vector2d>& part) const {
    std::vector<Pose2> poses;
    for (const double turn : turns_) {
      for (const ScoredPose& peak :
           matcher_.Peaks(part, Pose2(center_.x(), center_.y(), turn), window_,
                          kTurnWindow, kLeastScore, kScoreShare, kMostPeaks,
                          std::numeric_limits<double>::infinity(), stop_)) {
        poses.push_back(peak.pose);
      }
    }
    return poses;
  }

 private:
  // Nothing in a plan is a wild return.
  static ScanMatcherOptions MatcherOptions() {
    ScanMatcherOptions options;
    options.reference_reach = 250.0;
    return options;
  }

  ScanMatcher matcher_;
  std::vector<double> turns_;
  std::function<bool()> stop_;
  // Middle of the plan, and how far the search goes from there.
  Eigen::Vector2d center_;
  double window_;
};

// Drops places that are not near the pose of the plan that is known. They are
// told apart by where the middle of the plan lies in the map.
void KeepNearPose(const KnownStructure& known, const Eigen::Vector2d& center,
                  std::vector<Place>* places) {
  const Pose2& guess = *known.plan_pose;
  const Eigen::Vector2d expected = PoseTransform(guess).Point(center);
  const auto is_far = [&](const Place& place) {
    const Pose2 pose = Inverse(place.pose);
    const Eigen::Vector2d moved = PoseTransform(pose).Point(center) - expected;
    return moved.norm() > known.max_pose_offset ||
           std::abs(NormalizeAngle(pose[2] - guess[2])) > known.max_pose_turn;
  };
  places->erase(std::remove_if(places->begin(), places->end(), is_far),
                places->end());
}

// Places of the map where one of its parts fits the plan, near the plan's pose
// where that is known, the one with the highest score first; none once `stop`
// has returned true.
std::vector<Place> FindPlaces(const KnownStructure& known,
                              const std::vector<Wall>& walls,
                              const std::vector<WallPoint>& points,
                              const std::vector<Eigen::Vector2d>& middles,
                              const std::vector<Wall>& lines,
                              const std::function<bool()>& stop) {
  const PartSearch search(lines, points, stop);
  std::vector<Place> places;
  const auto keep = [&](const Pose2& pose) {
    places.push_back(Judged(points, lines, Refined(points, lines, pose)));
  };
  if (known.plan_pose) keep(Inverse(*known.plan_pose));
  for (const Eigen::Vector2d& middle : middles) {
    if (stop && stop()) return {};
    const std::vector<Eigen::Vector2d> part = PartAround(middle, walls);
    if (part.size() < kLeastPartPoints) continue;
    for (const Pose2& peak : search.Find(part)) {
      if (stop && stop()) return {};
      if (IsKnown(places, middle, peak)) continue;
      keep(Compose(peak, Pose2(-middle.x(), -middle.y(), 0.0)));
    }
  }
  if (known.plan_pose) KeepNearPose(known, search.center(), &places);
  std::stable_sort(
      places.begin(), places.end(),
      [](const Place& a, const Place& b) { return a.score > b.score; });
  return places;
}

// Whether so much agrees at a place that it is to be believed, of all walls of
// this length, m, or of those in the part of the building that the plan is of.
bool IsEnough(const KnownStructure& known, const Place& place, double length) {
  return place.spread >= kLeastSpread &&
         ((place.agreeing >= known.min_agreeing_length &&
           place.agreeing >= known.min_agreeing_share * length) ||
          (place.agreeing >= known.min_agreeing_length_of_part &&
           place.agreeing >= known.min_agreeing_share_of_part * place.inside));
}

// Why the best of these places is not to be believed; empty when it is.
// `length`: of all walls, m; `middle`: of a part of the map.
std::string WhyRefused(const KnownStructure& known,
                       const std::vector<Place>& places, double length,
                       const Eigen::Vector2d& middle) {
  if (places.empty() || !IsEnough(known, places.front(), length)) {
    return "the plan is not used: " +
           Fixed(places.empty() ? 0.0 : places.front().agreeing, 1) + " m of " +
           Fixed(length, 1) +
           " m of walls agree with it at the best place, too little or all of "
           "one direction" +
           (known.plan_pose ? " (near the pose that was given)" : "");
  }
  const Place& best = places.front();
  for (const Place& rival : places) {
    // Where the middle of the map lies tells them apart.
    const Eigen::Vector2d moved = PoseTransform(rival.pose).Point(middle) -
                                  PoseTransform(best.pose).Point(middle);
    const double turn = std::abs(NormalizeAngle(rival.pose[2] - best.pose[2]));
    if (moved.norm() < kSamePlace && turn < kSameTurn) continue;
    if (rival.score < known.rival_share * best.score) continue;
    const Pose2 pose = Inverse(best.pose);
    return "the plan is not used: it fits in two places, " +
           Fixed(moved.norm(), 2) + " m and " + Fixed(RadToDeg(turn), 1) +
           " degrees apart, with " + Fixed(best.agreeing, 1) + " m and " +
           Fixed(rival.agreeing, 1) +
           " m of walls (--plan_pose=" + Fixed(pose[0], 2) + "," +
           Fixed(pose[1], 2) + "," + Fixed(RadToDeg(pose[2]), 1) +
           " names the first)";
  }
  return {};
}

double MedianLength(const std::vector<Wall>& lines) {
  std::vector<double> lengths;
  for (const Wall& line : lines) lengths.push_back(line.length());
  const auto middle =
      lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

double TotalLength(const std::vector<Wall>& walls) {
  double length = 0.0;
  for (const Wall& wall : walls) length += wall.length();
  return length;
}

PlanPlacement Placed(const Place& place, double length) {
  return {place.pose, "the plan agrees with " + Fixed(place.agreeing, 1) +
                          " m of " + Fixed(length, 1) +
                          " m of walls where it is placed"};
}

// A plan in another unit, or its mirror image.
std::vector<PlanLine> Redrawn(std::vector<PlanLine> plan, double scale,
                              bool is_mirrored) {
  for (PlanLine& line : plan) {
    for (Eigen::Vector2d* end : {&line.begin, &line.end}) {
      *end *= scale;
      if (is_mirrored) end->x() = -end->x();
    }
  }
  return plan;
}

}  // namespace

Wall MakePlanWall(const PlanLine& line) {
  const Eigen::Vector2d along = line.end - line.begin;
  const double length = along.norm();
  return {0.5 * (line.begin + line.end), std::atan2(along.y(), along.x()),
          along / length, -0.5 * length, 0.5 * length};
}

PlanPlacement PlacePlan(const KnownStructure& known,
                        const std::vector<Wall>& walls,
                        const std::function<bool()>& stop) {
  std::vector<Wall> lines;
  for (const PlanLine& line : known.plan) lines.push_back(MakePlanWall(line));
  if (walls.empty() || lines.empty()) {
    return {std::nullopt,
            "the plan is not used: there are no walls to compare"};
  }
  const double length = TotalLength(walls);
  const std::vector<Eigen::Vector2d> middles = PartMiddles(walls);
  const std::vector<WallPoint> points = PointsOn(walls);
  const double size = Box(lines).size();
  const double map_size = Box(walls).size();
  std::vector<Place> places;
  std::string why;
  const double usual_length = MedianLength(lines);
  const double line_length = TotalLength(lines);
  const bool is_absurd =
      usual_length > map_size || line_length > kMostLineLength;
  if (usual_length > map_size) {
    why = "the plan is not used: half of its lines are longer than " +
          Fixed(usual_length, 1) + " m, and the whole map is only " +
          Fixed(map_size, 1) + " m large";
  } else if (is_absurd) {
    why = "the plan is not used: it has " + Fixed(1e-3 * line_length, 0) +
          " km of lines, and the whole map is only " + Fixed(map_size, 1) +
          " m large";
  } else {
    places = FindPlaces(known, walls, points, middles, lines, stop);
    why = WhyRefused(known, places, length, middles.front());
  }
  if (stop && stop()) return {};
  if (why.empty() && places.front().agreeing >= kClearShare * length) {
    return Placed(places.front(), length);
  }
  // What it would be if it were drawn otherwise. Where that lies nobody said.
  KnownStructure other = known;
  other.plan_pose.reset();
  const auto places_of = [&](double scale, bool is_mirrored) {
    other.plan = Redrawn(known.plan, scale, is_mirrored);
    std::vector<Wall> redrawn;
    for (const PlanLine& line : other.plan) {
      redrawn.push_back(MakePlanWall(line));
    }
    return FindPlaces(other, walls, points, middles, redrawn, stop);
  };
  if (!is_absurd) {
    const std::vector<Place> mirrored = places_of(1.0, true);
    if (stop && stop()) return {};
    if (WhyRefused(other, mirrored, length, middles.front()).empty() &&
        (places.empty() ||
         known.rival_share * mirrored.front().score > places.front().score)) {
      return {std::nullopt,
              "the plan is not used: its mirror image agrees with " +
                  Fixed(mirrored.front().agreeing, 1) + " m of " +
                  Fixed(length, 1) + " m of walls, and the plan itself with " +
                  Fixed(places.empty() ? 0.0 : places.front().agreeing, 1) +
                  " m: it is drawn mirrored"};
    }
  }
  if (why.empty()) return Placed(places.front(), length);
  for (const double ratio : kUnitRatios) {
    for (const double scale : {1.0 / ratio, ratio}) {
      if (size * scale < kLeastSizeRatio * map_size ||
          size * scale > kMostSizeRatio * map_size ||
          line_length * scale > kMostLineLength) {
        continue;
      }
      const std::vector<Place> scaled = places_of(scale, false);
      if (stop && stop()) return {};
      if (!WhyRefused(other, scaled, length, middles.front()).empty()) continue;
      return {std::nullopt,
              why + "; " +
                  (scale < 1.0 ? Fixed(ratio, 2) + " times smaller"
                               : Fixed(ratio, 2) + " times larger") +
                  " it agrees with " + Fixed(scaled.front().agreeing, 1) +
                  " m: the drawing's unit ($INSUNITS) is another one"};
    }
  }
  return {std::nullopt, why};
}

}  // namespace plumbline
