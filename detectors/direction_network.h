#ifndef PLUMBLINE_DETECTORS_DIRECTION_NETWORK_H_
#define PLUMBLINE_DETECTORS_DIRECTION_NETWORK_H_

#include <plumbline/core/symmetric_ordering.h>

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

namespace plumbline {

/// Directions (rad) and what is known of their differences: a linear Gaussian
/// model with one unknown per node, the part of a map that decides which walls
/// share a direction. Every link is an equation x[to] - x[from] = angle with a
/// variance; the estimate minimizes the sum of squares. Angles are unwrapped
/// around the initial values of the nodes, so those have to be better than a
/// half turn (a quarter turn for axial links).
///
/// A part of the network that no link connects with another is free to turn
/// against it: differences across have a variance of about kUnknownVariance.
class DirectionNetwork {
 public:
  /// rad^2; ten turns.
  static constexpr double kUnknownVariance = 4e3;

  /// A node with its initial value, rad; returns its index.
  std::size_t AddNode(double angle);

  /// x[to] - x[from] = angle (rad), to within a variance (rad^2, > 0); with
  /// `axial` modulo pi, for undirected directions. `group`: a number from 0 on
  /// for links whose variances are wrong by one factor, if they are.
  void AddLink(std::size_t from, std::size_t to, double angle, double variance,
               bool axial, int group = 0);

  /// Multiplies the variances of the links of a group, which then are `floor`
  /// (rad^2) at least.
  void ScaleVariances(int group, double factor, double floor);

  /// Takes out every link on a node, or between a node and any of others.
  void RemoveLinksOf(std::size_t node);
  void RemoveLinksBetween(std::size_t node,
                          const std::vector<std::size_t>& others);

  /// Number of nodes.
  std::size_t size() const { return initial_.size(); }
  /// Whether a link is on a node.
  bool HasLinks(std::size_t node) const { return degree_[node] > 0; }
  /// Number of links.
  std::size_t num_links() const { return links_.size(); }

  /// Estimates all nodes and the variances of single nodes. Has to be called
  /// after the last change and before what follows. What depends on which nodes
  /// links are between, and not on their values, is kept from one to the next.
  void Solve();
  /// The same without the variances: Variance must not be asked for.
  void SolveAngles();

  /// rad, unwrapped.
  double Angle(std::size_t node) const { return estimate_[node]; }
  /// Variance of a node, rad^2 (with the gauge of its part loosely at zero).
  double Variance(std::size_t node) const { return variance_[node]; }
  /// Covariances of a node with all nodes, rad^2.
  Eigen::VectorXd CovarianceColumn(std::size_t node) const;
  /// The covariance matrix times a vector with an entry for each node.
  Eigen::VectorXd Covary(const Eigen::VectorXd& vector) const;

  /// By how much the residuals of a group are larger than its variances say
  /// (variance component, Foerstner 1979): the sum of its squared whitened
  /// residuals over its share in the redundancy. Both have kPriorRedundancy
  /// added, so that few links say little.
  double VarianceFactor(int group) const;
  static constexpr double kPriorRedundancy = 10.0;

 private:
  struct Link {
    std::size_t from, to;
    double angle, information;
    bool is_axial;
    int group;
  };
  double Residual(const Link& link) const;
  template <typename Predicate>
  void RemoveLinks(Predicate goes);
  void ComputeVariances();

  std::vector<double> initial_;
  std::vector<Link> links_;
  // Links on each node.
  std::vector<int> degree_;
  std::vector<double> estimate_;
  std::vector<double> variance_;
  // By pointer: a factorization cannot be moved.
  std::unique_ptr<SymmetricFactor<double>> ldlt_;
  // Whether the analysis in it is of the present nodes and links.
  bool is_analyzed_ = false;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_DIRECTION_NETWORK_H_
