#include <gtest/gtest.h>
#include <plumbline/plan/regions.h>

#include <algorithm>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Faces of 4 m one above the other, with these heights, m: the lowest was seen,
// and there is wall around each but between the others.
Arrangement Stack(const std::vector<double>& heights) {
  constexpr double kWidth = 4.0;
  Arrangement arrangement;
  const auto add = [&](const Vector2d& begin, const Vector2d& end, int left,
                       int right, bool is_wall) {
    ArrangementEdge edge;
    edge.begin = begin;
    edge.end = end;
    edge.left = left;
    edge.right = right;
    const Mark mark = is_wall ? Mark::kWall : Mark::kUnknown;
    edge.lengths.metres[static_cast<std::size_t>(mark)] = edge.length();
    edge.lengths.holds = (is_wall ? 1.0 : 0.2) * edge.length();
    arrangement.edges.push_back(edge);
  };
  double low = 0.0;
  const int count = static_cast<int>(heights.size());
  for (int i = 0; i < count; ++i) {
    const double high = low + heights[static_cast<std::size_t>(i)];
    Polygon face;
    face.shell = {{0.0, low}, {kWidth, low}, {kWidth, high}, {0.0, high}};
    arrangement.faces.push_back(face);
    arrangement.free.push_back(i == 0 ? face.Area() : 0.0);
    arrangement.unknown.push_back(i == 0 ? 0.0 : face.Area());
    if (i == 0) add({0.0, low}, {kWidth, low}, i, -1, true);
    add({kWidth, low}, {kWidth, high}, i, -1, true);
    add({0.0, high}, {0.0, low}, i, -1, true);
    add({kWidth, high}, {0.0, high}, i, i + 1 < count ? i + 1 : -1,
        i == 0 || i + 1 == count);
    low = high;
  }
  return arrangement;
}

TEST(RegionsTest, NarrowSpaceBehindFurnitureBelongsToItsRoom) {
  EXPECT_EQ(FindRegions(Stack({3.0, 0.7})), (std::vector<int>{0, 0}));
  // Deeper than a cupboard: seen beside it, or beyond a wall.
  Arrangement desk = Stack({3.0, 1.1});
  EXPECT_EQ(FindRegions(desk), (std::vector<int>{0, -1}));
  desk.free[1] = 0.2 * desk.unknown[1];
  desk.unknown[1] -= desk.free[1];
  EXPECT_EQ(FindRegions(desk), (std::vector<int>{0, 0}));
}

// How deep it may be does not jump with what was seen of it.
TEST(RegionsTest, TheMoreWasSeenBehindFurnitureTheDeeperItMayBe) {
  const auto region = [](double depth, double seen) {
    Arrangement desk = Stack({3.0, depth});
    desk.free[1] = seen * desk.unknown[1];
    desk.unknown[1] -= desk.free[1];
    return FindRegions(desk)[1];
  };
  EXPECT_EQ(region(1.1, 0.02), -1);
  EXPECT_EQ(region(1.1, 0.08), 0);
  EXPECT_EQ(region(1.24, 0.02), -1);
  EXPECT_EQ(region(1.24, 0.08), 0);
}

// Where outer walls bend outwards the next one goes on behind each of them:
// nothing was seen there, and the lines alone close it.
TEST(RegionsTest, UnseenSpaceBehindALongWallIsNoPocketWhereLinesAloneCloseIt) {
  Arrangement arrangement = Stack({3.0, 0.7});
  for (ArrangementEdge& edge : arrangement.edges) {
    if (edge.left != 1) continue;
    edge.lengths.metres = {};
    edge.lengths.metres[static_cast<std::size_t>(Mark::kUnknown)] =
        edge.length();
    edge.lengths.holds = 0.9 * edge.length();
  }
  EXPECT_EQ(FindRegions(arrangement), (std::vector<int>{0, -1}));
}

// The same where a line that ends there cuts the space in two: the wall before
// it is as long as it was.
TEST(RegionsTest, WallBeforeASpaceIsAsLongAsTheSpace) {
  Arrangement arrangement = Stack({3.0, 0.7});
  std::vector<ArrangementEdge> edges;
  const auto add = [&](const Vector2d& begin, const Vector2d& end, int left,
                       int right, Mark mark, double holds) {
    ArrangementEdge edge;
    edge.begin = begin;
    edge.end = end;
    edge.left = left;
    edge.right = right;
    edge.lengths.metres[static_cast<std::size_t>(mark)] = edge.length();
    edge.lengths.holds = holds * edge.length();
    edges.push_back(edge);
  };
  for (const ArrangementEdge& edge : arrangement.edges) {
    if (edge.left == 0 && edge.right < 0) edges.push_back(edge);
  }
  arrangement.faces[1].shell = {{0.0, 3.0}, {2.0, 3.0}, {2.0, 3.7}, {0.0, 3.7}};
  Polygon other;
  other.shell = {{2.0, 3.0}, {4.0, 3.0}, {4.0, 3.7}, {2.0, 3.7}};
  arrangement.faces.push_back(other);
  arrangement.free.push_back(0.0);
  arrangement.unknown = {0.0, 1.4, 1.4};
  add({2.0, 3.0}, {0.0, 3.0}, 0, 1, Mark::kWall, 1.0);
  add({4.0, 3.0}, {2.0, 3.0}, 0, 2, Mark::kWall, 1.0);
  add({2.0, 3.0}, {2.0, 3.7}, 1, 2, Mark::kUnknown, 0.2);
  add({2.0, 3.7}, {0.0, 3.7}, 1, -1, Mark::kUnknown, 0.9);
  add({0.0, 3.7}, {0.0, 3.0}, 1, -1, Mark::kUnknown, 0.9);
  add({4.0, 3.0}, {4.0, 3.7}, 2, -1, Mark::kUnknown, 0.9);
  add({4.0, 3.7}, {2.0, 3.7}, 2, -1, Mark::kUnknown, 0.9);
  arrangement.edges = edges;
  EXPECT_EQ(FindRegions(arrangement), (std::vector<int>{0, -1, -1}));
}

// Nothing is known between the two upper faces: they are one space, and that is
// no narrow one.
TEST(RegionsTest, UnseenSpaceBehindAWallIsNoPocket) {
  EXPECT_EQ(FindRegions(Stack({3.0, 0.7, 0.8})), (std::vector<int>{0, -1, -1}));
}

// A corridor, 2 m wide, goes on through an opening of its whole width in a line
// of walls (line 0), with a strip at its side that runs back beside its first
// part behind a wall (on line 1).
TEST(RegionsTest, ACorridorGoesOnThoughItsPartsShareAWall) {
  const auto regions = [](double open) {
    Arrangement arrangement;
    const auto face = [&](double x1, double y1, double x2, double y2) {
      Polygon polygon;
      polygon.shell = {{x1, y1}, {x2, y1}, {x2, y2}, {x1, y2}};
      arrangement.faces.push_back(polygon);
      arrangement.free.push_back(polygon.Area());
      arrangement.unknown.push_back(0.0);
    };
    face(0.0, 0.0, 10.0, 2.0);
    face(10.0, 0.0, 20.0, 2.0);
    face(0.0, 2.0, 20.0, 2.6);
    const auto edge = [&](const Vector2d& begin, const Vector2d& end, int left,
                          int right, int line, double opening) {
      ArrangementEdge added;
      added.begin = begin;
      added.end = end;
      added.left = left;
      added.right = right;
      added.line = line;
      const double wall = added.length() - opening;
      added.lengths.metres[static_cast<std::size_t>(Mark::kOpen)] = opening;
      added.lengths.metres[static_cast<std::size_t>(Mark::kWall)] = wall;
      // As a wide door holds.
      added.lengths.holds = wall + 0.35 * opening;
      arrangement.edges.push_back(added);
    };
    edge({0.0, 0.0}, {10.0, 0.0}, 0, -1, 2, 0.0);
    edge({10.0, 0.0}, {20.0, 0.0}, 1, -1, 2, 0.0);
    edge({20.0, 0.0}, {20.0, 2.0}, 1, -1, 3, 0.0);
    edge({20.0, 2.0}, {10.0, 2.0}, 1, 2, 1, 10.0);
    arrangement.edges.back().lengths.holds = -10.0;
    edge({10.0, 0.0}, {10.0, 2.0}, 0, 1, 0, open);
    edge({10.0, 2.0}, {0.0, 2.0}, 0, 2, 1, 0.0);
    edge({20.0, 2.0}, {20.0, 2.6}, 2, -1, 3, 0.0);
    edge({20.0, 2.6}, {0.0, 2.6}, 2, -1, 4, 0.0);
    edge({0.0, 2.6}, {0.0, 0.0}, 2, -1, 5, 0.0);
    return FindRegions(arrangement);
  };
  EXPECT_EQ(regions(2.0), (std::vector<int>{0, 0, 0}));
  // A door in a wall.
  const std::vector<int> apart = regions(0.9);
  EXPECT_NE(apart[0], apart[1]);
  EXPECT_EQ(apart[1], apart[2]);
}

void AddFace(const Ring& ring, Arrangement* arrangement) {
  Polygon polygon;
  polygon.shell = ring;
  arrangement->faces.push_back(polygon);
  arrangement->free.push_back(polygon.Area());
  arrangement->unknown.push_back(0.0);
}

// `holds` is a mean over the edge, `door` m of it are a door.
void AddEdge(const Vector2d& begin, const Vector2d& end, int left, int right,
             double holds, double door, Arrangement* arrangement) {
  ArrangementEdge edge;
  edge.begin = begin;
  edge.end = end;
  edge.left = left;
  edge.right = right;
  const double open = std::max(0.0, 0.5 * (1.0 - holds) * edge.length() - door);
  edge.lengths.metres[static_cast<std::size_t>(Mark::kDoor)] = door;
  edge.lengths.metres[static_cast<std::size_t>(Mark::kOpen)] = open;
  edge.lengths.metres[static_cast<std::size_t>(Mark::kWall)] =
      edge.length() - open - door;
  edge.lengths.holds = holds * edge.length();
  arrangement->edges.push_back(edge);
}

// A room of three pieces, each with a gap in furniture to both others: none of
// them is a corridor to which the other two have a door each.
TEST(RegionsTest, PiecesOfARoomDoNotVouchForEachOther) {
  Arrangement arrangement;
  AddFace({{0.0, 0.0}, {3.0, 0.0}, {3.0, 3.0}, {0.0, 3.0}}, &arrangement);
  AddFace({{3.0, 0.0}, {6.0, 0.0}, {6.0, 3.0}, {3.0, 3.0}}, &arrangement);
  AddFace({{0.0, 3.0}, {3.0, 3.0}, {6.0, 3.0}, {6.0, 6.0}, {0.0, 6.0}},
          &arrangement);
  AddEdge({3.0, 0.0}, {3.0, 3.0}, 0, 1, 0.2, 1.0, &arrangement);
  AddEdge({3.0, 3.0}, {0.0, 3.0}, 0, 2, 0.2, 1.0, &arrangement);
  AddEdge({6.0, 3.0}, {3.0, 3.0}, 1, 2, 0.2, 1.0, &arrangement);
  AddEdge({0.0, 0.0}, {3.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
  AddEdge({0.0, 3.0}, {0.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
  AddEdge({3.0, 0.0}, {6.0, 0.0}, 1, -1, 1.0, 0.0, &arrangement);
  AddEdge({6.0, 0.0}, {6.0, 3.0}, 1, -1, 1.0, 0.0, &arrangement);
  AddEdge({6.0, 3.0}, {6.0, 6.0}, 2, -1, 1.0, 0.0, &arrangement);
  AddEdge({6.0, 6.0}, {0.0, 6.0}, 2, -1, 1.0, 0.0, &arrangement);
  AddEdge({0.0, 6.0}, {0.0, 3.0}, 2, -1, 1.0, 0.0, &arrangement);
  const std::vector<int> region = FindRegions(arrangement);
  EXPECT_EQ(region[0], region[1]);
  EXPECT_EQ(region[0], region[2]);
}

// An office (face 0) opens to a hall (1) along 2.9 m of its front (on line 0);
// the wall beside the opening stands before a corridor (2) with a door to the
// hall.
TEST(RegionsTest, TheWallBesideADoorIsThatOfTheWholeSide) {
  const auto is_apart = [](double wall) {
    const double end = 3.4 + wall;
    Arrangement arrangement;
    AddFace({{0.0, 2.0}, {3.4, 2.0}, {end, 2.0}, {end, 7.0}, {0.0, 7.0}},
            &arrangement);
    AddFace({{-6.0, -8.0}, {3.4, -8.0}, {3.4, 2.0}, {-6.0, 2.0}}, &arrangement);
    AddFace({{3.4, 0.0}, {12.0, 0.0}, {12.0, 2.0}, {end, 2.0}, {3.4, 2.0}},
            &arrangement);
    AddEdge({0.0, 2.0}, {3.4, 2.0}, 0, 1, 0.0, 2.9, &arrangement);
    arrangement.edges.back().line = 0;
    AddEdge({3.4, 2.0}, {end, 2.0}, 0, 2, 1.0, 0.0, &arrangement);
    arrangement.edges.back().line = 0;
    AddEdge({end, 2.0}, {end, 7.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({end, 7.0}, {0.0, 7.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 7.0}, {0.0, 2.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({3.4, 0.0}, {3.4, 2.0}, 1, 2, 0.8, 0.9, &arrangement);
    AddEdge({-6.0, -8.0}, {3.4, -8.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({3.4, -8.0}, {3.4, 0.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 2.0}, {-6.0, 2.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({-6.0, 2.0}, {-6.0, -8.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({3.4, 0.0}, {12.0, 0.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({12.0, 0.0}, {12.0, 2.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({12.0, 2.0}, {end, 2.0}, 2, -1, 1.0, 0.0, &arrangement);
    const std::vector<int> region = FindRegions(arrangement);
    return region[0] != region[1];
  };
  EXPECT_TRUE(is_apart(2.2));
  // No more than a cupboard.
  EXPECT_FALSE(is_apart(1.0));
}

// Two rooms side by side with a border that holds less than others, and a
// corridor below both: with a door each they stay two.
TEST(RegionsTest, RoomsWithADoorEachStayApart) {
  const auto are_apart = [](double holds, double second_door) {
    Arrangement arrangement;
    AddFace({{0.0, 2.0}, {5.0, 2.0}, {5.0, 7.0}, {0.0, 7.0}}, &arrangement);
    AddFace({{5.0, 2.0}, {10.0, 2.0}, {10.0, 7.0}, {5.0, 7.0}}, &arrangement);
    AddFace({{0.0, 0.0}, {10.0, 0.0}, {10.0, 2.0}, {5.0, 2.0}, {0.0, 2.0}},
            &arrangement);
    AddEdge({0.0, 2.0}, {5.0, 2.0}, 0, 2, 0.9, 0.9, &arrangement);
    AddEdge({5.0, 2.0}, {10.0, 2.0}, 1, 2, 0.9, second_door, &arrangement);
    AddEdge({5.0, 2.0}, {5.0, 7.0}, 0, 1, holds, 0.0, &arrangement);
    AddEdge({5.0, 7.0}, {0.0, 7.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 7.0}, {0.0, 2.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 2.0}, {10.0, 7.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 7.0}, {5.0, 7.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 2.0}, {0.0, 0.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 0.0}, {10.0, 0.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 0.0}, {10.0, 2.0}, 2, -1, 1.0, 0.0, &arrangement);
    const std::vector<int> region = FindRegions(arrangement);
    return region[0] != region[1];
  };
  EXPECT_TRUE(are_apart(0.2, 0.9));
  EXPECT_FALSE(are_apart(0.2, 0.0));
  EXPECT_FALSE(are_apart(0.0, 0.9));
  EXPECT_TRUE(are_apart(0.4, 0.0));
}

// The same, but a line of walls crosses the corridor at an opening as wide as
// it is, between the two doors, and the second door leads through two lines of
// one wall, 0.2 m apart.
TEST(RegionsTest, DoorsToTwoPartsOfOneCorridorLeadToOne) {
  const auto are_apart = [](double opening) {
    Arrangement arrangement;
    AddFace({{0.0, 2.0}, {5.0, 2.0}, {5.0, 2.2}, {5.0, 7.0}, {0.0, 7.0}},
            &arrangement);
    AddFace({{5.0, 2.2}, {10.0, 2.2}, {10.0, 7.0}, {5.0, 7.0}}, &arrangement);
    AddFace({{0.0, 0.0}, {5.0, 0.0}, {5.0, 2.0}, {0.0, 2.0}}, &arrangement);
    AddFace({{5.0, 0.0}, {10.0, 0.0}, {10.0, 2.0}, {5.0, 2.0}}, &arrangement);
    AddFace({{5.0, 2.0}, {10.0, 2.0}, {10.0, 2.2}, {5.0, 2.2}}, &arrangement);
    AddEdge({0.0, 2.0}, {5.0, 2.0}, 0, 2, 0.9, 0.9, &arrangement);
    AddEdge({5.0, 2.0}, {10.0, 2.0}, 4, 3, 0.9, 0.9, &arrangement);
    AddEdge({5.0, 2.2}, {10.0, 2.2}, 1, 4, 0.9, 0.9, &arrangement);
    AddEdge({5.0, 2.0}, {5.0, 2.2}, 0, 4, 1.0, 0.0, &arrangement);
    AddEdge({5.0, 2.2}, {5.0, 7.0}, 0, 1, 0.2, 0.0, &arrangement);
    // The corridor: as an opening holds that is as wide as a wide door.
    AddEdge({5.0, 0.0}, {5.0, 2.0}, 2, 3, 0.5, opening, &arrangement);
    arrangement.edges.back().lengths.metres = {};
    arrangement.edges.back()
        .lengths.metres[static_cast<std::size_t>(Mark::kDoor)] = opening;
    arrangement.edges.back()
        .lengths.metres[static_cast<std::size_t>(Mark::kWall)] = 2.0 - opening;
    AddEdge({5.0, 7.0}, {0.0, 7.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 7.0}, {0.0, 2.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 2.2}, {10.0, 7.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 7.0}, {5.0, 7.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 2.0}, {10.0, 2.2}, 4, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 2.0}, {0.0, 0.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 0.0}, {5.0, 0.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({5.0, 0.0}, {10.0, 0.0}, 3, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 0.0}, {10.0, 2.0}, 3, -1, 1.0, 0.0, &arrangement);
    const std::vector<int> region = FindRegions(arrangement);
    return region[0] != region[1];
  };
  EXPECT_TRUE(are_apart(1.9));
  // Two rooms behind a door each.
  EXPECT_FALSE(are_apart(0.9));
}

// Half of the wall between two rooms is open; before the other half stands a
// cupboard, whose front is a line of its own. The cupboard belongs to the room
// on its open side, and then the wall is whole.
TEST(RegionsTest, WhatStandsBeforeAWallIsPartOfItsRoomFirst) {
  Arrangement arrangement;
  AddFace({{0.0, 0.0}, {4.0, 0.0}, {4.0, 2.0}, {4.0, 4.0}, {0.0, 4.0}},
          &arrangement);
  AddFace({{4.0, 0.0}, {4.3, 0.0}, {4.3, 2.0}, {4.0, 2.0}}, &arrangement);
  AddFace(
      {{4.3, 0.0}, {8.0, 0.0}, {8.0, 4.0}, {4.0, 4.0}, {4.0, 2.0}, {4.3, 2.0}},
      &arrangement);
  AddEdge({4.0, 0.0}, {4.0, 2.0}, 0, 1, 1.0, 0.0, &arrangement);
  AddEdge({4.0, 2.0}, {4.0, 4.0}, 0, 2, -0.35, 0.0, &arrangement);
  AddEdge({4.3, 0.0}, {4.3, 2.0}, 1, 2, -0.2, 0.0, &arrangement);
  AddEdge({4.3, 2.0}, {4.0, 2.0}, 1, 2, -0.2, 0.0, &arrangement);
  AddEdge({0.0, 0.0}, {4.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
  AddEdge({4.0, 4.0}, {0.0, 4.0}, 0, -1, 1.0, 0.0, &arrangement);
  AddEdge({0.0, 4.0}, {0.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
  AddEdge({4.0, 0.0}, {4.3, 0.0}, 1, -1, 1.0, 0.0, &arrangement);
  AddEdge({4.3, 0.0}, {8.0, 0.0}, 2, -1, 1.0, 0.0, &arrangement);
  AddEdge({8.0, 0.0}, {8.0, 4.0}, 2, -1, 1.0, 0.0, &arrangement);
  AddEdge({8.0, 4.0}, {4.0, 4.0}, 2, -1, 1.0, 0.0, &arrangement);
  const std::vector<int> region = FindRegions(arrangement);
  EXPECT_EQ(region[1], region[2]);
  EXPECT_NE(region[0], region[2]);
}

// A row of cupboards that nobody saw into, 0.4 m deep, stands between two rooms
// and leaves an opening of 1.8 m that alone holds little: the cupboards keep
// them apart along their length. A single one beside an opening does not, nor
// do they cut off a strip that is too narrow for a room.
TEST(RegionsTest, CupboardsBetweenTwoRoomsKeepThemApart) {
  const auto are_apart = [](double cupboards, double width) {
    Arrangement arrangement;
    const double end = 4.0 - cupboards;
    const double right = 4.4 + width;
    AddFace({{0.0, 0.0}, {4.0, 0.0}, {4.0, end}, {4.0, 4.0}, {0.0, 4.0}},
            &arrangement);
    AddFace({{4.0, 0.0},
             {right, 0.0},
             {right, 4.0},
             {4.4, 4.0},
             {4.4, end},
             {4.0, end}},
            &arrangement);
    AddFace({{4.0, end}, {4.4, end}, {4.4, 4.0}, {4.0, 4.0}}, &arrangement);
    arrangement.unknown[2] = arrangement.free[2];
    arrangement.free[2] = 0.0;
    AddEdge({4.0, 0.0}, {4.0, end}, 0, 1, 0.1, end, &arrangement);
    AddEdge({4.0, end}, {4.0, 4.0}, 0, 2, 1.0, 0.0, &arrangement);
    AddEdge({4.0, end}, {4.4, end}, 1, 2, 1.0, 0.0, &arrangement);
    AddEdge({4.4, end}, {4.4, 4.0}, 2, 1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 0.0}, {4.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({4.0, 4.0}, {0.0, 4.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 4.0}, {0.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({4.0, 0.0}, {right, 0.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({right, 0.0}, {right, 4.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({right, 4.0}, {4.4, 4.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({4.4, 4.0}, {4.0, 4.0}, 2, -1, 1.0, 0.0, &arrangement);
    const std::vector<int> region = FindRegions(arrangement);
    return region[0] != region[1];
  };
  EXPECT_TRUE(are_apart(2.2, 4.0));
  EXPECT_FALSE(are_apart(0.5, 4.0));
  EXPECT_FALSE(are_apart(2.2, 0.6));
}

// A corridor of 2 m runs into a hall, and a line of walls crosses it before, at
// an opening that could be a wide door: the corridor ends at the hall, but goes
// on through the opening.
TEST(RegionsTest, ACorridorThatEndsInAHallGoesOnThroughOpenings) {
  const auto is_one = [](double opening) {
    Arrangement arrangement;
    AddFace({{0.0, 0.0}, {10.0, 0.0}, {10.0, 2.0}, {0.0, 2.0}}, &arrangement);
    AddFace({{10.0, 0.0}, {16.0, 0.0}, {16.0, 2.0}, {10.0, 2.0}}, &arrangement);
    AddFace({{16.0, -3.0},
             {24.0, -3.0},
             {24.0, 5.0},
             {16.0, 5.0},
             {16.0, 2.0},
             {16.0, 0.0}},
            &arrangement);
    AddEdge({10.0, 0.0}, {10.0, 2.0}, 0, 1, 0.35, opening, &arrangement);
    arrangement.edges.back().lengths.metres = {0.0, 0.0, 2.0 - opening,
                                               opening};
    AddEdge({16.0, 0.0}, {16.0, 2.0}, 1, 2, -1.0, 0.0, &arrangement);
    AddEdge({0.0, 0.0}, {10.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 2.0}, {0.0, 2.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 2.0}, {0.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({10.0, 0.0}, {16.0, 0.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({16.0, 2.0}, {10.0, 2.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({16.0, 0.0}, {16.0, -3.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({16.0, -3.0}, {24.0, -3.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({24.0, -3.0}, {24.0, 5.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({24.0, 5.0}, {16.0, 5.0}, 2, -1, 1.0, 0.0, &arrangement);
    AddEdge({16.0, 5.0}, {16.0, 2.0}, 2, -1, 1.0, 0.0, &arrangement);
    const std::vector<int> region = FindRegions(arrangement);
    EXPECT_NE(region[1], region[2]);
    return region[0] == region[1];
  };
  EXPECT_TRUE(is_one(1.9));
  EXPECT_FALSE(is_one(0.9));
}

// A strip of 0.6 m between two rooms, with a door to each, is a part of one of
// them; with one door it may be a room of which little was seen.
TEST(RegionsTest, AStripBetweenTwoDoorsBelongsToARoom) {
  const auto strip_is_alone = [](bool has_second_room) {
    Arrangement arrangement;
    AddFace({{0.0, 0.0}, {2.0, 0.0}, {2.0, 3.0}, {0.0, 3.0}}, &arrangement);
    AddFace({{0.0, 3.0}, {2.0, 3.0}, {2.0, 3.6}, {0.0, 3.6}}, &arrangement);
    AddEdge({0.0, 3.0}, {2.0, 3.0}, 1, 0, 0.9, 1.1, &arrangement);
    AddEdge({2.0, 3.6}, {0.0, 3.6}, 1, has_second_room ? 2 : -1, 0.9,
            has_second_room ? 1.1 : 0.0, &arrangement);
    AddEdge({2.0, 3.0}, {2.0, 3.6}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 3.6}, {0.0, 3.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 0.0}, {2.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({2.0, 0.0}, {2.0, 3.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 3.0}, {0.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    if (has_second_room) {
      AddFace({{0.0, 3.6}, {2.0, 3.6}, {2.0, 7.0}, {0.0, 7.0}}, &arrangement);
      AddEdge({2.0, 3.6}, {2.0, 7.0}, 2, -1, 1.0, 0.0, &arrangement);
      AddEdge({2.0, 7.0}, {0.0, 7.0}, 2, -1, 1.0, 0.0, &arrangement);
      AddEdge({0.0, 7.0}, {0.0, 3.6}, 2, -1, 1.0, 0.0, &arrangement);
    }
    const std::vector<int> region = FindRegions(arrangement);
    return region[1] != region[0] &&
           (!has_second_room || region[1] != region[2]);
  };
  EXPECT_FALSE(strip_is_alone(true));
  EXPECT_TRUE(strip_is_alone(false));
}

// What stands before a wall and hides it.
struct Hidden {
  double front = 2.0;   // m along the wall (line 7), ...
  double depth = 0.8;   // ... and across
  double beside = 1.0;  // m of wall beside it, ...
  int line = 7;         // ... and the line that it lies on
  double wall = 0.0;    // m of wall seen behind it, ...
  double seen = 0.0;    // ... and share of the floor there
};

// Walls go on behind furniture: what is seen of a wall beside it says so, or
// what is seen of the floor and the wall behind it; not where too little of the
// wall is seen, nor when what stands there is as long as a wall or flat: there
// the wall itself juts out.
TEST(RegionsTest, WallsGoOnBehindFurniture) {
  const auto is_filled = [](const Hidden& hidden) {
    const double front = hidden.front;
    const double height = front + hidden.beside;
    const double right = 4.0 + hidden.depth;
    Arrangement arrangement;
    AddFace({{0.0, 0.0},
             {4.0, 0.0},
             {4.0, front},
             {right, front},
             {right, height},
             {0.0, height}},
            &arrangement);
    AddFace({{4.0, 0.0}, {right, 0.0}, {right, front}, {4.0, front}},
            &arrangement);
    arrangement.unknown[1] = (1.0 - hidden.seen) * arrangement.free[1];
    arrangement.free[1] *= hidden.seen;
    AddEdge({4.0, 0.0}, {4.0, front}, 0, 1, 1.0, 0.0, &arrangement);
    arrangement.edges.back().line = 3;
    AddEdge({4.0, front}, {right, front}, 0, 1, 1.0, 0.0, &arrangement);
    AddEdge({right, front}, {right, height}, 0, -1, 1.0, 0.0, &arrangement);
    arrangement.edges.back().line = hidden.line;
    AddEdge({right, 0.0}, {right, front}, 1, -1, 0.2, 0.0, &arrangement);
    arrangement.edges.back().line = 7;
    arrangement.edges.back().lengths.metres = {front - hidden.wall, 0.0,
                                               hidden.wall, 0.0};
    AddEdge({4.0, 0.0}, {right, 0.0}, 1, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, 0.0}, {4.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({right, height}, {0.0, height}, 0, -1, 1.0, 0.0, &arrangement);
    AddEdge({0.0, height}, {0.0, 0.0}, 0, -1, 1.0, 0.0, &arrangement);
    const std::vector<int> region = FindRegions(arrangement);
    return region[1] == region[0];
  };
  Hidden hidden;
  EXPECT_TRUE(is_filled(hidden));
  hidden.line = 8;
  EXPECT_FALSE(is_filled(hidden));
  hidden.wall = 0.4;
  EXPECT_FALSE(is_filled(hidden));
  hidden.seen = 0.2;
  EXPECT_TRUE(is_filled(hidden));
  hidden = {};
  hidden.beside = 0.4;
  EXPECT_FALSE(is_filled(hidden));
  hidden = {};
  hidden.front = 3.0;
  EXPECT_FALSE(is_filled(hidden));
  hidden = {};
  hidden.depth = 0.2;
  EXPECT_FALSE(is_filled(hidden));
}

}  // namespace
}  // namespace plumbline
