#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/wall_contradictions.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

WallStretch StretchAt(double x, double y, double length) {
  WallStretch stretch;
  stretch.middle = {x, y};
  stretch.normal = {0.0, 1.0};
  stretch.length = length;
  return stretch;
}

TEST(WallContradictionsTest, Sums) {
  WallContradictions contradictions;
  EXPECT_EQ(contradictions.number(), 0u);
  EXPECT_EQ(contradictions.longest(), 0.0);
  contradictions.of_track = {StretchAt(0.0, 0.0, 0.8)};
  contradictions.of_map = {StretchAt(5.0, 0.0, 1.5), StretchAt(9.0, 0.0, 0.2)};
  EXPECT_EQ(contradictions.number(), 3u);
  EXPECT_DOUBLE_EQ(contradictions.length(), 2.5);
  EXPECT_EQ(contradictions.longest(), 1.5);
}

TEST(MovedDoorsTest, OneShutAndOneOpenedInTheSameWall) {
  WallContradictions contradictions;
  contradictions.of_track = {StretchAt(0.0, 0.0, 0.8)};
  contradictions.of_map = {StretchAt(2.0, 0.1, 0.8)};
  EXPECT_EQ(CountMovedDoors(contradictions), 1);
  // Each is one half of one pair.
  contradictions.of_track.push_back(StretchAt(0.5, 0.0, 0.8));
  EXPECT_EQ(CountMovedDoors(contradictions), 1);
  contradictions.of_map.push_back(StretchAt(-1.0, 0.0, 0.8));
  EXPECT_EQ(CountMovedDoors(contradictions), 2);
  // Too far along, in another wall, at a right angle.
  contradictions.of_track = {StretchAt(0.0, 0.0, 0.8)};
  contradictions.of_map = {StretchAt(3.5, 0.0, 0.8)};
  EXPECT_EQ(CountMovedDoors(contradictions), 0);
  contradictions.of_map = {StretchAt(0.5, 2.0, 0.8)};
  EXPECT_EQ(CountMovedDoors(contradictions), 0);
  contradictions.of_map = {StretchAt(1.0, 0.0, 0.8)};
  contradictions.of_map[0].normal = {1.0, 0.0};
  EXPECT_EQ(CountMovedDoors(contradictions), 0);
}

// A corridor of 2.4 m x 16 m with a door 1 m wide at the top, which is open in
// the map.
std::vector<KeyView> CorridorViews(bool is_open, std::uint64_t seed) {
  std::vector<testing::WallEnds> walls = testing::Room(16.0, 2.4);
  walls.erase(walls.begin() + 2);
  walls.push_back({{-8.0, 1.2}, {-0.5, 1.2}});
  walls.push_back({{0.5, 1.2}, {8.0, 1.2}});
  // The room behind.
  walls.push_back({{-2.0, 4.0}, {2.0, 4.0}});
  if (!is_open) walls.push_back({{-0.5, 1.2}, {0.5, 1.2}});
  testing::Noise noise(seed);
  testing::Laser laser = testing::FullCircle();
  laser.sigma = 0.005;
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
  for (int i = 0; i < 16; ++i) {
    keys.push_back(i);
    poses.emplace_back(-2.4 + 0.3 * i, -0.4, 0.0);
    scans.push_back(testing::MakeScan(walls, poses.back(), laser, &noise));
  }
  return MakeKeyViews(scans, keys, poses, {});
}

WallContradictions Compare(const std::vector<KeyView>& map,
                           const std::vector<KeyView>& track,
                           WindowVerdict verdict) {
  const std::vector<TrackWindow> windows = MakeTrackWindows(track, 16);
  std::vector<WindowJudgement> judgements(windows.size());
  for (std::size_t w = 0; w < windows.size(); ++w) {
    judgements[w].verdict = verdict;
    judgements[w].pose = windows[w].middle;
  }
  return FindWallContradictions(map, track, windows, judgements, {});
}

TEST(WallContradictionsTest, ADoorThatWasShut) {
  const std::vector<KeyView> open = CorridorViews(true, 1);
  const std::vector<KeyView> shut = CorridorViews(false, 2);
  const WallContradictions found = Compare(open, shut, WindowVerdict::kAgrees);
  ASSERT_EQ(found.of_track.size(), 1u);
  EXPECT_TRUE(found.of_map.empty());
  EXPECT_NEAR(found.of_track[0].middle.x(), 0.0, 0.3);
  EXPECT_NEAR(found.of_track[0].middle.y(), 1.2, 0.05);
  // Up to what counts for nothing at either end.
  EXPECT_GT(found.longest(), 0.2);
  EXPECT_LT(found.longest(), 1.1);
  // The other way round it is the map that has it.
  const WallContradictions turned = Compare(shut, open, WindowVerdict::kAgrees);
  EXPECT_TRUE(turned.of_track.empty());
  EXPECT_EQ(turned.of_map.size(), 1u);
  // Windows that do not agree are not asked.
  EXPECT_EQ(Compare(open, shut, WindowVerdict::kDoubtful).number(), 0u);
  EXPECT_EQ(
      Compare(open, CorridorViews(true, 3), WindowVerdict::kAgrees).number(),
      0u);
}

}  // namespace
}  // namespace plumbline
