#include <plumbline/detectors/heading_drift.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

// Standard deviation of a normal distribution over its median absolute
// deviation, and of a median over that of a mean.
constexpr double kOfMedianDeviation = 1.4826;
constexpr double kOfMedian = 1.2533;

// Changes the order of `values`, which are not empty.
double Median(std::vector<double>* values) {
  const auto middle =
      values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// The median, or zero where chance explains it.
double SignificantMedian(std::vector<double>* values) {
  const double median = Median(values);
  for (double& value : *values) value = std::abs(value - median);
  const double deviation = kOfMedian * kOfMedianDeviation * Median(values) /
                           std::sqrt(static_cast<double>(values->size()));
  return std::abs(median) > HeadingDrift::kSignificance * deviation ? median
                                                                    : 0.0;
}

}  // namespace

HeadingDrift::HeadingDrift(std::vector<double> headings)
    : headings_(std::move(headings)), sums_(headings_.size(), 0.0) {
  if (!headings_.empty()) steps_.resize(headings_.size() - 1);
}

void HeadingDrift::AddTurn(std::size_t step, double turn, double information) {
  Step& of = steps_[step];
  // Near what the map says, so that sums do not wrap.
  const double in_map = headings_[step + 1] - headings_[step];
  of.turn += information * (in_map + NormalizeAngle(turn - in_map));
  of.information += information;
}

void HeadingDrift::Estimate() {
  std::vector<double> missing;
  for (std::size_t k = 0; k < steps_.size(); ++k) {
    missing.clear();
    const std::size_t begin = k > kHalfWindow ? k - kHalfWindow : 0;
    const std::size_t end = std::min(steps_.size(), k + kHalfWindow + 1);
    for (std::size_t i = begin; i < end; ++i) {
      if (steps_[i].information <= 0.0) continue;
      missing.push_back(headings_[i + 1] - headings_[i] -
                        steps_[i].turn / steps_[i].information);
    }
    const bool is_known =
        steps_[k].information > 0.0 && missing.size() >= kFewestSteps;
    sums_[k + 1] = sums_[k] + (is_known ? SignificantMedian(&missing) : 0.0);
  }
}

double HeadingDrift::Between(std::size_t from, std::size_t to) const {
  if (std::max(from, to) - std::min(from, to) > kHalfWindow) return 0.0;
  return sums_[to] - sums_[from];
}

}  // namespace plumbline
