#include <plumbline/outputs/closing_lines.h>
#include <plumbline/outputs/map_drawing.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <set>

namespace plumbline {
namespace {

// A wall that long should have a direction of the building, m.
constexpr double kLongWall = 5.0;
// A way outside of all rooms is told from this on, m.
constexpr double kLongOutside = 5.0;
// So many rooms are named.
constexpr int kMostNamed = 5;

std::string Counted(std::int64_t count, const char* noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

void Append(const std::string& part, std::string* list) {
  *list += (list->empty() ? "" : ", ") + part;
}

// Walls of the graph, directions that they share, and those long walls whose
// tie to a direction was broken while none holds.
struct Walls {
  std::int64_t walls = 0;
  std::int64_t directions = 0;
  std::int64_t refuted = 0;
  double longest_refuted = 0.0;
};

bool IsRefuted(const Graph& graph, const Feature& wall) {
  bool is_broken = false;
  for (const ConstraintId id : graph.ConstraintsOf(wall.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (constraint.kind != ConstraintClass::kStructure ||
        !constraint.type->Is(RelationRole::kDirection)) {
      continue;
    }
    if (constraint.state == ConstraintState::kLive) return false;
    is_broken = true;
  }
  return is_broken;
}

Walls CountWalls(const Graph& graph) {
  Walls count;
  for (const Feature* feature : graph.Features()) {
    if (feature->type->Is(FeatureRole::kDirection)) ++count.directions;
    DrawnWall ends;
    if (!WallEnds(*feature, &ends)) continue;
    ++count.walls;
    const double length = std::hypot(ends.x2 - ends.x1, ends.y2 - ends.y1);
    if (length < kLongWall || !IsRefuted(graph, *feature)) continue;
    ++count.refuted;
    count.longest_refuted = std::max(count.longest_refuted, length);
  }
  return count;
}

// "2 rooms without a door (4, 7)", numbered as in rooms.csv; empty when there
// is none.
std::string RoomsWithoutDoor(const BuildingPlan& plan) {
  std::string named;
  int count = 0;
  for (std::size_t i = 0; i < plan.rooms.size(); ++i) {
    const auto index = static_cast<int>(i);
    const bool has_door = std::any_of(
        plan.doors.begin(), plan.doors.end(), [index](const PlanDoor& door) {
          return door.rooms[0] == index || door.rooms[1] == index;
        });
    if (has_door) continue;
    if (++count <= kMostNamed) Append(std::to_string(i + 1), &named);
  }
  if (count == 0) return "";
  return Counted(count, "room") + " without a door (" + named +
         (count > kMostNamed ? ", ...)" : ")");
}

void AppendLoose(const SolveOutcome& outcome, const char* what,
                 std::string* list) {
  const auto loose =
      static_cast<std::int64_t>(outcome.summary.tracking.loose.size());
  if (loose == 0) return;
  Append(std::string(what) + " hangs by a thread in " + Counted(loose, "place"),
         list);
}

void AppendUncertain(const Summary& summary, std::string* list) {
  const auto uncertain = static_cast<std::int64_t>(
      std::count_if(summary.logs.begin(), summary.logs.end(),
                    [](const auto& log) { return !log.uncertain.empty(); }));
  if (uncertain > 0) {
    Append(Counted(uncertain, "log") + " may be of another building", list);
  }
  std::int64_t apart = 0;
  std::set<std::string> folders;
  for (const Summary::LogInput& log : summary.logs) {
    if (log.why_apart.empty()) continue;
    ++apart;
    folders.insert(log.map);
  }
  if (apart > 0) {
    std::string names;
    for (const std::string& folder : folders) Append(folder, &names);
    Append(Counted(apart, "log") + " kept apart (" + names + ")", list);
  }
  const auto candidates = static_cast<std::int64_t>(
      std::count_if(summary.logs.begin(), summary.logs.end(),
                    [](const auto& log) { return log.candidate.has_value(); }));
  if (candidates > 0) {
    Append(Counted(candidates, "log") +
               " kept apart may be of the first one's building",
           list);
  }
}

std::string WorthALook(const SolveOutcome& outcome, const Walls& walls) {
  const Summary& summary = outcome.summary;
  std::string list;
  if (summary.partial) {
    Append("the run was interrupted", &list);
  } else if (summary.IsUnsolved()) {
    const std::string& hint = summary.solver->hint;
    Append("the solver did not converge" +
               (hint.empty() ? hint : " (" + hint + ")"),
           &list);
  } else if (summary.em_termination != EmTermination::kConvergence) {
    Append("the search for structure did not converge", &list);
  }
  AppendUncertain(summary, &list);
  if (summary.open_way > 0.0) {
    char text[64];
    std::snprintf(text, sizeof text, "lengths of corridors (%.0f m are open)",
                  summary.open_way);
    Append(text, &list);
  }
  AppendLoose(outcome, "the map", &list);
  if (!summary.mirrors.empty()) {
    Append(
        Counted(static_cast<std::int64_t>(summary.mirrors.size()), "mirror") +
            " (reflections are left out)",
        &list);
  }
  if (walls.refuted > 0) {
    char text[64];
    std::snprintf(text, sizeof text, " off every direction (up to %.1f m)",
                  walls.longest_refuted);
    Append(Counted(walls.refuted, "long wall") + text, &list);
  }
  const BuildingPlan* const plan = outcome.BuildingIfMade();
  const std::string rooms = plan == nullptr ? "" : RoomsWithoutDoor(*plan);
  if (!rooms.empty()) Append(rooms, &list);
  if (summary.plan && summary.plan->rooms > 0 &&
      summary.plan->way_outside >= kLongOutside) {
    char text[64];
    std::snprintf(text, sizeof text, "%.0f m of the way lie in no room",
                  summary.plan->way_outside);
    Append(text, &list);
  }
  return list;
}

// Which file shows it.
void AppendOpen(const SolveOutcome& outcome, const std::string& folder,
                std::vector<std::string>* lines) {
  const std::vector<std::string>& files = outcome.summary.files;
  for (const char* name : {"report.html", "map.svg", "map.png"}) {
    if (std::count(files.begin(), files.end(), name) == 0) continue;
    lines->push_back("open " + (std::filesystem::path(folder) / name).string());
    break;
  }
}

}  // namespace

std::vector<std::string> ClosingLines(const SolveOutcome& outcome,
                                      const std::string& folder) {
  const Walls walls = CountWalls(*outcome.graph);
  std::string line = folder + ": " + Counted(walls.walls, "wall") + ", " +
                     Counted(walls.directions, "shared direction");
  const BuildingPlan* const plan = outcome.BuildingIfMade();
  if (plan != nullptr) {
    line +=
        ", " + Counted(static_cast<std::int64_t>(plan->rooms.size()), "room") +
        ", " + Counted(static_cast<std::int64_t>(plan->doors.size()), "door");
  }
  const Summary::Closures& closures = outcome.summary.closures;
  if (closures.proposed > 0) {
    line += ", " + Counted(closures.live, "closure");
    // They are not among those that hold.
    if (closures.broken > 0) {
      line += ", " + std::to_string(closures.broken) + " more broken";
    }
  }
  std::vector<std::string> lines = {line};
  const std::string worth = WorthALook(outcome, walls);
  if (!worth.empty()) lines.push_back("worth a look: " + worth);
  AppendOpen(outcome, folder, &lines);
  return lines;
}

std::vector<std::string> ClosingLinesInMap(const SolveOutcome& outcome,
                                           const std::string& folder,
                                           const std::string& map) {
  std::string agreeing;
  for (const Summary::LogInput& log : outcome.summary.logs) {
    Append(std::to_string(log.agreeing) + " of " + Counted(log.parts, "part"),
           &agreeing);
  }
  std::vector<std::string> lines = {
      folder + ": " +
      Counted(static_cast<std::int64_t>(outcome.trajectory.size()), "pose") +
      " in " + map + " (" + agreeing + " agree with it)"};
  std::string worth;
  if (outcome.summary.partial) Append("the run was interrupted", &worth);
  AppendUncertain(outcome.summary, &worth);
  AppendLoose(outcome, "the track", &worth);
  if (!worth.empty()) lines.push_back("worth a look: " + worth);
  AppendOpen(outcome, folder, &lines);
  return lines;
}

}  // namespace plumbline
