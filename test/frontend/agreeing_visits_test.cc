#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/agreeing_visits.h>

#include <algorithm>
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
    for (int k = 0; k < 2 * kEach; ++k) {
      const double share = k < kEach ? 0.0 : 0.5 * k / kEach;
      See(LongHall(), InHall(k), share * bend, k != 0 && k != kEach);
    }
  }

  // It goes on from the end of the hall through `outside` key scans of nothing,
  // along which the way is bent, and all of the way back is off.
  ThereAndBack(const Pose2& bend, int outside) {
    for (int k = 0; k < kEach; ++k) {
      See(LongHall(), InHall(k), Pose2::Zero(), k != 0);
    }
    for (int k = 0; k < outside; ++k) {
      const double x = 17.5 + 0.3 * std::min(k, outside - k);
      See({}, Pose2(x, 0.0, 2 * k < outside ? 0.0 : kPi),
          k / double(outside) * bend, true);
    }
    for (int k = kEach; k < 2 * kEach; ++k) {
      See(LongHall(), InHall(k), bend, true);
    }
  }

  static constexpr int kEach = 115;

  static Pose2 InHall(int k) {
    const bool is_back = k >= kEach;
    const int step = is_back ? 2 * kEach - 1 - k : k;
    return Pose2(-17.0 + 0.3 * step, is_back ? -0.2 : 0.2, is_back ? kPi : 0.0);
  }

  void See(const std::vector<testing::WallEnds>& walls, const Pose2& at,
           const Pose2& off, bool does_follow) {
    testing::Laser laser = testing::FullCircle();
    laser.angle_step = DegToRad(1.0);
    laser.beams = 360;
    scans.push_back(MakeScan(walls, at, laser));
    truth.push_back(at);
    poses.push_back(Compose(off, at));
    follows.push_back(does_follow);
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

// Five metres are a hundred standard deviations: beside the way that holds them
// what agrees there counts for little at first.
TEST(AgreeingVisitsTest, BendsAWayByMetres) {
  const ThereAndBack log(Pose2(5.0, 0.3, 0.0), 200);
  const std::vector<Pose2> bent = log.Bent();
  ASSERT_EQ(bent.size(), log.poses.size());
  for (std::size_t k = bent.size() - 50; k < bent.size(); ++k) {
    const Pose2 in_first = Between(bent.front(), bent[k]);
    const Pose2 true_in_first = Between(log.truth.front(), log.truth[k]);
    EXPECT_LT(PositionError(in_first, true_in_first), 0.2) << k;
    EXPECT_LT(HeadingError(in_first, true_in_first), DegToRad(2.0)) << k;
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
