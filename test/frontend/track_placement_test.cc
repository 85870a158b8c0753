#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/track_placement.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "frontend/long_hall.h"
#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::WallEnds;

// Two rooms of 8 m by 6 m with boxes in them, which a bare corridor of 40 m
// joins.
std::vector<WallEnds> RoomsAndCorridor() {
  std::vector<WallEnds> walls;
  for (const double side : {-1.0, 1.0}) {
    const Pose2 frame(24.0 * side, 0.0, side > 0.0 ? 0.0 : kPi);
    std::vector<WallEnds> room = {
        {{4.0, -3.0}, {4.0, 3.0}},    {{4.0, 3.0}, {-4.0, 3.0}},
        {{-4.0, -3.0}, {4.0, -3.0}},  {{-4.0, 3.0}, {-4.0, 1.0}},
        {{-4.0, -1.0}, {-4.0, -3.0}},
    };
    const double size = side > 0.0 ? 1.2 : 2.0;
    for (const Pose2& box :
         {Pose2(1.0, 1.8 * side, 0.3), Pose2(2.2 - size, -1.7, 0.5 * side)}) {
      for (const WallEnds& edge : testing::Moved(testing::Room(size, 0.6), box))
        room.push_back(edge);
    }
    for (const WallEnds& wall : testing::Moved(room, frame))
      walls.push_back(wall);
    walls.push_back({{-20.0, side}, {20.0, side}});
  }
  return walls;
}

// From room to room, seen from `y`; poses are those of the truth.
std::vector<KeyView> Drive(std::uint64_t seed, double y) {
  testing::Noise noise(seed);
  testing::Laser laser = testing::FullCircle();
  laser.sigma = 0.04;
  laser.maximum_range = 8.0;
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
  for (double x = -26.0; x < 26.0; x += 0.3) {
    keys.push_back(static_cast<int>(keys.size()));
    poses.emplace_back(x, y, 0.0);
    scans.push_back(
        testing::MakeScan(RoomsAndCorridor(), poses.back(), laser, &noise));
  }
  return MakeKeyViews(scans, keys, poses, {});
}

// What slides along it, as far as half a metre where ranges are noisy, does not
// bend the track.
TEST(PlaceTrackTest, ABareCorridorSaysNothingOfItsLength) {
  TrackPlacementOptions options;
  options.min_certain_information_share = options.min_information_share;
  const TrackPlacement placement =
      PlaceTrack(Drive(1, 0.1), Drive(2, -0.1), std::nullopt, options);
  ASSERT_TRUE(placement.found) << placement.why_not;
  EXPECT_LT(placement.pose.norm(), 0.05);
  EXPECT_EQ(placement.agreeing, placement.windows);
  EXPECT_LT(placement.misfit, 0.1);
}

TEST(PlaceTrackTest, JudgesAPlace) {
  const std::vector<KeyView> map = Drive(1, 0.1);
  const std::vector<KeyView> track = Drive(2, -0.1);
  const PlaceSupport right = JudgePlace(map, track, Pose2::Zero(), {});
  EXPECT_EQ(right.agreeing, 10);
  EXPECT_EQ(right.contradicting, 0);
  const PlaceSupport wrong =
      JudgePlace(map, track, Pose2(0.0, 0.0, 0.5 * kPi), {});
  EXPECT_EQ(wrong.agreeing, 0);
  EXPECT_GE(wrong.contradicting, 1);
}

// Key scans along a hall from `from` to `to`; poses are those of the truth.
std::vector<KeyView> DriveAlong(const std::vector<WallEnds>& hall, double from,
                                double to, double y, double sigma) {
  testing::Noise noise(5);
  testing::Laser laser = testing::FullCircle();
  laser.angle_step = DegToRad(1.0);
  laser.beams = 360;
  laser.sigma = sigma;
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
  for (double x = from; x < to; x += 0.3) {
    keys.push_back(static_cast<int>(keys.size()));
    poses.emplace_back(x, y, 0.0);
    scans.push_back(testing::MakeScan(hall, poses.back(), laser, &noise));
  }
  return MakeKeyViews(scans, keys, poses, {});
}

// A wall of 1.4 m in the middle of the hall, of which 0.3 m at either end count
// for nothing.
TEST(PlaceTrackTest, SaysWhatContradictsAtAPlace) {
  const std::vector<WallEnds> empty = testing::LongHall();
  std::vector<WallEnds> full = empty;
  full.push_back({{-1.4, 1.2}, {0.0, 1.2}});
  const std::vector<KeyView> without = DriveAlong(empty, -18.0, 18.0, 0.2, 0.0);
  const std::vector<KeyView> with = DriveAlong(full, -12.0, 12.0, -0.2, 0.0);
  const WallContradictions there =
      ContradictionsOfPlace(without, with, Pose2::Zero(), {});
  EXPECT_TRUE(there.of_map.empty());
  ASSERT_EQ(there.of_track.size(), 1u);
  EXPECT_NEAR(there.of_track[0].middle.x(), -0.7, 0.4);
  EXPECT_NEAR(there.of_track[0].middle.y(), 1.2, 0.1);
  EXPECT_NEAR(there.of_track[0].length, 0.8, 0.2);
  const WallContradictions back =
      ContradictionsOfPlace(with, without, Pose2::Zero(), {});
  EXPECT_TRUE(back.of_track.empty());
  EXPECT_EQ(back.of_map.size(), 1u);
  EXPECT_EQ(ContradictionsOfPlace(without, without, Pose2::Zero(), {}).number(),
            0u);
  // No window agrees, so none says anything.
  EXPECT_EQ(
      ContradictionsOfPlace(without, with, Pose2(0.0, 100.0, 0.0), {}).number(),
      0u);
}

// The window that fits best looks through what stood there before; others agree
// once they are asked.
TEST(PlaceTrackTest, AsksAllWindowsThatSpeakForAPlace) {
  const std::vector<WallEnds> after = testing::LongHall();
  std::vector<WallEnds> before = after;
  for (double x = -12.0; x < -6.0; x += 1.5) {
    before.push_back({{x, 1.0}, {x + 0.3, 1.0}});
  }
  const std::vector<KeyView> map = DriveAlong(before, -18.0, 18.0, 0.2, 0.0);
  std::vector<KeyView> track = DriveAlong(after, -13.0, -4.0, -0.2, 0.0);
  for (const KeyView& view : DriveAlong(after, -4.0, 14.0, -0.2, 0.08)) {
    track.push_back(view);
  }
  TrackPlacementOptions options;
  options.max_seen_through = 0.04;
  EXPECT_EQ(PlaceTrack(map, track, std::nullopt, options).agreeing, 0);
  options.ask_all_voters = true;
  const TrackPlacement placement =
      PlaceTrack(map, track, std::nullopt, options);
  EXPECT_EQ(placement.agreeing, 3);
  EXPECT_EQ(placement.doubtful, 2);
  EXPECT_LT(placement.pose.norm(), 0.05);
}

// A hall in which a wall of 1.2 m stands on another day, more or less than what
// may for each window that agrees.
TEST(PlaceTrackTest, TooMuchWallThatContradictsIsAnotherPlace) {
  const std::vector<WallEnds> after = testing::LongHall();
  std::vector<WallEnds> before = after;
  before.push_back({{1.0, 1.0}, {2.2, 1.0}});
  const std::vector<KeyView> map = DriveAlong(before, -18.0, 18.0, 0.2, 0.0);
  const std::vector<KeyView> track = DriveAlong(after, -13.0, 14.0, -0.2, 0.0);
  TrackPlacementOptions options;
  options.min_agreeing_per_change = 1;
  const TrackPlacement found = PlaceTrack(map, track, std::nullopt, options);
  ASSERT_TRUE(found.found) << found.why_not;
  EXPECT_GT(found.contradicting_length, 0.2);
  const double per_window = found.contradicting_length / found.agreeing;
  for (const double share : {0.9, 1.1}) {
    options.max_contradicting_per_window = share * per_window;
    const TrackPlacement now = PlaceTrack(map, track, std::nullopt, options);
    EXPECT_EQ(now.found, share > 1.0) << now.why_not;
    EXPECT_EQ(now.why_not.find("m of wall in all") != std::string::npos,
              share < 1.0)
        << now.why_not;
  }
}

// The same hall is on another floor, with and without a wall that the track
// looks through.
TEST(PlaceTrackTest, APlaceThatMoreContradictsIsHardlyARival) {
  const std::vector<WallEnds> hall = testing::LongHall();
  const std::vector<KeyView> track = DriveAlong(hall, -13.0, 14.0, -0.2, 0.0);
  for (const bool has_wall : {false, true}) {
    SCOPED_TRACE(has_wall);
    std::vector<WallEnds> other = hall;
    if (has_wall) other.push_back({{1.0, 1.0}, {3.4, 1.0}});
    std::vector<KeyView> map = DriveAlong(hall, -18.0, 18.0, 0.2, 0.0);
    for (KeyView& view : DriveAlong(other, -18.0, 18.0, 0.2, 0.0)) {
      view.pose = Compose(Pose2(0.0, 60.0, 0.0), view.pose);
      map.push_back(view);
    }
    const TrackPlacement placement =
        PlaceTrack(map, track, std::nullopt, TrackPlacementOptions());
    EXPECT_GE(placement.agreeing, 4);
    EXPECT_GE(placement.rival, 3.0);
    EXPECT_EQ(placement.clean_rival, has_wall ? 0.0 : placement.rival);
    EXPECT_GT(placement.compared, 1000);
    EXPECT_LT(placement.contradicted, 0.02 * placement.compared);
  }
}

}  // namespace
}  // namespace plumbline
