#include <gtest/gtest.h>
#include <plumbline/frontend/carmen_messages.h>

#include <cmath>
#include <string>

namespace plumbline {
namespace {

TEST(CarmenTokensTest, SplitsAtBlanks) {
  CarmenTokens tokens(" FLASER\t 2  1.5 +2e1\r");
  EXPECT_EQ(tokens.Count(), 4);
  EXPECT_EQ(tokens.Next(), "FLASER");
  int count = 0;
  EXPECT_TRUE(tokens.NextInt(&count));
  EXPECT_EQ(count, 2);
  double value = 0.0;
  EXPECT_TRUE(tokens.NextDouble(&value));
  EXPECT_EQ(value, 1.5);
  EXPECT_FALSE(tokens.AtEnd());
  EXPECT_TRUE(tokens.NextDouble(&value));
  EXPECT_EQ(value, 20.0);
  EXPECT_TRUE(tokens.AtEnd());
  EXPECT_EQ(tokens.Next(), "");
}

TEST(CarmenTokensTest, NumbersOfLogs) {
  double value = 0.0;
  EXPECT_TRUE(CarmenTokens::Parse("1e-999", &value));
  EXPECT_EQ(value, 0.0);
  EXPECT_TRUE(CarmenTokens::Parse("1e999", &value));
  EXPECT_TRUE(std::isinf(value));
  EXPECT_TRUE(CarmenTokens::Parse("nan", &value));
  for (const char* text : {"", "0x10", "+-1", "1,5", "12a"}) {
    EXPECT_FALSE(CarmenTokens::Parse(text, &value)) << text;
  }
}

TEST(CarmenMessagesTest, ScansByKindOdometryAndParameters) {
  CarmenMessages messages;
  messages.Read("PARAM robot_frontlaser_offset 0.25 1 host 1", 1);
  messages.Read("ODOM 1 2 0.5 0 0 0 10 host 10", 2);
  messages.Read("FLASER 2 1.5 -1 0.2 0 0 0.1 0 0 11.5 host 11", 3);
  messages.Read("RAWLASER1 0 -1.57 3.14 1.57 8 0.01 0 2 3 4 0 12 host 12", 4);
  messages.Read("# a comment", 5);
  EXPECT_EQ(messages.Parameter("robot_frontlaser_offset", 1.0), 0.25);
  EXPECT_EQ(messages.Parameter("robot_rearlaser_offset", 1.0), 1.0);
  ASSERT_EQ(messages.odometry().size(), 1u);
  EXPECT_EQ(messages.odometry()[0].pose, Pose2(1.0, 2.0, 0.5));
  EXPECT_EQ(messages.odometry()[0].timestamp, 10.0);
  const CarmenMessages::Scans& old = messages.scans(CarmenMessages::kFlaser);
  ASSERT_EQ(old.scans.size(), 1u);
  EXPECT_EQ(old.scans[0].line, 3);
  EXPECT_EQ(old.scans[0].timestamp_text, "11.5");
  // -1 is no distance.
  EXPECT_EQ(old.scans[0].ranges, std::vector<float>({1.5f, 0.0f}));
  EXPECT_EQ(old.lasers[0], Pose2(0.2, 0.0, 0.0));
  EXPECT_EQ(old.scans[0].odometry, Pose2(0.1, 0.0, 0.0));
  ASSERT_EQ(messages.scans(CarmenMessages::kRawLaser).scans.size(), 1u);
  EXPECT_EQ(messages.odometry_before(), std::vector<int>({0}));
  EXPECT_EQ(messages.counts().at("FLASER"), 1);
  ASSERT_EQ(messages.skips().reports().size(), 1u);
  EXPECT_EQ(messages.skips().reports()[0].first_lines, std::vector<int>({3}));
}

TEST(CarmenMessagesTest, UnknownNamesAreCountedUpToABound) {
  CarmenMessages messages;
  for (int i = 0; i < 30; ++i) {
    messages.Read("NAME" + std::to_string(i) + " 1", i + 1);
  }
  messages.Read("NAME3 1", 31);
  const std::vector<SkipReport>& reports = messages.skips().reports();
  ASSERT_EQ(reports.size(), 21u);
  EXPECT_EQ(reports[3].count, 2);
  EXPECT_EQ(reports.back().reason, "message that is not used: further names");
  EXPECT_EQ(reports.back().count, 10);
}

}  // namespace
}  // namespace plumbline
