#include <gtest/gtest.h>
#include <plumbline/frontend/association.h>

#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::Observe;
using testing::WallEnds;

constexpr double kTight = 1e-12;

AssociationOptions GateOptions() {
  AssociationOptions options;
  options.gate = 9.21;
  options.max_offset = 0.5;
  options.max_angle = DegToRad(12.0);
  options.feature_offset_sigma = 0.03;
  options.feature_angle_sigma = DegToRad(0.7);
  options.max_gap = 0.4;
  return options;
}

// A wall along +x about (x, y), seen from above.
AssociationCandidate Candidate(const Pose2& pose, double half_length,
                               const Eigen::Vector3d& robot_sigmas) {
  AssociationCandidate candidate;
  candidate.feature = 7;
  candidate.pose = pose;
  candidate.extent_begin = -half_length;
  candidate.extent_end = half_length;
  candidate.robot_covariance =
      robot_sigmas.array().square().matrix().asDiagonal();
  return candidate;
}

const Eigen::Vector3d kSigmas(0.1, 0.1, DegToRad(3.0));

TEST(AssociationTest, HandWorkedInnovation) {
  SegmentObservation observation;
  observation.pose = Pose2(3.0, -1.0, -0.5 * kPi + 0.1);
  const Pose2 robot(1.0, 2.0, 0.5 * kPi);
  // The middle of the observation is at (2, 5) with heading 0.1.
  const Eigen::Vector2d level =
      Innovation(robot, observation, Pose2(0.0, 4.8, 0.0));
  EXPECT_NEAR(level[0], 0.2, kTight);
  EXPECT_NEAR(level[1], 0.1, kTight);
  // Left of a feature along +y is -x.
  const Eigen::Vector2d upright =
      Innovation(robot, observation, Pose2(1.7, -40.0, 0.5 * kPi));
  EXPECT_NEAR(upright[0], -0.3, kTight);
  EXPECT_NEAR(upright[1], 0.1 - 0.5 * kPi, kTight);
  // Where along its line the feature is does not matter.
  const Eigen::Vector2d diagonal =
      Innovation(robot, observation, Pose2(2.0, 5.0, 0.25 * kPi));
  const Eigen::Vector2d shifted =
      Innovation(robot, observation, Pose2(12.0, 15.0, 0.25 * kPi));
  EXPECT_NEAR((diagonal - shifted).norm(), 0.0, kTight);
  EXPECT_NEAR(diagonal[0], 0.0, kTight);
}

TEST(AssociationTest, InnovationAngleWraps) {
  SegmentObservation observation;
  observation.pose = Pose2(0.0, 0.0, -kPi + 0.02);
  EXPECT_NEAR(Innovation(Pose2(0.0, 0.0, 0.0), observation,
                         Pose2(0.0, 0.0, kPi - 0.03))[1],
              0.05, kTight);
  EXPECT_NEAR(Innovation(Pose2(0.0, 0.0, 4.0 * kPi), observation,
                         Pose2(0.0, 0.0, -kPi))[1],
              0.02, 1e-12);
}

TEST(AssociationTest, JacobianAgreesWithCentralDifferences) {
  SegmentObservation observation;
  observation.pose = Pose2(3.0, -1.5, 0.4);
  constexpr double kStep = 1e-6;
  for (const Pose2& robot : {Pose2(0.0, 0.0, 0.0), Pose2(1.0, -2.0, 2.5),
                             Pose2(-30.0, 12.0, -1.0)}) {
    for (const Pose2& feature :
         {Pose2(0.5, 1.0, 0.0), Pose2(-20.0, 3.0, 1.9), Pose2(0, 0, -2.8)}) {
      const Eigen::Matrix<double, 2, 3> jacobian =
          InnovationJacobian(robot, observation, feature);
      for (int i = 0; i < 3; ++i) {
        Pose2 step = Pose2::Zero();
        step[i] = kStep;
        Eigen::Vector2d difference =
            Innovation(robot + step, observation, feature) -
            Innovation(robot - step, observation, feature);
        difference[1] = NormalizeAngle(difference[1]);
        difference /= 2.0 * kStep;
        EXPECT_NEAR((jacobian.col(i) - difference).norm(), 0.0, 1e-8) << i;
      }
    }
  }
}

TEST(AssociationTest, HandWorkedInnovationCovariance) {
  SegmentObservation observation;
  observation.pose = Pose2(2.0, 0.0, 0.0);
  observation.covariance << 1e-4, 2e-5, 2e-5, 4e-4;
  AssociationCandidate candidate =
      Candidate(Pose2::Zero(), 1.0, Eigen::Vector3d(0.1, 0.2, 0.05));
  AssociationOptions options = GateOptions();
  options.feature_offset_sigma = 0.03;
  options.feature_angle_sigma = 0.01;
  const Eigen::Matrix2d covariance =
      InnovationCovariance(Pose2::Zero(), observation, candidate, options);
  // Across: 1e-4 + 0.2^2 + (2 m x 0.05)^2 + 0.03^2.
  EXPECT_NEAR(covariance(0, 0), 0.0510, kTight);
  // 2e-5 + 2 m x 0.05^2.
  EXPECT_NEAR(covariance(0, 1), 0.00502, kTight);
  EXPECT_NEAR(covariance(1, 0), 0.00502, kTight);
  // 4e-4 + 0.05^2 + 0.01^2.
  EXPECT_NEAR(covariance(1, 1), 0.0030, kTight);
}

TEST(AssociationTest, PerfectMatch) {
  const Pose2 robot(0.3, 2.0, 0.4);
  const WallEnds wall{{-1.0, 0.0}, {1.0, 0.0}};
  const auto associations =
      Associate(robot, {Observe(robot, wall)},
                {Candidate(Pose2::Zero(), 1.0, kSigmas)}, GateOptions());
  ASSERT_EQ(associations.size(), 1u);
  EXPECT_EQ(associations[0].observation, 0);
  EXPECT_EQ(associations[0].candidate, 0);
  EXPECT_NEAR(associations[0].squared_distance, 0.0, kTight);
}

TEST(AssociationTest, SquaredDistanceIsMahalanobis) {
  // Middle of the observation at the robot's own abscissa: offset and heading
  // are independent. Offset 0.1 against sqrt(0.01^2 + 0.1^2 + 0.03^2).
  const Pose2 robot(0.0, 2.0, 0.0);
  const auto associations =
      Associate(robot, {Observe(robot, WallEnds{{-1.0, 0.1}, {1.0, 0.1}})},
                {Candidate(Pose2::Zero(), 1.0, Eigen::Vector3d(0.1, 0.1, 0.0))},
                GateOptions());
  ASSERT_EQ(associations.size(), 1u);
  EXPECT_NEAR(associations[0].squared_distance, 0.01 / 0.0110, 1e-9);
}

TEST(AssociationTest, GateOnMahalanobisDistance) {
  const Pose2 robot(0.0, 2.0, 0.0);
  const std::vector<SegmentObservation> observations = {
      Observe(robot, WallEnds{{-1.0, 0.2}, {1.0, 0.2}})};
  AssociationOptions options = GateOptions();
  options.feature_offset_sigma = 0.03;
  // 0.2 m: far for a well known robot, near for a lost one.
  EXPECT_TRUE(Associate(robot, observations,
                        {Candidate(Pose2::Zero(), 1.0,
                                   Eigen::Vector3d(0.02, 0.02, 0.001))},
                        options)
                  .empty());
  EXPECT_EQ(Associate(robot, observations,
                      {Candidate(Pose2::Zero(), 1.0,
                                 Eigen::Vector3d(0.2, 0.2, 0.001))},
                      options)
                .size(),
            1u);
}

TEST(AssociationTest, FixedGatesHoldForALostRobot) {
  const Eigen::Vector3d lost(100.0, 100.0, 10.0);
  const Pose2 robot(0.0, 2.0, 0.0);
  const std::vector<AssociationCandidate> candidates = {
      Candidate(Pose2::Zero(), 1.0, lost)};
  const auto count = [&](const WallEnds& wall) {
    return Associate(robot, {Observe(robot, wall)}, candidates, GateOptions())
        .size();
  };
  EXPECT_EQ(count({{-1.0, 0.49}, {1.0, 0.49}}), 1u);
  EXPECT_EQ(count({{-1.0, 0.51}, {1.0, 0.51}}), 0u);
  EXPECT_EQ(count({{-1.0, -0.49}, {1.0, -0.49}}), 1u);
  EXPECT_EQ(count({{-1.0, -0.51}, {1.0, -0.51}}), 0u);
  const double inside = std::tan(DegToRad(11.9));
  const double outside = std::tan(DegToRad(12.1));
  EXPECT_EQ(count({{-1.0, -inside}, {1.0, inside}}), 1u);
  EXPECT_EQ(count({{-1.0, -outside}, {1.0, outside}}), 0u);
}

TEST(AssociationTest, GateOnOverlap) {
  const Pose2 robot(0.0, 2.0, 0.0);
  const std::vector<AssociationCandidate> candidates = {
      Candidate(Pose2(0.5, 0.0, 0.0), 1.0, kSigmas)};  // x from -0.5 to 1.5
  const auto count = [&](double begin, double end) {
    return Associate(robot,
                     {Observe(robot, WallEnds{{begin, 0.0}, {end, 0.0}})},
                     candidates, GateOptions())
        .size();
  };
  EXPECT_EQ(count(1.85, 2.85), 1u);
  EXPECT_EQ(count(1.95, 2.95), 0u);
  EXPECT_EQ(count(-1.85, -0.85), 1u);
  EXPECT_EQ(count(-1.95, -0.95), 0u);
  // A piece inside the wall, and one that reaches over both of its ends.
  EXPECT_EQ(count(0.3, 0.8), 1u);
  EXPECT_EQ(count(-5.0, 5.0), 1u);
}

TEST(AssociationTest, OppositeFacesOfAThinWallAreDifferent) {
  // The candidate was seen from above, the observation is made from below.
  const Pose2 robot(0.0, -2.0, 0.0);
  const Eigen::Vector3d lost(100.0, 100.0, 10.0);
  const std::vector<SegmentObservation> observations = {
      Observe(robot, WallEnds{{-1.0, -0.1}, {1.0, -0.1}})};
  EXPECT_TRUE(Associate(robot, observations,
                        {Candidate(Pose2::Zero(), 1.0, lost)}, GateOptions())
                  .empty());
  EXPECT_EQ(
      Associate(robot, observations,
                {Candidate(Pose2(0.0, 0.0, kPi), 1.0, lost)}, GateOptions())
          .size(),
      1u);
}

TEST(AssociationTest, NearestCandidateWinsAndMayTakeSeveral) {
  const Pose2 robot(0.0, 2.0, 0.0);
  const std::vector<SegmentObservation> observations = {
      Observe(robot, WallEnds{{-1.0, 0.0}, {-0.2, 0.0}}),
      Observe(robot, WallEnds{{0.0, 5.0}, {1.0, 5.0}}),  // nobody's
      Observe(robot, WallEnds{{0.2, 0.02}, {1.0, 0.02}})};
  const std::vector<AssociationCandidate> candidates = {
      Candidate(Pose2(0.0, 0.15, 0.0), 1.0, kSigmas),
      Candidate(Pose2(0.0, 0.01, 0.0), 1.0, kSigmas),
      Candidate(Pose2(0.0, -0.15, 0.0), 1.0, kSigmas)};
  const auto associations =
      Associate(robot, observations, candidates, GateOptions());
  ASSERT_EQ(associations.size(), 2u);
  EXPECT_EQ(associations[0].observation, 0);
  EXPECT_EQ(associations[0].candidate, 1);
  EXPECT_EQ(associations[1].observation, 2);
  EXPECT_EQ(associations[1].candidate, 1);
}

TEST(AssociationTest, NothingWithNothing) {
  const Pose2 robot(0.0, 2.0, 0.0);
  const std::vector<SegmentObservation> observations = {
      Observe(robot, WallEnds{{-1.0, 0.0}, {1.0, 0.0}})};
  const std::vector<AssociationCandidate> candidates = {
      Candidate(Pose2::Zero(), 1.0, kSigmas)};
  EXPECT_TRUE(Associate(robot, {}, candidates, GateOptions()).empty());
  EXPECT_TRUE(Associate(robot, observations, {}, GateOptions()).empty());
}

TEST(AssociationTest, SameResultTenKilometresAwayAndTurned) {
  const Pose2 robot(0.3, 2.0, 0.4);
  const Pose2 feature(0.2, -0.05, 0.03);
  const SegmentObservation observation =
      Observe(robot, WallEnds{{-1.0, 0.0}, {1.0, 0.05}});
  AssociationCandidate candidate =
      Candidate(feature, 1.0, Eigen::Vector3d(0.1, 0.1, 0.05));
  const auto here = Associate(robot, {observation}, {candidate}, GateOptions());
  const Pose2 move(10000.0, -10000.0, 2.0);
  candidate.pose = Compose(move, feature);
  const auto there = Associate(Compose(move, robot), {observation}, {candidate},
                               GateOptions());
  ASSERT_EQ(here.size(), 1u);
  ASSERT_EQ(there.size(), 1u);
  EXPECT_GT(here[0].squared_distance, 0.01);
  EXPECT_NEAR(there[0].squared_distance, here[0].squared_distance, 1e-7);
}

}  // namespace
}  // namespace plumbline
