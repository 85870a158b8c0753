#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/apps/experiments/experiment_jobs.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/outputs/map_picture.h>

#include <cmath>
#include <cstdio>
#include <set>

namespace plumbline {
namespace {

// Empty for what is not a number.
std::string CsvNumber(double value) {
  return std::isfinite(value) ? Format("%.9g", value) : std::string();
}

}  // namespace

double TrialRow::Get(const std::string& name) const {
  for (const auto& [key, value] : values) {
    if (key == name) return value;
  }
  throw PLUMBLINE_ERROR("no value '" + name + "' in a trial of " + condition,
                        "one that the experiment measures");
}

std::vector<SummaryRow> Summarize(const ExperimentResult& result) {
  std::vector<std::string> conditions;
  for (const TrialRow& row : result.trials) {
    if (std::find(conditions.begin(), conditions.end(), row.condition) ==
        conditions.end()) {
      conditions.push_back(row.condition);
    }
  }
  std::vector<SummaryRow> rows;
  for (const std::string& condition : conditions) {
    for (const auto& [name, value] : result.trials.front().values) {
      SummaryRow row;
      row.condition = condition;
      row.quantity = name;
      const std::vector<double> values = Column(result, condition, name);
      row.trials = static_cast<int>(values.size());
      row.mean = MeanEstimate(values);
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

void WriteTrials(const ExperimentResult& result, std::ostream& output) {
  output << "experiment,condition,seed";
  if (!result.trials.empty()) {
    for (const auto& value : result.trials.front().values) {
      output << ',' << value.first;
    }
  }
  output << '\n';
  for (const TrialRow& row : result.trials) {
    output << result.id << ",\"" << row.condition << "\"," << row.seed;
    for (const auto& value : row.values) {
      output << ',' << CsvNumber(value.second);
    }
    output << '\n';
  }
}

bool IsKnown(const Claim& claim) { return !std::isnan(claim.measured.value); }

const char* Verdict(const Claim& claim) {
  if (!IsKnown(claim)) return "not known";
  return claim.holds ? "holds" : claim.is_open ? "open " : "FAILS";
}

void WriteExperimentSummary(const ExperimentResult& result,
                            std::ostream& output) {
  output << result.id << ": " << result.title << "\n\nPaper: " << result.paper
         << "\n\n";
  if (!result.skipped.empty()) {
    output << "Skipped: " << result.skipped << '\n';
    return;
  }
  if (result.interrupted) output << "Cut short: not all trials are whole.\n\n";
  for (const Claim& claim : result.claims) {
    output << "  " << Verdict(claim) << "   " << claim.text << ": "
           << FormatEstimate(claim.measured) << ", required " << claim.required
           << '\n';
  }
  if (!result.claims.empty()) output << '\n';
  for (const std::string& note : result.notes) output << note << '\n';
  if (!result.notes.empty()) output << '\n';
  output << "Means with 95 % confidence intervals\n";
  std::string condition;
  for (const SummaryRow& row : Summarize(result)) {
    if (row.condition != condition) {
      condition = row.condition;
      output << "\n  " << condition << " (" << row.trials << " trials)\n";
    }
    char line[160];
    std::snprintf(line, sizeof(line), "    %-22s %s\n", row.quantity.c_str(),
                  FormatEstimate(row.mean).c_str());
    output << line;
  }
}

void WriteExperiment(const ExperimentResult& result,
                     const std::string& folder) {
  const std::string base = folder + "/" + result.id;
  WriteFileAtomically(base + "_summary.txt", [&](std::ostream& output) {
    WriteExperimentSummary(result, output);
  });
  if (!result.skipped.empty()) return;
  WriteFileAtomically(base + ".csv", [&](std::ostream& output) {
    WriteTrials(result, output);
  });
  WriteFileAtomically(base + "_summary.csv", [&](std::ostream& output) {
    output << "experiment,condition,quantity,trials,mean,ci95_low,ci95_high\n";
    for (const SummaryRow& row : Summarize(result)) {
      output << result.id << ",\"" << row.condition << "\"," << row.quantity
             << ',' << row.trials << ',' << CsvNumber(row.mean.value) << ','
             << CsvNumber(row.mean.low) << ',' << CsvNumber(row.mean.high)
             << '\n';
    }
  });
  if (!result.plots.empty()) {
    WriteFileAtomically(base + ".svg", [&](std::ostream& output) {
      output << PlotSvg(result.plots);
    });
  }
  for (const auto& [name, drawing] : result.maps) {
    WriteMapSvg(drawing, base + "_" + name + ".svg");
  }
}

}  // namespace plumbline
