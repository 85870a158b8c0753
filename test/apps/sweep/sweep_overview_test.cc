#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/figures/heat_map.h>
#include <plumbline/apps/sweep/sweep_overview.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "apps/browser.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// y is the sum of the places of all values plus a tenth of the seed.
SweepResult MakeResult(const std::vector<SweepAxis>& axes, int trials,
                       bool one_at_a_time = false) {
  SweepResult result;
  result.definition.axes = axes;
  result.definition.trials = trials;
  result.definition.one_at_a_time = one_at_a_time;
  result.definition.command = {"/bin/program", "<&>"};
  result.runs = MakeRuns(result.definition);
  for (const SweepRun& run : result.runs) {
    double y = 0.1 * static_cast<double>(run.seed);
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const std::vector<std::string>& values = axes[i].values;
      y += static_cast<double>(
          std::find(values.begin(), values.end(), run.values[i]) -
          values.begin());
    }
    RunRecord record;
    record.status = RunStatus::kDone;
    record.figures = {{"same", 1.0},
                      {"time_s.total", y},
                      {"other", 2.0 * y},
                      {"evaluation.t.mean", y + 1.0},
                      {"evaluation.t.max", y + 2.0},
                      {"y", y}};
    result.records.emplace_back(record);
  }
  return result;
}

int Count(const std::string& text, const std::string& part) {
  int count = 0;
  for (std::size_t i = text.find(part); i != std::string::npos;
       i = text.find(part, i + 1)) {
    ++count;
  }
  return count;
}

TEST(SweepOverviewTest, FiguresAreChosen) {
  const SweepResult result = MakeResult({{"x", {"1", "2"}}}, 1);
  EXPECT_THAT(
      ChooseFigures(result, "y", 9),
      ElementsAre("y", "evaluation.t.mean", "other", "evaluation.t.max"));
  EXPECT_THAT(ChooseFigures(result, "", 2),
              ElementsAre("evaluation.t.mean", "other"));
  EXPECT_THAT(ChooseFigures(SweepResult(), "y", 9), IsEmpty());
}

TEST(SweepOverviewTest, OneFlagGivesALineWithABand) {
  const SweepResult result = MakeResult({{"x", {"3", "1", "2"}}}, 3);
  OverviewOptions options;
  options.figures = {"y", "other"};
  std::string svg = OverviewSvg(result, options);
  EXPECT_EQ(Count(svg, "<polygon"), 2);
  EXPECT_EQ(Count(svg, "<polyline"), 2);
  EXPECT_EQ(Count(svg, "<circle"), 6);
  options.figures = {"no such"};
  EXPECT_THROW(OverviewSvg(result, options), Error);
  options.figures = {"y"};
  svg = OverviewSvg(MakeResult({{"x", {"3", "1", "2"}}}, 1), options);
  EXPECT_EQ(Count(svg, "<polygon"), 0);
}

TEST(SweepOverviewTest, NumbersAreToScaleAndWordsAreNot) {
  OverviewOptions options;
  options.figures = {"y"};
  // Over a factor of 20 and more by their logarithms, written as they are.
  const std::string wide =
      OverviewSvg(MakeResult({{"x", {"0.01", "0.1", "1"}}}, 1), options);
  EXPECT_THAT(wide, HasSubstr(">0.01</text>"));
  const std::string words =
      OverviewSvg(MakeResult({{"x", {"frozen", "huber"}}}, 1), options);
  EXPECT_THAT(words, HasSubstr(">frozen</text>"));
  const std::string numbers =
      OverviewSvg(MakeResult({{"x", {"0", "100"}}}, 1), options);
  EXPECT_THAT(numbers, HasSubstr(">20</text>"));
}

TEST(SweepOverviewTest, TwoFlagsGiveAHeatMapWithTheBestFramed) {
  const SweepResult result =
      MakeResult({{"a", {"1", "2"}}, {"b", {"u", "v", "w"}}}, 2);
  OverviewOptions options;
  options.figures = {"y", "other"};
  options.objective = "y";
  options.minimize = false;
  const std::string svg = OverviewSvg(result, options);
  EXPECT_EQ(Count(svg, "<polyline"), 0);
  EXPECT_EQ(Count(svg, "stroke=\"#D55E00\""), 1);
  EXPECT_THAT(svg, HasSubstr("fill=\"" + HeatColor(1.0) + "\""));
}

TEST(SweepOverviewTest, MoreFlagsGiveALineEachAndMapsOfPairs) {
  const std::vector<SweepAxis> axes = {
      {"a", {"1", "2"}}, {"b", {"1", "2"}}, {"c", {"1", "2", "3"}}};
  OverviewOptions options;
  options.figures = {"y"};
  options.objective = "y";
  const SweepResult result = MakeResult(axes, 1);
  EXPECT_EQ(Count(OverviewSvg(result, options), "<polyline"), 3);
  const std::string page = OverviewHtml(result, options);
  EXPECT_EQ(Count(page, "<svg"), 3 + 3);
  EXPECT_EQ(Count(page, "stroke=\"#D55E00\""), 3);

  // One at a time only the plots of lines have all their numbers.
  const SweepResult star = MakeResult(axes, 1, true);
  EXPECT_EQ(Count(OverviewSvg(star, options), "<polyline"), 3);
  EXPECT_EQ(Count(OverviewHtml(star, options), "<svg"), 3);
  // Settings, and runs.
  EXPECT_EQ(Count(OverviewHtml(star, options), "<tr"), 2 * (1 + 5));
}

TEST(SweepOverviewTest, ThePageSaysWhatWentWrong) {
  SweepResult result = MakeResult({{"x", {"1", "2", "3"}}}, 1);
  result.records[1] = RunRecord();
  result.records[1]->reason = "exit <3>";
  result.records[2].reset();
  OverviewOptions options;
  options.figures = {"y"};
  options.objective = "y";
  const std::string page = OverviewHtml(result, options);
  EXPECT_THAT(page, HasSubstr("/bin/program '&lt;&amp;&gt;'"));
  EXPECT_THAT(page, HasSubstr("exit &lt;3&gt;"));
  EXPECT_THAT(page, HasSubstr("not done yet"));
  EXPECT_THAT(page, HasSubstr("class=\"best\""));
  EXPECT_THAT(page, Not(HasSubstr("nan")));
  EXPECT_THAT(page, HasSubstr("href=\"runs/x=2,seed=1/log.txt\""));
}

TEST(SweepOverviewTest, ThePageOpensInABrowser) {
  if (Browser::Find().empty()) GTEST_SKIP() << "Chromium is not installed";
  const std::string folder = ::testing::TempDir() + "sweep_overview_browser";
  std::filesystem::remove_all(folder);
  Browser browser(folder);
  OverviewOptions options;
  options.figures = {"y", "other"};
  options.objective = "y";
  SweepResult result =
      MakeResult({{"a", {"1", "2"}}, {"b", {"1", "2"}}, {"c", {"1", "2"}}}, 3);
  result.definition.evaluate = {"/bin/judge", "{}/trajectory.tum"};
  std::ofstream(folder + "/sweep.html") << OverviewHtml(result, options);
  browser.Open("file://" + folder + "/sweep.html");
  EXPECT_EQ(browser.Evaluate("document.querySelectorAll('svg').length"), 6 + 3);
  EXPECT_EQ(browser.Evaluate("document.querySelectorAll('tr.best').length"), 1);
  EXPECT_EQ(browser.Evaluate(
                "document.body.scrollWidth <= document.body.clientWidth"),
            true);
  // The whole of both tables, settings and runs, and the command that judges.
  EXPECT_EQ(browser.Evaluate("document.querySelectorAll('tr').length"),
            1 + 8 + 1 + 24);
  EXPECT_THAT(browser.Evaluate("document.body.innerText").get<std::string>(),
              HasSubstr("/bin/judge"));
  // No plot is cut off, on a telephone neither.
  for (const int width : {420, 1900}) {
    browser.Call("Emulation.setDeviceMetricsOverride",
                 {{"width", width},
                  {"height", 900},
                  {"deviceScaleFactor", 1},
                  {"mobile", false}});
    const auto of_plots = [&browser](const std::string& what) {
      return browser.Evaluate(
          "(() => { const boxes = [...document.querySelectorAll('.plots svg')]"
          ".map((s) => s.getBoundingClientRect()); return " +
          what + "; })()");
    };
    const double right =
        of_plots("Math.max(...boxes.map((b) => b.right))").get<double>();
    EXPECT_LE(right, width);
    // Nor is half of a wide window left empty.
    EXPECT_GE(right, width - 40.0);
  }
  EXPECT_THAT(browser.complaints(), IsEmpty());
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace plumbline
