#include <plumbline/core/parallel_for.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/visibility.h>
#include <plumbline/factors/wall_visibility.h>

#include <algorithm>
#include <array>
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

// How far a box reaches along a direction, m.
double Farthest(const Eigen::AlignedBox2d& box,
                const Eigen::Vector2d& direction) {
  const auto most = [&](int i) {
    return direction[i] * (direction[i] > 0.0 ? box.max()[i] : box.min()[i]);
  };
  return box.isEmpty() ? 0.0 : most(0) + most(1);
}

// A wall of the graph with its feature.
struct GraphWall {
  FeatureId id = kNoId;
  Wall wall;
};

// A sight line that went through a wall.
struct Violation {
  std::size_t look = 0;
  FeatureId frame = kNoId;
  // End in the frame, cut by the margin, and side of the sensor.
  Eigen::Vector3d expected;
  // Of the wall in the frame.
  Eigen::Vector2d normal;
  double beyond = 0.0;
};

// What looks say about a wall.
struct WallFinding {
  // The worst few of each look, the worst first, by look.
  std::vector<Violation> worst;
  std::int64_t looks = 0;
  std::int64_t crossings = 0;
};

// The sector around a sensor that a direction lies in, counterclockwise.
std::size_t SectorOf(const Eigen::Vector2d& direction) {
  constexpr std::size_t kSectors = SectoredLook::kSectors;
  const double share =
      direction.y() / (std::abs(direction.x()) + std::abs(direction.y()));
  const double turn = direction.x() >= 0.0 ? share + 1.0 : 3.0 - share;
  return static_cast<std::size_t>(0.25 * kSectors * turn) % kSectors;
}

// Unit vectors along the edges of the sectors.
const std::array<Eigen::Vector2d, SectoredLook::kSectors + 1>& SectorEdges() {
  static const auto edges = [] {
    constexpr std::size_t kSectors = SectoredLook::kSectors;
    std::array<Eigen::Vector2d, kSectors + 1> made;
    for (std::size_t k = 0; k <= kSectors; ++k) {
      const double turn = 4.0 * static_cast<double>(k) / kSectors;
      const double share = turn < 2.0 ? turn - 1.0 : 3.0 - turn;
      const double x = 1.0 - std::abs(share);
      made[k] = Eigen::Vector2d(turn < 2.0 ? x : -x, share).normalized();
    }
    return made;
  }();
  return edges;
}

SectoredLook InSectors(const Look& look) {
  SectoredLook sectored;
  std::vector<std::pair<std::size_t, Eigen::Vector2d>> ends;
  for (const Eigen::Vector2d& end : look.ends) {
    // A line of no length has no direction.
    if (end == look.sensor) continue;
    const std::size_t sector = SectorOf(end - look.sensor);
    sectored.reach[sector] = std::max(
        sectored.reach[sector], static_cast<float>((end - look.sensor).norm()));
    sectored.boxes[sector / SectoredLook::kGroup].extend(end - look.sensor);
    sectored.box.extend(end - look.sensor);
    ++sectored.begin[sector + 1];
    ends.emplace_back(sector, end);
  }
  std::stable_sort(ends.begin(), ends.end(),
                   [](const auto& one, const auto& other) {
                     return one.first < other.first;
                   });
  for (const auto& end : ends) sectored.ends.push_back(end.second);
  for (std::size_t k = 0; k < SectoredLook::kSectors; ++k) {
    sectored.begin[k + 1] += sectored.begin[k];
  }
  return sectored;
}

class Search {
 public:
  Search(const Looks& looks, const std::vector<SectoredLook>& sectored,
         const Graph& graph, const Registry& registry,
         const VisibilityOptions& options)
      : looks_(looks),
        sectored_(sectored),
        graph_(graph),
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
    std::vector<std::pair<SightCrossing, Eigen::Vector2d>> crossings;
    for (const std::size_t i : placed_.Near(of.wall, options_.range)) {
      const Look& look = placed_.look(i);
      if (look.frame == kNoId || Contains(measured_by, look.frame)) continue;
      ++finding.looks;
      if (!MayGoThrough(i, of.wall)) continue;
      const Wall wall = placed_.Seen(i, of.wall);
      crossings.clear();
      VisitThrough(look, wall, begin, end, [&](const Eigen::Vector2d& at) {
        const std::optional<SightCrossing> crossing =
            CrossingOf(wall, look.sensor, at);
        if (!crossing || crossing->beyond <= options_.margin ||
            crossing->beyond > options_.depth ||
            crossing->slant < through_.min_slant || crossing->along < begin ||
            crossing->along > end) {
          return;
        }
        crossings.emplace_back(*crossing, at);
      });
      finding.crossings += static_cast<std::int64_t>(crossings.size());
      // A single line may have grazed an edge.
      if (static_cast<int>(crossings.size()) < options_.lines) continue;
      std::stable_sort(crossings.begin(), crossings.end(),
                       [](const auto& a, const auto& b) {
                         return a.first.beyond > b.first.beyond;
                       });
      crossings.resize(static_cast<std::size_t>(options_.lines));
      for (const auto& [crossing, at] : crossings) {
        const Eigen::Vector2d line = at - look.sensor;
        const Eigen::Vector2d cut =
            at - options_.margin / (crossing.slant * line.norm()) * line;
        finding.worst.push_back(
            {i, look.frame, Eigen::Vector3d(cut.x(), cut.y(), crossing.side),
             wall.normal(), crossing.beyond});
      }
    }
    std::stable_sort(finding.worst.begin(), finding.worst.end(),
                     [](const Violation& one, const Violation& other) {
                       return one.look < other.look;
                     });
    return finding;
  }

  // Whether a look has ends farther away than a wall (map frame), as far as its
  // box tells.
  bool MayGoThrough(std::size_t i, const Wall& wall) const {
    // More than the rounding between the two frames.
    constexpr double kRounding = 1e-6;
    const double distance = wall.Across(placed_.sensor(i));
    const Eigen::Vector2d behind = placed_.DirectionSeen(
        i, distance > 0.0 ? -wall.normal() : wall.normal());
    return Farthest(SectoredOf(placed_.look(i)).box, behind) + kRounding >
           std::abs(distance) + options_.margin;
  }

  const SectoredLook& SectoredOf(const Look& look) const {
    return sectored_[static_cast<std::size_t>(&look - looks_.data())];
  }

  // Calls visit(end) for the sight lines of a look, and few others, that go
  // between two points of a wall and reach farther than it by the margin.
  template <typename Visit>
  void VisitThrough(const Look& look, const Wall& wall, double begin,
                    double end, const Visit& visit) const {
    // A line may reach this much farther than along the edges of its sector.
    constexpr double kBetweenEdges = 1.01;
    const SectoredLook& sectored = SectoredOf(look);
    const auto& edges = SectorEdges();
    const double distance = wall.Across(look.sensor);
    const double least = std::abs(distance) + options_.margin;
    const Eigen::Vector2d normal = wall.normal();
    const Eigen::Vector2d behind = distance > 0.0 ? -normal : normal;
    // Counterclockwise, for a sensor to the left of the wall.
    const std::size_t first =
        SectorOf(wall.At(distance > 0.0 ? begin : end) - look.sensor);
    const std::size_t last =
        SectorOf(wall.At(distance > 0.0 ? end : begin) - look.sensor);
    for (std::size_t k = first;;) {
      const std::size_t group = k / SectoredLook::kGroup;
      // The loop ends in this group, or goes on behind it.
      const std::size_t group_last = (group + 1) * SectoredLook::kGroup - 1;
      const bool is_last = k <= last && last <= group_last;
      if (Farthest(sectored.boxes[group], behind) > least) {
        for (const std::size_t end_of = is_last ? last : group_last;
             k <= end_of; ++k) {
          const double steepness = std::max(std::abs(normal.dot(edges[k])),
                                            std::abs(normal.dot(edges[k + 1])));
          if (kBetweenEdges * steepness * sectored.reach[k] <= least) continue;
          for (int e = sectored.begin[k]; e < sectored.begin[k + 1]; ++e) {
            visit(sectored.ends[static_cast<std::size_t>(e)]);
          }
        }
      }
      if (is_last) break;
      k = (group_last + 1) % SectoredLook::kSectors;
    }
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
    const auto& constraints = graph_.ConstraintsOf(wall);
    std::vector<FeatureId> frames;
    frames.reserve(constraints.size() + 1);
    frames.push_back(wall);
    for (const ConstraintId id : constraints) {
      const Constraint& constraint = *graph_.FindConstraint(id);
      if (constraint.state != ConstraintState::kLive ||
          constraint.kind != ConstraintClass::kMeasurement) {
        continue;
      }
      for (const FeatureId feature : constraint.features) {
        if (feature != wall) frames.push_back(feature);
      }
    }
    std::sort(frames.begin(), frames.end());
    return frames;
  }

  static bool Contains(const std::vector<FeatureId>& ids, FeatureId id) {
    return std::binary_search(ids.begin(), ids.end(), id);
  }

  const Looks& looks_;
  // Of each look.
  const std::vector<SectoredLook>& sectored_;
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
  looks_ = std::move(looks);
  sectored_.clear();
  if (looks_ == nullptr) return;
  for (const Look& look : *looks_) sectored_.push_back(InSectors(look));
}

Transaction Visibility::Detect(const Graph& graph, const Registry& registry,
                               const DetectionScope& scope) const {
  Transaction transaction;
  if (looks_ == nullptr || scope.features != nullptr || scope.level != 0) {
    return transaction;
  }
  const Search search(*looks_, sectored_, graph, registry, options_);
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
