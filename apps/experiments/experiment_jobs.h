#ifndef PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENT_JOBS_H_
#define PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENT_JOBS_H_

#include <plumbline/apps/evaluation/confidence.h>
#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/apps/experiments/synthetic_run.h>
#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/outputs/map_drawing.h>

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

using Values = std::vector<std::pair<std::string, double>>;

/// One run of a trial under one condition: writes into its own slot.
struct Job {
  std::string condition;
  std::uint64_t seed = 1;
  std::function<void(Job*)> run;
  Values values;
  std::vector<SyntheticRun::Phase> phases;
  /// Name and drawing.
  std::vector<std::pair<std::string, MapDrawing>> maps;
  bool is_done = false;
};

/// Adds a job for each of options.trials, with the seeds from options.seed on.
void AddTrials(const ExperimentOptions& options, const std::string& condition,
               const std::function<void(Job*)>& run, std::vector<Job>* jobs);

/// Runs the jobs on options.num_threads threads. The first exception, in the
/// order of jobs, is thrown again when all threads have ended.
void RunJobs(const ExperimentOptions& options, std::vector<Job>* jobs);

/// Moves what the jobs measured into the result.
void Collect(std::vector<Job>* jobs, ExperimentResult* result);

/// A value of the trials under a condition, in the order of seeds.
std::vector<double> Column(const ExperimentResult& result,
                           const std::string& condition,
                           const std::string& name);

/// Not a number for no values.
double Mean(const std::vector<double>& values);

/// A number as with printf.
std::string Format(const char* format, double value);
/// "0.123 [0.1, 0.15]", "-" for what is no number.
std::string FormatEstimate(const Estimate& estimate);

/// Errors over the phases of the EM loop, a line for each condition: the mean
/// over the trials, each holding its last value when it has ended, with its
/// confidence interval.
LinePlot EvolutionPlot(const std::vector<Job>& jobs,
                       const std::vector<std::string>& conditions,
                       const std::string& title, const std::string& y_label);

/// A dashed line at y across a plot.
void AddLevel(const std::string& name, double y, int color, LinePlot* plot);

/// Ratio of the means of a value under two conditions, over the trials that
/// both have.
Estimate RatioOfMeans(const ExperimentResult& result, const std::string& name,
                      const std::string& condition,
                      const std::string& reference);

/// Claims that `measured` is at most `bound`.
void AddBound(const std::string& text, const Estimate& measured, double bound,
              ExperimentResult* result);

/// Claims that `successes` (1 for each) of the trials are at least `required`
/// of 20.
void AddShare(const std::string& text, const std::vector<double>& successes,
              int required, ExperimentResult* result);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENT_JOBS_H_
