#include <gtest/gtest.h>
#include <plumbline/plan/polygon.h>

#include <random>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

Polygon Rectangle(double x1, double y1, double x2, double y2) {
  Polygon polygon;
  polygon.shell = {{x1, y1}, {x2, y1}, {x2, y2}, {x1, y2}};
  return polygon;
}

TEST(PolygonTest, FacesOfAGrid) {
  // Three lines each way: four faces; the pieces that stick out are no face.
  std::vector<StraightPiece> pieces;
  for (const double at : {0.0, 1.0, 3.0}) {
    pieces.push_back({Vector2d(-0.5, at), Vector2d(3.5, at)});
    pieces.push_back({Vector2d(at, -0.5), Vector2d(at, 3.5)});
  }
  const std::vector<Polygon> faces = FacesOf(pieces);
  ASSERT_EQ(faces.size(), 4u);
  double area = 0.0;
  for (const Polygon& face : faces) {
    EXPECT_GT(SignedArea(face.shell), 0.0);
    area += face.Area();
  }
  EXPECT_NEAR(area, 9.0, 1e-9);
  EXPECT_TRUE(FacesOf({}).empty());
}

TEST(PolygonTest, UnionHasNoStraightCorners) {
  const std::vector<Polygon> whole = UnionOf(
      {Rectangle(0, 0, 1, 1), Rectangle(1, 0, 2, 1), Rectangle(5, 5, 6, 6)});
  ASSERT_EQ(whole.size(), 2u);
  EXPECT_EQ(whole[0].shell.size(), 4u);
  EXPECT_NEAR(whole[0].Area(), 2.0, 1e-9);
  EXPECT_NEAR(whole[0].Perimeter(), 6.0, 1e-9);
}

TEST(PolygonTest, PartsThatTouchInACornerStayApart) {
  const std::vector<Polygon> parts =
      UnionOf({Rectangle(0, 0, 1, 1), Rectangle(1, 1, 2, 2)});
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].shell.size(), 4u);
  EXPECT_EQ(parts[1].shell.size(), 4u);
}

TEST(PolygonTest, UnionsOfFacesLoseNothing) {
  // More meets in some of their corners than in those of a plan.
  for (const unsigned seed : {1u, 7u}) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(0.0, 10.0);
    std::vector<StraightPiece> pieces;
    for (int i = 0; i < 60; ++i) {
      const double x1 = place(random), y1 = place(random);
      const double x2 = place(random), y2 = place(random);
      pieces.push_back({Vector2d(x1, y1), Vector2d(x2, y2)});
    }
    const std::vector<Polygon> faces = FacesOf(pieces);
    ASSERT_GT(faces.size(), 100u);
    for (const double share : {0.1, 0.3, 0.5, 0.7, 0.9}) {
      std::vector<Polygon> some;
      double area = 0.0;
      for (const Polygon& face : faces) {
        if (place(random) > 10.0 * share) continue;
        some.push_back(face);
        area += face.Area();
      }
      double united = 0.0;
      for (const Polygon& part : UnionOf(some)) united += part.Area();
      // Corners in a nearly straight line are left out.
      EXPECT_NEAR(united, area, 0.01) << seed << ' ' << share;
    }
  }
}

TEST(PolygonTest, HolesAreOutside) {
  Polygon ring = DifferenceOf(Rectangle(0, 0, 4, 4), Rectangle(1, 1, 3, 3))[0];
  ASSERT_EQ(ring.holes.size(), 1u);
  EXPECT_NEAR(ring.Area(), 12.0, 1e-9);
  EXPECT_TRUE(ring.Contains({0.5, 0.5}));
  EXPECT_FALSE(ring.Contains({2.0, 2.0}));
  EXPECT_FALSE(ring.Contains({5.0, 2.0}));
  EXPECT_TRUE(ring.Contains(InnerPoint(ring)));
}

TEST(PolygonTest, OffsetOfANarrowOneIsNothing) {
  EXPECT_TRUE(Offset(Rectangle(0, 0, 10, 0.8), -0.5).empty());
  const std::vector<Polygon> smaller = Offset(Rectangle(0, 0, 4, 3), -0.5);
  ASSERT_EQ(smaller.size(), 1u);
  EXPECT_NEAR(smaller[0].Area(), 6.0, 1e-9);
}

TEST(PolygonTest, WhatCrossesItselfIsMended) {
  Polygon bow;
  bow.shell = {{0, 0}, {2, 2}, {2, 0}, {0, 2}};
  EXPECT_NEAR(Mended(bow).Area(), 1.0, 1e-6);
  EXPECT_EQ(Mended(Polygon()).shell.size(), 0u);
  EXPECT_TRUE(Offset(Polygon(), 1.0).empty());
  EXPECT_TRUE(IntersectionOf(Polygon(), bow).empty());
}

}  // namespace
}  // namespace plumbline
