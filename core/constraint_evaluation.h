#ifndef PLUMBLINE_CORE_CONSTRAINT_EVALUATION_H_
#define PLUMBLINE_CORE_CONSTRAINT_EVALUATION_H_

#include <ceres/cost_function.h>
#include <plumbline/core/constraint.h>
#include <plumbline/core/feature.h>
#include <plumbline/core/graph.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace plumbline {

/// The cost function of a constraint: r = root (f(x) (-) expected).
/// `features` are those that it is between, in its order: types and anchors
/// are read, parameters are not. Throws Error when they do not fit.
std::unique_ptr<ceres::CostFunction> MakeCost(
    const Constraint& constraint, Eigen::MatrixXd root,
    std::vector<const Feature*> features);

/// The features of a constraint of the graph, in its order.
std::vector<const Feature*> FeaturesOf(const Graph& graph,
                                       const Constraint& constraint);

/// Residual of a cost function of a constraint of the graph at the present
/// state, and where `jacobians` is not null, those that are not null in it as
/// Ceres has them. False when it cannot be evaluated; numbers that are not
/// finite are not looked for.
bool Evaluate(const Graph& graph, const Constraint& constraint,
              const ceres::CostFunction& cost, double* residual,
              double** jacobians = nullptr);

/// Whitened error of what a constraint says, if it was between `features`;
/// infinite where it cannot be evaluated or is not finite.
Eigen::VectorXd WhitenedError(const Constraint& constraint,
                              const std::vector<const Feature*>& features);

/// Error e = f(x) (-) u of a constraint of the graph in the units of its
/// relation, not whitened; infinite where it cannot be evaluated.
Eigen::VectorXd ErrorOf(const Graph& graph, const Constraint& constraint);

/// First-order model of a constraint: r(x + d) = residual + sum J_i d_i.
struct LinearizedConstraint {
  Eigen::VectorXd residual;
  /// For each feature in order, rows x parameters (not tangent space).
  std::vector<Eigen::MatrixXd> jacobians;
};

/// The first-order model of a constraint of the graph at the present state by a
/// cost function of it. Throws Error when it is not finite.
LinearizedConstraint Linearize(const Graph& graph, const Constraint& constraint,
                               const ceres::CostFunction& cost);

/// The model with residual and Jacobians multiplied by a weight.
LinearizedConstraint Weighted(LinearizedConstraint linearized, double weight);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_CONSTRAINT_EVALUATION_H_
