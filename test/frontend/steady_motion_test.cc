#include <gtest/gtest.h>
#include <plumbline/frontend/steady_motion.h>

#include <cmath>

namespace plumbline {
namespace {

TEST(SteadyMotionTest, MeanOfTheLastFour) {
  SteadyMotion motion;
  motion.Add(Pose2(9.0, 9.0, 9.0));
  for (const double x : {0.08, 0.10, 0.12}) {
    EXPECT_FALSE(motion.IsMoving());
    motion.Add(Pose2(x, 0.01, 0.02));
  }
  motion.Add(Pose2(0.14, 0.01, 0.02));
  EXPECT_TRUE(motion.IsMoving());
  const UncertainPose2 step = motion.Step();
  EXPECT_NEAR((step.mean - Pose2(0.11, 0.01, 0.02)).norm(), 0.0, 1e-12);
  // 0.02 m and half of the way; 3 degrees and half of the turn.
  EXPECT_NEAR(std::sqrt(step.covariance(0, 0)), 0.02 + 0.5 * std::sqrt(0.0122),
              1e-12);
  EXPECT_EQ(step.covariance(0, 0), step.covariance(1, 1));
  EXPECT_NEAR(std::sqrt(step.covariance(2, 2)), kPi / 60.0 + 0.01, 1e-12);
  EXPECT_EQ(step.covariance(0, 2), 0.0);
}

TEST(SteadyMotionTest, FollowsForever) {
  SteadyMotion motion;
  for (int i = 0; i < 1000; ++i) {
    motion.Add(Pose2(0.001 * i, 0.0, 0.0));
    if (i >= 3) {
      ASSERT_NEAR(motion.Step().mean[0], 0.001 * (i - 1.5), 1e-12);
    }
  }
}

TEST(SteadyMotionTest, StandsAndTurns) {
  SteadyMotion motion;
  for (int i = 0; i < 4; ++i) motion.Add(Pose2(0.019, 0.0, 0.017));
  EXPECT_FALSE(motion.IsMoving());
  for (int i = 0; i < 4; ++i) motion.Add(Pose2(0.0, 0.0, -0.02));
  EXPECT_TRUE(motion.IsMoving());
  motion.Break();
  EXPECT_FALSE(motion.IsMoving());
  for (int i = 0; i < 4; ++i) motion.Add(Pose2(-0.021, 0.0, 0.0));
  EXPECT_TRUE(motion.IsMoving());
}

TEST(SteadyMotionTest, ExplainsWhatIsAboutTheSame) {
  SteadyMotion motion;
  for (int i = 0; i < 4; ++i) motion.Add(Pose2(0.2, 0.0, 0.1));
  EXPECT_TRUE(motion.Explains(Pose2(0.2, 0.0, 0.1)));
  EXPECT_TRUE(motion.Explains(Pose2(0.3, 0.0, 0.0)));
  EXPECT_TRUE(motion.Explains(Pose2(0.2, 0.1, 0.2)));
  // A robot that stops, one that goes back, one that turns.
  EXPECT_FALSE(motion.Explains(Pose2(0.0, 0.0, 0.1)));
  EXPECT_FALSE(motion.Explains(Pose2(-0.2, 0.0, 0.1)));
  EXPECT_FALSE(motion.Explains(Pose2(0.2, 0.0, 0.3)));
  EXPECT_FALSE(motion.Explains(Pose2(0.2, 0.0, -0.1)));
}

}  // namespace
}  // namespace plumbline
