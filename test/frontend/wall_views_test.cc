#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/wall_views.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace plumbline {
namespace {

// Three places in a corridor along x, 2 m wide; the robot looks along it.
class WallViewsTest : public ::testing::Test {
 protected:
  WallViewsTest() {
    RegisterBuiltinRelations(&registry_);
    for (int i = 0; i < 3; ++i) {
      Scan scan;
      scan.start_angle = -0.5 * kPi;
      scan.angle_step = DegToRad(1.0);
      scan.maximum_range = 20.0;
      for (int beam = 0; beam <= 180; ++beam) {
        const double angle = scan.start_angle + beam * scan.angle_step;
        scan.ranges.push_back(
            static_cast<float>(std::min(4.0, 1.0 / std::abs(std::sin(angle)))));
      }
      scans_.push_back(scan);
      poses_.emplace_back(5.0 * i, 0.0, 0.0);
      groups_.push_back(i);
    }
  }

  Feature Wall(double x, double y, double length) {
    Feature wall;
    wall.type = &registry_.GetFeature("segment");
    wall.parameters = {x, y, y > 0.0 ? kPi : 0.0};
    wall.extent_begin = -0.5 * length;
    wall.extent_end = 0.5 * length;
    return wall;
  }

  std::vector<int> See(const std::vector<Feature>& walls) {
    return GroupsThatSaw(walls, scans_, poses_, groups_, ScanPointsOptions(),
                         0.05);
  }

  Registry registry_;
  std::vector<Scan> scans_;
  std::vector<Pose2> poses_;
  std::vector<int> groups_;
};

// The place beside a wall need not be the one that saw it: the robot looks
// forward.
TEST_F(WallViewsTest, WhoSawIsAsked) {
  EXPECT_EQ(See({Wall(1.0, 1.0, 1.5), Wall(6.5, -1.0, 1.5), Wall(4.5, 1.0, 0.5),
                 Wall(11.0, 1.0, 1.0)}),
            (std::vector<int>{0, 1, -1, 2}));
  // Another wall stands there.
  EXPECT_EQ(See({Wall(1.0, 1.3, 1.5)}), std::vector<int>{-1});
}

TEST_F(WallViewsTest, TheMostReturnsCount) {
  groups_ = {4, 4, 2};
  EXPECT_EQ(See({Wall(6.0, 1.0, 20.0)}), std::vector<int>{4});
}

TEST_F(WallViewsTest, NumbersMustAgree) {
  groups_.pop_back();
  EXPECT_THROW(See({}), Error);
}

}  // namespace
}  // namespace plumbline
