#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/contested_ways.h>
#include <plumbline/frontend/near_points.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Comparisons that one thread makes in a row.
constexpr std::size_t kInTurn = 64;
// No points are put between beams this far apart, rad.
constexpr double kNoneBetween = 4.0;

// Scans that are compared, each with the one before in the list where the robot
// did not jump between them.
struct Station {
  std::size_t scan = 0;
  bool follows = false;
};

std::vector<Station> StationsOf(const std::vector<Scan>& scans, double scale,
                                const ContestedWayOptions& options) {
  std::vector<Station> stations;
  double way = 0.0;
  bool follows = false;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const double step =
        i == 0 ? 0.0
               : scale * Between(scans[i - 1].odometry, scans[i].odometry)
                             .head<2>()
                             .norm();
    const bool jumps = step > options.jump;
    way += step;
    if (!stations.empty() && !jumps && way < options.step) continue;
    stations.push_back({i, follows && !jumps});
    way = 0.0;
    follows = true;
  }
  return stations;
}

// What the returns of a scan say of the way from the one before.
struct Witnesses {
  int along = 0;
  int standing = 0;
};

class Comparison {
 public:
  Comparison(const ContestedWayOptions& options, double scale)
      : options_(options), scale_(scale) {
    points_options_ = options.points;
    points_options_.max_beam_step = kNoneBetween;
  }

  void Read(const Scan& scan, std::vector<ScanPoint>* points) const {
    ExtractScanPoints(scan, points_options_, points);
  }

  // How many returns of a scan go along, and how many stand.
  Witnesses Compare(const std::vector<ScanPoint>& before,
                    const std::vector<ScanPoint>& now, Pose2 motion) const {
    Witnesses witnesses;
    if (std::abs(motion[2]) > options_.max_turn) return witnesses;
    motion.head<2>() *= scale_;
    const PoseTransform transform(motion);
    const NearPoints near(before);
    for (std::size_t i = 0; i < now.size(); ++i) {
      const ScanPoint& point = now[i];
      if (point.range > options_.max_range || point.is_between ||
          (point.normal.isZero() && StandsAlone(now, i))) {
        continue;
      }
      const Vector2d was = transform.Point(point.position);
      if (ShiftAlongNormal(point, was) < options_.least_shift) continue;
      const bool stays =
          near.DistanceTo(point.position, point.normal) <= options_.near;
      const bool stands =
          near.DistanceTo(was, transform.Direction(point.normal)) <=
          options_.near;
      witnesses.along += stays && !stands;
      witnesses.standing += stands && !stays;
    }
    return witnesses;
  }

 private:
  // Where beams graze a wall each scan has its returns at the same places, and
  // none between them.
  bool StandsAlone(const std::vector<ScanPoint>& points, std::size_t i) const {
    const auto is_near = [&](std::size_t k) {
      return (points[k].position - points[i].position).norm() <= options_.near;
    };
    return !(i > 0 && is_near(i - 1)) &&
           !(i + 1 < points.size() && is_near(i + 1));
  }

  const ContestedWayOptions& options_;
  const double scale_;
  ScanPointsOptions points_options_;
};

// By station.
std::vector<Witnesses> CompareAll(const std::vector<Scan>& scans,
                                  const std::vector<Station>& stations,
                                  double scale,
                                  const ContestedWayOptions& options) {
  const Comparison comparison(options, scale);
  std::vector<Witnesses> witnesses(stations.size());
  ParallelFor(
      (stations.size() + kInTurn - 1) / kInTurn, options.num_threads,
      [&](std::size_t turn) {
        std::vector<ScanPoint> before, now;
        const std::size_t begin = std::max<std::size_t>(1, turn * kInTurn);
        const std::size_t end = std::min(stations.size(), (turn + 1) * kInTurn);
        if (begin >= end) return;
        comparison.Read(scans[stations[begin - 1].scan], &before);
        for (std::size_t i = begin; i < end; ++i) {
          const Scan& scan = scans[stations[i].scan];
          comparison.Read(scan, &now);
          if (stations[i].follows) {
            witnesses[i] = comparison.Compare(
                before, now,
                Between(scans[stations[i - 1].scan].odometry, scan.odometry));
          }
          before.swap(now);
        }
      });
  return witnesses;
}

ContestedWay WayBetween(const std::vector<Scan>& scans,
                        const std::vector<Pose2>& trajectory, double scale,
                        const std::vector<Station>& stations, std::size_t first,
                        std::size_t last) {
  ContestedWay way;
  way.begin = static_cast<int>(stations[first].scan);
  way.end = static_cast<int>(stations[last].scan);
  for (std::size_t i = first; i < last; ++i) {
    const std::size_t begin = stations[i].scan;
    const std::size_t end = stations[i + 1].scan;
    way.by_map += Between(trajectory[begin], trajectory[end]).head<2>().norm();
    way.by_odometry +=
        scale *
        Between(scans[begin].odometry, scans[end].odometry).head<2>().norm();
  }
  return way;
}

}  // namespace

std::vector<ContestedWay> FindContestedWays(
    const std::vector<Scan>& scans, const std::vector<Pose2>& trajectory,
    double scale, const ContestedWayOptions& options) {
  if (trajectory.size() != scans.size()) {
    throw PLUMBLINE_ERROR(
        "a trajectory of " + std::to_string(trajectory.size()) + " poses",
        "one for each of " + std::to_string(scans.size()) + " scans");
  }
  const std::vector<Station> stations = StationsOf(scans, scale, options);
  const std::vector<Witnesses> witnesses =
      CompareAll(scans, stations, scale, options);
  std::vector<ContestedWay> ways;
  std::size_t first = 0;
  std::size_t last = 0;
  int steps = 0;
  Witnesses sum;
  const auto end_stretch = [&] {
    if (steps >= options.min_steps) {
      const ContestedWay way =
          WayBetween(scans, trajectory, scale, stations, first, last);
      const bool is_unopposed = sum.standing <= options.unopposed * sum.along;
      double doubt = options.scale_sigma * way.by_odometry;
      if (is_unopposed) doubt = way.by_odometry;
      if (way.by_odometry >= options.least_length) {
        doubt = std::max(doubt, std::abs(way.by_odometry - way.by_map));
      }
      if (doubt > options.told) ways.push_back(way);
    }
    steps = 0;
    sum = Witnesses();
  };
  for (std::size_t i = 1; i < stations.size(); ++i) {
    if (!stations[i].follows) end_stretch();
    const Witnesses& here = witnesses[i];
    if (here.along < options.min_along ||
        here.along <= options.min_ratio * here.standing) {
      continue;
    }
    if (steps > 0 && i > last + 1 + static_cast<std::size_t>(options.max_gap)) {
      end_stretch();
    }
    if (steps == 0) first = i - 1;
    last = i;
    ++steps;
    sum.along += here.along;
    sum.standing += here.standing;
  }
  end_stretch();
  return ways;
}

}  // namespace plumbline
