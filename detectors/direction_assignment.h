#ifndef PLUMBLINE_DETECTORS_DIRECTION_ASSIGNMENT_H_
#define PLUMBLINE_DETECTORS_DIRECTION_ASSIGNMENT_H_

#include <plumbline/detectors/direction_network.h>
#include <plumbline/factors/angle.h>

#include <cstddef>
#include <functional>
#include <vector>

namespace plumbline {

/// Options of the assignment of walls to directions. Angles in rad.
struct DirectionAssignmentOptions {
  /// Tolerance of a wall against its direction, and of two directions that are
  /// parallel or at a right angle against each other.
  double sigma = DegToRad(0.1);
  double relation_sigma = DegToRad(0.1);
  /// Largest chi-square (1 degree of freedom) of an innovation that is
  /// accepted.
  double gate = 9.0;
  /// Share of a wall's own error that may count in favour of a tie: a short
  /// wall that is clearly measured to be off a direction waits, although it is
  /// no evidence against it.
  double own_share = 0.35;
  /// A wall leaves its direction when the innovation is beyond this.
  double breaking_gate = 16.0;
  /// Two directions are two only when the chi-square of their difference (1
  /// degree of freedom) is at least this: the price of a further direction.
  double split_gate = 16.0;
  /// Of the cost of all ties, the share that a split has to take away where the
  /// parts are chosen by the angles of their walls.
  double split_share = 0.85;
  /// Log-likelihood by which the best direction has to beat the next one; walls
  /// between them wait.
  double margin = 2.3;
  /// Nor are directions two when they differ by less than this.
  double min_separation = DegToRad(0.4);
  /// Walls whose angle to a direction is known less well than this are not tied
  /// to it.
  double max_uncertainty = DegToRad(12.0);
  /// Fewest walls, and sum of their lengths (m), that make a new direction.
  int min_support = 3;
  double min_support_length = 5.0;
  /// Probability that walls in uniformly random directions found one, anywhere.
  double significance = 0.01;
  /// Shortest wall that a new direction may be founded on, m.
  double min_founder_length = 1.0;
};

/// A wall that may be tied to a direction.
struct DirectionWall {
  /// In the network.
  std::size_t node = 0;
  /// Of the visible part, m.
  double length = 0.0;
  /// How far the visible part's direction may be off the wall's, rad: panels,
  /// frames, and what else is wrong in every look.
  double own_sigma = 0.0;
};

/// A direction that walls share.
struct SharedDirection {
  /// In: the walls that are tied to it whatever the rest says, at least one
  /// unless `angle` is all that is known of it. Out: all its walls. Indices of
  /// walls.
  std::vector<std::size_t> walls;
  /// rad; in: initial value, out: estimate.
  double angle = 0.0;
};

/// Innovation of a wall against a direction.
struct DirectionInnovation {
  /// Estimated difference (rad, axial) without the tie, its predicted variance
  /// with the tolerance in it (rad^2), and chi-square.
  double difference = 0.0;
  double variance = 0.0;
  double chi_square = 0.0;
};

/// Result of the assignment.
struct DirectionAssignment {
  /// The given directions in their order, then new ones.
  std::vector<SharedDirection> directions;
  /// For each wall the direction that it is tied to, -1 for none.
  std::vector<int> direction_of;
  /// For each wall the innovation against the direction that it was compared
  /// with last: the one that it is tied to, or else the nearest.
  std::vector<DirectionInnovation> innovations;
};

/// Assigns walls to directions in the order of certainty (method.md, section
/// 9). A tie "this wall has that direction" is judged by its innovation, the
/// difference that the network without the tie predicts, against the predicted
/// variance: the chi-square is what the tie would add to the cost of the whole
/// network, while the residual that a tight tolerance leaves after a solve says
/// nothing.
///
/// Of all ties whose innovation is within the gate and whose direction wins
/// clearly over the others (a quarter turn off the others included), those with
/// the smallest variance enter the network first; then everything is estimated
/// again with them. Directions that are parallel or at a right angle to each
/// other within the gate are tied in the same way. When nothing more fits, a
/// new direction is founded on walls that contradict all there are, or of whose
/// angle to these too little is known (another part of the map), and agree with
/// each other; it stands when, with all that was tied, it differs from every
/// other one by split_gate. In the end a direction is split where two
/// explain its walls better: walls that each lie within their own gate can
/// contradict it together (score test of a further parameter, the turn of one
/// part of the walls against the other); parts that then differ from no other
/// direction are joined with it. Walls that fit several directions, or of which
/// too little is known, stay untied.
///
/// Without a given direction any wall may found one.
///
/// `network` holds the measurements. `stop` (may be null) is asked now and
/// then; once it has returned true the assignment is unfinished.
DirectionAssignment AssignDirections(
    DirectionNetwork network, const std::vector<DirectionWall>& walls,
    std::vector<SharedDirection> directions,
    const DirectionAssignmentOptions& options,
    const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_DIRECTION_ASSIGNMENT_H_
