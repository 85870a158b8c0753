#include <plumbline/apps/simulation/building_clutter.h>
#include <plumbline/apps/simulation/world_geometry.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <cstddef>

namespace plumbline {
namespace {

using Eigen::Vector2d;
using world_geometry::Corners;
using world_geometry::Direction;
using world_geometry::DistanceToSegment;
using world_geometry::LeftOf;
using world_geometry::SegmentDistance;

class ClutterMaker {
 public:
  ClutterMaker(const BuildingOptions& options, const ClutterPlaces& places,
               SimulationRandom* random, World* world)
      : options_(options), places_(places), random_(random), world_(world) {}

  void Make() {
    for (const BuildingRoom& room : places_.rooms) {
      for (int i = 0; i < options_.furniture; ++i) Furnish(room);
    }
    for (const auto& [begin, end] : places_.corridors) Fill(begin, end);
  }

 private:
  // Tries a piece of furniture.
  void Furnish(const BuildingRoom& room) {
    const double angle = RadToDeg(std::atan2(room.along.y(), room.along.x()));
    const double length = random_->Uniform(0.8, 1.6);
    const double width = random_->Uniform(0.4, 0.8);
    const double kind = random_->Uniform(0.0, 1.0);
    const double where = random_->Uniform(0.0, 1.0);
    const double turn = random_->Uniform(-90.0, 90.0);
    const auto at = [&room](double u, double v) {
      return (room.corner + u * room.along + v * room.away).eval();
    };
    if (kind < 0.45) {
      // Desk at the back wall.
      const double u = length / 2 + where * (room.width - length);
      TryBox({at(u, room.depth - width / 2 - 0.02), length, width, angle});
    } else if (kind < 0.8) {
      // Cupboard at a partition.
      const double v = 1.0 + where * (room.depth - 1.0 - length) + length / 2;
      const double u =
          turn < 0.0 ? width / 2 + 0.02 : room.width - width / 2 - 0.02;
      TryBox({at(u, v), length, width, angle + 90.0});
    } else {
      // Something standing about.
      const double side = 0.3 + 0.3 * where;
      TryBox({at(0.6 + where * (room.width - 1.2), room.depth * 0.6), side,
              side, angle + turn});
    }
  }

  // Tries cupboards along a corridor.
  void Fill(const Vector2d& begin, const Vector2d& end) {
    const double length = (end - begin).norm();
    const Vector2d along = (end - begin) / length;
    const int tries = static_cast<int>(
        std::lround(length / 10.0 * options_.corridor_clutter));
    for (int i = 0; i < tries; ++i) {
      const double u = random_->Uniform(1.0, length - 1.0);
      const double size = random_->Uniform(0.6, 1.2);
      const double depth = random_->Uniform(0.25, 0.4);
      const double side = random_->Chance(0.5) ? 1.0 : -1.0;
      const double angle = RadToDeg(std::atan2(along.y(), along.x()));
      const WorldBox box{
          begin + u * along +
              side * (places_.half_width - depth / 2 - 0.01) * LeftOf(along),
          size, depth, angle};
      if (HasWallBehind(box, side * LeftOf(along))) TryBox(box);
    }
  }

  // Whether a box leaves room for the robot, doors, columns and other boxes.
  bool Fits(const WorldBox& box) const {
    const std::vector<Vector2d> corners = Corners(box);
    const double radius = std::hypot(box.length, box.width) / 2;
    for (const Vector2d& door : places_.doors) {
      if ((door - box.center).norm() < radius + 0.7) return false;
    }
    for (const WorldCircle& circle : world_->circles) {
      if ((circle.center - box.center).norm() < radius + circle.radius + 0.2) {
        return false;
      }
    }
    for (const WorldBox& other : world_->boxes) {
      const double reach = radius + std::hypot(other.length, other.width) / 2;
      if ((other.center - box.center).norm() < reach + 0.1) return false;
    }
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 1; j < world_->path.size(); ++j) {
        if (SegmentDistance(corners[i], corners[(i + 1) % 4],
                            world_->path[j - 1], world_->path[j]) < 0.55) {
          return false;
        }
      }
    }
    return true;
  }

  void TryBox(const WorldBox& box) {
    if (Fits(box)) world_->boxes.push_back(box);
  }

  // A cupboard stands at a wall, not in the opening of another corridor.
  bool HasWallBehind(const WorldBox& box, const Vector2d& away) const {
    for (const double share : {-0.5, 0.5}) {
      const Vector2d probe =
          box.center + share * box.length * Direction(box.angle_deg) +
          away * (box.width / 2 + places_.wall_thickness / 2);
      bool on_wall = false;
      for (const WorldWall& wall : world_->walls) {
        on_wall = on_wall || DistanceToSegment(probe, wall.begin, wall.end) <
                                 wall.thickness / 2;
      }
      if (!on_wall) return false;
    }
    return true;
  }

  const BuildingOptions& options_;
  const ClutterPlaces& places_;
  SimulationRandom* random_;
  World* world_;
};

}  // namespace

void AddClutter(const BuildingOptions& options, const ClutterPlaces& places,
                SimulationRandom* random, World* world) {
  ClutterMaker(options, places, random, world).Make();
}

}  // namespace plumbline
