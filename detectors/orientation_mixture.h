#ifndef PLUMBLINE_DETECTORS_ORIENTATION_MIXTURE_H_
#define PLUMBLINE_DETECTORS_ORIENTATION_MIXTURE_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/axial.h>
#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_scatter.h>
#include <plumbline/detectors/map_directions.h>

#include <string>
#include <vector>

namespace plumbline {

/// Options: which walls share a direction, and how tightly they are tied to it.
struct OrientationMixtureOptions {
  /// Tolerance of a wall against its orientation, rad.
  double sigma = DegToRad(0.1);
  /// Features with a shorter visible part are left out, m. A feature without
  /// extent has an unknown length and counts as one of 1 m.
  double min_length = 0.5;
  /// Standard deviation of the direction of a feature of 1 m, rad. It falls
  /// with length^1.5: points at a constant spacing and noise.
  double direction_noise = DegToRad(0.7);
  /// Orientations with fewer live features are dropped.
  int minimum_support = 2;
  /// How directions are told from clutter. `gate` also decides which features
  /// join an orientation.
  AxialMixtureOptions mixture;
  /// How far the direction of a wall's visible part may be off the wall's own,
  /// rad, for a wall of 1 m; it falls with length^1.5. Panels, frames and
  /// cupboards are in every look: on real logs walls agree only so well.
  double own_direction_noise = DegToRad(2.0);
  /// How walls whose directions the measurements tie to each other are
  /// assigned (its sigma is the one above), how parallel they are whatever
  /// their length, and how far the measurements are trusted.
  DirectionAssignmentOptions assignment;
  DirectionScatterOptions scatter;
  MapDirectionsOptions links;
};

/// Orientations of segments and lines (core/method.md, section 6): reads
/// features of the types "segment" and "line" of a level, and of those below
/// that have no orientation yet, and makes virtual "orientation" features one
/// level up, tied by the relations segment_orientation and line_orientation
/// (expected 0). So walls (level 0 or 1) and rows of columns (level 2 or 3)
/// have directions in common when the detector stands above both.
///
/// A "rectangle" is tied by rectangle_orientation in both its directions
/// (expected 0 and pi/2), where they have an orientation; its walls speak for
/// it among the others, and are not tied themselves.
///
/// Segments of a whole map that holds the poses which saw them are assigned by
/// AssignDirections (core/method.md, section 9): what their measurements say
/// about their directions decides, not how near to a direction a solve has
/// pulled them. Ties that lose are broken.
///
/// Otherwise a feature that no live constraint ties to an orientation joins the
/// nearest one within the gate, one that is there already or a new one. New
/// ones are what FindAxialComponents sees in the features that are beyond every
/// gate. With a list in the scope only the listed features, of this level and
/// of lower ones, join or make orientations; those that exist are known to
/// Graph::VirtualFeatures, so none is missed and none made twice.
class OrientationMixture : public StructureDetector {
 public:
  /// Options that make no sense are refused by the type's factory.
  explicit OrientationMixture(const OrientationMixtureOptions& options);

  const std::string& name() const override;
  int minimum_support() const override { return options_.minimum_support; }
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  OrientationMixtureOptions options_;
  // The last assignment of walls by innovation, and what it was made of: it
  // depends on measurements alone, which do not change from one iteration of EM
  // to the next.
  mutable std::vector<ConstraintId> judged_constraints_;
  mutable std::vector<FeatureId> judged_ids_;
  mutable double scatter_ = 0.0;
  mutable DirectionAssignment assignment_;
};

/// "orientation_mixture" with its parameters (angles in degrees).
DetectorType OrientationMixtureType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_ORIENTATION_MIXTURE_H_
