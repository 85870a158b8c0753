#ifndef PLUMBLINE_CORE_GRAPH_G2O_H_
#define PLUMBLINE_CORE_GRAPH_G2O_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <cstdint>
#include <iosfwd>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// What a g2o file held besides the graph, kept so that it can be written back.
struct G2oFile {
  /// Comments and lines with tags that no plug-in knows, verbatim.
  std::vector<std::string> unknown_lines;
  /// For each of them the feature whose vertex came last before it, kNoId at
  /// the top: a laser scan belongs to the vertex above it.
  std::vector<FeatureId> unknown_line_positions;
  /// How often each unknown tag occurred.
  std::map<std::string, int> unknown_tags;
  /// Id in the file of each feature, by feature id.
  std::vector<std::int64_t> file_ids;
};

/// Reads g2o text into an empty graph: vertices and edges by the registry's
/// tags, in any order, and FIX. Features and constraints are numbered in the
/// order of the file.
///
/// Lines of this project's own carry what g2o has no place for, so that writing
/// what was written and read gives the same bytes; g2o passes over them:
///
///   PLUMBLINE_FEATURE id level virtual anchor_x anchor_y extent_begin
///       extent_end observations source
///   PLUMBLINE_CONSTRAINT class state delta source
///
/// each on one line. The first belongs to the vertex with this id, the second
/// to the edge above it; "virtual" is 0 or 1, "class" measurement or structure,
/// "state" live or broken; a source is "-" when empty, with %XX for white
/// space, '%', control characters and a lone "-". Without such a line a feature
/// is raw and a constraint a live measurement, both from the source "g2o".
///
/// An edge to a vertex with an unknown tag, and own lines of unknown vertices
/// and edges, are kept verbatim like the unknown ones. Throws Error with
/// `name`:line for dangling or duplicate ids, wrong counts, numbers that do not
/// parse or are not finite, features that do not fit, and information that is
/// not positive semidefinite; the graph is empty then.
G2oFile ReadG2o(std::istream& input, const std::string& name,
                const Registry& registry, Graph* graph);

/// Writes a graph as g2o text; `file` (may be null) gives ids and unknown lines
/// back. Features that are not of the file get ids past all that it uses.
/// Numbers are written so that reading gives the same doubles; information
/// matrices by their upper triangle.
void WriteG2o(const Graph& graph, const G2oFile* file, std::ostream& output);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_GRAPH_G2O_H_
