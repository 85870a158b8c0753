#ifndef PLUMBLINE_FRONTEND_POINT_ASSOCIATION_H_
#define PLUMBLINE_FRONTEND_POINT_ASSOCIATION_H_

#include <plumbline/core/feature.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// Gates of the association of points of the map with the surfaces of a scan.
struct PointAssociationOptions {
  /// Gate on the squared distance across the surface in standard deviations
  /// (chi^2, 1 degree of freedom).
  double gate = 6.63;
  /// Whatever the uncertainty: farthest off the surface, m.
  double max_offset = 0.3;
  /// Largest angle between the surface that the point was made on and the one
  /// that is seen, rad: keeps the walls of a corner and the two faces of a thin
  /// wall apart.
  double max_angle = DegToRad(30.0);
  /// Uncertainty of a point's own place in its neighbourhood, m.
  double feature_sigma = 0.03;
  /// A point's place along its surface is not observed: the standard deviation
  /// that stands for it, m.
  double along_sigma = 50.0;
};

/// A point as a scan sees it: robot's frame.
struct PointObservation {
  /// m.
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  /// m^2; wide along the surface that the point is on.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  /// Share of the information that counts: points on one surface share its
  /// error, so together they weigh as much as the surface.
  double share = 1.0;
};

/// An observation recognized as a point of the map.
struct PointMatch {
  FeatureId feature = kNoId;
  PointObservation observation;
};

/// A point of the map that a scan may see.
struct PointCandidate {
  FeatureId feature = kNoId;
  /// m, map frame.
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  /// Direction of the surface that it is on, the side that was seen on the
  /// left; rad, map frame.
  double direction = 0.0;
  /// Covariance of the robot relative to the point, axes of the map frame.
  Eigen::Matrix3d robot_covariance = Eigen::Matrix3d::Zero();
};

/// A candidate on a surface.
struct PointAssociation {
  /// Index of the candidate and of the surface.
  int candidate = -1;
  int surface = -1;
  /// The surface at the candidate's foot.
  PointObservation observation;
  /// Where that is along the surface, m from its middle.
  double along = 0.0;
  double squared_distance = 0.0;
};

/// The surface `surface` of a scan at `along` m from its middle as a point:
/// certain across as the surface is there, with standard deviation
/// `along_sigma` (m) along it.
PointObservation PointOnSurface(const SegmentObservation& surface, double along,
                                double along_sigma);

/// Nearest neighbour association of points with the straight surfaces of a
/// scan, with the robot at `robot`: each candidate with the surface of the
/// smallest normalized distance, of those that its foot is on and the gates
/// allow. The observation is the surface sampled at the foot: a scan sees
/// a wall and not the point that once was chosen on it. In the order of
/// candidates.
std::vector<PointAssociation> AssociatePoints(
    const Pose2& robot, const std::vector<SegmentObservation>& surfaces,
    const std::vector<PointCandidate>& candidates,
    const PointAssociationOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_POINT_ASSOCIATION_H_
