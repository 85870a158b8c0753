#include <plumbline/frontend/range_noise.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace plumbline {
namespace {

// Neighbours whose ranges differ by more lie on different surfaces, m.
constexpr double kLargestStep = 0.3;
// Quantiles of the sizes of deviations, and where the standard normal
// distribution has them.
struct Quantile {
  double share;
  double normal;
};
constexpr Quantile kQuantiles[] = {
    {0.2, 0.25335}, {0.3, 0.38532}, {0.5, 0.67449}};

}  // namespace

double RangeNoiseScale(double range_sigma) {
  return std::max(1.0, range_sigma / kUsualRangeNoise);
}

void RangeNoise::Add(const Scan& scan) {
  // Of beams whose angles to both neighbours are the same.
  const double even = scan.angle_step;
  const double even_weight = std::sin(even) / std::sin(even + even);
  for (std::size_t i = 1; i + 1 < scan.ranges.size(); ++i) {
    const double before = scan.ranges[i - 1];
    const double range = scan.ranges[i];
    const double after = scan.ranges[i + 1];
    // What is no return is stored as 0.
    if (!(before > 0.0 && range > 0.0 && after > 0.0) ||
        std::abs(before - range) > kLargestStep ||
        std::abs(after - range) > kLargestStep) {
      continue;
    }
    double weight_before = even_weight;
    double weight_after = even_weight;
    if (!scan.bearings.empty()) {
      const double step_before = scan.Bearing(i) - scan.Bearing(i - 1);
      const double step_after = scan.Bearing(i + 1) - scan.Bearing(i);
      const double both = std::sin(step_before + step_after);
      weight_before = std::sin(step_after) / both;
      weight_after = std::sin(step_before) / both;
    }
    const double straight =
        1.0 / (weight_before / before + weight_after / after);
    // Of `straight` with respect to its neighbours' ranges.
    const double slope_before =
        weight_before * straight * straight / (before * before);
    const double slope_after =
        weight_after * straight * straight / (after * after);
    const double deviation = std::abs(range - straight) /
                             std::sqrt(1.0 + slope_before * slope_before +
                                       slope_after * slope_after);
    // Not for beams in one direction.
    if (!std::isfinite(deviation)) continue;
    ++counts_[static_cast<std::size_t>(
        std::min(deviation / kBinWidth, kBins - 1.0))];
    ++total_;
  }
}

double RangeNoise::sigma() const {
  if (total_ < kFewest) return 0.0;
  double smallest = std::numeric_limits<double>::infinity();
  for (const Quantile& quantile : kQuantiles) {
    const double rank = quantile.share * static_cast<double>(total_);
    double below = 0.0;
    std::size_t bin = 0;
    while (bin + 1 < kBins &&
           below + static_cast<double>(counts_[bin]) < rank) {
      below += static_cast<double>(counts_[bin++]);
    }
    // Deviations are spread evenly over their bin.
    const double inside = (rank - below) / static_cast<double>(counts_[bin]);
    smallest = std::min(smallest, (static_cast<double>(bin) + inside) *
                                      kBinWidth / quantile.normal);
  }
  return smallest;
}

}  // namespace plumbline
