#ifndef PLUMBLINE_APPS_EVALUATION_CONFIDENCE_H_
#define PLUMBLINE_APPS_EVALUATION_CONFIDENCE_H_

#include <functional>
#include <vector>

namespace plumbline {

/// An estimate with its 95 % confidence interval.
struct Estimate {
  double value = 0.0;
  double low = 0.0;
  double high = 0.0;
};

/// A statistic of a sample of trials, given the indices of the trials that are
/// in the sample (repeated ones count as often).
using Statistic = std::function<double(const std::vector<std::size_t>&)>;

/// The statistic of all `trials` and the percentiles of it over 2000 samples
/// drawn with replacement (bootstrap; Efron 1979). Trials are drawn whole, so a
/// statistic of several columns keeps their pairing. The draws are the same
/// every time. With no trials the estimate is not a number, with one the
/// interval is the value.
Estimate Bootstrap(std::size_t trials, const Statistic& statistic);

/// Of the mean of the values.
Estimate MeanEstimate(const std::vector<double>& values);

/// Of the mean of `numerator` divided by that of `denominator`, trial by trial
/// paired. Throws Error when the sizes differ.
Estimate RatioEstimate(const std::vector<double>& numerator,
                       const std::vector<double>& denominator);

/// Of a probability from `successes` in `trials` (Wilson 1927).
Estimate ShareEstimate(int successes, int trials);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_CONFIDENCE_H_
