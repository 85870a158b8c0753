#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/sweep/child_process.h>
#include <plumbline/apps/sweep/sweep_launcher.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <thread>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// Slurm's MaxArraySize is 1001 unless somebody changed it.
constexpr std::size_t kArraySize = 1000;

bool HasRecord(const std::string& folder, const SweepRun& run) {
  return fs::exists(RunFolder(folder, run) + "/run.json");
}

int CountRecords(const std::string& folder, const std::vector<SweepRun>& runs) {
  int count = 0;
  for (const SweepRun& run : runs) count += HasRecord(folder, run);
  return count;
}

// Whether to stop; tells the progress about twice a second.
class Watch {
 public:
  Watch(const std::string& folder, const std::vector<SweepRun>& runs,
        const LaunchOptions& options)
      : folder_(folder), runs_(runs), options_(options) {}

  bool operator()() {
    const Clock::time_point now = Clock::now();
    if (options_.progress && now >= next_) {
      options_.progress(CountRecords(folder_, runs_));
      next_ = now + std::chrono::milliseconds(500);
    }
    return options_.stop && options_.stop();
  }

 private:
  const std::string& folder_;
  const std::vector<SweepRun>& runs_;
  const LaunchOptions& options_;
  Clock::time_point next_;
};

// The command that does a run, for a shell that replaces `name`.
std::string WorkerCommand(const std::string& folder,
                          const LaunchOptions& options,
                          const std::string& name) {
  return QuoteForShell(options.program) +
         " --output_dir=" + QuoteForShell(folder) + " --trust --run=" + name;
}

// The same for a shell without the character that all replacement strings of
// GNU parallel begin with ({}, {#}, {=...=}); for words in single quotes.
std::string WithoutBraces(const std::string& quoted) {
  std::string command;
  for (const char c : quoted) {
    if (c == '{') {
      command += "'\"$(printf '\\173')\"'";
    } else {
      command += c;
    }
  }
  return command;
}

// In a process of its own: does a run and ends with an ExitStatus.
[[noreturn]] void Work(const SweepDefinition& definition, const SweepRun& run,
                       const std::string& folder, const LaunchOptions& options,
                       pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  int status = kExitInternal;
  try {
    const bool is_done =
        getppid() == parent &&
        ExecuteRun(definition, run, folder, options.stop).has_value();
    status = is_done ? kExitSuccess : kExitInterrupted;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    status = kExitInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "internal error: %s\n", error.what());
  }
  _exit(status);
}

// What a program printed; throws Error when it failed.
std::string Output(const std::vector<std::string>& command,
                   const std::string& input, const std::string& folder) {
  ChildOptions child;
  child.command = command;
  child.input = input;
  child.log = folder + "/slurm.out";
  std::remove(child.log.c_str());
  const ChildResult result = RunChild(child);
  std::ifstream file(child.log);
  std::string output{std::istreambuf_iterator<char>(file),
                     std::istreambuf_iterator<char>()};
  std::remove(child.log.c_str());
  if (!result.succeeded) {
    throw Error(command[0], 0, result.failure + ": " + output,
                "a cluster with Slurm");
  }
  return output;
}

// Slurm forgets jobs that have ended; any other failure says nothing of them.
bool HasJobs(const std::string& jobs, const std::string& folder) {
  try {
    return !Output({"squeue", "--noheader", "--jobs=" + jobs}, "", folder)
                .empty();
  } catch (const Error& error) {
    return std::strstr(error.what(), "Invalid job id") == nullptr;
  }
}

void CancelJobs(const std::string& jobs, const std::string& folder) {
  std::vector<std::string> command = {"scancel"};
  std::istringstream list(jobs);
  std::string job;
  while (std::getline(list, job, ',')) command.push_back(job);
  try {
    Output(command, "", folder);
  } catch (const Error&) {
    // They may have ended by themselves.
  }
  while (HasJobs(jobs, folder)) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
  }
}

}  // namespace

void LaunchLocally(const SweepDefinition& definition,
                   const std::vector<SweepRun>& runs, const std::string& folder,
                   const LaunchOptions& options) {
  const std::size_t jobs =
      options.jobs > 0
          ? static_cast<std::size_t>(options.jobs)
          : std::max<std::size_t>(1, std::thread::hardware_concurrency());
  const pid_t parent = getpid();
  std::map<pid_t, const SweepRun*> workers;
  std::size_t next = 0;
  bool cannot_write = false;
  bool is_stopping = false;
  int done = 0;
  for (;;) {
    if (!is_stopping && options.stop && options.stop()) {
      is_stopping = true;
      for (const auto& worker : workers) kill(worker.first, SIGTERM);
    }
    while (!is_stopping && !cannot_write && workers.size() < jobs &&
           next < runs.size()) {
      std::fflush(nullptr);
      const pid_t worker = fork();
      if (worker == 0) Work(definition, runs[next], folder, options, parent);
      if (worker < 0) {
        if (workers.empty()) {
          throw Error("fork", 0, std::strerror(errno), "room for a process");
        }
        break;
      }
      workers[worker] = &runs[next++];
    }
    if (workers.empty()) break;
    int status = 0;
    const pid_t ended = waitpid(-1, &status, WNOHANG);
    const auto worker = workers.find(ended);
    if (worker == workers.end()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      continue;
    }
    const SweepRun& run = *worker->second;
    workers.erase(worker);
    if (WIFEXITED(status) && WEXITSTATUS(status) == kExitInput) {
      cannot_write = true;
    } else if (WIFSIGNALED(status) && !is_stopping) {
      RecordLoss(RunFolder(folder, run));
    }
    if (options.progress) options.progress(++done);
  }
  if (cannot_write) {
    throw Error(folder, 0, "runs cannot write here", "a writable place");
  }
}

void LaunchWithParallel(const std::vector<SweepRun>& runs,
                        const std::string& folder,
                        const LaunchOptions& options) {
  ChildOptions child;
  child.command = {"parallel", "--will-cite"};
  if (options.jobs > 0) {
    child.command.push_back("--jobs=" + std::to_string(options.jobs));
  }
  if (!options.hosts.empty()) {
    child.command.push_back("--sshlogin=" + options.hosts);
  }
  child.command.insert(child.command.end(), options.options.begin(),
                       options.options.end());
  // The only braces are those that the run's name replaces.
  child.command.push_back(WithoutBraces(WorkerCommand(folder, options, "")) +
                          "{}");
  for (const SweepRun& run : runs) child.input += run.name + "\n";
  child.stop = Watch(folder, runs, options);
  const ChildResult result = RunChild(child);
  if (!result.succeeded && !result.stopped && CountRecords(folder, runs) == 0) {
    throw Error("parallel", 0, result.failure,
                "GNU parallel, hosts that ssh logs into without a question, "
                "and " +
                    folder + " and " + options.program + " on each");
  }
}

void LaunchWithSlurm(const std::vector<SweepRun>& runs,
                     const std::string& folder, const LaunchOptions& options) {
  const std::string jobs_path = folder + "/slurm.jobs";
  {
    std::string jobs;
    if (std::getline(std::ifstream(jobs_path), jobs) && !jobs.empty()) {
      CancelJobs(jobs, folder);
    }
  }
  std::string jobs;
  for (std::size_t begin = 0; begin < runs.size(); begin += kArraySize) {
    const std::size_t end = std::min(begin + kArraySize, runs.size());
    // Line n is the run of the array's task n.
    const std::string list =
        folder + "/slurm." + std::to_string(begin / kArraySize) + ".runs";
    WriteFileAtomically(list, [&](std::ostream& output) {
      for (std::size_t i = begin; i < end; ++i) output << runs[i].name << '\n';
    });
    std::string array = "--array=1-" + std::to_string(end - begin);
    if (options.jobs > 0) array += "%" + std::to_string(options.jobs);
    std::vector<std::string> command = {"sbatch",
                                        "--parsable",
                                        "--job-name=plumbline_sweep",
                                        "--chdir=" + folder,
                                        "--output=" + folder + "/slurm.log",
                                        "--open-mode=append",
                                        array};
    command.insert(command.end(), options.options.begin(),
                   options.options.end());
    std::string job =
        Output(command,
               "#!/bin/sh\nexec " +
                   WorkerCommand(folder, options,
                                 "\"$(sed -n \"${SLURM_ARRAY_TASK_ID}p\" " +
                                     QuoteForShell(list) + ")\"") +
                   "\n",
               folder);
    // "number" or "number;cluster".
    job = job.substr(0, job.find_first_of(";\n"));
    jobs += (jobs.empty() ? "" : ",") + job;
    WriteFileAtomically(jobs_path,
                        [&](std::ostream& output) { output << jobs << '\n'; });
  }
  Watch watch(folder, runs, options);
  Clock::time_point next_question = Clock::now();
  while (CountRecords(folder, runs) < static_cast<int>(runs.size())) {
    if (watch()) {
      CancelJobs(jobs, folder);
      break;
    }
    if (Clock::now() >= next_question) {
      if (!HasJobs(jobs, folder)) {
        // Other machines' files may come into sight a little later.
        std::this_thread::sleep_for(std::chrono::seconds(2));
        break;
      }
      next_question = Clock::now() + std::chrono::seconds(5);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  std::remove(jobs_path.c_str());
  if (!(options.stop && options.stop()) && CountRecords(folder, runs) == 0) {
    throw Error(folder + "/slurm.log", 0, "no job did its run",
                "nodes that have " + folder + " and " + options.program);
  }
}

}  // namespace plumbline
