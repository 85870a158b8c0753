#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/placement_tie.h>

#include <Eigen/Core>

namespace plumbline {
namespace {

constexpr double kSigma = 0.1;
constexpr double kSigmaPerMetre = 0.02;
constexpr double kAngle = DegToRad(1.0);
constexpr double kAnglePerMetre = DegToRad(0.1);

}  // namespace

UncertainPose2 PlacementTie(const Pose2& mean, double way) {
  const double sigma = kSigma + kSigmaPerMetre * way;
  const double angle = kAngle + kAnglePerMetre * way;
  UncertainPose2 tie;
  tie.mean = mean;
  tie.covariance =
      Eigen::Vector3d(sigma * sigma, sigma * sigma, angle * angle).asDiagonal();
  return tie;
}

}  // namespace plumbline
