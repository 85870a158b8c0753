#include <ceres/ceres.h>
#include <gtest/gtest.h>
#include <plumbline/core/flat_problem.h>
#include <plumbline/core/normal_matrix.h>

#include <array>
#include <limits>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// factor (b - a), of one parameter each.
struct Difference {
  double factor;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    residual[0] = factor * (b[0] - a[0]);
    return true;
  }
};

// A chain a - b - c of blocks with one parameter each.
class FlatProblemTest : public ::testing::Test {
 protected:
  ceres::ResidualBlockId Tie(int a, int b, double factor) {
    return problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Difference, 1, 1, 1>(
            new Difference{factor}),
        nullptr, &values_[a], &values_[b]);
  }

  // Products of the Jacobians of all terms go into the matrix.
  Eigen::VectorXd Linearize(NormalMatrix* matrix) const {
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(flat_.num_columns());
    matrix->SetZero();
    for (const FlatProblem::Term& term : flat_.terms()) {
      std::vector<double> jacobians(2);
      std::vector<double*> pointers;
      const double* arguments[2];
      for (int i = term.begin; i < term.end; ++i) {
        const int k = i - term.begin;
        arguments[k] = flat_.blocks()[flat_.arguments()[i].block].user;
        pointers.push_back(flat_.arguments()[i].variable < 0 ? nullptr
                                                             : &jacobians[k]);
      }
      double residual;
      EXPECT_TRUE(term.cost->Evaluate(arguments, &residual, pointers.data()));
      matrix->Add(flat_, term, pointers.data(), &residual, gradient.data());
    }
    return gradient;
  }

  int VariableOf(const double* value) const {
    for (std::size_t v = 0; v < flat_.variables().size(); ++v) {
      if (flat_.variables()[v].user == value) return static_cast<int>(v);
    }
    return -1;
  }

  std::array<double, 4> values_ = {1.0, 2.0, 4.0, 8.0};
  ceres::Problem problem_;
  FlatProblem flat_{&problem_};
};

TEST_F(FlatProblemTest, VariablesComeInTheOrderOfResiduals) {
  Tie(2, 0, 1.0);
  Tie(0, 1, 1.0);
  problem_.SetParameterBlockConstant(&values_[0]);
  EXPECT_EQ(flat_.Read(/*may_keep=*/false), "");
  ASSERT_EQ(flat_.variables().size(), 2u);
  EXPECT_EQ(flat_.variables()[0].user, &values_[2]);
  EXPECT_EQ(flat_.variables()[1].user, &values_[1]);
  EXPECT_EQ(flat_.blocks().size(), 3u);
  EXPECT_EQ(flat_.num_columns(), 2);
  EXPECT_EQ(flat_.num_reduced_terms(), 2);
  // Each term has one variable, and so one product.
  EXPECT_EQ(flat_.num_products(), 2);
  EXPECT_FALSE(flat_.has_same_variables());
  EXPECT_EQ(flat_.KeptFrom(0), nullptr);
}

TEST_F(FlatProblemTest, KeepsWhatIsAsItWas) {
  const ceres::ResidualBlockId first = Tie(0, 1, 1.0);
  Tie(1, 2, 1.0);
  Tie(0, 2, 1.0);
  EXPECT_EQ(flat_.Read(false), "");
  EXPECT_EQ(flat_.Read(true), "");
  EXPECT_TRUE(flat_.has_same_variables());
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NE(flat_.KeptFrom(k), nullptr);

  // A residual went, and the last one took its place: what did not move up is
  // known still.
  problem_.RemoveResidualBlock(first);
  EXPECT_EQ(flat_.Read(true), "");
  EXPECT_TRUE(flat_.has_same_variables());
  ASSERT_EQ(flat_.terms().size(), 2u);
  EXPECT_TRUE(flat_.KeptFrom(0) != nullptr || flat_.KeptFrom(1) != nullptr);

  // Another came.
  Tie(1, 0, 2.0);
  EXPECT_EQ(flat_.Read(true), "");
  EXPECT_TRUE(flat_.has_same_variables());
  EXPECT_EQ(flat_.KeptFrom(2), nullptr);

  // A block no longer varies: variables are others.
  problem_.SetParameterBlockConstant(&values_[2]);
  EXPECT_EQ(flat_.Read(true), "");
  EXPECT_FALSE(flat_.has_same_variables());
  EXPECT_EQ(flat_.variables().size(), 2u);
}

TEST_F(FlatProblemTest, WhatDidNotChangeIsNotReadAgain) {
  Tie(0, 1, 1.0);
  const ceres::ResidualBlockId second = Tie(1, 2, 1.0);
  ProblemChanges changes;
  EXPECT_EQ(flat_.Read(false, &changes), "");
  EXPECT_FALSE(flat_.is_unchanged());
  changes.parameter_blocks = false;
  EXPECT_EQ(flat_.Read(true, &changes), "");
  EXPECT_TRUE(flat_.is_unchanged());
  EXPECT_EQ(flat_.terms().size(), 2u);
  // Nobody says what changed: it is looked for.
  EXPECT_EQ(flat_.Read(true), "");
  EXPECT_FALSE(flat_.is_unchanged());
  EXPECT_NE(flat_.KeptFrom(1), nullptr);

  // Another one where one was: that it has the same address says nothing.
  changes.added = {second};
  EXPECT_EQ(flat_.Read(true, &changes), "");
  EXPECT_FALSE(flat_.is_unchanged());
  EXPECT_TRUE(flat_.has_same_variables());
  EXPECT_NE(flat_.KeptFrom(0), nullptr);

  // What was taken out is noticed.
  problem_.RemoveResidualBlock(second);
  Tie(0, 2, 3.0);
  std::vector<ceres::ResidualBlockId> ids;
  problem_.GetResidualBlocks(&ids);
  changes.added = {ids.back()};
  EXPECT_EQ(flat_.Read(true, &changes), "");
  ASSERT_EQ(flat_.terms().size(), 2u);
  const FlatProblem::Term& last = flat_.terms().back();
  EXPECT_EQ(flat_.blocks()[flat_.arguments()[last.begin].block].user,
            &values_[0]);
  EXPECT_EQ(flat_.blocks()[flat_.arguments()[last.begin + 1].block].user,
            &values_[2]);
}

TEST_F(FlatProblemTest, BoundsAreRefused) {
  Tie(0, 1, 1.0);
  problem_.SetParameterUpperBound(&values_[1], 0, 9.0);
  EXPECT_NE(flat_.Read(false), "");
  problem_.SetParameterUpperBound(&values_[1], 0,
                                  std::numeric_limits<double>::max());
  EXPECT_EQ(flat_.Read(false), "");
}

// Of residuals 2 (b - a) and 3 (c - b) the normal matrix is
// [4 -4 0; -4 13 -9; 0 -9 9]; with one more on the diagonal and (1, 2, 3) on
// the right the solution is that of [5 -4 0; -4 14 -9; 0 -9 10], whose
// determinant is 5 (140 - 81) - 16 * 10 = 135.
TEST_F(FlatProblemTest, NormalMatrixSolves) {
  Tie(0, 1, 2.0);
  Tie(1, 2, 3.0);
  ASSERT_EQ(flat_.Read(false), "");
  NormalMatrix matrix;
  EXPECT_FALSE(matrix.is_analysed());
  ASSERT_TRUE(matrix.Analyse(flat_));
  EXPECT_TRUE(matrix.is_analysed());
  const Eigen::VectorXd gradient = Linearize(&matrix);
  const auto column = [&](int i) {
    return matrix.ColumnOf(VariableOf(&values_[i]));
  };
  // Residuals 2 (2 - 1) and 3 (4 - 2).
  EXPECT_EQ(gradient[column(0)], -2.0 * 2.0);
  EXPECT_EQ(gradient[column(1)], 2.0 * 2.0 - 3.0 * 6.0);
  EXPECT_EQ(gradient[column(2)], 3.0 * 6.0);
  EXPECT_EQ(matrix.Diagonal(column(0)), 4.0);
  EXPECT_EQ(matrix.Diagonal(column(1)), 13.0);
  EXPECT_EQ(matrix.Diagonal(column(2)), 9.0);
  Eigen::VectorXd right(3), y(3);
  for (int i = 0; i < 3; ++i) right[column(i)] = i + 1.0;
  ASSERT_TRUE(matrix.SolveDamped(Eigen::Vector3d::Ones(),
                                 Eigen::Vector3d::Ones(), right, &y));
  // Cramer's rule by hand.
  EXPECT_NEAR(y[column(0)], 247.0 / 135.0, 1e-12);
  EXPECT_NEAR(y[column(1)], 275.0 / 135.0, 1e-12);
  EXPECT_NEAR(y[column(2)], 288.0 / 135.0, 1e-12);
  EXPECT_GT(matrix.LeastPivot(), 0.01);
  // The factorization is there still, whatever becomes of the entries.
  matrix.SwapEntries();
  matrix.SetZero();
  Eigen::VectorXd again(3);
  ASSERT_TRUE(matrix.SolveAgain(2.0 * right, &again));
  EXPECT_NEAR((again - 2.0 * y).norm(), 0.0, 1e-12);
  EXPECT_EQ(matrix.Diagonal(column(1)), 0.0);
  matrix.SwapEntries();
  EXPECT_EQ(matrix.Diagonal(column(1)), 13.0);
  // Without damping the common shift is undetermined.
  EXPECT_FALSE(matrix.SolveDamped(Eigen::Vector3d::Ones(),
                                  Eigen::Vector3d::Zero(), right, &y) &&
               matrix.LeastPivot() > 1e-12);
}

TEST_F(FlatProblemTest, PlacesOfPairsThatWereThereAreFound) {
  const ceres::ResidualBlockId first = Tie(0, 1, 2.0);
  Tie(1, 2, 3.0);
  Tie(2, 3, 1.0);
  ASSERT_EQ(flat_.Read(false), "");
  NormalMatrix matrix;
  ASSERT_TRUE(matrix.Analyse(flat_));

  // Another residual between two that had one in common.
  problem_.RemoveResidualBlock(first);
  Tie(1, 0, 5.0);
  ASSERT_EQ(flat_.Read(true), "");
  ASSERT_TRUE(flat_.has_same_variables());
  EXPECT_TRUE(matrix.FindPlaces(flat_));
  Linearize(&matrix);
  EXPECT_EQ(matrix.Diagonal(matrix.ColumnOf(VariableOf(&values_[0]))), 25.0);
  EXPECT_EQ(matrix.Diagonal(matrix.ColumnOf(VariableOf(&values_[1]))), 34.0);

  // Between two that had none.
  Tie(0, 3, 1.0);
  ASSERT_EQ(flat_.Read(true), "");
  ASSERT_TRUE(flat_.has_same_variables());
  EXPECT_FALSE(matrix.FindPlaces(flat_));
  ASSERT_EQ(flat_.ReadAnew(), "");
  EXPECT_FALSE(flat_.has_same_variables());
  ASSERT_TRUE(matrix.Analyse(flat_));
  EXPECT_EQ(matrix.num_analyses(), 2);
  Linearize(&matrix);
  EXPECT_EQ(matrix.Diagonal(matrix.ColumnOf(VariableOf(&values_[0]))), 26.0);
}

TEST(AddressIndexTest, FindsWhatWasAdded) {
  std::vector<double> values(1000);
  AddressIndex index;
  EXPECT_EQ(index.Find(values.data()), -1);
  index.Clear(1);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(index.FindOrAdd(&values[i], i), i);
    EXPECT_EQ(index.FindOrAdd(&values[i], i + 1), i);
  }
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(index.Find(&values[i]), i);
  double other;
  EXPECT_EQ(index.Find(&other), -1);
}

}  // namespace
}  // namespace plumbline
