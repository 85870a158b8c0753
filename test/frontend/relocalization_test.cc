#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/frontend/relocalization.h>

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::HeadingError;
using testing::Observe;
using testing::PositionError;
using testing::Room;
using testing::WallEnds;

class RelocalizationTest : public ::testing::Test {
 protected:
  RelocalizationTest() {
    RegisterBuiltinRelations(&registry_);
    // Where walls say all, what they say comes out to the last digit.
    options_.start_position_sigma = 0.0;
  }

  // Walls of a room as features, and a drive of `count` key scans that see all
  // of them.
  void Build(int count) {
    const std::vector<WallEnds> walls = Room(8.0, 6.0);
    Transaction transaction;
    for (const WallEnds& wall : walls) {
      const SegmentObservation seen = Observe(Pose2::Zero(), wall);
      Feature feature;
      feature.type = &registry_.GetFeature("segment");
      feature.parameters = {seen.pose[0], seen.pose[1], seen.pose[2]};
      feature.extent_begin = -0.5 * seen.length;
      feature.extent_end = 0.5 * seen.length;
      transaction.AddFeature(feature);
    }
    const std::vector<FeatureId> ids =
        graph_.Apply(std::move(transaction)).features;
    Pose2 robot(-2.0, -1.0, 0.0);
    for (int i = 0; i < count; ++i) {
      const Pose2 step(0.4, 0.0, 0.15);
      KeyScanRecord record;
      record.scan = 10 * i;
      if (i > 0) {
        record.motion.mean = step;
        robot = Compose(robot, step);
      }
      record.motion.covariance =
          Eigen::Vector3d(0.02 * 0.02, 0.02 * 0.02, 0.01 * 0.01).asDiagonal();
      record.pose = robot;
      for (std::size_t k = 0; k < walls.size(); ++k) {
        FeatureMatch match;
        match.feature = ids[k];
        match.observation = Observe(robot, walls[k]);
        record.matches.push_back(match);
      }
      records_.push_back(record);
      truth_.push_back(robot);
    }
  }

  void MoveMap(const Pose2& move) {
    for (Feature* feature : graph_.MutableFeatures()) {
      const Pose2 moved =
          Compose(move, Pose2(feature->parameters[0], feature->parameters[1],
                              feature->parameters[2]));
      feature->parameters = {moved[0], moved[1], moved[2]};
    }
  }

  std::vector<Pose2> Relocalize() const {
    return RelocalizeKeyScans(graph_, records_, options_);
  }

  Registry registry_;
  Graph graph_;
  std::vector<KeyScanRecord> records_;
  std::vector<Pose2> truth_;
  RelocalizationOptions options_;
};

TEST_F(RelocalizationTest, NoRecords) { EXPECT_TRUE(Relocalize().empty()); }

TEST_F(RelocalizationTest, OneRecord) {
  Build(1);
  records_[0].pose += Pose2(0.1, -0.1, 0.03);
  const std::vector<Pose2> poses = Relocalize();
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_LT(PositionError(poses[0], truth_[0]), 1e-4);
  EXPECT_LT(HeadingError(poses[0], truth_[0]), 1e-5);
}

TEST_F(RelocalizationTest, StaysOnAMapThatDidNotMove) {
  Build(10);
  const std::vector<Pose2> poses = Relocalize();
  ASSERT_EQ(poses.size(), 10u);
  for (int i = 0; i < 10; ++i) {
    EXPECT_LT(PositionError(poses[i], truth_[i]), 1e-6) << i;
    EXPECT_LT(HeadingError(poses[i], truth_[i]), 1e-6) << i;
  }
}

TEST_F(RelocalizationTest, FollowsATurnedMap) {
  Build(12);
  const Pose2 move(0.3, -0.2, DegToRad(20.0));
  MoveMap(move);
  const std::vector<Pose2> poses = Relocalize();
  ASSERT_EQ(poses.size(), 12u);
  for (int i = 0; i < 12; ++i) {
    const Pose2 expected = Compose(move, truth_[i]);
    EXPECT_LT(PositionError(poses[i], expected), 1e-3) << i;
    EXPECT_LT(HeadingError(poses[i], expected), 1e-4) << i;
  }
}

TEST_F(RelocalizationTest, FollowsAMapOfPoints) {
  // Points on two walls at right angles, each seen across its wall only.
  Transaction transaction;
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 5; ++i) {
    points.emplace_back(i - 2.0, 3.0);
    points.emplace_back(4.0, i - 2.0);
  }
  const Pose2 move(0.3, -0.2, DegToRad(10.0));
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d moved = TransformPoint(move, point);
    Feature feature;
    feature.type = &registry_.GetFeature("point");
    feature.parameters = {moved.x(), moved.y()};
    transaction.AddFeature(feature);
  }
  const std::vector<FeatureId> ids =
      graph_.Apply(std::move(transaction)).features;
  Pose2 robot(-1.0, -1.0, 0.2);
  for (int k = 0; k < 5; ++k) {
    KeyScanRecord record;
    record.scan = k;
    record.pose = robot;
    if (k > 0) record.motion.mean = Pose2(0.3, 0.0, 0.1);
    record.motion.covariance =
        Eigen::Vector3d(0.02 * 0.02, 0.02 * 0.02, 0.01 * 0.01).asDiagonal();
    for (std::size_t i = 0; i < points.size(); ++i) {
      SegmentObservation surface;
      surface.pose = Between(robot, Pose2(points[i].x(), points[i].y(),
                                          i % 2 == 0 ? kPi : -0.5 * kPi));
      surface.covariance = Eigen::Vector2d(1e-4, 1e-5).asDiagonal();
      PointMatch match;
      match.feature = ids[i];
      match.observation = PointOnSurface(surface, 0.0, 50.0);
      match.observation.share = 0.2;
      record.points.push_back(match);
    }
    // A feature that is gone is passed over.
    record.points.push_back(record.points.front());
    record.points.back().feature = 1000;
    records_.push_back(record);
    truth_.push_back(Compose(move, robot));
    robot = Compose(robot, Pose2(0.3, 0.0, 0.1));
  }
  const std::vector<Pose2> poses = Relocalize();
  ASSERT_EQ(poses.size(), 5u);
  for (int k = 0; k < 5; ++k) {
    EXPECT_LT(PositionError(poses[k], truth_[k]), 1e-3) << k;
    EXPECT_LT(HeadingError(poses[k], truth_[k]), 1e-4) << k;
  }
}

TEST_F(RelocalizationTest, FollowsAMapTenKilometresAway) {
  Build(6);
  // Map and remembered poses together; the map turns a little on top.
  const Pose2 away(10000.0, -10000.0, 0.0);
  const Pose2 move(10000.02, -10000.03, DegToRad(3.0));
  MoveMap(move);
  for (KeyScanRecord& record : records_) record.pose += away;
  const std::vector<Pose2> poses = Relocalize();
  for (int i = 0; i < 6; ++i) {
    const Pose2 expected = Compose(move, truth_[i]);
    EXPECT_LT(PositionError(poses[i], expected), 1e-3) << i;
    EXPECT_LT(HeadingError(poses[i], expected), 1e-4) << i;
  }
}

TEST_F(RelocalizationTest, HeadingsComeBackWrapped) {
  Build(30);  // turns by more than half a turn
  MoveMap(Pose2(0.0, 0.0, DegToRad(10.0)));
  for (const Pose2& pose : Relocalize()) {
    EXPECT_GT(pose[2], -kPi - 1e-12);
    EXPECT_LE(pose[2], kPi + 1e-12);
  }
}

TEST_F(RelocalizationTest, CorrectsRememberedPosesThatDrifted) {
  Build(12);
  for (int i = 0; i < 12; ++i) {
    records_[i].pose += Pose2(0.02 * i, -0.01 * i, 0.005 * i);
  }
  const std::vector<Pose2> poses = Relocalize();
  for (int i = 0; i < 12; ++i) {
    EXPECT_LT(PositionError(poses[i], truth_[i]), 1e-4) << i;
    EXPECT_LT(HeadingError(poses[i], truth_[i]), 1e-5) << i;
  }
}

TEST_F(RelocalizationTest, OdometryBridgesBlindScans) {
  Build(9);
  for (int i = 2; i < 7; ++i) records_[i].matches.clear();
  const Pose2 move(0.2, 0.1, DegToRad(5.0));
  MoveMap(move);
  const std::vector<Pose2> poses = Relocalize();
  for (int i = 0; i < 9; ++i) {
    EXPECT_LT(PositionError(poses[i], Compose(move, truth_[i])), 1e-3) << i;
  }
}

TEST_F(RelocalizationTest, AWrongMatchDoesNotBendTheWay) {
  Build(10);
  // One look takes a cupboard for the wall behind it.
  records_[5].matches[2].observation.pose[0] += 0.5;
  const std::vector<Pose2> poses = Relocalize();
  for (int i = 0; i < 10; ++i) {
    EXPECT_LT(PositionError(poses[i], truth_[i]), 0.02) << i;
    EXPECT_LT(HeadingError(poses[i], truth_[i]), DegToRad(0.3)) << i;
  }
}

TEST_F(RelocalizationTest, OffsetIsObservedAtTheMiddleOfThePiece) {
  // A wall at y = -1 whose piece 6 m ahead looks turned by `turn` about its
  // middle, and one across at x = 3 that looks right. Both know the heading
  // equally well: theta = -turn / 2. The piece's middle stays on its line:
  // y + 6 theta = 0.
  Transaction transaction;
  Feature feature;
  feature.type = &registry_.GetFeature("segment");
  feature.parameters = {0.0, -1.0, 0.0};
  transaction.AddFeature(feature);
  feature.parameters = {3.0, 0.0, 0.5 * kPi};
  transaction.AddFeature(feature);
  const std::vector<FeatureId> ids =
      graph_.Apply(std::move(transaction)).features;
  constexpr double kTurn = 0.004;
  KeyScanRecord record;
  FeatureMatch match;
  match.feature = ids[0];
  match.observation =
      Observe(Pose2::Zero(), WallEnds{{5.0, -1.0}, {7.0, -1.0}});
  match.observation.pose[2] += kTurn;
  record.matches.push_back(match);
  match.feature = ids[1];
  match.observation = Observe(Pose2::Zero(), WallEnds{{3.0, -1.0}, {3.0, 1.0}});
  record.matches.push_back(match);
  records_.push_back(record);
  const std::vector<Pose2> poses = Relocalize();
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_NEAR(poses[0][0], 0.0, 1e-4);
  EXPECT_NEAR(poses[0][1], 3.0 * kTurn, 1e-4);
  EXPECT_NEAR(poses[0][2], -0.5 * kTurn, 1e-5);
}

TEST_F(RelocalizationTest, APieceOfACorridorStaysWhereItWas) {
  // The map has moved by 5 cm since, and its walls are not quite parallel:
  // where they are as far apart as they look is 25 m down the corridor.
  Transaction transaction;
  Feature feature;
  feature.type = &registry_.GetFeature("segment");
  feature.parameters = {0.0, -1.0, 0.0};
  transaction.AddFeature(feature);
  feature.parameters = {0.0, 1.05, 0.002 - kPi};
  transaction.AddFeature(feature);
  const std::vector<FeatureId> ids =
      graph_.Apply(std::move(transaction)).features;
  for (int i = 0; i < 5; ++i) {
    const Pose2 robot(0.5 * i, 0.0, 0.0);
    KeyScanRecord record;
    record.pose = robot;
    if (i > 0) record.motion.mean = Pose2(0.5, 0.0, 0.0);
    record.motion.covariance =
        Eigen::Vector3d(0.02 * 0.02, 0.02 * 0.02, 0.01 * 0.01).asDiagonal();
    for (int k = 0; k < 2; ++k) {
      const double y = k == 0 ? -1.0 : 1.0;
      FeatureMatch match;
      match.feature = ids[k];
      match.observation = Observe(robot, WallEnds{{-20.0, y}, {20.0, y}});
      record.matches.push_back(match);
    }
    records_.push_back(record);
    truth_.push_back(robot);
  }
  EXPECT_GT(PositionError(Relocalize()[2], truth_[2]), 5.0);
  options_ = RelocalizationOptions();
  const std::vector<Pose2> poses = Relocalize();
  for (int i = 0; i < 5; ++i) {
    EXPECT_LT(PositionError(poses[i], truth_[i]), 0.2) << i;
    EXPECT_LT(HeadingError(poses[i], truth_[i]), DegToRad(0.5)) << i;
  }
}

TEST_F(RelocalizationTest, FeaturesThatAreGoneAreLeftOut) {
  Build(5);
  Transaction transaction;
  transaction.RemoveFeature(records_[0].matches[0].feature);
  graph_.Apply(std::move(transaction));
  const std::vector<Pose2> poses = Relocalize();
  for (int i = 0; i < 5; ++i) {
    EXPECT_LT(PositionError(poses[i], truth_[i]), 1e-6) << i;
  }
}

TEST_F(RelocalizationTest, NothingRecognizedLeavesTheRememberedPoses) {
  Build(5);
  for (KeyScanRecord& record : records_) record.matches.clear();
  MoveMap(Pose2(1.0, 1.0, 1.0));
  EXPECT_EQ(Relocalize(), truth_);
}

TEST_F(RelocalizationTest, GraphAndThreads) {
  Build(12);
  MoveMap(Pose2(0.1, 0.1, DegToRad(4.0)));
  std::vector<std::array<double, kMaxFeatureSize>> before;
  for (const Feature* feature : graph_.Features()) {
    before.push_back(feature->parameters);
  }
  options_.num_threads = 1;
  const std::vector<Pose2> one = Relocalize();
  options_.num_threads = 2;
  const std::vector<Pose2> two = Relocalize();
  // The same bytes; and the map is held constant.
  EXPECT_EQ(one, two);
  std::size_t i = 0;
  for (const Feature* feature : graph_.Features()) {
    EXPECT_EQ(feature->parameters, before[i++]);
  }
}

// Refined odometry along +x with scans at these abscissas, keys as marked.
std::vector<RefinedScan> Refined(const std::vector<double>& x,
                                 const std::vector<int>& keys) {
  std::vector<RefinedScan> refined;
  double key = x.empty() ? 0.0 : x.front();
  for (std::size_t i = 0; i < x.size(); ++i) {
    RefinedScan scan;
    scan.pose = Pose2(x[i], 0.0, 0.0);
    scan.since_key.mean = Pose2(x[i] - key, 0.0, 0.0);
    for (int k : keys) scan.is_key |= k == static_cast<int>(i);
    if (scan.is_key) key = x[i];
    refined.push_back(scan);
  }
  return refined;
}

std::vector<KeyScanRecord> RecordsAt(const std::vector<int>& keys) {
  std::vector<KeyScanRecord> records;
  for (int key : keys) {
    KeyScanRecord record;
    record.scan = key;
    records.push_back(record);
  }
  return records;
}

TEST(InterpolateScansTest, KeysAreExactAndWhatIsMissingIsSpread) {
  const std::vector<int> keys = {0, 4};
  const std::vector<RefinedScan> refined =
      Refined({0.0, 0.25, 0.5, 0.75, 1.0, 1.1}, keys);
  // The map says that the way of 1 m is 1.2 m long and goes 0.1 m to the left.
  const std::vector<Pose2> key_poses = {Pose2(5.0, 1.0, 0.0),
                                        Pose2(6.2, 1.1, 0.04)};
  const std::vector<Pose2> poses =
      InterpolateScans(refined, RecordsAt(keys), key_poses);
  ASSERT_EQ(poses.size(), 6u);
  EXPECT_EQ(poses[0], key_poses[0]);
  EXPECT_EQ(poses[4], key_poses[1]);
  EXPECT_LT((poses[1] - Pose2(5.30, 1.025, 0.01)).norm(), 1e-12);
  EXPECT_LT((poses[2] - Pose2(5.60, 1.050, 0.02)).norm(), 1e-12);
  EXPECT_LT((poses[3] - Pose2(5.90, 1.075, 0.03)).norm(), 1e-12);
  // After the last key, refined odometry stands.
  EXPECT_LT((poses[5] - Compose(key_poses[1], Pose2(0.1, 0.0, 0.0))).norm(),
            1e-12);
}

TEST(InterpolateScansTest, TurnedMapTurnsTheWay) {
  const std::vector<int> keys = {0, 2, 4};
  const std::vector<RefinedScan> refined =
      Refined({0.0, 0.1, 0.2, 0.3, 0.4, 0.5}, keys);
  const Pose2 move(10.0, -3.0, DegToRad(20.0));
  std::vector<Pose2> key_poses;
  for (int key : keys) key_poses.push_back(Compose(move, refined[key].pose));
  const std::vector<Pose2> poses =
      InterpolateScans(refined, RecordsAt(keys), key_poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_LT((poses[i] - Compose(move, refined[i].pose)).norm(), 1e-12) << i;
  }
}

TEST(InterpolateScansTest, ContinuousAtTheNextKey) {
  // 1000 scans on a bend between two keys: no step is longer than its share.
  std::vector<RefinedScan> refined(1001);
  Pose2 pose(2.0, 1.0, 3.0);
  const Pose2 step(0.001, 0.0, 0.001);
  const Pose2 start = pose;
  for (int i = 0; i <= 1000; ++i) {
    refined[i].pose = pose;
    refined[i].since_key.mean = Between(start, pose);
    pose = Compose(pose, step);
  }
  refined[0].is_key = refined[1000].is_key = true;
  const std::vector<Pose2> key_poses = {
      start, Compose(refined[1000].pose, Pose2(0.2, -0.3, 0.1))};
  const std::vector<Pose2> poses =
      InterpolateScans(refined, RecordsAt({0, 1000}), key_poses);
  for (int i = 1; i <= 1000; ++i) {
    ASSERT_LT(PositionError(poses[i], poses[i - 1]), 0.002) << i;
    ASSERT_LT(HeadingError(poses[i], poses[i - 1]), 0.002) << i;
  }
  EXPECT_EQ(poses[1000], key_poses[1]);
}

TEST(InterpolateScansTest, StandingStillDoesNotDivideByZero) {
  const std::vector<int> keys = {0, 2};
  const std::vector<RefinedScan> refined = Refined({1.0, 1.0, 1.0}, keys);
  const std::vector<Pose2> poses = InterpolateScans(
      refined, RecordsAt(keys), {Pose2::Zero(), Pose2(0.1, 0.0, 0.0)});
  for (const Pose2& pose : poses) EXPECT_TRUE(pose.allFinite());
  EXPECT_EQ(poses[0], Pose2::Zero());
  EXPECT_EQ(poses[2], Pose2(0.1, 0.0, 0.0));
}

TEST(InterpolateScansTest, OneKeyAndNone) {
  const std::vector<RefinedScan> refined = Refined({0.0, 0.1, 0.2}, {0});
  const Pose2 key(3.0, 4.0, 0.5 * kPi);
  const std::vector<Pose2> poses =
      InterpolateScans(refined, RecordsAt({0}), {key});
  ASSERT_EQ(poses.size(), 3u);
  EXPECT_EQ(poses[0], key);
  EXPECT_LT((poses[2] - Pose2(3.0, 4.2, 0.5 * kPi)).norm(), 1e-12);
  EXPECT_TRUE(InterpolateScans({}, {}, {}).empty());
}

}  // namespace
}  // namespace plumbline
