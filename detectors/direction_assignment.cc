#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_founder.h>
#include <plumbline/detectors/direction_ties.h>
#include <plumbline/detectors/tie_forecast.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Ties that are nearly as certain as the most certain one enter with it: their
// order does not matter, and every round costs a factorization.
constexpr double kBatch = 4.0;
// Each ties, makes or takes back something.
constexpr int kMaxRounds = 200;

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
      forecast_ = PredictTies(ties_, walls_, options_, &innovations_);
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

  bool TieMostCertain() {
    double smallest = std::numeric_limits<double>::infinity();
    for (const TieCandidate& candidate : forecast_.candidates) {
      smallest = std::min(smallest, candidate.innovation.variance);
    }
    // What is known as well as a direction itself is as good as the best.
    const double limit =
        kBatch * std::max(smallest, options_.sigma * options_.sigma);
    bool has_tied = false;
    for (const TieCandidate& candidate : forecast_.candidates) {
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
    const std::optional<std::size_t> founder = FindFounder(
        ties_, walls_, forecast_.is_rejected, is_refused_founder_, options_);
    if (!founder) return false;
    is_refused_founder_[*founder] = true;
    const std::size_t k =
        ties_.Add(ties_.network().Angle(walls_[*founder].node));
    ties_.Tie(*founder, k);
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
  // Of this round.
  TieForecast forecast_;
  // By wall: its angle by the measurements alone.
  std::vector<double> untied_;
  // By wall: against the direction that it was compared with last.
  std::vector<DirectionInnovation> innovations_;
  // By wall: it was tried as a founder, or tied to a direction that went.
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
