#ifndef PLUMBLINE_DETECTORS_STRUCTURE_PRIOR_H_
#define PLUMBLINE_DETECTORS_STRUCTURE_PRIOR_H_

#include <plumbline/core/em.h>
#include <plumbline/core/registry.h>

#include <istream>
#include <map>
#include <ostream>
#include <string>
#include <vector>

namespace plumbline {

/// Tolerance of one row of a relation (RelationType::rows).
struct PriorTolerance {
  /// Standard deviation, > 0: degrees for an angle, else in the row's unit.
  double sigma = 0.0;
  bool is_angle = false;
  /// As it is written: "deg", the row's unit, "1" for a pure number. Empty for
  /// "deg" and "m".
  std::string unit = {};
};

/// Prior knowledge of a relation, before the building was seen.
struct PriorRelation {
  /// False: it is not looked for; a detector's proposals of it are left out.
  bool is_expected = true;
  /// One per row, in the order of the relation's rows; empty when not expected.
  std::vector<PriorTolerance> tolerances;
};

/// An angle between directions of walls.
struct PriorAngle {
  /// Degrees; the sign does not matter, nor do multiples of 180.
  double angle_deg = 0.0;
  /// Standard deviation, degrees; 0: as the relation orientation_orientation.
  double sigma_deg = 0.0;
};

/// Prior knowledge of the structure of a building: as text, one statement on a
/// line, words separated by blanks, what follows a # is a comment.
///
///     # Three wings at 60 degrees, built well; their walls less so.
///     angle 0
///     angle 60 0.05                        angle and tolerance, degrees
///     relation orientation_orientation 0.02 deg
///     relation segment_orientation 0.3 deg
///     relation segment_rectangle 0.05 m 0.3 deg   a tolerance per row
///     relation line_orientation no         not expected
///
/// Tolerances are standard deviations. With angles, only these are looked for.
/// What is not named stays as detectors and flags have it.
struct StructurePrior {
  std::map<std::string, PriorRelation> relations;
  std::vector<PriorAngle> angles;
};

/// Reads a prior; `name` stands for it in errors. Throws Error with the line
/// for an unknown word or relation, a number that cannot be read or is out of
/// range, a unit that does not fit the row, too few or too many tolerances,
/// what is said twice, and (without a line) a text that says nothing.
StructurePrior ReadStructurePrior(std::istream& input, const std::string& name,
                                  const Registry& registry);

/// Writes a prior that ReadStructurePrior reads as the same.
void WriteStructurePrior(const StructurePrior& prior, std::ostream& output);

/// Applies a prior: relations to the options of EM, angles and their tolerances
/// to the parameters of the detector orientation_relation, in place of those
/// that are set there.
void ApplyStructurePrior(
    const StructurePrior& prior, EmOptions* options,
    std::map<std::string, DetectorParameters>* detector_parameters);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_STRUCTURE_PRIOR_H_
