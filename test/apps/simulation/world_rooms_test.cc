#include <gtest/gtest.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/apps/simulation/world_rooms.h>

#include <sstream>
#include <string>

namespace plumbline {
namespace {

World ReadRooms(const std::string& text) {
  std::istringstream input(text);
  return ReadWorld(input, "test.world");
}

// Two rooms of 4 by 3 m within walls of 20 cm, a door of 90 cm between them.
const char kTwoRooms[] =
    "wall -0.2 -0.1 8.4 -0.1 0.2\n"
    "wall -0.2 3.1 8.4 3.1 0.2\n"
    "wall -0.1 -0.2 -0.1 3.2 0.2\n"
    "wall 8.3 -0.2 8.3 3.2 0.2\n"
    "wall 4.1 0 4.1 3 0.2\n"
    "door 4.1 1 0.9\n"
    "circle 6 2 0.2\n"
    "box 2 2 0.5 0.5 0\n"
    "path 1 1 2 1\n";

TEST(WorldRoomsTest, DoorsCloseRooms) {
  World world = ReadRooms(kTwoRooms);
  for (const double degrees : {0.0, 30.0}) {
    RotateWorld(degrees, &world);
    const std::vector<Polygon> rooms = WorldRooms(world);
    ASSERT_EQ(rooms.size(), 2u);
    for (const Polygon& room : rooms) {
      EXPECT_NEAR(room.Area(), 12.0, 0.02);
      EXPECT_EQ(room.shell.size(), 4u);
    }
    const std::vector<TrueDoor> doors = WorldDoors(world);
    ASSERT_EQ(doors.size(), 1u);
    EXPECT_NEAR((doors[0].end - doors[0].begin).norm(), 0.9, 1e-9);
    EXPECT_DOUBLE_EQ(doors[0].thickness, 0.2);
    EXPECT_FALSE(doors[0].is_shut);
  }
}

TEST(WorldRoomsTest, AShutDoor) {
  World world =
      ReadRooms(std::string(kTwoRooms) + "wall 4.1 0.55 4.1 1.45 0.04\n");
  // The leaf is as near to the door's place as the wall, and cut as well.
  EXPECT_FALSE(WorldDoors(world)[0].is_shut);
  world.walls.push_back({{4.1, 0.55}, {4.1, 1.45}, 0.04});
  ASSERT_EQ(WorldDoors(world).size(), 1u);
  EXPECT_TRUE(WorldDoors(world)[0].is_shut);
  EXPECT_EQ(WorldRooms(world).size(), 2u);
}

TEST(WorldRoomsTest, OpeningsCutCorridorsOff) {
  const std::string walls =
      "wall 0 -1 10 -1\nwall 0 1 10 1\nwall 0 -1 0 1\n"
      "wall 10 -5 10 -1\nwall 10 1 10 5\nwall 10 -5 18 -5\n"
      "wall 10 5 18 5\nwall 18 -5 18 5\npath 1 0 14 0\n";
  ASSERT_EQ(WorldRooms(ReadRooms(walls)).size(), 1u);
  const World world = ReadRooms(walls + "opening 10 -1 10 1\n");
  const std::vector<Polygon> rooms = WorldRooms(world);
  ASSERT_EQ(rooms.size(), 2u);
  EXPECT_NEAR(rooms[0].Area(), 80.0, 0.1);
  EXPECT_NEAR(rooms[1].Area(), 20.0, 0.1);
  EXPECT_TRUE(WorldDoors(world).empty());
}

TEST(WorldRoomsTest, SpacesWithoutADoorAreNoRooms) {
  World world = ReadRooms(kTwoRooms);
  world.doors.clear();
  // The door has become a part of one space, which the path is in.
  ASSERT_EQ(WorldRooms(world).size(), 1u);
  EXPECT_NEAR(WorldRooms(world)[0].Area(), 24.0 + 0.9 * 0.2, 0.02);
  world.path.clear();
  EXPECT_TRUE(WorldRooms(world).empty());
}

TEST(WorldRoomsTest, CurvedWallsOpenFieldsAndNoThickness) {
  const World rotunda = ReadRooms("arc 0 0 5 0 360\npath 0 0 1 0\n");
  // A whole circle is a column.
  EXPECT_TRUE(WorldRooms(rotunda).empty());
  const World half =
      ReadRooms("arc 0 0 5 0 180\nwall -5 0 5 0\npath 0 1 1 1\n");
  ASSERT_EQ(WorldRooms(half).size(), 1u);
  EXPECT_NEAR(WorldRooms(half)[0].Area(), 0.5 * 3.14159 * 25.0, 0.2);
  EXPECT_TRUE(WorldRooms(ReadRooms("wall 0 0 5 0\npath 0 1 1 1\n")).empty());
}

TEST(WorldRoomsTest, WrittenWorldsKeepTheirRooms) {
  const World world = MakeWorld("office", 5, 1.0);
  std::stringstream text;
  WriteWorld(world, text);
  const World read = ReadWorld(text, "written.world");
  EXPECT_EQ(read.doors.size(), world.doors.size());
  const std::vector<Polygon> rooms = WorldRooms(world);
  const std::vector<Polygon> again = WorldRooms(read);
  ASSERT_EQ(again.size(), rooms.size());
  for (std::size_t i = 0; i < rooms.size(); ++i) {
    EXPECT_NEAR(again[i].Area(), rooms[i].Area(), 0.01);
  }
  // Corridors, hall and wing, then a room for each door.
  EXPECT_EQ(rooms.size(), WorldDoors(world).size() + 3);
}

}  // namespace
}  // namespace plumbline
