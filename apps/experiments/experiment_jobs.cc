#include <plumbline/apps/experiments/experiment_jobs.h>
#include <plumbline/core/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <mutex>
#include <numeric>
#include <utility>

namespace plumbline {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Curves of the error are drawn this far; what comes later moves little.
constexpr int kDrawnIterations = 6;

bool IsStopped(const ExperimentOptions& options) {
  return options.stop && options.stop();
}

// What a person calls the phases of the EM loop.
std::string PhaseLabel(const SyntheticRun::Phase& phase) {
  static const std::map<std::string, std::string> labels = {
      {"start", "start"},
      {"measurements", "distances"},
      {"optimize", "solve"},
      {"break", "break"},
      {"detect_0", "detect level 0"},
      {"detect_1", "detect level 1"},
      {"detect_2", "detect level 2"},
      {"final", "solve"}};
  const auto found = labels.find(phase.name);
  const std::string name = found == labels.end() ? phase.name : found->second;
  return phase.iteration > 0 ? std::to_string(phase.iteration) + ": " + name
                             : name;
}

}  // namespace

void RunJobs(const ExperimentOptions& options, std::vector<Job>* jobs) {
  std::mutex mutex;
  int done = 0;
  std::atomic<bool> has_failed{false};
  ParallelFor(jobs->size(), options.num_threads, [&](std::size_t i) {
    if (has_failed || IsStopped(options)) return;
    Job& job = (*jobs)[i];
    try {
      job.run(&job);
    } catch (...) {
      has_failed = true;
      throw;
    }
    // What was cut short is not whole.
    job.is_done = !IsStopped(options);
    const std::lock_guard<std::mutex> lock(mutex);
    ++done;
    if (options.progress) {
      options.progress(done, static_cast<int>(jobs->size()));
    }
  });
}

void AddTrials(const ExperimentOptions& options, const std::string& condition,
               const std::function<void(Job*)>& run, std::vector<Job>* jobs) {
  for (int trial = 0; trial < options.trials; ++trial) {
    Job job;
    job.condition = condition;
    job.seed = options.seed + static_cast<std::uint64_t>(trial);
    job.run = run;
    jobs->push_back(std::move(job));
  }
}

void Collect(std::vector<Job>* jobs, ExperimentResult* result) {
  for (Job& job : *jobs) {
    if (!job.is_done) {
      result->interrupted = true;
      continue;
    }
    result->trials.push_back({job.condition, job.seed, std::move(job.values)});
    for (auto& map : job.maps) result->maps.push_back(std::move(map));
  }
}

std::vector<double> Column(const ExperimentResult& result,
                           const std::string& condition,
                           const std::string& name) {
  std::vector<double> values;
  for (const TrialRow& row : result.trials) {
    if (row.condition == condition) values.push_back(row.Get(name));
  }
  return values;
}

double Mean(const std::vector<double>& values) {
  if (values.empty()) return kNan;
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(values.size());
}

std::string Format(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

std::string FormatEstimate(const Estimate& estimate) {
  if (!std::isfinite(estimate.value)) return "-";
  if (estimate.low == estimate.value && estimate.high == estimate.value) {
    return Format("%.4g", estimate.value);
  }
  return Format("%.4g", estimate.value) + " [" + Format("%.4g", estimate.low) +
         ", " + Format("%.4g", estimate.high) + "]";
}

LinePlot EvolutionPlot(const std::vector<Job>& jobs,
                       const std::vector<std::string>& conditions,
                       const std::string& title, const std::string& y_label) {
  LinePlot plot;
  plot.title = title;
  plot.x_label = "phase of the EM loop";
  plot.y_label = y_label;
  plot.height = 540;
  std::map<std::pair<int, int>, std::string> axis;
  for (const Job& job : jobs) {
    for (const SyntheticRun::Phase& phase : job.phases) {
      if (phase.iteration > kDrawnIterations) continue;
      axis.emplace(std::make_pair(phase.iteration, phase.order),
                   PhaseLabel(phase));
    }
  }
  double x = 0.0;
  for (const auto& [key, label] : axis) plot.x_ticks.emplace_back(x++, label);
  for (const std::string& condition : conditions) {
    PlotSeries series;
    series.name = condition;
    x = 0.0;
    for (const auto& entry : axis) {
      std::vector<double> errors;
      for (const Job& job : jobs) {
        if (!job.is_done || job.condition != condition) continue;
        double error = kNan;
        for (const SyntheticRun::Phase& phase : job.phases) {
          if (std::make_pair(phase.iteration, phase.order) <= entry.first) {
            error = phase.error;
          }
        }
        errors.push_back(error);
      }
      const Estimate mean = MeanEstimate(errors);
      series.x.push_back(x++);
      series.y.push_back(mean.value);
      series.low.push_back(mean.low);
      series.high.push_back(mean.high);
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

void AddLevel(const std::string& name, double y, int color, LinePlot* plot) {
  PlotSeries series;
  series.name = name;
  series.dashed = true;
  series.color = color;
  series.x = {0.0, static_cast<double>(plot->x_ticks.size()) - 1.0};
  series.y = {y, y};
  plot->series.push_back(std::move(series));
}

Estimate RatioOfMeans(const ExperimentResult& result, const std::string& name,
                      const std::string& condition,
                      const std::string& reference) {
  std::vector<double> values = Column(result, condition, name);
  std::vector<double> of_reference = Column(result, reference, name);
  const std::size_t trials = std::min(values.size(), of_reference.size());
  values.resize(trials);
  of_reference.resize(trials);
  return RatioEstimate(values, of_reference);
}

void AddBound(const std::string& text, const Estimate& measured, double bound,
              ExperimentResult* result) {
  Claim claim;
  claim.text = text;
  claim.required = "at most " + Format("%g", bound);
  claim.measured = measured;
  // The mean of a few trials is not the mean: its interval decides.
  claim.holds = measured.high <= bound;
  claim.is_open = !claim.holds && measured.low <= bound;
  result->claims.push_back(std::move(claim));
}

void AddShare(const std::string& text, const std::vector<double>& successes,
              int required, ExperimentResult* result) {
  const int count =
      static_cast<int>(std::count(successes.begin(), successes.end(), 1.0));
  const int trials = static_cast<int>(successes.size());
  Claim claim;
  claim.text = text + " (" + std::to_string(count) + " of " +
               std::to_string(trials) + ")";
  claim.required = "in at least " + std::to_string(required) + " of 20 trials";
  claim.measured = ShareEstimate(count, trials);
  claim.holds = trials > 0 && count * 20 >= required * trials;
  result->claims.push_back(std::move(claim));
}

}  // namespace plumbline
