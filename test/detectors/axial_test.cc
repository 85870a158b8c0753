#include <gtest/gtest.h>
#include <plumbline/detectors/axial.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "detectors/wall_samples.h"

namespace plumbline {
namespace {

// Means in degrees, ascending.
std::vector<double> Directions(const std::vector<AxialComponent>& components) {
  std::vector<double> directions;
  for (const AxialComponent& component : components) {
    directions.push_back(RadToDeg(component.mean));
  }
  std::sort(directions.begin(), directions.end());
  return directions;
}

TEST(AxialTest, DistanceIsAxial) {
  EXPECT_NEAR(AxialDistance(DegToRad(89.0), DegToRad(-89.0)), DegToRad(2.0),
              1e-12);
  EXPECT_NEAR(AxialDistance(DegToRad(10.0), DegToRad(190.0)), 0.0, 1e-12);
  EXPECT_NEAR(AxialDistance(0.0, DegToRad(90.0)), DegToRad(90.0), 1e-12);
}

TEST(AxialTest, Nearest) {
  const std::vector<double> directions = {0.0, DegToRad(4.0), DegToRad(89.0)};
  const double gate = DegToRad(5.0);
  EXPECT_EQ(NearestAxial(directions, DegToRad(1.5), gate), 0);
  EXPECT_EQ(NearestAxial(directions, DegToRad(2.5), gate), 1);
  EXPECT_EQ(NearestAxial(directions, DegToRad(-87.0), gate), 2);
  EXPECT_EQ(NearestAxial(directions, DegToRad(45.0), gate), -1);
  EXPECT_EQ(NearestAxial({}, 0.0, gate), -1);
}

// 5500 segments: two dominant directions, and as much clutter.
TEST(AxialTest, TwoDominantDirectionsInClutter) {
  WallSampler sampler(1);
  std::vector<AxialSample> samples;
  sampler.AddWalls(2000, 10.0, 1.2, 1.5, &samples);
  sampler.AddWalls(1500, 100.0, 1.5, 1.5, &samples);
  sampler.AddClutter(2000, 0.5, &samples);
  const auto components = FindAxialComponents(samples, {}, {});
  ASSERT_EQ(components.size(), 2u);
  EXPECT_NEAR(RadToDeg(components[0].mean), 10.0, 0.1);
  EXPECT_NEAR(RadToDeg(components[1].mean), -80.0, 0.1);
  EXPECT_NEAR(RadToDeg(components[0].stddev), 1.2, 0.1);
  EXPECT_NEAR(RadToDeg(components[1].stddev), 1.5, 0.1);
  EXPECT_NEAR(components[0].count, 2050, 60);
}

TEST(AxialTest, ObliqueWing) {
  WallSampler sampler(2);
  std::vector<AxialSample> samples;
  sampler.AddWalls(2000, 10.0, 1.2, 1.5, &samples);
  sampler.AddWalls(1500, 100.0, 1.5, 1.5, &samples);
  sampler.AddWalls(200, 40.0, 0.5, 1.5, &samples);
  sampler.AddClutter(1500, 0.5, &samples);
  const auto directions = Directions(FindAxialComponents(samples, {}, {}));
  ASSERT_EQ(directions.size(), 3u);
  EXPECT_NEAR(directions[0], -80.0, 0.1);
  EXPECT_NEAR(directions[1], 10.0, 0.1);
  EXPECT_NEAR(directions[2], 40.0, 0.1);
}

// What is uniform has no direction, however much of it there is.
TEST(AxialTest, ClutterAlone) {
  int found = 0;
  for (const int count : {3, 5, 10, 30, 100, 1000, 5000}) {
    for (int seed = 0; seed < (count < 1000 ? 50 : 5); ++seed) {
      WallSampler sampler(1000 * seed + count);
      std::vector<AxialSample> samples;
      sampler.AddClutter(count, 0.6, &samples);
      if (!FindAxialComponents(samples, {}, {}).empty()) ++found;
    }
  }
  EXPECT_EQ(found, 0);
}

TEST(AxialTest, TwoDirectionsThreeDegreesApart) {
  WallSampler sampler(3);
  std::vector<AxialSample> samples;
  sampler.AddWalls(60, 0.0, 0.4, 3.0, &samples);
  sampler.AddWalls(60, 3.0, 0.4, 3.0, &samples);
  const auto directions = Directions(FindAxialComponents(samples, {}, {}));
  ASSERT_EQ(directions.size(), 2u);
  EXPECT_NEAR(directions[0], 0.0, 0.2);
  EXPECT_NEAR(directions[1], 3.0, 0.2);
  // One direction when told that buildings do not have such.
  AxialMixtureOptions options;
  options.min_separation = DegToRad(5.0);
  EXPECT_EQ(FindAxialComponents(samples, {}, options).size(), 1u);
}

// Twelve directions around the whole half circle: nowhere is clutter alone.
TEST(AxialTest, ManyDirections) {
  WallSampler sampler(4);
  std::vector<AxialSample> samples;
  for (int i = 0; i < 12; ++i) {
    sampler.AddWalls(60, -82.5 + 15.0 * i, 0.5, 2.0, &samples);
  }
  const auto directions = Directions(FindAxialComponents(samples, {}, {}));
  ASSERT_EQ(directions.size(), 12u);
  for (int i = 0; i < 12; ++i) {
    EXPECT_NEAR(directions[i], -82.5 + 15.0 * i, 0.3);
  }
}

TEST(AxialTest, AcrossTheWrap) {
  std::vector<AxialSample> samples;
  for (int i = 0; i < 21; ++i) {
    // 89 to 91 degrees, half of them written from the other side.
    const double angle = DegToRad(89.0 + 0.1 * i);
    samples.push_back({i % 2 == 0 ? angle : angle - kPi, 0.0, 2.0});
  }
  const auto components = FindAxialComponents(samples, {}, {});
  ASSERT_EQ(components.size(), 1u);
  EXPECT_NEAR(AxialDistance(components[0].mean, kPi / 2), 0.0, DegToRad(0.01));
  // Of 0, 0.1, ..., 2: sqrt(110 / 3) / 10.
  EXPECT_NEAR(RadToDeg(components[0].stddev), 0.6055, 0.02);
  EXPECT_EQ(components[0].count, 21);
  EXPECT_DOUBLE_EQ(components[0].length, 42.0);
  EXPECT_GT(components[0].mean, -kPi / 2);
  EXPECT_LE(components[0].mean, kPi / 2);
}

// A few long walls in an empty map are a direction; a few short ones are not.
TEST(AxialTest, Support) {
  std::vector<AxialSample> samples;
  for (int i = 0; i < 3; ++i) {
    samples.push_back({DegToRad(20.0 + 0.1 * i), DegToRad(0.1), 4.0});
  }
  const auto components = FindAxialComponents(samples, {}, {});
  ASSERT_EQ(components.size(), 1u);
  EXPECT_NEAR(RadToDeg(components[0].mean), 20.1, 0.01);
  AxialMixtureOptions options;
  options.min_support = 4;
  EXPECT_TRUE(FindAxialComponents(samples, {}, options).empty());
  options = {};
  options.min_support_length = 12.5;
  EXPECT_TRUE(FindAxialComponents(samples, {}, options).empty());
  for (AxialSample& sample : samples) sample.length = 1.0;
  EXPECT_TRUE(FindAxialComponents(samples, {}, {}).empty());
}

// Long features weigh more than short ones in the direction.
TEST(AxialTest, PoorDirectionsWeighLess) {
  std::vector<AxialSample> samples;
  for (int i = 0; i < 10; ++i) {
    samples.push_back({DegToRad(0.02 * i), DegToRad(0.05), 6.0});
    samples.push_back({DegToRad(2.0 + 0.1 * i), DegToRad(2.0), 0.5});
  }
  const auto components = FindAxialComponents(samples, {}, {});
  ASSERT_EQ(components.size(), 1u);
  EXPECT_NEAR(RadToDeg(components[0].mean), 0.1, 0.1);
}

// The tails of a smeared direction reach beyond the gate: they are shoulders
// and not directions, also once the peak itself is known and taken out.
TEST(AxialTest, ShouldersAreNotDirections) {
  AxialMixtureOptions options;
  options.gate = DegToRad(5.0);
  for (int seed = 0; seed < 10; ++seed) {
    WallSampler sampler(seed);
    std::vector<AxialSample> gauss, laplace;
    sampler.AddWalls(2000, 0.0, 4.0, 1.5, &gauss);
    sampler.AddClutter(300, 0.5, &gauss);
    sampler.AddWalls(2000, 0.0, 0.0, 1.5, &laplace);
    for (AxialSample& sample : laplace) {
      const double offset = -2.0 * std::log(sampler.Uniform());
      sample.angle += DegToRad(sampler.Uniform() < 0.5 ? offset : -offset);
    }
    sampler.AddClutter(300, 0.5, &laplace);
    for (const auto& samples : {gauss, laplace}) {
      const auto components = FindAxialComponents(samples, {}, options);
      ASSERT_EQ(components.size(), 1u) << "seed " << seed;
      EXPECT_NEAR(RadToDeg(components[0].mean), 0.0, 0.5);
      EXPECT_TRUE(FindAxialComponents(samples, {0.0}, options).empty());
    }
  }
}

TEST(AxialTest, KnownDirectionsAreLeftOut) {
  WallSampler sampler(5);
  std::vector<AxialSample> samples;
  sampler.AddWalls(100, 10.0, 0.8, 2.0, &samples);
  sampler.AddWalls(80, 55.0, 0.8, 2.0, &samples);
  sampler.AddClutter(100, 0.5, &samples);
  const auto directions =
      Directions(FindAxialComponents(samples, {DegToRad(10.5)}, {}));
  ASSERT_EQ(directions.size(), 1u);
  EXPECT_NEAR(directions[0], 55.0, 0.3);
}

TEST(AxialTest, WhatWasFoundIsNotFoundAgain) {
  for (int seed = 0; seed < 10; ++seed) {
    WallSampler sampler(seed);
    std::vector<AxialSample> samples;
    sampler.AddWalls(300, 10.0, 2.5, 1.5, &samples);
    sampler.AddWalls(200, 100.0, 2.0, 1.5, &samples);
    sampler.AddWalls(30, 40.0, 1.0, 1.5, &samples);
    sampler.AddWalls(10, 60.0, 1.0, 1.5, &samples);
    sampler.AddClutter(300, 0.5, &samples);
    std::vector<double> known;
    for (const AxialComponent& component :
         FindAxialComponents(samples, {}, {})) {
      known.push_back(component.mean);
    }
    EXPECT_GE(known.size(), 2u);
    EXPECT_TRUE(FindAxialComponents(samples, known, {}).empty());
  }
}

TEST(AxialTest, OrderOfSamplesDoesNotMatter) {
  WallSampler sampler(6);
  std::vector<AxialSample> samples;
  sampler.AddWalls(300, -30.0, 1.5, 1.5, &samples);
  sampler.AddWalls(200, 60.0, 1.0, 1.5, &samples);
  sampler.AddClutter(200, 0.5, &samples);
  const auto forward = FindAxialComponents(samples, {}, {});
  std::reverse(samples.begin(), samples.end());
  const auto backward = FindAxialComponents(samples, {}, {});
  ASSERT_EQ(forward.size(), 2u);
  ASSERT_EQ(backward.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(forward[i].mean, backward[i].mean);
    EXPECT_EQ(forward[i].stddev, backward[i].stddev);
    EXPECT_EQ(forward[i].count, backward[i].count);
  }
}

TEST(AxialTest, DegenerateInput) {
  EXPECT_TRUE(FindAxialComponents({}, {}, {}).empty());
  EXPECT_TRUE(FindAxialComponents({}, {0.0}, {}).empty());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<AxialSample> samples(5, {nan, 0.01, 3.0});
  EXPECT_TRUE(FindAxialComponents(samples, {}, {}).empty());
  // No length, no evidence.
  samples.assign(5, {0.3, 0.0, 0.0});
  EXPECT_TRUE(FindAxialComponents(samples, {}, {}).empty());
  // Equal to the last bit.
  samples.assign(50, {0.3, 0.0, 3.0});
  const auto components = FindAxialComponents(samples, {}, {});
  ASSERT_EQ(components.size(), 1u);
  EXPECT_NEAR(components[0].mean, 0.3, 1e-9);
  // Everything is within a known gate.
  std::vector<double> known;
  for (int i = 0; i < 36; ++i) known.push_back(DegToRad(5.0 * i));
  EXPECT_TRUE(FindAxialComponents(samples, known, {}).empty());
}

}  // namespace
}  // namespace plumbline
