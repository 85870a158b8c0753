#include <gtest/gtest.h>
#include <plumbline/core/wall.h>
#include <plumbline/frontend/sampled_returns.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

class SampledReturnsTest : public ::testing::Test {
 protected:
  // A robot that stands before a wall at y = 2, and then drives along it.
  SampledReturnsTest() {
    const std::vector<testing::WallEnds> world = {{{-9.0, 2.0}, {9.0, 2.0}}};
    for (int i = 0; i < 140; ++i) {
      poses_.emplace_back(i < 100 ? 0.0 : 0.05 * (i - 99), 0.0, 0.0);
      scans_.push_back(
          testing::MakeScan(world, poses_.back(), testing::Laser()));
    }
    options_.step = 0.19;
    // Seen from below.
    walls_ = {MakeWall(Eigen::Vector2d(0.0, 2.0), kPi, -3.0, 3.0)};
  }

  std::vector<Scan> scans_;
  std::vector<Pose2> poses_;
  std::vector<Wall> walls_;
  SampledReturnsOptions options_;
};

TEST_F(SampledReturnsTest, ScansAreSpreadAlongTheWay) {
  const SampledReturns all(walls_, scans_, poses_, options_);
  // One of those while it stood, and one for each 0.2 m.
  ASSERT_EQ(all.views().size(), 11u);
  EXPECT_NEAR(all.views()[5].origin.x(), 1.0, 1e-9);
  EXPECT_EQ(all.views().back().end, all.returns().size());

  options_.max_scans = 4;
  options_.max_beams = 91;
  const SampledReturns few(walls_, scans_, poses_, options_);
  EXPECT_EQ(few.views().size(), 4u);
  const auto returns = [](const SampledReturns& sampled) {
    return sampled.views()[0].end - sampled.views()[0].begin;
  };
  EXPECT_NEAR(static_cast<double>(returns(few)),
              0.5 * static_cast<double>(returns(all)), 1.0);
}

TEST_F(SampledReturnsTest, ReturnsLieOnTheWallThatTheLaserSees) {
  const SampledReturns sampled(walls_, scans_, poses_, options_);
  for (const SampledReturns::Return& seen : sampled.returns()) {
    EXPECT_NEAR(seen.place.y(), 2.0, 1e-4);
    if (std::abs(std::abs(seen.place.x()) - 3.0) < 0.1) continue;
    EXPECT_EQ(seen.wall, std::abs(seen.place.x()) < 3.0 ? 0 : -1);
  }
  EXPECT_EQ(sampled.WallAt({1.0, 2.04}, {0.0, 0.0}, 0.06), 0);
  EXPECT_EQ(sampled.WallAt({1.0, 2.08}, {0.0, 0.0}, 0.06), -1);
  EXPECT_EQ(sampled.WallAt({1.0, 2.0}, {0.0, 4.0}, 0.06), -1);
  EXPECT_TRUE(sampled.IsNear({0.5, 2.02}, 0.08));
  EXPECT_FALSE(sampled.IsNear({0.5, 2.1}, 0.08));
}

TEST_F(SampledReturnsTest, NothingWasSeen) {
  const SampledReturns sampled(walls_, {}, {}, options_);
  EXPECT_TRUE(sampled.views().empty());
  EXPECT_EQ(sampled.num_cells(), 0u);
  EXPECT_FALSE(sampled.IsNear({0.0, 0.0}, 0.08));
}

}  // namespace
}  // namespace plumbline
