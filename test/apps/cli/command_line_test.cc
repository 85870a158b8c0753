#include <gflags/gflags.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/cli/command_line.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

DEFINE_uint64(test_number, 1, "For a test");
DEFINE_bool(test_switch, false, "For a test");
DEFINE_bool(test_other, false, "For a test");
DEFINE_string(test_words_file, "", "");
DEFINE_string(test_word, "", "For a test");

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Words = std::vector<std::string>;

class CommandLineTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              ("command_line_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return (folder_ / name).string();
  }

  // Problems of a flag file with this text.
  Words Problems(const std::string& text) {
    return ReadCommandLine({"--flagfile=" + Write("my.flags", text)}).problems;
  }

  fs::path folder_;
};

TEST_F(CommandLineTest, FlagFilesStandWhereTheyAreNamed) {
  const std::string inner = Write("inner.flags", "--test_other");
  const std::string outer =
      Write("outer.flags",
            "\xEF\xBB\xBF# mine\r\n\n --test_switch \n-notest_switch\r\n"
            "--test_number=7\n--flagfile=" +
                inner + "\n");
  for (const Words& naming :
       {Words{"--flagfile=" + outer}, Words{"--flagfile", outer},
        Words{"-flagfile=" + outer}}) {
    Words arguments = {"--test_number=1"};
    arguments.insert(arguments.end(), naming.begin(), naming.end());
    arguments.push_back("--test_number=3");
    const CommandLine line = ReadCommandLine(arguments);
    EXPECT_THAT(line.problems, IsEmpty());
    EXPECT_THAT(line.arguments, ElementsAre("--test_number=1", "--test_switch",
                                            "-notest_switch", "--test_number=7",
                                            "--test_other", "--test_number=3"));
  }
  const CommandLine twice =
      ReadCommandLine({"--flagfile=" + inner + "," + inner});
  EXPECT_THAT(twice.problems, IsEmpty());
  EXPECT_THAT(twice.arguments, ElementsAre("--test_other", "--test_other"));
}

TEST_F(CommandLineTest, BehindTwoDashesNothingIsRead) {
  const Words arguments = {"--test_switch", "--", "command", "--flagfile=none",
                           "--notest_switch=false"};
  const CommandLine line = ReadCommandLine(arguments);
  EXPECT_THAT(line.problems, IsEmpty());
  EXPECT_EQ(line.arguments, arguments);
}

TEST_F(CommandLineTest, LinesThatAreNotUnderstood) {
  EXPECT_THAT(Problems("--test_switch\n--tets_number=1\n"),
              ElementsAre(AllOf(
                  HasSubstr("my.flags:2: there is no flag '--tets_number' "
                            "(--test_number?): expected"))));
  EXPECT_THAT(Problems("test_number=1\n"),
              ElementsAre(HasSubstr("my.flags:1: 'test_number=1' is no flag")));
  EXPECT_THAT(
      Problems("--test_number = 1\n"),
      ElementsAre(HasSubstr("my.flags:1: there is no flag '--test_number '")));
  EXPECT_THAT(
      Problems("--test_number 1\n"),
      ElementsAre(HasSubstr("my.flags:1: there is no flag '--test_number 1'")));
  EXPECT_THAT(Problems("--test_number= 1x\n"),
              ElementsAre(HasSubstr("my.flags:1: --test_number= 1x: cannot be "
                                    "read: expected a whole number from 0")));
  EXPECT_THAT(Problems("--test_number\n"),
              ElementsAre(HasSubstr("has no value")));
  EXPECT_THAT(Problems("--notest_number\n"), ElementsAre(HasSubstr("no flag")));
  EXPECT_THAT(
      Problems("--notest_switch=false\n"),
      ElementsAre(HasSubstr("my.flags:1: --notest_switch=false: 'no' and")));
  EXPECT_THAT(Problems("--\n"), ElementsAre(HasSubstr("is no flag")));
  EXPECT_THAT(Problems("\x01\xff\x1b[2J"),
              ElementsAre(HasSubstr("my.flags:1: '\xEF\xBF\xBD")));
  EXPECT_THAT(Problems(std::string(1 << 21, 'x')),
              ElementsAre(HasSubstr("holds more than")));
}

TEST_F(CommandLineTest, FilesThatCannotBeRead) {
  const auto problems = [](const std::string& name) {
    return ReadCommandLine({"--flagfile=" + name}).problems;
  };
  EXPECT_THAT(problems("/no/such"), ElementsAre(HasSubstr("No such file")));
  EXPECT_THAT(problems(folder_.string()),
              ElementsAre(HasSubstr("cannot be read")));
  EXPECT_THAT(problems("/dev/zero"),
              ElementsAre(HasSubstr("holds bytes that are zero")));
  EXPECT_THAT(problems(""), ElementsAre(HasSubstr("no name of a file")));
  const std::string self = (folder_ / "self.flags").string();
  Write("self.flags", "--test_switch\n--flagfile=" + self + "\n");
  EXPECT_THAT(problems(self), ElementsAre(AllOf(HasSubstr("self.flags:2: "),
                                                HasSubstr("names itself"))));
  Write("a.flags", "--flagfile=" + (folder_ / "b.flags").string());
  Write("b.flags", "--flagfile=" + (folder_ / "a.flags").string());
  EXPECT_THAT(problems((folder_ / "a.flags").string()),
              ElementsAre(HasSubstr("b.flags:1: ")));
}

TEST_F(CommandLineTest, WordsOfTheCommandLine) {
  const auto problems = [](const Words& words) {
    return ReadCommandLine(words).problems;
  };
  EXPECT_THAT(
      problems({"--notest_switch=false"}),
      ElementsAre(HasSubstr("--notest_switch=false: 'no' and a value")));
  EXPECT_THAT(problems({"--test_number=-5"}),
              ElementsAre("--test_number=-5: cannot be read: expected a whole "
                          "number from 0 on"));
  EXPECT_THAT(problems({"--test_number", "x", "--test_switch=perhaps"}),
              ElementsAre(HasSubstr("--test_number=x: cannot be read"),
                          "--test_switch=perhaps: cannot be read: expected "
                          "true or false"));
  EXPECT_THAT(problems({"--test_number"}),
              ElementsAre(HasSubstr("--test_number: has no value")));
  // Only tried.
  EXPECT_THAT(problems({"--test_number=77", "--test_switch"}), IsEmpty());
  EXPECT_EQ(FLAGS_test_number, 1u);
  EXPECT_THAT(problems({"--test_word", "--test_switch"}),
              ElementsAre(HasSubstr("--test_word: has no value")));
  EXPECT_THAT(problems({"--test_word", "-1", "--test_number", "7",
                        "--notest_switch", "word", "-"}),
              IsEmpty());
}

TEST_F(CommandLineTest, WhatAFlagMayHaveBeen) {
  EXPECT_THAT(ReadCommandLine({"--test_numbr=1"}).problems,
              ElementsAre(HasSubstr("no such flag (--test_number?)")));
  EXPECT_THAT(ReadCommandLine({"--test_words=1"}).problems,
              ElementsAre(HasSubstr(
                  "no such flag (--test_word or --test_words_file?)")));
}

}  // namespace
}  // namespace plumbline
