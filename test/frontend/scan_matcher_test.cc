#include <gtest/gtest.h>
#include <plumbline/frontend/scan_matcher.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::Corridor;
using testing::FullCircle;
using testing::HeadingError;
using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::PointsOf;
using testing::PositionError;
using testing::Room;
using testing::Transformed;
using testing::WallEnds;

ScanMatcherOptions MatcherOptions() {
  ScanMatcherOptions options;
  options.point_sigma = 0.03;
  options.independence = 0.3;
  options.initial_radius = 0.4;
  options.final_radius = 0.15;
  options.max_iterations = 30;
  options.convergence = 1e-5;
  options.grid_resolution = 0.1;
  options.search_step = 0.15;
  options.rotation_step = DegToRad(1.0);
  return options;
}

// A room of 7 m x 5 m with a pillar that makes it tell its corners apart.
std::vector<WallEnds> RoomWithPillar() {
  std::vector<WallEnds> walls = Room(7.0, 5.0);
  for (const WallEnds& side : testing::Moved(Room(0.8, 0.8), {2.0, 1.2, 0.0})) {
    walls.push_back(side);
  }
  return walls;
}

// What was seen from `robot`, in the map frame.
std::vector<ScanPoint> Seen(const std::vector<WallEnds>& walls,
                            const Pose2& robot,
                            const ScanPointsOptions& options = {}) {
  return Transformed(PointsOf(MakeScan(walls, robot, FullCircle()), options),
                     robot);
}

TEST(ScanMatcherTest, RefineRecoversADisplacement) {
  ScanMatcher matcher(MatcherOptions());
  EXPECT_TRUE(matcher.empty());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2(-0.5, 0.2, 0.1)));
  EXPECT_FALSE(matcher.empty());
  const Pose2 truth(-0.2, 0.3, 0.25);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, FullCircle()));
  for (const Pose2& error :
       {Pose2(0.2, 0.0, 0.0), Pose2(0.0, -0.2, 0.0),
        Pose2(0.0, 0.0, DegToRad(5.0)), Pose2(-0.14, 0.14, DegToRad(-5.0)),
        Pose2(0.0, 0.0, 0.0)}) {
    SCOPED_TRACE(error.transpose());
    const MatchResult match = matcher.Refine(scan, truth + error, MatchPrior());
    EXPECT_LT(PositionError(match.pose, truth), 0.005);
    EXPECT_LT(HeadingError(match.pose, truth), DegToRad(0.1));
    EXPECT_GT(match.inlier_ratio, 0.95);
    EXPECT_GT(match.inliers, 500);
    EXPECT_LT(match.cost, 0.1);
  }
}

TEST(ScanMatcherTest, CovarianceCoversTheErrorsOfNoisyScans) {
  Laser laser = FullCircle();
  laser.sigma = 0.01;
  Noise noise(7);
  const Pose2 truth(0.3, -0.1, -2.0);
  ScanMatcher matcher(MatcherOptions());
  double sum = 0.0;
  constexpr int kScans = 20;
  for (int i = 0; i < kScans; ++i) {
    matcher.SetReference(
        PointsOf(MakeScan(Room(7.0, 5.0), Pose2::Zero(), laser, &noise)));
    const MatchResult match =
        matcher.Refine(PointsOf(MakeScan(Room(7.0, 5.0), truth, laser, &noise)),
                       truth + Pose2(0.05, 0.05, 0.02), MatchPrior());
    Eigen::Vector3d error = match.pose - truth;
    error[2] = NormalizeAngle(error[2]);
    EXPECT_LT(error.head<2>().norm(), 0.02);
    EXPECT_LT(std::abs(error[2]), DegToRad(0.5));
    sum += error.dot(match.covariance.inverse() * error);
  }
  // chi^2 with 3 degrees of freedom: not surer than right. The noise here is
  // a third of point_sigma, so it may well be less sure.
  EXPECT_LT(sum / kScans, 4.5);
}

// Every step of the refinement must pair returns with the nearest reference
// points, whatever is remembered from the step before: each match, begun anew
// with one more step allowed, is compared with a search through all points.
TEST(ScanMatcherTest, ErrorsAreDistancesFromTheSurface) {
  ScanMatcher matcher(MatcherOptions());
  const std::vector<WallEnds> wall = {{{-3.0, 1.0}, {3.0, 1.0}}};
  matcher.SetReference(Seen(wall, Pose2::Zero()));
  std::vector<ScanPoint> scan =
      PointsOf(MakeScan(wall, Pose2::Zero(), FullCircle()));
  ASSERT_GT(scan.size(), 10u);
  for (const double error : matcher.Errors(scan, Pose2(0.0, 0.06, 0.0))) {
    EXPECT_NEAR(error, 0.06, 0.001);
  }
  for (const double error : matcher.Errors(scan, Pose2(0.0, 0.3, 0.0))) {
    EXPECT_EQ(error, std::numeric_limits<double>::infinity());
  }
  scan.front().normal.setZero();
  EXPECT_EQ(matcher.Errors(scan, Pose2::Zero()).front(),
            std::numeric_limits<double>::infinity());
  EXPECT_NEAR(matcher.Errors(scan, Pose2::Zero())[5], 0.0, 0.001);
}

TEST(ScanMatcherTest, EveryStepPairsWithTheNearest) {
  Laser laser = FullCircle();
  laser.sigma = 0.02;
  Noise noise(11);
  std::vector<ScanPoint> reference;
  for (const double x : {-0.5, -0.3, 0.0, 0.2}) {
    const Pose2 robot(x, 0.5 * x, 0.3 * x);
    const std::vector<ScanPoint> seen = Transformed(
        PointsOf(MakeScan(RoomWithPillar(), robot, laser, &noise)), robot);
    // Those so near each other that they would become one are left out.
    for (const ScanPoint& point : seen) {
      const bool is_near = std::any_of(
          reference.begin(), reference.end(), [&](const ScanPoint& other) {
            return (other.position - point.position).norm() <
                   MatcherOptions().point_sigma;
          });
      if (!is_near) reference.push_back(point);
    }
  }
  const Pose2 truth(-0.2, 0.3, 0.25);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, laser, &noise));
  const Pose2 guess = truth + Pose2(0.15, -0.1, DegToRad(3.0));
  ScanMatcherOptions options = MatcherOptions();
  options.convergence = 0.0;
  options.coarse_points = static_cast<int>(scan.size());
  Pose2 pose = guess;
  double progress = 0.0;
  for (int steps = 1; steps <= 12; ++steps) {
    SCOPED_TRACE(steps);
    options.max_iterations = steps;
    ScanMatcher matcher(options);
    matcher.SetReference(reference);
    const MatchResult match = matcher.Refine(scan, guess, MatchPrior());
    // What the last step saw from where the one before it had led.
    progress = std::max(progress, std::min(1.0, (steps - 1) / 6.0));
    const double radius =
        options.initial_radius +
        progress * (options.final_radius - options.initial_radius);
    const PoseTransform transform(pose);
    int inliers = 0;
    int tried = 0;
    double cost = 0.0;
    for (const ScanPoint& point : scan) {
      if (point.normal.squaredNorm() == 0.0) continue;
      ++tried;
      const Eigen::Vector2d position = transform.Point(point.position);
      const Eigen::Vector2d normal = transform.Direction(point.normal);
      const ScanPoint* nearest = nullptr;
      double least = radius;
      for (const ScanPoint& candidate : reference) {
        const double distance = (candidate.position - position).norm();
        if (distance < least && candidate.normal.dot(normal) >= 0.7) {
          least = distance;
          nearest = &candidate;
        }
      }
      if (nearest != nullptr) ++inliers;
      const double error =
          nearest == nullptr
              ? 1e9
              : nearest->normal.dot(position - nearest->position) /
                    options.point_sigma;
      cost += std::min(4.0, error * error);
    }
    EXPECT_EQ(match.inliers, inliers);
    EXPECT_NEAR(match.cost, cost / tried, 1e-9);
    // Where the pose hardly moves the radius is the final one at once.
    if (PositionError(match.pose, pose) < 0.005 &&
        HeadingError(match.pose, pose) < 0.0015) {
      progress = 1.0;
    }
    pose = match.pose;
  }
}

// What was seen many times is a band as wide as the noise: a scan that lies in
// it off its middle must not find partners where it is, and stay.
TEST(ScanMatcherTest, ManyViewsDoNotHoldAScanWhereItBegins) {
  Laser laser = FullCircle();
  laser.sigma = 0.02;
  Noise noise(13);
  std::vector<ScanPoint> reference;
  for (int view = 0; view < 12; ++view) {
    const std::vector<ScanPoint> seen =
        PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), laser, &noise));
    reference.insert(reference.end(), seen.begin(), seen.end());
  }
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(reference);
  const Pose2 truth(0.1, 0.05, 0.2);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, laser, &noise));
  std::vector<Pose2> found;
  for (const double off : {-0.04, 0.04}) {
    found.push_back(
        matcher.Refine(scan, truth + Pose2(off, off, 0.0), MatchPrior()).pose);
    EXPECT_LT(PositionError(found.back(), truth), 0.004);
  }
  EXPECT_LT(PositionError(found[0], found[1]), 0.001);
}

// Few points lead to where all do, and all have a say in the end.
TEST(ScanMatcherTest, FewPointsAreEnoughToComeNear) {
  Laser laser = FullCircle();
  laser.sigma = 0.01;
  Noise noise(5);
  const std::vector<ScanPoint> reference =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), laser, &noise));
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE(trial);
    const Pose2 truth(0.02 * trial - 0.2, 0.01 * trial, 0.01 * trial);
    const std::vector<ScanPoint> scan =
        PointsOf(MakeScan(RoomWithPillar(), truth, laser, &noise));
    const Pose2 guess = truth + Pose2(0.1, -0.1, DegToRad(2.0));
    ScanMatcherOptions options = MatcherOptions();
    ScanMatcher few(options);
    options.coarse_points = static_cast<int>(scan.size());
    ScanMatcher all(options);
    few.SetReference(reference);
    all.SetReference(reference);
    const MatchResult by_few = few.Refine(scan, guess, MatchPrior());
    const MatchResult by_all = all.Refine(scan, guess, MatchPrior());
    EXPECT_LT(PositionError(by_few.pose, by_all.pose), 0.002);
    EXPECT_LT(HeadingError(by_few.pose, by_all.pose), DegToRad(0.05));
    EXPECT_NEAR(by_few.inliers, by_all.inliers, 0.01 * by_all.inliers);
  }
}

TEST(ScanMatcherTest, SearchFindsAWrongTurn) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2(-0.5, 0.2, 0.1)));
  const Pose2 truth(-0.3, 0.3, 0.3);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, FullCircle()));
  for (double turn : {25.0, -25.0}) {
    SCOPED_TRACE(turn);
    const Pose2 guess = truth + Pose2(0.2, -0.1, DegToRad(turn));
    double score = -1.0;
    const Pose2 found =
        matcher.Search(scan, guess, 0.45, DegToRad(30.0), &score);
    EXPECT_LT(PositionError(found, truth), 0.15);
    EXPECT_LT(HeadingError(found, truth), DegToRad(2.0));
    EXPECT_GT(score, 0.6);
    EXPECT_LE(score, 1.0);
    const MatchResult match = matcher.Refine(scan, found, MatchPrior());
    EXPECT_LT(PositionError(match.pose, truth), 0.005);
    EXPECT_LT(HeadingError(match.pose, truth), DegToRad(0.1));
  }
}

// Wide windows leave out squares of poses together.
TEST(ScanMatcherTest, AWideSearchFindsWhatALookAtEveryPoseFinds) {
  const ScanMatcherOptions options = MatcherOptions();
  ScanMatcher matcher(options);
  matcher.SetReference(Seen(RoomWithPillar(), Pose2(-0.5, 0.2, 0.1)));
  const Pose2 truth(-0.3, 0.3, 0.3);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, FullCircle()));
  constexpr int kSteps = 10;
  constexpr int kTurns = 8;
  for (const Pose2& off : {Pose2(1.2, -0.9, 0.1), Pose2(-1.35, 0.3, -0.12),
                           Pose2(3.0, 2.0, 0.05), Pose2(30.0, 0.0, 0.0)}) {
    SCOPED_TRACE(off.transpose());
    const Pose2 guess = truth + off;
    double expected = 0.0;
    for (int k = -kTurns; k <= kTurns; ++k) {
      for (int y = -kSteps; y <= kSteps; ++y) {
        for (int x = -kSteps; x <= kSteps; ++x) {
          const Pose2 step(x * options.search_step, y * options.search_step,
                           k * options.rotation_step);
          double score = 0.0;
          matcher.Search(scan, guess + step, 0.0, 0.0, &score);
          expected = std::max(
              expected,
              score * (1.0 - 0.05 * std::abs(step[2]) / DegToRad(30.0) -
                       0.06 * step.head<2>().norm()));
        }
      }
    }
    double score = -1.0;
    const Pose2 found =
        matcher.Search(scan, guess, kSteps * options.search_step,
                       kTurns * options.rotation_step, &score);
    // A point at the edge of a cell may fall to either side.
    EXPECT_NEAR(score, expected, 0.01);
    if (off.head<2>().norm() < 1.6) {
      EXPECT_LT(PositionError(found, truth), 0.15);
    }
    if (expected == 0.0) {
      EXPECT_EQ(found, guess);
    }
  }
}

TEST(ScanMatcherTest, SearchStaysInItsWindow) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2::Zero()));
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle()));
  const Pose2 guess(0.9, 0.0, DegToRad(20.0));
  const Pose2 found = matcher.Search(scan, guess, 0.3, DegToRad(5.0), nullptr);
  EXPECT_LE(std::abs(found[0] - guess[0]), 0.3 + 1e-9);
  EXPECT_LE(std::abs(found[1] - guess[1]), 0.3 + 1e-9);
  EXPECT_LE(HeadingError(found, guess), DegToRad(5.0) + 1e-9);
  // No window: the guess itself.
  EXPECT_LT((matcher.Search(scan, guess, 0.0, 0.0, nullptr) - guess).norm(),
            1e-12);
}

TEST(ScanMatcherTest, ScoreIsHigherAtTheTruth) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2::Zero()));
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle()));
  double right = 0.0;
  double wrong = 0.0;
  matcher.Search(scan, Pose2::Zero(), 0.0, 0.0, &right);
  matcher.Search(scan, Pose2(0.0, 0.0, DegToRad(15.0)), 0.0, 0.0, &wrong);
  EXPECT_GT(right, 0.6);
  EXPECT_LT(wrong, 0.5 * right);
}

TEST(ScanMatcherTest, CorridorSaysNothingAlong) {
  ScanPointsOptions points;
  points.usable_range = 10.0;
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(Corridor(), Pose2::Zero(), points));
  const Pose2 truth(0.5, 0.1, 0.05);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(Corridor(), truth, FullCircle()), points);
  MatchPrior prior;
  prior.pose = Pose2(0.6, 0.0, 0.0);
  prior.information =
      Eigen::Vector3d(1.0 / 0.01, 1.0 / 0.01, 1.0 / 0.01).asDiagonal();
  const MatchResult match = matcher.Refine(scan, prior.pose, prior);
  // Along, the prior stands; across and heading come from the walls.
  EXPECT_NEAR(match.pose[0], 0.6, 0.02);
  EXPECT_NEAR(match.pose[1], 0.1, 0.005);
  EXPECT_NEAR(match.pose[2], 0.05, DegToRad(0.2));
  EXPECT_NEAR(std::sqrt(match.covariance(0, 0)), 0.1, 0.03);
  EXPECT_LT(std::sqrt(match.covariance(1, 1)), 0.01);
  EXPECT_LT(std::sqrt(match.covariance(2, 2)), DegToRad(0.5));
  const Eigen::Vector3d eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(match.information)
          .eigenvalues();
  EXPECT_LT(eigenvalues[0], 1e-3 * eigenvalues[1]);
}

// Normals of noisy returns point a little along the corridor, all of them.
TEST(ScanMatcherTest, NoisyNormalsSayNothingAlongACorridor) {
  Laser laser = FullCircle();
  laser.sigma = 0.015;
  Noise noise(5);
  std::vector<double> sigmas;
  for (int trial = 0; trial < 9; ++trial) {
    std::vector<ScanPoint> reference;
    for (const double x : {-0.6, 0.0, 0.6}) {
      const Pose2 robot(x, 0.0, 0.0);
      const std::vector<ScanPoint> seen = Transformed(
          PointsOf(MakeScan(Corridor(), robot, laser, &noise)), robot);
      reference.insert(reference.end(), seen.begin(), seen.end());
    }
    ScanMatcher matcher(MatcherOptions());
    matcher.SetReference(reference);
    const Pose2 truth(0.2, 0.05, 0.02);
    const MatchResult match =
        matcher.Refine(PointsOf(MakeScan(Corridor(), truth, laser, &noise)),
                       truth, MatchPrior());
    EXPECT_LT(std::abs(match.pose[1] - truth[1]), 0.01);
    EXPECT_LT(1.0 / std::sqrt(match.information(1, 1)), 0.01);
    sigmas.push_back(match.information(0, 0) > 0.0
                         ? 1.0 / std::sqrt(match.information(0, 0))
                         : 1e9);
  }
  std::sort(sigmas.begin(), sigmas.end());
  EXPECT_GT(sigmas[sigmas.size() / 2], 0.35);
}

// The returns that tell the heading are those that are farthest along the
// walls, where beams graze.
TEST(ScanMatcherTest, GrazedWallsHoldTheHeadingInACorridor) {
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(7);
  constexpr int kTrials = 60;
  double squares = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    ScanMatcher matcher(MatcherOptions());
    matcher.SetReference(
        PointsOf(MakeScan(Corridor(), Pose2::Zero(), laser, &noise)));
    const Pose2 truth(1.0, 0.0, 0.0);
    MatchPrior prior;
    prior.pose = truth;
    prior.information = Eigen::Vector3d(1e4, 1.0, 1.0).asDiagonal();
    const MatchResult match =
        matcher.Refine(PointsOf(MakeScan(Corridor(), truth, laser, &noise)),
                       Pose2(1.0, 0.02, 0.01), prior);
    squares += match.pose[2] * match.pose[2];
  }
  EXPECT_LT(RadToDeg(std::sqrt(squares / kTrials)), 0.055);
}

TEST(ScanMatcherTest, PriorPullsOnlyWhereTheReturnsAreSilent) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2::Zero()));
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2(0.1, 0.1, 0.1), FullCircle()));
  MatchPrior prior;
  prior.pose = Pose2::Zero();
  prior.information = Eigen::Matrix3d::Identity() * 100.0;
  const MatchResult match = matcher.Refine(scan, prior.pose, prior);
  EXPECT_LT((match.pose - Pose2(0.1, 0.1, 0.1)).norm(), 0.01);
}

TEST(ScanMatcherTest, APriorThatHoldsDoesNotLetGo) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(
      PointsOf(MakeScan(Room(8.0, 6.0), Pose2::Zero(), FullCircle())));
  const Pose2 truth(0.2, -0.1, 0.0);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(Room(8.0, 6.0), truth, FullCircle()));
  MatchPrior prior;
  prior.pose = Pose2::Zero();
  prior.information = Eigen::Matrix3d::Identity() * 1e6;
  const MatchResult free = matcher.Refine(scan, truth, prior);
  EXPECT_LT((free.pose - truth).norm(), 0.01);
  prior.is_heavy_tailed = false;
  const MatchResult held = matcher.Refine(scan, truth, prior);
  EXPECT_GT((held.pose - truth).norm(), 0.1);
}

TEST(ScanMatcherTest, InformationAndCovarianceAreSymmetricPositive) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2::Zero()));
  const MatchResult match = matcher.Refine(
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle())),
      Pose2::Zero(), MatchPrior());
  EXPECT_LT((match.information - match.information.transpose()).norm(), 1e-6);
  EXPECT_LT((match.covariance - match.covariance.transpose()).norm(), 1e-12);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(match.covariance)
                .eigenvalues()[0],
            0.0);
}

TEST(ScanMatcherTest, SameResultTenKilometresAway) {
  const Pose2 shift(10000.0, -10000.0, 0.0);
  const Pose2 truth(-0.2, 0.3, 0.25);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, FullCircle()));
  const std::vector<ScanPoint> reference =
      Seen(RoomWithPillar(), Pose2(-0.5, 0.2, 0.1));
  const Pose2 guess = truth + Pose2(0.1, -0.1, DegToRad(3.0));
  MatchPrior prior;
  prior.pose = guess;
  prior.information = Eigen::Matrix3d::Identity();

  ScanMatcher here(MatcherOptions());
  here.SetReference(reference);
  const MatchResult match_here = here.Refine(scan, guess, prior);
  ScanMatcher there(MatcherOptions());
  there.SetReference(Transformed(reference, shift));
  prior.pose += shift;
  const MatchResult match_there = there.Refine(scan, guess + shift, prior);
  EXPECT_LT((match_there.pose - shift - match_here.pose).norm(), 1e-6);
  EXPECT_LT((match_there.covariance - match_here.covariance).norm(),
            1e-6 * match_here.covariance.norm());
  const Pose2 found_here =
      here.Search(scan, guess, 0.3, DegToRad(6.0), nullptr);
  const Pose2 found_there =
      there.Search(scan, guess + shift, 0.3, DegToRad(6.0), nullptr);
  EXPECT_LT((found_there - shift - found_here).norm(), 1e-6);
}

TEST(ScanMatcherTest, TurnedWorldTurnsTheResult) {
  // The whole thing by 120 degrees, and by 4 km.
  const Pose2 turn(4000.0, 1000.0, DegToRad(120.0));
  const Pose2 truth(-0.2, 0.3, 0.25);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, FullCircle()));
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(
      Transformed(Seen(RoomWithPillar(), Pose2(-0.5, 0.2, 0.1)), turn));
  const Pose2 guess = truth + Pose2(0.1, -0.1, DegToRad(3.0));
  const MatchResult match =
      matcher.Refine(scan, Compose(turn, guess), MatchPrior());
  const Pose2 back = Compose(Inverse(turn), match.pose);
  EXPECT_LT(PositionError(back, truth), 0.005);
  EXPECT_LT(HeadingError(back, truth), DegToRad(0.1));
}

TEST(ScanMatcherTest, OverlapByTryingEveryReferencePoint) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-2.0, 2.0);
  std::uniform_real_distribution<double> heading(-M_PI, M_PI);
  const auto cloud = [&](int count, double spread) {
    std::vector<ScanPoint> points(count, ScanPoint());
    for (ScanPoint& point : points) {
      const double angle = heading(random);
      point.position = {spread * place(random), spread * place(random)};
      point.normal = {std::cos(angle), std::sin(angle)};
    }
    return points;
  };
  const ScanMatcherOptions options = MatcherOptions();
  for (int round = 0; round < 50; ++round) {
    const std::vector<ScanPoint> reference = cloud(1 + 2 * round, 1.0);
    // Also beyond the reference's bounds.
    const std::vector<ScanPoint> scan = cloud(100, 1.6);
    const Pose2 pose(place(random), place(random), heading(random));
    ScanMatcher matcher(options);
    matcher.SetReference(reference);
    int found = 0;
    for (const ScanPoint& point : Transformed(scan, pose)) {
      found += std::any_of(reference.begin(), reference.end(),
                           [&](const ScanPoint& other) {
                             return (other.position - point.position).norm() <
                                        options.initial_radius &&
                                    other.normal.dot(point.normal) >= 0.7;
                           });
    }
    EXPECT_DOUBLE_EQ(matcher.Overlap(scan, pose), found / 100.0) << round;
    for (const double least :
         {0.0, found / 100.0 - 1e-9, found / 100.0 + 1e-9, 0.4, 1.0}) {
      EXPECT_EQ(matcher.OverlapsBy(least, scan, pose),
                matcher.Overlap(scan, pose) >= least)
          << round << ' ' << least;
    }
  }
}

// Two rooms and one wild return: the far room stays where it is known that it
// was seen from nearby, or where that is asked for; the return never does.
TEST(ScanMatcherTest, AReferenceReachesWhereItWasSeenFrom) {
  const std::vector<ScanPoint> room = Seen(RoomWithPillar(), Pose2::Zero());
  struct Case {
    double distance;
    bool has_viewpoints;
    double reach;
    bool is_there;
  };
  for (const Case& c :
       {Case{100.0, false, 120.0, true}, Case{200.0, false, 120.0, false},
        Case{200.0, true, 120.0, true}, Case{200.0, false, 250.0, true},
        Case{300.0, true, 120.0, false}}) {
    SCOPED_TRACE(::testing::Message()
                 << c.distance << ' ' << c.has_viewpoints << ' ' << c.reach);
    const Pose2 there(-c.distance, c.distance / 2.0, 0.0);
    // More of the near room, so that the middle of all lies in it.
    std::vector<ScanPoint> reference = room;
    reference.insert(reference.end(), room.begin(), room.end());
    const std::size_t second = reference.size();
    for (const ScanPoint& point : Transformed(room, there)) {
      reference.push_back(point);
    }
    const std::size_t third = reference.size();
    ScanPoint wild = room.front();
    wild.position = {5e5, 3e5};
    reference.push_back(wild);
    std::vector<Viewpoint> viewpoints;
    if (c.has_viewpoints) {
      viewpoints = {{Eigen::Vector2d::Zero(), 0},
                    {there.head<2>(), second},
                    {Eigen::Vector2d::Zero(), third}};
    }
    ScanMatcherOptions options = MatcherOptions();
    options.reference_reach = c.reach;
    ScanMatcher matcher(options);
    matcher.SetReference(reference, viewpoints);
    EXPECT_EQ(matcher.Overlap(room, Pose2::Zero()), 1.0);
    EXPECT_EQ(matcher.Overlap(room, there), c.is_there ? 1.0 : 0.0);
    EXPECT_EQ(matcher.Overlap({wild}, Pose2::Zero()), 0.0);
    if (!c.is_there) continue;
    const MatchResult result = matcher.Refine(
        room, Compose(there, Pose2(0.1, -0.05, DegToRad(2.0))), MatchPrior());
    EXPECT_LT((result.pose - there).norm(), 1e-3);
  }
}

TEST(ScanMatcherTest, RefineTakesTheNearestReferencePoint) {
  // Lines of points one behind the other, at distances that fall into the same
  // and into other buckets: one step of least squares without a prior goes
  // onto the nearest.
  for (const double nearest : {0.01, 0.07, 0.13, 0.21, 0.3, 0.38}) {
    std::vector<ScanPoint> reference, scan;
    for (int i = 0; i < 40; ++i) {
      ScanPoint point = {};
      point.position = {0.1 * i, 0.0};
      point.normal = {0.0, 1.0};
      scan.push_back(point);
      for (const double offset : {nearest, nearest + 0.5, -nearest - 0.005}) {
        point.position.y() = offset;
        reference.push_back(point);
      }
    }
    ScanMatcherOptions options = MatcherOptions();
    options.max_iterations = 1;
    ScanMatcher matcher(options);
    matcher.SetReference(reference);
    const MatchResult result =
        matcher.Refine(scan, Pose2::Zero(), MatchPrior());
    EXPECT_EQ(result.inliers, 40);
    EXPECT_NEAR(result.pose[1], nearest, 1e-6) << nearest;
  }
}

TEST(ScanMatcherTest, EmptyReferenceLeavesTheGuess) {
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle()));
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference({});
  EXPECT_TRUE(matcher.empty());
  const Pose2 guess(1.0, 2.0, 0.5);
  const MatchResult match = matcher.Refine(scan, guess, MatchPrior());
  EXPECT_LT((match.pose - guess).norm(), 1e-12);
  EXPECT_EQ(match.inliers, 0);
  EXPECT_EQ(match.inlier_ratio, 0.0);
  EXPECT_EQ(match.information, Eigen::Matrix3d::Zero());
}

TEST(ScanMatcherTest, EmptyReferenceAfterAFullOne) {
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle()));
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(scan);
  EXPECT_FALSE(matcher.empty());
  EXPECT_GT(matcher.Refine(scan, Pose2::Zero(), MatchPrior()).inliers, 500);
  matcher.Search(scan, Pose2::Zero(), 0.1, 0.1, nullptr);
  matcher.SetReference({});
  EXPECT_TRUE(matcher.empty());
  EXPECT_EQ(matcher.Refine(scan, Pose2::Zero(), MatchPrior()).inliers, 0);
  double score = -1.0;
  EXPECT_EQ(matcher.Search(scan, Pose2::Zero(), 0.3, 0.1, &score),
            Pose2::Zero());
  EXPECT_EQ(score, 0.0);
}

TEST(ScanMatcherTest, SearchWithNothingToScoreReturnsTheCenter) {
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle()));
  const Pose2 center(100.0, 2.0, 0.5);
  ScanMatcher matcher(MatcherOptions());
  double score = -1.0;
  EXPECT_EQ(matcher.Search(scan, center, 0.45, 0.1, &score), center);
  EXPECT_EQ(score, 0.0);
  // A reference, but nowhere near.
  matcher.SetReference(scan);
  score = -1.0;
  EXPECT_EQ(matcher.Search(scan, center, 0.45, 0.1, &score), center);
  EXPECT_EQ(score, 0.0);
}

TEST(ScanMatcherTest, WildPointsInTheReferenceDoNotMatter) {
  const std::vector<ScanPoint> reference =
      Seen(RoomWithPillar(), Pose2(-0.5, 0.2, 0.1));
  const Pose2 truth(-0.2, 0.3, 0.25);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, FullCircle()));
  const Pose2 guess = truth + Pose2(0.1, -0.1, DegToRad(3.0));
  ScanMatcher clean(MatcherOptions());
  clean.SetReference(reference);
  const MatchResult expected = clean.Refine(scan, guess, MatchPrior());
  EXPECT_GT(expected.inliers, 500);
  const Eigen::Vector2d wilds[] = {
      {-1e4, 0.0}, {1e4, 1e4}, {0.0, -1e9}, {1e300, -1e300}};
  for (const Eigen::Vector2d& wild : wilds) {
    for (const bool first : {true, false}) {
      SCOPED_TRACE(::testing::Message() << wild.transpose() << " " << first);
      std::vector<ScanPoint> points = reference;
      ScanPoint point = reference.front();
      point.position = wild;
      points.insert(first ? points.begin() : points.end(), point);
      ScanMatcher matcher(MatcherOptions());
      matcher.SetReference(points);
      const MatchResult match = matcher.Refine(scan, guess, MatchPrior());
      EXPECT_EQ(match.inliers, expected.inliers);
      // Which points are one depends on where the grid begins.
      EXPECT_LT((match.pose - expected.pose).norm(),
                MatcherOptions().convergence);
      double score = 0.0;
      const Pose2 found =
          matcher.Search(scan, guess, 0.3, DegToRad(6.0), &score);
      EXPECT_LT(PositionError(found, truth), 0.15);
      EXPECT_GT(score, 0.6);
    }
  }
}

TEST(ScanMatcherTest, EmptyScanLeavesTheGuess) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2::Zero()));
  const Pose2 guess(1.0, 2.0, 0.5);
  const MatchResult match = matcher.Refine({}, guess, MatchPrior());
  EXPECT_LT((match.pose - guess).norm(), 1e-12);
  EXPECT_EQ(match.inliers, 0);
  double score = -1.0;
  EXPECT_EQ(matcher.Search({}, guess, 0.3, 0.1, &score), guess);
  EXPECT_EQ(score, 0.0);
}

TEST(ScanMatcherTest, ScanFarFromTheReferenceHasNoInliers) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2::Zero()));
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle()));
  const Pose2 guess(500.0, -500.0, 0.0);
  const MatchResult match = matcher.Refine(scan, guess, MatchPrior());
  EXPECT_EQ(match.inliers, 0);
  EXPECT_LT((match.pose - guess).norm(), 1e-12);
}

TEST(ScanMatcherTest, OtherFaceOfAThinWallIsNoPartner) {
  // Seen from above at y = 0.05, from below at y = -0.05.
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(
      Seen({{{-2.0, 0.05}, {2.0, 0.05}}}, Pose2(0.0, 1.5, 0.0)));
  const Pose2 below(0.0, -1.5, 0.0);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan({{{-2.0, -0.05}, {2.0, -0.05}}}, below, FullCircle()));
  const MatchResult match = matcher.Refine(scan, below, MatchPrior());
  EXPECT_EQ(match.inliers, 0);
}

TEST(ScanMatcherTest, PeopleInTheScanDoNotDragIt) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(RoomWithPillar(), Pose2::Zero()));
  // Somebody stands 0.3 m before the wall at y = -2.5, over 1.5 m.
  std::vector<WallEnds> crowded = RoomWithPillar();
  crowded.push_back({{-1.5, -2.2}, {0.0, -2.2}});
  const Pose2 truth(0.1, 0.1, 0.05);
  const MatchResult match =
      matcher.Refine(PointsOf(MakeScan(crowded, truth, FullCircle())),
                     Pose2::Zero(), MatchPrior());
  EXPECT_LT(PositionError(match.pose, truth), 0.01);
  EXPECT_LT(HeadingError(match.pose, truth), DegToRad(0.2));
  EXPECT_LT(match.inlier_ratio, 0.95);
}

TEST(ScanMatcherTest, NewReferenceReplacesTheOld) {
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), Pose2::Zero(), FullCircle()));
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(scan);
  double before = 0.0;
  matcher.Search(scan, Pose2::Zero(), 0.0, 0.0, &before);
  matcher.SetReference(Transformed(scan, Pose2(50.0, 0.0, 0.0)));
  double after = 0.0;
  matcher.Search(scan, Pose2::Zero(), 0.0, 0.0, &after);
  EXPECT_GT(before, 0.6);
  EXPECT_EQ(after, 0.0);
  EXPECT_EQ(matcher.Refine(scan, Pose2::Zero(), MatchPrior()).inliers, 0);
}

// Positions of what a scan sees, its own frame.
std::vector<Eigen::Vector2d> Positions(const std::vector<ScanPoint>& points) {
  std::vector<Eigen::Vector2d> positions;
  for (std::size_t i = 0; i < points.size(); i += 4) {
    positions.push_back(points[i].position);
  }
  return positions;
}

TEST(ScanMatcherTest, PeaksFindThePoseFromAnywhere) {
  ScanMatcher matcher(MatcherOptions());
  const Pose2 from(-0.5, 0.2, 0.1);
  matcher.SetReference(Seen(RoomWithPillar(), from), {{from.head<2>(), 0}});
  const Pose2 truth(0.6, -0.8, 2.8);
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(RoomWithPillar(), truth, FullCircle()));
  const std::vector<ScoredPose> peaks =
      matcher.Peaks(Positions(scan), Pose2::Zero(), 3.0, kPi, 0.2, 0.3, 5);
  ASSERT_FALSE(peaks.empty());
  EXPECT_LT(PositionError(peaks[0].pose, truth), 0.15);
  EXPECT_LT(HeadingError(peaks[0].pose, truth), DegToRad(2.0));
  for (std::size_t i = 1; i < peaks.size(); ++i) {
    EXPECT_LE(peaks[i].score, peaks[i - 1].score);
    EXPECT_GE(peaks[i].score, 0.3 * peaks[0].score);
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_TRUE(PositionError(peaks[i].pose, peaks[j].pose) >=
                      ScanMatcher::kPeakDistance - 1e-9 ||
                  HeadingError(peaks[i].pose, peaks[j].pose) >=
                      ScanMatcher::kPeakRotation - 1e-9);
    }
  }
  // Nothing in the windows.
  EXPECT_TRUE(
      matcher
          .Peaks(Positions(scan), Pose2(50.0, 0.0, 0.0), 3.0, kPi, 0.2, 0.3, 5)
          .empty());
}

TEST(ScanMatcherTest, NoPoseScoresMoreThanTheFirstPeak) {
  ScanMatcher matcher(MatcherOptions());
  const Pose2 from(-0.5, 0.2, 0.1);
  matcher.SetReference(Seen(RoomWithPillar(), from), {{from.head<2>(), 0}});
  const std::vector<Eigen::Vector2d> points = Positions(PointsOf(
      MakeScan(RoomWithPillar(), Pose2(0.6, -0.8, 0.2), FullCircle())));
  // The last two lie where the walls end, and beyond.
  for (const Pose2& center :
       {Pose2(0.2, -0.5, 0.1), Pose2(3.4, 2.4, 0.3), Pose2(-6.0, 1.0, 0.0)}) {
    SCOPED_TRACE(center.transpose());
    constexpr int kCells = 9;
    constexpr double kTurn = DegToRad(4.0);
    double expected = 0.0;
    for (const double turn : {-kTurn, 0.0, kTurn}) {
      for (int y = -kCells; y <= kCells; ++y) {
        for (int x = -kCells; x <= kCells; ++x) {
          const std::vector<ScoredPose> here =
              matcher.Peaks(points, center + Pose2(0.1 * x, 0.1 * y, turn), 0.0,
                            0.0, 0.0, 0.0, 1);
          if (!here.empty()) expected = std::max(expected, here[0].score);
        }
      }
    }
    const std::vector<ScoredPose> peaks =
        matcher.Peaks(points, center, 0.1 * kCells, kTurn, 0.01, 0.5, 5);
    ASSERT_EQ(peaks.empty(), expected < 0.01) << expected;
    if (!peaks.empty()) {
      EXPECT_GE(peaks[0].score, expected - 0.01);
    }
  }
}

TEST(ScanMatcherTest, PeaksOfARoomThatLooksTheSameTurnedRound) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(Room(7.0, 5.0), Pose2::Zero()),
                       {{Eigen::Vector2d::Zero(), 0}});
  const std::vector<ScanPoint> scan =
      PointsOf(MakeScan(Room(7.0, 5.0), Pose2(0.8, 0.4, 0.3), FullCircle()));
  const std::vector<ScoredPose> peaks =
      matcher.Peaks(Positions(scan), Pose2::Zero(), 3.0, kPi, 0.5, 0.8, 5);
  ASSERT_EQ(peaks.size(), 2u);
  EXPECT_GT(peaks[1].score, 0.95 * peaks[0].score);
  EXPECT_LT(
      PositionError(peaks[0].pose, Pose2(-peaks[1].pose.head<2>()[0],
                                         -peaks[1].pose.head<2>()[1], 0.0)),
      0.3);
}

TEST(ScanMatcherTest, CompareTellsSolidFromFree) {
  ScanMatcher matcher(MatcherOptions());
  matcher.SetReference(Seen(Room(7.0, 5.0), Pose2::Zero()),
                       {{Eigen::Vector2d::Zero(), 0}});
  const Eigen::Vector2d laser = Eigen::Vector2d::Zero();
  const Pose2 pose(0.5, 0.5, 0.2);
  const auto compare = [&](const std::vector<WallEnds>& walls,
                           const Pose2& seen) {
    return matcher.Compare(PointsOf(MakeScan(walls, seen, FullCircle())), pose,
                           laser);
  };
  const ScanAgreement same = compare(Room(7.0, 5.0), pose);
  EXPECT_GT(same.hits, 100);
  EXPECT_EQ(same.intruders, 0);
  EXPECT_GT(same.seen, 100);
  EXPECT_EQ(same.seen_through, 0);
  // A pillar that was not there.
  std::vector<WallEnds> walls = Room(7.0, 5.0);
  for (const WallEnds& side :
       testing::Moved(Room(0.8, 0.8), {-1.5, 0.0, 0.0})) {
    walls.push_back(side);
  }
  const ScanAgreement pillar = compare(walls, pose);
  EXPECT_GT(pillar.intruders, 4);
  EXPECT_EQ(pillar.seen_through, 0);
  EXPECT_LT(pillar.seen, same.seen);
  // A wall that is gone.
  const ScanAgreement gone = compare(Room(12.0, 5.0), pose);
  EXPECT_GT(gone.unknown, 10);
  EXPECT_GT(gone.seen_through, 20);
  EXPECT_EQ(gone.intruders, 0);
}

}  // namespace
}  // namespace plumbline
