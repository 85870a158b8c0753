#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/reference_points.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr double kDistance = 0.03;

ReferencePoint At(double x, double y, double angle) {
  return {{x, y}, {std::cos(angle), std::sin(angle)}};
}

void ExpectSame(const ReferencePoints& a, const ReferencePoints& b) {
  ASSERT_EQ(a.points().size(), b.points().size());
  for (std::size_t i = 0; i < a.points().size(); ++i) {
    EXPECT_EQ(a.points()[i].position, b.points()[i].position) << i;
    EXPECT_EQ(a.points()[i].normal, b.points()[i].normal) << i;
  }
  ASSERT_EQ(a.buckets().size(), b.buckets().size());
  for (std::size_t i = 0; i < a.buckets().size(); ++i) {
    EXPECT_EQ(a.buckets()[i].row, b.buckets()[i].row) << i;
    EXPECT_EQ(a.buckets()[i].column, b.buckets()[i].column) << i;
    EXPECT_EQ(a.buckets()[i].begin, b.buckets()[i].begin) << i;
  }
}

TEST(ReferencePointsTest, WhatLiesTogetherAndLooksTheSameWayIsOne) {
  ReferencePoints points(kDistance);
  points.Add({At(1.02, 2.04, 0.0), At(1.04, 2.04, 0.2),
              At(1.02, 2.05, 0.5 * kPi), At(1.08, 2.04, 0.0)});
  ASSERT_EQ(points.points().size(), 3u);
  EXPECT_NEAR(points.points()[0].position.x(), 1.03, 1e-12);
  EXPECT_NEAR(
      std::atan2(points.points()[0].normal.y(), points.points()[0].normal.x()),
      0.1, 1e-12);
  EXPECT_NEAR(points.points()[0].normal.norm(), 1.0, 1e-12);
  EXPECT_EQ(points.given().size(), 4u);
  ASSERT_EQ(points.buckets().size(), 1u);
  EXPECT_EQ(points.buckets()[0].row, 20);
  EXPECT_EQ(points.buckets()[0].column, 10);
}

TEST(ReferencePointsTest, BucketsComeByRowsAndColumns) {
  ReferencePoints points(kDistance);
  points.Add({At(0.35, 0.05, 0.0), At(-0.05, 0.05, 0.0), At(0.35, -0.15, 0.0),
              At(0.05, 0.05, 0.0), At(0.36, -0.11, 1.5)});
  std::vector<std::vector<int>> buckets;
  for (const ReferencePoints::Bucket& bucket : points.buckets()) {
    buckets.push_back({bucket.row, bucket.column, bucket.begin});
  }
  EXPECT_EQ(buckets, (std::vector<std::vector<int>>{
                         {-2, 3, 0}, {0, -1, 2}, {0, 0, 3}, {0, 3, 4}}));
}

// Points that come in parts are as points that come at once, bit by bit.
TEST(ReferencePointsTest, PartsAreAsTheWhole) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.02);
  std::uniform_real_distribution<double> along(-3.0, 3.0);
  std::vector<ReferencePoint> all;
  for (int i = 0; i < 3000; ++i) {
    const double place = along(random);
    switch (random() % 3) {
      case 0:
        all.push_back(At(place, 1.0 + noise(random), -0.5 * kPi));
        break;
      case 1:
        all.push_back(At(-2.0 + noise(random), place, noise(random)));
        break;
      default:
        all.push_back({{along(random), along(random)}, {0.0, 0.0}});
    }
  }
  ReferencePoints whole(kDistance);
  whole.Add(all);
  EXPECT_LT(whole.points().size(), 2500u);
  for (const std::size_t first :
       {std::size_t{0}, std::size_t{1}, std::size_t{1500}, std::size_t{2990}}) {
    ReferencePoints parts(kDistance);
    parts.Add({all.begin(), all.begin() + first});
    parts.Add({all.begin() + first, all.end()});
    ExpectSame(parts, whole);
    EXPECT_EQ(parts.given().size(), all.size());
  }
  ReferencePoints many(kDistance);
  for (std::size_t i = 0; i < all.size(); i += 250) {
    many.Add({all.begin() + i, all.begin() + i + 250});
  }
  ExpectSame(many, whole);
}

TEST(ReferencePointsTest, WildPointsCostNothing) {
  const double infinity = std::numeric_limits<double>::infinity();
  ReferencePoints points(kDistance);
  points.Add({At(1e7, -1e7, 0.0), At(0.05, 0.05, 0.0), At(-1e7, 1e7, 0.0)});
  EXPECT_EQ(points.points().size(), 3u);
  EXPECT_EQ(points.buckets()[1].row, 0);
  points.Add({At(infinity, 0.0, 0.0), At(std::nan(""), 0.0, 0.0),
              At(1e300, 0.0, 0.0), At(0.15, 0.05, 0.0)});
  EXPECT_EQ(points.points().size(), 4u);
  EXPECT_EQ(points.given().size(), 7u);
  points.Add({});
  EXPECT_EQ(points.points().size(), 4u);
}

}  // namespace
}  // namespace plumbline
