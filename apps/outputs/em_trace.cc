#include <plumbline/core/atomic_file.h>
#include <plumbline/outputs/em_trace.h>

#include <cctype>
#include <charconv>
#include <cstdint>
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

// "same_wall" and "place pairs refused: one visit":
// same_wall_place_pairs_refused_one_visit.
std::string ColumnOf(const std::string& detector, const std::string& count) {
  std::string column;
  for (const char c : detector + "_" + count) {
    if (std::isalnum(static_cast<unsigned char>(c))) {
      column += c;
    } else if (column.empty() || column.back() != '_') {
      column += '_';
    }
  }
  return column;
}

int CountOf(const std::string& name, const std::map<std::string, int>& counts) {
  const auto found = counts.find(name);
  return found == counts.end() ? 0 : found->second;
}

}  // namespace

void WriteEmTrace(const std::vector<EmTraceRow>& rows, std::ostream& output) {
  std::set<std::string> types;
  std::set<std::string> relations;
  std::set<std::string> counts_of_detectors;
  std::vector<std::map<std::string, std::int64_t>> counts(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (const auto& [detector, its_counts] : rows[i].phase.detections) {
      for (const auto& [name, number] : its_counts) {
        const std::string column = ColumnOf(detector, name);
        counts_of_detectors.insert(column);
        counts[i][column] += number;
      }
    }
  }
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
  output << ",seconds,mean_position_error";
  for (const std::string& column : counts_of_detectors) output << ',' << column;
  output << '\n';
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const EmTraceRow& row = rows[i];
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
    for (const std::string& column : counts_of_detectors) {
      const auto found = counts[i].find(column);
      output << ',';
      if (found != counts[i].end()) output << found->second;
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
