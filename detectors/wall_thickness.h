#ifndef PLUMBLINE_DETECTORS_WALL_THICKNESS_H_
#define PLUMBLINE_DETECTORS_WALL_THICKNESS_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/thickness_classes.h>
#include <plumbline/factors/angle.h>

#include <string>

namespace plumbline {

/// Options for which faces are a wall, and how tightly they are tied to its
/// thickness.
struct WallThicknessOptions {
  /// Tolerance of a wall against its class: thickness, m, and how parallel its
  /// faces are, rad.
  double sigma = 0.01;
  double sigma_angle = DegToRad(0.2);
  /// How far the direction of a face's visible part may be off the wall's own,
  /// rad, for a face of 1 m; it falls with length^1.5 (OwnDirectionSigma).
  double own_direction_noise = DegToRad(2.0);
  /// Largest chi-square (2 degrees of freedom) of the innovation of a wall
  /// against its class, and p-value below which its tie is broken: that of the
  /// same gate.
  double gate = 11.8;
  /// Log-likelihood by which the best class has to beat the next one; walls
  /// between them wait.
  double margin = 2.3;
  /// Faces with a shorter visible part are left out, and two faces lie back to
  /// back over at least this length, m.
  double min_face = 0.5;
  double min_overlap = 0.5;
  /// Largest angle between the two faces of a wall,
  /// rad.
  double max_turn = DegToRad(5.0);
  /// Walls whose thickness is known less well say nothing of classes, m.
  double max_uncertainty = 0.03;
  /// How classes are told from clutter.
  ThicknessClassOptions classes;
};

/// Thicknesses that walls share (core/method.md, section 6): reads the
/// one-sided walls ("segment") of a level and makes virtual "thickness"
/// features one level up. Two faces that look away from each other, side by
/// side, with nothing between them, are one wall; segment_segment_thickness
/// with the expected value (0, pi) ties them to their class.
///
/// Classes are found as directions are, by a mixture with an unknown number of
/// components (FindThicknessClasses), and only where the figures speak for
/// them. Each wall is then judged by its innovation (core/method.md, section
/// 9): its thickness and how parallel its faces are against the covariance that
/// the graph predicts for them, against the class that fits best. The most
/// certain walls are judged first; walls between two classes wait.
///
/// Only whole graphs are looked at, and only faces that poses of the graph have
/// seen (CollectWallFaces): without them there is nothing to judge by.
class WallThicknessDetector : public StructureDetector {
 public:
  /// Options that make no sense are refused by the type's factory.
  explicit WallThicknessDetector(const WallThicknessOptions& options);

  const std::string& name() const override;
  int minimum_support() const override { return options_.classes.min_support; }
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  WallThicknessOptions options_;
};

/// "wall_thickness" with its parameters (angles in degrees).
DetectorType WallThicknessType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_WALL_THICKNESS_H_
