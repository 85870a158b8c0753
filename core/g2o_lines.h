#ifndef PLUMBLINE_CORE_G2O_LINES_H_
#define PLUMBLINE_CORE_G2O_LINES_H_

#include <plumbline/core/constraint.h>
#include <plumbline/core/feature.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/registry.h>

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumbline {

// What the reader and the writer of graph files share: how a feature or a
// constraint stands on a line. The format: core/graph_files.md.

inline constexpr char kG2oFeatureTag[] = "PLUMBLINE_FEATURE";
inline constexpr char kG2oConstraintTag[] = "PLUMBLINE_CONSTRAINT";
inline constexpr char kG2oFixTag[] = "FIX";
/// Feature::source and Constraint::source of what a plain line says.
inline constexpr char kG2oSource[] = "g2o";
/// Room for new ids above it.
inline constexpr std::int64_t kLargestG2oId =
    std::numeric_limits<std::int64_t>::max() / 2;

/// Splits a line at blanks, in place.
void SplitG2oLine(std::string_view line, std::vector<std::string_view>* fields);

/// Reads a source that AppendG2oAttributes wrote; false for what it never
/// writes.
bool ParseG2oSource(std::string_view text, std::string* source);

/// Where the features of a constraint stand on its line: place of the i-th.
/// `format` null: the relation's own tag, in order.
int FeaturePlace(const G2oEdgeFormat* format, int feature);
/// The same of the rows of the residual.
int RowPlace(const G2oEdgeFormat* format, int row);
/// Calls visit(row, column) for the entries of an information matrix in the
/// order of the line.
template <typename Visit>
void ForInformation(const G2oEdgeFormat* format, int size, const Visit& visit) {
  if (format != nullptr && !format->information_order.empty()) {
    for (const auto& [row, column] : format->information_order) {
      visit(row, column);
    }
    return;
  }
  for (int i = 0; i < size; ++i) {
    for (int j = i; j < size; ++j) visit(i, j);
  }
}

/// Turns the information (3x3) of a relative pose by an angle, rad.
void TurnInformation(double angle, Eigen::MatrixXd* information);
/// Whether the file has the information of this constraint in the frame of the
/// second pose.
bool IsTurned(const G2oOptions& options, const Constraint& constraint);

/// Appends the line of a feature, without its end. `format` null: the type's
/// own tag. `extra`: what follows the parameters, "458 460".
void AppendG2oVertex(const Feature& feature, const G2oVertexFormat* format,
                     std::int64_t file_id, std::string_view extra,
                     std::string* text);
/// Appends the line that fixes a feature.
void AppendG2oFix(std::int64_t file_id, std::string* text);
/// Appends the line of a constraint. `file_ids`: by feature id.
void AppendG2oEdge(const Constraint& constraint, const G2oEdgeFormat* format,
                   const G2oOptions& options,
                   const std::vector<std::int64_t>& file_ids,
                   std::string* text);

/// Appends what the line of a feature or constraint cannot say: level, extent,
/// source and others.
void AppendG2oAttributes(const Feature& feature, std::int64_t file_id,
                         std::string* text);
void AppendG2oAttributes(const Constraint& constraint, std::string* text);
/// Whether there is nothing of that kind to say.
bool IsPlainG2o(const Feature& feature);
bool IsPlainG2o(const Constraint& constraint);

/// What an element says, whatever its format.
G2oFile::Fingerprint G2oFingerprintOf(const Feature& feature);
G2oFile::Fingerprint G2oFingerprintOf(
    const Constraint& constraint, const std::vector<std::int64_t>& file_ids);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_G2O_LINES_H_
