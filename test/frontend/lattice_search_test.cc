#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/lattice_search.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr int kSize = 60;
constexpr double kCell = 0.1;

// A field of walls at x = 4 and y = 2 m, blurred by a cell, seen from (3, 3).
class LatticeSearchTest : public ::testing::Test {
 protected:
  LatticeSearchTest() : likelihood_(kSize * kSize, 0) {
    for (int i = 0; i < kSize; ++i) {
      for (int off = -1; off <= 1; ++off) {
        Mark(40 + off, i, off == 0 ? 255 : 155);
        Mark(i, 20 + off, off == 0 ? 255 : 155);
      }
    }
    // What a robot sees that stands 0.3 m to the right, 0.2 m further up and is
    // turned by 4 degrees.
    const double turn = DegToRad(4.0);
    for (double t = -2.5; t <= 2.5; t += 0.1) {
      for (const Eigen::Vector2d& at :
           {Eigen::Vector2d(4.05, 3.2 + t), Eigen::Vector2d(3.3 + t, 2.05)}) {
        points_.push_back(Eigen::Rotation2Dd(-turn) *
                          (at - Eigen::Vector2d(3.3, 3.2)));
      }
    }
  }

  void Mark(int column, int row, std::uint8_t value) {
    std::uint8_t& cell = likelihood_[row * kSize + column];
    cell = std::max(cell, value);
  }

  FieldView Field() const {
    return {likelihood_, kSize, kSize, kCell, {30.0, 30.0}};
  }

  std::vector<std::uint8_t> likelihood_;
  std::vector<Eigen::Vector2d> points_;
};

// Windows with few and with many steps are searched in other ways.
TEST_F(LatticeSearchTest, FindsThePose) {
  for (const int steps : {4, 5, 8, 13}) {
    const LatticePose found = FindBestOnLattice(
        Field(), points_, {0.0, DegToRad(10.0), DegToRad(1.0), steps, 0.1});
    EXPECT_EQ(found.column, 3) << steps;
    EXPECT_EQ(found.row, 2) << steps;
    EXPECT_NEAR(found.angle, DegToRad(4.0), DegToRad(1.01)) << steps;
    EXPECT_GT(found.score, 0.8);
    EXPECT_LE(found.score, 1.0);
  }
}

// The score of a pose does not depend on which others are looked at.
TEST_F(LatticeSearchTest, NoSmallerWindowHasABetterPose) {
  std::mt19937 random(3);
  for (std::uint8_t& cell : likelihood_) cell = random() % 256;
  const LatticePose wide = FindBestOnLattice(
      Field(), points_, {0.0, DegToRad(6.0), DegToRad(2.0), 10, 0.1});
  for (const int steps : {0, 1, 3, 7, 9}) {
    const LatticePose found = FindBestOnLattice(
        Field(), points_, {0.0, DegToRad(6.0), DegToRad(2.0), steps, 0.1});
    EXPECT_LE(found.score, wide.score) << steps;
    if (std::abs(wide.row) <= steps && std::abs(wide.column) <= steps) {
      EXPECT_EQ(found.score, wide.score) << steps;
    }
  }
}

TEST_F(LatticeSearchTest, WhereNothingFitsThePredictionStands) {
  std::fill(likelihood_.begin(), likelihood_.end(), 0);
  for (const int steps : {3, 12}) {
    const LatticePose found = FindBestOnLattice(
        Field(), points_, {0.5, DegToRad(10.0), DegToRad(1.0), steps, 0.1});
    EXPECT_EQ(found.score, 0.0);
    EXPECT_EQ(found.angle, 0.0);
    EXPECT_EQ(found.row, 0);
    EXPECT_EQ(found.column, 0);
  }
}

TEST_F(LatticeSearchTest, OutsideOfTheFieldThereIsNothing) {
  const FieldView field = Field();
  EXPECT_EQ(field.At(-1, 20), 0);
  EXPECT_EQ(field.At(20, kSize), 0);
  EXPECT_EQ(field.At(40, 59), 255);
  EXPECT_EQ(field.At(41, 50), 155);
}

}  // namespace
}  // namespace plumbline
