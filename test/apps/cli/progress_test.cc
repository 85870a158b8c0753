#include <gflags/gflags.h>
#include <gtest/gtest.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/core/error.h>
#include <plumbline/core/version.h>

#include <csignal>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

DECLARE_bool(quiet);

DEFINE_double(test_range, 0.5, "For CheckFlagValues.");
PLUMBLINE_FLAG_RANGE(test_range, 0, 1);
DEFINE_string(test_choice, "a", "For CheckFlagValues.");
PLUMBLINE_FLAG_CHOICES(test_choice, "a", "b");

namespace plumbline {
namespace {

TEST(ProgressLineTest, ShowsBarRateAndTimeLeft) {
  // 50 of 200 in 10 s: 5/s, and 150 left take 30 s. A quarter of 30 is 7.
  EXPECT_EQ(ProgressLine("Reading", "scans", 50, 200, 10.0, 120),
            "Reading [=======                       ]  25% "
            "50/200, 5.0 scans/s, 30 s left");
}

TEST(ProgressLineTest, KeepsWithinTheTerminal) {
  EXPECT_EQ(ProgressLine("Reading", "scans", 50, 200, 10.0, 50),
            "Reading  25% 50/200, 5.0 scans/s, 30 s left");
  EXPECT_EQ(ProgressLine("Reading", "scans", 50, 200, 10.0, 10), "Reading  2");
  EXPECT_EQ(ProgressLine("Reading", "scans", 50, 200, 10.0, -1), "");
}

TEST(ProgressLineTest, UnknownTotalHasNoBar) {
  EXPECT_EQ(ProgressLine("Reading", "lines", 4000, 0, 2.0, 80),
            "Reading 4000, 2000 lines/s");
}

TEST(ProgressLineTest, NothingDoneAndMoreThanAll) {
  EXPECT_EQ(ProgressLine("T", "s", 0, 10, 0.0, 40),
            "T [                 ]   0% 0/10, 0.0 s/s");
  EXPECT_EQ(ProgressLine("T", "s", 20, 10, 1.0, 30),
            "T 100% 20/10, 20 s/s, 0 s left");
}

TEST(ProgressLineTest, LongTimesInMinutesAndHours) {
  // 1 in 1 s, 90 to go; 1 in 100 s, 90 to go.
  EXPECT_EQ(ProgressLine("T", "s", 1, 91, 1.0, 45),
            "T [     ]   1% 1/91, 1.0 s/s, 1 min 30 s left");
  EXPECT_EQ(ProgressLine("T", "s", 1, 91, 100.0, 40),
            "T   1% 1/91, 0.0 s/s, 2 h 30 min left");
}

TEST(WorkEstimateTest, KnownSharesCountByWeight) {
  WorkEstimate work;
  work.Plan({{"reading", 10.0}, {"solving", 80.0}, {"writing", 10.0}});
  EXPECT_EQ(work.Done(0.5, 0.5), 0.0);
  work.Begin("reading", 1.0);
  EXPECT_DOUBLE_EQ(work.Done(1.0, 0.5), 0.05);
  work.Begin("solving", 2.0);
  EXPECT_DOUBLE_EQ(work.Done(3.0, 0.25), 0.3);
  // A step of no stage is part of the present one.
  work.Begin("other", 4.0);
  EXPECT_DOUBLE_EQ(work.Done(4.0, 0.5), 0.5);
  work.Begin("writing", 10.0);
  EXPECT_DOUBLE_EQ(work.Done(11.0, 1.0), 1.0);
}

TEST(WorkEstimateTest, UnknownSharesAdvanceAsWorkDidBefore) {
  WorkEstimate work;
  work.Plan({{"a", 50.0}, {"b", 50.0}});
  work.Begin("a", 0.0);
  // Nothing was before: nothing can be said.
  EXPECT_EQ(work.Done(5.0), 0.0);
  work.Begin("b", 10.0);
  EXPECT_NEAR(work.Done(15.0), 0.75, 1e-12);
  // Late: it goes on, and never ends.
  const double late = work.Done(20.0);
  EXPECT_GT(late, 0.85);
  EXPECT_LT(late, 1.0);
  EXPECT_GT(work.Done(40.0), late);
  EXPECT_LE(work.Done(60.0), 1.0);
}

TEST(WorkEstimateTest, NeverGoesBackAndLeavesOutWhatIsPassedOver) {
  WorkEstimate work;
  work.Plan({{"a", 10.0}, {"b", 10.0}, {"c", 80.0}, {"b", 10.0}});
  work.Begin("a", 0.0);
  EXPECT_DOUBLE_EQ(work.Done(1.0, 1.0), 10.0 / 110.0);
  work.Begin("c", 3.0);
  EXPECT_DOUBLE_EQ(work.Done(3.0, 0.0), 0.1);
  work.Begin("a", 4.0);
  EXPECT_DOUBLE_EQ(work.Done(4.0, 0.5), 0.5);
  work.Begin("b", 5.0);
  EXPECT_DOUBLE_EQ(work.Done(5.0, 0.0), 0.9);
  // More work than was known: it waits.
  work.Plan({{"d", 900.0}});
  EXPECT_DOUBLE_EQ(work.Done(6.0, 0.5), 0.9);
}

TEST(WorkLineTest, FitsAndTellsTheTimeLeft) {
  EXPECT_EQ(WorkLine("solving", 0.25, 10.0, 60),
            "solving [=======                       ]  25%, 30 s left");
  EXPECT_EQ(WorkLine("solving", 0.01, 10.0, 60),
            "solving [                              ]   1%");
  EXPECT_EQ(WorkLine("reading", 0.0, 12.0, 60), "reading, 12 s");
  EXPECT_LE(
      WorkLine("joint adjustment of poses and walls", 0.5, 10.0, 40).size(),
      40u);
}

TEST(RemarkTest, QuietAndVerbose) {
  gflags::FlagSaver saver;
  const auto print = [] {
    ::testing::internal::CaptureStderr();
    Remark("%d remarks", 1);
    Detail("%s", "a detail");
    return ::testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(print(), "1 remarks\n");
  gflags::SetCommandLineOption("verbose", "true");
  EXPECT_EQ(print(), "1 remarks\na detail\n");
  FLAGS_quiet = true;
  EXPECT_EQ(print(), "");
}

TEST(AppTest, VersionIsTheProjects) {
  std::ifstream file(PLUMBLINE_SOURCE_DIR "/CMakeLists.txt");
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_NE(text.str().find("project(plumbline VERSION " +
                            std::string(kVersion) + " "),
            std::string::npos);
}

TEST(AppTest, RunMainTurnsExceptionsIntoStatuses) {
  EXPECT_EQ(RunMain([] { return 0; }), 0);
  EXPECT_EQ(RunMain([] { return 7; }), 7);
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(RunMain([]() -> int {
              throw Error("a.clf", 12, "no number", "a range in m");
            }),
            2);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "a.clf:12: no number: expected a range in m\n");
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(RunMain([]() -> int { throw std::logic_error("impossible"); }), 3);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "internal error: impossible\n");
}

TEST(AppTest, ChecksRangesAndChoices) {
  gflags::FlagSaver saver;
  EXPECT_TRUE(CheckFlagValues().empty());
  FLAGS_test_range = 1.0;
  FLAGS_test_choice = "b";
  EXPECT_TRUE(CheckFlagValues().empty());
  FLAGS_test_range = 1.5;
  FLAGS_test_choice = "c";
  EXPECT_EQ(CheckFlagValues(),
            (std::vector<std::string>{
                "--test_choice=c: unknown value: expected one of a, b",
                "--test_range=1.5: out of range: expected 0 to 1"}));
  gflags::SetCommandLineOption("test_range", "nan");
  EXPECT_EQ(CheckFlagValues().size(), 2u);
}

TEST(AppTest, ChangedFlagsAreOurOwn) {
  gflags::FlagSaver saver;
  EXPECT_TRUE(ChangedFlags().empty());
  FLAGS_quiet = true;
  // A flag of a library, and one that is not in the apps' folder.
  gflags::SetCommandLineOption("v", "1");
  FLAGS_test_range = 1.0;
  const std::vector<FlagValue> changed = ChangedFlags();
  ASSERT_EQ(changed.size(), 1u);
  EXPECT_EQ(changed[0].name, "quiet");
  EXPECT_EQ(changed[0].value, "true");
  EXPECT_EQ(changed[0].default_value, "false");
  EXPECT_EQ(changed[0].type, "bool");
}

class ParseFlagsDeathTest : public ::testing::Test {
 protected:
  static void Parse(std::vector<std::string> arguments,
                    bool takes_arguments = false) {
    AppInfo info;
    info.name = "plumbline_test";
    info.summary = "Test.";
    info.takes_arguments = takes_arguments;
    std::vector<char*> argv = {const_cast<char*>("plumbline_test")};
    for (std::string& argument : arguments) argv.push_back(&argument[0]);
    argv.push_back(nullptr);
    const auto rest =
        ParseFlags(info, static_cast<int>(argv.size()) - 1, argv.data());
    // What was left over becomes the status, so that a test can see it.
    std::exit(40 + static_cast<int>(rest.size()));
  }
};

TEST_F(ParseFlagsDeathTest, HelpAndVersionSucceed) {
  EXPECT_EXIT(Parse({"--help"}), ::testing::ExitedWithCode(0), "");
  EXPECT_EXIT(Parse({"--version"}), ::testing::ExitedWithCode(0), "");
}

TEST_F(ParseFlagsDeathTest, WrongFlagsAreRefused) {
  EXPECT_EXIT(Parse({"--no_such_flag=1"}), ::testing::ExitedWithCode(1),
              "no_such_flag");
  EXPECT_EXIT(Parse({"--test_range=abc"}), ::testing::ExitedWithCode(1), "abc");
  EXPECT_EXIT(Parse({"--test_range=7"}), ::testing::ExitedWithCode(1),
              "--test_range=7: out of range: expected 0 to 1");
  EXPECT_EXIT(Parse({"--quiet", "false"}), ::testing::ExitedWithCode(1),
              "false: unexpected argument");
}

TEST_F(ParseFlagsDeathTest, PassesArgumentsOn) {
  EXPECT_EXIT(Parse({"--quiet"}), ::testing::ExitedWithCode(40), "");
  EXPECT_EXIT(Parse({"--quiet", "--", "command", "--no_such_flag"}, true),
              ::testing::ExitedWithCode(42), "");
}

TEST_F(ParseFlagsDeathTest, FirstCtrlCIsARequestAndTheSecondAnEnd) {
  const auto parse_and_raise = [](int times, bool is_whole = false) {
    AppInfo info;
    info.name = "plumbline_test";
    char name[] = "plumbline_test";
    char* argv[] = {name, nullptr};
    ParseFlags(info, 1, argv);
    std::exit(RunMain([times, is_whole] {
      for (int i = 0; i < times; ++i) std::raise(SIGINT);
      if (is_whole) TellWhole();
      return InterruptRequested() ? 0 : 50;
    }));
  };
  EXPECT_EXIT(parse_and_raise(0), ::testing::ExitedWithCode(50), "");
  EXPECT_EXIT(parse_and_raise(1), ::testing::ExitedWithCode(130),
              "interrupted");
  EXPECT_EXIT(parse_and_raise(1, /*is_whole=*/true),
              ::testing::ExitedWithCode(0), "interrupted when all was done");
  EXPECT_EXIT(parse_and_raise(2), ::testing::KilledBySignal(SIGINT), "");
}

}  // namespace
}  // namespace plumbline
