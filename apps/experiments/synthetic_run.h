#ifndef PLUMBLINE_APPS_EXPERIMENTS_SYNTHETIC_RUN_H_
#define PLUMBLINE_APPS_EXPERIMENTS_SYNTHETIC_RUN_H_

#include <plumbline/apps/evaluation/structure_match.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/em.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

/// Detectors that the synthetic experiments run by default: points to lines and
/// circles, lines to orientations, circles to common centres.
extern const char kSyntheticHierarchy[];

/// Name of a loss without any weight: structure pulls with all it has, right or
/// wrong. For comparison only (S5); RunExperiment registers it.
extern const char kUnweightedLoss[];

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

/// The phase of a run with the error at its end, m.
SyntheticRun::Phase MakePhase(const EmPhase& phase, double error);

/// The session that solves synthetic worlds.
std::unique_ptr<SolverSession> MakeSession(const SyntheticRunOptions& options,
                                           const Registry& registry,
                                           Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_SYNTHETIC_RUN_H_
