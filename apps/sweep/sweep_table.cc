#include <plumbline/apps/sweep/sweep_table.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

namespace plumbline {
namespace {

std::string Cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string cell = "\"";
  for (const char c : text) {
    if (c == '"') cell += '"';
    cell += c;
  }
  return cell + "\"";
}

double Value(const RunRecord& record, const std::string& figure) {
  for (const auto& [name, value] : record.figures) {
    if (name == figure) return value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

SweepResult CollectSweep(const SweepDefinition& definition,
                         const std::string& folder) {
  SweepResult result;
  result.definition = definition;
  result.runs = MakeRuns(definition);
  for (const SweepRun& run : result.runs) {
    result.records.push_back(ReadRecord(RunFolder(folder, run)));
  }
  return result;
}

std::vector<std::string> FigureNames(const SweepResult& result) {
  std::vector<std::string> names;
  std::set<std::string> known;
  for (const std::optional<RunRecord>& record : result.records) {
    if (!record) continue;
    for (const Figure& figure : record->figures) {
      if (known.insert(figure.first).second) names.push_back(figure.first);
    }
  }
  return names;
}

bool IsMeasuredResource(const std::string& figure) {
  for (const char* part : {"time_s", "seconds", "memory"}) {
    if (figure.find(part) != std::string::npos) return true;
  }
  return false;
}

std::string TableNumber(double value) {
  std::string text;
  if (std::abs(value) < 1e15 && value == std::floor(value)) {
    AppendNumber(static_cast<std::int64_t>(value), &text);
  } else {
    AppendNumber(value, &text);
  }
  return text;
}

void WriteSweepTable(const SweepResult& result, bool resources,
                     std::ostream& output) {
  std::set<std::string> taken = {"run", "seed", "status", "reason"};
  output << "run";
  for (const SweepAxis& axis : result.definition.axes) {
    output << ',' << Cell(axis.flag);
    taken.insert(axis.flag);
  }
  output << ",seed,status,reason";
  std::vector<std::string> columns;
  for (const std::string& name : FigureNames(result)) {
    if (name == "seed" || name.compare(0, 6, "flags.") == 0) continue;
    if (!resources && IsMeasuredResource(name)) continue;
    output << ',' << Cell((taken.count(name) > 0 ? "summary." : "") + name);
    columns.push_back(name);
  }
  output << '\n';
  for (std::size_t i = 0; i < result.runs.size(); ++i) {
    if (!result.records[i]) continue;
    const SweepRun& run = result.runs[i];
    const RunRecord& record = *result.records[i];
    output << Cell(run.name);
    for (const std::string& value : run.values) output << ',' << Cell(value);
    output << ',' << run.seed << ',' << RunStatusName(record.status) << ','
           << Cell(record.reason);
    for (const std::string& column : columns) {
      const double value = Value(record, column);
      output << ',' << (std::isnan(value) ? "" : TableNumber(value));
    }
    output << '\n';
  }
}

std::vector<SweepSetting> Settings(const SweepResult& result) {
  std::vector<SweepSetting> settings;
  for (std::size_t i = 0; i < result.runs.size(); ++i) {
    if (settings.empty() || settings.back().values != result.runs[i].values) {
      settings.emplace_back();
      settings.back().values = result.runs[i].values;
    }
    settings.back().runs.push_back(i);
    const std::optional<RunRecord>& record = result.records[i];
    settings.back().done += record && record->status == RunStatus::kDone;
  }
  return settings;
}

std::vector<double> FigureValues(const SweepResult& result,
                                 const SweepSetting& setting,
                                 const std::string& figure) {
  std::vector<double> values;
  for (const std::size_t i : setting.runs) {
    const std::optional<RunRecord>& record = result.records[i];
    values.push_back(record ? Value(*record, figure)
                            : std::numeric_limits<double>::quiet_NaN());
  }
  return values;
}

Estimate MeanOfNumbers(const std::vector<double>& values) {
  std::vector<double> numbers;
  std::copy_if(values.begin(), values.end(), std::back_inserter(numbers),
               [](double value) { return !std::isnan(value); });
  return MeanEstimate(numbers);
}

bool IsFigure(const SweepResult& result, const std::string& figure) {
  const std::vector<std::string> names = FigureNames(result);
  return std::find(names.begin(), names.end(), figure) != names.end() ||
         std::any_of(result.records.begin(), result.records.end(),
                     [&](const std::optional<RunRecord>& record) {
                       return record &&
                              std::count(record->unknown.begin(),
                                         record->unknown.end(), figure) > 0;
                     });
}

std::optional<BestSetting> FindBest(const SweepResult& result,
                                    const std::string& figure, bool minimize) {
  const std::vector<std::string> names = FigureNames(result);
  if (!names.empty() && !IsFigure(result, figure)) {
    std::string known;
    for (const std::string& name : names) {
      known += (known.empty() ? "" : ", ") + name;
    }
    throw Error(minimize ? "--minimize" : "--maximize", 0,
                "no run has a figure '" + figure + "'", "one of " + known);
  }
  const std::vector<SweepSetting> settings = Settings(result);
  const double sign = minimize ? 1.0 : -1.0;
  std::vector<std::vector<double>> values;
  std::optional<BestSetting> best;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    values.push_back(FigureValues(result, settings[i], figure));
    if (std::any_of(values[i].begin(), values[i].end(),
                    [](double value) { return std::isnan(value); })) {
      values[i].clear();
      continue;
    }
    const Estimate mean = MeanEstimate(values[i]);
    if (!best || sign * mean.value < sign * best->mean.value) {
      best.emplace();
      best->setting = i;
      best->mean = mean;
    }
  }
  if (!best) return std::nullopt;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    if (i == best->setting || values[i].empty()) continue;
    std::vector<double> differences;
    for (std::size_t k = 0; k < values[i].size(); ++k) {
      differences.push_back(values[i][k] - values[best->setting][k]);
    }
    const Estimate difference = MeanEstimate(differences);
    if (difference.low <= 0.0 && difference.high >= 0.0) {
      best->equals.push_back(i);
    }
  }
  return best;
}

}  // namespace plumbline
