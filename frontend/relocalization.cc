#include <ceres/ceres.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/information.h>
#include <plumbline/factors/pose_point.h>
#include <plumbline/factors/pose_pose.h>
#include <plumbline/factors/pose_segment_collinearity.h>
#include <plumbline/frontend/relocalization.h>

#include <Eigen/LU>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

namespace plumbline {

namespace {

// The poses of key scans as unknowns among features that stay where they are.
class KeyScanProblem {
 public:
  // All must outlive it.
  KeyScanProblem(const Graph& graph, const std::vector<KeyScanRecord>& records,
                 const RelocalizationOptions& options)
      : graph_(graph),
        options_(options),
        loss_(options.loss_scale),
        problem_(ProblemOptions()) {
    poses_.reserve(records.size());
    for (const KeyScanRecord& record : records) poses_.push_back(record.pose);
    for (std::size_t k = 0; k < records.size(); ++k) Add(records[k], k);
    if (options.start_position_sigma > 0.0) HoldStart();
    for (auto& entry : segments_) {
      problem_.SetParameterBlockConstant(entry.second.data());
    }
    for (auto& entry : points_) {
      problem_.SetParameterBlockConstant(entry.second.data());
    }
  }

  // The poses; as odometry has them where there is nothing to find them on.
  std::vector<Pose2> Solve() {
    if (!is_anchored_) return std::move(poses_);
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    solver.max_num_iterations = options_.max_iterations;
    solver.num_threads = options_.num_threads;
    solver.initial_trust_region_radius = 1e8;
    solver.function_tolerance = 1e-7;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
    if (!summary.IsSolutionUsable()) {
      throw PLUMBLINE_ERROR("relocalization failed: " + summary.message,
                            "a usable solution");
    }
    for (Pose2& pose : poses_) pose[2] = NormalizeAngle(pose[2]);
    return std::move(poses_);
  }

 private:
  static ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    options.disable_all_safety_checks = true;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  void Add(const KeyScanRecord& record, std::size_t k) {
    problem_.AddParameterBlock(poses_[k].data(), 3);
    if (k > 0) {
      const std::size_t from =
          record.from >= 0 ? static_cast<std::size_t>(record.from) : k - 1;
      problem_.AddResidualBlock(
          PosePose::Create(record.motion.mean, SqrtInformationFromCovariance(
                                                   record.motion.covariance)),
          nullptr, poses_[from].data(), poses_[k].data());
    }
    for (const FeatureMatch& match : record.matches) {
      const Feature* feature = graph_.FindFeature(match.feature);
      if (feature != nullptr) AddSegment(*feature, match.observation, k);
    }
    for (const PointMatch& match : record.points) {
      const Feature* feature = graph_.FindFeature(match.feature);
      if (feature != nullptr) AddPoint(*feature, match.observation, k);
    }
  }

  // An origin that stays, from which the first key scan is seen.
  void HoldStart() {
    const double position =
        1.0 / (options_.start_position_sigma * options_.start_position_sigma);
    const double angle =
        1.0 / (options_.start_angle_sigma * options_.start_angle_sigma);
    problem_.AddParameterBlock(origin_.data(), 3);
    problem_.SetParameterBlockConstant(origin_.data());
    problem_.AddResidualBlock(
        PosePose::Create(
            poses_.front(),
            SqrtInformation(Eigen::Matrix3d(
                Eigen::Vector3d(position, position, angle).asDiagonal()))),
        nullptr, origin_.data(), poses_.front().data());
  }

  void AddSegment(const Feature& feature, const SegmentObservation& observation,
                  std::size_t k) {
    Pose2& segment = segments_
                         .emplace(feature.id, Pose2(feature.parameters[0],
                                                    feature.parameters[1],
                                                    feature.parameters[2]))
                         .first->second;
    // The observed line in the robot's frame: offset of the robot's origin from
    // it, and heading of the robot against it (Eq. 20).
    const Pose2 inverse = Inverse(observation.pose);
    const Eigen::Vector2d expected(inverse[1], inverse[2]);
    Eigen::Matrix2d covariance = observation.covariance;
    covariance(0, 0) +=
        options_.feature_offset_sigma * options_.feature_offset_sigma;
    covariance(1, 1) +=
        options_.feature_angle_sigma * options_.feature_angle_sigma;
    // Offset and direction are independent at the middle of the piece; at the
    // robot's foot point the direction moves the offset.
    Eigen::Matrix2d lever;
    lever << 1.0, inverse[0], 0.0, 1.0;
    const Eigen::Matrix2d at_robot = lever * covariance * lever.transpose();
    problem_.AddResidualBlock(
        PoseSegmentCollinearity::Create(
            expected, SqrtInformationFromCovariance(at_robot)),
        &loss_, poses_[k].data(), segment.data());
    is_anchored_ = true;
  }

  void AddPoint(const Feature& feature, const PointObservation& observation,
                std::size_t k) {
    Eigen::Vector2d& point =
        points_
            .emplace(feature.id, Eigen::Vector2d(feature.parameters[0],
                                                 feature.parameters[1]))
            .first->second;
    Eigen::Matrix2d covariance = observation.covariance;
    covariance.diagonal().array() +=
        options_.point_sigma * options_.point_sigma;
    covariance /= observation.share;
    problem_.AddResidualBlock(
        PosePoint::Create(observation.position,
                          SqrtInformationFromCovariance(covariance)),
        &loss_, poses_[k].data(), point.data());
    is_anchored_ = true;
  }

  const Graph& graph_;
  const RelocalizationOptions& options_;
  std::vector<Pose2> poses_;
  Pose2 origin_ = Pose2::Zero();
  std::map<FeatureId, Pose2> segments_;
  std::map<FeatureId, Eigen::Vector2d> points_;
  bool is_anchored_ = false;
  // The problem points at all of these: it comes last.
  ceres::CauchyLoss loss_;
  ceres::Problem problem_;
};

}  // namespace

std::vector<Pose2> RelocalizeKeyScans(const Graph& graph,
                                      const std::vector<KeyScanRecord>& records,
                                      const RelocalizationOptions& options) {
  if (records.empty()) return {};
  return KeyScanProblem(graph, records, options).Solve();
}

std::vector<Pose2> InterpolateScans(const std::vector<RefinedScan>& refined,
                                    const std::vector<KeyScanRecord>& records,
                                    const std::vector<Pose2>& key_poses) {
  std::vector<Pose2> poses(refined.size(), Pose2::Zero());
  if (records.empty()) {
    for (std::size_t i = 0; i < refined.size(); ++i) poses[i] = refined[i].pose;
    return poses;
  }
  for (std::size_t k = 0; k < records.size(); ++k) {
    const std::size_t begin = records[k].scan;
    const bool last = k + 1 == records.size();
    const std::size_t end = last ? refined.size() : records[k + 1].scan;
    poses[begin] = key_poses[k];
    // What refined odometry misses at the next key, in that key's frame.
    Pose2 missing = Pose2::Zero();
    double whole = 0.0;
    std::vector<double> way(end - begin, 0.0);
    for (std::size_t i = begin + 1; i < end; ++i) {
      const Pose2 step = Between(refined[i - 1].pose, refined[i].pose);
      // A turn on the spot counts as way too.
      whole += step.head<2>().norm() + 0.5 * std::abs(step[2]);
      way[i - begin] = whole;
    }
    // The robot was lost in between: nothing tells what is missing.
    const bool goes_on = !last && FollowsTheOneBefore(records[k + 1]);
    if (goes_on) {
      const Pose2 step = Between(refined[end - 1].pose, refined[end].pose);
      whole += step.head<2>().norm() + 0.5 * std::abs(step[2]);
      missing = Between(Compose(key_poses[k], refined[end].since_key.mean),
                        key_poses[k + 1]);
    }
    for (std::size_t i = begin + 1; i < end; ++i) {
      const double share = whole > 0.0 ? way[i - begin] / whole : 0.0;
      poses[i] = Compose(Compose(key_poses[k], refined[i].since_key.mean),
                         Pose2(share * missing));
    }
  }
  return poses;
}

}  // namespace plumbline
