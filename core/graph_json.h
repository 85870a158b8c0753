#ifndef PLUMBLINE_CORE_GRAPH_JSON_H_
#define PLUMBLINE_CORE_GRAPH_JSON_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <Eigen/Core>
#include <iosfwd>
#include <map>
#include <string>

namespace plumbline {

/// Covariances of features' parameters, map frame, by feature id.
using FeatureCovariances = std::map<FeatureId, Eigen::MatrixXd>;

/// Writes map.json: {"features": [...], "constraints": [...]} with, for every
/// feature, id, type, level, virtual, fixed, parameters, anchor, extent
/// ([begin, end]), observations, source and support (ids of the live structure
/// constraints from below), and for every constraint id, type, features,
/// expected, information (rows), class ("measurement" or "structure"), delta,
/// state ("live" or "broken"), source and, where it is not 1, break_below.
/// Features among the `covariances` (may
/// be null) also have covariance (rows). One line per element. Deterministic;
/// numbers read back as the same doubles (one that is not finite becomes null,
/// which is not read back).
void WriteGraphJson(const Graph& graph, std::ostream& output,
                    const FeatureCovariances* covariances = nullptr);

/// Reads what WriteGraphJson wrote into an empty graph; ids are kept in order
/// but made dense. "support" follows from the constraints and is passed over,
/// as are covariances and names that are not known. Throws Error that names
/// `name` and the place ("features[3].parameters", or the line where it is not
/// JSON); the graph is empty then.
void ReadGraphJson(std::istream& input, const std::string& name,
                   const Registry& registry, Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_GRAPH_JSON_H_
