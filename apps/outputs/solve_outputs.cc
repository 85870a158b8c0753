#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/sha256.h>
#include <plumbline/frontend/tum.h>
#include <plumbline/outputs/em_trace.h>
#include <plumbline/outputs/floor_plan.h>
#include <plumbline/outputs/floor_plan_dxf.h>
#include <plumbline/outputs/floor_plan_geojson.h>
#include <plumbline/outputs/floor_plan_svg.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/map_json.h>
#include <plumbline/outputs/map_picture.h>
#include <plumbline/outputs/marginals_output.h>
#include <plumbline/outputs/report.h>
#include <plumbline/outputs/rooms_csv.h>
#include <plumbline/outputs/solve_outputs.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

namespace plumbline {
namespace {

using std::filesystem::path;

// Of a grid on which rooms are found, m.
constexpr double kPlanResolution = 0.05;
constexpr double kCoarsestPlanResolution = 0.1;
// Scans whose rays the grid of a run that was interrupted has, and its finest
// cells, m: whoever pressed Ctrl-C is waiting, and half of the time that
// writing takes goes by the number of cells. A fifth is that of pictures: this
// is the longer side of map.png then, px.
constexpr std::size_t kMostScansOfAPart = 4000;
constexpr double kFinestResolutionOfAPart = kCoarsestPlanResolution;
constexpr int kLongSideOfAPart = 1200;

std::vector<Pose2> Poses(const SolveOutcome& outcome) {
  std::vector<Pose2> poses;
  poses.reserve(outcome.trajectory.size());
  for (const TimedPose& timed : outcome.trajectory) poses.push_back(timed.pose);
  return poses;
}

// The robot's way. It breaks off where another log begins.
std::vector<Pose2> Way(const SolveOutcome& outcome) {
  std::set<std::size_t> begins;
  for (const LogPart& log : outcome.logs) begins.insert(log.begin);
  std::vector<Pose2> way;
  way.reserve(outcome.trajectory.size() + begins.size());
  for (std::size_t i = 0; i < outcome.trajectory.size(); ++i) {
    if (i > 0 && begins.count(i) > 0)
      way.push_back(Pose2::Constant(std::nan("")));
    way.push_back(outcome.trajectory[i].pose);
  }
  return way;
}

OccupancyOptions GridOptions(const SolveOutcome& outcome) {
  OccupancyOptions options = outcome.occupancy;
  if (outcome.summary.partial) {
    options.max_scans = kMostScansOfAPart;
    options.resolution = std::max(options.resolution, kFinestResolutionOfAPart);
  }
  return options;
}

}  // namespace

// Writers run side by side.
class SharedParts {
 public:
  // What several threads do of the grid; the rest waits for who needs it.
  void BeginGrid(const SolveOutcome& outcome) {
    std::call_once(grid_begun_, [&] {
      try {
        grid_ = GatherOccupancyGrid(*outcome.scans, Poses(outcome),
                                    GridOptions(outcome));
      } catch (const Error& error) {
        no_grid_ = error.what();
      }
    });
  }

  // The grid; null, and why, when it cannot be made.
  const OccupancyGrid* Grid(const SolveOutcome& outcome, std::string* reason) {
    BeginGrid(outcome);
    std::call_once(grid_once_, [&] {
      if (grid_) grid_->ForgetUnreachable();
    });
    *reason = no_grid_;
    return grid_ ? &*grid_ : nullptr;
  }

  const FloorPlan& Plan(const SolveOutcome& outcome) {
    std::call_once(plan_once_, [&] {
      plan_ = MakeFloorPlan(*outcome.graph, Poses(outcome));
      plan_.title = outcome.title;
      if (outcome.scans == nullptr || outcome.trajectory.empty()) return;
      // A plan without rooms is better than none.
      try {
        FindRooms(outcome);
        are_rooms_found_ = no_rooms_.empty();
      } catch (const Error& error) {
        no_rooms_ = error.what();
      }
    });
    return plan_;
  }

  // Rooms and doors; null without scans, and when they could not be looked
  // for.
  const BuildingPlan* Building(const SolveOutcome& outcome) {
    const FloorPlan& plan = Plan(outcome);
    return are_rooms_found_ ? &plan.building : nullptr;
  }

  // The same, once all writers have run; null when none needed it.
  const BuildingPlan* BuildingIfMade() const {
    return are_rooms_found_ ? &plan_.building : nullptr;
  }

  // An interrupt kept something out of a file that is there.
  void TellCut() { is_cut_ = true; }
  bool is_cut() const { return is_cut_; }

  // Why the plan of a log has no rooms; empty when they were looked for.
  const std::string& no_rooms() const { return no_rooms_; }

 private:
  void FindRooms(const SolveOutcome& outcome) {
    // Too fine a grid has holes, too coarse a one no doors.
    OccupancyOptions options = GridOptions(outcome);
    if (options.resolution >= 0.5 * kPlanResolution &&
        options.resolution <= kCoarsestPlanResolution) {
      std::string reason;
      const OccupancyGrid* const grid = Grid(outcome, &reason);
      if (grid != nullptr) AddRooms(*grid, Way(outcome), &plan_);
      no_rooms_ = reason;
      return;
    }
    options.resolution = kPlanResolution;
    // Of a run that was interrupted the last scans have no pose.
    OccupancyGrid grid =
        GatherOccupancyGrid(*outcome.scans, Poses(outcome), options);
    grid.ForgetUnreachable();
    AddRooms(grid, Way(outcome), &plan_);
  }

  std::once_flag grid_begun_;
  std::once_flag grid_once_;
  std::optional<OccupancyGrid> grid_;
  std::string no_grid_;
  std::once_flag plan_once_;
  FloorPlan plan_;
  bool are_rooms_found_ = false;
  std::string no_rooms_;
  std::atomic<bool> is_cut_ = false;
};

namespace {

MapDrawing Drawing(const SolveOutcome& outcome) {
  MapDrawing drawing = DrawingFromGraph(*outcome.graph, Poses(outcome));
  drawing.title = outcome.title;
  for (const PlacedClosure& closure : outcome.closures) {
    if (closure.holds) drawing.closures.push_back(closure.place);
  }
  if (outcome.ellipse_sigmas > 0.0) {
    drawing.ellipses =
        EllipsesOf(*outcome.graph, outcome.covariances, outcome.ellipse_sigmas);
    char text[64];
    std::snprintf(text, sizeof(text), "%g standard deviations",
                  outcome.ellipse_sigmas);
    drawing.ellipses_title = text;
  }
  return drawing;
}

const FloorPlan& Plan(const SolveOutcome& outcome) {
  return outcome.parts->Plan(outcome);
}

Report MakeReport(const SolveOutcome& outcome) {
  Report report;
  report.graph = outcome.graph;
  if (outcome.without_structure) report.before = outcome.without_structure();
  report.path = Poses(outcome);
  for (const EmPhase& phase : outcome.trace)
    report.trace.push_back({phase, {}});
  report.summary = outcome.summary;
  if (report.before.interrupted) {
    // Also where the interrupt came only now.
    report.summary.partial = true;
    outcome.parts->TellCut();
  }
  report.flags = outcome.flags;
  report.delta_threshold = outcome.delta_threshold;
  report.title = outcome.title;
  report.breaks = outcome.breaks;
  report.closures = outcome.closures;
  if (outcome.scans != nullptr && !outcome.trajectory.empty()) {
    std::string reason;
    const OccupancyGrid* const grid = outcome.parts->Grid(outcome, &reason);
    if (grid != nullptr) {
      report.grid = MakeReportGrid(*grid, outcome.summary.partial
                                              ? kMostReportPixelsOfAPart
                                              : kMostReportPixels);
    }
  }
  // Last, as another thread may be making it.
  report.building = outcome.parts->Building(outcome);
  return report;
}

std::string WriteOccupancy(const SolveOutcome& outcome, const path& folder) {
  std::string reason;
  const OccupancyGrid* const grid = outcome.parts->Grid(outcome, &reason);
  if (grid == nullptr) return reason;
  WriteOccupancyMap(*grid, folder / "occupancy");
  return "";
}

std::string TrajectoryOfLog(std::size_t number) {
  return "trajectory_" + std::to_string(number) + ".tum";
}

std::vector<std::string> TrajectoriesOfLogs() {
  std::vector<std::string> names;
  for (std::size_t i = 1; i <= kMostLogs; ++i) {
    names.push_back(TrajectoryOfLog(i));
  }
  return names;
}

// Of all scans, and of each log where there are several.
void WriteTrajectories(const SolveOutcome& outcome, const path& folder) {
  const auto write = [&](const std::string& name, std::size_t begin,
                         std::size_t end) {
    const auto first = outcome.trajectory.begin();
    WriteFileAtomically(folder / name, [&](std::ostream& output) {
      WriteTum({first + static_cast<std::ptrdiff_t>(begin),
                first + static_cast<std::ptrdiff_t>(end)},
               output);
    });
  };
  write("trajectory.tum", 0, outcome.trajectory.size());
  for (const LogPart& log : outcome.logs) {
    write(TrajectoryOfLog(log.number), log.begin, log.end);
  }
}

// For writers that have no reason not to write.
template <typename Write>
auto Always(Write write) {
  return [write](const SolveOutcome& outcome, const path& folder) {
    write(outcome, folder);
    return std::string();
  };
}

// What a writer came to.
struct WriteResult {
  std::string reason;
  // Why it failed; empty when it did not.
  std::string failure;
  std::map<std::string, std::string> digests;
};

WriteResult RunWriter(const OutputWriterType& writer,
                      const SolveOutcome& outcome, const path& folder) {
  WriteResult result;
  try {
    result.reason = writer.write(outcome, folder);
  } catch (const Error& error) {
    result.failure = error.what();
    return result;
  }
  if (!result.reason.empty()) return result;
  std::vector<std::string> names = writer.further_files;
  names.push_back(writer.name);
  for (const std::string& name : names) {
    result.digests[name] = Sha256OfFile((folder / name).string());
    if (result.digests[name].empty()) {
      result.failure = Error((folder / name).string(), 0, "was not written",
                             "a file that its writer wrote")
                           .what();
    }
  }
  for (const std::string& name : writer.optional_files) {
    const std::string digest = Sha256OfFile((folder / name).string());
    if (!digest.empty()) result.digests[name] = digest;
  }
  return result;
}

// When the turn of a file comes: those with a part of the plan, which takes as
// long as all the rest, last, and of these first who has other things to do,
// too. 0 without such a part.
int TurnOf(const OutputWriterType& output) {
  static const std::vector<std::string> kOfThePlan = {
      "report.html",   "map.json",          "floorplan.svg",
      "floorplan.dxf", "floorplan.geojson", "rooms.csv"};
  const auto found =
      std::find(kOfThePlan.begin(), kOfThePlan.end(), output.name);
  return found == kOfThePlan.end()
             ? 0
             : static_cast<int>(found - kOfThePlan.begin()) + 1;
}

// Places in the list, in the order in which its files are begun.
std::vector<std::size_t> OrderOfWriting(
    const std::vector<const OutputWriterType*>& outputs) {
  std::vector<std::size_t> order(outputs.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) {
                     return TurnOf(*outputs[a]) < TurnOf(*outputs[b]);
                   });
  return order;
}

// Whether files show the grid.
bool HasGrid(const std::vector<const OutputWriterType*>& outputs) {
  return std::any_of(
      outputs.begin(), outputs.end(), [](const OutputWriterType* output) {
        return output->name == "report.html" || output->name == "occupancy.pgm";
      });
}

// Makes the plan that others will ask for.
void BeginPlan(const SolveOutcome& outcome) {
  try {
    outcome.parts->Plan(outcome);
  } catch (const Error&) {
    // Each of them meets it again, and says so.
  }
}

}  // namespace

SolveOutcome::SolveOutcome() : parts(std::make_shared<SharedParts>()) {}

const BuildingPlan* SolveOutcome::BuildingIfMade() const {
  return parts->BuildingIfMade();
}

void RegisterBuiltinOutputWriters(Registry* registry) {
  const auto add = [&](const char* name, const char* description,
                       bool by_default, bool of_scans, auto write,
                       const std::vector<std::string>& further_files = {},
                       const std::vector<std::string>& optional_files = {}) {
    if (registry->Find<OutputWriterType>(name) != nullptr) return;
    OutputWriterType type;
    type.name = name;
    type.further_files = further_files;
    type.optional_files = optional_files;
    type.description = description;
    type.by_default = by_default;
    type.of_scans = of_scans;
    type.write = [write](const SolvedRun& run, const path& folder) {
      return write(dynamic_cast<const SolveOutcome&>(run), folder);
    };
    registry->Register(std::move(type));
  };
  add("map.png", "the map as a picture", true, false,
      Always([](const SolveOutcome& outcome, const path& folder) {
        MapDrawingOptions options;
        if (outcome.summary.partial) options.long_side = kLongSideOfAPart;
        WriteMapPng(Drawing(outcome), folder / "map.png", options);
      }));
  add("report.html", "all of it as one page for a browser", true, false,
      Always([](const SolveOutcome& outcome, const path& folder) {
        WriteReport(MakeReport(outcome), folder / "report.html");
      }));
  add("map.svg", "the map as a picture that can be zoomed", true, false,
      Always([](const SolveOutcome& outcome, const path& folder) {
        WriteMapSvg(Drawing(outcome), folder / "map.svg");
      }));
  add("map.json", "every feature and constraint, rooms and doors, key scans",
      true, false, Always([](const SolveOutcome& outcome, const path& folder) {
        KeyScanArchive key_scans;
        if (outcome.key_scans) key_scans = outcome.key_scans();
        WriteMapJson(*outcome.graph, &outcome.covariances,
                     outcome.parts->Building(outcome),
                     key_scans.scans.empty() ? nullptr : &key_scans,
                     folder / "map.json");
      }));
  add("graph.g2o", "the same as g2o text", true, false,
      Always([](const SolveOutcome& outcome, const path& folder) {
        WriteFileAtomically(folder / "graph.g2o", [&](std::ostream& output) {
          WriteG2o(*outcome.graph, outcome.g2o, output);
        });
      }));
  add("em_trace.csv", "one row per phase of expectation maximization", true,
      false, Always([](const SolveOutcome& outcome, const path& folder) {
        std::vector<EmTraceRow> rows;
        for (const EmPhase& phase : outcome.trace) rows.push_back({phase, {}});
        WriteEmTrace(rows, folder / "em_trace.csv");
      }));
  add("trajectory.tum", "the pose of every scan", true, true,
      Always(WriteTrajectories), {}, TrajectoriesOfLogs());
  add("floorplan.dxf", "walls as CAD lines, layers by direction", true, false,
      Always([](const SolveOutcome& outcome, const path& folder) {
        WriteFloorPlanDxf(Plan(outcome), folder / "floorplan.dxf");
      }));
  add("floorplan.svg", "the plan on paper, to scale", true, false,
      Always([](const SolveOutcome& outcome, const path& folder) {
        WriteFloorPlanSvg(Plan(outcome), folder / "floorplan.svg");
      }));
  add("floorplan.geojson",
      "rooms, doors and walls as GeoJSON in metres of the map", true, false,
      Always([](const SolveOutcome& outcome, const path& folder) {
        WriteFloorPlanGeoJson(Plan(outcome), folder / "floorplan.geojson");
      }));
  add("rooms.csv", "number, kind, area and neighbors of every room", true, true,
      [](const SolveOutcome& outcome, const path& folder) {
        const BuildingPlan& building = Plan(outcome).building;
        if (!outcome.parts->no_rooms().empty()) {
          return outcome.parts->no_rooms();
        }
        WriteRoomsCsv(building, folder / "rooms.csv");
        return std::string();
      });
  add("occupancy.pgm", "a grid for ROS map_server and Nav2, and its .yaml",
      true, true, WriteOccupancy, {"occupancy.yaml"});
}

std::set<std::string> SelectOutputs(const std::string& list,
                                    const Registry& registry) {
  const auto outputs = registry.All<OutputWriterType>();
  std::set<std::string> all;
  std::set<std::string> by_default;
  for (const OutputWriterType* output : outputs) {
    all.insert(output->name);
    if (output->by_default) by_default.insert(output->name);
  }
  std::set<std::string> selected;
  if (!list.empty() && list[0] == '-') selected = by_default;
  std::istringstream words(list);
  std::string word;
  while (std::getline(words, word, ',')) {
    if (word.empty() || word == "none") continue;
    if (word == "all") {
      selected = all;
    } else if (word == "default") {
      selected.insert(by_default.begin(), by_default.end());
    } else if (all.count(word) > 0) {
      selected.insert(word);
    } else if (word[0] == '-' && all.count(word.substr(1)) > 0) {
      selected.erase(word.substr(1));
    } else {
      std::string names = "all, default, none";
      for (const OutputWriterType* output : outputs) {
        names += ", " + output->name;
      }
      throw Error("--outputs", 0, "unknown file '" + word + "'",
                  "names separated by commas, a minus in front of those to "
                  "leave out: " +
                      names);
    }
  }
  return selected;
}

std::set<std::string> FilesOfOutputs(const std::set<std::string>& names,
                                     const Registry& registry) {
  std::set<std::string> files;
  for (const std::string& name : names) {
    const auto& writer = registry.Get<OutputWriterType>(name);
    files.insert(writer.name);
    files.insert(writer.further_files.begin(), writer.further_files.end());
    files.insert(writer.optional_files.begin(), writer.optional_files.end());
  }
  return files;
}

WrittenOutputs WriteSolveOutputs(
    const SolveOutcome& outcome, const std::set<std::string>& names,
    const path& folder, int threads,
    const std::function<void(int, int)>& progress) {
  std::vector<const OutputWriterType*> selected;
  for (const OutputWriterType* output :
       outcome.registry->All<OutputWriterType>()) {
    if (names.count(output->name) == 0) continue;
    if (output->of_scans && outcome.trajectory.empty()) continue;
    selected.push_back(output);
  }
  const std::vector<std::size_t> order = OrderOfWriting(selected);
  const bool has_plan = std::any_of(
      selected.begin(), selected.end(),
      [](const OutputWriterType* output) { return TurnOf(*output) > 0; });
  // On all threads, before each of them has a file to write.
  if (HasGrid(selected) && outcome.scans != nullptr &&
      !outcome.trajectory.empty()) {
    outcome.parts->BeginGrid(outcome);
  }
  std::vector<WriteResult> results(selected.size());
  std::mutex mutex;
  int done = 0;
  ParallelFor(order.size() + 1, threads, [&](std::size_t job) {
    if (job == 0) {
      // It takes longest: who is done with the rest helps.
      const ThreadsScope scope(threads);
      if (has_plan) BeginPlan(outcome);
      return;
    }
    const std::size_t i = order[job - 1];
    results[i] = RunWriter(*selected[i], outcome, folder);
    const std::lock_guard<std::mutex> lock(mutex);
    ++done;
    if (progress) progress(done, static_cast<int>(selected.size()));
  });
  WrittenOutputs written;
  std::string failure, others;
  for (std::size_t i = 0; i < selected.size(); ++i) {
    if (!results[i].failure.empty()) {
      if (failure.empty()) {
        failure = results[i].failure;
      } else {
        others += (others.empty() ? "" : ", ") + selected[i]->name;
      }
    } else if (!results[i].reason.empty()) {
      written.reasons.push_back(selected[i]->name +
                                " not written: " + results[i].reason);
    }
    for (const auto& [name, digest] : results[i].digests) {
      written.files.push_back(name);
      written.digests[name] = digest;
    }
  }
  if (!failure.empty()) {
    if (!others.empty()) failure += "; so with " + others;
    throw Error("no file is replaced", 0, failure, "");
  }
  std::sort(written.files.begin(), written.files.end());
  written.is_cut = outcome.parts->is_cut();
  return written;
}

}  // namespace plumbline
