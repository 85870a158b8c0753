#ifndef PLUMBLINE_DETECTORS_DIRECTION_TIES_H_
#define PLUMBLINE_DETECTORS_DIRECTION_TIES_H_

#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_network.h>

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <set>
#include <vector>

namespace plumbline {

/// Walls tied to shared directions, as links of a network of directions.
/// Directions are numbered in the order in which they are made and keep their
/// numbers. A family is a direction with its companion, the one at a right
/// angle to it; its number is the smaller one of the two.
class DirectionTies {
 public:
  /// Without any direction. Walls and options are not owned and must outlive
  /// this.
  DirectionTies(DirectionNetwork network,
                const std::vector<DirectionWall>& walls,
                const DirectionAssignmentOptions& options);

  /// Solves the network with all ties, which the angles and variances below
  /// are then of.
  void Solve() { network_.Solve(); }
  /// The network as it was solved last.
  const DirectionNetwork& network() const { return network_; }

  /// Number of directions ever made.
  std::size_t size() const { return nodes_.size(); }
  /// Node of a direction in the network.
  std::size_t node(std::size_t direction) const { return nodes_[direction]; }
  /// Family of a direction.
  std::size_t family(std::size_t direction) const {
    return families_[direction];
  }
  /// Walls that are tied to a direction.
  const std::vector<std::size_t>& WallsOf(std::size_t direction) const {
    return walls_of_[direction];
  }
  /// The direction of each wall, -1 for none.
  const std::vector<int>& direction_of() const { return direction_of_; }
  /// Whether walls are tied to a direction.
  bool IsUsed(std::size_t direction) const {
    return !walls_of_[direction].empty();
  }
  /// Number of directions with walls in the family of a direction.
  std::size_t FamilySize(std::size_t direction) const;
  /// The direction that the walls of a direction went to by Merge.
  std::size_t Owner(std::size_t direction) const;

  /// Makes a direction without walls; `angle` is its start, rad.
  std::size_t Add(double angle);
  /// Ties a wall to a direction.
  void Tie(std::size_t wall, std::size_t direction);
  /// Takes walls off their direction.
  void Untie(const std::vector<std::size_t>& walls, std::size_t direction);
  /// Makes two directions companions.
  void Relate(std::size_t a, std::size_t b);
  /// Makes one direction of two parallel ones, and one of their companions.
  void Merge(std::size_t to, std::size_t from);
  /// Takes all walls off a direction for good.
  void Remove(std::size_t direction);
  /// The companion of a direction; makes it when there is none.
  std::size_t Across(std::size_t direction);

  /// Standard deviation with which a wall is tied, rad.
  double Tolerance(std::size_t wall) const;
  /// Innovation of the statement that a node lies `offset` (rad) from another
  /// one to within `tolerance` (rad). `column`: covariances of the other one
  /// (DirectionNetwork::CovarianceColumn).
  DirectionInnovation Innovation(std::size_t node, std::size_t other,
                                 const Eigen::VectorXd& column, double offset,
                                 double tolerance) const;

 private:
  void Move(std::size_t to, std::size_t from);

  DirectionNetwork network_;
  const std::vector<DirectionWall>& walls_;
  const DirectionAssignmentOptions& options_;
  std::vector<int> direction_of_;
  // By direction.
  std::vector<std::vector<std::size_t>> walls_of_;
  std::vector<std::size_t> nodes_;
  std::vector<std::size_t> families_;
  std::map<std::size_t, std::size_t> merged_into_;
  std::set<std::size_t> is_removed_;
};

/// Log-likelihood of an innovation.
double LogLikelihood(const DirectionInnovation& innovation);

/// Finds the walls of a family whose turn against its other walls would lower
/// the cost of all ties most (score test), if by more than *best_statistic,
/// which it raises; `best` are these walls then. Parts are cut in the order in
/// which walls came into the map, where a part is a part of the building, and
/// by the angles that the measurements alone give: `untied`, by wall, rad.
void FindFamilySplit(const DirectionTies& ties,
                     const std::vector<DirectionWall>& walls,
                     const DirectionAssignmentOptions& options,
                     const std::vector<double>& untied, std::size_t family,
                     double* best_statistic, std::vector<std::size_t>* best);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_DIRECTION_TIES_H_
