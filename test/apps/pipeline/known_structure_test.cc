#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/em.h>
#include <plumbline/core/error.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/merged_walls.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/summary.h>
#include <plumbline/pipeline/known_structure.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/plan_placement.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(WallStatementsTest, Reads) {
  const std::vector<WallStatement> statements = ReadWallStatements(
      "# of the west wing\n"
      "same 1.5,2 30,-2.1\n"
      "\n"
      "distance 1,2 3,4 12.40 sigma=0.05 sigma_deg=1 # measured\n"
      "parallel 1,2 3,4 hard\n"
      "right_angle 1,2 3,4\n",
      "walls.txt");
  ASSERT_EQ(statements.size(), 4u);
  EXPECT_EQ(statements[0].kind, WallStatement::Kind::kSame);
  EXPECT_EQ(statements[0].second, Eigen::Vector2d(30.0, -2.1));
  EXPECT_FALSE(statements[0].is_hard);
  EXPECT_EQ(statements[1].kind, WallStatement::Kind::kDistance);
  EXPECT_EQ(statements[1].distance, 12.4);
  EXPECT_EQ(statements[1].sigma_offset, 0.05);
  EXPECT_NEAR(RadToDeg(statements[1].sigma_angle), 1.0, 1e-12);
  EXPECT_EQ(statements[1].place, "walls.txt:4");
  EXPECT_TRUE(statements[2].is_hard);
  EXPECT_EQ(statements[3].kind, WallStatement::Kind::kRightAngle);
}

TEST(WallStatementsTest, RefusesWhatIsNone) {
  const auto why = [](const std::string& text) {
    return Refusal([&] { ReadWallStatements(text, "walls.txt"); });
  };
  EXPECT_THAT(why("\nequal 1,2 3,4\n"), HasSubstr("walls.txt:2: 'equal'"));
  EXPECT_THAT(why("same 1,2\n"), HasSubstr("without two points"));
  EXPECT_THAT(why("same 1,2 3\n"), HasSubstr("without two points"));
  EXPECT_THAT(why("same 1,2 3,nan\n"), HasSubstr("without two points"));
  EXPECT_THAT(why("distance 1,2 3,4\n"), HasSubstr("without metres"));
  EXPECT_THAT(why("distance 1,2 3,4 -5\n"), HasSubstr("no distance"));
  EXPECT_THAT(why("distance 1,2 3,4 far\n"), HasSubstr("no distance"));
  EXPECT_THAT(why("same 1,2 3,4 sigma=0\n"), HasSubstr("not understood"));
  EXPECT_THAT(why("same 1,2 3,4 sigma=x\n"), HasSubstr("not understood"));
  EXPECT_THAT(why("same 1,2 3,4 soft\n"), HasSubstr("not understood"));
}

// Uneven enough for a plan to fit in one place. `last`: direction of one, rad.
std::vector<Pose2> FiveWalls(double last = 0.0) {
  return {Pose2(0.0, 0.0, 0.0), Pose2(2.0, 2.0, 0.5 * kPi),
          Pose2(1.0, 5.0, 0.3), Pose2(-3.0, 3.0, 0.5 * kPi),
          Pose2(5.0, -1.5, last)};
}

// Walls that a fixed pose has measured, each to `sigma`, m and rad / 10.
class StatementTest : public ::testing::Test {
 protected:
  StatementTest() { RegisterBuiltins(&registry_); }

  // In place of those that there were.
  void MakeWalls(const std::vector<Pose2>& walls, double sigma) {
    Transaction clear;
    for (const Constraint* constraint : std::as_const(graph_).Constraints()) {
      clear.RemoveConstraint(constraint->id);
    }
    for (const Feature* feature : std::as_const(graph_).Features()) {
      clear.RemoveFeature(feature->id);
    }
    graph_.Apply(std::move(clear));
    Transaction transaction;
    Feature pose;
    pose.type = &registry_.GetFeature("pose");
    pose.fixed = true;
    const FeatureId first = transaction.AddFeature(pose);
    for (const Pose2& at : walls) {
      Feature wall;
      wall.type = &registry_.GetFeature("segment");
      wall.parameters = {at[0], at[1], at[2]};
      wall.extent_begin = -2.0;
      wall.extent_end = 2.0;
      transaction.AddConstraint(MakeMeasurement(
          registry_.GetRelation("pose_pose"),
          {first, transaction.AddFeature(wall)}, at,
          InformationFromSigmas(Eigen::Vector3d(sigma, sigma, 0.1 * sigma)),
          "test"));
    }
    const std::vector<FeatureId> ids =
        graph_.Apply(std::move(transaction)).features;
    pose_ = ids[0];
    walls_.assign(ids.begin() + 1, ids.end());
  }

  // Tells what is said of it after EM.
  std::vector<std::string> Solve(const std::string& text) {
    KnownStructure known;
    known.statements = ReadWallStatements(text, "walls.txt");
    KnownStructureBinder binder(known, registry_, pose_, &graph_);
    SolverSession session(&graph_, registry_, {});
    EmOrchestrator em(&graph_, &session, registry_, Hierarchy(), {});
    binder.AddStatements();
    em.Run();
    return binder.Notes();
  }

  Pose2 Wall(std::size_t i) {
    const Feature& wall = graph_.GetFeature(walls_[i]);
    return Pose2(wall.parameters[0], wall.parameters[1], wall.parameters[2]);
  }

  Registry registry_;
  Graph graph_;
  FeatureId pose_ = kNoId;
  std::vector<FeatureId> walls_;
};

TEST_F(StatementTest, ADistanceHoldsBetweenFacesThatLookAtEachOther) {
  MakeWalls({Pose2(0.0, 0.0, 0.0), Pose2(1.0, 12.5, kPi - 0.01)}, 0.2);
  EXPECT_TRUE(Solve("distance 0,0.1 1,12.5 12.40\n").empty());
  EXPECT_NEAR(std::abs(Between(Wall(0), Wall(1))[1]), 12.4, 0.01);
  EXPECT_NEAR(std::cos(Wall(0)[2] - Wall(1)[2]), -1.0, 1e-4);
}

TEST_F(StatementTest, WallsAreOneOrAtRightAngles) {
  MakeWalls({Pose2(0.0, 0.0, 0.02), Pose2(10.0, 0.2, 0.0),
             Pose2(4.0, 5.0, 0.5 * kPi + 0.03)},
            0.3);
  EXPECT_TRUE(Solve("same 0,0 10,0\nright_angle 10,0 4,5\n").empty());
  EXPECT_NEAR(Between(Wall(0), Wall(1))[1], 0.0, 0.01);
  EXPECT_NEAR(Wall(2)[2] - Wall(1)[2], 0.5 * kPi, 2e-3);
}

TEST_F(StatementTest, WhatMeasurementsContradictBreaksUnlessItIsHard) {
  const std::vector<Pose2> walls = {Pose2(0.0, 0.0, 0.0), Pose2(0.0, 5.0, 0.0)};
  MakeWalls(walls, 0.02);
  EXPECT_THAT(Solve("distance 0,0 0,5 6\n"),
              Contains(HasSubstr("walls.txt:1: measurements contradict")));
  EXPECT_NEAR(Wall(1)[1] - Wall(0)[1], 5.0, 1e-3);
  Solve("distance 0,0 0,5 6 hard sigma=0.001\n");
  EXPECT_NEAR(Wall(1)[1] - Wall(0)[1], 6.0, 0.01);
}

// Millimetres for metres; hard ones, too.
TEST_F(StatementTest, ADistanceThatNoMapHasIsOfAnotherUnit) {
  for (const char* const text :
       {"distance 0,0 0,5 5000\n", "distance 0,0 0,5 5000 hard\n"}) {
    MakeWalls({Pose2(0.0, 0.0, 0.0), Pose2(0.0, 5.0, 0.0)}, 0.02);
    EXPECT_THAT(Solve(text), ::testing::ElementsAre(
                                 HasSubstr("walls.txt:1: the whole map is")));
    EXPECT_NEAR(Wall(1)[1] - Wall(0)[1], 5.0, 1e-6);
  }
}

// While wrong statements pull at a wall a right one breaks with them.
TEST_F(StatementTest, ARightStatementOutlivesWrongOnes) {
  MakeWalls({Pose2(0.0, 0.0, 0.0), Pose2(0.0, 5.0, 0.0)}, 0.02);
  KnownStructure known;
  known.statements = ReadWallStatements(
      "distance 0,0 0,5 5.01\ndistance 0,0 0,5 9\ndistance 0,0 0,5 6\n",
      "walls.txt");
  KnownStructureBinder binder(known, registry_, pose_, &graph_);
  SolverSession session(&graph_, registry_, {});
  EmOrchestrator em(&graph_, &session, registry_, Hierarchy(), {});
  binder.AddStatements();
  em.Run();
  EXPECT_EQ(binder.AddStatementsAgain(), 1);
  em.Run();
  EXPECT_EQ(binder.AddStatementsAgain(), 0);
  EXPECT_THAT(binder.Notes(),
              ::testing::UnorderedElementsAre(
                  HasSubstr("walls.txt:2: measurements contradict it"),
                  HasSubstr("walls.txt:3: measurements contradict it")));
  EXPECT_NEAR(Wall(1)[1] - Wall(0)[1], 5.005, 5e-3);
}

// However tight it is, and so however small what is left of the contradiction.
TEST_F(StatementTest, WhatMeasurementsContradictIsToldWhereItIsHard) {
  const std::vector<Pose2> walls = {Pose2(0.0, 0.0, 0.0), Pose2(0.0, 5.0, 0.0),
                                    Pose2(7.0, 0.0, 0.5 * kPi)};
  for (const char* const text :
       {"distance 0,0 0,5 6 hard\n", "distance 0,0 0,5 6 hard sigma=0.001\n",
        "distance 0,0 0,5 20 hard sigma=0.0001\n",
        "right_angle 0,0 0,5 hard sigma_deg=0.001\n",
        "same 0,0 0,5 hard sigma=0.001\n",
        "parallel 0,0 7,0 hard sigma_deg=0.01\n"}) {
    MakeWalls(walls, 0.02);
    EXPECT_THAT(Solve(text), ::testing::ElementsAre(HasSubstr(
                                 "walls.txt:1: measurements contradict it, it "
                                 "is hard and holds")))
        << text;
  }
  // Two that contradict each other, where measurements are too coarse to tell.
  MakeWalls(walls, 2.0);
  EXPECT_THAT(Solve("distance 0,0 0,5 5 hard\ndistance 0,0 0,5 6 hard\n"),
              ::testing::ElementsAre(HasSubstr("walls.txt:1: measurements"),
                                     HasSubstr("walls.txt:2: measurements")));
  // What agrees with them, or tells what they leave open, is not told.
  for (const char* const text :
       {"distance 0,0 0,5 5 hard\n",
        "distance 0,0 0,5 5.04 hard sigma=0.0001\n",
        "parallel 0,0 0,5 hard sigma_deg=0.001\n",
        "right_angle 0,0 7,0 hard sigma_deg=0.001\n"}) {
    MakeWalls(walls, 0.02);
    EXPECT_TRUE(Solve(text).empty()) << text;
  }
  MakeWalls(walls, 2.0);
  EXPECT_TRUE(Solve("distance 0,0 0,5 6 hard sigma=0.001\n").empty());
}

// Whatever is said of them, and whether it holds.
TEST_F(StatementTest, WallsThatAreSpokenOfStayTwo) {
  for (const char* const text :
       {"parallel 0,0 0,5\n", "distance 0,0 0,5 5\n",
        "distance 0,0 0,5 5 hard\n", "distance 0,0 0,5 7\n",
        "right_angle 0,0 7,0\n", "same 0,0 0,5\n"}) {
    SCOPED_TRACE(text);
    MakeWalls({Pose2(0.0, 0.0, 0.0), Pose2(0.0, 5.0, 0.0),
               Pose2(7.0, 0.0, 0.5 * kPi)},
              0.02);
    Solve(text);
    EXPECT_EQ(MergeWalls(graph_).size(), walls_.size());
    EXPECT_TRUE(DrawingFromGraph(graph_, {}).closures.empty());
    Summary summary;
    CountGraph(graph_, &summary);
    EXPECT_EQ(summary.closures.proposed, 0);
  }
  // On both sides of a door.
  MakeWalls({Pose2(0.0, 0.0, 0.0), Pose2(5.0, 0.03, 0.0)}, 0.02);
  EXPECT_TRUE(Solve("same 0,0 5,0\n").empty());
  EXPECT_EQ(MergeWalls(graph_).size(), 2u);
}

TEST_F(StatementTest, SaysWhereThereIsNoWall) {
  MakeWalls({Pose2(0.0, 0.0, 0.0), Pose2(0.0, 5.0, 0.0)}, 0.02);
  EXPECT_THAT(
      Solve("same 0,0 0,2.5\nsame 0,0 1,0\n"),
      ::testing::ElementsAre(HasSubstr("no wall within 1 m of 0.00,2.50"),
                             HasSubstr("both points are at one wall")));
}

// A drawing has a frame, or a second building far away: neither memory nor time
// may grow with that distance.
TEST_F(StatementTest, WhatIsFarAwayInThePlanDoesNotCount) {
  MakeWalls(FiveWalls(), 0.02);
  KnownStructure known;
  const PoseTransform elsewhere(Pose2(100.0, -50.0, 0.65));
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    const PoseTransform wall(Wall(i));
    PlanLine line;
    line.begin = elsewhere.Point(wall.Point(Eigen::Vector2d(-2.0, 0.0)));
    line.end = elsewhere.Point(wall.Point(Eigen::Vector2d(2.0, 0.0)));
    known.plan.push_back(line);
  }
  for (const double far : {5e3, -1e6}) {
    PlanLine line;
    line.begin = Eigen::Vector2d(far, far);
    line.end = Eigen::Vector2d(far + 3.0, far);
    known.plan.push_back(line);
  }
  KnownStructureBinder binder(known, registry_, pose_, &graph_);
  EXPECT_EQ(binder.TieToPlan(), static_cast<int>(walls_.size()));
  EXPECT_THAT(binder.Notes(),
              Contains(HasSubstr("agrees with 20.0 m of 20.0 m")));
}

// A plan that is the same turned by 180 degrees lies where it is said to.
TEST_F(StatementTest, APlanThatFitsInTwoPlacesNeedsItsPose) {
  const std::vector<Pose2> half = {
      Pose2(0.0, -4.0, 0.0), Pose2(6.0, -2.0, 0.5 * kPi), Pose2(2.0, 1.0, 0.3)};
  std::vector<Pose2> walls = half;
  for (const Pose2& wall : half) {
    walls.push_back(Compose(Pose2(0.0, 0.0, kPi), wall));
  }
  MakeWalls(walls, 0.02);
  KnownStructure known;
  const Pose2 origin(10.0, -5.0, 0.65);  // of the plan, map frame
  const PoseTransform to_plan(Inverse(origin));
  for (const Pose2& pose : walls) {
    const PoseTransform wall(pose);
    PlanLine line;
    line.begin = to_plan.Point(wall.Point(Eigen::Vector2d(-2.0, 0.0)));
    line.end = to_plan.Point(wall.Point(Eigen::Vector2d(2.0, 0.0)));
    known.plan.push_back(line);
  }
  {
    KnownStructureBinder binder(known, registry_, pose_, &graph_);
    EXPECT_EQ(binder.TieToPlan(), 0);
    EXPECT_THAT(binder.Notes(), Contains(HasSubstr("--plan_pose=")));
  }
  // Roughly, either way round.
  for (const Pose2& at : {origin, Compose(Pose2(0.0, 0.0, kPi), origin)}) {
    MakeWalls(walls, 0.02);
    known.plan_pose = at + Pose2(0.6, -0.5, DegToRad(4.0));
    KnownStructureBinder binder(known, registry_, pose_, &graph_);
    EXPECT_EQ(binder.TieToPlan(), static_cast<int>(walls.size()));
    char expected[80];
    std::snprintf(expected, sizeof expected, "origin is at %.3f,%.3f", at[0],
                  at[1]);
    EXPECT_THAT(binder.Notes(), Contains(HasSubstr(expected)));
  }
  // Where it does not lie it is not taken.
  MakeWalls(walls, 0.02);
  known.plan_pose = Compose(Pose2(0.0, 0.0, 0.5 * kPi), origin);
  KnownStructureBinder binder(known, registry_, pose_, &graph_);
  EXPECT_EQ(binder.TieToPlan(), 0);
  EXPECT_THAT(binder.Notes(),
              Contains(HasSubstr("near the pose that was given")));
}

// Each wall is off by less than the tolerance of a tie, or a little more: the
// plan bends the map, and no line of it is said to be wrong.
TEST_F(StatementTest, APlanThatIsDrawnTooLargeIsTold) {
  std::vector<Pose2> walls;
  for (const double x : {-6.0, -2.0, 3.0, 9.0}) {
    for (const double y : {-5.0, 4.0}) {
      walls.emplace_back(x, y, 0.5 * kPi);
      walls.emplace_back(x + 1.5, y + 2.5, 0.0);
    }
  }
  for (const double scale : {0.99, 1.0, 1.01}) {
    MakeWalls(walls, 0.02);
    KnownStructure known;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      const PoseTransform wall(Wall(i));
      PlanLine line;
      line.begin = scale * wall.Point(Eigen::Vector2d(-2.0, 0.0));
      line.end = scale * wall.Point(Eigen::Vector2d(2.0, 0.0));
      known.plan.push_back(line);
    }
    KnownStructureBinder binder(known, registry_, pose_, &graph_);
    EXPECT_EQ(binder.TieToPlan(), static_cast<int>(walls.size()));
    SolverSession session(&graph_, registry_, {});
    EmOrchestrator em(&graph_, &session, registry_, Hierarchy(), {});
    em.Run();
    const std::vector<std::string> notes = binder.Notes();
    if (scale == 1.0) {
      EXPECT_THAT(notes, Not(Contains(HasSubstr("drawn too"))));
    } else {
      EXPECT_THAT(notes,
                  Contains(HasSubstr(scale > 1.0 ? "drawn too large, by"
                                                 : "drawn too small, by")));
    }
  }
}

// A cupboard in front of a long wall does not contradict the plan, a wall that
// stands elsewhere does; and the run says where.
TEST_F(StatementTest, WhatStandsBesideALineIsTold) {
  for (const bool is_long : {false, true}) {
    MakeWalls(FiveWalls(), 0.005);
    KnownStructure known;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      const PoseTransform wall(Wall(i));
      PlanLine line;
      line.begin = wall.Point(Eigen::Vector2d(-2.0, 0.0));
      line.end = wall.Point(Eigen::Vector2d(2.0, 0.0));
      known.plan.push_back(line);
    }
    // The last one lies 0.3 m beside its line.
    known.plan.back().begin += Eigen::Vector2d(0.0, 0.3);
    known.plan.back().end += Eigen::Vector2d(is_long ? 20.0 : 0.0, 0.3);
    known.min_contradicting_length = 5.0;
    KnownStructureBinder binder(known, registry_, pose_, &graph_);
    EXPECT_EQ(binder.TieToPlan(), static_cast<int>(walls_.size()));
    SolverSession session(&graph_, registry_, {});
    EmOrchestrator em(&graph_, &session, registry_, Hierarchy(), {});
    for (int round = 0; round < 6; ++round) {
      em.Run();
      if (binder.TieToPlan() == 0) break;
    }
    const std::vector<std::string> notes = binder.Notes();
    EXPECT_THAT(notes, Contains(HasSubstr("4 walls are tied to 4 lines")));
    if (is_long) {
      EXPECT_THAT(
          notes,
          Contains(HasSubstr("only 4.0 m of wall were seen, 0.30 m off it")));
    } else {
      EXPECT_THAT(notes, Contains(HasSubstr("lies 0.30 m beside it")));
    }
  }
}

// A map that is off by more than half the thickness of a wall: the nearest line
// is the other face of the wall, which is not seen from there.
TEST_F(StatementTest, AWallIsTiedToTheFaceThatIsSeenFromItsSide) {
  const std::vector<Pose2> faces = FiveWalls();
  KnownStructure known;
  for (const Pose2& face : faces) {
    for (const double across : {0.0, -0.15}) {
      // What is drawn has no direction: the one runs so, the other against it.
      const double sense = across == 0.0 ? 1.0 : -1.0;
      PlanLine line;
      line.begin = TransformPoint(face, Eigen::Vector2d(-2.0 * sense, across));
      line.end = TransformPoint(face, Eigen::Vector2d(2.0 * sense, across));
      known.plan.push_back(line);
    }
  }
  std::vector<Pose2> walls = faces;
  walls.back()[1] -= 0.1;
  MakeWalls(walls, 0.1);
  KnownStructureBinder binder(known, registry_, pose_, &graph_);
  EXPECT_EQ(binder.TieToPlan(), static_cast<int>(walls.size()));
  SolverSession session(&graph_, registry_, {});
  EmOrchestrator em(&graph_, &session, registry_, Hierarchy(), {});
  em.Run();
  EXPECT_GT(Wall(walls.size() - 1)[1], -1.56);
}

// A wall of 1 m, 3 degrees off its line as short walls are, and 110 m from the
// plan's origin: the turn alone would put it 0.15 m off as seen from there.
TEST_F(StatementTest, AShortWallFarFromThePlansOriginStaysTied) {
  MakeWalls(FiveWalls(0.457), 0.005);
  KnownStructure known;
  const PoseTransform elsewhere(Pose2(100.0, -50.0, 0.65));
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    const bool is_short = i + 1 == walls_.size();
    const PoseTransform line(
        Compose(Wall(i), Pose2(0.0, 0.0, is_short ? DegToRad(3.0) : 0.0)));
    const double half = is_short ? 0.5 : 2.0;
    known.plan.push_back(
        {elsewhere.Point(line.Point(Eigen::Vector2d(-half, 0.0))),
         elsewhere.Point(line.Point(Eigen::Vector2d(half, 0.0))), ""});
  }
  KnownStructureBinder binder(known, registry_, pose_, &graph_);
  EXPECT_EQ(binder.TieToPlan(), static_cast<int>(walls_.size()));
  SolverSession session(&graph_, registry_, {});
  EmOrchestrator em(&graph_, &session, registry_, Hierarchy(), {});
  em.Run();
  EXPECT_THAT(binder.Notes(),
              Contains(HasSubstr("5 walls are tied to 5 lines")));
}

// Whoever saw the wall looked through the line in front of it.
TEST_F(StatementTest, ALineInFrontOfAWallIsToldAsWrong) {
  MakeWalls(FiveWalls(), 0.01);
  for (const double across : {0.25, -0.25}) {
    KnownStructure known;
    for (std::size_t i = 0; i <= walls_.size(); ++i) {
      const PoseTransform wall(Wall(std::min(i, walls_.size() - 1)));
      const double off = i == walls_.size() ? across : 0.0;
      PlanLine line;
      line.begin = wall.Point(Eigen::Vector2d(-2.0, off));
      line.end = wall.Point(Eigen::Vector2d(2.0, off));
      known.plan.push_back(line);
    }
    KnownStructureBinder binder(known, registry_, pose_, &graph_);
    EXPECT_EQ(binder.TieToPlan(), static_cast<int>(walls_.size()));
    const auto told = Contains(HasSubstr(
        "contradict the plan's line from 3.00,-1.25 to 7.00,-1.25: the wall "
        "there lies 0.25 m beside it"));
    if (across > 0.0) {
      EXPECT_THAT(binder.Notes(), told);
    } else {
      // The other face of the same wall.
      EXPECT_THAT(binder.Notes(), Not(Contains(HasSubstr("contradict"))));
    }
  }
}

// The first half of a drive, which closes no loop.
class PlanTest : public ::testing::Test {
 protected:
  PlanTest() {
    RegisterBuiltins(&registry_);
    options_.global_association = false;
    Drive(5);
  }

  // Through the building of a seed.
  void Drive(std::uint64_t seed) {
    truth_.clear();
    plan_.clear();
    options_.known.plan.clear();
    SimulatorOptions options;
    options.laser.maximum_range = 6.0;
    options.laser.noise = 0.03;
    options.odometry.heading_noise_deg = 1.0;
    options.progress = [](double share) { return share < 0.5; };
    const Simulation simulation =
        Simulate(MakeWorld("oblique", seed, 1.0), options, seed);
    std::ostringstream text;
    WriteCarmenLog(simulation, options.laser, {}, text);
    InputStream input("oblique", text.str());
    log_ = ReadCarmenLog(&input, {});
    for (const SimulatedState& state : simulation.states) {
      truth_[std::lround(1e3 * state.time)] = state.pose;
    }
    for (const WorldFace& face : simulation.surfaces.faces) {
      if (face.orientation < 0 || (face.end - face.begin).norm() < 0.5)
        continue;
      PlanLine line;
      line.begin = elsewhere_.Point(face.begin);
      line.end = elsewhere_.Point(face.end);
      plan_.push_back(line);
    }
  }

  // Whether the robot passes the middle of a line of the plan.
  bool ComesBy(std::size_t i) const {
    const Eigen::Vector2d middle = 0.5 * (plan_[i].begin + plan_[i].end);
    return std::any_of(truth_.begin(), truth_.end(), [&](const auto& pose) {
      return (elsewhere_.Point(pose.second.template head<2>()) - middle)
                 .norm() < 1.5;
    });
  }

  LogSolverResult Solve() {
    LogSolver solver(registry_, options_);
    return solver.Run(log_);
  }

  // RMS distance from the truth after the best rigid motion, m.
  double Error(const LogSolverResult& result) const {
    Eigen::Vector2d from = Eigen::Vector2d::Zero();
    Eigen::Vector2d to = Eigen::Vector2d::Zero();
    const std::size_t n = result.trajectory.size();
    const auto truth = [&](std::size_t i) -> Eigen::Vector2d {
      return truth_.at(std::lround(1e3 * log_.scans[i].timestamp)).head<2>();
    };
    for (std::size_t i = 0; i < n; ++i) {
      from += result.trajectory[i].head<2>() / static_cast<double>(n);
      to += truth(i) / static_cast<double>(n);
    }
    double c = 0.0;
    double s = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector2d a = result.trajectory[i].head<2>() - from;
      const Eigen::Vector2d b = truth(i) - to;
      c += a.dot(b);
      s += a.x() * b.y() - a.y() * b.x();
    }
    const PoseTransform turn(Pose2(0.0, 0.0, std::atan2(s, c)));
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      sum +=
          (turn.Point(result.trajectory[i].head<2>() - from) - (truth(i) - to))
              .squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(n));
  }

  Registry registry_;
  Log log_;
  std::map<long, Pose2> truth_;
  // Where the plan has the building: somewhere else, and turned.
  const PoseTransform elsewhere_{Pose2(100.0, -50.0, 0.65)};
  std::vector<PlanLine> plan_;
  LogSolverOptions options_;
};

TEST_F(PlanTest, AWrongWallBreaksAndTheRestImprovesTheMap) {
  // In three of them walls come nearer to their other faces than to their own.
  double without = 0.0;
  double with_right = 0.0;
  double with_wrong = 0.0;
  for (const std::uint64_t seed : {1, 3, 5, 8}) {
    SCOPED_TRACE(seed);
    Drive(seed);
    without += Error(Solve());
    options_.known.plan = plan_;
    const LogSolverResult right = Solve();
    with_right += Error(right);
    EXPECT_THAT(right.notes, Contains(HasSubstr("walls are tied to")));
    // Half a metre off: the longest face that the robot came by.
    std::size_t longest = 0;
    const auto length = [this](std::size_t i) {
      return (plan_[i].end - plan_[i].begin).norm();
    };
    for (std::size_t i = 0; i < plan_.size(); ++i) {
      if (ComesBy(i) && length(i) > length(longest)) longest = i;
    }
    PlanLine& wrong = options_.known.plan[longest];
    const Eigen::Vector2d along = (wrong.end - wrong.begin).normalized();
    const Eigen::Vector2d shift(-0.5 * along.y(), 0.5 * along.x());
    wrong.begin += shift;
    wrong.end += shift;
    wrong.layer = "the wrong one";
    const LogSolverResult result = Solve();
    with_wrong += Error(result);
    EXPECT_THAT(result.notes, Contains(HasSubstr("(the wrong one)")));
  }
  EXPECT_LT(with_right, 0.9 * without);
  EXPECT_LT(with_wrong, 0.9 * without);
}

TEST_F(PlanTest, ThePlanOfAnotherBuildingIsNotUsed) {
  for (PlanLine& line : plan_) {
    line.begin *= 1.15;
    line.end *= 1.15;
  }
  const LogSolverResult without = Solve();
  options_.known.plan = plan_;
  const LogSolverResult with = Solve();
  EXPECT_THAT(with.notes, Contains(HasSubstr("the plan is not used")));
  EXPECT_THAT(with.notes, Not(Contains(HasSubstr("tied"))));
  EXPECT_EQ(with.trajectory, without.trajectory);
}

// A room of 10 m by 6 m with an L of two walls of 4 m in it, on the left.
std::vector<PlanLine> UnevenRoom() {
  const auto line = [](double x1, double y1, double x2, double y2) {
    PlanLine result;
    result.begin = {x1, y1};
    result.end = {x2, y2};
    return result;
  };
  return {line(0, 0, 10, 0), line(10, 0, 10, 6), line(10, 6, 0, 6),
          line(0, 6, 0, 0),  line(3, 0, 3, 4),   line(3, 4, 7, 4)};
}

// The walls that lines of a plan are in a map whose pose in it this is.
std::vector<Wall> WallsOf(const std::vector<PlanLine>& plan,
                          const Pose2& map_in_plan) {
  std::vector<Wall> walls;
  for (const PlanLine& line : plan) {
    const Wall wall = MakePlanWall(line);
    walls.push_back(
        MakeWall(Between(map_in_plan, wall.pose()), wall.begin, wall.end));
  }
  return walls;
}

TEST(PlanPlacementTest, APlanLineIsAWallAroundItsMiddle) {
  PlanLine line;
  line.begin = {1.0, 2.0};
  line.end = {1.0, 6.0};
  const Wall wall = MakePlanWall(line);
  EXPECT_NEAR((wall.At(wall.begin) - line.begin).norm(), 0.0, 1e-12);
  EXPECT_NEAR((wall.At(wall.end) - line.end).norm(), 0.0, 1e-12);
  EXPECT_NEAR(wall.angle, 0.5 * kPi, 1e-12);
}

TEST(PlanPlacementTest, IsFoundFromAnyPose) {
  KnownStructure known;
  known.plan = UnevenRoom();
  for (const Pose2& pose : {Pose2(0.0, 0.0, 0.0), Pose2(40.0, -25.0, 2.3)}) {
    const PlanPlacement placement = PlacePlan(known, WallsOf(known.plan, pose));
    ASSERT_TRUE(placement.map_in_plan) << placement.note;
    const Pose2 error = Between(pose, *placement.map_in_plan);
    EXPECT_LT(error.head<2>().norm(), 0.05);
    EXPECT_LT(std::abs(error[2]), DegToRad(0.5));
    EXPECT_THAT(placement.note, HasSubstr("agrees with"));
  }
}

TEST(PlanPlacementTest, ARoomThatFitsTwiceIsNotPlaced) {
  KnownStructure known;
  known.plan = UnevenRoom();
  known.plan.resize(4);
  const PlanPlacement placement =
      PlacePlan(known, WallsOf(known.plan, Pose2(1.0, 2.0, 0.3)));
  EXPECT_FALSE(placement.map_in_plan);
  EXPECT_THAT(placement.note, HasSubstr("fits in two places"));
}

// Much of a mirrored plan agrees at one place or another.
TEST(PlanPlacementTest, AMirroredPlanIsToldAsOne) {
  KnownStructure known;
  const Eigen::Vector2d corners[] = {{0.0, 0.0}, {14.0, 0.0}, {14.0, 9.0},
                                     {4.0, 9.0}, {4.0, 3.0},  {10.0, 3.0},
                                     {10.0, 6.0}};
  for (std::size_t i = 0; i + 1 < std::size(corners); ++i) {
    PlanLine line;
    line.begin = corners[i];
    line.end = corners[i + 1];
    known.plan.push_back(line);
  }
  const std::vector<Wall> walls = WallsOf(known.plan, Pose2(1.0, 2.0, 0.3));
  for (PlanLine& line : known.plan) {
    line.begin.x() *= -1.0;
    line.end.x() *= -1.0;
  }
  const PlanPlacement placement = PlacePlan(known, walls);
  EXPECT_FALSE(placement.map_in_plan);
  EXPECT_THAT(placement.note, HasSubstr("drawn mirrored"));
}

TEST(PlanPlacementTest, APlanInAnotherUnitIsToldAsOne) {
  for (const double scale : {1000.0, 3.281, 0.0254}) {
    KnownStructure known;
    known.plan = UnevenRoom();
    const std::vector<Wall> walls = WallsOf(known.plan, Pose2(1.0, 2.0, 0.3));
    for (PlanLine& line : known.plan) {
      line.begin *= scale;
      line.end *= scale;
    }
    const PlanPlacement placement = PlacePlan(known, walls);
    EXPECT_FALSE(placement.map_in_plan) << scale;
    EXPECT_THAT(placement.note, HasSubstr("$INSUNITS")) << scale;
  }
}

// In millimetres for metres, with so many lines, and most of them so short,
// that nothing but their sum shows that they are no building's.
TEST(PlanPlacementTest, TooManyLinesForABuildingAreOfAnotherUnit) {
  KnownStructure known;
  const std::vector<PlanLine> room = UnevenRoom();
  const std::vector<Wall> walls = WallsOf(room, Pose2(1.0, 2.0, 0.3));
  const Eigen::Vector2d inside = 0.5 * (room.front().begin + room.front().end);
  for (int copy = 0; copy < 5; ++copy) {
    for (const PlanLine& wall : room) {
      known.plan.push_back(wall);
      // Two for each wall: what the walls are is not the usual length.
      PlanLine tick;
      tick.begin = inside;
      tick.end = inside + Eigen::Vector2d(0.003, 0.0);
      known.plan.insert(known.plan.end(), 2, tick);
    }
  }
  for (PlanLine& line : known.plan) {
    line.begin *= 1000.0;
    line.end *= 1000.0;
  }
  const PlanPlacement placement = PlacePlan(known, walls);
  EXPECT_FALSE(placement.map_in_plan);
  EXPECT_THAT(placement.note, HasSubstr("km of lines"));
  EXPECT_THAT(placement.note, HasSubstr("1000.00 times smaller"));
  EXPECT_THAT(placement.note, HasSubstr("$INSUNITS"));
}

// A third of the walls at most can agree, but nearly all of those there.
TEST(PlanPlacementTest, APlanOfAPartOfTheBuildingIsUsed) {
  KnownStructure known;
  known.plan = UnevenRoom();
  std::vector<PlanLine> building = known.plan;
  for (const double y : {1.0, 3.0}) {
    PlanLine line;
    line.begin = {12.0, y};
    line.end = {62.0, y};
    building.push_back(line);
  }
  const Pose2 pose(40.0, -25.0, 2.3);
  const PlanPlacement placement = PlacePlan(known, WallsOf(building, pose));
  ASSERT_TRUE(placement.map_in_plan) << placement.note;
  EXPECT_LT(Between(pose, *placement.map_in_plan).head<2>().norm(), 0.05);
}

// All else of the building is far from where the robot drove.
TEST(PlanPlacementTest, IsFoundAtTheFarEndOfALargePlan) {
  KnownStructure known;
  known.plan = UnevenRoom();
  const std::vector<PlanLine> room = known.plan;
  for (int k = 0; k < 20; ++k) {
    const Eigen::Vector2d corner(150.0 + 5.0 * k, 0.0);
    const Eigen::Vector2d opposite = corner + Eigen::Vector2d(5.0, 4.0);
    for (const Eigen::Vector2d& other :
         {Eigen::Vector2d(corner.x(), opposite.y()),
          Eigen::Vector2d(opposite.x(), corner.y())}) {
      PlanLine line;
      line.begin = other;
      line.end = corner;
      known.plan.push_back(line);
      line.end = opposite;
      known.plan.push_back(line);
    }
  }
  const Pose2 pose(3.0, -2.0, 0.4);
  const PlanPlacement placement = PlacePlan(known, WallsOf(room, pose));
  ASSERT_TRUE(placement.map_in_plan) << placement.note;
  EXPECT_LT(Between(pose, *placement.map_in_plan).head<2>().norm(), 0.05);
}

TEST(PlanPlacementTest, SaysNothingWhenItIsStopped) {
  KnownStructure known;
  known.plan = UnevenRoom();
  const PlanPlacement placement = PlacePlan(
      known, WallsOf(known.plan, Pose2(1.0, 2.0, 0.3)), [] { return true; });
  EXPECT_FALSE(placement.map_in_plan);
  EXPECT_EQ(placement.note, "");
}

TEST(PlanPlacementTest, SaysThatThereAreNoWalls) {
  KnownStructure known;
  known.plan = UnevenRoom();
  EXPECT_THAT(PlacePlan(known, {}).note, HasSubstr("no walls"));
}

}  // namespace
}  // namespace plumbline
