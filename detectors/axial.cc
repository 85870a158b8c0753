#include <plumbline/detectors/axial.h>
#include <plumbline/detectors/normality_test.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

namespace plumbline {
namespace {

// The half circle in bins of a quarter of a degree.
constexpr int kBins = 720;
constexpr double kBinWidth = kPi / kBins;
// Half-widths of the sliding windows in bins: 0.6 to 4.1 degrees.
constexpr std::array<int, 4> kHalfWidths = {2, 4, 8, 16};
// Bins added on both sides of a window, so that tails are seen whole.
constexpr int kMargin = 4;
// A longer wall is not more evidence of a direction than this, m.
constexpr double kEvidenceLength = 3.0;
// Spreads are not estimated below this, rad.
constexpr double kSmallestStddev = DegToRad(0.05);
// The middle of a component in standard deviations to either side, and how much
// denser than its flanks it has to be.
constexpr double kCoreWidth = 1.2;
constexpr double kPeakContrast = 1.25;
constexpr int kMaxEmIterations = 100;
// Change of the log-likelihood at which EM ends; splits are decided on
// differences of about ten.
constexpr double kEmTolerance = 1e-3;

int BinOf(double angle) {
  const double position = (NormalizeAxial(angle) + kPi / 2) / kBinWidth;
  return std::clamp(static_cast<int>(position), 0, kBins - 1);
}

double BinCenter(int bin) { return -kPi / 2 + (bin + 0.5) * kBinWidth; }

double Weight(double length) {
  return std::min(length, kEvidenceLength) / kEvidenceLength;
}

// Log of Bennett's bound on P(S >= observed) for a compound Poisson sum S of
// marks of at most 1 with this mean and variance.
double LogTailBound(double observed, double mean, double variance) {
  const double excess = observed - mean;
  if (excess <= 0.0) return 0.0;
  const double u = excess / variance;
  return -variance * ((1.0 + u) * std::log1p(u) - u);
}

// Weights by direction, and the clutter among them.
class Histogram {
 public:
  Histogram(const std::vector<AxialSample>& samples,
            const std::vector<double>& known,
            const AxialMixtureOptions& options)
      : options_(options) {
    for (int bin = 0; bin < kBins; ++bin) {
      excluded_[bin] = NearestAxial(known, BinCenter(bin), options.gate) >= 0;
    }
    for (const AxialSample& sample : samples) {
      const int bin = BinOf(sample.angle);
      if (excluded_[bin]) continue;
      const double weight = Weight(sample.length);
      weight_[bin] += weight;
      squared_[bin] += weight * weight;
      prior_weight_ += weight;
      prior_squared_ += weight * weight;
      ++samples_[bin];
      ++count_;
    }
    if (count_ == 0) return;
    prior_weight_ /= count_;
    prior_squared_ /= count_;
    // Windows that do not overlap, twice as many for those that do.
    double windows = 0.0;
    for (const int half : kHalfWidths) {
      windows += 2.0 * kBins / (2 * half + 1);
    }
    log_threshold_ = std::log(options.significance / windows);
    Mask();
  }

  bool masked(int bin) const { return masked_[bin]; }
  double weight(int bin) const { return weight_[bin]; }
  // True when the window stands out of the clutter around it.
  bool Significant(int center, int half) const {
    double observed = 0.0;
    double outside_weight = background_weight_;
    double outside_squared = background_squared_;
    int bins = 0, outside_bins = background_bins_;
    for (int i = center - half; i <= center + half; ++i) {
      const int bin = (i + kBins) % kBins;
      if (excluded_[bin]) continue;
      observed += weight_[bin];
      ++bins;
      if (masked_[bin]) continue;
      // What is tested is not part of what it is tested against.
      outside_weight -= weight_[bin];
      outside_squared -= squared_[bin];
      --outside_bins;
    }
    if (bins == 0) return false;
    if (outside_bins <= 0) outside_bins = all_bins_;
    const double share = static_cast<double>(bins) / outside_bins;
    const double mean = share * std::max(outside_weight, prior_weight_);
    const double variance = share * std::max(outside_squared, prior_squared_);
    return Exceeds(observed, mean, variance);
  }

  // True when clutter with this mean and variance does not explain a sum of
  // weights.
  bool Exceeds(double observed, double mean, double variance) const {
    return observed >= options_.min_contrast * mean &&
           LogTailBound(observed, mean, variance) <= log_threshold_;
  }

  // Samples of clutter in one bin.
  double background() const {
    return background_count_ /
           (background_bins_ > 0 ? background_bins_ : std::max(all_bins_, 1));
  }

 private:
  void Mask() {
    for (;;) {
      EstimateBackground();
      std::array<bool, kBins> found{};
      for (const int half : kHalfWidths) {
        for (int center = 0; center < kBins; ++center) {
          if (excluded_[center] || !Significant(center, half)) continue;
          for (int i = center - half - kMargin; i <= center + half + kMargin;
               ++i) {
            const int bin = (i + kBins) % kBins;
            if (!excluded_[bin]) found[bin] = true;
          }
        }
      }
      bool changed = false;
      for (int bin = 0; bin < kBins; ++bin) {
        if (found[bin] && !masked_[bin]) {
          masked_[bin] = true;
          changed = true;
        }
      }
      if (!changed) return;
    }
  }

  // One sample of clutter more than was seen: nothing is certain in an empty
  // map.
  void EstimateBackground() {
    background_weight_ = prior_weight_;
    background_squared_ = prior_squared_;
    background_count_ = 1.0;
    background_bins_ = 0;
    all_bins_ = 0;
    for (int bin = 0; bin < kBins; ++bin) {
      if (excluded_[bin]) continue;
      ++all_bins_;
      if (masked_[bin]) continue;
      background_weight_ += weight_[bin];
      background_squared_ += squared_[bin];
      background_count_ += samples_[bin];
      ++background_bins_;
    }
  }

  const AxialMixtureOptions& options_;
  std::array<int, kBins> samples_{};
  std::array<double, kBins> weight_{};
  std::array<double, kBins> squared_{};
  std::array<bool, kBins> excluded_{};
  std::array<bool, kBins> masked_{};
  int count_ = 0;
  double prior_weight_ = 0.0;
  double prior_squared_ = 0.0;
  // Sums over the bins that are taken for clutter, one sample more included.
  double background_weight_ = 0.0;
  double background_squared_ = 0.0;
  double background_count_ = 0.0;
  int background_bins_ = 0;
  int all_bins_ = 0;
  double log_threshold_ = 0.0;
};

struct ArcSample {
  double x;         // rad from where the arc begins
  double variance;  // of the observation
  double length;
};

struct Gaussian {
  double proportion;
  double mean;
  double variance;  // of the true directions
};

// Gaussians over a uniform background on one arc.
struct Mixture {
  double width;
  double background;  // proportion
  std::vector<Gaussian> gaussians;
  double log_likelihood = -std::numeric_limits<double>::infinity();
};

double Density(const Gaussian& gaussian, const ArcSample& sample) {
  const double variance = gaussian.variance + sample.variance;
  const double d = sample.x - gaussian.mean;
  return gaussian.proportion * std::exp(-0.5 * d * d / variance) /
         std::sqrt(2.0 * kPi * variance);
}

// Maximum likelihood by EM. A sample's true direction is a hidden variable next
// to its component: given the component it is Gaussian with the precision
// weighted mean of sample and component.
void Estimate(const std::vector<ArcSample>& samples, bool estimate_background,
              Mixture* mixture) {
  struct Sums {
    double responsibility, first, second;
  };
  const std::size_t k = mixture->gaussians.size();
  std::vector<double> density(k);
  std::vector<Sums> sums(k);
  mixture->log_likelihood = -std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMaxEmIterations; ++iteration) {
    std::fill(sums.begin(), sums.end(), Sums{0.0, 0.0, 0.0});
    double background = 0.0, log_likelihood = 0.0;
    for (const ArcSample& sample : samples) {
      const double uniform = mixture->background / mixture->width;
      double total = uniform;
      for (std::size_t j = 0; j < k; ++j) {
        density[j] = Density(mixture->gaussians[j], sample);
        total += density[j];
      }
      log_likelihood += std::log(total);
      background += uniform / total;
      for (std::size_t j = 0; j < k; ++j) {
        const Gaussian& gaussian = mixture->gaussians[j];
        const double r = density[j] / total;
        const double gain =
            gaussian.variance / (gaussian.variance + sample.variance);
        // Relative to the present mean, so that no digits cancel.
        const double hidden = gain * (sample.x - gaussian.mean);
        sums[j].responsibility += r;
        sums[j].first += r * hidden;
        sums[j].second += r * (hidden * hidden + gain * sample.variance);
      }
    }
    const double n = static_cast<double>(samples.size());
    // A background of nothing could never come back.
    if (estimate_background) {
      mixture->background = std::max(background / n, 1e-3 / n);
    }
    for (std::size_t j = 0; j < k; ++j) {
      Gaussian& gaussian = mixture->gaussians[j];
      const double r = std::max(sums[j].responsibility, 1e-9);
      const double shift = sums[j].first / r;
      gaussian.proportion = sums[j].responsibility / n;
      gaussian.mean += shift;
      gaussian.variance = std::max(sums[j].second / r - shift * shift,
                                   kSmallestStddev * kSmallestStddev);
    }
    const double change = log_likelihood - mixture->log_likelihood;
    mixture->log_likelihood = log_likelihood;
    if (change < kEmTolerance) return;
  }
}

// The samples that belong to a component rather than to another one or to the
// background, in order.
std::vector<ArcSample> MembersOf(const std::vector<ArcSample>& samples,
                                 const Mixture& mixture, std::size_t j) {
  std::vector<ArcSample> members;
  for (const ArcSample& sample : samples) {
    const double own = Density(mixture.gaussians[j], sample);
    bool largest = own > mixture.background / mixture.width;
    for (std::size_t i = 0; largest && i < mixture.gaussians.size(); ++i) {
      largest = i == j || own >= Density(mixture.gaussians[i], sample);
    }
    if (largest) members.push_back(sample);
  }
  return members;
}

bool WantsSplit(const std::vector<ArcSample>& members, const Gaussian& gaussian,
                const AxialMixtureOptions& options) {
  if (std::sqrt(gaussian.variance) > options.max_stddev) return true;
  std::vector<double> residuals;
  residuals.reserve(members.size());
  for (const ArcSample& member : members) {
    residuals.push_back((member.x - gaussian.mean) /
                        std::sqrt(gaussian.variance + member.variance));
  }
  const NormalityResult result = TestNormality(residuals);
  return result.applicable && result.p_value < options.normality_significance;
}

// Cuts `members` (ascending) in two at the place where two Gaussians explain
// them best. False when there are too few.
bool BestCut(const std::vector<ArcSample>& members, const Gaussian& parent,
             Gaussian* left, Gaussian* right) {
  const std::size_t n = members.size();
  if (n < 4) return false;
  const double origin = parent.mean;
  double sum = 0.0, squares = 0.0;
  for (const ArcSample& member : members) {
    sum += member.x - origin;
    squares += (member.x - origin) * (member.x - origin);
  }
  const auto fit = [&](double count, double first, double second) {
    const double mean = first / count;
    const double variance = std::max(second / count - mean * mean,
                                     kSmallestStddev * kSmallestStddev);
    return Gaussian{parent.proportion * count / static_cast<double>(n),
                    origin + mean, variance};
  };
  double best = std::numeric_limits<double>::infinity();
  double left_sum = 0.0, left_squares = 0.0;
  for (std::size_t i = 0; i + 2 < n; ++i) {
    const double d = members[i].x - origin;
    left_sum += d;
    left_squares += d * d;
    if (i == 0) continue;
    const double n1 = static_cast<double>(i + 1);
    const double n2 = static_cast<double>(n) - n1;
    const Gaussian a = fit(n1, left_sum, left_squares);
    const Gaussian b = fit(n2, sum - left_sum, squares - left_squares);
    // Minus twice the log-likelihood of the classified samples, but for what
    // all cuts have in common.
    const double cost = n1 * (std::log(a.variance) - 2.0 * std::log(n1)) +
                        n2 * (std::log(b.variance) - 2.0 * std::log(n2));
    if (cost < best) {
      best = cost;
      *left = a;
      *right = b;
    }
  }
  return std::isfinite(best);
}

// Takes the densest window out of `members` (ascending) of a broad Gaussian:
// *narrow is what is in it, *rest the parent without it. False when no window
// holds more than the parent explains.
bool BestPeak(const std::vector<ArcSample>& members, const Gaussian& parent,
              Gaussian* narrow, Gaussian* rest) {
  const double n = static_cast<double>(members.size());
  const double parent_stddev = std::sqrt(parent.variance);
  double best = 0.0;
  for (const int bins : kHalfWidths) {
    const double half = bins * kBinWidth;
    if (half > parent_stddev) break;
    std::size_t begin = 0, end = 0;
    for (const ArcSample& center : members) {
      while (members[begin].x < center.x - half) ++begin;
      while (end < members.size() && members[end].x <= center.x + half) ++end;
      const double count = static_cast<double>(end - begin);
      const double d = (center.x - parent.mean) / parent_stddev;
      const double explained = n * 2.0 * half * std::exp(-0.5 * d * d) /
                               (std::sqrt(2.0 * kPi) * parent_stddev);
      if (count < 3.0 || count <= explained) continue;
      // Log-likelihood ratio of two Poisson rates.
      const double gain =
          count * std::log(count / explained) - (count - explained);
      if (gain > best) {
        best = gain;
        const double share = std::min(count / n, 0.9);
        *narrow = {parent.proportion * share, center.x, 0.25 * half * half};
        *rest = {parent.proportion * (1.0 - share), parent.mean,
                 parent.variance};
      }
    }
  }
  return best > 0.0;
}

bool SeparateModes(const Mixture& mixture, std::size_t changed, bool too_wide,
                   const AxialMixtureOptions& options) {
  const std::vector<Gaussian>& g = mixture.gaussians;
  for (std::size_t i = 0; i < g.size(); ++i) {
    for (std::size_t j = i + 1; j < g.size(); ++j) {
      const double distance = std::abs(g[i].mean - g[j].mean);
      if (distance < options.min_separation) return false;
      // Two equal Gaussians have one mode when nearer than twice their standard
      // deviation. What was too wide is split nevertheless.
      if (!too_wide && i == changed && j + 1 == g.size() &&
          distance < std::sqrt(g[i].variance) + std::sqrt(g[j].variance)) {
        return false;
      }
    }
  }
  return true;
}

// `samples` ascending in x.
Mixture FitMixture(const std::vector<ArcSample>& samples, double width,
                   double background, const AxialMixtureOptions& options) {
  Mixture mixture;
  mixture.width = width;
  mixture.background = background;
  double mean = 0.0, variance = 0.0;
  const double n = static_cast<double>(samples.size());
  for (const ArcSample& sample : samples) mean += sample.x / n;
  for (const ArcSample& sample : samples) {
    variance += (sample.x - mean) * (sample.x - mean) / n;
  }
  variance = std::max(variance, kSmallestStddev * kSmallestStddev);
  mixture.gaussians.push_back({1.0 - background, mean, variance});
  Estimate(samples, false, &mixture);

  // Components before `next` are as they should be or cannot be split.
  std::size_t next = 0;
  while (next < mixture.gaussians.size()) {
    const std::vector<ArcSample> members = MembersOf(samples, mixture, next);
    const bool too_wide =
        std::sqrt(mixture.gaussians[next].variance) > options.max_stddev;
    bool changed = false;
    if (WantsSplit(members, mixture.gaussians[next], options)) {
      Mixture best = mixture;
      for (const auto& propose : {BestCut, BestPeak}) {
        Mixture split = mixture;
        split.gaussians.emplace_back();
        if (!propose(members, mixture.gaussians[next], &split.gaussians[next],
                     &split.gaussians.back())) {
          continue;
        }
        Estimate(samples, false, &split);
        // Three parameters more: proportion, mean, variance.
        const double price = 0.5 * 3.0 * std::log(n);
        if (split.log_likelihood > mixture.log_likelihood + price &&
            split.log_likelihood > best.log_likelihood &&
            SeparateModes(split, next, too_wide, options)) {
          best = std::move(split);
          changed = true;
        }
      }
      if (changed) mixture = std::move(best);
    }
    if (!changed) ++next;
  }
  // Clutter may be denser here than elsewhere; had that been allowed from the
  // start, it would have swallowed what was to be split.
  Estimate(samples, true, &mixture);
  return mixture;
}

// True when the middle of the j-th Gaussian is denser than its flanks on both
// sides, up to where another one is nearer or a known direction begins: the
// shoulder of something larger is not, and near a known direction there must be
// room enough to tell.
bool IsPeak(const std::vector<ArcSample>& samples,
            const std::vector<Gaussian>& gaussians, std::size_t j, double noise,
            const std::vector<double>& known_offsets, double gate) {
  const double mean = gaussians[j].mean;
  const double half = kCoreWidth * std::sqrt(gaussians[j].variance + noise);
  double lower = mean - 3.0 * half, upper = mean + 3.0 * half;
  for (const double offset : known_offsets) {
    const double distance = NormalizeAxial(offset - mean);
    if (std::abs(distance) < gate + 2.0 * half) return false;
    if (distance < 0.0) lower = std::max(lower, mean + distance + gate);
    if (distance > 0.0) upper = std::min(upper, mean + distance - gate);
  }
  const auto density_at = [&](double x) {
    double density = 0.0;
    for (const Gaussian& gaussian : gaussians) {
      density += Density(gaussian, {x, noise, 0.0});
    }
    return density;
  };
  const double top = density_at(mean);
  for (const Gaussian& other : gaussians) {
    const double middle = 0.5 * (mean + other.mean);
    if (other.mean < mean) lower = std::max(lower, middle);
    if (other.mean > mean) upper = std::min(upper, middle);
    if (other.mean == mean || density_at(other.mean) <= top) continue;
    // Down from the higher one and up again.
    double valley = top;
    for (int i = 1; i < 20; ++i) {
      valley =
          std::min(valley, density_at(mean + 0.05 * i * (other.mean - mean)));
    }
    if (top < kPeakContrast * valley) return false;
  }
  double core = 0.0, left = 0.0, right = 0.0;
  for (const ArcSample& sample : samples) {
    const double weight = Weight(sample.length);
    if (std::abs(sample.x - mean) <= half) {
      core += weight;
    } else if (sample.x < mean && sample.x >= lower) {
      left += weight;
    } else if (sample.x > mean && sample.x <= upper) {
      right += weight;
    }
  }
  const double density = core / (2.0 * half) / kPeakContrast;
  const double left_width = mean - half - lower;
  const double right_width = upper - mean - half;
  return (left_width <= 0.0 || left <= density * left_width) &&
         (right_width <= 0.0 || right <= density * right_width);
}

// True when a longer component is nearer than `min_separation`.
bool IsOvershadowed(const std::vector<AxialComponent>& components,
                    std::size_t j, double min_separation) {
  const AxialComponent& own = components[j];
  for (std::size_t i = 0; i < components.size(); ++i) {
    const AxialComponent& other = components[i];
    const bool longer =
        other.length > own.length || (other.length == own.length && i < j);
    if (i != j && longer &&
        AxialDistance(own.mean, other.mean) < min_separation) {
      return true;
    }
  }
  return false;
}

// Which Gaussians of a mixture are directions of the building. One that is not
// is forgotten, and the others are looked at again without it. `origin` is
// where the arc begins.
std::vector<AxialComponent> Decide(const std::vector<ArcSample>& samples,
                                   const Mixture& mixture, double origin,
                                   const Histogram& histogram,
                                   const std::vector<double>& known,
                                   const AxialMixtureOptions& options) {
  double noise = 0.0, weights = 0.0;
  for (const ArcSample& sample : samples) {
    noise += Weight(sample.length) * sample.variance;
    weights += Weight(sample.length);
  }
  noise /= weights;
  // Samples of clutter per rad as the mixture sees it on this arc.
  const double clutter = mixture.background * samples.size() / mixture.width;
  std::vector<Gaussian> gaussians = mixture.gaussians;
  std::vector<double> known_offsets;
  for (const double direction : known) {
    known_offsets.push_back(direction - origin);
  }
  while (!gaussians.empty()) {
    std::vector<AxialComponent> components(gaussians.size());
    for (std::size_t j = 0; j < gaussians.size(); ++j) {
      components[j].mean = NormalizeAxial(origin + gaussians[j].mean);
      components[j].stddev = std::sqrt(gaussians[j].variance);
    }
    for (const ArcSample& sample : samples) {
      std::size_t nearest = 0;
      double distance = std::numeric_limits<double>::infinity();
      for (std::size_t j = 0; j < gaussians.size(); ++j) {
        const double d = std::abs(sample.x - gaussians[j].mean);
        if (d < distance) {
          distance = d;
          nearest = j;
        }
      }
      const double sigma =
          std::sqrt(gaussians[nearest].variance + sample.variance);
      if (distance <= std::min(options.gate, 3.0 * sigma)) {
        ++components[nearest].count;
        components[nearest].length += sample.length;
      }
    }
    // The shortest that fails goes first: it may be what spoils the others.
    std::size_t worst = gaussians.size();
    for (std::size_t j = 0; j < gaussians.size(); ++j) {
      const AxialComponent& component = components[j];
      const double spread = std::sqrt(gaussians[j].variance + noise);
      const int half =
          std::clamp(static_cast<int>(std::lround(2.0 * spread / kBinWidth)),
                     kHalfWidths.front(), kHalfWidths.back());
      const double reach = std::min(options.gate, 3.0 * spread);
      const bool stays =
          component.stddev <= options.gate &&
          component.count >= options.min_support &&
          component.length >= options.min_support_length &&
          histogram.Exceeds(component.count, 2.0 * reach * clutter,
                            2.0 * reach * clutter) &&
          histogram.Significant(BinOf(component.mean), half) &&
          !IsOvershadowed(components, j, options.min_separation) &&
          IsPeak(samples, gaussians, j, noise, known_offsets, options.gate);
      if (!stays && (worst == gaussians.size() ||
                     component.length < components[worst].length)) {
        worst = j;
      }
    }
    if (worst == gaussians.size()) return components;
    gaussians.erase(gaussians.begin() + worst);
  }
  return {};
}

// Steps 1 to 3 of FindAxialComponents, once. `samples` sorted by angle, none
// within the gate of `known`.
std::vector<AxialComponent> FindOnce(const std::vector<AxialSample>& samples,
                                     const std::vector<double>& known,
                                     const AxialMixtureOptions& options) {
  std::vector<AxialComponent> result;
  const Histogram histogram(samples, known, options);

  std::vector<std::vector<AxialSample>> by_bin(kBins);
  int masked = 0, emptiest = 0;
  for (const AxialSample& sample : samples) {
    by_bin[BinOf(sample.angle)].push_back(sample);
  }
  for (int bin = 0; bin < kBins; ++bin) {
    if (histogram.masked(bin)) ++masked;
    if (histogram.weight(bin) < histogram.weight(emptiest)) emptiest = bin;
  }
  if (masked == 0) return result;

  // Runs of masked bins around the circle, from a bin where no run goes on.
  int first = masked == kBins ? emptiest : 0;
  while (masked < kBins && histogram.masked(first)) ++first;
  for (int i = 0; i < kBins;) {
    if (!histogram.masked((first + i) % kBins)) {
      ++i;
      continue;
    }
    const int begin = first + i;
    int bins = 0;
    while (i < kBins && histogram.masked((first + i) % kBins)) {
      ++i;
      ++bins;
    }
    const double origin = BinCenter(begin % kBins) - 0.5 * kBinWidth;
    const double width = bins * kBinWidth;
    std::vector<ArcSample> arc;
    for (int b = begin; b < begin + bins; ++b) {
      for (const AxialSample& sample : by_bin[b % kBins]) {
        // Relative to the middle of the bin: no wrapping inside it.
        const double x = (b - begin + 0.5) * kBinWidth +
                         NormalizeAxial(sample.angle - BinCenter(b % kBins));
        arc.push_back({x, sample.stddev * sample.stddev, sample.length});
      }
    }
    if (arc.empty()) continue;
    const double background =
        std::clamp(histogram.background() * bins / arc.size(), 0.01, 0.9);
    const Mixture mixture = FitMixture(arc, width, background, options);

    const std::vector<AxialComponent> components =
        Decide(arc, mixture, origin, histogram, known, options);
    result.insert(result.end(), components.begin(), components.end());
  }
  return result;
}

}  // namespace

double AxialDistance(double a, double b) {
  return std::abs(NormalizeAxial(a - b));
}

int NearestAxial(const std::vector<double>& directions, double angle,
                 double gate) {
  int nearest = -1;
  double smallest = gate;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const double distance = AxialDistance(directions[i], angle);
    if (distance < smallest || (nearest < 0 && distance == smallest)) {
      smallest = distance;
      nearest = static_cast<int>(i);
    }
  }
  return nearest;
}

std::vector<AxialComponent> FindAxialComponents(
    const std::vector<AxialSample>& samples, const std::vector<double>& known,
    const AxialMixtureOptions& options) {
  std::vector<AxialSample> free;
  for (AxialSample sample : samples) {
    if (!std::isfinite(sample.angle) || !std::isfinite(sample.stddev) ||
        !std::isfinite(sample.length)) {
      continue;
    }
    sample.angle = NormalizeAxial(sample.angle);
    free.push_back(sample);
  }
  std::sort(free.begin(), free.end(),
            [](const AxialSample& a, const AxialSample& b) {
              return std::tie(a.angle, a.stddev, a.length) <
                     std::tie(b.angle, b.stddev, b.length);
            });
  std::vector<double> directions = known;
  std::vector<AxialComponent> result;
  for (;;) {
    free.erase(std::remove_if(free.begin(), free.end(),
                              [&](const AxialSample& sample) {
                                return NearestAxial(directions, sample.angle,
                                                    options.gate) >= 0;
                              }),
               free.end());
    const std::vector<AxialComponent> found =
        FindOnce(free, directions, options);
    if (found.empty()) break;
    for (const AxialComponent& component : found) {
      directions.push_back(component.mean);
      result.push_back(component);
    }
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const AxialComponent& a, const AxialComponent& b) {
                     return a.length > b.length;
                   });
  return result;
}

}  // namespace plumbline
