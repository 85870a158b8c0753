#ifndef PLUMBLINE_OUTPUTS_EM_TRACE_H_
#define PLUMBLINE_OUTPUTS_EM_TRACE_H_

#include <plumbline/core/em.h>

#include <optional>
#include <ostream>
#include <string>
#include <vector>

namespace plumbline {

/// A row of em_trace.csv.
struct EmTraceRow {
  EmPhase phase;
  /// Mean distance of the features' positions to the truth (core/method.md,
  /// section 8), m; none where the truth is not known.
  std::optional<double> mean_position_error;
};

/// Writes the rows with a header line: iteration, phase, cost_measurement,
/// cost_structure, features_<type> for every type that occurs in any row (by
/// name; 0 where a row has none), structure_constraints, broken_constraints,
/// structure_<relation> and broken_<relation> likewise, seconds,
/// mean_position_error (empty when not known), and <detector>_<count> for
/// everything that a detector counted, such as
/// same_wall_place_pairs_refused_one_visit (empty where it did not run).
/// Numbers read back as the same doubles.
void WriteEmTrace(const std::vector<EmTraceRow>& rows, std::ostream& output);

/// Writes it to a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteEmTrace(const std::vector<EmTraceRow>& rows, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_EM_TRACE_H_
