#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/frontend/return_cells.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <set>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;
using ::testing::ElementsAre;

constexpr double kCell = 0.05;
constexpr double kRadius = 0.3;
constexpr double kGap = 0.4;

std::vector<int> Near(const ReturnCells& returns, const Vector2d& place,
                      double radius) {
  std::vector<int> found;
  returns.VisitNear(place, radius, [&](int index) { found.push_back(index); });
  std::sort(found.begin(), found.end());
  return found;
}

TEST(ReturnCellsTest, ReturnsOfOneCellAreGathered) {
  ReturnCells returns(kCell, kRadius, kGap);
  returns.Add({1.01, 2.01}, {1.0, 0.0}, 3);
  returns.Add({1.03, 2.03}, {0.0, 1.0}, 3);
  returns.Add({1.02, 2.02}, {1.0, 0.0}, 5);
  returns.Add({1.06, 2.02}, {1.0, 0.0}, 5);
  returns.Finish();
  ASSERT_EQ(returns.cells().size(), 2u);
  const ReturnCells::Cell& cell = returns.cells()[0];
  EXPECT_EQ(cell.returns, 3);
  EXPECT_NEAR((cell.mean - Vector2d(1.02, 2.02)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((cell.view - Vector2d(-2.0, -1.0)).norm(), 0.0, 1e-12);
  const auto [first, last] = returns.ScansOf(0);
  EXPECT_THAT(std::vector<std::size_t>(first, last), ElementsAre(3u, 5u));
  const auto [first_beside, last_beside] = returns.ScansOf(1);
  EXPECT_THAT(std::vector<std::size_t>(first_beside, last_beside),
              ElementsAre(5u));
}

// Negative numbers cannot be shifted: sanitizers look at this one (test/fuzz).
TEST(ReturnCellsTest, EveryCellHasAKeyOfItsOwn) {
  std::set<std::int64_t> keys;
  for (std::int64_t column : {-3, -1, 0, 1, 3}) {
    for (std::int64_t row : {-3, -1, 0, 1, 3}) {
      keys.insert(CellKey(column, row));
    }
  }
  EXPECT_EQ(keys.size(), 25u);
  ReturnCells returns(kCell, kRadius, kGap);
  for (const double x : {-7.03, 7.03}) {
    for (const double y : {-4.02, 4.02}) returns.Add({x, y}, {1.0, 0.0}, 0);
  }
  returns.Finish();
  EXPECT_EQ(returns.cells().size(), 4u);
  EXPECT_THAT(Near(returns, {-7.0, -4.0}, 0.1), ElementsAre(0));
}

// Single returns all around a wall that was seen twenty times leave it no
// direction, unless they are left out.
TEST(ReturnCellsTest, StraysAroundAWallAreLeftOut) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> at(-1.0, 1.0);
  for (const bool leaves_out : {false, true}) {
    ReturnCells returns(kCell, kRadius, kGap);
    for (int i = 0; i < 20; ++i) {
      for (double x = -1.0 + 0.5 * kCell; x < 1.0; x += kCell) {
        returns.Add({x, 0.02}, {0.0, 1.0}, static_cast<std::size_t>(i));
      }
    }
    for (int i = 0; i < 1500; ++i) {
      returns.Add({at(random), at(random)}, {0.0, 1.0}, 20);
    }
    returns.Finish(leaves_out ? 0.2 : 0.0);
    int straight = 0;
    for (const ReturnCells::Cell& cell : returns.cells()) {
      if (cell.returns < 5) {
        const double off = std::abs(cell.mean.y() - 0.02);
        if (off < 0.2) {
          EXPECT_EQ(cell.used, leaves_out);
        }
        if (off > 0.35) {
          EXPECT_FALSE(cell.used);
        }
      } else if (cell.straightness > 0.0) {
        ++straight;
        EXPECT_LT(std::abs(cell.direction.y()), 0.05);
      }
    }
    EXPECT_EQ(straight > 20, leaves_out) << straight;
  }
}

TEST(ReturnCellsTest, CellsNearAPlaceAreThoseOfALookAtAll) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> at(-2.0, 2.0);
  ReturnCells returns(kCell, kRadius, kGap);
  for (int i = 0; i < 500; ++i) {
    returns.Add({at(random), at(random)}, {1.0, 0.0}, 0);
  }
  returns.Finish();
  for (int k = 0; k < 50; ++k) {
    const Vector2d place(at(random), at(random));
    std::vector<int> expected;
    for (std::size_t i = 0; i < returns.cells().size(); ++i) {
      if ((returns.cells()[i].mean - place).norm() <= 0.35) {
        expected.push_back(static_cast<int>(i));
      }
    }
    EXPECT_EQ(Near(returns, place, 0.35), expected);
  }
}

TEST(ReturnCellsTest, CellsAlongALineAreFoundOnce) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> at(-2.0, 2.0);
  ReturnCells returns(kCell, kRadius, kGap);
  for (int i = 0; i < 500; ++i) {
    returns.Add({at(random), at(random)}, {1.0, 0.0}, 0);
  }
  returns.Finish();
  const Vector2d direction(std::cos(0.4), std::sin(0.4));
  const Vector2d normal(-direction.y(), direction.x());
  constexpr double kReach = 0.1;
  for (int seed = 0; seed < 50; ++seed) {
    const Vector2d point = returns.cells()[seed].mean;
    ReturnCells::Marks marks;
    returns.Mark(seed, &marks);
    std::vector<int> found;
    const auto look = [&](int index, const Vector2d& mean, std::size_t slot) {
      EXPECT_EQ(mean, returns.cells()[index].mean);
      if ((mean - point).norm() > kGap ||
          std::abs(normal.dot(mean - point)) > kReach) {
        return;
      }
      marks.Settle(slot);
      found.push_back(index);
    };
    for (int times = 0; times < 2; ++times) {
      returns.VisitAlong(seed, kGap * kGap, point, direction, kReach, &marks,
                         look);
    }
    std::sort(found.begin(), found.end());
    std::vector<int> expected;
    for (std::size_t i = 0; i < returns.cells().size(); ++i) {
      const Vector2d offset = returns.cells()[i].mean - point;
      if (static_cast<int>(i) != seed && offset.norm() <= kGap &&
          std::abs(normal.dot(offset)) <= kReach) {
        expected.push_back(static_cast<int>(i));
      }
    }
    EXPECT_EQ(found, expected) << seed;
    marks.Clear();
    EXPECT_THAT(marks.is_settled, ::testing::Each(0));
  }
}

TEST(ReturnCellsTest, UsedCellsAreNotFoundAnyMore) {
  ReturnCells returns(kCell, kRadius, kGap);
  for (int i = 0; i < 10; ++i) {
    returns.Add({0.1 * i + 0.01, 0.01}, {0.0, 1.0}, 0);
  }
  returns.Finish();
  returns.Use(4);
  returns.Use(4);
  returns.DropUsed();
  EXPECT_THAT(Near(returns, {0.41, 0.01}, 0.15), ElementsAre(3, 5));
}

TEST(ReturnCellsTest, DirectionsWhereTheSurfaceIsStraight) {
  ReturnCells returns(kCell, kRadius, kGap);
  const Vector2d direction(std::cos(0.7), std::sin(0.7));
  for (int i = 0; i < 60; ++i) returns.Add(0.05 * i * direction, {1, 0}, 0);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> at(0.0, 1.0);
  for (int i = 0; i < 300; ++i) {
    returns.Add({10.0 + at(random), at(random)}, {1, 0}, 0);
  }
  returns.Finish();
  int straight = 0;
  for (const ReturnCells::Cell& cell : returns.cells()) {
    if (cell.mean.x() > 9.0) {
      EXPECT_EQ(cell.straightness, 0.0);
    } else if (cell.straightness > 0.0) {
      ++straight;
      EXPECT_NEAR(std::abs(cell.direction.dot(direction)), 1.0, 1e-9);
    }
  }
  EXPECT_GT(straight, 50);
}

}  // namespace
}  // namespace plumbline
