#include <gtest/gtest.h>
#include <plumbline/frontend/missed_motion.h>

#include <vector>

namespace plumbline {
namespace {

// A key scan at (1, 2) that looks along y, and scans by odometry: 1 m a
// scan along y, but for the third, which stands.
std::vector<RefinedScan> DriveWithBlindRuns() {
  std::vector<RefinedScan> refined(8);
  const Pose2 key(1.0, 2.0, 0.5 * kPi);
  double way = 0.0;
  for (std::size_t i = 0; i < refined.size(); ++i) {
    if (i > 0 && i != 3) way += 1.0;
    refined[i].since_key.mean = Pose2(way, 0.0, 0.0);
    refined[i].pose = Compose(key, refined[i].since_key.mean);
  }
  refined[0].is_key = true;
  return refined;
}

// Scan 7, which odometry has at (1, 8), is matched at (1.5, 8.6).
std::vector<RefinedScan> MatchedAgain() {
  std::vector<RefinedScan> refined = DriveWithBlindRuns();
  refined[7].missed = Pose2(0.6, -0.5, 0.1);
  refined[7].missed_since = 1;
  refined[7].pose = Compose(refined[7].pose, refined[7].missed);
  refined[7].since_key.mean =
      Compose(refined[7].since_key.mean, refined[7].missed);
  return refined;
}

TEST(MissedMotionTest, IsSpreadOverTheWay) {
  std::vector<RefinedScan> refined = MatchedAgain();
  const std::vector<RefinedScan> before = refined;
  SpreadMissedMotion(&refined);
  // Scan 1 was matched; of the 5 m since then scan 2 has 1, and so has scan 3.
  const std::vector<double> shares = {0.0, 0.0, 0.2, 0.2, 0.4, 0.6, 0.8};
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double share = shares[i];
    const Pose2 expected(1.0 + 0.5 * share, before[i].pose[1] + 0.6 * share,
                         0.5 * kPi + 0.1 * share);
    EXPECT_NEAR((refined[i].pose - expected).norm(), 0.0, 1e-12) << i;
    EXPECT_NEAR(
        (Compose(refined[0].pose, refined[i].since_key.mean) - refined[i].pose)
            .norm(),
        0.0, 1e-12)
        << i;
  }
  EXPECT_EQ(refined[7].pose, before[7].pose);
  EXPECT_EQ(refined[7].since_key.mean, before[7].since_key.mean);
}

TEST(MissedMotionTest, RunsEndWhereAScanIsMatched) {
  EXPECT_TRUE(FindBlindRuns({}).empty());
  EXPECT_TRUE(FindBlindRuns(DriveWithBlindRuns()).empty());
  std::vector<RefinedScan> refined = MatchedAgain();
  std::vector<BlindRun> runs = FindBlindRuns(refined);
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(runs[0].begin, 1);
  EXPECT_EQ(runs[0].end, 7);
  EXPECT_EQ(runs[0].missed, refined[7].missed);
  // A key scan anchors what follows.
  refined[4].is_key = true;
  runs = FindBlindRuns(refined);
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(runs[0].begin, 4);
}

// From the first scan on, and by a robot that stands.
TEST(MissedMotionTest, WithoutAWayNothingMoves) {
  std::vector<RefinedScan> refined(3);
  refined[2].missed_since = 0;
  refined[2].missed = Pose2(0.3, 0.0, 0.0);
  refined[2].pose = refined[2].missed;
  SpreadMissedMotion(&refined);
  EXPECT_EQ(refined[0].pose, Pose2::Zero().eval());
  EXPECT_EQ(refined[1].pose, Pose2::Zero().eval());
}

}  // namespace
}  // namespace plumbline
