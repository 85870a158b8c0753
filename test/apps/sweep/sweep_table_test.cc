#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/sweep/sweep_table.h>
#include <plumbline/core/error.h>

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Runs x = 1, 2, 3 with two seeds each; figure y, and others on some.
SweepResult ResultOf(const std::vector<double>& y) {
  SweepResult result;
  result.definition.axes = {{"x", {"1", "2", "3"}}};
  result.definition.trials = 2;
  result.runs = MakeRuns(result.definition);
  for (const double value : y) {
    RunRecord record;
    record.status = RunStatus::kDone;
    record.figures = {{"y", value}};
    result.records.emplace_back(record);
  }
  result.records.resize(result.runs.size());
  return result;
}

TEST(SweepTableTest, ARowARunThatHasARecord) {
  SweepResult result = ResultOf({1.0, 0.1});
  result.records[0]->figures = {{"seed", 1.0},
                                {"flags.x", 1.0},
                                {"x", 9.0},
                                {"y", 1.0},
                                {"time_s.all", 2.5}};
  result.records[1]->figures.emplace_back("a,b", 1e20);
  RunRecord failed;
  failed.reason = "said \"no\", and ended";
  result.records[3] = failed;
  std::ostringstream table;
  WriteSweepTable(result, true, table);
  EXPECT_EQ(table.str(),
            "run,x,seed,status,reason,summary.x,y,time_s.all,\"a,b\"\n"
            "\"x=1,seed=1\",1,1,done,,9,1,2.5,\n"
            "\"x=1,seed=2\",1,2,done,,,0.1,,1e+20\n"
            "\"x=2,seed=2\",2,2,failed,\"said \"\"no\"\", and ended\",,,,\n");
  std::ostringstream without;
  WriteSweepTable(result, false, without);
  EXPECT_THAT(without.str(), HasSubstr("summary.x,y,\"a,b\"\n"));
}

TEST(SweepTableTest, NumbersReadBack) {
  EXPECT_EQ(TableNumber(100000.0), "100000");
  EXPECT_EQ(TableNumber(-3.0), "-3");
  EXPECT_EQ(TableNumber(0.1), "0.1");
  EXPECT_EQ(TableNumber(1e-7), "1e-07");
  EXPECT_EQ(TableNumber(1e300), "1e+300");
}

TEST(SweepTableTest, SettingsGatherTheirRuns) {
  const SweepResult result = ResultOf({1.0, 2.0, 3.0});
  const std::vector<SweepSetting> settings = Settings(result);
  ASSERT_EQ(settings.size(), 3u);
  EXPECT_THAT(settings[1].values, ElementsAre("2"));
  EXPECT_THAT(settings[1].runs, ElementsAre(2u, 3u));
  EXPECT_EQ(settings[0].done, 2);
  EXPECT_EQ(settings[1].done, 1);
  const std::vector<double> values = FigureValues(result, settings[1], "y");
  EXPECT_EQ(values[0], 3.0);
  EXPECT_TRUE(std::isnan(values[1]));
  EXPECT_EQ(MeanOfNumbers(values).value, 3.0);
}

TEST(SweepTableTest, TheBestIsPairedBySeed) {
  // Means 2, 1.5, 1; the differences from the third: 1 and 1; -1 and 2.
  const SweepResult result = ResultOf({1.0, 3.0, -1.0, 4.0, 0.0, 2.0});
  const std::optional<BestSetting> least = FindBest(result, "y", true);
  ASSERT_TRUE(least);
  EXPECT_EQ(least->setting, 2u);
  EXPECT_EQ(least->mean.value, 1.0);
  EXPECT_THAT(least->equals, ElementsAre(1u));
  const std::optional<BestSetting> most = FindBest(result, "y", false);
  ASSERT_TRUE(most);
  EXPECT_EQ(most->setting, 0u);
}

TEST(SweepTableTest, WhatIsNotWholeDoesNotWin) {
  const SweepResult result = ResultOf({1.0, 3.0, 0.0});
  const std::optional<BestSetting> best = FindBest(result, "y", true);
  ASSERT_TRUE(best);
  EXPECT_EQ(best->setting, 0u);
  EXPECT_THAT(best->equals, IsEmpty());
  EXPECT_FALSE(FindBest(ResultOf({1.0}), "y", true));
  EXPECT_FALSE(FindBest(ResultOf({}), "y", true));
  try {
    FindBest(result, "z", true);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no run has a figure 'z'"));
    EXPECT_THAT(error.what(), HasSubstr("one of y"));
  }
}

TEST(SweepTableTest, TimesAreToldByTheirNames) {
  EXPECT_TRUE(IsMeasuredResource("time_s.total"));
  EXPECT_TRUE(IsMeasuredResource("peak_memory_bytes"));
  EXPECT_TRUE(IsMeasuredResource("frontend.scan_seconds_growth"));
  EXPECT_FALSE(IsMeasuredResource("cost.total"));
  EXPECT_FALSE(IsMeasuredResource("em.iterations"));
}

}  // namespace
}  // namespace plumbline
