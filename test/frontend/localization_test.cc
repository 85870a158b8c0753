#include <gtest/gtest.h>
#include <plumbline/frontend/localization.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::HeadingError;
using testing::Observe;
using testing::PositionError;
using testing::WallEnds;

AssociationOptions NoiseOptions() {
  AssociationOptions options;
  options.feature_offset_sigma = 0.03;
  options.feature_angle_sigma = DegToRad(0.7);
  return options;
}

// Walls as candidates, and what a robot at `truth` sees of them, each
// recognized.
struct Sight {
  std::vector<SegmentObservation> observations;
  std::vector<AssociationCandidate> candidates;
  std::vector<Association> associations;
};

Sight SeeFrom(const Pose2& truth, const std::vector<WallEnds>& walls) {
  Sight sight;
  for (const WallEnds& wall : walls) {
    const int index = static_cast<int>(sight.observations.size());
    sight.observations.push_back(Observe(truth, wall));
    AssociationCandidate candidate;
    candidate.feature = 10 + index;
    candidate.pose = Compose(truth, sight.observations.back().pose);
    // Features lie anywhere along their line.
    candidate.pose = Compose(candidate.pose, Pose2(0.7 * index, 0.0, 0.0));
    candidate.extent_begin = -2.0;
    candidate.extent_end = 2.0;
    sight.candidates.push_back(candidate);
    Association association;
    association.observation = index;
    association.candidate = index;
    sight.associations.push_back(association);
  }
  return sight;
}

Localization Localize(const Pose2& predicted, const Eigen::Matrix3d& prior,
                      const Sight& sight) {
  return LocalizeRobot(predicted, prior, sight.observations, sight.candidates,
                       sight.associations, NoiseOptions());
}

const WallEnds kFloor{{-1.0, 0.0}, {3.0, 0.0}};
const WallEnds kSide{{5.0, -1.0}, {5.0, 3.0}};

TEST(LocalizationTest, TwoPerpendicularWallsGiveThePose) {
  const Pose2 truth(2.0, 1.0, 0.3);
  const Sight sight = SeeFrom(truth, {kFloor, kSide});
  const Localization result =
      Localize(truth + Pose2(0.1, -0.08, DegToRad(2.0)),
               Eigen::Matrix3d::Identity() * 1e-6, sight);
  EXPECT_LT(PositionError(result.pose, truth), 1e-5);
  EXPECT_LT(HeadingError(result.pose, truth), 1e-6);
  const Eigen::Matrix3d& information = result.observation_information;
  EXPECT_LT((information - information.transpose()).norm(), 1e-6);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information)
                .eigenvalues()[0],
            100.0);
}

TEST(LocalizationTest, OneWallKeepsThePriorAlong) {
  const Pose2 truth(2.0, 1.0, 0.3);
  const Sight sight = SeeFrom(truth, {kFloor});
  const Localization result =
      Localize(truth + Pose2(0.1, -0.08, DegToRad(2.0)),
               Eigen::Vector3d(100.0, 1e-3, 1e-3).asDiagonal(), sight);
  EXPECT_NEAR(result.pose[0], 2.1, 1e-8);
  EXPECT_NEAR(result.pose[1], 1.0, 1e-4);
  EXPECT_NEAR(result.pose[2], 0.3, 1e-5);
  EXPECT_NEAR(result.observation_information(0, 0), 0.0, 1e-9);
  EXPECT_GT(result.observation_information(1, 1), 100.0);
}

TEST(LocalizationTest, OneWallAskewKeepsThePriorAlong) {
  // The wall runs at 30 degrees.
  const Pose2 truth(0.0, 2.0, -0.5);
  const Eigen::Vector2d along(std::cos(kPi / 6.0), std::sin(kPi / 6.0));
  const Sight sight = SeeFrom(truth, {{-1.0 * along, 2.0 * along}});
  const Pose2 predicted = truth + Pose2(0.06, 0.05, 0.02);
  const Localization result =
      Localize(predicted, Eigen::Matrix3d::Identity() * 1e-3, sight);
  const Eigen::Vector2d error = (result.pose - truth).head<2>();
  const Eigen::Vector2d predicted_error = (predicted - truth).head<2>();
  EXPECT_NEAR(along.dot(error), along.dot(predicted_error), 1e-5);
  EXPECT_NEAR(-along.y() * error.x() + along.x() * error.y(), 0.0, 1e-4);
  const Eigen::Vector3d eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(
          result.observation_information)
          .eigenvalues();
  EXPECT_NEAR(eigenvalues[0], 0.0, 1e-6);
  EXPECT_GT(eigenvalues[1], 1.0);
}

TEST(LocalizationTest, HandWorkedFusionWithThePrior) {
  // Seen straight below, so offset and heading do not mix. The observation has
  // 0.01^2 + 0.03^2 = 0.001 m^2; so has the prior: half way.
  const Pose2 truth(1.0, 2.0, 0.0);
  const Sight sight = SeeFrom(truth, {kFloor});
  const Localization result =
      Localize(truth + Pose2(0.0, 0.002, 0.0),
               Eigen::Vector3d(1000.0, 1000.0, 1e6).asDiagonal(), sight);
  EXPECT_NEAR(result.pose[0], 1.0, 1e-9);
  EXPECT_NEAR(result.pose[1], 2.001, 2e-6);
  EXPECT_NEAR(result.observation_information(1, 1), 1000.0, 1.0);
}

TEST(LocalizationTest, StrongPriorHolds) {
  const Pose2 truth(2.0, 1.0, 0.3);
  const Pose2 predicted = truth + Pose2(0.02, -0.02, 0.01);
  const Localization result =
      Localize(predicted, Eigen::Matrix3d::Identity() * 1e12,
               SeeFrom(truth, {kFloor, kSide}));
  EXPECT_LT((result.pose - predicted).norm(), 1e-6);
}

TEST(LocalizationTest, FeaturesStayAndPoseIsTheSameFromEitherSide) {
  const Pose2 truth(2.0, 1.0, 3.1);
  const Sight sight = SeeFrom(truth, {kFloor, kSide});
  const Sight before = sight;
  // Headings on the two sides of pi.
  for (double error : {0.06, -0.06}) {
    const Localization result =
        Localize(Pose2(2.05, 0.95, NormalizeAngle(3.1 + error)),
                 Eigen::Matrix3d::Identity() * 1e-6, sight);
    EXPECT_LT(PositionError(result.pose, truth), 1e-5);
    EXPECT_LT(HeadingError(result.pose, truth), 1e-6);
    EXPECT_LE(std::abs(result.pose[2]), kPi);
  }
  for (std::size_t i = 0; i < before.candidates.size(); ++i) {
    EXPECT_EQ(sight.candidates[i].pose, before.candidates[i].pose);
  }
}

TEST(LocalizationTest, NothingRecognizedLeavesThePrediction) {
  const Pose2 predicted(1.0, 2.0, 0.3);
  const Localization result =
      Localize(predicted, Eigen::Matrix3d::Identity(), Sight());
  EXPECT_LT((result.pose - predicted).norm(), 1e-12);
  EXPECT_EQ(result.observation_information, Eigen::Matrix3d::Zero());
  // Not even a prior: the pose must stay a number.
  const Localization free =
      Localize(predicted, Eigen::Matrix3d::Zero(), Sight());
  EXPECT_LT((free.pose - predicted).norm(), 1e-12);
}

TEST(LocalizationTest, AWrongAssociationDoesNotDrag) {
  const Pose2 truth(2.0, 1.0, 0.3);
  Sight sight = SeeFrom(
      truth,
      {kFloor, kSide, {{0.0, 4.0}, {3.0, 4.0}}, {{-2.0, 0.0}, {-2.0, 3.0}}});
  // A cupboard 0.4 m before a wall is taken for the wall.
  sight.candidates.push_back(sight.candidates[2]);
  sight.candidates.back().pose[1] += 0.4;
  sight.observations.push_back(sight.observations[2]);
  Association wrong;
  wrong.observation = 4;
  wrong.candidate = 4;
  sight.associations.push_back(wrong);
  const Localization result = Localize(truth + Pose2(0.03, 0.03, 0.01),
                                       Eigen::Matrix3d::Identity(), sight);
  EXPECT_LT(PositionError(result.pose, truth), 0.02);
}

TEST(LocalizationTest, OnlyAssociatedPairsCount) {
  const Pose2 truth(2.0, 1.0, 0.3);
  Sight sight = SeeFrom(truth, {kFloor, kSide});
  sight.associations.pop_back();
  const Localization result = Localize(truth + Pose2(0.1, 0.0, 0.0),
                                       Eigen::Matrix3d::Identity(), sight);
  EXPECT_NEAR(result.pose[0], 2.1, 1e-8);
}

TEST(LocalizationTest, SameResultTenKilometresAway) {
  const Pose2 truth(2.0, 1.0, 0.3);
  const Sight here = SeeFrom(truth, {kFloor, kSide});
  Sight there = here;
  const Pose2 shift(10000.0, -10000.0, 0.0);
  for (AssociationCandidate& candidate : there.candidates) {
    candidate.pose += shift;
  }
  const Pose2 predicted = truth + Pose2(0.1, -0.08, DegToRad(2.0));
  const Eigen::Matrix3d prior = Eigen::Matrix3d::Identity() * 100.0;
  const Localization a = Localize(predicted, prior, here);
  const Localization b = Localize(predicted + shift, prior, there);
  EXPECT_LT((b.pose - shift - a.pose).norm(), 1e-7);
  EXPECT_LT((b.observation_information - a.observation_information).norm(),
            1e-4);
}

}  // namespace
}  // namespace plumbline
