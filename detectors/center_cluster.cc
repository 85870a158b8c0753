#include <plumbline/detectors/center_cluster.h>
#include <plumbline/detectors/parameters.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr char kClusterName[] = "center_cluster";
constexpr char kCenterName[] = "circle_center";
// Rounds of assigning circles and moving centres; centres settle in few.
constexpr int kRounds = 5;

struct Circle {
  FeatureId id;
  Eigen::Vector2d center;
  // How far the common centre may be.
  double gate;
  // Index of the common centre, -1 for none.
  int common = -1;
};

// Positions that are looked up by place.
class Centers {
 public:
  explicit Centers(double cell) : cell_(cell) {}

  int Add(const Eigen::Vector2d& position) {
    positions_.push_back(position);
    const int index = static_cast<int>(positions_.size()) - 1;
    cells_[CellOf(position)].push_back(index);
    return index;
  }

  // The nearest within `gate`, which is at most the cell; -1 for none.
  int FindNearest(const Eigen::Vector2d& position, double gate) const {
    const Cell center = CellOf(position);
    int nearest = -1;
    double smallest = gate;
    for (std::int64_t x = center.first - 1; x <= center.first + 1; ++x) {
      for (std::int64_t y = center.second - 1; y <= center.second + 1; ++y) {
        const auto found = cells_.find({x, y});
        if (found == cells_.end()) continue;
        for (const int index : found->second) {
          const double distance =
              (positions_[static_cast<std::size_t>(index)] - position).norm();
          if (distance > smallest ||
              (distance == smallest && nearest >= 0 && index > nearest)) {
            continue;
          }
          smallest = distance;
          nearest = index;
        }
      }
    }
    return nearest;
  }

  int size() const { return static_cast<int>(positions_.size()); }
  const Eigen::Vector2d& position(int index) const {
    return positions_[static_cast<std::size_t>(index)];
  }

 private:
  using Cell = std::pair<std::int64_t, std::int64_t>;

  Cell CellOf(const Eigen::Vector2d& position) const {
    return {static_cast<std::int64_t>(std::floor(position.x() / cell_)),
            static_cast<std::int64_t>(std::floor(position.y() / cell_))};
  }

  double cell_;
  std::vector<Eigen::Vector2d> positions_;
  std::map<Cell, std::vector<int>> cells_;
};

// Centres of gravity of the circles without a common centre that are near to
// each other, at least `minimum` in a cluster.
std::vector<Eigen::Vector2d> Cluster(const std::vector<Circle>& circles,
                                     double gate, std::size_t minimum) {
  std::vector<Eigen::Vector2d> means;
  for (int round = 0; round <= kRounds; ++round) {
    Centers centers(gate);
    for (const Eigen::Vector2d& mean : means) centers.Add(mean);
    std::vector<Eigen::Vector2d> sums(means.size(), Eigen::Vector2d::Zero());
    std::vector<std::size_t> counts(means.size(), 0);
    for (const Circle& circle : circles) {
      if (circle.common >= 0) continue;
      int index = centers.FindNearest(circle.center, circle.gate);
      if (index < 0) {
        index = centers.Add(circle.center);
        sums.emplace_back(Eigen::Vector2d::Zero());
        counts.push_back(0);
      }
      sums[static_cast<std::size_t>(index)] += circle.center;
      ++counts[static_cast<std::size_t>(index)];
    }
    means.clear();
    for (std::size_t i = 0; i < sums.size(); ++i) {
      if (counts[i] == 0) continue;
      // In the last round the small ones go.
      if (round == kRounds && counts[i] < minimum) continue;
      means.emplace_back(sums[i] / static_cast<double>(counts[i]));
    }
  }
  return means;
}

void BindCenters(ParameterBinder* parameters, CenterClusterOptions* options) {
  parameters->Length("gate", &options->gate, 1e-6, ParameterBinder::kNoLimit,
                     "how near to a common centre a circle's centre has it");
  parameters->Length("sigma", &options->sigma, 1e-6, ParameterBinder::kNoLimit,
                     "tolerance of a centre against the common one");
}

void BindClusters(ParameterBinder* parameters, CenterClusterOptions* options) {
  BindCenters(parameters, options);
  parameters->Count("minimum_support", &options->minimum_support, 2,
                    "fewest circles that make a common centre");
}

// Whether a live constraint ties the circle to a common centre one level up.
bool HasCenter(const Graph& graph, const Feature& circle) {
  for (const ConstraintId id : graph.ConstraintsOf(circle.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (constraint.state != ConstraintState::kLive ||
        constraint.kind != ConstraintClass::kStructure ||
        !constraint.type->Is(RelationRole::kCoincidence)) {
      continue;
    }
    for (const FeatureId other_id : constraint.features) {
      const Feature& other = graph.GetFeature(other_id);
      if (other.is_virtual && other.level == circle.level + 1) return true;
    }
  }
  return false;
}

// Circles of the scope that have no common centre yet.
std::vector<Circle> CirclesWithoutCenter(const Graph& graph,
                                         const DetectionScope& scope,
                                         double gate) {
  std::vector<Circle> circles;
  for (const Feature* feature : FeaturesInScope(graph, scope)) {
    if (!feature->type->Is(FeatureRole::kCircle) || HasCenter(graph, *feature))
      continue;
    Circle circle;
    circle.id = feature->id;
    circle.center = {feature->parameters[0], feature->parameters[1]};
    // Columns side by side are not concentric.
    circle.gate = std::min(gate, 0.5 * std::abs(feature->parameters[2]));
    if (!circle.center.allFinite() || !std::isfinite(circle.gate)) continue;
    circles.push_back(circle);
  }
  return circles;
}

// Centres that are in the graph, with their features.
struct KnownCenters {
  std::vector<FeatureId> ids;
  std::vector<Eigen::Vector2d> positions;
};

KnownCenters ReadCenters(const Graph& graph, int level) {
  KnownCenters known;
  for (const FeatureId id : graph.VirtualFeatures(level)) {
    const Feature& feature = graph.GetFeature(id);
    const Eigen::Vector2d position(feature.parameters[0],
                                   feature.parameters[1]);
    if (!feature.type->Is(FeatureRole::kPoint) || !position.allFinite()) {
      continue;
    }
    known.ids.push_back(id);
    known.positions.push_back(position);
  }
  return known;
}

// Gives circles without a centre the nearest within their gates; `members`
// counts the circles of each centre. True when there was one.
bool Assign(const Centers& centers, std::vector<Circle>* circles,
            std::vector<int>* members) {
  bool has_assigned = false;
  members->resize(static_cast<std::size_t>(centers.size()), 0);
  for (Circle& circle : *circles) {
    if (circle.common >= 0) continue;
    circle.common = centers.FindNearest(circle.center, circle.gate);
    if (circle.common < 0) continue;
    ++(*members)[static_cast<std::size_t>(circle.common)];
    has_assigned = true;
  }
  return has_assigned;
}

}  // namespace

CenterCluster::CenterCluster(std::string name,
                             const CenterClusterOptions& options)
    : name_(std::move(name)), options_(options) {}

Transaction CenterCluster::Detect(const Graph& graph, const Registry& registry,
                                  const DetectionScope& scope) const {
  Transaction transaction;
  std::vector<Circle> circles =
      CirclesWithoutCenter(graph, scope, options_.gate);
  if (circles.empty()) return transaction;

  KnownCenters known = ReadCenters(graph, scope.level + 1);
  Centers centers(options_.gate);
  for (const Eigen::Vector2d& position : known.positions) {
    centers.Add(position);
  }
  const int num_existing = centers.size();
  std::vector<int> members;
  Assign(centers, &circles, &members);
  // Until nothing is left that a later call would find.
  for (bool has_assigned = true; has_assigned;) {
    for (const Eigen::Vector2d& mean :
         Cluster(circles, options_.gate,
                 static_cast<std::size_t>(options_.minimum_support))) {
      centers.Add(mean);
    }
    has_assigned = Assign(centers, &circles, &members);
  }

  std::int64_t small = 0;
  std::vector<FeatureId> ids = std::move(known.ids);
  ids.resize(static_cast<std::size_t>(centers.size()), kNoId);
  for (int i = num_existing; i < centers.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (members[k] < options_.minimum_support) {
      ++small;
      continue;
    }
    Feature feature;
    feature.type = &registry.GetFeature("point");
    feature.level = scope.level + 1;
    feature.is_virtual = true;
    feature.parameters[0] = centers.position(i).x();
    feature.parameters[1] = centers.position(i).y();
    feature.source = name_;
    ids[k] = transaction.AddFeature(std::move(feature));
  }
  std::int64_t alone = 0;
  for (const Circle& circle : circles) {
    const FeatureId common = circle.common < 0
                                 ? kNoId
                                 : ids[static_cast<std::size_t>(circle.common)];
    if (common == kNoId) {
      ++alone;
      continue;
    }
    transaction.AddConstraint(MakeStructure(
        registry.GetRelation("point_point_coincidence"), {circle.id, common},
        Eigen::Vector2d::Zero(),
        InformationFromSigmas(Eigen::Vector2d::Constant(options_.sigma)),
        name_));
  }
  scope.Count("circles", static_cast<std::int64_t>(circles.size()));
  scope.Count("circles refused: no centre in common", alone);
  scope.Count("centres there", num_existing);
  scope.Count("centres found", centers.size() - num_existing - small);
  scope.Count("centres refused: too few circles", small);
  return transaction;
}

DetectorType CenterClusterType() {
  DetectorType type;
  type.name = kClusterName;
  type.description =
      "Common centres of circles: clusters within the gate, each tied to its "
      "centre of gravity";
  type.reads = {"circle"};
  type.makes = {"point"};
  SetParameters<CenterClusterOptions>(
      BindClusters,
      [](const CenterClusterOptions& options) {
        return std::make_unique<CenterCluster>(kClusterName, options);
      },
      &type);
  return type;
}

DetectorType CircleCenterType() {
  DetectorType type;
  type.name = kCenterName;
  type.description =
      "Centre of every circle, one for those that share it: lines may be seen "
      "through them";
  type.reads = {"circle"};
  type.makes = {"point"};
  SetParameters<CenterClusterOptions>(
      BindCenters,
      [](CenterClusterOptions options) {
        options.minimum_support = 1;
        return std::make_unique<CenterCluster>(kCenterName, options);
      },
      &type);
  return type;
}

}  // namespace plumbline
