#include <gtest/gtest.h>
#include <plumbline/detectors/direction_network.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace plumbline {
namespace {

// Two links between two nodes: their mean by weight, their common variance.
TEST(DirectionNetworkTest, TwoLooksAtOneDifference) {
  DirectionNetwork network;
  const std::size_t a = network.AddNode(0.0);
  const std::size_t b = network.AddNode(0.0);
  network.AddLink(a, b, 0.3, 0.01, false);
  network.AddLink(a, b, 0.6, 0.02, false);
  network.Solve();
  EXPECT_NEAR(network.Angle(b) - network.Angle(a), 0.4, 1e-6);
  const double variance = network.Variance(a) + network.Variance(b) -
                          2.0 * network.CovarianceColumn(a)[1];
  EXPECT_NEAR(variance, 0.02 / 3.0, 1e-7);
}

TEST(DirectionNetworkTest, LinksOfUndirectedThingsAreModuloPi) {
  DirectionNetwork network;
  const std::size_t a = network.AddNode(0.1);
  const std::size_t b = network.AddNode(3.1);
  network.AddLink(a, b, 0.0, 0.01, true);
  network.Solve();
  EXPECT_NEAR(network.Angle(b) - network.Angle(a), kPi, 1e-6);
}

TEST(DirectionNetworkTest, PartsThatNothingConnectsAreFree) {
  DirectionNetwork network;
  for (int i = 0; i < 4; ++i) network.AddNode(0.0);
  network.AddLink(0, 1, 0.0, 1e-4, false);
  network.AddLink(2, 3, 0.0, 1e-4, false);
  network.Solve();
  EXPECT_GT(network.Variance(0) + network.Variance(2) -
                2.0 * network.CovarianceColumn(0)[2],
            0.9 * DirectionNetwork::kUnknownVariance);
  EXPECT_TRUE(network.HasLinks(3));
  network.RemoveLinksBetween(3, {2});
  EXPECT_FALSE(network.HasLinks(3));
  EXPECT_TRUE(network.HasLinks(0));
  network.RemoveLinksOf(1);
  EXPECT_EQ(network.num_links(), 0u);
}

// Variances of single nodes against the dense inverse.
TEST(DirectionNetworkTest, VariancesAreThoseOfTheInverse) {
  constexpr int kNodes = 40;
  std::mt19937_64 engine(1);
  std::uniform_int_distribution<int> node(0, kNodes - 1);
  std::uniform_real_distribution<double> variance(1e-6, 1e-2);
  DirectionNetwork network;
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(kNodes, kNodes) /
                                DirectionNetwork::kUnknownVariance;
  for (int i = 0; i < kNodes; ++i) network.AddNode(0.0);
  for (int k = 0; k < 90; ++k) {
    const int a = node(engine);
    const int b = (a + 1 + node(engine) % (kNodes - 1)) % kNodes;
    const double v = variance(engine);
    network.AddLink(a, b, 0.0, v, false);
    information(a, a) += 1.0 / v;
    information(b, b) += 1.0 / v;
    information(a, b) -= 1.0 / v;
    information(b, a) -= 1.0 / v;
  }
  network.Solve();
  const Eigen::MatrixXd covariance = information.inverse();
  for (int i = 0; i < kNodes; ++i) {
    EXPECT_NEAR(network.Variance(i) / covariance(i, i), 1.0, 1e-5);
    const Eigen::VectorXd column = network.CovarianceColumn(i);
    EXPECT_LT((column - covariance.col(i)).norm() / column.norm(), 1e-5);
  }
}

// Links whose residuals are three times what their variances say.
TEST(DirectionNetworkTest, VarianceFactorSaysWhatResidualsShow) {
  std::mt19937_64 engine(2);
  std::normal_distribution<double> noise(0.0, 1.0);
  DirectionNetwork network;
  constexpr int kNodes = 50;
  for (int i = 0; i < kNodes; ++i) network.AddNode(0.0);
  for (int i = 0; i < kNodes; ++i) {
    for (int step = 1; step <= 8 && i + step < kNodes; ++step) {
      network.AddLink(i, i + step, 0.03 * noise(engine), 0.01 * 0.01, false,
                      step % 2);
    }
  }
  network.Solve();
  for (const int group : {0, 1}) {
    EXPECT_NEAR(std::sqrt(network.VarianceFactor(group)), 3.0, 0.5);
    network.ScaleVariances(group, network.VarianceFactor(group), 0.0);
  }
  network.Solve();
  EXPECT_NEAR(network.VarianceFactor(0), 1.0, 0.2);
  EXPECT_EQ(network.VarianceFactor(7), 1.0);
}

// What is kept from one solve to the next is given up when links change.
TEST(DirectionNetworkTest, SolvedAgainAsIfItWereNew) {
  const auto fill = [](int links, DirectionNetwork* network) {
    std::mt19937_64 engine(4);
    std::normal_distribution<double> noise(0.0, 0.1);
    for (int i = 0; i < 12; ++i) network->AddNode(noise(engine));
    for (int k = 0; k < links; ++k) {
      network->AddLink(k % 12, (k + 1 + k / 12) % 12, noise(engine),
                       0.01 + 0.001 * k, false, k % 2);
    }
  };
  const auto expect_same = [](const DirectionNetwork& a,
                              const DirectionNetwork& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a.Angle(i), b.Angle(i)) << i;
      EXPECT_EQ(a.CovarianceColumn(i), b.CovarianceColumn(i)) << i;
    }
  };
  DirectionNetwork network;
  fill(20, &network);
  network.SolveAngles();
  network.ScaleVariances(1, 2.5, 0.0);
  network.SolveAngles();
  DirectionNetwork scaled;
  fill(20, &scaled);
  scaled.ScaleVariances(1, 2.5, 0.0);
  scaled.Solve();
  expect_same(network, scaled);
  network.Solve();
  for (std::size_t i = 0; i < network.size(); ++i) {
    EXPECT_EQ(network.Variance(i), scaled.Variance(i)) << i;
  }

  network.RemoveLinksOf(3);
  network.AddLink(3, 9, 0.2, 0.5, true);
  network.Solve();
  DirectionNetwork fresh;
  fill(20, &fresh);
  fresh.ScaleVariances(1, 2.5, 0.0);
  fresh.RemoveLinksOf(3);
  fresh.AddLink(3, 9, 0.2, 0.5, true);
  fresh.Solve();
  expect_same(network, fresh);

  network.AddNode(0.4);
  fresh.AddNode(0.4);
  network.AddLink(12, 0, 0.1, 0.01, false);
  fresh.AddLink(12, 0, 0.1, 0.01, false);
  network.Solve();
  fresh.SolveAngles();
  expect_same(network, fresh);
}

}  // namespace
}  // namespace plumbline
