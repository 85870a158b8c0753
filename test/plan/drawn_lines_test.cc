#include <gtest/gtest.h>
#include <plumbline/plan/drawn_lines.h>

#include <algorithm>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

WallLine LineBetween(const Vector2d& begin, const Vector2d& end) {
  WallLine line;
  line.origin = begin;
  line.along = (end - begin).normalized();
  line.end = (end - begin).norm();
  line.weight = line.end;
  return line;
}

// The front of a room, in line with the open end of a corridor, closes that
// end, also where a partition stands before the corridor.
TEST(DrawnLinesTest, APartitionIsNotTheWallThatALineIsDrawnOnTo) {
  std::vector<WallLine> lines = {LineBetween({5.0, 1.0}, {5.0, 10.0}),
                                 LineBetween({7.0, 1.0}, {7.0, 9.7}),
                                 LineBetween({14.0, 9.6}, {9.0, 9.6})};
  const auto front_ends = [&] {
    const DrawnLine front = DrawLines(lines, 6.0, 1.5)[2];
    return front.line.At(front.to)[0];
  };
  EXPECT_NEAR(front_ends(), 5.0, 0.05);
  lines.push_back(LineBetween({8.0, 9.0}, {8.0, 10.5}));
  EXPECT_NEAR(front_ends(), 5.0, 0.05);
  // A wall counts: two of them are enough.
  lines.push_back(LineBetween({8.0, 9.0}, {8.0, 14.0}));
  EXPECT_NEAR(front_ends(), 7.0, 0.05);
}

}  // namespace
}  // namespace plumbline
