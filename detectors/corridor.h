#ifndef PLUMBLINE_DETECTORS_CORRIDOR_H_
#define PLUMBLINE_DETECTORS_CORRIDOR_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>

#include <string>
#include <vector>

namespace plumbline {

/// Options for which faces make a corridor, and how tightly they are tied to
/// it.
struct CorridorOptions {
  /// Tolerance of a face against its side: across it, m, and in direction, rad.
  double sigma = 0.02;
  double sigma_angle = DegToRad(0.2);
  /// How far the direction of a face's visible part may be off the wall's own,
  /// rad, for a face of 1 m; it falls with length^1.5 (OwnDirectionSigma).
  double own_direction_noise = DegToRad(2.0);
  /// Largest chi-square (2 degrees of freedom) of the innovation of a face
  /// against the corridor, and p-value below which its tie is broken: that of
  /// the same gate.
  double gate = 11.8;
  /// Faces farther from a side are not looked at: across, m, and in direction,
  /// rad.
  double max_offset = 0.25;
  double max_turn = DegToRad(5.0);
  /// Faces with a shorter visible part are left out, m, and two that found a
  /// corridor lie opposite each other over at least this length, m.
  double min_face = 0.5;
  double min_facing = 1.0;
  /// Distance of the two sides, m: from a duct to a hall.
  double min_width = 0.8;
  double max_width = 4.0;
  /// Least length of a corridor, m, and least ratio of length to width.
  double min_length = 4.0;
  double min_ratio = 3.5;
  /// Part of each side that faces cover, at least, and the widest opening
  /// without a face on either side, m.
  double min_coverage = 0.35;
  double max_opening = 3.0;
};

/// Corridors (core/method.md, section 6): reads the one-sided walls ("segment")
/// of a level and makes virtual "corridor" features one level up, tied by the
/// relation segment_corridor with the expected value (0, phi), phi the side.
///
/// Two faces that look at each other across free space found one: nearly
/// parallel, side by side over some length, no wall across between them. Other
/// faces in line with either, across doors and the mouths of rooms, are
/// gathered up to a wall across or an opening that is too wide. What they make
/// is long and narrow, with walls along both sides. Each face is then judged by
/// its innovation (core/method.md, section 9): its offset and direction against
/// the corridor as the others have it, before it is tied, against the
/// covariance that the graph predicts for it. The most certain ones are judged
/// first.
///
/// A face on a side of a corridor that is there already joins it in the same
/// way. Only whole graphs are looked at, and only faces that poses of the graph
/// have seen (CollectWallFaces): without them there is nothing to judge by.
class CorridorDetector : public StructureDetector {
 public:
  /// Options that make no sense are refused by the type's factory.
  explicit CorridorDetector(const CorridorOptions& options);

  const std::string& name() const override;
  int minimum_support() const override { return 2; }
  /// Each of the two sides has a face.
  bool IsSupported(
      const std::vector<const Constraint*>& support) const override;
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  CorridorOptions options_;
};

/// "corridor" with its parameters (angles in degrees).
DetectorType CorridorType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CORRIDOR_H_
