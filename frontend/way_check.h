#ifndef PLUMBLINE_FRONTEND_WAY_CHECK_H_
#define PLUMBLINE_FRONTEND_WAY_CHECK_H_

#include <plumbline/core/wall.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace plumbline {

/// Options for when a robot has gone through a wall.
struct WayCheckOptions {
  ScanPointsOptions points;
  /// Longest step between key scans that is a way, m: where the robot was lost
  /// the trajectory may jump.
  double max_step = 1.5;
  /// Key scans up to this much way before and behind a crossing are of the
  /// visit that crosses, m.
  double visit = 3.0;
  /// Scans made within this distance of a crossing are looked at, m, and of
  /// other visits at most this many, the nearest.
  double radius = 10.0;
  int max_others = 60;
  /// Returns within this distance of a wall lie on it, and beams that end at
  /// least `passed` behind it went through, m.
  double thickness = 0.08;
  double passed = 0.3;
  /// A piece of wall of this length, m, is solid where this many returns of
  /// other visits lie on it, and a tenth of what lies on a piece in the middle
  /// of the wall's, and passed where this many beams of the visit went through,
  /// and more than three for each return that the visit has on it.
  double piece = 0.1;
  int min_beams = 3;
  /// Width in one piece that is solid and passed from which on it is no door,
  /// m: doors and their frames have up to 1.2, and the pieces at both ends
  /// count whole.
  double min_width = 1.4;
  int num_threads = 0;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    points.ScaleToNoise(scale);
    thickness *= scale;
    passed *= scale;
  }
};

/// A wall that the robot has gone through: it was moved since it was seen, or
/// the map is wrong.
struct BlockedWay {
  /// The last scan before the crossing, and the scan nearest to it in time that
  /// saw the wall where the robot went through: indices into `scans`.
  int crossing = 0;
  int seen = 0;
};

/// The places where the way leads through what other visits saw as solid, over
/// more than the width of a door (core/method.md, section 7), in the order of
/// crossings. `keys`: indices into `scans`, ascending; `poses`: of the robot at
/// these, map frame; `walls` in the same frame. `stop` (may be null) is asked
/// now and then; once it has returned true the result is empty. Throws Error
/// when numbers differ. Cost: linear in the way and in the walls.
std::vector<BlockedWay> FindBlockedWays(
    const std::vector<Scan>& scans, const std::vector<int>& keys,
    const std::vector<Pose2>& poses, const std::vector<Wall>& walls,
    const WayCheckOptions& options,
    const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WAY_CHECK_H_
