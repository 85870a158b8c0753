#include <gtest/gtest.h>
#include <plumbline/frontend/way_lengths.h>

#include <vector>

namespace plumbline {
namespace {

TEST(WayLengthsTest, AddsUpStepsAndCutsJumps) {
  // Steps of 5, none (a turn on the spot) and 100 m.
  const std::vector<double> lengths = WayLengths(
      {{0.0, 0.0, 0.0}, {3.0, 4.0, 0.0}, {3.0, 4.0, 2.0}, {3.0, 104.0, 2.0}},
      6.0);
  EXPECT_EQ(lengths, (std::vector<double>{0.0, 5.0, 5.0, 11.0}));
}

TEST(WayLengthsTest, OfOnePoseAndNone) {
  EXPECT_EQ(WayLengths({{1.0, 2.0, 3.0}}, 2.0), std::vector<double>{0.0});
  EXPECT_TRUE(WayLengths({}, 2.0).empty());
}

}  // namespace
}  // namespace plumbline
