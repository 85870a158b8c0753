// Turns a robot's log, or a graph, into a true map.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/flag_remarks.h>
#include <plumbline/apps/solve/live_map.h>
#include <plumbline/apps/solve/log_input.h>
#include <plumbline/apps/solve/run_clock.h>
#include <plumbline/apps/solve/run_context.h>
#include <plumbline/apps/solve/run_outputs.h>
#include <plumbline/apps/solve/solve_graph.h>
#include <plumbline/apps/solve/solve_log.h>
#include <plumbline/apps/solve/solve_logs.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/plugin.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/outputs/marginals_output.h>
#include <plumbline/outputs/output_folder.h>
#include <plumbline/outputs/solve_outputs.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/several_logs.h>

#include <cstdio>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

void LoadPlugins(Registry* registry) {
  std::istringstream list(FLAGS_plugins);
  std::string path;
  while (std::getline(list, path, ',')) {
    if (!path.empty()) LoadPlugin(path, registry);
  }
}

// Parameters of a detector, a line each: "min_side=1 m", "angle_0, angle_1, ...
// deg".
void ListParameters(const DetectorType& detector) {
  for (const DetectorParameter& parameter : detector.parameters) {
    std::ostringstream text;
    if (parameter.is_list) {
      text << parameter.name << "0, " << parameter.name << "1, ...";
    } else {
      text << parameter.name << '=' << parameter.default_value;
    }
    if (!parameter.unit.empty()) text << ' ' << parameter.unit;
    std::printf("    %-32s %s\n", text.str().c_str(),
                parameter.description.c_str());
  }
}

void ListPlugins(const Registry& registry) {
  for (const PluginList* list : registry.lists()) {
    std::printf("%s\n", list->title().c_str());
    for (const PluginList::Entry& entry : list->entries()) {
      std::printf("  %-34s %s\n", entry.name.c_str(),
                  entry.description.c_str());
      if (list->title() != DetectorType::kTitle) continue;
      ListParameters(registry.GetDetector(entry.name));
    }
  }
}

// What --check_flags looks at besides: all that a run finds wrong with its
// flags only when it has seen what its input is. Files that the flags name are
// read, the input is not.
void CheckRemainingFlags(bool are_several, const Registry& registry) {
  const LogSolverOptions options = LogSolverOptionsFromFlags(registry);
  LaserOptionsFromFlags();
  LiveMap::CheckFlags();
  if (are_several) CheckOptionsOfLogs(options);
  // Only a log is made of scans, and these are known to come from one.
  if (are_several || options.features != RawFeatures::kSegments) {
    CheckHierarchy(options, registry);
    return;
  }
  if (!options.structure || options.hierarchy.empty()) return;
  // A graph may hold whatever there is.
  std::vector<std::string> types;
  for (const FeatureType* type : registry.features()) {
    types.push_back(type->name);
  }
  ForFlag("hierarchy", [&] {
    MakeHierarchy(options.hierarchy, registry, types,
                  options.detector_parameters);
  });
}

int Run() {
  RunClock clock;
  Registry& registry = Registry::Global();
  RegisterBuiltins(&registry);
  RegisterBuiltinLogReaders(&registry);
  RegisterBuiltinOutputWriters(&registry);
  LoadPlugins(&registry);
  if (FLAGS_list_plugins) {
    if (!OnlyChecksFlags()) ListPlugins(registry);
    return kExitSuccess;
  }
  // Whoever asks about flags may yet add these two.
  if (!OnlyChecksFlags() && (FLAGS_input.empty() || FLAGS_output_dir.empty())) {
    std::fprintf(stderr,
                 "plumbline_solve: --input and --output_dir are needed; see "
                 "--help\n");
    return kExitUsage;
  }
  RefuseFlagsWithoutEffect();
  if (!OnlyChecksFlags()) RemarkOnStructureFlags();
  // Wrong lists are refused before the work.
  ForFlag("outputs", [&] { SelectOutputs(FLAGS_outputs, registry); });
  if (ParseMarginalsSelection(FLAGS_marginals, registry).empty() &&
      FLAGS_ellipse_sigmas > 0.0) {
    throw Error("--ellipse_sigmas", 0, "ellipses of nothing",
                "features named by --marginals");
  }
  // Inputs are read ahead from when they are opened on.
  const ThreadsScope threads(NumThreadsFromFlags());
  const LogReaderType* reader =
      FLAGS_log_reader.empty()
          ? nullptr
          : &ForFlag(
                "log_reader", [&]() -> const auto& {
                  return registry.Get<LogReaderType>(FLAGS_log_reader);
                });
  const std::vector<std::string> names = InputsFromFlags();
  if (names.empty() || names.size() > kMostLogs) {
    throw Error("--input", 0, std::to_string(names.size()) + " names",
                "1 to " + std::to_string(kMostLogs) + " separated by commas");
  }
  const auto starts =
      ForFlag("start_pose", [&] { return StartPosesFromFlags(names.size()); });
  const std::unique_ptr<EarlierMap> earlier = EarlierMapFromFlags(registry);
  if (OnlyChecksFlags()) {
    CheckRemainingFlags(names.size() > 1 || earlier != nullptr, registry);
    return kExitSuccess;
  }
  std::vector<std::unique_ptr<OpenInput>> inputs;
  for (const std::string& name : names) {
    inputs.push_back(Open(name, registry, reader));
    if (inputs.back() == nullptr) {
      std::fprintf(stderr, "interrupted: nothing was read yet\n");
      return kExitInterrupted;
    }
    if (!inputs.back()->is_graph) continue;
    if (earlier != nullptr) {
      throw Error("--input", 0, name + " is a graph",
                  "logs: --map goes with nothing else");
    }
    if (names.size() > 1) {
      throw Error("--input", 0, name + " is a graph",
                  "one graph alone, or logs");
    }
  }
  // What is wrong with the folder is said before the work, not after it.
  OutputFolder folder(FLAGS_output_dir, NamesOfAllOutputs(registry),
                      InputFiles());
  folder.CheckTargets(FilesOfOutputs(OutputsFromFlags(registry), registry));
  if (!folder.cleaned().empty()) {
    Remark("%s: removed what a run that was killed had left: %s",
           FLAGS_output_dir.c_str(), Joined(folder.cleaned()).c_str());
  }
  LiveMap live(clock);
  const RunContext run{registry, &clock, &live, &folder};
  if (inputs.size() > 1 || earlier != nullptr) {
    return SolveLogs(inputs, starts, earlier.get(), run);
  }
  OpenInput& input = *inputs.front();
  return input.is_graph ? SolveGraph(&*input.stream, run)
                        : SolveLog(input.log, run);
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  plumbline::AppInfo info;
  info.name = "plumbline_solve";
  info.summary =
      "Turns a robot's log or a graph into a true map: finds the walls, the "
      "directions that they share and the right angles between them, and uses "
      "them.";
  info.usage = {"--input=LOG_OR_GRAPH --output_dir=DIR [flags]",
                "--list_plugins [--plugins=libmine.so]"};
  info.example =
      "plumbline_solve --input=datasets/office.clf.gz --output_dir=out/office";
  info.groups = plumbline::SolveFlagGroups();
  info.statuses = {{plumbline::kExitElsewhere,
                    "A log fits nowhere in --map, or in more than one place; "
                    "nothing is written"}};
  info.checks_flags_itself = true;
  plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain(plumbline::Run);
}
