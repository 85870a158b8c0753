#ifndef PLUMBLINE_CORE_GRAPH_G2O_H_
#define PLUMBLINE_CORE_GRAPH_G2O_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <iosfwd>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// What a g2o file held besides the graph, kept so that it can be written back.
struct G2oFile {
  /// Lines with tags that no plug-in knows, verbatim.
  std::vector<std::string> unknown_lines;
  /// How often each unknown tag occurred.
  std::map<std::string, int> unknown_tags;
  /// Id in the file of each feature, by feature id.
  std::vector<std::int64_t> file_ids;
};

/// Reads g2o text into an empty graph: vertices and edges by the registry's
/// tags, FIX, and comment lines. Lines of this project's own carry what g2o has
/// no place for (levels, extents, class, delta, state, source), so that writing
/// what was read gives the same bytes. Throws Error with `name`:line for
/// dangling or duplicate ids, wrong counts, numbers that do not parse or are
/// not finite, and information that is not positive semidefinite.
G2oFile ReadG2o(std::istream& input, const std::string& name,
                const Registry& registry, Graph* graph);

/// Writes a graph as g2o text; `file` (may be null) gives unknown lines back.
/// Numbers are written so that reading gives the same doubles.
void WriteG2o(const Graph& graph, const G2oFile* file, std::ostream& output);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_GRAPH_G2O_H_
