#include <plumbline/detectors/direction_ties.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

// Places at which the walls of a direction are cut in two for a trial.
constexpr std::size_t kMaxCuts = 60;

// Finds where a family is split.
class FamilySplitter {
 public:
  FamilySplitter(const DirectionTies& ties,
                 const std::vector<DirectionWall>& walls,
                 const DirectionAssignmentOptions& options,
                 const std::vector<double>& untied)
      : ties_(ties), walls_(walls), options_(options), untied_(untied) {}

  void Find(std::size_t family, double* best_statistic,
            std::vector<std::size_t>* best) const {
    std::vector<Member> members;
    for (std::size_t k = 0; k < ties_.size(); ++k) {
      if (ties_.family(k) != family) continue;
      for (const std::size_t wall : ties_.WallsOf(k)) {
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
      const double pull = Residual(member) / ties_.Tolerance(member.wall);
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

 private:
  // A wall of a family.
  struct Member {
    std::size_t wall;
    std::size_t direction;
    // From the first wall, by the measurements alone, without quarter turns.
    double untied;
  };

  double Residual(const Member& member) const {
    return NormalizeAxial(ties_.network().Angle(walls_[member.wall].node) -
                          ties_.network().Angle(ties_.node(member.direction)));
  }

  // The best cut among those before and after each member, in their order.
  void FindCut(const std::vector<Member>& members, double* best_statistic,
               std::vector<std::size_t>* best) const {
    double total_length = 0.0;
    for (const Member& member : members) {
      total_length += walls_[member.wall].length;
    }
    const std::size_t step = 1 + members.size() / kMaxCuts;
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(
        static_cast<Eigen::Index>(ties_.network().size()));
    double score = 0.0, weight = 0.0, length = 0.0;
    for (std::size_t i = 0; i + 1 < members.size(); ++i) {
      const Member& member = members[i];
      const double tolerance = ties_.Tolerance(member.wall);
      const double w = 1.0 / (tolerance * tolerance);
      score += w * Residual(member);
      weight += w;
      length += walls_[member.wall].length;
      pull[static_cast<Eigen::Index>(walls_[member.wall].node)] += w;
      pull[static_cast<Eigen::Index>(ties_.node(member.direction))] -= w;
      const std::size_t count = i + 1;
      const auto support = static_cast<std::size_t>(options_.min_support);
      if (count % step != 0 || count < support ||
          members.size() - count < support ||
          length < options_.min_support_length ||
          total_length - length < options_.min_support_length) {
        continue;
      }
      const double information =
          weight - pull.dot(ties_.network().Covary(pull));
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

  const DirectionTies& ties_;
  const std::vector<DirectionWall>& walls_;
  const DirectionAssignmentOptions& options_;
  const std::vector<double>& untied_;
};

}  // namespace

DirectionTies::DirectionTies(DirectionNetwork network,
                             const std::vector<DirectionWall>& walls,
                             const DirectionAssignmentOptions& options)
    : network_(std::move(network)),
      walls_(walls),
      options_(options),
      direction_of_(walls.size(), -1) {}

std::size_t DirectionTies::FamilySize(std::size_t direction) const {
  std::size_t size = 0;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    size += IsUsed(k) && families_[k] == families_[direction];
  }
  return size;
}

std::size_t DirectionTies::Owner(std::size_t direction) const {
  while (merged_into_.count(direction) > 0) {
    direction = merged_into_.at(direction);
  }
  return direction;
}

std::size_t DirectionTies::Add(double angle) {
  nodes_.push_back(network_.AddNode(angle));
  families_.push_back(nodes_.size() - 1);
  walls_of_.emplace_back();
  return nodes_.size() - 1;
}

void DirectionTies::Tie(std::size_t wall, std::size_t direction) {
  const double tolerance = Tolerance(wall);
  network_.AddLink(walls_[wall].node, nodes_[direction], 0.0,
                   tolerance * tolerance, true);
  direction_of_[wall] = static_cast<int>(direction);
  walls_of_[direction].push_back(wall);
}

void DirectionTies::Untie(const std::vector<std::size_t>& walls,
                          std::size_t direction) {
  std::vector<std::size_t> nodes;
  for (const std::size_t wall : walls) {
    direction_of_[wall] = -1;
    nodes.push_back(walls_[wall].node);
  }
  std::vector<std::size_t>& tied = walls_of_[direction];
  tied.erase(std::remove_if(
                 tied.begin(), tied.end(),
                 [this](std::size_t wall) { return direction_of_[wall] < 0; }),
             tied.end());
  network_.RemoveLinksBetween(nodes_[direction], nodes);
}

void DirectionTies::Relate(std::size_t a, std::size_t b) {
  network_.AddLink(nodes_[a], nodes_[b], 0.5 * kPi,
                   options_.relation_sigma * options_.relation_sigma, true);
  const std::size_t family = std::min(families_[a], families_[b]);
  families_[a] = families_[b] = family;
}

void DirectionTies::Merge(std::size_t to, std::size_t from) {
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

void DirectionTies::Move(std::size_t to, std::size_t from) {
  std::vector<std::size_t> walls;
  walls.swap(walls_of_[from]);
  network_.RemoveLinksOf(nodes_[from]);
  for (const std::size_t wall : walls) Tie(wall, to);
  merged_into_[from] = to;
}

void DirectionTies::Remove(std::size_t direction) {
  for (const std::size_t wall : walls_of_[direction]) direction_of_[wall] = -1;
  walls_of_[direction].clear();
  network_.RemoveLinksOf(nodes_[direction]);
  is_removed_.insert(direction);
}

std::size_t DirectionTies::Across(std::size_t direction) {
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    if (k != direction && merged_into_.count(k) == 0 && !is_removed_.count(k) &&
        families_[k] == families_[direction]) {
      return k;
    }
  }
  const std::size_t across =
      Add(NormalizeAxial(network_.Angle(nodes_[direction]) + 0.5 * kPi));
  Relate(direction, across);
  return across;
}

double DirectionTies::Tolerance(std::size_t wall) const {
  return std::hypot(options_.sigma, walls_[wall].own_sigma);
}

DirectionInnovation DirectionTies::Innovation(std::size_t node,
                                              std::size_t other,
                                              const Eigen::VectorXd& column,
                                              double offset,
                                              double tolerance) const {
  DirectionInnovation innovation;
  innovation.difference =
      NormalizeAxial(network_.Angle(node) - network_.Angle(other) - offset);
  innovation.variance =
      std::max(network_.Variance(node) + network_.Variance(other) -
                   2.0 * column[static_cast<Eigen::Index>(node)],
               0.0) +
      tolerance * tolerance;
  innovation.chi_square =
      innovation.difference * innovation.difference / innovation.variance;
  return innovation;
}

double LogLikelihood(const DirectionInnovation& innovation) {
  return -0.5 *
         (innovation.chi_square + std::log(2.0 * kPi * innovation.variance));
}

void FindFamilySplit(const DirectionTies& ties,
                     const std::vector<DirectionWall>& walls,
                     const DirectionAssignmentOptions& options,
                     const std::vector<double>& untied, std::size_t family,
                     double* best_statistic, std::vector<std::size_t>* best) {
  FamilySplitter(ties, walls, options, untied)
      .Find(family, best_statistic, best);
}

}  // namespace plumbline
