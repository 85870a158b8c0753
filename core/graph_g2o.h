#ifndef PLUMBLINE_CORE_GRAPH_G2O_H_
#define PLUMBLINE_CORE_GRAPH_G2O_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <cstdint>
#include <iosfwd>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace plumbline {

/// Interpretation of a g2o file where writers differ.
struct G2oOptions {
  /// Frame in which the information of relative poses (EDGE_SE2, EDGE2) is
  /// given: that of the first pose (false: the error is inverse(p1) (+) p2
  /// minus what was measured, as in this project and in Ceres' example), or
  /// that of the second pose as measured (true: the error is
  /// inverse(measured) (+) inverse(p1) (+) p2, as g2o has it). The two agree
  /// where x and y have the same information and no correlation.
  bool information_at_second = false;
};

/// A line of a g2o file.
struct G2oLine {
  /// Content of a line.
  enum class Kind {
    /// Comments, blank lines, unknown tags, laser scans: kept verbatim.
    kText,
    kVertex,
    kEdge,
    kFix,
    /// This project's own lines, see ReadG2o.
    kFeatureAttributes,
    kConstraintAttributes,
  };
  Kind kind = Kind::kText;
  /// As it was read, without the line feed; a part of G2oFile::text.
  std::string_view text;
  /// Feature or constraint that it belongs to; kNoId for text and FIX.
  std::int64_t id = kNoId;
};

/// Content of a g2o file besides the graph, kept so that it can be written back
/// byte for byte.
struct G2oFile {
  G2oOptions options;
  /// All that was read.
  std::shared_ptr<const std::string> text;
  /// Every line, in order.
  std::vector<G2oLine> lines;
  bool ends_with_line_feed = true;
  /// Number of lines with each unknown tag.
  std::map<std::string, int> unknown_tags;
  /// The last line where the file may break off in the middle of it: an unknown
  /// tag alone, without a line feed, with which known ones begin. Empty
  /// otherwise.
  std::string cut_tag;
  /// Number of laser scans; each belongs to the vertex above it.
  int laser_scans = 0;
  /// Id in the file of each feature, by feature id; kNoId where there is none.
  std::vector<std::int64_t> file_ids;

  /// Hashes of what WriteG2o would have written at the time of reading (vertex
  /// or edge, attributes), by feature id and by constraint id, to tell what
  /// changed since, and which features had been fixed.
  struct Fingerprint {
    std::size_t element = 0;
    /// 0 where there is nothing to say.
    std::size_t attributes = 0;
  };
  std::vector<Fingerprint> feature_fingerprints;
  std::vector<Fingerprint> constraint_fingerprints;
  std::vector<bool> was_fixed;
  /// Features without a line of their own, named by edges alone, in the order
  /// of their ids in the file. They are where nobody has put them: all numbers
  /// are 0.
  std::vector<FeatureId> named_by_edges;
};

/// Reads g2o text into an empty graph: vertices and edges by the registry's
/// tags (those of other formats included: TORO's VERTEX2 and EDGE2, lines by
/// their normals), in any order, FIX, and ROBOTLASER1, which is kept with the
/// vertex above it. Features and constraints are numbered in the order of the
/// file.
///
/// Lines of this project's own carry what g2o has no place for, so that writing
/// what was written and read gives the same bytes; g2o passes over them:
///
///   PLUMBLINE_FEATURE id level virtual anchor_x anchor_y extent_begin
///       extent_end observations source
///   PLUMBLINE_CONSTRAINT class state delta source [break_below]
///
/// each on one line; an anchor in space has an anchor_z after anchor_y. The
/// first line belongs to the vertex with this id, the second to the edge above
/// it; "virtual" is 0 or 1, "class" measurement or structure,
/// "state" live or broken, "break_below" 1 where it is missing; a source is "-"
/// when empty, with %XX for white space, '%', control characters and a lone
/// "-". Without such a line a feature is raw and a constraint a live
/// measurement, both from the source "g2o".
///
/// A file without any vertex has those that its edges name, as many files with
/// relative poses do: each of the (first) type that suits its edges, at the
/// origin, numbered in the order of ids.
///
/// An edge to a vertex with an unknown tag, and own lines of unknown vertices
/// and edges, are kept verbatim like the unknown ones. Throws Error with
/// `name`:line for dangling or duplicate ids, wrong counts, numbers that do not
/// parse or are not finite, features that do not fit, information that is not
/// positive semidefinite, and a laser scan without a vertex above it; the graph
/// is empty then. A file that breaks off within a line is mostly one of these;
/// where it does so within a tag, G2oFile::cut_tag has it.
G2oFile ReadG2o(std::istream& input, const std::string& name,
                const Registry& registry, Graph* graph,
                const G2oOptions& options = {});

/// The same of text that was read already.
G2oFile ReadG2o(std::string text, const std::string& name,
                const Registry& registry, Graph* graph,
                const G2oOptions& options = {});

/// Writes a graph as g2o text. With the `file` that it was read from, every
/// line of it comes back as it was, byte for byte, but for the elements that
/// have changed (same place, same tag), those that are gone (left out), and new
/// ones (at the end; ids past all that the file uses). Vertices that edges
/// alone name come before all else once one of them has changed. Without
/// (null), features and then constraints in the order of ids. Numbers are
/// written so that reading gives the same doubles; information matrices by
/// their upper triangle.
void WriteG2o(const Graph& graph, const G2oFile* file, std::ostream& output);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_GRAPH_G2O_H_
