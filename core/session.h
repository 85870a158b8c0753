#ifndef PLUMBLINE_CORE_SESSION_H_
#define PLUMBLINE_CORE_SESSION_H_

#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Weighting of structure, and when a solve ends.
struct SessionOptions {
  /// Weighting of structure constraints: a LossType's name.
  std::string delta_mode = "frozen";
  /// "resident" (ResidentMinimizer) keeps the analysis of the graph between
  /// global solves, "ceres" makes it anew. Small solves are Ceres' in any case.
  std::string minimizer = "ceres";
  int max_iterations = 50;
  /// Relative change of the cost at which a solve ends.
  double function_tolerance = 1e-8;
  /// Damping of the steps is its inverse, relative to the scale of each
  /// parameter, and never gets smaller: large for near Gauss-Newton steps from
  /// warm starts, small enough that undetermined directions stay put.
  double initial_trust_region_radius = 1e10;
  /// Threads of residual evaluation in large global solves. Results of the
  /// resident minimizer do not depend on them. With more than one, Ceres adds
  /// up costs in any order: results agree to rounding only.
  int num_threads = 1;
  /// Taking constraints out costs next to nothing, whatever the size of the
  /// graph. False: making the session and global solves are cheaper, and every
  /// constraint taken out costs a pass over all of them; for graphs that lose
  /// few or none.
  bool fast_removal = true;
};

/// Result and cost of one solve.
struct SolveReport {
  bool usable = false;
  bool converged = false;
  /// Steps computed, each a factorization; rejected ones included.
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

/// Smallest weight that an E-step gives to a live structure constraint. With a
/// weight of exactly zero, a virtual feature whose constraints are all bad
/// would be held by nothing and could never be pulled back by them; this much
/// moves nothing else.
constexpr double kDeltaFloor = 1e-6;

/// Sums of s_c(x) = |r|^2 over live constraints: measurements unweighted,
/// structure weighted as in a solve at the present deltas (sum of rho(s)).
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
  /// it are taken over. Throws Error for an unknown delta_mode or minimizer.
  SolverSession(Graph* graph, const Registry& registry,
                const SessionOptions& options);
  ~SolverSession() override;

  /// Optimizes every feature that is not fixed and has a live constraint. A
  /// connected part of the graph without a fixed feature (and without a
  /// relation of a single feature) has no gauge: its feature with the lowest id
  /// of the lowest level is held for the solve. What is undetermined all the
  /// same (a segment along its wall, a rotation about a held point) stays where
  /// it is, up to rounding. Angles are wrapped to (-pi, pi] after a solve.
  /// Parameters are left as they were when the solve fails (usable is false).
  SolveReport SolveGlobal();

  /// SolveGlobal with another relative change of the cost and initial radius of
  /// the trust region: a coarse solve on the way to something else. It ends
  /// with a step that brings less, or is rejected and promised no more. A rise
  /// in one part of the graph that makes up for the fall in the rest does not
  /// end it.
  SolveReport SolveGlobal(double function_tolerance,
                          double initial_trust_region_radius);

  /// Optimizes the given features (unknown and fixed ones, and those without a
  /// live constraint, are passed over) with every other feature constant. Costs
  /// what these features and their constraints cost, whatever the size of the
  /// graph. Features that nothing around them holds have no gauge: then the
  /// lowest of them is held as in SolveGlobal.
  SolveReport SolveLocal(const std::vector<FeatureId>& features);

  /// Asked after every step of a solve; when it returns true the solve ends
  /// with what it has: usable, but not converged. Null: solves go on to their
  /// end.
  void SetStop(std::function<bool()> stop);

  /// Whitened squared residual s_c at the present state, unweighted; infinite
  /// when it cannot be evaluated. Here and below, `constraint` is one of the
  /// graph, live or broken.
  double SquaredResidual(const Constraint& constraint) const;
  /// Error e_c = f(x) (-) u in the units of the relation, not whitened.
  Eigen::VectorXd Error(const Constraint& constraint) const;
  /// Chi-square p-value of the residual with the rank of the information as
  /// degrees of freedom, at the present state; 1 for a rank of 0.
  double Delta(const Constraint& constraint) const;
  /// The E-step: writes Delta(), and at least kDeltaFloor, to every live
  /// structure constraint on `features`, or of the whole graph when null. No
  /// weight freezes for good: Delta() is that of the unweighted residual.
  /// Returns the largest change of a weight.
  double UpdateDeltas(const std::vector<FeatureId>* features = nullptr);

  /// Linearization of a live constraint at the present state as a solve has it:
  /// whitened, and structure weighted with the root of rho'(s). Throws Error
  /// when the constraint is broken or cannot be evaluated.
  LinearizedConstraint Linearize(const Constraint& constraint) const;

  /// Cost at the present state of the whole graph, or of the live constraints
  /// on `features`.
  CostReport Cost(const std::vector<FeatureId>* features = nullptr) const;

  /// As they were given.
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

/// Has a session ask whether to stop for as long as it lives.
class SolveStop {
 public:
  /// The session is not owned and must outlive it.
  SolveStop(SolverSession* session, std::function<bool()> stop)
      : session_(session) {
    session_->SetStop(std::move(stop));
  }
  SolveStop(const SolveStop&) = delete;
  SolveStop& operator=(const SolveStop&) = delete;
  ~SolveStop() { session_->SetStop(nullptr); }

 private:
  SolverSession* session_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SESSION_H_
