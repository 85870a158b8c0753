#include <plumbline/apps/simulation/world.h>
#include <plumbline/apps/simulation/world_geometry.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;
using world_geometry::Corners;
using world_geometry::Direction;
using world_geometry::DistanceToSegment;
using world_geometry::LeftOf;

constexpr double kSameDirectionDeg = 0.01;
constexpr double kShortestOwnDirection = 0.5;
constexpr double kOnWallTolerance = 0.01;

double AxialDeg(const Vector2d& along) {
  return RadToDeg(NormalizeAxial(std::atan2(along.y(), along.x())));
}

}  // namespace

double SimulationRandom::Uniform(double low, double high) {
  // The upper 53 bits fill a double's mantissa exactly.
  const double unit = static_cast<double>(engine_() >> 11) * 0x1p-53;
  return low + (high - low) * unit;
}

double SimulationRandom::Gaussian() {
  // Twelve uniform draws of 16 bits have variance 1 and mean 12 * 65535 / 2.
  std::int64_t sum = 0;
  for (int i = 0; i < 3; ++i) {
    for (std::uint64_t bits = engine_(), j = 0; j < 4; ++j, bits >>= 16) {
      sum += static_cast<std::int64_t>(bits & 0xffff);
    }
  }
  return static_cast<double>(2 * sum - 12 * 65535) * 0x1p-17;
}

WorldSurfaces MakeSurfaces(const World& world) {
  WorldSurfaces surfaces;
  std::vector<WorldFace> ends;
  for (const WorldWall& wall : world.walls) {
    if (wall.thickness <= 0.0) {
      surfaces.faces.push_back({wall.begin, wall.end, -1});
      continue;
    }
    const Vector2d half =
        LeftOf((wall.end - wall.begin).normalized()) * (wall.thickness / 2);
    surfaces.faces.push_back({wall.begin - half, wall.end - half, -1});
    surfaces.faces.push_back({wall.end + half, wall.begin + half, -1});
    ends.push_back({wall.end - half, wall.end + half, -1});
    ends.push_back({wall.begin + half, wall.begin - half, -1});
  }
  const std::size_t num_sides = surfaces.faces.size();
  surfaces.faces.insert(surfaces.faces.end(), ends.begin(), ends.end());

  std::vector<double>& orientations = surfaces.orientations_deg;
  const auto find = [&orientations](double degrees) {
    for (std::size_t i = 0; i < orientations.size(); ++i) {
      if (std::abs(WrapAngle(degrees - orientations[i], 180.0)) <=
          kSameDirectionDeg) {
        return static_cast<int>(i);
      }
    }
    return -1;
  };
  for (std::size_t i = 0; i < surfaces.faces.size(); ++i) {
    const Vector2d along = surfaces.faces[i].end - surfaces.faces[i].begin;
    if (i >= num_sides && along.norm() < kShortestOwnDirection) continue;
    if (find(AxialDeg(along)) < 0) orientations.push_back(AxialDeg(along));
  }
  std::sort(orientations.begin(), orientations.end());
  for (WorldFace& face : surfaces.faces) {
    face.orientation = find(AxialDeg(face.end - face.begin));
  }
  for (const WorldBox& box : world.boxes) {
    const std::vector<Vector2d> corners = Corners(box);
    for (std::size_t i = 0; i < 4; ++i) {
      surfaces.faces.push_back({corners[i], corners[(i + 1) % 4], -1});
    }
  }
  surfaces.circles = world.circles;
  return surfaces;
}

int CutDoor(const Vector2d& position, double width, World* world) {
  int num_cut = 0;
  std::vector<WorldWall> walls;
  WorldDoor door;
  for (const WorldWall& wall : world->walls) {
    const double reach = wall.thickness / 2 + kOnWallTolerance;
    if (DistanceToSegment(position, wall.begin, wall.end) > reach) {
      walls.push_back(wall);
      continue;
    }
    ++num_cut;
    const double length = (wall.end - wall.begin).norm();
    const Vector2d along = (wall.end - wall.begin) / length;
    const double middle = (position - wall.begin).dot(along);
    if (num_cut == 1 || wall.thickness > door.thickness) {
      door.begin = wall.begin + std::max(0.0, middle - width / 2) * along;
      door.end = wall.begin + std::min(length, middle + width / 2) * along;
      door.thickness = wall.thickness;
    }
    // A stump shorter than a centimetre is no wall.
    if (middle - width / 2 > 0.01) {
      walls.push_back({wall.begin, wall.begin + (middle - width / 2) * along,
                       wall.thickness});
    }
    if (middle + width / 2 < length - 0.01) {
      walls.push_back({wall.begin + (middle + width / 2) * along, wall.end,
                       wall.thickness});
    }
  }
  world->walls = std::move(walls);
  if (num_cut > 0) world->doors.push_back(door);
  return num_cut;
}

void RotateWorld(double degrees, World* world) {
  const Vector2d u = Direction(degrees);
  const Vector2d v = LeftOf(u);
  const auto rotate = [&](Vector2d* p) {
    *p = (p->x() * u + p->y() * v).eval();
  };
  for (WorldWall& wall : world->walls) {
    rotate(&wall.begin);
    rotate(&wall.end);
  }
  for (WorldDoor& door : world->doors) {
    rotate(&door.begin);
    rotate(&door.end);
  }
  for (WorldCircle& circle : world->circles) {
    rotate(&circle.center);
    circle.begin_deg += degrees;
  }
  for (WorldBox& box : world->boxes) {
    rotate(&box.center);
    box.angle_deg += degrees;
  }
  for (Vector2d& point : world->path) rotate(&point);
}

}  // namespace plumbline
