#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/cli/help.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "apps/shell.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  std::string line;
  while (std::getline(stream, line)) lines.push_back(line);
  return lines;
}

// Output of a command on both streams.
std::string OutputOf(const std::string& command, int* status) {
  std::string output;
  *status = RunInShell(command, &output);
  return output;
}

bool IsInstalled(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) ==
         0;
}

AppInfo TestInfo() {
  AppInfo info;
  info.name = "plumbline_test";
  info.summary =
      "Shows how a summary that is quite a bit longer than eighty columns is "
      "wrapped at a blank. And more.";
  info.usage = {"--input=FILE [flags]"};
  info.example =
      "plumbline_test --input=a_file_with_a_long_name.clf --output_dir=and/"
      "a/folder --more=1";
  info.groups = {{"Display", {"quiet", "no_such_flag"}},
                 {"Help", {"long", "choice"}}};
  return info;
}

std::vector<FlagDescription> TestFlags() {
  return {{"long",
           "string",
           "A word that no line holds: alpha,beta/gamma,delta/epsilon,zeta/"
           "eta,theta/iota,kappa/lambda,mu/nu,xi/omicron,pi/rho,sigma",
           "",
           {},
           ""},
          {"choice",
           "string",
           "Where to go: north or south.",
           "north",
           {"north", "south"},
           ""},
          {"colour", "string", "Its colour.", "red", {"red", "green"}, ""},
          {"number", "int32", "How many; it's a 'number'", "3", {}, "0 to 9"},
          {"quiet", "bool", "Print nothing.", "false", {}, ""}};
}

TEST(HelpTest, FitsEightyColumnsAndGroupsFlags) {
  const std::string help = HelpText(TestInfo(), TestFlags());
  EXPECT_THAT(help, HasSubstr("\nDisplay:\n  --[no]quiet\n"));
  EXPECT_THAT(help, HasSubstr("(default false)"));
  EXPECT_THAT(help, HasSubstr("\nHelp:\n  --long=TEXT\n"));
  EXPECT_THAT(help, HasSubstr("\nOther flags:\n"));
  EXPECT_THAT(help, HasSubstr("How many; it's a 'number' (0 to 9; default 3)"));
  // Choices are listed once, whether the description does or not.
  EXPECT_THAT(help, HasSubstr("Where to go: north or south (default north)\n"));
  EXPECT_THAT(help, HasSubstr("Its colour (red, green; default red)\n"));
  // A command that is too long can be pasted as it is.
  EXPECT_THAT(help,
              HasSubstr("\nExample:\n  plumbline_test "
                        "--input=a_file_with_a_long_name.clf "
                        "--output_dir=and/a/folder \\\n      --more=1\n"));
  // Libraries' flags stay out.
  EXPECT_THAT(help, Not(HasSubstr("--logtostderr")));
  for (const std::string& line : LinesOf(help)) {
    EXPECT_LE(line.size(), 80u) << line;
  }
  // The long word is all there.
  std::string joined;
  for (const std::string& line : LinesOf(help)) {
    joined += line.substr(std::min(line.size(), line.find_first_not_of(' ')));
  }
  EXPECT_THAT(joined, HasSubstr("eta,theta/iota,kappa/lambda,mu/nu,xi/omicron,"
                                "pi/rho,sigma"));
}

TEST(HelpTest, ExitStatuses) {
  AppInfo info = TestInfo();
  info.statuses = {{4, "Elsewhere"}, {3, "or worse"}};
  const std::string help = HelpText(info, TestFlags());
  EXPECT_THAT(help, HasSubstr("\nExit status:\n  0\n      Success\n  1\n"));
  EXPECT_THAT(help, HasSubstr("\n  4\n      Elsewhere\n  130\n"));
  EXPECT_THAT(help, HasSubstr("lack of memory; or worse\n"));
  EXPECT_THAT(HelpText(TestInfo(), TestFlags()), Not(HasSubstr("\n  4\n")));
  EXPECT_THAT(ManPage(info, TestFlags()),
              HasSubstr("\n.B 4\nElsewhere\n.TP\n.B 130\n"));
}

TEST(HelpTest, ManPage) {
  const std::string page = ManPage(TestInfo(), TestFlags());
  EXPECT_THAT(page, ::testing::StartsWith(".TH PLUMBLINE_TEST 1 "));
  EXPECT_THAT(page, HasSubstr("plumbline_test \\- shows how a summary"));
  EXPECT_THAT(page, HasSubstr("\n.B \\-\\-number=NUMBER\n"
                              "How many; it\\(aqs a \\(aqnumber\\(aq"));
  for (const char* section :
       {"SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "EXAMPLE"}) {
    EXPECT_THAT(page, HasSubstr(std::string("\n.SH ") + section + "\n"));
  }
  // Up to the end of a sentence, not of a word.
  AppInfo info = TestInfo();
  info.summary = "Writes a summary.json for you: fine. And more.";
  EXPECT_THAT(ManPage(info, TestFlags()),
              HasSubstr("plumbline_test \\- writes a summary.json for you\n"));
  // Lines with a value that cannot be broken are not stretched.
  EXPECT_THAT(page, HasSubstr("\n.ad l\n"));
  // No line is taken for a command that is none.
  for (const std::string& line : LinesOf(page)) {
    if (line[0] != '.') continue;
    const std::string command = line.substr(0, line.find(' '));
    EXPECT_THAT((std::vector<std::string>{".TH", ".SH", ".SS", ".TP", ".B",
                                          ".br", ".nf", ".fi", ".ad"}),
                ::testing::Contains(command));
  }
}

// Every binary that was built.
class BinariesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const auto& entry :
         std::filesystem::directory_iterator(PLUMBLINE_BIN_DIR)) {
      const std::string name = entry.path().filename().string();
      if (name.rfind("plumbline_", 0) == 0 && !entry.path().has_extension()) {
        binaries_.push_back(entry.path().string());
      }
    }
    std::sort(binaries_.begin(), binaries_.end());
    ASSERT_GE(binaries_.size(), 4u);
  }

  static std::string NameOf(const std::string& binary) {
    return std::filesystem::path(binary).filename().string();
  }

  // Names of the flags that the project's own sources define, by gflags.
  static std::vector<std::string> OwnFlagNames(const std::string& binary) {
    int status = 0;
    const std::string xml = OutputOf(binary + " --helpxml", &status);
    const auto text = [&xml](std::size_t from, const std::string& tag) {
      const std::size_t begin = xml.find("<" + tag + ">", from);
      if (begin == std::string::npos) return std::string();
      const std::size_t end = xml.find("</" + tag + ">", begin);
      return xml.substr(begin + tag.size() + 2, end - begin - tag.size() - 2);
    };
    std::vector<std::string> names;
    for (std::size_t at = xml.find("<flag>"); at != std::string::npos;
         at = xml.find("<flag>", at + 1)) {
      if (text(at, "file").find("/apps/") != std::string::npos) {
        names.push_back(text(at, "name"));
      }
    }
    return names;
  }

  std::vector<std::string> binaries_;
};

TEST_F(BinariesTest, HelpHasEveryFlagInEightyColumns) {
  for (const std::string& binary : binaries_) {
    SCOPED_TRACE(binary);
    int status = -1;
    const std::string help = OutputOf(binary + " --help", &status);
    EXPECT_EQ(status, 0);
    for (const std::string& line : LinesOf(help)) {
      EXPECT_LE(line.size(), 80u) << line;
    }
    EXPECT_THAT(help, HasSubstr("\nExample:\n  " + NameOf(binary)));
    EXPECT_THAT(help, Not(HasSubstr("Other flags:")));
    const std::vector<std::string> names = OwnFlagNames(binary);
    EXPECT_GE(names.size(), 4u);
    for (const std::string& name : names) {
      const bool is_there =
          help.find("\n  --" + name + "=") != std::string::npos ||
          help.find("\n  --[no]" + name + "\n") != std::string::npos;
      EXPECT_TRUE(is_there) << name;
    }
    EXPECT_THAT(OutputOf(binary + " --help --help_format=html", &status),
                HasSubstr("text, man, bash"));
    EXPECT_NE(status, 0);
  }
}

TEST_F(BinariesTest, ManPagesAreBuiltAndInOrder) {
  for (const std::string& binary : binaries_) {
    SCOPED_TRACE(binary);
    int status = -1;
    const std::string page =
        OutputOf(binary + " --help --help_format=man", &status);
    EXPECT_EQ(status, 0);
    for (const std::string& name : OwnFlagNames(binary)) {
      const bool is_there =
          page.find("\n.B \\-\\-" + name + "=") != std::string::npos ||
          page.find("\n.B \\-\\-[no]" + name + "\n") != std::string::npos;
      EXPECT_TRUE(is_there) << name;
    }
    // The page that is installed.
    std::ifstream file(std::filesystem::path(PLUMBLINE_BIN_DIR)
                           .parent_path()
                           .append("apps")
                           .append(NameOf(binary) + ".1"));
    ASSERT_TRUE(file);
    std::ostringstream built;
    built << file.rdbuf();
    EXPECT_EQ(built.str(), page);
  }
}

TEST_F(BinariesTest, RoffHasNoComplaints) {
  if (!IsInstalled("groff") && !IsInstalled("nroff")) {
    GTEST_SKIP() << "groff is not installed";
  }
  for (const std::string& binary : binaries_) {
    int status = -1;
    EXPECT_EQ(OutputOf(binary + " --help --help_format=man | " +
                           (IsInstalled("groff") ? "groff -man -Tutf8 -ww"
                                                 : "nroff -man -ww") +
                           " 2>&1 >/dev/null",
                       &status),
              "")
        << binary;
    EXPECT_EQ(status, 0);
  }
}

// What bash offers for the words of a command line, the last of which is being
// typed.
std::vector<std::string> Complete(const std::string& binary,
                                  const std::vector<std::string>& words) {
  const std::string name = std::filesystem::path(binary).filename().string();
  std::string command = "bash -c 'source <(" + binary +
                        " --help --help_format=bash); COMP_WORDS=(" + name;
  for (const std::string& word : words) command += " \"" + word + "\"";
  command += "); COMP_CWORD=" + std::to_string(words.size()) + "; _" + name +
             "; printf \"%s\\n\" \"${COMPREPLY[@]}\"'";
  int status = -1;
  std::vector<std::string> offers;
  for (const std::string& line : LinesOf(OutputOf(command, &status))) {
    if (!line.empty()) offers.push_back(line);
  }
  EXPECT_EQ(status, 0);
  return offers;
}

TEST_F(BinariesTest, BashCompletes) {
  const std::string solve = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_solve";
  EXPECT_THAT(Complete(solve, {"--delta_t"}),
              ElementsAre("--delta_threshold="));
  EXPECT_THAT(Complete(solve, {"--nostr"}), ElementsAre("--nostructure"));
  EXPECT_THAT(Complete(solve, {"--delta_mode", "=", "fr"}),
              ElementsAre("frozen"));
  EXPECT_THAT(Complete(solve, {"--refine", "="}),
              ElementsAre("none", "map", "full"));
  EXPECT_THAT(Complete(solve, {"--quiet", "=", "t"}), ElementsAre("true"));
  EXPECT_THAT(Complete(solve, {"--seed", "=", "1"}), IsEmpty());
  EXPECT_THAT(Complete(solve, {"--input", "=",
                               PLUMBLINE_SOURCE_DIR "/datasets/office.cl"}),
              ElementsAre(PLUMBLINE_SOURCE_DIR "/datasets/office.clf.gz"));
  for (const std::string& binary : binaries_) {
    for (const std::string& name : OwnFlagNames(binary)) {
      EXPECT_THAT(Complete(binary, {"--" + name}), Not(IsEmpty()))
          << binary << " " << name;
      break;  // each call starts bash: one flag shows that the script runs
    }
  }
}

}  // namespace
}  // namespace plumbline
