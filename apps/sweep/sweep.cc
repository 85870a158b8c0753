#include <plumbline/apps/sweep/child_process.h>
#include <plumbline/apps/sweep/sweep.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/text_file.h>
#include <plumbline/core/utf8.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <system_error>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Names of files may have 255 bytes; some are left for whoever copies folders.
constexpr std::size_t kLongestName = 150;
// Each run is held in memory, and has a folder.
constexpr double kMostRuns = 1e6;
// Bytes.
constexpr std::size_t kLargestDefinition = std::size_t{1} << 26;

// A new file of a name that nobody knows beforehand: others may write to the
// folder for temporary files, too. Gone with the object.
class ScratchFile {
 public:
  ScratchFile() {
    std::error_code failure;
    const fs::path folder = fs::temp_directory_path(failure);
    path_ = (folder / "plumbline_sweep_XXXXXX").string();
    const int descriptor = failure ? -1 : mkstemp(path_.data());
    if (descriptor < 0) {
      throw Error(
          failure ? "TMPDIR" : path_, 0,
          "a temporary file cannot be made: " +
              (failure ? failure.message() : std::string(std::strerror(errno))),
          "a writable folder for temporary files");
    }
    close(descriptor);
  }
  ~ScratchFile() {
    std::error_code ignored;
    fs::remove(path_, ignored);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

bool ReadText(const std::string& path, std::string* text) {
  // Opening a pipe would wait for who writes to it, and a device has no end.
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  std::ifstream file(path, std::ios::binary);
  text->assign(std::istreambuf_iterator<char>(file),
               std::istreambuf_iterator<char>());
  return file.is_open() && !file.bad();
}

// Where a sweep.json is written: no other folder has both, and whoever sends an
// archive does not know the second beforehand.
Json PlaceOf(const std::string& folder) {
  struct stat status = {};
  stat(folder.c_str(), &status);
  return {{"folder", folder},
          {"inode", static_cast<std::uint64_t>(status.st_ino)}};
}

void WriteJson(const Json& json, const std::string& path) {
  WriteFileAtomically(path, [&](std::ostream& output) {
    output << json.dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
  });
}

// FNV-1a, 64 bits.
std::string Hash(const std::string& text) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const unsigned char c : text) {
    hash = (hash ^ c) * 0x100000001b3u;
  }
  char digits[20];
  std::snprintf(digits, sizeof(digits), "%016llx",
                static_cast<unsigned long long>(hash));
  return digits;
}

std::string RunName(const SweepDefinition& definition, const SweepRun& run) {
  // The parts are kept apart by what no argument can hold.
  std::string exact;
  std::string name;
  for (std::size_t i = 0; i < run.values.size(); ++i) {
    exact += definition.axes[i].flag + '\0' + run.values[i] + '\0';
    std::string flag = definition.axes[i].flag;
    std::replace(flag.begin(), flag.end(), ':', '.');
    name += flag + "=" + run.values[i] + ",";
  }
  const std::string seed = "seed=" + std::to_string(run.seed);
  bool is_exact = name.size() + seed.size() <= kLongestName;
  const std::string_view safe = "_-.=,+";
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) ||
        safe.find(c) != std::string_view::npos) {
      continue;
    }
    c = '_';
    is_exact = false;
  }
  // A comma within a value looks like the next flag.
  for (const std::string& value : run.values) {
    if (value.find(',') != std::string::npos) is_exact = false;
  }
  if (is_exact) return name + seed;
  return name.substr(0, kLongestName - 60) + Hash(exact) + "," + seed;
}

void AddNumbers(const Json& json, const std::string& name, bool count_lists,
                std::vector<Figure>* figures,
                std::vector<std::string>* unknown) {
  const auto inner = [&](const std::string& key) {
    return name.empty() ? key : name + "." + key;
  };
  if (json.is_object()) {
    for (const auto& [key, value] : json.items()) {
      AddNumbers(value, inner(key), count_lists, figures, unknown);
    }
  } else if (json.is_array()) {
    if (count_lists) {
      figures->emplace_back(name, static_cast<double>(json.size()));
      return;
    }
    for (std::size_t i = 0; i < json.size(); ++i) {
      AddNumbers(json[i], inner(std::to_string(i)), count_lists, figures,
                 unknown);
    }
  } else if (json.is_boolean()) {
    figures->emplace_back(name, json.get<bool>() ? 1.0 : 0.0);
  } else if (json.is_number()) {
    figures->emplace_back(name, json.get<double>());
  } else if (json.is_null() && unknown != nullptr) {
    unknown->push_back(name);
  }
}

// Runs without seeds and names.
std::vector<SweepRun> AllCombinations(const std::vector<SweepAxis>& axes) {
  std::vector<SweepRun> settings(1);
  for (const SweepAxis& axis : axes) {
    std::vector<SweepRun> finer;
    for (const SweepRun& setting : settings) {
      for (const std::string& value : axis.values) {
        finer.push_back(setting);
        finer.back().values.push_back(value);
      }
    }
    settings = std::move(finer);
  }
  return settings;
}

std::vector<SweepRun> OneAtATime(const std::vector<SweepAxis>& axes) {
  std::vector<SweepRun> settings(1);
  for (const SweepAxis& axis : axes) {
    settings[0].values.push_back(axis.values[0]);
  }
  for (std::size_t i = 0; i < axes.size(); ++i) {
    for (std::size_t k = 1; k < axes[i].values.size(); ++k) {
      settings.push_back(settings[0]);
      settings.back().values[i] = axes[i].values[k];
    }
  }
  return settings;
}

RunStatus StatusFromName(const std::string& name) {
  for (const RunStatus status :
       {RunStatus::kDone, RunStatus::kFailed, RunStatus::kTimedOut}) {
    if (name == RunStatusName(status)) return status;
  }
  throw PLUMBLINE_ERROR("there is no status '" + name + "'",
                        "done, failed or timed_out");
}

void WriteRecord(const RunRecord& record, const std::string& run_folder) {
  Json figures = Json::array();
  for (const auto& [name, value] : record.figures) {
    figures.push_back({name, value});
  }
  WriteJson({{"status", RunStatusName(record.status)},
             {"reason", record.reason},
             {"seconds", record.seconds},
             {"figures", std::move(figures)},
             {"unknown", record.unknown}},
            run_folder + "/run.json");
}

// The last line that says something, for people; empty when there is none.
std::string LastLine(const std::string& path) {
  constexpr std::streamoff kTail = 4096;
  constexpr std::size_t kLongest = 300;
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = file.tellg();
  file.seekg(std::max<std::streamoff>(0, size - kTail));
  std::string last;
  for (std::string line; std::getline(file, line);) {
    // A progress bar writes over its own line.
    const std::size_t end = line.find_last_not_of(" \t\r");
    if (end == std::string::npos) continue;
    line.resize(end + 1);
    const std::size_t begin = line.find_last_of('\r') + 1;
    if (begin < line.size()) last = line.substr(begin);
  }
  // What the sweep itself wrote: the command printed nothing.
  if (last.compare(0, 2, "$ ") == 0) return "";
  last = PrintableUtf8(last);
  return last.size() > kLongest ? last.substr(0, kLongest) + "..." : last;
}

// The files that figures are read from, as they were before a run: what is
// still so after it is none of that run's.
class FiguresBefore {
 public:
  explicit FiguresBefore(const std::string& run_folder)
      : folder_(run_folder),
        summary_(Look("summary.json")),
        evaluation_(Look("evaluation.json")) {}

  // False when there is none, or that of before.
  bool ReadSummary(std::string* text) const {
    return Look("summary.json") != summary_ &&
           ReadText(folder_ + "/summary.json", text);
  }
  bool ReadEvaluation(std::string* text) const {
    return Look("evaluation.json") != evaluation_ &&
           ReadText(folder_ + "/evaluation.json", text);
  }

 private:
  // Number, size and time of last change.
  using Stamp = std::array<std::int64_t, 4>;

  Stamp Look(const char* name) const {
    struct stat status = {};
    if (stat((folder_ + "/" + name).c_str(), &status) != 0) return {};
    return {static_cast<std::int64_t>(status.st_ino), status.st_size,
            status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
  }

  std::string folder_;
  Stamp summary_;
  Stamp evaluation_;
};

// Reads the run's figures; what is wrong with them otherwise.
std::string ReadFigures(const SweepDefinition& definition,
                        const FiguresBefore& before, RunRecord* record) {
  std::string text;
  if (!before.ReadSummary(&text)) return "no summary.json";
  try {
    record->figures = Numbers(text, false, "summary.json", &record->unknown);
    if (!definition.evaluate.empty() && before.ReadEvaluation(&text)) {
      std::vector<std::string> unknown;
      for (Figure& figure : Numbers(text, true, "evaluation.json", &unknown)) {
        record->figures.emplace_back("evaluation." + figure.first,
                                     figure.second);
      }
      for (const std::string& name : unknown) {
        record->unknown.push_back("evaluation." + name);
      }
    }
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace

void WriteDefinition(const SweepDefinition& definition,
                     const std::string& folder) {
  Json axes = Json::array();
  for (const SweepAxis& axis : definition.axes) {
    axes.push_back({{"flag", axis.flag}, {"values", axis.values}});
  }
  Json environment = Json::object();
  for (const auto& [name, value] : definition.environment) {
    environment[name] = value;
  }
  WriteJson({{"axes", std::move(axes)},
             {"one_at_a_time", definition.one_at_a_time},
             {"trials", definition.trials},
             {"first_seed", definition.first_seed},
             {"seed_flag", definition.seed_flag},
             {"command", definition.command},
             {"evaluate", definition.evaluate},
             {"working_directory", definition.working_directory},
             {"environment", std::move(environment)},
             {"time_limit", definition.time_limit},
             {"objective", definition.objective},
             {"maximize", definition.maximize},
             {"best_digest", definition.best_digest},
             {"made_in", PlaceOf(folder)}},
            folder + "/sweep.json");
}

bool WasDefinedHere(const std::string& folder) {
  std::string text;
  if (!ReadText(folder + "/sweep.json", &text)) return false;
  const Json json = Json::parse(text, nullptr, false);
  return json.is_object() && json.contains("made_in") &&
         json["made_in"] == PlaceOf(folder);
}

void CheckDefinition(const SweepDefinition& definition,
                     const std::string& path) {
  const auto require = [&](bool holds, const std::string& what,
                           const std::string& expected) {
    if (!holds) throw Error(path, 0, what, expected);
  };
  require(!definition.command.empty() && !definition.command[0].empty(),
          "has no command", "a program and its arguments");
  require(definition.trials >= 1, "has no trials", "at least 1");
  require(definition.time_limit >= 0.0 && std::isfinite(definition.time_limit),
          "has no time limit that makes sense", "seconds, or 0 for none");
  double settings = 1.0;
  double one_at_a_time = 1.0;
  for (const SweepAxis& axis : definition.axes) {
    require(!axis.flag.empty(), "has an axis without a name", "a flag");
    require(!axis.values.empty(), "has no values of '" + axis.flag + "'",
            "at least one");
    const std::set<std::string> distinct(axis.values.begin(),
                                         axis.values.end());
    require(distinct.size() == axis.values.size(),
            "has a value of '" + axis.flag + "' twice", "each once");
    settings *= static_cast<double>(axis.values.size());
    one_at_a_time += static_cast<double>(axis.values.size()) - 1.0;
  }
  const double runs =
      (definition.one_at_a_time ? one_at_a_time : settings) * definition.trials;
  if (runs > kMostRuns) {
    std::string count;
    AppendNumber(runs, &count);
    throw Error(path, 0, "makes " + count + " runs", "a million at most");
  }
}

std::optional<SweepDefinition> ReadDefinition(const std::string& folder) {
  const std::string path = folder + "/sweep.json";
  if (!fs::exists(path)) return std::nullopt;
  if (!fs::is_regular_file(path)) {
    throw Error(path, 0, "is no regular file", "a sweep, or nothing there");
  }
  const std::string text = ReadTextFile(path, kLargestDefinition);
  try {
    const Json json = Json::parse(text);
    SweepDefinition definition;
    for (const Json& axis : json.at("axes")) {
      definition.axes.push_back(
          {axis.at("flag").get<std::string>(),
           axis.at("values").get<std::vector<std::string>>()});
    }
    definition.one_at_a_time = json.at("one_at_a_time").get<bool>();
    // A number that does not fit would wrap around.
    const Json& trials = json.at("trials");
    if (!trials.is_number_integer() || trials < 1 ||
        trials > std::numeric_limits<int>::max()) {
      throw Error(path, 0, "trials are " + trials.dump(), "a whole number");
    }
    definition.trials = trials.get<int>();
    if (!json.at("first_seed").is_number_integer()) {
      throw Error(path, 0, "first_seed is " + json.at("first_seed").dump(),
                  "a whole number");
    }
    definition.first_seed = json.at("first_seed").get<std::uint64_t>();
    definition.seed_flag = json.at("seed_flag").get<std::string>();
    definition.command = json.at("command").get<std::vector<std::string>>();
    definition.evaluate = json.at("evaluate").get<std::vector<std::string>>();
    definition.working_directory =
        json.at("working_directory").get<std::string>();
    for (const auto& [name, value] : json.at("environment").items()) {
      definition.environment.emplace_back(name, value.get<std::string>());
    }
    definition.time_limit = json.at("time_limit").get<double>();
    definition.objective = json.value("objective", "");
    definition.maximize = json.value("maximize", false);
    definition.best_digest = json.value("best_digest", "");
    CheckDefinition(definition, path);
    return definition;
  } catch (const Json::exception& error) {
    throw Error(path, 0, std::string("cannot be read: ") + error.what(),
                "a file that plumbline_sweep wrote");
  }
}

void CheckSameRuns(const SweepDefinition& old_one,
                   const SweepDefinition& definition,
                   const std::string& folder) {
  const auto words = [](const std::vector<std::string>& command) {
    std::string text;
    for (const std::string& word : command) {
      text += (text.empty() ? "" : " ") + QuoteForShell(word);
    }
    return text;
  };
  const auto check = [&](const std::string& what, const std::string& was,
                         const std::string& is) {
    if (was == is) return;
    throw Error(folder, 0,
                "holds runs of another sweep: its " + what + " is " +
                    QuoteForShell(was) + ", not " + QuoteForShell(is),
                "the same one, or another folder");
  };
  check("command", words(old_one.command), words(definition.command));
  check("evaluation", words(old_one.evaluate), words(definition.evaluate));
  check("seed flag", old_one.seed_flag, definition.seed_flag);
  check("working directory", old_one.working_directory,
        definition.working_directory);
}

std::vector<SweepRun> MakeRuns(const SweepDefinition& definition) {
  const std::vector<SweepRun> settings = definition.one_at_a_time
                                             ? OneAtATime(definition.axes)
                                             : AllCombinations(definition.axes);
  std::vector<SweepRun> runs;
  for (const SweepRun& setting : settings) {
    for (int trial = 0; trial < definition.trials; ++trial) {
      runs.push_back(setting);
      runs.back().seed = definition.first_seed + trial;
      runs.back().name = RunName(definition, runs.back());
    }
  }
  return runs;
}

std::vector<std::string> SettingFlags(const SweepDefinition& definition,
                                      const std::vector<std::string>& values) {
  std::vector<std::string> flags;
  // Where the list of a flag with keys stands.
  std::map<std::string, std::size_t> lists;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string& flag = definition.axes[i].flag;
    const std::size_t colon = flag.find(':');
    if (colon == std::string::npos) {
      flags.push_back("--" + flag + "=" + values[i]);
      continue;
    }
    const std::string entry = flag.substr(colon + 1) + "=" + values[i];
    const auto list = lists.emplace(flag.substr(0, colon), flags.size());
    if (list.second) {
      flags.push_back("--" + list.first->first + "=" + entry);
    } else {
      flags[list.first->second] += "," + entry;
    }
  }
  return flags;
}

std::string SettingText(const SweepDefinition& definition,
                        const std::vector<std::string>& values) {
  std::string text;
  for (const std::string& flag : SettingFlags(definition, values)) {
    text += (text.empty() ? "" : " ") + QuoteForShell(flag);
  }
  return text.empty() ? "(no flags)" : text;
}

std::vector<std::string> RunCommand(const SweepDefinition& definition,
                                    const SweepRun& run,
                                    const std::string& run_folder) {
  std::vector<std::string> command = definition.command;
  for (std::string& flag : SettingFlags(definition, run.values)) {
    command.push_back(std::move(flag));
  }
  if (!definition.seed_flag.empty()) {
    command.push_back("--" + definition.seed_flag + "=" +
                      std::to_string(run.seed));
  }
  command.push_back("--output_dir=" + run_folder);
  return command;
}

const char* RunStatusName(RunStatus status) {
  switch (status) {
    case RunStatus::kDone:
      return "done";
    case RunStatus::kFailed:
      return "failed";
    case RunStatus::kTimedOut:
      return "timed_out";
  }
  return "";
}

std::string RunFolder(const std::string& folder, const SweepRun& run) {
  return folder + "/runs/" + run.name;
}

void CheckFlagsOfRuns(const SweepDefinition& definition) {
  const auto check = [&](std::vector<std::string> command,
                         const std::string& place) {
    if (fs::path(command[0]).filename().string().compare(0, 10, "plumbline_") !=
        0) {
      return;
    }
    command.push_back("--check_flags");
    const ScratchFile log;
    ChildOptions child;
    child.command = command;
    child.working_directory = definition.working_directory;
    child.environment = definition.environment;
    child.log = log.path();
    const ChildResult result = RunChild(child);
    std::string said;
    ReadText(log.path(), &said);
    if (result.succeeded) return;
    const std::string first = said.substr(0, said.find('\n'));
    throw Error(place, 0,
                "the command would refuse it: " +
                    (first.empty() ? result.failure : PrintableUtf8(first)),
                "");
  };
  SweepDefinition one_by_one = definition;
  one_by_one.one_at_a_time = true;
  one_by_one.trials = 1;
  for (const SweepRun& run : MakeRuns(one_by_one)) {
    check(RunCommand(definition, run, "."),
          run.values.empty() ? definition.command[0]
                             : SettingText(definition, run.values));
  }
  if (!definition.evaluate.empty()) check(definition.evaluate, "--evaluate");
}

std::optional<RunRecord> ReadRecord(const std::string& run_folder) {
  std::string text;
  if (!ReadText(run_folder + "/run.json", &text)) return std::nullopt;
  try {
    const Json json = Json::parse(text);
    RunRecord record;
    record.status = StatusFromName(json.at("status").get<std::string>());
    record.reason = json.at("reason").get<std::string>();
    record.seconds = json.at("seconds").get<double>();
    for (const Json& figure : json.at("figures")) {
      record.figures.emplace_back(figure.at(0).get<std::string>(),
                                  figure.at(1).get<double>());
    }
    // Records of older versions have none.
    if (json.contains("unknown")) {
      record.unknown = json.at("unknown").get<std::vector<std::string>>();
    }
    return record;
  } catch (const std::exception&) {
    // Somebody else's: the run is done anew.
    return std::nullopt;
  }
}

void RecordLoss(const std::string& run_folder) {
  std::error_code ignored;
  fs::create_directories(run_folder, ignored);
  RunRecord record;
  record.reason = "ended without a record";
  WriteRecord(record, run_folder);
}

std::vector<Figure> Numbers(const std::string& text, bool count_lists,
                            const std::string& path,
                            std::vector<std::string>* unknown) {
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::exception& error) {
    throw Error(path, 0, std::string("cannot be read: ") + error.what(),
                "JSON");
  }
  if (!json.is_object()) throw Error(path, 0, "is no object", "{...}");
  std::vector<Figure> figures;
  AddNumbers(json, "", count_lists, &figures, unknown);
  return figures;
}

std::optional<RunRecord> ExecuteRun(const SweepDefinition& definition,
                                    const SweepRun& run,
                                    const std::string& folder,
                                    const std::function<bool()>& stop) {
  const std::string run_folder = RunFolder(folder, run);
  std::error_code error;
  // What an earlier attempt left there stays: the command may go on from it,
  // and nobody can tell it from what somebody else put there.
  fs::create_directories(run_folder, error);
  if (!fs::is_directory(run_folder)) {
    throw Error(run_folder, 0, "cannot be made", "a writable place");
  }
  const FiguresBefore before(run_folder);
  const Stopwatch watch;
  bool is_late = false;
  ChildOptions child;
  child.working_directory = definition.working_directory;
  child.environment = definition.environment;
  child.log = run_folder + "/log.txt";
  child.stop = [&] {
    is_late =
        definition.time_limit > 0.0 && watch.Seconds() > definition.time_limit;
    return is_late || (stop && stop());
  };

  RunRecord record;
  const auto take = [&](const std::vector<std::string>& command,
                        const std::string& prefix) {
    std::string line = "$";
    for (const std::string& word : command) line += " " + QuoteForShell(word);
    std::ofstream(child.log, std::ios::app) << line << '\n';
    child.command = command;
    const ChildResult result = RunChild(child);
    if (result.stopped && !is_late) return false;
    if (result.stopped) {
      record.status = RunStatus::kTimedOut;
      record.reason = "longer than ";
      AppendNumber(definition.time_limit, &record.reason);
      record.reason += " s";
    } else if (!result.succeeded) {
      record.reason = prefix + result.failure;
      const std::string last = LastLine(child.log);
      if (!last.empty()) record.reason += ": " + last;
    }
    return true;
  };
  if (!take(RunCommand(definition, run, run_folder), "")) return std::nullopt;
  if (record.reason.empty() && !definition.evaluate.empty()) {
    std::vector<std::string> command = definition.evaluate;
    for (std::string& word : command) {
      for (std::size_t i = word.find("{}"); i != std::string::npos;
           i = word.find("{}", i + run_folder.size())) {
        word.replace(i, 2, run_folder);
      }
    }
    if (!take(command, "evaluation: ")) return std::nullopt;
  }
  if (record.reason.empty()) {
    record.reason = ReadFigures(definition, before, &record);
    if (record.reason.empty()) record.status = RunStatus::kDone;
  }
  if (record.status != RunStatus::kDone) {
    record.figures.clear();
    record.unknown.clear();
  }
  record.seconds = watch.Seconds();
  WriteRecord(record, run_folder);
  return record;
}

}  // namespace plumbline
