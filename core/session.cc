#include <ceres/ceres.h>
#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/resident_minimizer.h>
#include <plumbline/core/serial_openmp.h>
#include <plumbline/core/session.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/chi_square.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <utility>

namespace plumbline {
namespace {

// Ceres' other ways to stop. A change of parameters is judged relative to the
// norm of the whole state: far from the origin its default would stop at
// centimetres.
constexpr double kParameterTolerance = 1e-12;
// A factorization that fails halves the radius and tries again; the default of
// 5 tries does not get far enough.
constexpr int kMaxInvalidSteps = 20;
// Rows times squared columns below which a dense solve is done before a sparse
// one has been set up.
constexpr double kDenseWork = 3e5;
// Steps in a row that may lead uphill on the way to a lower cost.
constexpr int kUphillSteps = 3;
constexpr int kUnknownRank = -1;
// Residual blocks added, for each that there is, of which account is kept.
constexpr std::size_t kAddedPerResidual = 4;
// Constraints whose cost one thread computes at a time.
constexpr std::size_t kCostsAtOnce = 1024;

ceres::Problem::Options ProblemOptions(bool fast_removal) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.enable_fast_removal = fast_removal;
  // The graph has checked sizes and that blocks differ.
  options.disable_all_safety_checks = true;
  return options;
}

// The fastest that is there: measured on pose graphs of 10^3 to 10^4 poses,
// thin or not, it is CHOLMOD.
ceres::SparseLinearAlgebraLibraryType SparseLibrary() {
  return ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE)
             ? ceres::SUITE_SPARSE
             : ceres::EIGEN_SPARSE;
}

// What the session knows of a feature type.
struct TypeInfo {
  std::unique_ptr<ceres::Manifold> manifold;
  // Indices of the parameters that are angles.
  std::vector<int> angles;
};

TypeInfo MakeTypeInfo(const FeatureType& type) {
  TypeInfo info;
  if (type.make_manifold) info.manifold = type.make_manifold();
  for (std::size_t i = 0; i < type.parameters.size(); ++i) {
    if (type.parameters[i].is_angle) {
      info.angles.push_back(static_cast<int>(i));
    }
  }
  return info;
}

// Ends a coarse solve: when less than the tolerance is left, or a step was
// rejected that had promised no more. Ceres' own test looks at the size of the
// change alone, and takes a rejected step in which a rise in one part of the
// graph makes up for the fall in the rest for convergence.
class CoarseEnd final : public ceres::IterationCallback {
 public:
  explicit CoarseEnd(double function_tolerance)
      : function_tolerance_(function_tolerance) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& step) override {
    if (step.iteration == 0 || !step.step_is_valid) {
      return ceres::SOLVER_CONTINUE;
    }
    // What is left to be gained is about what a step promised and did not keep,
    // and no more than what it brought.
    const double promised = step.relative_decrease == 0.0
                                ? step.cost_change
                                : step.cost_change / step.relative_decrease;
    const double left =
        step.step_is_successful && !step.step_is_nonmonotonic
            ? std::min(step.cost_change, std::abs(promised - step.cost_change))
            : promised;
    return left <= function_tolerance_ * step.cost
               ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
               : ceres::SOLVER_CONTINUE;
  }

 private:
  double function_tolerance_;
};

// Ends a solve with what it has when it is told to.
class StopWhenAsked final : public ceres::IterationCallback {
 public:
  explicit StopWhenAsked(const std::function<bool()>& stop) : stop_(stop) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& /*step*/) override {
    if (!stop_()) return ceres::SOLVER_CONTINUE;
    has_stopped_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  bool has_stopped() const { return has_stopped_; }

 private:
  const std::function<bool()>& stop_;
  bool has_stopped_ = false;
};

// A cost that another one of the same relation can take the place of, without
// the problem's taking its residual block out and a new one in.
class ReplaceableCost final : public ceres::CostFunction {
 public:
  explicit ReplaceableCost(std::unique_ptr<ceres::CostFunction> cost) {
    set_num_residuals(cost->num_residuals());
    *mutable_parameter_block_sizes() = cost->parameter_block_sizes();
    cost_ = std::move(cost);
  }

  void Replace(std::unique_ptr<ceres::CostFunction> cost) {
    cost_ = std::move(cost);
  }

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    return cost_->Evaluate(parameters, residuals, jacobians);
  }

 private:
  std::unique_ptr<ceres::CostFunction> cost_;
};

struct Block {
  Feature* feature = nullptr;
  TypeInfo* type = nullptr;
  // Live constraints on it; in the problem while there are some.
  int residuals = 0;
  // As the problem has it.
  bool constant = false;
  // As the feature was when the gauge was found.
  bool fixed = false;
  int level = 0;
};

void AddParameterBlock(const Block& block, ceres::Problem* problem) {
  double* const values = block.feature->data();
  const int size = block.feature->type->size;
  // Ceres takes longer over a manifold that is null than over none.
  if (block.type->manifold == nullptr) {
    problem->AddParameterBlock(values, size);
  } else {
    problem->AddParameterBlock(values, size, block.type->manifold.get());
  }
}

struct Residual {
  std::unique_ptr<ceres::CostFunction> cost;
  // The cost itself once it has changed: what changes does so again and again.
  ReplaceableCost* replaceable = nullptr;
  std::unique_ptr<ceres::LossFunction> loss;
  // Null while the constraint is not live.
  ceres::ResidualBlockId id = nullptr;
  // Rank of the information; kUnknownRank until somebody asks: for most
  // measurements nobody does, and it takes an eigen decomposition.
  int degrees_of_freedom = kUnknownRank;
};

// A constraint as an edge, for the parts of the graph.
struct Link {
  bool is_live = false;
  // The second is the first where it has one feature alone.
  FeatureId first = 0;
  FeatureId second = 0;
  bool has_more = false;
};

}  // namespace

struct SolverSession::Impl {
  Impl(Graph* graph_in, const Registry& registry,
       const SessionOptions& options_in)
      : graph(graph_in),
        options(options_in),
        loss_type(registry.GetLoss(options_in.delta_mode)),
        problem(ProblemOptions(options_in.fast_removal)) {
    totals.usable = true;
    totals.converged = true;
    if (options.minimizer == "resident") {
      resident = std::make_unique<ResidentMinimizer>(&problem,
                                                     /*may_have_bounds=*/false);
    } else if (options.minimizer != "ceres") {
      throw PLUMBLINE_ERROR("unknown minimizer \"" + options.minimizer + "\"",
                            "ceres or resident");
    }
  }

  TypeInfo* InfoOf(const FeatureType* type) {
    const auto found = types.find(type);
    if (found != types.end()) return &found->second;
    return &types.emplace(type, MakeTypeInfo(*type)).first->second;
  }

  std::unique_ptr<ceres::CostFunction> MakeCost(
      const Constraint& constraint) const {
    return plumbline::MakeCost(constraint,
                               SqrtInformation(constraint.information),
                               FeaturesOf(*graph, constraint));
  }

  Residual& ResidualOf(ConstraintId id) { return *residuals[id]; }

  void AddFeature(Feature* feature) {
    const std::size_t index = static_cast<std::size_t>(feature->id);
    if (blocks.size() <= index) blocks.resize(index + 1);
    blocks[index].feature = feature;
    blocks[index].type = InfoOf(feature->type);
    has_gauge = false;
  }

  // Makes cost and loss; they are not in the problem yet.
  void AddConstraint(const Constraint& constraint) {
    const std::size_t index = static_cast<std::size_t>(constraint.id);
    if (residuals.size() <= index) {
      residuals.resize(index + 1);
      links.resize(index + 1);
    }
    auto residual = std::make_unique<Residual>();
    residual->cost = MakeCost(constraint);
    if (constraint.kind == ConstraintClass::kStructure) {
      residual->degrees_of_freedom = InformationRank(constraint.information);
      residual->loss =
          loss_type.make_loss(&constraint.delta, residual->degrees_of_freedom);
    }
    residuals[index] = std::move(residual);
  }

  void AddResidual(const Constraint& constraint) {
    Residual& residual = ResidualOf(constraint.id);
    has_gauge = false;
    std::vector<double*> parameters;
    parameters.reserve(constraint.features.size());
    for (const FeatureId id : constraint.features) {
      Block& block = blocks[id];
      if (block.residuals++ == 0) {
        AddParameterBlock(block, &problem);
        block.constant = false;
        changes.parameter_blocks = true;
      }
      parameters.push_back(block.feature->data());
    }
    residual.id = problem.AddResidualBlock(residual.cost.get(),
                                           residual.loss.get(), parameters);
    NoteAdded(residual.id);
    num_rows += constraint.type->residual_size;
    Link& link = links[constraint.id];
    link.is_live = true;
    link.first = constraint.features.front();
    link.second = constraint.features[constraint.features.size() > 1 ? 1 : 0];
    link.has_more = constraint.features.size() > 2;
  }

  void NoteAdded(ceres::ResidualBlockId id) {
    // Where small problems never come to the resident minimizer.
    knows_changes = knows_changes &&
                    changes.added.size() <=
                        kAddedPerResidual * static_cast<std::size_t>(
                                                problem.NumResidualBlocks());
    if (knows_changes) changes.added.push_back(id);
  }

  void RemoveResidual(const Constraint& constraint) {
    Residual& residual = ResidualOf(constraint.id);
    has_gauge = false;
    problem.RemoveResidualBlock(residual.id);
    residual.id = nullptr;
    num_rows -= constraint.type->residual_size;
    links[constraint.id].is_live = false;
    for (const FeatureId id : constraint.features) {
      Block& block = blocks[id];
      if (--block.residuals == 0) {
        problem.RemoveParameterBlock(block.feature->data());
        changes.parameter_blocks = true;
      }
    }
  }

  void SetConstant(Block* block, bool constant) {
    if (block->constant == constant) return;
    block->constant = constant;
    changes.parameter_blocks = true;
    if (constant) {
      problem.SetParameterBlockConstant(block->feature->data());
    } else {
      problem.SetParameterBlockVariable(block->feature->data());
    }
  }

  // The features to hold because nothing else ties their part of the graph to
  // the plane: in every connected part without a fixed feature and without a
  // relation of one feature alone (which refers to the plane itself), the one
  // with the lowest id of the lowest level.
  std::vector<Block*> GaugeBlocks() {
    DisjointSets parts(blocks.size());
    std::vector<bool> is_tied(blocks.size(), false);
    for (std::size_t i = 0; i < links.size(); ++i) {
      const Link& link = links[i];
      if (!link.is_live) continue;
      if (link.first == link.second) is_tied[link.first] = true;
      parts.Join(static_cast<std::size_t>(link.first),
                 static_cast<std::size_t>(link.second));
      if (!link.has_more) continue;
      for (const FeatureId feature :
           graph->FindConstraint(static_cast<ConstraintId>(i))->features) {
        parts.Join(static_cast<std::size_t>(link.first),
                   static_cast<std::size_t>(feature));
      }
    }
    std::vector<Block*> lowest(blocks.size(), nullptr);
    std::vector<bool> is_held(blocks.size(), false);
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      Block& block = blocks[i];
      if (block.residuals == 0) continue;
      const std::size_t part = parts.Find(i);
      if (block.feature->fixed || is_tied[i]) is_held[part] = true;
      if (lowest[part] == nullptr ||
          block.feature->level < lowest[part]->feature->level) {
        lowest[part] = &block;
      }
    }
    std::vector<Block*> held;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (lowest[i] != nullptr && !is_held[i]) held.push_back(lowest[i]);
    }
    return held;
  }

  // Ids of the live constraints on `features`, ascending.
  std::vector<ConstraintId> LiveConstraintsOn(
      const std::vector<FeatureId>& features) const {
    std::vector<ConstraintId> ids;
    for (const FeatureId feature : features) {
      if (graph->FindFeature(feature) == nullptr) continue;
      for (const ConstraintId id : graph->ConstraintsOf(feature)) {
        if (graph->FindConstraint(id)->state == ConstraintState::kLive) {
          ids.push_back(id);
        }
      }
    }
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return ids;
  }

  // Solves a problem of which `variables` are the blocks that vary;
  // `rows` and `columns` are the size of its Jacobian.
  SolveReport Solve(ceres::Problem* solved,
                    const std::vector<Block*>& variables, int num_residuals,
                    int rows, int columns, int num_threads,
                    double function_tolerance, double trust_region_radius,
                    bool is_coarse, const Stopwatch& watch) {
    SolveReport report;
    report.residual_blocks = num_residuals;
    report.variable_blocks = static_cast<int>(variables.size());
    if (variables.empty()) {
      report.usable = true;
      report.converged = true;
    } else {
      ceres::Solver::Options solver;
      solver.max_num_iterations = options.max_iterations;
      solver.function_tolerance = function_tolerance;
      solver.parameter_tolerance = kParameterTolerance;
      solver.initial_trust_region_radius = trust_region_radius;
      solver.max_trust_region_radius =
          std::max(solver.max_trust_region_radius, trust_region_radius);
      solver.max_num_consecutive_invalid_steps = kMaxInvalidSteps;
      // Ceres adds up in any order; the same bytes come with one thread.
      solver.num_threads = resident != nullptr ? 1 : num_threads;
      solver.logging_type = ceres::SILENT;
      if (static_cast<double>(rows) * columns * columns <= kDenseWork) {
        solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
        solver.dense_linear_algebra_library_type = ceres::EIGEN;
      } else {
        solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
        solver.sparse_linear_algebra_library_type = SparseLibrary();
      }
      const SerialOpenMp serial;
      CoarseEnd coarse_end(function_tolerance);
      if (is_coarse) {
        solver.function_tolerance = 0.0;
        solver.callbacks.push_back(&coarse_end);
      }
      StopWhenAsked stop_when_asked(stop);
      if (stop) solver.callbacks.push_back(&stop_when_asked);
      ceres::Solver::Summary summary;
      if (resident == nullptr ||
          solver.linear_solver_type != ceres::SPARSE_NORMAL_CHOLESKY) {
        ceres::Solve(solver, solved, &summary);
      } else if (solved == &problem) {
        solver.num_threads = num_threads;
        solver.use_nonmonotonic_steps = true;
        solver.max_consecutive_nonmonotonic_steps = kUphillSteps;
        resident->Solve(solver, &summary,
                        is_coarse ? ResidentMinimizer::Damping::kAsGiven
                                  : ResidentMinimizer::Damping::kWhereNeeded,
                        knows_changes ? &changes : nullptr);
        knows_changes = true;
        changes.parameter_blocks = false;
        changes.added.clear();
      } else {
        // Of a problem that is there but once.
        ResidentMinimizer(solved, /*may_have_bounds=*/false)
            .Solve(solver, &summary);
      }
      report.usable = summary.IsSolutionUsable();
      report.converged = !stop_when_asked.has_stopped() &&
                         (summary.termination_type == ceres::CONVERGENCE ||
                          summary.termination_type == ceres::USER_SUCCESS);
      if (report.usable && !std::isfinite(summary.final_cost)) {
        report.usable = false;
        report.converged = false;
        summary.message = "The cost is too large for a number.";
      }
      report.iterations = summary.num_linear_solves;
      report.initial_cost = summary.initial_cost;
      report.final_cost = summary.final_cost;
      report.evaluation_seconds = summary.residual_evaluation_time_in_seconds +
                                  summary.jacobian_evaluation_time_in_seconds;
      report.linear_solver_seconds = summary.linear_solver_time_in_seconds;
      if (report.usable) {
        for (const Block* block : variables) {
          for (const int i : block->type->angles) {
            double& angle = block->feature->parameters[i];
            angle = NormalizeAngle(angle);
          }
        }
      } else {
        report.message = summary.message;
      }
    }
    report.total_seconds = watch.Seconds();
    report.setup_seconds =
        std::max(0.0, report.total_seconds - report.evaluation_seconds -
                          report.linear_solver_seconds);
    AddToTotals(report);
    return report;
  }

  SolveReport SolveGlobal(double function_tolerance, double trust_region_radius,
                          bool is_coarse) {
    const Stopwatch watch;
    if (!HasGauge()) HoldGauge();
    return Solve(&problem, variables, problem.NumResidualBlocks(), num_rows,
                 num_columns, options.num_threads, function_tolerance,
                 trust_region_radius, is_coarse, watch);
  }

  // Whether what varies is known, and found from features as they are.
  bool HasGauge() const {
    return has_gauge &&
           std::all_of(blocks.begin(), blocks.end(), [](const Block& block) {
             return block.residuals == 0 ||
                    (block.fixed == block.feature->fixed &&
                     block.level == block.feature->level);
           });
  }

  // Finds what varies, and has the problem hold the rest.
  void HoldGauge() {
    const std::vector<Block*> held = GaugeBlocks();
    std::vector<char> is_held(blocks.size(), 0);
    for (const Block* block : held) is_held[block - blocks.data()] = 1;
    variables.clear();
    num_columns = 0;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      Block& block = blocks[i];
      if (block.residuals == 0) continue;
      block.fixed = block.feature->fixed;
      block.level = block.feature->level;
      SetConstant(&block, block.fixed || is_held[i] != 0);
      if (block.constant) continue;
      variables.push_back(&block);
      num_columns += block.feature->type->size;
    }
    has_gauge = true;
  }

  void AddToTotals(const SolveReport& report) {
    ++num_solves;
    totals.usable = totals.usable && report.usable;
    totals.converged = totals.converged && report.converged;
    totals.iterations += report.iterations;
    totals.initial_cost += report.initial_cost;
    totals.final_cost += report.final_cost;
    totals.residual_blocks += report.residual_blocks;
    totals.variable_blocks += report.variable_blocks;
    totals.evaluation_seconds += report.evaluation_seconds;
    totals.linear_solver_seconds += report.linear_solver_seconds;
    totals.setup_seconds += report.setup_seconds;
    totals.total_seconds += report.total_seconds;
    if (!report.message.empty()) totals.message = report.message;
  }

  double SquaredResidual(const Constraint& constraint) const {
    // On the stack for any usual relation.
    constexpr int kUsualSize = 6;
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kUsualSize, 1> usual;
    Eigen::VectorXd unusual;
    const int size = constraint.type->residual_size;
    if (size <= kUsualSize) {
      usual.resize(size);
    } else {
      unusual.resize(size);
    }
    Eigen::Map<Eigen::VectorXd> whitened(
        size <= kUsualSize ? usual.data() : unusual.data(), size);
    const bool evaluated = Evaluate(
        *graph, constraint, *residuals[constraint.id]->cost, whitened.data());
    const double squared = whitened.squaredNorm();
    // A residual that cannot be evaluated is as wrong as can be.
    if (!evaluated || std::isnan(squared)) {
      return std::numeric_limits<double>::infinity();
    }
    return squared;
  }

  double Delta(const Constraint& constraint) const {
    int& degrees = residuals[constraint.id]->degrees_of_freedom;
    if (degrees == kUnknownRank) {
      degrees = InformationRank(constraint.information);
    }
    if (degrees < 1) return 1.0;
    return ChiSquarePValue(SquaredResidual(constraint), degrees);
  }

  // Returns how much the weight changed.
  double UpdateDelta(Constraint* constraint) const {
    if (constraint->kind != ConstraintClass::kStructure ||
        constraint->state != ConstraintState::kLive) {
      return 0.0;
    }
    const double before = constraint->delta;
    constraint->delta = std::max(Delta(*constraint), kDeltaFloor);
    return std::abs(constraint->delta - before);
  }

  LinearizedConstraint Linearize(const Constraint& constraint) const {
    if (constraint.state != ConstraintState::kLive) {
      throw PLUMBLINE_ERROR("constraint " + std::to_string(constraint.id) +
                                " is broken and cannot be linearized",
                            "a live constraint");
    }
    const Residual& residual = *residuals[constraint.id];
    LinearizedConstraint linearized =
        plumbline::Linearize(*graph, constraint, *residual.cost);
    if (residual.loss == nullptr) return linearized;
    double rho[3];
    residual.loss->Evaluate(linearized.residual.squaredNorm(), rho);
    return Weighted(std::move(linearized), std::sqrt(rho[1]));
  }

  CostReport CostOf(const Constraint& constraint) const {
    CostReport report;
    if (constraint.state != ConstraintState::kLive) return report;
    const double squared = SquaredResidual(constraint);
    if (constraint.kind == ConstraintClass::kMeasurement) {
      report.measurement = squared;
      return report;
    }
    const ceres::LossFunction* loss = residuals[constraint.id]->loss.get();
    if (loss == nullptr) {
      report.structure = squared;
      return report;
    }
    double rho[3];
    loss->Evaluate(squared, rho);
    report.structure = rho[0];
    return report;
  }

  Graph* graph;
  SessionOptions options;
  const LossType& loss_type;
  // Costs, losses and manifolds must outlive the problem: it comes last.
  std::map<const FeatureType*, TypeInfo> types;
  std::vector<Block> blocks;
  // By the ids of constraints, both.
  std::vector<std::unique_ptr<Residual>> residuals;
  std::vector<Link> links;
  // Whether the blocks that vary are known; their number of parameters, and the
  // rows of all residuals.
  bool has_gauge = false;
  std::vector<Block*> variables;
  int num_columns = 0;
  int num_rows = 0;
  // Of the problem since the resident minimizer read it.
  bool knows_changes = false;
  ProblemChanges changes;
  std::function<bool()> stop;
  SolveReport totals;
  int num_solves = 0;
  ceres::Problem problem;
  // Null: Ceres' own.
  std::unique_ptr<ResidentMinimizer> resident;
};

SolverSession::SolverSession(Graph* graph, const Registry& registry,
                             const SessionOptions& options)
    : impl_(std::make_unique<Impl>(graph, registry, options)) {
  for (Feature* feature : graph->MutableFeatures()) impl_->AddFeature(feature);
  // One after the other, so that the costs lie side by side: a solve goes over
  // them again and again.
  const auto constraints = std::as_const(*graph).Constraints();
  impl_->residuals.reserve(constraints.size());
  impl_->links.reserve(constraints.size());
  for (const Constraint* constraint : constraints) {
    impl_->AddConstraint(*constraint);
  }
  for (const Constraint* constraint : constraints) {
    if (constraint->state == ConstraintState::kLive) {
      impl_->AddResidual(*constraint);
    }
  }
  graph->AddListener(this);
}

SolverSession::~SolverSession() { impl_->graph->RemoveListener(this); }

SolveReport SolverSession::SolveGlobal() {
  return impl_->SolveGlobal(impl_->options.function_tolerance,
                            impl_->options.initial_trust_region_radius,
                            /*is_coarse=*/false);
}

SolveReport SolverSession::SolveGlobal(double function_tolerance,
                                       double initial_trust_region_radius) {
  return impl_->SolveGlobal(function_tolerance, initial_trust_region_radius,
                            /*is_coarse=*/true);
}

SolveReport SolverSession::SolveLocal(const std::vector<FeatureId>& features) {
  const Stopwatch watch;
  std::vector<FeatureId> ids;
  for (const FeatureId id : features) {
    const Feature* feature = impl_->graph->FindFeature(id);
    if (feature == nullptr || feature->fixed ||
        impl_->blocks[id].residuals == 0)
      continue;
    ids.push_back(id);
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  const std::vector<ConstraintId> constraints = impl_->LiveConstraintsOn(ids);

  ceres::Problem problem(ProblemOptions(/*fast_removal=*/false));
  for (const FeatureId id : ids) {
    const Block& block = impl_->blocks[id];
    AddParameterBlock(block, &problem);
  }
  std::vector<FeatureId> neighbours;
  std::vector<double*> parameters;
  bool is_tied = false;
  int rows = 0;
  for (const ConstraintId id : constraints) {
    const Constraint& constraint = *impl_->graph->FindConstraint(id);
    parameters.clear();
    for (const FeatureId feature : constraint.features) {
      parameters.push_back(impl_->blocks[feature].feature->data());
      if (!std::binary_search(ids.begin(), ids.end(), feature)) {
        neighbours.push_back(feature);
      }
    }
    is_tied = is_tied || constraint.features.size() == 1;
    rows += constraint.type->residual_size;
    const Residual& residual = impl_->ResidualOf(id);
    problem.AddResidualBlock(residual.cost.get(), residual.loss.get(),
                             parameters);
  }
  for (const FeatureId id : neighbours) {
    problem.SetParameterBlockConstant(impl_->blocks[id].feature->data());
  }
  std::vector<Block*> variables;
  int columns = 0;
  for (const FeatureId id : ids) {
    variables.push_back(&impl_->blocks[id]);
    columns += variables.back()->feature->type->size;
  }
  if (neighbours.empty() && !is_tied && !variables.empty()) {
    // Nothing around them holds these features: the gauge is theirs.
    const auto lowest = std::min_element(
        variables.begin(), variables.end(), [](const Block* a, const Block* b) {
          return a->feature->level < b->feature->level;
        });
    problem.SetParameterBlockConstant((*lowest)->feature->data());
    columns -= (*lowest)->feature->type->size;
    variables.erase(lowest);
  }
  return impl_->Solve(&problem, variables, static_cast<int>(constraints.size()),
                      rows, columns, /*num_threads=*/1,
                      impl_->options.function_tolerance,
                      impl_->options.initial_trust_region_radius,
                      /*is_coarse=*/false, watch);
}

void SolverSession::SetStop(std::function<bool()> stop) {
  impl_->stop = std::move(stop);
}

double SolverSession::SquaredResidual(const Constraint& constraint) const {
  return impl_->SquaredResidual(constraint);
}

Eigen::VectorXd SolverSession::Error(const Constraint& constraint) const {
  return ErrorOf(*impl_->graph, constraint);
}

double SolverSession::Delta(const Constraint& constraint) const {
  return impl_->Delta(constraint);
}

LinearizedConstraint SolverSession::Linearize(
    const Constraint& constraint) const {
  return impl_->Linearize(constraint);
}

double SolverSession::UpdateDeltas(const std::vector<FeatureId>* features) {
  double change = 0.0;
  if (features == nullptr) {
    for (Constraint* constraint : impl_->graph->MutableConstraints()) {
      change = std::max(change, impl_->UpdateDelta(constraint));
    }
    return change;
  }
  for (const ConstraintId id : impl_->LiveConstraintsOn(*features)) {
    change =
        std::max(change, impl_->UpdateDelta(impl_->graph->FindConstraint(id)));
  }
  return change;
}

CostReport SolverSession::Cost(const std::vector<FeatureId>* features) const {
  CostReport report;
  const auto add = [&report](const CostReport& share) {
    report.measurement += share.measurement;
    report.structure += share.structure;
  };
  if (features == nullptr) {
    const auto constraints = std::as_const(*impl_->graph).Constraints();
    std::vector<CostReport> shares(constraints.size());
    ParallelFor((constraints.size() + kCostsAtOnce - 1) / kCostsAtOnce,
                impl_->options.num_threads, [&](std::size_t part) {
                  const std::size_t end =
                      std::min(constraints.size(), (part + 1) * kCostsAtOnce);
                  for (std::size_t k = part * kCostsAtOnce; k < end; ++k) {
                    shares[k] = impl_->CostOf(*constraints[k]);
                  }
                });
    for (const CostReport& share : shares) add(share);
    return report;
  }
  for (const ConstraintId id : impl_->LiveConstraintsOn(*features)) {
    add(impl_->CostOf(*impl_->graph->FindConstraint(id)));
  }
  return report;
}

const SessionOptions& SolverSession::options() const { return impl_->options; }
const SolveReport& SolverSession::totals() const { return impl_->totals; }
int SolverSession::num_solves() const { return impl_->num_solves; }

void SolverSession::OnFeatureAdded(const Feature& feature) {
  impl_->AddFeature(&impl_->graph->GetFeature(feature.id));
}

void SolverSession::OnFeatureRemoved(const Feature& feature) {
  impl_->blocks[feature.id] = Block();
  impl_->has_gauge = false;
  if (impl_->resident != nullptr) impl_->resident->Forget();
}

void SolverSession::OnConstraintAdded(const Constraint& constraint) {
  impl_->AddConstraint(constraint);
  if (constraint.state == ConstraintState::kLive) {
    impl_->AddResidual(constraint);
  }
}

void SolverSession::OnConstraintChanged(const Constraint& constraint) {
  Residual& residual = impl_->ResidualOf(constraint.id);
  std::unique_ptr<ceres::CostFunction> cost = impl_->MakeCost(constraint);
  residual.degrees_of_freedom = kUnknownRank;
  if (residual.replaceable != nullptr) {
    residual.replaceable->Replace(std::move(cost));
    return;
  }
  auto replaceable = std::make_unique<ReplaceableCost>(std::move(cost));
  const bool is_live = residual.id != nullptr;
  const bool had_gauge = impl_->has_gauge;
  const bool had_changed_blocks =
      std::exchange(impl_->changes.parameter_blocks, false);
  if (is_live) impl_->RemoveResidual(constraint);
  residual.replaceable = replaceable.get();
  residual.cost = std::move(replaceable);
  if (is_live) impl_->AddResidual(constraint);
  // It ties what it tied before.
  if (!impl_->changes.parameter_blocks) impl_->has_gauge = had_gauge;
  impl_->changes.parameter_blocks |= had_changed_blocks;
}

void SolverSession::OnConstraintRetired(const Constraint& constraint) {
  const Residual* residual = impl_->residuals[constraint.id].get();
  if (residual != nullptr && residual->id != nullptr) {
    impl_->RemoveResidual(constraint);
  }
  // Broken ones keep their cost: what they would say is asked for later.
  if (impl_->graph->FindConstraint(constraint.id) == nullptr) {
    impl_->residuals[constraint.id].reset();
  }
}

}  // namespace plumbline
