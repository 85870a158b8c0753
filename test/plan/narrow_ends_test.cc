#include <gtest/gtest.h>
#include <plumbline/plan/narrow_ends.h>

#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

void AddEdge(const Vector2d& begin, const Vector2d& end, int left, int right,
             Mark mark, Arrangement* arrangement) {
  ArrangementEdge edge;
  edge.begin = begin;
  edge.end = end;
  edge.left = left;
  edge.right = right;
  edge.lengths.metres[static_cast<std::size_t>(mark)] = (end - begin).norm();
  arrangement->edges.push_back(edge);
}

Polygon SpaceWithin(double x1, double y1, double x2, double y2) {
  return {{{x1, y1}, {x2, y1}, {x2, y2}, {x1, y2}}, {}};
}

// A gap of 1 by 3 m; above it a space 1 m wide and `height` m high, to which it
// opens in its whole width.
Arrangement GapBelow(double height) {
  Arrangement arrangement;
  arrangement.faces = {SpaceWithin(0, 0, 1, 3),
                       SpaceWithin(0, 3, 1, 3 + height)};
  AddEdge({0, 3}, {1, 3}, 1, 0, Mark::kOpen, &arrangement);
  AddEdge({0, 0}, {1, 0}, 0, -1, Mark::kWall, &arrangement);
  AddEdge({1, 0}, {1, 3}, 0, -1, Mark::kWall, &arrangement);
  AddEdge({0, 3}, {0, 0}, 0, -1, Mark::kWall, &arrangement);
  AddEdge({1, 3}, {1, 3 + height}, 1, -1, Mark::kWall, &arrangement);
  AddEdge({1, 3 + height}, {0, 3 + height}, 1, -1, Mark::kWall, &arrangement);
  AddEdge({0, 3 + height}, {0, 3}, 1, -1, Mark::kWall, &arrangement);
  return arrangement;
}

std::vector<int> Joined(double height, const std::vector<Pose2>& path) {
  std::vector<int> region = {0, 1};
  JoinNarrowEnds(GapBelow(height), path, &region);
  return region;
}

TEST(NarrowEndsTest, AGapGoesToTheLargerSpace) {
  EXPECT_EQ(Joined(20.0, {}), (std::vector<int>{1, 1}));
  EXPECT_EQ(Joined(4.0, {}), (std::vector<int>{1, 1}));
}

TEST(NarrowEndsTest, NotWhatTheRobotWasIn) {
  EXPECT_EQ(Joined(20.0, {Pose2(0.5, 1.0, 0.0)}), (std::vector<int>{0, 1}));
}

// Each could go to the other.
TEST(NarrowEndsTest, TwoGapsOfOneSizeAreLeft) {
  EXPECT_EQ(Joined(3.0, {}), (std::vector<int>{0, 1}));
}

}  // namespace
}  // namespace plumbline
