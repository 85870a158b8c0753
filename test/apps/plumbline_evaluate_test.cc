#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/shell.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;

// Runs the binary in a folder of its own; standard output and error go to
// `output` together.
class EvaluateTest : public ::testing::Test {
 protected:
  void SetUp() override {
    binary_ = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_evaluate";
    if (!std::ifstream(binary_)) GTEST_SKIP() << binary_ << " is not built";
    folder_ = ::testing::TempDir() + "evaluate_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name() +
              "_";
    Write("path.tum",
          "1.000000 0 0 0 0 0 0 1\n"
          "2.000000 4 4 0 0 0 0 1\n");
    Write("true.relations",
          "1.0 2.0 1 0 0 0 0 0\n"
          "1.0 7.0 1 0 0 0 0 0\n");
  }

  void Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + name) << text;
  }

  std::string Read(const std::string& name) {
    std::ifstream file(folder_ + name);
    return {std::istreambuf_iterator<char>(file),
            std::istreambuf_iterator<char>()};
  }

  std::string Flag(const std::string& flag, const std::string& name) {
    return " --" + flag + "=" + folder_ + name;
  }

  int Run(const std::string& arguments, std::string* output) {
    return RunInShell(binary_ + arguments, output);
  }

  std::string binary_;
  std::string folder_;
};

// Nobody writes to the pipe.
TEST_F(EvaluateTest, AnInterruptEndsIt) {
  const std::string pipe_name = folder_ + "pipe";
  std::remove(pipe_name.c_str());
  ASSERT_EQ(mkfifo(pipe_name.c_str(), 0600), 0);
  std::string output;
  EXPECT_EQ(RunInShell("'" + binary_ + "'" + Flag("trajectory", "pipe") +
                           Flag("relations", "true.relations") +
                           " & sleep 1; kill -INT $!; wait $!; exit $?",
                       &output),
            130)
      << output;
  EXPECT_THAT(output, HasSubstr("interrupted"));
}

TEST_F(EvaluateTest, WhatIsReadIsNotReplaced) {
  const std::string before = Read("path.tum");
  std::string output;
  EXPECT_EQ(
      Run(Flag("trajectory", "path.tum") + Flag("relations", "true.relations") +
              Flag("output", "path.tum"),
          &output),
      2);
  EXPECT_THAT(output, HasSubstr("--output: "));
  EXPECT_THAT(output, HasSubstr("what --trajectory reads"));
  EXPECT_EQ(Read("path.tum"), before);
}

TEST_F(EvaluateTest, Relations) {
  std::string output;
  ASSERT_EQ(
      Run(Flag("trajectory", "path.tum") + Flag("relations", "true.relations") +
              Flag("output", "eval.json") +
              Flag("relation_errors", "errors.csv"),
          &output),
      0)
      << output;
  EXPECT_THAT(output, HasSubstr("translational error"));
  EXPECT_THAT(output, HasSubstr("mean     5.0000"));
  EXPECT_THAT(output, HasSubstr("1 matched, 1 not matched"));
  const auto json = nlohmann::json::parse(Read("eval.json"));
  EXPECT_EQ(json["relations"]["matched"], 1);
  EXPECT_EQ(json["relations"]["not_matched"], 1);
  EXPECT_NEAR(json["relations"]["translation_m"]["mean"].get<double>(), 5.0,
              1e-12);
  EXPECT_NEAR(json["relations"]["squared_translation_m2"]["max"].get<double>(),
              25.0, 1e-9);
  EXPECT_THAT(Read("errors.csv"), HasSubstr("\n1,1.000000,2.000000,3,4,0,5,0"));
}

TEST_F(EvaluateTest, Truth) {
  Write("truth.json",
        R"({"format":"plumbline-truth","version":1,"orientations_deg":[0],
            "walls":[{"id":0,"x1":0,"y1":0,"x2":4,"y2":0,"orientation":0,
                      "seen":[[0,4]]}],
            "poses":[[1,0,0,0],[2,4,4,0]]})");
  Write("map.json",
        R"({"features":[{"id":0,"type":"segment","parameters":[0,0.25,0],
            "extent":[0,4]}],"constraints":[]})");
  Write("plan.geojson",
        R"({"features":[{"properties":{"kind":"wall"},"geometry":{"type":
            "Polygon","coordinates":[[[0,0],[4,0],[4,0.1],[0,0.1],[0,0]]]}}]})");
  for (const std::string& trajectory :
       {Flag("trajectory", "path.tum"), std::string()}) {
    std::string output;
    ASSERT_EQ(
        Run(trajectory + Flag("truth", "truth.json") + Flag("map", "map.json") +
                Flag("plan", "plan.geojson") + Flag("output", "eval.json"),
            &output),
        0)
        << output;
    EXPECT_THAT(output, HasSubstr("walls: 1 of 1 found"));
    EXPECT_THAT(output, HasSubstr("missed orientations: 1 (0.00 deg)"));
    EXPECT_THAT(output, HasSubstr("completeness 1.000, correctness 1.000"));
    const auto json = nlohmann::json::parse(Read("eval.json"));
    EXPECT_NEAR(json["truth"]["offset_error_m"]["mean"].get<double>(), 0.25,
                1e-9);
  }
}

// A map without walls has no errors, which are not errors of 0.
TEST_F(EvaluateTest, FiguresOfNothingAreNotKnown) {
  Write("truth.json",
        R"({"format":"plumbline-truth","version":1,"orientations_deg":[0],
            "walls":[{"id":0,"x1":0,"y1":0,"x2":4,"y2":0,"orientation":0,
                      "seen":[[0,4]]}],
            "poses":[[1,0,0,0],[2,4,4,0]]})");
  Write("map.json", R"({"features":[],"constraints":[]})");
  Write("plan.geojson", R"({"features":[]})");
  std::string output;
  ASSERT_EQ(Run(Flag("truth", "truth.json") + Flag("map", "map.json") +
                    Flag("plan", "plan.geojson") + Flag("output", "eval.json"),
                &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("mean          -  std          -  max          "
                                "-  n 0\n"));
  EXPECT_THAT(output, HasSubstr("recall 0.0000, precision - (length)"));
  EXPECT_THAT(output, HasSubstr("bend error: - deg"));
  EXPECT_THAT(output, HasSubstr("mean IoU -, precision -, recall -\n"));
  EXPECT_THAT(output, HasSubstr("width error - m"));
  EXPECT_THAT(output, HasSubstr("completeness 0.000, correctness -;"));
  const nlohmann::json truth =
      nlohmann::json::parse(Read("eval.json")).at("truth");
  for (const char* figure : {"direction_error_deg", "offset_error_m"}) {
    for (const char* name : {"mean", "std", "max"}) {
      EXPECT_TRUE(truth.at(figure).at(name).is_null()) << figure << name;
    }
    EXPECT_EQ(truth.at(figure).at("n"), 0);
  }
  EXPECT_EQ(truth.at("recall"), 0.0);
  EXPECT_TRUE(truth.at("precision").is_null());
  EXPECT_TRUE(truth.at("bend_error_deg").is_null());
  EXPECT_TRUE(truth.at("plan").at("rooms").at("recall").is_null());
  EXPECT_TRUE(truth.at("plan").at("doors").at("width_error_m").is_null());
  EXPECT_EQ(truth.at("plan").at("walls").at("completeness"), 0.0);
  EXPECT_TRUE(truth.at("plan").at("walls").at("correctness").is_null());
}

TEST_F(EvaluateTest, Reference) {
  // The path, turned by 180 degrees and shifted, and one pose a metre off.
  Write("est.tum",
        "1 10 0 0 0 0 1 0\n2 9 0 0 0 0 1 0\n3 8 0 0 0 0 1 0\n"
        "4 7 0 0 0 0 1 0\n");
  Write("ref.tum",
        "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n3 2 0 0 0 0 0 1\n"
        "4 4 0 0 0 0 0 1\n");
  std::string output;
  ASSERT_EQ(Run(Flag("trajectory", "est.tum") + Flag("reference", "ref.tum") +
                    Flag("output", "eval.json") + Flag("plot", "plot.svg") +
                    Flag("pose_errors", "errors.csv"),
                &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("matched: 4 poses"));
  EXPECT_THAT(output, HasSubstr("alignment: se2"));
  const auto json = nlohmann::json::parse(Read("eval.json"))["reference"];
  EXPECT_EQ(json["matched"], 4);
  EXPECT_EQ(json["alignment"]["kind"], "se2");
  // Centres coincide: off by 0.25 m three times, and by 0.75 m.
  const auto ape = json["ape"]["translation_m"];
  EXPECT_NEAR(ape["mean"].get<double>(), 0.375, 1e-9);
  EXPECT_NEAR(ape["sse"].get<double>(), 0.75, 1e-9);
  EXPECT_NEAR(ape["max"].get<double>(), 0.75, 1e-9);
  const auto rpe = json["rpe"]["translation_m"];
  EXPECT_EQ(rpe["n"], 3);
  EXPECT_NEAR(rpe["max"].get<double>(), 1.0, 1e-9);
  EXPECT_NEAR(rpe["median"].get<double>(), 0.0, 1e-9);
  EXPECT_THAT(Read("plot.svg"), HasSubstr("absolute pose error"));
  EXPECT_THAT(Read("errors.csv"),
              HasSubstr("time,ape_m,ape_deg,rpe_m,rpe_deg\n1,0.25"));

  ASSERT_EQ(Run(Flag("trajectory", "est.tum") + Flag("reference", "ref.tum") +
                    " --rpe_delta=50" + Flag("plot", "plot.png"),
                &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("too short for a step of 50 frames"));
  EXPECT_EQ(Read("plot.png").substr(1, 3), "PNG");
}

TEST_F(EvaluateTest, BadReference) {
  Write("late.tum", "101 0 0 0 0 0 0 1\n102 1 0 0 0 0 0 1\n");
  Write("one.tum", "1 0 0 0 0 0 0 1\n");
  std::string output;
  const auto run = [&](const std::string& reference, const char* flags = "") {
    return Run(Flag("trajectory", "path.tum") + Flag("reference", reference) +
                   Flag("output", "none.json") + flags,
               &output);
  };
  EXPECT_EQ(run("late.tum"), 2);
  EXPECT_THAT(output, HasSubstr("no pose (1 s to 2 s) is within 0.01 s"));
  EXPECT_EQ(run("late.tum", " --time_offset=100"), 0) << output;
  std::remove((folder_ + "none.json").c_str());
  EXPECT_EQ(run("one.tum"), 2);
  EXPECT_THAT(output, HasSubstr("--alignment: one pose matches"));
  EXPECT_EQ(run("late.tum", " --time_offset=100 --rpe_delta=1.5"), 2);
  EXPECT_THAT(output, HasSubstr("--rpe_delta: steps of 1.5 poses"));
  EXPECT_FALSE(std::ifstream(folder_ + "none.json"));
  EXPECT_EQ(run("late.tum", " --plot=plot.pdf"), 1);
  EXPECT_THAT(output, HasSubstr("ends in .svg or .png"));
  EXPECT_EQ(Run(Flag("reference", "late.tum"), &output), 1);
  EXPECT_THAT(output, HasSubstr("expected --trajectory"));
}

TEST_F(EvaluateTest, BadInput) {
  Write("bad.relations", "1 2 3 4 5 6 7 8\n1 2 x 0 0 0 0 0\n");
  std::string output;
  EXPECT_EQ(
      Run(Flag("trajectory", "path.tum") + Flag("relations", "bad.relations") +
              Flag("output", "eval.json"),
          &output),
      2);
  EXPECT_THAT(output, HasSubstr("bad.relations:2: 'x' is no finite number"));
  EXPECT_FALSE(std::ifstream(folder_ + "eval.json"));

  Write("other.relations", "101 102 1 0 0 0 0 0\n");
  EXPECT_EQ(
      Run(Flag("trajectory", "path.tum") + Flag("relations", "other.relations"),
          &output),
      2);
  EXPECT_THAT(output, HasSubstr("other.relations:1: no relation has both"));
  EXPECT_EQ(
      Run(Flag("trajectory", "none.tum") + Flag("relations", "true.relations"),
          &output),
      2);
  EXPECT_THAT(output, HasSubstr("none.tum: cannot be opened"));
  // A device has no end.
  Write("truth.json",
        R"({"format":"plumbline-truth","version":1,"orientations_deg":[0],
            "walls":[],"poses":[[1,0,0,0],[2,4,4,0]]})");
  for (const std::string& endless :
       {Flag("truth", "truth.json") + " --map=/dev/zero",
        Flag("map", "truth.json") + " --truth=/dev/zero",
        Flag("trajectory", "path.tum") + " --relations=/dev/zero",
        Flag("relations", "true.relations") + " --trajectory=/dev/zero"}) {
    EXPECT_EQ(Run(endless, &output), 2) << endless;
    EXPECT_THAT(output, HasSubstr("/dev/zero:")) << endless;
  }
}

TEST_F(EvaluateTest, ASmallShareOfMatchesIsSaid) {
  std::string reference;
  std::string few;
  std::string more;
  for (int i = 0; i < 60; ++i) {
    const std::string pose = std::to_string(i) + " 0 0 0 0 0 1\n";
    reference += std::to_string(i) + " " + pose;
    // Every twelfth and every sixth at the time of one of the reference.
    few += std::to_string(i) + (i % 12 == 0 ? " " : ".5 ") + pose;
    more += std::to_string(i) + (i % 6 == 0 ? " " : ".5 ") + pose;
  }
  Write("reference.tum", reference);
  Write("few.tum", few);
  Write("more.tum", more);
  std::string output;
  ASSERT_EQ(
      Run(Flag("trajectory", "few.tum") + Flag("reference", "reference.tum"),
          &output),
      0)
      << output;
  EXPECT_THAT(output, HasSubstr("matched: 5 poses\n"));
  EXPECT_THAT(output, HasSubstr("only 5 of the 60 poses of the shorter "
                                "trajectory have one of the other within "
                                "--max_time_difference"));
  ASSERT_EQ(
      Run(Flag("trajectory", "more.tum") + Flag("reference", "reference.tum"),
          &output),
      0)
      << output;
  EXPECT_THAT(output, HasSubstr("matched: 10 poses\n"));
  EXPECT_EQ(output.find("only"), std::string::npos) << output;
}

TEST_F(EvaluateTest, Usage) {
  std::string output;
  EXPECT_EQ(Run("", &output), 1);
  EXPECT_THAT(output, HasSubstr("nothing to compare with"));
  EXPECT_EQ(Run(Flag("relations", "true.relations"), &output), 1);
  EXPECT_THAT(output, HasSubstr("--trajectory"));
  EXPECT_EQ(Run(Flag("truth", "truth.json"), &output), 1);
  EXPECT_THAT(output, HasSubstr("go together"));
  EXPECT_EQ(
      Run(Flag("trajectory", "path.tum") + Flag("relations", "true.relations") +
              Flag("plan", "plan.geojson"),
          &output),
      1);
  EXPECT_THAT(output, HasSubstr("--plan needs --truth or --rooms"));
  EXPECT_EQ(Run(Flag("rooms", "rooms.json"), &output), 1);
  EXPECT_THAT(output, HasSubstr("--rooms needs a plan"));
  const std::string relations =
      Flag("trajectory", "path.tum") + Flag("relations", "true.relations");
  for (const char* flag :
       {"--rpe_delta=10", "--rpe_unit=m", "--rpe_all_pairs", "--alignment=se2",
        "--max_time_difference=1", "--time_offset=1"}) {
    EXPECT_EQ(Run(relations + " " + flag, &output), 1) << flag;
    const std::string name = flag;
    EXPECT_THAT(output, HasSubstr(name.substr(0, name.find('=')) +
                                  " needs --reference"));
  }
  EXPECT_EQ(Run(relations + " --minimum_wall_length=2", &output), 1);
  EXPECT_THAT(output, HasSubstr("--minimum_wall_length needs --truth"));
  EXPECT_EQ(Run(" --no_such_flag=1", &output), 1);
  EXPECT_THAT(output, HasSubstr("no_such_flag"));
  EXPECT_EQ(Run(" --trajektory=a", &output), 1);
  EXPECT_THAT(output, HasSubstr("'--trajektory': there is no such flag "
                                "(--trajectory?)"));
  EXPECT_EQ(Run(" --alignment=se33", &output), 1);
  EXPECT_THAT(output, HasSubstr("(se3?)"));
  EXPECT_EQ(Run(" --relations=r --check_flags", &output), 0);
  EXPECT_EQ(output, "");
  EXPECT_EQ(Run(" -h", &output), 0);
  EXPECT_THAT(output, HasSubstr("Example:"));
  EXPECT_EQ(Run(" --help", &output), 0);
  EXPECT_THAT(output, HasSubstr("Example:"));
  EXPECT_THAT(output, HasSubstr("--relation_errors"));
}

}  // namespace
}  // namespace plumbline
