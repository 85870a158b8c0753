#ifndef PLUMBLINE_DETECTORS_NORMALITY_TEST_H_
#define PLUMBLINE_DETECTORS_NORMALITY_TEST_H_

#include <cstddef>
#include <vector>

namespace plumbline {

/// Fewest samples for which the normal approximation of the sample kurtosis
/// holds (Anscombe and Glynn 1983).
constexpr std::size_t kMinimumNormalitySamples = 20;

/// D'Agostino's Z of skewness: `skewness` is m3 / m2^1.5 of `n` samples with
/// central moments m2, m3 (divided by n). Standard normal when the samples are
/// normal. Needs n >= 8.
double SkewnessZ(std::size_t n, double skewness);

/// Anscombe and Glynn's Z of kurtosis: `kurtosis` is m4 / m2^2 of `n` samples
/// (3 for a normal distribution). Standard normal when the samples are normal.
/// Needs n >= kMinimumNormalitySamples.
double KurtosisZ(std::size_t n, double kurtosis);

/// Result of D'Agostino's K^2 test.
struct NormalityResult {
  /// False when there are fewer than kMinimumNormalitySamples samples or when
  /// they do not vary: the other members say nothing then.
  bool applicable = false;
  double skewness_z = 0.0;
  double kurtosis_z = 0.0;
  /// skewness_z^2 + kurtosis_z^2: chi^2 with 2 degrees of freedom when the
  /// samples are normal.
  double k_squared = 0.0;
  /// Probability of a larger k_squared from normal samples.
  double p_value = 1.0;
};

/// D'Agostino's K^2 omnibus test of normality (D'Agostino, Belanger and
/// D'Agostino, The American Statistician 44(4), 1990). The unit of the samples
/// does not matter; their order does not either, but for rounding.
NormalityResult TestNormality(const std::vector<double>& samples);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_NORMALITY_TEST_H_
