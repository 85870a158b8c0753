#include <plumbline/frontend/laser_profile.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace plumbline {
namespace {

// The laser's place is a difference of poses that have six digits after the
// point at most: rounded to the last of them, and an angle to the round one
// that it may stand for, it is what was written, so that a drive is the same in
// all formats.
double RoundPosition(double value) { return std::round(value * 1e6) / 1e6; }
double RoundMountAngle(double angle) {
  const double round = DegToRad(std::round(RadToDeg(angle) * 10.0) / 10.0);
  return std::abs(round - angle) < 2e-6 ? round : std::round(angle * 1e6) / 1e6;
}

double Median(std::vector<double> values) {
  const std::size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + middle, values.end());
  return values[middle];
}

}  // namespace

BeamFan FanOfBeams(int beams, double resolution) {
  const bool standard =
      beams == 180 || beams == 181 || beams == 360 || beams == 361;
  const int intervals = beams % 2 == 0 ? beams : beams - 1;
  double step = intervals > 0 ? kPi / intervals : 0.0;
  if (!standard && resolution > 0.0 && resolution * intervals <= 2.0 * kPi) {
    step = resolution;
  }
  return {-0.5 * step * intervals, step};
}

double SaturatedRange(const std::vector<Scan>& scans, double limit) {
  constexpr double kSmallest = 7.5;
  constexpr int kMostBins = 20000;     // of 1 cm
  constexpr int kHalfPile = 15;        // bins
  constexpr int kBelow = 100;          // bins
  constexpr int kTop = 2 * kHalfPile;  // bins
  constexpr std::int64_t kMinimum = 20;
  const auto bin_of = [](float range) {
    return static_cast<int>(std::lround(range * 100.0));
  };
  std::vector<std::int64_t> histogram;
  std::int64_t total = 0;
  for (const Scan& scan : scans) {
    for (const float range : scan.ranges) {
      if (!(range > 0.0f && range < limit)) continue;
      ++total;
      const int bin = bin_of(range);
      if (bin >= kMostBins) continue;
      if (bin >= static_cast<int>(histogram.size())) {
        histogram.resize(static_cast<std::size_t>(bin) + 1, 0);
      }
      ++histogram[bin];
    }
  }
  const int bins = static_cast<int>(histogram.size());
  const std::int64_t enough = std::max(kMinimum, total / 1000);
  const auto sum = [&histogram, bins](int first, int last) {
    std::int64_t result = 0;
    for (int i = std::max(first, 0); i <= std::min(last, bins - 1); ++i)
      result += histogram[i];
    return result;
  };
  std::int64_t window = 0;
  int top = bins - 1;
  for (; top >= 0; --top) {
    // Readings in [top, top + kTop).
    window += histogram[top];
    if (top + kTop < bins) window -= histogram[top + kTop];
    if (window >= enough) break;
  }
  if (top < 0) return 0.0;
  const auto first = histogram.begin() + std::max(0, top - kHalfPile);
  const auto last = histogram.begin() + std::min(bins, top + kTop);
  const int peak =
      static_cast<int>(std::max_element(first, last) - histogram.begin());
  if (peak < kSmallest * 100.0) return 0.0;
  const std::int64_t pile = sum(peak - kHalfPile, peak + kHalfPile);
  const std::int64_t core = sum(peak - 1, peak + 1);
  const std::int64_t below =
      sum(peak - kHalfPile - kBelow, peak - kHalfPile - 1);
  if (pile < enough || 10 * pile > 9 * total || 2 * core < pile || below > pile)
    return 0.0;

  std::vector<char> beam_has_it;
  for (const Scan& scan : scans) {
    if (beam_has_it.size() < scan.ranges.size())
      beam_has_it.resize(scan.ranges.size(), 0);
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      const float range = scan.ranges[i];
      if (range > 0.0f && range < limit && std::abs(bin_of(range) - peak) <= 1)
        beam_has_it[i] = 1;
    }
  }
  const auto beams = std::count(beam_has_it.begin(), beam_has_it.end(), 1);
  if (10 * beams < static_cast<std::ptrdiff_t>(beam_has_it.size())) return 0.0;

  int lowest = peak;
  while (lowest > peak - kHalfPile &&
         1000 * histogram[lowest - 1] > histogram[peak])
    --lowest;
  return (lowest - 0.5) / 100.0;
}

double RepeatedRange(const std::vector<Scan>& scans) {
  // Of readings that are the same, and of those just below, m.
  constexpr float kSame = 0.0005f;
  constexpr float kBelow = 0.05f;
  constexpr std::int64_t kMinimum = 20;
  float largest = 0.0f;
  std::size_t beams = 0;
  for (const Scan& scan : scans) {
    for (const float range : scan.ranges) largest = std::max(largest, range);
    beams = std::max(beams, scan.ranges.size());
  }
  std::int64_t total = 0;
  std::int64_t same = 0;
  std::int64_t below = 0;
  std::vector<char> has_it(beams, 0);
  std::vector<char> has_other(beams, 0);
  for (const Scan& scan : scans) {
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      const float range = scan.ranges[i];
      if (!(range > 0.0f)) continue;
      ++total;
      if (range > largest - kSame) {
        ++same;
        has_it[i] = 1;
        continue;
      }
      has_other[i] = 1;
      if (range > largest - kBelow) ++below;
    }
  }
  // Of these the beams that do not always have it: the robot may stand.
  std::size_t some = 0;
  std::size_t both = 0;
  for (std::size_t i = 0; i < beams; ++i) {
    some += has_it[i];
    both += has_it[i] & has_other[i];
  }
  const bool is_repeated = same >= std::max(kMinimum, total / 100) &&
                           10 * same < 9 * total && 10 * below <= same &&
                           10 * some >= beams && 2 * both >= some;
  return is_repeated ? largest : 0.0;
}

LaserMount FindLaserMount(const std::vector<Scan>& scans,
                          const std::vector<Pose2>& lasers) {
  std::vector<Pose2> offsets(lasers.size());
  std::array<std::vector<double>, 3> components;
  for (std::size_t i = 0; i < lasers.size(); ++i) {
    offsets[i] = Between(scans[i].odometry, lasers[i]);
    // Near the first, so that the median does not straddle the cut.
    offsets[i][2] =
        offsets[0][2] + NormalizeAngle(offsets[i][2] - offsets[0][2]);
    for (int k = 0; k < 3; ++k) components[k].push_back(offsets[i][k]);
  }
  const Pose2 median(Median(components[0]), Median(components[1]),
                     Median(components[2]));
  LaserMount mount;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const Pose2 difference = offsets[i] - median;
    if (difference.head<2>().norm() > 0.3 ||
        std::abs(NormalizeAngle(difference[2])) > DegToRad(10.0)) {
      mount.apart.push_back(static_cast<int>(i));
    }
  }
  mount.is_fixed = 10 * mount.apart.size() <= offsets.size();
  mount.is_on_robot = median.head<2>().norm() < 5.0;
  mount.pose = Pose2(RoundPosition(median[0]), RoundPosition(median[1]),
                     RoundMountAngle(NormalizeAngle(median[2])));
  return mount;
}

int ThinScan(int most, Scan* scan) {
  const int beams = static_cast<int>(scan->ranges.size());
  const int stride = beams <= most ? 1 : (beams + most - 1) / most;
  if (stride == 1) return 1;
  int kept = 0;
  for (int i = 0; i < beams; i += stride) {
    scan->ranges[kept++] = scan->ranges[i];
  }
  scan->ranges.resize(kept);
  scan->angle_step *= stride;
  return stride;
}

}  // namespace plumbline
