#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/graduated_delta_loss.h>
#include <plumbline/factors/orientation_orientation.h>

#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

constexpr double kTolerance = DegToRad(0.1);
constexpr double kMeasured = DegToRad(0.5);

TEST(GraduatedDeltaLossTest, IsTheLossOfAWiderTolerance) {
  double widening = 1.0;
  for (const int k : {1, 2, 3}) {
    const GraduatedDeltaLoss loss(k, &widening);
    for (const double residual : {0.0, 0.3, 1.0, 4.0, 60.0}) {
      for (const double c : {1.0, 2.0, 100.0}) {
        widening = c;
        const double s = residual * residual;
        double wide[3];
        ContinuousDeltaLoss(k).Evaluate(s / (c * c), wide);
        double rho[3];
        loss.Evaluate(s, rho);
        EXPECT_DOUBLE_EQ(rho[0], wide[0]);
        // Of s, not of s / c^2.
        EXPECT_NEAR(rho[1] * c * c, wide[1], 1e-12 * wide[1]);
        EXPECT_NEAR(rho[2] * std::pow(c, 4), wide[2],
                    1e-12 * std::abs(wide[2]));
      }
    }
  }
  widening = 1.0;
  testing::ExpectRobustLoss(GraduatedDeltaLoss(2, &widening));
}

TEST(GraduatedDeltaLossTest, RefusesWhatMakesNoSense) {
  double widening = 1.0;
  EXPECT_THROW(GraduatedDeltaLoss(1, nullptr), std::invalid_argument);
  EXPECT_THROW(GraduatedDeltaLoss(0, &widening), std::invalid_argument);
  ceres::Problem problem;
  for (const double first :
       {0.5, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(SolveGraduated({}, first, &problem, &widening),
                 std::invalid_argument);
  }
}

// Walls whose directions were measured to half a degree, and the hypothesis
// that all of them have one direction, to a tenth.
class SharedDirectionTest : public ::testing::Test {
 protected:
  // Makes the problem; directions in degrees.
  void Build(const std::vector<double>& measured, double start,
             bool is_graduated) {
    problem_ = std::make_unique<ceres::Problem>();
    walls_.assign(measured.size(), 0.0);
    direction_ = DegToRad(start);
    problem_->AddParameterBlock(&frame_, 1);
    problem_->SetParameterBlockConstant(&frame_);
    for (std::size_t i = 0; i < measured.size(); ++i) {
      walls_[i] = DegToRad(measured[i]);
      problem_->AddResidualBlock(
          OrientationOrientation::Create(walls_[i], 1.0 / kMeasured), nullptr,
          &frame_, &walls_[i]);
      ceres::LossFunction* loss = nullptr;
      if (is_graduated) {
        loss = new GraduatedDeltaLoss(1, &widening_);
      } else {
        loss = new ContinuousDeltaLoss(1);
      }
      problem_->AddResidualBlock(
          OrientationOrientation::Create(0.0, 1.0 / kTolerance), loss,
          &walls_[i], &direction_);
      problem_->SetManifold(&walls_[i], new AngleManifold);
    }
    problem_->SetManifold(&direction_, new AngleManifold);
  }

  double Wall(std::size_t i) const { return RadToDeg(walls_[i]); }
  double Direction() const { return RadToDeg(direction_); }

  double frame_ = 0.0;
  double direction_ = 0.0;
  std::vector<double> walls_;
  double widening_ = 1.0;
  std::unique_ptr<ceres::Problem> problem_;
};

// What the header of ContinuousDeltaLoss warns of.
TEST_F(SharedDirectionTest, TheNarrowLossStaysWhereItStartsAndSaysConverged) {
  Build({0.3, -0.2, 0.1, -0.2}, 10.0, /*is_graduated=*/false);
  ceres::Solver::Summary summary;
  ceres::Solve({}, problem_.get(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(Direction(), 10.0, 1e-9);
  EXPECT_NEAR(Wall(0), 0.3, 1e-9);
}

TEST_F(SharedDirectionTest, TheNarrowLossWorksFromWithinThreeTolerances) {
  Build({0.05, -0.05, 0.05, -0.05}, 0.3, /*is_graduated=*/false);
  ceres::Solver::Summary summary;
  ceres::Solve({}, problem_.get(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(Direction(), 0.0, 0.01);
}

TEST_F(SharedDirectionTest, TheGraduatedOneComesInFromTenDegrees) {
  Build({0.3, -0.2, 0.1, -0.2}, 10.0, /*is_graduated=*/true);
  const ceres::Solver::Summary summary =
      SolveGraduated({}, 100.0, problem_.get(), &widening_);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(widening_, 1.0);
  EXPECT_NEAR(Direction(), 0.0, 0.01);
  // t^2 / (t^2 + m^2) = 0.04 of what was measured is left, and a little more,
  // since the weights are a little below 1.
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    EXPECT_NEAR(Wall(i), Direction(), 0.02);
  }
}

TEST_F(SharedDirectionTest, AWallOfAnotherDirectionIsLetGo) {
  for (const double other : {10.0, 4.0}) {
    SCOPED_TRACE(other);
    Build({0.3, -0.2, 0.1, -0.2, other}, 10.0, /*is_graduated=*/true);
    SolveGraduated({}, 100.0, problem_.get(), &widening_);
    EXPECT_NEAR(Direction(), 0.0, 0.01);
    EXPECT_NEAR(Wall(4), other, 1e-6);
  }
}

}  // namespace
}  // namespace plumbline
