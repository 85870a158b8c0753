#include <plumbline/detectors/direction_scatter.h>
#include <plumbline/factors/chi_square.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

// Halvings of the interval of the result.
constexpr int kHalvings = 30;

// Two walls: squared difference, and its variance but for the scatter.
struct Pair {
  double squared_difference;
  double variance;
};

}  // namespace

double EstimateDirectionScatter(const DirectionNetwork& network,
                                const std::vector<DirectionWall>& walls,
                                const DirectionScatterOptions& options) {
  std::vector<DirectionWall> longest;
  for (const DirectionWall& wall : walls) {
    if (wall.length >= options.min_length) longest.push_back(wall);
  }
  std::stable_sort(longest.begin(), longest.end(),
                   [](const DirectionWall& a, const DirectionWall& b) {
                     return a.length > b.length;
                   });
  if (longest.size() > options.max_walls) longest.resize(options.max_walls);
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i + 1 < longest.size(); ++i) {
    const DirectionWall& first = longest[i];
    const Eigen::VectorXd column = network.CovarianceColumn(first.node);
    for (std::size_t j = i + 1; j < longest.size(); ++j) {
      const DirectionWall& second = longest[j];
      double difference =
          network.Angle(second.node) - network.Angle(first.node);
      difference -= 0.5 * kPi * std::round(difference / (0.5 * kPi));
      const double variance = std::max(
          network.Variance(first.node) + network.Variance(second.node) -
              2.0 * column[static_cast<Eigen::Index>(second.node)],
          0.0);
      if (std::abs(difference) > options.max_difference ||
          variance > options.max_uncertainty * options.max_uncertainty) {
        continue;
      }
      pairs.push_back({difference * difference,
                       variance + first.own_sigma * first.own_sigma +
                           second.own_sigma * second.own_sigma});
    }
  }
  if (pairs.size() < options.min_pairs) return options.prior;
  const double expected = ChiSquareQuantile(options.share, 1);
  const auto rank = static_cast<std::ptrdiff_t>(
      options.share * static_cast<double>(pairs.size()));
  std::vector<double> squares(pairs.size());
  // The quantile falls as the scatter grows.
  double low = options.min_sigma;
  double high = options.max_sigma;
  for (int k = 0; k < kHalvings; ++k) {
    const double sigma = 0.5 * (low + high);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      squares[i] = pairs[i].squared_difference /
                   (pairs[i].variance + 2.0 * sigma * sigma);
    }
    std::nth_element(squares.begin(), squares.begin() + rank, squares.end());
    (squares[static_cast<std::size_t>(rank)] > expected ? low : high) = sigma;
  }
  return 0.5 * (low + high);
}

}  // namespace plumbline
