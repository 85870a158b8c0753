#include <gtest/gtest.h>
#include <plumbline/frontend/track_reference.h>

#include <deque>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::WallEnds;

constexpr double kReach = 20.0;
constexpr int kWindow = 4;

// Returns in a room with a pillar, in the robot's frame.
std::vector<ScanPoint> SeenFrom(const Pose2& pose) {
  std::vector<WallEnds> walls = testing::Room(7.0, 5.0);
  for (const WallEnds& side :
       testing::Moved(testing::Room(0.8, 0.8), {2.0, 1.2, 0.0})) {
    walls.push_back(side);
  }
  return testing::PointsOf(testing::MakeScan(walls, pose, testing::Laser()),
                           {});
}

TrackKey KeyAt(int scan, const Pose2& pose) {
  return {scan, pose, SeenFrom(pose), Eigen::Vector2d(0.1, 0.0)};
}

// What a matcher with these key scans makes of a scan.
MatchResult MatchWith(const ScanMatcher& matcher) {
  const Pose2 pose(0.3, 0.1, 0.05);
  MatchPrior prior;
  prior.pose = pose + Pose2(0.05, -0.04, 0.01);
  return matcher.Refine(SeenFrom(pose), prior.pose, prior);
}

// By points of all keys at once.
ScanMatcher MatcherOf(const std::deque<TrackKey>& keys,
                      const ScanMatcherOptions& options = {}) {
  ScanMatcher matcher(options);
  std::vector<ScanPoint> points;
  std::vector<Viewpoint> viewpoints;
  for (const TrackKey& key : keys) {
    const PoseTransform transform(key.pose);
    viewpoints.push_back({transform.Point(key.laser), points.size()});
    for (const ScanPoint& point : key.points) {
      points.push_back(Moved(point, transform));
    }
  }
  matcher.SetReference(points, viewpoints);
  return matcher;
}

void ExpectSame(const ScanMatcher& a, const ScanMatcher& b) {
  const MatchResult first = MatchWith(a);
  const MatchResult second = MatchWith(b);
  EXPECT_GT(first.inlier_ratio, 0.9);
  EXPECT_EQ(first.pose, second.pose);
  EXPECT_EQ(first.information, second.information);
  EXPECT_EQ(first.inliers, second.inliers);
  const std::vector<ScanPoint> scan = SeenFrom(Pose2::Zero());
  const ScanAgreement one =
      a.Compare(scan, Pose2::Zero(), Eigen::Vector2d::Zero());
  const ScanAgreement other =
      b.Compare(scan, Pose2::Zero(), Eigen::Vector2d::Zero());
  EXPECT_GT(one.seen, 0);
  EXPECT_EQ(one.hits, other.hits);
  EXPECT_EQ(one.seen, other.seen);
  EXPECT_EQ(one.unknown, other.unknown);
}

// With the thread and without it, as key scans come and go, are moved, and as
// the noise changes.
TEST(TrackReferenceTest, IsThatOfAllReturnsAtOnce) {
  for (const bool ahead : {false, true}) {
    TrackReference reference(ahead);
    ScanMatcher matcher({});
    std::deque<TrackKey> keys;
    const auto set = [&] {
      reference.Set(keys, kReach, kWindow, matcher.merge_distance(), &matcher);
    };
    for (int i = 0; i < 9; ++i) {
      keys.push_back(KeyAt(i, Pose2(0.1 * i - 0.4, 0.05 * i, 0.02 * i)));
      if (static_cast<int>(keys.size()) > kWindow) keys.pop_front();
      set();
      ExpectSame(matcher, MatcherOf(keys));
    }
    // The same key scans, moved.
    for (TrackKey& key : keys) key.pose[0] += 0.01;
    set();
    ExpectSame(matcher, MatcherOf(keys));
    // A track that begins anew.
    keys = {KeyAt(20, Pose2(0.2, 0.0, 0.0))};
    set();
    ExpectSame(matcher, MatcherOf(keys));
    // Twice the same.
    set();
    ExpectSame(matcher, MatcherOf(keys));
  }
}

TEST(TrackReferenceTest, WhatIsFarFromTheLastKeyIsNoPartOfIt) {
  TrackReference reference(true);
  ScanMatcher matcher({});
  const TrackKey here = KeyAt(1, Pose2(0.1, 0.0, 0.0));
  TrackKey there = KeyAt(0, Pose2(0.0, 0.0, 0.0));
  there.pose[0] += 2.0 * kReach;
  const std::deque<TrackKey> keys = {there, here};
  reference.Set(keys, kReach, kWindow, matcher.merge_distance(), &matcher);
  ExpectSame(matcher, MatcherOf({here}));
}

// A matcher that merges over another distance gets what is merged over that.
TEST(TrackReferenceTest, TheDistanceOfMergingIsThatOfTheMatcher) {
  TrackReference reference(true);
  std::deque<TrackKey> keys = {KeyAt(0, Pose2(0.0, 0.0, 0.0))};
  ScanMatcher matcher({});
  reference.Set(keys, kReach, kWindow, matcher.merge_distance(), &matcher);
  keys.push_back(KeyAt(1, Pose2(0.1, 0.0, 0.0)));
  ScanMatcherOptions options;
  options.point_sigma = 0.06;
  ScanMatcher other(options);
  reference.Set(keys, kReach, kWindow, other.merge_distance(), &other);
  ExpectSame(other, MatcherOf(keys, options));
}

}  // namespace
}  // namespace plumbline
