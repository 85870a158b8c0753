#include <plumbline/detectors/tie_forecast.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace plumbline {
namespace {

// By direction: whether there is one at a right angle in its family.
std::vector<bool> HaveCompanions(const DirectionTies& ties) {
  std::vector<bool> has_companion(ties.size(), false);
  for (std::size_t a = 0; a < ties.size(); ++a) {
    for (std::size_t b = 0; b < ties.size(); ++b) {
      if (a != b && ties.IsUsed(a) && ties.IsUsed(b) &&
          ties.family(a) == ties.family(b)) {
        has_companion[a] = true;
      }
    }
  }
  return has_companion;
}

// The directions that a wall is compared with.
struct UsedDirections {
  std::vector<bool> has_companion;
  // By direction; empty for those without walls.
  std::vector<Eigen::VectorXd> columns;
};

UsedDirections FindUsed(const DirectionTies& ties) {
  UsedDirections used;
  used.has_companion = HaveCompanions(ties);
  used.columns.resize(ties.size());
  for (std::size_t k = 0; k < ties.size(); ++k) {
    if (ties.IsUsed(k)) {
      used.columns[k] = ties.network().CovarianceColumn(ties.node(k));
    }
  }
  return used;
}

// The tie of a wall that is most likely.
struct BestTie {
  // False: of no direction is enough known.
  bool is_known = false;
  TieCandidate candidate;
  double likelihood = -std::numeric_limits<double>::infinity();
  // Of the best other one.
  double next_likelihood = -std::numeric_limits<double>::infinity();
};

BestTie FindBestTie(const DirectionTies& ties, const UsedDirections& used,
                    const std::vector<DirectionWall>& walls, std::size_t wall,
                    const DirectionAssignmentOptions& options) {
  BestTie best;
  for (std::size_t k = 0; k < ties.size(); ++k) {
    if (!ties.IsUsed(k)) continue;
    for (const bool is_across : {false, true}) {
      if (is_across && used.has_companion[k]) continue;
      TieCandidate candidate;
      candidate.wall = wall;
      candidate.direction = k;
      candidate.is_across = is_across;
      candidate.innovation = ties.Innovation(
          walls[wall].node, ties.node(k), used.columns[k],
          is_across ? 0.5 * kPi : 0.0,
          is_across ? std::hypot(ties.Tolerance(wall), options.relation_sigma)
                    : ties.Tolerance(wall));
      if (candidate.innovation.variance >
          options.max_uncertainty * options.max_uncertainty) {
        continue;
      }
      best.is_known = true;
      const double likelihood = LogLikelihood(candidate.innovation);
      if (likelihood > best.likelihood) {
        best.next_likelihood = best.likelihood;
        best.likelihood = likelihood;
        best.candidate = candidate;
      } else {
        best.next_likelihood = std::max(best.next_likelihood, likelihood);
      }
    }
  }
  return best;
}

// Whether the best tie within the gate is made, or the wall waits.
bool IsClear(const BestTie& best, const DirectionWall& wall,
             const DirectionAssignmentOptions& options) {
  const DirectionInnovation& innovation = best.candidate.innovation;
  const double own = wall.own_sigma;
  if (innovation.difference * innovation.difference >
      options.gate *
          (innovation.variance -
           (1.0 - options.own_share * options.own_share) * own * own)) {
    return false;
  }
  // Uniform over the half turn: a direction of its own.
  return best.likelihood >=
         std::max(best.next_likelihood, -std::log(kPi)) + options.margin;
}

// Directions of different families against each other: they are one, or one is
// the other's companion.
void PredictRelations(const DirectionTies& ties, const UsedDirections& used,
                      const DirectionAssignmentOptions& options,
                      std::vector<TieCandidate>* candidates) {
  for (std::size_t a = 0; a < ties.size(); ++a) {
    if (!ties.IsUsed(a)) continue;
    for (std::size_t b = a + 1; b < ties.size(); ++b) {
      if (!ties.IsUsed(b) || ties.family(a) == ties.family(b)) continue;
      for (const bool is_across : {false, true}) {
        if (is_across && (used.has_companion[a] || used.has_companion[b])) {
          continue;
        }
        TieCandidate candidate;
        candidate.is_relation = true;
        candidate.direction = a;
        candidate.other = b;
        candidate.is_across = is_across;
        candidate.innovation = ties.Innovation(
            ties.node(b), ties.node(a), used.columns[a],
            is_across ? 0.5 * kPi : 0.0, options.relation_sigma);
        if (candidate.innovation.chi_square <= options.gate &&
            LogLikelihood(candidate.innovation) >
                -std::log(kPi) + options.margin) {
          candidates->push_back(candidate);
        }
      }
    }
  }
}

}  // namespace

TieForecast PredictTies(const DirectionTies& ties,
                        const std::vector<DirectionWall>& walls,
                        const DirectionAssignmentOptions& options,
                        std::vector<DirectionInnovation>* innovations) {
  bool has_direction = false;
  for (std::size_t k = 0; k < ties.size(); ++k) {
    has_direction = has_direction || ties.IsUsed(k);
  }
  TieForecast forecast;
  forecast.is_rejected.assign(walls.size(), !has_direction);
  if (!has_direction) return forecast;
  const UsedDirections used = FindUsed(ties);
  for (std::size_t i = 0; i < walls.size(); ++i) {
    if (ties.direction_of()[i] >= 0) continue;
    const BestTie best = FindBestTie(ties, used, walls, i, options);
    if (!best.is_known) {
      forecast.is_rejected[i] = true;
      continue;
    }
    (*innovations)[i] = best.candidate.innovation;
    if (best.candidate.innovation.chi_square > options.gate) {
      forecast.is_rejected[i] = true;
    } else if (IsClear(best, walls[i], options)) {
      forecast.candidates.push_back(best.candidate);
    }
  }
  PredictRelations(ties, used, options, &forecast.candidates);
  return forecast;
}

}  // namespace plumbline
