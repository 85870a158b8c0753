// plumbline_experiments, and the graphs of plumbline_simulate, as processes.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph_g2o.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "apps/shell.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class ExperimentsBinaryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"plumbline_experiments", "plumbline_simulate"}) {
      const std::string binary = std::string(PLUMBLINE_BIN_DIR) + "/" + name;
      if (!std::ifstream(binary)) GTEST_SKIP() << binary << " is not built";
    }
    folder_ = ::testing::TempDir() + "experiments_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override {
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }

  std::string Read(const std::string& name) const {
    std::ifstream file(folder_ + "/" + name);
    return {std::istreambuf_iterator<char>(file),
            std::istreambuf_iterator<char>()};
  }

  // Runs a command line with the binary's folder put before it.
  static int Run(const std::string& command, std::string* output) {
    return RunInShell("env -u PLUMBLINE_DATASETS " +
                          std::string(PLUMBLINE_BIN_DIR) + "/" + command,
                      output);
  }

  std::string folder_;
};

TEST_F(ExperimentsBinaryTest, WritesTablesAndFigures) {
  std::string output;
  ASSERT_EQ(Run("plumbline_experiments --experiment=S6 --trials=2 "
                "--output_dir=" +
                    folder_ + "/new/results",
                &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("S6: Four ways"));
  EXPECT_THAT(Read("new/results/S6.csv"), HasSubstr("S6,\"4: common centre"));
  EXPECT_THAT(Read("new/results/S6_summary.txt"), HasSubstr("Paper:"));
  EXPECT_THAT(Read("new/results/S6.svg"), HasSubstr("</svg>"));
  const nlohmann::json summary =
      nlohmann::json::parse(Read("new/results/summary.json"));
  EXPECT_EQ(summary["seed"], 1);
  EXPECT_EQ(summary["S6"]["interrupted"], false);
  EXPECT_TRUE(summary["S6"]["claims"].contains(
      "method 4 isolates the outlier and keeps the others together"));
  for (const auto& claim : summary["S6"]["claims"]) {
    EXPECT_TRUE(claim["holds"].is_boolean());
    EXPECT_LE(claim["low"], claim["value"]);
  }
  EXPECT_FALSE(summary["S6"]["means"].empty());
}

TEST_F(ExperimentsBinaryTest, WhatAnInterruptLeftUntestedIsNotKnown) {
  std::string output;
  EXPECT_EQ(RunInShell("timeout --foreground --preserve-status --signal=INT "
                       "1 " PLUMBLINE_BIN_DIR
                       "/plumbline_experiments --experiment=S6 "
                       "--trials=100000 --output_dir=" +
                           folder_ + "/out",
                       &output),
            130)
      << output;
  EXPECT_THAT(output, HasSubstr("  not known  "));
  EXPECT_THAT(output, HasSubstr("no trial is whole"));
  EXPECT_THAT(output, Not(HasSubstr("nan")));
  const nlohmann::json summary =
      nlohmann::json::parse(Read("out/summary.json"));
  EXPECT_EQ(summary["S6"]["interrupted"], true);
  int unknown = 0;
  for (const auto& claim : summary["S6"]["claims"]) {
    EXPECT_EQ(claim["value"].is_null(), claim["holds"].is_null());
    unknown += claim["holds"].is_null();
  }
  EXPECT_GT(unknown, 0);
}

// That of plumbline_solve tells which files are its own.
TEST_F(ExperimentsBinaryTest, ASummaryOfAnotherProgramStays) {
  std::string output;
  const std::string path = folder_ + "/summary.json";
  for (const char* text :
       {"{\"version\": \"1\", \"seed\": 1, \"files\": []}", "[]", "notes"}) {
    std::ofstream(path) << text;
    EXPECT_EQ(Run("plumbline_experiments --experiment=S6 --trials=1"
                  " --output_dir=" +
                      folder_,
                  &output),
              2);
    EXPECT_THAT(output, HasSubstr("summary.json: is of no experiments"));
    EXPECT_EQ(Read("summary.json"), text);
  }
}

TEST_F(ExperimentsBinaryTest, SameFilesWithOneAndTwoThreads) {
  std::string output;
  for (const std::string threads : {"1", "2"}) {
    ASSERT_EQ(Run("plumbline_experiments --experiment=S1 --trials=2 "
                  "--num_threads=" +
                      threads + " --output_dir=" + folder_ + "/" + threads,
                  &output),
              0)
        << output;
  }
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(folder_ + "/1")) {
    const std::string name = entry.path().filename();
    EXPECT_EQ(Read("1/" + name), Read("2/" + name)) << name;
    ++files;
  }
  // Trials, two summaries, the plot, three maps, and summary.json.
  EXPECT_EQ(files, 8);
}

TEST_F(ExperimentsBinaryTest, SaysWhatItSkips) {
  std::string output;
  EXPECT_EQ(Run("plumbline_experiments --experiment=R2 --output_dir=" + folder_,
                &output),
            0);
  EXPECT_THAT(output, HasSubstr("skipped: PLUMBLINE_DATASETS is not set"));
}

TEST_F(ExperimentsBinaryTest, RefusesWrongFlags) {
  std::string output;
  const std::string good = " --output_dir=" + folder_;
  EXPECT_EQ(Run("plumbline_experiments" + good, &output), 1);
  EXPECT_THAT(output, HasSubstr("--experiment: it is missing"));
  EXPECT_EQ(Run("plumbline_experiments --experiment=S9" + good, &output), 2);
  EXPECT_THAT(output,
              HasSubstr("S1, S2, S3, S4, S5, S6, R1, R2, B1, B2, N1 or all"));
  EXPECT_EQ(Run("plumbline_experiments --experiment=S6", &output), 1);
  EXPECT_THAT(output, HasSubstr("--output_dir: it is missing"));
  EXPECT_EQ(
      Run("plumbline_experiments --experiment=S6 --trials=0" + good, &output),
      1);
  EXPECT_EQ(Run("plumbline_experiments --experiment=S6 --delta_mode=x" + good,
                &output),
            1);
  for (const std::string bad :
       {"line_ransac.sigma", "line_ransac=1", "line_ransac.sigma=0.1x",
        "sigma=1.2", "line_ransac.sigma=0.1,,"}) {
    EXPECT_NE(Run("plumbline_experiments --experiment=S1 --trials=1 "
                  "--detector_parameters=" +
                      bad + good,
                  &output),
              0);
    EXPECT_THAT(output, HasSubstr("as in line_ransac.sigma=0.02"));
  }
  EXPECT_EQ(
      Run("plumbline_experiments --experiment=S6 --output_dir=/dev/null/x",
          &output),
      2);
}

TEST_F(ExperimentsBinaryTest, SimulateWritesTheGraphOfAWorld) {
  std::string output;
  const std::string command =
      "plumbline_simulate --world=S4 --seed=9 --position_noise=0.1 "
      "--outliers=3 --truth=" +
      folder_ + "/truth.json --output=" + folder_;
  ASSERT_EQ(Run(command + "/a.g2o", &output), 0) << output;
  ASSERT_EQ(Run(command + "/b.g2o", &output), 0) << output;
  EXPECT_EQ(Read("a.g2o"), Read("b.g2o"));
  EXPECT_THAT(Read("truth.json"), HasSubstr("plumbline-synthetic-truth"));

  Registry registry;
  RegisterBuiltinRelations(&registry);
  Graph graph;
  std::istringstream file(Read("a.g2o"));
  ReadG2o(file, "a.g2o", registry, &graph);
  SyntheticOptions options = DefaultSyntheticOptions("S4");
  options.position_noise = 0.1;
  options.outliers = 3;
  const SyntheticWorld world = MakeSyntheticWorld("S4", options, 9, registry);
  ASSERT_EQ(graph.num_features(), 575u);
  ASSERT_EQ(graph.num_constraints(), world.graph->num_constraints());
  for (FeatureId id = 0; id < 575; ++id) {
    EXPECT_EQ(graph.GetFeature(id).parameters,
              world.graph->GetFeature(id).parameters);
  }
  EXPECT_EQ(graph.GetConstraint(77).expected,
            world.graph->GetConstraint(77).expected);
}

TEST_F(ExperimentsBinaryTest, SimulateNeedsAWorldAndAPlaceToWrite) {
  std::string output;
  EXPECT_EQ(Run("plumbline_simulate --world=office", &output), 1);
  EXPECT_THAT(output, HasSubstr("--output: it is missing"));
  EXPECT_EQ(Run("plumbline_simulate --output=" + folder_ + "/a.clf", &output),
            1);
  EXPECT_THAT(output, HasSubstr("--world: it is missing"));
}

TEST_F(ExperimentsBinaryTest, SimulateNamesTheSizeThatIsTooSmall) {
  std::string output;
  for (const char* world : {"bent", "bent_niches"}) {
    EXPECT_EQ(Run(std::string("plumbline_simulate --size=0.1 --world=") +
                      world + " --output=" + folder_ + "/a.clf",
                  &output),
              2);
    EXPECT_EQ(output, std::string("--size: 0.1 is too small for --world=") +
                          world + ": expected at least 0.25\n");
  }
  EXPECT_EQ(Run("plumbline_simulate --size=0.25 --world=bent --output=" +
                    folder_ + "/a.clf",
                &output),
            0)
      << output;
}

TEST_F(ExperimentsBinaryTest, SimulateRefusesWhatAGraphHasNot) {
  std::string output;
  EXPECT_EQ(Run("plumbline_simulate --world=S1 --output=" + folder_ +
                    "/a.g2o --relations=" + folder_ + "/a.relations",
                &output),
            2);
  EXPECT_THAT(output, HasSubstr("no --relations"));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/a.g2o"));
}

}  // namespace
}  // namespace plumbline
