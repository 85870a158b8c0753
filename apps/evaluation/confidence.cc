#include <plumbline/apps/evaluation/confidence.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

namespace plumbline {
namespace {

constexpr int kSamples = 2000;
constexpr std::uint64_t kBootstrapSeed = 20140124;
// 97.5 % quantile of the standard normal distribution.
constexpr double kNormalQuantile = 1.959963984540054;

double MeanOf(const std::vector<double>& values,
              const std::vector<std::size_t>& indices) {
  double sum = 0.0;
  for (const std::size_t i : indices) sum += values[i];
  return sum / static_cast<double>(indices.size());
}

// Linear interpolation between order statistics.
double Percentile(const std::vector<double>& sorted, double share) {
  const double position = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  if (below + 1 >= sorted.size()) return sorted.back();
  const double fraction = position - static_cast<double>(below);
  if (fraction == 0.0) return sorted[below];
  return sorted[below] + fraction * (sorted[below + 1] - sorted[below]);
}

}  // namespace

Estimate Bootstrap(std::size_t trials, const Statistic& statistic) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (trials == 0) return {kNan, kNan, kNan};
  std::vector<std::size_t> indices(trials);
  std::iota(indices.begin(), indices.end(), std::size_t{0});
  Estimate estimate;
  estimate.value = statistic(indices);
  SimulationRandom random(kBootstrapSeed);
  std::vector<double> values;
  values.reserve(kSamples);
  for (int sample = 0; sample < kSamples; ++sample) {
    for (std::size_t& index : indices) {
      index = static_cast<std::size_t>(
          random.Uniform(0.0, static_cast<double>(trials)));
    }
    const double value = statistic(indices);
    // A ratio with nothing below the line says nothing.
    if (!std::isnan(value)) values.push_back(value);
  }
  if (values.empty()) {
    estimate.low = estimate.high = estimate.value;
    return estimate;
  }
  std::sort(values.begin(), values.end());
  estimate.low = Percentile(values, 0.025);
  estimate.high = Percentile(values, 0.975);
  return estimate;
}

Estimate MeanEstimate(const std::vector<double>& values) {
  return Bootstrap(values.size(), [&](const std::vector<std::size_t>& indices) {
    return MeanOf(values, indices);
  });
}

Estimate RatioEstimate(const std::vector<double>& numerator,
                       const std::vector<double>& denominator) {
  if (numerator.size() != denominator.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(numerator.size()) + " numerators and " +
            std::to_string(denominator.size()) + " denominators",
        "one of each a trial");
  }
  return Bootstrap(
      numerator.size(), [&](const std::vector<std::size_t>& indices) {
        return MeanOf(numerator, indices) / MeanOf(denominator, indices);
      });
}

Estimate ShareEstimate(int successes, int trials) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (trials <= 0) return {kNan, kNan, kNan};
  const double n = trials;
  const double share = successes / n;
  const double z2 = kNormalQuantile * kNormalQuantile;
  const double center = (share + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kNormalQuantile / (1 + z2 / n) *
                      std::sqrt(share * (1 - share) / n + z2 / (4 * n * n));
  return {share, std::max(0.0, center - half), std::min(1.0, center + half)};
}

}  // namespace plumbline
