#include <plumbline/core/registry.h>
#include <plumbline/detectors/planar_curve.h>
#include <plumbline/detectors/supported_curves.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>

namespace plumbline {
namespace {

// False when it is not there.
template <typename Value>
bool TakeOutOf(std::vector<Value>* values, const Value& value) {
  const auto found = std::find(values->begin(), values->end(), value);
  if (found == values->end()) return false;
  values->erase(found);
  return true;
}

// Whether nothing but structure holds a curve and its points are all known.
bool MayGo(const Graph& graph, const SupportedCurve& curve) {
  const Feature& feature = graph.GetFeature(curve.id);
  if (!feature.is_virtual || feature.fixed) return false;
  std::size_t from_below = 0;
  for (const ConstraintId id : graph.ConstraintsOf(curve.id)) {
    const Constraint& constraint = *graph.FindConstraint(id);
    if (constraint.state != ConstraintState::kLive) continue;
    if (constraint.kind == ConstraintClass::kMeasurement) return false;
    if (graph.GetFeature(constraint.features[0]).level < feature.level) {
      ++from_below;
    }
  }
  return from_below == curve.found.support.size();
}

}  // namespace

SupportedCurves::SupportedCurves(const Graph& graph, const PointGraph& points)
    : points_(points), on_(static_cast<std::size_t>(points.size())) {
  Read(graph);
  IndexPoints();
}

void SupportedCurves::Read(const Graph& graph) {
  std::map<FeatureId, SupportedCurve> entries;
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
      SupportedCurve& entry = entries[feature.id];
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
    curves_.push_back(std::move(entry));
  }
}

void SupportedCurves::IndexPoints() {
  for (std::vector<std::size_t>& curves : on_) curves.clear();
  for (std::size_t c = 0; c < curves_.size(); ++c) {
    for (const int i : curves_[c].found.support) {
      on_[static_cast<std::size_t>(i)].push_back(c);
    }
  }
}

std::vector<std::size_t> SupportedCurves::Touching(std::size_t curve) const {
  std::vector<std::size_t> others;
  for (const int i : curves_[curve].found.support) {
    const auto& own = on_[static_cast<std::size_t>(i)];
    others.insert(others.end(), own.begin(), own.end());
    for (const int j : points_.neighbors(i)) {
      const auto& next = on_[static_cast<std::size_t>(j)];
      others.insert(others.end(), next.begin(), next.end());
    }
  }
  std::sort(others.begin(), others.end());
  others.erase(std::unique(others.begin(), others.end()), others.end());
  others.erase(std::lower_bound(others.begin(), others.end(), curve));
  return others;
}

double SupportedCurves::GapLimit(const FoundCurve& found,
                                 double max_gap) const {
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
  if (gaps.empty()) return max_gap;
  const auto middle =
      gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  return std::max(max_gap, 3.0 * *middle);
}

void SupportedCurves::Add(FoundCurve found) {
  SupportedCurve curve;
  curve.found = std::move(found);
  curve.joining = curve.found.support;
  for (const int i : curve.found.support) {
    on_[static_cast<std::size_t>(i)].push_back(curves_.size());
  }
  curves_.push_back(std::move(curve));
}

void SupportedCurves::AddPoint(std::size_t curve, int point) {
  SupportedCurve& entry = curves_[curve];
  on_[static_cast<std::size_t>(point)].push_back(curve);
  entry.found.support.push_back(point);
  // One that was to leave is still tied to it.
  if (!TakeOutOf(&entry.leaving, point)) entry.joining.push_back(point);
}

void SupportedCurves::TakeOut(std::size_t curve, int point) {
  SupportedCurve& entry = curves_[curve];
  entry.is_dirty = true;
  TakeOutOf(&entry.found.support, point);
  if (!TakeOutOf(&entry.joining, point)) entry.leaving.push_back(point);
  TakeOutOf(&on_[static_cast<std::size_t>(point)], curve);
}

void SupportedCurves::Remove(const std::vector<bool>& is_removed) {
  std::size_t kept = 0;
  for (std::size_t c = 0; c < curves_.size(); ++c) {
    if (is_removed[c]) continue;
    if (kept < c) curves_[kept] = std::move(curves_[c]);
    ++kept;
  }
  curves_.resize(kept);
  IndexPoints();
}

}  // namespace plumbline
