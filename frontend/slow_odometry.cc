#include <plumbline/factors/angle.h>
#include <plumbline/frontend/slow_odometry.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

namespace plumbline {
namespace {

// A reading that holds longer is that of a robot that stands, s.
constexpr double kLongestPeriod = 2.5;
// So many readings of a moving robot say how often odometry comes.
constexpr std::size_t kFewestReadings = 20;
// A reading that holds for more than so many usual times does so, too.
constexpr double kLatePeriods = 1.5;
// No robot goes or turns faster, m/s and rad/s.
constexpr double kFastest = 3.0;
constexpr double kFastestTurn = 3.0;

// Scans in a row with the same odometry.
struct Reading {
  std::size_t begin = 0;
  std::size_t end = 0;
};

std::vector<Reading> ReadingsOf(const std::vector<Scan>& scans) {
  std::vector<Reading> readings;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    if (i == 0 || scans[i].odometry != scans[i - 1].odometry) {
      readings.push_back({i, i});
    }
    readings.back().end = i + 1;
  }
  return readings;
}

template <typename T>
T Median(std::vector<T> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Puts the scans of a reading on the way to the next one; `period`: how long
// one holds usually, s.
void Spread(const Reading& reading, double period, std::vector<Scan>* scans) {
  const Scan& next = (*scans)[reading.end];
  const Pose2 start = (*scans)[reading.begin].odometry;
  double time = next.timestamp - (*scans)[reading.begin].timestamp;
  if (time > kLatePeriods * period) time = period;
  Pose2 motion = next.odometry - start;
  motion[2] = NormalizeAngle(motion[2]);
  if (!(time > 0.0) || motion.head<2>().norm() > kFastest * time ||
      std::abs(motion[2]) > kFastestTurn * time) {
    return;
  }
  for (std::size_t i = reading.begin + 1; i < reading.end; ++i) {
    Scan& scan = (*scans)[i];
    const double share = 1.0 - (next.timestamp - scan.timestamp) / time;
    if (!(share > 0.0 && share < 1.0)) continue;
    scan.odometry = start + share * motion;
    scan.odometry[2] = NormalizeAngle(scan.odometry[2]);
  }
}

}  // namespace

int SpreadSlowOdometry(std::vector<Scan>* scans) {
  const std::vector<Reading> readings = ReadingsOf(*scans);
  // The last one has no next.
  std::vector<double> periods;
  std::vector<std::int64_t> counts;
  for (std::size_t k = 0; k + 1 < readings.size(); ++k) {
    const double period = (*scans)[readings[k].end].timestamp -
                          (*scans)[readings[k].begin].timestamp;
    if (!(period > 0.0 && period <= kLongestPeriod)) continue;
    periods.push_back(period);
    counts.push_back(
        static_cast<std::int64_t>(readings[k].end - readings[k].begin));
  }
  if (counts.size() < kFewestReadings) return 1;
  const auto usual = static_cast<int>(Median(counts));
  if (usual < 2) return 1;
  const double period = Median(periods);
  for (std::size_t k = 0; k + 1 < readings.size(); ++k) {
    Spread(readings[k], period, scans);
  }
  return usual;
}

void SpreadSlowOdometry(Log* log) {
  const int usual = SpreadSlowOdometry(&log->scans);
  if (usual < 2) return;
  log->notes.push_back("odometry has one reading for " + std::to_string(usual) +
                       " scans: between two readings it is interpolated");
}

}  // namespace plumbline
