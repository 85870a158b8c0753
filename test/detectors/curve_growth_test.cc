#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/detectors/curve_growth.h>
#include <plumbline/detectors/supported_curves.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "detectors/point_chain.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class CurveGrowthTest : public PointChainTest {
 protected:
  // Points that join a line of the graph when it is extended.
  std::vector<int> Joining(std::size_t line) {
    const PointGraph points = Points();
    const CurveSearchOptions options;
    SupportedCurves curves(graph_, points);
    CurveGrowth growth(points, options);
    const bool has_changed = growth.Extend(line, &curves);
    leaving_.clear();
    for (const SupportedCurve& curve : curves.all()) {
      leaving_.insert(leaving_.end(), curve.leaving.begin(),
                      curve.leaving.end());
    }
    EXPECT_EQ(has_changed, !curves[line].joining.empty() || !leaving_.empty());
    EXPECT_TRUE(std::is_sorted(curves[line].found.support.begin(),
                               curves[line].found.support.end()));
    // There is nothing more to join.
    EXPECT_FALSE(growth.Extend(line, &curves));
    return curves[line].joining;
  }

  // Points that were to leave lines then.
  std::vector<int> leaving_;
};

TEST_F(CurveGrowthTest, ConnectedPointsWithinTheGateJoin) {
  for (int i = 0; i < 4; ++i) AddPoint(0.5 * i, 0.0);
  AddPoint(2.0, 0.09);
  AddPoint(2.5, 0.2);
  AddPoint(3.0, 0.05);
  // Near the line, but nothing connects it.
  AddPoint(3.5, 0.0, /*is_linked=*/false);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  EXPECT_THAT(Joining(0), ElementsAre(4, 6));
}

TEST_F(CurveGrowthTest, StopsAtWideGapsAndManyPointsOffTheLine) {
  for (int i = 0; i < 4; ++i) AddPoint(0.5 * i, 0.0);
  // One step too far: spaced at 0.5 m, a line may have no point for 1.5 m.
  AddPoint(3.1, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  EXPECT_THAT(Joining(0), IsEmpty());
  // At the other end three points off the line.
  for (int i = 0; i < 3; ++i) {
    AddPoint(-0.1, 0.3 + 0.1 * i, /*is_linked=*/i > 0);
  }
  Link(0, 5);
  AddPoint(-0.3, 0.0);
  EXPECT_THAT(Joining(0), IsEmpty());
}

// The next point of a wall across is within the gate of the row.
TEST_F(CurveGrowthTest, PointWithinALineAcrossStaysThere) {
  for (int i = 0; i < 5; ++i) AddPoint(0.5 * i, 0.0);
  for (int i = -2; i < 3; ++i) AddPoint(2.5, 0.08 * i, /*is_linked=*/i > -2);
  Link(4, 7);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4});
  AddLine(2.5, 0.0, 0.5 * kPi, {5, 6, 7, 8, 9});
  EXPECT_THAT(Joining(0), IsEmpty());
}

// A point of the row that a wall across took while the map was far off.
TEST_F(CurveGrowthTest, PointWithinALineLeavesTheEndOfAnother) {
  for (int i = 0; i < 7; ++i) AddPoint(0.5 * i, i == 3 ? 0.05 : 0.0);
  for (int i = 1; i < 5; ++i) AddPoint(1.5, 0.5 * i, /*is_linked=*/i > 1);
  Link(3, 7);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 4, 5, 6});
  AddLine(1.5, 0.0, 0.5 * kPi, {3, 7, 8, 9, 10});
  EXPECT_THAT(Joining(0), ElementsAre(3));
  EXPECT_THAT(leaving_, ElementsAre(3));
}

// Where two walls end, a point is on the one or on the other.
TEST_F(CurveGrowthTest, PointAtTheEndsOfTwoLinesIsOnNeither) {
  for (int i = 0; i < 5; ++i) AddPoint(0.5 * i, 0.0);
  AddPoint(2.5, 0.15);
  for (int i = 1; i < 5; ++i) AddPoint(2.5, 0.5 * i);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4});
  const FeatureId across = AddLine(2.5, 0.0, 0.5 * kPi, {5, 6, 7, 8, 9});
  EXPECT_THAT(Joining(0), IsEmpty());
  EXPECT_THAT(leaving_, ElementsAre(5));
  // Nor does it come back, to either.
  for (const ConstraintId id : graph_.ConstraintsOf(across)) {
    if (graph_.GetConstraint(id).features[0] != points_[5]) continue;
    Transaction transaction;
    transaction.RemoveConstraint(id);
    graph_.Apply(std::move(transaction));
    break;
  }
  EXPECT_THAT(Joining(0), IsEmpty());
  EXPECT_THAT(Joining(1), IsEmpty());
}

TEST_F(CurveGrowthTest, EndOfALineStaysWhereAnotherIsFarAway) {
  for (int i = 0; i < 5; ++i) AddPoint(0.5 * i, 0.0);
  AddPoint(2.5, 0.25);
  for (int i = 1; i < 5; ++i) AddPoint(2.5, 0.5 * i);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4});
  AddLine(2.5, 0.0, 0.5 * kPi, {5, 6, 7, 8, 9});
  EXPECT_THAT(Joining(0), IsEmpty());
  EXPECT_THAT(leaving_, IsEmpty());
}

}  // namespace
}  // namespace plumbline
