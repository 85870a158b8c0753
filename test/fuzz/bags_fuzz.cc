// Feeds arbitrary bytes to the readers of bags, whichever recognizes them.
// Whatever the input, they either give a log that keeps its promises or throw
// Error.

#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/log_reader.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckLog(const plumbline::Log& log) {
  Require(!log.scans.empty());
  for (const plumbline::Scan& scan : log.scans) {
    Require(std::isfinite(scan.timestamp) && !scan.timestamp_text.empty());
    Require(scan.odometry.allFinite() && scan.laser_offset.allFinite());
    Require(std::isfinite(scan.start_angle) && scan.angle_step > 0.0);
    Require(scan.maximum_range > 0.0 && scan.ranges.size() > 1);
    Require(scan.bearings.empty() ||
            scan.bearings.size() == scan.ranges.size());
    for (const float range : scan.ranges) {
      Require(range >= 0.0f && std::isfinite(range));
    }
    for (const float bearing : scan.bearings) Require(std::isfinite(bearing));
  }
  for (const plumbline::SkipReport& report : log.skipped) {
    Require(!report.reason.empty() && report.count > 0);
    Require(report.first_lines.size() <= 5);
  }
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
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  // With several threads chunks are unpacked ahead.
  const plumbline::ThreadsScope threads(size % 2 == 0 ? 1 : 3);
  try {
    plumbline::InputStream input("fuzz", bytes);
    const plumbline::LogReaderType* const reader =
        plumbline::RecognizeLog(Readers(), input.Peek(1 << 16));
    if (reader == nullptr || reader->name == "carmen") return 0;
    CheckLog(reader->read(&input, plumbline::LaserOptions()));
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
  return 0;
}
