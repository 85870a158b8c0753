#ifndef PLUMBLINE_TEST_FACTORS_FACTORS_TEST_UTIL_H_
#define PLUMBLINE_TEST_FACTORS_FACTORS_TEST_UTIL_H_

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <gtest/gtest.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <vector>

namespace plumbline::testing {

/// Reproducible random numbers on every platform.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  double Uniform(double low, double high) {
    constexpr double kUnit = 1.0 / 9007199254740992.0;  // 2^-53
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * kUnit);
  }

 private:
  std::mt19937_64 engine_;
};

/// Square roots of information without symmetries that could hide an error.
inline Eigen::Matrix2d Weight2() {
  Eigen::Matrix2d weight;
  weight << 2.0, 1.0,  //
      0.0, 3.0;
  return weight;
}
inline Eigen::Matrix3d Weight3() {
  Eigen::Matrix3d weight;
  weight << 2.0, 1.0, 0.5,  //
      0.0, 3.0, -1.0,       //
      0.0, 0.0, 4.0;
  return weight;
}

using Block = std::vector<double>;

/// Residuals and Jacobians (rows x block size) of a cost function.
struct Evaluation {
  Eigen::VectorXd residual;
  std::vector<Eigen::MatrixXd> jacobians;
};

inline Evaluation Evaluate(const ceres::CostFunction& cost,
                           const std::vector<Block>& blocks) {
  using RowMajor =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  std::vector<const double*> parameters;
  std::vector<std::vector<double>> storage;
  std::vector<double*> jacobians;
  EXPECT_EQ(cost.parameter_block_sizes().size(), blocks.size());
  for (const Block& block : blocks) {
    parameters.push_back(block.data());
    storage.emplace_back(cost.num_residuals() * block.size(),
                         std::numeric_limits<double>::quiet_NaN());
  }
  for (auto& values : storage) jacobians.push_back(values.data());
  Evaluation result;
  result.residual.resize(cost.num_residuals());
  EXPECT_TRUE(cost.Evaluate(parameters.data(), result.residual.data(),
                            jacobians.data()));
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    EXPECT_EQ(cost.parameter_block_sizes()[i],
              static_cast<int>(blocks[i].size()));
    result.jacobians.push_back(
        Eigen::Map<RowMajor>(storage[i].data(), cost.num_residuals(),
                             static_cast<Eigen::Index>(blocks[i].size())));
  }
  return result;
}

/// Compares the Jacobians with central differences of the residual. The state
/// must be away from the residual's cuts by more than `step`.
inline void ExpectJacobiansMatchDifferences(const ceres::CostFunction& cost,
                                            const std::vector<Block>& blocks,
                                            double tolerance = 1e-6,
                                            double step = 1e-5) {
  const Evaluation evaluation = Evaluate(cost, blocks);
  ASSERT_TRUE(evaluation.residual.allFinite());
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    ASSERT_TRUE(evaluation.jacobians[b].allFinite()) << "block " << b;
    for (std::size_t p = 0; p < blocks[b].size(); ++p) {
      std::vector<Block> high = blocks;
      std::vector<Block> low = blocks;
      high[b][p] += step;
      low[b][p] -= step;
      const double width = high[b][p] - low[b][p];
      const Eigen::VectorXd difference =
          (Evaluate(cost, high).residual - Evaluate(cost, low).residual) /
          width;
      const Eigen::VectorXd derivative =
          evaluation.jacobians[b].col(static_cast<Eigen::Index>(p));
      const double scale = std::max(1.0, derivative.cwiseAbs().maxCoeff());
      EXPECT_LT((difference - derivative).cwiseAbs().maxCoeff(),
                tolerance * scale)
          << "block " << b << ", parameter " << p << ": differences "
          << difference.transpose() << ", derivatives "
          << derivative.transpose();
    }
  }
}

/// Motions of the whole world for tests of invariance: near, 10 km away, and
/// turned in between.
inline std::vector<Pose2> WorldMotions() {
  return {Pose2(0.5, -0.25, 0.0), Pose2(10000.0, -10000.0, 0.0),
          Pose2(0.0, 0.0, 2.0), Pose2(-10000.0, 7000.0, -3.0)};
}

/// Moves a block that begins with x, y and goes on with entries that no motion
/// changes (points, circles).
inline Block MovePoint(const Pose2& motion, const Block& point) {
  const Eigen::Vector2d moved =
      TransformPoint(motion, Eigen::Vector2d(point[0], point[1]));
  Block result = point;
  result[0] = moved[0];
  result[1] = moved[1];
  return result;
}

/// Moves a pose or segment.
inline Block MovePose(const Pose2& motion, const Block& pose) {
  const Pose2 moved = Compose(motion, Pose2(pose[0], pose[1], pose[2]));
  return {moved[0], moved[1], moved[2]};
}

/// Moves a rectangle (x, y, theta, half_length, half_width).
inline Block MoveRectangle(const Pose2& motion, const Block& rectangle) {
  Block moved = MovePose(motion, rectangle);
  moved.push_back(rectangle[3]);
  moved.push_back(rectangle[4]);
  return moved;
}

/// Moves a line whose anchor is moved with the world.
inline Block MoveLine(const Pose2& motion, const Block& line) {
  return {line[0], NormalizeAngle(line[1] + motion[2])};
}

/// Moves an orientation.
inline Block MoveOrientation(const Pose2& motion, const Block& orientation) {
  return {NormalizeAngle(orientation[0] + motion[2])};
}

/// Checks what Ceres needs of a loss and what a robust kernel promises: at
/// zero it is the identity, finite everywhere, rho' in [0, 1] and falling,
/// never the combination on which Ceres ends the process, and derivatives that
/// agree with differences away from `kink`.
inline void ExpectRobustLoss(const ceres::LossFunction& loss,
                             double kink = -1.0) {
  double rho[3];
  loss.Evaluate(0.0, rho);
  EXPECT_EQ(rho[0], 0.0);
  EXPECT_EQ(rho[1], 1.0);
  EXPECT_LE(rho[2], 0.0);
  EXPECT_TRUE(std::isfinite(rho[2]));

  double last_value = 0.0;
  double last_weight = 1.0;
  const double max = std::numeric_limits<double>::max();
  for (double s : {0.0,    std::numeric_limits<double>::denorm_min(),
                   1e-300, 1e-200,
                   1e-100, 1e-30,
                   1e-16,  1e-10,
                   1e-6,   1e-3,
                   0.01,   0.1,
                   0.357,  0.5,
                   0.9,    0.999,
                   1.0,    1.001,
                   1.5,    1.792,
                   1.999,  2.0,
                   2.001,  2.5,
                   2.999,  3.0,
                   3.5,    4.0,
                   4.5,    5.0,
                   6.0,    7.0,
                   8.0,    9.0,
                   10.0,   20.0,
                   50.0,   100.0,
                   700.0,  1400.0,
                   1500.0, 1e4,
                   1e8,    1e16,
                   1e50,   1e100,
                   1e154,  1e200,
                   1e300,  max}) {
    loss.Evaluate(s, rho);
    for (double value : {rho[0], rho[1], rho[2]}) {
      EXPECT_TRUE(std::isfinite(value)) << "s = " << s;
    }
    EXPECT_GE(rho[0], last_value * (1.0 - 1e-14) - 1e-15) << "s = " << s;
    EXPECT_LE(rho[0], s * (1.0 + 1e-14) + 1e-15) << "s = " << s;
    EXPECT_GE(rho[1], 0.0) << "s = " << s;
    EXPECT_LE(rho[1], last_weight * (1.0 + 1e-14)) << "s = " << s;
    EXPECT_LE(rho[2], 0.0) << "s = " << s;
    last_value = rho[0];
    last_weight = rho[1];
  }

  for (double s : {0.1, 0.357, 0.8, 1.792, 2.6, 4.7, 9.1, 15.0, 30.0, 200.0}) {
    const double step = 1e-4;
    if (std::abs(s - kink) < 10.0 * step) continue;
    double high[3];
    double low[3];
    loss.Evaluate(s, rho);
    loss.Evaluate(s + step, high);
    loss.Evaluate(s - step, low);
    EXPECT_NEAR((high[0] - low[0]) / (2.0 * step), rho[1], 1e-6) << "s = " << s;
    EXPECT_NEAR((high[1] - low[1]) / (2.0 * step), rho[2], 1e-6) << "s = " << s;
  }
}

}  // namespace plumbline::testing

#endif  // PLUMBLINE_TEST_FACTORS_FACTORS_TEST_UTIL_H_
