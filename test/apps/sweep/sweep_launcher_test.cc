// Sweeps past one process: GNU parallel over ssh to a server that the test
// starts, and a Slurm cluster of one node that the test starts.

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <set>
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

// First of the paths that is a program; empty without one.
std::string Find(const std::string& name) {
  for (const char* folder : {"/usr/bin/", "/usr/sbin/", "/usr/local/bin/",
                             "/usr/local/sbin/", "/bin/", "/sbin/"}) {
    if (access((folder + name).c_str(), X_OK) == 0) return folder + name;
  }
  return "";
}

// A port of the loopback that nobody listens on.
int FreePort() {
  const int descriptor = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  EXPECT_EQ(bind(descriptor, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(
      getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size), 0);
  close(descriptor);
  return ntohs(address.sin_port);
}

// A server in the foreground, for as long as this object lives.
class Server {
 public:
  Server(const std::vector<std::string>& command, const std::string& log) {
    process_ = fork();
    if (process_ == 0) {
      const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
      dup2(output, STDOUT_FILENO);
      dup2(output, STDERR_FILENO);
      std::vector<char*> arguments;
      for (const std::string& word : command) {
        arguments.push_back(const_cast<char*>(word.c_str()));
      }
      arguments.push_back(nullptr);
      execv(arguments[0], arguments.data());
      _exit(99);
    }
  }
  ~Server() {
    kill(process_, SIGTERM);
    for (int i = 0; i < 500; ++i) {
      if (waitpid(process_, nullptr, WNOHANG) == process_) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

 private:
  pid_t process_;
};

class SweepLauncherTest : public ::testing::Test {
 protected:
  void SetUp() override {
    binary_ = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_sweep";
    if (!std::ifstream(binary_)) GTEST_SKIP() << binary_ << " is not built";
    folder_ = ::testing::TempDir() + "sweep_launcher_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    program_ = folder_ + "/program.sh";
    Write("program.sh", R"(#!/bin/sh
for flag; do
  case $flag in
    --output_dir=*) out=${flag#*=};;
    --seed=*) seed=${flag#*=};;
    --x=*) x=${flag#*=};;
  esac
done
echo "$HOST_NAME $SLURM_ARRAY_JOB_ID $PLUMBLINE_DATASETS" > "$out/where"
if [ "$x" = 2 ]; then exit 7; fi
if [ "$x" = slow ]; then sleep 60; fi
echo "{\"y\": $x.$seed}" > "$out/summary.json"
)");
    fs::permissions(program_, fs::perms::owner_all);
  }
  void TearDown() override {
    servers_.clear();
    if (!folder_.empty() && !HasFailure()) fs::remove_all(folder_);
  }

  void Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + "/" + name, std::ios::trunc) << text;
  }
  std::string Read(const std::string& name) const {
    std::ifstream file(folder_ + "/" + name);
    return {std::istreambuf_iterator<char>(file),
            std::istreambuf_iterator<char>()};
  }

  bool WaitFor(const std::string& command, const std::string& text) {
    std::string output;
    for (int i = 0; i < 300; ++i) {
      RunInShell(command, &output);
      if (output.find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    last_output_ = output;
    return false;
  }

  // The sweep of the tests, by a launcher, against the same by this machine.
  void CompareWithLocal(const std::string& flags) {
    const std::string sweep =
        "cd " + folder_ + " && PLUMBLINE_DATASETS=/data/sets " + binary_ +
        " --grid=x=1,2,3,slow --trials=3 --time_limit=3 --output_dir=";
    std::string output;
    ASSERT_EQ(RunInShell(sweep + "there --jobs=4 " + flags + " -- ./program.sh",
                         &output),
              2)
        << output;
    EXPECT_THAT(output, HasSubstr("runs: 12; 6 done, 3 failed, 3 timed out"));
    ASSERT_EQ(RunInShell(sweep + "here --jobs=6 -- ./program.sh", &output), 2)
        << output;
    EXPECT_EQ(Read("there/sweep.csv"), Read("here/sweep.csv"));
    EXPECT_THAT(Read("there/sweep.csv"),
                HasSubstr("\"x=3,seed=2\",3,2,done,,3.2\n"
                          "\"x=3,seed=3\",3,3,done,,3.3\n"
                          "\"x=slow,seed=1\",slow,1,timed_out,longer than 3 "
                          "s,\n"));
    EXPECT_THAT(Read("there/runs/x=1,seed=1/where"), HasSubstr("/data/sets"));
  }

  std::string binary_;
  std::string folder_;
  std::string program_;
  std::string last_output_;
  std::vector<std::unique_ptr<Server>> servers_;
};

TEST_F(SweepLauncherTest, ParallelOnThisMachine) {
  if (Find("parallel").empty()) GTEST_SKIP() << "GNU parallel is not there";
  CompareWithLocal("--launcher=parallel");
}

// GNU parallel puts names of runs in the place of braces.
TEST_F(SweepLauncherTest, ParallelInAFolderOfBraces) {
  if (Find("parallel").empty()) GTEST_SKIP() << "GNU parallel is not there";
  std::string output;
  const std::string out = "it's {} {#} {.}";
  fs::create_directories(folder_ + "/" + out);
  ASSERT_EQ(RunInShell("cd " + folder_ + " && " + binary_ +
                           " --grid=x=1,3 --launcher=parallel --output_dir=\"" +
                           out + "\" -- ./program.sh",
                       &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("runs: 2; 2 done"));
  EXPECT_TRUE(fs::exists(folder_ + "/" + out + "/runs/x=3,seed=1/run.json"));
}

TEST_F(SweepLauncherTest, ParallelOverSshToTwoHosts) {
  const std::string sshd = Find("sshd");
  for (const char* program : {"parallel", "sshd", "ssh", "ssh-keygen"}) {
    if (Find(program).empty()) GTEST_SKIP() << program << " is not there";
  }
  std::string output;
  for (const std::string key : {"host_key", "user_key"}) {
    ASSERT_EQ(
        RunInShell("ssh-keygen -q -t ed25519 -N '' -f " + folder_ + "/" + key,
                   &output),
        0)
        << output;
  }
  fs::copy(folder_ + "/user_key.pub", folder_ + "/authorized_keys");
  const std::string port = std::to_string(FreePort());
  Write("sshd_config", "Port " + port + "\nListenAddress 127.0.0.1\nHostKey " +
                           folder_ + "/host_key\nAuthorizedKeysFile " +
                           folder_ +
                           "/authorized_keys\nPidFile none\nStrictModes no\n"
                           "UsePAM no\nPasswordAuthentication no\n"
                           "KbdInteractiveAuthentication no\n"
                           "PermitRootLogin prohibit-password\n"
                           "AcceptEnv HOST_NAME\nMaxStartups 100\n");
  std::string hosts;
  for (const std::string host : {"first-host", "second-host"}) {
    hosts += "Host " + host + "\n  HostName 127.0.0.1\n  Port " + port +
             "\n  SetEnv HOST_NAME=" + host + "\n  IdentityFile " + folder_ +
             "/user_key\n  IdentitiesOnly yes\n  BatchMode yes\n"
             "  StrictHostKeyChecking no\n  UserKnownHostsFile " +
             folder_ + "/known_hosts\n  LogLevel ERROR\n";
  }
  Write("ssh_config", hosts);
  // A server as root wants this folder, which the system's own makes at its
  // start.
  std::error_code ignored;
  if (geteuid() == 0) fs::create_directories("/run/sshd", ignored);
  servers_.push_back(std::make_unique<Server>(
      std::vector<std::string>{sshd, "-D", "-e", "-f",
                               folder_ + "/sshd_config"},
      folder_ + "/sshd.log"));
  if (!WaitFor("ssh -F " + folder_ + "/ssh_config first-host echo in",
               "in\n")) {
    GTEST_SKIP() << "no ssh to a server of one's own here: " << last_output_
                 << Read("sshd.log");
  }

  const std::string ssh =
      " --launcher_options='--ssh \"ssh -F " + folder_ + "/ssh_config\"'";
  CompareWithLocal("--launcher=parallel --hosts=first-host,second-host" + ssh);
  std::set<std::string> seen;
  for (const auto& run : fs::directory_iterator(folder_ + "/there/runs")) {
    std::ifstream file(run.path() / "where");
    std::string host;
    file >> host;
    seen.insert(host);
  }
  EXPECT_EQ(seen, (std::set<std::string>{"first-host", "second-host"}));

  // A host that is not there is said.
  EXPECT_EQ(RunInShell("cd " + folder_ + " && " + binary_ +
                           " --grid=x=1 --output_dir=no --launcher=parallel "
                           "--hosts=no-such-host.invalid" +
                           ssh + " -- ./program.sh",
                       &output),
            2)
      << output;
  EXPECT_THAT(output, HasSubstr("hosts that ssh logs into without a question"));
}

TEST_F(SweepLauncherTest, SlurmOnOneNode) {
  for (const char* program : {"slurmctld", "slurmd", "sbatch", "sinfo"}) {
    if (Find(program).empty()) GTEST_SKIP() << program << " is not there";
  }
  char host[256] = {};
  gethostname(host, sizeof(host) - 1);
  std::string user;
  ASSERT_EQ(RunInShell("id -un", &user), 0);
  for (const char* name : {"state", "spool"}) {
    fs::create_directories(folder_ + "/" + name);
  }
  Write("slurm.conf",
        "ClusterName=test\nSlurmctldHost=" + std::string(host) +
            "(127.0.0.1)\nSlurmctldPort=" + std::to_string(FreePort()) +
            "\nSlurmdPort=" + std::to_string(FreePort()) +
            "\nSlurmUser=" + user + "SlurmdUser=" + user +
            "AuthType=auth/none\nCredType=cred/none\n"
            "ProctrackType=proctrack/pgid\nTaskPlugin=task/none\n"
            "SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\n"
            "SlurmctldPidFile=" +
            folder_ + "/slurmctld.pid\nSlurmdPidFile=" + folder_ +
            "/slurmd.pid\nStateSaveLocation=" + folder_ +
            "/state\nSlurmdSpoolDir=" + folder_ + "/spool\nSlurmctldLogFile=" +
            folder_ + "/slurmctld.log\nSlurmdLogFile=" + folder_ +
            "/slurmd.log\nJobAcctGatherType=jobacct_gather/none\n"
            "AccountingStorageType=accounting_storage/none\nMpiDefault=none\n"
            "ReturnToService=2\nSlurmdParameters=config_overrides\n"
            "SchedulerParameters=sched_min_interval=100000\n"
            "NodeName=node1 NodeHostname=" +
            std::string(host) +
            " NodeAddr=127.0.0.1 CPUs=4 State=UNKNOWN\n"
            "PartitionName=all Nodes=node1 Default=YES MaxTime=INFINITE "
            "State=UP\n");
  // All programs find it in the environment.
  setenv("SLURM_CONF", (folder_ + "/slurm.conf").c_str(), 1);
  servers_.push_back(std::make_unique<Server>(
      std::vector<std::string>{Find("slurmctld"), "-D"},
      folder_ + "/slurmctld.out"));
  servers_.push_back(std::make_unique<Server>(
      std::vector<std::string>{Find("slurmd"), "-D", "-N", "node1"},
      folder_ + "/slurmd.out"));
  if (!WaitFor("sinfo --noheader --format=%T", "idle")) {
    GTEST_SKIP() << "no Slurm of one's own here: " << last_output_
                 << Read("slurmctld.out") << Read("slurmd.out");
  }

  CompareWithLocal("--launcher=slurm --launcher_options=--cpus-per-task=1");
  std::string where = Read("there/runs/x=1,seed=1/where");
  std::istringstream words(where);
  int job = 0;
  EXPECT_TRUE(words >> job) << where;

  // Interrupted, it takes its jobs back; killed, the next one does.
  for (const int signal_number : {SIGINT, SIGKILL}) {
    const std::string out = "signal" + std::to_string(signal_number);
    const pid_t sweep = fork();
    if (sweep == 0) {
      const std::string flag = "--output_dir=" + folder_ + "/" + out;
      execl(binary_.c_str(), binary_.c_str(), "--grid=x=slow,1",
            "--launcher=slurm", flag.c_str(), "--", program_.c_str(),
            static_cast<char*>(nullptr));
      _exit(99);
    }
    EXPECT_TRUE(
        WaitFor("ls " + folder_ + "/" + out + "/runs/x=slow,seed=1", "where"));
    kill(sweep, signal_number);
    int status = 0;
    waitpid(sweep, &status, 0);
    std::string output;
    if (signal_number == SIGINT) {
      EXPECT_EQ(WEXITSTATUS(status), 130);
    } else {
      ASSERT_TRUE(WIFSIGNALED(status));
      RunInShell("squeue --noheader --format=%t", &output);
      EXPECT_THAT(output, HasSubstr("R\n"));
      // The slow run again, with a limit.
      EXPECT_EQ(RunInShell(binary_ +
                               " --time_limit=1 --launcher=slurm "
                               "--output_dir=" +
                               folder_ + "/" + out,
                           &output),
                2)
          << output;
      EXPECT_THAT(Read(out + "/sweep.csv"), HasSubstr("longer than 1 s"));
    }
    RunInShell("squeue --noheader --states=R,PD", &output);
    EXPECT_EQ(output, "");
  }
  unsetenv("SLURM_CONF");
}

TEST_F(SweepLauncherTest, SaysWhatIsMissing) {
  std::string output;
  EXPECT_EQ(
      RunInShell("cd " + folder_ + " && PATH=/no/such " + binary_ +
                     " --launcher=parallel --output_dir=out -- ./program.sh",
                 &output),
      2);
  EXPECT_THAT(output, HasSubstr("parallel: cannot be run"));
  EXPECT_EQ(RunInShell("cd " + folder_ + " && PATH=/no/such " + binary_ +
                           " --launcher=slurm --output_dir=out -- ./program.sh",
                       &output),
            2);
  EXPECT_THAT(output, HasSubstr("sbatch: cannot be run"));
}

}  // namespace
}  // namespace plumbline
