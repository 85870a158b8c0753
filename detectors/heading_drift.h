#ifndef PLUMBLINE_DETECTORS_HEADING_DRIFT_H_
#define PLUMBLINE_DETECTORS_HEADING_DRIFT_H_

#include <cstddef>
#include <vector>

namespace plumbline {

/// Systematic error of the turns measured from pose to pose along a robot's
/// way. Where loops are closed, the positions of a map say how far the robot
/// has turned in all; matches of scans may be off by a tenth of a degree a
/// metre in one sense for a hundred metres (beams that a laser takes at
/// different times, a robot that keeps to one side of a corridor). Residuals
/// show it although each of them is small: they have the same sign. A model of
/// independent errors that leaves positions open does not know of it, and takes
/// the far end of a straight corridor for another direction.
class HeadingDrift {
 public:
  /// `headings`: of the poses as they stand in the map, rad, in the order of
  /// the log.
  explicit HeadingDrift(std::vector<double> headings);

  /// A measurement of the turn from pose `step` to the next, rad, and its
  /// information, rad^-2. Of several the weighted mean counts.
  void AddTurn(std::size_t step, double turn, double information);

  /// Estimates the drift at each measured step: the median of what the map
  /// turns more than was measured, over kHalfWindow steps to either side. A
  /// building that bends at one place does not move it. Zero where fewer than
  /// kFewestSteps are there, or where the median does not differ from zero by
  /// kSignificance of its standard deviations. Has to be called after the last
  /// AddTurn and before Between.
  void Estimate();

  /// What a measured turn from one pose to another lacks, rad. Zero where more
  /// than kHalfWindow steps lie between them: what closes a loop did not come
  /// by way of them.
  double Between(std::size_t from, std::size_t to) const;

  /// See Estimate.
  static constexpr std::size_t kHalfWindow = 32;
  /// See Estimate.
  static constexpr std::size_t kFewestSteps = 16;
  /// See Estimate.
  static constexpr double kSignificance = 3.0;

 private:
  struct Step {
    // Weighted sum of what was measured.
    double turn = 0.0;
    double information = 0.0;
  };

  std::vector<double> headings_;
  std::vector<Step> steps_;
  // Of the drift, up to each pose.
  std::vector<double> sums_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_HEADING_DRIFT_H_
