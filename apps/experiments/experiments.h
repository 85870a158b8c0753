#ifndef PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENTS_H_
#define PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENTS_H_

#include <plumbline/apps/evaluation/confidence.h>
#include <plumbline/apps/evaluation/structure_match.h>
#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/em.h>
#include <plumbline/core/registry.h>
#include <plumbline/outputs/map_drawing.h>

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Detectors that the synthetic experiments run by default: points to lines and
/// circles, lines to orientations, circles to common centres.
extern const char kSyntheticHierarchy[];

/// Name of a loss without any weight: structure pulls with all it has, right or
/// wrong. For comparison only (S5); RunExperiment registers it.
extern const char kUnweightedLoss[];

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
};

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

/// "S1" to "S6", "R1", "R2", "B1".
const std::vector<std::string>& ExperimentNames();

/// Runs an experiment of core/method.md, section 8.
///
///   S1  with structure, without, and with the true structure given (oracle)
///   S2  S1 from initial noise of 0.05 to 0.3 m
///   S3  S1 with distance noise of 0.01 and 0.1 m
///   S4  S1 with 20 random points
///   S5  wrong structure kept at full weight; kept but weighted by delta;
///       broken where delta is small
///   S6  four ways to say that circles are concentric, to within 0.1 m and to
///       within 0.02 m
///   R1, R2  the logs of Killian Court and of the first part of the Intel
///       Research Lab, without structure and with
///   B1  simulated buildings of several shapes (building_trial.h): right
///       and wrong loop closures, errors of walls
///
/// The registry needs the built-ins. Throws Error for an unknown name and for
/// options that do not fit.
ExperimentResult RunExperiment(const std::string& id,
                               const ExperimentOptions& options,
                               Registry* registry);

/// A synthetic world taken through the EM loop.
struct SyntheticRun {
  /// Mean position errors (Eq. 24), m: at the start, with distances only, at
  /// the end.
  double start_error = 0.0;
  double distances_error = 0.0;
  double final_error = 0.0;
  StructureMatch match;
  EmReport em;
  /// Error after every phase: iteration, place in the iteration, name, error.
  struct Phase {
    int iteration = 0;
    int order = 0;
    std::string name;
    double error = 0.0;
  };
  std::vector<Phase> phases;
};

struct SyntheticRunOptions {
  std::string delta_mode = "frozen";
  double delta_threshold = 0.3;
  bool full_weight_test = true;
  bool break_constraints = true;
  std::string hierarchy = kSyntheticHierarchy;
  std::map<std::string, DetectorParameters> detector_parameters;
  std::uint64_t seed = 1;
  /// Of the errors.
  bool with_outliers = true;
  StructureMatchOptions match;
  std::function<bool()> stop;
};

/// Finds structure in a world that is as MakeSyntheticWorld made it; its graph
/// is the map afterwards.
SyntheticRun RunOnWorld(const Registry& registry,
                        const SyntheticRunOptions& options,
                        SyntheticWorld* world);

/// Mean position errors of an oracle, m.
struct OracleErrors {
  /// With the structure at its full weight.
  double full = 0.0;
  /// With the structure weighed by delta until that has settled, as found
  /// structure is, but none broken.
  double weighted = 0.0;
};

/// The oracle: solves the distances, then adds the true structure with the
/// tolerances that the detectors would use (AddTrueStructure), and solves again
/// with the same solver.
OracleErrors RunOracle(const Registry& registry,
                       const SyntheticRunOptions& options,
                       SyntheticWorld* world);

/// How S6 says that circles have one centre.
enum class Concentricity {
  /// Each circle and the next.
  kChain = 1,
  /// The first circle and each other.
  kStar = 2,
  kAllPairs = 3,
  /// A virtual centre and each circle.
  kCommonCenter = 4,
};

/// Adds live coincidence constraints between the circles (level 0) of a graph;
/// `sigma` in m.
void AddConcentricity(Concentricity method, double sigma,
                      const Registry& registry, Graph* graph);

/// What S6 asks of a result.
struct ConcentricityResult {
  /// No live structure constraint is on an outlier.
  bool is_isolated = false;
  /// Live structure constraints connect all other circles.
  bool is_intact = false;
};
ConcentricityResult CheckConcentricity(const Graph& graph,
                                       const SyntheticTruth& truth);

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

#endif  // PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENTS_H_
