#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/beam_directions.h>

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

}  // namespace
}  // namespace plumbline
