#include <gtest/gtest.h>
#include <plumbline/detectors/direction_founder.h>
#include <plumbline/factors/angle.h>

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Walls whose directions (degrees) and lengths are given, known to 0.05 degrees
// against a node that is no wall.
struct FounderWalls {
  DirectionNetwork network;
  std::vector<DirectionWall> walls;

  FounderWalls(const std::vector<double>& angles,
               const std::vector<double>& lengths) {
    const std::size_t origin = network.AddNode(0.0);
    for (std::size_t i = 0; i < angles.size(); ++i) {
      DirectionWall wall;
      wall.node = network.AddNode(DegToRad(angles[i]));
      wall.length = lengths[i];
      network.AddLink(origin, wall.node, DegToRad(angles[i]),
                      DegToRad(0.05) * DegToRad(0.05), false);
      walls.push_back(wall);
    }
  }

  // All are rejected but the first `tied`.
  std::optional<std::size_t> Found(const std::vector<bool>& is_refused,
                                   std::size_t tied = 0) {
    const DirectionAssignmentOptions options;
    DirectionTies ties(std::move(network), walls, options);
    ties.Solve();
    std::vector<bool> is_rejected(walls.size(), true);
    for (std::size_t i = 0; i < tied; ++i) is_rejected[i] = false;
    return FindFounder(ties, walls, is_rejected, is_refused, options);
  }
};

TEST(FindFounderTest, WhereTheGreatestLengthAgrees) {
  // Two of 4 m at 50 degrees; three of 3 m at 20 degrees, one of them across.
  const std::vector<double> angles = {50.0, 50.0, 20.0, 110.0, 20.0};
  const std::vector<double> lengths = {4.0, 4.0, 3.0, 3.0, 3.0};
  const std::optional<std::size_t> founder =
      FounderWalls(angles, lengths).Found(std::vector<bool>(5, false));
  ASSERT_TRUE(founder.has_value());
  EXPECT_EQ(*founder, 2u);
  // Another one of them when that was tried.
  EXPECT_EQ(
      FounderWalls(angles, lengths).Found({false, false, true, false, false}),
      std::optional<std::size_t>(3));
  // Two are not enough: one is tied by now.
  EXPECT_EQ(FounderWalls({20.0, 20.0, 110.0}, {3.0, 3.0, 3.0})
                .Found(std::vector<bool>(3, false), 1),
            std::nullopt);
}

TEST(FindFounderTest, ShortWallsFoundNothing) {
  const std::vector<bool> none(4, false);
  EXPECT_EQ(
      FounderWalls({20.0, 20.0, 20.0, 20.0}, {0.9, 0.9, 0.9, 0.9}).Found(none),
      std::nullopt);
  // Fewer metres than a direction needs.
  EXPECT_EQ(
      FounderWalls({20.0, 20.0, 20.0, 20.0}, {1.1, 1.1, 1.1, 1.1}).Found(none),
      std::nullopt);
  EXPECT_TRUE(FounderWalls({20.0, 20.0, 20.0, 20.0}, {1.3, 1.3, 1.3, 1.3})
                  .Found(none)
                  .has_value());
}

// Long walls, each in a direction of its own, stand before no others.
TEST(FindFounderTest, ShorterWallsWhereNoneOfTheLongestAgree) {
  std::vector<double> angles;
  std::vector<double> lengths;
  for (int i = 0; i < 20; ++i) {
    angles.push_back(40.0 + 2.0 * i);
    lengths.push_back(6.0);
  }
  for (int i = 0; i < 6; ++i) {
    angles.push_back(i % 2 == 0 ? 10.0 : 100.0);
    lengths.push_back(3.0);
  }
  EXPECT_EQ(FounderWalls(angles, lengths).Found(std::vector<bool>(26, false)),
            std::optional<std::size_t>(20));
}

// Every wall in a direction of its own; by chance three of 400 agree.
TEST(FindFounderTest, ChanceFoundsNothing) {
  std::vector<double> angles;
  for (int i = 0; i < 400; ++i) angles.push_back(0.225 * i);
  EXPECT_EQ(FounderWalls(angles, std::vector<double>(400, 3.0))
                .Found(std::vector<bool>(400, false)),
            std::nullopt);
}

}  // namespace
}  // namespace plumbline
