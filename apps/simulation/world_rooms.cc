#include <plumbline/apps/simulation/world_rooms.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Smaller spaces are gaps between walls, m^2.
constexpr double kLeastRoom = 0.5;
constexpr double kChordDeg = 5.0;
constexpr double kIntoWall = 0.02;  // m

// A straight body by its centre line.
struct Body {
  Vector2d begin, end;
  double thickness;

  Vector2d Along() const { return (end - begin).normalized(); }
  Vector2d Left() const {
    const Vector2d along = Along();
    return {-along[1], along[0]};
  }
  bool Contains(const Vector2d& point) const {
    const double t = Along().dot(point - begin);
    return t >= 0.0 && t <= (end - begin).norm() &&
           std::abs(Left().dot(point - begin)) <= 0.5 * thickness;
  }
  void AppendSides(std::vector<StraightPiece>* pieces) const {
    if (thickness <= 0.0) {
      pieces->emplace_back(begin, end);
      return;
    }
    const Vector2d half = 0.5 * thickness * Left();
    pieces->emplace_back(begin - half, end - half);
    pieces->emplace_back(end - half, end + half);
    pieces->emplace_back(end + half, begin + half);
    pieces->emplace_back(begin + half, begin - half);
  }
};

bool LeadsInto(const Body& door, const Polygon& room) {
  const Vector2d beside = (0.5 * door.thickness + 0.02) * door.Left();
  const Vector2d middle = 0.5 * (door.begin + door.end);
  return room.Contains(middle + beside) || room.Contains(middle - beside);
}

}  // namespace

std::vector<Polygon> WorldRooms(const World& world) {
  std::vector<Body> bodies;
  for (const WorldWall& wall : world.walls) {
    bodies.push_back({wall.begin, wall.end, wall.thickness});
  }
  for (const WorldDoor& door : world.doors) {
    // Into the walls beside it, so that rounding leaves no gap.
    const Vector2d more = kIntoWall * (door.end - door.begin).normalized();
    bodies.push_back({door.begin - more, door.end + more, door.thickness});
  }
  std::vector<StraightPiece> pieces;
  for (const Body& body : bodies) body.AppendSides(&pieces);
  for (const WorldCircle& circle : world.circles) {
    if (circle.sweep_deg >= 360.0) continue;
    const int chords =
        std::max(1, static_cast<int>(std::ceil(circle.sweep_deg / kChordDeg)));
    const auto at = [&](int i) -> Vector2d {
      const double angle =
          DegToRad(circle.begin_deg + circle.sweep_deg * i / chords);
      return circle.center +
             circle.radius * Vector2d(std::cos(angle), std::sin(angle));
    };
    for (int i = 0; i < chords; ++i) pieces.emplace_back(at(i), at(i + 1));
  }
  std::vector<Polygon> rooms;
  for (const Polygon& face : FacesOf(pieces)) {
    if (face.Area() < kLeastRoom) continue;
    // Each face lies within a body as a whole or not at all.
    const Vector2d inner = InnerPoint(face);
    if (std::any_of(bodies.begin(), bodies.end(),
                    [&](const Body& body) { return body.Contains(inner); })) {
      continue;
    }
    const bool is_visited =
        std::any_of(world.path.begin(), world.path.end(),
                    [&](const Vector2d& p) { return face.Contains(p); });
    const bool has_door = std::any_of(
        bodies.begin() + static_cast<std::ptrdiff_t>(world.walls.size()),
        bodies.end(), [&](const Body& door) { return LeadsInto(door, face); });
    // With corners in a straight line left out.
    if (is_visited || has_door) rooms.push_back(Mended(face));
  }
  std::stable_sort(
      rooms.begin(), rooms.end(),
      [](const Polygon& a, const Polygon& b) { return a.Area() > b.Area(); });
  return rooms;
}

std::vector<TrueDoor> WorldDoors(const World& world) {
  std::vector<TrueDoor> doors;
  for (const WorldDoor& from : world.doors) {
    if (from.is_opening) continue;
    TrueDoor door;
    door.begin = from.begin;
    door.end = from.end;
    door.thickness = from.thickness;
    const Vector2d middle = 0.5 * (from.begin + from.end);
    door.is_shut = std::any_of(
        world.walls.begin(), world.walls.end(), [&](const WorldWall& wall) {
          return Body{wall.begin, wall.end, std::max(wall.thickness, 0.02)}
              .Contains(middle);
        });
    doors.push_back(door);
  }
  return doors;
}

}  // namespace plumbline
