#ifndef PLUMBLINE_FRONTEND_WALL_JUNCTIONS_H_
#define PLUMBLINE_FRONTEND_WALL_JUNCTIONS_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/angle.h>

namespace plumbline {

/// Which ends of walls meet.
struct WallJunctionOptions {
  /// Farthest distance and overlap of the ends along the wall, and distance
  /// across, m. What is farther apart has an opening in between.
  double max_gap = 0.4;
  double max_overlap = 1.0;
  double max_step = 0.2;
  /// Angles between the walls at which they meet in an edge, rad: at less they
  /// are one wall, at more the returns at the edge cannot be confused.
  double min_angle = DegToRad(0.2);
  double max_angle = DegToRad(15.0);
  /// How far the part of a wall that changes hands may lie off the wall that it
  /// goes to, m.
  double max_offset = 0.08;
  /// What is left of a wall, m.
  double min_length = 0.5;
};

/// Moves the edge between walls (segments of level 0, seen from the same side)
/// that meet at a small angle to where their lines intersect; returns how many
/// were moved. Walls are grown from returns one after the other, so the first
/// takes returns of the second as far as its tolerance goes: metres, at a bend
/// of a degree. Were these to vote for it, the bend would be lost. Once the
/// walls are adjusted their lines say where the edge is; with returns that vote
/// anew in between this converges (alternating estimation). Cost: linear in the
/// walls but for the search of ends.
int MoveWallJunctions(const WallJunctionOptions& options, Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WALL_JUNCTIONS_H_
