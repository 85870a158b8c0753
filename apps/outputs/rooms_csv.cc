#include <plumbline/core/atomic_file.h>
#include <plumbline/core/number_text.h>
#include <plumbline/outputs/rooms_csv.h>

#include <algorithm>

namespace plumbline {

void WriteRoomsCsv(const BuildingPlan& plan, std::ostream& output) {
  output << "room,kind,area_m2,x_m,y_m,entered,doors,neighbors\n";
  for (std::size_t i = 0; i < plan.rooms.size(); ++i) {
    const PlanRoom& room = plan.rooms[i];
    const auto index = static_cast<int>(i);
    const auto doors = std::count_if(
        plan.doors.begin(), plan.doors.end(), [&](const PlanDoor& door) {
          return door.rooms[0] == index || door.rooms[1] == index;
        });
    std::string line = std::to_string(i + 1) + "," + RoomKindName(room.kind);
    const Eigen::Vector2d middle = InnerPoint(room.outline);
    for (const double value : {room.area, middle[0], middle[1]}) {
      line += ',';
      AppendFixed(value, 2, &line);
    }
    line += room.is_entered ? ",1," : ",0,";
    line += std::to_string(doors) + ",";
    for (std::size_t k = 0; k < room.neighbors.size(); ++k) {
      if (k > 0) line += ' ';
      line += std::to_string(room.neighbors[k] + 1);
    }
    output << line << '\n';
  }
}

void WriteRoomsCsv(const BuildingPlan& plan, const std::string& path) {
  WriteFileAtomically(
      path, [&plan](std::ostream& output) { WriteRoomsCsv(plan, output); });
}

}  // namespace plumbline
