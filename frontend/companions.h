#ifndef PLUMBLINE_FRONTEND_COMPANIONS_H_
#define PLUMBLINE_FRONTEND_COMPANIONS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <cstdint>
#include <vector>

namespace plumbline {

/// Options for what goes along with the robot.
struct CompanionOptions {
  ScanPointsOptions points;
  /// Way by odometry between two scans that are compared, m, and the turn up to
  /// which they are, rad.
  double step = 0.5;
  double max_turn = 0.8;
  /// A return says whether its surface stands or goes along when the two lead
  /// to places this far apart, along its normal, m; ...
  double least_shift = 0.25;
  /// ... it goes along when the scan before had a surface this near to where it
  /// is now in the robot's frame, in parts of that distance, ...
  double stays = 0.3;
  /// ... and stands when it had one this near to where it was if it stands, m.
  double stands = 0.15;
  /// Returns farther than this are on nothing that somebody pushes, or on
  /// people who walk along, m.
  double max_range = 5.0;
  /// Returns of one thing lie no farther apart than this, m, and are this many
  /// at least.
  double gap = 0.4;
  int min_returns = 3;
  /// It is found again at the next comparison when it has moved by no more than
  /// this in the robot's frame, m.
  double max_shift = 0.35;
  /// It is believed when it was seen in this many comparisons, ...
  int min_steps = 4;
  /// ... and in this share of those between the first and the last, ...
  double min_share = 0.6;
  /// ... in which this many returns in all, and in the mean, went by as
  /// odometry says, and this many times as many as went along on what is no
  /// such thing: where wheels spin on the spot everything goes along.
  int min_witnesses = 8;
  double min_witnesses_per_step = 0.2;
  double min_ratio = 2.0;
  /// It stands free: beams beside it, beyond what hangs together with it over
  /// this length at most, m, go farther by this much, m. What the laser sees of
  /// a railing at its side looks the same all along it.
  double max_length = 1.5;
  double min_depth = 0.15;
  /// Scans in between show this share of it within this distance, m, of where
  /// it was seen: what stands at even distances along the way, as columns do,
  /// is elsewhere in between.
  double min_share_between = 0.75;
  double reach_between = 0.15;
  /// What lies this near to where it was seen belongs to it, m.
  double reach = 0.25;
};

/// A part of the log in which something went along with the robot: a cart, a
/// person, a part of the robot that the laser sees; or several such things.
struct Companion {
  /// First and last scan: indices.
  int begin = 0;
  int end = 0;
  /// Way by odometry between them, m.
  double way = 0.0;
  /// Returns that were taken out.
  std::int64_t returns = 0;
};

/// Finds what goes along with the robot (core/method.md, section 7): returns
/// that stay where they are in the robot's frame over metres of its way while
/// others go by as odometry says. No map holds what goes along, and where it is
/// the largest thing that tells how far the robot went, as a cart in a
/// corridor, scans that are matched stand still.
///
/// What is found so is followed to both sides, scan by scan, as long as it is
/// seen where it was, or something is in front of it: where the robot stands or
/// turns on the spot nothing tells what goes along.
///
/// Takes its returns out of the scans (they become none). Needs odometry that
/// tells a metre from none; where there is none, or wheels spin, nothing is
/// found. Cost: linear in the way and in the returns of a scan, times their
/// logarithm.
std::vector<Companion> TakeOutCompanions(const CompanionOptions& options,
                                         std::vector<Scan>* scans);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_COMPANIONS_H_
