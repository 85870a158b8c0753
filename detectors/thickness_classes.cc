#include <plumbline/detectors/thickness_classes.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>

namespace plumbline {
namespace {

// Half widths of windows in which samples are counted, m.
constexpr std::array<double, 3> kWindows = {0.005, 0.01, 0.02};
// Parameters of a class: thickness, standard deviation, share.
constexpr double kParameters = 3.0;
// Smallest standard deviation of a class, m.
constexpr double kLeastStddev = 0.001;
// What is wider than a class may be by this factor is none.
constexpr double kWidest = 1.5;
constexpr double kLeastShare = 1e-3;
constexpr int kMaxSteps = 200;
constexpr double kReach = 3.0;

struct Component {
  ThicknessClass shared;
  double share = 0.0;
};

struct Mixture {
  std::vector<Component> components;
  // Of samples that are spread evenly.
  double even_share = 1.0;
  double log_likelihood = 0.0;
};

double Density(const ThicknessClass& shared, const ThicknessSample& sample) {
  const double variance = shared.stddev * shared.stddev + sample.variance;
  const double distance = sample.thickness - shared.thickness;
  return std::exp(-0.5 * distance * distance / variance) /
         std::sqrt(2.0 * kPi * variance);
}

bool IsNear(const ThicknessClass& shared, const ThicknessSample& sample) {
  return std::abs(sample.thickness - shared.thickness) <=
         kReach * std::sqrt(shared.stddev * shared.stddev + sample.variance);
}

// Maximum likelihood by expectation maximization, from where it stands.
// A class grows no wider than `widest`, or the first one would take in all.
void Estimate(const std::vector<ThicknessSample>& samples, double range,
              double widest, Mixture* mixture) {
  const auto count = static_cast<double>(samples.size());
  std::vector<Component>& components = mixture->components;
  double last = -std::numeric_limits<double>::infinity();
  for (int step = 0; step < kMaxSteps; ++step) {
    // Responsibilities of components for samples.
    std::vector<std::vector<double>> shares(
        components.size(), std::vector<double>(samples.size()));
    mixture->log_likelihood = 0.0;
    double even = 0.0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      double total = mixture->even_share / range;
      for (std::size_t k = 0; k < components.size(); ++k) {
        shares[k][i] =
            components[k].share * Density(components[k].shared, samples[i]);
        total += shares[k][i];
      }
      for (auto& share : shares) share[i] /= total;
      even += mixture->even_share / range / total;
      mixture->log_likelihood += std::log(total);
    }
    if (mixture->log_likelihood - last < 1e-9 * count) break;
    last = mixture->log_likelihood;
    mixture->even_share = std::max(even / count, kLeastShare);
    double sum = mixture->even_share;
    for (std::size_t k = 0; k < components.size(); ++k) {
      ThicknessClass& shared = components[k].shared;
      double members = 0.0, weights = 0.0, mean = 0.0;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const double weight = shares[k][i] / (shared.stddev * shared.stddev +
                                              samples[i].variance);
        members += shares[k][i];
        weights += weight;
        mean += weight * samples[i].thickness;
      }
      components[k].share = std::max(members / count, kLeastShare);
      sum += components[k].share;
      if (!(weights > 0.0)) continue;
      shared.thickness = mean / weights;
      // What the samples scatter beyond their own variances.
      double scatter = 0.0, scale = 0.0;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const double weight =
            1.0 / (shared.stddev * shared.stddev + samples[i].variance);
        const double distance = samples[i].thickness - shared.thickness;
        scatter += shares[k][i] * weight * weight *
                   (distance * distance - samples[i].variance);
        scale += shares[k][i] * weight * weight;
      }
      shared.stddev = std::clamp(std::sqrt(std::max(scatter / scale, 0.0)),
                                 kLeastStddev, widest);
    }
    mixture->even_share /= sum;
    for (Component& component : components) component.share /= sum;
  }
}

// Where samples are densest against what the mixture expects there.
bool ProposeComponent(const std::vector<ThicknessSample>& samples, double range,
                      const Mixture& mixture, Component* proposed) {
  const auto count = static_cast<double>(samples.size());
  double best = 0.0;
  for (const ThicknessSample& center : samples) {
    for (const double half : kWindows) {
      double inside = 0.0;
      for (const ThicknessSample& sample : samples) {
        if (std::abs(sample.thickness - center.thickness) <= half) {
          inside += 1.0;
        }
      }
      double expected = mixture.even_share * count * 2.0 * half / range;
      for (const Component& component : mixture.components) {
        expected += count * component.share * 2.0 * half *
                    Density(component.shared, {center.thickness, half * half});
      }
      if (inside <= expected) continue;
      // Log-likelihood ratio of two Poisson rates.
      const double gain =
          inside * std::log(inside / expected) - (inside - expected);
      if (gain > best) {
        best = gain;
        proposed->shared = {center.thickness, 0.5 * half};
        proposed->share = std::min(inside / count, 0.9);
      }
    }
  }
  return best > 0.0;
}

// Probability of at least `least` of `count` independent events of probability
// p each.
double BinomialTail(int count, int least, double p) {
  if (least <= 0) return 1.0;
  if (p >= 1.0) return 1.0;
  double tail = 0.0;
  for (int k = least; k <= count; ++k) {
    tail += std::exp(std::lgamma(count + 1.0) - std::lgamma(k + 1.0) -
                     std::lgamma(count - k + 1.0) + k * std::log(p) +
                     (count - k) * std::log1p(-p));
  }
  return std::min(tail, 1.0);
}

// Whether a component of a mixture is a class on its own account: narrow, and
// so many samples in a window about it are not to be expected of those that no
// other component explains better, were they spread evenly.
bool IsClass(const std::vector<ThicknessSample>& samples, double range,
             const std::vector<Component>& components, std::size_t k,
             const ThicknessClassOptions& options) {
  const ThicknessClass& shared = components[k].shared;
  if (shared.stddev > options.max_stddev) return false;
  std::vector<double> distances;
  int support = 0;
  for (const ThicknessSample& sample : samples) {
    const double own = components[k].share * Density(shared, sample);
    if (std::any_of(components.begin(), components.end(),
                    [&](const Component& other) {
                      return other.share * Density(other.shared, sample) > own;
                    })) {
      continue;
    }
    distances.push_back(std::abs(sample.thickness - shared.thickness));
    support += IsNear(shared, sample);
  }
  if (support < options.min_support) return false;
  const int count = static_cast<int>(distances.size());
  // A window may be about any of them.
  const double tests = static_cast<double>(count) * kWindows.size();
  return std::any_of(kWindows.begin(), kWindows.end(), [&](double half) {
    const auto members = static_cast<int>(
        std::count_if(distances.begin(), distances.end(),
                      [half](double distance) { return distance <= half; }));
    return tests * BinomialTail(count - 1, members - 1, 2.0 * half / range) <=
           options.significance;
  });
}

}  // namespace

std::vector<ThicknessClass> FindThicknessClasses(
    std::vector<ThicknessSample> samples,
    const std::vector<ThicknessClass>& known,
    const ThicknessClassOptions& options) {
  samples.erase(
      std::remove_if(samples.begin(), samples.end(),
                     [&](const ThicknessSample& sample) {
                       return !(sample.thickness >= options.min_thickness &&
                                sample.thickness <= options.max_thickness) ||
                              !(sample.variance >= 0.0) ||
                              std::any_of(known.begin(), known.end(),
                                          [&](const ThicknessClass& shared) {
                                            return IsNear(shared, sample);
                                          });
                     }),
      samples.end());
  std::sort(samples.begin(), samples.end(),
            [](const ThicknessSample& a, const ThicknessSample& b) {
              return std::tie(a.thickness, a.variance) <
                     std::tie(b.thickness, b.variance);
            });
  if (static_cast<int>(samples.size()) < options.min_support) return {};
  const double range = options.max_thickness - options.min_thickness;
  const double price =
      0.5 * kParameters * std::log(static_cast<double>(samples.size()));
  const double widest = std::max(kLeastStddev, kWidest * options.max_stddev);
  Mixture mixture;
  Estimate(samples, range, widest, &mixture);
  const auto is_apart = [&](const Mixture& tried) {
    const ThicknessClass& last = tried.components.back().shared;
    const auto is_far = [&](const ThicknessClass& other) {
      return std::abs(other.thickness - last.thickness) >=
             options.min_separation;
    };
    return std::all_of(
               tried.components.begin(), tried.components.end() - 1,
               [&](const Component& other) { return is_far(other.shared); }) &&
           std::all_of(known.begin(), known.end(), is_far);
  };
  while (true) {
    Mixture tried = mixture;
    Component proposed;
    if (!ProposeComponent(samples, range, mixture, &proposed)) break;
    for (Component& component : tried.components) {
      component.share *= 1.0 - proposed.share;
    }
    tried.even_share *= 1.0 - proposed.share;
    tried.components.push_back(proposed);
    Estimate(samples, range, widest, &tried);
    bool are_classes = true;
    for (std::size_t k = 0; k < tried.components.size(); ++k) {
      are_classes =
          are_classes && IsClass(samples, range, tried.components, k, options);
    }
    if (tried.log_likelihood <= mixture.log_likelihood + price ||
        !are_classes || !is_apart(tried)) {
      break;
    }
    mixture = std::move(tried);
  }
  std::vector<ThicknessClass> classes;
  for (const Component& component : mixture.components) {
    classes.push_back(component.shared);
  }
  std::sort(classes.begin(), classes.end(),
            [](const ThicknessClass& a, const ThicknessClass& b) {
              return a.thickness < b.thickness;
            });
  return classes;
}

}  // namespace plumbline
