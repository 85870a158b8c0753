#include <plumbline/apps/evaluation/consistency.h>
#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/core/marginals.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// A wall of the map on the true wall that it is.
struct Pairing {
  FeatureId id;
  // Of the middle, map frame.
  Eigen::Vector2d middle;
  double direction;
  // Along the direction from the feature's position to the middle, m.
  double along;
  // Offset across (m) and direction (rad): map minus truth.
  Eigen::Vector2d error;
};

// How far a point lies to the left of a line.
double AcrossFrom(const Eigen::Vector2d& begin, const Eigen::Vector2d& along,
                  const Eigen::Vector2d& point) {
  const Eigen::Vector2d from_begin = point - begin;
  return along.x() * from_begin.y() - along.y() * from_begin.x();
}

// Whether both ends are beside the wall.
bool LiesOn(const TruthWall& wall, const Eigen::Vector2d& begin,
            const Eigen::Vector2d& end, const ConsistencyOptions& options) {
  const Eigen::Vector2d along = wall.end - wall.begin;
  const double length = along.norm();
  if (!(length > 0.0)) return false;
  const Eigen::Vector2d direction = along / length;
  for (const Eigen::Vector2d& point : {begin, end}) {
    const Eigen::Vector2d from_begin = point - wall.begin;
    const double t = from_begin.dot(direction);
    const double offset = std::abs(direction.x() * from_begin.y() -
                                   direction.y() * from_begin.x());
    if (t < -options.end_slack || t > length + options.end_slack ||
        offset > options.maximum_offset) {
      return false;
    }
  }
  return true;
}

// World pose of the map frame as it is around a place: by the pose of the
// trajectory that is nearest.
Pose2 LocalAlignment(const std::vector<std::pair<Pose2, Pose2>>& poses,
                     const Eigen::Vector2d& place) {
  const auto nearest = std::min_element(
      poses.begin(), poses.end(), [&place](const auto& a, const auto& b) {
        return (a.first.template head<2>() - place).squaredNorm() <
               (b.first.template head<2>() - place).squaredNorm();
      });
  return Compose(nearest->second, Inverse(nearest->first));
}

std::vector<Pairing> PairWalls(const Graph& graph, const MapTruth& truth,
                               const std::vector<TimedPose>& trajectory,
                               const ConsistencyOptions& options) {
  const Pose2 alignment = AlignTrajectory(trajectory, truth);
  std::vector<std::pair<Pose2, Pose2>> poses;
  const TrajectoryIndex index(trajectory);
  for (const TimedPose& timed : truth.poses) {
    const int match = index.Find(timed.timestamp, 1e-3);
    if (match >= 0) poses.emplace_back(trajectory[match].pose, timed.pose);
  }
  std::vector<Pairing> pairs;
  for (const Feature* feature : graph.Features()) {
    if (!feature->type->Is(FeatureRole::kWall) ||
        !feature->type->traits.is_one_sided || feature->level != 0 ||
        feature->extent_end - feature->extent_begin < options.minimum_length) {
      continue;
    }
    const Pose2 pose = feature->type->frame(*feature);
    const Eigen::Vector2d middle = TransformPoint(
        pose, Eigen::Vector2d(
                  0.5 * (feature->extent_begin + feature->extent_end), 0.0));
    const Pose2 moved = Compose(LocalAlignment(poses, middle), pose);
    const Pose2 global = Compose(alignment, pose);
    const auto at = [&moved](double along) {
      return TransformPoint(moved, Eigen::Vector2d(along, 0.0));
    };
    Pairing pair;
    pair.id = feature->id;
    pair.along = 0.5 * (feature->extent_begin + feature->extent_end);
    pair.middle = middle;
    pair.direction = pose[2];
    double nearest = options.maximum_offset;
    double second = options.maximum_offset;
    for (const TruthWall& wall : truth.walls) {
      const Eigen::Vector2d along = (wall.end - wall.begin).normalized();
      const double direction = std::atan2(along.y(), along.x());
      if (std::abs(RadToDeg(NormalizeAxial(moved[2] - direction))) >
              options.maximum_angle_deg ||
          !LiesOn(wall, at(feature->extent_begin), at(feature->extent_end),
                  options)) {
        continue;
      }
      const double offset = AcrossFrom(wall.begin, along, at(pair.along));
      if (std::abs(offset) >= nearest) {
        second = std::min(second, std::abs(offset));
        continue;
      }
      second = nearest;
      nearest = std::abs(offset);
      const double turn = NormalizeAxial(global[2] - direction);
      const Eigen::Vector2d middle_in_world =
          TransformPoint(global, Eigen::Vector2d(pair.along, 0.0));
      // The offset along the map wall's own normal.
      const double side = std::cos(global[2] - direction) < 0.0 ? -1.0 : 1.0;
      pair.error = {side * AcrossFrom(wall.begin, along, middle_in_world),
                    turn};
    }
    // Two faces alike near: which one it is cannot be said.
    if (nearest < options.maximum_offset &&
        second - nearest >= options.least_margin) {
      pairs.push_back(pair);
    }
  }
  return pairs;
}

}  // namespace

Consistency EvaluateConsistency(const Graph& graph,
                                const SolverSession& session,
                                const MapTruth& truth,
                                const std::vector<TimedPose>& trajectory,
                                const ConsistencyOptions& options) {
  Consistency result;
  const std::vector<Pairing> pairs =
      PairWalls(graph, truth, trajectory, options);
  result.walls = static_cast<int>(pairs.size());
  if (pairs.size() < 2) return result;
  std::vector<FeatureId> ids;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  for (const Pairing& pair : pairs) {
    ids.push_back(pair.id);
    center += pair.middle / static_cast<double>(pairs.size());
  }
  MarginalsOptions marginals_options;
  marginals_options.hold_gauge = true;
  Marginals marginals(graph, session, marginals_options);
  const Eigen::MatrixXd joint = marginals.JointCovariance(ids);

  const int n = 2 * result.walls;
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(n, joint.cols());
  Eigen::MatrixXd gauge(n, 3);
  Eigen::VectorXd error(n);
  for (int i = 0; i < result.walls; ++i) {
    const Pairing& pair = pairs[i];
    const Eigen::RowVector2d normal(-std::sin(pair.direction),
                                    std::cos(pair.direction));
    jacobian.block<1, 2>(2 * i, 3 * i) = normal;
    jacobian(2 * i, 3 * i + 2) = pair.along;
    jacobian(2 * i + 1, 3 * i + 2) = 1.0;
    const Eigen::Vector2d lever = pair.middle - center;
    gauge.row(2 * i) << normal,
        normal.dot(Eigen::RowVector2d(-lever.y(), lever.x()));
    gauge.row(2 * i + 1) << 0.0, 0.0, 1.0;
    error.segment<2>(2 * i) = pair.error;
  }
  Eigen::MatrixXd covariance = jacobian * joint * jacobian.transpose();
  // What the map says in rounding only, m^2 and rad^2.
  covariance.diagonal().array() += 1e-12;
  const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
  // The frame is not known: it is fitted.
  const Eigen::MatrixXd weighted = factor.solve(gauge);
  const Eigen::Matrix3d information = gauge.transpose() * weighted;
  const Eigen::LDLT<Eigen::Matrix3d> frame(information);
  const Eigen::VectorXd left =
      error - gauge * frame.solve(weighted.transpose() * error);
  result.nees = left.dot(factor.solve(left));
  result.degrees_of_freedom = n - 3;
  const Eigen::MatrixXd left_covariance =
      covariance - gauge * frame.solve(gauge.transpose());
  const double share = 1.0 / result.walls;
  for (int i = 0; i < result.walls; ++i) {
    const Eigen::Vector2d e = left.segment<2>(2 * i);
    const Eigen::Matrix2d c = left_covariance.block<2, 2>(2 * i, 2 * i);
    result.mean_wall_ratio += share * 0.5 * e.dot(c.ldlt().solve(e));
    result.offset_error += share * e[0] * e[0];
    result.direction_error_deg += share * e[1] * e[1];
    result.offset_sigma += share * c(0, 0);
    result.direction_sigma_deg += share * c(1, 1);
  }
  result.offset_error = std::sqrt(result.offset_error);
  result.offset_sigma = std::sqrt(std::max(0.0, result.offset_sigma));
  result.direction_error_deg = RadToDeg(std::sqrt(result.direction_error_deg));
  result.direction_sigma_deg =
      RadToDeg(std::sqrt(std::max(0.0, result.direction_sigma_deg)));
  return result;
}

}  // namespace plumbline
