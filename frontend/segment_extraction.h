#ifndef PLUMBLINE_FRONTEND_SEGMENT_EXTRACTION_H_
#define PLUMBLINE_FRONTEND_SEGMENT_EXTRACTION_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// Options of the extraction of straight pieces of wall.
struct SegmentExtractionOptions {
  /// Fewest returns of a segment, and its least length, m.
  int min_points = 6;
  double min_length = 0.4;
  /// Farthest that one return may lie off its segment, m: noise of the laser.
  double split_distance = 0.05;
  /// Farthest that the mean of `bend_window` neighbouring returns may lie off,
  /// m: a door set back by a few centimetres is another piece of wall, and a
  /// line through both would be turned by degrees.
  double bend_distance = 0.01;
  int bend_window = 5;
  /// Or this many standard deviations of that mean, where the returns are
  /// noisier.
  double bend_sigmas = 2.0;
  /// Pieces whose ends swing by more across the wall, as the direction is that
  /// uncertain (standard deviation over the whole length, m), are left out: too
  /// few returns with too much scatter, often two surfaces in one.
  double max_end_sigma = 0.013;
  /// Neighbouring returns farther apart than this, or than `gap_factor` times
  /// the distance that beams spread, end a segment, m.
  double gap = 0.25;
  double gap_factor = 3.0;
  /// Noise of one return across a wall, m: the smaller of this and the fit's
  /// own scatter is not believed.
  double point_sigma = 0.015;
  /// What more returns do not average out (calibration, rough walls): offset
  /// of a segment, m, and bend over its length, m.
  double bias_sigma = 0.008;
  /// rad.
  double angle_bias_sigma = DegToRad(0.4);

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    split_distance *= scale;
    max_end_sigma *= scale;
    point_sigma *= scale;
  }
};

/// A straight piece of wall as one scan sees it, in the robot's frame. Its
/// direction is such that the laser is on its left, so the two faces of a thin
/// wall have opposite directions.
struct SegmentObservation {
  /// Middle of the piece and direction.
  Pose2 pose = Pose2::Zero();
  /// m.
  double length = 0.0;
  int points = 0;
  /// Covariance (2x2; m, rad) of the offset across and of the direction, at the
  /// middle, where the two are independent. Nothing is known along.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
};

/// Cuts a scan into straight pieces: split at the farthest return, fit by total
/// least squares, merge what fits one line. `points` are in the order of beams
/// (ExtractScanPoints); those between returns are left out: two returns and
/// what is put between them are always straight. `laser` is the laser's
/// position in their frame.
std::vector<SegmentObservation> ExtractSegments(
    const std::vector<ScanPoint>& points, const Eigen::Vector2d& laser,
    double angle_step, const SegmentExtractionOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SEGMENT_EXTRACTION_H_
