#include <fcntl.h>
#include <plumbline/apps/sweep/child_process.h>
#include <plumbline/core/error.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <thread>
#include <vector>

namespace plumbline {
namespace {

constexpr std::chrono::milliseconds kPause(10);
// Somebody waits for this one, too.
constexpr std::chrono::milliseconds kGrace(1500);

// Closes it at the end.
struct Descriptor {
  explicit Descriptor(int number) : number(number) {}
  ~Descriptor() { Close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  void Close() {
    if (number >= 0) close(number);
    number = -1;
  }
  int number;
};

// A file with the text, at its beginning, that is gone once it is closed.
int OpenInput(const std::string& text) {
  if (text.empty()) return open("/dev/null", O_RDONLY | O_CLOEXEC);
  std::FILE* const file = std::tmpfile();
  if (file == nullptr) return -1;
  std::fwrite(text.data(), 1, text.size(), file);
  std::rewind(file);
  const int descriptor = fcntl(fileno(file), F_DUPFD_CLOEXEC, 3);
  std::fclose(file);
  return descriptor;
}

// In the child: becomes the program, or tells `failure` why it cannot.
[[noreturn]] void Become(const ChildOptions& options, int input, int output,
                         int failure, pid_t parent) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // It may have died before that.
  if (getppid() != parent) _exit(127);
  signal(SIGINT, SIG_DFL);
  signal(SIGTERM, SIG_DFL);
  signal(SIGPIPE, SIG_DFL);
  signal(SIGXFSZ, SIG_DFL);
  dup2(input, STDIN_FILENO);
  if (output >= 0) {
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
  }
  for (const auto& [name, value] : options.environment) {
    setenv(name.c_str(), value.c_str(), 1);
  }
  if (options.working_directory.empty() ||
      chdir(options.working_directory.c_str()) == 0) {
    std::vector<char*> arguments;
    for (const std::string& word : options.command) {
      arguments.push_back(const_cast<char*>(word.c_str()));
    }
    arguments.push_back(nullptr);
    execvp(arguments[0], arguments.data());
  }
  const int reason = errno;
  const ssize_t written = write(failure, &reason, sizeof(reason));
  _exit(written == sizeof(reason) ? 127 : 126);
}

std::string Describe(int status) {
  if (WIFSIGNALED(status)) {
    const int number = WTERMSIG(status);
    return "signal " + std::to_string(number) + " (" + strsignal(number) + ")";
  }
  return "exit status " + std::to_string(WEXITSTATUS(status));
}

[[noreturn]] void ThrowCannotRun(const ChildOptions& options) {
  throw Error(options.command[0], 0,
              std::string("cannot be run: ") + std::strerror(errno), "");
}

// Where the child's output goes; -1 when it stays ours.
int OpenLog(const std::string& path) {
  if (path.empty()) return -1;
  const int log =
      open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (log < 0) {
    throw Error(path, 0,
                std::string("cannot be written: ") + std::strerror(errno),
                "a writable place");
  }
  return log;
}

// Why the child did not become the program (an errno), from its end of the
// pipe; 0 when it did.
int ReadFailure(int pipe) {
  int reason = 0;
  ssize_t count;
  do {
    count = read(pipe, &reason, sizeof(reason));
  } while (count < 0 && errno == EINTR);
  return count == sizeof(reason) ? reason : 0;
}

// Waits until the child has ended, which is left unburied, so that its number
// stays its own. Asked to stop, it gets some time to end by itself; true when
// it was.
bool WaitForEnd(pid_t child, const std::function<bool()>& stop) {
  bool is_stopped = false;
  std::chrono::steady_clock::time_point kill_time;
  for (;;) {
    siginfo_t ended = {};
    if (waitid(P_PID, static_cast<id_t>(child), &ended,
               WEXITED | WNOHANG | WNOWAIT) == 0 &&
        ended.si_pid == child) {
      return is_stopped;
    }
    const auto now = std::chrono::steady_clock::now();
    if (!is_stopped && stop && stop()) {
      is_stopped = true;
      kill(-child, SIGTERM);
      kill_time = now + kGrace;
    } else if (is_stopped && now >= kill_time) {
      kill(-child, SIGKILL);
      kill_time = now + kGrace;
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace

ChildResult RunChild(const ChildOptions& options) {
  if (options.command.empty()) {
    throw PLUMBLINE_ERROR("there is no program to run", "a command");
  }
  const Descriptor output(OpenLog(options.log));
  const Descriptor input(OpenInput(options.input));
  int failure[2] = {-1, -1};
  if (input.number < 0 || pipe2(failure, O_CLOEXEC) != 0) {
    ThrowCannotRun(options);
  }
  const Descriptor failure_read(failure[0]);
  Descriptor failure_write(failure[1]);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) ThrowCannotRun(options);
  if (child == 0) {
    Become(options, input.number, output.number, failure_write.number, parent);
  }
  // By both, so that the group is there whoever comes first.
  setpgid(child, child);
  failure_write.Close();
  const int reason = ReadFailure(failure_read.number);

  ChildResult result;
  result.stopped = WaitForEnd(child, options.stop);
  int status = 0;
  kill(-child, SIGKILL);
  waitpid(child, &status, 0);
  if (reason != 0) {
    result.failure = std::string("cannot be run: ") + std::strerror(reason);
  } else if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    result.failure = Describe(status);
  }
  result.succeeded = result.failure.empty();
  return result;
}

}  // namespace plumbline
