#ifndef PLUMBLINE_TEST_FRONTEND_SYNTHETIC_WORLD_H_
#define PLUMBLINE_TEST_FRONTEND_SYNTHETIC_WORLD_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace plumbline::testing {

/// Reproducible normal numbers on every platform (Box and Muller).
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : engine_(seed) {}

  double Normal(double sigma) {
    const double u = 1.0 - Unit();
    const double v = Unit();
    return sigma * std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * kPi * v);
  }

 private:
  double Unit() {
    constexpr double kUnit = 1.0 / 9007199254740992.0;  // 2^-53
    return static_cast<double>(engine_() >> 11) * kUnit;
  }

  std::mt19937_64 engine_;
};

/// A straight wall from a to b, map frame, m.
struct WallEnds {
  Eigen::Vector2d a;
  Eigen::Vector2d b;
};

/// A rectangle of four walls about the origin: y = -height/2, x = width/2,
/// y = height/2, x = -width/2.
inline std::vector<WallEnds> Room(double width, double height) {
  const double x = 0.5 * width;
  const double y = 0.5 * height;
  return {{{-x, -y}, {x, -y}},
          {{x, -y}, {x, y}},
          {{x, y}, {-x, y}},
          {{-x, y}, {-x, -y}}};
}

/// Two walls at y = -1 and y = 1, whose ends are out of sight.
inline std::vector<WallEnds> Corridor() {
  return {{{-200.0, -1.0}, {200.0, -1.0}}, {{-200.0, 1.0}, {200.0, 1.0}}};
}

/// The world moved by `pose`.
inline std::vector<WallEnds> Moved(const std::vector<WallEnds>& walls,
                                   const Pose2& pose) {
  std::vector<WallEnds> moved;
  for (const WallEnds& wall : walls) {
    moved.push_back(
        {TransformPoint(pose, wall.a), TransformPoint(pose, wall.b)});
  }
  return moved;
}

/// Distance from `from` to the nearest wall in direction `angle`; infinity
/// when there is none.
inline double CastRay(const std::vector<WallEnds>& walls,
                      const Eigen::Vector2d& from, double angle) {
  const Eigen::Vector2d ray(std::cos(angle), std::sin(angle));
  double nearest = std::numeric_limits<double>::infinity();
  for (const WallEnds& wall : walls) {
    const Eigen::Vector2d side = wall.b - wall.a;
    const Eigen::Vector2d to = wall.a - from;
    const double cross = ray.x() * side.y() - ray.y() * side.x();
    if (cross == 0.0) continue;
    const double distance = (to.x() * side.y() - to.y() * side.x()) / cross;
    const double along = (to.x() * ray.y() - to.y() * ray.x()) / cross;
    if (distance > 0.0 && along >= 0.0 && along <= 1.0 && distance < nearest) {
      nearest = distance;
    }
  }
  return nearest;
}

struct Laser {
  Pose2 offset = Pose2::Zero();
  double start_angle = -0.5 * kPi;
  double angle_step = DegToRad(1.0);
  int beams = 181;
  double maximum_range = 30.0;
  /// Standard deviation of a range, m.
  double sigma = 0.0;
};

/// All around, half a degree a beam.
inline Laser FullCircle() {
  Laser laser;
  laser.start_angle = -kPi;
  laser.angle_step = DegToRad(0.5);
  laser.beams = 720;
  return laser;
}

/// What a robot at `robot` (map frame) sees. `noise` may be null.
inline Scan MakeScan(const std::vector<WallEnds>& walls, const Pose2& robot,
                     const Laser& laser, Noise* noise = nullptr) {
  Scan scan;
  scan.odometry = robot;
  scan.laser_offset = laser.offset;
  scan.start_angle = laser.start_angle;
  scan.angle_step = laser.angle_step;
  scan.maximum_range = laser.maximum_range;
  const Pose2 eye = Compose(robot, laser.offset);
  for (int i = 0; i < laser.beams; ++i) {
    double range = CastRay(walls, eye.head<2>(),
                           eye[2] + laser.start_angle + i * laser.angle_step);
    if (noise != nullptr) range += noise->Normal(laser.sigma);
    scan.ranges.push_back(
        range < laser.maximum_range ? static_cast<float>(range) : 0.0f);
  }
  return scan;
}

inline std::vector<ScanPoint> PointsOf(const Scan& scan,
                                       const ScanPointsOptions& options = {}) {
  std::vector<ScanPoint> points;
  ExtractScanPoints(scan, options, &points);
  return points;
}

/// Points and normals of a scan in the frame in which `pose` is given.
inline std::vector<ScanPoint> Transformed(std::vector<ScanPoint> points,
                                          const Pose2& pose) {
  const Pose2 turn(0.0, 0.0, pose[2]);
  for (ScanPoint& point : points) {
    point.position = TransformPoint(pose, point.position);
    point.normal = TransformPoint(turn, point.normal);
  }
  return points;
}

/// The observation of a whole wall without error: direction with the robot on
/// the left, covariance diag(offset_sigma^2, angle_sigma^2).
inline SegmentObservation Observe(const Pose2& robot, const WallEnds& wall,
                                  double offset_sigma = 0.01,
                                  double angle_sigma = DegToRad(0.3)) {
  Eigen::Vector2d side = wall.b - wall.a;
  const Eigen::Vector2d to = robot.head<2>() - wall.a;
  if (side.x() * to.y() - side.y() * to.x() < 0.0) side = -side;
  const Eigen::Vector2d middle = 0.5 * (wall.a + wall.b);
  SegmentObservation observation;
  observation.pose = Between(
      robot, Pose2(middle.x(), middle.y(), std::atan2(side.y(), side.x())));
  observation.length = side.norm();
  observation.points = 50;
  observation.covariance =
      Eigen::Vector2d(offset_sigma * offset_sigma, angle_sigma * angle_sigma)
          .asDiagonal();
  return observation;
}

/// Distance of two poses in position, m, and heading, rad.
inline double PositionError(const Pose2& a, const Pose2& b) {
  return (a.head<2>() - b.head<2>()).norm();
}
inline double HeadingError(const Pose2& a, const Pose2& b) {
  return std::abs(NormalizeAngle(a[2] - b[2]));
}

}  // namespace plumbline::testing

#endif  // PLUMBLINE_TEST_FRONTEND_SYNTHETIC_WORLD_H_
