#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/session.h>
#include <plumbline/frontend/point_map_builder.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::FullCircle;
using testing::HeadingError;
using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::Observe;
using testing::PointsOf;
using testing::PositionError;
using testing::Room;
using testing::WallEnds;

UncertainPose2 QuietMotion(const Pose2& mean, double position_sigma = 0.02,
                           double angle_sigma = DegToRad(0.7)) {
  UncertainPose2 motion;
  motion.mean = mean;
  motion.covariance = Eigen::Vector3d(position_sigma * position_sigma,
                                      position_sigma * position_sigma,
                                      angle_sigma * angle_sigma)
                          .asDiagonal();
  return motion;
}

std::vector<SegmentObservation> ObserveSurfaces(
    const Pose2& robot, const std::vector<WallEnds>& walls) {
  std::vector<SegmentObservation> surfaces;
  for (const WallEnds& wall : walls) surfaces.push_back(Observe(robot, wall));
  return surfaces;
}

KeyScan KeyScanOf(const Scan& scan, const UncertainPose2& motion,
                  const Pose2& start) {
  KeyScan key;
  key.motion = motion;
  key.start = start;
  key.returns = PointsOf(scan);
  key.laser = scan.laser_offset.head<2>();
  key.angle_step = scan.angle_step;
  return key;
}

class PointMapBuilderTest : public ::testing::Test {
 protected:
  PointMapBuilderTest() { RegisterBuiltinRelations(&registry_); }

  std::vector<const Feature*> Points() const {
    std::vector<const Feature*> points;
    for (const Feature* feature : graph_.Features()) {
      if (feature->type->name == "point") points.push_back(feature);
    }
    return points;
  }

  std::vector<const Constraint*> Distances() const {
    std::vector<const Constraint*> distances;
    for (const Constraint* constraint : graph_.Constraints()) {
      if (constraint->type->name == "point_point_distance") {
        distances.push_back(constraint);
      }
    }
    return distances;
  }

  static Eigen::Vector2d PositionOf(const Feature& feature) {
    return {feature.parameters[0], feature.parameters[1]};
  }

  // Without the robot's own pose.
  void AddKeyScan(PointMapBuilder* builder, int scan,
                  const std::vector<WallEnds>& walls, const Pose2& robot,
                  const UncertainPose2& motion) {
    builder->AddKeyScan(scan, motion, ObserveSurfaces(robot, walls),
                        Eigen::Vector2d::Zero(), robot);
  }

  Registry registry_;
  Graph graph_;
  PointMapBuilderOptions options_;
};

TEST_F(PointMapBuilderTest, FirstScanPutsPointsOnTheWalls) {
  PointMapBuilder builder(&graph_, registry_, options_);
  const Pose2 robot(0.5, -0.5, 0.3);
  // The motion of the first scan does not count.
  AddKeyScan(&builder, 17, Room(6.0, 4.0), robot, QuietMotion(Pose2(9, 9, 1)));
  EXPECT_EQ(builder.robot(), robot);
  EXPECT_EQ(builder.feature_type(), "point");
  // 5.8 m and 3.8 m between the margins: 12 and 8 points a wall.
  EXPECT_EQ(builder.num_created(), 40);
  EXPECT_EQ(builder.num_matches(), 0);
  const std::vector<const Feature*> points = Points();
  ASSERT_EQ(points.size(), 40u);
  std::map<int, int> on_wall;
  std::vector<Eigen::Vector2d> fixed;
  for (const Feature* point : points) {
    const Eigen::Vector2d p = PositionOf(*point);
    const double off[] = {std::abs(p.y() + 2.0), std::abs(p.x() - 3.0),
                          std::abs(p.y() - 2.0), std::abs(p.x() + 3.0)};
    const int wall = static_cast<int>(std::min_element(off, off + 4) - off);
    EXPECT_LT(off[wall], 1e-12) << p.transpose();
    ++on_wall[wall];
    EXPECT_EQ(point->observations, 1);
    EXPECT_EQ(point->level, 0);
    EXPECT_FALSE(point->is_virtual);
    EXPECT_EQ(point->source, "frontend");
    if (point->fixed) fixed.push_back(p);
  }
  EXPECT_EQ(on_wall, (std::map<int, int>{{0, 12}, {1, 8}, {2, 12}, {3, 8}}));
  // Two hold the map in place: as far apart as there are.
  ASSERT_EQ(fixed.size(), 2u);
  EXPECT_GT((fixed[0] - fixed[1]).norm(), 6.8);

  std::map<FeatureId, int> made_by;
  for (const Constraint* distance : Distances()) {
    const double length =
        (PositionOf(graph_.GetFeature(distance->features[0])) -
         PositionOf(graph_.GetFeature(distance->features[1])))
            .norm();
    EXPECT_NEAR(distance->expected[0], length, 1e-12);
    EXPECT_EQ(distance->kind, ConstraintClass::kMeasurement);
    EXPECT_GT(distance->information(0, 0), 0.0);
    EXPECT_LE(distance->information(0, 0),
              1.0 / (options_.distance_floor * options_.distance_floor) + 1e-6);
    // The earlier one comes first.
    EXPECT_LT(distance->features[0], distance->features[1]);
    ++made_by[distance->features[1]];
  }
  EXPECT_EQ(made_by.size(), 39u);
  for (const auto& [id, count] : made_by) {
    EXPECT_EQ(count, std::min<int>(options_.links_per_point, id)) << id;
  }

  ASSERT_EQ(builder.records().size(), 1u);
  EXPECT_EQ(builder.records()[0].scan, 17);
  EXPECT_EQ(builder.records()[0].pose, robot);
  EXPECT_TRUE(builder.records()[0].matches.empty());
  ASSERT_EQ(builder.records()[0].points.size(), 40u);
  for (const PointMatch& match : builder.records()[0].points) {
    EXPECT_LT((TransformPoint(robot, match.observation.position) -
               PositionOf(graph_.GetFeature(match.feature)))
                  .norm(),
              1e-12);
  }
}

TEST_F(PointMapBuilderTest, LinksGoInDifferentDirections) {
  // A corridor: along one wall there are nearer points than across, but with
  // these alone the walls could bend.
  PointMapBuilder builder(&graph_, registry_, options_);
  const std::vector<WallEnds> walls = {{{-4, -1}, {4, -1}}, {{4, 1}, {-4, 1}}};
  AddKeyScan(&builder, 0, walls, Pose2::Zero(), QuietMotion(Pose2::Zero()));
  ASSERT_EQ(builder.num_created(), 32);
  std::map<FeatureId, std::pair<int, int>> links;  // along, across
  for (const Constraint* distance : Distances()) {
    const Eigen::Vector2d arm =
        PositionOf(graph_.GetFeature(distance->features[0])) -
        PositionOf(graph_.GetFeature(distance->features[1]));
    auto& count = links[distance->features[1]];
    ++(std::abs(arm.y()) < 1e-9 ? count.first : count.second);
  }
  // The second wall: one neighbour behind, four across.
  for (FeatureId id = 17; id < 32; ++id) {
    EXPECT_EQ(links[id].first + links[id].second, 5) << id;
    EXPECT_GE(links[id].second, 2) << id;
    EXPECT_GE(links[id].first, 1) << id;
  }
}

TEST_F(PointMapBuilderTest, RoomDrivenAroundKeepsItsPoints) {
  const std::vector<WallEnds> walls = Room(8.0, 6.0);
  Laser laser;  // the half circle ahead
  laser.sigma = 0.01;
  Noise noise(21);
  PointMapBuilder builder(&graph_, registry_, options_);
  std::vector<Pose2> motions;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < (side % 2 == 0 ? 12 : 6); ++i) {
      motions.emplace_back(0.4, 0.0, 0.0);
    }
    for (int i = 0; i < 6; ++i) motions.emplace_back(0.0, 0.0, DegToRad(15.0));
  }
  Pose2 truth(-2.4, -1.4, 0.0);
  UncertainPose2 reported = QuietMotion(Pose2::Zero());
  for (std::size_t i = 0; i <= motions.size(); ++i) {
    builder.AddScan(
        KeyScanOf(MakeScan(walls, truth, laser, &noise), reported, truth));
    ASSERT_LT(PositionError(builder.robot(), truth), 0.06) << i;
    ASSERT_LT(HeadingError(builder.robot(), truth), DegToRad(1.0)) << i;
    if (i == motions.size()) break;
    truth = Compose(truth, motions[i]);
    reported =
        QuietMotion(motions[i] + Pose2(noise.Normal(0.02), noise.Normal(0.02),
                                       noise.Normal(DegToRad(0.7))));
  }
  // 28 m of walls, a point each half metre, and none twice.
  EXPECT_GE(builder.num_created(), 45);
  EXPECT_LE(builder.num_created(), 64);
  EXPECT_GT(builder.num_matches(), 1000);
  for (const Feature* point : Points()) {
    const Eigen::Vector2d p = PositionOf(*point);
    const double off = std::min(
        {std::abs(std::abs(p.x()) - 4.0), std::abs(std::abs(p.y()) - 3.0)});
    EXPECT_LT(off, 0.06) << p.transpose();
  }
  // A solve finds nothing to complain of.
  builder.WriteRobot();
  SolverSession session(&graph_, registry_, SessionOptions());
  ASSERT_TRUE(session.SolveGlobal().usable);
  builder.ReadRobot();
  EXPECT_LT(PositionError(builder.robot(), truth), 0.06);
  EXPECT_LT(HeadingError(builder.robot(), truth), DegToRad(1.0));
}

TEST_F(PointMapBuilderTest, SecondLooksSharpenWhatTheySee) {
  PointMapBuilder builder(&graph_, registry_, options_);
  const std::vector<WallEnds> walls = {{{-1, -1}, {1, -1}}, {{1, 1}, {-1, 1}}};
  AddKeyScan(&builder, 0, walls, Pose2::Zero(), QuietMotion(Pose2::Zero()));
  // Across from each other, and neighbours on a wall.
  const auto find = [&](const Eigen::Vector2d& arm) -> const Constraint* {
    for (const Constraint* distance : Distances()) {
      const Eigen::Vector2d between =
          PositionOf(graph_.GetFeature(distance->features[1])) -
          PositionOf(graph_.GetFeature(distance->features[0]));
      if ((between - arm).norm() < 0.03) return distance;
    }
    return nullptr;
  };
  const Constraint* across = find({0.0, 2.0});
  const Constraint* along = find({0.45, 0.0});
  ASSERT_NE(across, nullptr);
  ASSERT_NE(along, nullptr);
  const double across_before = across->information(0, 0);
  const double along_before = along->information(0, 0);
  // Both walls a centimetre farther out.
  const std::vector<WallEnds> seen = {{{-1, -1.01}, {1, -1.01}},
                                      {{1, 1.01}, {-1, 1.01}}};
  AddKeyScan(&builder, 1, seen, Pose2::Zero(), QuietMotion(Pose2::Zero()));
  EXPECT_EQ(builder.num_created(), 8);
  EXPECT_EQ(builder.num_matches(), 8);
  EXPECT_GT(across->information(0, 0), 1.1 * across_before);
  EXPECT_GT(across->expected[0], 2.001);
  EXPECT_LT(across->expected[0], 2.02);
  // A wall does not tell where on it the points were chosen.
  EXPECT_NEAR(along->information(0, 0), along_before, 1e-3 * along_before);
  EXPECT_NEAR(along->expected[0], 0.45, 1e-3);
  // However often they are seen.
  for (int i = 2; i < 200; ++i) {
    AddKeyScan(&builder, i, seen, Pose2::Zero(), QuietMotion(Pose2::Zero()));
  }
  EXPECT_EQ(builder.num_created(), 8);
  EXPECT_LE(across->information(0, 0),
            1.0 / (options_.distance_floor * options_.distance_floor) + 1e-6);
  EXPECT_NEAR(across->expected[0], 2.02, 0.005);
}

TEST_F(PointMapBuilderTest, AWallThatComesIntoSightGetsPointsInStep) {
  PointMapBuilder builder(&graph_, registry_, options_);
  const Pose2 step(0.4, 0.0, 0.0);
  for (int i = 0; i < 6; ++i) {
    const double end = 2.0 + 0.8 * i;
    const std::vector<WallEnds> walls = {{{-2, -1}, {end, -1}},
                                         {{end, 1}, {-2, 1}}};
    AddKeyScan(&builder, i, walls, Pose2(0.4 * i, 0.0, 0.0), QuietMotion(step));
  }
  std::vector<double> places;
  for (const Feature* point : Points()) {
    if (point->parameters[1] < 0.0) places.push_back(point->parameters[0]);
  }
  std::sort(places.begin(), places.end());
  ASSERT_GE(places.size(), 14u);
  EXPECT_LE(places.size(), 17u);
  for (std::size_t i = 1; i < places.size(); ++i) {
    EXPECT_NEAR(places[i] - places[i - 1], options_.spacing, 0.13);
  }
}

TEST_F(PointMapBuilderTest, FarSurfacesMakeNoPoints) {
  PointMapBuilder builder(&graph_, registry_, options_);
  // At 7 m of 8 m range, 3.87 m of it each way.
  const std::vector<WallEnds> walls = {{{-20, -7}, {20, -7}},
                                       {{20, 8.5}, {-20, 8.5}}};
  AddKeyScan(&builder, 0, walls, Pose2::Zero(), QuietMotion(Pose2::Zero()));
  EXPECT_EQ(builder.num_created(), 15);
  for (const Feature* point : Points()) {
    EXPECT_LE(PositionOf(*point).norm(), 8.0);
    EXPECT_NEAR(point->parameters[1], -7.0, 1e-9);
  }
}

TEST_F(PointMapBuilderTest, FacesOfAThinWallHaveTheirOwnPoints) {
  PointMapBuilder builder(&graph_, registry_, options_);
  const std::vector<WallEnds> this_side = {{{-2, 0}, {2, 0}},
                                           {{-2.2, -1.5}, {-2.2, 0}}};
  const std::vector<WallEnds> that_side = {{{2, 0.05}, {-2, 0.05}},
                                           {{-2.2, 0}, {-2.2, 1.5}}};
  AddKeyScan(&builder, 0, this_side, Pose2(0, -1, 0),
             QuietMotion(Pose2::Zero()));
  const std::int64_t created = builder.num_created();
  AddKeyScan(&builder, 1, that_side, Pose2(0, 1, 0),
             QuietMotion(Pose2(0, 2, 0)));
  EXPECT_EQ(builder.num_matches(), 0);
  EXPECT_GT(builder.num_created(), created + 7);
}

TEST_F(PointMapBuilderTest, LinksAreCutBehind) {
  options_.link_radius = 3.0;
  PointMapBuilder builder(&graph_, registry_, options_);
  const Pose2 step(0.5, 0.0, 0.0);
  for (int i = 0; i < 30; ++i) {
    const double x = 0.5 * i;
    const std::vector<WallEnds> walls = {{{x - 3, -1}, {x + 3, -1}},
                                         {{x + 3, 1}, {x - 3, 1}}};
    AddKeyScan(&builder, i, walls, Pose2(x, 0.0, 0.0), QuietMotion(step));
    const std::vector<FeatureId> near = builder.Neighborhood(1);
    // 6 m of two walls.
    EXPECT_LE(near.size(), 28u) << i;
    for (const FeatureId id : near) {
      EXPECT_LE((PositionOf(graph_.GetFeature(id)) - builder.robot().head<2>())
                    .norm(),
                3.0 + 0.5)
          << i;
    }
  }
}

TEST_F(PointMapBuilderTest, ScansThatSeeNothing) {
  PointMapBuilder builder(&graph_, registry_, options_);
  const Pose2 start(1.0, 2.0, 0.5);
  const Pose2 step(0.3, 0.1, 0.2);
  Scan scan = MakeScan(Room(6.0, 4.0), start, FullCircle());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<Scan> broken(5, scan);
  broken[0].ranges.clear();
  std::fill(broken[1].ranges.begin(), broken[1].ranges.end(), 0.0f);
  std::fill(broken[2].ranges.begin(), broken[2].ranges.end(), nan);
  std::fill(broken[3].ranges.begin(), broken[3].ranges.end(),
            std::numeric_limits<float>::infinity());
  std::fill(broken[4].ranges.begin(), broken[4].ranges.end(), -1.0f);
  Pose2 expected = start;
  for (std::size_t i = 0; i < broken.size(); ++i) {
    builder.AddScan(KeyScanOf(broken[i], QuietMotion(step), start));
    if (i > 0) expected = Compose(expected, step);
    EXPECT_LT((builder.robot() - expected).norm(), 1e-12) << i;
    builder.WriteRobot();
    builder.ReadRobot();
  }
  EXPECT_EQ(builder.num_created(), 0);
  EXPECT_EQ(builder.records().size(), 5u);
  EXPECT_EQ(graph_.num_features(), 1u);  // the robot
  // The first that sees something begins the map; every third beam broken.
  scan = MakeScan(Room(6.0, 4.0), Compose(expected, step), FullCircle());
  for (std::size_t i = 0; i < scan.ranges.size(); i += 3) scan.ranges[i] = nan;
  builder.AddScan(KeyScanOf(scan, QuietMotion(step), start));
  EXPECT_GE(builder.num_created(), 8);
  int fixed = 0;
  for (const Feature* point : Points()) fixed += point->fixed;
  EXPECT_EQ(fixed, 2);
  // And blind again: the links hold.
  builder.AddScan(KeyScanOf(broken[1], QuietMotion(step), start));
  EXPECT_TRUE(builder.robot().allFinite());
}

TEST_F(PointMapBuilderTest, TheRobotInTheGraph) {
  PointMapBuilder builder(&graph_, registry_, options_);
  EXPECT_EQ(builder.robot_id(), kNoId);
  const std::vector<WallEnds> walls = Room(6.0, 4.0);
  AddKeyScan(&builder, 0, walls, Pose2::Zero(), QuietMotion(Pose2::Zero()));
  const Pose2 step(0.3, 0.0, 0.1);
  AddKeyScan(&builder, 1, walls, step, QuietMotion(step));
  for (int round = 0; round < 2; ++round) {
    builder.WriteRobot();
    const FeatureId robot = builder.robot_id();
    ASSERT_NE(robot, kNoId);
    std::size_t links = 0;
    for (const ConstraintId id : graph_.ConstraintsOf(robot)) {
      const Constraint& constraint = graph_.GetConstraint(id);
      EXPECT_EQ(constraint.type->name, "pose_point");
      EXPECT_EQ(constraint.features[0], robot);
      ++links;
    }
    EXPECT_EQ(links, Points().size());
  }
  // Turn and shift the map: the robot goes with it.
  const Pose2 move(0.5, -0.3, 0.2);
  for (Feature* feature : graph_.MutableFeatures()) {
    if (feature->type->name != "point") continue;
    const Eigen::Vector2d moved = TransformPoint(move, PositionOf(*feature));
    feature->parameters[0] = moved.x();
    feature->parameters[1] = moved.y();
  }
  SolverSession session(&graph_, registry_, SessionOptions());
  ASSERT_TRUE(session.SolveLocal({builder.robot_id()}).usable);
  builder.ReadRobot();
  EXPECT_LT(PositionError(builder.robot(), Compose(move, step)), 1e-4);
  EXPECT_LT(HeadingError(builder.robot(), Compose(move, step)), 1e-4);
}

TEST_F(PointMapBuilderTest, SameMapTenKilometresAway) {
  Graph there;
  PointMapBuilder builder(&graph_, registry_, options_);
  PointMapBuilder far(&there, registry_, options_);
  const Eigen::Vector2d away(10000.0, -10000.0);
  const std::vector<WallEnds> walls = Room(8.0, 6.0);
  Laser laser = FullCircle();
  laser.sigma = 0.01;
  Noise noise(3);
  Pose2 robot(-2.0, -1.0, 0.1);
  const Pose2 step(0.3, 0.05, 0.1);
  for (int i = 0; i < 12; ++i) {
    const Scan scan = MakeScan(walls, robot, laser, &noise);
    Pose2 start = robot;
    builder.AddScan(KeyScanOf(scan, QuietMotion(step), start));
    start.head<2>() += away;
    far.AddScan(KeyScanOf(scan, QuietMotion(step), start));
    robot = Compose(robot, step);
  }
  ASSERT_EQ(graph_.num_features(), there.num_features());
  ASSERT_EQ(graph_.num_constraints(), there.num_constraints());
  const auto here_points = Points();
  const auto there_points = std::as_const(there).Features();
  for (std::size_t i = 0; i < here_points.size(); ++i) {
    EXPECT_LT(
        (PositionOf(*there_points[i]) - away - PositionOf(*here_points[i]))
            .norm(),
        1e-6);
  }
}

TEST_F(PointMapBuilderTest, OptionsThatMakeNoSense) {
  PointMapBuilderOptions options;
  options.spacing = 0.0;
  EXPECT_THROW(PointMapBuilder(&graph_, registry_, options), Error);
  options.spacing = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(PointMapBuilder(&graph_, registry_, options), Error);
  options = PointMapBuilderOptions();
  options.links_per_point = 0;
  EXPECT_THROW(PointMapBuilder(&graph_, registry_, options), Error);
}

}  // namespace
}  // namespace plumbline
