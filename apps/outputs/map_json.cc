#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/outputs/map_json.h>

#include <sstream>
#include <vector>

namespace plumbline {
namespace {

// Numbers of rooms and doors in the files begin with 1.
std::string Id(int index) {
  return index < 0 ? "null" : std::to_string(index + 1);
}

std::string Ids(const std::vector<int>& indices) {
  std::string text = "[";
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (i > 0) text += ", ";
    text += Id(indices[i]);
  }
  return text + "]";
}

std::string Position(const Eigen::Vector2d& point) {
  std::string text = "[";
  AppendFixed(point[0], 4, &text);
  text += ", ";
  AppendFixed(point[1], 4, &text);
  return text + "]";
}

std::string RingText(const Ring& ring) {
  std::string text = "[";
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (i > 0) text += ", ";
    text += Position(ring[i]);
  }
  return text + "]";
}

void AppendRoom(const BuildingPlan& plan, int index, std::string* text) {
  const PlanRoom& room = plan.rooms[static_cast<std::size_t>(index)];
  *text += "{\"id\": " + Id(index) + ", \"kind\": \"" +
           RoomKindName(room.kind) + "\", \"area_m2\": ";
  AppendFixed(room.area, 3, text);
  *text += ", \"entered\": ";
  *text += room.is_entered ? "true" : "false";
  *text += ", \"outline\": " + RingText(room.outline.shell) + ", \"holes\": [";
  for (std::size_t i = 0; i < room.outline.holes.size(); ++i) {
    if (i > 0) *text += ", ";
    *text += RingText(room.outline.holes[i]);
  }
  std::vector<int> doors;
  for (std::size_t i = 0; i < plan.doors.size(); ++i) {
    const PlanDoor& door = plan.doors[i];
    if (door.rooms[0] == index || door.rooms[1] == index) {
      doors.push_back(static_cast<int>(i));
    }
  }
  *text += "], \"neighbors\": " + Ids(room.neighbors) +
           ", \"doors\": " + Ids(doors) + "}";
}

void AppendDoor(const PlanDoor& door, int index, std::string* text) {
  *text += "{\"id\": " + Id(index) + ", \"begin\": " + Position(door.begin) +
           ", \"end\": " + Position(door.end) + ", \"width_m\": ";
  AppendFixed(door.width(), 3, text);
  *text += ", \"thickness_m\": ";
  AppendFixed(door.thickness, 3, text);
  *text += ", \"rooms\": [" + Id(door.rooms[0]) + ", " + Id(door.rooms[1]) +
           "], \"driven\": ";
  *text += door.is_driven ? "true}" : "false}";
}

void AppendPlan(const BuildingPlan& plan, std::string* text) {
  *text += ",\n\"rooms\": [";
  for (std::size_t i = 0; i < plan.rooms.size(); ++i) {
    *text += i > 0 ? ",\n" : "\n";
    AppendRoom(plan, static_cast<int>(i), text);
  }
  *text += "\n],\n\"doors\": [";
  for (std::size_t i = 0; i < plan.doors.size(); ++i) {
    *text += i > 0 ? ",\n" : "\n";
    AppendDoor(plan.doors[i], static_cast<int>(i), text);
  }
  *text += "\n]";
}

}  // namespace

void WriteMapJson(const Graph& graph, const FeatureCovariances* covariances,
                  const BuildingPlan* plan, const KeyScanArchive* key_scans,
                  std::ostream& output) {
  if (plan == nullptr && key_scans == nullptr) {
    WriteGraphJson(graph, output, covariances);
    return;
  }
  std::ostringstream of_graph;
  WriteGraphJson(graph, of_graph, covariances);
  std::string text = of_graph.str();
  // All goes into the same object.
  const std::string end = "\n}\n";
  if (text.size() < end.size() ||
      text.compare(text.size() - end.size(), end.size(), end) != 0) {
    throw PLUMBLINE_ERROR("the graph's JSON does not end as an object",
                          "a brace on a line of its own");
  }
  text.resize(text.size() - end.size());
  if (plan != nullptr) AppendPlan(*plan, &text);
  if (key_scans != nullptr) {
    text += ",\n";
    AppendKeyScans(*key_scans, &text);
  }
  text += end;
  output.write(text.data(), static_cast<std::streamsize>(text.size()));
}

void WriteMapJson(const Graph& graph, const FeatureCovariances* covariances,
                  const BuildingPlan* plan, const KeyScanArchive* key_scans,
                  const std::string& path) {
  WriteFileAtomically(path, [&](std::ostream& output) {
    WriteMapJson(graph, covariances, plan, key_scans, output);
  });
}

}  // namespace plumbline
