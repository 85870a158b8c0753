#include <ceres/ceres.h>
#include <gtest/gtest.h>
#include <plumbline/core/resident_minimizer.h>
#include <plumbline/factors/dcs_loss.h>
#include <plumbline/factors/delta_loss.h>
#include <plumbline/factors/geman_mcclure_loss.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <vector>

namespace plumbline {
namespace {

using Pose = std::array<double, 3>;

struct Step {
  Pose expected;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    const T c = cos(a[2]);
    const T s = sin(a[2]);
    const T dx = b[0] - a[0];
    const T dy = b[1] - a[1];
    residual[0] = c * dx + s * dy - expected[0];
    residual[1] = -s * dx + c * dy - expected[1];
    residual[2] = 3.0 * (b[2] - a[2] - expected[2]);
    return true;
  }
};

// Says where a pose is along x and y.
struct Position {
  double x, y;

  template <typename T>
  bool operator()(const T* a, T* residual) const {
    residual[0] = 0.3 * (a[0] - x);
    residual[1] = 0.3 * (a[1] - y);
    return true;
  }
};

struct Curve {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = 10.0 * (x[1] - x[0] * x[0]);
    residual[1] = 1.0 - x[0];
    return true;
  }
};

// A residual that becomes steep at 1, beside one that is always 10.
struct Kink {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = x[0] > 1.0 ? 1000.0 * (x[0] - 1.0) + 1.0 : x[0];
    residual[1] = T(10.0);
    return true;
  }
};

// A ring of poses with chords, its measurements off by noise and some by far.
class Ring {
 public:
  explicit Ring(int count, std::function<ceres::LossFunction*()> loss = {},
                bool holds_gauge = true)
      : loss_(std::move(loss)), poses(count) {
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 0.05);
    std::vector<Pose> truth(count);
    for (int i = 0; i < count; ++i) {
      const double angle = 2.0 * M_PI * i / count;
      truth[i] = {5.0 * std::cos(angle), 5.0 * std::sin(angle), angle};
      for (int k = 0; k < 3; ++k) {
        poses[i][k] = truth[i][k] + (i == 0 ? 0.0 : noise(random));
      }
    }
    for (int i = 0; i < count; ++i) {
      problem.AddParameterBlock(poses[i].data(), 3);
    }
    for (const int far : {1, 2, 5}) {
      for (int i = 0; i + far < count; ++i) {
        const Pose& a = truth[i];
        const Pose& b = truth[i + far];
        const double c = std::cos(a[2]), s = std::sin(a[2]);
        const double dx = b[0] - a[0], dy = b[1] - a[1];
        Step step{{c * dx + s * dy + noise(random),
                   -s * dx + c * dy + noise(random),
                   b[2] - a[2] + 0.3 * noise(random)}};
        if (far == 5 && i % 7 == 0) step.expected[0] += 2.0;
        Add(step, i, i + far);
      }
    }
    if (holds_gauge) problem.SetParameterBlockConstant(poses[0].data());
  }

  ceres::ResidualBlockId Add(const Step& step, int a, int b) {
    return problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Step, 3, 3, 3>(new Step(step)),
        loss_ ? loss_() : nullptr, poses[a].data(), poses[b].data());
  }

  static ceres::Problem::Options FastRemoval() {
    ceres::Problem::Options options;
    options.enable_fast_removal = true;
    return options;
  }

 private:
  std::function<ceres::LossFunction*()> loss_;

 public:
  std::vector<Pose> poses;
  ceres::Problem problem{FastRemoval()};
};

ceres::Solver::Options Tight() {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.function_tolerance = 1e-15;
  options.gradient_tolerance = 1e-13;
  options.parameter_tolerance = 1e-14;
  options.max_num_iterations = 200;
  options.initial_trust_region_radius = 1e10;
  options.logging_type = ceres::SILENT;
  return options;
}

void ExpectSameMinimum(Ring* ours, Ring* ceres_ring,
                       const ceres::Solver::Options& options = Tight()) {
  ceres::Solver::Summary expected, summary;
  ceres::Solve(options, &ceres_ring->problem, &expected);
  ResidentMinimizer(&ours->problem).Solve(options, &summary);
  ASSERT_TRUE(expected.IsSolutionUsable()) << expected.message;
  ASSERT_TRUE(summary.IsSolutionUsable()) << summary.message;
  EXPECT_NEAR(summary.initial_cost, expected.initial_cost,
              1e-12 * expected.initial_cost);
  EXPECT_NEAR(summary.final_cost, expected.final_cost,
              1e-9 * expected.final_cost);
  for (std::size_t i = 0; i < ours->poses.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(ours->poses[i][k], ceres_ring->poses[i][k], 1e-6);
    }
  }
  double cost = 0.0;
  ours->problem.Evaluate({}, &cost, nullptr, nullptr, nullptr);
  EXPECT_NEAR(summary.final_cost, cost, 1e-12 * cost);
}

TEST(ResidentMinimizerTest, ComesToTheMinimumOfCeres) {
  Ring a(40), b(40);
  ExpectSameMinimum(&a, &b);
}

TEST(ResidentMinimizerTest, TakesTheStepsOfCeres) {
  Ring a(40), b(40);
  ceres::Solver::Options options = Tight();
  options.function_tolerance = 1e-8;
  options.initial_trust_region_radius = 1.0;
  ceres::Solver::Summary expected, summary;
  ceres::Solve(options, &b.problem, &expected);
  ResidentMinimizer(&a.problem).Solve(options, &summary);
  // The last one finds out that nothing is left.
  EXPECT_EQ(summary.num_linear_solves, expected.num_linear_solves - 1);
  EXPECT_EQ(summary.termination_type, expected.termination_type);
  ASSERT_EQ(summary.iterations.size(), expected.iterations.size());
  for (std::size_t i = 0; i < summary.iterations.size(); ++i) {
    EXPECT_NEAR(summary.iterations[i].cost, expected.iterations[i].cost,
                1e-9 * expected.iterations[i].cost);
    EXPECT_NEAR(summary.iterations[i].trust_region_radius,
                expected.iterations[i].trust_region_radius,
                1e-6 * expected.iterations[i].trust_region_radius);
  }
}

// The first step, from where the residual is steep, leads to where it is not:
// by the matrix of before next to nothing would be left, which is one part in a
// hundred of the cost.
TEST(ResidentMinimizerTest, AStepThatBrokeItsPromiseIsNotTheLast) {
  double x = 1.0005;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Kink, 2, 1>(new Kink), nullptr, &x);
  ceres::Solver::Options options = Tight();
  options.function_tolerance = 1e-6;
  ceres::Solver::Summary summary;
  ResidentMinimizer(&problem).Solve(options, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(x, 0.0, 1e-6);
  EXPECT_NEAR(summary.final_cost, 50.0, 1e-9);
}

TEST(ResidentMinimizerTest, ComesToTheMinimumOfCeresWithEveryLoss) {
  const std::vector<std::function<ceres::LossFunction*()>> losses = {
      [] { return new ceres::HuberLoss(0.1); },
      [] { return new ceres::CauchyLoss(0.2); },
      [] { return new ceres::SoftLOneLoss(0.2); },
      [] { return new ceres::ArctanLoss(2.0); },
      [] { return new ceres::TolerantLoss(0.3, 0.1); },
      [] { return new ceres::TukeyLoss(3.0); },
      [] {
        return new ceres::ScaledLoss(nullptr, 0.25, ceres::TAKE_OWNERSHIP);
      },
      [] { return new DcsLoss(3.0); },
      [] { return new GemanMcClureLoss(3.0); },
      [] { return new ContinuousDeltaLoss(3); }};
  for (std::size_t i = 0; i < losses.size(); ++i) {
    SCOPED_TRACE(i);
    Ring a(40, losses[i]), b(40, losses[i]);
    ExpectSameMinimum(&a, &b);
  }
}

TEST(ResidentMinimizerTest, ManifoldsAndConstantBlocksAreThoseOfTheProblem) {
  Ring a(30), b(30);
  for (Ring* ring : {&a, &b}) {
    // One pose moves along y and turns only, one not at all.
    ring->problem.SetManifold(ring->poses[4].data(),
                              new ceres::SubsetManifold(3, {0}));
    ring->problem.SetManifold(ring->poses[9].data(),
                              new ceres::SubsetManifold(3, {0, 1, 2}));
    ring->problem.SetParameterBlockConstant(ring->poses[12].data());
  }
  const double x = a.poses[4][0];
  const Pose nine = a.poses[9];
  ExpectSameMinimum(&a, &b);
  EXPECT_EQ(a.poses[4][0], x);
  EXPECT_EQ(a.poses[9], nine);
}

TEST(ResidentMinimizerTest, UndeterminedDirectionsStayWhereTheyAre) {
  // No gauge: cost and shape are determined, the place is not.
  Ring a(25, {}, /*holds_gauge=*/false), b(25, {}, /*holds_gauge=*/false);
  ceres::Solver::Summary expected, summary;
  ceres::Solve(Tight(), &b.problem, &expected);
  ResidentMinimizer(&a.problem).Solve(Tight(), &summary);
  ASSERT_TRUE(summary.IsSolutionUsable()) << summary.message;
  EXPECT_NEAR(summary.final_cost, expected.final_cost,
              1e-9 * expected.final_cost);
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(a.poses[i][k], b.poses[i][k], 1e-3);
    }
  }
}

TEST(ResidentMinimizerTest, ABlockThatNothingDeterminesAlongAnAxisStaysThere) {
  Pose pose = {1.0, 2.0, 0.7};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Position, 2, 3>(new Position{4.0, -1.0}),
      nullptr, pose.data());
  ceres::Solver::Summary summary;
  ResidentMinimizer(&problem).Solve(Tight(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(pose[0], 4.0, 1e-9);
  EXPECT_NEAR(pose[1], -1.0, 1e-9);
  EXPECT_EQ(pose[2], 0.7);
}

TEST(ResidentMinimizerTest, KeepsTheAnalysisWhileConstraintsComeAndGo) {
  Ring a(60);
  ResidentMinimizer minimizer(&a.problem);
  ceres::Solver::Summary summary;
  minimizer.Solve(Tight(), &summary);
  EXPECT_EQ(minimizer.num_analyses(), 1);
  std::vector<ceres::ResidualBlockId> ids;
  a.problem.GetResidualBlocks(&ids);
  // Gone: chords of two. Again: between poses that have another in common.
  for (int i = 60; i < 110; i += 9) a.problem.RemoveResidualBlock(ids[i]);
  a.Add({{0.5, 0.0, 0.1}}, 3, 4);
  a.Add({{1.0, 0.1, 0.2}}, 12, 10);
  Ring copy(60);
  for (std::size_t i = 0; i < copy.poses.size(); ++i) {
    copy.poses[i] = a.poses[i];
  }
  copy.problem.GetResidualBlocks(&ids);
  for (int i = 60; i < 110; i += 9) copy.problem.RemoveResidualBlock(ids[i]);
  copy.Add({{0.5, 0.0, 0.1}}, 3, 4);
  copy.Add({{1.0, 0.1, 0.2}}, 12, 10);
  ceres::Solver::Summary expected;
  ceres::Solve(Tight(), &copy.problem, &expected);
  minimizer.Solve(Tight(), &summary);
  EXPECT_EQ(minimizer.num_analyses(), 1);
  EXPECT_NEAR(summary.final_cost, expected.final_cost,
              1e-9 * expected.final_cost);
  // A pair that had nothing in common needs a new one.
  a.Add({{0.0, 0.0, 0.0}}, 3, 40);
  copy.Add({{0.0, 0.0, 0.0}}, 3, 40);
  ceres::Solve(Tight(), &copy.problem, &expected);
  minimizer.Solve(Tight(), &summary);
  EXPECT_EQ(minimizer.num_analyses(), 2);
  EXPECT_NEAR(summary.final_cost, expected.final_cost,
              1e-9 * expected.final_cost);
  // So do variables that go.
  a.problem.SetParameterBlockConstant(a.poses[7].data());
  copy.problem.SetParameterBlockConstant(copy.poses[7].data());
  ceres::Solve(Tight(), &copy.problem, &expected);
  minimizer.Solve(Tight(), &summary);
  EXPECT_EQ(minimizer.num_analyses(), 3);
  EXPECT_NEAR(summary.final_cost, expected.final_cost,
              1e-9 * expected.final_cost);
}

// Of two rings that change in the same way the one is told what changed, the
// other finds it out.
TEST(ResidentMinimizerTest, WhatIsToldOfChangesIsWhatIsFoundOut) {
  Ring told(60), found(60);
  ResidentMinimizer told_minimizer(&told.problem,
                                   /*may_have_bounds=*/false);
  ResidentMinimizer found_minimizer(&found.problem);
  ProblemChanges changes;
  const auto solve = [&] {
    ceres::Solver::Summary summary, expected;
    told_minimizer.Solve(Tight(), &summary,
                         ResidentMinimizer::Damping::kAsGiven, &changes);
    found_minimizer.Solve(Tight(), &expected);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    EXPECT_EQ(summary.num_linear_solves, expected.num_linear_solves);
    EXPECT_EQ(summary.final_cost, expected.final_cost);
    EXPECT_EQ(told.poses, found.poses);
    EXPECT_EQ(told_minimizer.num_analyses(), found_minimizer.num_analyses());
    changes = {false, {}};
  };
  const auto add = [&](const Step& step, int a, int b) {
    changes.added.push_back(told.Add(step, a, b));
    found.Add(step, a, b);
  };
  const auto remove = [&](std::size_t index) {
    for (Ring* const ring : {&told, &found}) {
      std::vector<ceres::ResidualBlockId> ids;
      ring->problem.GetResidualBlocks(&ids);
      ring->problem.RemoveResidualBlock(ids[index]);
    }
  };
  solve();
  // Nothing but values.
  for (Ring* const ring : {&told, &found}) ring->poses[9][1] += 0.2;
  solve();
  // Those that went make room for those that come: some of these are likely to
  // have the address of one that was there.
  for (const std::size_t index : {70u, 90u, 75u, 3u, 20u}) {
    remove(index);
    add({{0.9, 0.1, 0.2}}, 12, 10);
    add({{0.4, 0.0, 0.1}}, 30, 31);
    solve();
  }
  add({{0.5, 0.0, 0.1}}, 3, 4);
  remove(100);
  solve();
  // A pair that had nothing in common.
  add({{0.0, 0.0, 0.0}}, 3, 40);
  solve();
  // One that no longer varies.
  for (Ring* const ring : {&told, &found}) {
    ring->problem.SetParameterBlockConstant(ring->poses[7].data());
  }
  changes.parameter_blocks = true;
  solve();
  EXPECT_EQ(told_minimizer.num_analyses(), 3);
  remove(5);
  solve();
}

// Options that are refused: what has changed by then is told once, and is not
// lost.
TEST(ResidentMinimizerTest, WhatIsToldWithARefusedSolveIsNotLost) {
  Ring ring(60);
  ResidentMinimizer minimizer(&ring.problem);
  ceres::Solver::Summary summary;
  minimizer.Solve(Tight(), &summary);
  ring.problem.SetParameterBlockConstant(ring.poses[7].data());
  const Pose held = ring.poses[7];
  ring.poses[8][0] += 0.5;
  ceres::Solver::Options refused = Tight();
  refused.function_tolerance = -1.0;
  ProblemChanges changes;
  minimizer.Solve(refused, &summary, ResidentMinimizer::Damping::kAsGiven,
                  &changes);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  changes = {false, {}};
  minimizer.Solve(Tight(), &summary, ResidentMinimizer::Damping::kAsGiven,
                  &changes);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(ring.poses[7], held);
}

// Where the parameters lie in memory changes from run to run.
TEST(ResidentMinimizerTest, TheSameBytesWhereverTheParametersLie) {
  constexpr int kPoses = 80;
  const auto solve = [](bool backwards) {
    std::vector<Pose> memory(kPoses);
    std::vector<double*> poses;
    for (int i = 0; i < kPoses; ++i) {
      poses.push_back(memory[backwards ? kPoses - 1 - i : i].data());
      poses[i][0] = i + 0.1 * std::sin(7.0 * i);
      poses[i][1] = 0.1 * std::cos(5.0 * i);
      poses[i][2] = 0.1 * std::sin(3.0 * i);
    }
    ceres::Problem problem;
    const auto add = [&](int from, int to) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Step, 3, 3, 3>(
              new Step{Pose{1.0 * (to - from), 0.01 * (from % 3), 0.0}}),
          nullptr, poses[from], poses[to]);
    };
    for (int i = 1; i < kPoses; ++i) add(i - 1, i);
    for (int i = 9; i < kPoses; i += 4) add(i - 9, i);
    problem.SetParameterBlockConstant(poses[0]);
    ResidentMinimizer minimizer(&problem);
    ceres::Solver::Summary summary;
    minimizer.Solve(Tight(), &summary);
    // A constraint less moves others in the problem.
    std::vector<ceres::ResidualBlockId> ids;
    problem.GetResidualBlocks(&ids);
    problem.RemoveResidualBlock(ids[85]);
    minimizer.Solve(Tight(), &summary);
    EXPECT_EQ(minimizer.num_analyses(), 1);
    // Another pair that had nothing in common.
    add(3, 70);
    minimizer.Solve(Tight(), &summary);
    std::vector<double> result;
    for (const double* const pose : poses) {
      result.insert(result.end(), pose, pose + 3);
    }
    return result;
  };
  EXPECT_EQ(solve(false), solve(true));
}

TEST(ResidentMinimizerTest, AnalysesAnewWhatItWasToldToForget) {
  Ring ring(60);
  ResidentMinimizer minimizer(&ring.problem);
  ceres::Solver::Summary summary;
  minimizer.Solve(Tight(), &summary);
  minimizer.Forget();
  minimizer.Solve(Tight(), &summary);
  minimizer.Solve(Tight(), &summary);
  EXPECT_EQ(minimizer.num_analyses(), 2);
}

TEST(ResidentMinimizerTest, UphillStepsEndAtTheBestState) {
  // Along the bottom of a curved valley a bound on the cost of every step is
  // what takes long.
  const auto solve = [](int uphill, int* steps) {
    std::array<double, 2> x = {-1.9, 2.0};
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Curve, 2, 2>(new Curve), nullptr,
        x.data());
    ceres::Solver::Options options = Tight();
    options.use_nonmonotonic_steps = uphill > 0;
    options.max_consecutive_nonmonotonic_steps = std::max(1, uphill);
    ceres::Solver::Summary summary;
    ResidentMinimizer(&problem).Solve(options, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    EXPECT_NEAR(x[0], 1.0, 1e-6);
    EXPECT_NEAR(x[1], 1.0, 1e-6);
    *steps = summary.num_linear_solves;
  };
  int monotonic = 0, uphill = 0;
  solve(0, &monotonic);
  solve(3, &uphill);
  EXPECT_LT(uphill, monotonic);

  // Ended on the way up, it gives back the best state.
  std::array<double, 2> x = {-1.9, 3.61};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Curve, 2, 2>(new Curve), nullptr,
      x.data());
  for (int most = 0; most < 12; ++most) {
    x = {-1.9, 2.0};
    ceres::Solver::Options options = Tight();
    options.use_nonmonotonic_steps = true;
    options.max_consecutive_nonmonotonic_steps = 3;
    options.max_num_iterations = most;
    ceres::Solver::Summary summary;
    ResidentMinimizer(&problem).Solve(options, &summary);
    double cost = 0.0;
    problem.Evaluate({}, &cost, nullptr, nullptr, nullptr);
    EXPECT_NEAR(cost, summary.final_cost, 1e-12 * (1.0 + cost));
    for (const ceres::IterationSummary& step : summary.iterations) {
      if (step.iteration == 0 || step.step_is_successful) {
        EXPECT_LE(summary.final_cost, step.cost * (1.0 + 1e-12));
      }
    }
  }
}

// The end of a lever that turns: the linear step leaves the circle, and costs
// more than staying; the one after it is right.
struct Lever {
  template <typename T>
  bool operator()(const T* const x, T* residual) const {
    using std::cos;
    using std::sin;
    residual[0] = 2.0 * (x[0] - 3.0 * sin(x[1]));
    residual[1] = 2.0 * (x[2] - 3.0 * (1.0 - cos(x[1])));
    residual[2] = x[1] - 0.8;
    residual[3] = T(3.0);
    return true;
  }
};

TEST(ResidentMinimizerTest, AStepUphillMayBeMadeUpFor) {
  const auto solve = [](bool uphill, ceres::Solver::Summary* summary) {
    std::array<double, 3> x = {0.0, 0.0, 0.0};
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Lever, 4, 3>(new Lever), nullptr,
        x.data());
    ceres::Solver::Options options = Tight();
    options.use_nonmonotonic_steps = uphill;
    options.max_consecutive_nonmonotonic_steps = 3;
    ResidentMinimizer(&problem).Solve(options, summary);
    EXPECT_NEAR(x[1], 0.8, 1e-6);
    EXPECT_NEAR(summary->final_cost, 4.5, 1e-9);
  };
  ceres::Solver::Summary monotonic, uphill;
  solve(false, &monotonic);
  solve(true, &uphill);
  EXPECT_LT(uphill.num_linear_solves, monotonic.num_linear_solves);
  bool has_gone_up = false;
  for (const ceres::IterationSummary& step : uphill.iterations) {
    has_gone_up = has_gone_up || step.cost > uphill.initial_cost;
  }
  EXPECT_TRUE(has_gone_up);
}

// -- Damping ------------------------------------------------------------------

struct ChainLink {
  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    residual[0] = b[0] - a[0] - 1.0;
    return true;
  }
};

TEST(ResidentMinimizerTest, WhatIsTiedWeaklyIsNotHeldBack) {
  // The far end of a chain without a closure: damping by 1e-4 of the diagonal
  // takes many steps to bring it home.
  const auto solve = [](ResidentMinimizer::Damping damping,
                        ceres::Solver::Summary* summary) {
    constexpr int kLength = 300;
    std::vector<std::array<double, 1>> x(kLength);
    ceres::Problem problem;
    for (int i = 0; i + 1 < kLength; ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ChainLink, 1, 1, 1>(new ChainLink),
          nullptr, x[i].data(), x[i + 1].data());
    }
    problem.SetParameterBlockConstant(x[0].data());
    ceres::Solver::Options options = Tight();
    options.initial_trust_region_radius = 1e4;
    options.max_trust_region_radius = 1e16;
    ResidentMinimizer(&problem).Solve(options, summary, damping);
    EXPECT_NEAR(x[kLength - 1][0], kLength - 1.0, 1e-6);
  };
  ceres::Solver::Summary given, needed;
  solve(ResidentMinimizer::Damping::kAsGiven, &given);
  solve(ResidentMinimizer::Damping::kWhereNeeded, &needed);
  EXPECT_LE(needed.num_linear_solves, 2);
  EXPECT_GT(given.num_linear_solves, 4);
}

TEST(ResidentMinimizerTest, WhatIsUndeterminedIsDampedAsGiven) {
  // Nothing holds the ring in the plane: its place is undetermined.
  Ring ring(40, nullptr, /*holds_gauge=*/false);
  const std::vector<Pose> before = ring.poses;
  ceres::Solver::Summary summary;
  ResidentMinimizer(&ring.problem)
      .Solve(Tight(), &summary, ResidentMinimizer::Damping::kWhereNeeded);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
  ASSERT_GT(summary.iterations.size(), 1u);
  EXPECT_LT(summary.iterations[1].trust_region_radius, 1e13);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR(ring.poses[i][0], before[i][0], 1.0);
    EXPECT_NEAR(ring.poses[i][1], before[i][1], 1.0);
  }
}

// -- Reasons to stop ----------------------------------------------------------

class CountAndAnswer final : public ceres::IterationCallback {
 public:
  CountAndAnswer(int at, ceres::CallbackReturnType answer)
      : at_(at), answer_(answer) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& step) override {
    ++calls;
    return step.iteration == at_ ? answer_ : ceres::SOLVER_CONTINUE;
  }
  int calls = 0;

 private:
  int at_;
  ceres::CallbackReturnType answer_;
};

TEST(ResidentMinimizerTest, StopsForEveryReasonThatCeresHas) {
  struct Case {
    const char* name;
    std::function<void(ceres::Solver::Options*)> change;
  };
  const std::vector<Case> cases = {
      {"function", [](auto* o) { o->function_tolerance = 1e-3; }},
      {"gradient", [](auto* o) { o->gradient_tolerance = 1e-2; }},
      {"parameter", [](auto* o) { o->parameter_tolerance = 1e-2; }},
      {"iterations", [](auto* o) { o->max_num_iterations = 2; }},
      {"no iterations", [](auto* o) { o->max_num_iterations = 0; }},
      {"time", [](auto* o) { o->max_solver_time_in_seconds = 0.0; }},
      {"radius",
       [](auto* o) {
         o->initial_trust_region_radius = 1e-32;
         o->min_trust_region_radius = 1e-32;
       }},
      {"options", [](auto* o) { o->function_tolerance = -1.0; }}};
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    Ring a(40), b(40);
    ceres::Solver::Options options = Tight();
    one.change(&options);
    ceres::Solver::Summary expected, summary;
    ceres::Solve(options, &b.problem, &expected);
    ResidentMinimizer(&a.problem).Solve(options, &summary);
    EXPECT_EQ(summary.termination_type, expected.termination_type)
        << summary.message << " / " << expected.message;
    if (expected.IsSolutionUsable()) {
      EXPECT_NEAR(summary.final_cost, expected.final_cost,
                  1e-9 * expected.final_cost);
    }
    EXPECT_EQ(summary.iterations.size(), expected.iterations.size())
        << summary.message << " / " << expected.message;
  }
}

TEST(ResidentMinimizerTest, CallbacksEndASolve) {
  for (const auto answer :
       {ceres::SOLVER_TERMINATE_SUCCESSFULLY, ceres::SOLVER_ABORT}) {
    Ring a(40), b(40);
    const std::vector<Pose> before = a.poses;
    ceres::Solver::Options options = Tight();
    CountAndAnswer ours(2, answer), theirs(2, answer);
    ceres::Solver::Summary expected, summary;
    options.callbacks = {&theirs};
    ceres::Solve(options, &b.problem, &expected);
    options.callbacks = {&ours};
    ResidentMinimizer(&a.problem).Solve(options, &summary);
    EXPECT_EQ(summary.termination_type, expected.termination_type);
    EXPECT_EQ(ours.calls, theirs.calls);
    EXPECT_EQ(summary.IsSolutionUsable(), expected.IsSolutionUsable());
    if (answer == ceres::SOLVER_ABORT) {
      EXPECT_EQ(a.poses, before);
    }
  }
}

// Evaluates nothing from its n-th call on.
struct Fails {
  int* calls_left;

  bool operator()(const double* x, double* residual) const {
    residual[0] = x[0] - 3.0;
    return (*calls_left)-- > 0;
  }
};

TEST(ResidentMinimizerTest, AFailureLeavesTheParameters) {
  double x = 1.0;
  int calls_left = 0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::NumericDiffCostFunction<Fails, ceres::CENTRAL, 1, 1>(
          new Fails{&calls_left}),
      nullptr, &x);
  ceres::Solver::Summary summary;
  ResidentMinimizer(&problem).Solve(Tight(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_FALSE(summary.message.empty());
  EXPECT_EQ(x, 1.0);
  calls_left = 1000;
  ResidentMinimizer(&problem).Solve(Tight(), &summary);
  EXPECT_TRUE(summary.IsSolutionUsable()) << summary.message;
  EXPECT_NEAR(x, 3.0, 1e-9);
}

struct NotFinite {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = x[0] / T(0.0);
    return true;
  }
};

TEST(ResidentMinimizerTest, AResidualThatIsNoNumberIsAFailure) {
  double x = 1.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<NotFinite, 1, 1>(new NotFinite), nullptr,
      &x);
  ceres::Solver::Summary summary;
  ResidentMinimizer(&problem).Solve(Tight(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(x, 1.0);
}

// So many terms that several threads evaluate them, in more than one go.
constexpr int kManyPoses = 7000;

TEST(ResidentMinimizerTest, TheSameBytesWithAnyNumberOfThreads) {
  const auto loss = [] { return new ceres::CauchyLoss(0.3); };
  std::vector<Pose> poses;
  std::vector<double> costs;
  for (const int num_threads : {1, 2, 3}) {
    Ring a(kManyPoses, loss);
    ceres::Solver::Options options = Tight();
    options.max_num_iterations = 6;
    options.num_threads = num_threads;
    ResidentMinimizer minimizer(&a.problem);
    std::vector<double> own_costs;
    for (int solve = 0; solve < 2; ++solve) {
      ceres::Solver::Summary summary;
      minimizer.Solve(options, &summary);
      ASSERT_TRUE(summary.IsSolutionUsable()) << summary.message;
      own_costs.push_back(summary.initial_cost);
      own_costs.push_back(summary.final_cost);
      // What comes between two that had nothing in common is analysed anew.
      a.Add({{0.1, 5.0, 0.5}}, 3, kManyPoses / 2);
    }
    EXPECT_EQ(minimizer.num_analyses(), 2);
    EXPECT_LT(own_costs[1], 0.5 * own_costs[0]);
    if (num_threads == 1) {
      poses = a.poses;
      costs = own_costs;
    }
    EXPECT_EQ(a.poses, poses) << num_threads;
    EXPECT_EQ(own_costs, costs) << num_threads;
  }
}

TEST(ResidentMinimizerTest, WhatCannotBeEvaluatedIsAFailureWithSeveralThreads) {
  Ring a(kManyPoses);
  double x = 1.0;
  a.problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<NotFinite, 1, 1>(new NotFinite), nullptr,
      &x);
  const std::vector<Pose> before = a.poses;
  ceres::Solver::Options options = Tight();
  options.num_threads = 3;
  ceres::Solver::Summary summary;
  ResidentMinimizer minimizer(&a.problem);
  minimizer.Solve(options, &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(a.poses, before);
  // Taken away, the rest is solved.
  a.problem.RemoveParameterBlock(&x);
  minimizer.Forget();
  minimizer.Solve(options, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
}

TEST(ResidentMinimizerTest, BoundsAreRefused) {
  Ring a(10);
  a.problem.SetParameterLowerBound(a.poses[3].data(), 0, -1.0);
  const std::vector<Pose> before = a.poses;
  ceres::Solver::Summary summary;
  ResidentMinimizer(&a.problem).Solve(Tight(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(a.poses, before);
}

TEST(ResidentMinimizerTest, NothingToSolveIsSolved) {
  ceres::Problem empty;
  ceres::Solver::Summary summary;
  ResidentMinimizer(&empty).Solve(Tight(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  Ring a(10);
  for (Pose& pose : a.poses) a.problem.SetParameterBlockConstant(pose.data());
  double cost = 0.0;
  a.problem.Evaluate({}, &cost, nullptr, nullptr, nullptr);
  ResidentMinimizer(&a.problem).Solve(Tight(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(summary.final_cost, cost, 1e-12 * cost);
}

}  // namespace
}  // namespace plumbline
