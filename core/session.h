#ifndef PLUMBLINE_CORE_SESSION_H_
#define PLUMBLINE_CORE_SESSION_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <memory>
#include <string>
#include <vector>

namespace plumbline {

struct SessionOptions {
  /// Weighting of structure constraints: a LossType's name.
  std::string delta_mode = "frozen";
  int max_iterations = 50;
  /// Relative change of the cost at which a solve ends.
  double function_tolerance = 1e-8;
  /// Warm starts want near Gauss-Newton steps (performance.md).
  double initial_trust_region_radius = 1e16;
  /// Threads of residual evaluation. Results do not depend on it.
  int num_threads = 1;
};

/// What one solve did and cost.
struct SolveReport {
  bool usable = false;
  bool converged = false;
  int iterations = 0;
  /// 1/2 sum of rho(s) before and after, over the residuals of this solve.
  double initial_cost = 0.0;
  double final_cost = 0.0;
  int residual_blocks = 0;
  int variable_blocks = 0;
  /// Seconds: evaluation of residuals and Jacobians, linear solver, the rest
  /// (building, preprocessing, ordering), and the sum of all.
  double evaluation_seconds = 0.0;
  double linear_solver_seconds = 0.0;
  double setup_seconds = 0.0;
  double total_seconds = 0.0;
  /// Ceres' message when not usable.
  std::string message;
};

/// Sums of s_c(x) = |r|^2 over live constraints: measurements unweighted,
/// structure weighted as in the last solve (sum of rho(s)).
struct CostReport {
  double measurement = 0.0;
  double structure = 0.0;
  double total() const { return measurement + structure; }
};

/// Keeps one ceres::Problem in step with a graph: residual blocks are added and
/// removed as constraints are, parameter blocks live in the features. It
/// listens to the graph for as long as it lives.
class SolverSession : public GraphListener {
 public:
  /// The graph must outlive the session; features and constraints already in
  /// it are taken over. Throws Error for an unknown delta_mode.
  SolverSession(Graph* graph, const Registry& registry,
                const SessionOptions& options);
  ~SolverSession() override;

  /// Optimizes every feature that is not fixed. A graph without a fixed
  /// feature has no gauge: the feature with the lowest id of the lowest level
  /// is held for the solve. Parameters are left as they were when the solve
  /// fails (usable is false).
  SolveReport SolveGlobal();

  /// Optimizes the given features (unknown and fixed ones are passed over)
  /// with every other feature constant. Costs what these features and their
  /// constraints cost, whatever the size of the graph.
  SolveReport SolveLocal(const std::vector<FeatureId>& features);

  /// Whitened squared residual s_c at the present state, unweighted.
  double SquaredResidual(const Constraint& constraint) const;
  /// Error e_c = f(x) (-) u in the units of the relation, not whitened.
  Eigen::VectorXd Error(const Constraint& constraint) const;
  /// Chi-square p-value of the residual with the rank of the information as
  /// degrees of freedom, at the present state.
  double Delta(const Constraint& constraint) const;
  /// Writes Delta() to every live structure constraint on `features`, or of
  /// the whole graph when null.
  void UpdateDeltas(const std::vector<FeatureId>* features = nullptr);

  CostReport Cost() const;

  const SessionOptions& options() const;
  /// Sums over all solves so far.
  const SolveReport& totals() const;
  int num_solves() const;

  void OnFeatureAdded(const Feature& feature) override;
  void OnFeatureRemoved(const Feature& feature) override;
  void OnConstraintAdded(const Constraint& constraint) override;
  void OnConstraintChanged(const Constraint& constraint) override;
  void OnConstraintRetired(const Constraint& constraint) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SESSION_H_
