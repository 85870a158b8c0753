#include <plumbline/detectors/direction_assignment.h>

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
// Places at which the walls of a direction are cut in two for a trial.
constexpr std::size_t kMaxCuts = 60;

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
           std::vector<SharedDirection> directions,
           const DirectionAssignmentOptions& options,
           const std::function<bool()>& stop)
      : network_(std::move(network)),
        walls_(walls),
        options_(options),
        stop_(stop),
        num_given_(directions.size()) {
    result_.direction_of.assign(walls.size(), -1);
    result_.innovations.resize(walls.size());
    is_refused_founder_.assign(walls.size(), false);
    network_.Solve();
    for (const DirectionWall& wall : walls_) {
      untied_.push_back(network_.Angle(wall.node));
    }
    for (SharedDirection& given : directions) {
      const std::vector<std::size_t> tied = std::move(given.walls);
      given.walls.clear();
      const std::size_t k = AddDirection(given.angle);
      for (const std::size_t wall : tied) Tie(wall, k);
    }
  }

  DirectionAssignment Run() {
    for (int round = 0; round < kMaxRounds; ++round) {
      if (stop_ && stop_()) break;
      network_.Solve();
      Predict();
      if (TieMostCertain()) continue;
      if (Found()) continue;
      if (Dissolve()) continue;
      if (Reunite()) continue;
      if (!Split()) break;
    }
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      result_.directions[k].angle = NormalizeAxial(network_.Angle(nodes_[k]));
    }
    return std::move(result_);
  }

 private:
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

  std::size_t AddDirection(double angle) {
    nodes_.push_back(network_.AddNode(angle));
    families_.push_back(nodes_.size() - 1);
    SharedDirection direction;
    direction.angle = angle;
    result_.directions.push_back(std::move(direction));
    return nodes_.size() - 1;
  }

  void Tie(std::size_t wall, std::size_t direction) {
    const double tolerance = Tolerance(wall);
    network_.AddLink(walls_[wall].node, nodes_[direction], 0.0,
                     tolerance * tolerance, true);
    result_.direction_of[wall] = static_cast<int>(direction);
    result_.directions[direction].walls.push_back(wall);
  }

  double Tolerance(std::size_t wall) const {
    return std::hypot(options_.sigma, walls_[wall].own_sigma);
  }

  // Makes two directions companions at a right angle.
  void Relate(std::size_t a, std::size_t b) {
    network_.AddLink(nodes_[a], nodes_[b], 0.5 * kPi,
                     options_.relation_sigma * options_.relation_sigma, true);
    const std::size_t family = std::min(families_[a], families_[b]);
    families_[a] = families_[b] = family;
  }

  bool IsUsed(std::size_t direction) const {
    return !result_.directions[direction].walls.empty();
  }

  // Difference of two nodes and its variance.
  DirectionInnovation Innovation(std::size_t node, std::size_t direction_node,
                                 const Eigen::VectorXd& column, double offset,
                                 double tolerance) const {
    DirectionInnovation innovation;
    innovation.difference = NormalizeAxial(
        network_.Angle(node) - network_.Angle(direction_node) - offset);
    innovation.variance =
        std::max(network_.Variance(node) + network_.Variance(direction_node) -
                     2.0 * column[static_cast<Eigen::Index>(node)],
                 0.0) +
        tolerance * tolerance;
    innovation.chi_square =
        innovation.difference * innovation.difference / innovation.variance;
    return innovation;
  }

  static double LogLikelihood(const DirectionInnovation& innovation) {
    return -0.5 *
           (innovation.chi_square + std::log(2.0 * kPi * innovation.variance));
  }

  // Which directions have one at a right angle among those of their family.
  void FindCompanions() {
    companion_.assign(nodes_.size(), -1);
    for (std::size_t a = 0; a < nodes_.size(); ++a) {
      for (std::size_t b = 0; b < nodes_.size(); ++b) {
        if (a != b && IsUsed(a) && IsUsed(b) && families_[a] == families_[b]) {
          companion_[a] = static_cast<int>(b);
        }
      }
    }
  }

  // Every tie that could be made, with its innovation.
  void Predict() {
    FindCompanions();
    candidates_.clear();
    std::vector<Eigen::VectorXd> columns(nodes_.size());
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (IsUsed(k)) columns[k] = network_.CovarianceColumn(nodes_[k]);
    }
    bool has_direction = false;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      has_direction = has_direction || IsUsed(k);
    }
    is_rejected_.assign(walls_.size(), !has_direction);
    if (!has_direction) return;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      Candidate best;
      double best_likelihood = -std::numeric_limits<double>::infinity();
      double next_likelihood = best_likelihood;
      bool is_known = false;
      for (std::size_t k = 0; k < nodes_.size(); ++k) {
        if (!IsUsed(k)) continue;
        for (const bool is_across : {false, true}) {
          if (is_across && companion_[k] >= 0) continue;
          Candidate candidate;
          candidate.wall = i;
          candidate.direction = k;
          candidate.is_across = is_across;
          candidate.innovation = Innovation(
              walls_[i].node, nodes_[k], columns[k],
              is_across ? 0.5 * kPi : 0.0,
              is_across ? std::hypot(Tolerance(i), options_.relation_sigma)
                        : Tolerance(i));
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
      if (result_.direction_of[i] >= 0 || !is_known) continue;
      result_.innovations[i] = best.innovation;
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
    for (std::size_t a = 0; a < nodes_.size(); ++a) {
      if (!IsUsed(a)) continue;
      for (std::size_t b = a + 1; b < nodes_.size(); ++b) {
        if (!IsUsed(b) || families_[a] == families_[b]) continue;
        for (const bool is_across : {false, true}) {
          if (is_across && (companion_[a] >= 0 || companion_[b] >= 0)) continue;
          Candidate candidate;
          candidate.is_relation = true;
          candidate.direction = a;
          candidate.other = b;
          candidate.is_across = is_across;
          candidate.innovation =
              Innovation(nodes_[b], nodes_[a], columns[a],
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
        if (!IsUsed(candidate.direction) || !IsUsed(candidate.other) ||
            families_[candidate.direction] == families_[candidate.other]) {
          continue;
        }
        if (candidate.is_across) {
          if (FamilySize(candidate.direction) + FamilySize(candidate.other) >
              2) {
            continue;
          }
          Relate(candidate.direction, candidate.other);
        } else {
          Merge(candidate.direction, candidate.other);
        }
      } else {
        // It may have been merged in this round.
        const std::size_t direction = Owner(candidate.direction);
        Tie(candidate.wall,
            candidate.is_across ? Across(direction) : direction);
      }
      has_tied = true;
    }
    return has_tied;
  }

  std::size_t FamilySize(std::size_t direction) const {
    std::size_t size = 0;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      size += IsUsed(k) && families_[k] == families_[direction];
    }
    return size;
  }

  // Where the walls of a direction went.
  std::size_t Owner(std::size_t direction) const {
    while (merged_into_.count(direction) > 0) {
      direction = merged_into_.at(direction);
    }
    return direction;
  }

  // Makes one direction of two parallel ones, and one family of theirs.
  void Merge(std::size_t to, std::size_t from) {
    // Those at a right angle to either become one as well.
    int companions[2] = {-1, -1};
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (!IsUsed(k) || k == to || k == from) continue;
      if (families_[k] == families_[to]) companions[0] = static_cast<int>(k);
      if (families_[k] == families_[from]) companions[1] = static_cast<int>(k);
    }
    Move(to, from);
    if (companions[1] >= 0) {
      const auto across = static_cast<std::size_t>(companions[1]);
      if (companions[0] >= 0) {
        Move(static_cast<std::size_t>(companions[0]), across);
      } else {
        Relate(to, across);
      }
    }
  }

  void Move(std::size_t to, std::size_t from) {
    std::vector<std::size_t> walls;
    walls.swap(result_.directions[from].walls);
    network_.RemoveLinksOf(nodes_[from]);
    for (const std::size_t wall : walls) Tie(wall, to);
    merged_into_[from] = to;
  }

  // The direction at a right angle to one.
  std::size_t Across(std::size_t direction) {
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (k != direction && merged_into_.count(k) == 0 &&
          !is_removed_.count(k) && families_[k] == families_[direction]) {
        return k;
      }
    }
    const std::size_t across = AddDirection(
        NormalizeAxial(network_.Angle(nodes_[direction]) + 0.5 * kPi));
    Relate(direction, across);
    return across;
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
      const Eigen::VectorXd column = network_.CovarianceColumn(node);
      double length = 0.0;
      int support = 0;
      // Of walls in random directions.
      double expected_support = 0.0;
      std::size_t tried = 0;
      for (std::size_t i = 0; i < walls_.size(); ++i) {
        if (!is_rejected_[i]) continue;
        ++tried;
        if (i != founder) {
          const DirectionInnovation innovation =
              Innovation(walls_[i].node, node, column, 0.0,
                         std::hypot(Tolerance(i), Tolerance(founder)));
          expected_support += std::min(
              1.0, 2.0 * std::sqrt(0.5 * options_.gate * innovation.variance) /
                       (0.5 * kPi));
        }
        for (const double offset : {0.0, 0.5 * kPi}) {
          const DirectionInnovation innovation =
              Innovation(walls_[i].node, node, column, offset,
                         std::hypot(Tolerance(i), Tolerance(founder)));
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
    const std::size_t k = AddDirection(network_.Angle(walls_[best].node));
    Tie(best, k);
    return true;
  }

  // Takes back a new direction that did not get support or does not differ from
  // another one. True when one went.
  bool Dissolve() {
    for (std::size_t k = nodes_.size(); k-- > num_given_;) {
      if (!IsUsed(k) || families_[k] < num_given_) continue;
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
    for (std::size_t j = 0; j < nodes_.size(); ++j) {
      if (families_[j] != families_[k]) continue;
      for (const std::size_t wall : result_.directions[j].walls) {
        length += walls_[wall].length;
        ++support;
      }
    }
    return support >= static_cast<std::size_t>(options_.min_support) &&
           length >= options_.min_support_length;
  }

  bool IsDistinct(std::size_t k) const {
    const Eigen::VectorXd column = network_.CovarianceColumn(nodes_[k]);
    for (std::size_t j = 0; j < nodes_.size(); ++j) {
      if (!IsUsed(j) || families_[j] == families_[k]) continue;
      for (const double offset : {0.0, 0.5 * kPi}) {
        const DirectionInnovation innovation = Innovation(
            nodes_[j], nodes_[k], column, offset, options_.relation_sigma);
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
      if (!IsUsed(k)) continue;
      const Eigen::VectorXd column = network_.CovarianceColumn(nodes_[k]);
      double smallest = options_.split_gate;
      std::size_t nearest = k;
      for (std::size_t j = 0; j < nodes_.size(); ++j) {
        if (!IsUsed(j) || families_[j] == families_[k]) continue;
        const DirectionInnovation innovation = Innovation(
            nodes_[j], nodes_[k], column, 0.0, options_.relation_sigma);
        if (innovation.variance <=
                options_.max_uncertainty * options_.max_uncertainty &&
            innovation.chi_square < smallest) {
          smallest = innovation.chi_square;
          nearest = j;
        }
      }
      if (nearest == k) continue;
      const std::size_t family = std::min(families_[nearest], families_[k]);
      Merge(nearest, k);
      is_whole_.insert(families_[nearest]);
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
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (families_[k] == k && is_whole_.count(k) == 0) {
        FindSplit(k, &best_statistic, &best);
      }
    }
    if (best.empty()) return false;
    // The walls along, and those across.
    std::map<std::size_t, std::vector<std::size_t>> parts;
    for (const std::size_t wall : best) {
      parts[static_cast<std::size_t>(result_.direction_of[wall])].push_back(
          wall);
    }
    std::vector<std::size_t> made;
    for (const auto& [old, part] : parts) {
      Untie(part, old);
      const std::size_t k = AddDirection(network_.Angle(nodes_[old]));
      for (const std::size_t wall : part) Tie(wall, k);
      split_off_.insert(k);
      made.push_back(k);
    }
    if (made.size() == 2) Relate(made[0], made[1]);
    return true;
  }

  // Walls of a direction.
  void Untie(const std::vector<std::size_t>& walls, std::size_t direction) {
    std::vector<std::size_t> nodes;
    for (const std::size_t wall : walls) {
      result_.direction_of[wall] = -1;
      nodes.push_back(walls_[wall].node);
    }
    std::vector<std::size_t>& tied = result_.directions[direction].walls;
    tied.erase(std::remove_if(tied.begin(), tied.end(),
                              [this](std::size_t wall) {
                                return result_.direction_of[wall] < 0;
                              }),
               tied.end());
    network_.RemoveLinksBetween(nodes_[direction], nodes);
  }

  // A wall of a family.
  struct Member {
    std::size_t wall;
    std::size_t direction;
    // From the first wall, by the measurements alone, without quarter turns.
    double untied;
  };

  // The part of a family's walls whose turn against the others would lower the
  // cost most, if by more than *best_statistic. Parts are cut in the order in
  // which walls came into the map, where a part is a part of the building, and
  // by the angles that the measurements alone give.
  void FindSplit(std::size_t family, double* best_statistic,
                 std::vector<std::size_t>* best) const {
    std::vector<Member> members;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (families_[k] != family) continue;
      for (const std::size_t wall : result_.directions[k].walls) {
        const double turn =
            members.empty() ? 0.0 : untied_[wall] - untied_[members[0].wall];
        members.push_back(
            {wall, k, turn - 0.5 * kPi * std::round(turn / (0.5 * kPi))});
      }
    }
    if (members.size() < 2 * static_cast<std::size_t>(options_.min_support)) {
      return;
    }
    std::sort(members.begin(), members.end(),
              [](const Member& a, const Member& b) { return a.wall < b.wall; });
    FindCut(members, best_statistic, best);
    // The two halves of any scatter differ: chosen so, the turn of a normal
    // distribution's upper half explains 2 / pi of the cost, of a uniform
    // one's 3 / 4.
    double cost = 0.0;
    for (const Member& member : members) {
      const double pull = Residual(member) / Tolerance(member.wall);
      cost += pull * pull;
    }
    double least = std::max(*best_statistic, options_.split_share * cost);
    const double without = least;
    std::stable_sort(
        members.begin(), members.end(),
        [](const Member& a, const Member& b) { return a.untied < b.untied; });
    FindCut(members, &least, best);
    if (least > without) *best_statistic = least;
  }

  double Residual(const Member& member) const {
    return NormalizeAxial(network_.Angle(walls_[member.wall].node) -
                          network_.Angle(nodes_[member.direction]));
  }

  // The same among the parts before and after a member.
  void FindCut(const std::vector<Member>& members, double* best_statistic,
               std::vector<std::size_t>* best) const {
    double total_length = 0.0;
    for (const Member& member : members) {
      total_length += walls_[member.wall].length;
    }
    const std::size_t step = 1 + members.size() / kMaxCuts;
    Eigen::VectorXd pull =
        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(network_.size()));
    double score = 0.0, weight = 0.0, length = 0.0;
    for (std::size_t i = 0; i + 1 < members.size(); ++i) {
      const Member& member = members[i];
      const double tolerance = Tolerance(member.wall);
      const double w = 1.0 / (tolerance * tolerance);
      score += w * Residual(member);
      weight += w;
      length += walls_[member.wall].length;
      pull[static_cast<Eigen::Index>(walls_[member.wall].node)] += w;
      pull[static_cast<Eigen::Index>(nodes_[member.direction])] -= w;
      const std::size_t count = i + 1;
      const auto support = static_cast<std::size_t>(options_.min_support);
      if (count % step != 0 || count < support ||
          members.size() - count < support ||
          length < options_.min_support_length ||
          total_length - length < options_.min_support_length) {
        continue;
      }
      const double information = weight - pull.dot(network_.Covary(pull));
      if (information <= 1e-9 * weight) continue;
      const double statistic = score * score / information;
      if (statistic > *best_statistic &&
          std::abs(score / information) >= options_.min_separation) {
        *best_statistic = statistic;
        best->clear();
        // The shorter part goes.
        const bool goes_first = length <= 0.5 * total_length;
        for (std::size_t j = 0; j < members.size(); ++j) {
          if ((j < count) == goes_first) best->push_back(members[j].wall);
        }
      }
    }
  }

  void Remove(std::size_t k) {
    for (const std::size_t wall : result_.directions[k].walls) {
      result_.direction_of[wall] = -1;
      is_refused_founder_[wall] = true;
    }
    result_.directions[k].walls.clear();
    network_.RemoveLinksOf(nodes_[k]);
    is_removed_.insert(k);
  }

  DirectionNetwork network_;
  const std::vector<DirectionWall>& walls_;
  const DirectionAssignmentOptions& options_;
  const std::function<bool()>& stop_;
  std::size_t num_given_;
  DirectionAssignment result_;
  // By direction: its node, and its family, which it shares with the one at a
  // right angle: the lowest index.
  std::vector<std::size_t> nodes_;
  std::vector<std::size_t> families_;
  std::map<std::size_t, std::size_t> merged_into_;
  std::set<std::size_t> is_removed_;
  std::set<std::size_t> split_off_;
  // Families that were found to be one after a split.
  std::set<std::size_t> is_whole_;
  // Of this round. By direction: the one at a right angle, -1 for none.
  std::vector<int> companion_;
  std::vector<Candidate> candidates_;
  // By wall: its angle by the measurements alone.
  std::vector<double> untied_;
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
