#ifndef PLUMBLINE_DETECTORS_WALL_FACES_H_
#define PLUMBLINE_DETECTORS_WALL_FACES_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/wall.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace plumbline {

/// The visible part of a wall that was seen from one side: free space lies to
/// the left of its direction.
struct WallFace {
  const Feature* feature = nullptr;
  Wall wall;
  /// Middle of the visible part, m, map frame.
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  /// Of the visible part, m.
  double length = 0.0;
  /// Connected part of the graph that it belongs to: relative covariances mean
  /// something within a part only. Directions and sizes that are shared connect
  /// nothing.
  std::size_t part = 0;
};

/// The one-sided walls of a scope with a visible part of at least `min_length`
/// (m) that poses of the graph have seen, in the order of ids. Relative poses
/// of walls that a front-end left (RelationRole::kPose) neglect what their
/// errors have in common: walls that have nothing else are left out, as nothing
/// can be judged by their covariances. Cost: linear in the graph.
std::vector<WallFace> CollectWallFaces(const Graph& graph,
                                       const DetectionScope& scope,
                                       double min_length);

/// Joint covariance of the parameters of other features, as they are and in
/// their order, and of two numbers for each face: how far its middle lies to
/// the left of where it is (m), and its direction (rad). Left is along `across`
/// or against it: one unit vector, that all faces are nearly across to, so that
/// where they lie as a whole does not enter what lies between them. All are of
/// one part of the graph. Throws Error as Marginals::JointCovariance does.
Eigen::MatrixXd FaceCovariance(const std::vector<const Feature*>& others,
                               const std::vector<const WallFace*>& faces,
                               const Eigen::Vector2d& across,
                               Marginals* marginals);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_WALL_FACES_H_
