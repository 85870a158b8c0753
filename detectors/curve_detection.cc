#include <plumbline/detectors/curve_detection.h>
#include <plumbline/detectors/point_graph.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr int kMaxRounds = 50;

// A curve with the points that support it, those that are proposed included.
struct Entry {
  // kNoId for a new one.
  FeatureId id = kNoId;
  FoundCurve found;
  // Points of found.support that are not tied to it yet.
  std::vector<int> joining;
  // It may be taken out when it turns out to be the same as another.
  bool may_go = true;
};

class CurveDetection {
 public:
  CurveDetection(const Graph& graph, const DetectionScope& scope,
                 CurveKind kind, const CurveSearchOptions& options)
      : points_(graph, scope, options.reach),
        options_(options),
        kind_(kind),
        entries_of_(static_cast<std::size_t>(points_.size())),
        support_stamp_(entries_of_.size(), 0) {
    Load(graph);
    // Until a further call would find nothing.
    for (int round = 0; round < kMaxRounds; ++round) {
      IndexEntries();
      bool has_changed = Merge();
      if (has_changed) IndexEntries();
      for (std::size_t e = 0; e < entries_.size(); ++e) {
        if (entries_[e].found.curve.kind == kind_ && Extend(e)) {
          has_changed = true;
        }
      }
      if (!has_changed && !Search(scope.seed)) break;
    }
  }

  Transaction Propose(const Graph& graph, const Registry& registry, int level,
                      const std::string& source) const {
    Transaction transaction;
    for (const FeatureId id : removed_) {
      for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
        if (graph.FindConstraint(constraint_id)->state ==
            ConstraintState::kLive) {
          transaction.RemoveConstraint(constraint_id);
        }
      }
      transaction.RemoveFeature(id);
    }
    const bool is_line = kind_ == CurveKind::kLine;
    for (const Entry& entry : entries_) {
      if (entry.joining.empty()) continue;
      FeatureId id = entry.id;
      if (id == kNoId) {
        Feature feature =
            is_line ? MakeLine(entry.found) : MakeCircle(entry.found);
        feature.type = &registry.GetFeature(is_line ? "line" : "circle");
        feature.level = level + 1;
        feature.is_virtual = true;
        feature.source = source;
        id = transaction.AddFeature(std::move(feature));
      }
      std::vector<int> joining = entry.joining;
      std::sort(joining.begin(), joining.end());
      for (const int i : joining) {
        Constraint constraint;
        constraint.type = &registry.GetRelation(
            is_line ? "point_line_distance" : "point_circle_distance");
        constraint.features = {points_.id(i), id};
        constraint.expected = Eigen::VectorXd::Zero(1);
        constraint.information = Eigen::MatrixXd::Constant(
            1, 1, 1.0 / (options_.sigma * options_.sigma));
        constraint.kind = ConstraintClass::kStructure;
        constraint.source = source;
        transaction.AddConstraint(std::move(constraint));
      }
    }
    return transaction;
  }

 private:
  // Curves of the graph that points are tied to.
  void Load(const Graph& graph) {
    std::map<FeatureId, Entry> entries;
    for (int i = 0; i < points_.size(); ++i) {
      for (const ConstraintId id : graph.ConstraintsOf(points_.id(i))) {
        const Constraint& constraint = *graph.FindConstraint(id);
        if (constraint.kind != ConstraintClass::kStructure ||
            constraint.features.size() != 2) {
          continue;
        }
        const Feature& feature = graph.GetFeature(constraint.features[1]);
        PlanarCurve curve;
        if (constraint.type->name == "point_line_distance") {
          const double d = feature.parameters[0];
          const double alpha = feature.parameters[1];
          curve.kind = CurveKind::kLine;
          curve.direction = alpha;
          curve.position = {feature.anchor[0] - d * std::sin(alpha),
                            feature.anchor[1] + d * std::cos(alpha)};
        } else if (constraint.type->name == "point_circle_distance") {
          curve.kind = CurveKind::kCircle;
          curve.position = {feature.parameters[0], feature.parameters[1]};
          curve.radius = feature.parameters[2];
        } else {
          continue;
        }
        if (constraint.state != ConstraintState::kLive) {
          // An outlier of that curve is no sign of another.
          outliers_.push_back(i);
          continue;
        }
        Entry& entry = entries[feature.id];
        entry.id = feature.id;
        entry.found.curve = curve;
        if (!entry.found.support.empty() && entry.found.support.back() == i) {
          continue;
        }
        entry.found.support.push_back(i);
      }
    }
    for (auto& [id, entry] : entries) {
      entry.may_go = MayGo(graph, entry);
      entries_.push_back(std::move(entry));
    }
  }

  // A curve that nothing but structure holds and whose points are all known.
  static bool MayGo(const Graph& graph, const Entry& entry) {
    const Feature& feature = graph.GetFeature(entry.id);
    if (!feature.is_virtual || feature.fixed) return false;
    std::size_t from_below = 0;
    for (const ConstraintId id : graph.ConstraintsOf(entry.id)) {
      const Constraint& constraint = *graph.FindConstraint(id);
      if (constraint.state != ConstraintState::kLive) continue;
      if (constraint.kind == ConstraintClass::kMeasurement) return false;
      if (graph.GetFeature(constraint.features[0]).level < feature.level) {
        ++from_below;
      }
    }
    return from_below == entry.found.support.size();
  }

  void IndexEntries() {
    for (std::vector<std::size_t>& entries : entries_of_) entries.clear();
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      for (const int i : entries_[e].found.support) {
        entries_of_[static_cast<std::size_t>(i)].push_back(e);
      }
    }
  }

  double GapLimit(const FoundCurve& found) const {
    const CurveRuler ruler(found.curve);
    std::vector<double> along;
    for (const int i : found.support) {
      along.push_back(ruler.Along(points_.position(i)));
    }
    std::sort(along.begin(), along.end());
    std::vector<double> gaps;
    for (std::size_t i = 1; i < along.size(); ++i) {
      gaps.push_back(along[i] - along[i - 1]);
    }
    if (gaps.empty()) return options_.max_gap;
    const auto middle =
        gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
    std::nth_element(gaps.begin(), middle, gaps.end());
    return std::max(options_.max_gap, 3.0 * *middle);
  }

  // Takes out curves that have become the same as another one with more
  // support. True when there were any.
  bool Merge() {
    std::vector<bool> is_merged(entries_.size(), false);
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      const Entry& entry = entries_[e];
      if (entry.found.curve.kind != kind_ || !entry.may_go) continue;
      // Curves that touch this one.
      std::set<std::size_t> others;
      for (const int i : entry.found.support) {
        const auto& own = entries_of_[static_cast<std::size_t>(i)];
        others.insert(own.begin(), own.end());
        for (const int j : points_.neighbors(i)) {
          const auto& next = entries_of_[static_cast<std::size_t>(j)];
          others.insert(next.begin(), next.end());
        }
      }
      others.erase(e);
      for (const std::size_t o : others) {
        const Entry& other = entries_[o];
        const std::size_t size = entry.found.support.size();
        const std::size_t other_size = other.found.support.size();
        if (other.found.curve.kind != kind_ || is_merged[o] ||
            size > other_size || (size == other_size && e < o) ||
            !IsSame(entry, other)) {
          continue;
        }
        is_merged[e] = true;
        break;
      }
    }
    bool has_merged = false;
    for (std::size_t e = entries_.size(); e-- > 0;) {
      if (!is_merged[e]) continue;
      has_merged = true;
      if (entries_[e].id != kNoId) removed_.push_back(entries_[e].id);
      entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(e));
    }
    return has_merged;
  }

  // Whether the support of a curve lies on the other as well as it should on
  // its own.
  bool IsSame(const Entry& entry, const Entry& other) const {
    const CurveRuler ruler(other.found.curve);
    double sum = 0.0;
    for (const int i : entry.found.support) {
      const double distance =
          std::abs(ruler.SignedDistance(points_.position(i)));
      if (distance > options_.gate) return false;
      sum += distance * distance;
    }
    const auto count = static_cast<double>(entry.found.support.size());
    return sum <= count * 0.5 * options_.gate * 0.5 * options_.gate;
  }

  // How near to a curve a point must be to join it. Where curves cross, some
  // point of one lies near the other by chance, and tying it there would hold
  // the one by the other along its own direction, in which nothing else may.
  double JoinGate(const PlanarCurve& curve, int i) const {
    double gate = options_.gate;
    for (const std::size_t e : entries_of_[static_cast<std::size_t>(i)]) {
      const Eigen::Vector2d& position = points_.position(i);
      const double angle =
          NormalizeAxial(Direction(curve, position) -
                         Direction(entries_[e].found.curve, position));
      gate = std::min(gate, std::abs(angle) > options_.min_corner
                                ? options_.sigma
                                : 0.5 * options_.gate);
    }
    return gate;
  }

  // Of the tangent at the foot of a point, rad.
  static double Direction(const PlanarCurve& curve,
                          const Eigen::Vector2d& point) {
    if (curve.kind == CurveKind::kLine) return curve.direction;
    const Eigen::Vector2d arm = point - curve.position;
    return std::atan2(arm.x(), -arm.y());
  }

  // Adds connected points near the curve to its support; false when there are
  // none.
  bool Extend(std::size_t index) {
    Entry& entry = entries_[index];
    FoundCurve& found = entry.found;
    const std::size_t before = found.support.size();
    const double limit = GapLimit(found);
    const CurveRuler ruler(found.curve);
    ++stamp_;
    struct Step {
      int point;
      // The last one on the curve on the way, and the points off it since.
      int from;
      int gap;
    };
    std::deque<Step> queue;
    for (const int i : found.support) {
      support_stamp_[static_cast<std::size_t>(i)] = stamp_;
      queue.push_back({i, i, 0});
    }
    std::map<int, int> gaps;
    while (!queue.empty()) {
      const Step step = queue.front();
      queue.pop_front();
      for (const int i : points_.neighbors(step.point)) {
        const auto k = static_cast<std::size_t>(i);
        if (support_stamp_[k] == stamp_) continue;
        const double distance =
            std::abs(ruler.SignedDistance(points_.position(i)));
        if (distance <= JoinGate(found.curve, i) &&
            (points_.position(i) - points_.position(step.from)).norm() <=
                limit) {
          support_stamp_[k] = stamp_;
          entries_of_[k].push_back(index);
          found.support.push_back(i);
          entry.joining.push_back(i);
          queue.push_front({i, i, 0});
          continue;
        }
        const int gap = step.gap + 1;
        if (gap > options_.max_gap_points) continue;
        const auto visited = gaps.emplace(i, gap);
        if (!visited.second) {
          if (visited.first->second <= gap) continue;
          visited.first->second = gap;
        }
        queue.push_back({i, step.from, gap});
      }
    }
    std::sort(found.support.begin(), found.support.end());
    return found.support.size() > before;
  }

  // Points that support a curve or are left over of one.
  std::vector<bool> Claimed() const {
    std::vector<bool> is_claimed(entries_of_.size(), false);
    for (const int i : outliers_) {
      is_claimed[static_cast<std::size_t>(i)] = true;
    }
    for (const Entry& entry : entries_) {
      const FoundCurve& found = entry.found;
      const CurveRuler ruler(found.curve);
      double sum = 0.0;
      for (const int i : found.support) {
        const double distance = ruler.SignedDistance(points_.position(i));
        sum += distance * distance;
      }
      const double near = std::max(
          options_.gate,
          3.0 * std::sqrt(sum / static_cast<double>(found.support.size())));
      std::map<int, int> steps;
      std::vector<int> queue;
      for (const int i : found.support) {
        is_claimed[static_cast<std::size_t>(i)] = true;
        steps[i] = 0;
        queue.push_back(i);
      }
      for (std::size_t k = 0; k < queue.size(); ++k) {
        const int next = steps.at(queue[k]) + 1;
        if (next > options_.max_gap_points) break;
        for (const int i : points_.neighbors(queue[k])) {
          if (!steps.emplace(i, next).second) continue;
          queue.push_back(i);
          if (std::abs(ruler.SignedDistance(points_.position(i))) <= near) {
            is_claimed[static_cast<std::size_t>(i)] = true;
          }
        }
      }
    }
    return is_claimed;
  }

  // Adds new curves of the kind; false when there are none.
  bool Search(std::uint64_t seed) {
    std::vector<FoundCurve> known;
    for (const Entry& entry : entries_) known.push_back(entry.found);
    bool has_found = false;
    for (FoundCurve& found :
         SearchCurves(points_, Claimed(), known, seed, options_)) {
      if (found.curve.kind != kind_) continue;
      Entry entry;
      entry.found = std::move(found);
      entry.joining = entry.found.support;
      entries_.push_back(std::move(entry));
      has_found = true;
    }
    return has_found;
  }

  Feature MakeLine(const FoundCurve& found) const {
    Feature feature;
    const PlanarCurve& line = found.curve;
    feature.anchor = {line.position.x(), line.position.y()};
    feature.parameters[1] = line.direction;
    feature.extent_begin = std::numeric_limits<double>::infinity();
    feature.extent_end = -feature.extent_begin;
    for (const int i : found.support) {
      const double along = line.Along(points_.position(i));
      feature.extent_begin = std::min(feature.extent_begin, along);
      feature.extent_end = std::max(feature.extent_end, along);
    }
    return feature;
  }

  static Feature MakeCircle(const FoundCurve& found) {
    Feature feature;
    feature.parameters[0] = found.curve.position.x();
    feature.parameters[1] = found.curve.position.y();
    feature.parameters[2] = found.curve.radius;
    return feature;
  }

  const PointGraph points_;
  const CurveSearchOptions& options_;
  const CurveKind kind_;
  std::vector<Entry> entries_;
  // Curves of the graph that are the same as another.
  std::vector<FeatureId> removed_;
  // Points with a broken constraint to a curve that is still there.
  std::vector<int> outliers_;
  // Indices of those that each point supports.
  std::vector<std::vector<std::size_t>> entries_of_;
  // Scratch of Extend: equal to stamp_ for the support of the curve.
  std::vector<int> support_stamp_;
  int stamp_ = 0;
};

}  // namespace

Transaction DetectCurves(const Graph& graph, const Registry& registry,
                         const DetectionScope& scope, CurveKind kind,
                         const std::string& source,
                         const CurveSearchOptions& options) {
  return CurveDetection(graph, scope, kind, options)
      .Propose(graph, registry, scope.level, source);
}

DetectorParameters CurveSearchDefaults() {
  const CurveSearchOptions defaults;
  return {
      {"tolerance", defaults.tolerance},
      {"sigma", defaults.sigma},
      {"gate", defaults.gate},
      {"max_log_false_alarms", defaults.max_log_false_alarms},
      {"max_gap_points", static_cast<double>(defaults.max_gap_points)},
      {"max_gap", defaults.max_gap},
      {"min_line_points", static_cast<double>(defaults.min_line_points)},
      {"min_circle_points", static_cast<double>(defaults.min_circle_points)},
      {"min_arc_deg", RadToDeg(defaults.min_arc)},
      {"min_corner_deg", RadToDeg(defaults.min_corner)},
      {"max_radius", defaults.max_radius},
      {"reach", static_cast<double>(defaults.reach)},
  };
}

CurveSearchOptions ReadCurveSearchOptions(const ParameterReader& reader) {
  CurveSearchOptions options;
  options.tolerance = reader.Get("tolerance", 1e-6);
  options.sigma = reader.Get("sigma", 1e-6);
  options.gate = reader.Get("gate", 1e-6);
  options.max_log_false_alarms = reader.Get("max_log_false_alarms");
  options.max_gap_points = reader.GetInt("max_gap_points", 0);
  options.max_gap = reader.Get("max_gap", 0.0);
  options.min_line_points = reader.GetInt("min_line_points", 3);
  options.min_circle_points = reader.GetInt("min_circle_points", 4);
  options.min_arc = DegToRad(reader.Get("min_arc_deg", 0.0, 360.0));
  options.min_corner = DegToRad(reader.Get("min_corner_deg", 0.0, 90.0));
  options.max_radius = reader.Get("max_radius", 0.0);
  options.reach = reader.GetInt("reach", 0);
  return options;
}

}  // namespace plumbline
