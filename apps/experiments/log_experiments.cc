#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/apps/experiments/experiment_jobs.h>
#include <plumbline/apps/experiments/log_experiments.h>
#include <plumbline/apps/experiments/solve_mode.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/outputs/summary.h>

#include <filesystem>
#include <limits>
#include <string>
#include <utility>

namespace plumbline {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// R2: the first part of the log, scans.
constexpr std::size_t kFirstPart = 4500;

// Each adds one thing to one before it.
constexpr SolveMode kModes[] = {
    {"none", false, false, Refinement::kMap},
    {"structure", true, false, Refinement::kMap},
    {"structure and closures", true, true, Refinement::kMap},
    {"adjustment", false, false, Refinement::kFull},
    {"structure, closures and adjustment", true, true, Refinement::kFull}};

// "structure, closures" becomes "structure_closures".
std::string FileNameOf(const std::string& condition) {
  std::string name;
  for (const char c : condition) {
    if (c != ',') name += c == ' ' ? '_' : c;
  }
  return name;
}

void RunLog(const std::string& log_file, const std::string& relations_file,
            std::size_t max_scans, const ExperimentOptions& options,
            const Registry& registry, ExperimentResult* result) {
  if (options.datasets.empty()) {
    result->skipped =
        "PLUMBLINE_DATASETS is not set: it names the folder with " + log_file;
    return;
  }
  const std::string log_path = options.datasets + "/" + log_file;
  if (!std::filesystem::exists(log_path)) {
    result->skipped = log_path + " is not there";
    return;
  }
  Log log = ReadCarmenLog(log_path, LaserOptions());
  if (max_scans > 0 && log.scans.size() > max_scans) {
    log.scans.resize(max_scans);
  }
  const std::vector<Relation> relations =
      ReadRelations(options.datasets + "/" + relations_file);
  std::vector<Job> jobs;
  for (const SolveMode& mode : kModes) {
    Job job;
    job.condition = mode.name;
    job.seed = options.seed;
    job.run = [&mode, &log, &relations, &options, &registry,
               result](Job* self) {
      LogSolver solver(registry, SolverOptions(options, mode));
      const Stopwatch watch;
      RunControl control;
      control.stop = options.stop;
      const LogSolverResult solved = solver.Run(log, control);
      const double seconds = watch.Seconds();
      if (solved.interrupted) return;
      std::vector<TimedPose> trajectory(solved.trajectory.size());
      for (std::size_t i = 0; i < trajectory.size(); ++i) {
        trajectory[i].timestamp = log.scans[i].timestamp;
        trajectory[i].pose = solved.trajectory[i];
      }
      const RelationEvaluation evaluation =
          EvaluateRelations(trajectory, relations);
      self->values = {
          {"orthogonality_deg",
           OrthogonalityDeg(solver.graph()).value_or(kNan)},
          {"translation_mean", evaluation.translation.mean},
          {"translation_std", evaluation.translation.standard_deviation},
          {"translation_max", evaluation.translation.maximum},
          {"rotation_mean_deg", evaluation.rotation_deg.mean},
          {"relations", static_cast<double>(evaluation.errors.size())},
          {"scans", static_cast<double>(log.scans.size())},
          {"seconds", seconds}};
      MapDrawing drawing = DrawingFromGraph(solver.graph(), solved.trajectory);
      drawing.title = result->id + ": " + self->condition;
      self->maps.emplace_back(FileNameOf(self->condition), drawing);
    };
    jobs.push_back(std::move(job));
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  if (result->interrupted) return;
  for (const char* value : {"orthogonality_deg", "translation_mean"}) {
    AddBound(std::string(value) + " with structure / without, all else equal",
             RatioOfMeans(*result, value, "structure", "none"), 1.0, result);
  }
  result->notes.push_back("Translational error, by what is added:");
  for (const auto& [mode, reference] :
       {std::pair("structure", "none"),
        std::pair("structure and closures", "structure"),
        std::pair("structure, closures and adjustment",
                  "structure and closures"),
        std::pair("adjustment", "none"),
        std::pair("structure, closures and adjustment", "adjustment")}) {
    result->notes.push_back("  " + std::string(mode) + " over " + reference +
                            ": " +
                            FormatEstimate(RatioOfMeans(
                                *result, "translation_mean", mode, reference)));
  }
  result->notes.push_back(
      "One run each: a ratio below 1 means better. Closures are structure, "
      "too: walls of two visits that are one. Errors are those of Kuemmerle et "
      "al. 2009, m and degrees.");
}

}  // namespace

void RunR1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "MIT Killian Court";
  result->paper =
      "Without structure the map is inconsistent and not orthogonal, in 38 s; "
      "with structure it is orthogonal, in 72 s (Pentium D, 3.2 GHz; Figs. 17 "
      "and 18).";
  RunLog("mit-killian.clf.bz2", "mit-killian.relations", 0, options, registry,
         result);
}

void RunR2(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Intel Research Lab, first part";
  result->paper =
      "Better with structure than without, even with slightly curved walls "
      "(Figs. 19 and 20).";
  RunLog("intel.clf.bz2", "intel.relations", kFirstPart, options, registry,
         result);
}

}  // namespace plumbline
