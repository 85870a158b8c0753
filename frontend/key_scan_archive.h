#ifndef PLUMBLINE_FRONTEND_KEY_SCAN_ARCHIVE_H_
#define PLUMBLINE_FRONTEND_KEY_SCAN_ARCHIVE_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/scan.h>

#include <string>
#include <vector>

namespace plumbline {

/// The key scans that a map was made of, as map.json keeps them: enough to find
/// another log in the map, and to make one map of both. All four have one entry
/// per key scan, in the order of the log; what lay between key scans is gone.
struct KeyScanArchive {
  std::vector<Scan> scans;
  std::vector<RefinedScan> refined;
  /// Without what was recognized in the scans.
  std::vector<KeyScanRecord> records;
  /// Map frame.
  std::vector<Pose2> trajectory;
};

/// Takes the key scans out of a solved log: `refined` and `trajectory` have one
/// entry per scan, `records` one per key scan. Key scans without a pose (of a
/// run that was interrupted) are left out.
KeyScanArchive MakeKeyScanArchive(const std::vector<Scan>& scans,
                                  const std::vector<RefinedScan>& refined,
                                  const std::vector<KeyScanRecord>& records,
                                  const std::vector<Pose2>& trajectory);

/// Appends two members of a JSON object:
///
///     "lasers": offset ([x, y, theta] on the robot), start_angle, angle_step,
///               maximum_range
///     "key_scans": time (text), pose ([x, y, theta], map frame), odometry (the
///                  same, raw), from (index of the key scan that motion counts
///                  from, -1: the one before), loose (motion is a guess),
///                  motion
///                  ([x, y, theta]), covariance (of it: xx, xy, xt, yy, yt,
///                  tt), laser (index), ranges (whole millimetres, 0: no
///                  return), bearings (rad, only where beams are not evenly
///                  spaced)
///
/// m and rad; a line per element.
void AppendKeyScans(const KeyScanArchive& archive, std::string* text);

/// Reads them from the text of a map.json. Throws Error that names `name` and
/// the place for text that is no JSON, a map without key scans (of a graph, or
/// of an earlier version) and impossible numbers.
KeyScanArchive ReadKeyScans(const std::string& text, const std::string& name);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_KEY_SCAN_ARCHIVE_H_
