#include <gtest/gtest.h>
#include <plumbline/plan/min_cut.h>

#include <limits>
#include <random>
#include <vector>

namespace plumbline {
namespace {

struct Edge {
  std::size_t a, b;
  double cost;
};

TEST(MinCutTest, FindsWhatTryingAllLabelsFinds) {
  std::mt19937 random(7);
  const auto draw = [&] { return static_cast<double>(random() % 1000) / 100; };
  for (int trial = 0; trial < 50; ++trial) {
    constexpr std::size_t kNodes = 8;
    MinCut cut(kNodes);
    std::vector<double> if_false, if_true;
    for (std::size_t i = 0; i < kNodes; ++i) {
      if_false.push_back(draw());
      if_true.push_back(draw());
      cut.AddNodeCost(i, if_false[i], if_true[i]);
    }
    std::vector<Edge> edges;
    for (int k = 0; k < 12; ++k) {
      const Edge edge{random() % kNodes, random() % kNodes, draw()};
      if (edge.a == edge.b) continue;
      edges.push_back(edge);
      cut.AddEdgeCost(edge.a, edge.b, edge.cost);
    }
    const auto cost = [&](unsigned labels) {
      double sum = 0.0;
      for (std::size_t i = 0; i < kNodes; ++i) {
        sum += (labels >> i & 1) != 0 ? if_true[i] : if_false[i];
      }
      for (const Edge& edge : edges) {
        if ((labels >> edge.a & 1) != (labels >> edge.b & 1)) sum += edge.cost;
      }
      return sum;
    };
    double best = std::numeric_limits<double>::infinity();
    for (unsigned labels = 0; labels < 1u << kNodes; ++labels) {
      best = std::min(best, cost(labels));
    }
    unsigned found = 0;
    const std::vector<bool> labels = cut.Solve();
    for (std::size_t i = 0; i < kNodes; ++i) {
      found |= static_cast<unsigned>(labels[i]) << i;
    }
    EXPECT_NEAR(cost(found), best, 1e-6);
  }
}

TEST(MinCutTest, NothingIsNothing) { EXPECT_TRUE(MinCut(0).Solve().empty()); }

}  // namespace
}  // namespace plumbline
