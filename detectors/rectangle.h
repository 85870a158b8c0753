#ifndef PLUMBLINE_DETECTORS_RECTANGLE_H_
#define PLUMBLINE_DETECTORS_RECTANGLE_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>

#include <string>
#include <vector>

namespace plumbline {

/// Options for which walls make a rectangle, and how tightly they are tied to
/// it.
struct RectangleOptions {
  /// Tolerance of a wall against its side: across it, m, and in direction, rad.
  double sigma = 0.05;
  double sigma_angle = DegToRad(0.1);
  /// Largest distance of a wall from its side across, m, and in direction,
  /// rad: nearer than the two faces of a wall are to each other. Adjacent walls
  /// are at right angles to within the same angle.
  double gate = 0.1;
  double gate_angle = DegToRad(3.0);
  /// Walls with a shorter visible part are left out, m.
  double min_length = 0.5;
  /// A corner is met when the wall on each side begins this near to it, m:
  /// a corner hides behind a cupboard, a door stands beside it.
  double corner_gap = 0.5;
  /// Part of each side that walls cover, at least, and the widest opening
  /// between two walls of a side, m.
  double min_coverage = 0.5;
  double max_opening = 3.0;
  /// Shortest and longest side, m. What is smaller is furniture.
  double min_side = 1.0;
  double max_side = 60.0;
};

/// Rectangles of walls (core/method.md, Table 1, row 4): rooms seen from
/// inside, blocks seen from outside. Reads the "segment" and "line" features of
/// a level and makes virtual "rectangle" features one level up, tied by the
/// relations segment_rectangle and line_rectangle with the expected value (0,
/// phi), phi the side. A side may consist of several walls in a line, and a
/// wall may be on sides of several rectangles.
///
/// Where walls meet at right angles is a corner. Four corners that are joined
/// by walls in turn make a candidate; a rectangle is fitted to the walls of its
/// sides, and it is one when every side is covered and meets its neighbours.
/// Smaller ones go first: one that overlaps another and has two sides in common
/// with it says nothing new (two rooms side by side with the wall between
/// them).
///
/// A wall on a side of a rectangle that is there already joins it. Walls
/// without an extent have no corners and are passed over. With a list in the
/// scope only the listed walls make rectangles or join them.
class RectangleDetector : public StructureDetector {
 public:
  /// Options that make no sense are refused by the type's factory.
  explicit RectangleDetector(const RectangleOptions& options);

  const std::string& name() const override;
  int minimum_support() const override { return 4; }
  /// Each of the four sides has a wall.
  bool IsSupported(
      const std::vector<const Constraint*>& support) const override;
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  RectangleOptions options_;
};

/// "rectangle" with its parameters (angles in degrees).
DetectorType RectangleType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_RECTANGLE_H_
