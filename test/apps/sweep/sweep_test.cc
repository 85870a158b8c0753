#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/sweep/child_process.h>
#include <plumbline/apps/sweep/sweep.h>
#include <plumbline/core/error.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::StartsWith;

class SweepTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "sweep_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    definition_.working_directory = folder_;
  }
  void TearDown() override {
    if (!HasFailure()) fs::remove_all(folder_);
  }

  // A program that is a shell script; ${out} is the run's folder.
  void SetScript(const std::string& body) {
    const std::string path = folder_ + "/program.sh";
    std::ofstream(path) << "#!/bin/sh\nfor flag; do case $flag in\n"
                           "--output_dir=*) out=${flag#*=};;\n"
                           "--seed=*) seed=${flag#*=};;\n"
                           "--x=*) x=${flag#*=};;\nesac; done\n"
                        << body << '\n';
    fs::permissions(path, fs::perms::owner_all);
    definition_.command = {path, "two words"};
  }

  RunRecord Execute() {
    const std::optional<RunRecord> record =
        ExecuteRun(definition_, MakeRuns(definition_).at(0), folder_, nullptr);
    EXPECT_TRUE(record);
    return record.value_or(RunRecord());
  }

  std::string Log() {
    const SweepRun run = MakeRuns(definition_).at(0);
    std::ifstream file(RunFolder(folder_, run) + "/log.txt");
    return {std::istreambuf_iterator<char>(file),
            std::istreambuf_iterator<char>()};
  }

  std::string folder_;
  SweepDefinition definition_;
};

TEST_F(SweepTest, DefinitionsComeBackFromTheirFile) {
  EXPECT_FALSE(ReadDefinition(folder_));
  definition_.axes = {{"x", {"1", "a,b"}}, {"y", {""}}};
  definition_.one_at_a_time = true;
  definition_.best_digest = "abc";
  definition_.objective = "cost.total";
  definition_.maximize = true;
  definition_.trials = 7;
  definition_.first_seed = 18446744073709551000u;
  definition_.seed_flag = "";
  definition_.command = {"/bin/true", "--a=\"b\"", ""};
  definition_.evaluate = {"/bin/echo", "{}/x"};
  definition_.environment = {{"NAME", "va=lue"}};
  definition_.time_limit = 1.5;
  WriteDefinition(definition_, folder_);
  const std::optional<SweepDefinition> read = ReadDefinition(folder_);
  ASSERT_TRUE(read);
  ASSERT_EQ(read->axes.size(), 2u);
  EXPECT_EQ(read->axes[0].flag, "x");
  EXPECT_THAT(read->axes[0].values, ElementsAre("1", "a,b"));
  EXPECT_THAT(read->axes[1].values, ElementsAre(""));
  EXPECT_TRUE(read->one_at_a_time);
  EXPECT_EQ(read->objective, "cost.total");
  EXPECT_TRUE(read->maximize);
  EXPECT_EQ(read->best_digest, "abc");
  EXPECT_EQ(read->trials, 7);
  EXPECT_EQ(read->first_seed, 18446744073709551000u);
  EXPECT_EQ(read->seed_flag, "");
  EXPECT_EQ(read->command, definition_.command);
  EXPECT_EQ(read->evaluate, definition_.evaluate);
  EXPECT_EQ(read->working_directory, folder_);
  EXPECT_THAT(read->environment, ElementsAre(Pair("NAME", "va=lue")));
  EXPECT_EQ(read->time_limit, 1.5);

  std::ofstream(folder_ + "/sweep.json") << "{\"axes\": 1";
  EXPECT_THROW(ReadDefinition(folder_), Error);
  std::ofstream(folder_ + "/sweep.json") << "{}";
  EXPECT_THROW(ReadDefinition(folder_), Error);
}

// Edited by hand.
TEST_F(SweepTest, DefinitionsThatMakeNoSense) {
  definition_.axes = {{"x", {"1", "2"}}};
  definition_.command = {"/bin/true"};
  WriteDefinition(definition_, folder_);
  const std::string path = folder_ + "/sweep.json";
  std::ifstream file(path);
  const auto good = nlohmann::json::parse(file);
  const auto refusal = [&](const std::string& key, const std::string& value) {
    nlohmann::json json = good;
    json[key] = nlohmann::json::parse(value);
    std::ofstream(path) << json;
    try {
      ReadDefinition(folder_);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal("trials", "1"), "");
  for (const auto& [key, value] :
       std::vector<std::pair<std::string, std::string>>{
           {"axes", R"([{"flag": "x", "values": []}])"},
           {"axes", R"([{"flag": "x", "values": ["1", "1"]}])"},
           {"axes", R"([{"flag": "", "values": ["1"]}])"},
           {"axes", R"([{"flag": "x", "values": [1]}])"},
           {"trials", "2000000000"},
           {"trials", "20000000000"},
           {"trials", "0"},
           {"trials", "-1"},
           {"trials", "1.5"},
           {"first_seed", "-0.5"},
           {"time_limit", "-1"},
           {"command", "[]"}}) {
    EXPECT_THAT(refusal(key, value), HasSubstr("sweep.json: ")) << key << value;
  }
  std::string values;
  for (int i = 0; i < 1001; ++i) {
    values += (i > 0 ? ",\"" : "\"") + std::to_string(i) + "\"";
  }
  const std::string axes = R"([{"flag": "x", "values": [)" + values +
                           R"(]}, {"flag": "y", "values": [)" + values + "]}]";
  EXPECT_THAT(refusal("axes", axes), HasSubstr("a million at most"));
}

// Nor is a pipe waited for.
TEST_F(SweepTest, APipeIsNoDefinition) {
  ASSERT_EQ(mkfifo((folder_ + "/sweep.json").c_str(), 0600), 0);
  EXPECT_THROW(ReadDefinition(folder_), Error);
  EXPECT_FALSE(WasDefinedHere(folder_));
  ASSERT_EQ(mkfifo((folder_ + "/run.json").c_str(), 0600), 0);
  EXPECT_FALSE(ReadRecord(folder_));
}

TEST_F(SweepTest, DefinitionsKnowTheirFolder) {
  EXPECT_FALSE(WasDefinedHere(folder_));
  WriteDefinition(definition_, folder_);
  EXPECT_TRUE(WasDefinedHere(folder_));
  const std::string copy = folder_ + "/copy";
  fs::create_directories(copy);
  fs::copy(folder_ + "/sweep.json", copy + "/sweep.json");
  EXPECT_FALSE(WasDefinedHere(copy));
  std::ofstream(folder_ + "/sweep.json") << "{}";
  EXPECT_FALSE(WasDefinedHere(folder_));
}

TEST_F(SweepTest, OtherAxesKeepRunsAndOtherCommandsDoNot) {
  SweepDefinition other = definition_;
  other.axes = {{"x", {"1"}}};
  other.trials = 9;
  other.time_limit = 1.0;
  EXPECT_NO_THROW(CheckSameRuns(definition_, other, folder_));
  for (const int which : {0, 1, 2, 3}) {
    other = definition_;
    if (which == 0) other.command.push_back("--more");
    if (which == 1) other.evaluate.push_back("x");
    if (which == 2) other.seed_flag = "random_seed";
    if (which == 3) other.working_directory = "/";
    EXPECT_THROW(CheckSameRuns(definition_, other, folder_), Error) << which;
  }
}

TEST_F(SweepTest, RunsAreAllCombinationsTheSeedFastest) {
  definition_.axes = {{"a", {"1", "2"}}, {"b", {"x", "y", "z"}}};
  definition_.trials = 2;
  definition_.first_seed = 5;
  definition_.command = {"/bin/program", "--input=i"};
  const std::vector<SweepRun> runs = MakeRuns(definition_);
  ASSERT_EQ(runs.size(), 12u);
  EXPECT_THAT(runs[0].values, ElementsAre("1", "x"));
  EXPECT_EQ(runs[0].seed, 5u);
  EXPECT_EQ(runs[1].seed, 6u);
  EXPECT_THAT(runs[2].values, ElementsAre("1", "y"));
  EXPECT_THAT(runs[11].values, ElementsAre("2", "z"));
  EXPECT_EQ(runs[11].name, "a=2,b=z,seed=6");
  EXPECT_THAT(RunCommand(definition_, runs[11], "/out"),
              ElementsAre("/bin/program", "--input=i", "--a=2", "--b=z",
                          "--seed=6", "--output_dir=/out"));
  definition_.seed_flag = "";
  EXPECT_THAT(RunCommand(definition_, runs[0], "/out"),
              ElementsAre("/bin/program", "--input=i", "--a=1", "--b=x",
                          "--output_dir=/out"));
  definition_.one_at_a_time = true;
  definition_.trials = 1;
  std::vector<std::string> names;
  for (const SweepRun& run : MakeRuns(definition_)) names.push_back(run.name);
  EXPECT_THAT(names, ElementsAre("a=1,b=x,seed=5", "a=2,b=x,seed=5",
                                 "a=1,b=y,seed=5", "a=1,b=z,seed=5"));
  definition_.axes.clear();
  EXPECT_EQ(MakeRuns(definition_).at(0).name, "seed=5");
}

TEST_F(SweepTest, AxesOfAFlagWithKeysMakeOneList) {
  definition_.command = {"p"};
  definition_.axes = {{"d:a.x", {"1"}}, {"y", {"2"}}, {"d:b.z", {"3"}}};
  const SweepRun run = MakeRuns(definition_).at(0);
  EXPECT_THAT(RunCommand(definition_, run, "/o"),
              ElementsAre("p", "--d=a.x=1,b.z=3", "--y=2", "--seed=1",
                          "--output_dir=/o"));
  EXPECT_EQ(run.name, "d.a.x=1,y=2,d.b.z=3,seed=1");
}

TEST_F(SweepTest, FoldersOfRunsAreDifferentAndShort) {
  const std::string long_one(400, 'l');
  definition_.axes = {{"hierarchy",
                       {"a/b", "a_b", "a,b", "a=b", "", "a b", "..", "\xc3\xa4",
                        long_one, long_one + "x"}}};
  std::set<std::string> names;
  for (const SweepRun& run : MakeRuns(definition_)) {
    EXPECT_LE(run.name.size(), 200u);
    EXPECT_EQ(run.name.find_first_of("/ \xc3"), std::string::npos) << run.name;
    names.insert(run.name);
  }
  EXPECT_EQ(names.size(), 10u);
}

TEST_F(SweepTest, NumbersHaveTheirPaths) {
  const std::string text =
      R"({"a": {"b": [1, true, {"c": -2.5}]}, "word": "7", "no": null,
          "d": false, "seed": 3})";
  EXPECT_THAT(
      Numbers(text, false, "f"),
      ElementsAre(Pair("a.b.0", 1.0), Pair("a.b.1", 1.0), Pair("a.b.2.c", -2.5),
                  Pair("d", 0.0), Pair("seed", 3.0)));
  EXPECT_THAT(Numbers(text, true, "f"),
              ElementsAre(Pair("a.b", 3.0), Pair("d", 0.0), Pair("seed", 3.0)));
  std::vector<std::string> unknown;
  Numbers(R"({"a": null, "b": {"c": null, "d": 1}})", true, "f", &unknown);
  EXPECT_THAT(unknown, ElementsAre("a", "b.c"));
  EXPECT_THAT(Numbers("{}", false, "f"), IsEmpty());
  EXPECT_THROW(Numbers("[1]", false, "f"), Error);
  EXPECT_THROW(Numbers("{\"a\": ", false, "f"), Error);
}

TEST_F(SweepTest, ARunGivesItsFiguresAndItsLog) {
  SetScript(
      "echo says \"$1\"; echo warns >&2\n"
      "echo \"{\\\"x\\\": $x, \\\"seed\\\": $seed}\" > $out/summary.json");
  definition_.axes = {{"x", {"1.25"}}};
  definition_.first_seed = 4;
  definition_.evaluate = {"/bin/sh", "-c",
                          "echo '{\"list\": [5, 6], \"no\": null}' > "
                          "{}/evaluation.json; "
                          "test {} = \"$0\"",
                          "{}"};
  const RunRecord record = Execute();
  EXPECT_EQ(record.status, RunStatus::kDone) << record.reason;
  EXPECT_THAT(record.figures, ElementsAre(Pair("x", 1.25), Pair("seed", 4.0),
                                          Pair("evaluation.list", 2.0)));
  EXPECT_THAT(record.unknown, ElementsAre("evaluation.no"));
  EXPECT_THAT(Log(), HasSubstr("$ " + folder_ + "/program.sh 'two words'"));
  EXPECT_THAT(Log(), HasSubstr("says two words\nwarns\n"));

  const std::optional<RunRecord> read =
      ReadRecord(folder_ + "/runs/x=1.25,seed=4");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->status, RunStatus::kDone);
  EXPECT_EQ(read->figures, record.figures);
  EXPECT_EQ(read->unknown, record.unknown);
  EXPECT_EQ(read->seconds, record.seconds);
}

// Of an attempt that failed or was killed, and of whoever put notes there.
TEST_F(SweepTest, WhatIsInTheFolderOfARunStays) {
  SetScript("echo '{\"x\": 1}' > $out/summary.json\nexit 3");
  EXPECT_EQ(Execute().reason, "exit status 3");
  const std::string folder =
      RunFolder(folder_, MakeRuns(definition_).at(0)) + "/";
  std::ofstream(folder + "thesis.tex") << "years of work";
  // Its figures are none of another attempt's.
  SetScript("true");
  EXPECT_EQ(Execute().reason, "no summary.json");
  EXPECT_TRUE(fs::exists(folder + "summary.json"));
  SetScript("echo '{\"x\": 2}' > $out/summary.json");
  EXPECT_THAT(Execute().figures, ElementsAre(Pair("x", 2.0)));
  std::ifstream thesis(folder + "thesis.tex");
  const std::string text{std::istreambuf_iterator<char>(thesis), {}};
  EXPECT_EQ(text, "years of work");
}

TEST_F(SweepTest, WhatGoesWrongIsSaid) {
  const auto reason = [this](const std::string& script) {
    SetScript(script);
    const RunRecord record = Execute();
    EXPECT_EQ(record.status, RunStatus::kFailed);
    EXPECT_THAT(record.figures, IsEmpty());
    return record.reason;
  };
  const std::string good = "echo '{\"x\": 1}' > $out/summary.json\n";
  EXPECT_EQ(reason(good + "exit 3"), "exit status 3");
  EXPECT_EQ(reason(good + "kill -SEGV $$"), "signal 11 (Segmentation fault)");
  // With the last words of the run.
  EXPECT_EQ(reason("echo first\necho 'a.clf:3: no number' >&2\necho\nexit 2"),
            "exit status 2: a.clf:3: no number");
  EXPECT_EQ(reason("printf 'reading 3%%\\rreading 9%%\\rstuck'\nexit 2"),
            "exit status 2: stuck");
  EXPECT_EQ(reason("true"), "no summary.json");
  EXPECT_THAT(reason("echo '{' > $out/summary.json"),
              StartsWith("summary.json: cannot be read"));
  definition_.evaluate = {"/bin/false"};
  EXPECT_EQ(reason(good), "evaluation: exit status 1");
  definition_.evaluate = {"/no/such"};
  EXPECT_EQ(reason(good),
            "evaluation: cannot be run: No such file or directory");
  definition_.evaluate.clear();
  fs::remove(folder_ + "/program.sh");
  EXPECT_EQ(Execute().reason, "cannot be run: No such file or directory");
  // With what an earlier attempt wrote in the folder.
  EXPECT_TRUE(fs::exists(folder_ + "/runs/seed=1/summary.json"));
}

TEST_F(SweepTest, ATimeLimitEndsTheRunAndWhatItStarted) {
  SetScript(
      "echo '{\"x\": 1}' > $out/summary.json\n"
      "(sleep 1; touch late) &\nsleep 30");
  definition_.time_limit = 0.25;
  const auto begin = std::chrono::steady_clock::now();
  const RunRecord record = Execute();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  EXPECT_EQ(record.status, RunStatus::kTimedOut);
  EXPECT_EQ(record.reason, "longer than 0.25 s");
  EXPECT_THAT(record.figures, IsEmpty());
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  EXPECT_FALSE(fs::exists(folder_ + "/late"));
}

TEST_F(SweepTest, AStoppedRunHasNoRecord) {
  SetScript("touch begun; sleep 30");
  const auto begin = std::chrono::steady_clock::now();
  const SweepRun run = MakeRuns(definition_).at(0);
  EXPECT_FALSE(ExecuteRun(definition_, run, folder_,
                          [&] { return fs::exists(folder_ + "/begun"); }));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  EXPECT_FALSE(ReadRecord(RunFolder(folder_, run)));
}

TEST_F(SweepTest, DamagedRecordsAreNone) {
  const std::string path = folder_ + "/run.json";
  for (const std::string text :
       {"", "{", "{}", "[]",
        "{\"status\": \"x\", \"reason\": \"\", \"seconds\": 1, \"figures\": "
        "[]}",
        "{\"status\": \"done\", \"reason\": \"\", \"seconds\": 1, \"figures\": "
        "[[1]]}"}) {
    std::ofstream(path, std::ios::trunc) << text;
    EXPECT_FALSE(ReadRecord(folder_)) << text;
  }
  RecordLoss(folder_ + "/new");
  const std::optional<RunRecord> lost = ReadRecord(folder_ + "/new");
  ASSERT_TRUE(lost);
  EXPECT_EQ(lost->status, RunStatus::kFailed);
  EXPECT_EQ(lost->reason, "ended without a record");
}

TEST(ChildProcessTest, GetsInputEnvironmentAndFolder) {
  const std::string log = ::testing::TempDir() + "child_process_log";
  fs::remove(log);
  ChildOptions options;
  options.command = {"sh", "-c", "cat; echo $NAME; pwd"};
  options.input = "from above\n";
  options.environment = {{"NAME", "a value"}};
  options.working_directory = "/";
  options.log = log;
  const ChildResult result = RunChild(options);
  EXPECT_TRUE(result.succeeded) << result.failure;
  std::ifstream file(log);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(file), {}),
            "from above\na value\n/\n");
  options.working_directory = "/no/such/folder";
  EXPECT_THAT(RunChild(options).failure, HasSubstr("cannot be run"));
  options.log = "/no/such/folder/log";
  EXPECT_THROW(RunChild(options), Error);
  fs::remove(log);
}

}  // namespace
}  // namespace plumbline
