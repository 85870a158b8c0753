#include <gtest/gtest.h>
#include <plumbline/outputs/reachable_space.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ReachStarts = std::vector<std::pair<int, int>>;

// Rows from the first on: '#' occupied, '.' free, ' ' unknown.
SeenCells CellsOfRows(const std::vector<std::string>& rows) {
  SeenCells seen;
  seen.width = static_cast<int>(rows.front().size());
  seen.height = static_cast<int>(rows.size());
  for (const std::string& row : rows) {
    for (const char c : row) {
      seen.cells.push_back(c == '#'   ? SeenCells::kOccupied
                           : c == '.' ? SeenCells::kFree
                                      : SeenCells::kUnknown);
    }
  }
  return seen;
}

std::vector<std::string> RowsOfCells(const SeenCells& seen) {
  std::vector<std::string> rows;
  for (std::size_t i = 0; i < seen.cells.size(); ++i) {
    if (i % static_cast<std::size_t>(seen.width) == 0) rows.emplace_back();
    rows.back() += seen.cells[i] == SeenCells::kOccupied ? '#'
                   : seen.cells[i] == SeenCells::kFree   ? '.'
                                                         : ' ';
  }
  return rows;
}

std::vector<std::string> KeptRows(const std::vector<std::string>& rows,
                                  const ReachStarts& starts,
                                  const ReachOptions& options) {
  SeenCells seen = CellsOfRows(rows);
  KeepReachable(starts, options, &seen);
  return RowsOfCells(seen);
}

ReachOptions ReachOfBody(int body) {
  ReachOptions options;
  options.body = body;
  options.behind = 2;
  options.pocket = 0;
  return options;
}

TEST(KeepReachableTest, WhatLiesBehindACrackIsForgotten) {
  const std::vector<std::string> seen = {
      "#############   ",  //
      "#....#......#   ",  //
      "#....#......# ##",  //
      "#...........# ##",  //
      "#....#......#   ",  //
      "#....#......#   ",  //
      "#############   ",
  };
  // A body of one cell passes, one of three does not.
  EXPECT_EQ(KeptRows(seen, {{2, 3}}, ReachOfBody(0)),
            (std::vector<std::string>{
                "#############   ",  //
                "#....#......#   ",  //
                "#....#......#   ",  //
                "#...........#   ",  //
                "#....#......#   ",  //
                "#....#......#   ",  //
                "#############   ",
            }));
  EXPECT_EQ(KeptRows(seen, {{2, 3}}, ReachOfBody(1)),
            (std::vector<std::string>{
                "######          ",  //
                "#....#          ",  //
                "#....#          ",  //
                "#......         ",  //
                "#....#          ",  //
                "#....#          ",  //
                "######          ",
            }));
}

TEST(KeepReachableTest, PocketsStayAndGlimpsesGo) {
  const std::vector<std::string> seen = {
      "....#          ",  //
      "...............",  //
      "....#          ",  //
      "....##         ",  //
      "......#        ",  //
      "....##         ",  //
      "....#          ",
  };
  ReachOptions options = ReachOfBody(1);
  options.pocket = 4;
  EXPECT_EQ(KeptRows(seen, {{1, 3}}, options), (std::vector<std::string>{
                                                   "....#          ",  //
                                                   "......         ",  //
                                                   "....#          ",  //
                                                   "....##         ",  //
                                                   "......#        ",  //
                                                   "....##         ",  //
                                                   "....#          ",
                                               }));
  // As far as that it is a pocket, too.
  options.pocket = 12;
  EXPECT_EQ(KeptRows(seen, {{1, 3}}, options), seen);
}

TEST(KeepReachableTest, EveryStartHasItsPart) {
  const std::vector<std::string> seen = {
      "...#...#...",  //
      "...#...#...",  //
      "...#...#...",
  };
  EXPECT_EQ(KeptRows(seen, {{1, 1}, {9, 1}}, ReachOfBody(1)),
            (std::vector<std::string>{
                "...#   #...",  //
                "...#   #...",  //
                "...#   #...",
            }));
  // A start in a corner is near enough to the middle; one outside is none.
  EXPECT_EQ(KeptRows(seen, {{4, 0}, {-1, 1}, {1, 30}}, ReachOfBody(1)),
            (std::vector<std::string>{
                "   #...#   ",  //
                "   #...#   ",  //
                "   #...#   ",
            }));
  EXPECT_EQ(KeptRows(seen, {}, ReachOfBody(1)),
            std::vector<std::string>(3, std::string(11, ' ')));
}

TEST(KeepReachableTest, GapsBetweenRaysHinderNobody) {
  const std::vector<std::string> seen = {
      "...........",  //
      "....       ",  //
      "...........",  //
      "....       ",  //
      "...........",
  };
  const std::vector<std::string> lost = {
      "......     ",  //
      "....       ",  //
      "......     ",  //
      "....       ",  //
      "......     ",
  };
  EXPECT_EQ(KeptRows(seen, {{1, 2}}, ReachOfBody(1)), lost);
  ReachOptions options = ReachOfBody(1);
  options.gap = [](int, int) { return 1; };
  EXPECT_EQ(KeptRows(seen, {{1, 2}}, options), seen);
  // Only where rays are so far apart.
  options.gap = [](int column, int) { return column < 7 ? 1 : 0; };
  const std::vector<std::string> partly = KeptRows(seen, {{1, 2}}, options);
  EXPECT_EQ(partly[0], ".........  ");
  EXPECT_EQ(partly[1], "....       ");
  // What was hit is no gap.
  options.gap = [](int, int) { return 5; };
  EXPECT_EQ(
      KeptRows({".....#....", ".....#....", ".....#...."}, {{1, 1}}, options),
      (std::vector<std::string>(3, ".....#    ")));
}

// What is documented, cell by cell and as slowly as it reads.
class SlowReach {
 public:
  SlowReach(const SeenCells& seen, const ReachOptions& options)
      : seen_(seen), options_(options) {}

  SeenCells Keep(const ReachStarts& starts) const {
    const std::vector<bool> free = Where(SeenCells::kFree);
    std::vector<bool> closed = free;
    closed.flip();
    closed = Near(closed, options_.body);
    std::vector<bool> fits = free;
    for (std::size_t i = 0; i < fits.size(); ++i) {
      if (closed[i]) fits[i] = false;
    }
    std::vector<bool> began(free.size(), false);
    for (const auto& [column, row] : starts) {
      for (int y = row - options_.body; y <= row + options_.body; ++y) {
        for (int x = column - options_.body; x <= column + options_.body; ++x) {
          if (IsInside(x, y)) began[Index(x, y)] = true;
        }
      }
    }
    std::vector<bool> reached = Near(Connected(fits, began), options_.body + 1);
    std::vector<bool> rest = free;
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (reached[i]) rest[i] = false;
      if (!free[i]) reached[i] = false;
    }
    std::vector<bool> away = Near(reached, options_.pocket);
    away.flip();
    const std::vector<bool> glimpses = Connected(rest, away);
    SeenCells kept = seen_;
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (glimpses[i]) kept.cells[i] = SeenCells::kUnknown;
    }
    std::vector<bool> left(free.size());
    for (std::size_t i = 0; i < free.size(); ++i) {
      left[i] = kept.cells[i] == SeenCells::kFree;
    }
    left = Near(left, options_.behind);
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (kept.cells[i] == SeenCells::kOccupied && !left[i]) {
        kept.cells[i] = SeenCells::kUnknown;
      }
    }
    return kept;
  }

 private:
  bool IsInside(int x, int y) const {
    return x >= 0 && y >= 0 && x < seen_.width && y < seen_.height;
  }
  std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y) * seen_.width + x;
  }
  std::vector<bool> Where(std::uint8_t value) const {
    std::vector<bool> cells;
    for (const std::uint8_t cell : seen_.cells) cells.push_back(cell == value);
    return cells;
  }
  // Cells with one of `cells` within `radius`, from middle to middle.
  std::vector<bool> Near(const std::vector<bool>& cells, int radius) const {
    std::vector<bool> near(cells.size(), false);
    for (int y = 0; y < seen_.height; ++y) {
      for (int x = 0; x < seen_.width; ++x) {
        if (!cells[Index(x, y)]) continue;
        for (int v = y - radius; v <= y + radius; ++v) {
          for (int u = x - radius; u <= x + radius; ++u) {
            if (IsInside(u, v) &&
                (u - x) * (u - x) + (v - y) * (v - y) <= radius * radius) {
              near[Index(u, v)] = true;
            }
          }
        }
      }
    }
    return near;
  }
  // Those of `cells` that hang together, by sides or corners, with one that is
  // also among `first`.
  std::vector<bool> Connected(const std::vector<bool>& cells,
                              const std::vector<bool>& first) const {
    std::vector<bool> connected(cells.size());
    for (std::size_t i = 0; i < cells.size(); ++i) {
      connected[i] = cells[i] && first[i];
    }
    for (bool grows = true; grows;) {
      grows = false;
      const std::vector<bool> near = Near(connected, 1);
      for (int y = 0; y < seen_.height; ++y) {
        for (int x = 0; x < seen_.width; ++x) {
          const std::size_t i = Index(x, y);
          if (!cells[i] || connected[i]) continue;
          bool touches = near[i];
          for (const int v : {y - 1, y + 1}) {
            for (const int u : {x - 1, x + 1}) {
              touches |= IsInside(u, v) && connected[Index(u, v)];
            }
          }
          if (touches) connected[i] = grows = true;
        }
      }
    }
    return connected;
  }

  const SeenCells& seen_;
  const ReachOptions& options_;
};

// Rasters of several blocks of cells with rooms, walls with cracks and stray
// cells, some rows with nothing.
TEST(KeepReachableTest, AsTheDefinitionSays) {
  std::mt19937 engine(3);
  const auto draw = [&engine](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(engine);
  };
  int changed = 0;
  for (int trial = 0; trial < 12; ++trial) {
    SeenCells seen;
    seen.width = draw(60, 210);
    seen.height = draw(20, 50);
    seen.cells.assign(static_cast<std::size_t>(seen.width) * seen.height,
                      SeenCells::kUnknown);
    const auto fill = [&](int x0, int x1, int y0, int y1, std::uint8_t value) {
      for (int y = std::max(0, y0); y < std::min(seen.height, y1); ++y) {
        for (int x = std::max(0, x0); x < std::min(seen.width, x1); ++x) {
          seen.cells[static_cast<std::size_t>(y) * seen.width + x] = value;
        }
      }
    };
    for (int room = 0; room < 9; ++room) {
      const int x = draw(-5, seen.width);
      const int y = draw(-5, seen.height);
      fill(x, x + draw(3, 60), y, y + draw(3, 20), SeenCells::kFree);
    }
    for (int wall = 0; wall < 8; ++wall) {
      const int x = draw(0, seen.width);
      fill(x, x + draw(1, 2), draw(0, 10), draw(10, seen.height),
           SeenCells::kOccupied);
    }
    for (int stray = 0; stray < 200; ++stray) {
      const int x = draw(0, seen.width);
      const int y = draw(0, seen.height);
      fill(x, x + 1, y, y + 1, static_cast<std::uint8_t>(draw(0, 2)));
    }
    ReachOptions options;
    options.body = draw(0, 3);
    options.pocket = draw(0, 9);
    options.behind = draw(1, 5);
    const ReachStarts starts = {
        {draw(-3, seen.width), draw(-3, seen.height)},
        {draw(0, seen.width - 1), draw(0, seen.height - 1)}};
    SeenCells kept = seen;
    KeepReachable(starts, options, &kept);
    EXPECT_EQ(RowsOfCells(kept),
              RowsOfCells(SlowReach(seen, options).Keep(starts)))
        << trial;
    changed += kept.cells != seen.cells;
  }
  EXPECT_GT(changed, 6);
}

}  // namespace
}  // namespace plumbline
