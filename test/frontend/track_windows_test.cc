#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/track_windows.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

// A room of 10 m by 6 m with a box in it.
std::vector<testing::WallEnds> RoomWithABox(const Pose2& box) {
  std::vector<testing::WallEnds> walls = testing::Room(10.0, 6.0);
  for (const testing::WallEnds& side :
       testing::Moved(testing::Room(1.2, 0.8), box)) {
    walls.push_back(side);
  }
  return walls;
}

// Views on the way through it, whose poses are in the frame of the first.
std::vector<KeyView> ViewsOnTheWay(const std::vector<testing::WallEnds>& walls,
                                   std::uint64_t seed, int count) {
  testing::Noise noise(seed);
  testing::Laser laser = testing::FullCircle();
  laser.sigma = 0.01;
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
  for (int i = 0; i < count; ++i) {
    const Pose2 pose(-4.0 + 0.3 * i, -2.0, 0.0);
    keys.push_back(i);
    scans.push_back(testing::MakeScan(walls, pose, laser, &noise));
    poses.push_back(pose);
  }
  return MakeKeyViews(scans, keys, poses, {});
}

TEST(TrackWindowsTest, CutTheTrack) {
  const std::vector<KeyView> track =
      ViewsOnTheWay(RoomWithABox(Pose2(1.0, 1.0, 0.3)), 1, 20);
  const std::vector<TrackWindow> windows = MakeTrackWindows(track, 8);
  ASSERT_EQ(windows.size(), 2u);
  EXPECT_EQ(windows[0].begin, 0u);
  EXPECT_EQ(windows[0].end, windows[1].begin);
  EXPECT_EQ(windows[1].end, 20u);
  for (const TrackWindow& window : windows) {
    ASSERT_EQ(window.relative.size(), window.end - window.begin);
    for (std::size_t k = window.begin; k < window.end; ++k) {
      EXPECT_NEAR((Compose(window.middle, window.relative[k - window.begin]) -
                   track[k].pose)
                      .norm(),
                  0.0, 1e-9);
    }
    EXPECT_GT(window.dense.size(), 2 * window.sparse.size());
  }
  // One that is too short is one window.
  EXPECT_EQ(MakeTrackWindows(track, 50).size(), 1u);
}

TEST(TrackWindowsTest, JudgeAPlace) {
  const std::vector<testing::WallEnds> room =
      RoomWithABox(Pose2(1.0, 1.0, 0.3));
  const std::vector<KeyView> map = ViewsOnTheWay(room, 1, 20);
  const std::vector<KeyView> track = ViewsOnTheWay(room, 2, 8);
  const std::vector<TrackWindow> windows = MakeTrackWindows(track, 8);
  ASSERT_EQ(windows.size(), 1u);
  const TrackPlacementOptions options;
  const Pose2 truth = windows[0].middle;

  // A little off: it agrees and is matched.
  const WindowJudgement right =
      JudgeWindow(map, track, windows[0],
                  Compose(truth, Pose2(0.1, -0.1, DegToRad(2.0))), options);
  EXPECT_EQ(right.verdict, WindowVerdict::kAgrees);
  EXPECT_LT((right.pose - truth).head<2>().norm(), 0.01);
  EXPECT_GT(right.quality, 0.7);
  EXPECT_GT(right.information.determinant(), 0.0);

  // In the middle of the room and turned.
  const WindowJudgement wrong =
      JudgeWindow(map, track, windows[0], Pose2(0.0, 0.0, 1.2), options);
  EXPECT_EQ(wrong.verdict, WindowVerdict::kContradicts);

  // Where nobody has been.
  const WindowJudgement away =
      JudgeWindow(map, track, windows[0], Pose2(100.0, 0.0, 0.0), options);
  EXPECT_EQ(away.verdict, WindowVerdict::kUnknown);
}

TEST(TrackWindowsTest, ATrackIsFittedToItsWindows) {
  const Pose2 frame(7.0, -3.0, 2.0);
  std::vector<TrackWindow> windows(4);
  std::vector<WindowJudgement> judgements(4);
  for (std::size_t w = 0; w < windows.size(); ++w) {
    const auto x = static_cast<double>(w);
    windows[w].middle = Pose2(4.0 * x, x * x, 0.3 * x);
    judgements[w].verdict = WindowVerdict::kAgrees;
    judgements[w].pose = Compose(frame, windows[w].middle);
  }
  // One that does not agree is not asked.
  judgements[1].verdict = WindowVerdict::kDoubtful;
  judgements[1].pose = Pose2(50.0, 50.0, 0.0);
  const Pose2 fitted = FitTrack(windows, judgements);
  EXPECT_NEAR((fitted - frame).head<2>().norm(), 0.0, 1e-9);
  EXPECT_NEAR(NormalizeAngle(fitted[2] - frame[2]), 0.0, 1e-9);
  // A single one has a direction as well.
  windows.resize(1);
  judgements.resize(1);
  EXPECT_NEAR(NormalizeAngle(FitTrack(windows, judgements)[2] - frame[2]), 0.0,
              1e-9);
}

// Along a bare corridor a window says nothing, wherever it slid to.
TEST(TrackWindowsTest, ASlidWindowDoesNotMoveTheTrack) {
  const Pose2 frame(7.0, -3.0, 0.5);
  std::vector<TrackWindow> windows(4);
  std::vector<WindowJudgement> judgements(4);
  Eigen::Rotation2Dd turn(frame[2]);
  for (std::size_t w = 0; w < windows.size(); ++w) {
    windows[w].middle = Pose2(5.0 * static_cast<double>(w), 0.0, 0.0);
    judgements[w].verdict = WindowVerdict::kAgrees;
    judgements[w].pose = Compose(frame, windows[w].middle);
    judgements[w].information = 100.0 * Eigen::Matrix2d::Identity();
  }
  judgements[2].information = turn * Eigen::Vector2d(0.1, 100.0).asDiagonal() *
                              turn.inverse().toRotationMatrix();
  judgements[2].pose = Compose(judgements[2].pose, Pose2(0.8, 0.0, 0.0));
  const Pose2 fitted = FitTrack(windows, judgements);
  EXPECT_LT((fitted - frame).head<2>().norm(), 0.01);
  EXPECT_NEAR(fitted[2], frame[2], DegToRad(0.05));
  // Across it it does.
  judgements[2].pose =
      Compose(Compose(frame, windows[2].middle), Pose2(0.0, 0.8, 0.0));
  EXPECT_GT((FitTrack(windows, judgements) - frame).head<2>().norm(), 0.1);
}

}  // namespace
}  // namespace plumbline
