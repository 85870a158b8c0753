#include <plumbline/detectors/curve_detection.h>
#include <plumbline/detectors/curve_growth.h>
#include <plumbline/detectors/curve_search_region.h>
#include <plumbline/detectors/point_graph.h>
#include <plumbline/detectors/same_curves.h>
#include <plumbline/detectors/supported_curves.h>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr int kMaxRounds = 50;

class CurveDetection {
 public:
  CurveDetection(const Graph& graph, const DetectionScope& scope,
                 CurveKind kind, const CurveSearchOptions& options)
      : points_(graph, scope, options.reach),
        options_(options),
        kind_(kind),
        curves_(graph, points_),
        growth_(points_, options),
        region_(points_, options) {
    // Until a further call would find nothing. What did not change is not
    // looked at again: a large graph needs many rounds, each for a few places.
    for (int round = 0; round < kMaxRounds; ++round) {
      bool has_changed = TakeOutSame();
      for (std::size_t c = 0; c < curves_.size(); ++c) {
        SupportedCurve& curve = curves_[c];
        if (!curve.is_dirty) continue;
        curve.is_dirty =
            curve.found.curve.kind == kind_ && growth_.Extend(c, &curves_);
        if (!curve.is_dirty) continue;
        has_changed = true;
        region_.Touch(curve);
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
    for (const SupportedCurve& curve : curves_.all()) {
      for (const int i : curve.leaving) LetGo(graph, curve.id, i, &transaction);
      if (curve.joining.empty()) continue;
      FeatureId id = curve.id;
      if (id == kNoId) {
        Feature feature =
            is_line ? MakeLine(curve.found) : MakeCircle(curve.found);
        feature.type = &registry.GetFeature(is_line ? "line" : "circle");
        feature.level = level + 1;
        feature.is_virtual = true;
        feature.source = source;
        id = transaction.AddFeature(std::move(feature));
      }
      std::vector<int> joining = curve.joining;
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
  // True when there were any.
  bool TakeOutSame() {
    const std::vector<SupportedCurve> gone =
        TakeOutSameCurves(points_, kind_, options_, &curves_);
    for (const SupportedCurve& curve : gone) {
      region_.Touch(curve);
      if (curve.id != kNoId) removed_.push_back(curve.id);
    }
    return !gone.empty();
  }

  // Removes what ties a point to a curve of the graph.
  void LetGo(const Graph& graph, FeatureId curve, int point,
             Transaction* transaction) const {
    for (const ConstraintId id : graph.ConstraintsOf(points_.id(point))) {
      const Constraint& constraint = *graph.FindConstraint(id);
      if (constraint.state == ConstraintState::kLive &&
          constraint.kind == ConstraintClass::kStructure &&
          constraint.features.size() == 2 && constraint.features[1] == curve &&
          constraint.type->Is(RelationRole::kOnCurve)) {
        transaction->RemoveConstraint(id);
      }
    }
  }

  // Adds new curves of the kind; false when there are none.
  bool Search(const DetectionScope& scope) {
    const std::vector<bool> is_out = region_.Take(curves_);
    std::vector<FoundCurve> known;
    for (const SupportedCurve& curve : curves_.all()) {
      known.push_back(curve.found);
    }
    bool has_found = false;
    for (FoundCurve& found :
         SearchCurves(points_, is_out, known, scope.seed, options_, scope)) {
      if (found.curve.kind != kind_) continue;
      curves_.Add(std::move(found));
      region_.Touch(curves_.all().back());
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
  SupportedCurves curves_;
  CurveGrowth growth_;
  CurveSearchRegion region_;
  // Curves of the graph that are the same as another.
  std::vector<FeatureId> removed_;
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
