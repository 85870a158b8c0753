#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information.h>
#include <plumbline/core/registry.h>

#include <array>
#include <limits>
#include <string>
#include <utility>

namespace plumbline {
namespace {

using RowMajor =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

std::unique_ptr<ceres::CostFunction> MakeCost(
    const Constraint& constraint, Eigen::MatrixXd root,
    std::vector<const Feature*> features) {
  RelationArguments arguments;
  arguments.expected = constraint.expected;
  arguments.sqrt_information = std::move(root);
  arguments.features = std::move(features);
  return constraint.type->make_cost(arguments);
}

std::vector<const Feature*> FeaturesOf(const Graph& graph,
                                       const Constraint& constraint) {
  std::vector<const Feature*> features;
  features.reserve(constraint.features.size());
  for (const FeatureId id : constraint.features) {
    features.push_back(&graph.GetFeature(id));
  }
  return features;
}

bool Evaluate(const Graph& graph, const Constraint& constraint,
              const ceres::CostFunction& cost, double* residual,
              double** jacobians) {
  // On the stack for any usual relation: this is asked for every constraint.
  std::array<const double*, 4> usual;
  std::vector<const double*> unusual;
  const double** parameters = usual.data();
  const std::size_t arity = constraint.features.size();
  if (arity > usual.size()) {
    unusual.resize(arity);
    parameters = unusual.data();
  }
  for (std::size_t i = 0; i < arity; ++i) {
    parameters[i] = graph.GetFeature(constraint.features[i]).data();
  }
  return cost.Evaluate(parameters, residual, jacobians);
}

Eigen::VectorXd WhitenedError(const Constraint& constraint,
                              const std::vector<const Feature*>& features) {
  std::vector<const double*> parameters;
  parameters.reserve(features.size());
  for (const Feature* feature : features) {
    parameters.push_back(feature->data());
  }
  const auto cost =
      MakeCost(constraint, SqrtInformation(constraint.information), features);
  Eigen::VectorXd error(constraint.type->residual_size);
  if (!cost->Evaluate(parameters.data(), error.data(), nullptr) ||
      !error.allFinite()) {
    error.setConstant(std::numeric_limits<double>::infinity());
  }
  return error;
}

Eigen::VectorXd ErrorOf(const Graph& graph, const Constraint& constraint) {
  const int size = constraint.type->residual_size;
  const auto cost = MakeCost(constraint, Eigen::MatrixXd::Identity(size, size),
                             FeaturesOf(graph, constraint));
  Eigen::VectorXd error(size);
  if (!Evaluate(graph, constraint, *cost, error.data())) {
    error.setConstant(std::numeric_limits<double>::infinity());
  }
  return error;
}

LinearizedConstraint Linearize(const Graph& graph, const Constraint& constraint,
                               const ceres::CostFunction& cost) {
  const int rows = constraint.type->residual_size;
  LinearizedConstraint linearized;
  linearized.residual.resize(rows);
  std::vector<RowMajor> blocks;
  std::vector<double*> jacobians;
  for (const FeatureId id : constraint.features) {
    blocks.emplace_back(rows, graph.GetFeature(id).type->size);
  }
  for (RowMajor& block : blocks) jacobians.push_back(block.data());
  bool is_finite = Evaluate(graph, constraint, cost, linearized.residual.data(),
                            jacobians.data()) &&
                   linearized.residual.allFinite();
  for (const RowMajor& block : blocks) {
    is_finite = is_finite && block.allFinite();
  }
  if (!is_finite) {
    throw PLUMBLINE_ERROR(
        constraint.type->name + " " + std::to_string(constraint.id) +
            " cannot be linearized",
        "a state at which the residual and its derivatives are finite");
  }
  linearized.jacobians.assign(blocks.begin(), blocks.end());
  return linearized;
}

LinearizedConstraint Weighted(LinearizedConstraint linearized, double weight) {
  linearized.residual *= weight;
  for (Eigen::MatrixXd& jacobian : linearized.jacobians) jacobian *= weight;
  return linearized;
}

}  // namespace plumbline
