#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/closure_truth.h>
#include <plumbline/factors/angle.h>

#include <vector>

namespace plumbline {
namespace {

// A wall 0.1 m thick along x with rooms on both sides, cut by a door, and a
// second one 3 m further up. The room is on the right of a face.
MapTruth TwoWalls() {
  MapTruth truth;
  const auto add = [&truth](double x1, double x2, double y) {
    TruthWall wall;
    wall.id = static_cast<int>(truth.walls.size());
    wall.begin = {x1, y};
    wall.end = {x2, y};
    truth.walls.push_back(wall);
  };
  add(5.0, 0.0, 0.1);   // 0: seen from above, piece right of the door at 6
  add(12.0, 6.0, 0.1);  // 1: the same face beyond the door
  add(0.0, 5.0, 0.0);   // 2: its back
  add(5.0, 0.0, 3.1);   // 3: another wall
  return truth;
}

// Seen from above (the room on the left).
MapSegment Segment(std::int64_t id, double x1, double x2, double y) {
  MapSegment segment;
  segment.id = id;
  segment.pose = Pose2(x1, y, x2 > x1 ? 0.0 : kPi);
  segment.end = std::abs(x2 - x1);
  return segment;
}

TEST(ClosureTruthTest, RightAndWrong) {
  StraightMap map;
  map.segments = {Segment(1, 0.0, 4.0, 0.12), Segment(2, 1.0, 5.0, 0.07),
                  Segment(3, 4.5, 0.5, 0.06), Segment(4, 0.0, 5.0, 3.0),
                  Segment(5, 7.0, 11.0, 0.1)};
  map.closures = {{1, 2, true},
                  {2, 5, true},    // in line beyond the door
                  {1, 3, true},    // front and back
                  {1, 4, false},   // wrong and broken
                  {1, 2, false}};  // right, and broken once
  const ClosureEvaluation evaluation =
      EvaluateClosures(map, TwoWalls(), Pose2::Zero());
  EXPECT_EQ(evaluation.right, 2);
  EXPECT_EQ(evaluation.wrong, 1);
  EXPECT_EQ(evaluation.broken_right, 1);
  EXPECT_EQ(evaluation.broken_wrong, 1);
  ASSERT_EQ(evaluation.wrong_pairs.size(), 1u);
  EXPECT_EQ(evaluation.wrong_pairs[0].second, 3);
}

TEST(ClosureTruthTest, ADoorAndItsWallAreNear) {
  MapTruth truth = TwoWalls();
  TruthWall door;
  door.id = 4;
  door.begin = {6.0, 0.04};
  door.end = {5.0, 0.04};  // looks up, 0.06 m behind the wall
  truth.walls.push_back(door);
  StraightMap map;
  map.segments = {Segment(1, 0.0, 4.0, 0.1), Segment(2, 5.0, 6.0, 0.04),
                  Segment(3, 4.0, 0.5, 0.0)};
  map.closures = {{1, 2, true}, {2, 3, true}};
  ClosureEvaluation evaluation = EvaluateClosures(map, truth, Pose2::Zero());
  EXPECT_EQ(evaluation.right, 0);
  EXPECT_EQ(evaluation.near, 1);
  // The back of the wall is as close, but looks the other way.
  EXPECT_EQ(evaluation.wrong, 1);
  map.closures = {{1, 2, false}};
  evaluation = EvaluateClosures(map, truth, Pose2::Zero());
  EXPECT_EQ(evaluation.broken_right, 1);
  // Deeper than that is another wall.
  truth.walls.back().begin.y() = truth.walls.back().end.y() = -0.05;
  map.segments[1] = Segment(2, 5.0, 6.0, -0.05);
  map.closures = {{1, 2, true}};
  evaluation = EvaluateClosures(map, truth, Pose2::Zero());
  EXPECT_EQ(evaluation.wrong, 1);
}

TEST(ClosureTruthTest, Revisits) {
  StraightMap map;
  map.segments = {Segment(1, 0.0, 4.0, 0.1),  Segment(2, 1.0, 5.0, 0.1),
                  Segment(3, 3.0, 5.0, 0.1),  Segment(4, 0.0, 0.5, 0.1),
                  Segment(5, 7.0, 11.0, 0.1), Segment(6, 0.0, 5.0, 3.1)};
  ClosureEvaluation evaluation =
      EvaluateClosures(map, TwoWalls(), Pose2::Zero());
  // 1, 2 and 3 lie side by side; 4 is too short; 5 is beyond the door.
  EXPECT_EQ(evaluation.revisits, 2);
  EXPECT_EQ(evaluation.closed_revisits, 0);
  map.closures = {{1, 3, true}};
  evaluation = EvaluateClosures(map, TwoWalls(), Pose2::Zero());
  EXPECT_EQ(evaluation.closed_revisits, 1);
  // By way of the short one.
  map.closures = {{1, 3, true}, {1, 4, true}, {2, 4, true}, {2, 3, false}};
  evaluation = EvaluateClosures(map, TwoWalls(), Pose2::Zero());
  EXPECT_EQ(evaluation.revisits, 2);
  EXPECT_EQ(evaluation.closed_revisits, 2);
}

TEST(ClosureTruthTest, TheMapIsMovedOntoTheTruth) {
  StraightMap map;
  map.segments = {Segment(1, 100.0, 104.0, 50.1),
                  Segment(2, 101.0, 105.0, 50.1)};
  map.closures = {{1, 2, true}};
  EXPECT_EQ(EvaluateClosures(map, TwoWalls(), Pose2(-100.0, -50.0, 0.0)).right,
            1);
  // Where nothing is, nothing is right.
  EXPECT_EQ(EvaluateClosures(map, TwoWalls(), Pose2::Zero()).wrong, 1);
}

TEST(ClosureTruthTest, NothingToCompare) {
  const ClosureEvaluation evaluation =
      EvaluateClosures(StraightMap(), MapTruth(), Pose2::Zero());
  EXPECT_EQ(evaluation.right + evaluation.wrong + evaluation.revisits, 0);
}

}  // namespace
}  // namespace plumbline
