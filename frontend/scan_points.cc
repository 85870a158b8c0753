#include <plumbline/frontend/scan_points.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

bool SameSurface(const ScanPoint& a, const ScanPoint& b, double angle_step,
                 const ScanPointsOptions& options) {
  const int beams = b.beam - a.beam;
  if (beams > 3) return false;
  const double spread = std::sqrt(2.0) * std::max(a.range, b.range) *
                        std::abs(angle_step) * beams;
  const double limit = std::max(options.gap, options.gap_factor * spread);
  return (b.position - a.position).squaredNorm() <= limit * limit;
}

}  // namespace

void ExtractScanPoints(const Scan& scan, const ScanPointsOptions& options,
                       std::vector<ScanPoint>* points) {
  points->clear();
  const int beams = static_cast<int>(scan.ranges.size());
  const PoseTransform from_laser(scan.laser_offset);
  for (int i = 0; i < beams; ++i) {
    const double range = scan.ranges[i];
    if (!(range >= options.minimum_range) || range > options.usable_range) {
      continue;
    }
    const double angle = scan.start_angle + i * scan.angle_step;
    ScanPoint point;
    point.position = from_laser.Point(
        Eigen::Vector2d(range * std::cos(angle), range * std::sin(angle)));
    point.normal.setZero();
    point.range = range;
    point.beam = i;
    points->push_back(point);
  }

  const int n = static_cast<int>(points->size());
  const Eigen::Vector2d laser = scan.laser_offset.head<2>();
  int surface_begin = 0;
  for (int i = 0; i < n; ++i) {
    if (i > 0 && !SameSurface((*points)[i - 1], (*points)[i], scan.angle_step,
                              options)) {
      surface_begin = i;
    }
    ScanPoint& point = (*points)[i];
    // Far away neighbours are far apart: widen the fit to hold two on each
    // side where the surface allows.
    const double radius =
        std::max(options.normal_radius, 2.5 * std::sqrt(2.0) * point.range *
                                            std::abs(scan.angle_step));
    int begin = i;
    while (begin > surface_begin &&
           ((*points)[begin - 1].position - point.position).squaredNorm() <=
               radius * radius) {
      --begin;
    }
    int end = i + 1;
    while (end < n &&
           SameSurface((*points)[end - 1], (*points)[end], scan.angle_step,
                       options) &&
           ((*points)[end].position - point.position).squaredNorm() <=
               radius * radius) {
      ++end;
    }
    const int count = end - begin;
    if (count < 3) continue;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (int j = begin; j < end; ++j) mean += (*points)[j].position;
    mean /= count;
    double sxx = 0.0, sxy = 0.0, syy = 0.0;
    for (int j = begin; j < end; ++j) {
      const Eigen::Vector2d d = (*points)[j].position - mean;
      sxx += d.x() * d.x();
      sxy += d.x() * d.y();
      syy += d.y() * d.y();
    }
    const double direction = 0.5 * std::atan2(2.0 * sxy, sxx - syy);
    const double half_trace = 0.5 * (sxx + syy);
    const double radical = std::hypot(0.5 * (sxx - syy), sxy);
    const double across = std::max(0.0, half_trace - radical) / count;
    const double along = (half_trace + radical) / count;
    if (across > options.normal_tolerance * options.normal_tolerance ||
        across > 0.1 * along) {
      continue;
    }
    Eigen::Vector2d normal(-std::sin(direction), std::cos(direction));
    if (normal.dot(laser - point.position) < 0.0) normal = -normal;
    point.normal = normal;
  }
}

}  // namespace plumbline
