#ifndef PLUMBLINE_FRONTEND_SCAN_POINTS_H_
#define PLUMBLINE_FRONTEND_SCAN_POINTS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// Options of the choice of a scan's returns.
struct ScanPointsOptions {
  /// Returns farther away are left out, m: far beams graze the walls.
  double usable_range = 50.0;
  /// Returns nearer than this are the robot itself, m.
  double minimum_range = 0.1;
  /// Two neighbouring returns farther apart than this, or than
  /// `gap_factor` times the distance that beams spread at their range on a
  /// wall seen at 45 degrees, do not lie on one surface, m. With a factor of 5
  /// surfaces count that beams graze at 8 degrees or more: in a corridor it is
  /// the farthest of them that hold headings.
  double gap = 0.15;
  double gap_factor = 5.0;
  /// Neighbouring beams that lie farther apart than this, rad, have points put
  /// between their returns where these lie on one surface: what is matched with
  /// a laser of few beams would find gaps wider than its gates.
  double max_beam_step = DegToRad(1.1);
  /// Half the length along the surface over which a normal is fitted, m, and
  /// how many returns it takes in on each side all the same, as far as the
  /// surface goes: where beams graze they lie farther apart.
  double normal_radius = 0.25;
  int normal_neighbors = 2;
  /// A laser that sees no farther than this, m, also has normals over
  /// jamb_radius, m, where the surface is not straight over normal_radius:
  /// along a corridor of which it sees a few metres the jambs of doors are all
  /// that tells the place.
  double short_range = 6.0;
  double jamb_radius = 0.1;
  /// Standard deviation of a fitted surface's points, m, above which the
  /// point has no normal; half of it where the fit goes beyond normal_radius.
  double normal_tolerance = 0.04;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  /// Normals of noisy returns need a longer piece of surface.
  void ScaleToNoise(double scale) {
    normal_tolerance *= scale;
    jamb_radius *= scale;
  }
};

/// One return of a scan.
struct ScanPoint {
  /// In the robot's frame, m.
  Eigen::Vector2d position;
  /// Unit normal of the surface, towards the laser, in the robot's frame; zero
  /// when the surface around the point is not straight.
  Eigen::Vector2d normal;
  /// Distance from the laser, m.
  double range;
  /// Index of the beam, or of the one before it where no beam went.
  int beam;
  /// Put between two returns: it says where the surface is, but nothing that
  /// they do not say.
  bool is_between = false;
};

/// A return with its position and normal taken from the frame of a pose to the
/// one in which that pose is given.
inline ScanPoint Moved(const ScanPoint& point, const PoseTransform& transform) {
  ScanPoint moved = point;
  moved.position = transform.Point(point.position);
  moved.normal = transform.Direction(point.normal);
  return moved;
}

/// The returns of a scan in the order of beams, those of few beams with points
/// between them (ScanPointsOptions::max_beam_step), with the normals of the
/// surfaces that they lie on (total least squares over neighbouring returns).
/// `points` is overwritten; its capacity is kept, so reuse it in loops.
void ExtractScanPoints(const Scan& scan, const ScanPointsOptions& options,
                       std::vector<ScanPoint>* points);

/// Options for what stands by itself in front of the rest: a leg, a person, a
/// chair.
struct ClutterOptions {
  /// Largest width, m, and least distance by which its surroundings lie behind
  /// it, m.
  double max_width = 0.6;
  double min_depth = 0.15;
  /// Ranges of neighbouring returns differ by more than this where one thing
  /// ends, m.
  double min_jump = 0.1;
  /// Farthest from the laser, m: beyond it few returns are on such things.
  double max_range = 4.0;
};

/// Marks the returns on narrow things that stand free of what is beside them on
/// both sides, and may move: one entry for each of `points` (ExtractScanPoints
/// of `scan`). Returns how many there are.
int MarkClutter(const Scan& scan, const std::vector<ScanPoint>& points,
                const ClutterOptions& options, std::vector<bool>* clutter);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SCAN_POINTS_H_
