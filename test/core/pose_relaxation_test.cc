#include <gtest/gtest.h>
#include <plumbline/core/pose_relaxation.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace plumbline {
namespace {

// Poses on a circle, each seen from the one before it and the first from the
// last, with the true poses and none known but the first.
class PoseRelaxationTest : public ::testing::Test {
 protected:
  PoseRelaxationTest() {
    constexpr int kPoses = 12;
    for (int i = 0; i < kPoses; ++i) {
      const double angle = 2.0 * kPi * i / kPoses;
      truth_.emplace_back(5.0 * std::cos(angle), 5.0 * std::sin(angle),
                          NormalizeAngle(angle + 0.5 * kPi));
      network_.is_known_pose.push_back(i == 0);
    }
    network_.poses = truth_;
    for (int i = 0; i < kPoses; ++i) AddSighting(i, (i + 1) % kPoses);
  }

  void AddSighting(int first, int second) {
    PoseSighting sighting;
    sighting.first = first;
    sighting.second = second;
    sighting.value = Between(truth_[static_cast<std::size_t>(first)],
                             truth_[static_cast<std::size_t>(second)]);
    network_.pose_sightings.push_back(sighting);
  }

  void AddLandmark(double x, double y, const std::vector<int>& seen_from) {
    for (const int pose : seen_from) {
      PositionSighting sighting;
      sighting.pose = pose;
      sighting.landmark = static_cast<int>(network_.landmarks.size());
      sighting.value = TransformPoint(
          Inverse(truth_[static_cast<std::size_t>(pose)]), {x, y});
      network_.position_sightings.push_back(sighting);
    }
    network_.landmarks.emplace_back(x, y);
    network_.is_known_landmark.push_back(false);
  }

  // Turns and moves what is not known.
  void Disturb() {
    for (std::size_t i = 1; i < network_.poses.size(); ++i) {
      const double size = static_cast<double>(i);
      network_.poses[i] += Pose2(0.3 * size, -0.2 * size, 0.08 * size);
    }
    for (Eigen::Vector2d& landmark : network_.landmarks) {
      landmark += Eigen::Vector2d(2.0, 1.0);
    }
  }

  double LargestError() const {
    double largest = 0.0;
    for (std::size_t i = 0; i < truth_.size(); ++i) {
      Pose2 error = network_.poses[i] - truth_[i];
      error[2] = NormalizeAngle(error[2]);
      largest = std::max(largest, error.norm());
    }
    return largest;
  }

  std::vector<Pose2> truth_;
  PoseNetwork network_;
};

TEST_F(PoseRelaxationTest, FindsPosesThatRelationsAgreeOn) {
  Disturb();
  ASSERT_GT(LargestError(), 1.0);
  RelaxPoses(&network_);
  EXPECT_LT(LargestError(), 1e-6);
}

TEST_F(PoseRelaxationTest, KnownPosesStay) {
  network_.poses[0] = Pose2(100.0, 50.0, 1.0);
  RelaxPoses(&network_);
  EXPECT_EQ(network_.poses[0], Pose2(100.0, 50.0, 1.0));
  // The others go along.
  const Pose2 step = Between(network_.poses[0], network_.poses[1]);
  EXPECT_LT((step - Between(truth_[0], truth_[1])).norm(), 1e-6);
}

TEST_F(PoseRelaxationTest, PriorHoldsWhereNothingIsKnown) {
  network_.is_known_pose.assign(truth_.size(), false);
  PoseSighting prior;
  prior.second = 3;
  prior.value = truth_[3];
  network_.pose_sightings.push_back(prior);
  Disturb();
  RelaxPoses(&network_);
  EXPECT_LT(LargestError(), 1e-6);
}

TEST_F(PoseRelaxationTest, LandmarksCloseTheLoop) {
  // Nothing but two landmarks ties the end of the chain to its beginning.
  network_.pose_sightings.pop_back();
  AddLandmark(6.0, -2.0, {0, 1, 10, 11});
  AddLandmark(3.0, -4.0, {0, 9, 11});
  Disturb();
  RelaxPoses(&network_);
  EXPECT_LT(LargestError(), 1e-6);
  EXPECT_LT((network_.landmarks[0] - Eigen::Vector2d(6.0, -2.0)).norm(), 1e-6);
  EXPECT_LT((network_.landmarks[1] - Eigen::Vector2d(3.0, -4.0)).norm(), 1e-6);
}

TEST_F(PoseRelaxationTest, SharesOutWhatDoesNotClose) {
  network_.pose_sightings.back().value[0] += 0.6;
  RelaxPoses(&network_);
  // No step takes much more than its share of the gap.
  for (std::size_t i = 0; i + 1 < truth_.size(); ++i) {
    const Pose2 step = Between(network_.poses[i], network_.poses[i + 1]);
    const Pose2 expected = Between(truth_[i], truth_[i + 1]);
    EXPECT_LT((step - expected).head<2>().norm(), 0.1) << i;
  }
  EXPECT_GT(LargestError(), 0.05);
}

}  // namespace
}  // namespace plumbline
