#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/detectors/place_match.h>

#include <cmath>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// The face of a wall from one point to another; its reference point is a third
// of the way along.
PlaceWall Face(double x1, double y1, double x2, double y2) {
  PlaceWall wall;
  const Vector2d begin(x1, y1);
  const Vector2d along = Vector2d(x2, y2) - begin;
  wall.position = begin + along / 3.0;
  wall.direction = std::atan2(along.y(), along.x());
  wall.begin = -along.norm() / 3.0;
  wall.end = along.norm() * 2.0 / 3.0;
  return wall;
}

// What would be seen where the second place is displaced by the inverse of
// `displacement` about the origin.
std::vector<PlaceWall> MovedBack(std::vector<PlaceWall> walls,
                                 const Vector3d& displacement) {
  const double c = std::cos(displacement[2]);
  const double s = std::sin(displacement[2]);
  Eigen::Matrix2d rotation;
  rotation << c, s, -s, c;
  for (PlaceWall& wall : walls) {
    wall.position = rotation * (wall.position - displacement.head<2>());
    wall.direction -= displacement[2];
  }
  return walls;
}

Matrix3d Prior(double x, double y, double degrees = 0.5) {
  const double angle = DegToRad(degrees);
  return Vector3d(x * x, y * y, angle * angle).asDiagonal();
}

// Two walls along x, 2 m apart, seen from between.
std::vector<PlaceWall> Corridor(double y = 0.0) {
  return {Face(-6.0, y - 1.0, 6.0, y - 1.0), Face(6.0, y + 1.0, -6.0, y + 1.0)};
}

// A room of 5 m by 4 m with a niche and a pillar: four lines each way.
std::vector<PlaceWall> Room() {
  return {Face(0.0, 0.0, 5.0, 0.0), Face(5.0, 0.0, 5.0, 4.0),
          Face(5.0, 4.0, 0.0, 4.0), Face(0.0, 4.0, 0.0, 0.0),
          Face(1.0, 3.2, 0.2, 3.2), Face(1.0, 4.0, 1.0, 3.2),
          Face(3.0, 1.5, 3.0, 2.5), Face(3.0, 1.5, 4.0, 1.5)};
}

std::set<std::pair<int, int>> Pairs(const PlaceMatch& match) {
  std::set<std::pair<int, int>> pairs;
  for (const WallMatch& wall : match.matches) {
    pairs.insert({wall.first, wall.second});
  }
  return pairs;
}

PlaceMatch Match(const std::vector<PlaceWall>& first,
                 const std::vector<PlaceWall>& second, const Matrix3d& prior) {
  return MatchPlaces(first, second, Vector2d::Zero(), prior,
                     PlaceMatchOptions());
}

TEST(PlaceMatchTest, RoomInANarrowSearch) {
  const Vector3d displacement(0.21, -0.13, DegToRad(0.6));
  const PlaceMatch match =
      Match(Room(), MovedBack(Room(), displacement), Prior(0.15, 0.15));
  // To a tenth: pulled a little to what is most probable beforehand.
  EXPECT_NEAR(match.displacement[0], displacement[0], 0.02);
  EXPECT_NEAR(match.displacement[1], displacement[1], 0.02);
  EXPECT_NEAR(match.displacement[2], displacement[2], DegToRad(0.2));
  for (int i = 0; i < 8; ++i) EXPECT_EQ(Pairs(match).count({i, i}), 1u) << i;
  EXPECT_EQ(match.matches.size(), 8u);
  for (const WallMatch& wall : match.matches) {
    EXPECT_NEAR(wall.offset, 0.0, 0.08);
  }
  // The long wall's common part: 5 m, its middle 5/2 - 5/3 from the reference.
  EXPECT_NEAR(match.matches[0].overlap, 5.0, 0.3);
  EXPECT_NEAR(match.matches[0].along, 5.0 / 6.0, 0.15);
}

TEST(PlaceMatchTest, RoomInAWideSearch) {
  const Vector3d displacement(3.1, -2.3, DegToRad(4.0));
  const PlaceMatch match =
      Match(Room(), MovedBack(Room(), displacement), Prior(2.0, 2.0, 3.0));
  EXPECT_EQ(match.matches.size(), 8u);
  EXPECT_NEAR(match.displacement[0], displacement[0], 0.03);
  EXPECT_NEAR(match.displacement[1], displacement[1], 0.03);
  EXPECT_GT(match.evidence, PlaceMatchOptions().min_evidence);
  EXPECT_NEAR(match.search, 6.0, 1.0);
}

// A search of 6 m across every wall: not looked at by who asks for 5 m, and no
// narrower than what is found when it is.
TEST(PlaceMatchTest, AWiderSearchThanIsAskedForWaits) {
  const std::vector<PlaceWall> second =
      MovedBack(Room(), Vector3d(3.1, -2.3, DegToRad(4.0)));
  const Matrix3d prior = Prior(2.0, 2.0, 3.0);
  const PlaceMatch waiting = MatchPlaces(Room(), second, Vector2d::Zero(),
                                         prior, PlaceMatchOptions(), 5.0);
  EXPECT_EQ(waiting.outcome, PlaceMatch::Outcome::kTooWide);
  EXPECT_TRUE(waiting.matches.empty());
  EXPECT_GT(waiting.search, 6.0);
  const PlaceMatch looked = MatchPlaces(Room(), second, Vector2d::Zero(), prior,
                                        PlaceMatchOptions(), waiting.search);
  EXPECT_EQ(looked.matches.size(), 8u);
  EXPECT_GE(looked.search, waiting.search);
  // Along a corridor it may be as wide as it likes.
  EXPECT_EQ(
      MatchPlaces(Corridor(), MovedBack(Corridor(), Vector3d(0.4, 0.12, 0.0)),
                  Vector2d::Zero(), Prior(2.0, 0.15), PlaceMatchOptions(), 0.7)
          .matches.size(),
      2u);
}

TEST(PlaceMatchTest, BeyondTheGateIsNotLookedFor) {
  const PlaceMatch match = Match(
      Room(), MovedBack(Room(), Vector3d(0.5, 0.0, 0.0)), Prior(0.1, 0.1));
  // Across x nothing fits within 0.3 m; along x the walls do.
  for (const WallMatch& wall : match.matches) {
    EXPECT_TRUE(wall.first == 0 || wall.first == 2 || wall.first == 4 ||
                wall.first == 7)
        << wall.first;
  }
}

TEST(PlaceMatchTest, ACorridorSaysNothingAlong) {
  const PlaceMatch match =
      Match(Corridor(), MovedBack(Corridor(), Vector3d(0.4, 0.12, 0.0)),
            Prior(2.0, 0.15));
  EXPECT_EQ(Pairs(match), (std::set<std::pair<int, int>>{{0, 0}, {1, 1}}));
  EXPECT_NEAR(match.displacement[1], 0.12, 0.01);
  EXPECT_NEAR(match.displacement[0], 0.0, 0.01);
}

TEST(PlaceMatchTest, ABareCorridorProvesNothingInAWideSearch) {
  // It could be the next one, which was not seen yet.
  EXPECT_TRUE(Match(Corridor(), MovedBack(Corridor(), Vector3d(0.0, 1.1, 0.0)),
                    Prior(1.0, 1.0))
                  .matches.empty());
}

TEST(PlaceMatchTest, TwoCorridorsAreAmbiguous) {
  std::vector<PlaceWall> first = Corridor(0.0);
  for (const PlaceWall& wall : Corridor(2.6)) first.push_back(wall);
  PlaceMatchOptions options;
  options.narrow = 10.0;  // The rivals alone must decide.
  EXPECT_TRUE(MatchPlaces(first, Corridor(1.2), Vector2d::Zero(),
                          Prior(0.3, 1.0), options)
                  .matches.empty());
  // Known well enough, it is the first.
  const PlaceMatch match = Match(first, Corridor(0.2), Prior(0.3, 0.15));
  EXPECT_EQ(Pairs(match), (std::set<std::pair<int, int>>{{0, 0}, {1, 1}}));
}

TEST(PlaceMatchTest, RepeatedDoorsLeaveTheWayAlongOpen) {
  // Frames every 2 m on one side: along x it could be any of them.
  std::vector<PlaceWall> first = Corridor();
  for (double x = -5.0; x <= 5.0; x += 2.0) {
    first.push_back(Face(x, 1.0, x, 0.4));
  }
  std::vector<PlaceWall> second = Corridor();
  for (double x = -2.0; x <= 2.0; x += 2.0) {
    second.push_back(Face(x, 1.0, x, 0.4));
  }
  PlaceMatchOptions options;
  options.narrow = 10.0;
  const PlaceMatch match =
      MatchPlaces(first, second, Vector2d::Zero(), Prior(1.5, 0.1), options);
  EXPECT_EQ(Pairs(match), (std::set<std::pair<int, int>>{{0, 0}, {1, 1}}));
}

TEST(PlaceMatchTest, TheOtherFaceOfAWallIsAnotherWall) {
  const std::vector<PlaceWall> first = {Face(0.0, 0.0, 5.0, 0.0),
                                        Face(0.0, 5.0, 0.0, 0.0)};
  const std::vector<PlaceWall> second = {Face(5.0, 0.02, 0.0, 0.02),
                                         Face(0.0, 5.0, 0.0, 0.0)};
  const PlaceMatch match = Match(first, second, Prior(0.1, 0.1));
  EXPECT_EQ(Pairs(match), (std::set<std::pair<int, int>>{{1, 1}}));
}

TEST(PlaceMatchTest, WallsThatDoNotLieSideBySide) {
  const std::vector<PlaceWall> first = {Face(0.0, 0.0, 5.0, 0.0)};
  EXPECT_TRUE(Match(first, {Face(6.0, 0.0, 9.0, 0.0)}, Prior(0.1, 0.1))
                  .matches.empty());
  EXPECT_EQ(
      Match(first, {Face(4.0, 0.0, 9.0, 0.0)}, Prior(0.1, 0.1)).matches.size(),
      1u);
}

TEST(PlaceMatchTest, PiecesOfALineAreOneLine) {
  // Ten pieces between doors prove no more than one wall does.
  std::vector<PlaceWall> pieces;
  for (int i = 0; i < 10; ++i) {
    pieces.push_back(Face(1.5 * i, 0.0, 1.5 * i + 1.2, 0.0));
  }
  EXPECT_TRUE(
      Match(pieces, MovedBack(pieces, Vector3d(0.0, 1.0, 0.0)), Prior(0.2, 1.0))
          .matches.empty());
}

TEST(PlaceMatchTest, WallsOfOneGroupAreNoNews) {
  std::vector<PlaceWall> first = Room();
  std::vector<PlaceWall> second = Room();
  for (int i = 0; i < 8; ++i) first[i].group = second[i].group = 0;
  EXPECT_TRUE(Match(first, second, Prior(0.1, 0.1)).matches.empty());
  // One wall that is not is enough to match them all.
  second[3].group = 1;
  EXPECT_EQ(Match(first, second, Prior(0.1, 0.1)).matches.size(), 8u);
  // Groups that are not known count for nothing.
  for (int i = 0; i < 8; ++i) first[i].group = second[i].group = -1;
  EXPECT_EQ(Match(first, second, Prior(0.1, 0.1)).matches.size(), 8u);
}

TEST(PlaceMatchTest, APlaceOfWhichNothingIsKnownIsNotLookedFor) {
  const PlaceMatch match =
      Match(Room(), MovedBack(Room(), Vector3d(0.2, 0.1, 0.0)),
            Prior(6.0, 6.0, 40.0));
  EXPECT_EQ(match.outcome, PlaceMatch::Outcome::kTurnUnknown);
  EXPECT_TRUE(match.matches.empty());
}

TEST(PlaceMatchTest, WhereTooManyWallsMayBeOneTheLongestArePaired) {
  const Vector3d displacement(3.1, -2.3, DegToRad(4.0));
  const std::vector<PlaceWall> second = MovedBack(Room(), displacement);
  PlaceMatchOptions options;
  const auto match = [&] {
    return MatchPlaces(Room(), second, Vector2d::Zero(), Prior(2.0, 2.0, 3.0),
                       options);
  };
  options.max_tried_pairs = 60;
  EXPECT_EQ(Pairs(match()), Pairs(Match(Room(), second, Prior(2.0, 2.0, 3.0))));
  EXPECT_EQ(match().matches.size(), 8u);
  // One wall at a time does not lead there.
  options.max_tried_pairs = 0;
  EXPECT_NE(match().matches.size(), 8u);
}

TEST(PlaceMatchTest, DegenerateInput) {
  EXPECT_TRUE(Match({}, {}, Prior(1.0, 1.0)).matches.empty());
  EXPECT_TRUE(Match(Room(), {}, Prior(1.0, 1.0)).matches.empty());
  EXPECT_TRUE(Match({}, Room(), Prior(1.0, 1.0)).matches.empty());
  EXPECT_TRUE(
      Match({PlaceWall()}, {PlaceWall()}, Prior(1.0, 1.0)).matches.empty());
  EXPECT_THROW(Match(Room(), Room(), Matrix3d::Zero()), Error);
}

}  // namespace
}  // namespace plumbline
