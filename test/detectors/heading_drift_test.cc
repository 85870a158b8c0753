#include <gtest/gtest.h>
#include <plumbline/detectors/heading_drift.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr double kSigma = DegToRad(0.1);

// The turns from pose to pose, in the map and as measured with so much drift a
// step and independent noise.
HeadingDrift DriftOf(const std::vector<double>& turns, double drift,
                     unsigned seed, double begin = 0.0) {
  std::vector<double> headings = {begin};
  for (const double turn : turns) headings.push_back(headings.back() + turn);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, kSigma);
  for (double& heading : headings) heading = NormalizeAngle(heading);
  HeadingDrift result(headings);
  for (std::size_t k = 0; k < turns.size(); ++k) {
    result.AddTurn(k, turns[k] - drift + noise(random),
                   1.0 / (kSigma * kSigma));
  }
  result.Estimate();
  return result;
}

TEST(HeadingDriftTest, SteadyDriftIsFound) {
  const double drift = DegToRad(0.12);
  const HeadingDrift found =
      DriftOf(std::vector<double>(200, 0.0), drift, /*seed=*/1);
  EXPECT_NEAR(found.Between(80, 90), 10 * drift, DegToRad(0.3));
  EXPECT_NEAR(found.Between(90, 80), -10 * drift, DegToRad(0.3));
  EXPECT_DOUBLE_EQ(found.Between(90, 80), -found.Between(80, 90));
  EXPECT_EQ(found.Between(90, 90), 0.0);
}

TEST(HeadingDriftTest, NoiseIsNoDrift) {
  int taken_for_drift = 0;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    const HeadingDrift found =
        DriftOf(std::vector<double>(200, 0.0), 0.0, seed);
    taken_for_drift += found.Between(90, 100) != 0.0;
  }
  EXPECT_LE(taken_for_drift, 3);
}

TEST(HeadingDriftTest, ABendOfTheBuildingIsNoDrift) {
  // The map says that the robot turned by 5 degrees more at one place.
  std::vector<double> headings(101, 0.0);
  for (std::size_t k = 51; k < headings.size(); ++k) {
    headings[k] = DegToRad(5.0);
  }
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, kSigma);
  HeadingDrift drift(headings);
  for (std::size_t k = 0; k < 100; ++k) {
    drift.AddTurn(k, noise(random), 1.0 / (kSigma * kSigma));
  }
  drift.Estimate();
  EXPECT_LT(std::abs(drift.Between(40, 60)), DegToRad(0.8));
}

TEST(HeadingDriftTest, TurnsThatWrapAreNoDrift) {
  const std::vector<double> turns(120, DegToRad(37.0));
  const HeadingDrift found = DriftOf(turns, DegToRad(0.2), 2, 3.0);
  EXPECT_NEAR(found.Between(50, 60), DegToRad(2.0), DegToRad(0.4));
}

TEST(HeadingDriftTest, FewOrFarStepsHaveNone) {
  const double drift = DegToRad(0.5);
  EXPECT_EQ(DriftOf(std::vector<double>(15, 0.0), drift, 1).Between(2, 9), 0.0);
  EXPECT_GT(DriftOf(std::vector<double>(16, 0.0), drift, 1).Between(2, 9), 0.0);
  const HeadingDrift found = DriftOf(std::vector<double>(200, 0.0), drift, 1);
  EXPECT_GT(found.Between(20, 52), 0.0);
  EXPECT_EQ(found.Between(20, 53), 0.0);
}

TEST(HeadingDriftTest, StepsWithoutAMeasurementHaveNone) {
  std::vector<double> headings(101, 0.0);
  HeadingDrift drift(headings);
  for (std::size_t k = 0; k < 100; ++k) {
    if (k == 50) continue;
    drift.AddTurn(k, DegToRad(-0.2), 1.0);
    drift.AddTurn(k, DegToRad(-0.2), 3.0);
  }
  drift.Estimate();
  EXPECT_EQ(drift.Between(50, 51), 0.0);
  EXPECT_NEAR(drift.Between(49, 52), DegToRad(0.4), 1e-12);
}

}  // namespace
}  // namespace plumbline
