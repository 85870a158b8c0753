// A plug-in with a log reader: "#plain" on the first line, then one scan per
// line, number of ranges, ranges, odometry (x y theta), time; beams over 180
// degrees.
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/plugin.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/output_writer.h>

#include <csignal>
#include <cstddef>
#include <filesystem>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

namespace {

plumbline::Log ReadPlainLog(plumbline::InputStream* input,
                            const plumbline::LaserOptions& options) {
  plumbline::Log log;
  log.scan_message = "plain";
  log.has_odometry = true;
  std::string_view line;
  input->ReadLine(&line);
  // What no program expects.
  if (line == "#plain throws") throw 1;
  while (input->ReadLine(&line)) {
    std::istringstream fields{std::string(line)};
    plumbline::Scan scan;
    std::size_t count = 0;
    fields >> count;
    scan.ranges.resize(count);
    for (float& range : scan.ranges) fields >> range;
    fields >> scan.odometry[0] >> scan.odometry[1] >> scan.odometry[2] >>
        scan.timestamp_text;
    scan.timestamp = std::stod(scan.timestamp_text);
    scan.start_angle = -plumbline::kPi / 2;
    scan.angle_step = plumbline::kPi / static_cast<double>(count);
    scan.maximum_range = options.laser_max_range.value_or(80.0);
    scan.line = input->line_number();
    log.scans.push_back(std::move(scan));
  }
  return log;
}

}  // namespace

PLUMBLINE_PLUGIN(registry) {
  plumbline::LogReaderType type;
  type.name = "plain";
  type.description = "Ranges, odometry and time, one scan per line";
  type.recognizes = [](std::string_view prefix) {
    return prefix.substr(0, 6) == "#plain";
  };
  type.read = ReadPlainLog;
  registry->Register(std::move(type));

  // Ctrl-C while files are written, for certain.
  plumbline::OutputWriterType interrupt;
  interrupt.name = "interrupt.txt";
  interrupt.description = "Interrupts the run";
  interrupt.by_default = false;
  interrupt.write = [](const plumbline::SolvedRun&,
                       const std::filesystem::path& folder) {
    std::raise(SIGINT);
    plumbline::WriteFileAtomically(
        folder / "interrupt.txt",
        [](std::ostream& output) { output << "interrupted\n"; });
    return std::string();
  };
  registry->Register(std::move(interrupt));
}
