#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/carmen_reader.h>

#include <cstdlib>
#include <fstream>
#include <string>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kRounding = 1e-12;

Log ReadCarmen(const std::string& text, const LaserOptions& options = {}) {
  InputStream input("test.log", text);
  return ReadCarmenLog(&input, options);
}

// The message of the Error that reading throws.
std::string WhyRefused(const std::string& text,
                       const LaserOptions& options = {}) {
  try {
    ReadCarmen(text, options);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

std::string Repeat(const std::string& token, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += token + " ";
  return text;
}

std::string Flaser(int beams, const std::string& range,
                   const std::string& poses, const std::string& timestamp) {
  return "FLASER " + std::to_string(beams) + " " + Repeat(range, beams) +
         poses + " " + timestamp + " host 0.5\n";
}

std::int64_t Skipped(const Log& log, const std::string& part) {
  std::int64_t count = 0;
  for (const SkipReport& report : log.skipped) {
    if (report.reason.find(part) != std::string::npos) count += report.count;
  }
  return count;
}

TEST(CarmenReaderTest, Flaser) {
  // The robot stands at (1, 2) and looks along y, the laser 4 cm behind it.
  const Log log = ReadCarmen(
      "# comment\n"
      "FLASER 3 1.5 0.25 2 1 1.96 1.5707963267948966 1 2 1.5707963267948966 "
      "976052857.337530 nohost 0.000246\n");
  ASSERT_EQ(log.scans.size(), 1u);
  const Scan& scan = log.scans[0];
  EXPECT_EQ(scan.timestamp, 976052857.337530);
  EXPECT_EQ(scan.timestamp_text, "976052857.337530");
  EXPECT_THAT(scan.ranges, ElementsAre(1.5f, 0.25f, 2.0f));
  EXPECT_EQ(scan.line, 2);
  EXPECT_NEAR(scan.odometry[0], 1.0, kRounding);
  EXPECT_NEAR(scan.odometry[1], 2.0, kRounding);
  EXPECT_NEAR(scan.odometry[2], kPi / 2, kRounding);
  EXPECT_NEAR(scan.laser_offset[0], -0.04, kRounding);
  EXPECT_NEAR(scan.laser_offset[1], 0.0, kRounding);
  EXPECT_NEAR(scan.laser_offset[2], 0.0, kRounding);
  EXPECT_EQ(scan.maximum_range, 80.0);
  EXPECT_EQ(log.scan_message, "FLASER");
  EXPECT_EQ(log.messages.at("FLASER"), 1);
  EXPECT_THAT(log.skipped, IsEmpty());
  EXPECT_FALSE(log.has_odometry);
}

TEST(CarmenReaderTest, AnglesOfTheOldFormat) {
  struct Case {
    int beams;
    double start_degrees;
    double step_degrees;
  };
  for (const Case& c : {Case{180, -90, 1}, Case{181, -90, 1},
                        Case{360, -90, 0.5}, Case{361, -90, 0.5},
                        Case{90, -90, 2}, Case{91, -90, 2}, Case{1, 0, 0}}) {
    const Log log = ReadCarmen(Flaser(c.beams, "1", "0 0 0 0 0 0", "1"));
    EXPECT_NEAR(RadToDeg(log.scans[0].start_angle), c.start_degrees, 1e-9)
        << c.beams;
    EXPECT_NEAR(RadToDeg(log.scans[0].angle_step), c.step_degrees, 1e-9)
        << c.beams;
  }
}

TEST(CarmenReaderTest, ResolutionParameterSpacesUnusualBeams) {
  const std::string parameter =
      "PARAM laser_front_laser_resolution 0.25 1 h 1\n";
  const Log unusual =
      ReadCarmen(parameter + Flaser(401, "1", "0 0 0 0 0 0", "1"));
  EXPECT_NEAR(RadToDeg(unusual.scans[0].start_angle), -50.0, 1e-9);
  EXPECT_NEAR(RadToDeg(unusual.scans[0].angle_step), 0.25, 1e-9);
  // The table goes before.
  const Log usual =
      ReadCarmen(parameter + Flaser(181, "1", "0 0 0 0 0 0", "1"));
  EXPECT_NEAR(RadToDeg(usual.scans[0].angle_step), 1.0, 1e-9);
}

TEST(CarmenReaderTest, OptionsOverride) {
  LaserOptions options;
  options.laser_start_angle = -1.0;
  options.laser_step = 0.5;
  options.laser_max_range = 10.0;
  const Log log =
      ReadCarmen("FLASER 4 1 9.9 10 81 0 0 0 0 0 0 1 h 1\n", options);
  EXPECT_EQ(log.scans[0].start_angle, -1.0);
  EXPECT_EQ(log.scans[0].angle_step, 0.5);
  EXPECT_EQ(log.scans[0].maximum_range, 10.0);
  EXPECT_THAT(log.scans[0].ranges, ElementsAre(1.0f, 9.9f, 0.0f, 0.0f));

  options.laser_max_range = -1.0;
  EXPECT_THAT(WhyRefused("", options), HasSubstr("laser_max_range"));
  options.laser_max_range = 10.0;
  options.laser_step = 0.0;
  EXPECT_THAT(WhyRefused("", options), HasSubstr("laser_step"));
}

TEST(CarmenReaderTest, RobotLaser) {
  // Remissions of 2, robot at (1, 1, 0), laser 0.3 m ahead.
  const Log log = ReadCarmen(
      "ROBOTLASER1 0 -1.0 2.0 1.0 8.0 0.01 0 3 1 2 8 2 77 78 "
      "1.3 1 0 1 1 0 0.1 0.2 0.3 0.4 0.5 12.25 host 3\n");
  ASSERT_EQ(log.scans.size(), 1u);
  const Scan& scan = log.scans[0];
  EXPECT_EQ(scan.start_angle, -1.0);
  EXPECT_EQ(scan.angle_step, 1.0);
  EXPECT_EQ(scan.maximum_range, 8.0);
  EXPECT_THAT(scan.ranges, ElementsAre(1.0f, 2.0f, 0.0f));
  EXPECT_EQ(scan.odometry, Pose2(1, 1, 0));
  EXPECT_NEAR(scan.laser_offset[0], 0.3, kRounding);
  EXPECT_EQ(scan.timestamp, 12.25);
}

TEST(CarmenReaderTest, RobotLaserWithoutRemissionsAndResolution) {
  const Log log = ReadCarmen(
      "ROBOTLASER1 0 -1.0 2.0 0 8.0 0.01 0 3 1 2 3 "
      "1 1 0 1 1 0 0.1 0.2 0.3 0.4 0.5 12.25 host 3\n");
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(log.scans[0].angle_step, 1.0);
  EXPECT_EQ(log.scans[0].timestamp_text, "12.25");
}

// Beams that all look the same way are no scan: the line alone is lost, not the
// log, and with a step that is given not even the line.
TEST(CarmenReaderTest, ScansWithoutAnAngleBetweenBeamsAreCounted) {
  const std::string end =
      "3 1 2 3 1 1 0 1 1 0 0.1 0.2 0.3 0.4 0.5 12.25 host 3\n";
  const std::string good = "ROBOTLASER1 0 -1 2 1 8 0.01 0 " + end;
  const std::string zero = "ROBOTLASER1 0 -1 0 0 8 0.01 0 " + end;
  const std::string tiny = "ROBOTLASER1 0 -1 1e-999 0 8 0.01 0 " + end;
  const std::string none = "ROBOTLASER1 0 -1 nan nan 8 0.01 0 " + end;
  const std::string raw = "RAWLASER1 0 -1 0 0 8 0.01 0 3 1 2 3 0 9.5 h 0\n";
  const std::string single =
      "ROBOTLASER1 0 -1 0 0 8 0.01 0 1 1 1 1 0 1 1 0 0 0 0 0 0 13 host 3\n";
  const Log log = ReadCarmen(good + zero + tiny + none + raw + single);
  ASSERT_EQ(log.scans.size(), 2u);
  EXPECT_EQ(log.scans[0].angle_step, 1.0);
  EXPECT_EQ(log.scans[1].ranges.size(), 1u);
  EXPECT_EQ(Skipped(log, "ROBOTLASER1 whose readings have no angle"), 2);
  EXPECT_EQ(Skipped(log, "RAWLASER1 whose readings have no angle"), 1);
  EXPECT_EQ(Skipped(log, "absurd angles"), 1);
  EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(2, 3));
  EXPECT_THAT(WhyRefused(zero), HasSubstr("no angle between them"));

  LaserOptions options;
  options.laser_step = 0.5;
  const Log given = ReadCarmen(zero, options);
  ASSERT_EQ(given.scans.size(), 1u);
  EXPECT_EQ(given.scans[0].angle_step, 0.5);
}

TEST(CarmenReaderTest, RawLaserIsPlacedByOdometry) {
  const std::string raw = "RAWLASER1 0 -1 2 1 8 0.01 0 3 1 2 3 0 ";
  const Log log = ReadCarmen(
      "PARAM robot_frontlaser_offset 0.2 nohost 0\n" + raw + "9.5 h 0\n" +
      "ODOM 1 0 3.1 0 0 0 10.0 h 0\n" + raw + "10.25 h 0\n" +
      "ODOM 2 4 -3.1 0 0 0 11.0 h 0\n" + raw + "11.5 h 0\n");
  ASSERT_EQ(log.scans.size(), 3u);
  // Before any odometry: the first there is.
  EXPECT_EQ(log.scans[0].odometry, Pose2(1, 0, 3.1));
  // A quarter of the way, the short way round past pi.
  EXPECT_NEAR(log.scans[1].odometry[0], 1.25, kRounding);
  EXPECT_NEAR(log.scans[1].odometry[1], 1.0, kRounding);
  EXPECT_NEAR(log.scans[1].odometry[2], 3.1 + 0.25 * (2 * kPi - 6.2),
              kRounding);
  // After the last.
  EXPECT_EQ(log.scans[2].odometry, Pose2(2, 4, -3.1));
  EXPECT_NEAR(log.scans[2].laser_offset[0], 0.2, kRounding);
  EXPECT_TRUE(log.has_odometry);
}

TEST(CarmenReaderTest, RawLaserWithoutOdometry) {
  const std::string raw = "RAWLASER1 0 -1 2 1 8 0.01 0 3 1 2 3 0 ";
  const Log log = ReadCarmen(raw + "1 h 0\n" + raw + "2 h 0\n");
  EXPECT_EQ(log.scans.size(), 2u);
  EXPECT_FALSE(log.has_odometry);
  EXPECT_EQ(log.scans[1].odometry, Pose2(0, 0, 0));
}

TEST(CarmenReaderTest, RawLaserOutOfTimeTakesTheLastOdometry) {
  const std::string raw = "RAWLASER1 0 -1 2 1 8 0.01 0 3 1 2 3 0 ";
  const Log log = ReadCarmen("ODOM 1 0 0 0 0 0 10.0 h 0\n" + raw + "9.0 h 0\n" +
                             "ODOM 2 0 0 0 0 0 10.0 h 0\n");
  EXPECT_EQ(log.scans[0].odometry, Pose2(1, 0, 0));
}

// Odometry comes with every fourth scan: what is between lies on the way.
TEST(CarmenReaderTest, SlowOdometryIsInterpolated) {
  std::string text;
  for (int i = 0; i < 120; ++i) {
    const std::string x = std::to_string(0.1 * (i - i % 4));
    text += Flaser(3, "1.5", x + " 0 0 " + x + " 0 0", std::to_string(0.1 * i));
  }
  const Log log = ReadCarmen(text);
  ASSERT_EQ(log.scans.size(), 120u);
  for (int i = 0; i < 116; ++i) {
    EXPECT_NEAR(log.scans[i].odometry[0], 0.1 * i, 1e-6);
    EXPECT_NEAR(log.scans[i].laser_offset[0], 0.0, kRounding);
  }
  EXPECT_EQ(log.notes.size(), 1u);
}

TEST(CarmenReaderTest, OneLaserGivesTheScans) {
  const std::string front = Flaser(2, "1", "0 0 0 0 0 0", "1");
  const std::string rear = "RLASER 2 3 3 0 0 3.14159 0 0 0 1 h 1\n";
  const Log both = ReadCarmen(rear + front + rear);
  ASSERT_EQ(both.scans.size(), 1u);
  EXPECT_EQ(both.scans[0].ranges[0], 1.0f);
  EXPECT_EQ(both.messages.at("RLASER"), 2);
  ASSERT_EQ(both.skipped.size(), 1u);
  EXPECT_THAT(both.skipped[0].reason, HasSubstr("RLASER passed over"));
  EXPECT_EQ(both.skipped[0].count, 2);
  EXPECT_THAT(both.skipped[0].first_lines, ElementsAre(1, 3));

  const Log alone = ReadCarmen(rear);
  ASSERT_EQ(alone.scans.size(), 1u);
  EXPECT_EQ(alone.scan_message, "RLASER");
  EXPECT_NEAR(alone.scans[0].laser_offset[2], 3.14159, kRounding);
}

TEST(CarmenReaderTest, KeepsTheOrderOfLinesAndCountsReversals) {
  const Log log = ReadCarmen(Flaser(2, "1", "0 0 0 0 0 0", "10.0") +
                             Flaser(2, "2", "1 0 0 1 0 0", "9.5") +
                             Flaser(2, "3", "2 0 0 2 0 0", "9.75") +
                             Flaser(2, "4", "3 0 0 3 0 0", "9.5"));
  ASSERT_EQ(log.scans.size(), 4u);
  EXPECT_EQ(log.scans[1].ranges[0], 2.0f);
  EXPECT_EQ(log.scans[3].ranges[0], 4.0f);
  EXPECT_EQ(log.time_reversals, 2);
  EXPECT_EQ(log.largest_time_reversal, 0.5);
  EXPECT_TRUE(log.has_odometry);
}

TEST(CarmenReaderTest, ConstantOdometryIsNone) {
  const Log log = ReadCarmen(Flaser(2, "1", "1 2 3 1 2 3", "1") +
                             Flaser(2, "1", "1 2 3 1 2 3", "2"));
  EXPECT_FALSE(log.has_odometry);
}

TEST(CarmenReaderTest, CorrectedPosesAreNotOdometry) {
  std::string text;
  for (int i = 0; i < 10; ++i) {
    text += Flaser(2, "1",
                   std::to_string(i * 2) + " 0 0 " + std::to_string(i) + " 0 0",
                   std::to_string(i));
  }
  const Log log = ReadCarmen(text);
  EXPECT_EQ(log.scans[9].odometry, Pose2(9, 0, 0));
  EXPECT_EQ(log.scans[9].laser_offset, Pose2(0, 0, 0));
  EXPECT_EQ(Skipped(log, "corrected log"), 10);
  EXPECT_FALSE(log.skipped[0].first_lines.empty());

  // The corrected pose is not used where odometry is missing either.
  const Log none = ReadCarmen(Flaser(2, "1", "1 0 0 0 0 0", "1") +
                              Flaser(2, "1", "5 0 0 0 0 0", "2"));
  EXPECT_FALSE(none.has_odometry);
}

// All of them say the same, so that none is apart: the lines are told all the
// same.
TEST(CarmenReaderTest, LaserPosesFarFromTheRobotAreNotUsed) {
  std::string text;
  for (int i = 0; i < 8; ++i) {
    text += Flaser(2, "1", "-1000 0 0 0 0 0", std::to_string(i));
  }
  const Log log = ReadCarmen(text);
  ASSERT_EQ(log.scans.size(), 8u);
  EXPECT_EQ(log.scans[7].laser_offset, Pose2(0, 0, 0));
  ASSERT_EQ(log.skipped.size(), 1u);
  EXPECT_THAT(log.skipped[0].reason, HasSubstr("5 m or more from the robot"));
  EXPECT_EQ(log.skipped[0].count, 8);
  EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(1, 2, 3, 4, 5));
}

TEST(CarmenReaderTest, MaximumRangeFromParameter) {
  const Log log = ReadCarmen(
      "PARAM robot_front_laser_max 20.0 1 h 1\n"
      "FLASER 4 1 19.9 19.96 81 0 0 0 0 0 0 1 h 1\n");
  EXPECT_EQ(log.scans[0].maximum_range, 20.0);
  EXPECT_THAT(log.scans[0].ranges, ElementsAre(1.0f, 19.9f, 0.0f, 0.0f));
}

// A corridor log: `far` readings of 180 are the top value, the others spread
// over 1 m to 6 m.
std::string CorridorLog(const std::string& far_value, int far) {
  std::string text;
  for (int i = 0; i < 10; ++i) {
    text += "FLASER 180 ";
    for (int k = 0; k < 180; ++k) {
      const int beam = (k + 17 * i) % 180;
      text += beam < far ? far_value + " "
                         : std::to_string(1.0 + beam / 36.0) + " ";
    }
    text += "0 0 0 0 0 0 " + std::to_string(i) + " h 0\n";
  }
  return text;
}

TEST(CarmenReaderTest, MaximumRangeFromWhereReadingsPileUp) {
  const Log piled = ReadCarmen(CorridorLog("51.06", 9));
  EXPECT_NEAR(piled.scans[0].maximum_range, 51.055, 1e-9);
  int zeros = 0;
  for (const float range : piled.scans[0].ranges) zeros += range == 0.0f;
  EXPECT_EQ(zeros, 9);
}

TEST(CarmenReaderTest, AFarWallIsNoMaximumRange) {
  // The robot stands and sees a narrow wall 25 m away in the same beams.
  std::string text;
  for (int i = 0; i < 20; ++i) {
    text += "FLASER 180 " + Repeat("25.00", 8);
    for (int k = 8; k < 180; ++k) text += std::to_string(1 + k / 36.0) + " ";
    text += "0 0 0 0 0 0 " + std::to_string(i) + " h 0\n";
  }
  const Log log = ReadCarmen(text);
  EXPECT_EQ(log.scans[0].maximum_range, 80.0);
  EXPECT_EQ(log.scans[0].ranges[0], 25.0f);
}

TEST(CarmenReaderTest, EqualReadingsAreNoMaximumRange) {
  const Log log = ReadCarmen(Flaser(180, "10", "0 0 0 0 0 0", "1"));
  EXPECT_EQ(log.scans[0].ranges[0], 10.0f);
}

TEST(CarmenReaderTest, ReadingsThatAreNoDistances) {
  const Log log =
      ReadCarmen("FLASER 7 nan -1 inf 1e9 0 2 1e-400 0 0 0 0 0 0 1 h 1\n");
  EXPECT_THAT(log.scans[0].ranges, ElementsAre(0, 0, 0, 0, 0, 2.0f, 0));
  EXPECT_EQ(Skipped(log, "no distance"), 4);
  EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(1));
}

TEST(CarmenReaderTest, GarbledLinesAreCountedWithTheirLines) {
  const std::string good = Flaser(2, "1", "0 0 0 0 0 0", "1");
  const Log log =
      ReadCarmen(good +
                 "FLASER 2 1 1 0 0 0 0 0 0 976\n"             // cut
                 "FLASER 5 1 1 0 0 0 0 0 0 1 h 1\n"           // n too large
                 "FLASER 1 1 1 0 0 0 0 0 0 1 h 1\n"           // n too small
                 "FLASER 2 1 1x 0 0 0 0 0 0 1 h 1\n"          // no number
                 "FLASER two 1 1 0 0 0 0 0 0 1 h 1\n"         // no count
                 "FLASER -3 1 1 0 0 0 0 0 0 1 h 1\n"          // negative
                 "FLASER 2147483647 1 1 0 0 0 0 0 0 1 h 1\n"  // huge
                 "FLASER\n"                                   //
                 "FLASER 0 0 0 0 0 0 0 1 h 1\n"               // no beams
                 "FLASER 2 1 1 0 0 0 nan 0 0 1 h 1\n"         // pose
                 "FLASER 2 1 1 0 0 0 1e30 0 0 1 h 1\n" +      // pose
                 good);
  EXPECT_EQ(log.scans.size(), 2u);
  EXPECT_EQ(log.scans[1].line, 13);
  EXPECT_EQ(Skipped(log, "garbled or truncated FLASER"), 8);
  EXPECT_EQ(Skipped(log, "FLASER without readings"), 1);
  EXPECT_EQ(Skipped(log, "not finite or absurd"), 2);
  EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(2, 3, 4, 5));
}

TEST(CarmenReaderTest, OtherGarbledMessages) {
  const Log log =
      ReadCarmen(Flaser(2, "1", "0 0 0 0 0 0", "1") +
                 "ODOM 1 2\n"
                 "ODOM nan 2 3 0 0 0 1 h 1\n"
                 "PARAM\n"
                 "PARAM lonely\n"
                 "ROBOTLASER1 0 -1.0 2.0\n"
                 "ROBOTLASER1 0 -1 2 1 8 0.01 0 3 1 2 3 7 1 2\n"
                 "ROBOTLASER1 0 -1 2 1 8 0.01 0 3 1 2 3 2147483647 1 2\n"
                 "ROBOTLASER1 0 nan 2.0 0 8.0 0.01 0 3 1 2 3 "
                 "1 1 0 1 1 0 0.1 0.2 0.3 0.4 0.5 12.25 host 3\n"
                 "FANCY 1 2 3\n"
                 "garbage\n"
                 "\n"
                 "SYNC tag 1 h 1\n"
                 "TRUEPOS 0 0 0 0 0 0 1 h 1\n");
  EXPECT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(Skipped(log, "ODOM"), 2);
  EXPECT_EQ(Skipped(log, "PARAM"), 2);
  EXPECT_EQ(Skipped(log, "garbled or truncated ROBOTLASER1"), 3);
  EXPECT_EQ(Skipped(log, "absurd angles"), 1);
  EXPECT_EQ(Skipped(log, "not used: FANCY"), 1);
  EXPECT_EQ(Skipped(log, "no message name"), 1);
  EXPECT_EQ(log.messages.at("SYNC"), 1);
  EXPECT_EQ(log.messages.at("TRUEPOS"), 1);
}

TEST(CarmenReaderTest, Parameters) {
  const Log log = ReadCarmen(Flaser(2, "1", "0 0 0 0 0 0", "1") +
                             "PARAM a 1 nohost 0\n"
                             "PARAM b two words 1 host 2\n"
                             "PARAM c only\n"
                             "PARAM d old 1 h 1\n"
                             "PARAM d new 2 h 2\n");
  EXPECT_EQ(log.parameters.at("a"), "1");
  EXPECT_EQ(log.parameters.at("b"), "two words");
  EXPECT_EQ(log.parameters.at("c"), "only");
  EXPECT_EQ(log.parameters.at("d"), "new");
}

TEST(CarmenReaderTest, NumberOfBeamsMayChange) {
  const Log log = ReadCarmen(Flaser(180, "1", "0 0 0 0 0 0", "1") +
                             Flaser(360, "1", "0 0 0 0 0 0", "2") +
                             Flaser(360, "1", "0 0 0 0 0 0", "3") +
                             Flaser(180, "1", "0 0 0 0 0 0", "4"));
  EXPECT_EQ(log.scans.size(), 4u);
  EXPECT_EQ(log.beam_count_changes, 2);
  EXPECT_NEAR(RadToDeg(log.scans[1].angle_step), 0.5, 1e-9);
  EXPECT_NEAR(RadToDeg(log.scans[3].angle_step), 1.0, 1e-9);
}

TEST(CarmenReaderTest, CarriageReturns) {
  const Log log = ReadCarmen(
      "ODOM 0 0 0 0 0 0 1 h 1\r\n"
      "FLASER 2 1 1 0 0 0 0 0 0 1.5 h 1\r\n");
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(log.scans[0].timestamp_text, "1.5");
  EXPECT_THAT(log.skipped, IsEmpty());
}

TEST(CarmenReaderTest, NothingToReadIsRefused) {
  EXPECT_THAT(WhyRefused(""), HasSubstr("test.log: is empty: expected a "
                                        "robot's log (CARMEN, CSV, "));
  EXPECT_THAT(WhyRefused("\n\n"), Not(HasSubstr("FLASER")));
  EXPECT_THAT(WhyRefused("ODOM 0 0 0 0 0 0 1 h 1\n"),
              HasSubstr("1 lines, 1 ODOM: expected a CARMEN log"));
  EXPECT_THAT(WhyRefused("hello\n"),
              HasSubstr("1 x line that starts with no message name (first in "
                        "line 1)"));
  EXPECT_THAT(WhyRefused(std::string("\0\1\2\n\0", 5)),
              HasSubstr("2 x line with zero bytes"));
  EXPECT_THAT(WhyRefused("VERTEX_SE2 0 0 0 0\n"), HasSubstr("is a g2o graph"));
  EXPECT_THAT(WhyRefused("\x1f\x8b\x08"),
              HasSubstr("nothing of it can be unpacked: gzip data breaks off"));
}

TEST(CarmenReaderTest, ManyUnknownNamesMakeFewReports) {
  std::string text = Flaser(2, "1", "0 0 0 0 0 0", "1");
  for (int i = 0; i < 1000; ++i) text += "X" + std::to_string(i) + " 1\n";
  const Log log = ReadCarmen(text);
  EXPECT_EQ(log.skipped.size(), 21u);
  EXPECT_EQ(Skipped(log, "not used"), 1000);
}

TEST(CarmenReaderTest, ScansThatAreTooDenseAreThinned) {
  std::string dense = "FLASER 25000 ";
  for (int i = 0; i < 25000; ++i) dense += std::to_string(1 + i % 3) + " ";
  const Log log = ReadCarmen(Flaser(10000, "2", "0 0 0 0 0 0", "1") + dense +
                             "0 0 0 0 0 0 2 host 0.5\n");
  ASSERT_EQ(log.scans.size(), 2u);
  EXPECT_EQ(log.scans[0].ranges.size(), 10000u);
  EXPECT_NEAR(log.scans[0].angle_step, kPi / 10000, kRounding);
  const Scan& scan = log.scans[1];
  ASSERT_EQ(scan.ranges.size(), 8334u);
  EXPECT_NEAR(scan.start_angle, -kPi / 2, kRounding);
  EXPECT_NEAR(scan.angle_step, 3 * kPi / 25000, kRounding);
  for (const float range : scan.ranges) ASSERT_EQ(range, 1.0f);
  EXPECT_EQ(Skipped(log, "more than 10000"), 1);
  EXPECT_THAT(log.skipped.back().first_lines, ElementsAre(2));
}

TEST(CarmenReaderTest, RecognizesFormats) {
  EXPECT_TRUE(LooksLikeCarmenLog("# CARMEN Logfile\nPARAM a b\n"));
  EXPECT_TRUE(LooksLikeCarmenLog("FLASER 180 1.0 2.0"));
  EXPECT_TRUE(LooksLikeCarmenLog("garbage\nROBOTLASER1 0\n"));
  EXPECT_FALSE(LooksLikeCarmenLog(""));
  EXPECT_FALSE(LooksLikeCarmenLog("# FLASER\n"));
  EXPECT_FALSE(LooksLikeCarmenLog("FLASERX 1\n"));
  // g2o files may carry scans after the vertices.
  EXPECT_FALSE(LooksLikeCarmenLog("VERTEX_SE2 0 0 0 0\nROBOTLASER1 0\n"));
  EXPECT_TRUE(LooksLikeG2o("VERTEX_SE2 0 0 0 0\nROBOTLASER1 0\n"));
  EXPECT_TRUE(LooksLikeG2o("# comment\n\nEDGE_SE2 0 1 1 0 0"));
  EXPECT_TRUE(LooksLikeG2o("FIX 0\n"));
  EXPECT_TRUE(LooksLikeG2o("PLUMBLINE_VERTEX_CIRCLE 0 1 2 3\n"));
  EXPECT_FALSE(LooksLikeG2o("FLASER 180\nVERTEX_SE2\n"));
}

// The public logs, where they are.
Log ReadDataset(const std::string& name) {
  return ReadCarmenLog(
      std::string(std::getenv("PLUMBLINE_DATASETS")) + "/" + name, {});
}

bool HasDataset(const std::string& name) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  return folder != nullptr && std::ifstream(std::string(folder) + "/" + name);
}

TEST(CarmenReaderTest, IntelLog) {
  if (!HasDataset("intel.clf.bz2"))
    GTEST_SKIP() << "PLUMBLINE_DATASETS names no folder with intel.clf.bz2";
  const Log log = ReadDataset("intel.clf.bz2");
  EXPECT_EQ(log.scans.size(), 13631u);
  EXPECT_EQ(log.messages.at("ODOM"), 26915);
  EXPECT_EQ(log.time_reversals, 631);
  EXPECT_NEAR(log.largest_time_reversal, 0.897, 0.001);
  EXPECT_EQ(log.scans[0].timestamp_text, "976052857.337530");
  EXPECT_TRUE(log.has_odometry);
  EXPECT_THAT(log.skipped, IsEmpty());
}

TEST(CarmenReaderTest, KillianLog) {
  if (!HasDataset("mit-killian.clf.bz2"))
    GTEST_SKIP() << "PLUMBLINE_DATASETS names no folder with mit-killian";
  const Log log = ReadDataset("mit-killian.clf.bz2");
  EXPECT_EQ(log.scans.size(), 17480u);
  // Readings of 51.05 m to 51.2 m stand for no return.
  EXPECT_NEAR(log.scans[0].maximum_range, 51.05, 0.02);
  EXPECT_THAT(log.skipped, IsEmpty());
}

TEST(CarmenReaderTest, Fr079Log) {
  if (!HasDataset("fr079.clf.bz2"))
    GTEST_SKIP() << "PLUMBLINE_DATASETS names no folder with fr079.clf.bz2";
  const Log log = ReadDataset("fr079.clf.bz2");
  EXPECT_EQ(log.scans.size(), 4934u);
  EXPECT_NEAR(log.scans[0].laser_offset[0], -0.04, 1e-6);
  EXPECT_NEAR(log.scans[0].laser_offset[1], 0.0, 1e-6);
  EXPECT_EQ(log.scans[0].maximum_range, 80.99);
  EXPECT_NEAR(RadToDeg(log.scans[0].angle_step), 0.5, 1e-9);
  EXPECT_THAT(log.skipped, IsEmpty());
}

}  // namespace
}  // namespace plumbline
