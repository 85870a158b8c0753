#include <plumbline/core/wall.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/rectangle.h>
#include <plumbline/detectors/rectangle_fit.h>
#include <plumbline/detectors/visible_wall.h>
#include <plumbline/detectors/wall_corners.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

namespace plumbline {
namespace {

constexpr char kName[] = "rectangle";
// Two rectangles with more than this part of the smaller one in common overlap.
constexpr double kOverlap = 0.1;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// One call of Detect.
class RectangleSearch {
 public:
  RectangleSearch(const RectangleOptions& options,
                  std::vector<VisibleWall> walls)
      : options_(options),
        walls_(std::move(walls)),
        grid_(std::max(options.corner_gap, options.max_opening)) {
    for (int i = 0; i < size(); ++i) grid_.Add(i, wall(i), Reach());
  }

  // Rectangles that are there, with the walls that they have.
  void AddExisting(WalledRectangle rectangle) {
    rectangles_.push_back(std::move(rectangle));
    Index(static_cast<int>(rectangles_.size()) - 1);
  }

  // Lets walls join what is there and adds what is found.
  const std::vector<WalledRectangle>& Run(const DetectionScope& scope) {
    for (std::size_t i = 0; i < rectangles_.size(); ++i) {
      Join(&rectangles_[i]);
      Index(static_cast<int>(i));
    }
    WallCornerOptions corner_options;
    corner_options.corner_gap = options_.corner_gap;
    corner_options.max_opening = options_.max_opening;
    corner_options.gate = options_.gate;
    corner_options.gate_angle = options_.gate_angle;
    const WallCorners corners(walls_, grid_, Reach(), corner_options);
    std::int64_t known = 0;
    for (WalledRectangle& candidate : Candidates(corners, scope)) {
      if (IsKnown(candidate)) {
        ++known;
        continue;
      }
      rectangles_.push_back(std::move(candidate));
      Index(static_cast<int>(rectangles_.size()) - 1);
    }
    scope.Count("walls", size());
    scope.Count("corners", corners.size());
    scope.Count("rectangles", tried_);
    scope.Count("rectangles refused: size", wrong_size_);
    scope.Count("rectangles refused: walls not on the sides", not_on_sides_);
    scope.Count("rectangles refused: sides not covered", not_covered_);
    scope.Count("rectangles refused: there already", known);
    return rectangles_;
  }

 private:
  int size() const { return static_cast<int>(walls_.size()); }
  const VisibleWall& wall(int i) const {
    return walls_[static_cast<std::size_t>(i)];
  }
  // Past its ends a wall may meet another or go on as another.
  double Reach() const {
    return std::max(options_.corner_gap, 0.5 * options_.max_opening);
  }

  // Enters a rectangle's walls into the list by feature.
  void Index(int rectangle) {
    const WalledRectangle& r = rectangles_[static_cast<std::size_t>(rectangle)];
    for (int side = 0; side < WalledRectangle::kNumSides; ++side) {
      for (const WalledRectangle::Member& member :
           r.sides[static_cast<std::size_t>(side)]) {
        by_feature_[member.feature->id].insert({rectangle, side});
      }
    }
  }

  // Adds walls that lie on the sides, the longest first, to those that are
  // there: what runs beside one of them is another face of the wall.
  void Join(WalledRectangle* rectangle) const {
    for (int side = 0; side < WalledRectangle::kNumSides; ++side) {
      std::vector<WalledRectangle::Member>& members =
          rectangle->sides[static_cast<std::size_t>(side)];
      VisibleWall line;
      line.middle = rectangle->Middle(side);
      line.direction = rectangle->Direction(side);
      line.half_length = rectangle->HalfLength(side);
      std::vector<std::pair<double, int>> by_length;
      for (const int i : grid_.Near(line, 0.0)) {
        by_length.emplace_back(-wall(i).half_length, i);
      }
      std::sort(by_length.begin(), by_length.end());
      for (const auto& entry : by_length) {
        const VisibleWall& candidate = wall(entry.second);
        const std::optional<Interval> interval = IntervalOnSide(
            candidate, *rectangle, side, options_.gate, options_.gate_angle);
        if (!interval) continue;
        if (std::any_of(members.begin(), members.end(),
                        [&](const WalledRectangle::Member& member) {
                          return member.feature == candidate.feature ||
                                 RunsBeside(member.interval, *interval);
                        })) {
          continue;
        }
        members.push_back({candidate.feature, *interval, true});
      }
    }
  }

  // Whether walls cover enough of the side and meet the next ones.
  bool IsCovered(const WalledRectangle& rectangle, int side) const {
    const double half = rectangle.HalfLength(side);
    std::vector<Interval> intervals;
    for (const WalledRectangle::Member& member :
         rectangle.sides[static_cast<std::size_t>(side)]) {
      intervals.push_back(member.interval);
    }
    std::sort(intervals.begin(), intervals.end());
    double end = -half;
    double covered = 0.0;
    for (const auto& [begin, its_end] : intervals) {
      const double opening = begin - end;
      if (opening > (end == -half ? options_.corner_gap : options_.max_opening))
        return false;
      const double first = std::max(begin, end);
      const double last = std::min(its_end, half);
      if (last > first) covered += last - first;
      end = std::max(end, last);
    }
    return half - end <= options_.corner_gap &&
           covered >= 2.0 * half * options_.min_coverage;
  }

  // Rectangles that could be, the smallest first.
  std::vector<WalledRectangle> Candidates(const WallCorners& corners,
                                          const DetectionScope& scope) {
    std::vector<WalledRectangle> candidates;
    for (int at = 0; at < corners.size(); ++at) {
      if (scope.ShouldStop()) return {};
      const WallCorner& a = corners.corner(at);
      for (const int i : {a.first, a.second}) {
        const int j = a.Other(i);
        const auto along_j =
            corners.Along(at, j, options_.min_side, options_.max_side);
        for (const auto& [next, i2] :
             corners.Along(at, i, options_.min_side, options_.max_side)) {
          // Each set of four is looked at from its first corner only.
          if (next < at) continue;
          const WallCorner& b = corners.corner(next);
          for (const auto& [last, j2] : along_j) {
            if (last < at) continue;
            const WallCorner& d = corners.corner(last);
            // Counterclockwise.
            if (Cross(b.position - a.position, d.position - a.position) <=
                0.0) {
              continue;
            }
            Close(corners, at, {i, i2}, b.Other(i2), d.Other(j2), {j, j2},
                  &candidates);
          }
        }
      }
    }
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [](const WalledRectangle& first, const WalledRectangle& second) {
          return first.area() < second.area();
        });
    return candidates;
  }

  // Looks for the fourth corner, on the walls k and l or in line with them, and
  // adds the rectangle.
  void Close(const WallCorners& corners, int at,
             const std::pair<int, int>& bottom, int k, int l,
             const std::pair<int, int>& left,
             std::vector<WalledRectangle>* candidates) {
    for (const int k2 : corners.InLineWith(k)) {
      for (const int l2 : corners.InLineWith(l)) {
        if (corners.Between(k2, l2) < at) continue;
        const auto list = [&](int first, int second) {
          std::vector<const VisibleWall*> walls = {&wall(first)};
          if (second != first) walls.push_back(&wall(second));
          return walls;
        };
        WalledRectangle rectangle =
            FitRectangle({list(bottom.first, bottom.second), list(k, k2),
                          list(l, l2), list(left.first, left.second)});
        if (Complete(&rectangle)) candidates->push_back(std::move(rectangle));
      }
    }
  }

  // Checks the walls that it was fitted to and adds others on its sides; false
  // when it is none.
  bool Complete(WalledRectangle* rectangle) {
    ++tried_;
    if (2.0 * std::min(rectangle->a, rectangle->b) < options_.min_side ||
        2.0 * std::max(rectangle->a, rectangle->b) > options_.max_side) {
      ++wrong_size_;
      return false;
    }
    for (int side = 0; side < WalledRectangle::kNumSides; ++side) {
      for (WalledRectangle::Member& member :
           rectangle->sides[static_cast<std::size_t>(side)]) {
        const std::optional<Interval> interval =
            IntervalOnSide(*VisiblePartOf(*member.feature), *rectangle, side,
                           options_.gate, options_.gate_angle);
        if (!interval) {
          ++not_on_sides_;
          return false;
        }
        member.interval = *interval;
      }
    }
    Join(rectangle);
    for (int side = 0; side < WalledRectangle::kNumSides; ++side) {
      if (!IsCovered(*rectangle, side)) {
        ++not_covered_;
        return false;
      }
    }
    return true;
  }

  // Whether a rectangle that is there overlaps it and has two sides in common
  // with it.
  bool IsKnown(const WalledRectangle& candidate) const {
    // Sides of the candidate that each rectangle has.
    std::map<int, std::set<int>> common;
    for (int side = 0; side < WalledRectangle::kNumSides; ++side) {
      for (const WalledRectangle::Member& member :
           candidate.sides[static_cast<std::size_t>(side)]) {
        const auto found = by_feature_.find(member.feature->id);
        if (found == by_feature_.end()) continue;
        for (const auto& [other, its_side] : found->second) {
          const WalledRectangle& rectangle =
              rectangles_[static_cast<std::size_t>(other)];
          if (candidate.Normal(side).dot(rectangle.Normal(its_side)) > 0.0) {
            common[other].insert(side);
          }
        }
      }
    }
    return std::any_of(common.begin(), common.end(), [&](const auto& entry) {
      const WalledRectangle& rectangle =
          rectangles_[static_cast<std::size_t>(entry.first)];
      return entry.second.size() >= 2 &&
             CommonArea(candidate, rectangle) >
                 kOverlap * std::min(candidate.area(), rectangle.area());
    });
  }

  const RectangleOptions& options_;
  std::vector<VisibleWall> walls_;
  VisibleWallGrid grid_;
  std::vector<WalledRectangle> rectangles_;
  // Rectangles and their sides that a feature is on.
  std::map<FeatureId, std::set<std::pair<int, int>>> by_feature_;
  // What was tried and refused.
  std::int64_t tried_ = 0;
  std::int64_t wrong_size_ = 0;
  std::int64_t not_on_sides_ = 0;
  std::int64_t not_covered_ = 0;
};

// The side that a live constraint ties a wall to; -1 when it does not.
int SideOf(const Constraint& constraint) {
  if (constraint.state != ConstraintState::kLive ||
      constraint.kind != ConstraintClass::kStructure ||
      !constraint.type->Is(RelationRole::kSide)) {
    return -1;
  }
  for (int side = 0; side < WalledRectangle::kNumSides; ++side) {
    const double difference =
        constraint.expected[1] -
        WalledRectangle::kSides[static_cast<std::size_t>(side)];
    if (std::abs(NormalizeAngle(difference)) < 0.25 * kPi) return side;
  }
  return -1;
}

WalledRectangle ReadRectangle(const Graph& graph, const Feature& feature) {
  WalledRectangle rectangle;
  rectangle.id = feature.id;
  rectangle.center = {feature.parameters[0], feature.parameters[1]};
  rectangle.theta = feature.parameters[2];
  rectangle.a = feature.parameters[3];
  rectangle.b = feature.parameters[4];
  for (const ConstraintId id : graph.ConstraintsOf(feature.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    const int side = SideOf(constraint);
    if (side < 0) continue;
    const Feature& support = graph.GetFeature(constraint.features[0]);
    const std::optional<VisibleWall> wall = VisiblePartOf(support);
    if (!wall) continue;
    rectangle.sides[static_cast<std::size_t>(side)].push_back(
        {&support,
         IntervalAlong(*wall, rectangle.Middle(side),
                       rectangle.Direction(side)),
         false});
  }
  return rectangle;
}

void Bind(ParameterBinder* parameters, RectangleOptions* options) {
  ParameterBinder& p = *parameters;
  constexpr double kNoLimit = ParameterBinder::kNoLimit;
  p.Length("sigma", &options->sigma, 1e-6, kNoLimit,
           "tolerance of a wall across its side");
  p.Angle("sigma_deg", &options->sigma_angle, 1e-6, 90.0,
          "tolerance of its direction");
  p.Length("gate", &options->gate, 1e-6, kNoLimit,
           "how near to a side a wall is on it");
  p.Angle("gate_deg", &options->gate_angle, 1e-6, 40.0,
          "the same in direction, and how square a corner is");
  p.Length("min_length", &options->min_length, 0.0, kNoLimit,
           "shortest wall that is looked at");
  p.Length("corner_gap", &options->corner_gap, 1e-3, kNoLimit,
           "how near to a corner walls on both sides of it begin");
  p.Number("min_coverage", &options->min_coverage, 0.0, 1.0, "",
           "least part of each side that walls cover");
  p.Length("max_opening", &options->max_opening, 0.0, kNoLimit,
           "widest opening between two walls of a side");
  p.Length("min_side", &options->min_side, 1e-3, kNoLimit, "shortest side");
  p.Length("max_side", &options->max_side, options->min_side, kNoLimit,
           "longest side");
}

}  // namespace

RectangleDetector::RectangleDetector(const RectangleOptions& options)
    : options_(options) {}

const std::string& RectangleDetector::name() const {
  static const std::string name = kName;
  return name;
}

bool RectangleDetector::IsSupported(
    const std::vector<const Constraint*>& support) const {
  std::set<int> sides;
  for (const Constraint* constraint : support) {
    sides.insert(SideOf(*constraint));
  }
  sides.erase(-1);
  return sides.size() == static_cast<std::size_t>(WalledRectangle::kNumSides);
}

Transaction RectangleDetector::Detect(const Graph& graph,
                                      const Registry& registry,
                                      const DetectionScope& scope) const {
  std::vector<VisibleWall> walls;
  for (const Feature* feature : FeaturesInScope(graph, scope)) {
    const std::optional<VisibleWall> wall = VisiblePartOf(*feature);
    if (wall && 2.0 * wall->half_length >= options_.min_length) {
      walls.push_back(*wall);
    }
  }
  Transaction transaction;
  if (walls.empty()) return transaction;

  const FeatureType& rectangle_type = registry.GetFeature("rectangle");
  RectangleSearch search(options_, std::move(walls));
  for (const FeatureId id : graph.VirtualFeatures(scope.level + 1)) {
    const Feature& feature = graph.GetFeature(id);
    if (!feature.type->Is(FeatureRole::kRectangle)) continue;
    WalledRectangle rectangle = ReadRectangle(graph, feature);
    if (rectangle.center.allFinite() && std::isfinite(rectangle.theta) &&
        rectangle.a > 0.0 && rectangle.b > 0.0 &&
        std::max(rectangle.a, rectangle.b) <= options_.max_side) {
      search.AddExisting(std::move(rectangle));
    }
  }
  for (const WalledRectangle& rectangle : search.Run(scope)) {
    FeatureId id = rectangle.id;
    if (id == kNoId) {
      Feature feature;
      feature.type = &rectangle_type;
      feature.level = scope.level + 1;
      feature.is_virtual = true;
      feature.parameters = {rectangle.center.x(), rectangle.center.y(),
                            rectangle.theta, rectangle.a, rectangle.b};
      feature.source = kName;
      id = transaction.AddFeature(std::move(feature));
    }
    for (std::size_t side = 0; side < WalledRectangle::kSides.size(); ++side) {
      for (const WalledRectangle::Member& member : rectangle.sides[side]) {
        if (!member.is_new) continue;
        const RelationType* relation = registry.FindRelation(
            RelationRole::kSide, *member.feature->type, rectangle_type);
        if (relation == nullptr) continue;
        transaction.AddConstraint(
            MakeStructure(*relation, {member.feature->id, id},
                          Eigen::Vector2d(0.0, WalledRectangle::kSides[side]),
                          InformationFromSigmas(Eigen::Vector2d(
                              options_.sigma, options_.sigma_angle)),
                          kName));
      }
    }
  }
  return transaction;
}

DetectorType RectangleType() {
  DetectorType type;
  type.name = kName;
  type.description =
      "Rectangles of walls: sides parallel and at right angles, corners that "
      "meet";
  type.reads = {"segment", "line"};
  type.makes = {"rectangle"};
  SetParameters<RectangleOptions>(
      Bind,
      [](const RectangleOptions& options) {
        return std::make_unique<RectangleDetector>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
