#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/wall_kinks.h>

#include <cmath>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr double kSpacing = 0.05;

// Samples of a wall of `length` that turns by `turn` at `joint`, with noise
// across.
std::vector<WallSample> Bent(double length, double joint, double turn,
                             double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> off(0.0, noise);
  std::vector<WallSample> samples;
  for (double along = 0.0; along <= length; along += kSpacing) {
    const double beyond = std::max(0.0, along - joint);
    samples.push_back({along, std::tan(turn) * beyond + off(random),
                       static_cast<int>(samples.size())});
  }
  return samples;
}

TEST(WallKinkTest, StraightWallsHardlyEverHaveOne) {
  int found = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    found += FindWallKink(Bent(6.0, 6.0, 0.0, 0.01, seed), {}) != 0;
  }
  // Four standard deviations at the best of a hundred places.
  EXPECT_LE(found, 6);
  EXPECT_EQ(FindWallKink(Bent(6.0, 6.0, 0.0, 0.0, 1), {}), 0u);
}

TEST(WallKinkTest, WallsThatMeetAtASmallAngleArePartedWhereTheyMeet) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const std::vector<WallSample> samples =
        Bent(6.0, 2.5, DegToRad(3.0), 0.003, seed);
    const std::size_t cut = FindWallKink(samples, {});
    ASSERT_GT(cut, 0u) << seed;
    EXPECT_NEAR(samples[cut].along, 2.5, 0.25) << seed;
  }
}

TEST(WallKinkTest, EndThatIsTooShortForADirectionOfItsOwn) {
  WallKinkOptions options;
  const std::vector<WallSample> samples =
      Bent(3.0, 2.6, DegToRad(8.0), 0.001, 1);
  const std::size_t cut = FindWallKink(samples, options);
  ASSERT_GT(cut, 0u);
  EXPECT_NEAR(samples[cut].along, 2.6, 0.2);
  // Neither a wall of its own nor a short end.
  options.min_length = 1.6;
  EXPECT_GT(FindWallKink(samples, options), 0u);
  options.max_end_share = 0.05;
  EXPECT_EQ(FindWallKink(samples, options), 0u);
}

TEST(WallKinkTest, TurnMustBeLargeAndCertain) {
  WallKinkOptions options;
  options.min_turn = DegToRad(4.0);
  EXPECT_EQ(FindWallKink(Bent(6.0, 3.0, DegToRad(3.0), 0.001, 1), options), 0u);
  options = {};
  EXPECT_EQ(FindWallKink(Bent(1.5, 0.75, DegToRad(0.6), 0.02, 1), options), 0u);
}

// Samples of a wall of 2 m that steps aside at `joint`, as a line through all
// of it has them.
std::vector<WallSample> Stepped(double step, double joint, double noise,
                                unsigned seed) {
  std::vector<WallSample> samples = Bent(2.0, 2.0, 0.0, noise, seed);
  for (WallSample& sample : samples) {
    if (sample.along > joint) sample.across += step;
    sample.across -= 0.5 * step * sample.along;
  }
  return samples;
}

TEST(WallKinkTest, AWallAndADoorSetBackInItArePartedWhereTheyMeet) {
  WallKinkOptions options;
  options.min_step = 0.03;
  for (const double joint : {0.61, 0.92, 1.36}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const std::vector<WallSample> samples =
          Stepped(0.055, joint, 0.008, seed);
      const std::size_t cut = FindWallKink(samples, options);
      ASSERT_GT(cut, 0u) << joint << " " << seed;
      EXPECT_NEAR(samples[cut].along, joint, 0.11) << joint << " " << seed;
    }
  }
  // Too little of a step; two ends too short for a wall; nobody asks.
  EXPECT_EQ(FindWallKink(Stepped(0.02, 0.92, 0.003, 1), options), 0u);
  options.min_end = 1.1;
  options.min_length = 1.1;
  EXPECT_EQ(FindWallKink(Stepped(0.055, 0.92, 0.003, 1), options), 0u);
}

TEST(WallKinkTest, StraightWallsHardlyEverHaveAStep) {
  WallKinkOptions options;
  options.min_step = 0.005;
  int found = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    found += FindWallKink(Bent(2.0, 2.0, 0.0, 0.01, seed), options) != 0;
  }
  EXPECT_LE(found, 6);
}

TEST(WallKinkTest, FewSamplesTellNothing) {
  std::vector<WallSample> samples = Bent(6.0, 3.0, DegToRad(10.0), 0.0, 1);
  samples.resize(11);
  EXPECT_EQ(FindWallKink(samples, {}), 0u);
  EXPECT_EQ(FindWallKink({}, {}), 0u);
}

}  // namespace
}  // namespace plumbline
