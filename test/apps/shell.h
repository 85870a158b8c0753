#ifndef PLUMBLINE_TEST_APPS_SHELL_H_
#define PLUMBLINE_TEST_APPS_SHELL_H_

#include <sys/wait.h>

#include <cstddef>
#include <cstdio>
#include <string>

namespace plumbline {

/// Runs a command in a shell; what it prints on both streams goes to `output`.
/// Returns its exit status, or -1 when a signal ended it.
inline int RunInShell(const std::string& command, std::string* output) {
  output->clear();
  FILE* const pipe = popen(("(" + command + "\n) 2>&1").c_str(), "r");
  if (pipe == nullptr) return -1;
  char buffer[4096];
  std::size_t count;
  while ((count = fread(buffer, 1, sizeof(buffer), pipe)) > 0) {
    output->append(buffer, count);
  }
  const int status = pclose(pipe);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_APPS_SHELL_H_
