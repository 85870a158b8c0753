#ifndef PLUMBLINE_FRONTEND_WALL_VOTES_H_
#define PLUMBLINE_FRONTEND_WALL_VOTES_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan_relations.h>

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace plumbline {

/// Options of votes: which returns vote for a wall, and how far one is trusted.
struct WallVoteOptions {
  /// Largest distance of a return from the wall that it votes for, the nearest:
  /// across and past its ends (m), and in the direction of its surface (rad),
  /// seen from the wall's own side. A door set back by a hand's breadth is
  /// another wall: were its returns to vote for the wall beside it, they would
  /// tilt it.
  double max_offset = 0.04;
  double max_gap = 0.2;
  double max_turn = DegToRad(25.0);
  /// Standard deviation of a return off its wall, m, and distance in standard
  /// deviations at which it counts half (Cauchy).
  double point_sigma = 0.03;
  double loss_scale = 1.0;
  /// A return counts as this many independent ones: whatever the number of
  /// returns and visits, they share the wall's own errors (panels, frames,
  /// bends) and those of its poses.
  double independence = 0.5;
  /// Fewer returns of one place on a wall do not count as a vote.
  int min_points = 3;
  /// The result does not depend on it.
  int num_threads = 1;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    max_offset *= scale;
    point_sigma *= scale;
  }
};

/// Vote of the returns of one place on one wall: the information of a
/// pose_segment_points constraint (factors/pose_segment_points.h).
struct WallVote {
  FeatureId wall = kNoId;
  int points = 0;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

/// Lets every return vote for the wall (segment of level 0) that it hit, its
/// weight robust; all scans of a place count as one. `poses`: one per place,
/// map frame. Returns the votes of each place by ascending id of the wall.
/// Cost: linear in the returns.
std::vector<std::vector<WallVote>> CollectWallVotes(
    const Graph& graph, const std::vector<Place>& places,
    const std::vector<Pose2>& poses, const WallVoteOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WALL_VOTES_H_
