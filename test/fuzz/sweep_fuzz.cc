// Feeds arbitrary text to what reads the files of a sweep: sweep.json, the
// numbers of a run's summary.json, and the texts of --grid and of a command.

#include <plumbline/apps/sweep/sweep.h>
#include <plumbline/apps/sweep/sweep_grid.h>
#include <plumbline/core/error.h>

#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "scratch_folder.h"

namespace {

// More runs than this take longer to list than a run of the fuzzer.
constexpr std::size_t kMostRuns = 1000;

void Require(bool holds) {
  if (!holds) std::abort();
}

template <typename Read>
void Try(const Read& read) {
  try {
    read();
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
}

void ReadSweep(const std::string& folder) {
  const std::optional<plumbline::SweepDefinition> definition =
      plumbline::ReadDefinition(folder);
  plumbline::WasDefinedHere(folder);
  if (!definition) return;
  std::size_t runs = static_cast<std::size_t>(definition->trials);
  for (const plumbline::SweepAxis& axis : definition->axes) {
    Require(!axis.values.empty());
    runs *= axis.values.size();
    if (runs > kMostRuns) return;
  }
  for (const plumbline::SweepRun& run : plumbline::MakeRuns(*definition)) {
    Require(run.name.find('/') == std::string::npos && !run.name.empty());
    plumbline::RunCommand(*definition, run, "folder");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  static const plumbline::ScratchFolder folder("sweep");
  const std::string text(reinterpret_cast<const char*>(data), size);
  folder.Write("sweep.json", text);
  Try([&] { ReadSweep(folder.path()); });
  Try([&] { plumbline::Numbers(text, true, "fuzz"); });
  // Ranges may be long.
  if (size < 200) Try([&] { plumbline::ParseGrid(text); });
  Try([&] { plumbline::SplitWords(text); });
  Try([&] { plumbline::SplitNames(text); });
  return 0;
}
