#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/plan_evaluation.h>
#include <plumbline/core/error.h>

#include <string>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;

Polygon Box(double x1, double y1, double x2, double y2) {
  Polygon box;
  box.shell = {{x1, y1}, {x2, y1}, {x2, y2}, {x1, y2}};
  return box;
}

PlanWall StraightWall(double x1, double y1, double x2, double y2) {
  PlanWall wall;
  wall.begin = {x1, y1};
  wall.end = {x2, y2};
  wall.left = wall.right = 0.1;
  return wall;
}

TruthWall Face(double x1, double y1, double x2, double y2) {
  TruthWall wall;
  wall.begin = {x1, y1};
  wall.end = {x2, y2};
  wall.orientation = 0;
  wall.seen = {{0.0, (wall.end - wall.begin).norm()}};
  return wall;
}

TEST(RoomEvaluationTest, FoundMissedSplitAndInvented) {
  const std::vector<Polygon> truth = {Box(0, 0, 4, 4), Box(5, 0, 9, 4),
                                      Box(10, 0, 14, 4)};
  // The first one with a strip missing, the second in two pieces, the third
  // not at all, and one where there is nothing.
  const std::vector<Polygon> plan = {Box(0, 0, 4, 3), Box(5, 0, 8, 4),
                                     Box(8, 0, 9, 4), Box(20, 0, 24, 4)};
  const RoomEvaluation rooms = EvaluateRooms(plan, truth, {true, true, true});
  EXPECT_EQ(rooms.asked, 3);
  EXPECT_EQ(rooms.found, 2);
  EXPECT_EQ(rooms.drawn, 4);
  EXPECT_EQ(rooms.not_true, 2);
  ASSERT_EQ(rooms.iou.size(), 3u);
  EXPECT_NEAR(rooms.iou[0], 0.75, 1e-6);
  EXPECT_NEAR(rooms.iou[1], 0.75, 1e-6);
  EXPECT_NEAR(rooms.mean_iou, 0.5, 1e-6);
  EXPECT_NEAR(rooms.precision, 1.0, 1e-6);
  EXPECT_NEAR(rooms.recall, 0.5, 1e-6);
}

TEST(RoomEvaluationTest, TwoRoomsThatAreOneInThePlan) {
  const std::vector<Polygon> truth = {Box(0, 0, 4, 4), Box(4, 0, 8, 4)};
  const RoomEvaluation rooms =
      EvaluateRooms({Box(0, 0, 8, 4)}, truth, {true, true});
  EXPECT_EQ(rooms.drawn, 1);
  EXPECT_NEAR(rooms.mean_iou, 0.5, 1e-6);
  EXPECT_NEAR(rooms.recall, 1.0, 1e-6);
  EXPECT_NEAR(rooms.precision, 0.5, 1e-6);
}

TEST(RoomEvaluationTest, NothingAskedNothingDrawn) {
  const RoomEvaluation rooms = EvaluateRooms({}, {Box(0, 0, 1, 1)}, {false});
  EXPECT_EQ(rooms.asked, 0);
  EXPECT_EQ(rooms.drawn, 0);
  EXPECT_EQ(rooms.mean_iou, 0.0);
}

// A wall of 6 m with a door of 90 cm; the robot drives through it.
MapTruth ADoor() {
  MapTruth truth;
  truth.walls = {Face(0.0, -0.1, 2.0, -0.1), Face(2.9, -0.1, 6.0, -0.1)};
  TrueDoor door;
  door.begin = {2.0, 0.0};
  door.end = {2.9, 0.0};
  door.thickness = 0.2;
  truth.doors = {door};
  for (const double y : {-1.0, 1.0}) {
    TimedPose pose;
    pose.timestamp = 1.0 + y;
    pose.pose = Pose2(2.5, y, 0.0);
    truth.poses.push_back(pose);
  }
  return truth;
}

TEST(PlanEvaluationTest, DoorsAndWalls) {
  const MapTruth truth = ADoor();
  BuildingPlan plan;
  plan.walls = {StraightWall(0.0, 0.0, 2.0, 0.0),
                StraightWall(2.9, 0.0, 6.0, 0.0)};
  PlanDoor door;
  door.begin = {2.0, 0.0};
  door.end = {2.8, 0.0};
  plan.doors = {door};
  PlanEvaluation result = EvaluatePlan(plan, truth, Pose2::Zero());
  EXPECT_EQ(result.doors_asked, 1);
  EXPECT_EQ(result.doors_found, 1);
  EXPECT_EQ(result.doors_false, 0);
  EXPECT_NEAR(result.door_width_error, 0.1, 1e-9);
  EXPECT_DOUBLE_EQ(result.wall_completeness, 1.0);
  // One face of each lies on a true one, the other 20 cm away.
  EXPECT_NEAR(result.wall_correctness, 0.5, 1e-6);
  EXPECT_EQ(result.ends, 4);
  EXPECT_EQ(result.free_ends, 2);
  EXPECT_EQ(result.double_walls, 0);

  // The plan lies elsewhere in its own frame.
  result = EvaluatePlan(plan, truth, Pose2(3.0, 0.0, 0.0));
  EXPECT_EQ(result.doors_found, 0);
  EXPECT_EQ(result.doors_false, 1);
  EXPECT_LT(result.wall_completeness, 0.9);

  plan.walls.push_back(StraightWall(3.0, 0.05, 5.0, 0.05));
  EXPECT_EQ(EvaluatePlan(plan, truth, Pose2::Zero()).double_walls, 1);
}

TEST(PlanEvaluationTest, ADoorCountsOnce) {
  MapTruth truth = ADoor();
  PlanDoor door;
  door.begin = {2.0, 0.0};
  door.end = {2.9, 0.0};
  PlanDoor beside;
  beside.begin = {2.3, 0.0};
  beside.end = {3.2, 0.0};
  BuildingPlan plan;
  plan.doors = {beside, door};
  PlanEvaluation result = EvaluatePlan(plan, truth, Pose2::Zero());
  EXPECT_EQ(result.doors_found, 1);
  EXPECT_EQ(result.doors_drawn, 2);
  EXPECT_EQ(result.doors_false, 1);
  EXPECT_NEAR(result.door_width_error, 0.0, 1e-9);

  // One of the plan between two true ones.
  truth.doors.push_back(truth.doors[0]);
  truth.doors[0].begin = {2.0, 0.0};
  truth.doors[0].end = {2.55, 0.0};
  truth.doors[1].begin = {2.45, 0.0};
  truth.doors[1].end = {3.0, 0.0};
  plan.doors = {door};
  result = EvaluatePlan(plan, truth, Pose2::Zero());
  EXPECT_EQ(result.doors_asked, 2);
  EXPECT_EQ(result.doors_found, 1);
}

BuildingPlan ParsePlan(const std::string& text) {
  InputStream input("plan.geojson", text);
  return ReadBuildingPlan(&input);
}

TEST(ReadBuildingPlanTest, RoomsDoorsWalls) {
  const BuildingPlan plan = ParsePlan(R"({"features":[
    {"properties":{"kind":"room"},"geometry":{"type":"Polygon",
     "coordinates":[[[0,0],[4,0],[4,3],[0,3],[0,0]]]}},
    {"properties":{"kind":"door"},"geometry":{"type":"LineString",
     "coordinates":[[1,0],[2,0]]}},
    {"properties":{"kind":"wall"},"geometry":{"type":"Polygon",
     "coordinates":[[[2,-0.1],[4,-0.1],[4,0.1],[2,0.1],[2,-0.1]]]}},
    {"properties":{"kind":"column"}},
    {"properties":{}}]})");
  ASSERT_EQ(plan.rooms.size(), 1u);
  EXPECT_EQ(plan.rooms[0].outline.shell.size(), 4u);
  EXPECT_DOUBLE_EQ(plan.rooms[0].area, 12.0);
  ASSERT_EQ(plan.doors.size(), 1u);
  EXPECT_DOUBLE_EQ(plan.doors[0].width(), 1.0);
  ASSERT_EQ(plan.walls.size(), 1u);
  EXPECT_DOUBLE_EQ(plan.walls[0].begin[0], 2.0);
  EXPECT_DOUBLE_EQ(plan.walls[0].left, 0.1);
}

TEST(ReadBuildingPlanTest, BrokenPlansAreNamed) {
  const auto error_of = [](const std::string& text) {
    return Refusal([&] { ParsePlan(text); });
  };
  EXPECT_THAT(error_of("{"), HasSubstr("plan.geojson:1: is no valid JSON"));
  EXPECT_THAT(error_of("{}"), HasSubstr("'features' is missing"));
  EXPECT_THAT(error_of(R"({"features":[{"properties":{"kind":"room"},
      "geometry":{"type":"Polygon","coordinates":[[[0,0],[1,"a"],[1,1]]]}}]})"),
              HasSubstr("'features[0].geometry.coordinates[0][1][1]' is no "
                        "number"));
  EXPECT_THAT(error_of(R"({"features":[{"properties":{"kind":"wall"},
      "geometry":{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1]]]}}]})"),
              HasSubstr("expected four corners"));
}

}  // namespace
}  // namespace plumbline
