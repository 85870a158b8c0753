#ifndef MINE_RANGES_READER_H_
#define MINE_RANGES_READER_H_

#include <plumbline/factors/angle.h>
#include <plumbline/frontend/log_reader.h>

#include <sstream>
#include <string>
#include <string_view>
#include <utility>

namespace mine {

//! [reader]
/// Logs that begin with "#ranges" and have a line for each scan: time, odometry
/// (x, y, theta), then ranges over half a turn from right to left; s, m, rad.
inline plumbline::LogReaderType RangesReaderType() {
  plumbline::LogReaderType type;
  type.name = "ranges";
  type.description = "Time, odometry and ranges over half a turn";
  type.recognizes = [](std::string_view prefix) {
    return prefix.substr(0, 7) == "#ranges";
  };
  type.read = [](plumbline::InputStream* input,
                 const plumbline::LaserOptions& options) {
    plumbline::Log log;
    log.scan_message = "ranges";
    log.has_odometry = true;
    std::string_view line;
    while (input->ReadLine(&line)) {
      if (line.empty() || line[0] == '#') continue;
      plumbline::Scan scan;
      std::istringstream fields{std::string(line)};
      fields >> scan.timestamp_text >> scan.odometry[0] >> scan.odometry[1] >>
          scan.odometry[2];
      for (float range = 0.0f; fields >> range;) scan.ranges.push_back(range);
      scan.timestamp = std::stod(scan.timestamp_text);
      scan.start_angle = -0.5 * plumbline::kPi;
      scan.angle_step =
          plumbline::kPi / static_cast<double>(scan.ranges.size());
      scan.maximum_range = options.laser_max_range.value_or(30.0);
      scan.line = input->line_number();
      log.scans.push_back(std::move(scan));
    }
    return log;
  };
  return type;
}
//! [reader]

}  // namespace mine

#endif  // MINE_RANGES_READER_H_
