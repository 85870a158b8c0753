// Solves what the CARMEN reader makes of arbitrary text, when it is short, by
// matching of scans where it has no odometry: a trajectory without a number
// that is none, or an Error.

#include <plumbline/core/error.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/scan_odometry.h>
#include <plumbline/pipeline/log_solver.h>

#include <cstdint>
#include <cstdlib>
#include <string>

namespace {

constexpr std::size_t kMostScans = 12;
constexpr std::size_t kMostBeams = 2000;

const plumbline::Registry& BuiltIns() {
  static const plumbline::Registry& registry =
      []() -> const plumbline::Registry& {
    static plumbline::Registry made;
    plumbline::RegisterBuiltins(&made);
    return made;
  }();
  return registry;
}

void Solve(const plumbline::Log& log, plumbline::RawFeatures features) {
  plumbline::LogSolverOptions options;
  options.features = features;
  // A round of EM on the way.
  options.em_every = 4;
  options.odometry.key_distance = 0.05;
  // Jumps of odometry are what most mutations make: the wide searches that
  // follow would take nearly all of the time.
  options.odometry.max_search_translation = 0.6;
  options.odometry.tracking.max_local_search = 0.8;
  plumbline::LogSolver solver(BuiltIns(), options);
  const plumbline::LogSolverResult result = solver.Run(log);
  if (result.trajectory.size() != log.scans.size()) std::abort();
  for (const plumbline::Pose2& pose : result.trajectory) {
    if (!pose.allFinite()) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    plumbline::InputStream input("fuzz", text);
    plumbline::Log log =
        plumbline::ReadCarmenLog(&input, plumbline::LaserOptions());
    if (log.scans.size() > kMostScans) return 0;
    for (const plumbline::Scan& scan : log.scans) {
      if (scan.ranges.size() > kMostBeams) return 0;
    }
    if (!log.has_odometry) plumbline::AddScanOdometry({}, &log);
    Solve(log, plumbline::RawFeatures::kSegments);
    Solve(log, plumbline::RawFeatures::kPoints);
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
  return 0;
}
