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
    const bool has_grown = growth.Extend(line, &curves);
    EXPECT_EQ(has_grown, !curves[line].joining.empty());
    EXPECT_TRUE(std::is_sorted(curves[line].found.support.begin(),
                               curves[line].found.support.end()));
    // There is nothing more to join.
    EXPECT_FALSE(growth.Extend(line, &curves));
    return curves[line].joining;
  }
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

TEST_F(CurveGrowthTest, PointOfALineAcrossJoinsAtTheCornerOnly) {
  for (int i = 0; i < 5; ++i) AddPoint(0.5 * i, 0.0);
  // The corner, and the next point of the wall across: within the gate of the
  // first, but not within its tolerance.
  AddPoint(2.5, 0.01);
  for (int i = 1; i < 5; ++i) AddPoint(2.5, 0.08 * i);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4});
  AddLine(2.5, 0.0, 0.5 * kPi, {5, 6, 7, 8, 9});
  EXPECT_THAT(Joining(0), ElementsAre(5));
}

}  // namespace
}  // namespace plumbline
