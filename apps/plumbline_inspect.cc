// Says what is in a robot's log, what of it would be used, and what would be
// refused and why.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/inspection/log_inspection.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/log_reader.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

DEFINE_bool(json, false, "Write JSON in place of text.");
DEFINE_string(scan_topic, "",
              "Topic of a bag's laser scans; empty: the only one that may be "
              "meant.");
DEFINE_string(odometry_topic, "",
              "Topic of a bag's odometry, tf or none; empty: as "
              "plumbline_solve chooses.");

namespace plumbline {
namespace {

int Run(const std::vector<std::string>& arguments) {
  if (arguments.size() != 1) {
    std::fprintf(stderr, "plumbline_inspect: expected one log; see --help\n");
    return kExitUsage;
  }
  const ThreadsScope threads(GrantedThreads(
      std::max(1, static_cast<int>(std::thread::hardware_concurrency()))));
  Registry readers;
  RegisterBuiltinLogReaders(&readers);
  LaserOptions options;
  options.scan_topic = FLAGS_scan_topic;
  options.odometry_topic = FLAGS_odometry_topic;
  options.stop = [] { return InterruptRequested(); };
  const LogInspection inspection = InspectLog(arguments[0], readers, options);
  // What is not read to its end may be refused for that.
  if (inspection.is_refused && InterruptRequested()) throw Interruption();
  std::cout << (FLAGS_json ? inspection.json : inspection.text);
  return inspection.is_refused ? kExitInput : kExitSuccess;
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  plumbline::AppInfo info;
  info.name = "plumbline_inspect";
  info.summary =
      "Says what is in a robot's log: topics with counts, rates and gaps, "
      "laser "
      "and odometry, what plumbline_solve would use of it, and what it would "
      "refuse and why. Ends with status 2 for a log that would be refused.";
  info.usage = {"LOG [flags]"};
  info.statuses = {{plumbline::kExitInput, "also for a log that is refused"}};
  info.example = "plumbline_inspect robot.bag";
  info.groups = {{"Output", {"json", "quiet", "verbose"}},
                 {"Bags", {"scan_topic", "odometry_topic"}}};
  info.takes_arguments = true;
  const std::vector<std::string> arguments =
      plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain([&] { return plumbline::Run(arguments); });
}
