#ifndef PLUMBLINE_APPS_SWEEP_SWEEP_LAUNCHER_H_
#define PLUMBLINE_APPS_SWEEP_SWEEP_LAUNCHER_H_

#include <plumbline/apps/sweep/sweep.h>

#include <functional>
#include <string>
#include <vector>

namespace plumbline {

struct LaunchOptions {
  /// Runs at a time: of this machine (local), of each host (parallel), of the
  /// cluster (slurm). 0: as many as there are cores (local, parallel), as many
  /// as the cluster takes (slurm).
  int jobs = 0;
  /// Absolute path of plumbline_sweep, on all machines.
  std::string program;
  /// For GNU parallel: hosts separated by commas as its --sshlogin takes them;
  /// empty: this machine.
  std::string hosts;
  /// Further options of parallel or sbatch.
  std::vector<std::string> options;
  /// Called now and then with the number of runs that are done. May be empty.
  std::function<void(int)> progress;
  /// Asked often; true ends what runs. May be empty.
  std::function<bool()> stop;
};

/// Does the runs as child processes of this one, in order. A run that takes its
/// process with it gives a record that says so. Throws Error when a run cannot
/// write its folder.
void LaunchLocally(const SweepDefinition& definition,
                   const std::vector<SweepRun>& runs, const std::string& folder,
                   const LaunchOptions& options);

/// Does the runs by GNU parallel, over ssh when there are hosts. They need the
/// folder and the program under the same paths. Throws Error when parallel
/// cannot be run or no run has a record in the end.
void LaunchWithParallel(const std::vector<SweepRun>& runs,
                        const std::string& folder,
                        const LaunchOptions& options);

/// Does the runs as job arrays of Slurm, of up to 1000 runs each. What is left
/// of jobs for this folder is cancelled first. Throws Error when sbatch fails
/// or no run has a record in the end.
void LaunchWithSlurm(const std::vector<SweepRun>& runs,
                     const std::string& folder, const LaunchOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SWEEP_SWEEP_LAUNCHER_H_
