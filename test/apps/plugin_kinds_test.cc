// Plug-ins of the kinds that core does not know, used by plumbline_solve by
// name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include "apps/shell.h"

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class PluginKindsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              (std::string("kinds_") +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Everything that the run prints goes to `output`.
  static int Solve(const std::string& arguments, std::string* output) {
    return RunInShell(PLUMBLINE_BIN_DIR
                          "/plumbline_solve --odometry_refinement=false "
                          "--plugins=" PLUMBLINE_TEST_PLUGIN_DIR
                          "/plain_log.so " +
                          arguments,
                      output);
  }

  std::string Read(const std::string& name) const {
    std::ifstream file(folder_ / name);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  fs::path folder_;
};

// The same three scans of a room of 4 m x 6 m as CARMEN and as plain text.
TEST_F(PluginKindsTest, LogReader) {
  std::ofstream carmen(folder_ / "carmen.log");
  std::ofstream plain(folder_ / "plain.log");
  plain << "#plain\n";
  for (int scan = 0; scan < 3; ++scan) {
    const double x = 0.1 * scan;
    std::ostringstream ranges;
    ranges << "180";
    for (int beam = 0; beam < 180; ++beam) {
      const double angle = (beam - 90) * 3.14159265358979 / 180.0;
      const double to_front = (3.0 - x) / std::max(1e-9, std::cos(angle));
      const double to_side = 2.0 / std::max(1e-9, std::abs(std::sin(angle)));
      ranges << ' ' << std::min(to_front, to_side);
    }
    carmen << "FLASER " << ranges.str() << ' ' << x << " 0 0 " << x << " 0 0 "
           << 100 + scan << ".5 host 0\n";
    plain << ranges.str() << ' ' << x << " 0 0 " << 100 + scan << ".5\n";
  }
  carmen.close();
  plain.close();

  std::string output;
  for (const std::string name : {"carmen", "plain"}) {
    ASSERT_EQ(Solve("--input=" + (folder_ / (name + ".log")).string() +
                        " --output_dir=" + (folder_ / name).string(),
                    &output),
              0)
        << output;
  }
  EXPECT_EQ(Read("carmen/trajectory.tum"), Read("plain/trajectory.tum"));
  EXPECT_THAT(Read("plain/trajectory.tum"), HasSubstr("\n102.5 "));
  EXPECT_EQ(Read("carmen/map.json"), Read("plain/map.json"));

  // By name: the reader gets what it would not have recognized.
  EXPECT_EQ(
      Solve("--log_reader=carmen --input=" + (folder_ / "plain.log").string() +
                " --output_dir=" + (folder_ / "out").string(),
            &output),
      2);
  EXPECT_THAT(output, HasSubstr("plain.log"));
  EXPECT_EQ(
      Solve("--log_reader=plane --input=" + (folder_ / "plain.log").string() +
                " --output_dir=" + (folder_ / "out").string(),
            &output),
      2);
  EXPECT_THAT(output,
              AllOf(HasSubstr("unknown log reader 'plane': expected one of "
                              "plain, "),
                    HasSubstr("carmen")));
}

TEST_F(PluginKindsTest, WhateverOneThrowsEndsTheRunWithAMessage) {
  std::ofstream(folder_ / "throws.log") << "#plain throws\n";
  std::string output;
  EXPECT_EQ(Solve("--input=" + (folder_ / "throws.log").string() +
                      " --output_dir=" + (folder_ / "out").string(),
                  &output),
            3);
  EXPECT_THAT(output, HasSubstr("an exception of an unknown type"));
}

// The exit status and what is written agree.
TEST_F(PluginKindsTest, AnInterruptWhileFilesAreWritten) {
  const auto solve = [&](const std::string& outputs, std::string* output) {
    return Solve("--input=" PLUMBLINE_SOURCE_DIR
                 "/datasets/office.clf.gz --num_threads=1 --outputs=" +
                     outputs + " --output_dir=" + (folder_ / "out").string(),
                 output);
  };
  // The trajectory has all that it has without.
  std::string output;
  EXPECT_EQ(solve("trajectory.tum,interrupt.txt", &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("interrupted when all was done"));
  EXPECT_THAT(Read("out/summary.json"), HasSubstr("\"partial\": false"));
  // The report has no map without structure.
  EXPECT_EQ(solve("interrupt.txt,report.html", &output), 130) << output;
  EXPECT_THAT(output, HasSubstr("what was done so far is written"));
  EXPECT_THAT(Read("out/summary.json"), HasSubstr("\"partial\": true"));
  EXPECT_THAT(Read("out/report.html"),
              HasSubstr("\"partial\":{\"scans_in_log\":"));
}

TEST_F(PluginKindsTest, AreListedUnderTheirFlags) {
  std::string output;
  ASSERT_EQ(Solve("--list_plugins", &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("Log readers (--log_reader)\n  carmen "));
  EXPECT_THAT(output, HasSubstr("\n  plain "));
}

}  // namespace
}  // namespace plumbline
