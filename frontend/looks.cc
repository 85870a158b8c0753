#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/looks.h>
#include <plumbline/frontend/place_chain.h>

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <utility>

namespace plumbline {

std::vector<LookPlace> LooksFromPlaces(
    const std::vector<KeyScanRecord>& records,
    const std::vector<FeatureId>& places, int place_stride) {
  const std::vector<std::size_t> begins = PlaceBegins(records, place_stride);
  if (begins.size() != places.size()) {
    throw PLUMBLINE_ERROR(std::to_string(places.size()) + " places",
                          std::to_string(begins.size()));
  }
  std::vector<LookPlace> looks;
  for (std::size_t p = 0; p < begins.size(); ++p) {
    looks.push_back({records[begins[p]].scan, places[p], Pose2::Zero()});
  }
  return looks;
}

std::vector<LookPlace> LooksFromWalls(const std::vector<KeyScanRecord>& records,
                                      const std::vector<Pose2>& key_poses,
                                      const Graph& graph, int place_stride) {
  if (key_poses.size() != records.size()) {
    throw PLUMBLINE_ERROR(std::to_string(key_poses.size()) + " poses",
                          std::to_string(records.size()));
  }
  std::vector<LookPlace> looks;
  for (const std::size_t k : PlaceBegins(records, place_stride)) {
    const Feature* longest = nullptr;
    double length = 0.0;
    for (const FeatureMatch& match : records[k].matches) {
      const Feature* wall = graph.FindFeature(match.feature);
      if (wall == nullptr || !(match.observation.length > length)) continue;
      longest = wall;
      length = match.observation.length;
    }
    if (longest == nullptr) continue;
    looks.push_back({records[k].scan, longest->id,
                     Between(longest->type->frame(*longest), key_poses[k])});
  }
  return looks;
}

Looks CollectLooks(const std::vector<Scan>& scans,
                   const std::vector<LookPlace>& places,
                   const LookOptions& options) {
  Looks looks;
  looks.reserve(places.size());
  std::vector<ScanPoint> points;
  for (const LookPlace& place : places) {
    const Scan& scan = scans[static_cast<std::size_t>(place.scan)];
    ExtractScanPoints(scan, options.points, &points);
    const PoseTransform transform(place.pose);
    Look look;
    look.frame = place.frame;
    look.sensor = transform.Point(scan.laser_offset.head<2>());
    double last = -HUGE_VAL;
    for (const ScanPoint& point : points) {
      if (point.is_between) continue;
      const double bearing = scan.Bearing(static_cast<std::size_t>(point.beam));
      if (std::abs(bearing - last) < options.min_step) continue;
      last = bearing;
      Eigen::Vector2d end = transform.Point(point.position);
      if (point.range > options.max_range) {
        end =
            look.sensor + options.max_range / point.range * (end - look.sensor);
      }
      look.ends.push_back(end);
    }
    looks.push_back(std::move(look));
  }
  return looks;
}

}  // namespace plumbline
