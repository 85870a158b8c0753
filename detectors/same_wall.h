#ifndef PLUMBLINE_DETECTORS_SAME_WALL_H_
#define PLUMBLINE_DETECTORS_SAME_WALL_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/place_match.h>

#include <string>

namespace plumbline {

/// Options for which walls are taken for one, and how tightly they are tied.
struct SameWallOptions {
  /// Tolerance of a wall seen twice: across (m) and direction (rad).
  double sigma_offset = 0.05;
  double sigma_angle = DegToRad(0.3);
  /// Segments with a shorter visible part are left out, m.
  double min_length = 0.4;
  /// Reach of a place from the wall in its middle, in measurement links and in
  /// m; a new place begins this far from the last, m.
  int place_links = 2;
  double place_radius = 7.0;
  double place_spacing = 3.0;
  /// Places fewer measurement links apart are of one visit: association saw
  /// both.
  int min_links = 4;
  /// The graph's relative covariances neglect what errors have in common (only
  /// the last robot pose is kept): standard deviations are taken this many
  /// times larger, and a drift of this share of the way between two places is
  /// added, m/m.
  double covariance_scale = 2.0;
  double drift_rate = 0.005;
  /// Least uncertainty of two places against each other, m and rad.
  double least_position_sigma = 0.03;
  double least_angle_sigma = DegToRad(0.2);
  /// Two walls side by side, whose relative place the graph knows to this (m),
  /// are one when they are within this offset (m), whenever they were seen:
  /// there is no room for two.
  double known_sigma = 0.15;
  double known_offset = 0.03;
  /// Of two places that explain a third, but put its walls this far apart, m,
  /// one is wrong.
  double contradiction = 0.5;
  PlaceMatchOptions match;
};

/// Closes loops: proposes that segments seen in different visits are one wall
/// (segment_segment_collinearity, expected zero). Reads "segment" features of
/// level 0.
///
/// Places (walls seen together) that lie far apart in measurement links, but
/// near each other within the uncertainty that the graph and the way between
/// them leave, are compared as a whole (MatchPlaces): walls are matched only in
/// agreement on one displacement, only when no other displacement explains
/// nearly as much, and along a corridor only across it. The least uncertain
/// closures come first: a proposal holds those whose search was narrow, and
/// wider ones only when no narrower ones are left. What they say moves the map,
/// and the next call sees it so.
///
/// Walls that live closures already make one (also by way of others) are left
/// alone, and pairs once broken are not what a proposal waits for. A scope with
/// a list of features gives no proposal: loops are a matter of the whole map.
class SameWall : public StructureDetector {
 public:
  /// Options that make no sense are refused by the type's factory.
  explicit SameWall(const SameWallOptions& options);

  const std::string& name() const override;
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  SameWallOptions options_;
};

/// Name of the relation that closures are made of.
extern const char* const kSameWallRelation;

/// "same_wall" with its parameters (angles in degrees).
DetectorType SameWallType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_SAME_WALL_H_
