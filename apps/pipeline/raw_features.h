#ifndef PLUMBLINE_PIPELINE_RAW_FEATURES_H_
#define PLUMBLINE_PIPELINE_RAW_FEATURES_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/graph_builder.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

struct LogSolverOptions;

/// Raw features that a log's scans become: level 0 of the hierarchy.
enum class RawFeatures {
  kSegments,
  kPoints,
};

/// Everything that depends on the kind of raw features. A new kind is a new
/// profile.
struct RawFeatureProfile {
  RawFeatures kind = RawFeatures::kSegments;
  /// As flags have it: "segments".
  std::string name;
  /// Type of the features: "segment".
  std::string feature_type;
  /// Straight walls at level 0. Without them loops are not closed by walls, no
  /// wall is completed, and no refinement goes further than finding the scans
  /// again on the map.
  bool has_walls = true;
  /// EmOptions::full_weight_test where nobody says otherwise.
  bool full_weight_test = false;
  /// EmOptions::loop_tolerance of a graph (of a log: 0).
  double graph_loop_tolerance = 0.0;
  /// LogSolverOptions::em_depth is at most this: the more features are bound to
  /// one, the more a step reaches.
  int max_em_depth = 1000;
  /// Parameters of detectors for a log, where the options give no value.
  std::map<std::string, DetectorParameters> detector_parameters;
  /// Makes what grows the graph from a log's scans. The graph and registry must
  /// outlive it.
  std::function<std::unique_ptr<GraphBuilder>(
      const LogSolverOptions& options, Graph* graph, const Registry& registry)>
      make_builder;
};

const RawFeatureProfile& ProfileOf(RawFeatures kind);

/// The profile of a graph with raw features of these types: that of points
/// where there are any.
const RawFeatureProfile& ProfileOf(
    const std::vector<const FeatureType*>& raw_feature_types);

/// The options as this kind of raw features can be solved with: what it cannot
/// do is off, and its parameters of detectors are filled in.
LogSolverOptions WithProfile(const RawFeatureProfile& profile,
                             LogSolverOptions options);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_RAW_FEATURES_H_
