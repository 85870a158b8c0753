#ifndef PLUMBLINE_DETECTORS_ORIENTATION_RELATION_H_
#define PLUMBLINE_DETECTORS_ORIENTATION_RELATION_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/factors/angle.h>

#include <string>
#include <vector>

namespace plumbline {

/// Options: the angles that are looked for, and how tightly they hold.
struct OrientationRelationOptions {
  /// Angles between orientations that are expected in a building, rad. The sign
  /// does not matter, nor do multiples of pi: 0 is "these are the same".
  std::vector<double> angles = {0.0, kPi / 4, kPi / 2, 3 * kPi / 4};
  /// Tolerances of the angles that have one of their own, rad; of the size of
  /// `angles` or empty, 0 for `sigma`.
  std::vector<double> angle_sigmas;
  /// Two orientations are related when their angle is this near to an expected
  /// one, rad. An orientation stands on many walls and is known to a few tenths
  /// of a degree before it is related; a relation, once it stands, is tight and
  /// pulls the orientation off its walls rather than show a residual, so a wing
  /// that is oblique by a degree must not get one.
  double gate = DegToRad(0.7);
  /// In a graph whose measurements give no directions (points and their
  /// distances) a map may be out of square by more than that, and the graph
  /// says by how much: there two orientations are related up to this difference
  /// (rad) when its chi-square is at most innovation_gate, by a standard
  /// deviation of at most this.
  double uncertain_gate = DegToRad(3.0);
  /// Tolerance of the relation, rad.
  double sigma = DegToRad(0.02);
  /// An orientation is related to at most this many that stood before it. All
  /// pairs of few orientations are related; many get enough for redundancy.
  int max_relations = 4;
  /// Largest chi-square (1 degree of freedom) of the innovation of a relation,
  /// in a graph that has the poses that saw the walls; how far the links there
  /// are trusted, and the direction of a wall of 1 m (rad), are as in
  /// OrientationMixtureOptions.
  double innovation_gate = 9.0;
  MapDirectionsOptions links;
  double own_direction_noise = DegToRad(2.0);
};

/// Relations between the "orientation" features of a level (core/method.md,
/// section 6): orientation_orientation constraints with the expected angle
/// nearest to the present one, in (-pi/2, pi/2], if it is within the gate.
/// Pairs that a live constraint relates are left alone.
///
/// Virtual orientations are few, so all of a level are looked at even when the
/// scope lists features: an orientation belongs to the whole building.
class OrientationRelation : public StructureDetector {
 public:
  /// Angles are completed by their negatives.
  explicit OrientationRelation(OrientationRelationOptions options);

  const std::string& name() const override;
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  OrientationRelationOptions options_;
};

/// "orientation_relation". Parameters in degrees: gate_deg, uncertain_gate_deg,
/// sigma_deg,
/// resolution_deg (its multiples are expected; 0: unset) and the list angle_0,
/// angle_1, ... (with angle_sigma_deg_0, ... where one has a tolerance of its
/// own) which is 0, 45, 90, 135 when neither it nor a resolution is
/// given. With both, all of the angles are expected.
DetectorType OrientationRelationType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_ORIENTATION_RELATION_H_
