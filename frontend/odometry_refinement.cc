#include <plumbline/frontend/odometry_refinement.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace plumbline {

Eigen::Matrix3d OdometryCovariance(const Pose2& motion,
                                   const OdometryNoise& noise) {
  const double distance = motion.head<2>().norm();
  const double turn = std::abs(NormalizeAngle(motion[2]));
  const double translation = noise.translation +
                             noise.translation_per_metre * distance +
                             noise.translation_per_radian * turn;
  const double rotation = noise.rotation + noise.rotation_per_metre * distance +
                          noise.rotation_per_radian * turn;
  return Eigen::Vector3d(translation * translation, translation * translation,
                         rotation * rotation)
      .asDiagonal();
}

OdometryRefiner::OdometryRefiner(const OdometryRefinementOptions& options)
    : options_(options), matcher_(options.matcher) {}

void OdometryRefiner::RebuildReference() {
  std::vector<ScanPoint> reference;
  for (const KeyScan& key : keys_) {
    // Where odometry has jumped: nothing is in sight of both.
    if ((key.pose - keys_.back().pose).head<2>().norm() >
        2.0 * options_.points.usable_range) {
      continue;
    }
    const PoseTransform transform(key.pose);
    for (const ScanPoint& point : key.points) {
      reference.push_back(Moved(point, transform));
    }
  }
  matcher_.SetReference(std::move(reference));
}

RefinedScan OdometryRefiner::Process(const Scan& scan) {
  ExtractScanPoints(scan, options_.points, &points_);
  RefinedScan result;
  if (!started_) {
    started_ = true;
    result.pose = scan.odometry;
    result.is_key = true;
    last_odometry_ = scan.odometry;
    last_pose_ = scan.odometry;
    keys_.push_back({last_pose_, points_});
    RebuildReference();
    return result;
  }

  const Pose2 motion = Between(last_odometry_, scan.odometry);
  const Eigen::Matrix3d motion_covariance =
      OdometryCovariance(motion, options_.noise);
  const Pose2 key_pose = keys_.back().pose;
  const double turn = std::abs(motion[2]);
  const double distance = motion.head<2>().norm();

  result.since_key = Compose(since_key_, {motion, motion_covariance});
  result.pose = Compose(last_pose_, motion);
  result.odometry_only = true;
  if (options_.match_scans && !matcher_.empty() &&
      static_cast<int>(points_.size()) >= options_.minimum_points) {
    MatchPrior prior;
    prior.pose = result.pose;
    prior.information = motion_covariance.inverse();
    MatchResult match = matcher_.Refine(points_, result.pose, prior);
    if (match.inlier_ratio < options_.good_inlier_ratio ||
        turn > options_.search_turn) {
      ++wide_searches_;
      // Twice the distance: some odometry gives the way travelled backwards
      // as if it were forwards.
      const Pose2 found =
          matcher_.Search(points_, result.pose,
                          std::min(options_.search_translation + 2.0 * distance,
                                   options_.max_search_translation),
                          options_.search_rotation + turn, nullptr);
      MatchPrior overruled = prior;
      overruled.information.row(2).setZero();
      overruled.information.col(2).setZero();
      const MatchResult wide = matcher_.Refine(points_, found, overruled);
      // The scan has to speak clearly for another pose than odometry's.
      if (wide.cost < match.cost - 0.02) match = wide;
    }
    if (match.inlier_ratio >= options_.minimum_inlier_ratio) {
      result.pose = match.pose;
      result.odometry_only = false;
      result.since_key.mean = Between(key_pose, match.pose);
      // From the refined frame's axes to the key scan's.
      const double c = std::cos(key_pose[2]);
      const double s = std::sin(key_pose[2]);
      Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
      rotation.topLeftCorner<2, 2>() << c, s, -s, c;
      // What the returns leave open is as uncertain as all the odometry since
      // the key scan, not as that of the last step alone.
      result.since_key.covariance =
          (rotation * match.information * rotation.transpose() +
           result.since_key.covariance.inverse())
              .inverse();
    } else {
      ++refusals_;
    }
  }

  since_key_ = result.since_key;
  if (!result.odometry_only) {
    const MatchDrift& drift = options_.drift;
    const double way = result.since_key.mean.head<2>().norm();
    const double turned = std::abs(result.since_key.mean[2]);
    const double translation = drift.translation_per_root_metre *
                               drift.translation_per_root_metre * way;
    const double rotation =
        drift.rotation_per_root_metre * drift.rotation_per_root_metre * way +
        drift.rotation_per_root_radian * drift.rotation_per_root_radian *
            turned;
    result.since_key.covariance.diagonal() +=
        Eigen::Vector3d(translation, translation, rotation);
  }
  if (result.since_key.mean.head<2>().norm() >= options_.key_distance ||
      std::abs(result.since_key.mean[2]) >= options_.key_rotation) {
    result.is_key = true;
    keys_.push_back({result.pose, points_});
    while (static_cast<int>(keys_.size()) > options_.window) keys_.pop_front();
    RebuildReference();
    since_key_ = UncertainPose2();
  }
  last_odometry_ = scan.odometry;
  last_pose_ = result.pose;
  return result;
}

}  // namespace plumbline
