#include <plumbline/detectors/direction_founder.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

// P(X >= count) of a Poisson variable.
double PoissonTail(int count, double mean) {
  double term = std::exp(-mean);
  double below = 0.0;
  for (int k = 0; k < count; ++k) {
    below += term;
    term *= mean / (k + 1);
  }
  // The sum below loses all digits of a small tail: its first term bounds it.
  return std::max(1.0 - below, term);
}

// The longest ones first.
std::vector<std::size_t> Founders(const std::vector<DirectionWall>& walls,
                                  const std::vector<bool>& is_rejected,
                                  const std::vector<bool>& is_refused,
                                  const DirectionAssignmentOptions& options) {
  std::vector<std::size_t> founders;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    if (is_rejected[i] && !is_refused[i] &&
        walls[i].length >= options.min_founder_length) {
      founders.push_back(i);
    }
  }
  std::stable_sort(founders.begin(), founders.end(),
                   [&walls](std::size_t a, std::size_t b) {
                     return walls[a].length > walls[b].length;
                   });
  if (founders.size() > kMostFounders) founders.resize(kMostFounders);
  return founders;
}

// The largest chi-square at which an innovation of this variance counts.
double LargestChiSquare(double variance,
                        const DirectionAssignmentOptions& options) {
  // What is so uncertain that it lies as well anywhere shows nothing.
  const double clear =
      2.0 * (std::log(kPi) - options.margin) - std::log(2.0 * kPi * variance);
  return std::clamp(clear, 0.0, 0.5 * options.gate);
}

// The rejected walls that agree with one of them.
struct Agreement {
  int walls = 0;
  double length = 0.0;
  // Of walls in random directions.
  double expected_walls = 0.0;
  // How many were asked.
  std::size_t tried = 0;
};

Agreement CountAgreeing(const DirectionTies& ties,
                        const std::vector<DirectionWall>& walls,
                        const std::vector<bool>& is_rejected,
                        std::size_t founder,
                        const DirectionAssignmentOptions& options) {
  const std::size_t node = walls[founder].node;
  const Eigen::VectorXd column = ties.network().CovarianceColumn(node);
  Agreement agreement;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    if (!is_rejected[i]) continue;
    ++agreement.tried;
    if (i != founder) {
      const DirectionInnovation innovation = ties.Innovation(
          walls[i].node, node, column, 0.0,
          std::hypot(ties.Tolerance(i), ties.Tolerance(founder)));
      agreement.expected_walls += std::min(
          1.0, 2.0 *
                   std::sqrt(LargestChiSquare(innovation.variance, options) *
                             innovation.variance) /
                   (0.5 * kPi));
    }
    for (const double offset : {0.0, 0.5 * kPi}) {
      const DirectionInnovation innovation = ties.Innovation(
          walls[i].node, node, column, offset,
          std::hypot(ties.Tolerance(i), ties.Tolerance(founder)));
      if (i == founder ? offset == 0.0
                       : innovation.chi_square <= 0.5 * options.gate &&
                             LogLikelihood(innovation) >
                                 -std::log(kPi) + options.margin) {
        ++agreement.walls;
        agreement.length += walls[i].length;
        break;
      }
    }
  }
  return agreement;
}

}  // namespace

std::optional<std::size_t> FindFounder(
    const DirectionTies& ties, const std::vector<DirectionWall>& walls,
    const std::vector<bool>& is_rejected, const std::vector<bool>& is_refused,
    const DirectionAssignmentOptions& options) {
  double best_length = 0.0;
  std::optional<std::size_t> best;
  std::size_t tried = 0;
  for (const std::size_t founder :
       Founders(walls, is_rejected, is_refused, options)) {
    // The longest walls may each stand alone.
    if (best && tried >= kEnoughFounders) break;
    ++tried;
    const Agreement agreement =
        CountAgreeing(ties, walls, is_rejected, founder, options);
    if (agreement.walls >= options.min_support &&
        agreement.length >= options.min_support_length &&
        agreement.length > best_length &&
        static_cast<double>(agreement.tried) *
                PoissonTail(agreement.walls - 1, agreement.expected_walls) <
            options.significance) {
      best_length = agreement.length;
      best = founder;
    }
  }
  return best;
}

}  // namespace plumbline
