#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_ties.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Ties that are nearly as certain as the most certain one enter with it: their
// order does not matter, and every round costs a factorization.
constexpr double kBatch = 4.0;
// New directions that are tried before the search for them ends in one round.
constexpr int kMaxFounders = 12;
constexpr int kMaxRounds = 200;

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

class Assigner {
 public:
  Assigner(DirectionNetwork network, const std::vector<DirectionWall>& walls,
           const std::vector<SharedDirection>& directions,
           const DirectionAssignmentOptions& options,
           const std::function<bool()>& stop)
      : ties_(std::move(network), walls, options),
        walls_(walls),
        options_(options),
        stop_(stop),
        num_given_(directions.size()),
        innovations_(walls.size()),
        is_refused_founder_(walls.size(), false) {
    ties_.Solve();
    for (const DirectionWall& wall : walls_) {
      untied_.push_back(ties_.network().Angle(wall.node));
    }
    for (const SharedDirection& given : directions) {
      const std::size_t k = ties_.Add(given.angle);
      for (const std::size_t wall : given.walls) ties_.Tie(wall, k);
    }
  }

  DirectionAssignment Run() {
    for (int round = 0; round < kMaxRounds; ++round) {
      if (stop_ && stop_()) break;
      ties_.Solve();
      Predict();
      if (TieMostCertain()) continue;
      if (Found()) continue;
      if (Dissolve()) continue;
      if (Reunite()) continue;
      if (!Split()) break;
    }
    return Result();
  }

 private:
  DirectionAssignment Result() const {
    DirectionAssignment result;
    for (std::size_t k = 0; k < ties_.size(); ++k) {
      SharedDirection direction;
      direction.walls = ties_.WallsOf(k);
      direction.angle = NormalizeAxial(ties_.network().Angle(ties_.node(k)));
      result.directions.push_back(std::move(direction));
    }
    result.direction_of = ties_.direction_of();
    result.innovations = innovations_;
    return result;
  }

  // A tie that could be made.
  struct Candidate {
    std::size_t wall = 0;
    // Direction; of a wall at a right angle to a direction without such a
    // companion a new one is made.
    std::size_t direction = 0;
    bool is_across = false;
    // Of two directions, in place of a wall and one.
    bool is_relation = false;
    std::size_t other = 0;
    DirectionInnovation innovation;
  };

  // Which directions have one at a right angle among those of their family.
  void FindCompanions() {
    companion_.assign(ties_.size(), -1);
    for (std::size_t a = 0; a < ties_.size(); ++a) {
      for (std::size_t b = 0; b < ties_.size(); ++b) {
        if (a != b && ties_.IsUsed(a) && ties_.IsUsed(b) &&
            ties_.family(a) == ties_.family(b)) {
          companion_[a] = static_cast<int>(b);
        }
      }
    }
  }

  // Every tie that could be made, with its innovation.
  void Predict() {
    FindCompanions();
    candidates_.clear();
    std::vector<Eigen::VectorXd> columns(ties_.size());
    for (std::size_t k = 0; k < ties_.size(); ++k) {
      if (ties_.IsUsed(k))
        columns[k] = ties_.network().CovarianceColumn(ties_.node(k));
    }
    bool has_direction = false;
    for (std::size_t k = 0; k < ties_.size(); ++k) {
      has_direction = has_direction || ties_.IsUsed(k);
    }
    is_rejected_.assign(walls_.size(), !has_direction);
    if (!has_direction) return;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      Candidate best;
      double best_likelihood = -std::numeric_limits<double>::infinity();
      double next_likelihood = best_likelihood;
      bool is_known = false;
      for (std::size_t k = 0; k < ties_.size(); ++k) {
        if (!ties_.IsUsed(k)) continue;
        for (const bool is_across : {false, true}) {
          if (is_across && companion_[k] >= 0) continue;
          Candidate candidate;
          candidate.wall = i;
          candidate.direction = k;
          candidate.is_across = is_across;
          candidate.innovation = ties_.Innovation(
              walls_[i].node, ties_.node(k), columns[k],
              is_across ? 0.5 * kPi : 0.0,
              is_across
                  ? std::hypot(ties_.Tolerance(i), options_.relation_sigma)
                  : ties_.Tolerance(i));
          if (candidate.innovation.variance >
              options_.max_uncertainty * options_.max_uncertainty) {
            continue;
          }
          is_known = true;
          const double likelihood = LogLikelihood(candidate.innovation);
          if (likelihood > best_likelihood) {
            next_likelihood = best_likelihood;
            best_likelihood = likelihood;
            best = candidate;
          } else {
            next_likelihood = std::max(next_likelihood, likelihood);
          }
        }
      }
      if (ties_.direction_of()[i] >= 0 || !is_known) continue;
      innovations_[i] = best.innovation;
      if (best.innovation.chi_square > options_.gate) {
        is_rejected_[i] = true;
        continue;
      }
      const double own = walls_[i].own_sigma;
      if (best.innovation.difference * best.innovation.difference >
          options_.gate *
              (best.innovation.variance -
               (1.0 - options_.own_share * options_.own_share) * own * own)) {
        continue;
      }
      // Uniform over the half turn: a direction of its own.
      if (best_likelihood <
          std::max(next_likelihood, -std::log(kPi)) + options_.margin) {
        continue;
      }
      candidates_.push_back(best);
    }
    PredictRelations(columns);
  }

  // Directions of different families against each other: they are one, or one
  // is the other's companion.
  void PredictRelations(const std::vector<Eigen::VectorXd>& columns) {
    for (std::size_t a = 0; a < ties_.size(); ++a) {
      if (!ties_.IsUsed(a)) continue;
      for (std::size_t b = a + 1; b < ties_.size(); ++b) {
        if (!ties_.IsUsed(b) || ties_.family(a) == ties_.family(b)) continue;
        for (const bool is_across : {false, true}) {
          if (is_across && (companion_[a] >= 0 || companion_[b] >= 0)) continue;
          Candidate candidate;
          candidate.is_relation = true;
          candidate.direction = a;
          candidate.other = b;
          candidate.is_across = is_across;
          candidate.innovation = ties_.Innovation(
              ties_.node(b), ties_.node(a), columns[a],
              is_across ? 0.5 * kPi : 0.0, options_.relation_sigma);
          if (candidate.innovation.chi_square <= options_.gate &&
              LogLikelihood(candidate.innovation) >
                  -std::log(kPi) + options_.margin) {
            candidates_.push_back(candidate);
          }
        }
      }
    }
  }

  bool TieMostCertain() {
    double smallest = std::numeric_limits<double>::infinity();
    for (const Candidate& candidate : candidates_) {
      smallest = std::min(smallest, candidate.innovation.variance);
    }
    // What is known as well as a direction itself is as good as the best.
    const double limit =
        kBatch * std::max(smallest, options_.sigma * options_.sigma);
    bool has_tied = false;
    for (const Candidate& candidate : candidates_) {
      if (candidate.innovation.variance > limit) continue;
      if (candidate.is_relation) {
        // What was joined before in this round is looked at in the next.
        if (!ties_.IsUsed(candidate.direction) ||
            !ties_.IsUsed(candidate.other) ||
            ties_.family(candidate.direction) ==
                ties_.family(candidate.other)) {
          continue;
        }
        if (candidate.is_across) {
          if (ties_.FamilySize(candidate.direction) +
                  ties_.FamilySize(candidate.other) >
              2) {
            continue;
          }
          ties_.Relate(candidate.direction, candidate.other);
        } else {
          ties_.Merge(candidate.direction, candidate.other);
        }
      } else {
        // It may have been merged in this round.
        const std::size_t direction = ties_.Owner(candidate.direction);
        ties_.Tie(candidate.wall,
                  candidate.is_across ? ties_.Across(direction) : direction);
      }
      has_tied = true;
    }
    return has_tied;
  }

  // Makes a direction of walls that contradict all others.
  bool Found() {
    std::vector<std::size_t> founders;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      if (is_rejected_[i] && !is_refused_founder_[i] &&
          walls_[i].length >= options_.min_founder_length) {
        founders.push_back(i);
      }
    }
    std::stable_sort(founders.begin(), founders.end(),
                     [this](std::size_t a, std::size_t b) {
                       return walls_[a].length > walls_[b].length;
                     });
    if (founders.size() > kMaxFounders) founders.resize(kMaxFounders);
    double best_length = 0.0;
    std::size_t best = walls_.size();
    for (const std::size_t founder : founders) {
      const std::size_t node = walls_[founder].node;
      const Eigen::VectorXd column = ties_.network().CovarianceColumn(node);
      double length = 0.0;
      int support = 0;
      // Of walls in random directions.
      double expected_support = 0.0;
      std::size_t tried = 0;
      for (std::size_t i = 0; i < walls_.size(); ++i) {
        if (!is_rejected_[i]) continue;
        ++tried;
        if (i != founder) {
          const DirectionInnovation innovation = ties_.Innovation(
              walls_[i].node, node, column, 0.0,
              std::hypot(ties_.Tolerance(i), ties_.Tolerance(founder)));
          expected_support += std::min(
              1.0, 2.0 * std::sqrt(0.5 * options_.gate * innovation.variance) /
                       (0.5 * kPi));
        }
        for (const double offset : {0.0, 0.5 * kPi}) {
          const DirectionInnovation innovation = ties_.Innovation(
              walls_[i].node, node, column, offset,
              std::hypot(ties_.Tolerance(i), ties_.Tolerance(founder)));
          if (i == founder ? offset == 0.0
                           : innovation.chi_square <= 0.5 * options_.gate &&
                                 LogLikelihood(innovation) >
                                     -std::log(kPi) + options_.margin) {
            ++support;
            length += walls_[i].length;
            break;
          }
        }
      }
      if (support >= options_.min_support &&
          length >= options_.min_support_length && length > best_length &&
          static_cast<double>(tried) *
                  PoissonTail(support - 1, expected_support) <
              options_.significance) {
        best_length = length;
        best = founder;
      }
    }
    if (best == walls_.size()) return false;
    is_refused_founder_[best] = true;
    const std::size_t k = ties_.Add(ties_.network().Angle(walls_[best].node));
    ties_.Tie(best, k);
    return true;
  }

  // Takes back a new direction that did not get support or does not differ from
  // another one. True when one went.
  bool Dissolve() {
    for (std::size_t k = ties_.size(); k-- > num_given_;) {
      if (!ties_.IsUsed(k) || ties_.family(k) < num_given_) continue;
      if (HasSupport(k) && (split_off_.count(k) > 0 || IsDistinct(k))) continue;
      Remove(k);
      return true;
    }
    return false;
  }

  // The companion at a right angle counts as well.
  bool HasSupport(std::size_t k) const {
    double length = 0.0;
    std::size_t support = 0;
    for (std::size_t j = 0; j < ties_.size(); ++j) {
      if (ties_.family(j) != ties_.family(k)) continue;
      for (const std::size_t wall : ties_.WallsOf(j)) {
        length += walls_[wall].length;
        ++support;
      }
    }
    return support >= static_cast<std::size_t>(options_.min_support) &&
           length >= options_.min_support_length;
  }

  bool IsDistinct(std::size_t k) const {
    const Eigen::VectorXd column =
        ties_.network().CovarianceColumn(ties_.node(k));
    for (std::size_t j = 0; j < ties_.size(); ++j) {
      if (!ties_.IsUsed(j) || ties_.family(j) == ties_.family(k)) continue;
      for (const double offset : {0.0, 0.5 * kPi}) {
        const DirectionInnovation innovation =
            ties_.Innovation(ties_.node(j), ties_.node(k), column, offset,
                             options_.relation_sigma);
        if (innovation.variance <=
                options_.max_uncertainty * options_.max_uncertainty &&
            innovation.chi_square < options_.split_gate) {
          return false;
        }
      }
    }
    return true;
  }

  // Makes one family of a part that was split off and one that it does not
  // differ from: a building turns and turns back. Neither is split again. True
  // when two were joined.
  bool Reunite() {
    for (const std::size_t k : split_off_) {
      if (!ties_.IsUsed(k)) continue;
      const Eigen::VectorXd column =
          ties_.network().CovarianceColumn(ties_.node(k));
      double smallest = options_.split_gate;
      std::size_t nearest = k;
      for (std::size_t j = 0; j < ties_.size(); ++j) {
        if (!ties_.IsUsed(j) || ties_.family(j) == ties_.family(k)) continue;
        const DirectionInnovation innovation = ties_.Innovation(
            ties_.node(j), ties_.node(k), column, 0.0, options_.relation_sigma);
        if (innovation.variance <=
                options_.max_uncertainty * options_.max_uncertainty &&
            innovation.chi_square < smallest) {
          smallest = innovation.chi_square;
          nearest = j;
        }
      }
      if (nearest == k) continue;
      const std::size_t family =
          std::min(ties_.family(nearest), ties_.family(k));
      ties_.Merge(nearest, k);
      is_whole_.insert(ties_.family(nearest));
      is_whole_.insert(family);
      return true;
    }
    return false;
  }

  // Splits the family whose walls are explained best by two, if any is. True
  // when one was.
  bool Split() {
    double best_statistic = options_.split_gate;
    std::vector<std::size_t> best;
    for (std::size_t k = 0; k < ties_.size(); ++k) {
      if (ties_.family(k) == k && is_whole_.count(k) == 0) {
        FindFamilySplit(ties_, walls_, options_, untied_, k, &best_statistic,
                        &best);
      }
    }
    if (best.empty()) return false;
    // The walls along, and those across.
    std::map<std::size_t, std::vector<std::size_t>> parts;
    for (const std::size_t wall : best) {
      parts[static_cast<std::size_t>(ties_.direction_of()[wall])].push_back(
          wall);
    }
    std::vector<std::size_t> made;
    for (const auto& [old, part] : parts) {
      ties_.Untie(part, old);
      const std::size_t k = ties_.Add(ties_.network().Angle(ties_.node(old)));
      for (const std::size_t wall : part) ties_.Tie(wall, k);
      split_off_.insert(k);
      made.push_back(k);
    }
    if (made.size() == 2) ties_.Relate(made[0], made[1]);
    return true;
  }

  void Remove(std::size_t k) {
    for (const std::size_t wall : ties_.WallsOf(k)) {
      is_refused_founder_[wall] = true;
    }
    ties_.Remove(k);
  }

  DirectionTies ties_;
  const std::vector<DirectionWall>& walls_;
  const DirectionAssignmentOptions& options_;
  const std::function<bool()>& stop_;
  std::size_t num_given_;
  // Directions that were split off.
  std::set<std::size_t> split_off_;
  // Families that were found to be one after a split.
  std::set<std::size_t> is_whole_;
  // Of this round. By direction: the one at a right angle, -1 for none.
  std::vector<int> companion_;
  std::vector<Candidate> candidates_;
  // By wall: its angle by the measurements alone.
  std::vector<double> untied_;
  // By wall: against the direction that it was compared with last.
  std::vector<DirectionInnovation> innovations_;
  // By wall: it contradicts all directions; it was tried as a founder.
  std::vector<bool> is_rejected_;
  std::vector<bool> is_refused_founder_;
};

}  // namespace

DirectionAssignment AssignDirections(DirectionNetwork network,
                                     const std::vector<DirectionWall>& walls,
                                     std::vector<SharedDirection> directions,
                                     const DirectionAssignmentOptions& options,
                                     const std::function<bool()>& stop) {
  return Assigner(std::move(network), walls, std::move(directions), options,
                  stop)
      .Run();
}

}  // namespace plumbline
