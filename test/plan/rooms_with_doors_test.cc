#include <gtest/gtest.h>
#include <plumbline/plan/rooms_with_doors.h>

#include <vector>

namespace plumbline {
namespace {

// Regions of one face each; line 5 lies between the first two.
class DoorPlan {
 public:
  DoorPlan& Border(int a, int b, int line, Mark mark, double length) {
    ArrangementEdge edge;
    edge.left = a;
    edge.right = b;
    edge.line = line;
    edge.begin = {0.0, 0.0};
    edge.end = {length, 0.0};
    edge.lengths.metres[static_cast<std::size_t>(mark)] = length;
    arrangement_.edges.push_back(edge);
    return *this;
  }
  DoorPlan& Door(int a, int b) { return Border(a, b, 0, Mark::kDoor, 0.9); }
  std::vector<int> Lines() const {
    const std::vector<int> region = {0, 1, 2, 3, 4, 5};
    return LinesBetweenRoomsWithDoors(arrangement_, region, 5, 6);
  }

 private:
  Arrangement arrangement_;
};

TEST(RoomsWithDoorsTest, OfficesAlongACorridorArePartedByALine) {
  EXPECT_EQ(DoorPlan()
                .Border(0, 1, 5, Mark::kWall, 3.0)
                .Door(0, 2)
                .Door(1, 2)
                .Lines(),
            std::vector<int>{5});
  EXPECT_TRUE(DoorPlan()
                  .Border(0, 1, 5, Mark::kWall, 3.0)
                  .Door(0, 2)
                  .Door(1, 3)
                  .Lines()
                  .empty());
}

// What lies between an office and its corridor is not a partition because both
// have a door to the office next to it.
TEST(RoomsWithDoorsTest, ACorridorIsNoOfficeBesideItsOwnOffices) {
  EXPECT_TRUE(DoorPlan()
                  .Border(0, 1, 5, Mark::kWall, 3.0)
                  .Door(0, 2)
                  .Door(1, 2)
                  .Door(0, 1)
                  .Door(0, 3)
                  .Lines()
                  .empty());
}

}  // namespace
}  // namespace plumbline
