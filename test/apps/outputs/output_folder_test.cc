#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/sha256.h>
#include <plumbline/outputs/output_folder.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Names = std::set<std::string>;

const Names kOwn = {"a.txt", "b.txt", "c.txt"};

class OutputFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::path(::testing::TempDir()) /
            (std::string("output_folder_") +
             ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(root_);
    folder_ = root_ / "out";
    fs::create_directories(folder_);
  }
  void TearDown() override {
    if (!HasFailure()) fs::remove_all(root_);
  }

  void Write(const fs::path& path, const std::string& text) const {
    std::ofstream(folder_ / path, std::ios::binary) << text;
  }

  std::string Read(const fs::path& path) const {
    std::ifstream file(folder_ / path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }

  Names Files() const {
    Names names;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      names.insert(entry.path().filename().string());
    }
    return names;
  }

  // A run that writes the names, each with its text.
  OutputFolder::Changes RunOnce(
      const std::map<std::string, std::string>& files,
      const std::vector<fs::path>& inputs = {},
      const std::function<void()>& before_step = nullptr) const {
    OutputFolder out(folder_, kOwn, inputs);
    nlohmann::json summary = {{"counts", 0}, {"partial", false}};
    summary["files"] = nlohmann::json::array();
    summary["sha256"] = nlohmann::json::object();
    std::map<std::string, std::string> digests;
    for (const auto& [name, text] : files) {
      std::ofstream(out.staging() / name) << text;
      digests[name] = Sha256OfFile((out.staging() / name).string());
      summary["files"].push_back(name);
      summary["sha256"][name] = digests[name];
    }
    std::ofstream(out.staging() / "summary.json") << summary;
    return out.Commit(digests, before_step);
  }

  // Whether every file of ours is the one whose digest summary.json has.
  bool IsWhole() const {
    const auto summary =
        nlohmann::json::parse(Read("summary.json"), nullptr, false);
    if (!summary.is_object() || summary["partial"] != false) return false;
    for (const std::string& name : kOwn) {
      const bool is_there = fs::exists(folder_ / name);
      if (is_there != summary["sha256"].contains(name)) return false;
      if (is_there &&
          summary["sha256"][name] != Sha256OfFile((folder_ / name).string())) {
        return false;
      }
    }
    return true;
  }

  fs::path root_, folder_;
};

TEST_F(OutputFolderTest, NothingIsLeftOfARunThatWroteNothing) {
  // Who made it has it.
  { const OutputFolder out(folder_, kOwn, {}); }
  EXPECT_TRUE(fs::exists(folder_));
  {
    OutputFolder out(folder_ / "new/deep/", kOwn, {});
    std::ofstream(out.staging() / "a.txt") << "never put in place";
    EXPECT_TRUE(fs::exists(folder_ / "new/deep"));
  }
  EXPECT_EQ(Files(), Names());
  {
    const OutputFolder out(folder_ / "new/deep", kOwn, {});
    Write("new/notes.txt", "mine");
  }
  EXPECT_FALSE(fs::exists(folder_ / "new/deep"));
  EXPECT_EQ(Read("new/notes.txt"), "mine");
}

TEST_F(OutputFolderTest, LaterRunsReplaceEarlierOnes) {
  EXPECT_FALSE(RunOnce({{"a.txt", "1"}, {"b.txt", "1"}}).replaced_whole_run);
  EXPECT_EQ(Files(), (Names{"a.txt", "b.txt", "summary.json"}));
  EXPECT_TRUE(IsWhole());
  Write("notes.txt", "mine");
  const OutputFolder::Changes changes =
      RunOnce({{"a.txt", "2"}, {"c.txt", "2"}});
  EXPECT_THAT(changes.removed, ElementsAre("b.txt"));
  EXPECT_THAT(changes.kept, IsEmpty());
  EXPECT_THAT(changes.replaced_foreign, IsEmpty());
  EXPECT_TRUE(changes.replaced_whole_run);
  EXPECT_EQ(Files(), (Names{"a.txt", "c.txt", "notes.txt", "summary.json"}));
  EXPECT_EQ(Read("a.txt"), "2");
  EXPECT_TRUE(IsWhole());
}

// Whatever a summary.json says.
TEST_F(OutputFolderTest, OnlyWhatARunWroteIsRemoved) {
  const std::string digest = Sha256OfFile("/dev/null");
  Write("thesis.tex", "years of work");
  Write("a.txt", "mine");
  Write("b.txt", "");
  fs::create_directories(folder_ / "sub");
  Write("sub/b.txt", "");
  Write("../b.txt", "");
  for (const std::string text :
       {"", "{", "[]", R"({"files": 3})", R"({"files": {"a": "a"}})",
        R"({"files": ["thesis.tex", "a.txt", "b.txt"]})",
        R"({"files": ["thesis.tex", "a.txt", "../b.txt", "sub/b.txt", 1, null,
            "", ".", ".."], "sha256": 3})",
        R"({"files": ["thesis.tex", "a.txt", "../b.txt", "sub/b.txt", "sub"],
            "sha256": {"thesis.tex": "DIGEST", "a.txt": "DIGEST",
                       "../b.txt": "DIGEST", "sub/b.txt": "DIGEST",
                       "b.txt": "DIGEST", "sub": "DIGEST"}})"}) {
    std::string summary = text;
    for (std::size_t i = summary.find("DIGEST"); i != std::string::npos;
         i = summary.find("DIGEST")) {
      summary.replace(i, 6, digest);
    }
    Write("summary.json", summary);
    EXPECT_THAT(RunOnce({}).removed, IsEmpty()) << summary;
    EXPECT_EQ(Files(),
              (Names{"a.txt", "b.txt", "sub", "summary.json", "thesis.tex"}));
    EXPECT_TRUE(fs::exists(folder_ / "sub/b.txt"));
    EXPECT_TRUE(fs::exists(root_ / "b.txt"));
  }
  // And said to be kept.
  Write("summary.json", R"({"files": ["a.txt", "thesis.tex"]})");
  EXPECT_THAT(RunOnce({}).kept, ElementsAre(HasSubstr("a.txt (written by")));
  RunOnce({{"a.txt", "1"}, {"c.txt", "1"}});
  Write("a.txt", "edited");
  fs::remove(folder_ / "c.txt");
  fs::create_symlink("thesis.tex", folder_ / "c.txt");
  EXPECT_THAT(RunOnce({}).kept,
              ElementsAre("a.txt (changed since it was written)",
                          "c.txt (no regular file)"));
  EXPECT_EQ(Read("c.txt"), "years of work");
}

TEST_F(OutputFolderTest, InputsStay) {
  RunOnce({{"a.txt", "1"}, {"b.txt", "1"}});
  fs::create_symlink(folder_ / "b.txt", root_ / "link");
  for (const fs::path& input :
       std::vector<fs::path>{folder_ / "b.txt", root_ / "link"}) {
    EXPECT_THAT(RunOnce({{"a.txt", "2"}}, {"missing", input}).kept,
                ElementsAre("b.txt (read by this run)"));
    RunOnce({{"a.txt", "1"}, {"b.txt", "1"}});
    try {
      RunOnce({{"b.txt", "2"}}, {input});
      ADD_FAILURE() << input;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("b.txt: is read by this run"));
    }
    EXPECT_EQ(Read("b.txt"), "1");
    EXPECT_TRUE(IsWhole());
  }
  OutputFolder out(folder_, kOwn, {folder_ / "summary.json"});
  EXPECT_THROW(out.CheckTargets({}), Error);
}

TEST_F(OutputFolderTest, ForeignFilesThatAreReplacedAreNamed) {
  Write("a.txt", "mine");
  EXPECT_THAT(RunOnce({{"a.txt", "1"}, {"b.txt", "1"}}).replaced_foreign,
              ElementsAre("a.txt"));
  EXPECT_THAT(RunOnce({{"a.txt", "2"}, {"b.txt", "2"}}).replaced_foreign,
              IsEmpty());
}

TEST_F(OutputFolderTest, WhatCannotBeReplacedIsRefused) {
  fs::create_directories(folder_ / "a.txt");
  ASSERT_EQ(mkfifo((folder_ / "b.txt").c_str(), 0600), 0);
  const OutputFolder out(folder_, kOwn, {});
  EXPECT_THROW(out.CheckTargets({"a.txt"}), Error);
  EXPECT_THROW(out.CheckTargets({"b.txt"}), Error);
  out.CheckTargets({"c.txt"});
  // A link stays one.
  Write("../real", "old");
  fs::create_symlink("../real", folder_ / "c.txt");
  RunOnce({{"c.txt", "new"}});
  EXPECT_TRUE(fs::is_symlink(folder_ / "c.txt"));
  EXPECT_EQ(Read("../real"), "new");
}

// Killed before every single change.
TEST_F(OutputFolderTest, AKilledRunLeavesOneRunWholeOrSaysThatItDoesNot) {
  const std::map<std::string, std::string> old = {{"a.txt", "old"},
                                                  {"b.txt", "old"}};
  const std::map<std::string, std::string> now = {{"a.txt", "new"},
                                                  {"c.txt", "new"}};
  int whole_old = 0, whole_new = 0, mixed = 0;
  for (int killed_at = 0;; ++killed_at) {
    fs::remove_all(folder_);
    RunOnce(old);
    ASSERT_TRUE(IsWhole());
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      int step = 0;
      RunOnce(now, {}, [&] {
        if (step++ == killed_at) _exit(7);
      });
      _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    if (IsWhole()) {
      ++(Read("a.txt") == "old" ? whole_old : whole_new);
    } else {
      const auto summary = nlohmann::json::parse(Read("summary.json"));
      EXPECT_EQ(summary["partial"], true);
      EXPECT_TRUE(summary.contains("mixed"));
      ++mixed;
    }
    // The next run makes it whole again, and nothing stays behind.
    RunOnce({{"c.txt", "last"}});
    EXPECT_TRUE(IsWhole());
    EXPECT_EQ(Files(), (Names{"c.txt", "summary.json"})) << killed_at;
    if (WEXITSTATUS(status) == 0) break;
  }
  // The marking, a removal, two files and the summary; then the clearing up.
  EXPECT_EQ(whole_old, 1);
  EXPECT_EQ(mixed, 4);
  EXPECT_EQ(whole_new, 2);
}

TEST_F(OutputFolderTest, LeftoversOfDeadProcesses) {
  // A process that has ended.
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) _exit(0);
  ASSERT_EQ(waitpid(child, nullptr, 0), child);
  const std::string dead = ".tmp" + std::to_string(child) + "_0";
  const std::string alive = ".tmp" + std::to_string(getpid()) + "_0";
  Write("a.txt" + dead, "");
  Write("a.txt" + alive, "");
  Write("thesis.tex" + dead, "");
  Write("a.txt.tmp", "");
  Write("a.txt.tmp1", "");
  Write("a.txt.tmp_0", "");
  Write("a.txt.tmp0_0", "");
  Write("a.txt.tmp-1_0", "");
  Write("b.txt" + dead, "");
  fs::create_directories(folder_ / ".plumbline_files.dead01");
  Write(".plumbline_files.dead01/a.txt", "");
  Write(".plumbline_files.dead01/b.txt" + dead, "");
  fs::create_directories(folder_ / ".plumbline_files.mine01");
  Write(".plumbline_files.mine01/thesis.tex", "");
  fs::create_directories(folder_ / ".plumbline_files.live01");
  Write(".plumbline_files.live01/a.txt", "");
  const int live = open((folder_ / ".plumbline_files.live01").c_str(),
                        O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(flock(live, LOCK_EX), 0);
  const OutputFolder out(folder_, kOwn, {folder_ / ("b.txt" + dead)});
  close(live);
  EXPECT_THAT(out.cleaned(),
              ElementsAre(".plumbline_files.dead01", "a.txt" + dead));
  EXPECT_EQ(
      Files(),
      (Names{"a.txt" + alive, "thesis.tex" + dead, "a.txt.tmp", "a.txt.tmp1",
             "a.txt.tmp_0", "a.txt.tmp0_0", "a.txt.tmp-1_0", "b.txt" + dead,
             ".plumbline_files.mine01", ".plumbline_files.live01"}));
  EXPECT_EQ(Read(".plumbline_files.mine01/thesis.tex"), "");
  EXPECT_TRUE(fs::exists(folder_ / ".plumbline_files.mine01/thesis.tex"));
  EXPECT_TRUE(fs::exists(folder_ / ".plumbline_files.live01/a.txt"));
}

// A run that fails before its files are in place changes nothing.
TEST_F(OutputFolderTest, AFailedRunChangesNothing) {
  RunOnce({{"a.txt", "1"}});
  {
    OutputFolder out(folder_, kOwn, {});
    std::ofstream(out.staging() / "a.txt") << "2";
    EXPECT_EQ(
        out.InPlace(Error((out.staging() / "a.txt").string(), 0, "x", "y"))
            .what(),
        (folder_ / "a.txt").string() + ": x: expected y");
  }
  EXPECT_EQ(Read("a.txt"), "1");
  EXPECT_EQ(Files(), (Names{"a.txt", "summary.json"}));
}

// In a process of its own, whose working folder is removed.
TEST_F(OutputFolderTest, ARelativeFolderNeedsAWorkingFolder) {
  const fs::path gone = root_ / "gone";
  fs::create_directories(gone);
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    if (chdir(gone.c_str()) != 0 || rmdir(gone.c_str()) != 0) _exit(9);
    try {
      const OutputFolder out("out", kOwn, {});
      _exit(1);
    } catch (const Error& error) {
      const std::string what = error.what();
      _exit(what.find("out: the working folder is not there") == 0 ? 0 : 2);
    }
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST_F(OutputFolderTest, AFolderThatVanishedIsMadeAgain) {
  OutputFolder out(folder_, kOwn, {});
  fs::remove_all(folder_);
  std::ofstream(out.staging() / "summary.json") << "{}";
  out.Commit({});
  EXPECT_EQ(Files(), Names{"summary.json"});
}

}  // namespace
}  // namespace plumbline
