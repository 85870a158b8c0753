// Feeds arbitrary text to what reads command lines: as the words of one, a line
// each, and as a flag file. What is accepted is what gflags takes without a
// further word.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/command_line.h>
#include <plumbline/core/error.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "scratch_folder.h"

DEFINE_bool(structure, true, "");
DEFINE_int32(num_threads, 1, "");
DEFINE_uint64(seed, 1, "");
DEFINE_double(link_radius, 10.0, "");
DEFINE_string(input, "", "");

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckAccepted(const plumbline::CommandLine& line) {
  for (const std::string& problem : line.problems) Require(!problem.empty());
  if (!line.problems.empty()) return;
  for (const std::string& argument : line.arguments) {
    Require(argument.find('\0') == std::string::npos);
  }
}

// No file of the machine is read because a mutation names it.
bool NamesFiles(const std::string& text) {
  return text.find("flagfile") != std::string::npos;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  static const plumbline::ScratchFolder folder("flags");
  const std::string text(reinterpret_cast<const char*>(data), size);
  if (NamesFiles(text)) return 0;
  CheckAccepted(plumbline::ReadCommandLine(
      {"--flagfile=" + folder.Write("flags", text)}));
  if (text.find('\0') == std::string::npos) {
    std::vector<std::string> words;
    std::istringstream lines(text);
    for (std::string word; std::getline(lines, word);) words.push_back(word);
    CheckAccepted(plumbline::ReadCommandLine(words));
  }
  return 0;
}
