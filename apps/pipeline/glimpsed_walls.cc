#include <plumbline/factors/angle.h>
#include <plumbline/frontend/place_chain.h>
#include <plumbline/frontend/wall_views.h>
#include <plumbline/pipeline/glimpsed_walls.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>

namespace plumbline {
namespace {

// How well a wall of glimpses is known relative to the place that saw it, m
// and rad.
constexpr double kGlimpsedPosition = 0.03;
constexpr double kGlimpsedDirection = DegToRad(0.3);

// By scan: the place that it belongs to.
std::vector<int> PlacesOfScans(const std::vector<KeyScanRecord>& records,
                               int place_stride, std::size_t num_scans) {
  const std::vector<std::size_t> begins = PlaceBegins(records, place_stride);
  std::vector<int> place_of_scan;
  for (std::size_t p = 0; p < begins.size(); ++p) {
    const auto first = static_cast<std::size_t>(records[begins[p]].scan);
    place_of_scan.resize(std::max(first, place_of_scan.size()),
                         std::max(0, static_cast<int>(p) - 1));
  }
  place_of_scan.resize(num_scans, static_cast<int>(begins.size()) - 1);
  return place_of_scan;
}

}  // namespace

Transaction BindGlimpsedWalls(const Transaction& walls, const Graph& graph,
                              const Registry& registry,
                              const std::vector<FeatureId>& places,
                              const std::vector<Scan>& scans,
                              const std::vector<KeyScanRecord>& records,
                              const std::vector<Pose2>& trajectory,
                              int place_stride,
                              const WallCompletionOptions& options) {
  Transaction bound;
  const Eigen::Vector3d sigma(kGlimpsedPosition, kGlimpsedPosition,
                              kGlimpsedDirection);
  const Eigen::Matrix3d information =
      sigma.array().square().inverse().matrix().asDiagonal();
  const std::vector<int> seen_from =
      GroupsThatSaw(walls.added_features(), scans, trajectory,
                    PlacesOfScans(records, place_stride, scans.size()),
                    options.points, options.explained_offset);
  for (std::size_t w = 0; w < seen_from.size(); ++w) {
    if (seen_from[w] < 0) continue;
    const Feature& wall = walls.added_features()[w];
    const Feature& place =
        graph.GetFeature(places[static_cast<std::size_t>(seen_from[w])]);
    bound.AddConstraint(MakeMeasurement(
        registry.GetRelation("pose_pose"), {place.id, bound.AddFeature(wall)},
        Between(place.type->frame(place), wall.type->frame(wall)), information,
        wall.source));
  }
  return bound;
}

}  // namespace plumbline
