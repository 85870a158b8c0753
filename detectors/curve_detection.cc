#include <plumbline/core/wall.h>
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
  // It, or what lies near it, changed since it was last compared with others
  // and extended.
  bool is_dirty = true;
};

class CurveDetection {
 public:
  CurveDetection(const Graph& graph, const DetectionScope& scope,
                 CurveKind kind, const CurveSearchOptions& options)
      : points_(graph, scope, options.reach),
        options_(options),
        kind_(kind),
        entries_of_(static_cast<std::size_t>(points_.size())),
        stamps_(entries_of_.size(), 0),
        steps_(entries_of_.size(), 0),
        is_claimed_(entries_of_.size(), false),
        is_unsearched_(entries_of_.size(), true) {
    Load(graph);
    IndexEntries();
    // Until a further call would find nothing. What did not change is not
    // looked at again: a large graph needs many rounds, each for a few places.
    for (int round = 0; round < kMaxRounds; ++round) {
      bool has_changed = Merge();
      if (has_changed) IndexEntries();
      for (std::size_t e = 0; e < entries_.size(); ++e) {
        Entry& entry = entries_[e];
        if (!entry.is_dirty) continue;
        entry.is_dirty = entry.found.curve.kind == kind_ && Extend(e);
        if (!entry.is_dirty) continue;
        has_changed = true;
        Touch(entry);
      }
      if (scope.ShouldStop()) break;
      if (!has_changed && !Search(scope)) break;
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
        transaction.AddConstraint(MakeStructure(
            registry.GetRelation(is_line ? "point_line_distance"
                                         : "point_circle_distance"),
            {points_.id(i), id}, Eigen::VectorXd::Zero(1),
            InformationFromSigmas(Eigen::VectorXd::Constant(1, options_.sigma)),
            source));
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
        if (!constraint.type->Is(RelationRole::kOnCurve)) continue;
        if (feature.type->Is(FeatureRole::kWall)) {
          const Eigen::Vector3d frame = feature.type->frame(feature);
          curve.kind = CurveKind::kLine;
          curve.position = frame.head<2>();
          curve.direction = frame[2];
        } else if (feature.type->Is(FeatureRole::kCircle)) {
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

  // Curves that touch another one, ascending.
  std::vector<std::size_t> Touching(std::size_t e) const {
    std::vector<std::size_t> others;
    for (const int i : entries_[e].found.support) {
      const auto& own = entries_of_[static_cast<std::size_t>(i)];
      others.insert(others.end(), own.begin(), own.end());
      for (const int j : points_.neighbors(i)) {
        const auto& next = entries_of_[static_cast<std::size_t>(j)];
        others.insert(others.end(), next.begin(), next.end());
      }
    }
    std::sort(others.begin(), others.end());
    others.erase(std::unique(others.begin(), others.end()), others.end());
    others.erase(std::lower_bound(others.begin(), others.end(), e));
    return others;
  }

  // Takes out curves that have become the same as another one with more
  // support. True when there were any.
  bool Merge() {
    std::set<std::size_t> compared;
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      if (!entries_[e].is_dirty) continue;
      compared.insert(e);
      for (const std::size_t o : Touching(e)) compared.insert(o);
    }
    std::vector<bool> is_merged(entries_.size(), false);
    bool has_merged = false;
    for (const std::size_t e : compared) {
      const Entry& entry = entries_[e];
      if (entry.found.curve.kind != kind_ || !entry.may_go) continue;
      for (const std::size_t o : Touching(e)) {
        const Entry& other = entries_[o];
        const std::size_t size = entry.found.support.size();
        const std::size_t other_size = other.found.support.size();
        if (other.found.curve.kind != kind_ || is_merged[o] ||
            size > other_size || (size == other_size && e < o) ||
            !IsSame(entry, other)) {
          continue;
        }
        is_merged[e] = true;
        has_merged = true;
        break;
      }
    }
    if (!has_merged) return false;
    for (const std::size_t e : compared) {
      if (!is_merged[e]) continue;
      // Its points are free to join others.
      for (const std::size_t o : Touching(e)) entries_[o].is_dirty = true;
      Touch(entries_[e]);
      if (entries_[e].id != kNoId) removed_.push_back(entries_[e].id);
    }
    std::size_t kept = 0;
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      if (is_merged[e]) continue;
      if (kept < e) entries_[kept] = std::move(entries_[e]);
      ++kept;
    }
    entries_.resize(kept);
    return true;
  }

  // Whether a line ends before the other begins, by more than a line may have
  // no points: walls in line with each other, of neighbouring buildings for
  // one, are two.
  bool IsApart(const Entry& entry, const Entry& other) const {
    const CurveRuler ruler(other.found.curve);
    const double infinity = std::numeric_limits<double>::infinity();
    double begin = infinity, end = -infinity;
    for (const int i : other.found.support) {
      const double along = ruler.Along(points_.position(i));
      begin = std::min(begin, along);
      end = std::max(end, along);
    }
    double gap = infinity;
    for (const int i : entry.found.support) {
      const double along = ruler.Along(points_.position(i));
      gap = std::min(gap, std::max(begin - along, along - end));
    }
    return gap > GapLimit(other.found);
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
    return sum <= count * 0.5 * options_.gate * 0.5 * options_.gate &&
           (kind_ == CurveKind::kCircle || !IsApart(entry, other));
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
      stamps_[static_cast<std::size_t>(i)] = stamp_;
      queue.push_back({i, i, 0});
    }
    std::map<int, int> gaps;
    while (!queue.empty()) {
      const Step step = queue.front();
      queue.pop_front();
      for (const int i : points_.neighbors(step.point)) {
        const auto k = static_cast<std::size_t>(i);
        if (stamps_[k] == stamp_) continue;
        const double distance =
            std::abs(ruler.SignedDistance(points_.position(i)));
        if (distance <= JoinGate(found.curve, i) &&
            (points_.position(i) - points_.position(step.from)).norm() <=
                limit) {
          stamps_[k] = stamp_;
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

  // A search may find something else near the support of a curve that came,
  // grew or went.
  void Touch(const Entry& entry) {
    touched_.insert(touched_.end(), entry.found.support.begin(),
                    entry.found.support.end());
  }

  // Visits the points of `queue` and those within `reach` constraints of them;
  // after that `queue` holds them all.
  template <typename Visit>
  void Spread(int reach, std::vector<int>* queue, const Visit& visit) {
    ++stamp_;
    std::size_t count = 0;
    for (const int i : *queue) {
      const auto k = static_cast<std::size_t>(i);
      if (stamps_[k] == stamp_) continue;
      stamps_[k] = stamp_;
      steps_[k] = 0;
      (*queue)[count++] = i;
    }
    queue->resize(count);
    for (std::size_t q = 0; q < queue->size(); ++q) {
      const int from = (*queue)[q];
      visit(from);
      const int step = steps_[static_cast<std::size_t>(from)] + 1;
      if (step > reach) continue;
      for (const int i : points_.neighbors(from)) {
        const auto k = static_cast<std::size_t>(i);
        if (stamps_[k] == stamp_) continue;
        stamps_[k] = stamp_;
        steps_[k] = step;
        queue->push_back(i);
      }
    }
  }

  // Points that support a curve or are left over of one.
  void UpdateClaimed() {
    is_claimed_.assign(is_claimed_.size(), false);
    for (const int i : outliers_) {
      is_claimed_[static_cast<std::size_t>(i)] = true;
    }
    std::vector<int> queue;
    for (const Entry& entry : entries_) {
      const FoundCurve& found = entry.found;
      const CurveRuler ruler(found.curve);
      double sum = 0.0;
      for (const int i : found.support) {
        const double distance = ruler.SignedDistance(points_.position(i));
        sum += distance * distance;
        is_claimed_[static_cast<std::size_t>(i)] = true;
      }
      const double near = std::max(
          options_.gate,
          3.0 * std::sqrt(sum / static_cast<double>(found.support.size())));
      queue = found.support;
      Spread(options_.max_gap_points, &queue, [&](int i) {
        if (std::abs(ruler.SignedDistance(points_.position(i))) <= near) {
          is_claimed_[static_cast<std::size_t>(i)] = true;
        }
      });
    }
  }

  // Marks the points of which a search may say something else than the last
  // one: those connected, past points that are not claimed, with one that is as
  // near to a change as a curve may reach over a gap.
  void UpdateUnsearched() {
    std::vector<int> queue = std::move(touched_);
    touched_.clear();
    // A claim reaches as far as a gap, and what it ends is next to it.
    Spread(2 * options_.max_gap_points + 2, &queue, [&](int i) {
      if (!is_claimed_[static_cast<std::size_t>(i)]) {
        is_unsearched_[static_cast<std::size_t>(i)] = true;
      }
    });
    for (std::size_t q = 0; q < queue.size(); ++q) {
      if (!is_unsearched_[static_cast<std::size_t>(queue[q])]) continue;
      for (const int i : points_.neighbors(queue[q])) {
        const auto k = static_cast<std::size_t>(i);
        if (is_claimed_[k] || is_unsearched_[k]) continue;
        is_unsearched_[k] = true;
        queue.push_back(i);
      }
    }
  }

  // Adds new curves of the kind; false when there are none.
  bool Search(const DetectionScope& scope) {
    UpdateClaimed();
    UpdateUnsearched();
    std::vector<bool> is_out = is_claimed_;
    for (std::size_t i = 0; i < is_out.size(); ++i) {
      is_out[i] = is_out[i] || !is_unsearched_[i];
    }
    is_unsearched_.assign(is_unsearched_.size(), false);
    std::vector<FoundCurve> known;
    for (const Entry& entry : entries_) known.push_back(entry.found);
    bool has_found = false;
    for (FoundCurve& found :
         SearchCurves(points_, is_out, known, scope.seed, options_, scope)) {
      if (found.curve.kind != kind_) continue;
      Entry entry;
      entry.found = std::move(found);
      entry.joining = entry.found.support;
      for (const int i : entry.found.support) {
        entries_of_[static_cast<std::size_t>(i)].push_back(entries_.size());
      }
      Touch(entry);
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
  // Scratch: points that were visited are those with the last stamp, and in how
  // many steps.
  std::vector<int> stamps_;
  std::vector<int> steps_;
  int stamp_ = 0;
  // Points that support a curve or are left over of one, as of the last search.
  std::vector<bool> is_claimed_;
  // Points that no search has looked at since something changed near them.
  std::vector<bool> is_unsearched_;
  // Support of curves that changed since the last search.
  std::vector<int> touched_;
};

}  // namespace

Transaction DetectCurves(const Graph& graph, const Registry& registry,
                         const DetectionScope& scope, CurveKind kind,
                         const std::string& source,
                         const CurveSearchOptions& options) {
  return CurveDetection(graph, scope, kind, options)
      .Propose(graph, registry, scope.level, source);
}

void BindCurveSearch(ParameterBinder* parameters, CurveSearchOptions* options) {
  ParameterBinder& p = *parameters;
  p.Length("tolerance", &options->tolerance, 1e-6, ParameterBinder::kNoLimit,
           "points farther from a curve never support it when it is found");
  p.Length("sigma", &options->sigma, 1e-6, ParameterBinder::kNoLimit,
           "tolerance of a point against its curve");
  p.Length("gate", &options->gate, 1e-6, ParameterBinder::kNoLimit,
           "how near to a curve a connected point joins it");
  p.Number("max_log_false_alarms", &options->max_log_false_alarms,
           -ParameterBinder::kNoLimit, ParameterBinder::kNoLimit, "",
           "log10 of the curves that 1,000 points may show by chance");
  p.Count("max_gap_points", &options->max_gap_points, 0,
          "points between two that support a curve and do not, at most");
  p.Length("max_gap", &options->max_gap, 0.0, ParameterBinder::kNoLimit,
           "longest part of a line without a point");
  p.Count("min_line_points", &options->min_line_points, 3,
          "fewest points of a line");
  p.Count("min_circle_points", &options->min_circle_points, 4,
          "fewest points of a circle");
  p.Angle("min_arc_deg", &options->min_arc, 0.0, 360.0,
          "least arc over which the points of a circle reach");
  p.Angle("min_corner_deg", &options->min_corner, 0.0, 90.0,
          "lines that touch at less are one, bent by drift");
  p.Length("max_radius", &options->max_radius, 0.0, ParameterBinder::kNoLimit,
           "largest circle");
  p.Count("reach", &options->reach, 0,
          "constraints from a listed point to those that are taken along");
}

}  // namespace plumbline
