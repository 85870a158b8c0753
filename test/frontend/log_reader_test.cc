#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/log_reader.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

LogReaderType ReaderOf(const std::string& name, char first) {
  LogReaderType type;
  type.name = name;
  type.recognizes = [first](std::string_view prefix) {
    return !prefix.empty() && prefix[0] == first;
  };
  type.read = [](InputStream*, const LaserOptions&) { return Log(); };
  return type;
}

TEST(LogReaderTest, TheFirstByNameThatRecognizes) {
  Registry registry;
  EXPECT_EQ(RecognizeLog(registry, "a log"), nullptr);
  registry.Register(ReaderOf("second", 'a'));
  registry.Register(ReaderOf("first", 'a'));
  registry.Register(ReaderOf("other", 'b'));
  // One that recognizes nothing is asked for by name only.
  LogReaderType by_name = ReaderOf("by_name", 'a');
  by_name.recognizes = nullptr;
  registry.Register(std::move(by_name));
  ASSERT_NE(RecognizeLog(registry, "a log"), nullptr);
  EXPECT_EQ(RecognizeLog(registry, "a log")->name, "first");
  EXPECT_EQ(RecognizeLog(registry, "b log")->name, "other");
  EXPECT_EQ(RecognizeLog(registry, "c log"), nullptr);
}

TEST(LogReaderTest, BuiltinCarmen) {
  Registry registry;
  RegisterBuiltinLogReaders(&registry);
  const LogReaderType* carmen = registry.Find<LogReaderType>("carmen");
  ASSERT_NE(carmen, nullptr);
  RegisterBuiltinLogReaders(&registry);
  EXPECT_EQ(registry.Find<LogReaderType>("carmen"), carmen);

  const std::string text = "FLASER 2 1 2 0 0 0 0 0 0 17.5 host 0\n";
  EXPECT_EQ(RecognizeLog(registry, text), carmen);
  EXPECT_EQ(RecognizeLog(registry, "VERTEX_SE2 0 0 0 0\n"), nullptr);
  InputStream input("two beams", text);
  LaserOptions options;
  options.laser_max_range = 1.5;
  const Log log = carmen->read(&input, options);
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(log.scans[0].timestamp, 17.5);
  // At or above the maximum range there is no return.
  EXPECT_EQ(log.scans[0].ranges, (std::vector<float>{1.0f, 0.0f}));
}

TEST(LogReaderTest, ReadsALogOfAnyKnownFormat) {
  Registry registry;
  const std::string office =
      std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/office.clf.gz";
  const auto refusal = [&registry](const std::string& path) -> std::string {
    try {
      ReadLog(path, registry);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal(office), ::testing::HasSubstr("expected log readers"));
  RegisterBuiltinLogReaders(&registry);
  EXPECT_GT(ReadLog(office, registry).scans.size(), 1000u);
  LaserOptions options;
  options.laser_max_range = 1.0;
  const Log near = ReadLog(office, registry, options);
  for (const float range : near.scans[0].ranges) {
    EXPECT_LT(range, 1.0f);
  }
  EXPECT_THAT(refusal(std::string(PLUMBLINE_SOURCE_DIR) + "/LICENSE"),
              ::testing::EndsWith(
                  "LICENSE: is no log of a known format: expected a log for "
                  "one of the readers carmen, csv, mcap, "
                  "ros1_bag, ros2_bag"));
  EXPECT_THAT(refusal("no/such.log"), ::testing::HasSubstr("no/such.log"));
}

TEST(LogReaderTest, TheLargestReadingThatRepeatsIsNoReturn) {
  Log log;
  for (int k = 0; k < 20; ++k) {
    Scan scan;
    scan.maximum_range = 8.0;
    scan.line = k + 1;
    for (int i = 0; i < 50; ++i) {
      scan.ranges.push_back(
          (i + k) % 50 < 20 ? 4.0f : 1.0f + 0.05f * static_cast<float>(i));
    }
    log.scans.push_back(scan);
  }
  Log told = log;
  LaserOptions options;
  TakeOutRepeatedRange(options, &log);
  ASSERT_EQ(log.skipped.size(), 1u);
  EXPECT_EQ(log.skipped[0].count, 400);
  EXPECT_EQ(log.skipped[0].first_lines.front(), 1);
  EXPECT_THAT(log.skipped[0].reason, ::testing::HasSubstr("4.000 m"));
  EXPECT_EQ(log.scans[7].ranges[5], 0.0f);
  EXPECT_EQ(log.scans[7].ranges[30], told.scans[7].ranges[30]);
  EXPECT_NEAR(log.scans[7].maximum_range, 4.0, 1e-6);

  options.laser_max_range = 8.0;
  TakeOutRepeatedRange(options, &told);
  EXPECT_TRUE(told.skipped.empty());
  EXPECT_EQ(told.scans[7].ranges[5], 4.0f);
}

// A log of 40 scans 0.1 m apart, of which as many in a row have the readings of
// the first of them as `repeats` says.
Log LogOfRepeats(int repeats) {
  Log log;
  for (int k = 0; k < 40; ++k) {
    Scan scan;
    scan.maximum_range = 8.0;
    scan.line = k + 1;
    scan.odometry = Pose2(0.1 * k, 0.0, 0.0);
    for (int i = 0; i < 50; ++i) {
      scan.ranges.push_back(
          1.0f + 0.01f * static_cast<float>((i * (k / repeats + 3)) % 50));
    }
    log.scans.push_back(scan);
  }
  return log;
}

TEST(LogReaderTest, AScanThatRepeatsTheOneBeforeIsNone) {
  Log log = LogOfRepeats(2);
  LeaveOutRepeatedScans(&log);
  ASSERT_EQ(log.scans.size(), 20u);
  EXPECT_EQ(log.scans[1].line, 3);
  EXPECT_EQ(log.scans[19].line, 39);
  ASSERT_EQ(log.skipped.size(), 1u);
  EXPECT_EQ(log.skipped[0].count, 20);
  EXPECT_THAT(log.skipped[0].first_lines,
              ::testing::ElementsAre(2, 4, 6, 8, 10));
}

TEST(LogReaderTest, ScansThatMayRepeatTheOneBeforeStay) {
  // A robot that stands, seen by a laser without noise.
  Log standing = LogOfRepeats(2);
  for (Scan& scan : standing.scans) scan.odometry.setZero();
  LeaveOutRepeatedScans(&standing);
  EXPECT_EQ(standing.scans.size(), 40u);
  // A bare corridor, seen by such a laser.
  Log corridor = LogOfRepeats(40);
  LeaveOutRepeatedScans(&corridor);
  EXPECT_EQ(corridor.scans.size(), 40u);
  // Nothing in sight.
  Log blind = LogOfRepeats(2);
  for (Scan& scan : blind.scans) {
    scan.ranges.assign(scan.ranges.size(), 0.0f);
  }
  LeaveOutRepeatedScans(&blind);
  EXPECT_EQ(blind.scans.size(), 40u);
  Log none;
  LeaveOutRepeatedScans(&none);
  EXPECT_TRUE(none.scans.empty() && none.skipped.empty());
}

}  // namespace
}  // namespace plumbline
