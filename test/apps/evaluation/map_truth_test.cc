#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/map_evaluation.h>
#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/core/error.h>

#include <cmath>
#include <string>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

MapTruth ParseTruth(const std::string& text) {
  InputStream input("truth.json", text);
  return ReadMapTruth(&input);
}

StraightMap ParseMap(const std::string& text) {
  InputStream input("map.json", text);
  return ReadStraightMap(&input);
}

TruthWall MakeWall(int id, double x1, double y1, double x2, double y2,
                   int orientation) {
  TruthWall wall;
  wall.id = id;
  wall.begin = {x1, y1};
  wall.end = {x2, y2};
  wall.orientation = orientation;
  wall.seen = {{0.0, std::hypot(x2 - x1, y2 - y1)}};
  return wall;
}

// An L: 10 m along x, 4 m along y, both seen whole.
MapTruth MakeL() {
  MapTruth truth;
  truth.orientations_deg = {0, 90};
  truth.walls = {MakeWall(0, 0, 0, 10, 0, 0), MakeWall(1, 10, 0, 10, 4, 1)};
  return truth;
}

MapSegment MakeSegment(int id, double x, double y, double degrees, double begin,
                       double end) {
  MapSegment segment;
  segment.id = id;
  segment.pose = Pose2(x, y, DegToRad(degrees));
  segment.begin = begin;
  segment.end = end;
  return segment;
}

TEST(MapTruthTest, ReadsTruth) {
  const MapTruth truth = ParseTruth(
      R"({"format":"plumbline-truth","version":1,"orientations_deg":[0,90,30],
          "walls":[{"id":7,"x1":0,"y1":1,"x2":2.5,"y2":1,"orientation":2,
                    "seen":[[0,1],[1.5,2]]},
                   {"id":8,"x1":0,"y1":1,"x2":2,"y2":1,"orientation":-1,
                    "seen":[]}],
          "circles":[],
          "poses":[[12.5,1,2,3]]})");
  EXPECT_THAT(truth.orientations_deg, ElementsAre(0, 90, 30));
  ASSERT_EQ(truth.walls.size(), 2u);
  EXPECT_EQ(truth.walls[0].id, 7);
  EXPECT_EQ(truth.walls[0].end, Eigen::Vector2d(2.5, 1));
  EXPECT_EQ(truth.walls[0].orientation, 2);
  EXPECT_EQ(truth.walls[0].seen[1], std::make_pair(1.5, 2.0));
  EXPECT_EQ(truth.walls[1].orientation, -1);
  ASSERT_EQ(truth.poses.size(), 1u);
  EXPECT_EQ(truth.poses[0].timestamp, 12.5);
  EXPECT_EQ(truth.poses[0].pose, Pose2(1, 2, 3));
}

TEST(MapTruthTest, RefusesBadTruth) {
  const auto refusal = [](const std::string& text) {
    return Refusal([&] { ParseTruth(text); });
  };
  const std::string head =
      R"({"format":"plumbline-truth","version":1,"orientations_deg":[0],)";
  EXPECT_THAT(refusal(""), HasSubstr("truth.json:1: is no valid JSON"));
  EXPECT_THAT(refusal("{\n\"a\": }"),
              HasSubstr("truth.json:2: is no valid JSON"));
  EXPECT_THAT(refusal("{\n\"a\":\n-1e400}"),
              HasSubstr("truth.json:3: -1e400 is too large for a number"));
  EXPECT_THAT(refusal("[1]"), HasSubstr("the document is no truth file"));
  EXPECT_THAT(refusal(R"({"format":"plumbline-truth","version":2})"),
              HasSubstr("'version' is 2: expected 1"));
  EXPECT_THAT(refusal(head + R"("poses":[]})"),
              HasSubstr("'walls' is missing"));
  EXPECT_THAT(refusal(head + R"("walls":3,"poses":[]})"),
              HasSubstr("'walls' is no array"));
  EXPECT_THAT(refusal(head + R"("walls":[{"id":0,"x1":"a"}],"poses":[]})"),
              HasSubstr("'walls[0].x1' is no number"));
  EXPECT_THAT(refusal(head + R"("walls":[{"id":0,"x1":0,"y1":0,"x2":1,"y2":0,
                "orientation":1,"seen":[]}],"poses":[]})"),
              HasSubstr("'walls[0].orientation' is no index"));
  EXPECT_THAT(refusal(head + R"("walls":[{"id":0,"x1":0,"y1":0,"x2":1,"y2":0,
                "orientation":0,"seen":[[2,1]]}],"poses":[]})"),
              HasSubstr("'walls[0].seen[0]' ends before it begins"));
  EXPECT_THAT(refusal(head + R"("walls":[],"poses":[[1,2,3]]})"),
              HasSubstr("'poses[0]' has 3 elements: expected 4 numbers"));
}

TEST(MapTruthTest, ReadsMap) {
  const StraightMap map = ParseMap(
      R"({"features":[
          {"id":0,"type":"segment","parameters":[1,2,0.5],"extent":[-1,2]},
          {"id":1,"type":"circle","parameters":[1,2,0.5]},
          {"id":2,"type":"line","parameters":[2,1.5707963267948966],
           "anchor":[10,20],"extent":[0,4]},
          {"id":3,"type":"orientation","parameters":[0.25]}],
          "constraints":[]})");
  ASSERT_EQ(map.segments.size(), 2u);
  EXPECT_EQ(map.segments[0].pose, Pose2(1, 2, 0.5));
  EXPECT_EQ(map.segments[0].begin, -1);
  EXPECT_EQ(map.segments[0].end, 2);
  // d = y cos(alpha) - x sin(alpha) = -x: the line x = -2 from the anchor.
  EXPECT_NEAR(map.segments[1].pose[0], 8.0, 1e-12);
  EXPECT_NEAR(map.segments[1].pose[1], 20.0, 1e-12);
  ASSERT_EQ(map.orientations.size(), 1u);
  EXPECT_EQ(map.orientations[0].angle, 0.25);
}

TEST(MapTruthTest, RefusesBadMaps) {
  EXPECT_THAT(Refusal([] { ParseMap("{}"); }), HasSubstr("has no features"));
  EXPECT_THAT(Refusal([] {
                ParseMap(R"({"features":[{"id":0,"type":"segment",
                             "parameters":[1,2],"extent":[0,1]}]})");
              }),
              HasSubstr("'features[0].parameters' has 2 elements"));
  EXPECT_THAT(Refusal([] {
                ParseMap(R"({"features":[{"id":0,"type":"segment",
                             "parameters":[1,2,null],"extent":[0,1]}]})");
              }),
              HasSubstr("'features[0].parameters[2]' is no number"));
}

TEST(MapTruthTest, FitsARigidTransform) {
  // Turned by 90 degrees and moved by (5, -1).
  const std::vector<Pose2> from = {{0, 0, 0}, {2, 0, 0.1}, {2, 1, -0.3}};
  std::vector<Pose2> to;
  for (const Pose2& pose : from)
    to.push_back(Compose(Pose2(5, -1, kPi / 2), pose));
  const Pose2 fit = FitRigidTransform(from, to);
  EXPECT_NEAR(fit[0], 5.0, 1e-12);
  EXPECT_NEAR(fit[1], -1.0, 1e-12);
  EXPECT_NEAR(fit[2], kPi / 2, 1e-12);
}

TEST(MapTruthTest, HeadingsDecideWhenTheRobotStands) {
  const Pose2 fit =
      FitRigidTransform({{1, 0, 0.5}, {1, 0, 0.7}}, {{0, 3, 2.5}, {0, 3, 2.7}});
  EXPECT_NEAR(fit[2], 2.0, 1e-12);
  EXPECT_NEAR(fit[0], -std::cos(2.0), 1e-12);
  EXPECT_NEAR(fit[1], 3.0 - std::sin(2.0), 1e-12);
  EXPECT_THAT(Refusal([] { FitRigidTransform({}, {}); }),
              HasSubstr("do not pair up"));
  EXPECT_THAT(Refusal([] { FitRigidTransform({Pose2::Zero()}, {}); }),
              HasSubstr("do not pair up"));
}

TEST(MapTruthTest, AlignsByTime) {
  MapTruth truth;
  truth.name = "truth.json";
  truth.poses = {{1.0, "", Pose2(0, 0, 0)},
                 {2.0, "", Pose2(4, 0, 0)},
                 {3.0, "", Pose2(99, 99, 0)}};
  // Out of order, one without a partner.
  const std::vector<TimedPose> trajectory = {{2.0004, "", Pose2(0, 4, 0)},
                                             {1.0, "", Pose2(0, 0, 0)},
                                             {7.0, "", Pose2(50, 0, 0)}};
  const Pose2 alignment = AlignTrajectory(trajectory, truth);
  EXPECT_NEAR(alignment[0], 0.0, 1e-12);
  EXPECT_NEAR(alignment[1], 0.0, 1e-12);
  EXPECT_NEAR(alignment[2], -kPi / 2, 1e-12);
  EXPECT_THAT(Refusal([&] {
                AlignTrajectory({{9.0, "", Pose2::Zero()}}, truth);
              }),
              HasSubstr("truth.json: no true pose has the time stamp"));
}

TEST(MapTruthTest, PerfectMap) {
  StraightMap map;
  // The second one looks the other way, the map frame is turned and moved.
  map.segments = {MakeSegment(0, 5, 0, 0, -5, 5),
                  MakeSegment(1, 10, 2, -90, -2, 2)};
  map.orientations = {{2, 0.0}, {3, DegToRad(-90)}};
  const Pose2 alignment(100, -50, 2.0);
  for (MapSegment& segment : map.segments)
    segment.pose = Compose(Inverse(alignment), segment.pose);
  for (MapOrientation& orientation : map.orientations) orientation.angle -= 2.0;

  const MapTruthEvaluation result = EvaluateMap(map, MakeL(), alignment);
  ASSERT_EQ(result.walls.size(), 2u);
  EXPECT_TRUE(result.walls[0].found);
  EXPECT_TRUE(result.walls[1].found);
  EXPECT_NEAR(result.walls[0].covered, 10.0, 1e-6);
  EXPECT_NEAR(result.direction_error_deg.maximum, 0.0, 1e-9);
  EXPECT_NEAR(result.offset_error.maximum, 0.0, 1e-9);
  EXPECT_NEAR(result.recall, 1.0, 1e-6);
  EXPECT_NEAR(result.precision, 1.0, 1e-6);
  EXPECT_NEAR(result.doubled_length, 0.0, 1e-6);
  EXPECT_THAT(result.missed_walls, IsEmpty());
  EXPECT_THAT(result.false_walls, IsEmpty());
  EXPECT_THAT(result.missed_orientations_deg, IsEmpty());
  EXPECT_THAT(result.false_orientations_deg, IsEmpty());
  EXPECT_EQ(result.duplicate_orientations, 0);
}

TEST(MapTruthTest, ErrorsOfAWall) {
  StraightMap map;
  // Two pieces: 6 m at 0.1 m, and 2 m turned by 3 degrees about its middle,
  // which lies on the wall: its mean distance is 0.5 m sin(3 degrees).
  map.segments = {MakeSegment(0, 0, 0.1, 0, 0, 6),
                  MakeSegment(1, 8, 0, 3, -1, 1)};
  MapTruth truth = MakeL();
  truth.walls.pop_back();
  const MapTruthEvaluation result = EvaluateMap(map, truth, Pose2::Zero());
  ASSERT_EQ(result.walls.size(), 1u);
  EXPECT_NEAR(result.walls[0].direction_error_deg, 3.0 * 2.0 / 8.0, 1e-9);
  EXPECT_NEAR(result.walls[0].offset_error,
              (0.1 * 6.0 + 0.5 * std::sin(DegToRad(3.0)) * 2.0) / 8.0, 1e-6);
  EXPECT_NEAR(result.walls[0].covered, 8.0, 0.01);
  EXPECT_NEAR(result.recall, 0.8, 0.001);
}

TEST(MapTruthTest, MissedAndFalseWalls) {
  StraightMap map;
  map.segments = {
      MakeSegment(0, 0, 0, 0, 0, 4),      // covers 4 of 10 m only
      MakeSegment(1, 10, 0, 85.1, 0, 3),  // just parallel enough
      MakeSegment(2, 5, 3, 0, 0, 2),      // nothing there
      MakeSegment(3, 5, 0, 45, 0, 2),     // not parallel
      MakeSegment(4, 5, 0.6, 0, 0, 2),    // too far beside
      MakeSegment(5, 9, 0, 0, 0, 2.4),    // 1.25 m of 2.4 m on the wall
      MakeSegment(6, 12, 0, 0, 0, 2),     // beyond the end
      MakeSegment(7, 5, 3, 0, 0, 0.9)};   // short
  const MapTruthEvaluation result = EvaluateMap(map, MakeL(), Pose2::Zero());
  EXPECT_FALSE(result.walls[0].found);
  EXPECT_TRUE(result.walls[1].found);
  EXPECT_NEAR(result.walls[1].direction_error_deg, 4.9, 1e-9);
  EXPECT_THAT(result.missed_walls, ElementsAre(0));
  EXPECT_THAT(result.false_walls, ElementsAre(2, 3, 4, 6));
  // Right: 4 + 3 + 1.25 of 17.4 m.
  EXPECT_NEAR(result.precision, 8.25 / 17.4, 0.01);
  EXPECT_EQ(result.direction_error_deg.count, 1u);
}

TEST(MapTruthTest, OnlyWhatWasSeenIsAskedFor) {
  MapTruth truth = MakeL();
  // Overlapping hits count once: 2 m; of the other wall too little was seen.
  truth.walls[0].seen = {{0, 1.5}, {1, 2}};
  truth.walls[1].seen = {{0, 0.4}, {1, 1.5}};
  StraightMap map;
  map.segments = {MakeSegment(0, 0, 0, 0, 0, 1.2)};
  const MapTruthEvaluation result = EvaluateMap(map, truth, Pose2::Zero());
  ASSERT_EQ(result.walls.size(), 1u);
  EXPECT_NEAR(result.walls[0].seen, 2.0, 1e-12);
  EXPECT_NEAR(result.walls[0].covered, 1.2, 1e-6);
  EXPECT_TRUE(result.walls[0].found);
}

TEST(MapTruthTest, FacesOfAThinWallAreToldApart) {
  MapTruth truth;
  truth.walls = {MakeWall(0, 0, 0, 10, 0, -1),
                 MakeWall(1, 0, 0.2, 10, 0.2, -1)};
  StraightMap map;
  map.segments = {MakeSegment(0, 0, 0.05, 0, 0, 10)};
  const MapTruthEvaluation one = EvaluateMap(map, truth, Pose2::Zero());
  EXPECT_THAT(one.missed_walls, ElementsAre(1));
  map.segments.push_back(MakeSegment(1, 0, 0.17, 0, 0, 10));
  const MapTruthEvaluation both = EvaluateMap(map, truth, Pose2::Zero());
  EXPECT_THAT(both.missed_walls, IsEmpty());
  EXPECT_NEAR(both.walls[0].offset_error, 0.05, 1e-9);
  EXPECT_NEAR(both.walls[1].offset_error, 0.03, 1e-9);
}

TEST(MapTruthTest, OneSegmentMayCoverTwoWalls) {
  MapTruth truth;
  truth.walls = {MakeWall(0, 0, 0, 4, 0, -1), MakeWall(1, 5, 0, 10, 0, -1)};
  StraightMap map;
  map.segments = {MakeSegment(0, 0, 0, 180, -10, 0)};
  const MapTruthEvaluation result = EvaluateMap(map, truth, Pose2::Zero());
  EXPECT_THAT(result.missed_walls, IsEmpty());
  EXPECT_THAT(result.false_walls, IsEmpty());
}

TEST(MapTruthTest, WallsDrawnTwice) {
  StraightMap map;
  map.segments = {MakeSegment(0, 0, 0, 0, 0, 10),
                  MakeSegment(1, 2, 0.3, 0, 0, 3)};
  const MapTruthEvaluation result = EvaluateMap(map, MakeL(), Pose2::Zero());
  EXPECT_NEAR(result.doubled_length, 3.0, 0.01);
}

TEST(MapTruthTest, Orientations) {
  MapTruth truth = MakeL();
  truth.orientations_deg = {0, 90, 30};  // nothing at 30 degrees was seen
  StraightMap map;
  map.orientations = {{0, DegToRad(0.9)},
                      {1, DegToRad(179.5)},
                      {2, DegToRad(88.5)},
                      {3, DegToRad(-45)}};
  const MapTruthEvaluation result = EvaluateMap(map, truth, Pose2::Zero());
  EXPECT_EQ(result.duplicate_orientations, 1);
  ASSERT_EQ(result.false_orientations_deg.size(), 2u);
  EXPECT_NEAR(result.false_orientations_deg[0], 88.5, 1e-9);
  EXPECT_NEAR(result.false_orientations_deg[1], 135.0, 1e-9);
  EXPECT_THAT(result.missed_orientations_deg, ElementsAre(90));
}

TEST(MapTruthTest, ABendIsTheDifferenceOfDirectionsErrors) {
  MapTruth truth;
  truth.orientations_deg = {0, 5};
  truth.walls = {MakeWall(0, 0, 0, 10, 0, 0),
                 MakeWall(1, 10, 0, 10 + 10 * std::cos(DegToRad(5)),
                          10 * std::sin(DegToRad(5)), 1)};
  StraightMap map;
  map.segments = {MakeSegment(1, 0, 0, 0.4, 0, 10),
                  MakeSegment(2, 10, 0, 4.1, 0, 10),
                  // Too short to say anything about a direction.
                  MakeSegment(3, 5, 0, 4.9, 0, 0.5)};
  const MapTruthEvaluation evaluation = EvaluateMap(map, truth, Pose2::Zero());
  ASSERT_EQ(evaluation.directions.size(), 2u);
  EXPECT_NEAR(evaluation.directions[0].error_deg, 0.4, 1e-9);
  EXPECT_NEAR(evaluation.directions[1].error_deg, -0.9, 1e-9);
  EXPECT_NEAR(evaluation.directions[1].length, 10.0, 0.1);
  EXPECT_NEAR(evaluation.bend_error_deg, 1.3, 1e-9);
  EXPECT_TRUE(evaluation.is_bend_known);
}

// What turned so far that it matches no wall any more is no straight building.
TEST(MapTruthTest, ABendOfWhatIsNotInTheMapIsNotKnown) {
  const MapTruth truth = MakeL();
  StraightMap map;
  EXPECT_FALSE(EvaluateMap(map, truth, Pose2::Zero()).is_bend_known);
  map.segments = {MakeSegment(1, 0, 0, 0, 0, 10),
                  MakeSegment(2, 10, 0, 80, 0, 4)};
  MapTruthEvaluation evaluation = EvaluateMap(map, truth, Pose2::Zero());
  ASSERT_EQ(evaluation.directions.size(), 1u);
  EXPECT_FALSE(evaluation.is_bend_known);
  map.segments[1] = MakeSegment(2, 10, 0, 88, 0, 4);
  evaluation = EvaluateMap(map, truth, Pose2::Zero());
  EXPECT_TRUE(evaluation.is_bend_known);
  EXPECT_NEAR(evaluation.bend_error_deg, 2.0, 1e-9);
}

TEST(MapTruthTest, PosesAgainstTheTruth) {
  MapTruth truth;
  std::vector<TimedPose> trajectory(3);
  for (int i = 0; i < 3; ++i) {
    trajectory[i].timestamp = i;
    trajectory[i].pose = Pose2(i, 0, 0);
    truth.poses.push_back(trajectory[i]);
  }
  truth.poses[2].pose = Pose2(5, 4, DegToRad(6));
  truth.poses[1].timestamp = 1.5;
  const PoseErrors errors = EvaluatePoses(trajectory, truth, Pose2::Zero());
  EXPECT_EQ(errors.position.count, 2u);
  EXPECT_NEAR(errors.position.mean, 2.5, 1e-12);
  EXPECT_NEAR(errors.heading_deg.maximum, 6.0, 1e-9);
}

// A map of absurd size is evaluated in no more time than one of walls. (Each
// would take 3.6 million samples against all others.)
TEST(MapTruthTest, AbsurdlyLongWalls) {
  MapTruth truth;
  truth.name = "truth";
  truth.orientations_deg = {0.0};
  StraightMap map;
  for (int i = 0; i < 50; ++i) {
    const double y = 0.4 * i;
    TruthWall wall;
    wall.id = i;
    wall.begin = {0.0, y};
    wall.end = {90000.0, y};
    wall.orientation = 0;
    wall.seen = {{0.0, 90000.0}};
    truth.walls.push_back(wall);
    MapSegment segment;
    segment.id = i;
    segment.pose = Pose2(0.0, y, 0.0);
    segment.end = 90000.0;
    map.segments.push_back(segment);
  }
  const MapTruthEvaluation evaluation =
      EvaluateMap(map, truth, Pose2::Zero(), {});
  EXPECT_NEAR(evaluation.recall, 1.0, 1e-9);
  EXPECT_NEAR(evaluation.precision, 1.0, 1e-9);
  EXPECT_TRUE(evaluation.false_walls.empty());
}

TEST(MapTruthTest, NothingAgainstNothing) {
  const MapTruthEvaluation result =
      EvaluateMap(StraightMap(), MapTruth(), Pose2::Zero());
  EXPECT_EQ(result.recall, 1.0);
  EXPECT_EQ(result.precision, 1.0);
  EXPECT_THAT(result.walls, IsEmpty());

  // Degenerate walls and segments do no harm.
  MapTruth truth;
  truth.walls = {MakeWall(0, 1, 1, 1, 1, -1)};
  StraightMap map;
  map.segments = {MakeSegment(0, 1, 1, 0, 2, 2)};
  EXPECT_THAT(EvaluateMap(map, truth, Pose2::Zero()).walls, IsEmpty());
}

}  // namespace
}  // namespace plumbline
