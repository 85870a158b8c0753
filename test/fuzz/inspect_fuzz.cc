// Feeds arbitrary bytes to what plumbline_inspect does: whatever reader
// recognizes them, the log's figures as JSON and as text, which are UTF-8.

#include <plumbline/apps/inspection/log_inspection.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/utf8.h>
#include <plumbline/frontend/builtins.h>

#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <string>

#include "scratch_folder.h"

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

const plumbline::Registry& Readers() {
  static const plumbline::Registry* const readers = [] {
    auto* const registry = new plumbline::Registry;
    plumbline::RegisterBuiltinLogReaders(registry);
    return registry;
  }();
  return *readers;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  static const plumbline::ScratchFolder folder("inspect");
  const std::string path = folder.Write(
      "log", std::string(reinterpret_cast<const char*>(data), size));
  const plumbline::LogInspection inspection =
      plumbline::InspectLog(path, Readers(), plumbline::LaserOptions());
  Require(!inspection.json.empty() && inspection.json.back() == '\n');
  Require(!inspection.text.empty() && inspection.text.back() == '\n');
  std::istringstream lines(inspection.text);
  for (std::string line; std::getline(lines, line);) {
    Require(plumbline::PrintableUtf8(line) == line);
  }
  return 0;
}
