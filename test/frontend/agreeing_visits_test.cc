#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/agreeing_visits.h>

#include <cstddef>
#include <vector>

#include "frontend/long_hall.h"
#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::HeadingError;
using testing::LongHall;
using testing::MakeScan;
using testing::PositionError;

// A robot goes along the hall, is carried on beyond its end, and comes back.
struct ThereAndBack {
  std::vector<Scan> scans;
  std::vector<Pose2> truth;
  std::vector<Pose2> poses;
  std::vector<bool> follows;

  // `bend`: how far the last pose is off; the first one of the way back is off
  // by half of that.
  explicit ThereAndBack(const Pose2& bend) {
    testing::Laser laser = testing::FullCircle();
    laser.angle_step = DegToRad(1.0);
    laser.beams = 360;
    constexpr int kEach = 115;
    for (int k = 0; k < 2 * kEach; ++k) {
      const bool is_back = k >= kEach;
      const int step = is_back ? 2 * kEach - 1 - k : k;
      const Pose2 at(-17.0 + 0.3 * step, is_back ? -0.2 : 0.2,
                     is_back ? kPi : 0.0);
      scans.push_back(MakeScan(LongHall(), at, laser));
      truth.push_back(at);
      const double share =
          is_back ? 0.5 + 0.5 * (k - kEach) / double{kEach} : 0.0;
      poses.push_back(Compose(Pose2(share * bend), at));
      follows.push_back(k != 0 && k != kEach);
    }
  }

  std::vector<KeyView> Views() const {
    std::vector<int> keys;
    for (std::size_t k = 0; k < scans.size(); ++k) {
      keys.push_back(static_cast<int>(k));
    }
    return MakeKeyViews(scans, keys, poses, {});
  }

  std::vector<Pose2> Bent(int num_threads = 1) const {
    return PosesOfAgreeingVisits(Views(), follows, {}, num_threads);
  }
};

TEST(AgreeingVisitsTest, BendsTheWayToWhereVisitsAgree) {
  for (const Pose2& bend : {Pose2(1.2, 0.4, 0.0), Pose2(-0.5, 0.5, -0.03)}) {
    const ThereAndBack log(bend);
    const std::vector<Pose2> bent = log.Bent();
    ASSERT_EQ(bent.size(), log.poses.size());
    EXPECT_EQ(bent.front(), log.poses.front());
    for (std::size_t k = 0; k < bent.size(); ++k) {
      // What is seen shortly before and after the turn is one visit.
      if (k >= 115 && k < 150) continue;
      const Pose2 in_first = Between(bent.front(), bent[k]);
      const Pose2 true_in_first = Between(log.truth.front(), log.truth[k]);
      EXPECT_LT(PositionError(in_first, true_in_first), 0.2) << k;
      EXPECT_LT(HeadingError(in_first, true_in_first), DegToRad(2.0)) << k;
    }
    EXPECT_GT(PositionError(log.poses.back(), log.truth.back()), 0.8);
  }
}

TEST(AgreeingVisitsTest, WhereAllAgreesThereIsNothingToDo) {
  EXPECT_TRUE(ThereAndBack(Pose2::Zero()).Bent().empty());
  // Nor where all of it contradicts and is off by more than is looked for.
  EXPECT_TRUE(ThereAndBack(Pose2(18.0, 0.0, 0.0)).Bent().empty());
  // Nor where nothing is near.
  EXPECT_TRUE(ThereAndBack(Pose2(0.0, 60.0, 0.0)).Bent().empty());
  EXPECT_TRUE(PosesOfAgreeingVisits({}, {}, {}, 1).empty());
}

TEST(AgreeingVisitsTest, DoesNotDependOnThreads) {
  const ThereAndBack log(Pose2(1.6, 0.4, 0.0));
  const std::vector<Pose2> alone = log.Bent(1);
  ASSERT_FALSE(alone.empty());
  EXPECT_EQ(alone, log.Bent(3));
}

TEST(AgreeingVisitsTest, StopsAndRefuses) {
  const ThereAndBack log(Pose2(1.6, 0.4, 0.0));
  EXPECT_TRUE(PosesOfAgreeingVisits(log.Views(), log.follows, {}, 1, [] {
                return true;
              }).empty());
  EXPECT_THROW(PosesOfAgreeingVisits(log.Views(), {true}, {}, 1), Error);
}

}  // namespace
}  // namespace plumbline
