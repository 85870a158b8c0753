#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/frontend/driven_way.h>

#include <vector>

namespace plumbline {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Along y = 0 from x = -5 to 5 in steps of 0.02 m, and back along y = 3.
std::vector<Pose2> ThereAndBack() {
  std::vector<Pose2> poses;
  for (int i = 0; i <= 500; ++i) poses.emplace_back(-5.0 + 0.02 * i, 0.0, 0.0);
  for (int i = 0; i <= 150; ++i) poses.emplace_back(5.0, 0.02 * i, 1.57);
  for (int i = 0; i <= 500; ++i) poses.emplace_back(5.0 - 0.02 * i, 3.0, 3.14);
  return poses;
}

TEST(DrivenWayTest, CrossesWhereTheRobotWentThrough) {
  const DrivenWay way(ThereAndBack());
  const Eigen::Vector2d up(0.0, 1.0);
  EXPECT_THAT(way.Crossings({1.23, -1.0}, up, 0.0, 10.0),
              ElementsAre(DoubleNear(1.0, 1e-9), DoubleNear(4.0, 1e-9)));
  EXPECT_THAT(way.Crossings({1.23, -1.0}, up, 1.5, 10.0),
              ElementsAre(DoubleNear(4.0, 1e-9)));
  // At 45 degrees, through a point of the way.
  EXPECT_THAT(way.Crossings({-2.0, 1.0}, Eigen::Vector2d(0.6, -0.8), -2.0, 2.0),
              ElementsAre(DoubleNear(1.25, 1e-9)));
  // Beside it, and nowhere near.
  EXPECT_THAT(way.Crossings({-3.0, 0.5}, Eigen::Vector2d(1.0, 0.0), -1.0, 6.0),
              IsEmpty());
  EXPECT_THAT(way.Crossings({800.0, 500.0}, up, -20.0, 20.0), IsEmpty());
}

TEST(DrivenWayTest, StandingStillAndJumpingIsNoWay) {
  std::vector<Pose2> poses(50, Pose2(0.0, 0.0, 0.0));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i][0] = i % 2 == 0 ? 0.01 : -0.01;
  }
  poses.emplace_back(4.0, 0.0, 0.0);
  const DrivenWay way(poses);
  const Eigen::Vector2d up(0.0, 1.0);
  EXPECT_THAT(way.Crossings({0.0, 0.0}, up, -1.0, 1.0), IsEmpty());
  EXPECT_THAT(way.Crossings({2.0, 0.0}, up, -1.0, 1.0), IsEmpty());
  EXPECT_THAT(DrivenWay({}).Crossings({0.0, 0.0}, up, -1.0, 1.0), IsEmpty());
}

}  // namespace
}  // namespace plumbline
