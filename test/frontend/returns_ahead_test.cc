#include <gtest/gtest.h>
#include <plumbline/frontend/returns_ahead.h>

#include <atomic>
#include <cmath>
#include <random>
#include <thread>
#include <vector>

namespace plumbline {
namespace {

// A wall 2 m ahead that is about as rough as normals of a usual laser allow.
std::vector<Scan> ScansOfARoughWall(int count) {
  std::mt19937 generator(5);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::vector<Scan> scans;
  for (int k = 0; k < count; ++k) {
    Scan scan;
    scan.start_angle = -0.6;
    scan.angle_step = 0.01;
    for (int i = 0; i < 120; ++i) {
      const double angle = scan.start_angle + i * scan.angle_step;
      scan.ranges.push_back(
          static_cast<float>(2.0 / std::cos(angle) + noise(generator)));
    }
    scans.push_back(scan);
  }
  return scans;
}

std::vector<ScanPoint> Expected(const Scan& scan, double noise_scale) {
  ScanPointsOptions options;
  options.ScaleToNoise(noise_scale);
  std::vector<ScanPoint> points;
  ExtractScanPoints(scan, options, &points);
  return points;
}

int Normals(const std::vector<ScanPoint>& points) {
  int count = 0;
  for (const ScanPoint& point : points) count += !point.normal.isZero(0.0);
  return count;
}

void ExpectSame(const std::vector<ScanPoint>& points,
                const std::vector<ScanPoint>& expected) {
  ASSERT_EQ(points.size(), expected.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].position, expected[i].position);
    EXPECT_EQ(points[i].normal, expected[i].normal);
    EXPECT_EQ(points[i].beam, expected[i].beam);
  }
}

TEST(ReturnsAheadTest, AreThoseOfTheNextScan) {
  const std::vector<Scan> scans = ScansOfARoughWall(10);
  ReturnsAhead returns(scans, 3, ScanPointsOptions(), 2);
  std::vector<ScanPoint> points;
  // Made when they are asked for, then made ahead, then half and half.
  returns.Take(1.0, &points);
  ExpectSame(points, Expected(scans[3], 1.0));
  EXPECT_TRUE(returns.MakeNext());
  EXPECT_TRUE(returns.MakeNext());
  EXPECT_FALSE(returns.MakeNext());
  for (std::size_t i = 4; i < scans.size(); ++i) {
    returns.Take(1.0, &points);
    ExpectSame(points, Expected(scans[i], 1.0));
    if (i == 6) {
      EXPECT_TRUE(returns.MakeNext());
    }
  }
  EXPECT_FALSE(returns.MakeNext());
}

TEST(ReturnsAheadTest, AreMadeAnewForANoisierLaser) {
  const std::vector<Scan> scans = ScansOfARoughWall(4);
  ASSERT_GT(Normals(Expected(scans[1], 3.0)),
            Normals(Expected(scans[1], 1.0)) + 5);
  ReturnsAhead returns(scans, 0, ScanPointsOptions(), 3);
  std::vector<ScanPoint> points;
  returns.Take(1.0, &points);
  EXPECT_TRUE(returns.MakeNext());
  EXPECT_TRUE(returns.MakeNext());
  for (std::size_t i = 1; i < scans.size(); ++i) {
    returns.Take(3.0, &points);
    ExpectSame(points, Expected(scans[i], 3.0));
  }
}

TEST(ReturnsAheadTest, AnotherThreadMayMakeThem) {
  const std::vector<Scan> scans = ScansOfARoughWall(500);
  ReturnsAhead returns(scans, 0, ScanPointsOptions(), 4);
  std::atomic<bool> is_done{false};
  std::thread other([&] {
    while (!is_done) {
      if (!returns.MakeNext()) std::this_thread::yield();
    }
  });
  std::vector<ScanPoint> points;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const double noise_scale = i < 200 ? 1.0 : 2.0;
    returns.Take(noise_scale, &points);
    ExpectSame(points, Expected(scans[i], noise_scale));
  }
  is_done = true;
  other.join();
}

}  // namespace
}  // namespace plumbline
