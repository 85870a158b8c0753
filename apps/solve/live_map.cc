#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/live_map.h>
#include <plumbline/apps/solve/run_summary.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <system_error>
#include <vector>

namespace plumbline {
namespace {

constexpr char kPage[] = "report.html";

}  // namespace

void LiveMap::CheckFlags() {
  if (FLAGS_live_dir.empty()) return;
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::weakly_canonical(FLAGS_live_dir, error) ==
      fs::weakly_canonical(FLAGS_output_dir, error)) {
    throw Error("--live_dir", 0, "is the folder of --output_dir",
                "another one");
  }
}

LiveMap::LiveMap(const RunClock& clock) : clock_(clock) {
  if (FLAGS_live_dir.empty()) return;
  CheckFlags();
  ForFlag("live_dir",
          [this] { report_.emplace(FLAGS_live_dir, FLAGS_live_every); });
}

void LiveMap::Show(const MapSoFar& map,
                   const std::function<std::string()>& stage) {
  if (!is_on() || !report_->IsDue()) return;
  Try([&] { report_->Offer(stage(), [&] { return MakeReport(map); }); });
}

void LiveMap::Finish(const SolveOutcome& outcome) {
  if (!is_on()) return;
  const std::vector<std::string>& files = outcome.summary.files;
  std::filesystem::path written;
  if (std::count(files.begin(), files.end(), kPage) > 0) {
    written = std::filesystem::path(FLAGS_output_dir) / kPage;
  }
  Try([&] {
    report_->Finish(written, [&] {
      Report report =
          MakeReport({*outcome.graph, outcome.trace, [&] {
                        std::vector<Pose2> poses;
                        for (const TimedPose& timed : outcome.trajectory) {
                          poses.push_back(timed.pose);
                        }
                        return poses;
                      }});
      report.summary = outcome.summary;
      report.title = outcome.title;
      return report;
    });
  });
}

Report LiveMap::MakeReport(const MapSoFar& map) const {
  Report report;
  report.graph = &map.graph;
  report.path = map.trajectory();
  for (const EmPhase& phase : map.trace) report.trace.push_back({phase, {}});
  report.summary = BeginSummary();
  report.summary.scans = static_cast<std::int64_t>(report.path.size());
  CountGraph(map.graph, &report.summary);
  clock_.Read(&report.summary);
  report.summary.peak_memory_bytes = PeakMemoryBytes();
  report.flags = OwnFlags();
  report.delta_threshold = FLAGS_delta_threshold;
  report.title = TitleOf(FLAGS_input);
  return report;
}

void LiveMap::Try(const std::function<void()>& write) {
  try {
    write();
  } catch (const Error& error) {
    report_.reset();
    Remark("goes on without --live_dir: %s", error.what());
  }
}

}  // namespace plumbline
