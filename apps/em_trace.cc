#include <plumbline/apps/em_trace.h>
#include <plumbline/core/atomic_file.h>

#include <charconv>
#include <set>

namespace plumbline {
namespace {

// Shortest text that reads back as the same double, whatever the locale.
std::string FormatDouble(double value) {
  char text[32];
  const std::to_chars_result result =
      std::to_chars(text, text + sizeof(text), value);
  return std::string(text, result.ptr);
}

}  // namespace

void WriteEmTrace(const std::vector<EmTraceRow>& rows, std::ostream& output) {
  std::set<std::string> types;
  for (const EmTraceRow& row : rows) {
    for (const auto& entry : row.phase.features) types.insert(entry.first);
  }
  output << "iteration,phase,cost_measurement,cost_structure";
  for (const std::string& type : types) output << ",features_" << type;
  output << ",structure_constraints,broken_constraints,seconds,"
            "mean_position_error\n";
  for (const EmTraceRow& row : rows) {
    const EmPhase& phase = row.phase;
    output << phase.iteration << ',' << phase.phase << ','
           << FormatDouble(phase.cost.measurement) << ','
           << FormatDouble(phase.cost.structure);
    for (const std::string& type : types) {
      const auto found = phase.features.find(type);
      output << ',' << (found == phase.features.end() ? 0 : found->second);
    }
    output << ',' << phase.structure_constraints << ','
           << phase.broken_constraints << ',' << FormatDouble(phase.seconds)
           << ',';
    if (row.mean_position_error) {
      output << FormatDouble(*row.mean_position_error);
    }
    output << '\n';
  }
}

void WriteEmTrace(const std::vector<EmTraceRow>& rows,
                  const std::string& path) {
  WriteFileAtomically(
      path, [&rows](std::ostream& output) { WriteEmTrace(rows, output); });
}

}  // namespace plumbline
