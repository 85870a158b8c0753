#ifndef PLUMBLINE_DETECTORS_MAP_DIRECTIONS_H_
#define PLUMBLINE_DETECTORS_MAP_DIRECTIONS_H_

#include <plumbline/core/graph.h>
#include <plumbline/detectors/direction_network.h>
#include <plumbline/factors/angle.h>

#include <cstddef>
#include <map>
#include <vector>

namespace plumbline {

/// Trust in the directions of a map's links.
struct MapDirectionsOptions {
  /// Standard deviations of links are taken this many times larger: ones that
  /// are too large cost little, ones that are too small tear directions apart.
  double sigma_scale = 1.5;
  /// No link is known better than this, rad: what is wrong with the look at a
  /// wall is wrong in every look.
  double sigma_floor = DegToRad(0.1);
};

/// The directions of a map's poses and segments.
struct MapDirections {
  DirectionNetwork network;
  /// Node of each feature with a direction.
  std::map<FeatureId, std::size_t> nodes;
  /// The constraints that the links were made from.
  std::vector<ConstraintId> constraints;
  /// Whether poses that saw the walls are part of the map.
  bool has_sightings = false;
};

/// Whether a feature has a direction that measurements may tell: a pose or a
/// wall with a frame of its own.
bool HasDirection(const Feature& feature);

/// What the live measurements between pairs of poses and segments say about the
/// difference of their directions, all positions left open: the constraint is
/// linearized at the present state, and the relative position is marginalized
/// out of its information (Schur complement). Constraints that say nothing
/// about directions, and those on features without one, are left out. With
/// `scope` (ascending ids) only those among the features listed.
MapDirections CollectDirections(const Graph& graph,
                                const std::vector<FeatureId>* scope,
                                const MapDirectionsOptions& options);

/// How far the direction of a wall's visible part may be off the wall's (rad),
/// by its length (m) and what it is for a wall of 1 m: points at a constant
/// spacing and noise, panels and frames.
double OwnDirectionSigma(double length, double sigma_of_one_metre);

/// Adds the orientations that walls of the map are tied to, and the ties as
/// links; `sigma_of_one_metre` as above.
void AddOrientations(const Graph& graph, double sigma_of_one_metre,
                     MapDirections* map);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_MAP_DIRECTIONS_H_
