#ifndef PLUMBLINE_FRONTEND_LOOKS_H_
#define PLUMBLINE_FRONTEND_LOOKS_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/sight_lines.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <vector>

namespace plumbline {

/// Options for which returns of a scan become sight lines.
struct LookOptions {
  ScanPointsOptions points;
  /// Sight lines are cut at this length, m.
  double max_range = 20.0;
  /// Least angle between two of them, rad.
  double min_step = DegToRad(0.9);
};

/// A scan that is looked at: where the robot stood when it was made, in the
/// frame of a feature (Look::frame).
struct LookPlace {
  /// Index of the scan in the log.
  int scan = 0;
  FeatureId frame = kNoId;
  Pose2 pose = Pose2::Zero();
};

/// The first key scans of the places of a graph, which are poses in it, as
/// JointAdjustment::places lists them.
std::vector<LookPlace> LooksFromPlaces(
    const std::vector<KeyScanRecord>& records,
    const std::vector<FeatureId>& places, int place_stride);

/// Every `place_stride`-th key scan of a graph in which their poses are
/// marginalized out: each stands where `key_poses` (map frame, one per record)
/// has it relative to the longest of the walls that it recognized, and moves
/// with that wall. Key scans without one are left out.
std::vector<LookPlace> LooksFromWalls(const std::vector<KeyScanRecord>& records,
                                      const std::vector<Pose2>& key_poses,
                                      const Graph& graph, int place_stride);

/// The sight lines of these scans, in the same order. Returns only: where a
/// beam has none, nothing is known of it. Cost: linear in the returns.
Looks CollectLooks(const std::vector<Scan>& scans,
                   const std::vector<LookPlace>& places,
                   const LookOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_LOOKS_H_
