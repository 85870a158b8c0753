#include <gtest/gtest.h>
#include <plumbline/frontend/range_noise.h>

#include <cmath>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr double kStep = DegToRad(0.5);

// In a room of 6 m x 4 m, the laser off its middle; a pillar in sight.
Scan RoomScan(double sigma, double per_metre, std::mt19937_64* random) {
  std::normal_distribution<double> normal(0.0, 1.0);
  Scan scan;
  scan.start_angle = -M_PI;
  scan.angle_step = kStep;
  scan.maximum_range = 20.0;
  for (int i = 0; i < 720; ++i) {
    const double angle = scan.Bearing(static_cast<std::size_t>(i));
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    double range = std::min((c > 0.0 ? 4.0 : 2.0) / std::abs(c),
                            (s > 0.0 ? 1.5 : 2.5) / std::abs(s));
    if (std::abs(angle - 0.3) < 0.1) range = 1.0;
    scan.ranges.push_back(static_cast<float>(
        range + (sigma + per_metre * range) * normal(*random)));
  }
  return scan;
}

double Measured(double sigma, double per_metre = 0.0, int scans = 20) {
  std::mt19937_64 random(3);
  RangeNoise noise;
  for (int i = 0; i < scans; ++i)
    noise.Add(RoomScan(sigma, per_metre, &random));
  return noise.sigma();
}

TEST(RangeNoiseTest, OfStraightWalls) {
  for (const double sigma : {0.005, 0.01, 0.03, 0.05}) {
    EXPECT_NEAR(Measured(sigma), sigma, 0.05 * sigma) << sigma;
  }
}

TEST(RangeNoiseTest, ThatGrowsWithTheRange) {
  // Ranges from 1.5 to 4.7 m.
  EXPECT_GT(Measured(0.01, 0.01), 0.02);
  EXPECT_LT(Measured(0.01, 0.01), 0.05);
}

TEST(RangeNoiseTest, ExactRangesHaveNone) { EXPECT_LT(Measured(0.0), 0.0005); }

// Told by their step or one by one.
TEST(RangeNoiseTest, OfEvenlySpacedBeams) {
  std::mt19937_64 random(6);
  RangeNoise by_step, one_by_one;
  for (int k = 0; k < 20; ++k) {
    Scan scan = RoomScan(0.02, 0.0, &random);
    by_step.Add(scan);
    std::vector<float> bearings;
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      bearings.push_back(static_cast<float>(scan.Bearing(i)));
    }
    scan.bearings = bearings;
    one_by_one.Add(scan);
  }
  // Bearings are stored in single precision.
  EXPECT_NEAR(by_step.sigma(), one_by_one.sigma(), 1e-5);
}

TEST(RangeNoiseTest, OfBeamsThatAreNotEvenlySpaced) {
  std::mt19937_64 random(4);
  RangeNoise noise;
  for (int k = 0; k < 20; ++k) {
    Scan scan = RoomScan(0.0, 0.0, &random);
    std::normal_distribution<double> normal(0.0, 0.02);
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      // A wall 2 m in front, in a fan of beams that grow apart.
      const double x = -1.0 + 2.0 * static_cast<double>(i) /
                                  static_cast<double>(scan.ranges.size());
      const double bearing = 0.9 * x + 0.1 * x * x * x;
      scan.bearings.push_back(static_cast<float>(bearing));
      scan.ranges[i] =
          static_cast<float>(2.0 / std::cos(bearing) + normal(random));
    }
    noise.Add(scan);
  }
  EXPECT_NEAR(noise.sigma(), 0.02, 0.001);
}

TEST(RangeNoiseTest, RoundedRangesLookNoNoisier) {
  // A laser that rounds to 5 cm.
  std::mt19937_64 random(5);
  RangeNoise noise;
  for (int k = 0; k < 20; ++k) {
    Scan scan = RoomScan(0.005, 0.0, &random);
    for (float& range : scan.ranges) range = 0.05f * std::round(range / 0.05f);
    noise.Add(scan);
  }
  EXPECT_LT(noise.sigma(), kUsualRangeNoise);
}

TEST(RangeNoiseTest, FewReturnsSayNothing) {
  EXPECT_EQ(Measured(0.05, 0.0, 1), 0.0);
  EXPECT_EQ(RangeNoise().sigma(), 0.0);
  RangeNoise noise;
  Scan empty;
  noise.Add(empty);
  Scan blind;
  blind.angle_step = kStep;
  blind.ranges.assign(720, 0.0f);
  for (int i = 0; i < 10; ++i) noise.Add(blind);
  EXPECT_EQ(noise.sigma(), 0.0);
  // All beams in one direction.
  Scan still;
  still.ranges.assign(720, 1.0f);
  for (int i = 0; i < 10; ++i) noise.Add(still);
  EXPECT_EQ(noise.sigma(), 0.0);
}

TEST(RangeNoiseTest, OnlyNoisierLasersAreAllowedFor) {
  EXPECT_EQ(RangeNoiseScale(0.0), 1.0);
  EXPECT_EQ(RangeNoiseScale(kUsualRangeNoise), 1.0);
  EXPECT_EQ(RangeNoiseScale(2.0 * kUsualRangeNoise), 2.0);
}

}  // namespace
}  // namespace plumbline
