#ifndef PLUMBLINE_OUTPUTS_MARGINALS_OUTPUT_H_
#define PLUMBLINE_OUTPUTS_MARGINALS_OUTPUT_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/outputs/map_drawing.h>

#include <set>
#include <string>
#include <vector>

namespace plumbline {

/// Selection by a list: names of feature types, numbers of features (those of
/// map.json) and "all", separated by commas; "none" and "" nothing.
struct MarginalsSelection {
  bool all = false;
  std::set<const FeatureType*> types;
  std::set<FeatureId> ids;
  bool empty() const { return !all && types.empty() && ids.empty(); }
};

/// Parses such a list. Throws Error that lists the types for a name that is
/// unknown.
MarginalsSelection ParseMarginalsSelection(const std::string& list,
                                           const Registry& registry);

/// Throws Error, as ComputeMarginals would, when a feature selected by its type
/// or number is in a part of the graph that nothing ties to the plane: before
/// the work and not after it.
void CheckGauge(const Graph& graph, const MarginalsSelection& selection);

/// Covariances of the features selected in the map frame, at the present state.
/// `session` may be null: structure then counts by its delta. Types and numbers
/// select the features that a live constraint speaks of; what selects none is
/// left out, and `missing` gets a few words on each: "no feature 17". With
/// `hold_gauge` the lowest feature of a part that nothing ties to the plane is
/// taken as known; otherwise asking for one of such a part throws Error.
FeatureCovariances ComputeMarginals(const Graph& graph,
                                    const SolverSession* session,
                                    const MarginalsSelection& selection,
                                    bool hold_gauge,
                                    std::vector<std::string>* missing);

/// Ellipses of this many standard deviations of the positions of those features
/// that have one (parameters x and y first). Left out where the graph says
/// nothing about some direction.
std::vector<DrawnEllipse> EllipsesOf(const Graph& graph,
                                     const FeatureCovariances& covariances,
                                     double sigmas);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_MARGINALS_OUTPUT_H_
