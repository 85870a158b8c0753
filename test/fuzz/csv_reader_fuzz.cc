// Feeds arbitrary bytes (plain or compressed) to the reader of CSV. Whatever
// the input, it either gives a log that keeps its promises or throws Error.

#include <plumbline/core/error.h>
#include <plumbline/frontend/csv_reader.h>

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
  int line = 0;
  for (const plumbline::Scan& scan : log.scans) {
    Require(scan.line > line);
    line = scan.line;
    Require(std::isfinite(scan.timestamp) && !scan.timestamp_text.empty());
    Require(scan.odometry.allFinite() && scan.laser_offset.allFinite());
    Require(std::isfinite(scan.start_angle) && scan.angle_step > 0.0);
    Require(scan.maximum_range > 0.0 && !scan.ranges.empty());
    for (const float range : scan.ranges)
      Require(range >= 0.0f && range < scan.maximum_range);
  }
  for (const plumbline::SkipReport& report : log.skipped) {
    Require(!report.reason.empty() && report.count > 0);
    Require(report.first_lines.size() <= 5);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  plumbline::LooksLikeCsvLog(text);
  try {
    plumbline::InputStream input("fuzz", text);
    CheckLog(plumbline::ReadCsvLog(&input, plumbline::LaserOptions()));
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
  return 0;
}
