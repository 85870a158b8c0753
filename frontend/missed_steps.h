#ifndef PLUMBLINE_FRONTEND_MISSED_STEPS_H_
#define PLUMBLINE_FRONTEND_MISSED_STEPS_H_

#include <plumbline/frontend/late_metre.h>
#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <functional>
#include <vector>

namespace plumbline {

/// Options for steps that neither odometry nor the matches noticed.
struct MissedStepOptions {
  ScanPointsOptions points;
  /// Way between the key scans that are compared, m, and between two that are
  /// compared with each other at most, m. The way between these is nearly
  /// straight: they lie at least this share of it apart.
  double spacing = 1.0;
  double reach = 8.0;
  double min_straightness = 0.5;
  /// Farthest returns that are looked at, m.
  double max_range = 30.0;
  /// Steps that are tried along the way, either way, m: up to this, so far
  /// from each other; one from this on counts.
  double max_step = 1.5;
  double resolution = 0.1;
  double min_step = 0.25;
  /// A return says something of a step when the cosine of its normal with the
  /// way is no smaller than this. It stands in the way of one when it lies in
  /// front of what the other scan saw by this much, m, and this share of the
  /// distance.
  double min_cosine = 0.5;
  double free_margin = 0.3;
  double free_share = 0.03;
  /// A step was missed where as many returns fit with it (less those that stand
  /// in the way), over all pairs of scans that it lies between, and without it
  /// no more than this share of them do; no scan has more of them than this
  /// share.
  int min_returns = 40;
  double max_without = 0.25;
  double of_one_scan = 0.85;
  /// It is sure unless more than this share of what fits lies within a depth of
  /// this, m, and is narrower than this, m: a thing that was moved.
  double of_one_thing = 0.8;
  double thing = 1.0;
  double min_width = 1.4;
  int num_threads = 0;
};

/// A step that the robot made, and neither odometry nor the matches noticed.
struct MissedStep {
  /// From the last key scan before it to the first one after it.
  MotionCorrection correction;
  /// Indices of these two.
  int begin = 0;
  int end = 0;
  /// Along the way, m; negative: it did not get as far as the track says.
  double length = 0.0;
  /// False: one thing in sight may have been moved instead.
  bool is_sure = false;
};

/// Finds steps along the way that no match could notice at the time
/// (core/method.md, section 7), in the order of scans: between two walls
/// nothing near tells how far the robot went when it is pushed, or its wheels
/// slip, or odometry leaps. What it saw from afar before does, when it comes
/// near: key scans before and after a place are compared with each other, and
/// where hardly any of what they say of the way fits as it is, and nearly all
/// of it with one and the same step between them, that was missed. `refined`:
/// one entry per scan, settled, whose tracks are long enough to tell. `stop`
/// (may be null) is asked now and then; once it has returned true the result
/// is empty. Throws Error when numbers differ. Cost: linear in the way and in
/// the returns of a scan.
std::vector<MissedStep> FindMissedSteps(
    const std::vector<Scan>& scans, const std::vector<RefinedScan>& refined,
    const MissedStepOptions& options,
    const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MISSED_STEPS_H_
