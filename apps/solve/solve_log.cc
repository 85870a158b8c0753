#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/flag_remarks.h>
#include <plumbline/apps/solve/log_map.h>
#include <plumbline/apps/solve/run_identity.h>
#include <plumbline/apps/solve/run_outputs.h>
#include <plumbline/apps/solve/run_summary.h>
#include <plumbline/apps/solve/solve_log.h>
#include <plumbline/apps/solve/solving_progress.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>
#include <plumbline/outputs/checkpoint_file.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

namespace plumbline {
namespace {

// Solves a log, from where a run that did not end had got to if there is one,
// and leaves checkpoints on the way.
LogSolverResult RunWithCheckpoints(const Log& log, const RunContext& run,
                                   CheckpointFile* checkpoint,
                                   LogSolver* solver) {
  // An interrupt that cuts the reading off leaves another log than that of the
  // state, which stays for the next run.
  bool may_write = FLAGS_checkpoint_every > 0.0 && !InterruptRequested();
  std::optional<std::string> state;
  if (may_write) state = checkpoint->Read();
  if (state) {
    Remark("%s: goes on where a run that did not end had got to",
           FLAGS_output_dir.c_str());
  }
  SolvingProgress progress(run.clock, run.live);
  progress.BeginLog("scans");
  RunControl control = progress.Control();
  if (may_write) {
    control.checkpoint = [&](const std::function<std::string()>& make_state) {
      if (!may_write) return;
      try {
        checkpoint->Offer(make_state);
      } catch (const Error& error) {
        // The run can do without.
        may_write = false;
        Remark("goes on without checkpoints: %s", error.what());
      }
    };
  }
  return state ? solver->Resume(log, *state, control)
               : solver->Run(log, control);
}

}  // namespace

void CheckHierarchy(const LogSolverOptions& options, const Registry& registry) {
  if (!options.structure || options.hierarchy.empty()) return;
  ForFlag("hierarchy", [&] {
    MakeHierarchy(options.hierarchy, registry,
                  {ProfileOf(options.features).feature_type},
                  options.detector_parameters);
  });
}

int SolveLog(const LogInput& input, const RunContext& run) {
  SolveOutcome outcome;
  Summary& summary = outcome.summary;
  summary = BeginSummary();
  const LogSolverOptions options = LogSolverOptionsFromFlags(run.registry);
  CheckHierarchy(options, run.registry);
  RemarkOnFlags(input.name, "log", "graphs", GraphFlags());
  RemarkOnBagFlags(input.name, {input.reader});

  run.clock->bar().Plan(StagesOfLogs({1.0}, options));
  Log log = ReadLog(input, run.clock, &summary);
  if (!log.has_odometry) {
    run.clock->bar().Plan(StagesWithMatching({1.0}, options));
  }
  CompleteLog(input.name, options, run.clock, &log, &summary);

  CheckpointFile checkpoint(
      std::filesystem::path(FLAGS_output_dir) / CheckpointFile::kName,
      [&log] { return IdentityOfRun(log); }, FLAGS_checkpoint_every);
  LogSolver solver(run.registry, options);
  const LogSolverResult result =
      RunWithCheckpoints(log, run, &checkpoint, &solver);
  run.clock->Begin("figures");
  TakeMap(input.name, log.scans, solver, run.registry, options, result,
          &outcome);
  FinishRun(run, 1, &outcome);
  if (!summary.partial) checkpoint.Remove();
  return kExitSuccess;
}

}  // namespace plumbline
