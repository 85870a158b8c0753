#include <plumbline/frontend/beam_directions.h>
#include <plumbline/frontend/principal_axis.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Beams that are next to each other though some between them have no return.
constexpr int kNeighborBeams = 3;

// Of the tolerance of a normal what holds where neighbours lie beyond its
// radius, as beams graze the surface: noise of ranges hardly moves returns
// across the surface there, and what is off by more is a step, a door set back
// by some centimetres, which would turn the normal.
constexpr double kGrazedTolerance = 0.5;

bool SameSurface(const ScanPoint& a, const ScanPoint& b, double angle_step,
                 const ScanPointsOptions& options) {
  const int beams = b.beam - a.beam;
  if (beams > kNeighborBeams) return false;
  const double spread = std::sqrt(2.0) * std::max(a.range, b.range) *
                        std::abs(angle_step) * beams;
  const double limit = std::max(options.gap, options.gap_factor * spread);
  return (b.position - a.position).squaredNorm() <= limit * limit;
}

// Points on the line between two returns of neighbouring beams, in `parts`
// equal parts of the angle between these. `laser`: where both were seen from.
void AddBetween(const ScanPoint& first, const ScanPoint& second,
                const Eigen::Vector2d& laser, int parts,
                std::vector<ScanPoint>* points) {
  const Eigen::Vector2d from = first.position - laser;
  const Eigen::Vector2d line = second.position - first.position;
  const Eigen::Vector2d to = second.position - laser;
  const double turn =
      std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
  for (int part = 1; part < parts; ++part) {
    const Eigen::Vector2d beam =
        Eigen::Rotation2Dd(turn * part / parts) * from / first.range;
    const double across = beam.x() * line.y() - beam.y() * line.x();
    const double range = (from.x() * line.y() - from.y() * line.x()) / across;
    // Along the beams there is nothing to be said.
    if (!(range > 0.0 && std::isfinite(range))) continue;
    ScanPoint point = first;
    point.position = laser + range * beam;
    point.range = range;
    point.is_between = true;
    points->push_back(point);
  }
}

// Puts points between returns of neighbouring beams that lie on one surface.
// `goes_on`: whether a return lies on the surface of the one before it.
void FillBetween(const Eigen::Vector2d& laser, int parts,
                 std::vector<ScanPoint>* points, std::vector<char>* goes_on) {
  std::vector<ScanPoint> filled;
  std::vector<char> filled_goes_on;
  filled.reserve(points->size() * static_cast<std::size_t>(parts));
  for (std::size_t i = 0; i < points->size(); ++i) {
    const ScanPoint& point = (*points)[i];
    if ((*goes_on)[i] != 0 && point.beam == (*points)[i - 1].beam + 1) {
      AddBetween((*points)[i - 1], point, laser, parts, &filled);
      filled_goes_on.resize(filled.size(), 1);
    }
    filled.push_back(point);
    filled_goes_on.push_back((*goes_on)[i]);
  }
  *points = std::move(filled);
  *goes_on = std::move(filled_goes_on);
}

// Sums over the first points of a scan, from a place among them on: those over
// the points of a stretch are differences of two, whatever its length.
struct Sums {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;

  Sums Plus(const Eigen::Vector2d& d) const {
    return {position + d, xx + d.x() * d.x(), xy + d.x() * d.y(),
            yy + d.y() * d.y()};
  }
};

// Principal axis of so many points that lie between two sums, with scatters
// about their mean in place of variances.
PrincipalAxis AxisBetween(const Sums& before, const Sums& after, int count) {
  const Eigen::Vector2d sum = after.position - before.position;
  const Eigen::Vector2d mean = sum / count;
  return PrincipalAxisOf(after.xx - before.xx - sum.x() * mean.x(),
                         after.xy - before.xy - sum.x() * mean.y(),
                         after.yy - before.yy - sum.y() * mean.y());
}

// Parts into which the angle between neighbouring beams is cut.
int BeamParts(const Scan& scan, const ScanPointsOptions& options) {
  constexpr int kMostParts = 20;
  const double parts =
      std::ceil(std::abs(scan.angle_step) / options.max_beam_step);
  return static_cast<int>(std::clamp(parts, 1.0, 1.0 * kMostParts));
}

}  // namespace

void ExtractScanPoints(const Scan& scan, const ScanPointsOptions& options,
                       std::vector<ScanPoint>* points) {
  points->clear();
  const int beams = static_cast<int>(scan.ranges.size());
  const PoseTransform from_laser(scan.laser_offset);
  // Scans of one laser mostly come in a row.
  thread_local BeamDirections beam_directions;
  const std::vector<Eigen::Vector2d>& directions = beam_directions.Of(scan);
  for (int i = 0; i < beams; ++i) {
    const double range = scan.ranges[i];
    if (!(range >= options.minimum_range) || range > options.usable_range) {
      continue;
    }
    ScanPoint point;
    point.position =
        from_laser.Point(range * directions[static_cast<std::size_t>(i)]);
    point.normal.setZero();
    point.range = range;
    point.beam = i;
    points->push_back(point);
  }

  const Eigen::Vector2d laser = scan.laser_offset.head<2>();
  const bool has_jambs = scan.maximum_range > 0.0 &&
                         scan.maximum_range <= options.short_range &&
                         options.jamb_radius < options.normal_radius;
  // Whether a return lies on the surface of the one before it.
  std::vector<char> goes_on(points->size(), 0);
  for (std::size_t i = 1; i < points->size(); ++i) {
    goes_on[i] =
        SameSurface((*points)[i - 1], (*points)[i], scan.angle_step, options);
  }
  const int parts = BeamParts(scan, options);
  if (parts > 1) FillBetween(laser, parts, points, &goes_on);
  const double angle_step = std::abs(scan.angle_step) / parts;
  const int n = static_cast<int>(points->size());
  thread_local std::vector<Eigen::Vector2d> positions;
  positions.clear();
  for (const ScanPoint& point : *points) positions.push_back(point.position);
  // Before each point of the surface that is looked at; from its first one on,
  // so that they are as exact far away.
  thread_local std::vector<Sums> sums;
  for (int surface = 0; surface < n;) {
    sums.assign(1, Sums());
    int surface_end = surface;
    do {
      sums.push_back(
          sums.back().Plus(positions[surface_end] - positions[surface]));
      ++surface_end;
    } while (surface_end < n && goes_on[surface_end]);
    // The normal of a point over this radius, m, or where neighbours are far
    // apart over more; zero where the surface is not straight.
    const auto normal_over = [&](int i, double least_radius) {
      Eigen::Vector2d normal = Eigen::Vector2d::Zero();
      const ScanPoint& point = (*points)[i];
      // Far away neighbours are far apart.
      const double radius = std::max(
          least_radius, 2.5 * std::sqrt(2.0) * point.range * angle_step);
      const double squared_radius = radius * radius;
      int begin = i;
      while (begin > surface &&
             (positions[begin - 1] - positions[i]).squaredNorm() <=
                 squared_radius) {
        --begin;
      }
      int end = i + 1;
      while (end < surface_end &&
             (positions[end] - positions[i]).squaredNorm() <= squared_radius) {
        ++end;
      }
      const int within = end - begin;
      begin = std::min(begin, std::max(surface, i - options.normal_neighbors));
      end = std::max(end,
                     std::min(surface_end, i + options.normal_neighbors + 1));
      const int count = end - begin;
      if (count < 3) return normal;
      const PrincipalAxis axis =
          AxisBetween(sums[begin - surface], sums[end - surface], count);
      const double across = axis.across / count;
      const double along = axis.along / count;
      const double tolerance = count > within
                                   ? kGrazedTolerance * options.normal_tolerance
                                   : options.normal_tolerance;
      if (across > tolerance * tolerance || across > 0.1 * along) return normal;
      normal = Eigen::Vector2d(-axis.direction.y(), axis.direction.x());
      if (normal.dot(laser - point.position) < 0.0) normal = -normal;
      return normal;
    };
    for (int i = surface; i < surface_end; ++i) {
      Eigen::Vector2d& normal = (*points)[i].normal;
      normal = normal_over(i, options.normal_radius);
      if (has_jambs && normal.isZero()) {
        normal = normal_over(i, options.jamb_radius);
      }
    }
    surface = surface_end;
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
