#ifndef PLUMBLINE_FACTORS_POSE_MANIFOLD_H_
#define PLUMBLINE_FACTORS_POSE_MANIFOLD_H_

#include <plumbline/factors/angle_manifold.h>

namespace plumbline {

/// Poses and segments (x, y, theta), in m, m, rad: the plane times the circle.
/// Steps are taken in the map frame, not in the frame of the pose.
class PoseManifold final : public WrappedAngleManifold<3, 2> {};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_MANIFOLD_H_
