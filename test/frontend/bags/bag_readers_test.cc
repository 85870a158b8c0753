#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/bags/bag_log.h>
#include <plumbline/frontend/bags/bag_messages.h>
#include <plumbline/frontend/bags/mcap.h>
#include <plumbline/frontend/bags/rosbag1.h>
#include <plumbline/frontend/bags/rosbag2.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/log_reader.h>
#include <sys/resource.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "frontend/bags/bag_records.h"

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// Near walls are beyond it, and a float does not have it.
LaserModel Laser() {
  LaserModel laser;
  laser.offset = 0.2;
  laser.maximum_range = 8.1;
  return laser;
}

const Simulation& Drive() {
  static const Simulation* const simulation = [] {
    SimulatorOptions options;
    options.laser = Laser();
    options.progress = [](double share) { return share < 0.03; };
    return new Simulation(Simulate(MakeWorld("office", 3, 0.5), options, 3));
  }();
  return *simulation;
}

// Every format says the same of the same drive, to the last digits that floats
// and quaternions leave.
class FormatsTest : public ::testing::Test {
 protected:
  FormatsTest() {
    std::ostringstream text;
    WriteCarmenLog(Drive(), Laser(), {}, text);
    InputStream input("carmen", text.str());
    carmen_ = ReadCarmenLog(&input, {});
  }

  void ExpectSame(const Log& log) const {
    EXPECT_EQ(log.scan_message, "/scan");
    EXPECT_EQ(log.odometry_source, "/odom");
    ExpectSameScans(log);
  }

  void ExpectSameScans(const Log& log) const {
    EXPECT_THAT(log.skipped, IsEmpty());
    EXPECT_TRUE(log.has_odometry);
    ASSERT_EQ(log.scans.size(), carmen_.scans.size());
    ASSERT_GT(log.scans.size(), 20u);
    for (std::size_t i = 0; i < log.scans.size(); ++i) {
      const Scan& scan = log.scans[i];
      const Scan& same = carmen_.scans[i];
      ASSERT_EQ(scan.ranges, same.ranges) << i;
      ASSERT_EQ(scan.timestamp, same.timestamp);
      ASSERT_EQ(scan.odometry, same.odometry);
      ASSERT_EQ(scan.laser_offset, same.laser_offset);
      ASSERT_NEAR(scan.start_angle, same.start_angle, 1e-12);
      ASSERT_NEAR(scan.angle_step, same.angle_step, 1e-12);
      ASSERT_EQ(scan.maximum_range, same.maximum_range);
    }
  }

  Log carmen_;
};

TEST_F(FormatsTest, Ros1) {
  const std::vector<BagRecord> messages =
      SimulatedMessages(Drive(), Laser(), kRos1);
  for (const char* compression : {"none", "bz2", "lz4"}) {
    for (const bool index : {true, false}) {
      SCOPED_TRACE(std::string(compression) + (index ? "" : ", no index"));
      BagWriterOptions options;
      options.compression = compression;
      options.index = index;
      options.chunk_size = 10000;
      ExpectSame(ReadBytes(MakeRosbag1(messages, options)));
    }
  }
}

TEST_F(FormatsTest, Mcap) {
  const std::vector<BagRecord> messages =
      SimulatedMessages(Drive(), Laser(), kCdr);
  for (const char* compression : {"none", "lz4", "zstd"}) {
    for (const bool index : {true, false}) {
      SCOPED_TRACE(std::string(compression) + (index ? "" : ", no index"));
      BagWriterOptions options;
      options.compression = compression;
      options.index = index;
      options.chunk_size = 10000;
      ExpectSame(ReadBytes(MakeMcap(messages, options)));
    }
  }
  BagWriterOptions options;
  options.chunks = false;
  ExpectSame(ReadBytes(MakeMcap(messages, options)));
}

TEST_F(FormatsTest, Ros2Folder) {
  const Folder folder;
  WriteRosbag2(SimulatedMessages(Drive(), Laser(), kCdr), folder / "bag");
  ExpectSame(ReadPath(folder / "bag"));
  // The database by itself, and as a folder without its description.
  ExpectSame(ReadPath(folder / "bag/bag_0.db3"));
  fs::remove(folder / "bag/metadata.yaml");
  const Log log = ReadPath(folder / "bag");
  EXPECT_EQ(SkippedInBag(log, "metadata.yaml"), 1);
  EXPECT_EQ(log.scans.size(), carmen_.scans.size());
}

TEST_F(FormatsTest, Ros2FolderOfSeveralMcapFiles) {
  const std::vector<BagRecord> messages =
      SimulatedMessages(Drive(), Laser(), kCdr);
  const Folder folder;
  fs::create_directories(folder / "bag");
  std::string description =
      "rosbag2_bagfile_information:\n  storage_identifier: mcap\n"
      "  relative_file_paths:\n";
  // Names that are no longer in order when there are eleven.
  for (std::size_t i = 0; i < 11; ++i) {
    const std::string name = "bag_" + std::to_string(i) + ".mcap";
    description += "    - " + name + '\n';
    const auto cut = [&](std::size_t k) {
      return messages.begin() +
             static_cast<std::ptrdiff_t>(messages.size() * k / 11);
    };
    WriteText(folder / ("bag/" + name), MakeMcap({cut(i), cut(i + 1)}));
  }
  WriteText(folder / "bag/metadata.yaml", description);
  ExpectSame(ReadPath(folder / "bag"));
}

// Of several echoes the first is meant, and a beam without any is no return.
TEST_F(FormatsTest, MultiEcho) {
  for (const MessageEncoding encoding : {kRos1, kCdr}) {
    std::vector<BagRecord> messages =
        SimulatedMessages(Drive(), Laser(), encoding);
    for (BagRecord& message : messages) {
      if (message.topic == "/scan") AsMultiEcho(encoding, &message);
    }
    ExpectSame(ReadBytes(encoding == kRos1 ? MakeRosbag1(messages)
                                           : MakeMcap(messages)));
  }
}

TEST_F(FormatsTest, Csv) {
  std::ostringstream text;
  WriteCsvLog(Drive(), Laser(), {"a drive"}, text);
  ExpectSameScans(ReadBytes(text.str()));
}

TEST(BagLogTest, TakesPosesAtTheTimeOfTheScan) {
  for (const MessageEncoding encoding : {kRos1, kCdr}) {
    const std::vector<BagRecord> records = SmallDrive(encoding);
    const Log log =
        ReadBytes(encoding == kRos1 ? MakeRosbag1(records) : MakeMcap(records));
    ASSERT_EQ(log.scans.size(), 10u);
    for (int i = 0; i < 10; ++i) {
      const Scan& scan = log.scans[i];
      EXPECT_NEAR(scan.odometry[0], 0.1 * i, 1e-9);
      EXPECT_NEAR(scan.laser_offset[0], 0.2, 1e-9);
      EXPECT_NEAR(scan.laser_offset[2], 0.1, 1e-9);
      EXPECT_EQ(scan.ranges.size(), 5u);
      EXPECT_NEAR(scan.angle_step, 0.5, 1e-7);
    }
    EXPECT_EQ(log.scans[1].timestamp_text, "1000.100000000");
    EXPECT_EQ(log.position_unit, "message");
    ASSERT_EQ(log.topics.size(), 3u);
    EXPECT_THAT(log.topics, Contains(AllOf(Field(&LogTopic::name, "/scan"),
                                           Field(&LogTopic::messages, 10),
                                           Field(&LogTopic::use, "scans"))));
    EXPECT_THAT(log.topics, Contains(AllOf(Field(&LogTopic::name, "/odom"),
                                           Field(&LogTopic::use, "odometry"))));
  }
}

TEST(BagLogTest, ReadsBigEndianMessages) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 3; ++i) {
    const LaserScanMessage scan = PlainScan(kBagStart + i * kSecond);
    records.push_back({"/scan", "sensor_msgs/LaserScan", scan.header.stamp,
                       EncodeLaserScan(scan, kCdr, true)});
  }
  const Log log = ReadBytes(MakeMcap(records));
  ASSERT_EQ(log.scans.size(), 3u);
  EXPECT_EQ(log.scans[0].ranges, PlainScan(0).ranges);
  EXPECT_EQ(log.scans[2].timestamp, 1002.0);
}

TEST(BagLogTest, MarksWhatIsNoReturn) {
  LaserScanMessage scan = PlainScan(kBagStart);
  const float infinity = std::numeric_limits<float>::infinity();
  scan.ranges = {infinity, std::nanf(""), 0.0f, 0.05f, -1.0f, 10.0f, 5.0f};
  scan.angle_increment = 0.1;
  const Log log = ReadBytes(MakeRosbag1({Record(scan, kRos1)}));
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(log.scans[0].ranges,
            (std::vector<float>{0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 5.0f}));
}

TEST(BagLogTest, TurnsScansCounterclockwise) {
  LaserScanMessage scan = PlainScan(kBagStart);
  scan.angle_min = 1.0;
  scan.angle_increment = -0.5;
  Log log = ReadBytes(MakeRosbag1({Record(scan, kRos1)}));
  EXPECT_NEAR(log.scans[0].start_angle, -1.0, 1e-6);
  EXPECT_NEAR(log.scans[0].angle_step, 0.5, 1e-6);
  EXPECT_EQ(log.scans[0].ranges,
            (std::vector<float>{5.0f, 4.0f, 3.0f, 2.0f, 1.0f}));

  // A laser that hangs upside down sees its first beam on the other side.
  TransformMessage mount =
      Transform(kBagStart, "base_link", "laser", Pose2::Zero());
  mount.transform.qx = 1.0;
  mount.transform.qw = 0.0;
  std::vector<BagRecord> records = {
      TfRecord(mount, kRos1, "/tf_static"),
      OdometryRecord(kBagStart, Pose2::Zero(), kRos1),
      OdometryRecord(kBagStart + kSecond, Pose2(1.0, 0.0, 0.0), kRos1),
      Record(PlainScan(kBagStart), kRos1)};
  log = ReadBytes(MakeRosbag1(records));
  EXPECT_NEAR(log.scans[0].start_angle, -1.0, 1e-6);
  EXPECT_EQ(log.scans[0].ranges,
            (std::vector<float>{5.0f, 4.0f, 3.0f, 2.0f, 1.0f}));
  EXPECT_NEAR(log.scans[0].laser_offset[2], 0.0, 1e-9);
}

// A robot turns on the spot beside a wall; beams come one after another.
TEST(BagLogTest, UndoesMotionDuringTheScan) {
  constexpr double kRate = 1.0;      // rad/s
  constexpr double kDuration = 0.2;  // s
  constexpr int kBeams = 181;
  for (const double offset : {0.0, 0.3}) {
    std::vector<BagRecord> records;
    records.push_back(TfRecord(
        Transform(kBagStart, "base_link", "laser", Pose2(offset, 0.0, 0.0)),
        kRos1, "/tf_static"));
    for (int i = 0; i <= 100; ++i) {
      records.push_back(OdometryRecord(kBagStart + i * kSecond / 100,
                                       Pose2(0.0, 0.0, kRate * i / 100.0),
                                       kRos1));
    }
    LaserScanMessage scan = PlainScan(kBagStart + kSecond / 10);
    scan.angle_min = -0.5;
    scan.angle_increment = 1.0 / (kBeams - 1);
    scan.time_increment = kDuration / (kBeams - 1);
    scan.ranges.clear();
    for (int i = 0; i < kBeams; ++i) {
      // The wall x = 2 of the world.
      const double heading = kRate * (0.1 + kDuration * i / (kBeams - 1));
      const double direction = heading - 0.5 + i * scan.angle_increment;
      scan.ranges.push_back(static_cast<float>(
          (2.0 - offset * std::cos(heading)) / std::cos(direction)));
    }
    records.push_back(Record(scan, kRos1));
    const Log log = ReadBytes(MakeRosbag1(records));
    ASSERT_EQ(log.scans.size(), 1u);
    const Scan& undone = log.scans[0];
    ASSERT_EQ(undone.bearings.size(), undone.ranges.size());
    const Pose2 laser = Compose(undone.odometry, undone.laser_offset);
    for (std::size_t i = 0; i < undone.ranges.size(); ++i) {
      const double x =
          laser[0] + undone.ranges[i] * std::cos(laser[2] + undone.Bearing(i));
      EXPECT_NEAR(x, 2.0, 2e-4) << i;
    }
    EXPECT_THAT(log.notes, Contains(HasSubstr("motion during the scan")));
  }
}

TEST(BagLogTest, OdometryOfTransforms) {
  std::vector<BagRecord> records;
  records.push_back(
      TfRecord(Transform(kBagStart, "base_link", "laser", Pose2(0.1, 0.2, 0.0)),
               kCdr, "/tf_static"));
  for (int i = 0; i < 5; ++i) {
    records.push_back(TfRecord(Transform(kBagStart + i * kSecond, "/odom",
                                         "base_link", Pose2(i, 0.0, 0.0)),
                               kCdr));
    records.push_back(
        Record(PlainScan(kBagStart + i * kSecond + kSecond / 4), kCdr));
  }
  Log log = ReadBytes(MakeMcap(records));
  EXPECT_TRUE(log.has_odometry);
  EXPECT_EQ(log.odometry_source, "tf odom -> base_link");
  EXPECT_NEAR(log.scans[1].odometry[0], 1.25, 1e-9);
  EXPECT_NEAR(log.scans[1].laser_offset[1], 0.2, 1e-9);

  LaserOptions options;
  options.odometry_topic = "none";
  log = ReadBytes(MakeMcap(records), options);
  EXPECT_FALSE(log.has_odometry);
}

// Odometry that never moves is none: what else there is carries the log.
TEST(BagLogTest, OdometryThatNeverChangesLeavesTheWayToOthers) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 5; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    records.push_back(OdometryRecord(time, Pose2(1.0, 2.0, 0.5), kCdr));
    ImuMessage imu;
    imu.header = {time, "imu"};
    imu.yaw_rate = 0.1 * i;
    records.push_back({"/imu", "sensor_msgs/Imu", time, EncodeImu(imu, kCdr)});
    records.push_back(Record(PlainScan(time), kCdr));
  }
  records.push_back(
      TfRecord(Transform(kBagStart, "base_link", "laser", Pose2(0.1, 0.2, 0.0)),
               kCdr, "/tf_static"));
  Log log = ReadBytes(MakeMcap(records));
  EXPECT_FALSE(log.has_odometry);
  EXPECT_EQ(log.odometry_source, "");
  EXPECT_EQ(log.yaw_rates.size(), 5u);
  EXPECT_NEAR(log.scans[0].laser_offset[1], 0.2, 1e-9);
  EXPECT_THAT(log.notes, Contains(HasSubstr("/odom never changes")));

  for (int i = 0; i < 5; ++i) {
    records.push_back(TfRecord(Transform(kBagStart + i * kSecond / 10, "odom",
                                         "base_link", Pose2(i, 0.0, 0.0)),
                               kCdr));
  }
  log = ReadBytes(MakeMcap(records));
  EXPECT_TRUE(log.has_odometry);
  EXPECT_EQ(log.odometry_source, "tf odom -> base_link");
  EXPECT_NEAR(log.scans[3].odometry[0], 3.0, 1e-9);
}

// A transform that nobody stamps, or by another clock, is taken as it was
// recorded; where it lacks for long that is said.
TEST(BagLogTest, TimesOfTransforms) {
  for (const std::int64_t clock :
       {std::int64_t{0}, 400 * kSecond, -kBagStart}) {
    SCOPED_TRACE(clock);
    const bool is_stamped = clock != -kBagStart;
    std::vector<BagRecord> records;
    for (int i = 0; i <= 40; ++i) {
      const std::int64_t time = kBagStart + i * kSecond / 10;
      if (i < 20) {
        BagRecord record =
            TfRecord(Transform(is_stamped ? time + clock : 0, "odom", "laser",
                               Pose2(0.1 * i, 0.0, 0.0)),
                     kRos1);
        record.time = time;
        records.push_back(record);
      }
      records.push_back(Record(PlainScan(time), kRos1));
    }
    const Log log = ReadBytes(MakeRosbag1(records));
    ASSERT_EQ(log.scans.size(), 41u);
    EXPECT_NEAR(log.scans[7].odometry[0], 0.7, 1e-9);
    EXPECT_NEAR(log.scans[40].odometry[0], 1.9, 1e-9);
    EXPECT_THAT(log.notes, Contains(HasSubstr("11 scans are more than 1 s")));
    const std::string said = !is_stamped  ? "has no time stamps of its own"
                             : clock != 0 ? "another clock"
                                          : "more than 1 s";
    EXPECT_THAT(log.notes, Contains(HasSubstr(said)));
  }
}

// A step that was rounded bends a scan: that is said.
TEST(BagLogTest, StepsThatDoNotLeadToTheStatedEndAreSaid) {
  const auto notes_of = [](double step) {
    LaserScanMessage scan = PlainScan(kBagStart);
    scan.angle_min = 0.0;
    scan.ranges.assign(360, 2.0f);
    scan.angle_increment = step;
    scan.angle_max = DegToRad(359.0);
    return ReadBytes(MakeRosbag1({Record(scan, kRos1)})).notes;
  };
  EXPECT_THAT(notes_of(0.017),
              Contains(AllOf(HasSubstr("1 scans end at another angle"),
                             HasSubstr("349.6"), HasSubstr("359.00"),
                             HasSubstr("--laser_step"))));
  // One beam more or less is no matter, nor is what a float leaves.
  for (const double step : {DegToRad(1.0), DegToRad(359.0) / 360.0}) {
    EXPECT_THAT(notes_of(step), Not(Contains(HasSubstr("another angle"))));
  }
}

// Drivers that put the time of a whole scan, or anything, into time_increment.
TEST(BagLogTest, SweepsThatTakeLongerThanThereIsTimeAreNotBelieved) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 10; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    records.push_back(
        OdometryRecord(time, Pose2(0.1 * i, 0.0, 0.3 * i), kRos1));
    LaserScanMessage scan = PlainScan(time);
    // Of five beams: 0.08 s are possible, 0.16 are not.
    scan.time_increment = i < 8 ? 0.04 : 0.02;
    records.push_back(Record(scan, kRos1));
  }
  const Log log = ReadBytes(MakeRosbag1(records));
  ASSERT_EQ(log.scans.size(), 10u);
  EXPECT_TRUE(log.scans[3].bearings.empty());
  EXPECT_FALSE(log.scans[8].bearings.empty());
  EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("time_increment of 8 of 10"),
                                        HasSubstr("not believed"))));
}

// What simulators write where there is no clock.
// As one that is sold with many robots says: 11 ms for a turn, five a second.
// What turns all the time takes from one scan to the next.
TEST(BagLogTest, WholeTurnsThatTakeHardlyAnyTimeAreNotBelieved) {
  const auto read = [](double increment, int beams) {
    std::vector<BagRecord> records;
    for (int i = 0; i < 10; ++i) {
      const std::int64_t time = kBagStart + i * kSecond / 5;
      records.push_back(
          OdometryRecord(time, Pose2(0.1 * i, 0.0, 0.2 * i), kRos1));
      LaserScanMessage scan = PlainScan(time);
      scan.angle_min = 0.0;
      scan.angle_increment = DegToRad(1.0);
      scan.angle_max = DegToRad(1.0) * (beams - 1);
      scan.time_increment = increment;
      scan.ranges.assign(static_cast<std::size_t>(beams), 2.0f);
      records.push_back(Record(scan, kRos1));
    }
    return ReadBytes(MakeRosbag1(records));
  };
  const auto is_said = Contains(HasSubstr("less than a tenth"));
  const Log hasty = read(2.99e-5, 360);
  EXPECT_THAT(hasty.notes, is_said);
  for (const Scan& scan : hasty.scans) EXPECT_THAT(scan.bearings, IsEmpty());
  // A turn that takes its time, and what does not see all round.
  for (const Log& log : {read(5e-4, 360), read(2.99e-5, 270)}) {
    EXPECT_THAT(log.notes, Not(is_said));
    EXPECT_THAT(log.scans[4].bearings, Not(IsEmpty()));
  }
}

TEST(BagLogTest, StampsOfZeroAreTimesOfRecording) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 10; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    BagRecord odometry = OdometryRecord(0, Pose2(0.1 * i, 0.0, 0.0), kCdr);
    odometry.time = time;
    records.push_back(odometry);
    LaserScanMessage message = PlainScan(0);
    message.ranges[0] = 1.0f + 0.1f * static_cast<float>(i);
    BagRecord scan = Record(message, kCdr);
    scan.time = time;
    records.push_back(scan);
  }
  const Log log = ReadBytes(MakeMcap(records));
  ASSERT_EQ(log.scans.size(), 10u);
  EXPECT_NEAR(log.scans[4].timestamp, 1000.4, 1e-9);
  EXPECT_NEAR(log.scans[4].odometry[0], 0.4, 1e-9);
  EXPECT_THAT(log.notes, Contains(HasSubstr("no time stamps of their own")));
}

// Frames have slashes in front, or not, as drivers have it; between odom and
// the laser there may be several.
TEST(BagLogTest, FramesWithSlashesAndWaysOfSeveralFrames) {
  std::vector<BagRecord> records;
  records.push_back(TfRecord(Transform(kBagStart, "/base_footprint",
                                       "base_link", Pose2(0.1, 0.0, 0.0)),
                             kRos1));
  records.push_back(TfRecord(
      Transform(kBagStart, "base_link", "/laser", Pose2(0.2, 0.3, 0.0)),
      kRos1));
  for (int i = 0; i < 10; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    records.push_back(TfRecord(
        Transform(time, "/odom", "base_footprint", Pose2(0.1 * i, 0.0, 0.0)),
        kRos1));
    LaserScanMessage scan = PlainScan(time);
    scan.header.frame = i % 2 == 0 ? "/laser" : "laser";
    records.push_back(Record(scan, kRos1));
  }
  const Log log = ReadBytes(MakeRosbag1(records));
  ASSERT_EQ(log.scans.size(), 10u);
  EXPECT_EQ(log.odometry_source, "tf odom -> base_footprint");
  for (int i = 0; i < 10; ++i) {
    EXPECT_NEAR(log.scans[i].odometry[0], 0.1 * i, 1e-9);
    EXPECT_NEAR(log.scans[i].laser_offset[0], 0.3, 1e-9);
    EXPECT_NEAR(log.scans[i].laser_offset[1], 0.3, 1e-9);
  }
  EXPECT_THAT(log.skipped, IsEmpty());
}

TEST(BagLogTest, OtherScansAreRefusedByType) {
  EXPECT_THAT(WhatOf(MakeRosbag1(
                  {{"/sonar", "sensor_msgs/Range", kBagStart, "bytes"}})),
              AllOf(HasSubstr("/sonar (sensor_msgs/Range, 1)"),
                    HasSubstr("expected"), HasSubstr("sensor_msgs/LaserScan"),
                    HasSubstr("MultiEchoLaserScan")));
}

TEST(BagLogTest, ReadsMultiEchoMessagesOfEitherByteOrder) {
  LaserScanMessage scan = PlainScan(kBagStart);
  scan.ranges[1] = 0.0f;
  scan.ranges[2] = std::numeric_limits<float>::infinity();
  for (const bool big_endian : {false, true}) {
    const Log log = ReadBytes(
        MakeMcap({{"/echoes", "sensor_msgs/MultiEchoLaserScan", kBagStart,
                   EncodeMultiEchoLaserScan(scan, kCdr, big_endian)}}));
    ASSERT_EQ(log.scans.size(), 1u);
    EXPECT_EQ(log.scans[0].ranges,
              (std::vector<float>{1.0f, 0.0f, 0.0f, 4.0f, 5.0f}));
    EXPECT_EQ(log.scan_message, "/echoes");
    EXPECT_THAT(log.skipped, IsEmpty());
  }
}

// A message breaks off where its last readings are, and after it no bytes of
// the next one are taken for echoes.
TEST(BagLogTest, MultiEchoMessagesThatBreakOffOrLieAreCounted) {
  const std::string whole =
      EncodeMultiEchoLaserScan(PlainScan(kBagStart), kRos1);
  std::string bare = whole;
  bare.resize(whole.size() - 4);
  const auto record = [](std::int64_t time, std::string data) {
    return BagRecord{"/echoes", "sensor_msgs/MultiEchoLaserScan", time,
                     std::move(data)};
  };
  // Ranges of PlainScan, without intensities, as all that can be missing.
  const std::size_t ranges = bare.size() - 5 * 4 - 7 * 4;
  for (std::size_t cut = 0; cut < bare.size(); ++cut) {
    const Log log = ReadBytes(
        MakeRosbag1({record(kBagStart, whole),
                     record(kBagStart + kSecond, bare.substr(0, cut))}));
    EXPECT_EQ(log.scans.size(), 1u) << cut;
    EXPECT_EQ(SkippedInBag(log, "/echoes that"), 1) << cut;
  }
  for (const std::uint32_t lie : {3u, 1000u, 0x40000000u, 0xffffffffu}) {
    // Of the number of echoes of the first beam, and of that of beams.
    for (const std::size_t place : {ranges, ranges - 4}) {
      std::string data = bare;
      std::memcpy(&data[place], &lie, 4);
      const Log log = ReadBytes(MakeRosbag1(
          {record(kBagStart, whole), record(kBagStart + kSecond, data)}));
      // Three beams in place of five are a scan of another shape.
      EXPECT_EQ(log.scans.size(), lie == 3 && place != ranges ? 2u : 1u);
      EXPECT_EQ(SkippedInBag(log, "/echoes that"),
                lie == 3 && place != ranges ? 0 : 1)
          << lie;
    }
  }
  EXPECT_THAT(WhatOf(MakeRosbag1({record(kBagStart, "bytes")})),
              HasSubstr("breaks off"));
}

TEST(BagLogTest, TfThatLacksTheLaserIsSaid) {
  std::vector<BagRecord> records = SmallDrive(kRos1);
  records.erase(records.begin());
  const Log log = ReadBytes(MakeRosbag1(records));
  EXPECT_EQ(log.scans[0].laser_offset, Pose2::Zero());
  EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("'laser'"),
                                        HasSubstr("robot's centre"))));
}

TEST(BagLogTest, SeveralTopicsNeedAChoice) {
  std::vector<BagRecord> records = SmallDrive(kRos1);
  records.push_back(Record(PlainScan(kBagStart + 5 * kSecond), kRos1, "/back"));
  EXPECT_THAT(WhatOf(MakeRosbag1(records)),
              AllOf(HasSubstr("/scan (10)"), HasSubstr("/back (1)"),
                    HasSubstr("--scan_topic")));
  LaserOptions options;
  options.scan_topic = "back";
  const Log log = ReadBytes(MakeRosbag1(records), options);
  EXPECT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(log.scan_message, "/back");
  options.scan_topic = "/front";
  EXPECT_THAT(WhatOf(MakeRosbag1(records), options),
              AllOf(HasSubstr("no topic /front"), HasSubstr("/back (1)")));
  options.scan_topic = "/odom";
  EXPECT_THAT(WhatOf(MakeRosbag1(records), options),
              HasSubstr("messages of type nav_msgs/Odometry on /odom"));

  records = SmallDrive(kRos1);
  for (const double x : {5.0, 6.0}) {
    records.push_back(
        OdometryRecord(kBagStart, Pose2(x, 0.0, 0.0), kRos1, "/wheels"));
  }
  EXPECT_THAT(WhatOf(MakeRosbag1(records)),
              AllOf(HasSubstr("/odom (11)"), HasSubstr("/wheels (2)"),
                    HasSubstr("--odometry_topic")));
  options = LaserOptions();
  options.odometry_topic = "/odom";
  EXPECT_NEAR(ReadBytes(MakeRosbag1(records), options).scans[1].odometry[0],
              0.1, 1e-9);
  options.odometry_topic = "tf";
  EXPECT_THAT(WhatOf(MakeRosbag1(records), options),
              HasSubstr("frame called odom"));
}

// A second laser in SmallDrive that nods, or stands on its side.
std::vector<BagRecord> DriveWithTiltedLaser(bool nods) {
  std::vector<BagRecord> records = SmallDrive(kRos1);
  for (int i = 0; i < 12; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    TransformMessage tilt =
        Transform(time, "base_link", "tilt", Pose2(0.0, 0.0, 0.0));
    const double angle = nods ? 0.1 * i : 0.5 * kPi;
    tilt.transform.qy = std::sin(0.5 * angle);
    tilt.transform.qw = std::cos(0.5 * angle);
    records.push_back(TfRecord(tilt, kRos1));
    LaserScanMessage scan = PlainScan(time);
    scan.header.frame = "tilt";
    // It comes first in the bag.
    records.insert(records.begin(), Record(scan, kRos1, "/tilt_scan"));
  }
  return records;
}

TEST(BagLogTest, LasersThatDoNotLookLevelAreNotMeant) {
  for (const bool nods : {true, false}) {
    const std::string bag = MakeRosbag1(DriveWithTiltedLaser(nods));
    const Log log = ReadBytes(bag);
    EXPECT_EQ(log.scan_message, "/scan");
    EXPECT_EQ(log.scans.size(), 10u);
    EXPECT_EQ(log.scans[0].laser_offset, Pose2(0.2, 0.0, 0.1));
    EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("/tilt_scan are not used"),
                                          HasSubstr("20 degrees"))));
    LaserOptions options;
    options.scan_topic = "/tilt_scan";
    EXPECT_EQ(ReadBytes(bag, options).scans.size(), 12u);
  }
}

// Without tf its name tells which laser of a backpack stands on its side.
TEST(BagLogTest, LasersThatAreCalledVerticalAreNotMeant) {
  const auto backpack = [](const char* other) {
    std::vector<BagRecord> records;
    for (int i = 0; i < 5; ++i) {
      LaserScanMessage scan = PlainScan(kBagStart + i * kSecond / 10);
      scan.header.frame = std::string(other) + "_laser_link";
      records.push_back(Record(scan, kRos1, std::string(other) + "_laser_2d"));
      scan.header.frame = "horizontal_laser_link";
      records.push_back(Record(scan, kRos1, "horizontal_laser_2d"));
    }
    return MakeRosbag1(records);
  };
  const Log log = ReadBytes(backpack("vertical"));
  EXPECT_EQ(log.scan_message, "horizontal_laser_2d");
  EXPECT_THAT(log.notes, Contains(HasSubstr("called vertical")));
  EXPECT_THAT(WhatOf(backpack("rear")),
              AllOf(HasSubstr("several topics"), HasSubstr("rear_laser_2d (5)"),
                    HasSubstr("horizontal_laser_2d (5)")));
}

// A filter takes away returns, or sends every fifth scan on.
TEST(BagLogTest, ScansThatWereFilteredAreThoseOfOneLaser) {
  for (const int every : {1, 5}) {
    std::vector<BagRecord> records;
    for (int i = 0; i < 20; ++i) {
      LaserScanMessage scan = PlainScan(kBagStart + i * kSecond / 10);
      const BagRecord raw = Record(scan, kRos1);
      scan.ranges[1] = every == 1 ? std::nanf("") : 2.5f;
      if (i % every == 0) {
        records.push_back(Record(scan, kRos1, "/scan_filtered"));
      }
      records.push_back(raw);
    }
    const Log log = ReadBytes(MakeRosbag1(records));
    EXPECT_EQ(log.scan_message, "/scan");
    EXPECT_EQ(log.scans.size(), 20u);
    EXPECT_THAT(log.notes, Contains(HasSubstr("it has the scans of /scan")));
  }
  // Stamps that nobody sets are all the same, and say nothing.
  std::vector<BagRecord> records;
  for (int i = 0; i < 5; ++i) {
    for (const char* topic : {"/front", "/rear"}) {
      BagRecord record = Record(PlainScan(0), kRos1, topic);
      record.time = kBagStart + i * kSecond / 10;
      records.push_back(record);
    }
  }
  EXPECT_THAT(WhatOf(MakeRosbag1(records)), HasSubstr("/front (5), /rear (5)"));
}

// Poses of a localization jump; what tf has is what the robot goes by.
TEST(BagLogTest, OdometryThatTheRobotGoesByIsMeant) {
  std::vector<BagRecord> records = SmallDrive(kRos1, 30);
  const auto add = [&](const char* topic, const char* frame, double scale) {
    for (int i = 0; i <= 30; ++i) {
      BagRecord record =
          OdometryRecord(kBagStart + i * kSecond / 10,
                         Pose2(0.1 * scale * i, 0.0, 0.0), kRos1, topic);
      OdometryMessage odometry;
      std::string why;
      ASSERT_TRUE(DecodeOdometry(record.data, kRos1, &odometry, &why));
      odometry.header.frame = frame;
      record.data = EncodeOdometry(odometry, kRos1);
      records.push_back(record);
    }
  };
  add("/slam", "map", 3.0);
  Log log = ReadBytes(MakeRosbag1(records));
  EXPECT_EQ(log.odometry_source, "/odom");
  EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("/slam is not used"),
                                        HasSubstr("frame 'map'"))));

  add("/filtered", "odom", 2.0);
  EXPECT_THAT(WhatOf(MakeRosbag1(records)),
              HasSubstr("has odometry on several topics"));
  for (int i = 0; i <= 30; ++i) {
    records.push_back(TfRecord(Transform(kBagStart + i * kSecond / 10, "odom",
                                         "base_link", Pose2(0.2 * i, 0.0, 0.0)),
                               kRos1));
  }
  log = ReadBytes(MakeRosbag1(records));
  EXPECT_EQ(log.odometry_source, "/filtered");
  EXPECT_NEAR(log.scans[10].odometry[0], 2.0, 1e-6);
  EXPECT_THAT(log.notes, Contains(HasSubstr("tf has the poses of /filtered")));

  // tf alone rather than a localization; that rather than nothing.
  records = SmallDrive(kRos1, 30);
  records.erase(
      std::remove_if(records.begin(), records.end(),
                     [](const BagRecord& r) { return r.topic == "/odom"; }),
      records.end());
  add("/slam", "map", 3.0);
  EXPECT_EQ(ReadBytes(MakeRosbag1(records)).odometry_source, "/slam");
  for (int i = 0; i <= 30; ++i) {
    records.push_back(TfRecord(Transform(kBagStart + i * kSecond / 10, "odom",
                                         "base_link", Pose2(0.1 * i, 0.0, 0.0)),
                               kRos1));
  }
  EXPECT_EQ(ReadBytes(MakeRosbag1(records)).odometry_source,
            "tf odom -> base_link");
}

// Two robots with frames of the same names, of which one scans.
TEST(BagLogTest, TransformsAndOdometryOfAnotherRobotAreNotUsed) {
  for (const bool is_tf : {false, true}) {
    std::vector<BagRecord> records;
    for (const int robot : {2, 1}) {
      const std::string space = "/robot" + std::to_string(robot);
      for (BagRecord record : SmallDrive(kRos1)) {
        if (record.topic == "/odom") {
          const double way = 0.1 * robot *
                             static_cast<double>(record.time - kBagStart) /
                             static_cast<double>(kSecond / 10);
          const Pose2 pose(way, 0.0, 0.0);
          record =
              is_tf
                  ? TfRecord(Transform(record.time, "odom", "base_link", pose),
                             kRos1, "/tf")
                  : OdometryRecord(record.time, pose, kRos1);
        } else if (record.topic == "/tf_static") {
          record = TfRecord(Transform(kBagStart, "base_link", "laser",
                                      Pose2(0.1 * robot, 0.0, 0.0)),
                            kRos1, record.topic);
        } else if (robot == 2) {
          continue;
        }
        record.topic = space + record.topic;
        records.push_back(record);
      }
    }
    const Log log = ReadBytes(MakeRosbag1(records));
    EXPECT_EQ(log.scan_message, "/robot1/scan");
    EXPECT_EQ(log.odometry_source,
              is_tf ? "tf odom -> base_link" : "/robot1/odom");
    EXPECT_NEAR(log.scans[5].odometry[0], 0.5, 1e-9);
    EXPECT_NEAR(log.scans[5].laser_offset[0], 0.1, 1e-9);
    EXPECT_THAT(log.topics,
                Contains(AllOf(Field(&LogTopic::name, "/robot2/tf_static"),
                               Field(&LogTopic::use, ""),
                               Field(&LogTopic::why_not,
                                     HasSubstr("another namespace")))));
  }
}

// What stands still is said once, and many recordings begin after that.
TEST(BagLogTest, TransformsOfTheOnlyRobotAreThoseOfALaserThatTfDoesNotKnow) {
  std::vector<BagRecord> records;
  const auto add = [&](const std::string& robot) {
    for (int i = 0; i < 10; ++i) {
      records.push_back(
          TfRecord(Transform(kBagStart + i * kSecond / 10, "odom" + robot,
                             "base_link" + robot, Pose2(0.1 * i, 0.0, 0.0)),
                   kRos1));
    }
  };
  for (int i = 0; i < 10; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    records.push_back(Record(PlainScan(time), kRos1));
    records.push_back(TfRecord(
        Transform(time, "map", "odom", Pose2(0.3 * i, 0.0, 0.0)), kRos1));
    records.push_back(TfRecord(
        Transform(time, "base_link", "arm", Pose2(0.0, 0.1 * i, 0.0)), kRos1));
  }
  add("");
  const Log log = ReadBytes(MakeRosbag1(records));
  EXPECT_EQ(log.odometry_source, "tf odom -> base_link");
  EXPECT_NEAR(log.scans[5].odometry[0], 0.5, 1e-9);
  EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("'laser' is in 'base_link'"),
                                        HasSubstr("robot's centre"))));
  // Of two it could be either.
  add("_of_another");
  EXPECT_EQ(ReadBytes(MakeRosbag1(records)).odometry_source, "");
}

TEST(BagLogTest, ScansWithoutReturnsAreSaid) {
  const auto notes = [](float scale) {
    LaserScanMessage scan = PlainScan(kBagStart);
    for (float& range : scan.ranges) range *= scale;
    return ReadBytes(MakeRosbag1({Record(scan, kRos1)})).notes;
  };
  EXPECT_THAT(notes(1.0f), Not(Contains(HasSubstr("are returns"))));
  EXPECT_THAT(notes(0.0f), Contains("0 % of the readings are returns"));
  // In millimetres.
  EXPECT_THAT(notes(1000.0f), Contains(AllOf(HasSubstr("0 % of the readings"),
                                             HasSubstr("another unit"))));
}

TEST(BagLogTest, OdometryInMillimetresIsNotUsed) {
  const auto read = [](double metre, double jump) {
    std::vector<BagRecord> records;
    for (int i = 0; i < 40; ++i) {
      const std::int64_t time = kBagStart + i * kSecond / 10;
      records.push_back(OdometryRecord(
          time, Pose2(metre * 0.1 * i + (i < 20 ? 0.0 : jump), 0.0, 0.0),
          kRos1));
      records.push_back(Record(PlainScan(time), kRos1));
    }
    return ReadBytes(MakeRosbag1(records));
  };
  EXPECT_EQ(read(1.0, 0.0).odometry_source, "/odom");
  EXPECT_EQ(read(10.0, 1e5).odometry_source, "/odom");
  const Log log = read(1000.0, 0.0);
  EXPECT_EQ(log.odometry_source, "");
  EXPECT_FALSE(log.has_odometry);
  EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("/odom has the robot go"),
                                        HasSubstr("1000 m/s"))));
}

TEST(BagLogTest, ListsWhatIsThereWhenThereIsNoScan) {
  std::vector<LogTopic> topics;
  LaserOptions options;
  options.on_topics = [&](const std::vector<LogTopic>& t) { topics = t; };
  const std::string bag =
      MakeRosbag1({OdometryRecord(kBagStart, Pose2::Zero(), kRos1)});
  EXPECT_THAT(WhatOf(bag, options),
              AllOf(HasSubstr("/odom (nav_msgs/Odometry, 1)"),
                    HasSubstr("sensor_msgs/LaserScan")));
  ASSERT_EQ(topics.size(), 1u);
  EXPECT_EQ(topics[0].name, "/odom");
}

TEST(BagLogTest, OrdersScansWithinASecond) {
  std::vector<BagRecord> records;
  for (const int i : {0, 2, 1, 3}) {
    records.push_back(Record(PlainScan(kBagStart + i * kSecond / 10), kRos1));
  }
  // A clock that was set back by a minute is meant.
  records.push_back(Record(PlainScan(kBagStart - 60 * kSecond), kRos1));
  const Log log = ReadBytes(MakeRosbag1(records));
  ASSERT_EQ(log.scans.size(), 5u);
  EXPECT_NEAR(log.scans[1].timestamp, 1000.1, 1e-9);
  EXPECT_NEAR(log.scans[4].timestamp, 940.0, 1e-9);
  EXPECT_EQ(log.time_reversals, 1);
  EXPECT_THAT(log.notes, Contains(HasSubstr("out of order")));
}

// A recorder that listens twice. Readings are compared as they were sent: the
// motion during the first one is undone by then.
TEST(BagLogTest, ScansThatWereRecordedTwiceCountOnce) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 10; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    records.push_back(
        OdometryRecord(time, Pose2(0.1 * i, 0.0, 0.3 * i), kRos1));
    LaserScanMessage scan = PlainScan(time);
    scan.time_increment = 0.02;
    scan.ranges[2] = std::nanf("");
    records.push_back(Record(scan, kRos1));
    if (i % 2 == 0) records.push_back(Record(scan, kRos1));
    // Another scan that claims the same time is one.
    scan.ranges[0] += 0.01f;
    if (i == 4) records.push_back(Record(scan, kRos1));
  }
  const Log log = ReadBytes(MakeRosbag1(records));
  EXPECT_EQ(log.scans.size(), 11u);
  EXPECT_EQ(SkippedInBag(log, "scan that was recorded twice"), 5);
}

TEST(BagLogTest, ClocksThatDifferAreAligned) {
  std::vector<BagRecord> records = SmallDrive(kRos1);
  // The robot's clock is an hour behind that of the laser's computer; messages
  // were recorded at the same time.
  std::vector<BagRecord> changed;
  for (const BagRecord& record : records) {
    if (record.topic != "/odom") {
      changed.push_back(record);
      continue;
    }
    OdometryMessage odometry;
    std::string why;
    ASSERT_TRUE(DecodeOdometry(record.data, kRos1, &odometry, &why));
    odometry.header.stamp -= 900 * kSecond;
    BagRecord moved = record;
    moved.data = EncodeOdometry(odometry, kRos1);
    changed.push_back(moved);
  }
  const Log log = ReadBytes(MakeRosbag1(changed));
  EXPECT_NEAR(log.scans[3].odometry[0], 0.3, 1e-9);
  EXPECT_THAT(log.notes, Contains(HasSubstr("another clock")));
}

// A robot in an office, so many scans a second.
Simulation OfficeDrive(double scan_rate) {
  SimulatorOptions options;
  options.laser = Laser();
  options.drive.scan_rate = scan_rate;
  options.progress = [](double share) { return share < 0.3; };
  return Simulate(MakeWorld("office", 3, 0.5), options, 3);
}

const Simulation& SlowDrive() {
  static const auto* const simulation = new Simulation(OfficeDrive(1.0));
  return *simulation;
}

// Records the scans of a drive `late` ns after their time stamps, and stamps
// odometry by a clock that is `ahead` ns ahead.
Log ReadDrive(const Simulation& drive, std::int64_t late, std::int64_t ahead,
              bool has_returns) {
  std::vector<BagRecord> records = SimulatedMessages(drive, Laser(), kRos1);
  std::string why;
  for (BagRecord& record : records) {
    if (record.topic == "/scan") {
      record.time += late;
      if (has_returns) continue;
      LaserScanMessage scan;
      EXPECT_TRUE(DecodeLaserScan(record.data, kRos1, &scan, &why)) << why;
      for (float& range : scan.ranges) range = 0.0f;
      record.data = EncodeLaserScan(scan, kRos1);
    } else if (record.topic == "/odom") {
      OdometryMessage odometry;
      EXPECT_TRUE(DecodeOdometry(record.data, kRos1, &odometry, &why)) << why;
      odometry.header.stamp += ahead;
      record.data = EncodeOdometry(odometry, kRos1);
    }
  }
  return ReadBytes(MakeRosbag1(records));
}

Log ReadSlowDrive(std::int64_t late, std::int64_t ahead,
                  bool has_returns = true) {
  return ReadDrive(SlowDrive(), late, ahead, has_returns);
}

// The laser of a slow robot takes a second to a scan, which is recorded in the
// end: its time stamps are right nevertheless, as the scans themselves say.
TEST(BagLogTest, ScansThatAreRecordedLateKeepTheirTimes) {
  const Log right = ReadSlowDrive(0, 0);
  ASSERT_GT(right.scans.size(), 30u);
  for (const std::int64_t late :
       {kSecond + kSecond / 100, 2 * kSecond, -2 * kSecond}) {
    SCOPED_TRACE(late);
    const Log log = ReadSlowDrive(late, 0);
    ASSERT_EQ(log.scans.size(), right.scans.size());
    for (std::size_t i = 0; i < log.scans.size(); ++i) {
      ASSERT_EQ(log.scans[i].odometry, right.scans[i].odometry) << i;
    }
    EXPECT_THAT(log.notes, Not(Contains(HasSubstr("clock"))));
  }
}

// Scans say better than times of recording by how much clocks differ.
TEST(BagLogTest, ScansTellByHowMuchClocksDiffer) {
  const Log right = ReadSlowDrive(0, 0);
  for (const std::int64_t ahead : {3 * kSecond, -100 * kSecond}) {
    SCOPED_TRACE(ahead);
    const Log log = ReadSlowDrive(kSecond, ahead);
    ASSERT_EQ(log.scans.size(), right.scans.size());
    EXPECT_THAT(log.notes, Contains(HasSubstr("another clock")));
    double most = 0.0;
    for (std::size_t i = 0; i < log.scans.size(); ++i) {
      most = std::max(
          most,
          (log.scans[i].odometry - right.scans[i].odometry).head<2>().norm());
    }
    EXPECT_LT(most, 0.05);
  }
}

double MostApart(const Log& a, const Log& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.scans.size(); ++i) {
    const Pose2 apart = a.scans[i].odometry - b.scans[i].odometry;
    most = std::max(
        {most, apart.head<2>().norm(), std::abs(NormalizeAngle(apart[2]))});
  }
  return most;
}

// Of clocks that differ by a little the times of recording say nothing. Scans
// do, where they do not hide it themselves.
TEST(BagLogTest, ScansTellOfClocksThatDifferByALittle) {
  const Simulation drive = OfficeDrive(10.0);
  const Log right = ReadDrive(drive, 0, 0, true);
  EXPECT_THAT(right.notes, Not(Contains(HasSubstr("time stamps, by which"))));
  for (const std::int64_t ahead : {kSecond / 5, -kSecond / 4}) {
    SCOPED_TRACE(ahead);
    const Log log = ReadDrive(drive, 0, ahead, true);
    ASSERT_EQ(log.scans.size(), right.scans.size());
    EXPECT_THAT(log.notes, Contains(HasSubstr("time stamps, by which")));
    EXPECT_LT(MostApart(log, right), 0.03);
    const Log blind = ReadDrive(drive, 0, ahead, false);
    EXPECT_THAT(blind.notes, Not(Contains(HasSubstr("time stamps, by which"))));
    EXPECT_GT(MostApart(blind, right), 0.1);
  }
}

// Stamps and poses of damaged messages, as far apart as they can be.
TEST(BagLogTest, AbsurdClocksAndPosesAreSurvived) {
  for (const std::int64_t received : {std::int64_t{0}, kMostTime}) {
    for (const double place : {0.0, 1e300}) {
      std::vector<BagRecord> records;
      for (int i = 0; i < 60; ++i) {
        const std::int64_t time = kBagStart + i * kSecond / 2;
        LaserScanMessage scan = PlainScan(time);
        scan.ranges.assign(200, 3.0f);
        scan.angle_increment = 0.01;
        records.push_back(Record(scan, kRos1));
        records.push_back(OdometryRecord(
            time, Pose2(i % 2 == 0 ? place : -place, i, 0.3 * i), kRos1));
        records.back().time = received;
      }
      const Log log = ReadBytes(MakeRosbag1(records));
      EXPECT_EQ(log.scans.size(), 60u);
      for (const Scan& scan : log.scans) {
        EXPECT_TRUE(scan.odometry.allFinite());
      }
    }
  }
}

// rosbag record --split; where tf_static and the like came once.
TEST(BagLogTest, FolderOfTheRos1BagsThatOneWasSplitInto) {
  const std::vector<BagRecord> records =
      SimulatedMessages(Drive(), Laser(), kRos1);
  const Log whole = ReadBytes(MakeRosbag1(records));
  ASSERT_FALSE(whole.scans.empty());
  const Folder folder;
  const auto split = [&](const std::vector<std::string>& names) {
    const std::string path = folder / names[0];
    fs::create_directory(path);
    const std::size_t n = names.size();
    for (std::size_t i = 0; i < n; ++i) {
      const auto at = [&](std::size_t part) {
        return records.begin() +
               static_cast<std::ptrdiff_t>(records.size() * part / n);
      };
      WriteText(path + "/" + names[i], MakeRosbag1({at(i), at(i + 1)}));
    }
    return path;
  };
  for (const std::string& path :
       {split({"d_10-59_0.bag", "d_11-10_1.bag", "d_01-30_2.bag"}),
        split({"drive.bag"})}) {
    SCOPED_TRACE(path);
    const Log log = ReadPath(path);
    EXPECT_EQ(log.format, "ROS 1 bag (folder)");
    EXPECT_THAT(log.skipped, IsEmpty());
    ASSERT_EQ(log.scans.size(), whole.scans.size());
    EXPECT_EQ(log.scans.back().odometry, whole.scans.back().odometry);
    EXPECT_EQ(log.scans.back().laser_offset, whole.scans.back().laser_offset);
  }
  // Drives of their own, and parts of which one lacks.
  for (const std::string& path :
       {split({"monday.bag", "tuesday.bag"}), split({"e_0.bag", "e_2.bag"})}) {
    SCOPED_TRACE(path);
    try {
      ReadPath(path);
      ADD_FAILURE() << "not refused";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("parts of one recording"));
    }
  }
}

enum class SetBackOf { kAll, kScans };

// A drive of 10 s in which a clock is set back, with odometry or transforms.
Log ReadSetBack(int jump_at, std::int64_t back, bool is_tf,
                SetBackOf what = SetBackOf::kAll) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 200; ++i) {
    const std::int64_t on = kBagStart + i * kSecond / 20;
    const std::int64_t time = i < jump_at ? on : on - back;
    const std::int64_t of_pose = what == SetBackOf::kAll ? time : on;
    const Pose2 pose(0.05 * i, 0.0, 0.0);
    records.push_back(
        is_tf ? TfRecord(Transform(of_pose, "odom", "laser", pose), kRos1)
              : OdometryRecord(of_pose, pose, kRos1));
    if (i % 2 == 0) records.push_back(Record(PlainScan(time), kRos1));
  }
  return ReadBytes(MakeRosbag1(records));
}

// A clock that is set back goes through the same times twice. The order of the
// bag tells which odometry is meant.
TEST(BagLogTest, OdometryOfTheSameTimeWhereTheClockWasSetBack) {
  for (const bool is_tf : {false, true}) {
    for (const std::int64_t back :
         {2 * kSecond, 3 * kSecond, 8 * kSecond, 500 * kSecond}) {
      SCOPED_TRACE(back);
      const Log log = ReadSetBack(101, back, is_tf);
      ASSERT_EQ(log.scans.size(), 100u);
      for (std::size_t i = 0; i < log.scans.size(); ++i) {
        ASSERT_NEAR(log.scans[i].odometry[0], 0.1 * static_cast<double>(i),
                    1e-9)
            << i;
      }
      // As stamped.
      EXPECT_NEAR(log.scans[60].timestamp,
                  SecondsOf(kBagStart + 6 * kSecond - back), 1e-6);
      EXPECT_EQ(log.time_reversals, 1);
      EXPECT_THAT(log.notes, Contains(HasSubstr("clock was set back")));
    }
  }
}

// A recording that is played in a circle and recorded. The laser starts after
// the base and ends before it, so that each topic goes back by another time.
TEST(BagLogTest, OdometryOfTheSameTimeWhereARecordingIsPlayedInACircle) {
  for (const bool is_tf : {false, true}) {
    for (const bool is_recorder_set_back : {false, true}) {
      std::vector<BagRecord> records;
      for (int round = 0; round < 3; ++round) {
        for (int i = 0; i < 200; ++i) {
          const std::int64_t time = kBagStart + i * kSecond / 20;
          const Pose2 pose(0.05 * i, 0.0, 0.0);
          const auto add = [&](BagRecord record) {
            if (!is_recorder_set_back) record.time += round * 10 * kSecond;
            records.push_back(std::move(record));
          };
          add(is_tf ? TfRecord(Transform(time, "odom", "laser", pose), kRos1)
                    : OdometryRecord(time, pose, kRos1));
          if (i >= 60 && i < 160 && i % 2 == 0) {
            add(Record(PlainScan(time), kRos1));
          }
        }
      }
      const Log log = ReadBytes(MakeRosbag1(records));
      ASSERT_EQ(log.scans.size(), 150u);
      for (std::size_t i = 0; i < log.scans.size(); ++i) {
        ASSERT_NEAR(log.scans[i].odometry[0],
                    3.0 + 0.1 * static_cast<double>(i % 50), 1e-9)
            << i;
      }
      EXPECT_TRUE(log.has_odometry);
      EXPECT_THAT(log.notes, Contains(HasSubstr("clock was set back")));
    }
  }
}

// Where that of the laser alone is set back, whose they are is lost.
TEST(BagLogTest, OdometryOfTimesThatCameTwiceIsNotUsed) {
  for (const bool is_tf : {false, true}) {
    Log log = ReadSetBack(100, 3 * kSecond, is_tf, SetBackOf::kScans);
    EXPECT_EQ(log.scans.size(), 100u);
    EXPECT_FALSE(log.has_odometry);
    EXPECT_EQ(log.odometry_source, "");
    EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("clock was set back"),
                                          HasSubstr("not used"))));
    // Few of them.
    log = ReadSetBack(194, 2 * kSecond, is_tf, SetBackOf::kScans);
    EXPECT_TRUE(log.has_odometry);
    EXPECT_THAT(log.notes, Contains(HasSubstr("clock was set back")));
  }
}

// Of a laser that nobody stamps the times of recording are known only, which
// are those of the ends of its scans.
TEST(BagLogTest, ScansWithoutStampsTellWhenTheyWereTaken) {
  const Log right = ReadSlowDrive(0, 0);
  std::vector<BagRecord> records =
      SimulatedMessages(SlowDrive(), Laser(), kRos1);
  std::string why;
  for (BagRecord& record : records) {
    if (record.topic != "/scan") continue;
    LaserScanMessage scan;
    ASSERT_TRUE(DecodeLaserScan(record.data, kRos1, &scan, &why)) << why;
    scan.header.stamp = 0;
    record.data = EncodeLaserScan(scan, kRos1);
    record.time += kSecond;
  }
  const Log log = ReadBytes(MakeRosbag1(records));
  ASSERT_EQ(log.scans.size(), right.scans.size());
  EXPECT_THAT(log.notes, Contains(HasSubstr("after they were taken")));
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    ASSERT_LT(
        (log.scans[i].odometry - right.scans[i].odometry).head<2>().norm(),
        0.05)
        << i;
  }
}

// What cannot be told is said; time stamps that overlap are believed.
TEST(BagLogTest, ClocksThatNothingTellsApartAreLeft) {
  const Log right = ReadSlowDrive(0, 0);
  const Log log = ReadSlowDrive(2 * kSecond, 0, false);
  ASSERT_EQ(log.scans.size(), right.scans.size());
  EXPECT_EQ(log.scans[20].odometry, right.scans[20].odometry);
  EXPECT_THAT(log.notes, Contains(AllOf(HasSubstr("2.000 s sooner"),
                                        HasSubstr("believed"))));
}

TEST(BagLogTest, YawRatesServeWhereThereIsNoOdometry) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 5; ++i) {
    ImuMessage imu;
    imu.header = {kBagStart + i * kSecond / 10, "imu"};
    imu.yaw_rate = 0.1 * i;
    records.push_back(
        {"/imu", "sensor_msgs/Imu", imu.header.stamp, EncodeImu(imu, kCdr)});
    records.push_back(Record(PlainScan(imu.header.stamp), kCdr));
  }
  const Log log = ReadBytes(MakeMcap(records));
  EXPECT_FALSE(log.has_odometry);
  ASSERT_EQ(log.yaw_rates.size(), 5u);
  EXPECT_NEAR(log.yaw_rates[3].rate, 0.3, 1e-12);
  EXPECT_EQ(log.yaw_rate_source, "/imu");
}

// The sensor of a camera stands on its side, and says more.
TEST(BagLogTest, YawRatesAreThoseOfASensorThatLiesLevel) {
  for (const bool is_known : {true, false}) {
    std::vector<BagRecord> records;
    if (is_known) {
      for (const char* frame : {"camera", "imu"}) {
        TransformMessage mount =
            Transform(kBagStart, "base_link", frame, Pose2::Zero());
        if (frame == std::string("camera")) {
          mount.transform.qx = mount.transform.qw = std::sqrt(0.5);
        }
        records.push_back(TfRecord(mount, kCdr, "/tf_static"));
      }
    }
    for (int i = 0; i < 10; ++i) {
      for (const char* frame : {"camera", "imu"}) {
        if (frame == std::string("imu") && i % 2 == 1) continue;
        ImuMessage imu;
        imu.header = {kBagStart + i * kSecond / 10, frame};
        imu.yaw_rate = 0.1 * i;
        records.push_back({std::string("/") + frame + "/data",
                           "sensor_msgs/Imu", imu.header.stamp,
                           EncodeImu(imu, kCdr)});
      }
      records.push_back(Record(PlainScan(kBagStart + i * kSecond / 10), kCdr));
    }
    const Log log = ReadBytes(MakeMcap(records));
    EXPECT_EQ(log.yaw_rate_source, is_known ? "/imu/data" : "/camera/data");
    EXPECT_EQ(log.yaw_rates.size(), is_known ? 5u : 10u);
    EXPECT_THAT(log.topics,
                Contains(Field(&LogTopic::why_not,
                               HasSubstr(is_known ? "tilted" : "more"))));
  }
}

// Bad input.

TEST(BadBagTest, OldVersionIsRefusedByName) {
  EXPECT_THAT(WhatOf("#ROSBAG V1.2\nsomething"),
              AllOf(HasSubstr("version 1.2"), HasSubstr("2.0")));
}

// SQLite needs a file: what is compressed is unpacked into one, which goes
// whether or not there was room for it.
TEST(BadBagTest, UnpackedDatabasesLeaveNothing) {
  const Folder folder;
  WriteRosbag2(SmallDrive(kCdr), folder / "whole");
  std::ifstream file(folder / "whole/whole_0.db3", std::ios::binary);
  std::stringstream whole;
  whole << file.rdbuf();
  const std::string path = folder / "bag.db3.gz";
  gzFile packed = gzopen(path.c_str(), "wb");
  gzwrite(packed, whole.str().data(),
          static_cast<unsigned>(whole.str().size()));
  gzclose(packed);
  const std::string temporary = folder / "temporary";
  fs::create_directories(temporary);
  setenv("TMPDIR", temporary.c_str(), 1);
  EXPECT_FALSE(ReadPath(path).scans.empty());
  EXPECT_TRUE(fs::is_empty(temporary));
  // No room.
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = 4096;
  setrlimit(RLIMIT_FSIZE, &small);
  std::string what;
  try {
    ReadPath(path);
  } catch (const Error& error) {
    what = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(what, AllOf(HasSubstr("cannot be written"), HasSubstr("TMPDIR")));
  EXPECT_TRUE(fs::is_empty(temporary));
  unsetenv("TMPDIR");
}

TEST(BadBagTest, IndexThatLiesAboutItsSizeIsSurvived) {
  BagWriterOptions options;
  options.chunk_size = 700;
  std::string bag = MakeRosbag1(SmallDrive(kRos1), options);
  // The size behind the first index's header.
  const std::size_t op = bag.find("op=\x04");
  ASSERT_NE(op, std::string::npos);
  const std::size_t size = bag.find("ver=", op) + 8;
  ASSERT_LT(static_cast<unsigned char>(bag[size]), 128);
  bag[size] = static_cast<char>(bag[size] + 100);
  const Log log = ReadBytes(bag);
  EXPECT_EQ(log.scans.size(), 10u);
  EXPECT_EQ(SkippedInBag(log, "index that states another size"), 1);
}

TEST(BadBagTest, ChunkThatLiesAboutItsSizeIsSurvived) {
  for (const char* compression : {"bz2", "lz4"}) {
    for (const int difference : {-30, 40}) {
      SCOPED_TRACE(std::string(compression) + std::to_string(difference));
      BagWriterOptions options;
      options.compression = compression;
      options.chunk_size = 700;
      std::string bag = MakeRosbag1(SmallDrive(kRos1), options);
      const std::size_t place = bag.find("size=", bag.find("op=\x05")) + 9;
      std::uint32_t size = 0;
      std::memcpy(&size, &bag[place], 4);
      size = static_cast<std::uint32_t>(static_cast<int>(size) + difference);
      std::memcpy(&bag[place], &size, 4);
      const Log log = ReadBytes(bag);
      EXPECT_EQ(log.scans.size(), 10u);
      EXPECT_GE(SkippedInBag(log, "states another size"), 1);
    }
  }
}

TEST(BadBagTest, DamagedChunksAreCounted) {
  for (const char* compression : {"none", "lz4", "zstd"}) {
    SCOPED_TRACE(compression);
    BagWriterOptions options;
    options.compression = compression;
    options.chunk_size = 700;
    options.index = false;
    std::string bag = MakeMcap(SmallDrive(kCdr), options);
    bag[bag.size() / 2] = static_cast<char>(bag[bag.size() / 2] ^ 0x55);
    const Log log = ReadBytes(bag);
    EXPECT_LT(log.scans.size(), 10u);
    EXPECT_GT(log.scans.size(), 3u);
    EXPECT_THAT(log.skipped,
                Contains(Field(&SkipReport::reason, HasSubstr("chunk"))));
  }
}

TEST(BadBagTest, UnknownCompressionIsCounted) {
  std::string bag = MakeRosbag1(SmallDrive(kRos1));
  const std::size_t place = bag.find("compression=none");
  bag.replace(place, 16, "compression=rar5");
  EXPECT_THAT(WhatOf(bag), AllOf(HasSubstr("unknown compression 'rar5'"),
                                 HasSubstr("none, bz2 and lz4 are known")));
  BagWriterOptions options;
  options.compression = "zstd";
  bag = MakeMcap(SmallDrive(kCdr), options);
  bag.replace(bag.find("zstd"), 4, "rar5");
  EXPECT_THAT(WhatOf(bag), HasSubstr("unknown compression 'rar5'"));
}

TEST(BadBagTest, FourGibibyteLengthsAreSurvived) {
  // Of every place where a length may stand: nothing crashes, nothing is taken
  // into memory that is not there.
  const std::vector<std::string> bags = {
      MakeRosbag1({Record(PlainScan(kBagStart), kRos1),
                   Record(PlainScan(kBagStart + kSecond), kRos1)}),
      MakeMcap({Record(PlainScan(kBagStart), kCdr),
                Record(PlainScan(kBagStart + kSecond), kCdr)})};
  for (const std::string& bag : bags) {
    const std::size_t begin = bag.size() > 4109 ? 4109 : 8;
    for (std::size_t i = begin; i + 4 <= std::min(bag.size(), begin + 900);
         ++i) {
      std::string changed = bag;
      changed.replace(i, 4, "\xff\xff\xff\xff");
      WhatOf(changed);
    }
  }
}

TEST(BadBagTest, MessagesWithoutBytesAreCounted) {
  std::vector<BagRecord> records = SmallDrive(kCdr);
  records.push_back({"/scan", "sensor_msgs/LaserScan", kBagStart, ""});
  records.push_back({"/odom", "nav_msgs/Odometry", kBagStart, ""});
  records.push_back({"/tf_static", "tf2_msgs/TFMessage", kBagStart, ""});
  // And one in another representation.
  records.push_back({"/scan", "sensor_msgs/LaserScan", kBagStart,
                     std::string("\0\x07\0\0rest", 8)});
  const Log log = ReadBytes(MakeMcap(records));
  EXPECT_EQ(log.scans.size(), 10u);
  EXPECT_EQ(SkippedInBag(log, "LaserScan on /scan that has no bytes"), 1);
  EXPECT_EQ(SkippedInBag(log, "Odometry on /odom that has no bytes"), 1);
  EXPECT_EQ(SkippedInBag(log, "TFMessage on /tf_static that has no bytes"), 1);
  EXPECT_EQ(SkippedInBag(log, "no plain CDR"), 1);
}

TEST(BadBagTest, TopicsOfAnotherTypeAndDefinition) {
  std::vector<BagRecord> records = SmallDrive(kRos1);
  records.push_back({"/points", "sensor_msgs/PointCloud2", kBagStart, "junk"});
  EXPECT_EQ(ReadBytes(MakeRosbag1(records)).scans.size(), 10u);
  std::string bag = MakeRosbag1(SmallDrive(kRos1));
  const std::string md5 = "90c7ef2dc6895d81024acba2ac42f369";
  for (std::size_t i = 0; (i = bag.find(md5, i)) != std::string::npos;) {
    bag[i] = '8';
  }
  EXPECT_THAT(WhatOf(bag), HasSubstr("another definition"));
}

TEST(BadBagTest, McapWithoutASchema) {
  std::string bag = MakeMcap({Record(PlainScan(kBagStart), kCdr)});
  // The channel's record: opcode 4, length, its number, the schema's.
  const std::size_t topic = bag.find("/scan", bag.find("cdr") - 20);
  const std::size_t schema = topic - 4 - 2;
  bag[schema] = 9;
  // Chunks have checksums.
  const std::size_t chunk = bag.find('\x06', 30);
  for (std::size_t i = 0; i < 4; ++i) bag[chunk + 9 + 24 + i] = 0;
  EXPECT_THAT(WhatOf(bag), HasSubstr("no schema says what type"));
}

TEST(BadBagTest, AbsurdAnglesAndPosesAreCounted) {
  std::vector<BagRecord> records = SmallDrive(kRos1);
  LaserScanMessage scan = PlainScan(kBagStart + 2 * kSecond);
  scan.angle_increment = 100.0;
  records.push_back(Record(scan, kRos1));
  scan = PlainScan(kBagStart + 2 * kSecond);
  scan.ranges.clear();
  records.push_back(Record(scan, kRos1));
  OdometryMessage odometry;
  odometry.header = {kBagStart, "odom"};
  odometry.pose.x = std::nan("");
  records.push_back({"/odom", "nav_msgs/Odometry", kBagStart,
                     EncodeOdometry(odometry, kRos1)});
  const Log log = ReadBytes(MakeRosbag1(records));
  EXPECT_EQ(log.scans.size(), 10u);
  EXPECT_EQ(SkippedInBag(log, "absurd angles"), 1);
  EXPECT_EQ(SkippedInBag(log, "no readings"), 1);
  EXPECT_EQ(SkippedInBag(log, "has no pose"), 1);
}

// A step of 0 is taken from the stated end; without one there is no scan.
TEST(BadBagTest, ScansWithoutAnAngleBetweenBeamsAreCounted) {
  std::vector<BagRecord> records = SmallDrive(kRos1);
  const std::size_t before = ReadBytes(MakeRosbag1(records)).scans.size();
  LaserScanMessage scan = PlainScan(kBagStart + 19 * kSecond / 20);
  scan.angle_increment = 0.0;
  records.push_back(Record(scan, kRos1));
  scan = PlainScan(kBagStart + 19 * kSecond / 20);
  scan.angle_increment = 0.0;
  scan.angle_max = scan.angle_min;
  records.push_back(Record(scan, kRos1));
  scan = PlainScan(kBagStart + 19 * kSecond / 20);
  scan.angle_increment = std::nan("");
  records.push_back(Record(scan, kRos1));
  const Log log = ReadBytes(MakeRosbag1(records));
  ASSERT_EQ(log.scans.size(), before + 1);
  EXPECT_NEAR(log.scans.back().angle_step, 0.5, 1e-6);
  EXPECT_EQ(SkippedInBag(log, "absurd angles"), 2);
}

TEST(BadBagTest, FolderWithoutItsFiles) {
  const Folder folder;
  fs::create_directories(folder / "bag");
  WriteText(folder / "bag/metadata.yaml",
            "rosbag2_bagfile_information:\n  relative_file_paths:\n"
            "    - gone_0.db3\n");
  try {
    ReadPath(folder / "bag");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("gone_0.db3"));
  }
}

// Real bags.

std::string Dataset(const std::string& name) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  if (folder == nullptr) return "";
  const std::string path = std::string(folder) + "/bags/" + name;
  return fs::exists(path) ? path : "";
}

TEST(RealBagTest, Turtlebot3) {
  const std::string path = Dataset("ros1/turtlebot3.bag");
  if (path.empty()) GTEST_SKIP() << "PLUMBLINE_DATASETS has no bags";
  const Log log = ReadPath(path);
  EXPECT_EQ(log.scans.size(), 457u);
  EXPECT_EQ(log.messages.at("/odom"), 2741);
  EXPECT_TRUE(log.has_odometry);
  EXPECT_THAT(log.skipped, IsEmpty());
  EXPECT_EQ(log.scans[0].ranges.size(), 360u);
}

TEST(RealBagTest, SlowHalfHallway) {
  const std::string path = Dataset("ros2/slow_half_hallway");
  if (path.empty()) GTEST_SKIP() << "PLUMBLINE_DATASETS has no bags";
  const Log log = ReadPath(path);
  EXPECT_EQ(log.scans.size(), 789u);
  EXPECT_EQ(log.yaw_rates.size(), 3369u);
  EXPECT_FALSE(log.has_odometry);
  EXPECT_THAT(log.skipped, IsEmpty());
}

TEST(RealBagTest, OthersAreRefusedWithWhatTheyHold) {
  if (Dataset("ros1").empty()) {
    GTEST_SKIP() << "PLUMBLINE_DATASETS has no bags";
  }
  for (const auto& [name, holds] :
       std::vector<std::pair<std::string, std::string>>{
           {"ros1/example.bag", "/tf (tf/tfMessage, 2688)"},
           {"ros1/example-bz2.bag", "/tf (tf/tfMessage, 2688)"},
           {"ros1/example-lz4.bag", "/tf (tf/tfMessage, 2688)"},
           {"ros1/no-messages.bag", "no topics"},
           {"ros1/tf_example.bag", "/tf (tf2_msgs/TFMessage, 517)"},
           {"ros2/tf_example", "/tf (tf2_msgs/TFMessage, 517)"},
           {"ros2/nav2_turtlebot.mcap", "/odom (nav_msgs/Odometry, 2639)"}}) {
    try {
      ReadPath(Dataset(name));
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(holds)) << name;
    }
  }
}

}  // namespace
}  // namespace plumbline
