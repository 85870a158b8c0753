#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/trajectory_errors.h>
#include <plumbline/core/error.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr double kPi = 3.14159265358979323846;

Pose3 At(double x, double y, double z = 0.0, double yaw = 0.0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(x, y, z)};
}

TrajectoryFile Trajectory(const std::string& name,
                          const std::vector<double>& times) {
  TrajectoryFile file;
  file.name = name;
  file.format = "TUM";
  for (const double time : times) file.poses.push_back({time, At(time, 0.0)});
  return file;
}

PosePairs Pairs(const std::vector<Pose3>& reference,
                const std::vector<Pose3>& estimate) {
  PosePairs pairs;
  pairs.reference = reference;
  pairs.estimate = estimate;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    pairs.times.push_back(static_cast<double>(i));
  }
  return pairs;
}

TEST(TrajectoryErrorsTest, StatisticsAreThoseOfEvo) {
  const ErrorSummary four = SummarizeErrors({3.0, 1.0, 4.0, 2.0});
  EXPECT_EQ(four.count, 4u);
  EXPECT_DOUBLE_EQ(four.mean, 2.5);
  EXPECT_DOUBLE_EQ(four.median, 2.5);
  EXPECT_DOUBLE_EQ(four.std, std::sqrt(1.25));
  EXPECT_DOUBLE_EQ(four.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(four.min, 1.0);
  EXPECT_DOUBLE_EQ(four.max, 4.0);
  EXPECT_DOUBLE_EQ(four.sse, 30.0);
  EXPECT_DOUBLE_EQ(SummarizeErrors({5.0, 1.0, 2.0}).median, 2.0);
  EXPECT_DOUBLE_EQ(SummarizeErrors({5.0}).std, 0.0);
  EXPECT_EQ(SummarizeErrors({}).count, 0u);
}

TEST(TrajectoryErrorsTest, PosesMatchByTime) {
  // The estimate has fewer poses: each looks for its nearest.
  const PosePairs pairs =
      AssociatePoses(Trajectory("a", {0.0, 1.0, 2.0, 3.0}),
                     Trajectory("b", {0.004, 1.02, 1.99}), 0.01);
  EXPECT_THAT(pairs.times, ElementsAre(0.0, 2.0));
  EXPECT_DOUBLE_EQ(pairs.estimate[1].translation.x(), 1.99);
  // The reference has fewer: of two poses as near the first is taken.
  const PosePairs few = AssociatePoses(
      Trajectory("a", {1.0, 2.0}), Trajectory("b", {0.5, 1.5, 2.25, 1.5}), 0.5);
  ASSERT_THAT(few.times, ElementsAre(1.0, 2.0));
  EXPECT_DOUBLE_EQ(few.estimate[0].translation.x(), 0.5);
  EXPECT_DOUBLE_EQ(few.estimate[1].translation.x(), 2.25);
}

TEST(TrajectoryErrorsTest, TimesMayBeShiftedAndOutOfOrder) {
  const PosePairs pairs =
      AssociatePoses(Trajectory("a", {3.0, 1.0, 2.0}),
                     Trajectory("b", {102.0, 103.0, 101.0}), 0.01, -100.0);
  EXPECT_THAT(pairs.times, ElementsAre(2.0, 3.0, 1.0));
  EXPECT_DOUBLE_EQ(pairs.estimate[0].translation.x(), 102.0);
}

TEST(TrajectoryErrorsTest, WhatDoesNotMatchIsRefused) {
  EXPECT_THAT(Refusal([] {
                AssociatePoses(Trajectory("a", {0.0, 1.0}),
                               Trajectory("b", {5.0, 6.0}));
              }),
              ::testing::AllOf(HasSubstr("b: no pose (5 s to 6 s) is within "
                                         "0.01 s of one of a (0 s to 1 s)"),
                               HasSubstr("--time_offset")));
  TrajectoryFile numbers = Trajectory("k", {0.0, 1.0});
  numbers.format = "KITTI";
  numbers.has_times = false;
  EXPECT_THAT(Refusal([&] {
                AssociatePoses(numbers, Trajectory("b", {0.0, 1.0}));
              }),
              HasSubstr("k: poses of KITTI have no times"));
  TrajectoryFile more = Trajectory("m", {0.0, 1.0, 2.0});
  more.has_times = false;
  EXPECT_THAT(Refusal([&] { AssociatePoses(numbers, more); }),
              HasSubstr("m: 3 poses without times, 2 in k"));
}

TEST(TrajectoryErrorsTest, ErrorsByHand) {
  // The second pose stands 0.3 m aside and is turned by 90 degrees, so the step
  // from it, 1 m ahead in truth, leads it aside.
  const PosePairs pairs = Pairs({At(0, 0), At(1, 0), At(2, 0)},
                                {At(0, 0), At(1, 0.3, 0, kPi / 2), At(2, 0.4)});
  const AbsoluteErrors absolute = ComputeAbsoluteErrors(pairs);
  ASSERT_EQ(absolute.translation.size(), 3u);
  EXPECT_NEAR(absolute.translation[0], 0.0, 1e-12);
  EXPECT_NEAR(absolute.translation[1], 0.3, 1e-12);
  EXPECT_NEAR(absolute.translation[2], 0.4, 1e-12);
  EXPECT_NEAR(absolute.rotation_deg[1], 90.0, 1e-9);
  const RelativeErrors relative = ComputeRelativeErrors(pairs, {});
  EXPECT_THAT(relative.steps, ElementsAre(Pair(0, 1), Pair(1, 2)));
  EXPECT_NEAR(relative.translation[0], 0.3, 1e-12);
  // Seen from it the third pose is at (0.1, -1) and not at (1, 0).
  EXPECT_NEAR(relative.translation[1], std::hypot(0.9, 1.0), 1e-12);
  EXPECT_NEAR(relative.rotation_deg[1], 90.0, 1e-9);
}

TEST(TrajectoryErrorsTest, StepsByNumberAndByMetres) {
  std::vector<Pose3> poses;
  for (int i = 0; i < 7; ++i) poses.push_back(At(4.0 * i, 0.0));
  const PosePairs pairs = Pairs(poses, poses);
  RelativeErrorOptions options;
  options.delta = 3.0;
  EXPECT_THAT(ComputeRelativeErrors(pairs, options).steps,
              ElementsAre(Pair(0, 3), Pair(3, 6)));
  options.all_pairs = true;
  EXPECT_THAT(ComputeRelativeErrors(pairs, options).steps,
              ElementsAre(Pair(0, 3), Pair(1, 4), Pair(2, 5), Pair(3, 6)));
  options.delta_is_m = true;
  options.delta = 8.0;
  EXPECT_THAT(
      ComputeRelativeErrors(pairs, options).steps,
      ElementsAre(Pair(0, 2), Pair(1, 3), Pair(2, 4), Pair(3, 5), Pair(4, 6)));
  // 8 and 12 m are both farther from 10 m than a tenth of it.
  options.delta = 10.0;
  EXPECT_THAT(ComputeRelativeErrors(pairs, options).steps, IsEmpty());
  // 12 m of path make a step of 10, and the first one begins there.
  options.all_pairs = false;
  EXPECT_THAT(ComputeRelativeErrors(pairs, options).steps,
              ElementsAre(Pair(3, 6)));
  options.delta = 100.0;
  EXPECT_THAT(ComputeRelativeErrors(pairs, options).steps, IsEmpty());
  options.delta = -1.0;
  EXPECT_THAT(Refusal([&] { ComputeRelativeErrors(pairs, options); }),
              HasSubstr("steps of -1 m"));
  options.delta_is_m = false;
  options.delta = 1.5;
  EXPECT_THAT(Refusal([&] { ComputeRelativeErrors(pairs, options); }),
              HasSubstr("a whole number"));
}

TEST(TrajectoryErrorsTest, AlignmentInThePlane) {
  // A square that was turned by 90 degrees, shifted and lifted.
  PosePairs pairs = Pairs({At(0, 0), At(1, 0), At(1, 1), At(0, 1)},
                          {At(5, 2, 0.7, kPi / 2), At(5, 3, 0.7, kPi / 2),
                           At(4, 3, 0.7, kPi / 2), At(4, 2, 0.7, kPi / 2)});
  AlignPoses(PoseAlignment::kSe2, &pairs);
  const AbsoluteErrors errors = ComputeAbsoluteErrors(pairs);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(errors.translation[i], 0.0, 1e-12);
    EXPECT_NEAR(errors.rotation_deg[i], 0.0, 1e-9);
  }
}

TEST(TrajectoryErrorsTest, AlignmentInSpaceWithAndWithoutScale) {
  const Pose3 motion{Eigen::Quaterniond(Eigen::AngleAxisd(
                         1.1, Eigen::Vector3d(1, 2, -1).normalized())),
                     Eigen::Vector3d(3, -4, 5)};
  const std::vector<Pose3> reference = {At(0, 0, 0), At(2, 0, 1, 0.3),
                                        At(2, 3, 0, 1.0), At(-1, 1, 2, -0.5)};
  for (const double scale : {1.0, 0.5}) {
    std::vector<Pose3> estimate;
    for (Pose3 pose : reference) {
      pose = Compose(Inverse(motion), pose);
      pose.translation /= scale;
      estimate.push_back(pose);
    }
    PosePairs pairs = Pairs(reference, estimate);
    const AlignmentTransform transform = AlignPoses(
        scale == 1.0 ? PoseAlignment::kSe3 : PoseAlignment::kSim3, &pairs);
    EXPECT_NEAR(transform.scale, scale, 1e-12);
    EXPECT_NEAR((transform.motion.translation - motion.translation).norm(), 0.0,
                1e-12);
    const AbsoluteErrors errors = ComputeAbsoluteErrors(pairs);
    EXPECT_NEAR(SummarizeErrors(errors.translation).max, 0.0, 1e-12);
    EXPECT_NEAR(SummarizeErrors(errors.rotation_deg).max, 0.0, 1e-6);
  }
}

TEST(TrajectoryErrorsTest, AlignmentOfTheFirstPoses) {
  PosePairs pairs = Pairs({At(1, 1, 0, kPi / 2), At(1, 2, 0, kPi / 2)},
                          {At(0, 0), At(1.5, 0)});
  AlignPoses(PoseAlignment::kOrigin, &pairs);
  const AbsoluteErrors errors = ComputeAbsoluteErrors(pairs);
  EXPECT_NEAR(errors.translation[0], 0.0, 1e-12);
  EXPECT_NEAR(errors.translation[1], 0.5, 1e-12);
}

TEST(TrajectoryErrorsTest, WhatDeterminesNoAlignmentIsRefused) {
  PosePairs one = Pairs({At(1, 1)}, {At(0, 0)});
  EXPECT_THAT(Refusal([&] { AlignPoses(PoseAlignment::kSe2, &one); }),
              HasSubstr("one pose matches: it fits anywhere"));
  EXPECT_THAT(Refusal([&] { AlignPoses(PoseAlignment::kSe3, &one); }),
              HasSubstr("on one line"));
  PosePairs line =
      Pairs({At(0, 0), At(1, 0), At(2, 0)}, {At(0, 0), At(1, 0), At(2, 0)});
  EXPECT_THAT(Refusal([&] { AlignPoses(PoseAlignment::kSe3, &line); }),
              HasSubstr("on one line"));
  // In the plane a line is enough.
  AlignPoses(PoseAlignment::kSe2, &line);
}

TEST(TrajectoryErrorsTest, PlanarIsWhatLiesInThePlane) {
  EXPECT_TRUE(IsPlanar({{0.0, At(1, 2, 0, 0.5)}}));
  EXPECT_FALSE(IsPlanar({{0.0, At(1, 2, 0.1)}}));
  EXPECT_FALSE(IsPlanar(
      {{0.0,
        {Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX())),
         Eigen::Vector3d::Zero()}}}));
}

// evo's own results on these files, in the archives beside them.
class EvoTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* const datasets = std::getenv("PLUMBLINE_DATASETS");
    if (datasets == nullptr) GTEST_SKIP() << "PLUMBLINE_DATASETS is unset";
    const std::string folder = std::string(datasets) + "/bags/trajectories/";
    pairs_ = AssociatePoses(ReadTrajectory(folder + "KITTI_00_gt.txt.bz2"),
                            ReadTrajectory(folder + "KITTI_00_ORB.txt.bz2"));
  }

  PosePairs pairs_;
};

TEST_F(EvoTest, AbsoluteErrors) {
  AlignPoses(PoseAlignment::kSe3, &pairs_);
  const ErrorSummary ape =
      SummarizeErrors(ComputeAbsoluteErrors(pairs_).translation);
  EXPECT_NEAR(ape.rmse, 1.3034497145650266, 1e-9);
  EXPECT_NEAR(ape.mean, 1.1569971285389768, 1e-9);
  EXPECT_NEAR(ape.median, 1.065624769555848, 1e-9);
  EXPECT_NEAR(ape.std, 0.6002822693968323, 1e-9);
  EXPECT_NEAR(ape.min, 0.06931322021483087, 1e-9);
  EXPECT_NEAR(ape.max, 3.587949120678954, 1e-9);
  EXPECT_NEAR(ape.sse, 7715.073440292808, 1e-5);
}

TEST_F(EvoTest, RelativeErrors) {
  RelativeErrorOptions options;
  options.delta = 10.0;
  options.delta_is_m = true;
  const ErrorSummary rpe =
      SummarizeErrors(ComputeRelativeErrors(pairs_, options).translation);
  // Rotations are quaternions here, and matrices of six digits there.
  EXPECT_NEAR(rpe.rmse, 0.22626134329310163, 1e-6);
  EXPECT_NEAR(rpe.mean, 0.16901737200653275, 1e-6);
  EXPECT_NEAR(rpe.median, 0.13848432516645606, 1e-6);
  EXPECT_NEAR(rpe.std, 0.1504238127053164, 1e-6);
  EXPECT_NEAR(rpe.min, 0.025322719660754993, 2e-6);
  EXPECT_NEAR(rpe.max, 1.2722090778658726, 1e-6);
  EXPECT_NEAR(rpe.sse, 18.07155100048597, 2e-5);
}

}  // namespace
}  // namespace plumbline
