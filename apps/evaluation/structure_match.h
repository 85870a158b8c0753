#ifndef PLUMBLINE_APPS_EVALUATION_STRUCTURE_MATCH_H_
#define PLUMBLINE_APPS_EVALUATION_STRUCTURE_MATCH_H_

#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/graph.h>

#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// How near a virtual feature must be to the true one, after AlignToTruth. Wide
/// against the errors of a map that is about right, narrow against the distance
/// between true features (1.5 m between walls and between circles), so that the
/// counts tell what was found and not how well: that is the position error.
struct StructureMatchOptions {
  /// Of a line from either end of the true one, m, and of their directions.
  double line_distance = 0.6;
  double line_angle_deg = 5.0;
  /// Of circle centres and of radii, m.
  double circle_center = 0.6;
  double circle_radius = 0.5;
  /// Of common centres, m.
  double common_center = 0.6;
  double orientation_deg = 3.0;
};

/// Virtual features of one kind against the truth.
struct MatchCount {
  int found = 0;
  int missed = 0;
  /// Match nothing true, or what another one matches better.
  int wrong = 0;
};

/// What was found of a synthetic world's structure.
struct StructureMatch {
  MatchCount lines;
  MatchCount circles;
  MatchCount centers;
  MatchCount orientations;
  /// Live constraints from points to lines and circles: right ones tie a point
  /// to the feature that it truly lies on; wrong ones are the others; missed
  /// are points that lie on a line or circle and are not tied to it.
  MatchCount supports;
  /// Outliers (SyntheticTruth::outliers) with a live structure constraint.
  int tied_outliers = 0;

  /// Lines, circles, centres and orientations together.
  MatchCount all() const;
  /// All virtual features found and no wrong one.
  bool is_exact() const;
};

/// Compares the virtual features of a graph (types line, circle, orientation,
/// and point: common centres) with the truth. Every true feature is matched by
/// at most one: the nearest.
StructureMatch MatchStructure(const Graph& graph, const SyntheticTruth& truth,
                              const StructureMatchOptions& options = {});

/// How tightly the true structure is held.
struct TrueStructureTolerances {
  double line = 0.02;           ///< point to line, m
  double circle = 0.02;         ///< point to circle, m
  double center = 0.05;         ///< circle to common centre, m
  double orientation = 0.0087;  ///< line to orientation, rad
  double relation = 0.0035;     ///< orientation to orientation, rad
};

/// Puts the true lines, circles, orientations and common centres into the graph
/// as live structure, as detectors would who knew: with these tolerances, and
/// with features that start where the points are now. Orientations are related
/// to the first one.
void AddTrueStructure(const SyntheticTruth& truth,
                      const TrueStructureTolerances& tolerances,
                      const Registry& registry, Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_STRUCTURE_MATCH_H_
