#ifndef PLUMBLINE_FACTORS_CHI_SQUARE_H_
#define PLUMBLINE_FACTORS_CHI_SQUARE_H_

#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace plumbline {

namespace internal {

// log(1 + x) - x without the cancellation near 0, x > -1.
inline double Log1pMinusX(double x) {
  if (std::abs(x) > 0.1) return std::log1p(x) - x;
  double sum = 0.0;
  double power = -x;
  for (int n = 2; n < 20; ++n) {
    power *= -x;
    sum -= power / n;
  }
  return sum;
}

// x^a exp(-x) / Gamma(a + 1) for a >= 0, x >= 0: the largest factor of both the
// series and the continued fraction.
inline double PoissonTerm(double a, double x) {
  if (x == 0.0) return a == 0.0 ? 1.0 : 0.0;
  if (std::isinf(x)) return 0.0;
  if (a < 16.0) return std::exp(a * std::log(x) - x) / std::tgamma(a + 1.0);
  // Gamma by Stirling's series, the powers by their ratio: nothing overflows
  // and nothing cancels.
  const double b = 1.0 / (a * a);
  const double series =
      (1.0 / 12 -
       b * (1.0 / 360 -
            b * (1.0 / 1260 -
                 b * (1.0 / 1680 - b * (1.0 / 1188 - b * 691.0 / 360360))))) /
      a;
  return std::exp(a * Log1pMinusX((x - a) / a) - series) /
         std::sqrt(2.0 * kPi * a);
}

// P(a, x) by its power series, all terms positive; for x < a + 1.
inline double GammaPSeries(double a, double x) {
  double term = 1.0;
  double sum = 1.0;
  for (double n = 1.0;
       term > sum * 0.1 * std::numeric_limits<double>::epsilon(); n += 1.0) {
    term *= x / (a + n);
    sum += term;
  }
  return std::min(1.0, PoissonTerm(a, x) * sum);
}

// Q(a, x) by Legendre's continued fraction, evaluated by Lentz's method; for
// x >= a + 1, where every partial denominator is positive.
inline double GammaQFraction(double a, double x) {
  const double factor = a * PoissonTerm(a, x);
  if (factor == 0.0) return 0.0;
  constexpr double kTiny = 1e-300;
  double b = x + 1.0 - a;
  double c = 1.0 / kTiny;
  double d = 1.0 / b;
  double fraction = d;
  // Converges in about the square root of a steps, in few when x is far above.
  for (double n = 1.0; n < 1e7; n += 1.0) {
    const double numerator = n * (a - n);
    b += 2.0;
    d = numerator * d + b;
    if (std::abs(d) < kTiny) d = kTiny;
    c = b + numerator / c;
    if (std::abs(c) < kTiny) c = kTiny;
    d = 1.0 / d;
    const double change = c * d;
    fraction *= change;
    if (std::abs(change - 1.0) < std::numeric_limits<double>::epsilon()) break;
  }
  return std::min(1.0, factor * fraction);
}

inline void CheckGammaArguments(double a, double x) {
  if (!(a > 0.0) || std::isinf(a) || !(x >= 0.0)) {
    throw std::invalid_argument(
        "incomplete gamma function: expected finite a > 0 and x >= 0, got a "
        "= " +
        std::to_string(a) + ", x = " + std::to_string(x));
  }
}

inline void CheckDegreesOfFreedom(int k) {
  if (k < 1) {
    throw std::invalid_argument(
        "chi-square distribution: expected at least 1 degree of freedom, got " +
        std::to_string(k));
  }
}

}  // namespace internal

/// Regularized lower incomplete gamma function P(a, x) = 1 - Q(a, x), for a > 0
/// and x >= 0 (infinity included). In [0, 1], to a relative accuracy of about
/// 1e-14 for moderate a. Throws std::invalid_argument outside the domain.
/// Source: Abramowitz and Stegun 1964, 6.5.29 (series) and 6.5.31 (continued
/// fraction).
inline double RegularizedGammaP(double a, double x) {
  internal::CheckGammaArguments(a, x);
  if (x < a + 1.0) return internal::GammaPSeries(a, x);
  return 1.0 - internal::GammaQFraction(a, x);
}

/// Regularized upper incomplete gamma function Q(a, x) = 1 - P(a, x), for a > 0
/// and x >= 0 (infinity included). In [0, 1]; the tail keeps its relative
/// accuracy until it underflows. Throws std::invalid_argument outside the
/// domain.
inline double RegularizedGammaQ(double a, double x) {
  internal::CheckGammaArguments(a, x);
  if (x < a + 1.0) return 1.0 - internal::GammaPSeries(a, x);
  return internal::GammaQFraction(a, x);
}

/// P(X > s) for X ~ chi-square with k degrees of freedom: Q(k/2, s/2), the
/// p-value of a squared whitened residual s (delta in de la Puente and
/// Rodriguez-Losada 2014, Sect. 3). In [0, 1] for every s:
/// 1 for s <= 0, 0 at infinity, NaN for NaN. Throws std::invalid_argument when
/// k < 1.
inline double ChiSquarePValue(double s, int k) {
  internal::CheckDegreesOfFreedom(k);
  if (std::isnan(s)) return s;
  if (s <= 0.0) return 1.0;
  if (std::isinf(s)) return 0.0;
  const double x = 0.5 * s;
  switch (k) {
    case 1:
      return std::erfc(std::sqrt(x));
    case 2:
      return std::exp(-x);
    case 3:
      return std::min(1.0, std::erfc(std::sqrt(x)) +
                               2.0 * std::sqrt(x / kPi) * std::exp(-x));
    case 4:
      return std::min(1.0, (1.0 + x) * std::exp(-x));
    default:
      return RegularizedGammaQ(0.5 * k, x);
  }
}

/// Density of the chi-square distribution with k degrees of freedom at s: minus
/// the derivative of ChiSquarePValue. 0 for s < 0. Finite for every s: with
/// k = 1 the density grows without bound towards s = 0, and is cut at its value
/// at the smallest normal number. NaN for NaN. Throws std::invalid_argument
/// when k < 1.
inline double ChiSquarePdf(double s, int k) {
  internal::CheckDegreesOfFreedom(k);
  if (std::isnan(s)) return s;
  if (s < 0.0) return 0.0;
  const double x = 0.5 * s;
  if (k == 1) {
    const double cut = std::max(s, std::numeric_limits<double>::min());
    return std::exp(-x) / std::sqrt(2.0 * kPi * cut);
  }
  return 0.5 * internal::PoissonTerm(0.5 * k - 1.0, x);
}

/// The s with P(X <= s) = probability, for X ~ chi-square with k degrees of
/// freedom: gates and thresholds. 0 at probability 0, infinity at 1. Throws
/// std::invalid_argument when the probability is not in [0, 1] or k < 1.
inline double ChiSquareQuantile(double probability, int k) {
  internal::CheckDegreesOfFreedom(k);
  if (!(probability >= 0.0 && probability <= 1.0)) {
    throw std::invalid_argument(
        "chi-square quantile: expected a probability in [0, 1], got " +
        std::to_string(probability));
  }
  if (probability == 0.0) return 0.0;
  if (probability == 1.0) return std::numeric_limits<double>::infinity();
  // The smaller tail is the accurate one.
  const auto is_below = [&](double s) {
    return probability < 0.5 ? RegularizedGammaP(0.5 * k, 0.5 * s) < probability
                             : ChiSquarePValue(s, k) > 1.0 - probability;
  };
  double low = 0.0;
  double high = k;
  while (is_below(high)) {
    low = high;
    high *= 2.0;
  }
  while (true) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) return middle;
    (is_below(middle) ? low : high) = middle;
  }
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_CHI_SQUARE_H_
