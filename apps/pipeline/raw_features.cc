#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/frontend/map_builder.h>
#include <plumbline/frontend/point_map_builder.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/raw_features.h>

#include <algorithm>

namespace plumbline {
namespace {

RawFeatureProfile MakeSegments() {
  RawFeatureProfile profile;
  profile.kind = RawFeatures::kSegments;
  profile.name = "segments";
  profile.feature_type = "segment";
  profile.make_builder = [](const LogSolverOptions& options, Graph* graph,
                            const Registry& registry) {
    return std::make_unique<MapBuilder>(graph, registry, options.builder);
  };
  return profile;
}

RawFeatureProfile MakePoints() {
  RawFeatureProfile profile;
  profile.kind = RawFeatures::kPoints;
  profile.name = "points";
  profile.feature_type = "point";
  profile.has_walls = false;
  profile.full_weight_test = true;
  profile.graph_loop_tolerance = kPointsLoopTolerance;
  // Points are bound to farther ones than segments, and there are more.
  profile.max_em_depth = 1;
  // The detectors of lines and circles have the synthetic worlds' noise of
  // decimetres as defaults. A point of a log is placed across its wall by many
  // returns, to a centimetre. Walls go on behind open doors, and a row of
  // points is a wall of its own when it is a hand's breadth from another.
  for (const char* detector : {"line_ransac", "circle_ransac"}) {
    profile.detector_parameters[detector] = {
        {"tolerance", 0.1}, {"gate", 0.06}, {"max_gap", 2.5}, {"reach", 2.0}};
  }
  profile.make_builder = [](const LogSolverOptions& options, Graph* graph,
                            const Registry& registry) {
    return std::make_unique<PointMapBuilder>(graph, registry,
                                             options.point_builder);
  };
  return profile;
}

}  // namespace

const RawFeatureProfile& ProfileOf(RawFeatures kind) {
  static const RawFeatureProfile segments = MakeSegments();
  static const RawFeatureProfile points = MakePoints();
  return kind == RawFeatures::kPoints ? points : segments;
}

const RawFeatureProfile& ProfileOf(
    const std::vector<const FeatureType*>& raw_feature_types) {
  const bool has_points = std::any_of(
      raw_feature_types.begin(), raw_feature_types.end(),
      [](const FeatureType* type) { return type->Is(FeatureRole::kPoint); });
  return ProfileOf(has_points ? RawFeatures::kPoints : RawFeatures::kSegments);
}

LogSolverOptions WithProfile(const RawFeatureProfile& profile,
                             LogSolverOptions options) {
  if (!profile.has_walls) {
    options.global_association = false;
    options.complete_walls = false;
    if (options.refine == Refinement::kFull) options.refine = Refinement::kMap;
  }
  for (const auto& [detector, parameters] : profile.detector_parameters) {
    // What was given stays.
    options.detector_parameters[detector].insert(parameters.begin(),
                                                 parameters.end());
  }
  options.em_depth = std::min(options.em_depth, profile.max_em_depth);
  return options;
}

}  // namespace plumbline
