#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/frontend/map_builder.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using testing::HeadingError;
using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::Observe;
using testing::PointsOf;
using testing::PositionError;
using testing::Room;
using testing::WallEnds;

MapBuilderOptions LinkOptions() {
  MapBuilderOptions options;
  options.link_radius = 10.0;
  options.association_depth = 3;
  options.links_per_feature = 5;
  options.links_within_scan = 3;
  options.relation_floor_position = 0.005;
  options.relation_floor_angle = DegToRad(0.1);
  return options;
}

Pose2 PoseOf(const Feature& feature) {
  return Pose2(feature.parameters[0], feature.parameters[1],
               feature.parameters[2]);
}

UncertainPose2 Motion(const Pose2& mean, double position_sigma = 0.03,
                      double angle_sigma = DegToRad(1.0)) {
  UncertainPose2 motion;
  motion.mean = mean;
  motion.covariance = Eigen::Vector3d(position_sigma * position_sigma,
                                      position_sigma * position_sigma,
                                      angle_sigma * angle_sigma)
                          .asDiagonal();
  return motion;
}

std::vector<SegmentObservation> ObserveAll(const Pose2& robot,
                                           const std::vector<WallEnds>& walls) {
  std::vector<SegmentObservation> observations;
  for (const WallEnds& wall : walls)
    observations.push_back(Observe(robot, wall));
  return observations;
}

class MapBuilderTest : public ::testing::Test {
 protected:
  MapBuilderTest() { RegisterBuiltinRelations(&registry_); }

  std::vector<const Feature*> Segments() const {
    std::vector<const Feature*> segments;
    for (const Feature* feature : graph_.Features()) {
      if (feature->type->name == "segment") segments.push_back(feature);
    }
    return segments;
  }

  // Constraints between segments.
  std::vector<const Constraint*> Relations() const {
    std::vector<const Constraint*> relations;
    for (const Constraint* constraint : graph_.Constraints()) {
      bool segments = true;
      for (FeatureId id : constraint->features) {
        segments &= graph_.GetFeature(id).type->name == "segment";
      }
      if (segments) relations.push_back(constraint);
    }
    return relations;
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(MapBuilderTest, FirstScanMakesFeaturesAndFixesTheBest) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const Pose2 start(5.0, -2.0, 0.5);
  const std::vector<WallEnds> walls =
      testing::Moved(Room(6.0, 4.0), Pose2(5.0, -1.0, 0.2));
  // The walls of 6 m come first and third; shorten the first.
  std::vector<SegmentObservation> observations = ObserveAll(start, walls);
  observations[0].length = 2.0;
  // The motion of the first scan does not count.
  builder.AddKeyScan(17, Motion(Pose2(9.0, 9.0, 1.0)), observations, start);
  EXPECT_EQ(builder.robot(), start);
  EXPECT_EQ(builder.num_created(), 4);
  EXPECT_EQ(builder.num_matches(), 0);
  const std::vector<const Feature*> segments = Segments();
  ASSERT_EQ(segments.size(), 4u);
  EXPECT_EQ(graph_.num_features(), 4u);
  const double lengths[] = {2.0, 4.0, 6.0, 4.0};
  for (int i = 0; i < 4; ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(segments[i]->fixed, i == 2);
    const Eigen::Vector2d middle = 0.5 * (walls[i].a + walls[i].b);
    EXPECT_NEAR((PoseOf(*segments[i]).head<2>() - middle).norm(), 0.0, 1e-12);
    // The room is on the left.
    EXPECT_NEAR(
        NormalizeAngle(segments[i]->parameters[2] - 0.2 - i * 0.5 * kPi), 0.0,
        1e-12);
    EXPECT_NEAR(segments[i]->extent_begin, -0.5 * lengths[i], 1e-12);
    EXPECT_NEAR(segments[i]->extent_end, 0.5 * lengths[i], 1e-12);
    EXPECT_EQ(segments[i]->observations, 1);
    EXPECT_EQ(segments[i]->level, 0);
    EXPECT_FALSE(segments[i]->is_virtual);
    EXPECT_EQ(segments[i]->source, "frontend");
  }
  ASSERT_EQ(builder.records().size(), 1u);
  const KeyScanRecord& record = builder.records()[0];
  EXPECT_EQ(record.scan, 17);
  EXPECT_EQ(record.pose, start);
  EXPECT_EQ(record.motion.mean, Pose2::Zero());
  ASSERT_EQ(record.matches.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(record.matches[i].feature, segments[i]->id);
    EXPECT_EQ(record.matches[i].observation.pose, observations[i].pose);
  }
}

TEST_F(MapBuilderTest, WithinScanRelationsAreLimitedAndToTheNearest) {
  MapBuilderOptions options = LinkOptions();
  options.links_within_scan = 2;
  MapBuilder builder(&graph_, registry_, options);
  // Five parallel walls, 2 m apart.
  std::vector<WallEnds> walls;
  for (int i = 0; i < 5; ++i) {
    walls.push_back({{-1.0, 2.0 * i}, {1.0, 2.0 * i}});
  }
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(Pose2(0.0, -1.0, 0.0), walls),
                     Pose2(0.0, -1.0, 0.0));
  std::map<std::vector<FeatureId>, int> pairs;
  for (const Constraint* constraint : Relations()) {
    ++pairs[constraint->features];
  }
  const std::map<std::vector<FeatureId>, int> expected = {
      {{0, 1}, 1}, {{0, 2}, 1}, {{1, 2}, 1}, {{1, 3}, 1},
      {{2, 3}, 1}, {{2, 4}, 1}, {{3, 4}, 1}};
  EXPECT_EQ(pairs, expected);
}

TEST_F(MapBuilderTest, SquareRoomDrivenAroundGivesFourWalls) {
  const std::vector<WallEnds> walls = Room(8.0, 6.0);
  Laser laser;  // the half circle ahead
  laser.sigma = 0.01;
  Noise noise(21);
  MapBuilder builder(&graph_, registry_, LinkOptions());
  SegmentExtractionOptions extraction;
  std::vector<Pose2> motions;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < (side % 2 == 0 ? 12 : 6); ++i) {
      motions.emplace_back(0.4, 0.0, 0.0);
    }
    for (int i = 0; i < 6; ++i) motions.emplace_back(0.0, 0.0, DegToRad(15.0));
  }
  Pose2 truth(-2.4, -1.4, 0.0);
  UncertainPose2 reported = Motion(Pose2::Zero());
  std::vector<double> first_lengths;
  for (std::size_t i = 0; i <= motions.size(); ++i) {
    const Scan scan = MakeScan(walls, truth, laser, &noise);
    builder.AddKeyScan(static_cast<int>(i), reported,
                       ExtractSegments(PointsOf(scan), Eigen::Vector2d::Zero(),
                                       laser.angle_step, extraction),
                       truth);
    ASSERT_LT(PositionError(builder.robot(), truth), 0.06) << i;
    ASSERT_LT(HeadingError(builder.robot(), truth), DegToRad(1.0)) << i;
    if (i == 0) {
      for (const Feature* feature : Segments()) {
        first_lengths.push_back(feature->extent_end - feature->extent_begin);
      }
    }
    if (i == motions.size()) break;
    truth = Compose(truth, motions[i]);
    reported = Motion(motions[i] + Pose2(noise.Normal(0.02), noise.Normal(0.02),
                                         noise.Normal(DegToRad(0.7))),
                      0.02, DegToRad(0.7));
  }
  const std::vector<const Feature*> segments = Segments();
  ASSERT_EQ(segments.size(), 4u);
  EXPECT_EQ(builder.num_created(), 4);
  EXPECT_EQ(builder.records().size(), motions.size() + 1);
  int fixed = 0;
  bool grown = false;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Feature& feature = *segments[i];
    SCOPED_TRACE(PoseOf(feature).transpose());
    const Pose2 pose = PoseOf(feature);
    const double turned = std::remainder(pose[2], 0.5 * kPi);
    EXPECT_NEAR(turned, 0.0, DegToRad(1.0));
    const bool horizontal = std::abs(std::cos(pose[2])) > 0.5;
    EXPECT_NEAR(Inverse(pose)[1], horizontal ? 3.0 : 4.0, 0.06);
    const double length = feature.extent_end - feature.extent_begin;
    EXPECT_GT(length, (horizontal ? 8.0 : 6.0) - 0.5);
    EXPECT_LT(length, (horizontal ? 8.0 : 6.0) + 0.3);
    if (i < first_lengths.size()) grown |= length > first_lengths[i] + 0.5;
    EXPECT_GT(feature.observations, 10);
    fixed += feature.fixed;
  }
  EXPECT_EQ(fixed, 1);
  EXPECT_TRUE(grown);
}

TEST_F(MapBuilderTest, RelationsHoldAndTheirInformationIsSound) {
  // Noise free: what relations expect is what the features are.
  MapBuilder builder(&graph_, registry_, LinkOptions());
  std::vector<WallEnds> walls = Room(8.0, 6.0);
  Pose2 robot(0.0, -1.0, 0.3);
  const Pose2 step(0.3, 0.0, 0.1);
  for (int i = 0; i < 8; ++i) {
    // One wall after the other comes into sight.
    const std::vector<WallEnds> seen(walls.begin(),
                                     walls.begin() + std::min(4, 1 + i / 2));
    builder.AddKeyScan(i, Motion(step), ObserveAll(robot, seen), robot);
    ASSERT_LT((builder.robot() - robot).norm(), 1e-6);
    robot = Compose(robot, step);
  }
  ASSERT_EQ(Segments().size(), 4u);
  const std::vector<const Constraint*> relations = Relations();
  EXPECT_EQ(relations.size(), 6u);  // every pair
  for (const Constraint* constraint : relations) {
    EXPECT_EQ(constraint->type->name, "pose_pose");
    EXPECT_EQ(constraint->kind, ConstraintClass::kMeasurement);
    EXPECT_EQ(constraint->state, ConstraintState::kLive);
    EXPECT_EQ(constraint->source, "frontend");
    Eigen::Vector3d error =
        Between(PoseOf(graph_.GetFeature(constraint->features[0])),
                PoseOf(graph_.GetFeature(constraint->features[1]))) -
        constraint->expected;
    error[2] = NormalizeAngle(error[2]);
    EXPECT_LT(error.norm(), 1e-6);
    const Eigen::Matrix3d information = constraint->information;
    EXPECT_LT((information - information.transpose()).norm(),
              1e-9 * information.norm());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information)
                  .eigenvalues()[0],
              0.0);
  }
}

TEST_F(MapBuilderTest, FeaturesStayWhileTheRobotIsCorrected) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const std::vector<WallEnds> walls = Room(8.0, 6.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()), ObserveAll(Pose2::Zero(), walls),
                     Pose2::Zero());
  std::vector<Pose2> before;
  for (const Feature* feature : Segments()) before.push_back(PoseOf(*feature));
  // Odometry says 0.3 m, truth is 0.35 m and 1.5 degrees.
  const Pose2 truth(0.35, 0.02, DegToRad(1.5));
  builder.AddKeyScan(1, Motion(Pose2(0.3, 0.0, 0.0), 0.05, DegToRad(2.0)),
                     ObserveAll(truth, walls), Pose2::Zero());
  EXPECT_EQ(builder.num_matches(), 4);
  EXPECT_EQ(builder.num_created(), 4);
  EXPECT_LT(PositionError(builder.robot(), truth), 0.02);
  EXPECT_LT(HeadingError(builder.robot(), truth), DegToRad(0.3));
  const std::vector<const Feature*> segments = Segments();
  ASSERT_EQ(segments.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(PoseOf(*segments[i]), before[i]);
    EXPECT_EQ(segments[i]->observations, 2);
  }
  ASSERT_EQ(builder.records().size(), 2u);
  EXPECT_EQ(builder.records()[1].motion.mean, Pose2(0.3, 0.0, 0.0));
  EXPECT_EQ(builder.records()[1].pose, builder.robot());
  EXPECT_EQ(builder.records()[1].matches.size(), 4u);
}

TEST_F(MapBuilderTest, ExtentsGrowAndNeverShrink) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const Pose2 robot(0.0, 2.0, 0.0);
  const auto look = [&](double begin, double end) {
    builder.AddKeyScan(0, Motion(Pose2::Zero()),
                       {Observe(robot, WallEnds{{begin, 0.0}, {end, 0.0}})},
                       robot);
    const std::vector<const Feature*> segments = Segments();
    EXPECT_EQ(segments.size(), 1u);
    return Eigen::Vector2d(segments[0]->extent_begin, segments[0]->extent_end);
  };
  EXPECT_LT((look(-1.0, 1.0) - Eigen::Vector2d(-1.0, 1.0)).norm(), 1e-9);
  EXPECT_LT((look(0.0, 3.0) - Eigen::Vector2d(-1.0, 3.0)).norm(), 1e-6);
  EXPECT_LT((look(-0.5, 0.5) - Eigen::Vector2d(-1.0, 3.0)).norm(), 1e-6);
  EXPECT_LT((look(-2.0, -0.5) - Eigen::Vector2d(-2.0, 3.0)).norm(), 1e-6);
}

TEST_F(MapBuilderTest, TheLastLinkStaysWhenAllAreBeyondTheRadius) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(Pose2::Zero(), {{{-1.0, 1.0}, {1.0, 1.0}},
                                                {{-1.0, -1.0}, {1.0, -1.0}}}),
                     Pose2::Zero());
  // Nothing is recognized for 20 m.
  for (int i = 1; i <= 10; ++i) {
    builder.AddKeyScan(i, Motion(Pose2(2.0, 0.0, 0.0)), {}, Pose2::Zero());
    EXPECT_EQ(builder.Neighborhood(1).size(), i <= 5 ? 2u : 1u) << i;
  }
  builder.WriteRobot();
  const std::vector<ConstraintId> links =
      graph_.ConstraintsOf(builder.robot_id());
  ASSERT_EQ(links.size(), 1u);
  // Blind for 20 m: 10 steps of 3 cm, and their headings.
  const Eigen::MatrixXd covariance =
      graph_.GetConstraint(links[0]).information.inverse();
  EXPECT_GT(covariance(0, 0), 10.0 * 0.03 * 0.03);
  EXPECT_GT(covariance(2, 2), 10.0 * DegToRad(1.0) * DegToRad(1.0));

  // What comes next is bound to what was seen before.
  const std::size_t before = Relations().size();
  builder.AddKeyScan(11, Motion(Pose2::Zero()),
                     ObserveAll(builder.robot(), {{{19.0, 1.0}, {21.0, 1.0}}}),
                     Pose2::Zero());
  ASSERT_EQ(Segments().size(), 3u);
  const std::vector<const Constraint*> relations = Relations();
  ASSERT_EQ(relations.size(), before + 1);
  EXPECT_LT(relations.back()->features[0], 2);
  EXPECT_EQ(relations.back()->features[1], Segments().back()->id);
  // With the new wall near, the old one's link goes.
  builder.AddKeyScan(12, Motion(Pose2(0.1, 0.0, 0.0)), {}, Pose2::Zero());
  const std::vector<FeatureId> linked = builder.Neighborhood(1);
  EXPECT_EQ(std::count(linked.begin(), linked.end(), Segments().back()->id), 1);
  EXPECT_EQ(std::count(linked.begin(), linked.end(), 0), 0);
  EXPECT_EQ(std::count(linked.begin(), linked.end(), 1), 0);
}

// The scan begins in the middle of a wall, or a column hides it.
TEST_F(MapBuilderTest, TwoPiecesOfAWallInTheFirstScanAreOneFeature) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const Pose2 robot(0.0, 2.0, 0.0);
  const std::vector<SegmentObservation> pieces =
      ObserveAll(robot, {{{-2.0, 0.0}, {-0.05, 0.0}},
                         {{0.05, 0.0}, {2.0, 0.0}},
                         {{-2.0, 4.0}, {2.0, 4.0}}});
  for (int i = 0; i < 5; ++i) {
    builder.AddKeyScan(i, Motion(Pose2::Zero()), pieces, robot);
  }
  const std::vector<const Feature*> segments = Segments();
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_EQ(builder.num_created(), 2);
  EXPECT_EQ(builder.num_matches(), 12);
  EXPECT_NEAR(segments[0]->extent_end - segments[0]->extent_begin, 4.0, 1e-3);
  // Both pieces are on record as that wall, and no relation binds it to itself.
  ASSERT_EQ(builder.records()[0].matches.size(), 3u);
  EXPECT_EQ(builder.records()[0].matches[0].feature, segments[0]->id);
  EXPECT_EQ(builder.records()[0].matches[1].feature, segments[0]->id);
  ASSERT_EQ(Relations().size(), 1u);
  EXPECT_THAT(Relations()[0]->features,
              ElementsAre(segments[0]->id, segments[1]->id));
}

// The longest piece belongs to a wall that a shorter one has made.
TEST_F(MapBuilderTest, TheGaugeIsFixedWhereTheLongestPieceIsOfAnothersWall) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const Pose2 robot(0.0, 2.0, 0.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(robot, {{{-2.0, 0.0}, {-0.05, 0.0}},
                                        {{0.05, 0.0}, {3.0, 0.0}},
                                        {{-1.0, 4.0}, {1.0, 4.0}}}),
                     robot);
  const std::vector<const Feature*> segments = Segments();
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_TRUE(segments[0]->fixed);
  EXPECT_FALSE(segments[1]->fixed);
}

// What begins where a wall ended may be another wall at a small angle.
TEST_F(MapBuilderTest, AContinuationIsNoSighting) {
  MapBuilderOptions options = LinkOptions();
  options.association.max_gap = 0.0;
  MapBuilder builder(&graph_, registry_, options);
  const Pose2 robot(0.0, 2.0, 0.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     {Observe(robot, WallEnds{{-2.0, 0.0}, {0.0, 0.0}})},
                     robot);
  builder.AddKeyScan(1, Motion(Pose2::Zero()),
                     {Observe(robot, WallEnds{{-2.0, 0.0}, {0.0, 0.0}}),
                      Observe(robot, WallEnds{{0.02, 0.0}, {2.0, 0.06}})},
                     robot);
  const std::vector<const Feature*> segments = Segments();
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_NEAR(segments[0]->extent_end - segments[0]->extent_begin, 2.0, 1e-3);
}

// A door leaf 10 cm behind its wall, or a wall at an angle, is another feature.
TEST_F(MapBuilderTest, WhatIsNotInLineInTheFirstScanStaysApart) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const Pose2 robot(0.0, 2.0, 0.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(robot, {{{-2.0, 0.0}, {-0.05, 0.0}},
                                        {{0.05, -0.1}, {2.0, -0.1}},
                                        {{2.1, 0.0}, {4.0, 0.35}}}),
                     robot);
  EXPECT_EQ(Segments().size(), 3u);
}

TEST_F(MapBuilderTest, PiecesOfAWallBehindAColumnAreOneFeature) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const Pose2 robot(0.0, 2.0, 0.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     {Observe(robot, WallEnds{{-2.0, 0.0}, {2.0, 0.0}})},
                     robot);
  builder.AddKeyScan(1, Motion(Pose2::Zero()),
                     {Observe(robot, WallEnds{{-2.0, 0.0}, {-0.5, 0.0}}),
                      Observe(robot, WallEnds{{0.5, 0.0}, {2.0, 0.0}})},
                     robot);
  EXPECT_EQ(Segments().size(), 1u);
  EXPECT_EQ(builder.num_matches(), 2);
}

TEST_F(MapBuilderTest, OppositeFacesOfAThinWallAreTwoFeatures) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const WallEnds above{{-1.0, 0.05}, {1.0, 0.05}};
  const WallEnds below{{-1.0, -0.05}, {1.0, -0.05}};
  const WallEnds end{{3.0, -3.0}, {3.0, 3.0}};
  const Pose2 first(0.0, 1.5, 0.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()), ObserveAll(first, {above, end}),
                     first);
  const Pose2 second(0.0, -1.5, 0.0);
  builder.AddKeyScan(1, Motion(Between(first, second), 0.1),
                     ObserveAll(second, {below, end}), first);
  ASSERT_EQ(Segments().size(), 3u);
  EXPECT_EQ(builder.num_matches(), 1);
}

TEST_F(MapBuilderTest, LinksBeyondTheRadiusAreCut) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const WallEnds near{{0.0, 1.0}, {2.0, 1.0}};
  const WallEnds ahead{{9.0, 1.0}, {12.0, 1.0}};
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(Pose2::Zero(), {near, ahead}), Pose2::Zero());
  EXPECT_THAT(builder.Neighborhood(1), ElementsAre(0, 1));
  // At 11.8 m, 9.8 m from the end of the first wall.
  builder.AddKeyScan(1, Motion(Pose2(11.8, 0.0, 0.0)), {}, Pose2::Zero());
  EXPECT_THAT(builder.Neighborhood(1), ElementsAre(0, 1));
  builder.AddKeyScan(2, Motion(Pose2(0.4, 0.0, 0.0)), {}, Pose2::Zero());
  EXPECT_THAT(builder.Neighborhood(1), ElementsAre(1));
  // The first wall is bound to the second.
  EXPECT_THAT(builder.Neighborhood(2), ElementsAre(0, 1));
  EXPECT_THAT(builder.Neighborhood(3), ElementsAre(0, 1));

  builder.WriteRobot();
  EXPECT_THAT(builder.Neighborhood(1), ElementsAre(1, builder.robot_id()));
  const std::vector<ConstraintId> links =
      graph_.ConstraintsOf(builder.robot_id());
  ASSERT_EQ(links.size(), 1u);
  EXPECT_THAT(graph_.GetConstraint(links[0]).features,
              ElementsAre(1, builder.robot_id()));
}

TEST_F(MapBuilderTest, AssociationGoesAsDeepAsAllowed) {
  // The first wall is no longer linked but bound to the second, which is: it
  // is known again two constraints deep, and new at depth one.
  for (int depth : {1, 2}) {
    SCOPED_TRACE(depth);
    Graph graph;
    MapBuilderOptions options = LinkOptions();
    options.association_depth = depth;
    options.link_radius = 3.0;
    MapBuilder builder(&graph, registry_, options);
    const WallEnds first{{-2.0, 1.0}, {0.0, 1.0}};
    const WallEnds second{{1.0, -1.0}, {6.0, -1.0}};
    builder.AddKeyScan(0, Motion(Pose2::Zero()),
                       ObserveAll(Pose2::Zero(), {first, second}),
                       Pose2::Zero());
    builder.AddKeyScan(1, Motion(Pose2(4.0, 0.0, 0.0)), {}, Pose2::Zero());
    EXPECT_THAT(builder.Neighborhood(1), ElementsAre(1));
    builder.AddKeyScan(2, Motion(Pose2::Zero()),
                       ObserveAll(Pose2(4.0, 0.0, 0.0), {first, second}),
                       Pose2::Zero());
    EXPECT_EQ(graph.num_features(), depth == 1 ? 3u : 2u);
  }
}

TEST_F(MapBuilderTest, NewFeaturesAreBoundToLinkedOnes) {
  MapBuilderOptions options = LinkOptions();
  options.links_per_feature = 2;
  MapBuilder builder(&graph_, registry_, options);
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(Pose2::Zero(), Room(6.0, 4.0)), Pose2::Zero());
  const WallEnds pillar{{1.0, 0.5}, {1.0, 1.2}};
  const Pose2 robot(0.1, 0.0, 0.0);
  std::vector<WallEnds> walls = Room(6.0, 4.0);
  walls.push_back(pillar);
  builder.AddKeyScan(1, Motion(robot), ObserveAll(robot, walls), Pose2::Zero());
  ASSERT_EQ(Segments().size(), 5u);
  EXPECT_EQ(builder.num_created(), 5);
  int bound = 0;
  for (const Constraint* constraint : Relations()) {
    if (constraint->features[1] != 4) continue;
    EXPECT_LT(constraint->features[0], 4);
    ++bound;
  }
  EXPECT_EQ(bound, 2);
  EXPECT_FALSE(graph_.GetFeature(4).fixed);
}

TEST_F(MapBuilderTest, SecondLooksRaiseTheInformation) {
  MapBuilderOptions options = LinkOptions();
  options.second_look_weight = 0.2;
  options.relation_floor_angle = DegToRad(0.1);
  options.relation_floor_position = 0.001;
  options.along_sigma = 0.02;
  MapBuilder builder(&graph_, registry_, options);
  const std::vector<WallEnds> walls = {{{-2.0, -1.0}, {2.0, -1.0}},
                                       {{-2.0, 1.0}, {2.0, 1.0}}};
  const std::vector<SegmentObservation> observations =
      ObserveAll(Pose2::Zero(), walls);
  double angle = 0.0;
  double across = 0.0;
  double along = 0.0;
  for (int i = 0; i < 4; ++i) {
    builder.AddKeyScan(i, Motion(Pose2::Zero()), observations, Pose2::Zero());
    const std::vector<const Constraint*> relations = Relations();
    ASSERT_EQ(relations.size(), 1u);
    const Eigen::MatrixXd& information = relations[0]->information;
    if (i == 0) {
      along = information(0, 0);
    } else {
      EXPECT_GT(information(2, 2), 1.02 * angle) << i;
      EXPECT_GT(information(1, 1), 1.02 * across) << i;
      // Nothing is learnt along the walls.
      EXPECT_NEAR(information(0, 0), along, 0.01 * along) << i;
    }
    angle = information(2, 2);
    across = information(1, 1);
  }
}

TEST_F(MapBuilderTest, SecondLooksNeverPassTheFloor) {
  MapBuilderOptions options = LinkOptions();
  options.second_look_weight = 0.2;
  options.relation_floor_angle = DegToRad(0.2);
  options.relation_floor_position = 0.005;
  MapBuilder builder(&graph_, registry_, options);
  const std::vector<SegmentObservation> observations =
      ObserveAll(Pose2::Zero(), Room(6.0, 4.0));
  std::vector<double> before;
  for (int i = 0; i < 100; ++i) {
    builder.AddKeyScan(i, Motion(Pose2::Zero()), observations, Pose2::Zero());
    if (i == 98) {
      for (const Constraint* constraint : Relations()) {
        before.push_back(constraint->information.norm());
      }
    }
  }
  const double limit = 1.0 / (DegToRad(0.2) * DegToRad(0.2));
  const double limit_position = 1.0 / (0.005 * 0.005);
  const std::vector<const Constraint*> relations = Relations();
  ASSERT_EQ(relations.size(), 6u);
  for (std::size_t i = 0; i < relations.size(); ++i) {
    const Eigen::MatrixXd& information = relations[i]->information;
    EXPECT_LE(information(2, 2), limit * (1.0 + 1e-9));
    EXPECT_LE(information(0, 0), limit_position * (1.0 + 1e-9));
    EXPECT_LE(information(1, 1), limit_position * (1.0 + 1e-9));
    EXPECT_EQ(relations[i]->information.norm(), before[i]);
  }
}

TEST_F(MapBuilderTest, WriteAndReadTheRobot) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  builder.ReadRobot();  // nothing there yet
  EXPECT_EQ(builder.robot_id(), kNoId);
  EXPECT_EQ(builder.robot(), Pose2::Zero());
  const Pose2 robot(0.5, 0.2, 3.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(robot, Room(6.0, 4.0)), robot);
  builder.WriteRobot();
  const FeatureId id = builder.robot_id();
  ASSERT_NE(graph_.FindFeature(id), nullptr);
  EXPECT_EQ(graph_.GetFeature(id).type->name, "pose");
  EXPECT_EQ(PoseOf(graph_.GetFeature(id)), robot);
  EXPECT_FALSE(graph_.GetFeature(id).fixed);
  ASSERT_EQ(graph_.ConstraintsOf(id).size(), 4u);
  for (ConstraintId link : graph_.ConstraintsOf(id)) {
    const Constraint& constraint = graph_.GetConstraint(link);
    ASSERT_EQ(constraint.features[1], id);
    const Pose2 feature = PoseOf(graph_.GetFeature(constraint.features[0]));
    EXPECT_LT((constraint.expected - Between(feature, robot)).norm(), 1e-12);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(
                  Eigen::Matrix3d(constraint.information))
                  .eigenvalues()[0],
              0.0);
  }
  // A second time replaces the links.
  const std::size_t constraints = graph_.num_constraints();
  builder.WriteRobot();
  EXPECT_EQ(builder.robot_id(), id);
  EXPECT_EQ(graph_.num_features(), 5u);
  EXPECT_EQ(graph_.num_constraints(), constraints);

  // A solve moves the robot; the heading comes back wrapped.
  graph_.GetFeature(id).parameters = {0.6, 0.1, 3.0 + 2.0 * kPi};
  builder.ReadRobot();
  EXPECT_LT((builder.robot() - Pose2(0.6, 0.1, 3.0)).norm(), 1e-12);
  // The robot is neither a wall nor doubled by the next scan.
  const Pose2 step(0.2, 0.0, 0.0);
  builder.AddKeyScan(1, Motion(step),
                     ObserveAll(Compose(builder.robot(), step), Room(6.0, 4.0)),
                     robot);
  builder.WriteRobot();
  EXPECT_EQ(graph_.num_features(), 5u);
  EXPECT_EQ(PoseOf(graph_.GetFeature(id)), builder.robot());
}

TEST_F(MapBuilderTest, FollowsAMovedMap) {
  // The back-end moved features and robot: the next scan is recognized there.
  MapBuilder builder(&graph_, registry_, LinkOptions());
  const std::vector<WallEnds> walls = Room(6.0, 4.0);
  builder.AddKeyScan(0, Motion(Pose2::Zero()), ObserveAll(Pose2::Zero(), walls),
                     Pose2::Zero());
  builder.WriteRobot();
  const Pose2 move(3.0, -2.0, 0.4);
  for (Feature* feature : graph_.MutableFeatures()) {
    const Pose2 moved = Compose(move, PoseOf(*feature));
    feature->parameters = {moved[0], moved[1], moved[2]};
  }
  builder.ReadRobot();
  const Pose2 step(0.3, 0.0, 0.1);
  builder.AddKeyScan(1, Motion(step), ObserveAll(step, walls), Pose2::Zero());
  EXPECT_EQ(builder.num_matches(), 4);
  EXPECT_EQ(builder.num_created(), 4);
  EXPECT_LT((builder.robot() - Compose(move, step)).norm(), 1e-6);
}

TEST_F(MapBuilderTest, ScansWithoutSegments) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  builder.AddKeyScan(0, Motion(Pose2::Zero()), {}, Pose2(1.0, 1.0, 0.0));
  builder.AddKeyScan(1, Motion(Pose2(0.5, 0.0, 0.1)), {}, Pose2::Zero());
  EXPECT_EQ(graph_.num_features(), 0u);
  EXPECT_LT((builder.robot() - Pose2(1.5, 1.0, 0.1)).norm(), 1e-12);
  builder.AddKeyScan(
      2, Motion(Pose2::Zero()),
      {Observe(builder.robot(), WallEnds{{0.0, 0.0}, {2.0, 0.0}})},
      Pose2::Zero());
  ASSERT_EQ(graph_.num_features(), 1u);
  // The first that there is fixes the gauge.
  EXPECT_TRUE(graph_.GetFeature(0).fixed);
  EXPECT_EQ(builder.records().size(), 3u);
}

TEST_F(MapBuilderTest, UncertaintyGrowsWhileBlind) {
  MapBuilder builder(&graph_, registry_, LinkOptions());
  builder.AddKeyScan(0, Motion(Pose2::Zero()),
                     ObserveAll(Pose2::Zero(), Room(6.0, 4.0)), Pose2::Zero());
  builder.WriteRobot();
  const auto information = [&] {
    const auto& links = graph_.ConstraintsOf(builder.robot_id());
    return graph_.GetConstraint(links.front()).information;
  };
  double before = information()(2, 2);
  for (int i = 1; i < 4; ++i) {
    builder.AddKeyScan(i, Motion(Pose2(0.2, 0.0, 0.0)), {}, Pose2::Zero());
    builder.WriteRobot();
    EXPECT_LT(information()(2, 2), before);
    before = information()(2, 2);
  }
  // A look around makes up for it.
  builder.AddKeyScan(4, Motion(Pose2::Zero()),
                     ObserveAll(builder.robot(), Room(6.0, 4.0)),
                     Pose2::Zero());
  builder.WriteRobot();
  EXPECT_GT(information()(2, 2), before);
}

TEST_F(MapBuilderTest, SameMapTenKilometresAway) {
  Graph there;
  MapBuilder builder(&graph_, registry_, LinkOptions());
  MapBuilder far(&there, registry_, LinkOptions());
  const Pose2 shift(10000.0, -10000.0, 0.0);
  Pose2 robot(0.0, -1.0, 0.3);
  const Pose2 start = robot;
  const Pose2 step(0.3, 0.0, 0.1);
  for (int i = 0; i < 6; ++i) {
    const auto observations = ObserveAll(robot, Room(8.0, 6.0));
    // Odometry is a little off.
    const UncertainPose2 motion = Motion(step + Pose2(0.01, -0.01, 0.005));
    builder.AddKeyScan(i, motion, observations, start);
    far.AddKeyScan(i, motion, observations, start + shift);
    robot = Compose(robot, step);
  }
  EXPECT_LT((far.robot() - shift - builder.robot()).norm(), 1e-6);
  ASSERT_EQ(there.num_features(), graph_.num_features());
  ASSERT_EQ(there.num_constraints(), graph_.num_constraints());
  for (const Constraint* constraint : graph_.Constraints()) {
    const Constraint& other = there.GetConstraint(constraint->id);
    EXPECT_LT((other.expected - constraint->expected).norm(), 1e-6);
    EXPECT_LT((other.information - constraint->information).norm(),
              1e-5 * constraint->information.norm());
  }
}

}  // namespace
}  // namespace plumbline
