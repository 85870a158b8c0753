#ifndef PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENT_H_
#define PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENT_H_

#include <plumbline/apps/evaluation/confidence.h>
#include <plumbline/apps/experiments/synthetic_run.h>
#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/core/registry.h>
#include <plumbline/outputs/map_drawing.h>

#include <cstdint>
#include <functional>
#include <map>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

struct ExperimentOptions {
  int trials = 20;
  /// Trials have the seeds from here on: seed, seed + 1, ...
  std::uint64_t seed = 1;
  /// Trials at a time; results do not depend on it.
  int num_threads = 1;
  /// Weighting of structure constraints and where they are broken.
  std::string delta_mode = "frozen";
  double delta_threshold = 0.3;
  /// EmOptions::full_weight_test of the synthetic experiments.
  bool full_weight_test = true;
  std::string hierarchy = kSyntheticHierarchy;
  std::map<std::string, DetectorParameters> detector_parameters;
  /// Folder with the public logs (R1, R2); empty: they are skipped.
  std::string datasets;
  /// Called with the runs done and in all, from one thread at a time. May be
  /// empty.
  std::function<void(int, int)> progress;
  /// Ends the experiment early when it returns true: trials that are not whole
  /// are left out. Called from any thread. May be empty.
  std::function<bool()> stop;
};

/// What was measured in one trial under one condition.
struct TrialRow {
  /// "noise 0.1 m", "method 4".
  std::string condition;
  std::uint64_t seed = 1;
  /// Name and value, the same names in every row of an experiment.
  std::vector<std::pair<std::string, double>> values;

  /// Throws Error when there is no such name.
  double Get(const std::string& name) const;
};

/// A result that is asked for, and whether it came out.
struct Claim {
  /// What is compared, and the bound that it must keep.
  std::string text;
  std::string required;
  Estimate measured;
  bool holds = false;
  /// It neither holds nor fails: the bound lies within the interval of what was
  /// measured. Then `holds` is false.
  bool is_open = false;
};

/// Whether anything was measured: of a run that was cut short, no trial may be
/// whole.
bool IsKnown(const Claim& claim);

/// "holds", "open ", "FAILS" or, without any trial, "not known".
const char* Verdict(const Claim& claim);

/// All that an experiment gives.
struct ExperimentResult {
  /// "S1"
  std::string id;
  std::string title;
  /// What the paper says came out.
  std::string paper;
  /// In the order of conditions, then seeds.
  std::vector<TrialRow> trials;
  std::vector<Claim> claims;
  std::vector<LinePlot> plots;
  /// Name and drawing of maps of the first trial.
  std::vector<std::pair<std::string, MapDrawing>> maps;
  /// Sentences for the summary.
  std::vector<std::string> notes;
  /// Why the experiment did not run; empty when it did.
  std::string skipped;
  /// Cut short by `stop`.
  bool interrupted = false;
};

/// Rows of <id>_summary.csv: the mean of every value under every condition.
struct SummaryRow {
  std::string condition;
  std::string quantity;
  int trials = 0;
  Estimate mean;
};
std::vector<SummaryRow> Summarize(const ExperimentResult& result);

/// Writes the trials as CSV: experiment,condition,seed,<names of values>.
void WriteTrials(const ExperimentResult& result, std::ostream& output);

/// Writes what was asked for and what came out, for people.
void WriteExperimentSummary(const ExperimentResult& result,
                            std::ostream& output);

/// Writes <id>.csv, <id>_summary.csv, <id>_summary.txt, <id>.svg (the plots)
/// and <id>_<name>.svg (the maps) into a folder that exists, each whole or not
/// at all. A skipped experiment gives the text only.
void WriteExperiment(const ExperimentResult& result, const std::string& folder);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENT_H_
