#include <plumbline/core/atomic_file.h>
#include <plumbline/outputs/em_trace.h>

#include <charconv>
#include <map>
#include <set>
#include <string>

namespace plumbline {
namespace {

// Shortest text that reads back as the same double, whatever the locale.
std::string FormatDouble(double value) {
  char text[32];
  const std::to_chars_result result =
      std::to_chars(text, text + sizeof(text), value);
  return std::string(text, result.ptr);
}

int CountOf(const std::string& name, const std::map<std::string, int>& counts) {
  const auto found = counts.find(name);
  return found == counts.end() ? 0 : found->second;
}

}  // namespace

void WriteEmTrace(const std::vector<EmTraceRow>& rows, std::ostream& output) {
  std::set<std::string> types;
  std::set<std::string> relations;
  for (const EmTraceRow& row : rows) {
    for (const auto& entry : row.phase.features) types.insert(entry.first);
    for (const auto* counts :
         {&row.phase.structure_by_relation, &row.phase.broken_by_relation}) {
      for (const auto& entry : *counts) relations.insert(entry.first);
    }
  }
  output << "iteration,phase,cost_measurement,cost_structure";
  for (const std::string& type : types) output << ",features_" << type;
  output << ",structure_constraints,broken_constraints";
  for (const std::string& relation : relations) {
    output << ",structure_" << relation << ",broken_" << relation;
  }
  output << ",seconds,mean_position_error\n";
  for (const EmTraceRow& row : rows) {
    const EmPhase& phase = row.phase;
    output << phase.iteration << ',' << phase.phase << ','
           << FormatDouble(phase.cost.measurement) << ','
           << FormatDouble(phase.cost.structure);
    for (const std::string& type : types) {
      output << ',' << CountOf(type, phase.features);
    }
    output << ',' << phase.structure_constraints << ','
           << phase.broken_constraints;
    for (const std::string& relation : relations) {
      output << ',' << CountOf(relation, phase.structure_by_relation) << ','
             << CountOf(relation, phase.broken_by_relation);
    }
    output << ',' << FormatDouble(phase.seconds) << ',';
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
