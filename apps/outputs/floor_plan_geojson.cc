#include <plumbline/core/atomic_file.h>
#include <plumbline/core/number_text.h>
#include <plumbline/outputs/floor_plan_geojson.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace plumbline {
namespace {

using Eigen::Vector2d;

std::string Position(const Vector2d& point) {
  std::string text = "[";
  AppendFixed(point[0], 4, &text);
  text += ", ";
  AppendFixed(point[1], 4, &text);
  return text + "]";
}

std::string Feature(const std::string& properties, const std::string& type,
                    const std::string& coordinates) {
  return "{\"type\": \"Feature\", \"properties\": {" + properties +
         "}, \"geometry\": {\"type\": \"" + type +
         "\", \"coordinates\": " + coordinates + "}}";
}

std::string RingText(const Ring& ring) {
  std::string text = "[";
  for (std::size_t i = 0; i <= ring.size(); ++i) {
    if (i > 0) text += ", ";
    text += Position(ring[i % ring.size()]);
  }
  return text + "]";
}

std::string PolygonText(const Polygon& polygon) {
  std::string text = "[" + RingText(polygon.shell);
  for (const Ring& hole : polygon.holes) text += ", " + RingText(hole);
  return text + "]";
}

// Numbers of rooms and doors in the files begin with 1.
std::string NumberOf(int index) {
  return index < 0 ? "null" : std::to_string(index + 1);
}

std::string RoomFeature(const PlanRoom& room, int index) {
  std::string properties = "\"kind\": \"" +
                           std::string(RoomKindName(room.kind)) +
                           "\", \"id\": " + NumberOf(index) + ", \"area_m2\": ";
  AppendFixed(room.area, 3, &properties);
  properties += ", \"entered\": ";
  properties += room.is_entered ? "true" : "false";
  properties += ", \"neighbors\": [";
  for (std::size_t i = 0; i < room.neighbors.size(); ++i) {
    if (i > 0) properties += ", ";
    properties += NumberOf(room.neighbors[i]);
  }
  return Feature(properties + "]", "Polygon", PolygonText(room.outline));
}

std::string DoorFeature(const PlanDoor& door, int index) {
  std::string properties =
      "\"kind\": \"door\", \"id\": " + NumberOf(index) + ", \"width_m\": ";
  AppendFixed(door.width(), 3, &properties);
  properties += ", \"rooms\": [" + NumberOf(door.rooms[0]) + ", " +
                NumberOf(door.rooms[1]) + "], \"driven\": ";
  properties += door.is_driven ? "true" : "false";
  return Feature(properties, "LineString",
                 "[" + Position(door.begin) + ", " + Position(door.end) + "]");
}

std::string BodyFeature(const PlanWall& wall) {
  std::string properties = "\"kind\": \"wall\", \"length_m\": ";
  AppendFixed((wall.end - wall.begin).norm(), 3, &properties);
  properties += ", \"thickness_m\": ";
  AppendFixed(wall.left + wall.right, 3, &properties);
  Polygon body;
  body.shell = BodyOf(wall);
  return Feature(properties, "Polygon", PolygonText(body));
}

std::string WallFeature(const FloorPlan& plan, const FloorPlanWall& wall) {
  std::string properties = "\"kind\": \"face\", \"layer\": \"" +
                           FloorPlanLayerName(plan, wall.direction) + "\"";
  const Vector2d along = wall.end - wall.begin;
  properties += ", \"direction_deg\": ";
  double degrees = RadToDeg(NormalizeAxial(std::atan2(along[1], along[0])));
  if (degrees < 0.0) degrees += 180.0;
  AppendFixed(degrees, 3, &properties);
  properties += ", \"length_m\": ";
  AppendFixed(along.norm(), 4, &properties);
  properties += ", \"features\": [";
  for (std::size_t i = 0; i < wall.features.size(); ++i) {
    if (i > 0) properties += ", ";
    AppendNumber(wall.features[i], &properties);
  }
  properties += "]";
  return Feature(properties, "LineString",
                 "[" + Position(wall.begin) + ", " + Position(wall.end) + "]");
}

std::string SolidFeature(const std::array<Vector2d, 4>& solid) {
  // The outer ring runs against the clock and ends where it began.
  std::array<Vector2d, 4> ring = solid;
  double doubled_area = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector2d& a = ring[i];
    const Vector2d& b = ring[(i + 1) % 4];
    doubled_area += a[0] * b[1] - a[1] * b[0];
  }
  if (doubled_area < 0.0) std::swap(ring[1], ring[3]);
  std::string positions = "[[";
  for (std::size_t i = 0; i <= 4; ++i) {
    if (i > 0) positions += ", ";
    positions += Position(ring[i % 4]);
  }
  return Feature("\"kind\": \"solid\", \"layer\": \"WALL-SOLID\"", "Polygon",
                 positions + "]]");
}

std::string CircleFeature(const DrawnCircle& circle) {
  std::string properties =
      "\"kind\": \"column\", \"layer\": \"COLUMNS\", \"radius_m\": ";
  AppendFixed(circle.radius, 4, &properties);
  return Feature(properties, "Point", Position({circle.x, circle.y}));
}

}  // namespace

void WriteFloorPlanGeoJson(const FloorPlan& plan, std::ostream& output) {
  output << "{\"type\": \"FeatureCollection\",\n"
         << "\"name\": "
         << nlohmann::json(plan.title)
                .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)
         << ",\n\"coordinate_reference\": {\"type\": \"local\", \"unit\": "
            "\"metre\", \"axes\": [\"x\", \"y\"], \"description\": "
            "\"Coordinates are metres in the frame of the robot's map, not "
            "degrees of longitude and latitude\"},\n\"features\": [\n";
  const char* separator = "";
  const auto write = [&](const std::string& feature) {
    output << separator << feature;
    separator = ",\n";
  };
  const BuildingPlan& building = plan.building;
  for (std::size_t i = 0; i < building.rooms.size(); ++i) {
    write(RoomFeature(building.rooms[i], static_cast<int>(i)));
  }
  for (std::size_t i = 0; i < building.doors.size(); ++i) {
    write(DoorFeature(building.doors[i], static_cast<int>(i)));
  }
  for (const PlanWall& wall : building.walls) write(BodyFeature(wall));
  for (const FloorPlanWall& wall : plan.walls) write(WallFeature(plan, wall));
  for (const auto& solid : plan.solids) write(SolidFeature(solid));
  for (const DrawnCircle& circle : plan.circles) write(CircleFeature(circle));
  output << "\n]}\n";
}

void WriteFloorPlanGeoJson(const FloorPlan& plan, const std::string& path) {
  WriteFileAtomically(path, [&plan](std::ostream& output) {
    WriteFloorPlanGeoJson(plan, output);
  });
}

}  // namespace plumbline
