#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/mirrors.h>
#include <plumbline/frontend/wall_completion.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::CastRay;
using testing::Laser;
using testing::Noise;
using testing::WallEnds;

// Four sides of a box between two corners.
void AddBox(double x1, double y1, double x2, double y2,
            std::vector<WallEnds>* world) {
  world->push_back({{x1, y1}, {x2, y1}});
  world->push_back({{x2, y1}, {x2, y2}});
  world->push_back({{x2, y2}, {x1, y2}});
  world->push_back({{x1, y2}, {x1, y1}});
}

// The room [-6, 6] x [0, 4] with its furniture, but for its wall at y = 4.
std::vector<WallEnds> RoomWithOpenSide() {
  std::vector<WallEnds> world = {
      {{-6.0, 4.0}, {-6.0, 0.0}},  {{-6.0, 0.0}, {-2.0, 0.0}},
      {{-2.0, 0.0}, {-2.0, -0.4}}, {{-2.0, -0.4}, {0.5, -0.4}},
      {{0.5, -0.4}, {0.5, 0.0}},   {{0.5, 0.0}, {6.0, 0.0}},
      {{6.0, 0.0}, {6.0, 4.0}}};
  AddBox(-4.5, 0.0, -3.5, 0.5, &world);
  AddBox(2.0, 0.0, 2.8, 0.6, &world);
  AddBox(4.6, 0.0, 5.2, 0.8, &world);
  return world;
}

// The image about y = `at`.
std::vector<WallEnds> Image(const std::vector<WallEnds>& world, double at) {
  std::vector<WallEnds> image;
  for (const WallEnds& wall : world) {
    image.push_back({{wall.a.x(), 2.0 * at - wall.a.y()},
                     {wall.b.x(), 2.0 * at - wall.b.y()}});
  }
  return image;
}

// Length of a ray that a mirror may reflect.
double CastReflected(const std::vector<WallEnds>& walls,
                     const std::optional<WallEnds>& mirror,
                     const Eigen::Vector2d& from, double angle) {
  const double direct = CastRay(walls, from, angle);
  if (!mirror) return direct;
  const double before = CastRay({*mirror}, from, angle);
  if (!(before < direct)) return direct;
  const Eigen::Vector2d side = mirror->b - mirror->a;
  const double reflected = 2.0 * std::atan2(side.y(), side.x()) - angle;
  const Eigen::Vector2d ray(std::cos(angle), std::sin(angle));
  return before + CastRay(walls, from + before * ray, reflected);
}

class MirrorsTest : public ::testing::Test {
 protected:
  MirrorsTest() {
    RegisterBuiltinRelations(&registry_);
    laser_.start_angle = -kPi;
    laser_.beams = 360;
    laser_.sigma = 0.01;
  }

  // Adds what is seen along a way in even steps.
  void Drive(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const int steps = static_cast<int>((to - from).norm() / 0.25);
    for (int i = 0; i <= steps; ++i) {
      const Eigen::Vector2d place = from + (to - from) * i / steps;
      const Pose2 pose(place.x(), place.y(), 0.0);
      Scan scan = testing::MakeScan({}, pose, laser_);
      for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
        const double range =
            CastReflected(world_, mirror_, place, scan.Bearing(beam)) +
            noise_.Normal(laser_.sigma);
        if (range > laser_.maximum_range) continue;
        scan.ranges[beam] = static_cast<float>(range);
      }
      scans_.push_back(scan);
      poses_.push_back(pose);
    }
  }
  void DriveThroughRoom() {
    Drive({-5.0, 1.5}, {5.0, 1.5});
    Drive({5.0, 1.5}, {5.0, 3.0});
    Drive({5.0, 3.0}, {-5.0, 3.0});
  }

  std::vector<Wall> WallsSeen() const {
    std::vector<Wall> walls;
    const Transaction found =
        FindGlimpsedWalls(Graph(), registry_, scans_, poses_, {});
    for (const Feature& feature : found.added_features()) {
      walls.push_back(*WallOf(feature));
    }
    return walls;
  }
  std::vector<Mirror> Find() const {
    return FindMirrors(WallsSeen(), scans_, poses_, options_);
  }

  // The room, with a wall of this thickness at y = 4 that is open between x =
  // -1 and 1.
  void OpenRoom(double thickness) {
    world_ = RoomWithOpenSide();
    for (const double side : {-1.0, 1.0}) {
      world_.push_back({{side * 6.0, 4.0}, {side * 1.0, 4.0}});
      world_.push_back({{side * 1.0, 4.0}, {side * 1.0, 4.0 + thickness}});
      world_.push_back(
          {{side * 1.0, 4.0 + thickness}, {side * 6.0, 4.0 + thickness}});
    }
  }
  void AddToWorld(const std::vector<WallEnds>& walls) {
    world_.insert(world_.end(), walls.begin(), walls.end());
  }

  Registry registry_;
  Laser laser_;
  Noise noise_{7};
  std::vector<WallEnds> world_;
  std::optional<WallEnds> mirror_;
  std::vector<Scan> scans_;
  std::vector<Pose2> poses_;
  MirrorOptions options_;
};

TEST_F(MirrorsTest, FindsAMirrorOnAWall) {
  OpenRoom(0.1);
  mirror_ = WallEnds{{-1.0, 3.98}, {1.0, 3.98}};
  DriveThroughRoom();
  const std::vector<Mirror> mirrors = Find();
  ASSERT_EQ(mirrors.size(), 1u);
  const Wall& wall = mirrors[0].wall;
  EXPECT_NEAR(wall.length(), 2.0, 0.1);
  EXPECT_NEAR(wall.Across({0.0, 3.98}), 0.0, 0.01);
  EXPECT_NEAR(wall.Middle().x(), 0.0, 0.05);
  // Seen from the room.
  EXPECT_GT(wall.Across({0.0, 1.0}), 2.5);
  EXPECT_GT(mirrors[0].share, 0.97);
  EXPECT_GT(mirrors[0].returns, 500);

  options_.min_width = 3.0;
  EXPECT_TRUE(Find().empty());
}

TEST_F(MirrorsTest, FindsNothingOnceItIsToStop) {
  OpenRoom(0.1);
  mirror_ = WallEnds{{-1.0, 3.98}, {1.0, 3.98}};
  DriveThroughRoom();
  EXPECT_TRUE(FindMirrors(WallsSeen(), scans_, poses_, options_, [] {
                return true;
              }).empty());
  EXPECT_TRUE(FindMirrors({}, scans_, poses_, options_).empty());
  EXPECT_TRUE(FindMirrors({}, {}, {}, options_).empty());
}

// What a mirror in the middle of the opening would show is there: two rooms of
// which each is the image of the other.
TEST_F(MirrorsTest, AnOpeningBetweenEqualRoomsIsNone) {
  OpenRoom(0.12);
  AddToWorld(Image(RoomWithOpenSide(), 4.06));
  DriveThroughRoom();
  EXPECT_TRUE(Find().empty());
}

TEST_F(MirrorsTest, AnOpeningIntoAnotherRoomIsNone) {
  OpenRoom(0.12);
  AddBox(-2.5, 4.12, 3.0, 7.6, &world_);
  world_.erase(world_.end() - 4);
  DriveThroughRoom();
  EXPECT_TRUE(Find().empty());
}

// Of a room of which the robot saw one half from within and the other from
// there.
TEST_F(MirrorsTest, TheMiddleOfARoomIsNone) {
  world_ = RoomWithOpenSide();
  AddToWorld(Image(RoomWithOpenSide(), 4.0));
  DriveThroughRoom();
  EXPECT_TRUE(Find().empty());
}

TEST_F(MirrorsTest, NothingIsAMirrorThatTheRobotWentThrough) {
  OpenRoom(0.0);
  AddToWorld(Image(RoomWithOpenSide(), 4.0));
  DriveThroughRoom();
  // A wall without thickness has the image that a mirror would have.
  EXPECT_EQ(Find().size(), 1u);
  Scan blind = scans_.back();
  for (float& range : blind.ranges) range = 0.0f;
  for (int i = 0; i <= 20; ++i) {
    scans_.push_back(blind);
    poses_.emplace_back(0.0, 3.0 + 0.1 * i, 0.0);
  }
  EXPECT_TRUE(Find().empty());
}

TEST_F(MirrorsTest, NothingIsAMirrorThatTheRobotLookedOutOf) {
  OpenRoom(0.0);
  AddToWorld(Image(RoomWithOpenSide(), 4.0));
  DriveThroughRoom();
  Drive({-0.75, 5.0}, {0.75, 5.0});
  EXPECT_TRUE(Find().empty());
}

// A wall stood there for a part of the log.
TEST_F(MirrorsTest, NothingIsAMirrorThatWasSeenItself) {
  OpenRoom(0.0);
  AddToWorld(Image(RoomWithOpenSide(), 4.0));
  DriveThroughRoom();
  world_.push_back({{-1.0, 4.0}, {1.0, 4.0}});
  DriveThroughRoom();
  EXPECT_TRUE(Find().empty());
}

TEST_F(MirrorsTest, BeamsEndAtTheMirror) {
  OpenRoom(0.1);
  mirror_ = WallEnds{{-1.0, 3.98}, {1.0, 3.98}};
  laser_.sigma = 0.0;
  Drive({-5.0, 1.5}, {5.0, 1.5});
  Mirror mirror;
  mirror.wall = MakeWall(Eigen::Vector2d(0.0, 3.98), kPi, -1.0, 1.0);
  // The last scan has no pose.
  const std::vector<Pose2> poses(poses_.begin(), poses_.end() - 1);
  const std::vector<Scan> cut = CutAtMirrors(scans_, poses, {mirror}, options_);
  ASSERT_EQ(cut.size(), scans_.size());
  EXPECT_EQ(cut.back().ranges, scans_.back().ranges);
  std::size_t num_cut = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (std::size_t beam = 0; beam < cut[i].ranges.size(); ++beam) {
      const double angle = cut[i].Bearing(beam);
      const Eigen::Vector2d place = poses[i].head<2>();
      const double before = CastRay({*mirror_}, place, angle);
      const double direct = CastRay(world_, place, angle);
      if (before < direct) {
        ++num_cut;
        EXPECT_NEAR(cut[i].ranges[beam], before, 1e-4);
      } else if (std::abs(place.x() + direct * std::cos(angle)) > 1.2) {
        EXPECT_EQ(cut[i].ranges[beam], scans_[i].ranges[beam]);
      }
    }
  }
  EXPECT_GT(num_cut, 500u);
}

}  // namespace
}  // namespace plumbline
