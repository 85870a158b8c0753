#include <gtest/gtest.h>
#include <plumbline/frontend/point_association.h>

#include <cmath>
#include <limits>
#include <vector>

namespace plumbline {
namespace {

// 4 m long, offset known to 1 cm and direction to 2 mrad.
SegmentObservation Surface(double x, double y, double direction) {
  SegmentObservation surface;
  surface.pose = Pose2(x, y, direction);
  surface.length = 4.0;
  surface.points = 40;
  surface.covariance = Eigen::Vector2d(1e-4, 4e-6).asDiagonal();
  return surface;
}

PointCandidate At(FeatureId id, double x, double y, double direction) {
  PointCandidate candidate;
  candidate.feature = id;
  candidate.position = {x, y};
  candidate.direction = direction;
  return candidate;
}

TEST(PointOnSurfaceTest, CertainAcrossAndWideAlong) {
  const PointObservation point =
      PointOnSurface(Surface(3.0, 1.0, 0.5 * kPi), 1.5, 0.2);
  EXPECT_NEAR(point.position.x(), 3.0, 1e-12);
  EXPECT_NEAR(point.position.y(), 2.5, 1e-12);
  // 1e-4 + 1.5^2 4e-6 across, 0.2^2 along.
  EXPECT_NEAR(point.covariance(0, 0), 1.09e-4, 1e-12);
  EXPECT_NEAR(point.covariance(1, 1), 0.04, 1e-12);
  EXPECT_NEAR(point.covariance(0, 1), 0.0, 1e-12);
  EXPECT_EQ(point.covariance(0, 1), point.covariance(1, 0));
}

TEST(AssociatePointsTest, SamplesTheSurfaceAtTheFoot) {
  // The robot stands at (10, 5) and looks along y; what is at x = 2 in its
  // frame is at y = 7 on the map.
  const Pose2 robot(10.0, 5.0, 0.5 * kPi);
  const std::vector<SegmentObservation> surfaces = {
      Surface(2.0, 0.0, 0.5 * kPi)};
  // On the map the surface runs in the direction pi; 3 cm behind it, and 0.7 m
  // along it.
  const std::vector<PointAssociation> associations = AssociatePoints(
      robot, surfaces, {At(7, 9.3, 7.03, kPi)}, PointAssociationOptions());
  ASSERT_EQ(associations.size(), 1u);
  EXPECT_EQ(associations[0].candidate, 0);
  EXPECT_EQ(associations[0].surface, 0);
  EXPECT_NEAR(associations[0].along, 0.7, 1e-12);
  EXPECT_NEAR(associations[0].observation.position.x(), 2.0, 1e-12);
  EXPECT_NEAR(associations[0].observation.position.y(), 0.7, 1e-12);
  EXPECT_EQ(associations[0].observation.share, 1.0);
  // 0.03^2 / (1e-4 + 0.49 4e-6 + 0.03^2).
  EXPECT_NEAR(associations[0].squared_distance, 9e-4 / 1.00196e-3, 1e-9);
}

TEST(AssociatePointsTest, GatesAndEnds) {
  const Pose2 robot = Pose2::Zero();
  const std::vector<SegmentObservation> surfaces = {Surface(0.0, 2.0, kPi)};
  PointAssociationOptions options;
  const auto count = [&](const PointCandidate& candidate) {
    return AssociatePoints(robot, surfaces, {candidate}, options).size();
  };
  EXPECT_EQ(count(At(0, 1.9, 2.0, kPi)), 1u);
  // Beyond its end.
  EXPECT_EQ(count(At(0, 2.1, 2.0, kPi)), 0u);
  // 2.5755 standard deviations of 3.16 cm is 8.1 cm.
  EXPECT_EQ(count(At(0, 0.0, 2.08, kPi)), 1u);
  EXPECT_EQ(count(At(0, 0.0, 2.083, kPi)), 0u);
  // Unless the robot is less certain, across ...
  PointCandidate unsure = At(0, 0.0, 2.25, kPi);
  unsure.robot_covariance(1, 1) = 0.01;
  EXPECT_EQ(count(unsure), 1u);
  unsure.robot_covariance.setZero();
  unsure.robot_covariance(0, 0) = 0.01;
  EXPECT_EQ(count(unsure), 0u);
  // ... or in heading, which moves what is to the side of the foot.
  unsure.position = {1.5, 2.15};
  unsure.robot_covariance.setZero();
  EXPECT_EQ(count(unsure), 0u);
  unsure.robot_covariance(2, 2) = 0.01;
  EXPECT_EQ(count(unsure), 1u);
  // But never farther than this.
  unsure.position = {0.0, 2.31};
  unsure.robot_covariance.setIdentity();
  EXPECT_EQ(count(unsure), 0u);
  // The other face of a thin wall, and the other wall of a corner.
  EXPECT_EQ(count(At(0, 0.0, 2.0, 0.0)), 0u);
  EXPECT_EQ(count(At(0, 0.0, 2.0, 0.5 * kPi)), 0u);
  EXPECT_EQ(count(At(0, 0.0, 2.0, -kPi + 0.5)), 1u);
}

TEST(AssociatePointsTest, TheNearestSurfaceAndSharesOfIt) {
  const std::vector<SegmentObservation> surfaces = {Surface(0.0, 2.0, kPi),
                                                    Surface(0.0, 2.05, kPi)};
  const std::vector<PointAssociation> associations =
      AssociatePoints(Pose2::Zero(), surfaces,
                      {At(3, 0.0, 2.01, kPi), At(4, 1.0, 2.06, kPi),
                       At(5, 9.0, 2.0, kPi), At(6, -1.0, 2.0, kPi)},
                      PointAssociationOptions());
  ASSERT_EQ(associations.size(), 3u);
  EXPECT_EQ(associations[0].candidate, 0);
  EXPECT_EQ(associations[0].surface, 0);
  EXPECT_EQ(associations[0].observation.share, 0.5);
  EXPECT_EQ(associations[1].candidate, 1);
  EXPECT_EQ(associations[1].surface, 1);
  EXPECT_EQ(associations[1].observation.share, 1.0);
  EXPECT_EQ(associations[2].candidate, 3);
  EXPECT_EQ(associations[2].surface, 0);
  EXPECT_EQ(associations[2].observation.share, 0.5);
}

TEST(AssociatePointsTest, NothingAndNonsense) {
  const std::vector<SegmentObservation> surfaces = {Surface(0.0, 2.0, kPi)};
  const std::vector<PointCandidate> candidates = {At(0, 0.0, 2.0, kPi)};
  const PointAssociationOptions options;
  EXPECT_TRUE(AssociatePoints(Pose2::Zero(), {}, candidates, options).empty());
  EXPECT_TRUE(AssociatePoints(Pose2::Zero(), surfaces, {}, options).empty());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(
      AssociatePoints(Pose2::Zero(), surfaces, {At(0, nan, 2.0, kPi)}, options)
          .empty());
  EXPECT_TRUE(
      AssociatePoints(Pose2(0.0, nan, 0.0), surfaces, candidates, options)
          .empty());
}

}  // namespace
}  // namespace plumbline
