#include <gtest/gtest.h>
#include <plumbline/plan/building_plan.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "plan/drawing.h"

namespace plumbline {
namespace {

using Eigen::Vector2d;

// A corridor below, two rooms above it with a door each, walls of 20 cm.
Drawing TwoRooms() {
  Drawing drawing(14.0, 12.0);
  drawing.Room(1.0, 1.0, 13.0, 3.0);
  drawing.Room(1.0, 3.2, 6.0, 8.0).Room(6.2, 3.2, 13.0, 8.0);
  drawing.Free(2.0, 2.9, 2.9, 3.3).Free(8.0, 2.9, 8.9, 3.3);
  return drawing;
}

BuildingPlan PlanOf(const Drawing& drawing,
                    const std::vector<Pose2>& path = {}) {
  return MakeBuildingPlan({}, {0.0}, drawing.space(), path);
}

TEST(BuildingPlanTest, RoomsAndDoorsOfACorridor) {
  const std::vector<Pose2> path = {Pose2(2.4, 2.0, 0.0), Pose2(2.4, 4.0, 0.0)};
  const BuildingPlan plan = PlanOf(TwoRooms(), path);
  ASSERT_EQ(plan.rooms.size(), 3u);
  EXPECT_NEAR(plan.rooms[0].area, 6.8 * 4.8, 1.0);
  EXPECT_NEAR(plan.rooms[1].area, 24.0, 0.8);
  EXPECT_NEAR(plan.rooms[2].area, 24.0, 0.8);
  const auto corridor = std::find_if(
      plan.rooms.begin(), plan.rooms.end(), [](const PlanRoom& room) {
        return room.kind == PlanRoom::Kind::kCorridor;
      });
  ASSERT_NE(corridor, plan.rooms.end());
  EXPECT_TRUE(corridor->outline.Contains({7.0, 2.0}));
  EXPECT_EQ(corridor->neighbors.size(), 2u);
  ASSERT_EQ(plan.doors.size(), 2u);
  int driven = 0;
  for (const PlanDoor& door : plan.doors) {
    EXPECT_NEAR(door.width(), 0.9, 0.11);
    EXPECT_NEAR(door.begin[1], 3.1, 0.05);
    EXPECT_GE(std::min(door.rooms[0], door.rooms[1]), 0);
    driven += door.is_driven;
  }
  EXPECT_EQ(driven, 1);
  const auto entered =
      std::count_if(plan.rooms.begin(), plan.rooms.end(),
                    [](const PlanRoom& room) { return room.is_entered; });
  EXPECT_EQ(entered, 2);
}

// The robot drives out of the last room for 6 m, in steps of 0.1 m; what it
// drives in a doorway does not count.
TEST(BuildingPlanTest, AWayOutsideOfAllRooms) {
  std::vector<Pose2> path;
  for (double y = 2.0; y < 6.0; y += 0.1) path.emplace_back(2.4, y, 0.0);
  EXPECT_EQ(PlanOf(TwoRooms(), path).way_outside, 0.0);
  for (double y = 6.0; y < 14.05; y += 0.1) path.emplace_back(2.4, y, 0.0);
  EXPECT_NEAR(PlanOf(TwoRooms(), path).way_outside, 6.0, 0.2);
  // The next log, elsewhere outside.
  path.emplace_back(Pose2::Constant(std::nan("")));
  path.emplace_back(40.0, 40.0, 0.0);
  EXPECT_NEAR(PlanOf(TwoRooms(), path).way_outside, 6.0, 0.2);
}

// The second log begins behind a door, and so does the third.
TEST(BuildingPlanTest, NobodyDrivesFromOneLogToTheNext) {
  const Pose2 off = Pose2::Constant(std::nan(""));
  const std::vector<Pose2> path = {Pose2(2.4, 2.0, 0.0), off,
                                   Pose2(2.4, 4.0, 0.0), off,
                                   Pose2(8.4, 2.0, 0.0), Pose2(8.4, 4.0, 0.0)};
  const BuildingPlan plan = PlanOf(TwoRooms(), path);
  ASSERT_EQ(plan.doors.size(), 2u);
  for (const PlanDoor& door : plan.doors) {
    EXPECT_EQ(door.is_driven, door.begin[0] > 6.0);
  }
  for (const PlanRoom& room : plan.rooms) EXPECT_TRUE(room.is_entered);
}

// A corridor of 2 by 8 m runs into a hall of 6 by 8 m; `room_width` makes the
// hall narrower.
BuildingPlan CorridorIntoHall(double room_width) {
  Drawing drawing(18.0, 12.0);
  const double half = 0.5 * room_width;
  drawing.Room(1.0, 5.0, 9.1, 7.0).Room(9.1, 6.0 - half, 15.0, 6.0 + half);
  drawing.Free(9.0, 5.0, 9.2, 7.0);
  return PlanOf(drawing);
}

TEST(BuildingPlanTest, ACorridorEndsInAHall) {
  const BuildingPlan plan = CorridorIntoHall(8.0);
  ASSERT_EQ(plan.rooms.size(), 2u);
  EXPECT_NEAR(plan.rooms[0].area, 5.9 * 8.0, 1.5);
  EXPECT_NEAR(plan.rooms[1].area, 8.1 * 2.0, 1.0);
  EXPECT_EQ(plan.rooms[1].kind, PlanRoom::Kind::kCorridor);
  // As wide as the corridor, without a wall beside it: no door.
  EXPECT_TRUE(plan.doors.empty());
}

TEST(BuildingPlanTest, ACorridorThatWidensALittleIsOne) {
  EXPECT_EQ(CorridorIntoHall(2.6).rooms.size(), 1u);
}

// A corridor of 2 m with a bay of `depth` m on one side.
std::size_t RoomsOfACorridorWithABay(double depth) {
  Drawing drawing(26.0, 12.0);
  drawing.Room(8.0, 5.0 - depth, 14.0, 7.0).Room(1.0, 5.0, 22.0, 7.0);
  drawing.Free(8.0, 4.9, 14.0, 5.1);
  return PlanOf(drawing).rooms.size();
}

TEST(BuildingPlanTest, ACorridorGoesStraightOnBehindABay) {
  EXPECT_EQ(RoomsOfACorridorWithABay(1.5), 1u);
  // A hall between two corridors.
  EXPECT_EQ(RoomsOfACorridorWithABay(3.5), 3u);
}

// No wall stands in a door, and each is joined to others at its ends.
TEST(BuildingPlanTest, WallsCloseTheRooms) {
  const BuildingPlan plan = PlanOf(TwoRooms());
  double length = 0.0;
  for (const PlanWall& wall : plan.walls) {
    length += (wall.end - wall.begin).norm();
    EXPECT_GE(wall.left + wall.right, 0.09);
    EXPECT_LT(wall.left + wall.right, 0.4);
    for (const PlanDoor& door : plan.doors) {
      Polygon body;
      body.shell = BodyOf(wall);
      EXPECT_FALSE(body.Contains(0.5 * (door.begin + door.end)));
    }
  }
  // Around, between the rooms, and to the corridor without the doors.
  EXPECT_NEAR(length, 2 * (12.2 + 7.2) + 5.0 + 12.2 - 1.8, 2.5);
}

TEST(BuildingPlanTest, WallsOnEachOtherAreDrawnOnce) {
  const auto wall = [](double x1, double y1, double x2, double y2) {
    PlanWall made;
    made.begin = {x1, y1};
    made.end = {x2, y2};
    made.left = made.right = 0.05;
    return made;
  };
  const std::vector<PlanWall> walls = WithoutDoubles({
      wall(3.0, 0.05, 1.0, 0.05),  // within the next one
      wall(0.0, 0.0, 5.0, 0.0),    //
      wall(4.0, 0.04, 6.0, 0.05),  // goes on from it
      wall(4.7, -0.05, 5.3, 0.0),  // meets it
      wall(1.0, 0.13, 3.0, 0.13),  // on the one of 5 m as well
      wall(1.0, 0.25, 3.0, 0.25),  // another one
      wall(2.0, -1.0, 2.0, 1.0),   // crosses it
  });
  ASSERT_EQ(walls.size(), 5u);
  EXPECT_EQ(walls[0].end, Vector2d(5.0, 0.0));
  EXPECT_NEAR(walls[1].begin[0], 5.0, 1e-3);
  EXPECT_EQ(walls[1].end, Vector2d(6.0, 0.05));
  EXPECT_EQ(walls[2].begin, Vector2d(4.7, -0.05));
  EXPECT_EQ(walls[3].begin, Vector2d(1.0, 0.25));
  EXPECT_EQ(walls[4].begin, Vector2d(2.0, -1.0));
}

// Walls of which one face was seen lie on one side of their lines, so that
// those of two lines may lie on each other.
TEST(BuildingPlanTest, BodiesOnEachOtherAreDrawnOnce) {
  const auto wall = [](double y, bool turned, double left, double right) {
    PlanWall made;
    made.begin = {turned ? 4.0 : 1.0, y};
    made.end = {turned ? 1.0 : 4.0, y};
    made.left = left;
    made.right = right;
    return made;
  };
  const PlanWall below = wall(0.0, false, 0.12, 0.0);
  EXPECT_EQ(WithoutDoubles({below, wall(0.2, false, 0.0, 0.12)}).size(), 1u);
  EXPECT_EQ(WithoutDoubles({below, wall(0.2, true, 0.12, 0.0)}).size(), 1u);
  EXPECT_EQ(WithoutDoubles({below, wall(0.2, true, 0.0, 0.12)}).size(), 2u);
  // A piece of half a metre to a rounding error, as profiles have them.
  PlanWall piece = wall(0.07, true, 0.1, 0.0);
  piece.begin[0] = 3.9;
  piece.end[0] = 3.4 + 1e-9;
  EXPECT_EQ(WithoutDoubles({below, piece}).size(), 1u);
}

// Something wide hides most of a wall: nothing was seen between its front and
// the wall, but the room is closed there.
TEST(BuildingPlanTest, JogsOfWallsAreClosed) {
  Drawing drawing(11.0, 9.0);
  drawing.Room(1.0, 1.0, 9.0, 6.0);
  drawing.Fill(3.0, 0.95, 9.05, 1.85, Space::kUnknown);
  drawing.Fill(3.0, 1.85, 9.05, 1.9, Space::kOccupied);
  const BuildingPlan plan = PlanOf(drawing);
  ASSERT_EQ(plan.rooms.size(), 1u);
  EXPECT_TRUE(std::any_of(
      plan.walls.begin(), plan.walls.end(), [](const PlanWall& wall) {
        return (0.5 * (wall.begin + wall.end) - Vector2d(3.0, 1.4)).norm() <
               0.2;
      }));
}

bool IsWallAt(const BuildingPlan& plan, const Vector2d& point) {
  return std::any_of(plan.walls.begin(), plan.walls.end(),
                     [&](const PlanWall& wall) {
                       Polygon body;
                       body.shell = BodyOf(wall);
                       return body.Contains(point);
                     });
}

// What nobody goes through is no opening: a crack beside a cupboard, a pane.
TEST(BuildingPlanTest, CracksTooNarrowForADoorAreWall) {
  const auto plan = [](double width) {
    Drawing drawing = TwoRooms();
    drawing.Free(5.9, 5.0, 6.3, 5.0 + width);
    return PlanOf(drawing);
  };
  const BuildingPlan crack = plan(0.4);
  EXPECT_TRUE(IsWallAt(crack, {6.1, 5.2}));
  EXPECT_EQ(crack.rooms.size(), 3u);
  EXPECT_EQ(crack.doors.size(), 2u);
  const BuildingPlan door = plan(0.8);
  EXPECT_FALSE(IsWallAt(door, {6.1, 5.4}));
  EXPECT_EQ(door.doors.size(), 3u);
}

// A shut door in a recess of a corridor's wall: the wall goes around it.
// Where returns behind an opening lie here and there nothing is drawn.
TEST(BuildingPlanTest, NichesHaveABackAndSides) {
  const auto plan = [](bool is_straight) {
    Drawing drawing = TwoRooms();
    drawing.Free(5.0, 0.6, 6.0, 1.05);
    if (is_straight) {
      drawing.Fill(5.0, 0.5, 6.0, 0.6, Space::kOccupied);
    } else {
      drawing.Fill(5.3, 0.8, 5.4, 0.85, Space::kOccupied);
    }
    return PlanOf(drawing);
  };
  const BuildingPlan niche = plan(true);
  EXPECT_TRUE(IsWallAt(niche, {5.5, 0.53}));
  EXPECT_FALSE(IsWallAt(niche, {5.5, 0.8}));
  EXPECT_TRUE(IsWallAt(niche, {4.95, 0.75}));
  EXPECT_TRUE(IsWallAt(niche, {6.05, 0.75}));
  EXPECT_EQ(niche.doors.size(), 2u);
  EXPECT_EQ(niche.walls.size(), plan(false).walls.size() + 3);
}

// What was not seen in line with a door says less against it than what was
// seen to be open.
TEST(BuildingPlanTest, UnseenPlacesSayLittleAgainstADoor) {
  const auto holds = [](Space elsewhere) {
    Drawing drawing(12.0, 2.0);
    drawing.Fill(0.0, 0.0, 12.0, 2.0, elsewhere);
    drawing.Fill(4.5, 1.0, 7.5, 1.05, Space::kOccupied);
    drawing.Free(5.5, 0.0, 6.5, 2.0);
    DrawnLine drawn;
    drawn.line.origin = Vector2d(0.0, 1.025);
    drawn.from = drawn.line.begin = 0.0;
    drawn.to = drawn.line.end = 12.0;
    drawn.line.weight = 2.0;
    std::vector<DrawnLine> lines = {drawn};
    MeasureLines(drawing.space(), {}, &lines);
    const WallProfile& profile = lines[0].profile;
    return profile.holds[static_cast<std::size_t>(profile.IndexOf(6.0))];
  };
  EXPECT_GT(holds(Space::kUnknown), holds(Space::kFree));
}

TEST(BuildingPlanTest, TurnedBuildingIsTheSame) {
  const Drawing drawing = TwoRooms();
  const BuildingPlan straight = PlanOf(drawing);
  // Every cell of a larger raster looks up its place in the drawing.
  SpaceGrid turned;
  turned.origin = Vector2d(-12.0, -3.0);
  turned.width = 500;
  turned.height = 500;
  const double angle = 0.5;
  for (int row = 0; row < turned.height; ++row) {
    for (int column = 0; column < turned.width; ++column) {
      const Vector2d p = turned.Middle(column, row);
      turned.cells.push_back(drawing.space().At(
          Vector2d(std::cos(angle) * p[0] + std::sin(angle) * p[1],
                   -std::sin(angle) * p[0] + std::cos(angle) * p[1])));
    }
  }
  const BuildingPlan plan = MakeBuildingPlan({}, {angle}, turned, {});
  ASSERT_EQ(plan.rooms.size(), straight.rooms.size());
  for (std::size_t i = 0; i < plan.rooms.size(); ++i) {
    EXPECT_NEAR(plan.rooms[i].area, straight.rooms[i].area, 1.0);
  }
  EXPECT_EQ(plan.doors.size(), straight.doors.size());
}

TEST(BuildingPlanTest, FurnitureIsNoWall) {
  Drawing drawing = TwoRooms();
  drawing.Fill(8.0, 5.0, 9.2, 5.6, Space::kOccupied);
  drawing.Fill(10.0, 6.0, 10.1, 6.1, Space::kOccupied);
  EXPECT_EQ(PlanOf(drawing).rooms.size(), 3u);
}

// Edges of desks 0.25 m beside each other with free floor in between are no
// faces of one wall; those of a wall of that thickness, seen from outside,
// are.
TEST(BuildingPlanTest, FacesWithFreeSpaceBetweenThemAreNoWall) {
  const auto rooms = [](bool is_wall) {
    Drawing drawing(14.0, 12.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 6.0, 10.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3);
    if (is_wall) {
      drawing.Fill(1.0, 6.0, 6.0, 6.25, Space::kUnknown);
      drawing.Fill(1.0, 6.0, 6.0, 6.05, Space::kOccupied);
      drawing.Fill(1.0, 6.2, 6.0, 6.25, Space::kOccupied);
      drawing.Free(3.0, 6.0, 3.9, 6.25);
    } else {
      drawing.Fill(1.0, 6.2, 2.6, 7.0, Space::kOccupied);
      drawing.Fill(4.0, 5.2, 6.0, 6.0, Space::kOccupied);
    }
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(true), 3u);
  EXPECT_EQ(rooms(false), 2u);
}

TEST(BuildingPlanTest, AWideOpeningJoins) {
  Drawing drawing = TwoRooms();
  drawing.Free(5.9, 4.0, 6.3, 8.0);
  EXPECT_EQ(PlanOf(drawing).rooms.size(), 2u);
}

// An office that is open to a hall along half of its front is a room when the
// wall of the front goes on beside it, and a part of the hall when it does
// not. A long wall between piers: its ends are long pieces too far from each
// other, and what is between them goes to either.
TEST(BuildingPlanTest, AWallBetweenPiersIsOneLine) {
  Drawing drawing(22.0, 12.0);
  drawing.Room(1.0, 1.0, 20.0, 9.0);
  for (const double pier : {7.0, 10.4, 14.0}) {
    drawing.Fill(pier, 0.9, pier + 0.6, 1.3, Space::kUnknown);
    drawing.Fill(pier, 1.3, pier + 0.6, 1.6, Space::kOccupied);
  }
  // A little off, as in a map.
  for (const double begin : {11.0, 14.6}) {
    const double end = begin < 14.0 ? 14.0 : 20.0;
    drawing.Free(begin, 0.9, end, 1.0);
    drawing.Fill(begin, 0.85, end, 0.9, Space::kOccupied);
  }
  int along_it = 0;
  for (const WallLine& line : FindWallLines({}, {0.0}, drawing.space())) {
    along_it += line.weight > 2.0 && std::abs(line.along[0]) > 0.9 &&
                std::abs(line.Across({10.0, 1.0})) < 0.2;
  }
  EXPECT_EQ(along_it, 1);
  const BuildingPlan plan = PlanOf(drawing);
  ASSERT_EQ(plan.rooms.size(), 1u);
  EXPECT_NEAR(plan.rooms[0].area, 19.0 * 8.0, 3.0);
}

// Two rooms with 0.5 m of wall between them, and a passage through it. Where
// `beside` m of the wall are seen beside what stands before it on the right,
// it is furniture that makes it so thick.
Drawing RoomsWithAThickWall(double beside) {
  Drawing drawing(16.0, 9.0);
  drawing.Room(1.0, 1.0, 7.0, 7.0).Room(7.5, 1.0, 14.0, 7.0);
  if (beside > 0.0) {
    drawing.Room(7.1, 7.0 - beside, 8.0, 7.0).Free(8.0, 6.0 - beside, 9.0, 7.0);
  }
  drawing.Fill(6.95, 2.0, 7.55, 3.0, Space::kOccupied);
  drawing.Free(6.95, 2.05, 7.55, 2.95);
  return drawing;
}

TEST(BuildingPlanTest, AThickWallIsOneWall) {
  const BuildingPlan plan = PlanOf(RoomsWithAThickWall(0.0));
  ASSERT_EQ(plan.rooms.size(), 2u);
  EXPECT_NEAR(plan.rooms[0].area, 6.5 * 6.0, 0.8);
  EXPECT_NEAR(plan.rooms[1].area, 6.0 * 6.0, 0.8);
  ASSERT_EQ(plan.doors.size(), 1u);
  EXPECT_NEAR(plan.doors[0].begin[0], 7.25, 0.06);
  EXPECT_NEAR(plan.doors[0].thickness, 0.55, 0.1);
  EXPECT_NEAR(plan.doors[0].width(), 0.9, 0.11);
}

// A room below a corridor, and two above it whose wall is 0.4 m to the right
// of the end of the room below. Cupboards before that wall have their front
// 0.15 m beside the line of the wall below.
Drawing CupboardsInLineWithAWall() {
  Drawing drawing(15.0, 15.0);
  drawing.Room(1.0, 6.0, 13.0, 8.0).Room(1.0, 1.0, 6.0, 5.8);
  drawing.Room(1.0, 8.2, 6.4, 13.0).Room(6.6, 8.2, 13.0, 13.0);
  drawing.Free(3.0, 5.7, 3.9, 6.1);
  drawing.Free(3.0, 7.9, 3.9, 8.3).Free(9.0, 7.9, 9.9, 8.3);
  drawing.Fill(5.85, 8.7, 6.4, 10.6, Space::kOccupied);
  drawing.Fill(5.9, 8.75, 6.5, 10.55, Space::kUnknown);
  return drawing;
}

TEST(BuildingPlanTest, CupboardsBesideALineOfWallAreNoneOfIt) {
  const Drawing drawing = CupboardsInLineWithAWall();
  double front = 0.0;
  for (const WallLine& line : FindWallLines({}, {0.0}, drawing.space())) {
    const double across = line.Across({5.87, 9.5});
    if (std::abs(line.along[1]) > 0.9 && across > line.low - 0.05 &&
        across < line.high + 0.05 && line.Along({5.87, 9.5}) > line.begin &&
        line.Along({5.87, 9.5}) < line.end) {
      front += line.weight;
    }
  }
  EXPECT_NEAR(front, 1.7, 0.2);
  const BuildingPlan plan = PlanOf(drawing);
  ASSERT_EQ(plan.rooms.size(), 4u);
  EXPECT_EQ(plan.doors.size(), 3u);
}

TEST(BuildingPlanTest, CupboardsBeforeAWallDoNotMakeItThick) {
  for (const WallLine& line :
       FindWallLines({}, {0.0}, RoomsWithAThickWall(0.9).space())) {
    EXPECT_LT(line.high - line.low, 0.31);
  }
}

// A thick wall of 8 m between two rooms, and beyond an unseen gap of 5 m in
// line with its lower face a wall that was seen from below only.
TEST(BuildingPlanTest, AWallFarFromAThickOneIsNoFaceOfIt) {
  Drawing drawing(28.0, 10.0);
  drawing.Room(16.0, 1.0, 24.0, 4.0).Room(16.0, 4.6, 24.0, 8.0);
  drawing.Room(1.0, 1.0, 7.0, 4.0);
  int thick = 0;
  for (const WallLine& line : FindWallLines({}, {0.0}, drawing.space())) {
    if (std::abs(line.along[0]) < 0.9 || line.high - line.low < 0.4) continue;
    ++thick;
    EXPECT_NEAR(line.end - line.begin, 8.0, 0.3);
  }
  EXPECT_EQ(thick, 1);
}

// Two walls of 4 m and more with a gap between them.
TEST(BuildingPlanTest, LongWallsGoOnBeyondACorridor) {
  const auto lines = [](double gap, double offset) {
    Drawing drawing(24.0, 8.0);
    drawing.Room(1.0, 1.0, 6.0, 4.0);
    drawing.Room(6.0 + gap, 1.0 + offset, 22.0, 4.0);
    int along_it = 0;
    for (const WallLine& line : FindWallLines({}, {0.0}, drawing.space())) {
      along_it += std::abs(line.along[0]) > 0.9 &&
                  std::abs(line.Across({12.0, 1.0})) < 0.2;
    }
    return along_it;
  };
  EXPECT_EQ(lines(3.0, 0.0), 1);
  EXPECT_EQ(lines(6.0, 0.0), 1);
  EXPECT_EQ(lines(9.0, 0.0), 2);
  // Not on one line.
  EXPECT_EQ(lines(3.0, 0.1), 1);
  EXPECT_EQ(lines(6.0, 0.1), 2);
}

// Four rooms at a corridor, two on either side, with walls between them in
// one line. In one of the upper rooms cupboards stand before that wall, in a
// longer row than what is seen of the wall: the rest of it is open.
TEST(BuildingPlanTest, AWallGoesOnBeyondWhatStandsBeforeIt) {
  Drawing drawing(15.0, 15.0);
  drawing.Room(1.0, 6.0, 13.0, 8.0);
  drawing.Room(1.0, 1.0, 6.0, 5.8).Room(6.2, 1.0, 13.0, 5.8);
  drawing.Room(1.0, 8.2, 6.0, 13.0).Room(6.2, 8.2, 13.0, 13.0);
  for (const double x : {3.0, 9.0}) {
    drawing.Free(x, 5.7, x + 0.9, 6.1).Free(x, 7.9, x + 0.9, 8.3);
  }
  drawing.Free(5.9, 11.0, 6.3, 13.0);
  drawing.Fill(6.05, 8.2, 6.65, 11.0, Space::kUnknown);
  drawing.Fill(6.65, 8.2, 6.7, 11.2, Space::kOccupied);
  drawing.Fill(6.05, 10.95, 6.7, 11.0, Space::kOccupied);
  const BuildingPlan plan = PlanOf(drawing);
  ASSERT_EQ(plan.rooms.size(), 5u);
  for (const PlanRoom& room : plan.rooms) {
    if (room.outline.Contains({3.0, 12.0})) {
      EXPECT_NEAR(room.area, 5.0 * 4.8, 0.8);
    }
    if (room.outline.Contains({10.0, 12.0})) {
      // The other face of the wall was not seen.
      EXPECT_NEAR(room.area, 6.95 * 4.8, 1.2);
    }
  }
}

TEST(BuildingPlanTest, APassageThroughAVeryThickWallIsOneDoor) {
  Drawing drawing(18.0, 9.0);
  drawing.Room(1.0, 1.0, 7.0, 7.0).Room(8.3, 1.0, 14.0, 7.0);
  drawing.Fill(6.95, 2.0, 8.35, 3.0, Space::kOccupied);
  drawing.Free(6.95, 2.05, 8.35, 2.95);
  const BuildingPlan plan =
      PlanOf(drawing, {Pose2(4.0, 2.5, 0.0), Pose2(10.0, 2.5, 0.0)});
  ASSERT_EQ(plan.rooms.size(), 2u);
  ASSERT_EQ(plan.doors.size(), 1u);
  const PlanDoor& door = plan.doors[0];
  EXPECT_NEAR(door.begin[0], 7.65, 0.1);
  EXPECT_NEAR(door.end[0], 7.65, 0.1);
  EXPECT_NEAR(door.width(), 0.9, 0.11);
  EXPECT_NEAR(door.thickness, 1.3, 0.15);
  EXPECT_TRUE(door.is_driven);
  // Left and right of begin to end.
  const bool is_upwards = door.end[1] > door.begin[1];
  ASSERT_GE(std::min(door.rooms[0], door.rooms[1]), 0);
  const PlanRoom& left = plan.rooms[static_cast<std::size_t>(door.rooms[0])];
  EXPECT_EQ(left.outline.Contains({4.0, 4.0}), is_upwards);
  EXPECT_EQ(plan.rooms[0].neighbors.size(), 1u);
}

// A bed of 3 by 3 m stands at a wall; `gap` m between it and the next wall.
BuildingPlan RoomWithABed(double gap) {
  Drawing drawing(12.0, 12.0);
  drawing.Room(1.0, 1.0, 9.0, 6.0 + gap);
  drawing.Fill(6.0, 3.0, 9.2, 6.2 + gap, Space::kUnknown);
  drawing.Fill(6.0, 3.0, 9.0, 3.05, Space::kOccupied);
  drawing.Fill(6.0, 3.0, 6.05, 6.0, Space::kOccupied);
  drawing.Fill(6.0, 6.0, 7.6, 6.05, Space::kOccupied);
  drawing.Free(6.0, 6.05, 7.6, 6.0 + gap);
  drawing.Fill(6.0, 6.0 + gap, 7.6, 6.05 + gap, Space::kOccupied);
  return PlanOf(drawing);
}

TEST(BuildingPlanTest, AGapBesideABedIsNoDoor) {
  const BuildingPlan plan = RoomWithABed(1.0);
  EXPECT_EQ(plan.rooms.size(), 1u);
  EXPECT_TRUE(plan.doors.empty());
}

// The bed of the next room stands in one row with the first, behind the wall
// between the two.
TEST(BuildingPlanTest, AGapBesideABedIsNoDoorThoughTheRowGoesOn) {
  Drawing drawing(12.0, 18.0);
  for (const double low : {1.0, 7.25}) {
    drawing.Room(1.0, low, 9.0, low + 6.0);
    drawing.Fill(6.0, low + 2.0, 9.2, low + 6.1, Space::kUnknown);
    drawing.Fill(6.0, low + 2.0, 9.0, low + 2.05, Space::kOccupied);
    drawing.Fill(6.0, low + 2.0, 6.05, low + 5.0, Space::kOccupied);
    drawing.Fill(6.0, low + 5.0, 7.6, low + 5.05, Space::kOccupied);
    drawing.Free(6.0, low + 5.05, 7.6, low + 6.0);
    drawing.Fill(1.0, low + 6.0, 7.6, low + 6.25, Space::kOccupied);
  }
  const BuildingPlan plan = PlanOf(drawing);
  EXPECT_EQ(plan.rooms.size(), 2u);
  EXPECT_TRUE(plan.doors.empty());
}

// Six rooms of 3.4 by 5.2 m along a corridor, seen from their doors. A bed of
// 1 by 2 m in each hides what lies behind it; `wedge` m of the wall behind
// were seen past its end, and so much of what lies beside it.
BuildingPlan RoomsWithBeds(double wedge, double beside) {
  Drawing drawing(26.0, 12.0);
  drawing.Room(1.0, 1.0, 22.9, 3.0);
  for (int i = 0; i < 6; ++i) {
    const double x = 1.2 + 3.6 * i;
    drawing.Room(x, 3.2, x + 3.4, 8.4);
    drawing.Fill(x + 1.3, 4.9, x + 3.45, 8.5, Space::kUnknown);
    drawing.Fill(x + 2.3, 4.9, x + 3.45, 4.9 + beside, Space::kOccupied);
    drawing.Free(x + 2.3, 4.9, x + 3.4, 4.9 + beside);
    drawing.Fill(x + 1.3, 4.9, x + 2.3, 4.95, Space::kOccupied);
    drawing.Fill(x + 1.3, 4.9, x + 1.35, 6.9, Space::kOccupied);
    drawing.Free(x + 1.3, 7.1, x + 1.3 + wedge, 8.4);
    drawing.Fill(x + 1.3, 8.4, x + 1.3 + wedge, 8.45, Space::kOccupied);
    drawing.Free(x + 0.3, 2.9, x + 1.2, 3.3);
  }
  return PlanOf(drawing);
}

TEST(BuildingPlanTest, WhatABedHidesOfARoomBelongsToIt) {
  const BuildingPlan plan = RoomsWithBeds(0.6, 0.4);
  ASSERT_EQ(plan.rooms.size(), 7u);
  EXPECT_EQ(plan.rooms[0].kind, PlanRoom::Kind::kCorridor);
  // Those with a neighbor on both sides.
  for (std::size_t i = 1; i < 5; ++i) {
    EXPECT_NEAR(plan.rooms[i].area, 3.5 * 5.3, 1.0);
    EXPECT_EQ(plan.rooms[i].kind, PlanRoom::Kind::kRoom);
  }
}

// Four cars of 1.8 by 4.8 m are parked at a wall of a hall, 0.8 m apart.
TEST(BuildingPlanTest, GapsBetweenParkedCarsAreNoRooms) {
  Drawing drawing(28.0, 20.0);
  drawing.Room(1.0, 1.0, 25.0, 17.0);
  for (int i = 0; i < 4; ++i) {
    const double x = 4.0 + 2.6 * i;
    drawing.Fill(x, 1.0, x + 1.8, 5.8, Space::kOccupied);
    drawing.Fill(x + 0.05, 0.9, x + 1.75, 5.75, Space::kUnknown);
  }
  const std::vector<Pose2> path = {Pose2(3.0, 10.0, 0.0),
                                   Pose2(20.0, 10.0, 0.0)};
  const BuildingPlan plan = PlanOf(drawing, path);
  EXPECT_EQ(plan.rooms.size(), 1u);
  EXPECT_TRUE(plan.doors.empty());
}

TEST(BuildingPlanTest, RowsOfRacksDoNotDivideAHall) {
  Drawing drawing(32.0, 18.0);
  drawing.Room(1.0, 1.0, 30.0, 16.0);
  for (const double low : {3.4, 6.8, 10.2, 13.4}) {
    drawing.Fill(5.0, low, 26.0, low + 1.0, Space::kOccupied);
    drawing.Fill(5.05, low + 0.05, 25.95, low + 0.95, Space::kUnknown);
  }
  EXPECT_EQ(PlanOf(drawing).rooms.size(), 1u);
}

// Two screens of 2.8 m across a room, with gaps of `gap` between and beside
// them.
std::size_t RoomsWithScreens(double gap) {
  Drawing drawing(16.0, 12.0);
  drawing.Room(1.0, 1.0, 6.6 + 3.0 * gap, 10.0);
  for (const double begin : {1.0 + gap, 3.8 + 2.0 * gap}) {
    drawing.Fill(begin, 5.5, begin + 2.8, 5.55, Space::kOccupied);
  }
  return PlanOf(drawing).rooms.size();
}

TEST(BuildingPlanTest, WhatStandsFreeDividesNoRoom) {
  EXPECT_EQ(RoomsWithScreens(1.6), 1u);
  // The wall between two doors stands free as well.
  EXPECT_EQ(RoomsWithScreens(0.9), 2u);
}

// A piece of 3.7 m across a room with a gap of 1.6 m on both sides; on one of
// them `stub` m of wall end.
TEST(BuildingPlanTest, AWallThatEndsBesideWhatStandsFreeIsAWall) {
  const auto rooms = [](double stub) {
    Drawing drawing(16.0, 12.0);
    drawing.Room(1.0, 1.0, 7.9 + stub, 10.0);
    drawing.Fill(1.0, 5.5, 1.0 + stub, 5.55, Space::kOccupied);
    drawing.Fill(2.6 + stub, 5.5, 6.3 + stub, 5.55, Space::kOccupied);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(0.0), 1u);
  EXPECT_EQ(rooms(0.35), 2u);
}

TEST(BuildingPlanTest, TheFrontBetweenADoorAndAGlazedStretchIsAWall) {
  const auto rooms = [](double wall) {
    Drawing drawing(16.0, 12.0);
    drawing.Room(1.0, 1.0, 3.4 + wall, 10.0);
    drawing.Fill(1.9, 5.5, 1.9 + wall, 5.55, Space::kOccupied);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(4.6), 2u);
  // A screen leaves as much open.
  EXPECT_EQ(rooms(2.0), 1u);
}

TEST(BuildingPlanTest, AnOpenFrontInALongWallKeepsAnOfficeApart) {
  const auto plan = [](double begin) {
    Drawing drawing(16.0, 14.0);
    drawing.Room(1.0, begin, 9.0, 12.0).Room(9.2, 6.2, 14.0, 12.0);
    drawing.Free(8.9, 8.9, 9.3, 11.8);
    return PlanOf(drawing);
  };
  const BuildingPlan office = plan(1.0);
  ASSERT_EQ(office.rooms.size(), 2u);
  EXPECT_EQ(office.rooms[0].neighbors, std::vector<int>{1});
  EXPECT_EQ(plan(6.2).rooms.size(), 1u);
}

// Screens that stand free in line between two walls leave one way around all
// of their ends, and no doors; columns as well.
TEST(BuildingPlanTest, ScreensAndColumnsDivideNoRoom) {
  const auto rooms = [](const std::vector<double>& walls) {
    Drawing drawing = TwoRooms();
    for (std::size_t i = 0; i < walls.size(); i += 2) {
      drawing.Fill(9.5, walls[i], 9.6, walls[i + 1], Space::kOccupied);
    }
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms({3.2, 3.9, 4.6, 5.4, 6.0, 6.6, 7.3, 8.0}), 3u);
  EXPECT_EQ(rooms({3.2, 4.0, 5.0, 5.5, 6.5, 8.0}), 3u);
  // Two pieces of wall with one door between them do.
  EXPECT_EQ(rooms({3.2, 4.0, 4.9, 8.0}), 4u);
}

TEST(BuildingPlanTest, WallBetweenTwoDoorsKeepsRoomsApart) {
  // Two doors of one room.
  Drawing two = TwoRooms();
  two.Free(10.2, 2.9, 11.1, 3.3);
  EXPECT_EQ(PlanOf(two).rooms.size(), 3u);
  EXPECT_EQ(PlanOf(two).doors.size(), 3u);
  // A wall ends between the doors of two rooms.
  Drawing next = TwoRooms();
  next.Free(4.9, 2.9, 5.8, 3.3).Free(6.4, 2.9, 7.3, 3.3);
  EXPECT_EQ(PlanOf(next).rooms.size(), 3u);
  EXPECT_EQ(PlanOf(next).doors.size(), 4u);
}

// The space between the jambs of a thick wall belongs to one side: the other
// must not take its door for the end of a corridor.
TEST(BuildingPlanTest, DoorsInThickWallsKeepRoomsApart) {
  for (const double thickness : {0.1, 0.3, 0.4, 0.5}) {
    Drawing drawing(14.0, 12.0);
    const double y = 3.0 + thickness;
    drawing.Room(1.0, 1.0, 13.0, 3.0);
    drawing.Room(1.0, y, 6.0, 8.0).Room(6.2, y, 13.0, 8.0);
    drawing.Free(2.0, 2.9, 2.9, y + 0.1).Free(8.0, 2.9, 8.9, y + 0.1);
    EXPECT_EQ(PlanOf(drawing).rooms.size(), 3u) << thickness;
  }
}

// Behind a gap between cupboards is the wall, half a metre away: no door.
TEST(BuildingPlanTest, GapsBetweenCupboardsAreNoDoors) {
  const auto doors = [](double depth) {
    Drawing drawing(10.0, 12.0);
    drawing.Room(1.0, 1.0, 8.0, 7.0);
    drawing.Fill(1.0, 7.0 - depth, 8.0, 7.05, Space::kUnknown);
    drawing.Fill(1.0, 6.95 - depth, 8.0, 7.0 - depth, Space::kOccupied);
    drawing.Free(4.0, 6.9 - depth, 4.8, 7.0)
        .Fill(4.0, 7.0, 4.8, 7.05, Space::kOccupied);
    return PlanOf(drawing).doors.size();
  };
  EXPECT_EQ(doors(0.5), 0u);
  EXPECT_EQ(doors(2.0), 1u);
}

// Two rooms of which each was seen through its own door: little is seen of
// the wall between them, but nobody looked through it.
TEST(BuildingPlanTest, AShortPieceOfAnUnseenWallKeepsRoomsApart) {
  const auto rooms = [](bool is_seen_through) {
    Drawing drawing(14.0, 10.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 8.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3).Free(10.0, 2.9, 10.9, 3.3);
    drawing.Fill(6.0, 3.2, 7.0, 8.0,
                 is_seen_through ? Space::kFree : Space::kUnknown);
    drawing.Fill(6.0, 4.0, 6.05, 5.5, Space::kOccupied);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(false), 3u);
  EXPECT_EQ(rooms(true), 2u);
}

// The same where most of the wall is hidden behind shelves.
TEST(BuildingPlanTest, WhatWasSeenFromTwoDoorsIsTwoRooms) {
  const auto rooms = [](bool is_seen_through) {
    Drawing drawing(14.0, 18.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 16.2);
    drawing.Free(2.0, 2.9, 2.9, 3.3).Free(10.0, 2.9, 10.9, 3.3);
    drawing.Fill(6.0, 3.2, 7.0, 16.2, Space::kUnknown);
    drawing.Fill(6.0, 8.5, 6.05, 10.6, Space::kOccupied);
    if (is_seen_through) drawing.Free(6.0, 10.6, 7.0, 16.2);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(false), 3u);
  EXPECT_EQ(rooms(true), 2u);
}

// Rooms of which each was seen through its own door, and nothing at all of
// the walls between them.
TEST(BuildingPlanTest, WallsWithoutATraceKeepRoomsApart) {
  const auto plan = [](bool is_seen_through) {
    Drawing drawing(20.0, 10.0);
    drawing.Room(1.0, 1.0, 19.0, 3.0).Room(1.0, 3.2, 19.0, 8.0);
    for (const double x : {2.0, 9.0, 16.0}) {
      drawing.Free(x, 2.9, x + 0.9, 3.3);
    }
    for (const double x : {6.0, 12.5}) {
      drawing.Fill(x, 3.2, x + 0.4, 8.05, Space::kUnknown);
      if (is_seen_through) drawing.Free(x, 5.0, x + 0.4, 6.0);
    }
    return PlanOf(drawing);
  };
  const BuildingPlan apart = plan(false);
  ASSERT_EQ(apart.rooms.size(), 4u);
  // The walls stand in the middle of what was not seen.
  std::vector<double> areas;
  for (const PlanRoom& room : apart.rooms) areas.push_back(room.area);
  std::sort(areas.begin(), areas.end());
  EXPECT_NEAR(areas[0], 5.2 * 4.8, 1.0);
  EXPECT_NEAR(areas[1], 6.3 * 4.8, 1.0);
  EXPECT_NEAR(areas[2], 6.5 * 4.8, 1.0);
  EXPECT_EQ(apart.doors.size(), 3u);
  EXPECT_EQ(plan(true).rooms.size(), 2u);
}

// A face that was seen at grazing angles: every third cell of it was hit, and
// nothing was seen behind the others, or it was seen through them.
TEST(BuildingPlanTest, KnownFacesMayHaveGapsThatNobodyLookedThrough) {
  const auto rooms = [](bool is_seen_through) {
    Drawing drawing(14.0, 10.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 8.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3).Free(10.0, 2.9, 10.9, 3.3);
    for (int i = 0; i < 78; ++i) {
      const double y = 4.1 + 0.05 * i;
      drawing.Fill(6.0, y, 6.05, y + 0.05,
                   i % 3 == 0        ? Space::kOccupied
                   : is_seen_through ? Space::kFree
                                     : Space::kUnknown);
    }
    KnownWall face;
    face.begin = {6.025, 4.1};
    face.end = {6.025, 8.0};
    return MakeBuildingPlan({face}, {0.0}, drawing.space(), {}).rooms.size();
  };
  EXPECT_EQ(rooms(false), 3u);
  EXPECT_EQ(rooms(true), 2u);
}

// A partition of 1.7 m with a door of 0.9 m, from wall to wall; a cupboard of
// the same length that stands alone.
TEST(BuildingPlanTest, AShortPartitionWithADoorKeepsRoomsApart) {
  const auto rooms = [](double width) {
    Drawing drawing(14.0, 12.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 1.0 + width, 10.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3);
    drawing.Fill(1.0, 6.0, 2.7, 6.05, Space::kOccupied);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(2.6), 3u);
  EXPECT_EQ(rooms(5.0), 2u);
}

// A short wall and a cupboard beside it reach half way through a room: two
// rooms when each half has a door to the corridor, one when there is one
// door.
TEST(BuildingPlanTest, APartitionBetweenTwoDoorsKeepsRoomsApart) {
  const auto rooms = [](bool has_two_doors) {
    Drawing drawing(14.0, 12.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 8.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3);
    if (has_two_doors) drawing.Free(10.0, 2.9, 10.9, 3.3);
    drawing.Fill(6.95, 4.9, 7.05, 6.9, Space::kOccupied);
    drawing.Fill(6.5, 6.9, 7.5, 7.9, Space::kOccupied);
    drawing.Fill(6.55, 6.95, 7.45, 7.85, Space::kUnknown);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(true), 3u);
  EXPECT_EQ(rooms(false), 2u);
}

// Cupboards and screens across a room with three gaps: a part of the room
// that they hide, unless it has a door to the corridor of its own. Two doors
// in a long wall are doors.
TEST(BuildingPlanTest, CupboardsAcrossARoomDoNotDivideIt) {
  const auto rooms = [](const std::vector<double>& gaps, bool has_own_door) {
    Drawing drawing(14.0, 12.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 10.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3);
    if (has_own_door) drawing.Free(11.0, 2.9, 11.9, 3.3);
    drawing.Fill(8.0, 3.2, 8.05, 10.0, Space::kOccupied);
    for (const double gap : gaps) drawing.Free(8.0, gap, 8.05, gap + 0.7);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms({4.2, 6.6, 9.0}, false), 2u);
  EXPECT_EQ(rooms({4.2, 6.6, 9.0}, true), 3u);
  EXPECT_EQ(rooms({4.2, 9.0}, false), 3u);
}

// The part that they hide leads to a space of its own.
TEST(BuildingPlanTest, APartOfARoomMayHaveAWayOutElsewhere) {
  Drawing drawing(18.0, 12.0);
  drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 10.0);
  drawing.Room(13.2, 1.0, 16.0, 10.0);
  drawing.Free(2.0, 2.9, 2.9, 3.3).Free(12.9, 6.0, 13.3, 6.9);
  drawing.Fill(8.0, 3.2, 8.05, 10.0, Space::kOccupied);
  for (const double gap : {4.2, 6.6, 9.0}) {
    drawing.Free(8.0, gap, 8.05, gap + 0.7);
  }
  EXPECT_EQ(PlanOf(drawing).rooms.size(), 3u);
}

// One front of the middle piece is in line with the first piece, its other
// one with the last: two lines with a gap each.
TEST(BuildingPlanTest, CupboardsOnTwoLinesAreOneRow) {
  Drawing drawing(14.0, 12.0);
  drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 10.0);
  drawing.Free(2.0, 2.9, 2.9, 3.3);
  drawing.Fill(8.0, 3.2, 8.05, 5.4, Space::kOccupied);
  drawing.Fill(8.0, 6.2, 8.3, 7.4, Space::kOccupied);
  drawing.Fill(8.05, 6.25, 8.25, 7.35, Space::kUnknown);
  drawing.Fill(8.25, 8.2, 8.3, 10.0, Space::kOccupied);
  EXPECT_EQ(PlanOf(drawing).rooms.size(), 2u);
}

// The same, and an opening to the corridor of which something hides a part:
// only what was seen of it is a way out.
TEST(BuildingPlanTest, AWayOutIsWhatWasSeenOfAnOpening) {
  const auto rooms = [](double hidden) {
    Drawing drawing(14.0, 12.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 10.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3).Free(11.0, 2.9, 12.0, 3.3);
    drawing.Fill(11.0, 2.9, 11.0 + hidden, 3.3, Space::kUnknown);
    drawing.Fill(8.0, 3.2, 8.05, 10.0, Space::kOccupied);
    for (const double gap : {4.2, 6.6, 9.0}) {
      drawing.Free(8.0, gap, 8.05, gap + 0.7);
    }
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(0.0), 3u);
  EXPECT_EQ(rooms(0.4), 2u);
}

// Cupboards across a room with three gaps, and an opening to the corridor
// that the leaf of its door hides all but 0.6 m of: a crack, unless the robot
// drove through it.
TEST(BuildingPlanTest, WhatTheRobotDroveThroughIsAWayOut) {
  Drawing drawing(14.0, 12.0);
  drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 10.0);
  drawing.Free(2.0, 2.9, 2.9, 3.3).Free(11.0, 2.9, 11.6, 3.3);
  drawing.Fill(8.0, 3.2, 8.05, 10.0, Space::kOccupied);
  for (const double gap : {4.2, 6.6, 9.0}) {
    drawing.Free(8.0, gap, 8.05, gap + 0.7);
  }
  EXPECT_EQ(PlanOf(drawing).rooms.size(), 2u);
  std::vector<Pose2> path;
  for (double y = 2.0; y < 6.0; y += 0.1) path.emplace_back(11.3, y, 1.57);
  EXPECT_EQ(PlanOf(drawing, path).rooms.size(), 3u);
}

// A partition of 1.9 m begins where something before the outer wall hides 1 m
// of that; where 2 m of it are hidden nobody knows that it is met.
TEST(BuildingPlanTest, APartitionMeetsAWallThatIsHiddenThere) {
  const auto rooms = [](double hidden) {
    Drawing drawing(14.0, 12.0);
    drawing.Room(1.0, 1.0, 13.0, 3.0).Room(1.0, 3.2, 13.0, 8.0);
    drawing.Free(2.0, 2.9, 2.9, 3.3).Free(10.0, 2.9, 10.9, 3.3);
    drawing.Fill(7.0, 4.6, 7.05, 6.5, Space::kOccupied);
    drawing.Fill(7.0 - 0.5 * hidden, 6.5, 7.0 + 0.5 * hidden, 8.05,
                 Space::kUnknown);
    return PlanOf(drawing).rooms.size();
  };
  EXPECT_EQ(rooms(1.0), 3u);
  EXPECT_EQ(rooms(2.6), 2u);
}

// A room with one wall that is an arc, whose chords are all shorter than a
// wall must be.
TEST(BuildingPlanTest, ChordsOfAnArcCloseARoom) {
  const auto arc = [](double y) {
    return -2.0 + std::sqrt(36.0 - (y - 5.0) * (y - 5.0));
  };
  Drawing drawing(12.0, 10.0);
  drawing.Room(1.0, 1.0, 9.0, 9.0);
  double area = 0.0;
  for (double y = 0.95; y < 9.0; y += 0.05) {
    const double x = arc(y + 0.025);
    drawing.Fill(0.9, y, x - 0.05, y + 0.05, Space::kUnknown);
    drawing.Fill(x - 0.05, y, x + 0.05, y + 0.05, Space::kOccupied);
    area += 0.05 * (9.0 - x);
  }
  std::vector<KnownWall> chords;
  for (double y = 1.0; y < 8.5; y += 1.0) {
    KnownWall chord;
    chord.begin = {arc(y), y};
    chord.end = {arc(y + 1.0), y + 1.0};
    chords.push_back(chord);
  }
  const BuildingPlan plan =
      MakeBuildingPlan(chords, {0.0}, drawing.space(), {});
  ASSERT_EQ(plan.rooms.size(), 1u);
  EXPECT_NEAR(plan.rooms[0].area, area, 2.0);
  for (const Vector2d& corner : plan.rooms[0].outline.shell) {
    EXPECT_GT(corner[0], arc(corner[1]) - 0.3);
  }
}

// A corridor of 2 m in which a cupboard stands, 0.4 m deep, in line with the
// wall of a room beside it.
TEST(BuildingPlanTest, CupboardsDoNotDivideACorridor) {
  Drawing drawing(20.0, 12.0);
  drawing.Room(1.0, 1.0, 19.0, 3.0);
  drawing.Room(1.0, 3.2, 9.8, 8.0).Room(10.0, 3.2, 19.0, 8.0);
  drawing.Free(2.0, 2.9, 2.9, 3.3).Free(10.3, 2.9, 11.2, 3.3);
  drawing.Fill(9.9, 1.0, 10.6, 1.4, Space::kOccupied);
  const BuildingPlan plan = PlanOf(drawing);
  EXPECT_EQ(plan.rooms.size(), 3u);
  EXPECT_EQ(plan.doors.size(), 2u);
}

// Doors in the corridor's wall make it no less straight.
TEST(BuildingPlanTest, CupboardsBesideDoorsDoNotDivideACorridor) {
  Drawing drawing(20.0, 12.0);
  drawing.Room(1.0, 1.0, 19.0, 3.0);
  drawing.Room(1.0, 3.2, 9.8, 8.0).Room(10.0, 3.2, 19.0, 8.0);
  drawing.Free(7.1, 2.9, 8.0, 3.3).Free(8.6, 2.9, 9.5, 3.3);
  drawing.Free(10.3, 2.9, 11.2, 3.3).Free(11.9, 2.9, 12.8, 3.3);
  drawing.Fill(9.9, 1.0, 10.6, 1.4, Space::kOccupied);
  const BuildingPlan plan = PlanOf(drawing);
  EXPECT_EQ(plan.rooms.size(), 3u);
  EXPECT_EQ(plan.doors.size(), 4u);
}

// The end of a room at the side of a corridor: open for 2 of its 2.8 m.
TEST(BuildingPlanTest, ARoomWithAWideDoorIsNoPartOfTheCorridor) {
  Drawing drawing(20.0, 12.0);
  drawing.Room(1.0, 1.0, 19.0, 3.0);
  drawing.Room(1.0, 3.2, 16.0, 8.0).Room(16.2, 3.2, 19.0, 8.0);
  drawing.Free(2.0, 2.9, 2.9, 3.3).Free(17.0, 2.9, 19.0, 3.3);
  const BuildingPlan plan = PlanOf(drawing);
  ASSERT_EQ(plan.rooms.size(), 3u);
  EXPECT_EQ(plan.doors.size(), 2u);
}

TEST(BuildingPlanTest, OneRoomAndOneCorridor) {
  const BuildingPlan room = PlanOf(Drawing(8.0, 8.0).Room(1, 1, 6, 5));
  ASSERT_EQ(room.rooms.size(), 1u);
  EXPECT_NEAR(room.rooms[0].area, 20.0, 0.7);
  EXPECT_EQ(room.rooms[0].kind, PlanRoom::Kind::kRoom);
  EXPECT_TRUE(room.doors.empty());
  const BuildingPlan corridor = PlanOf(Drawing(32.0, 5.0).Room(1, 1, 31, 3));
  ASSERT_EQ(corridor.rooms.size(), 1u);
  EXPECT_EQ(corridor.rooms[0].kind, PlanRoom::Kind::kCorridor);
}

// A closet of 1 by 4.5 m with its door in its short side.
TEST(BuildingPlanTest, ASmallStripThatLeadsNowhereIsNoCorridor) {
  Drawing drawing(26.0, 12.0);
  drawing.Room(1.0, 1.0, 20.0, 3.0).Room(8.0, 3.2, 9.0, 7.7);
  drawing.Free(8.1, 2.9, 8.9, 3.3);
  const BuildingPlan plan = PlanOf(drawing);
  ASSERT_EQ(plan.rooms.size(), 2u);
  EXPECT_EQ(plan.rooms[0].kind, PlanRoom::Kind::kCorridor);
  EXPECT_EQ(plan.rooms[1].kind, PlanRoom::Kind::kRoom);
}

// A hall of 24 by 20 m whose corner is out of the laser's sight, 5 m along
// both walls.
TEST(BuildingPlanTest, WallsOfAHallMeetOutOfSight) {
  Drawing drawing(28.0, 24.0);
  drawing.Room(1.0, 1.0, 25.0, 21.0);
  drawing.Fill(20.0, 0.9, 25.1, 6.0, Space::kUnknown);
  const std::vector<Pose2> path = {Pose2(5.0, 10.0, 0.0),
                                   Pose2(18.0, 15.0, 0.0)};
  const BuildingPlan plan = PlanOf(drawing, path);
  ASSERT_EQ(plan.rooms.size(), 1u);
  EXPECT_NEAR(plan.rooms[0].area, 24.0 * 20.0, 4.0);
  EXPECT_TRUE(plan.rooms[0].is_entered);
}

TEST(BuildingPlanTest, NoWallsNoRooms) {
  EXPECT_TRUE(PlanOf(Drawing(20.0, 20.0).Free(1, 1, 19, 19)).rooms.empty());
  EXPECT_TRUE(PlanOf(Drawing(20.0, 20.0)).rooms.empty());
  EXPECT_TRUE(MakeBuildingPlan({}, {}, SpaceGrid(), {}).rooms.empty());
  // A lone wall in the open, and trees.
  Drawing open(20.0, 20.0);
  open.Free(1, 1, 19, 19).Fill(3, 10, 9, 10.1, Space::kOccupied);
  for (double x = 4.0; x < 18.0; x += 3.0) {
    open.Fill(x, 15.0, x + 0.3, 15.3, Space::kOccupied);
  }
  EXPECT_TRUE(PlanOf(open).rooms.empty());
}

// A wall in the open and a car beside it have no room between them.
TEST(BuildingPlanTest, AWallAndACarAreNoRoom) {
  Drawing open(30.0, 20.0);
  open.Free(1, 1, 29, 19).Fill(3, 4, 20, 4.3, Space::kOccupied);
  open.Fill(9, 9, 13.2, 9.1, Space::kOccupied);
  open.Fill(9, 9, 9.1, 10.8, Space::kOccupied);
  open.Fill(13.1, 9, 13.2, 10.8, Space::kOccupied);
  EXPECT_TRUE(PlanOf(open).rooms.empty());
}

// A wall that ends in the middle of a room divides nothing, but is drawn; the
// front of a cupboard is not.
TEST(BuildingPlanTest, WallsThatEndWithinARoomAreDrawn) {
  Drawing drawing = TwoRooms();
  drawing.Fill(9.45, 3.2, 9.55, 5.4, Space::kOccupied);
  drawing.Fill(12.4, 4.4, 12.45, 7.0, Space::kOccupied);
  drawing.Fill(12.45, 4.4, 13.05, 7.0, Space::kUnknown);
  const BuildingPlan plan = PlanOf(drawing);
  EXPECT_EQ(plan.rooms.size(), 3u);
  EXPECT_TRUE(IsWallAt(plan, {9.5, 4.3}));
  EXPECT_FALSE(IsWallAt(plan, {12.42, 5.5}));
}

// A wall that bounds no room is drawn, alone from 4 m on and where it meets
// another one from 2 m on, but not on a wall of a room, nor what has no floor
// before it.
TEST(BuildingPlanTest, WallsBeyondTheRoomsAreDrawn) {
  Drawing drawing(30.0, 20.0);
  drawing.Free(14, 1, 29, 19);
  drawing.Room(1.0, 1.0, 13.0, 9.0);
  // A wing wall of the building, one across it, one alone, a short one, and
  // one behind which and before which nothing was seen.
  drawing.Fill(13.05, 8.95, 15.55, 9.05, Space::kOccupied);
  drawing.Free(13.3, 9.05, 15.55, 12.0);
  drawing.Fill(20, 4, 25, 4.05, Space::kOccupied);
  drawing.Fill(20, 8, 22.7, 8.05, Space::kOccupied);
  drawing.Fill(1, 15, 7, 15.05, Space::kOccupied);
  const BuildingPlan plan = PlanOf(drawing);
  ASSERT_EQ(plan.rooms.size(), 1u);
  EXPECT_TRUE(IsWallAt(plan, {14.5, 9.0}));
  EXPECT_TRUE(IsWallAt(plan, {22.5, 4.03}));
  EXPECT_FALSE(IsWallAt(plan, {21.3, 8.03}));
  EXPECT_FALSE(IsWallAt(plan, {4.0, 15.03}));
  EXPECT_EQ(plan.walls.size(), 6u);
}

// Two houses with an alley between them, open to the street: no room when a
// robot drove along the street, while what a robot in a building sees through
// a door is one.
TEST(BuildingPlanTest, AlleysBetweenHousesAreNoRooms) {
  Drawing street(40.0, 24.0);
  street.Free(1, 1, 39, 11);
  street.Fill(2, 11, 16, 11.05, Space::kOccupied);
  street.Fill(20, 11, 38, 11.05, Space::kOccupied);
  street.Free(16, 11, 20, 19);
  street.Fill(15.95, 11, 16, 19, Space::kOccupied);
  street.Fill(20, 11, 20.05, 19, Space::kOccupied);
  EXPECT_EQ(PlanOf(street).rooms.size(), 1u);
  const BuildingPlan outside =
      PlanOf(street, {Pose2(4.0, 6.0, 0.0), Pose2(36.0, 6.0, 0.0)});
  EXPECT_TRUE(outside.rooms.empty());
  // Their fronts are walls all the same.
  EXPECT_TRUE(IsWallAt(outside, {8.0, 11.02}));
  EXPECT_TRUE(IsWallAt(outside, {30.0, 11.02}));
  EXPECT_EQ(PlanOf(TwoRooms(), {Pose2(2.0, 2.0, 0.0), Pose2(12.0, 2.0, 0.0)})
                .rooms.size(),
            3u);
}

// Three rooms with six sides of 2.7 m around a corner, with a door of 0.9 m
// in each wall between two of them: in line with a wall lies the next room.
TEST(BuildingPlanTest, RoomsWithSixSides) {
  constexpr double kSide = 2.7;
  const double apothem = 0.5 * std::sqrt(3.0) * kSide;
  const Vector2d corner(6.0, 6.0);
  const auto at = [](double degrees) {
    return Vector2d(std::cos(DegToRad(degrees)), std::sin(DegToRad(degrees)));
  };
  std::vector<Vector2d> centers;
  for (const double angle : {90.0, 210.0, 330.0}) {
    centers.push_back(corner + kSide * at(angle));
  }
  // How far a point lies within the nearest room, m.
  const auto inside = [&](const Vector2d& p) {
    double most = -1e9;
    for (const Vector2d& center : centers) {
      double least = 1e9;
      for (int side = 0; side < 6; ++side) {
        least =
            std::min(least, apothem - 0.06 - (p - center).dot(at(60.0 * side)));
      }
      most = std::max(most, least);
    }
    return most;
  };
  const auto is_in_door = [&](const Vector2d& p) {
    for (const double angle : {30.0, 150.0, 270.0}) {
      const Vector2d q = p - corner;
      const double along = q.dot(at(angle));
      const double across = q.dot(at(angle + 90.0));
      if (std::abs(across) < 0.12 && std::abs(along - 0.5 * kSide) < 0.45) {
        return true;
      }
    }
    return false;
  };
  Drawing drawing(12.0, 12.0);
  drawing
      .FillWhere(Space::kOccupied,
                 [&](const Vector2d& p) { return inside(p) >= -0.04; })
      .FillWhere(Space::kFree, [&](const Vector2d& p) {
        return inside(p) > 0.0 || is_in_door(p);
      });
  std::vector<KnownWall> walls;
  for (const Vector2d& center : centers) {
    for (int side = 0; side < 6; ++side) {
      const Vector2d middle = center + (apothem - 0.06) * at(60.0 * side);
      const Vector2d along = at(60.0 * side + 90.0);
      const bool has_door = is_in_door(middle + 0.06 * at(60.0 * side));
      if (!has_door) {
        walls.push_back({middle - 1.25 * along, middle + 1.25 * along});
        continue;
      }
      walls.push_back({middle - 1.25 * along, middle - 0.47 * along});
      walls.push_back({middle + 0.47 * along, middle + 1.25 * along});
    }
  }
  const BuildingPlan plan =
      MakeBuildingPlan(walls, {DegToRad(0.0), DegToRad(60.0), DegToRad(120.0)},
                       drawing.space(), {});
  EXPECT_EQ(plan.rooms.size(), 3u);
  EXPECT_EQ(plan.doors.size(), 3u);
}

}  // namespace
}  // namespace plumbline
