#ifndef PLUMBLINE_DETECTORS_CURVE_SEARCH_H_
#define PLUMBLINE_DETECTORS_CURVE_SEARCH_H_

#include <plumbline/core/detector.h>
#include <plumbline/detectors/planar_curve.h>
#include <plumbline/detectors/point_graph.h>
#include <plumbline/factors/angle.h>

#include <cstdint>
#include <vector>

namespace plumbline {

/// Options of the search for curves. Lengths in m, angles in rad.
struct CurveSearchOptions {
  /// Points farther from a curve never support it when it is found. Smaller
  /// distances are tried as well, down to a fortieth, and the one that makes
  /// the curve most significant is taken.
  double tolerance = 0.3;
  /// Tolerance of the building, of a point against its curve: what the
  /// constraints hold it with.
  double sigma = 0.02;
  /// Distance from a curve within which a connected point joins it, and within
  /// which another curve is the same. Wider than sigma: points are off by their
  /// measurements too. Bends of less than half of it do not count.
  double gate = 0.1;
  /// Log10 of the expected number of curves of the kind that 1,000 points would
  /// show by chance, at which one is accepted. Well below one: EM looks many
  /// times, and what is left over each time is different.
  double max_log_false_alarms = -1.0;
  /// Points that support a curve are connected with each other past at most
  /// this many points that do not.
  int max_gap_points = 2;
  /// A line is cut where it has no point for this length, or for three times
  /// its usual spacing where that is longer.
  double max_gap = 1.0;
  int min_line_points = 4;
  int min_circle_points = 5;
  /// The points of a circle span at least this angle: on a shorter arc a line
  /// fits them as well.
  double min_arc = DegToRad(90.0);
  /// Lines that touch at a smaller angle are one line that drift has bent.
  double min_corner = DegToRad(15.0);
  /// Larger circles are not looked for.
  double max_radius = 50.0;
  /// Where only some of the points are to be looked at, those this many
  /// constraints away are taken along: they tell what a curve of theirs is. For
  /// the detectors; SearchCurves takes its points as they are.
  int reach = 8;
};

/// A curve and the evidence for it.
struct FoundCurve {
  PlanarCurve curve;
  /// Indices of the points that support it, ascending.
  std::vector<int> support;
  /// Minus log10 of the expected number of such curves by chance.
  double significance = 0.0;
};

/// Finds the lines and circles in a graph of points, by RANSAC over
/// interconnected points (core/method.md, section 6). Each point supports at
/// most one of the result; claimed points support none and count for nothing.
///
/// 1. Hypotheses. From each point the neighbourhood along the edges is grown;
///    pairs and triples of it are drawn, and the best line and the best circle
///    are extended over connected points near the curve, refitted by least
///    squares, and extended again until nothing changes.
/// 2. Significance. In the background model each point lies in a random
///    direction from the one before it at the spacing S, so it is within e of
///    a given curve with probability p = 2/pi asin(e/S). Points nearer than
///    2 e to each other along the curve count as one, which keeps p <= 1/3
///    and makes the test independent of the density. With k of n connected
///    points near the curve within e, the chance is at most
///    exp(-n KL(k/n || p)) (Chernoff), times the number of curves that
///    1,000 points could show at this resolution (a-contrario testing;
///    Desolneux, Moisan and Morel 2008). The tolerance e is the one with the
///    fewest expected false alarms.
/// 3. Selection between lines and circles. The most significant curve takes its
///    points, the others are judged by what is left. A curve gives way to
///    others on its points when they are more significant together: four walls
///    are not a circle, a circle is not many short walls, and two walls a
///    little out of line are not one. Pieces of one
///    curve that touch are put together where one curve fits them about as well
///    as each has its own.
///
/// 4. What is left over of a more significant curve that it touches, or of a
///    `known` one (curve and support matter), is no curve of its own; nor is a
///    line that goes on at less than min_corner where another ends.
///
/// What is found among points that are connected with each other, past points
/// that are not claimed, depends on these and what is within
/// options.max_gap_points + 1 constraints of them alone, so that the rest may
/// be claimed when it was searched before.
///
/// The same seed gives the same result. The most significant first. Counts what
/// was drawn, kept and refused into `scope`, of which nothing else but stop is
/// read; once that says so, the result is worthless.
std::vector<FoundCurve> SearchCurves(
    const PointGraph& points, const std::vector<bool>& is_claimed,
    const std::vector<FoundCurve>& known, std::uint64_t seed,
    const CurveSearchOptions& options,
    const DetectionScope& scope = DetectionScope());

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_SEARCH_H_
