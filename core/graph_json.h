#ifndef PLUMBLINE_CORE_GRAPH_JSON_H_
#define PLUMBLINE_CORE_GRAPH_JSON_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <iosfwd>
#include <string>

namespace plumbline {

/// Writes map.json: {"features": [...], "constraints": [...]} with, for every
/// feature, id, type, level, virtual, fixed, parameters, anchor, extent,
/// observations, source and support (ids of the live structure constraints
/// from below), and for every constraint id, type, features, expected,
/// information, class, delta, state and source. Deterministic; numbers read
/// back as the same doubles.
void WriteGraphJson(const Graph& graph, std::ostream& output);

/// Reads what WriteGraphJson wrote into an empty graph; ids are kept in order
/// but made dense. Throws Error that names `name` and the place.
void ReadGraphJson(std::istream& input, const std::string& name,
                   const Registry& registry, Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_GRAPH_JSON_H_
