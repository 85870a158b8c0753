#include <gtest/gtest.h>
#include <plumbline/apps/simulation/bent_world.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <vector>

namespace plumbline {
namespace {

TEST(BentWorldTest, CorridorsMeetAtTheAngleGiven) {
  for (const double bend : {-7.0, 2.0, 9.0}) {
    BentOptions options;
    options.bend_deg = bend;
    const WorldSurfaces surfaces = MakeSurfaces(MakeBentWorld(options, 3));
    // Four walls and two ends, nothing else, and no gap at the joint.
    ASSERT_EQ(surfaces.faces.size(), 6u);
    const Eigen::Vector2d second =
        surfaces.faces[1].end - surfaces.faces[1].begin;
    EXPECT_NEAR(std::atan2(second.y(), second.x()), DegToRad(bend), 1e-12);
    EXPECT_EQ(surfaces.faces[0].end, surfaces.faces[1].begin);
    EXPECT_EQ(surfaces.faces[2].end, surfaces.faces[3].begin);
    // Both corridors are as wide.
    const Eigen::Vector2d along = second.normalized();
    const Eigen::Vector2d across(-along.y(), along.x());
    EXPECT_NEAR(across.dot(surfaces.faces[1].end - surfaces.faces[3].end),
                surfaces.faces[0].begin.y() - surfaces.faces[2].begin.y(),
                1e-9);
  }
}

TEST(BentWorldTest, NichesAndTheJointAtHalfTheAngle) {
  BentOptions options = NichesOptions();
  options.bend_deg = 6.0;
  const WorldSurfaces surfaces = MakeSurfaces(MakeBentWorld(options, 1));
  EXPECT_GT(surfaces.faces.size(), 40u);
  int joints = 0;
  for (const WorldFace& face : surfaces.faces) {
    const Eigen::Vector2d along = face.end - face.begin;
    const double degrees = RadToDeg(std::atan2(along.y(), along.x()));
    if (std::abs(degrees - 3.0) < 1e-6) ++joints;
  }
  EXPECT_EQ(joints, 2);
}

TEST(BentWorldTest, TheRobotGetsThroughWhateverTheSeed) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    for (BentOptions options : {BentOptions(), NichesOptions()}) {
      options.bend_deg = 10.0;
      EXPECT_NO_THROW(
          Drive(MakeBentWorld(options, seed), DriveOptions(), seed));
    }
  }
}

TEST(BentWorldTest, OptionsOutOfRangeAreRefused) {
  BentOptions options;
  options.bend_deg = 80.0;
  EXPECT_THROW(MakeBentWorld(options, 1), Error);
  options = BentOptions();
  options.joint_length = 0.2;
  EXPECT_THROW(MakeBentWorld(options, 1), Error);
  options = BentOptions();
  options.length.low = 1.0;
  EXPECT_THROW(MakeBentWorld(options, 1), Error);
}

}  // namespace
}  // namespace plumbline
