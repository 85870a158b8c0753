#ifndef PLUMBLINE_APPS_SWEEP_SWEEP_TABLE_H_
#define PLUMBLINE_APPS_SWEEP_SWEEP_TABLE_H_

#include <plumbline/apps/evaluation/confidence.h>
#include <plumbline/apps/sweep/sweep.h>

#include <optional>
#include <ostream>
#include <string>
#include <vector>

namespace plumbline {

/// A sweep and what came of it.
struct SweepResult {
  SweepDefinition definition;
  /// MakeRuns(definition).
  std::vector<SweepRun> runs;
  /// Of each run; none where it was not done yet.
  std::vector<std::optional<RunRecord>> records;
};

/// Reads the records that there are.
SweepResult CollectSweep(const SweepDefinition& definition,
                         const std::string& folder);

/// Names of the figures of all runs, in the order in which they first come.
std::vector<std::string> FigureNames(const SweepResult& result);

/// Whether a figure is measured time or memory, by its name ("time_s",
/// "seconds" or "memory" in it): other than the rest, it differs between two
/// runs of the same.
bool IsMeasuredResource(const std::string& figure);

/// A number as it stands in a table: whole ones without an exponent, others in
/// the shortest way that reads back as the same.
std::string TableNumber(double value);

/// Writes a row for each run that has a record, with a header: run, the axes'
/// flags, seed, status, reason, and the figures by their names. Left out are
/// figures that these columns hold already (seed and flags.*) and, without
/// `resources`, measured time and memory; a figure with the name of an axis
/// becomes summary.<name>.
void WriteSweepTable(const SweepResult& result, bool resources,
                     std::ostream& output);

/// A value for every axis, and its runs.
struct SweepSetting {
  std::vector<std::string> values;
  /// Indices into SweepResult::runs, by seed.
  std::vector<std::size_t> runs;
  /// How many of them are done.
  int done = 0;
};

/// In the order of the runs.
std::vector<SweepSetting> Settings(const SweepResult& result);

/// A figure in the runs of a setting, by seed: not a number where a run is not
/// done or has no such figure.
std::vector<double> FigureValues(const SweepResult& result,
                                 const SweepSetting& setting,
                                 const std::string& figure);

/// Mean of the values that are numbers, with its confidence interval.
Estimate MeanOfNumbers(const std::vector<double>& values);

/// The best setting by the mean of a figure.
struct BestSetting {
  /// Index into Settings().
  std::size_t setting = 0;
  Estimate mean;
  /// Settings that are as good as far as one can tell: the confidence interval
  /// of the mean difference from the best, paired by seed, holds 0. With one
  /// trial only those of the same value.
  std::vector<std::size_t> equals;
};

/// Whether a figure is one that runs tell of, if only to say that they do not
/// know it (null).
bool IsFigure(const SweepResult& result, const std::string& figure);

/// Settings of which a run is not done or has no such figure do not take part;
/// none when that is true of all. Throws Error for what is no figure
/// (IsFigure), when there are runs that are done.
std::optional<BestSetting> FindBest(const SweepResult& result,
                                    const std::string& figure, bool minimize);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SWEEP_SWEEP_TABLE_H_
