// What a person sees of a run: bars on a terminal, none in pipes, and what is
// left after Ctrl-C.

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/tum.h>
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kColumns = 100;

// A run whose stderr is a terminal or a pipe, and whose stdin is a pipe.
class Process {
 public:
  Process(const std::string& binary, const std::vector<std::string>& flags,
          bool on_terminal) {
    int input[2];
    EXPECT_EQ(pipe2(input, O_CLOEXEC), 0);
    int output[2];
    if (on_terminal) {
      output[0] = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
      EXPECT_GE(output[0], 0);
      EXPECT_EQ(grantpt(output[0]), 0);
      EXPECT_EQ(unlockpt(output[0]), 0);
      output[1] = open(ptsname(output[0]), O_RDWR | O_NOCTTY | O_CLOEXEC);
      EXPECT_GE(output[1], 0);
      winsize size = {};
      size.ws_col = kColumns;
      size.ws_row = 30;
      EXPECT_EQ(ioctl(output[1], TIOCSWINSZ, &size), 0);
    } else {
      EXPECT_EQ(pipe2(output, O_CLOEXEC), 0);
    }
    process_ = fork();
    if (process_ == 0) {
      dup2(input[0], STDIN_FILENO);
      dup2(output[1], STDERR_FILENO);
      std::vector<char*> arguments = {const_cast<char*>(binary.c_str())};
      for (const std::string& flag : flags) {
        arguments.push_back(const_cast<char*>(flag.c_str()));
      }
      arguments.push_back(nullptr);
      execv(binary.c_str(), arguments.data());
      _exit(99);
    }
    close(input[0]);
    close(output[1]);
    input_ = input[1];
    output_ = output[0];
    fcntl(output_, F_SETFL, O_NONBLOCK);
  }
  ~Process() {
    if (process_ > 0) {
      kill(process_, SIGKILL);
      waitpid(process_, nullptr, 0);
    }
    CloseInput();
    close(output_);
  }

  void Write(std::string_view text) {
    while (!text.empty()) {
      const ssize_t count = write(input_, text.data(), text.size());
      ASSERT_GT(count, 0);
      text.remove_prefix(static_cast<std::size_t>(count));
      Read(0);
    }
  }
  void CloseInput() {
    if (input_ >= 0) close(input_);
    input_ = -1;
  }
  void Signal(int number) { kill(process_, number); }

  // Reads until `text` came, or nothing more will; true when it came.
  bool WaitFor(const std::string& text) {
    while (output().find(text) == std::string::npos) {
      if (!Read(1000) && has_ended_) return false;
    }
    return true;
  }

  // Its exit status once it has ended.
  int Wait() {
    while (!has_ended_) Read(1000);
    int status = 0;
    waitpid(process_, &status, 0);
    process_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  const std::string& output() const { return text_; }

 private:
  bool Read(int milliseconds) {
    pollfd descriptor = {output_, POLLIN, 0};
    if (poll(&descriptor, 1, milliseconds) <= 0) return false;
    char buffer[4096];
    const ssize_t count = read(output_, buffer, sizeof(buffer));
    // A terminal whose other side is closed gives an error, a pipe nothing.
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) {
      has_ended_ = true;
    }
    if (count <= 0) return false;
    text_.append(buffer, static_cast<std::size_t>(count));
    return true;
  }

  pid_t process_ = 0;
  int input_ = -1;
  int output_ = -1;
  bool has_ended_ = false;
  std::string text_;
};

class TerminalTest : public ::testing::Test {
 protected:
  void SetUp() override {
    signal(SIGPIPE, SIG_IGN);
    solve_ = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_solve";
    folder_ = fs::path(::testing::TempDir()) /
              ("terminal_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    InputStream input(std::string(PLUMBLINE_SOURCE_DIR) +
                      "/datasets/office.clf.gz");
    log_ = input.ReadRest();
    short_log_ = log_.substr(0, log_.find('\n', log_.size() / 10) + 1);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::vector<std::string> Flags(std::vector<std::string> more = {}) const {
    more.push_back("--input=-");
    // On a slow machine a state is kept otherwise, and stays with an interrupt.
    more.push_back("--checkpoint_every=0");
    more.push_back("--output_dir=" + folder_.string());
    return more;
  }

  // The short log, with a pause in it for longer than a bar waits.
  void WriteSlowly(Process* process) {
    const std::size_t half = short_log_.size() / 2;
    process->Write(std::string_view(short_log_).substr(0, half));
    usleep(1300000);
    process->Write(std::string_view(short_log_).substr(half));
    process->CloseInput();
  }

  std::set<std::string> FilesOfTheRun() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      names.insert(entry.path().filename().string());
    }
    return names;
  }

  nlohmann::json Summary() const {
    std::ifstream file(folder_ / "summary.json");
    return nlohmann::json::parse(file);
  }

  std::string solve_;
  fs::path folder_;
  std::string log_;
  /// About a tenth of it.
  std::string short_log_;
};

TEST_F(TerminalTest, BarOnATerminal) {
  Process process(solve_, Flags(), /*on_terminal=*/true);
  WriteSlowly(&process);
  EXPECT_EQ(process.Wait(), 0) << process.output();
  const std::string& output = process.output();
  // How much there is to read of a pipe is not known.
  EXPECT_THAT(output, HasSubstr("\r\033[Kreading, 1 s"));
  // Nothing of it is left, and no line was longer than the terminal.
  EXPECT_EQ(output.substr(output.size() - 4), "\r\033[K");
  std::size_t width = 0;
  for (std::size_t i = 0; i < output.size(); ++i) {
    if (output[i] == '\r') {
      width = 0;
    } else if (output.compare(i, 3, "\033[K") == 0) {
      i += 2;
    } else {
      EXPECT_LT(++width, static_cast<std::size_t>(kColumns));
    }
  }
}

// A file's size is known: how much is left, and for how long.
TEST_F(TerminalTest, BarWithTimeLeft) {
  // Long enough for more than a second of solving on any machine would be long
  // for a test; a simulation says how far it is.
  const std::string simulate =
      std::string(PLUMBLINE_BIN_DIR) + "/plumbline_simulate";
  Process process(simulate,
                  {"--world=office", "--speed=0.05", "--scan_rate=50",
                   "--output=" + (folder_ / "log.clf").string()},
                  /*on_terminal=*/true);
  const bool has_come = process.WaitFor(" left");
  EXPECT_TRUE(has_come) << process.output();
  EXPECT_THAT(process.output(), HasSubstr("simulating ["));
  EXPECT_THAT(process.output(), HasSubstr("%"));
  EXPECT_THAT(process.output(), HasSubstr(" per mille/s"));
  // The bar gives way.
  process.Signal(SIGINT);
  EXPECT_EQ(process.Wait(), 130);
  EXPECT_THAT(process.output(), HasSubstr("\r\033[Kinterrupted"));
  EXPECT_FALSE(fs::exists(folder_ / "log.clf"));
}

// Half a log would not tell that it is half a log: what was there stays, and
// nothing comes beside it.
TEST_F(TerminalTest, AnInterruptedSimulationLeavesWhatWasThere) {
  const std::string simulate =
      std::string(PLUMBLINE_BIN_DIR) + "/plumbline_simulate";
  for (const int signal : {SIGINT, SIGTERM}) {
    for (const char* name : {"log", "truth.json", "relations", "world"}) {
      std::ofstream(folder_ / name) << "of yesterday";
    }
    Process process(simulate,
                    {"--world=office", "--speed=0.05", "--scan_rate=50",
                     "--output=" + (folder_ / "log").string(),
                     "--truth=" + (folder_ / "truth.json").string(),
                     "--relations=" + (folder_ / "relations").string(),
                     "--save_world=" + (folder_ / "world").string()},
                    /*on_terminal=*/true);
    // Of the bar: it comes while the beams are cast.
    EXPECT_TRUE(process.WaitFor(" left")) << process.output();
    process.Signal(signal);
    EXPECT_EQ(process.Wait(), 130);
    for (const char* name : {"log", "truth.json", "relations", "world"}) {
      std::ifstream file(folder_ / name);
      const std::string text{std::istreambuf_iterator<char>(file), {}};
      EXPECT_EQ(text, "of yesterday") << name;
      fs::remove(folder_ / name);
    }
    EXPECT_TRUE(fs::is_empty(folder_));
  }
}

TEST_F(TerminalTest, NoBarInAPipe) {
  Process process(solve_, Flags(), /*on_terminal=*/false);
  WriteSlowly(&process);
  EXPECT_EQ(process.Wait(), 0);
  EXPECT_EQ(process.output(), "");
}

TEST_F(TerminalTest, QuietIsQuiet) {
  Process process(solve_, Flags({"--quiet", "--verbose"}),
                  /*on_terminal=*/true);
  WriteSlowly(&process);
  EXPECT_EQ(process.Wait(), 0);
  EXPECT_EQ(process.output(), "");
}

TEST_F(TerminalTest, QuietLeavesRemarksOut) {
  const std::string log = short_log_ + "FLASER 5 1 2\n";
  for (const bool is_quiet : {false, true}) {
    Process process(
        solve_, Flags({is_quiet ? "--quiet" : "--noquiet", "--outputs=none"}),
        /*on_terminal=*/false);
    process.Write(log);
    process.CloseInput();
    EXPECT_EQ(process.Wait(), 0);
    if (is_quiet) {
      EXPECT_EQ(process.output(), "");
    } else {
      EXPECT_THAT(process.output(), HasSubstr("1 skipped: "));
    }
  }
}

TEST_F(TerminalTest, VerboseTellsSteps) {
  Process process(solve_, Flags({"--verbose"}), /*on_terminal=*/false);
  process.Write(log_);
  process.CloseInput();
  EXPECT_EQ(process.Wait(), 0);
  EXPECT_THAT(process.output(), HasSubstr("read 1408 scans in "));
  EXPECT_THAT(process.output(), HasSubstr("\n500 of 1408 scans in "));
  EXPECT_THAT(process.output(), HasSubstr(" detect_0: cost "));
  std::size_t last = 0;
  for (const char* step :
       {"\n1408 of 1408 scans in ", "\nstructure of the whole map, after ",
        "\nclosing of loops, after ", "\nadjustment of poses, after ",
        "\nwalls from adjusted poses, after ",
        "\njoint adjustment of poses and walls, after "}) {
    const std::size_t place = process.output().find(step);
    ASSERT_NE(place, std::string::npos) << step;
    EXPECT_GT(place, last) << step;
    last = place;
  }
  EXPECT_THAT(process.output(), HasSubstr("\nwritten to "));
  EXPECT_THAT(process.output(), Not(HasSubstr("\r")));
}

const std::set<std::string> kFilesOfALog = {
    "em_trace.csv",  "floorplan.dxf",  "floorplan.geojson", "floorplan.svg",
    "graph.g2o",     "map.json",       "map.png",           "map.svg",
    "occupancy.pgm", "occupancy.yaml", "report.html",       "rooms.csv",
    "summary.json",  "trajectory.tum"};

// All scans are there, and the map that stood before the adjustment, whole.
TEST_F(TerminalTest, InterruptedJointAdjustment) {
  Process process(solve_, Flags({"--verbose"}), /*on_terminal=*/false);
  process.Write(log_);
  process.CloseInput();
  ASSERT_TRUE(process.WaitFor("\njoint adjustment of poses and walls"))
      << process.output();
  process.Signal(SIGINT);
  EXPECT_EQ(process.Wait(), 130);
  EXPECT_THAT(process.output(),
              HasSubstr("interrupted: what was done so far is written\n"));
  EXPECT_EQ(FilesOfTheRun(), kFilesOfALog);
  EXPECT_EQ(Summary()["counts"]["scans"], 1408);
  EXPECT_EQ(Summary()["partial"], true);
  const std::vector<TimedPose> trajectory =
      ReadTum((folder_ / "trajectory.tum").string());
  ASSERT_EQ(trajectory.size(), 1408u);
  // Between two scans the robot goes a few centimetres: no pose was left where
  // the adjustment had not come to.
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    EXPECT_LT((trajectory[i].pose.head<2>() - trajectory[i - 1].pose.head<2>())
                  .norm(),
              0.5)
        << i;
  }
}

class InterruptTest : public TerminalTest,
                      public ::testing::WithParamInterface<int> {};

// In the middle of the work: what was done is written whole, and said.
TEST_P(InterruptTest, WritesWhatThereIs) {
  Process process(solve_, Flags({"--verbose"}), /*on_terminal=*/false);
  process.Write(log_);
  process.CloseInput();
  ASSERT_TRUE(process.WaitFor("500 of 1408 scans")) << process.output();
  process.Signal(GetParam());
  EXPECT_EQ(process.Wait(), 130);
  EXPECT_THAT(process.output(),
              HasSubstr("interrupted: what was done so far is written\n"));
  const int scans = Summary()["counts"]["scans"].get<int>();
  EXPECT_GE(scans, 500);
  EXPECT_LE(scans, 1408);
  EXPECT_EQ(ReadTum((folder_ / "trajectory.tum").string()).size(),
            static_cast<std::size_t>(scans));
  EXPECT_EQ(FilesOfTheRun(), kFilesOfALog);
  // Coarser than that of a whole run, since somebody waits.
  std::ifstream grid(folder_ / "occupancy.yaml");
  const std::string yaml{std::istreambuf_iterator<char>(grid), {}};
  EXPECT_THAT(yaml, HasSubstr("resolution: 0.1\n"));
  // Width and height of a picture stand behind its first 16 bytes.
  std::ifstream picture(folder_ / "map.png", std::ios::binary);
  const std::string png{std::istreambuf_iterator<char>(picture), {}};
  ASSERT_GT(png.size(), 24u);
  for (const std::size_t place : {16u, 20u}) {
    EXPECT_LE(256 * static_cast<unsigned char>(png[place + 2]) +
                  static_cast<unsigned char>(png[place + 3]),
              1200);
  }
}

INSTANTIATE_TEST_SUITE_P(Signals, InterruptTest,
                         ::testing::Values(SIGINT, SIGTERM));

}  // namespace
}  // namespace plumbline
