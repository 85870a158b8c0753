#include <plumbline/detectors/normality_test.h>

#include <algorithm>
#include <cmath>

namespace plumbline {

double SkewnessZ(std::size_t samples, double skewness) {
  const double n = static_cast<double>(samples);
  const double y =
      skewness * std::sqrt((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0)));
  const double beta2 = 3.0 * (n * n + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0) /
                       ((n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0));
  const double w2 = -1.0 + std::sqrt(2.0 * (beta2 - 1.0));
  const double delta = 1.0 / std::sqrt(0.5 * std::log(w2));
  const double alpha = std::sqrt(2.0 / (w2 - 1.0));
  return delta * std::asinh(y / alpha);
}

double KurtosisZ(std::size_t samples, double kurtosis) {
  const double n = static_cast<double>(samples);
  const double mean = 3.0 * (n - 1.0) / (n + 1.0);
  const double variance = 24.0 * n * (n - 2.0) * (n - 3.0) /
                          ((n + 1.0) * (n + 1.0) * (n + 3.0) * (n + 5.0));
  const double x = (kurtosis - mean) / std::sqrt(variance);
  const double skewness =
      6.0 * (n * n - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0)) *
      std::sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0)));
  const double a =
      6.0 + 8.0 / skewness *
                (2.0 / skewness + std::sqrt(1.0 + 4.0 / (skewness * skewness)));
  // The approximation has its pole where the kurtosis is far below normal (two
  // distant modes, kurtosis near 1). Past the pole the formula would change
  // sign; the answer there is "as far from normal as can be".
  const double denominator =
      std::max(1.0 + x * std::sqrt(2.0 / (a - 4.0)), 1e-6);
  return (1.0 - 2.0 / (9.0 * a) - std::cbrt((1.0 - 2.0 / a) / denominator)) /
         std::sqrt(2.0 / (9.0 * a));
}

NormalityResult TestNormality(const std::vector<double>& samples) {
  NormalityResult result;
  if (samples.size() < kMinimumNormalitySamples) return result;
  const double n = static_cast<double>(samples.size());
  double mean = 0.0;
  for (const double sample : samples) mean += sample;
  mean /= n;
  double largest = 0.0;
  for (const double sample : samples) {
    largest = std::max(largest, std::abs(sample - mean));
  }
  // What is left of equal samples after rounding is not a distribution.
  if (!(largest > 1e-13 * std::abs(mean)) || !std::isfinite(largest)) {
    return result;
  }
  double m2 = 0.0, m3 = 0.0, m4 = 0.0;
  for (const double sample : samples) {
    // Scaled, so that the fourth power of tiny deviations does not vanish.
    const double d = (sample - mean) / largest;
    m2 += d * d;
    m3 += d * d * d;
    m4 += d * d * d * d;
  }
  m2 /= n;
  m3 /= n;
  m4 /= n;
  result.applicable = true;
  result.skewness_z = SkewnessZ(samples.size(), m3 / (m2 * std::sqrt(m2)));
  result.kurtosis_z = KurtosisZ(samples.size(), m4 / (m2 * m2));
  result.k_squared = result.skewness_z * result.skewness_z +
                     result.kurtosis_z * result.kurtosis_z;
  result.p_value = std::exp(-0.5 * result.k_squared);
  return result;
}

}  // namespace plumbline
