// plumbline_sweep as a process.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/frontend/input_stream.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "apps/shell.h"

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class SweepBinaryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    binary_ = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_sweep";
    if (!std::ifstream(binary_)) GTEST_SKIP() << binary_ << " is not built";
    folder_ = ::testing::TempDir() + "sweep_binary_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name() +
              "_" + std::to_string(getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    // Its figure is x^2 + seed / 10; it notes every run.
    program_ = folder_ + "/program.sh";
    std::ofstream(program_) << R"(#!/bin/sh
x=0 fail= sleep=0
for flag; do
  case $flag in
    --output_dir=*) out=${flag#*=};;
    --seed=*) seed=${flag#*=};;
    --x=*) x=${flag#*=};;
    --fail=*) fail=${flag#*=};;
    --sleep=*) sleep=${flag#*=};;
  esac
done
echo "$x $seed" >> )" << folder_
                            << R"(/notes
sleep $sleep
if [ "$x" = "$fail" ]; then kill -ABRT $$; fi
if [ "$x" = slow ]; then sleep 60; fi
echo "{\"y\": $((x * x)).$seed, \"input\": \"i\"}" > $out/summary.json
)";
    fs::permissions(program_, fs::perms::owner_all);
  }
  void TearDown() override {
    if (!folder_.empty() && !HasFailure()) fs::remove_all(folder_);
  }

  std::string Read(const std::string& name) const {
    std::ifstream file(folder_ + "/" + name);
    return {std::istreambuf_iterator<char>(file),
            std::istreambuf_iterator<char>()};
  }

  std::vector<std::string> Notes() const {
    std::istringstream text(Read("notes"));
    std::vector<std::string> notes;
    std::string line;
    while (std::getline(text, line)) notes.push_back(line);
    std::sort(notes.begin(), notes.end());
    return notes;
  }

  int Run(const std::string& arguments, std::string* output) {
    return RunInShell(binary_ + " " + arguments, output);
  }

  pid_t Start(const std::vector<std::string>& flags) {
    const pid_t process = fork();
    if (process == 0) {
      std::vector<char*> arguments = {const_cast<char*>(binary_.c_str())};
      for (const std::string& flag : flags) {
        arguments.push_back(const_cast<char*>(flag.c_str()));
      }
      arguments.push_back(nullptr);
      execv(binary_.c_str(), arguments.data());
      _exit(99);
    }
    return process;
  }

  // Records of runs below a folder.
  int Records(const std::string& name) const {
    int count = 0;
    std::error_code error;
    for (const auto& run :
         fs::directory_iterator(folder_ + "/" + name + "/runs", error)) {
      count += fs::exists(run.path() / "run.json");
    }
    return count;
  }

  // Up to 5 minutes: binaries under sanitizers are slow.
  static bool WaitFor(const std::function<bool()>& condition) {
    for (int i = 0; i < 30000; ++i) {
      if (condition()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }

  std::string binary_;
  std::string folder_;
  std::string program_;
};

TEST_F(SweepBinaryTest, ATableOfAllRuns) {
  std::string output;
  ASSERT_EQ(Run("--grid='x=3,1:1:2' --trials=2 --seed=5 --jobs=2 "
                "--minimize=y --output_dir=" +
                    folder_ + "/out -- " + program_,
                &output),
            0)
      << output;
  EXPECT_EQ(Read("out/sweep.csv"),
            "run,x,seed,status,reason,y\n"
            "\"x=3,seed=5\",3,5,done,,9.5\n"
            "\"x=3,seed=6\",3,6,done,,9.6\n"
            "\"x=1,seed=5\",1,5,done,,1.5\n"
            "\"x=1,seed=6\",1,6,done,,1.6\n"
            "\"x=2,seed=5\",2,5,done,,4.5\n"
            "\"x=2,seed=6\",2,6,done,,4.6\n");
  EXPECT_THAT(output, HasSubstr("runs: 6; 6 done, 0 failed, 0 timed out\n"));
  EXPECT_THAT(output, HasSubstr("best: --x=1: y = 1.55 [1.5, 1.6]\n"));
  EXPECT_EQ(Read("out/best.flags"), "--x=1\n");
  EXPECT_THAT(Read("out/sweep.svg"), HasSubstr("</svg>"));
  EXPECT_THAT(Read("out/sweep.html"), HasSubstr("Least y"));

  // More values and another question: only what is new is run.
  ASSERT_EQ(Run("--grid='x=1,4' --trials=2 --seed=5 --maximize=y "
                "--output_dir=" +
                    folder_ + "/out -- " + program_,
                &output),
            0)
      << output;
  EXPECT_THAT(Notes(), ::testing::ElementsAre("1 5", "1 6", "2 5", "2 6", "3 5",
                                              "3 6", "4 5", "4 6"));
  EXPECT_EQ(Read("out/best.flags"), "--x=4\n");

  // Without a command the sweep in the folder goes on, and its question with
  // it.
  ASSERT_EQ(Run("--output_dir=" + folder_ + "/out", &output), 0);
  EXPECT_EQ(Notes().size(), 8u);
  EXPECT_THAT(output, HasSubstr("best: --x=4"));
  EXPECT_EQ(Read("out/best.flags"), "--x=4\n");
  EXPECT_THAT(Read("out/sweep.html"), HasSubstr("Most y"));
  // Without a question there is no answer of an earlier one.
  ASSERT_EQ(Run("--minimize= --output_dir=" + folder_ + "/out", &output), 0);
  EXPECT_THAT(output, HasSubstr("best.flags: removed"));
  EXPECT_FALSE(fs::exists(folder_ + "/out/best.flags"));
  ASSERT_EQ(Run("--output_dir=" + folder_ + "/out", &output), 0);
  EXPECT_FALSE(fs::exists(folder_ + "/out/best.flags"));
  EXPECT_EQ(Run("--figures=z --output_dir=" + folder_ + "/out", &output), 2);
  EXPECT_THAT(output, HasSubstr("--figures: no run has a figure 'z'"));
  ASSERT_EQ(
      Run("--figures=y --minimize=y --output_dir=" + folder_ + "/out", &output),
      0);
  EXPECT_EQ(Read("out/best.flags"), "--x=1\n");
}

// Errors of walls of which a run found none are null, and no least errors.
TEST_F(SweepBinaryTest, AFigureThatIsNotKnownIsNotTheBest) {
  const std::string program = folder_ + "/unknown.sh";
  std::ofstream(program) << R"(#!/bin/sh
for flag; do
  case $flag in
    --output_dir=*) out=${flag#*=};;
    --x=*) x=${flag#*=};;
  esac
done
y=$x
if [ $x -lt 3 ]; then y=null; fi
echo "{\"y\": $y, \"z\": null, \"input\": \"i\"}" > $out/summary.json
)";
  fs::permissions(program, fs::perms::owner_all);
  std::string output;
  ASSERT_EQ(Run("--grid=x=1,2,3,4 --jobs=1 --minimize=y --output_dir=" +
                    folder_ + "/out -- " + program,
                &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("best: --x=3: y = 3\n"));
  EXPECT_EQ(Read("out/best.flags"), "--x=3\n");
  // Known of none.
  ASSERT_EQ(Run("--minimize=z --output_dir=" + folder_ + "/out", &output), 0)
      << output;
  EXPECT_THAT(output, HasSubstr("no setting has all its runs done with a "
                                "figure 'z'"));
}

TEST_F(SweepBinaryTest, FilesOfOthersAreNeitherReplacedNorRemoved) {
  const std::string command =
      "--grid=x=1,2 --output_dir=" + folder_ + "/out -- " + program_;
  std::string output;
  fs::create_directories(folder_ + "/out");
  for (const char* name : {"sweep.csv", "sweep.html", "best.flags", "runs"}) {
    const std::string path = folder_ + "/out/" + name;
    std::ofstream(path) << "of somebody else";
    EXPECT_EQ(Run(command, &output), 2) << name;
    EXPECT_THAT(output, HasSubstr(std::string(name) + ": is there"));
    EXPECT_EQ(Read(std::string("out/") + name), "of somebody else");
    fs::remove(path);
  }
  EXPECT_TRUE(Notes().empty());

  ASSERT_EQ(Run("--minimize=y " + command, &output), 0) << output;
  EXPECT_EQ(Read("out/best.flags"), "--x=1\n");
  std::ofstream(folder_ + "/out/best.flags") << "--x=2\n# edited\n";
  EXPECT_EQ(Run("--maximize=y " + command, &output), 2);
  EXPECT_THAT(output, HasSubstr("best.flags: is not what this sweep wrote"));
  EXPECT_EQ(Run(command, &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("best.flags is not what this sweep wrote"));
  EXPECT_EQ(Read("out/best.flags"), "--x=2\n# edited\n");
}

TEST_F(SweepBinaryTest, FailuresAndTimeOutsAreRows) {
  std::string output;
  const std::string out = " --output_dir=" + folder_ + "/out";
  ASSERT_EQ(Run("--grid='x=1,2,slow' --time_limit=1 --jobs=3 --minimize=y" +
                    out + " -- " + program_ + " --fail=2",
                &output),
            2)
      << output;
  EXPECT_THAT(output, HasSubstr("x=2,seed=1: failed: signal 6 (Aborted)\n"));
  EXPECT_THAT(output, HasSubstr("x=slow,seed=1: timed out: longer than 1 s\n"));
  EXPECT_EQ(Read("out/sweep.csv"),
            "run,x,seed,status,reason,y\n"
            "\"x=1,seed=1\",1,1,done,,1.1\n"
            "\"x=2,seed=1\",2,1,failed,signal 6 (Aborted),\n"
            "\"x=slow,seed=1\",slow,1,timed_out,longer than 1 s,\n");
  EXPECT_THAT(output, HasSubstr("3; 1 done, 1 failed, 1 timed out"));
  EXPECT_EQ(Notes().size(), 3u);
  ASSERT_EQ(Run(out.substr(1), &output), 2);
  EXPECT_EQ(Notes().size(), 3u);
  ASSERT_EQ(Run("--retry_failed" + out, &output), 2);
  EXPECT_EQ(Notes().size(), 5u);
}

TEST_F(SweepBinaryTest, WhatCannotComeOutIsRefusedAtOnce) {
  std::string output;
  const std::string out = " --output_dir=" + folder_ + "/out";
  // A value that the command would refuse, among good ones.
  EXPECT_EQ(Run("--grid=delta_threshold=0.1,0.2,50" + out +
                    " -- plumbline_solve --input=none",
                &output),
            2);
  EXPECT_THAT(output,
              HasSubstr("the command would refuse it: --delta_threshold=50: "
                        "out of range"));
  // One that is no number, and that only the run looks up.
  EXPECT_EQ(Run("--grid='hierarchy=foo,same_wall'" + out +
                    " -- plumbline_solve --input=none",
                &output),
            2);
  EXPECT_THAT(output, HasSubstr("the command would refuse it: --hierarchy: "));
  EXPECT_EQ(Run("--grid=delta_treshold=0.1" + out +
                    " -- plumbline_solve --input=none",
                &output),
            2);
  EXPECT_THAT(output, HasSubstr("(--delta_threshold?)"));
  EXPECT_EQ(Run("--grid=x=1 --minimize=evaluation.y" + out + " -- " + program_,
                &output),
            2);
  EXPECT_THAT(output, HasSubstr("there is none: expected --evaluate"));
  EXPECT_EQ(Run("--grid=delta_threshold=0.1 --minimize=costs.total" + out +
                    " -- plumbline_solve",
                &output),
            2);
  EXPECT_THAT(output, HasSubstr("no run will have a figure 'costs.total' "
                                "(cost?)"));
  EXPECT_EQ(Run("--grid=x=0.05:0.3" + out + " -- " + program_, &output), 2);
  EXPECT_THAT(output, HasSubstr("the range '0.05:0.3' has no step"));
  EXPECT_EQ(Notes().size(), 0u);
  // The folder for temporary files is one of them.
  ASSERT_EQ(setenv("TMPDIR", (folder_ + "/none").c_str(), 1), 0);
  EXPECT_EQ(Run("--grid=delta_threshold=0.1" + out +
                    " -- plumbline_solve --input=none",
                &output),
            2);
  unsetenv("TMPDIR");
  EXPECT_THAT(output, HasSubstr("TMPDIR: a temporary file cannot be made"));
  // What only a run can tell is told by the first.
  EXPECT_EQ(
      Run("--grid=x=1:1:9 --jobs=1 --minimize=z" + out + " -- " + program_,
          &output),
      2);
  EXPECT_THAT(output, HasSubstr("--minimize: no run has a figure 'z'"));
  EXPECT_LE(Notes().size(), 2u);
}

TEST_F(SweepBinaryTest, KilledInTheMiddleAndResumedGivesTheSameTable) {
  const std::vector<std::string> command = {"--", program_, "--sleep=0.1",
                                            "--fail=3"};
  const auto flags = [&](const std::string& name) {
    std::vector<std::string> all = {"--grid=x=1:1:6", "--trials=3", "--jobs=2",
                                    "--output_dir=" + folder_ + "/" + name};
    all.insert(all.end(), command.begin(), command.end());
    return all;
  };
  int status = 0;
  // Three runs fail: 2.
  ASSERT_EQ(waitpid(Start(flags("whole")), &status, 0) > 0, true);
  ASSERT_TRUE(WIFEXITED(status));
  ASSERT_EQ(WEXITSTATUS(status), 2);
  fs::remove(folder_ + "/notes");

  const pid_t victim = Start(flags("killed"));
  ASSERT_TRUE(WaitFor([&] { return Records("killed") >= 5; }));
  kill(victim, SIGKILL);
  waitpid(victim, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_FALSE(fs::exists(folder_ + "/killed/sweep.csv"));
  EXPECT_LT(Records("killed"), 18);
  ASSERT_GT(waitpid(Start(flags("killed")), &status, 0), 0);
  ASSERT_TRUE(WIFEXITED(status));
  ASSERT_EQ(WEXITSTATUS(status), 2);
  EXPECT_EQ(Read("killed/sweep.csv"), Read("whole/sweep.csv"));
  EXPECT_THAT(Read("killed/sweep.csv"), HasSubstr("x=6,seed=3"));
  // Only the two that were at work, and one that had its record to write, may
  // have been begun twice.
  EXPECT_LE(Notes().size(), 18u + 3u);
}

// With the program that sweeps are for, killed while it is at work.
TEST_F(SweepBinaryTest, KilledWhileSolvingAndResumedGivesTheSameTable) {
  InputStream input(std::string(PLUMBLINE_SOURCE_DIR) +
                    "/datasets/office.clf.gz");
  const std::string log = input.ReadRest();
  std::ofstream(folder_ + "/office.clf", std::ios::binary)
      << log.substr(0, log.find('\n', log.size() / 8) + 1);
  const auto flags = [&](const std::string& name) {
    return std::vector<std::string>{"--grid=delta_threshold=0.05:0.1:0.55",
                                    "--jobs=1",
                                    "--notimes",
                                    "--output_dir=" + folder_ + "/" + name,
                                    "--",
                                    "plumbline_solve",
                                    "--input=" + folder_ + "/office.clf",
                                    "--outputs=trajectory.tum",
                                    "--num_threads=1"};
  };
  int status = 0;
  ASSERT_GT(waitpid(Start(flags("whole")), &status, 0), 0);
  ASSERT_EQ(status, 0);

  const pid_t victim = Start(flags("killed"));
  const std::string runs = folder_ + "/killed/runs/";
  // Its third run has begun.
  ASSERT_TRUE(WaitFor(
      [&] { return fs::exists(runs + "delta_threshold=0.25,seed=1"); }));
  kill(victim, SIGKILL);
  waitpid(victim, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(Records("killed"), 2);
  ASSERT_GT(waitpid(Start(flags("killed")), &status, 0), 0);
  ASSERT_EQ(status, 0);
  const std::string table = Read("whole/sweep.csv");
  EXPECT_EQ(Read("killed/sweep.csv"), table);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 7);
  EXPECT_THAT(table,
              HasSubstr("\n\"delta_threshold=0.55,seed=1\",0.55,1,done"));
  for (const std::string name : {"whole", "killed"}) {
    EXPECT_FALSE(
        Read(name + "/runs/delta_threshold=0.25,seed=1/trajectory.tum").empty())
        << name;
  }
}

TEST_F(SweepBinaryTest, CtrlCLeavesATableOfWhatIsDone) {
  const std::vector<std::string> flags = {
      "--grid=x=1:1:9", "--jobs=2",   "--output_dir=" + folder_ + "/out", "--",
      program_,         "--sleep=0.2"};
  const pid_t process = Start(flags);
  ASSERT_TRUE(WaitFor([&] { return Records("out") >= 2; }));
  kill(process, SIGINT);
  int status = 0;
  waitpid(process, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  const std::string table = Read("out/sweep.csv");
  EXPECT_THAT(table, HasSubstr("x=1,seed=1"));
  EXPECT_THAT(table, Not(HasSubstr("x=9,seed=1")));
  EXPECT_THAT(table, Not(HasSubstr("failed")));
  ASSERT_GT(waitpid(Start(flags), &status, 0), 0);
  EXPECT_EQ(status, 0);
  EXPECT_THAT(Read("out/sweep.csv"), HasSubstr("x=9,seed=1"));
}

// Its sweep.json runs a program that somebody else chose.
TEST_F(SweepBinaryTest, ACopiedFolderIsNotTrusted) {
  const std::string out = "--output_dir=" + folder_;
  std::string output;
  ASSERT_EQ(Run("--grid=x=1,2 " + out + "/out -- " + program_, &output), 0);
  ASSERT_EQ(Notes().size(), 2u);
  fs::create_directories(folder_ + "/copy");
  fs::copy(folder_ + "/out/sweep.json", folder_ + "/copy/sweep.json");
  for (const std::string flags : {"", "--run=x=1,seed=1"}) {
    EXPECT_EQ(Run(flags + " " + out + "/copy </dev/null", &output), 2);
    EXPECT_THAT(output, HasSubstr("not trusted"));
    EXPECT_THAT(output, HasSubstr("program.sh"));
  }
  EXPECT_EQ(Notes().size(), 2u);
  ASSERT_EQ(Run(out + "/copy --trust", &output), 0) << output;
  EXPECT_EQ(Notes().size(), 4u);
  // Its own from now on.
  EXPECT_EQ(Run(out + "/copy", &output), 0) << output;
}

TEST_F(SweepBinaryTest, ASecondSweepWaitsForTheFirst) {
  const std::vector<std::string> flags = {
      "--grid=x=1:1:3", "--jobs=1",   "--output_dir=" + folder_ + "/out", "--",
      program_,         "--sleep=0.3"};
  const pid_t first = Start(flags);
  ASSERT_TRUE(WaitFor([&] { return Records("out") >= 1; }));
  const pid_t second = Start(flags);
  int status = 0;
  waitpid(first, &status, 0);
  EXPECT_EQ(status, 0);
  waitpid(second, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(Notes().size(), 3u);
}

TEST_F(SweepBinaryTest, SolvesAndEvaluates) {
  const std::string data = std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/";
  std::string output;
  for (const std::string jobs : {"1", "2"}) {
    ASSERT_EQ(Run("--grid='structure=true,false' --notimes --jobs=" + jobs +
                      " --minimize=evaluation.relations.translation_m.mean "
                      "--evaluate='plumbline_evaluate --relations=" +
                      data + "office.relations' --output_dir=" + folder_ + "/" +
                      jobs + " -- plumbline_solve --input=" + data +
                      "office.clf.gz --outputs=trajectory.tum --num_threads=1 "
                      "--refine=map --global_association=false",
                  &output),
              0)
        << output;
  }
  const std::string table = Read("1/sweep.csv");
  EXPECT_EQ(table, Read("2/sweep.csv"));
  const std::string header = table.substr(0, table.find('\n'));
  EXPECT_THAT(header, StartsWith("run,structure,seed,status,reason,counts."));
  for (const std::string column :
       {",cost.total,", ",em.converged,", ",orthogonality_deg,",
        ",evaluation.relations.translation_m.mean,"}) {
    EXPECT_THAT(header, HasSubstr(column));
  }
  EXPECT_THAT(header, Not(HasSubstr("time_s")));
  EXPECT_THAT(table, HasSubstr("\n\"structure=false,seed=1\",false,1,done,,"));
  EXPECT_EQ(Read("1/best.flags"), "--structure=true\n");
}

TEST_F(SweepBinaryTest, RefusesWhatMakesNoSweep) {
  std::string output;
  const std::string out = " --output_dir=" + folder_ + "/out ";
  EXPECT_EQ(Run("--grid=x=1 -- " + program_, &output), 1);
  EXPECT_THAT(output, HasSubstr("--output_dir is missing"));
  EXPECT_EQ(Run(out, &output), 1);
  EXPECT_THAT(output, HasSubstr("there is no command"));
  EXPECT_EQ(Run(out + "--minimize=y --maximize=y -- " + program_, &output), 1);
  EXPECT_EQ(Run(out + "--launcher=magic -- " + program_, &output), 1);
  EXPECT_EQ(Run(out + "--grid=x -- " + program_, &output), 2);
  EXPECT_EQ(Run(out + "--grid=seed=1,2 -- " + program_, &output), 2);
  EXPECT_THAT(output, HasSubstr("'seed' is the sweep's to set"));
  EXPECT_EQ(Run(out + "--grid=output_dir=1,2 -- " + program_, &output), 2);
  EXPECT_EQ(Run(out + "--seed_flag= --trials=2 -- " + program_, &output), 2);
  EXPECT_EQ(Run(out + "-- no_such_program", &output), 2);
  EXPECT_THAT(output, HasSubstr("no_such_program: there is no such program"));
  EXPECT_EQ(Run(out + "--run=x=1", &output), 2);
  EXPECT_THAT(output, HasSubstr("holds no sweep"));
  EXPECT_EQ(Run("--output_dir=/dev/null/x -- " + program_, &output), 2);
  // A working folder that was removed.
  for (const std::string& folder : {std::string("out"), folder_ + "/out"}) {
    const std::string gone = folder_ + "/gone";
    EXPECT_EQ(RunInShell("mkdir " + gone + " && cd " + gone + " && rmdir " +
                             gone + " && " + binary_ + " --output_dir=" +
                             folder + " --grid=x=1 -- " + program_,
                         &output),
              2);
    EXPECT_THAT(output, HasSubstr("the working folder is not there"));
  }
  EXPECT_FALSE(fs::exists(folder_ + "/out"));

  ASSERT_EQ(Run(out + "--grid=x=1 -- " + program_, &output), 0) << output;
  EXPECT_EQ(Run(out + "--grid=x=1 -- " + program_ + " --fail=2", &output), 2);
  EXPECT_THAT(output, HasSubstr("holds runs of another sweep"));
  EXPECT_EQ(Run(out + "--grid=x=1", &output), 1);
  EXPECT_EQ(Run(out + "--minimize=z", &output), 2);
  EXPECT_THAT(output, HasSubstr("no run has a figure 'z'"));
  EXPECT_EQ(Run(out + "--run=x=9,seed=1", &output), 2);
  EXPECT_THAT(output, HasSubstr("there is no run 'x=9,seed=1'"));
}

}  // namespace
}  // namespace plumbline
