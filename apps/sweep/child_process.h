#ifndef PLUMBLINE_APPS_SWEEP_CHILD_PROCESS_H_
#define PLUMBLINE_APPS_SWEEP_CHILD_PROCESS_H_

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

struct ChildOptions {
  /// The program (looked for in PATH when it has no slash) and its arguments.
  std::vector<std::string> command;
  /// Empty: this process's.
  std::string working_directory;
  /// Set in addition to this process's.
  std::vector<std::pair<std::string, std::string>> environment;
  /// What it prints is appended here; empty: it goes where this process's goes.
  std::string log;
  /// Text on its standard input, which otherwise is empty.
  std::string input;
  /// Asked a hundred times a second; true ends the child. May be empty.
  std::function<bool()> stop;
};

struct ChildResult {
  /// Ended because `stop` said so.
  bool stopped = false;
  /// It ran and ended with status 0.
  bool succeeded = false;
  /// "exit status 3", "signal 11 (Segmentation fault)", "cannot be run: No
  /// such file or directory"; empty when it succeeded.
  std::string failure;
};

/// Runs a program to its end, in a process group of its own. Stopped, the group
/// gets SIGTERM, and five seconds later SIGKILL; what else is left in it at the
/// end is killed. The child is killed when this process dies, too. Call it from
/// the main thread only. Throws Error when there can be no more processes and
/// when the log cannot be written.
ChildResult RunChild(const ChildOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SWEEP_CHILD_PROCESS_H_
