#include <plumbline/core/parallel_for.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/visibility.h>
#include <plumbline/factors/wall_visibility.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

namespace plumbline {

const char* const kVisibilityDetector = "visibility";

namespace {

// Pieces in which what was seen through is counted, m: long enough for a few
// lines that cross at a small angle; and how many these are at least.
constexpr double kPiece = 0.4;
constexpr int kMinLines = 2;

void Bind(ParameterBinder* parameters, VisibilityOptions* options) {
  ParameterBinder& p = *parameters;
  constexpr double kNoLimit = ParameterBinder::kNoLimit;
  p.Length("range", &options->range, 0.1, kNoLimit,
           "looks from within this distance of a wall are set against it");
  p.Length("door", &options->door, 0.0, kNoLimit,
           "sight lines cross a wall this far from its ends");
  p.Length("margin", &options->margin, 0.0, kNoLimit,
           "how far behind a wall they may end ...");
  p.Length("sigma", &options->sigma, 1e-6, 10.0,
           "... and the standard deviation of that");
  p.Length("depth", &options->depth, 0.0, kNoLimit,
           "lines that end farther behind it went through an opening");
  p.Angle("min_angle_deg", &options->min_angle, 0.0, 90.0,
          "least angle between sight line and wall");
  p.Count("lines", &options->lines, 1,
          "the worst so many lines of a look hold a wall back");
  p.Number("break_below", &options->break_below, 0.0, 1.0, "",
           "p-value below which one is broken");
  p.Length("min_width", &options->min_width, 0.0, kNoLimit,
           "walls are not in line where the sensor looked through over this "
           "width ...");
  p.Length("passed", &options->passed, 0.0, kNoLimit,
           "... with lines that end this far behind");
}

// A wall of the graph with its feature.
struct GraphWall {
  FeatureId id = kNoId;
  Wall wall;
};

// A sight line that went through a wall.
struct Violation {
  FeatureId frame = kNoId;
  // End in the frame, cut by the margin, and side of the sensor.
  Eigen::Vector3d expected;
  // Of the wall in the frame.
  Eigen::Vector2d normal;
  double beyond = 0.0;
};

// What looks say about a wall.
struct WallFinding {
  // The worst few of each look, the worst first.
  std::vector<Violation> worst;
  std::int64_t looks = 0;
  std::int64_t crossings = 0;
};

// Ends of sight lines by their bearing from the sensor, the frame's -x axis
// first, counterclockwise.
struct BearingOrder {
  Eigen::Vector2d sensor;

  bool operator()(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
    const Eigen::Vector2d one = a - sensor;
    const Eigen::Vector2d other = b - sensor;
    const bool one_is_below =
        one.y() < 0.0 || (one.y() == 0.0 && one.x() < 0.0);
    const bool other_is_below =
        other.y() < 0.0 || (other.y() == 0.0 && other.x() < 0.0);
    if (one_is_below != other_is_below) return one_is_below;
    return one.x() * other.y() - one.y() * other.x() > 0.0;
  }
};

// Looks are those of Visibility::SetLooks.
class Search {
 public:
  Search(const Looks& looks, const Graph& graph, const Registry& registry,
         const VisibilityOptions& options)
      : graph_(graph),
        relation_(registry.GetRelation(WallVisibility::kName)),
        options_(options),
        placed_(looks, graph) {
    through_.piece = kPiece;
    through_.min_lines = kMinLines;
    through_.passed = options.passed;
    through_.min_slant = std::sin(options.min_angle);
  }

  // Adds what holds walls back.
  void HoldBack(const DetectionScope& scope, Transaction* transaction) const {
    std::vector<GraphWall> walls;
    for (const Feature* feature : FeaturesInScope(graph_, scope)) {
      if (!relation_.Accepts(1, *feature->type)) continue;
      const std::optional<Wall> wall = WallOf(*feature);
      if (!wall || !std::isfinite(wall->length()) ||
          wall->length() <= 2.0 * options_.door) {
        continue;
      }
      walls.push_back({feature->id, *wall});
    }
    std::vector<WallFinding> found(walls.size());
    ParallelFor(walls.size(), ThreadsHere(),
                [&](std::size_t i) { found[i] = LookAt(walls[i]); });
    WallFinding sum;
    std::int64_t crossed = 0;
    for (std::size_t i = 0; i < walls.size(); ++i) {
      sum.looks += found[i].looks;
      sum.crossings += found[i].crossings;
      crossed += found[i].worst.empty() ? 0 : 1;
      Propose(walls[i].id, found[i].worst, transaction);
    }
    scope.Count("walls", static_cast<std::int64_t>(walls.size()));
    scope.Count("looks at walls", sum.looks);
    scope.Count("sight lines through walls", sum.crossings);
    scope.Count("walls held back", crossed);
  }

  // Breaks what puts walls in line that are not.
  void Refute(const DetectionScope& scope, Transaction* transaction) const {
    std::int64_t checked = 0;
    std::int64_t broken = 0;
    const auto check = [&](const Constraint& one, const GraphWall& first,
                           const GraphWall& second) {
      ++checked;
      if (!IsThrough(first, second) && !IsThrough(second, first)) return false;
      ++broken;
      transaction->BreakConstraint(one.id);
      return true;
    };
    // Walls on one side of a rectangle, by rectangle and side, with what ties
    // them to it.
    std::map<std::pair<FeatureId, long>,
             std::vector<std::pair<const Constraint*, GraphWall>>>
        sides;
    for (const Constraint* constraint : graph_.Constraints()) {
      if (constraint->state != ConstraintState::kLive ||
          constraint->kind != ConstraintClass::kStructure ||
          constraint->features.size() != 2) {
        continue;
      }
      const Feature& first = graph_.GetFeature(constraint->features[0]);
      const Feature& second = graph_.GetFeature(constraint->features[1]);
      if (constraint->type->Is(RelationRole::kSameWall)) {
        const std::optional<Wall> one = WallOf(first);
        const std::optional<Wall> other = WallOf(second);
        if (!one || !other) continue;
        check(*constraint, {first.id, *one}, {second.id, *other});
      } else if (constraint->type->Is(RelationRole::kSide)) {
        const std::optional<Wall> wall = WallOf(first);
        if (!wall) continue;
        sides[{second.id, std::lround(constraint->expected[1] / kPi * 2.0)}]
            .emplace_back(constraint, GraphWall{first.id, *wall});
      }
    }
    for (auto& side : sides) {
      // The longest walls stay.
      auto& members = side.second;
      std::stable_sort(members.begin(), members.end(),
                       [](const auto& a, const auto& b) {
                         return a.second.wall.length() > b.second.wall.length();
                       });
      std::vector<GraphWall> kept;
      for (const auto& [constraint, wall] : members) {
        if (std::none_of(kept.begin(), kept.end(), [&](const GraphWall& other) {
              return check(*constraint, other, wall);
            })) {
          kept.push_back(wall);
        }
      }
    }
    scope.Count("hypotheses checked", checked);
    scope.Count("hypotheses broken: the sensor looked through", broken);
  }

 private:
  WallFinding LookAt(const GraphWall& of) const {
    WallFinding finding;
    const double begin = of.wall.begin + options_.door;
    const double end = of.wall.end - options_.door;
    const std::vector<FeatureId> measured_by = FramesOf(of.id);
    std::vector<std::pair<SightCrossing, std::size_t>> crossings;
    for (const std::size_t i : placed_.Near(of.wall, options_.range)) {
      const Look& look = placed_.look(i);
      if (look.frame == kNoId || Contains(measured_by, look.frame)) continue;
      ++finding.looks;
      const Wall wall = placed_.Seen(i, of.wall);
      crossings.clear();
      VisitBetween(look, wall.At(begin), wall.At(end), [&](std::size_t k) {
        const std::optional<SightCrossing> crossing =
            CrossingOf(wall, look.sensor, look.ends[k]);
        if (!crossing || crossing->beyond <= options_.margin ||
            crossing->beyond > options_.depth ||
            crossing->slant < through_.min_slant || crossing->along < begin ||
            crossing->along > end) {
          return;
        }
        crossings.emplace_back(*crossing, k);
      });
      finding.crossings += static_cast<std::int64_t>(crossings.size());
      // A single line may have grazed an edge.
      if (static_cast<int>(crossings.size()) < options_.lines) continue;
      std::stable_sort(crossings.begin(), crossings.end(),
                       [](const auto& a, const auto& b) {
                         return a.first.beyond > b.first.beyond;
                       });
      crossings.resize(static_cast<std::size_t>(options_.lines));
      for (const auto& [crossing, k] : crossings) {
        const Eigen::Vector2d line = look.ends[k] - look.sensor;
        const Eigen::Vector2d cut =
            look.ends[k] -
            options_.margin / (crossing.slant * line.norm()) * line;
        finding.worst.push_back(
            {look.frame, Eigen::Vector3d(cut.x(), cut.y(), crossing.side),
             wall.normal(), crossing.beyond});
      }
    }
    return finding;
  }

  // Calls visit(index) for the sight lines of a look (BearingOrder) that go
  // between two points of its frame.
  template <typename Visit>
  static void VisitBetween(const Look& look, const Eigen::Vector2d& first,
                           const Eigen::Vector2d& second, const Visit& visit) {
    Eigen::Vector2d from = first - look.sensor;
    Eigen::Vector2d to = second - look.sensor;
    if (from.x() * to.y() - from.y() * to.x() < 0.0) std::swap(from, to);
    const auto index_of = [&look](const Eigen::Vector2d& direction) {
      return static_cast<std::size_t>(
          std::lower_bound(look.ends.begin(), look.ends.end(),
                           look.sensor + direction, BearingOrder{look.sensor}) -
          look.ends.begin());
    };
    const std::size_t begin = index_of(from);
    const std::size_t end = index_of(to);
    const std::size_t size = look.ends.size();
    const bool is_around =
        BearingOrder{look.sensor}(look.sensor + to, look.sensor + from);
    for (std::size_t k = begin; k < (is_around ? size : end); ++k) visit(k);
    for (std::size_t k = 0; is_around && k < end; ++k) visit(k);
  }

  // Proposes the worst that are not there yet, as many for each frame as there
  // is room for.
  void Propose(FeatureId wall, const std::vector<Violation>& worst,
               Transaction* transaction) const {
    if (worst.empty()) return;
    // Violated lines by frame; where one was broken there is no room.
    std::map<FeatureId, int> held;
    std::vector<const Constraint*> there;
    for (const ConstraintId id : graph_.ConstraintsOf(wall)) {
      const Constraint& constraint = graph_.GetConstraint(id);
      if (constraint.type != &relation_ || constraint.features[1] != wall) {
        continue;
      }
      there.push_back(&constraint);
      if (constraint.state == ConstraintState::kBroken) {
        held[constraint.features[0]] += options_.lines;
      } else if (IsViolated(constraint)) {
        ++held[constraint.features[0]];
      }
    }
    for (const Violation& violation : worst) {
      if (held[violation.frame] >= options_.lines) continue;
      if (std::any_of(there.begin(), there.end(), [&](const Constraint* one) {
            return one->features[0] == violation.frame &&
                   one->expected == violation.expected;
          })) {
        continue;
      }
      ++held[violation.frame];
      Constraint constraint = MakeStructure(
          relation_, {violation.frame, wall}, violation.expected,
          WallVisibilityInformation(violation.normal, options_.sigma),
          kVisibilityDetector);
      constraint.break_below = options_.break_below;
      transaction->AddConstraint(std::move(constraint));
    }
  }

  bool IsViolated(const Constraint& constraint) const {
    const Feature& frame = graph_.GetFeature(constraint.features[0]);
    const Feature& wall = graph_.GetFeature(constraint.features[1]);
    const WallVisibility functor(constraint.expected,
                                 Eigen::Matrix3d::Identity());
    double residual[3];
    functor(frame.data(), wall.data(), residual);
    return residual[0] != 0.0 || residual[1] != 0.0;
  }

  // Whether looks that saw the first wall went through where the second would
  // stand, were it in line with the first. Beyond the first by as much as it is
  // long, at most: farther away its direction is not known well enough.
  bool IsThrough(const GraphWall& first, const GraphWall& second) const {
    const Wall& line = first.wall;
    if (!std::isfinite(line.length()) || !std::isfinite(second.wall.length())) {
      return false;
    }
    Interval where = line.IntervalOf(second.wall);
    where.first =
        std::max(where.first + options_.door, line.begin - line.length());
    where.second =
        std::min(where.second - options_.door, line.end + line.length());
    // The first wall stands between.
    const Interval before = {where.first, std::min(where.second, line.begin)};
    const Interval behind = {std::max(where.first, line.end), where.second};
    return IsThrough(first, before) || IsThrough(first, behind);
  }

  bool IsThrough(const GraphWall& of, const Interval& where) const {
    if (where.second - where.first < options_.min_width) return false;
    Wall stretch = of.wall;
    stretch.begin = where.first;
    stretch.end = where.second;
    SeenPieces pieces(where.first, where.second, through_);
    const std::vector<FeatureId> measured_by = FramesOf(of.id);
    for (const std::size_t i : placed_.Near(stretch, options_.range)) {
      const Look& look = placed_.look(i);
      if (look.frame != kNoId && !Contains(measured_by, look.frame)) continue;
      pieces.Add(placed_.Seen(i, stretch), look);
    }
    return !pieces.Through(options_.min_width).empty();
  }

  // The features that live measurements tie to a wall, and the wall, ascending:
  // looks of these frames know where it is.
  std::vector<FeatureId> FramesOf(FeatureId wall) const {
    std::vector<FeatureId> frames = {wall};
    for (const ConstraintId id : graph_.ConstraintsOf(wall)) {
      const Constraint& constraint = *graph_.FindConstraint(id);
      if (constraint.state != ConstraintState::kLive ||
          constraint.kind != ConstraintClass::kMeasurement) {
        continue;
      }
      frames.insert(frames.end(), constraint.features.begin(),
                    constraint.features.end());
    }
    std::sort(frames.begin(), frames.end());
    return frames;
  }

  static bool Contains(const std::vector<FeatureId>& ids, FeatureId id) {
    return std::binary_search(ids.begin(), ids.end(), id);
  }

  const Graph& graph_;
  const RelationType& relation_;
  const VisibilityOptions& options_;
  PlacedLooks placed_;
  SeenThroughOptions through_;
};

}  // namespace

Visibility::Visibility(const VisibilityOptions& options) : options_(options) {}

const std::string& Visibility::name() const {
  static const std::string name = kVisibilityDetector;
  return name;
}

void Visibility::SetLooks(std::shared_ptr<const Looks> looks) {
  looks_ = nullptr;
  if (looks == nullptr) return;
  auto ordered = std::make_shared<Looks>(*looks);
  for (Look& look : *ordered) {
    // A line of no length has no bearing.
    look.ends.erase(
        std::remove(look.ends.begin(), look.ends.end(), look.sensor),
        look.ends.end());
    std::stable_sort(look.ends.begin(), look.ends.end(),
                     BearingOrder{look.sensor});
  }
  looks_ = std::move(ordered);
}

Transaction Visibility::Detect(const Graph& graph, const Registry& registry,
                               const DetectionScope& scope) const {
  Transaction transaction;
  if (looks_ == nullptr || scope.features != nullptr || scope.level != 0) {
    return transaction;
  }
  const Search search(*looks_, graph, registry, options_);
  search.Refute(scope, &transaction);
  if (scope.ShouldStop()) return transaction;
  search.HoldBack(scope, &transaction);
  return transaction;
}

DetectorType VisibilityType() {
  DetectorType type;
  type.name = kVisibilityDetector;
  type.description =
      "Walls do not stand where the sensor has looked through: sight lines "
      "hold them back and refute that walls are in line";
  type.reads = {"segment"};
  SetParameters<VisibilityOptions>(
      Bind,
      [](const VisibilityOptions& options) {
        return std::make_unique<Visibility>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
