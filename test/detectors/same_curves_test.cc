#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/detectors/same_curves.h>
#include <plumbline/detectors/supported_curves.h>
#include <plumbline/factors/angle.h>

#include <vector>

#include "detectors/point_chain.h"

namespace plumbline {
namespace {

using ::testing::IsEmpty;

class SameCurvesTest : public PointChainTest {
 protected:
  // Of the lines of the graph.
  std::vector<SupportedCurve> TakeOut() {
    const PointGraph points = Points();
    SupportedCurves curves(graph_, points);
    std::vector<SupportedCurve> gone = TakeOutSameCurves(
        points, CurveKind::kLine, CurveSearchOptions(), &curves);
    left_ = curves.all();
    return gone;
  }

  std::vector<SupportedCurve> left_;
};

TEST_F(SameCurvesTest, PieceOfALongerLineGoes) {
  for (int i = 0; i < 10; ++i) AddPoint(0.5 * i, 0.01);
  const FeatureId line = AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4, 5});
  const FeatureId piece = AddLine(0.0, 0.02, 0.0, {6, 7, 8, 9});
  const std::vector<SupportedCurve> gone = TakeOut();
  ASSERT_EQ(gone.size(), 1u);
  EXPECT_EQ(gone[0].id, piece);
  ASSERT_EQ(left_.size(), 1u);
  EXPECT_EQ(left_[0].id, line);
  EXPECT_TRUE(left_[0].is_dirty);
}

// Each holds its points on itself, so that all of a piece are as far off.
TEST_F(SameCurvesTest, PieceThatIsOffByLessThanTheGateGoes) {
  for (const double off : {0.08, 0.12}) {
    SCOPED_TRACE(off);
    const int first = AddPoint(0.0, off * 50.0, /*is_linked=*/false);
    std::vector<int> line = {first};
    std::vector<int> piece;
    for (int i = 1; i < 10; ++i) {
      (i < 6 ? line : piece)
          .push_back(AddPoint(0.5 * i, off * 50.0 + (i < 6 ? 0.0 : off)));
    }
    AddLine(0.0, off * 50.0, 0.0, line);
    AddLine(0.0, off * 51.0, 0.0, piece);
  }
  EXPECT_EQ(TakeOut().size(), 1u);
  EXPECT_EQ(left_.size(), 3u);
}

TEST_F(SameCurvesTest, OfEqualOnesTheFirstStays) {
  for (int i = 0; i < 8; ++i) AddPoint(0.5 * i, 0.0);
  const FeatureId first = AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  AddLine(0.0, 0.0, 0.0, {4, 5, 6, 7});
  EXPECT_EQ(TakeOut().size(), 1u);
  ASSERT_EQ(left_.size(), 1u);
  EXPECT_EQ(left_[0].id, first);
}

TEST_F(SameCurvesTest, LinesAcrossEachOtherAreTwo) {
  for (int i = 0; i < 6; ++i) AddPoint(0.5 * i, 0.0);
  for (int i = 1; i < 5; ++i) AddPoint(2.5, 0.5 * i);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4, 5});
  AddLine(2.5, 0.0, 0.5 * kPi, {6, 7, 8, 9});
  EXPECT_THAT(TakeOut(), IsEmpty());
  EXPECT_EQ(left_.size(), 2u);
}

TEST_F(SameCurvesTest, LinesInLineWithAWideGapBetweenAreTwo) {
  for (int i = 0; i < 6; ++i) AddPoint(0.5 * i, 0.0);
  // Linked all the same.
  for (int i = 0; i < 4; ++i) AddPoint(5.0 + 0.5 * i, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4, 5});
  AddLine(0.0, 0.0, 0.0, {6, 7, 8, 9});
  EXPECT_THAT(TakeOut(), IsEmpty());
}

TEST_F(SameCurvesTest, LineThatIsHeldByMoreThanStructureStays) {
  for (int i = 0; i < 10; ++i) AddPoint(0.5 * i, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4, 5});
  const FeatureId piece = AddLine(0.0, 0.0, 0.0, {6, 7, 8, 9});
  graph_.FindFeature(piece)->fixed = true;
  EXPECT_THAT(TakeOut(), IsEmpty());
}

}  // namespace
}  // namespace plumbline
