// Turns a robot's log, or a graph, into a true map.

#include <gflags/gflags.h>
#include <plumbline/apps/app.h>
#include <plumbline/apps/em_trace.h>
#include <plumbline/apps/log_solver.h>
#include <plumbline/apps/map_drawing.h>
#include <plumbline/apps/progress.h>
#include <plumbline/apps/relations.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/apps/summary.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/plugin.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/input_stream.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <iostream>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

double Now() {
  return std::chrono::duration<double>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void LoadPlugins(Registry* registry) {
  std::istringstream list(FLAGS_plugins);
  std::string path;
  while (std::getline(list, path, ',')) {
    if (!path.empty()) LoadPlugin(path, registry);
  }
}

void ListPlugins(const Registry& registry) {
  auto line = [](const std::string& name, const std::string& description) {
    std::printf("  %-34s %s\n", name.c_str(), description.c_str());
  };
  std::printf("Feature types\n");
  for (const FeatureType* type : registry.features()) {
    line(type->name, type->description);
  }
  std::printf("Relations\n");
  for (const RelationType* type : registry.relations()) {
    line(type->name, type->description);
  }
  std::printf("Losses (--delta_mode)\n");
  for (const LossType* type : registry.losses()) {
    line(type->name, type->description);
  }
  std::printf("Detectors (--hierarchy)\n");
  for (const DetectorType* type : registry.detectors()) {
    line(type->name, type->description);
  }
}

// Runs the tasks on so many threads; the first exception, in the order of
// tasks, is thrown again when all have ended.
void RunTasks(const std::vector<std::function<void()>>& tasks, int threads) {
  std::vector<std::exception_ptr> failures(tasks.size());
  std::mutex mutex;
  std::size_t next = 0;
  auto work = [&] {
    for (;;) {
      std::size_t index;
      {
        std::lock_guard<std::mutex> lock(mutex);
        if (next == tasks.size()) return;
        index = next++;
      }
      try {
        tasks[index]();
      } catch (...) {
        failures[index] = std::current_exception();
      }
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < threads && i < static_cast<int>(tasks.size()); ++i) {
    pool.emplace_back(work);
  }
  work();
  for (std::thread& thread : pool) thread.join();
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

// What both kinds of input come to.
struct Outcome {
  std::vector<Pose2> trajectory;
  std::vector<TimedPose> timed_trajectory;
  std::vector<EmPhase> trace;
  CostReport initial_cost;
  CostReport final_cost;
  EmReport em;
  G2oFile g2o;
  bool is_graph = false;
  std::string title;
};

void WriteOutputs(const Graph& graph, const Outcome& outcome, Summary* summary,
                  double total_begin) {
  const std::filesystem::path dir(FLAGS_output_dir);
  const double begin = Now();
  MapDrawing drawing = DrawingFromGraph(graph, outcome.trajectory);
  drawing.title = outcome.title;
  std::vector<EmTraceRow> rows;
  for (const EmPhase& phase : outcome.trace) rows.push_back({phase, {}});
  std::vector<std::function<void()>> tasks = {
      [&] { WriteMapPng(drawing, dir / "map.png"); },
      [&] {
        WriteFileAtomically(dir / "map.json", [&](std::ostream& output) {
          WriteGraphJson(graph, output);
        });
      },
      [&] {
        WriteFileAtomically(dir / "graph.g2o", [&](std::ostream& output) {
          WriteG2o(graph, outcome.is_graph ? &outcome.g2o : nullptr, output);
        });
      },
      [&] { WriteMapSvg(drawing, dir / "map.svg"); },
      [&] { WriteEmTrace(rows, dir / "em_trace.csv"); },
  };
  if (!outcome.timed_trajectory.empty()) {
    tasks.push_back([&] {
      WriteFileAtomically(dir / "trajectory.tum", [&](std::ostream& output) {
        WriteTum(outcome.timed_trajectory, output);
      });
    });
  }
  RunTasks(tasks, NumThreadsFromFlags());

  CountGraph(graph, summary);
  summary->initial_cost = outcome.initial_cost.total();
  summary->measurement_cost = outcome.final_cost.measurement;
  summary->structure_cost = outcome.final_cost.structure;
  summary->em_iterations = outcome.em.iterations;
  summary->em_converged = outcome.em.converged;
  summary->detect_seconds = outcome.em.detect_seconds;
  summary->solve_seconds = outcome.em.solve_seconds;
  summary->write_seconds = Now() - begin;
  summary->total_seconds = Now() - total_begin;
  summary->peak_memory_bytes = PeakMemoryBytes();
  WriteSummary(*summary, dir / "summary.json");
}

int SolveLog(InputStream* input, const Registry& registry, double begin) {
  Summary summary;
  summary.input = FLAGS_input;
  summary.seed = FLAGS_seed;
  summary.flags = ChangedFlags();
  const LogSolverOptions options = LogSolverOptionsFromFlags(registry);

  const double parse_begin = Now();
  const Log log = ReadCarmenLog(input, CarmenOptionsFromFlags());
  summary.parse_seconds = Now() - parse_begin;
  for (const SkipReport& skip : log.skipped) {
    std::string lines;
    for (int line : skip.first_lines) lines += " " + std::to_string(line);
    std::fprintf(stderr, "%s: %lld skipped: %s; first at line%s\n",
                 input->name().c_str(), static_cast<long long>(skip.count),
                 skip.reason.c_str(), lines.c_str());
  }

  LogSolver solver(registry, options);
  LogSolverResult result;
  {
    Progress progress("solving", "scans",
                      static_cast<std::int64_t>(log.scans.size()));
    result = solver.Run(
        log,
        [&](std::size_t done, std::size_t) {
          progress.Update(static_cast<std::int64_t>(done));
        },
        InterruptRequested);
  }
  summary.scans = static_cast<std::int64_t>(result.trajectory.size());
  summary.skipped = log.skipped;
  summary.frontend_seconds =
      result.frontend_seconds + result.relocalization_seconds;
  summary.scan_seconds.assign(result.scan_seconds.begin(),
                              result.scan_seconds.end());

  Outcome outcome;
  outcome.trajectory = result.trajectory;
  for (std::size_t i = 0; i < result.trajectory.size(); ++i) {
    TimedPose timed;
    timed.timestamp = log.scans[i].timestamp;
    timed.timestamp_text = log.scans[i].timestamp_text;
    timed.pose = result.trajectory[i];
    outcome.timed_trajectory.push_back(timed);
  }
  outcome.trace = solver.trace();
  outcome.initial_cost = result.initial_cost;
  outcome.final_cost = result.final_cost;
  outcome.em = result.em;
  outcome.em.detect_seconds = result.detect_seconds;
  outcome.em.solve_seconds = result.solve_seconds;
  outcome.title =
      std::filesystem::path(input->name()).filename().string() +
      (FLAGS_structure ? ", with structure" : ", without structure");
  WriteOutputs(solver.graph(), outcome, &summary, begin);
  return kExitSuccess;
}

int SolveGraph(InputStream* input, const Registry& registry, double begin) {
  Summary summary;
  summary.input = FLAGS_input;
  summary.seed = FLAGS_seed;
  summary.flags = ChangedFlags();
  const LogSolverOptions options = LogSolverOptionsFromFlags(registry);

  const double parse_begin = Now();
  Graph graph;
  Outcome outcome;
  outcome.is_graph = true;
  {
    std::istringstream text(input->ReadRest());
    if (!input->damage().empty()) {
      throw Error(input->name(), 0, input->damage(), "a whole graph");
    }
    outcome.g2o = ReadG2o(text, input->name(), registry, &graph);
  }
  summary.parse_seconds = Now() - parse_begin;
  for (const auto& tag : outcome.g2o.unknown_tags) {
    std::fprintf(stderr,
                 "%s: %d lines with the unknown tag %s kept as they are\n",
                 input->name().c_str(), tag.second, tag.first.c_str());
  }

  Hierarchy hierarchy;
  if (options.structure) {
    std::set<std::string> raw;
    for (const Feature* feature : graph.Features()) {
      if (feature->level == 0) raw.insert(feature->type->name);
    }
    hierarchy = MakeHierarchy(
        options.hierarchy.empty() ? DefaultHierarchy(raw) : options.hierarchy,
        registry, {raw.begin(), raw.end()}, options.detector_parameters);
  }
  SolverSession session(&graph, registry, options.session);
  outcome.initial_cost = session.Cost();
  EmOrchestrator em(&graph, &session, registry, std::move(hierarchy),
                    options.em);
  em.SetTrace([&](const EmPhase& phase) { outcome.trace.push_back(phase); });
  outcome.em = em.Run(InterruptRequested);
  outcome.final_cost = session.Cost();
  outcome.title = std::filesystem::path(input->name()).filename().string();
  WriteOutputs(graph, outcome, &summary, begin);
  return kExitSuccess;
}

int Run() {
  const double begin = Now();
  Registry& registry = Registry::Global();
  RegisterBuiltins(&registry);
  LoadPlugins(&registry);
  if (FLAGS_list_plugins) {
    ListPlugins(registry);
    return kExitSuccess;
  }
  if (FLAGS_input.empty() || FLAGS_output_dir.empty()) {
    std::fprintf(stderr,
                 "plumbline_solve: --input and --output_dir are needed; see "
                 "--help\n");
    return kExitUsage;
  }
  InputStream input(FLAGS_input);
  const std::string_view prefix = input.Peek(1 << 16);
  const bool is_graph = LooksLikeG2o(prefix) && !LooksLikeCarmenLog(prefix);
  std::error_code error;
  std::filesystem::create_directories(FLAGS_output_dir, error);
  if (error || !std::filesystem::is_directory(FLAGS_output_dir)) {
    throw Error(FLAGS_output_dir, 0,
                "cannot make the output folder" +
                    (error ? " (" + error.message() + ")" : std::string()),
                "a folder that can be written to");
  }
  // Said before the work, not after it.
  if (access(FLAGS_output_dir.c_str(), W_OK | X_OK) != 0) {
    throw Error(FLAGS_output_dir, 0,
                std::string("cannot write to the output folder (") +
                    std::strerror(errno) + ")",
                "a folder that can be written to");
  }
  return is_graph ? SolveGraph(&input, registry, begin)
                  : SolveLog(&input, registry, begin);
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
  plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain(plumbline::Run);
}
