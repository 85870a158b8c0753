#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/beam_directions.h>

#include <cmath>
#include <vector>

namespace plumbline {
namespace {

TEST(BeamDirectionsTest, FollowTheLaser) {
  BeamDirections beams;
  Scan scan;
  EXPECT_TRUE(beams.Of(scan).empty());
  scan.ranges = {1.0f, 0.0f, 2.0f};
  scan.start_angle = -kPi / 2.0;
  scan.angle_step = kPi / 2.0;
  const auto expect = [&](const std::vector<Eigen::Vector2d>& expected) {
    const std::vector<Eigen::Vector2d>& directions = beams.Of(scan);
    ASSERT_EQ(directions.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_LT((directions[i] - expected[i]).norm(), 1e-12) << i;
    }
  };
  expect({{0.0, -1.0}, {1.0, 0.0}, {0.0, 1.0}});
  // Other ranges, the same laser.
  scan.ranges = {3.0f, 3.0f, 3.0f};
  expect({{0.0, -1.0}, {1.0, 0.0}, {0.0, 1.0}});
  // Each of what makes another laser.
  scan.angle_step = -kPi / 2.0;
  expect({{0.0, -1.0}, {-1.0, 0.0}, {0.0, 1.0}});
  scan.start_angle = 0.0;
  expect({{1.0, 0.0}, {0.0, -1.0}, {-1.0, 0.0}});
  scan.ranges.pop_back();
  expect({{1.0, 0.0}, {0.0, -1.0}});
}

// Bearings are stored in single precision; their sines and cosines are not.
TEST(BeamDirectionsTest, BearingsAreTakenInDoublePrecision) {
  BeamDirections beams;
  Scan scan;
  for (int i = 0; i < 50; ++i) {
    scan.ranges.push_back(1.0f);
    scan.bearings.push_back(-1.3f + 0.05f * static_cast<float>(i));
  }
  const std::vector<Eigen::Vector2d>& directions = beams.Of(scan);
  ASSERT_EQ(directions.size(), scan.ranges.size());
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const double bearing = scan.Bearing(i);
    EXPECT_EQ(directions[i].x(), std::cos(bearing)) << i;
    EXPECT_EQ(directions[i].y(), std::sin(bearing)) << i;
  }
}

}  // namespace
}  // namespace plumbline
