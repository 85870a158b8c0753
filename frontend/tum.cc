#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/eight_numbers.h>
#include <plumbline/frontend/tum.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace plumbline {

void WriteTum(const std::vector<TimedPose>& trajectory, std::ostream& output) {
  char text[256];
  for (const TimedPose& timed : trajectory) {
    if (!timed.pose.allFinite() || !std::isfinite(timed.timestamp)) {
      throw PLUMBLINE_ERROR("pose of the trajectory is not finite",
                            "finite poses and time stamps");
    }
    if (timed.timestamp_text.empty()) {
      std::snprintf(text, sizeof(text), "%.6f", timed.timestamp);
      output << text;
    } else {
      output << timed.timestamp_text;
    }
    const double half = 0.5 * NormalizeAngle(timed.pose[2]);
    std::snprintf(text, sizeof(text), " %.9f %.9f 0 0 0 %.12f %.12f\n",
                  timed.pose[0], timed.pose[1], std::sin(half), std::cos(half));
    output << text;
  }
}

std::vector<TimedPose> ReadTum(const std::string& path) {
  InputStream input(path);
  return ReadTum(&input);
}

std::vector<TimedPose> ReadTum(InputStream* input) {
  const std::string expected = "eight numbers, timestamp x y z qx qy qz qw";
  std::vector<TimedPose> trajectory;
  std::string_view line;
  std::array<double, 8> row;
  TimedPose timed;
  while (input->ReadLine(&line)) {
    if (!ParseEightNumbers(*input, line, expected, &row,
                           &timed.timestamp_text)) {
      continue;
    }
    const double x = row[4], y = row[5], z = row[6], w = row[7];
    const double norm2 = x * x + y * y + z * z + w * w;
    if (std::abs(norm2 - 1.0) > 0.02) {
      throw Error(input->name(), input->line_number(),
                  "quaternion is not of unit length", expected);
    }
    timed.timestamp = row[0];
    timed.pose =
        Pose2(row[1], row[2],
              std::atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z));
    trajectory.push_back(timed);
  }
  RequireUndamaged(*input);
  if (trajectory.empty())
    throw Error(input->name(), 0, "holds no pose", expected + " a line");
  return trajectory;
}

}  // namespace plumbline
