#include <gtest/gtest.h>
#include <plumbline/frontend/bucket_starts.h>

#include <random>
#include <vector>

namespace plumbline {
namespace {

// The points before each cell, counted.
std::vector<std::vector<int>> CountBefore(
    const std::vector<std::vector<int>>& points) {
  std::vector<std::vector<int>> before;
  int count = 0;
  for (const std::vector<int>& row : points) {
    before.emplace_back();
    for (const int here : row) {
      before.back().push_back(count);
      count += here;
    }
    before.back().push_back(count);
  }
  return before;
}

void ExpectCounted(const std::vector<std::vector<int>>& points,
                   BucketStarts* starts) {
  const int rows = static_cast<int>(points.size());
  const int columns = static_cast<int>(points[0].size());
  starts->Reset(columns, rows);
  int count = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (points[row][column] == 0) continue;
      starts->Begin(column, row, count);
      count += points[row][column];
    }
  }
  starts->Finish(count);
  const std::vector<std::vector<int>> before = CountBefore(points);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      EXPECT_EQ(starts->Before(column, row), before[row][column])
          << column << ' ' << row;
    }
  }
}

TEST(BucketStartsTest, AFewCells) {
  BucketStarts starts;
  ExpectCounted({{0, 0, 3, 0}, {0, 0, 0, 0}, {1, 0, 0, 2}}, &starts);
  ExpectCounted({{0}}, &starts);
  ExpectCounted({{5}}, &starts);
}

// Widths around those of one and two blocks; rasters from empty to full, one
// after the other in the same memory.
TEST(BucketStartsTest, AnyRaster) {
  std::mt19937 random(3);
  BucketStarts starts;
  for (const int columns : {1, 15, 16, 17, 31, 32, 33, 100}) {
    for (const double share : {0.0, 0.02, 0.3, 1.0}) {
      std::bernoulli_distribution has_points(share);
      std::vector<std::vector<int>> points(7, std::vector<int>(columns, 0));
      for (std::vector<int>& row : points) {
        for (int& here : row) {
          if (has_points(random)) here = 1 + static_cast<int>(random() % 4);
        }
      }
      ExpectCounted(points, &starts);
    }
  }
}

}  // namespace
}  // namespace plumbline
