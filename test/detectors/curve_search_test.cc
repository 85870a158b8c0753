#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/curve_hypotheses.h>
#include <plumbline/detectors/curve_joining.h>
#include <plumbline/detectors/curve_points.h>
#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/curve_selection.h>
#include <plumbline/detectors/curve_significance.h>

#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// The parts of SearchCurves, on points that are linked with the next two.
class CurveSearchTest : public ::testing::Test {
 protected:
  CurveSearchTest() { RegisterBuiltins(&registry_); }

  void AddChain(const std::vector<std::array<double, 2>>& positions) {
    Transaction transaction;
    for (const auto& position : positions) {
      Feature feature;
      feature.type = &registry_.GetFeature("point");
      feature.parameters = {position[0], position[1]};
      transaction.AddFeature(feature);
    }
    for (std::size_t i = 0; i < positions.size(); ++i) {
      for (std::size_t j = i + 1; j < std::min(i + 3, positions.size()); ++j) {
        Constraint constraint;
        constraint.type = &registry_.GetRelation("point_point_distance");
        constraint.features = {Transaction::ProvisionalId(i),
                               Transaction::ProvisionalId(j)};
        constraint.expected = Eigen::VectorXd::Constant(1, 1.0);
        constraint.information = Eigen::MatrixXd::Identity(1, 1);
        transaction.AddConstraint(std::move(constraint));
      }
    }
    graph_.Apply(std::move(transaction));
  }

  // Every half metre along the x axis, up and down by `noise`.
  void AddWall(int count, double noise = 0.0) {
    std::vector<std::array<double, 2>> positions;
    for (int i = 0; i < count; ++i) {
      positions.push_back({0.5 * i, i % 2 == 0 ? noise : -noise});
    }
    AddChain(positions);
  }

  const CurvePoints& Points() {
    graph_points_ = std::make_unique<PointGraph>(graph_, DetectionScope(), 8);
    is_claimed_.resize(static_cast<std::size_t>(graph_points_->size()), false);
    points_ =
        std::make_unique<CurvePoints>(*graph_points_, is_claimed_, options_);
    return *points_;
  }

  static std::vector<int> Range(int begin, int end) {
    std::vector<int> range(static_cast<std::size_t>(end - begin));
    std::iota(range.begin(), range.end(), begin);
    return range;
  }

  static CurveHypothesis LineThrough(std::vector<int> inliers, double tolerance,
                                     double offset = 0.0) {
    CurveHypothesis hypothesis;
    hypothesis.curve.position = {0.0, offset};
    hypothesis.tolerance = tolerance;
    hypothesis.inliers = std::move(inliers);
    return hypothesis;
  }

  static FoundCurve Line(std::vector<int> support, double offset,
                         double significance) {
    FoundCurve found;
    found.curve.position = {0.0, offset};
    found.support = std::move(support);
    found.significance = significance;
    return found;
  }

  Registry registry_;
  Graph graph_;
  CurveSearchOptions options_;
  std::vector<bool> is_claimed_;
  std::unique_ptr<PointGraph> graph_points_;
  std::unique_ptr<CurvePoints> points_;
};

TEST_F(CurveSearchTest, MedianGapOfAscendingNumbers) {
  EXPECT_EQ(MedianGap({}), 0.0);
  EXPECT_EQ(MedianGap({3.0}), 0.0);
  EXPECT_EQ(MedianGap({0.0, 1.0, 1.5, 9.0}), 1.0);
}

TEST_F(CurveSearchTest, PointsAreCutAtGaps) {
  AddChain({{0.0, 0.0}, {0.5, 0.0}, {3.0, 0.0}, {3.5, 0.0}, {4.0, 0.0}});
  const CurvePoints& points = Points();
  // Median 0.5 m: three times that.
  EXPECT_EQ(points.GapLimit({0.0, 0.5, 3.0, 3.5, 4.0}), 1.5);
  std::vector<int> indices = {4, 3, 2, 1, 0};
  points.CutAtGaps(PlanarCurve(), &indices);
  EXPECT_THAT(indices, ElementsAre(2, 3, 4));
}

TEST_F(CurveSearchTest, AReachGoesPastAGap) {
  options_.max_gap_points = 1;
  AddWall(12);
  is_claimed_ = std::vector<bool>(12, false);
  is_claimed_[3] = true;
  const CurvePoints& points = Points();
  EXPECT_FALSE(points.IsFree(3));
  GapReach reach(points);
  // Two steps of up to two points each, claimed ones as well.
  for (int repeat = 0; repeat < 2; ++repeat) {
    std::vector<int> reached = reach.From(2);
    std::sort(reached.begin(), reached.end());
    EXPECT_THAT(reached, ElementsAre(0, 1, 2, 3, 4, 5, 6));
  }
}

TEST_F(CurveSearchTest, MoreAndFinerIsMoreSignificant) {
  AddWall(40, 0.01);
  const CurvePoints& points = Points();
  const auto significance = [&](int count, double tolerance) {
    return CurveSignificance(points, LineThrough(Range(0, count), tolerance),
                             nullptr);
  };
  EXPECT_GT(significance(40, 0.02), significance(20, 0.02));
  EXPECT_GT(significance(20, 0.02), significance(20, 0.1));
  EXPECT_LT(significance(4, 0.1), 0.0);
  EXPECT_TRUE(std::isinf(significance(3, 0.02)));
}

TEST_F(CurveSearchTest, OutliersAndOwnersCountAgainstACurve) {
  AddWall(40, 0.01);
  const CurvePoints& points = Points();
  CurveHypothesis line = LineThrough(Range(0, 20), 0.02);
  const double alone = CurveSignificance(points, line, nullptr);
  line.bystanders = Range(20, 30);
  const double crowded = CurveSignificance(points, line, nullptr);
  EXPECT_LT(crowded, alone);
  // Strangers count once curves are told apart.
  line.strangers = Range(30, 40);
  EXPECT_EQ(CurveSignificance(points, line, nullptr), crowded);
  std::vector<bool> is_owned(40, false);
  const double strange = CurveSignificance(points, line, &is_owned);
  EXPECT_LT(strange, crowded);
  for (int i = 0; i < 10; ++i) is_owned[static_cast<std::size_t>(i)] = true;
  EXPECT_LT(CurveSignificance(points, line, &is_owned), strange);
}

TEST_F(CurveSearchTest, HypothesesAreDrawnOnFreePoints) {
  AddWall(30);
  is_claimed_ = std::vector<bool>(30, false);
  for (int i = 20; i < 30; ++i) is_claimed_[static_cast<std::size_t>(i)] = true;
  const CurvePoints& points = Points();
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  const auto hypotheses = DrawCurveHypotheses(points, 1, scope);
  ASSERT_FALSE(hypotheses.empty());
  for (const CurveHypothesis& hypothesis : hypotheses) {
    EXPECT_GE(hypothesis.significance, -options_.max_log_false_alarms);
    for (const int i : hypothesis.inliers) EXPECT_LT(i, 20);
  }
  EXPECT_EQ(counts["points"], 30);
  EXPECT_EQ(counts["points refused: claimed"], 10);
  EXPECT_EQ(counts["draws"] - counts["draws refused: not significant"],
            static_cast<std::int64_t>(hypotheses.size()));
  EXPECT_EQ(counts["draws"] + counts["draws left out: enough hypotheses there"],
            6 * 20);
  scope.stop = [] { return true; };
  EXPECT_THAT(DrawCurveHypotheses(points, 1, scope), IsEmpty());
}

TEST_F(CurveSearchTest, TheMoreSignificantTakesThePoints) {
  AddWall(30);
  const CurvePoints& points = Points();
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  // The first has points of the second alone.
  const auto selected = SelectCurves(
      points,
      {LineThrough(Range(0, 12), 0.02), LineThrough(Range(0, 30), 0.02)},
      scope);
  ASSERT_EQ(selected.size(), 1u);
  EXPECT_EQ(selected[0].hypothesis, 1);
  EXPECT_EQ(selected[0].found.support, Range(0, 30));
  EXPECT_EQ(counts["curves"], 2);
  EXPECT_EQ(counts["curves refused: others explain the points"], 1);
}

TEST_F(CurveSearchTest, PiecesOfOneLineAreJoined) {
  AddWall(30, 0.01);
  const CurvePoints& points = Points();
  std::vector<SelectedCurve> pieces(2);
  pieces[0] = {Line(Range(0, 15), 0.0, 5.0), 0};
  pieces[1] = {Line(Range(15, 30), 0.0, 4.0), 1};
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  const auto joined = JoinCurves(points, pieces, scope);
  ASSERT_EQ(joined.size(), 1u);
  EXPECT_EQ(joined[0].support, Range(0, 30));
  EXPECT_EQ(joined[0].significance, 9.0);
  EXPECT_EQ(counts["curves joined with others"], 1);
}

TEST_F(CurveSearchTest, LeftOversGoAndTheMostSignificantComesFirst) {
  // Two walls side by side, 0.05 m and 1 m from the first.
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i < 20; ++i) positions.push_back({0.5 * i, 0.0});
  for (int i = 0; i < 20; ++i) positions.push_back({9.5 - 0.5 * i, 0.05});
  for (int i = 0; i < 20; ++i) positions.push_back({0.5 * i, 1.0});
  AddChain(positions);
  const CurvePoints& points = Points();
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  const std::vector<FoundCurve> curves = {Line(Range(20, 40), 0.05, 3.0),
                                          Line(Range(40, 60), 1.0, 4.0),
                                          Line(Range(0, 20), 0.0, 5.0)};
  const auto kept = PruneCurves(points, curves, {}, scope);
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_EQ(kept[0].support, Range(0, 20));
  EXPECT_EQ(kept[1].support, Range(40, 60));
  EXPECT_EQ(counts["curves refused: left over of another"], 1);
  // Of a known one, too.
  const std::vector<FoundCurve> known = {Line(Range(0, 20), 0.0, 0.0)};
  const auto others = PruneCurves(
      points, {Line(Range(20, 40), 0.05, 3.0), Line(Range(40, 60), 1.0, 4.0)},
      known, scope);
  ASSERT_EQ(others.size(), 1u);
  EXPECT_EQ(others[0].support, Range(40, 60));
}

TEST_F(CurveSearchTest, TheWholeSearchCountsAndStops) {
  AddWall(40, 0.01);
  Points();
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  const auto found =
      SearchCurves(*graph_points_, is_claimed_, {}, 1, options_, scope);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].support, Range(0, 40));
  EXPECT_EQ(counts["curves"] -
                counts["curves refused: others explain the points"] -
                counts["curves refused: too few points left"] -
                counts["curves joined with others"] -
                counts["curves refused: left over of another"],
            1);
}

}  // namespace
}  // namespace plumbline
