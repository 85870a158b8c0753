#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/scan_relations.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

std::vector<ScanRelation> FindScanRelations(
    const std::vector<Place>& places, const std::vector<Pose2>& poses,
    const ScanRelationOptions& options) {
  return ScanMatchFinder(places, options).Find(poses);
}

using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::PointsOf;
using testing::WallEnds;

class ScanRelationsTest : public ::testing::Test {
 protected:
  // A robot drives along y = 0 twice, or more often.
  void Drive(const std::vector<WallEnds>& walls, int visits = 2) {
    Noise noise(5);
    Laser laser = testing::FullCircle();
    laser.angle_step = DegToRad(2.0);
    laser.beams = 180;
    laser.sigma = 0.01;
    for (int visit = 0; visit < visits; ++visit) {
      for (int i = 0; i < 8; ++i) {
        truth_.emplace_back(-3.5 + i, 0.1 * visit, 0.2 * visit);
        Place place;
        place.scan = PointsOf(MakeScan(walls, truth_.back(), laser, &noise));
        place.reference = place.scan;
        places_.push_back(place);
      }
    }
  }

  // The second visit is off by this much.
  std::vector<Pose2> Drifted(const Pose2& drift) const {
    std::vector<Pose2> poses = truth_;
    for (std::size_t i = 8; i < poses.size(); ++i) {
      poses[i] = Compose(drift, poses[i]);
    }
    return poses;
  }

  std::vector<Place> places_;
  std::vector<Pose2> truth_;
  ScanRelationOptions options_;
};

TEST_F(ScanRelationsTest, FindTheTruthAcrossVisits) {
  Drive(testing::Room(10.0, 6.0));
  const std::vector<ScanRelation> relations = FindScanRelations(
      places_, Drifted(Pose2(0.12, -0.15, DegToRad(1.5))), options_);
  int across = 0;
  for (const ScanRelation& relation : relations) {
    // Submaps of four places: 0 to 3 has its middle at 2 and so on.
    EXPECT_EQ(relation.from % 4, 2);
    EXPECT_NE(relation.from / 4, relation.to / 4);
    const Pose2 true_relation =
        Between(truth_[relation.from], truth_[relation.to]);
    // Within a visit the reference is as good as the poses; across, too, since
    // a submap is of one visit.
    EXPECT_LT(testing::PositionError(relation.mean, true_relation), 0.02);
    EXPECT_LT(testing::HeadingError(relation.mean, true_relation),
              DegToRad(0.4));
    EXPECT_LT((relation.information - relation.information.transpose()).norm(),
              1e-6 * relation.information.norm());
    if (relation.from / 8 != relation.to / 8) ++across;
  }
  EXPECT_GE(across, 16);
}

TEST_F(ScanRelationsTest, ACorridorSaysNothingAlong) {
  Drive(testing::Corridor());
  const std::vector<ScanRelation> relations =
      FindScanRelations(places_, truth_, options_);
  ASSERT_FALSE(relations.empty());
  for (const ScanRelation& relation : relations) {
    // From a pose that looks along the corridor: x is along.
    const double heading = truth_[relation.from][2];
    const Eigen::Vector3d along(std::cos(heading), -std::sin(heading), 0.0);
    const Eigen::Vector3d across(std::sin(heading), std::cos(heading), 0.0);
    EXPECT_LT(along.dot(relation.information * along),
              0.02 * across.dot(relation.information * across));
  }
}

// Scatter of normals would move it by centimetres, and what it knows across the
// corridor hold it there.
TEST_F(ScanRelationsTest, ACorridorLeavesAScanWhereItWasAlong) {
  Drive(testing::Corridor());
  const std::vector<Pose2> poses = Drifted(Pose2(0.2, 0.0, 0.0));
  double farthest = 0.0;
  for (const ScanRelation& relation :
       FindScanRelations(places_, poses, options_)) {
    const Pose2 before = Between(poses[relation.from], poses[relation.to]);
    const double heading = truth_[relation.from][2];
    const Eigen::Vector2d along(std::cos(heading), -std::sin(heading));
    farthest = std::max(
        farthest, std::abs(along.dot((relation.mean - before).head<2>())));
  }
  EXPECT_LT(farthest, 0.01);
}

// A metre farther along, another place across may be measured.
TEST_F(ScanRelationsTest, AcrossACorridorLessIsKnownWhereAlongItNothingIs) {
  const auto least_across = [this](const std::vector<WallEnds>& walls) {
    places_.clear();
    truth_.clear();
    Drive(walls);
    double least = 1e9;
    for (const ScanRelation& relation :
         FindScanRelations(places_, truth_, options_)) {
      const double heading = truth_[relation.from][2];
      const Eigen::Vector3d across(std::sin(heading), std::cos(heading), 0.0);
      least = std::min(least, across.dot(relation.information * across));
    }
    return least;
  };
  // 0.02 m for each of up to 1 m, and 3 mm or so of the returns.
  EXPECT_NEAR(least_across(testing::Corridor()), 1.0 / (0.02 * 0.02), 250.0);
  EXPECT_GT(least_across(testing::Room(10.0, 6.0)), 8000.0);
  options_.slide_across = 0.0;
  options_.slide_turn = 0.0;
  EXPECT_GT(least_across(testing::Corridor()), 8000.0);
}

TEST_F(ScanRelationsTest, NothingWhereNothingIsSeenByBoth) {
  Drive(testing::Room(10.0, 6.0));
  // The second visit is put next to the first, as if it were another room.
  EXPECT_TRUE(
      FindScanRelations({places_[2], places_[10]},
                        {truth_[2], Compose(Pose2(0.0, 3.0, 0.0), truth_[10])},
                        options_)
          .empty());
  options_.radius = 0.5;
  EXPECT_TRUE(
      FindScanRelations(places_, Drifted(Pose2(0.0, 20.0, 0.0)), options_)
          .empty());
}

TEST_F(ScanRelationsTest, CostIsBoundedWhereTheRobotStays) {
  Drive(testing::Room(10.0, 6.0));
  options_.max_submaps = 1;
  const std::vector<ScanRelation> relations =
      FindScanRelations(places_, truth_, options_);
  std::vector<int> count(places_.size(), 0);
  for (const ScanRelation& relation : relations) ++count[relation.to];
  for (const int n : count) EXPECT_LE(n, 1);
  EXPECT_GE(relations.size(), 12u);
}

TEST_F(ScanRelationsTest, VisitsShareWhatAPlaceIsMatchedWith) {
  Drive(testing::Room(10.0, 6.0), /*visits=*/12);
  options_.max_submaps = 6;
  std::vector<int> count(places_.size(), 0);
  int last_visit = 0;
  for (const ScanRelation& relation :
       FindScanRelations(places_, truth_, options_)) {
    ++count[relation.to];
    // Visits lie farther off one by one: the six nearest end with the sixth.
    if (relation.to / 8 == 0) {
      last_visit = std::max(last_visit, relation.from / 8);
    }
  }
  for (const int n : count) EXPECT_LE(n, 6);
  EXPECT_GE(last_visit, 9);
}

// Many visits hold each other with fewer relations each.
TEST_F(ScanRelationsTest, ManyVisitsAreMatchedWithFewerEach) {
  Drive(testing::Room(10.0, 6.0), /*visits=*/30);
  options_.max_submaps = 6;
  std::vector<int> count(places_.size(), 0);
  for (const ScanRelation& relation :
       FindScanRelations(places_, truth_, options_)) {
    ++count[relation.to];
  }
  // From the middle of the room all 30 submaps of either half are near.
  for (const int i : {3, 4}) EXPECT_LE(count[i], 4) << i;
}

// Where a place has more submaps than it is matched with, those that it was
// matched with stay, whoever else comes near or goes.
TEST_F(ScanRelationsTest, VisitsThatWereMatchedAreNotMatchedAnew) {
  Drive(testing::Room(10.0, 6.0), /*visits=*/12);
  options_.max_submaps = 6;
  ScanMatchFinder finder(places_, options_);
  finder.Find(truth_);
  const std::int64_t all = finder.num_tried();
  // The last visits: some of their submaps were 4 m away, just near enough.
  std::vector<Pose2> poses = truth_;
  for (std::size_t i = 9 * 8; i < poses.size(); ++i) poses[i][0] += 1e-6;
  finder.Find(poses);
  EXPECT_LT(finder.num_tried(), all / 20);
}

TEST_F(ScanRelationsTest, SameForAnyNumberOfThreads) {
  Drive(testing::Room(10.0, 6.0));
  const std::vector<Pose2> poses = Drifted(Pose2(0.1, 0.1, 0.01));
  const std::vector<ScanRelation> one =
      FindScanRelations(places_, poses, options_);
  options_.num_threads = 3;
  const std::vector<ScanRelation> three =
      FindScanRelations(places_, poses, options_);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].from, three[i].from);
    EXPECT_EQ(one[i].to, three[i].to);
    EXPECT_EQ(one[i].mean, three[i].mean);
    EXPECT_EQ(one[i].information, three[i].information);
  }
}

TEST_F(ScanRelationsTest, OnlyWhatHasMovedIsMatchedAnew) {
  Drive(testing::Room(10.0, 6.0));
  ScanMatchFinder finder(places_, options_);
  const std::size_t first = finder.Find(Drifted(Pose2(0.0, 1.0, 0.0))).size();
  EXPECT_GT(finder.num_tried(), 30);
  // A little: everything stands.
  EXPECT_EQ(finder.Find(Drifted(Pose2(0.03, 1.0, 0.0))).size(), first);
  EXPECT_EQ(finder.num_tried(), 0);
  // Come near: the second visit is seen to overlap with the first.
  const std::vector<Pose2> near = Drifted(Pose2(0.1, 0.1, 0.0));
  const std::vector<ScanRelation> relations = finder.Find(near);
  EXPECT_GT(relations.size(), first);
  EXPECT_GT(finder.num_tried(), 10);
  const std::vector<ScanRelation> afresh =
      FindScanRelations(places_, near, options_);
  EXPECT_EQ(relations.size(), afresh.size());
}

TEST_F(ScanRelationsTest, EmptyAndBrokenInput) {
  EXPECT_TRUE(FindScanRelations({}, {}, options_).empty());
  // Places that saw nothing.
  EXPECT_TRUE(FindScanRelations(std::vector<Place>(9),
                                std::vector<Pose2>(9, Pose2::Zero()), options_)
                  .empty());
  EXPECT_THROW(
      FindScanRelations(std::vector<Place>(2), {Pose2::Zero()}, options_),
      Error);
  options_.radius = 0.0;
  EXPECT_THROW(FindScanRelations({}, {}, options_), Error);
  options_.radius = 4.0;
  options_.submap_size = 0;
  EXPECT_THROW(FindScanRelations({}, {}, options_), Error);
}

}  // namespace
}  // namespace plumbline
