#include <gtest/gtest.h>
#include <plumbline/core/state_archive.h>
#include <plumbline/frontend/wheel_track.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

namespace plumbline {
namespace {

// Of returns that tell the place to a centimetre, and of those of a corridor
// along x that tell the way along it to 0.1 m.
const Eigen::Matrix3d kClear = Eigen::Vector3d(1e4, 1e4, 1e5).asDiagonal();
const Eigen::Matrix3d kAlong = Eigen::Vector3d(1e2, 1e4, 1e5).asDiagonal();

WheelTrack At(const Eigen::Vector2d& position) {
  WheelTrack track;
  track.Follow(position, kClear);
  return track;
}

TEST(WheelTrackTest, BeginsAtAMatch) {
  WheelTrack track;
  EXPECT_FALSE(track.exists());
  track.Follow({3.0, -4.0}, kClear);
  EXPECT_TRUE(track.exists());
  EXPECT_EQ(track.position(), Eigen::Vector2d(3.0, -4.0));
  // Early or late by 0.02 m at that match, and at the next.
  EXPECT_NEAR(
      (track.Covariance() - 0.0008 * Eigen::Matrix2d::Identity()).norm(), 0.0,
      1e-15);
  track.Reset();
  EXPECT_FALSE(track.exists());
}

TEST(WheelTrackTest, GoesByOdometry) {
  WheelTrack track = At({1.0, 2.0});
  track.Move(Pose2(0.3, 0.4, -0.2), 0.5 * kPi);
  EXPECT_NEAR((track.position() - Eigen::Vector2d(0.6, 2.3)).norm(), 0.0,
              1e-12);
  // 0.02 m over the root of a metre, 0.05 m over that of a radian.
  EXPECT_NEAR((track.Covariance() - (0.0008 + 0.0004 * 0.5 + 0.0025 * 0.2) *
                                        Eigen::Matrix2d::Identity())
                  .norm(),
              0.0, 1e-12);
}

TEST(WheelTrackTest, FollowsWhatIsClear) {
  // Odometry has the way 3 % too long.
  WheelTrack track = At({0.0, 0.0});
  double way = 0.0;
  for (int i = 0; i < 200; ++i) {
    way += 0.1;
    track.Move(Pose2(0.103, 0.0, 0.0), 0.0);
    track.Follow({way, 0.0}, kClear);
    ASSERT_TRUE(track.exists());
    ASSERT_LT(std::abs(track.position()[0] - way), 0.03) << i;
  }
  EXPECT_EQ(track.position()[1], 0.0);
}

TEST(WheelTrackTest, SmallErrorsOfMatchesDoNotAddUp) {
  // Each match begins where odometry has the robot and is 4 mm short of it:
  // taken from scan to scan that is 0.8 m.
  WheelTrack track = At({0.0, 0.0});
  for (int i = 0; i < 200; ++i) {
    track.Move(Pose2(0.1, 0.0, 0.0), 0.0);
    track.Follow(track.position() - Eigen::Vector2d(0.004, 0.0), kAlong);
  }
  EXPECT_NEAR(track.position()[0], 20.0, 0.05);
  // Where nothing is told of the way at all it is odometry's.
  track = At({0.0, 0.0});
  const Eigen::Matrix3d bare = Eigen::Vector3d(0.0, 1e4, 1e5).asDiagonal();
  for (int i = 0; i < 200; ++i) {
    track.Move(Pose2(0.1, 0.0, 0.0), 0.0);
    track.Follow(track.position() - Eigen::Vector2d(0.004, 0.0), bare);
  }
  EXPECT_NEAR(track.position()[0], 20.0, 1e-4);
}

TEST(WheelTrackTest, KnowsLessTheFartherItGoesUntold) {
  WheelTrack track = At({0.0, 0.0});
  const Eigen::Matrix3d bare = Eigen::Vector3d(0.0, 1e4, 1e5).asDiagonal();
  for (int i = 0; i < 100; ++i) {
    track.Move(Pose2(0.1, 0.0, 0.0), 0.0);
    track.Follow(track.position(), bare);
  }
  const Eigen::Matrix2d covariance = track.Covariance();
  // 0.2 m, 0.02 m and 0.02 m along; across it is told again and again.
  EXPECT_NEAR(covariance(0, 0), 100 * 0.1 * 0.0004, 0.001);
  EXPECT_LT(covariance(1, 1), 0.0008);
  // The end of the corridor is followed.
  track.Follow(track.position() + Eigen::Vector2d(0.1, 0.0), kClear);
  EXPECT_NEAR(track.position()[0], 10.1, 0.02);
}

TEST(WheelTrackTest, BeginsAnewAtWhatIsFarOff) {
  WheelTrack track = At({0.0, 0.0});
  for (int i = 0; i < 20; ++i) {
    track.Move(Pose2(0.1, 0.0, 0.0), 0.0);
    track.Follow(track.position(), kClear);
  }
  track.Follow({4.0, 1.0}, kClear);
  EXPECT_TRUE(track.exists());
  EXPECT_EQ(track.position(), Eigen::Vector2d(4.0, 1.0));
}

TEST(WheelTrackTest, BadOdometrySaysLess) {
  const auto drive = [](double error) {
    WheelTrack track = At({0.0, 0.0});
    double way = 0.0;
    for (int i = 0; i < 100; ++i) {
      way += 0.1;
      const double sign = i % 2 == 0 ? 1.0 : -1.0;
      track.Move(Pose2(0.1 + sign * error, 0.0, 0.0), 0.0);
      track.Follow({way, 0.0}, kClear);
    }
    return track;
  };
  // Within what odometry is early or late nothing changes.
  const double usual = drive(0.01).Covariance()(0, 0);
  EXPECT_NEAR(drive(0.0).Covariance()(0, 0), usual, 0.01 * usual);
  EXPECT_GT(drive(0.08).Covariance()(0, 0), 1.4 * usual);
  // It comes to rest again.
  WheelTrack track = drive(0.08);
  for (int i = 0; i < 100; ++i) {
    track.Move(Pose2(0.1, 0.0, 0.0), 0.0);
    track.Follow(track.position(), kClear);
  }
  EXPECT_NEAR(track.Covariance()(0, 0), usual, 0.01 * usual);
}

TEST(WheelTrackTest, TurnedTheWorldTurnsIt) {
  const double turn = 0.7;
  Eigen::Matrix2d rotation;
  rotation << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
  Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
  turned.topLeftCorner<2, 2>() = rotation;
  WheelTrack track = At({1.0, 2.0});
  WheelTrack other = At(rotation * Eigen::Vector2d(1.0, 2.0));
  double heading = 0.3;
  Eigen::Vector2d place(1.0, 2.0);
  for (int i = 0; i < 50; ++i) {
    const Pose2 motion(0.1, 0.01, 0.02);
    track.Move(motion, heading);
    other.Move(motion, heading + turn);
    place += 0.1 * Eigen::Vector2d(std::cos(heading), std::sin(heading));
    track.Follow(place, kAlong);
    other.Follow(rotation * place, turned * kAlong * turned.transpose());
    heading += 0.02;
    ASSERT_NEAR((other.position() - rotation * track.position()).norm(), 0.0,
                1e-9);
    ASSERT_NEAR((other.Covariance() -
                 rotation * track.Covariance() * rotation.transpose())
                    .norm(),
                0.0, 1e-9);
  }
}

// By hand: (3, -4) turned by a quarter is (4, 3).
TEST(WheelTrackTest, MovesWithTheFrame) {
  WheelTrack track;
  track.Follow({3.0, -4.0}, kClear);
  track.Move({1.0, 0.0, 0.0}, 0.0);
  track.Follow({4.0, -4.0}, Eigen::Vector3d(1e6, 1.0, 1e6).asDiagonal());
  const Eigen::Vector2d before = track.position();
  const Eigen::Matrix2d covariance = track.Covariance();
  track.MoveBy({10.0, 20.0, 0.5 * kPi});
  EXPECT_NEAR(track.position().x(), 10.0 - before.y(), 1e-12);
  EXPECT_NEAR(track.position().y(), 20.0 + before.x(), 1e-12);
  EXPECT_NEAR(before.y(), -4.0, 1e-12);
  // What was across is along.
  EXPECT_LT(covariance(0, 0), 0.9 * covariance(1, 1));
  EXPECT_NEAR(track.Covariance()(0, 0), covariance(1, 1), 1e-15);
  EXPECT_NEAR(track.Covariance()(1, 1), covariance(0, 0), 1e-15);
}

TEST(WheelTrackTest, IsWrittenAndRead) {
  WheelTrack track = At({1.0, 2.0});
  track.Move(Pose2(0.3, 0.0, 0.1), 0.4);
  track.Follow({1.4, 2.2}, kAlong);
  track.Move(Pose2(0.3, 0.0, 0.1), 0.4);
  track.Follow({1.9, 2.3}, kAlong);
  StateWriter writer;
  Exchange(writer, track);
  StateReader reader(writer.bytes());
  WheelTrack again;
  Exchange(reader, again);
  EXPECT_EQ(reader.size(), 0u);
  for (WheelTrack* either : {&track, &again}) {
    either->Move(Pose2(0.3, 0.0, 0.1), 0.5);
    either->Follow({2.1, 2.5}, kClear);
  }
  EXPECT_EQ(again.exists(), track.exists());
  EXPECT_EQ(again.position(), track.position());
  EXPECT_EQ(again.Covariance(), track.Covariance());
}

}  // namespace
}  // namespace plumbline
