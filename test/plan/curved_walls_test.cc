#include <gtest/gtest.h>
#include <plumbline/plan/building_plan.h>
#include <plumbline/plan/curved_walls.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "plan/drawing.h"

namespace plumbline {
namespace {

using Eigen::Vector2d;

const Vector2d kRoundCenter(6.0, 6.0);

// A raster of 16 by 12 m with circles.
class RoundDrawing : public Drawing {
 public:
  RoundDrawing() : Drawing(16.0, 12.0) {}

  // Returns on a circle around kRoundCenter.
  RoundDrawing& Circle(double radius) {
    FillWhere(Space::kOccupied, [&](const Vector2d& p) {
      return std::abs((p - kRoundCenter).norm() - radius) <= 0.04;
    });
    return *this;
  }
};

Vector2d OnCircle(double radius, double degrees) {
  return kRoundCenter + radius * Vector2d(std::cos(DegToRad(degrees)),
                                          std::sin(DegToRad(degrees)));
}

// Faces along a circle, `step` degrees each.
std::vector<KnownWall> ArcChords(double radius, double from, double to,
                                 double step) {
  std::vector<KnownWall> chords;
  for (double angle = from; angle + step <= to + 1e-9; angle += step) {
    chords.push_back(
        {OnCircle(radius, angle + 1.0), OnCircle(radius, angle + step - 1.0)});
  }
  return chords;
}

std::vector<CurvedWall> TakeCurves(const RoundDrawing& drawing,
                                   std::vector<KnownWall>* pieces) {
  return TakeCurvedWalls(drawing.space(), {}, {}, pieces);
}

// How far the corners lie from the circle, m, at most.
double LargestOff(const CurvedWall& wall, double radius) {
  double largest = 0.0;
  for (const Vector2d& corner : wall.corners) {
    largest =
        std::max(largest, std::abs((corner - kRoundCenter).norm() - radius));
  }
  return largest;
}

TEST(CurvedWallsTest, ARoundRoomIsOneClosedWall) {
  RoundDrawing drawing;
  drawing.Circle(2.5).Free(8.0, 5.55, 9.0, 6.45);
  // A face is missing here and there, a straight one stands elsewhere.
  std::vector<KnownWall> pieces = ArcChords(2.5, 20.0, 340.0, 16.0);
  pieces.erase(pieces.begin() + 4);
  const KnownWall straight{{1.0, 1.0}, {9.0, 1.0}};
  pieces.push_back(straight);
  const std::vector<CurvedWall> walls = TakeCurves(drawing, &pieces);
  ASSERT_EQ(walls.size(), 1u);
  EXPECT_TRUE(walls[0].is_closed());
  EXPECT_LT(LargestOff(walls[0], 2.5), 0.04);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_EQ(pieces[0].end, straight.end);
  // The door lies within one edge, with wall before and after it.
  int over = 0;
  for (std::size_t i = 0; i + 1 < walls[0].corners.size(); ++i) {
    const Vector2d& a = walls[0].corners[i];
    const Vector2d& b = walls[0].corners[i + 1];
    EXPECT_LE((b - a).norm(), 1.7);
    const bool is_over = std::min(a[1], b[1]) < 5.5 &&
                         std::max(a[1], b[1]) > 6.5 &&
                         std::min(a[0], b[0]) > 7.0;
    over += is_over;
  }
  EXPECT_EQ(over, 1);
}

TEST(CurvedWallsTest, BothFacesAreOneWall) {
  RoundDrawing drawing;
  drawing.Circle(3.0).Circle(3.2);
  std::vector<KnownWall> pieces = ArcChords(3.0, 10.0, 170.0, 16.0);
  for (const KnownWall& piece : ArcChords(3.2, 30.0, 150.0, 15.0)) {
    pieces.push_back(piece);
  }
  const std::vector<CurvedWall> walls = TakeCurves(drawing, &pieces);
  ASSERT_EQ(walls.size(), 1u);
  EXPECT_TRUE(pieces.empty());
  EXPECT_LT(LargestOff(walls[0], 3.1), 0.04);
  EXPECT_NEAR(walls[0].low, -0.1, 0.02);
  EXPECT_NEAR(walls[0].high, 0.1, 0.02);
}

// Two circles that go on from each other, bent to either side.
TEST(CurvedWallsTest, CurvesThatGoOnAreOneWall) {
  RoundDrawing drawing;
  std::vector<KnownWall> pieces = ArcChords(3.0, 0.0, 96.0, 16.0);
  std::vector<KnownWall> other;
  // From the end of the first one on, around a center beyond it.
  const Vector2d center =
      kRoundCenter +
      6.0 * Vector2d(std::cos(DegToRad(96.0)), std::sin(DegToRad(96.0)));
  for (const KnownWall& piece : ArcChords(3.0, 276.0 - 80.0, 276.0, 16.0)) {
    other.push_back({piece.begin - kRoundCenter + center,
                     piece.end - kRoundCenter + center});
  }
  pieces.insert(pieces.end(), other.begin(), other.end());
  drawing.FillWhere(Space::kOccupied, [&](const Vector2d& p) {
    return (std::abs((p - kRoundCenter).norm() - 3.0) <= 0.04 &&
            p[0] > kRoundCenter[0] - 0.3) ||
           (std::abs((p - center).norm() - 3.0) <= 0.04 &&
            p[0] < center[0] + 0.2);
  });
  const std::vector<CurvedWall> walls = TakeCurves(drawing, &pieces);
  ASSERT_EQ(walls.size(), 1u);
  EXPECT_FALSE(walls[0].is_closed());
  EXPECT_TRUE(pieces.empty());
}

// Nothing of this is curved: corners of rooms, a wall with a bend, a wall that
// the map bends a little, faces on a circle along which nothing stands.
TEST(CurvedWallsTest, StraightWallsAreNone) {
  RoundDrawing drawing;
  drawing.Fill(0.0, 0.0, 16.0, 12.0, Space::kOccupied);
  const auto count = [&](std::vector<KnownWall> pieces) {
    const std::size_t before = pieces.size();
    const std::size_t walls = TakeCurves(drawing, &pieces).size();
    EXPECT_EQ(pieces.size(), before);
    return walls;
  };
  EXPECT_EQ(count({{{2.0, 2.0}, {5.0, 2.0}},
                   {{5.0, 2.0}, {5.0, 5.0}},
                   {{5.0, 5.0}, {2.0, 5.0}},
                   {{2.0, 5.0}, {2.0, 2.0}}}),
            0u);
  // 10 degrees, in three pieces on either side.
  std::vector<KnownWall> bend;
  const Vector2d on(std::cos(DegToRad(10.0)), std::sin(DegToRad(10.0)));
  for (int i = 0; i < 3; ++i) {
    bend.push_back({{8.0 - i - 0.9, 6.0}, {8.0 - i, 6.0}});
    bend.push_back(
        {Vector2d(8.0, 6.0) + i * on, Vector2d(8.0, 6.0) + (i + 0.9) * on});
  }
  EXPECT_EQ(count(bend), 0u);
  std::vector<KnownWall> bent;
  for (int i = 0; i < 10; ++i) {
    bent.push_back({{1.0 + i, 3.0 + 0.002 * i * i},
                    {1.9 + i, 3.0 + 0.002 * (i + 0.9) * (i + 0.9)}});
  }
  EXPECT_EQ(count(bent), 0u);
  std::vector<KnownWall> nothing = ArcChords(2.5, 0.0, 180.0, 16.0);
  EXPECT_TRUE(TakeCurves(RoundDrawing(), &nothing).empty());
  // A round table.
  EXPECT_EQ(count(ArcChords(0.7, 0.0, 320.0, 40.0)), 0u);
}

TEST(CurvedWallsTest, FewAndOddFaces) {
  std::vector<KnownWall> pieces;
  EXPECT_TRUE(TakeCurves(RoundDrawing(), &pieces).empty());
  const double nan = std::nan("");
  pieces = {{{1.0, 1.0}, {1.0, 1.0}}, {{nan, 1.0}, {2.0, nan}}};
  EXPECT_TRUE(TakeCurves(RoundDrawing(), &pieces).empty());
  EXPECT_EQ(pieces.size(), 2u);
}

// A round room of 2.5 m radius beside a corridor, with a door of 0.9 m.
TEST(CurvedWallsTest, ARoundRoomHasADoor) {
  RoundDrawing drawing;
  drawing.Fill(8.55, 0.95, 10.65, 11.05, Space::kOccupied)
      .Free(8.6, 1.0, 10.6, 11.0);
  drawing.Circle(2.5)
      .FillWhere(
          Space::kFree,
          [](const Vector2d& p) { return (p - kRoundCenter).norm() < 2.46; })
      .Free(8.0, 5.55, 9.0, 6.45);
  std::vector<KnownWall> walls = ArcChords(2.5, 20.0, 340.0, 16.0);
  walls.push_back({{8.6, 1.0}, {8.6, 5.5}});
  walls.push_back({{8.6, 6.5}, {8.6, 11.0}});
  walls.push_back({{10.6, 11.0}, {10.6, 1.0}});
  const BuildingPlan plan =
      MakeBuildingPlan(walls, {0.0}, drawing.space(),
                       {Pose2(9.6, 6.0, 0.0), Pose2(6.0, 6.0, 0.0)});
  ASSERT_EQ(plan.rooms.size(), 2u);
  const auto round = std::find_if(
      plan.rooms.begin(), plan.rooms.end(),
      [](const PlanRoom& r) { return r.outline.Contains(kRoundCenter); });
  ASSERT_NE(round, plan.rooms.end());
  EXPECT_NEAR(round->area, kPi * 2.5 * 2.5, 0.8);
  ASSERT_EQ(plan.doors.size(), 1u);
  EXPECT_NEAR(plan.doors[0].width(), 0.9, 0.12);
  EXPECT_TRUE(plan.doors[0].is_driven);
  EXPECT_GE(std::min(plan.doors[0].rooms[0], plan.doors[0].rooms[1]), 0);
}

}  // namespace
}  // namespace plumbline
