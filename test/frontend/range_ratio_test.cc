#include <gtest/gtest.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/range_ratio.h>

#include <cmath>
#include <optional>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

// Views along a room with a recess, as a laser sees it whose ranges are too
// long by a share and an offset; beside the axis by so much.
std::vector<KeyView> Views(double excess, double offset, double beside,
                           std::uint64_t seed) {
  std::vector<testing::WallEnds> walls = testing::Room(14.0, 5.0);
  walls.push_back({{1.0, 2.5}, {1.0, 1.5}});
  walls.push_back({{1.0, 1.5}, {3.0, 1.5}});
  walls.push_back({{3.0, 1.5}, {3.0, 2.5}});
  testing::Noise noise(seed);
  testing::Laser laser;
  laser.offset = Pose2(0.1, 0.0, 0.0);
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
  for (int i = 0; i < 40; ++i) {
    // As bent as poses are that were adjusted to both lasers.
    const Pose2 pose(-5.0 + 0.25 * i, beside, 0.4 * std::sin(0.7 * i));
    scans.push_back(testing::MakeScan(walls, pose, laser, &noise));
    for (float& range : scans.back().ranges) {
      range = static_cast<float>(range * (1.0 + excess) + offset);
    }
    keys.push_back(i);
    poses.push_back(pose + Pose2(noise.Normal(0.03), noise.Normal(0.03),
                                 noise.Normal(0.005)));
  }
  return MakeKeyViews(scans, keys, poses, {});
}

TEST(RangeRatioTest, IsFoundWhateverThePosesAndTheOffset) {
  const std::vector<KeyView> map = Views(0.0, 0.0, 0.0, 1);
  for (const double excess : {-0.02, 0.0, 0.015}) {
    for (const double offset : {0.0, 0.02}) {
      const std::optional<RangeRatio> ratio =
          CompareRanges(map, Views(excess, offset, 0.3, 2));
      ASSERT_TRUE(ratio);
      EXPECT_GE(ratio->pairs, 30);
      EXPECT_NEAR(ratio->excess, excess, 0.003) << offset;
      EXPECT_EQ(ratio->is_significant(), excess != 0.0)
          << ratio->excess << " " << ratio->sigma;
    }
  }
}

TEST(RangeRatioTest, ViewsFarFromEachOtherTellNothing) {
  const std::vector<KeyView> map = Views(0.0, 0.0, 0.0, 1);
  std::vector<KeyView> far = map;
  for (KeyView& view : far) view.pose[1] += 50.0;
  EXPECT_FALSE(CompareRanges(map, far));
  EXPECT_FALSE(CompareRanges(map, {}));
  EXPECT_FALSE(CompareRanges({}, map));
}

}  // namespace
}  // namespace plumbline
