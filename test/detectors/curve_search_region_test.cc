#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/detectors/curve_search_region.h>
#include <plumbline/detectors/supported_curves.h>

#include <vector>

#include "detectors/point_chain.h"

namespace plumbline {
namespace {

using ::testing::Each;

class CurveSearchRegionTest : public PointChainTest {};

TEST_F(CurveSearchRegionTest, FirstHasAllPointsButThoseOfCurves) {
  for (int i = 0; i < 4; ++i) AddPoint(0.5 * i, 0.0);
  // Left over of the line: within its gate, or far from it.
  AddPoint(2.0, 0.09);
  AddPoint(2.5, 3.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  const PointGraph points = Points();
  const CurveSearchOptions options;
  const SupportedCurves curves(graph_, points);
  CurveSearchRegion region(points, options);
  EXPECT_EQ(region.Take(curves),
            std::vector<bool>({true, true, true, true, true, false}));
  // Nothing was touched since.
  EXPECT_THAT(region.Take(curves), Each(true));
}

TEST_F(CurveSearchRegionTest, NextHasWhatIsConnectedWithTheTouched) {
  // A line, clutter on both sides of it, and clutter that hangs on neither.
  for (int i = 0; i < 6; ++i) AddPoint(-10.0 + i, 5.0 + i);
  for (int i = 0; i < 30; ++i) AddPoint(0.5 * i, 0.0);
  for (int i = 0; i < 6; ++i) AddPoint(20.0 + i, 5.0 + i);
  std::vector<int> on_line;
  for (int i = 6; i < 36; ++i) on_line.push_back(i);
  AddLine(0.0, 0.0, 0.0, on_line);
  AddPoint(50.0, 50.0, /*is_linked=*/false);
  AddPoint(51.0, 50.0);
  const PointGraph points = Points();
  const CurveSearchOptions options;
  const SupportedCurves curves(graph_, points);
  CurveSearchRegion region(points, options);
  region.Take(curves);
  // Near the beginning of the line something changed.
  SupportedCurve touched;
  touched.found.support = {7};
  region.Touch(touched);
  const std::vector<bool> is_out = region.Take(curves);
  for (int i = 0; i < points.size(); ++i) {
    EXPECT_EQ(is_out[static_cast<std::size_t>(i)], i >= 6) << i;
  }
}

}  // namespace
}  // namespace plumbline
