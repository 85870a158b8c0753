#include <plumbline/frontend/scan_points.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace plumbline {
namespace {

// Beams that are next to each other though some between them have no return.
constexpr int kNeighborBeams = 3;

bool SameSurface(const ScanPoint& a, const ScanPoint& b, double angle_step,
                 const ScanPointsOptions& options) {
  const int beams = b.beam - a.beam;
  if (beams > kNeighborBeams) return false;
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
    const double angle = scan.Bearing(static_cast<std::size_t>(i));
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
  // Whether a return lies on the surface of the one before it.
  std::vector<char> goes_on(static_cast<std::size_t>(n), 0);
  for (int i = 1; i < n; ++i) {
    goes_on[i] =
        SameSurface((*points)[i - 1], (*points)[i], scan.angle_step, options);
  }
  int surface_begin = 0;
  for (int i = 0; i < n; ++i) {
    if (!goes_on[i]) surface_begin = i;
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
    while (end < n && goes_on[end] &&
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

int MarkClutter(const Scan& scan, const std::vector<ScanPoint>& points,
                const ClutterOptions& options, std::vector<bool>* clutter) {
  clutter->assign(points.size(), false);
  // Things end where the range jumps.
  struct Thing {
    std::size_t begin;
    std::size_t end;
    bool is_narrow;
    bool is_marked = false;
  };
  std::vector<Thing> things;
  const auto are_neighbors = [&](std::size_t a, std::size_t b) {
    return points[b].beam - points[a].beam <= kNeighborBeams;
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i == 0 || !are_neighbors(i - 1, i) ||
        std::abs(points[i].range - points[i - 1].range) > options.min_jump) {
      things.push_back({i, i, false});
    }
    things.back().end = i + 1;
  }
  for (Thing& thing : things) {
    const ScanPoint& first = points[thing.begin];
    const ScanPoint& last = points[thing.end - 1];
    thing.is_narrow = std::max(first.range, last.range) <= options.max_range &&
                      (last.position - first.position).norm() +
                              first.range * std::abs(scan.angle_step) <=
                          options.max_width;
  }
  int marked = 0;
  // Things in front of things: what is marked does not hide what is beside it.
  for (bool again = true; again;) {
    again = false;
    for (std::size_t k = 0; k < things.size(); ++k) {
      Thing& thing = things[k];
      if (!thing.is_narrow || thing.is_marked) continue;
      const auto stands_free = [&](std::size_t edge, int step) {
        std::size_t beside = edge;
        for (std::size_t j = k + step; j < things.size(); j += step) {
          const std::size_t next =
              step > 0 ? things[j].begin : things[j].end - 1;
          if (!are_neighbors(std::min(beside, next), std::max(beside, next))) {
            break;
          }
          if (!things[j].is_marked) {
            return points[next].range > points[edge].range + options.min_depth;
          }
          beside = step > 0 ? things[j].end - 1 : things[j].begin;
        }
        // At the end of the field of view, unless something else stands there.
        return beside == edge;
      };
      if (!stands_free(thing.begin, -1) || !stands_free(thing.end - 1, 1)) {
        continue;
      }
      thing.is_marked = true;
      again = true;
      for (std::size_t i = thing.begin; i < thing.end; ++i) {
        (*clutter)[i] = true;
        ++marked;
      }
    }
  }
  return marked;
}

}  // namespace plumbline
