#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/csv_reader.h>

#include <string>
#include <vector>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Log ReadCsv(const std::string& text, const LaserOptions& options = {}) {
  InputStream input("scans.csv", text);
  return ReadCsvLog(&input, options);
}

std::string WhyNot(const std::string& text, const LaserOptions& options = {}) {
  return Refusal([&] { ReadCsv(text, options); });
}

const char kHeader[] = "time,start_angle,angle_step,r0,r1,r2\n";

TEST(CsvReaderTest, ReadsColumnsInAnyOrder) {
  const Log log = ReadCsv(
      "# of a robot\n"
      "r1, r0 ,laser_theta,theta,y,x,time,angle_step,start_angle,max_range,"
      "laser_x,laser_y,battery\r\n"
      "2.5,1.5,0.1,0.5,-1,3,12.25,0.5,-0.25,10,0.2,-0.1,full\r\n"
      "\n"
      "# pause\n"
      "2,1,0.1,0.5,-1,3.5,12.5,0.5,-0.25,10,0.2,-0.1,empty\n");
  EXPECT_EQ(log.format, "CSV of scans");
  EXPECT_TRUE(log.has_odometry);
  EXPECT_EQ(log.odometry_source, "x, y, theta");
  EXPECT_THAT(log.skipped, IsEmpty());
  EXPECT_THAT(log.notes, ElementsAre(HasSubstr("not used: battery")));
  ASSERT_EQ(log.scans.size(), 2u);
  const Scan& scan = log.scans[0];
  EXPECT_EQ(scan.timestamp, 12.25);
  EXPECT_EQ(scan.timestamp_text, "12.25");
  EXPECT_EQ(scan.odometry, Pose2(3.0, -1.0, 0.5));
  EXPECT_EQ(scan.laser_offset, Pose2(0.2, -0.1, 0.1));
  EXPECT_EQ(scan.start_angle, -0.25);
  EXPECT_EQ(scan.angle_step, 0.5);
  EXPECT_EQ(scan.maximum_range, 10.0);
  EXPECT_THAT(scan.ranges, ElementsAre(1.5f, 2.5f));
  EXPECT_EQ(scan.line, 3);
  EXPECT_EQ(log.scans[1].line, 6);
}

TEST(CsvReaderTest, DoesWithoutOdometryAndPlace) {
  const Log log =
      ReadCsv(std::string(kHeader) + "1,-1,1,2,3,4\n2,-1,1,2,3,4\n");
  EXPECT_FALSE(log.has_odometry);
  EXPECT_EQ(log.odometry_source, "");
  EXPECT_EQ(log.scans[1].laser_offset, Pose2(0.0, 0.0, 0.0));
  EXPECT_EQ(log.scans[1].maximum_range, 80.0);
}

TEST(CsvReaderTest, OptionsReplaceColumns) {
  LaserOptions options;
  options.laser_start_angle = -0.5;
  options.laser_step = 0.25;
  options.laser_max_range = 3.5;
  const Log log = ReadCsv("time,r0,r1\n1,3,4\n", options);
  EXPECT_EQ(log.scans[0].start_angle, -0.5);
  EXPECT_EQ(log.scans[0].angle_step, 0.25);
  EXPECT_THAT(log.scans[0].ranges, ElementsAre(3.0f, 0.0f));
}

TEST(CsvReaderTest, WhatIsNoReturn) {
  const Log log = ReadCsv(
      "time,start_angle,angle_step,max_range,r0,r1,r2,r3,r4,r5,r6,r7\n"
      "1,-1,0.1,10,,nan,inf,0,-1,10,none,9.9\n");
  EXPECT_THAT(log.scans[0].ranges,
              ElementsAre(0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 9.9f));
}

TEST(CsvReaderTest, TurnsClockwiseScans) {
  const Log log =
      ReadCsv("time,start_angle,angle_step,r0,r1,r2\n1,1,-1,2,3,4\n");
  EXPECT_EQ(log.scans[0].start_angle, -1.0);
  EXPECT_EQ(log.scans[0].angle_step, 1.0);
  EXPECT_THAT(log.scans[0].ranges, ElementsAre(4.0f, 3.0f, 2.0f));
}

TEST(CsvReaderTest, TimeThatJumpsBackIsCounted) {
  const Log log =
      ReadCsv(std::string(kHeader) + "5,-1,1,2,3,4\n3.5,-1,1,2,3,4\n");
  EXPECT_EQ(log.time_reversals, 1);
  EXPECT_EQ(log.largest_time_reversal, 1.5);
}

TEST(CsvReaderTest, HeadersThatCannotBe) {
  EXPECT_THAT(WhyNot("start_angle,angle_step,r0\n1,2,3\n"),
              HasSubstr("scans.csv:1: no column 'time'"));
  EXPECT_THAT(WhyNot("time,start_angle,angle_step\n1,2,3\n"),
              HasSubstr("no column 'r0'"));
  EXPECT_THAT(WhyNot("time,start_angle,angle_step,r0,r2\n"),
              HasSubstr("no column 'r1'"));
  EXPECT_THAT(WhyNot("time,start_angle,angle_step,r0,r0\n"),
              HasSubstr("two columns 'r0'"));
  EXPECT_THAT(WhyNot("time,time,start_angle,angle_step,r0\n"),
              HasSubstr("two columns 'time'"));
  EXPECT_THAT(WhyNot("time,angle_step,r0\n"), HasSubstr("--laser_start_angle"));
  EXPECT_THAT(WhyNot("time,start_angle,r0\n"), HasSubstr("--laser_step"));
  EXPECT_THAT(WhyNot("time,start_angle,angle_step,x,y,r0\n"),
              HasSubstr("x, y or theta"));
  EXPECT_THAT(WhyNot(kHeader), HasSubstr("no line is a scan"));
  EXPECT_THAT(WhyNot("# nothing\n"), HasSubstr("no line names columns"));
  EXPECT_THAT(WhyNot(""), HasSubstr("no line names columns"));
  // No number of a column can be that large.
  EXPECT_THAT(WhyNot("time,start_angle,angle_step,r99999999999999999999\n"),
              HasSubstr("no column 'r0'"));
}

TEST(CsvReaderTest, PassesOverLinesThatCannotBe) {
  const Log log = ReadCsv(
      "time,start_angle,angle_step,x,y,theta,max_range,r0,r1\n"
      "1,-1,1,0,0,0,10,2,3\n"
      "2,-1,1,0,0,0,10,2\n"
      "3,-1,1,0,0,0,10,2,3,4\n"
      "x,-1,1,0,0,0,10,2,3\n"
      "nan,-1,1,0,0,0,10,2,3\n"
      "6,-1,0,0,0,0,10,2,3\n"
      "7,-1,9,0,0,0,10,2,3\n"
      "8,-1e9,1,0,0,0,10,2,3\n"
      "9,-1,1,inf,0,0,10,2,3\n"
      "10,-1,1,1e300,0,0,10,2,3\n"
      "11,-1,1,0,0,0,0,2,3\n"
      "12,-1,1,0,0,1e400,10,2,3\n"
      "13,-1,1,1,0,0,10,2,3");
  ASSERT_EQ(log.scans.size(), 2u);
  EXPECT_EQ(log.scans[1].timestamp, 13.0);
  EXPECT_EQ(log.messages.at("scan"), 2);
  std::int64_t skipped = 0;
  for (const SkipReport& skip : log.skipped) skipped += skip.count;
  EXPECT_EQ(skipped, 11);
  EXPECT_THAT(log.skipped[0].reason, HasSubstr("number of cells"));
  EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(3, 4));
}

TEST(CsvReaderTest, ARefusalSaysWhatWasWrongWithTheLines) {
  EXPECT_THAT(WhyNot(std::string(kHeader) + "1,2\n"),
              HasSubstr("number of cells"));
}

// As they come from Unix, Windows and old Macs.
TEST(CsvReaderTest, LinesEndInThreeWays) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    SCOPED_TRACE(end.size());
    const std::string text =
        "# of a robot" + end + end + "time,start_angle,angle_step,r0,r1,r2" +
        end + "1,-1,1,2,3,4" + end + "2,-1,1,2,3" + end + "3,-1,1,2,3,";
    EXPECT_TRUE(LooksLikeCsvLog(text));
    for (const std::string& last : {std::string(), end}) {
      const Log log = ReadCsv(text + last);
      ASSERT_EQ(log.scans.size(), 2u);
      EXPECT_THAT(log.scans[0].ranges, ElementsAre(2.0f, 3.0f, 4.0f));
      EXPECT_THAT(log.scans[1].ranges, ElementsAre(2.0f, 3.0f, 0.0f));
      EXPECT_EQ(log.scans[1].line, 6);
      ASSERT_EQ(log.skipped.size(), 1u);
      EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(5));
    }
  }
}

// As R and spreadsheets write them.
TEST(CsvReaderTest, QuotesSemicolonsTabsAndDecimalCommas) {
  for (const std::string text :
       {"\"time\",\"start_angle\",\"angle_step\",\"r0\",\"r1\",\"r2\"\n"
        "\"1.25\",-1,1,2.5,3,NA\n",
        "time;start_angle;angle_step;r0;r1;r2\n1,25;-1;1;2,5;3;\n",
        "time\tstart_angle\tangle_step\tr0\tr1\tr2\n1.25\t-1\t1\t2.5\t3\t\n"}) {
    SCOPED_TRACE(text);
    EXPECT_TRUE(LooksLikeCsvLog(text));
    const Log log = ReadCsv(text);
    ASSERT_EQ(log.scans.size(), 1u);
    EXPECT_EQ(log.scans[0].timestamp, 1.25);
    EXPECT_EQ(log.scans[0].timestamp_text, "1.25");
    EXPECT_EQ(log.scans[0].start_angle, -1.0);
    EXPECT_THAT(log.scans[0].ranges, ElementsAre(2.5f, 3.0f, 0.0f));
    EXPECT_TRUE(log.skipped.empty());
  }
  EXPECT_THAT(WhyNot("time;start_angle;angle_step;r0;r1\n1,2,5;-1;1;2;3\n"),
              HasSubstr("not a finite number"));
}

// A comma in quotes separates nothing, and quotes in quotes are doubled.
TEST(CsvReaderTest, SeparatorsInQuotesSeparateNothing) {
  const Log log = ReadCsv(
      "\"a, b\",time,start_angle,angle_step, \"r0\" ,r1,\"the \"\"end\"\"\"\n"
      "\"left, right\",1,-1,1,2,3,\"a \"\"b\"\", c\"\n"
      "\"\"\"\",2,-1,1, \"2\" ,3,\"\"\n"
      "left, right,3,-1,1,2,3,c\n"
      "x,4,-1,1,2,3,\"not closed, c\n"
      "x,5,-1,1,\"2,3,c\n");
  ASSERT_EQ(log.scans.size(), 3u);
  EXPECT_THAT(log.scans[0].ranges, ElementsAre(2.0f, 3.0f));
  EXPECT_THAT(log.scans[1].ranges, ElementsAre(2.0f, 3.0f));
  EXPECT_EQ(log.scans[2].timestamp, 4.0);
  EXPECT_THAT(log.notes, ElementsAre(HasSubstr("not used: a, b, the \"end\"")));
  ASSERT_EQ(log.skipped.size(), 1u);
  EXPECT_THAT(log.skipped[0].reason, HasSubstr("number of cells"));
  EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(4, 6));

  const Log tabs = ReadCsv(
      "time\tr0\tnote\tstart_angle\tangle_step\n1\t2\t\"a\tb\"\t-1\t1\n"
      "2\t2\t\t-1\t1\n");
  EXPECT_EQ(tabs.scans.size(), 2u);
  EXPECT_TRUE(LooksLikeCsvLog("\"x; y\",time,r0\n"));
}

// Not a reading of the laser, and not one that is missing: it cannot be told
// what the others on the line are.
TEST(CsvReaderTest, RangesThatAreTextAreCounted) {
  const Log log = ReadCsv(std::string(kHeader) +
                          "1,-1,1,2,3,4\n"
                          "2,-1,1,abc,3,4\n"
                          "3,-1,1,2,1.2.3,4\n"
                          "4,-1,1,2,\"1,5\",4\n"
                          "5,-1,1,2,none of it,4\n"
                          "+6,-1,1,NA,+3,Null\n"
                          "7,-1,1,-inf,1e999,N/A\n"
                          "8,-1,1,-inf,1e999,NaN\n");
  ASSERT_EQ(log.scans.size(), 3u);
  EXPECT_THAT(log.scans[1].ranges, ElementsAre(0.0f, 3.0f, 0.0f));
  EXPECT_EQ(log.scans[1].timestamp_text, "6");
  EXPECT_THAT(log.scans[2].ranges, ElementsAre(0.0f, 0.0f, 0.0f));
  ASSERT_EQ(log.skipped.size(), 1u);
  EXPECT_EQ(log.skipped[0].count, 5);
  EXPECT_THAT(log.skipped[0].reason, HasSubstr("a range that is text"));
  EXPECT_THAT(log.skipped[0].first_lines, ElementsAre(3, 4, 5, 6, 8));
}

TEST(CsvReaderTest, IsRecognizedByItsColumns) {
  EXPECT_TRUE(LooksLikeCsvLog("# c\n\n x , time,r0\r\n"));
  EXPECT_TRUE(LooksLikeCsvLog("time,r0"));
  EXPECT_FALSE(LooksLikeCsvLog("time,x,y\nr0"));
  EXPECT_FALSE(LooksLikeCsvLog("FLASER 2 1 2\n"));
  EXPECT_FALSE(LooksLikeCsvLog(""));
  Registry registry;
  RegisterBuiltinLogReaders(&registry);
  const LogReaderType* reader = RecognizeLog(registry, kHeader);
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->name, "csv");
}

// Cut anywhere: a log of what is whole, or a refusal.
TEST(CsvReaderTest, CutAnywhere) {
  const std::string text =
      std::string(kHeader) + "1,-1,1,2,3,4\n2,-1,1,2,3,4\n";
  for (std::size_t size = 0; size <= text.size(); ++size) {
    const std::string part = text.substr(0, size);
    // The last cell of a line may be empty.
    EXPECT_EQ(WhyNot(part) == "accepted",
              size >= std::string(kHeader).size() + 11)
        << size;
  }
}

}  // namespace
}  // namespace plumbline
