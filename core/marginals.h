#ifndef PLUMBLINE_CORE_MARGINALS_H_
#define PLUMBLINE_CORE_MARGINALS_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/session.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace plumbline {

/// The part of a graph that covariances are taken of, and their frame.
struct MarginalsOptions {
  /// A connected part of the graph that nothing ties to the plane (no fixed
  /// feature, no relation of a single feature) has no covariance in the map
  /// frame. False: asking for one is an error. True: the part's feature with
  /// the lowest id of the lowest level is taken as known, as a solve holds it.
  /// Relative covariances do not depend on it.
  bool hold_gauge = false;
  /// Only these features and the live constraints among them (null: the whole
  /// graph). What lies outside is left out and not held, so covariances come
  /// out larger than those of the whole graph, never smaller.
  const std::vector<FeatureId>* features = nullptr;
};

/// Marginal covariances of features at the present state: blocks of the inverse
/// of J' J over the live constraints, structure weighted as in a solve (Kaess
/// and Dellaert 2009, "Covariance recovery from a square root information
/// matrix for data association").
///
/// Making it costs one evaluation of each constraint and one sparse
/// factorization; a feature then costs the solves for its own columns, once,
/// or, when many are asked for with Compute, its share of one pass over the
/// factor. It is a snapshot of the state at construction: a later change of the
/// graph does not show.
///
/// Directions about which the graph says nothing at all (a segment along its
/// wall when nothing was seen of its ends) get a variance of about
/// kUndeterminedVariance, m^2 or rad^2; everything else is as if such a
/// direction was not there.
class Marginals {
 public:
  static constexpr double kUndeterminedVariance = 1e8;

  /// The graph and the session need to live for the construction only. Throws
  /// Error when a constraint cannot be evaluated.
  Marginals(const Graph& graph, const SolverSession& session,
            const MarginalsOptions& options = {});
  /// Marginals without a session, for detectors: structure counts by the delta
  /// of the last E-step.
  explicit Marginals(const Graph& graph, const MarginalsOptions& options = {});
  ~Marginals();
  Marginals(Marginals&&) noexcept;
  Marginals& operator=(Marginals&&) noexcept;

  /// Covariance of a feature's parameters in the map frame (size x size, in the
  /// units of the parameters); zero for a fixed feature. Throws Error when the
  /// feature is unknown or has no live constraint, and when its part of the
  /// graph has no gauge.
  Eigen::MatrixXd Covariance(FeatureId id);

  /// Joint covariance of several features, blocks in the order of `ids`. Throws
  /// Error as Covariance does.
  Eigen::MatrixXd JointCovariance(const std::vector<FeatureId>& ids);

  /// Covariance (rows x rows) of the sum of jacobians[i] * x_i over features
  /// with the parameters x_i; jacobians[i] is rows x size of the feature, in
  /// its units. A combination that does not depend on where the plane lies,
  /// such as the difference of two directions, needs no gauge; what the graph
  /// says nothing about has about kUndeterminedVariance. Throws Error when a
  /// feature is unknown or has no live constraint, when there are no features,
  /// and when sizes do not fit.
  Eigen::MatrixXd PropagatedCovariance(
      const std::vector<FeatureId>& ids,
      const std::vector<Eigen::MatrixXd>& jacobians);

  /// Covariance (3x3; m, m, rad) of the feature `to` seen from `from`
  /// (factors/pose2.h, Between), both poses or segments. It depends neither on
  /// where the gauge is fixed nor on whether it is fixed. Throws Error when the
  /// features are unknown, have other parameters than x, y, theta, or when
  /// nothing connects them.
  Eigen::Matrix3d RelativeCovariance(FeatureId from, FeatureId to);

  /// RelativeCovariance of each of `to` seen from one feature, in their order:
  /// costs the solves for the columns of `from`, and the covariances of `to`
  /// once, whatever their number.
  std::vector<Eigen::Matrix3d> RelativeCovariances(
      FeatureId from, const std::vector<FeatureId>& to);

  /// Prepares the covariances of all these features at once: cheaper than one
  /// by one when they are many. Throws Error as Covariance does.
  void Compute(const std::vector<FeatureId>& ids);

  /// False when the graph says next to nothing about some direction of the
  /// feature: its covariance has kUndeterminedVariance in it. Throws Error as
  /// Covariance does.
  bool IsDetermined(FeatureId id);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_MARGINALS_H_
