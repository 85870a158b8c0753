#include <gtest/gtest.h>
#include <plumbline/frontend/strided_scores.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace plumbline {
namespace {

TEST(FloorDividedTest, RoundsDown) {
  EXPECT_EQ(FloorDivided(7, 4), 1);
  EXPECT_EQ(FloorDivided(8, 4), 2);
  EXPECT_EQ(FloorDivided(0, 4), 0);
  EXPECT_EQ(FloorDivided(-1, 4), -1);
  EXPECT_EQ(FloorDivided(-4, 4), -1);
  EXPECT_EQ(FloorDivided(-5, 4), -2);
}

class StridedScoresTest : public ::testing::Test {
 protected:
  struct Cell {
    int x;
    int y;
  };

  // A grid of scores and more points than a sum of 16 bits can hold, some of
  // which no node brings onto the grid.
  StridedScoresTest() {
    std::mt19937 random(5);
    const auto draw = [&](int below) {
      return static_cast<int>(random() % static_cast<unsigned>(below));
    };
    for (int k = 0; k < kColumns * kRows; ++k) {
      grid_.push_back(static_cast<std::int16_t>(draw(384) - 128));
    }
    for (int k = 0; k < 700; ++k) cells_.push_back({draw(600) - 300, 0});
    for (Cell& cell : cells_) cell.y = draw(300) - 150;
    std::sort(cells_.begin(), cells_.end(),
              [](const Cell& a, const Cell& b) { return a.y < b.y; });
  }

  int SumAt(int column, int row) const {
    int sum = 0;
    for (const Cell& cell : cells_) {
      const int x = cell.x + StridedScores::kStride * column;
      const int y = cell.y + StridedScores::kStride * row;
      if (x < 0 || y < 0 || x >= kColumns || y >= kRows) continue;
      sum += grid_[static_cast<std::size_t>(y * kColumns + x)];
    }
    return sum;
  }

  std::vector<std::int32_t> Sums(const std::vector<NodeRun>& runs,
                                 double least) const {
    const StridedScores scores(grid_, kColumns, kRows);
    std::vector<StridedScores::Place> places;
    for (const Cell& cell : cells_) {
      places.push_back(scores.PlaceOf(cell.x, cell.y));
    }
    // Of another search.
    std::vector<std::int32_t> sums(1000, 77);
    scores.Sum(places, runs.data(), runs.size(), least, &sums);
    return sums;
  }

  static constexpr int kColumns = 403;
  static constexpr int kRows = 142;
  std::vector<std::int16_t> grid_;
  std::vector<Cell> cells_;
};

TEST_F(StridedScoresTest, SumsOfEachNode) {
  // Of every width that is added up at once, and rows from before the grid to
  // behind it.
  std::vector<NodeRun> runs;
  for (const int count : {1, 15, 16, 17, 33, 50, 64, 65, 130}) {
    for (const int row : {-80, -21, 0, 3, 40, 79}) {
      runs.push_back({-60, row, count});
      runs.push_back({31, row, count});
    }
  }
  const std::vector<std::int32_t> sums = Sums(runs, -1e9);
  std::size_t first = 0;
  for (const NodeRun& run : runs) {
    for (int k = 0; k < run.count; ++k) {
      ASSERT_EQ(sums[first + static_cast<std::size_t>(k)],
                SumAt(run.column + k, run.row))
          << run.column << ' ' << k << ' ' << run.row;
    }
    first += StridedScores::LanesOf(run);
  }
  EXPECT_EQ(sums.size(), first);
}

TEST_F(StridedScoresTest, NodesThatCannotBeGoodEnough) {
  const std::vector<NodeRun> runs = {{-20, 1, 48}, {10, 2, 16}};
  std::vector<std::int32_t> exact;
  for (const NodeRun& run : runs) {
    for (int k = 0; k < run.count; ++k) {
      exact.push_back(SumAt(run.column + k, run.row));
    }
  }
  const int best = *std::max_element(exact.begin(), exact.end());
  const std::vector<std::int32_t> sums = Sums(runs, best);
  for (std::size_t k = 0; k < exact.size(); ++k) {
    EXPECT_TRUE(sums[k] == exact[k] || sums[k] == 0) << k;
    if (exact[k] == best) {
      EXPECT_EQ(sums[k], best);
    }
  }
  const std::vector<std::int32_t> none = Sums(runs, best + 1e6);
  EXPECT_EQ(none, std::vector<std::int32_t>(exact.size(), 0));
}

}  // namespace
}  // namespace plumbline
