#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/bent_map.h>

#include <cstddef>
#include <vector>

namespace plumbline {
namespace {

// Poses 0.5 m apart from `start` on, each step turning by so much, rad.
std::vector<Pose2> Arc(const Pose2& start, int count, double turn) {
  std::vector<Pose2> poses = {start};
  while (static_cast<int>(poses.size()) < count) {
    poses.push_back(Compose(poses.back(), Pose2(0.5, 0.0, turn)));
  }
  return poses;
}

TEST(PosesByMotionsTest, FollowsTheRecords) {
  std::vector<KeyScanRecord> records(4);
  records[0].motion.mean = Pose2(9.0, 9.0, 9.0);
  records[1].motion.mean = Pose2(1.0, 0.0, kPi / 2);
  records[2].motion.mean = Pose2(2.0, 0.0, 0.0);
  // Counts from the first one.
  records[3].motion.mean = Pose2(0.0, 3.0, 0.0);
  records[3].from = 0;
  const std::vector<Pose2> keys = {Pose2(10.0, 20.0, kPi / 2),
                                   Pose2(1.0, 1.0, 1.0), Pose2(2.0, 2.0, 2.0),
                                   Pose2(3.0, 3.0, 3.0)};
  const std::vector<Pose2> poses = PosesByMotions(records, keys);
  ASSERT_EQ(poses.size(), 4u);
  EXPECT_EQ(poses[0], keys[0]);
  EXPECT_TRUE(poses[1].head<2>().isApprox(Eigen::Vector2d(10.0, 21.0)));
  EXPECT_TRUE(poses[2].head<2>().isApprox(Eigen::Vector2d(8.0, 21.0)));
  EXPECT_TRUE(poses[3].head<2>().isApprox(Eigen::Vector2d(7.0, 20.0)));
  EXPECT_TRUE(PosesByMotions({}, {}).empty());
}

TEST(IsBentTest, WhatWasRoundAndIsMappedStraight) {
  const std::vector<Pose2> straight = Arc(Pose2(1.0, 2.0, 3.0), 60, 0.0);
  // 20 steps a window: 6 degrees each, and 2.
  const std::vector<Pose2> round = Arc(Pose2::Zero(), 60, DegToRad(0.3));
  const std::vector<Pose2> nearly = Arc(Pose2::Zero(), 60, DegToRad(0.1));
  EXPECT_TRUE(IsBent(straight, round));
  EXPECT_TRUE(IsBent(round, straight));
  EXPECT_FALSE(IsBent(straight, nearly));
  // Where they stand does not count.
  EXPECT_FALSE(
      IsBent(round, Arc(Pose2(-5.0, 7.0, kPi - 0.01), 60, DegToRad(0.3))));
  // Nor do half turns and more that both have.
  EXPECT_FALSE(IsBent(Arc(Pose2::Zero(), 60, DegToRad(10.0)),
                      Arc(Pose2::Zero(), 60, DegToRad(10.1))));
}

TEST(IsBentTest, OnAQuarterOfTheWays) {
  // A corner between two parts of 400 poses that only one has: each way of 10 m
  // over it turns, 20 of 780.
  std::vector<Pose2> straight = Arc(Pose2::Zero(), 800, 0.0);
  std::vector<Pose2> corner = Arc(Pose2::Zero(), 400, 0.0);
  const std::vector<Pose2> after =
      Arc(Compose(corner.back(), Pose2(0.5, 0.0, 1.0)), 400, 0.0);
  corner.insert(corner.end(), after.begin(), after.end());
  EXPECT_FALSE(IsBent(corner, straight));
  // 40 poses: 20 ways, all of them over the corner.
  straight.resize(40);
  corner.erase(corner.begin(), corner.begin() + 380);
  corner.resize(40);
  EXPECT_TRUE(IsBent(corner, straight));
}

TEST(HasKinkTest, AtOnePlace) {
  const std::vector<Pose2> round = Arc(Pose2(1.0, 2.0, 3.0), 800, 0.01);
  // Both go on alike behind a turn of so much that only one has.
  const auto kinked = [](double turn) {
    std::vector<Pose2> poses = Arc(Pose2::Zero(), 400, 0.01);
    const std::vector<Pose2> after =
        Arc(Compose(poses.back(), Pose2(0.5, 0.0, turn)), 400, 0.01);
    poses.insert(poses.end(), after.begin(), after.end());
    return poses;
  };
  EXPECT_TRUE(HasKink(kinked(DegToRad(5.0)), round));
  EXPECT_TRUE(HasKink(round, kinked(DegToRad(5.0))));
  EXPECT_FALSE(IsBent(kinked(DegToRad(5.0)), round));
  EXPECT_FALSE(HasKink(kinked(DegToRad(2.0)), round));
  EXPECT_FALSE(HasKink(round, round));
  EXPECT_FALSE(HasKink({}, {}));
}

TEST(IsBentTest, NothingWithoutAWayOfTenMetres) {
  EXPECT_FALSE(IsBent({}, {}));
  EXPECT_FALSE(IsBent(Arc(Pose2::Zero(), 20, 0.0),
                      Arc(Pose2::Zero(), 20, DegToRad(10.0))));
  // A jump is no way.
  std::vector<Pose2> standing(30, Pose2::Zero());
  std::vector<Pose2> jumped = standing;
  for (std::size_t i = 15; i < jumped.size(); ++i) {
    jumped[i] = Pose2(50.0, 0.0, 1.0);
  }
  EXPECT_FALSE(IsBent(standing, jumped));
}

// Poses 0.5 m apart: 60 steps to 30 m, 120 to 60 m.
TEST(AreBentByWallsTest, WhereWaysTurnAtTheMedian) {
  const auto arc = [](int count, double degrees_a_metre) {
    return Arc(Pose2(1.0, 2.0, 3.0), count, DegToRad(0.5 * degrees_a_metre));
  };
  // 0.3 degrees over 30 m.
  EXPECT_TRUE(AreBentByWalls(arc(80, 0.0), arc(80, 0.01)));
  EXPECT_TRUE(AreBentByWalls(arc(80, 0.01), arc(80, 0.0)));
  // 0.18 over 30 m, but 0.36 over 60 m.
  EXPECT_FALSE(AreBentByWalls(arc(80, 0.0), arc(80, 0.006)));
  EXPECT_TRUE(AreBentByWalls(arc(160, 0.0), arc(160, 0.006)));
  // 0.1 and 0.2.
  EXPECT_FALSE(AreBentByWalls(arc(160, 0.0), arc(160, 0.0033)));
  // Where they stand does not count, nor a bend that both have.
  EXPECT_FALSE(AreBentByWalls(Arc(Pose2(-5.0, 7.0, -kPi), 160, DegToRad(2.0)),
                              Arc(Pose2::Zero(), 160, DegToRad(2.0))));
  // Too short to tell.
  EXPECT_FALSE(AreBentByWalls(arc(50, 0.0), arc(50, 1.0)));
  EXPECT_FALSE(AreBentByWalls({}, {}));
}

TEST(AreBentByWallsTest, NotByOneCorner) {
  const std::vector<Pose2> straight = Arc(Pose2::Zero(), 400, 0.0);
  std::vector<Pose2> corner = Arc(Pose2::Zero(), 200, 0.0);
  const std::vector<Pose2> after =
      Arc(Compose(corner.back(), Pose2(0.5, 0.0, 0.1)), 200, 0.0);
  corner.insert(corner.end(), after.begin(), after.end());
  EXPECT_FALSE(AreBentByWalls(corner, straight));
}

}  // namespace
}  // namespace plumbline
