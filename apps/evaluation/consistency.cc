#include <plumbline/apps/evaluation/consistency.h>
#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/core/marginals.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// What a map says in rounding only, m^2 and rad^2.
constexpr double kRounding = 1e-12;

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

// How a wall of the map lies along a true one.
struct Beside {
  // Some of it does, all of it does.
  bool overlaps = false;
  bool lies_on = false;
  // How far the middle of what does lies to the left, m.
  double offset = 0.0;
};

Beside LieBeside(const TruthWall& wall, const Eigen::Vector2d& begin,
                 const Eigen::Vector2d& end,
                 const ConsistencyOptions& options) {
  Beside result;
  const double length = (wall.end - wall.begin).norm();
  if (!(length > 0.0)) return result;
  const Eigen::Vector2d along = (wall.end - wall.begin) / length;
  const auto [first, last] = std::minmax(
      {(begin - wall.begin).dot(along), (end - wall.begin).dot(along)});
  const double from = std::max(first, 0.0);
  const double to = std::min(last, length);
  result.overlaps = to - from > options.end_slack;
  if (!result.overlaps) return result;
  const double share = (0.5 * (from + to) - first) / (last - first);
  const bool is_forward = (end - begin).dot(along) > 0.0;
  result.offset =
      AcrossFrom(wall.begin, along,
                 begin + (is_forward ? share : 1.0 - share) * (end - begin));
  result.lies_on =
      first >= -options.end_slack && last <= length + options.end_slack &&
      std::abs(AcrossFrom(wall.begin, along, begin)) <=
          options.maximum_offset &&
      std::abs(AcrossFrom(wall.begin, along, end)) <= options.maximum_offset;
  return result;
}

// Poses of the trajectory, and the true ones.
using PosePairs = std::vector<std::pair<Pose2, Pose2>>;

// A pose of the graph is one of the trajectory's when it is so near, m (and m
// for a radian).
constexpr double kSamePose = 0.02;

// World pose of the map frame as it is around a wall: by the nearest pose of
// the graph that saw it, or, where there is none, the pose of the trajectory
// that is nearest to its middle on the side from which it was seen. Others may
// be of another visit, for which the map lies elsewhere.
Pose2 LocalAlignment(const Graph& graph, const PosePairs& poses,
                     const Feature& wall, const Eigen::Vector2d& middle) {
  const Feature* seen_from = nullptr;
  const auto distance = [&middle](const Feature& pose) {
    return (pose.type->frame(pose).head<2>() - middle).squaredNorm();
  };
  for (const ConstraintId id : graph.ConstraintsOf(wall.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (constraint.kind != ConstraintClass::kMeasurement) continue;
    for (const FeatureId other : constraint.features) {
      const Feature& feature = graph.GetFeature(other);
      if (feature.type->Is(FeatureRole::kPose) &&
          (seen_from == nullptr || distance(feature) < distance(*seen_from))) {
        seen_from = &feature;
      }
    }
  }
  const auto nearest = [&poses](const auto& rank) {
    return std::min_element(poses.begin(), poses.end(),
                            [&rank](const auto& a, const auto& b) {
                              return rank(a.first) < rank(b.first);
                            });
  };
  const auto alignment = [](const auto& pair) {
    return Compose(pair->second, Inverse(pair->first));
  };
  if (seen_from != nullptr) {
    const Pose2 from = seen_from->type->frame(*seen_from);
    const auto apart = [&from](const Pose2& pose) {
      return (pose - from).head<2>().norm() +
             std::abs(NormalizeAngle(pose[2] - from[2]));
    };
    const auto same = nearest(apart);
    if (apart(same->first) < kSamePose) return alignment(same);
  }
  const double direction = wall.type->frame(wall)[2];
  const Eigen::Vector2d normal(-std::sin(direction), std::cos(direction));
  return alignment(nearest([&](const Pose2& pose) {
    const Eigen::Vector2d from_middle = pose.head<2>() - middle;
    return std::make_pair(from_middle.dot(normal) <= 0.0,
                          from_middle.squaredNorm());
  }));
}

std::vector<Pairing> PairWalls(const Graph& graph, const MapTruth& truth,
                               const std::vector<TimedPose>& trajectory,
                               const ConsistencyOptions& options) {
  const Pose2 alignment = AlignTrajectory(trajectory, truth);
  PosePairs poses;
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
    const Pose2 moved =
        Compose(LocalAlignment(graph, poses, *feature, middle), pose);
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
    bool lies_on = false;
    for (const TruthWall& wall : truth.walls) {
      const Eigen::Vector2d along = (wall.end - wall.begin).normalized();
      const double direction = std::atan2(along.y(), along.x());
      if (std::abs(RadToDeg(NormalizeAxial(moved[2] - direction))) >
          options.maximum_angle_deg) {
        continue;
      }
      const Beside beside = LieBeside(wall, at(feature->extent_begin),
                                      at(feature->extent_end), options);
      if (!beside.overlaps) continue;
      const double offset = std::abs(beside.offset);
      if (offset >= nearest) {
        second = std::min(second, offset);
        continue;
      }
      second = nearest;
      nearest = offset;
      // What reaches beyond the face that it is must not be taken for the one
      // behind it.
      lies_on = beside.lies_on;
      const double turn = NormalizeAxial(global[2] - direction);
      const Eigen::Vector2d middle_in_world =
          TransformPoint(global, Eigen::Vector2d(pair.along, 0.0));
      // The offset along the map wall's own normal.
      const double side = std::cos(global[2] - direction) < 0.0 ? -1.0 : 1.0;
      pair.error = {side * AcrossFrom(wall.begin, along, middle_in_world),
                    turn};
    }
    // Two faces alike near: which one it is cannot be said.
    if (lies_on && second - nearest >= options.least_margin) {
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
  covariance.diagonal().array() += kRounding;
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

Consistency EvaluatePointConsistency(const Graph& graph,
                                     const SolverSession& session,
                                     const SyntheticTruth& truth) {
  Consistency result;
  std::vector<FeatureId> ids;
  for (const Feature* feature : graph.Features()) {
    if (feature->type->Is(FeatureRole::kPoint) && feature->level == 0) {
      ids.push_back(feature->id);
    }
  }
  result.walls = static_cast<int>(ids.size());
  if (ids.size() < 2) return result;
  MarginalsOptions marginals_options;
  marginals_options.hold_gauge = true;
  Marginals marginals(graph, session, marginals_options);
  Eigen::MatrixXd covariance = marginals.JointCovariance(ids);

  const int n = 2 * result.walls;
  const RigidTransform alignment = AlignToTruth(graph, truth);
  Eigen::VectorXd error(n);
  Eigen::MatrixXd gauge(n, 3);
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  const auto position = [&](int i) {
    const Feature& point = graph.GetFeature(ids[i]);
    return Eigen::Vector2d(point.parameters[0], point.parameters[1]);
  };
  for (int i = 0; i < result.walls; ++i) center += position(i) / result.walls;
  for (int i = 0; i < result.walls; ++i) {
    const Eigen::Vector2d lever = position(i) - center;
    error.segment<2>(2 * i) =
        alignment.rotation.transpose() *
        (alignment * position(i) -
         truth.positions[static_cast<std::size_t>(ids[i])]);
    gauge.row(2 * i) << 1.0, 0.0, -lever.y();
    gauge.row(2 * i + 1) << 0.0, 1.0, lever.x();
  }
  // Nothing ties the points to the plane: the frame's own variance, which is
  // next to infinite, is no error of theirs.
  const Eigen::MatrixXd basis =
      Eigen::HouseholderQR<Eigen::MatrixXd>(gauge).householderQ() *
      Eigen::MatrixXd::Identity(n, 3);
  const auto without_frame = [&basis](const Eigen::MatrixXd& m) {
    return Eigen::MatrixXd(m - basis * (basis.transpose() * m));
  };
  error = without_frame(error);
  covariance = without_frame(without_frame(covariance).transpose());
  const double share = 1.0 / n;
  for (int i = 0; i < result.walls; ++i) {
    const Eigen::Vector2d e = error.segment<2>(2 * i);
    const Eigen::Matrix2d c = covariance.block<2, 2>(2 * i, 2 * i);
    result.mean_wall_ratio += share * e.dot(c.ldlt().solve(e));
    result.offset_error += share * e.squaredNorm();
    result.offset_sigma += share * c.trace();
  }
  result.offset_error = std::sqrt(result.offset_error);
  result.offset_sigma = std::sqrt(std::max(0.0, result.offset_sigma));
  // The frame, of which the error has nothing, gets a variance again.
  covariance += basis * basis.transpose();
  covariance.diagonal().array() += kRounding;
  result.nees = error.dot(covariance.ldlt().solve(error));
  result.degrees_of_freedom = n - 3;
  return result;
}

}  // namespace plumbline
