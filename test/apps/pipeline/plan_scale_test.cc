#include <gtest/gtest.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/pipeline/plan_scale.h>

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

namespace plumbline {
namespace {

// Walls of rooms beside lines of a plan that is drawn larger by a share, moved
// and turned a little.
std::vector<WallBesideLine> Beside(double excess, double scatter) {
  std::vector<WallBesideLine> walls;
  for (const double x : {1e3 - 20.0, 1e3 - 5.0, 1e3 + 3.0, 1e3 + 17.0}) {
    for (const double y : {-8.0, 2.0, 9.0}) {
      for (const double angle : {0.1, 0.1 + 0.5 * kPi}) {
        WallBesideLine wall;
        wall.point = Eigen::Vector2d(x, y);
        wall.normal = Eigen::Vector2d(-std::sin(angle), std::cos(angle));
        const Eigen::Vector2d arm(x - 1e3, y);
        const Eigen::Vector2d moved = Eigen::Vector2d(0.03, -0.02) +
                                      2e-3 * Eigen::Vector2d(-y, x - 1e3) -
                                      excess * arm;
        wall.across =
            wall.normal.dot(moved) +
            scatter * std::sin(7.0 * static_cast<double>(walls.size()));
        walls.push_back(wall);
      }
    }
  }
  return walls;
}

TEST(PlanScaleTest, IsFoundWhereverThePlanLies) {
  for (const double excess : {-0.02, 0.0, 0.005}) {
    const std::optional<PlanScale> scale = FindPlanScale(Beside(excess, 0.01));
    ASSERT_TRUE(scale);
    EXPECT_NEAR(scale->excess, excess, 3.0 * scale->sigma);
    EXPECT_GT(scale->sigma, 1e-5);
    EXPECT_LT(scale->sigma, 1e-3);
    EXPECT_NEAR(scale->most_offset, std::abs(scale->excess) * 20.0,
                0.2 * scale->most_offset);
  }
}

TEST(PlanScaleTest, FewWallsOrOneDirectionTellNothing) {
  std::vector<WallBesideLine> walls = Beside(0.01, 0.0);
  EXPECT_FALSE(FindPlanScale({walls.begin(), walls.begin() + 8}));
  EXPECT_FALSE(FindPlanScale({}));
  // All along one line: nothing but how far it is off.
  for (WallBesideLine& wall : walls) {
    wall.point = Eigen::Vector2d(wall.point.x(), 0.0);
    wall.normal = Eigen::Vector2d::UnitY();
  }
  EXPECT_FALSE(FindPlanScale(walls));
  for (WallBesideLine& wall : walls) wall.point.setZero();
  EXPECT_FALSE(FindPlanScale(walls));
}

}  // namespace
}  // namespace plumbline
