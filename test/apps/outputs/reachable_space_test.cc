#include <gtest/gtest.h>
#include <plumbline/outputs/reachable_space.h>

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

}  // namespace
}  // namespace plumbline
