#include <plumbline/core/wall.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/rectangle.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

constexpr char kName[] = "rectangle";
constexpr int kNumSides = 4;
// The sides as the relations name them, counterclockwise.
constexpr std::array<double, kNumSides> kSides = {0.0, 0.5 * kPi, kPi,
                                                  -0.5 * kPi};
// From a corner so many of the nearest on each wall are tried, so that cost
// does not grow with the square of the rooms along a corridor.
constexpr std::size_t kMaxTries = 16;
// Two rectangles with more than this part of the smaller one in common overlap.
constexpr double kOverlap = 0.1;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// A side of a room, or a part of one: the visible part of a segment or line.
struct Face {
  const Feature* feature = nullptr;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  // rad, and as a unit vector.
  double angle = 0.0;
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  double half_length = 0.0;
};

// False when it is no wall, or none with a finite visible part.
bool MakeFace(const Feature& feature, Face* face) {
  const std::optional<Wall> wall = WallOf(feature);
  if (!wall) return false;
  face->feature = &feature;
  face->middle = wall->Middle();
  face->angle = wall->angle;
  face->direction = wall->direction;
  face->half_length = 0.5 * wall->length();
  return face->half_length > 0.0 && std::isfinite(face->half_length) &&
         std::isfinite(face->angle) && face->middle.allFinite();
}

// Where a wall lies along a line through `origin` in the direction `along`.
Interval IntervalAlong(const Face& wall, const Eigen::Vector2d& origin,
                       const Eigen::Vector2d& along) {
  const double middle = along.dot(wall.middle - origin);
  const double reach = wall.half_length * std::abs(along.dot(wall.direction));
  return {middle - reach, middle + reach};
}

// Whether two walls on one line are two faces of a wall rather than two parts
// of it: half of the shorter one lies beside the other.
bool RunsBeside(const Interval& a, const Interval& b) {
  return Overlap(a, b) > 0.5 * std::min(a.second - a.first, b.second - b.first);
}

// Walls by place: all that may pass near a point.
class WallGrid {
 public:
  explicit WallGrid(double cell) : cell_(cell) {}

  // `reach`: how far the wall counts past its ends.
  void Add(int index, const Face& wall, double reach) {
    Visit(wall, reach, [&](const Cell& cell) {
      std::vector<int>& walls = cells_[cell];
      if (walls.empty() || walls.back() != index) walls.push_back(index);
    });
  }

  // Indices of the walls that pass within a cell of the wall, ascending.
  std::vector<int> Near(const Face& wall, double reach) const {
    std::set<int> found;
    std::set<Cell> seen;
    Visit(wall, reach, [&](const Cell& center) {
      for (std::int64_t x = center.first - 1; x <= center.first + 1; ++x) {
        for (std::int64_t y = center.second - 1; y <= center.second + 1; ++y) {
          if (!seen.insert({x, y}).second) continue;
          const auto cell = cells_.find({x, y});
          if (cell == cells_.end()) continue;
          found.insert(cell->second.begin(), cell->second.end());
        }
      }
    });
    return {found.begin(), found.end()};
  }

 private:
  using Cell = std::pair<std::int64_t, std::int64_t>;

  template <typename Visitor>
  void Visit(const Face& wall, double reach, const Visitor& visit) const {
    const double end = wall.half_length + reach;
    const int steps = 1 + static_cast<int>(std::ceil(2.0 * end / cell_));
    for (int i = 0; i <= steps; ++i) {
      const Eigen::Vector2d point =
          wall.middle +
          end * (2.0 * static_cast<double>(i) / steps - 1.0) * wall.direction;
      visit({static_cast<std::int64_t>(std::floor(point.x() / cell_)),
             static_cast<std::int64_t>(std::floor(point.y() / cell_))});
    }
  }

  double cell_;
  std::map<Cell, std::vector<int>> cells_;
};

// Where two walls meet.
struct Corner {
  int first = -1;
  int second = -1;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();

  int Other(int wall) const { return wall == first ? second : first; }
};

struct Rectangle {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double theta = 0.0;
  // Half its size along theta and across.
  double a = 0.0;
  double b = 0.0;
  // kNoId for one that is not in the graph yet.
  FeatureId id = kNoId;
  // Walls on each side: features, where they lie along it from its middle.
  struct Member {
    const Feature* feature = nullptr;
    Interval interval;
    bool is_new = false;
  };
  std::array<std::vector<Member>, kNumSides> sides;

  double area() const { return 4.0 * a * b; }
  Eigen::Vector2d Direction(int side) const {
    const double angle = theta + kSides[static_cast<std::size_t>(side)];
    return {std::cos(angle), std::sin(angle)};
  }
  // Outward.
  Eigen::Vector2d Normal(int side) const {
    const Eigen::Vector2d along = Direction(side);
    return {along.y(), -along.x()};
  }
  double HalfLength(int side) const { return side % 2 == 0 ? a : b; }
  Eigen::Vector2d Middle(int side) const {
    return center + (side % 2 == 0 ? b : a) * Normal(side);
  }
};

// Area that two rectangles have in common, when their sides are parallel.
double CommonArea(const Rectangle& first, const Rectangle& second) {
  const Eigen::Vector2d x = first.Direction(0);
  const Eigen::Vector2d y(-x.y(), x.x());
  const Eigen::Vector2d offset = second.center - first.center;
  const bool is_turned =
      std::abs(std::sin(second.theta - first.theta)) > std::sqrt(0.5);
  const double a = is_turned ? second.b : second.a;
  const double b = is_turned ? second.a : second.b;
  const double width =
      Overlap({-first.a, first.a}, {x.dot(offset) - a, x.dot(offset) + a});
  const double height =
      Overlap({-first.b, first.b}, {y.dot(offset) - b, y.dot(offset) + b});
  return std::max(width, 0.0) * std::max(height, 0.0);
}

// One call of Detect.
class RectangleSearch {
 public:
  RectangleSearch(const RectangleOptions& options, std::vector<Face> walls)
      : options_(options),
        walls_(std::move(walls)),
        grid_(std::max(options.corner_gap, options.max_opening)) {
    for (int i = 0; i < size(); ++i) grid_.Add(i, wall(i), Reach());
  }

  // Rectangles that are there, with the walls that they have.
  void AddExisting(Rectangle rectangle) {
    rectangles_.push_back(std::move(rectangle));
    Index(static_cast<int>(rectangles_.size()) - 1);
  }

  // Lets walls join what is there and adds what is found.
  const std::vector<Rectangle>& Run(const DetectionScope& scope) {
    for (std::size_t i = 0; i < rectangles_.size(); ++i) {
      Join(&rectangles_[i]);
      Index(static_cast<int>(i));
    }
    FindCorners();
    std::int64_t known = 0;
    for (Rectangle& candidate : Candidates(scope)) {
      if (IsKnown(candidate)) {
        ++known;
        continue;
      }
      rectangles_.push_back(std::move(candidate));
      Index(static_cast<int>(rectangles_.size()) - 1);
    }
    scope.Count("walls", size());
    scope.Count("corners", static_cast<std::int64_t>(corners_.size()));
    scope.Count("rectangles", tried_);
    scope.Count("rectangles refused: size", wrong_size_);
    scope.Count("rectangles refused: walls not on the sides", not_on_sides_);
    scope.Count("rectangles refused: sides not covered", not_covered_);
    scope.Count("rectangles refused: there already", known);
    return rectangles_;
  }

 private:
  int size() const { return static_cast<int>(walls_.size()); }
  const Face& wall(int i) const { return walls_[static_cast<std::size_t>(i)]; }
  // Past its ends a wall may meet another or go on as another.
  double Reach() const {
    return std::max(options_.corner_gap, 0.5 * options_.max_opening);
  }

  // Enters a rectangle's walls into the list by feature.
  void Index(int rectangle) {
    const Rectangle& r = rectangles_[static_cast<std::size_t>(rectangle)];
    for (int side = 0; side < kNumSides; ++side) {
      for (const Rectangle::Member& member :
           r.sides[static_cast<std::size_t>(side)]) {
        by_feature_[member.feature->id].insert({rectangle, side});
      }
    }
  }

  bool AreCollinear(const Face& first, const Face& second) const {
    if (std::abs(NormalizeAxial(first.angle - second.angle)) >
        options_.gate_angle) {
      return false;
    }
    const auto own = std::pair(-first.half_length, first.half_length);
    const auto other = IntervalAlong(second, first.middle, first.direction);
    if (-Overlap(own, other) > options_.max_opening || RunsBeside(own, other)) {
      return false;
    }
    // Across, seen from the nearer end of each.
    const auto is_near = [&](const Face& from, const Face& to) {
      const double along = from.direction.dot(to.middle - from.middle);
      const double sign =
          (from.direction.dot(to.direction) > 0.0) == (along > 0.0) ? -1.0
                                                                    : 1.0;
      const Eigen::Vector2d end =
          to.middle + sign * to.half_length * to.direction;
      return std::abs(Cross(from.direction, end - from.middle)) <=
             options_.gate;
    };
    return is_near(first, second) && is_near(second, first);
  }

  void FindCorners() {
    const auto count = static_cast<std::size_t>(size());
    in_line_.resize(count);
    corners_of_.resize(count);
    for (int i = 0; i < size(); ++i) {
      in_line_[static_cast<std::size_t>(i)].push_back(i);
      for (const int j : grid_.Near(wall(i), Reach())) {
        if (j == i) continue;
        if (AreCollinear(wall(i), wall(j))) {
          in_line_[static_cast<std::size_t>(i)].push_back(j);
        }
        if (j < i) continue;
        const double turn =
            std::abs(NormalizeAxial(wall(i).angle - wall(j).angle));
        if (0.5 * kPi - turn > options_.gate_angle) continue;
        const double sine = Cross(wall(i).direction, wall(j).direction);
        const double along_i =
            Cross(wall(j).middle - wall(i).middle, wall(j).direction) / sine;
        const double along_j =
            Cross(wall(j).middle - wall(i).middle, wall(i).direction) / sine;
        if (std::abs(along_i) > wall(i).half_length + options_.corner_gap ||
            std::abs(along_j) > wall(j).half_length + options_.corner_gap) {
          continue;
        }
        const int corner = static_cast<int>(corners_.size());
        corners_.push_back(
            {i, j, wall(i).middle + along_i * wall(i).direction});
        corners_of_[static_cast<std::size_t>(i)].push_back(corner);
        corners_of_[static_cast<std::size_t>(j)].push_back(corner);
        corner_between_[{i, j}] = corner;
      }
    }
  }

  const Corner& corner(int i) const {
    return corners_[static_cast<std::size_t>(i)];
  }

  // Corners on a wall or one in line with it, in both directions from one of
  // them: the nearest ones, as corner and the wall that they are on.
  std::vector<std::pair<int, int>> CornersAlong(int from,
                                                int wall_index) const {
    std::array<std::vector<std::tuple<double, int, int>>, 2> found;
    for (const int on : in_line_[static_cast<std::size_t>(wall_index)]) {
      for (const int other : corners_of_[static_cast<std::size_t>(on)]) {
        const double along =
            wall(wall_index)
                .direction.dot(corner(other).position - corner(from).position);
        if (other == from || std::abs(along) < options_.min_side ||
            std::abs(along) > options_.max_side) {
          continue;
        }
        found[along < 0.0].emplace_back(std::abs(along), other, on);
      }
    }
    std::vector<std::pair<int, int>> corners;
    for (auto& direction : found) {
      std::sort(direction.begin(), direction.end());
      if (direction.size() > kMaxTries) direction.resize(kMaxTries);
      for (const auto& entry : direction) {
        corners.emplace_back(std::get<1>(entry), std::get<2>(entry));
      }
    }
    return corners;
  }

  // The rectangle whose sides run through these walls, the sides
  // counterclockwise; its direction is within 45 degrees of the map's x axis,
  // so that the same one is written in the same way again.
  Rectangle Fit(const std::array<std::vector<int>, kNumSides>& sides) const {
    // Sums of the doubled doubled angle tell a direction modulo 90 degrees.
    double cosine = 0.0, sine = 0.0;
    for (const auto& side : sides) {
      for (const int i : side) {
        // The variance of a direction falls with the length cubed.
        const double weight = std::pow(wall(i).half_length, 3.0);
        cosine += weight * std::cos(4.0 * wall(i).angle);
        sine += weight * std::sin(4.0 * wall(i).angle);
      }
    }
    Rectangle rectangle;
    rectangle.theta = 0.25 * std::atan2(sine, cosine);
    const Eigen::Vector2d origin = wall(sides[0][0]).middle;
    // Offsets of the sides outward. The given sides turn counterclockwise from
    // any of the four.
    std::array<double, kNumSides> offsets{};
    const std::size_t first = FirstSide(rectangle.theta, sides);
    for (std::size_t given = 0; given < sides.size(); ++given) {
      const std::size_t k = (first + given) % sides.size();
      const Eigen::Vector2d normal = rectangle.Normal(static_cast<int>(k));
      double sum = 0.0, weights = 0.0;
      for (const int i : sides[given]) {
        sum += wall(i).half_length * normal.dot(wall(i).middle - origin);
        weights += wall(i).half_length;
      }
      offsets[k] = sum / weights;
      for (const int i : sides[given]) {
        rectangle.sides[k].push_back({wall(i).feature, {}, true});
      }
    }
    rectangle.a = 0.5 * (offsets[1] + offsets[3]);
    rectangle.b = 0.5 * (offsets[0] + offsets[2]);
    rectangle.center = origin +
                       0.5 * (offsets[1] - offsets[3]) * rectangle.Normal(1) +
                       0.5 * (offsets[2] - offsets[0]) * rectangle.Normal(2);
    return rectangle;
  }

  // Which side of a rectangle in this direction the first of the given ones is.
  std::size_t FirstSide(
      double theta,
      const std::array<std::vector<int>, kNumSides>& sides) const {
    const Face& first = wall(sides[0][0]);
    const Eigen::Vector2d outward = first.middle - wall(sides[2][0]).middle;
    Eigen::Vector2d normal(first.direction.y(), -first.direction.x());
    if (normal.dot(outward) < 0.0) normal = -normal;
    std::size_t best = 0;
    double largest = -2.0;
    for (std::size_t k = 0; k < kSides.size(); ++k) {
      const double angle = theta + kSides[k];
      const double cosine =
          normal.dot(Eigen::Vector2d(std::sin(angle), -std::cos(angle)));
      if (cosine > largest) {
        largest = cosine;
        best = k;
      }
    }
    return best;
  }

  // Where a wall lies along a side; false when it is not on it.
  bool IsOnSide(const Face& wall, const Rectangle& rectangle, int side,
                Interval* interval) const {
    const double angle =
        rectangle.theta + kSides[static_cast<std::size_t>(side)];
    const Eigen::Vector2d middle = rectangle.Middle(side);
    if (std::abs(NormalizeAxial(wall.angle - angle)) > options_.gate_angle) {
      return false;
    }
    // Across where the wall is nearest to the middle of the side: a long wall
    // may go far beyond it, and a short one says little about what is beyond.
    const double along = std::clamp(wall.direction.dot(middle - wall.middle),
                                    -wall.half_length, wall.half_length);
    const Eigen::Vector2d nearest = wall.middle + along * wall.direction;
    if (std::abs(rectangle.Normal(side).dot(nearest - middle)) >
        options_.gate) {
      return false;
    }
    *interval = IntervalAlong(wall, middle, rectangle.Direction(side));
    const double half = rectangle.HalfLength(side);
    return Overlap(*interval, {-half, half}) >=
           std::min(wall.half_length, half);
  }

  // Adds walls that lie on the sides, the longest first, to those that are
  // there: what runs beside one of them is another face of the wall.
  void Join(Rectangle* rectangle) const {
    for (int side = 0; side < kNumSides; ++side) {
      std::vector<Rectangle::Member>& members =
          rectangle->sides[static_cast<std::size_t>(side)];
      Face line;
      line.middle = rectangle->Middle(side);
      line.direction = rectangle->Direction(side);
      line.half_length = rectangle->HalfLength(side);
      std::vector<std::pair<double, int>> by_length;
      for (const int i : grid_.Near(line, 0.0)) {
        by_length.emplace_back(-wall(i).half_length, i);
      }
      std::sort(by_length.begin(), by_length.end());
      for (const auto& entry : by_length) {
        const Face& candidate = wall(entry.second);
        Interval interval;
        if (!IsOnSide(candidate, *rectangle, side, &interval)) continue;
        if (std::any_of(members.begin(), members.end(),
                        [&](const Rectangle::Member& member) {
                          return member.feature == candidate.feature ||
                                 RunsBeside(member.interval, interval);
                        })) {
          continue;
        }
        members.push_back({candidate.feature, interval, true});
      }
    }
  }

  // Whether walls cover enough of the side and meet the next ones.
  bool IsCovered(const Rectangle& rectangle, int side) const {
    const double half = rectangle.HalfLength(side);
    std::vector<Interval> intervals;
    for (const Rectangle::Member& member :
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
  std::vector<Rectangle> Candidates(const DetectionScope& scope) {
    std::vector<Rectangle> candidates;
    for (int at = 0; at < static_cast<int>(corners_.size()); ++at) {
      if (scope.ShouldStop()) return {};
      const Corner& a = corner(at);
      for (const int i : {a.first, a.second}) {
        const int j = a.Other(i);
        const auto along_j = CornersAlong(at, j);
        for (const auto& [next, i2] : CornersAlong(at, i)) {
          // Each set of four is looked at from its first corner only.
          if (next < at) continue;
          const Corner& b = corner(next);
          for (const auto& [last, j2] : along_j) {
            if (last < at) continue;
            const Corner& d = corner(last);
            // Counterclockwise.
            if (Cross(b.position - a.position, d.position - a.position) <=
                0.0) {
              continue;
            }
            Close(at, {i, i2}, b.Other(i2), d.Other(j2), {j, j2}, &candidates);
          }
        }
      }
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Rectangle& first, const Rectangle& second) {
                       return first.area() < second.area();
                     });
    return candidates;
  }

  // Looks for the fourth corner, on the walls k and l or in line with them, and
  // adds the rectangle.
  void Close(int at, const std::pair<int, int>& bottom, int k, int l,
             const std::pair<int, int>& left,
             std::vector<Rectangle>* candidates) {
    for (const int k2 : in_line_[static_cast<std::size_t>(k)]) {
      for (const int l2 : in_line_[static_cast<std::size_t>(l)]) {
        const auto found = corner_between_.find(std::minmax(k2, l2));
        if (found == corner_between_.end() || found->second < at) continue;
        const auto list = [](int first, int second) {
          return first == second ? std::vector<int>{first}
                                 : std::vector<int>{first, second};
        };
        Rectangle rectangle =
            Fit({list(bottom.first, bottom.second), list(k, k2), list(l, l2),
                 list(left.first, left.second)});
        if (Complete(&rectangle)) candidates->push_back(std::move(rectangle));
      }
    }
  }

  // Checks the walls that it was fitted to and adds others on its sides; false
  // when it is none.
  bool Complete(Rectangle* rectangle) {
    ++tried_;
    if (2.0 * std::min(rectangle->a, rectangle->b) < options_.min_side ||
        2.0 * std::max(rectangle->a, rectangle->b) > options_.max_side) {
      ++wrong_size_;
      return false;
    }
    for (int side = 0; side < kNumSides; ++side) {
      for (Rectangle::Member& member :
           rectangle->sides[static_cast<std::size_t>(side)]) {
        Face wall;
        MakeFace(*member.feature, &wall);
        if (!IsOnSide(wall, *rectangle, side, &member.interval)) {
          ++not_on_sides_;
          return false;
        }
      }
    }
    Join(rectangle);
    for (int side = 0; side < kNumSides; ++side) {
      if (!IsCovered(*rectangle, side)) {
        ++not_covered_;
        return false;
      }
    }
    return true;
  }

  // Whether a rectangle that is there overlaps it and has two sides in common
  // with it.
  bool IsKnown(const Rectangle& candidate) const {
    // Sides of the candidate that each rectangle has.
    std::map<int, std::set<int>> common;
    for (int side = 0; side < kNumSides; ++side) {
      for (const Rectangle::Member& member :
           candidate.sides[static_cast<std::size_t>(side)]) {
        const auto found = by_feature_.find(member.feature->id);
        if (found == by_feature_.end()) continue;
        for (const auto& [other, its_side] : found->second) {
          const Rectangle& rectangle =
              rectangles_[static_cast<std::size_t>(other)];
          if (candidate.Normal(side).dot(rectangle.Normal(its_side)) > 0.0) {
            common[other].insert(side);
          }
        }
      }
    }
    return std::any_of(common.begin(), common.end(), [&](const auto& entry) {
      const Rectangle& rectangle =
          rectangles_[static_cast<std::size_t>(entry.first)];
      return entry.second.size() >= 2 &&
             CommonArea(candidate, rectangle) >
                 kOverlap * std::min(candidate.area(), rectangle.area());
    });
  }

  const RectangleOptions& options_;
  std::vector<Face> walls_;
  WallGrid grid_;
  std::vector<Corner> corners_;
  // Corners of each wall; walls in line with each, itself first.
  std::vector<std::vector<int>> corners_of_;
  std::vector<std::vector<int>> in_line_;
  std::map<std::pair<int, int>, int> corner_between_;
  std::vector<Rectangle> rectangles_;
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
  for (int side = 0; side < kNumSides; ++side) {
    const double difference =
        constraint.expected[1] - kSides[static_cast<std::size_t>(side)];
    if (std::abs(NormalizeAngle(difference)) < 0.25 * kPi) return side;
  }
  return -1;
}

Rectangle ReadRectangle(const Graph& graph, const Feature& feature) {
  Rectangle rectangle;
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
    Face wall;
    if (!MakeFace(support, &wall)) continue;
    rectangle.sides[static_cast<std::size_t>(side)].push_back(
        {&support,
         IntervalAlong(wall, rectangle.Middle(side), rectangle.Direction(side)),
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
  return sides.size() == static_cast<std::size_t>(kNumSides);
}

Transaction RectangleDetector::Detect(const Graph& graph,
                                      const Registry& registry,
                                      const DetectionScope& scope) const {
  std::vector<Face> walls;
  for (const Feature* feature : FeaturesInScope(graph, scope)) {
    Face wall;
    if (MakeFace(*feature, &wall) &&
        2.0 * wall.half_length >= options_.min_length) {
      walls.push_back(wall);
    }
  }
  Transaction transaction;
  if (walls.empty()) return transaction;

  const FeatureType& rectangle_type = registry.GetFeature("rectangle");
  RectangleSearch search(options_, std::move(walls));
  for (const FeatureId id : graph.VirtualFeatures(scope.level + 1)) {
    const Feature& feature = graph.GetFeature(id);
    if (!feature.type->Is(FeatureRole::kRectangle)) continue;
    Rectangle rectangle = ReadRectangle(graph, feature);
    if (rectangle.center.allFinite() && std::isfinite(rectangle.theta) &&
        rectangle.a > 0.0 && rectangle.b > 0.0 &&
        std::max(rectangle.a, rectangle.b) <= options_.max_side) {
      search.AddExisting(std::move(rectangle));
    }
  }
  for (const Rectangle& rectangle : search.Run(scope)) {
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
    for (std::size_t side = 0; side < kSides.size(); ++side) {
      for (const Rectangle::Member& member : rectangle.sides[side]) {
        if (!member.is_new) continue;
        const RelationType* relation = registry.FindRelation(
            RelationRole::kSide, *member.feature->type, rectangle_type);
        if (relation == nullptr) continue;
        transaction.AddConstraint(
            MakeStructure(*relation, {member.feature->id, id},
                          Eigen::Vector2d(0.0, kSides[side]),
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
