#include <gtest/gtest.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/odometry_calibration.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {
namespace {

// Odometry's, and that of returns which show the way, in m^2 and rad^2.
const Eigen::Matrix3d kWheels =
    Eigen::Vector3d(0.0016, 0.0016, 0.001).asDiagonal();
const Eigen::Matrix3d kClear = Eigen::Vector3d(1e4, 1e4, 1e5).asDiagonal();
// What odometry goes between two scans at an even speed, m.
constexpr double kStep = 0.1;

// `count` motions by 0.3 m in direction `angle`, matched as `ratio` times that.
void DriveStraight(int count, double ratio, double angle,
                   const Eigen::Matrix3d& information,
                   OdometryCalibration* scale) {
  const Pose2 motion(0.3 * std::cos(angle), 0.3 * std::sin(angle), 0.01);
  const Pose2 matched(ratio * motion[0], ratio * motion[1], 0.01);
  for (int i = 0; i < count; ++i) {
    scale->Compare(motion, kWheels, matched, information, kStep);
  }
}

TEST(OdometryCalibrationTest, IsOneAtFirst) {
  const OdometryCalibration scale;
  EXPECT_EQ(scale.scale(), 1.0);
  EXPECT_EQ(scale.Corrected(Pose2(1.0, -2.0, 0.5)), Pose2(1.0, -2.0, 0.5));
}

TEST(OdometryCalibrationTest, IsLearntInAnyDirection) {
  for (const double angle : {0.0, 0.7, kPi, -2.0}) {
    OdometryCalibration scale;
    DriveStraight(100, 0.95, angle, kClear, &scale);
    EXPECT_NEAR(scale.scale(), 0.95, 0.002) << angle;
    const Pose2 scaled = scale.Corrected(Pose2(1.0, -2.0, 0.5));
    EXPECT_NEAR(scaled[0], 0.95, 0.002);
    EXPECT_NEAR(scaled[1], -1.9, 0.004);
    EXPECT_EQ(scaled[2], 0.5);
  }
}

TEST(OdometryCalibrationTest, FewMotionsSayLittle) {
  OdometryCalibration scale;
  DriveStraight(3, 0.9, 0.0, kClear, &scale);
  EXPECT_LT(scale.scale(), 1.0);
  EXPECT_GT(scale.scale(), 0.93);
}

TEST(OdometryCalibrationTest, ACorridorSaysNothing) {
  // The returns show what is across only: the ratio repeats odometry.
  for (const double angle : {0.0, 0.7}) {
    const Eigen::Vector3d across(-std::sin(angle), std::cos(angle), 0.0);
    Eigen::Matrix3d information = 1e4 * across * across.transpose();
    information(2, 2) = 1e5;
    OdometryCalibration scale;
    DriveStraight(100, 0.95, angle, information, &scale);
    EXPECT_EQ(scale.scale(), 1.0);
  }
}

TEST(OdometryCalibrationTest, BothEndsMustBeClear) {
  // The robot slipped in a corridor: the first clear scan shows it at once.
  OdometryCalibration scale;
  for (int i = 0; i < 50; ++i) {
    DriveStraight(1, 1.0, 0.0, Eigen::Matrix3d::Zero(), &scale);
    DriveStraight(1, 0.9, 0.0, kClear, &scale);
  }
  EXPECT_EQ(scale.scale(), 1.0);
  for (int i = 0; i < 50; ++i) {
    scale.Break();
    DriveStraight(1, 0.9, 0.0, kClear, &scale);
  }
  EXPECT_EQ(scale.scale(), 1.0);
}

TEST(OdometryCalibrationTest, SlipsAndNoiseDoNotCount) {
  OdometryCalibration scale;
  for (int i = 0; i < 50; ++i) {
    DriveStraight(2, 1.0, 0.0, kClear, &scale);
    DriveStraight(1, -1.0, 0.0, kClear, &scale);
    DriveStraight(1, 0.2, 0.0, kClear, &scale);
    const Pose2 small(0.02, 0.0, 0.3);
    scale.Compare(small, kWheels, Pose2(0.018, 0.0, 0.3), kClear, kStep);
  }
  EXPECT_EQ(scale.scale(), 1.0);
}

// Wheels that are entered at 70 and at 40 % of their size.
TEST(OdometryCalibrationTest, AMetreThatIsWrongByFarIsLearnt) {
  for (const double ratio : {1.43, 2.5}) {
    OdometryCalibration scale;
    DriveStraight(8, ratio, 0.3, kClear, &scale);
    EXPECT_EQ(scale.scale(), 1.0);
    DriveStraight(1, ratio, 0.3, kClear, &scale);
    EXPECT_NEAR(scale.scale(), ratio, 1e-9);
    DriveStraight(50, 1.02 * ratio, 0.3, kClear, &scale);
    EXPECT_NEAR(scale.scale(), 1.02 * ratio, 0.01);
  }
}

// Motions that are longer at times, or by now this and now that, are slips, ...
TEST(OdometryCalibrationTest, MotionsThatAreLongerNowAndThenAreNone) {
  OdometryCalibration scale;
  for (int i = 0; i < 20; ++i) {
    DriveStraight(6, 1.5, 0.0, kClear, &scale);
    DriveStraight(2, 1.0, 0.0, kClear, &scale);
  }
  EXPECT_EQ(scale.scale(), 1.0);
  for (int i = 0; i < 20; ++i) {
    DriveStraight(2, 1.5, 0.0, kClear, &scale);
    DriveStraight(2, 2.4, 0.0, kClear, &scale);
  }
  EXPECT_EQ(scale.scale(), 1.0);
  DriveStraight(30, 5.0, 0.0, kClear, &scale);
  EXPECT_EQ(scale.scale(), 1.0);
}

// ... and those that are shorter may have been seen against what goes along.
TEST(OdometryCalibrationTest, MotionsThatAreShorterByFarAreNone) {
  OdometryCalibration scale;
  DriveStraight(50, 0.5, 0.0, kClear, &scale);
  EXPECT_EQ(scale.scale(), 1.0);
}

TEST(OdometryCalibrationTest, AnotherFloorIsFollowed) {
  OdometryCalibration scale;
  DriveStraight(1000, 0.97, 0.0, kClear, &scale);
  DriveStraight(1000, 1.02, 0.0, kClear, &scale);
  EXPECT_NEAR(scale.scale(), 1.02, 0.005);
}

TEST(OdometryCalibrationTest, SpeedingUpCountsLess) {
  // Odometry that is a scan late has the motion too short when the robot speeds
  // up, and too long when it slows down by as much later.
  const auto after = [](double step) {
    OdometryCalibration scale;
    scale.Compare(Pose2(0.3, 0.0, 0.0), kWheels, Pose2(0.3, 0.0, 0.0), kClear,
                  kStep);
    scale.Compare(Pose2(0.3, 0.0, 0.0), kWheels, Pose2(0.33, 0.0, 0.0), kClear,
                  step);
    return scale.scale() - 1.0;
  };
  const double even = after(kStep);
  EXPECT_GT(even, 0.0);
  EXPECT_LT(after(kStep + 0.05), 0.2 * even);
  EXPECT_LT(after(kStep - 0.05), 0.2 * even);
}

TEST(OdometryCalibrationTest, ReturnsThatSayLessCountLess) {
  const auto after = [](double information) {
    OdometryCalibration scale;
    const Eigen::Matrix3d returns =
        Eigen::Vector3d(information, 1e4, 1e5).asDiagonal();
    DriveStraight(2, 1.1, 0.0, returns, &scale);
    return scale.scale() - 1.0;
  };
  EXPECT_GT(after(1e3), 0.0);
  EXPECT_LT(after(1e3), 0.6 * after(1e5));
}

TEST(OdometryCalibrationTest, NoScaleFromTurns) {
  OdometryCalibration scale;
  for (int i = 0; i < 50; ++i) {
    scale.Compare(Pose2(0.3, 0.0, 0.12), kWheels, Pose2(0.27, 0.0, 0.12),
                  kClear, kStep);
  }
  EXPECT_EQ(scale.scale(), 1.0);
}

// `count` motions of 0.3 m in direction `angle` by odometry that turns `turn`
// more than the robot, which drives `course` to the left of it.
void DriveAskew(int count, double course, double angle, double turn,
                const Eigen::Matrix3d& information,
                OdometryCalibration* calibration) {
  // A chord turns by half of what its end does.
  const double by_wheels = angle + 0.5 * turn;
  const Pose2 motion(0.3 * std::cos(by_wheels), 0.3 * std::sin(by_wheels),
                     0.01 + turn);
  const Pose2 matched(0.3 * std::cos(angle + course),
                      0.3 * std::sin(angle + course), 0.01);
  for (int i = 0; i < count; ++i) {
    calibration->Compare(motion, kWheels, matched, information, kStep);
  }
}

TEST(OdometryCalibrationTest, CourseIsLearntInAnyDirection) {
  for (const double angle : {0.0, 0.7, kPi, -2.0}) {
    for (const double turn : {0.0, 0.03, -0.03}) {
      OdometryCalibration calibration;
      EXPECT_EQ(calibration.course(), 0.0);
      DriveAskew(200, 0.02, angle, turn, kClear, &calibration);
      EXPECT_NEAR(calibration.course(), 0.02, 0.001) << angle << " " << turn;
      EXPECT_NEAR(calibration.scale(), 1.0, 0.001);
      const Pose2 corrected = calibration.Corrected(Pose2(1.0, 0.0, 0.5));
      EXPECT_NEAR(std::atan2(corrected[1], corrected[0]), 0.02, 0.001);
      EXPECT_EQ(corrected[2], 0.5);
    }
  }
}

TEST(OdometryCalibrationTest, ACorridorTellsTheCourse) {
  for (const double angle : {0.0, 0.7}) {
    const Eigen::Vector3d across(-std::sin(angle), std::cos(angle), 0.0);
    Eigen::Matrix3d information = 1e4 * across * across.transpose();
    information(2, 2) = 1e5;
    OdometryCalibration calibration;
    DriveAskew(200, -0.02, angle, 0.0, information, &calibration);
    EXPECT_NEAR(calibration.course(), -0.02, 0.001);
    EXPECT_EQ(calibration.scale(), 1.0);
  }
}

TEST(OdometryCalibrationTest, NoCourseWhereNothingSaysWhatIsAcross) {
  OdometryCalibration calibration;
  DriveAskew(200, 0.02, 0.0, 0.0, Eigen::Matrix3d::Zero(), &calibration);
  EXPECT_EQ(calibration.course(), 0.0);
  // Slips to the side, turns on the spot, and ways back do not count.
  DriveAskew(200, 0.5, 0.0, 0.0, kClear, &calibration);
  EXPECT_EQ(calibration.course(), 0.0);
  calibration.Compare(Pose2(0.02, 0.0, 0.4), kWheels, Pose2(0.02, 0.01, 0.4),
                      kClear, kStep);
  calibration.Compare(Pose2(0.3, 0.0, 0.0), kWheels, Pose2(-0.3, 0.01, 0.0),
                      kClear, kStep);
  EXPECT_EQ(calibration.course(), 0.0);
}

}  // namespace
}  // namespace plumbline
