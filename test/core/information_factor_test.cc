#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information_factor.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr double kPriorVariance = 1e8;
constexpr int kBlock = 3;

// A chain of blocks of three variables that closes on itself, each coupled with
// the next: J' J of differences, and one that is tied to nothing else.
Eigen::MatrixXd Ring(int blocks, bool has_gauge) {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal(0.0, 1.0);
  Eigen::MatrixXd information =
      Eigen::MatrixXd::Zero(kBlock * blocks, kBlock * blocks);
  for (int i = 0; i < blocks; ++i) {
    const int j = (i + 1) % blocks;
    Eigen::Matrix3d weight;
    for (double& entry : weight.reshaped()) entry = normal(generator);
    weight = (weight.transpose() * weight + Eigen::Matrix3d::Identity()).eval();
    information.block<kBlock, kBlock>(kBlock * i, kBlock * i) += weight;
    information.block<kBlock, kBlock>(kBlock * j, kBlock * j) += weight;
    information.block<kBlock, kBlock>(kBlock * i, kBlock * j) -= weight;
    information.block<kBlock, kBlock>(kBlock * j, kBlock * i) -= weight;
  }
  if (has_gauge) {
    information.topLeftCorner<kBlock, kBlock>() += Eigen::Matrix3d::Identity();
  }
  return information;
}

Eigen::SparseMatrix<double> LowerTriangle(const Eigen::MatrixXd& matrix) {
  const Eigen::MatrixXd lower = matrix.triangularView<Eigen::Lower>();
  return lower.sparseView();
}

InformationRows Rows(int block) { return {kBlock * block, kBlock}; }

TEST(InformationFactorTest, BlocksAreThoseOfTheInverse) {
  constexpr int kBlocks = 20;
  const Eigen::MatrixXd information = Ring(kBlocks, true);
  const Eigen::MatrixXd inverse = information.inverse();
  InformationFactor factor;
  EXPECT_EQ(factor.size(), 0);
  factor.Factorize(LowerTriangle(information), kPriorVariance);
  EXPECT_EQ(factor.size(), kBlock * kBlocks);
  std::vector<InformationRows> rows;
  for (int i = 0; i < kBlocks; ++i) rows.push_back(Rows(i));
  const std::vector<Eigen::MatrixXd> blocks = factor.InverseBlocks(rows);
  ASSERT_EQ(blocks.size(), rows.size());
  for (int i = 0; i < kBlocks; ++i) {
    const Eigen::MatrixXd expected =
        inverse.block<kBlock, kBlock>(kBlock * i, kBlock * i);
    EXPECT_LT((blocks[static_cast<std::size_t>(i)] - expected).norm(),
              1e-9 * expected.norm())
        << i;
  }
}

TEST(InformationFactorTest, SolvesInTheRowsThatAreWanted) {
  constexpr int kBlocks = 20;
  const Eigen::MatrixXd information = Ring(kBlocks, true);
  const Eigen::MatrixXd inverse = information.inverse();
  InformationFactor factor;
  factor.Factorize(LowerTriangle(information), kPriorVariance);
  using ThreeColumns = Eigen::Matrix<double, Eigen::Dynamic, kBlock>;
  ThreeColumns right = ThreeColumns::Zero(information.rows(), kBlock);
  right.middleRows<kBlock>(kBlock * 4).setIdentity();
  const ThreeColumns columns = factor.SolveAt(right, {Rows(4)}, {Rows(17)});
  const Eigen::MatrixXd dynamic =
      factor.SolveAt<Eigen::MatrixXd>(right, {Rows(4)}, {Rows(17)});
  for (const int block : {4, 17}) {
    const Eigen::MatrixXd expected =
        inverse.block<kBlock, kBlock>(kBlock * block, kBlock * 4);
    EXPECT_LT((columns.middleRows<kBlock>(kBlock * block) - expected).norm(),
              1e-9 * expected.norm());
    EXPECT_EQ(dynamic.middleRows(kBlock * block, kBlock),
              columns.middleRows(kBlock * block, kBlock));
  }
  // What nobody wants is left zero.
  EXPECT_EQ(columns.middleRows<kBlock>(kBlock * 10).norm(), 0.0);
}

TEST(InformationFactorTest, UnknownDirectionsGetThePriorAndNothingElseDoes) {
  constexpr int kBlocks = 8;
  // Nothing ties the ring to anything: three directions are unknown. A last
  // variable that the matrix does not speak of at all.
  Eigen::MatrixXd information =
      Eigen::MatrixXd::Zero(kBlock * kBlocks + 1, kBlock * kBlocks + 1);
  information.topLeftCorner(kBlock * kBlocks, kBlock * kBlocks) =
      Ring(kBlocks, false);
  InformationFactor factor;
  factor.Factorize(LowerTriangle(information), kPriorVariance);
  const int last = kBlock * kBlocks;
  const std::vector<Eigen::MatrixXd> blocks =
      factor.InverseBlocks({Rows(2), {last, 1}});
  EXPECT_GT(blocks[0].diagonal().minCoeff(), 1e-2 * kPriorVariance);
  EXPECT_NEAR(blocks[1](0, 0), kPriorVariance, 1e-2 * kPriorVariance);
  // The difference of two blocks is known as well as with a gauge.
  const Eigen::MatrixXd inverse = Ring(kBlocks, true).inverse();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(information.rows(), kBlock);
  right.middleRows<kBlock>(kBlock * 2).setIdentity();
  right.middleRows<kBlock>(kBlock * 5) = -Eigen::Matrix3d::Identity();
  const Eigen::MatrixXd solved = factor.SolveAt(right, {Rows(2), Rows(5)}, {});
  const Eigen::Matrix3d difference = solved.middleRows<kBlock>(kBlock * 2) -
                                     solved.middleRows<kBlock>(kBlock * 5);
  const Eigen::MatrixXd gauged = right.topRows(kBlock * kBlocks);
  const Eigen::MatrixXd expected = gauged.transpose() * inverse * gauged;
  EXPECT_LT((difference - expected).norm(), 1e-6 * expected.norm());
}

TEST(InformationFactorTest, NegativeInformationThatThePriorEndsAtIsRefused) {
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(2, 2);
  information(1, 1) = -1.0 / kPriorVariance;
  InformationFactor factor;
  EXPECT_THROW(factor.Factorize(LowerTriangle(information), kPriorVariance),
               Error);
}

}  // namespace
}  // namespace plumbline
