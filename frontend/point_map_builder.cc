#include <plumbline/core/error.h>
#include <plumbline/frontend/localization.h>
#include <plumbline/frontend/point_map_builder.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

namespace plumbline {
namespace {

constexpr char kSource[] = "frontend";

Eigen::Matrix3d Symmetric(const Eigen::Matrix3d& m) {
  return 0.5 * (m + m.transpose());
}

Eigen::Vector2d PositionOf(const Feature& feature) {
  return {feature.parameters[0], feature.parameters[1]};
}

// Derivative of a point's position in the robot's frame, where it is `point`,
// with respect to the robot's pose in the map frame.
Eigen::Matrix<double, 2, 3> RobotJacobian(const Pose2& robot,
                                          const Eigen::Vector2d& point) {
  const double c = std::cos(robot[2]);
  const double s = std::sin(robot[2]);
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << -c, -s, point.y(),  //
      s, -c, -point.x();
  return jacobian;
}

// Whether `direction` differs from all of `others` by so much.
bool IsApart(double direction, const std::vector<double>& others,
             double angle) {
  return std::all_of(others.begin(), others.end(), [&](double other) {
    return std::abs(NormalizeAngle(direction - other)) >= angle;
  });
}

// Indices of at most `count` of the points `others`, the nearest first, of
// those that lie in different directions; then, when they are too few, the
// nearest of the rest.
std::vector<std::size_t> ChooseLinks(const Eigen::Vector2d& point,
                                     const std::vector<Eigen::Vector2d>& others,
                                     const PointMapBuilderOptions& options) {
  std::vector<std::pair<double, std::size_t>> nearest;
  for (std::size_t i = 0; i < others.size(); ++i) {
    const double distance = (others[i] - point).norm();
    if (distance >= options.min_distance) nearest.emplace_back(distance, i);
  }
  std::sort(nearest.begin(), nearest.end());
  const auto count = static_cast<std::size_t>(options.links_per_point);
  std::vector<std::size_t> chosen;
  std::vector<std::size_t> rest;
  std::vector<double> directions;
  for (const auto& [distance, i] : nearest) {
    if (chosen.size() == count) break;
    const Eigen::Vector2d arm = others[i] - point;
    const double direction = std::atan2(arm.y(), arm.x());
    if (IsApart(direction, directions, options.link_angle)) {
      directions.push_back(direction);
      chosen.push_back(i);
    } else {
      rest.push_back(i);
    }
  }
  for (const std::size_t i : rest) {
    if (chosen.size() == count) break;
    chosen.push_back(i);
  }
  return chosen;
}

}  // namespace

PointMapBuilder::PointMapBuilder(Graph* graph, const Registry& registry,
                                 const PointMapBuilderOptions& options)
    : GraphBuilder(graph, registry), options_(options) {
  if (!(options_.spacing > 0.0)) {
    throw PLUMBLINE_ERROR(
        "spacing of points is " + std::to_string(options_.spacing) + " m",
        "more than 0");
  }
  if (options_.links_per_point < 1) {
    throw PLUMBLINE_ERROR(
        "links_per_point is " + std::to_string(options_.links_per_point),
        "1 or more");
  }
}

void PointMapBuilder::AddScan(const KeyScan& scan) {
  Place(scan);
  SegmentExtractionOptions extraction = options_.extraction;
  extraction.ScaleToNoise(scan.noise_scale);
  AddKeyScan(
      scan.index, scan.motion,
      ExtractSegments(scan.returns, scan.laser, scan.angle_step, extraction),
      scan.laser, scan.start);
}

std::vector<PointCandidate> PointMapBuilder::Candidates() const {
  std::vector<PointCandidate> candidates;
  const Eigen::Matrix3d widest = robot_.Widest();
  // A point may be off by as much as the gates allow.
  const double reach = options_.max_range + options_.link_radius;
  for (const FeatureId id : Neighborhood(options_.association_depth)) {
    const auto direction = directions_.find(id);
    if (direction == directions_.end()) continue;
    const Feature& feature = graph_->GetFeature(id);
    PointCandidate candidate;
    candidate.feature = id;
    candidate.position = PositionOf(feature);
    if ((candidate.position - robot_.pose().head<2>()).squaredNorm() >
        reach * reach) {
      continue;
    }
    candidate.direction = direction->second;
    const auto link = robot_.links().find(id);
    candidate.robot_covariance =
        link != robot_.links().end() ? link->second : widest;
    candidates.push_back(candidate);
  }
  return candidates;
}

void PointMapBuilder::AddKeyScan(
    int scan, const UncertainPose2& motion,
    const std::vector<SegmentObservation>& surfaces,
    const Eigen::Vector2d& laser, const Pose2& start) {
  KeyScanRecord record =
      BeginScan(scan, motion, start, options_.link_radius,
                [this](const Feature& feature) {
                  return (PositionOf(feature) - robot_.pose().head<2>()).norm();
                });

  const std::vector<PointCandidate> candidates =
      record.is_loose ? std::vector<PointCandidate>() : Candidates();
  const auto associate = [&](const Pose2& pose) {
    return AssociatePoints(pose, surfaces, candidates, options_.association);
  };
  std::vector<PointAssociation> associations = associate(robot_.pose());
  const double variance =
      options_.association.feature_sigma * options_.association.feature_sigma;
  CorrectRobot(
      candidates, associate,
      [&](const Eigen::Matrix3d& prior,
          const std::vector<PointAssociation>& recognized) {
        return LocalizeRobot(
            robot_.pose(), prior, recognized.size(),
            [&](const Pose2& pose, std::size_t i) {
              const PointObservation& observation = recognized[i].observation;
              const Eigen::Vector2d seen = TransformPoint(
                  Inverse(pose), candidates[recognized[i].candidate].position);
              LinearizedObservation linearized;
              linearized.error = seen - observation.position;
              linearized.jacobian = RobotJacobian(pose, seen);
              Eigen::Matrix2d covariance = observation.covariance;
              covariance.diagonal().array() += variance;
              linearized.weight = observation.share * covariance.inverse();
              return linearized;
            });
      },
      &associations);

  for (const PointAssociation& association : associations) {
    PointMatch match;
    match.feature = candidates[association.candidate].feature;
    match.observation = association.observation;
    directions_[match.feature] = NormalizeAngle(
        robot_.pose()[2] + surfaces[association.surface].pose[2]);
    ++graph_->GetFeature(match.feature).observations;
    ++num_matches_;
    record.points.push_back(match);
  }
  SecondLook(record.points);
  Grow(FreePlaces(surfaces, associations, laser), &record);
  EndScan(std::move(record));
}

void PointMapBuilder::SecondLook(const std::vector<PointMatch>& matches) {
  std::map<FeatureId, const PointObservation*> seen;
  for (const PointMatch& match : matches) {
    seen.emplace(match.feature, &match.observation);
  }
  for (const auto& [feature, first] : seen) {
    for (const ConstraintId id : graph_->ConstraintsOf(feature)) {
      const Constraint& constraint = graph_->GetConstraint(id);
      if (constraint.kind != ConstraintClass::kMeasurement ||
          constraint.features[0] != feature) {
        continue;
      }
      const auto other = seen.find(constraint.features[1]);
      if (other == seen.end()) continue;
      const PointObservation& second = *other->second;
      const Eigen::Vector2d arm = second.position - first->position;
      const double distance = arm.norm();
      if (distance < options_.min_distance) continue;
      const Eigen::Vector2d along = arm / distance;
      const double variance =
          along.dot((first->covariance + second.covariance) * along);
      const double before = constraint.information(0, 0);
      const double most =
          1.0 / (options_.distance_floor * options_.distance_floor);
      const double information =
          std::min(options_.second_look_weight / variance, most - before);
      if (information <= 0.0) continue;
      const double difference = distance - constraint.expected[0];
      // Not the same points, or badly seen: a distance does not jump.
      if (difference * difference * information > 9.0) continue;
      const double fused = before + information;
      graph_->UpdateConstraint(
          id,
          Eigen::VectorXd::Constant(
              1, constraint.expected[0] + information * difference / fused),
          Eigen::MatrixXd::Constant(1, 1, fused));
    }
  }
}

std::vector<PointMapBuilder::NewPoint> PointMapBuilder::FreePlaces(
    const std::vector<SegmentObservation>& surfaces,
    const std::vector<PointAssociation>& associations,
    const Eigen::Vector2d& laser) const {
  std::vector<std::vector<double>> taken(surfaces.size());
  for (const PointAssociation& association : associations) {
    taken[association.surface].push_back(association.along);
  }
  std::vector<NewPoint> points;
  for (std::size_t w = 0; w < surfaces.size(); ++w) {
    const SegmentObservation& surface = surfaces[w];
    // The part of it that is within range.
    const Eigen::Vector2d along_axis(std::cos(surface.pose[2]),
                                     std::sin(surface.pose[2]));
    const Eigen::Vector2d arm = laser - surface.pose.head<2>();
    const double foot = along_axis.dot(arm);
    const double half_squared = options_.max_range * options_.max_range -
                                (arm.squaredNorm() - foot * foot);
    if (half_squared <= 0.0) continue;
    const double half = std::sqrt(half_squared);
    const double margin = std::min(options_.end_margin, 0.25 * surface.length);
    const double begin = std::max(foot - half, -0.5 * surface.length + margin);
    const double end = std::min(foot + half, 0.5 * surface.length - margin);
    if (begin > end) continue;

    std::vector<double> places;
    std::sort(taken[w].begin(), taken[w].end());
    // Fills (a, b), whose ends have points, evenly.
    const auto fill = [&](double a, double b) {
      const int gaps =
          static_cast<int>(std::lround((b - a) / options_.spacing));
      for (int i = 1; i < gaps; ++i) places.push_back(a + (b - a) * i / gaps);
    };
    if (taken[w].empty()) {
      const int count = std::max(
          1, static_cast<int>(std::lround((end - begin) / options_.spacing)));
      for (int i = 0; i < count; ++i) {
        places.push_back(begin + (end - begin) * (i + 0.5) / count);
      }
    } else {
      for (double place = taken[w].front() - options_.spacing; place >= begin;
           place -= options_.spacing) {
        places.push_back(place);
      }
      for (std::size_t i = 1; i < taken[w].size(); ++i) {
        fill(taken[w][i - 1], taken[w][i]);
      }
      for (double place = taken[w].back() + options_.spacing; place <= end;
           place += options_.spacing) {
        places.push_back(place);
      }
    }
    for (const double place : places) {
      if (place < begin || place > end) continue;
      const PointObservation observation =
          PointOnSurface(surface, place, options_.along_sigma);
      points.push_back({observation.position, observation.covariance,
                        surface.pose[2], static_cast<int>(w)});
    }
  }
  return points;
}

void PointMapBuilder::Grow(const std::vector<NewPoint>& points,
                           KeyScanRecord* record) {
  if (points.empty()) return;
  const FeatureType& point_type = registry_.GetFeature("point");
  const RelationType& relation = registry_.GetRelation("point_point_distance");

  // What a new point may be bound to: where the robot sees them, and how well.
  std::vector<FeatureId> others;
  std::vector<Eigen::Vector2d> positions;
  const Pose2 to_robot = Inverse(robot_.pose());
  for (const auto& link : robot_.links()) {
    others.push_back(link.first);
    positions.push_back(
        TransformPoint(to_robot, PositionOf(graph_->GetFeature(link.first))));
  }
  const std::size_t old = others.size();

  // The gauge: two points of the first scan, as far apart as there are.
  const bool is_first = robot_.links().empty() && num_created_ == 0;
  const std::pair<std::size_t, std::size_t> gauge =
      is_first ? FarthestPair(points)
               : std::make_pair(points.size(), points.size());

  Transaction transaction;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const NewPoint& point = points[k];
    const Eigen::Vector2d position =
        TransformPoint(robot_.pose(), point.position);
    Feature feature;
    feature.type = &point_type;
    feature.parameters = {position.x(), position.y()};
    feature.observations = 1;
    feature.source = kSource;
    feature.fixed = k == gauge.first || k == gauge.second;
    const FeatureId id = transaction.AddFeature(feature);
    for (const std::size_t i :
         ChooseLinks(point.position, positions, options_)) {
      const Eigen::Vector2d arm = positions[i] - point.position;
      const double distance = arm.norm();
      const Eigen::Vector2d along = arm / distance;
      double variance = along.dot(point.covariance * along);
      double weight = 1.0;
      if (i < old) {
        // The robot's error moves the new point against the earlier one.
        const Eigen::Matrix<double, 1, 3> row =
            along.transpose() * RobotJacobian(robot_.pose(), positions[i]);
        variance += row * robot_.links().at(others[i]) * row.transpose();
        weight = options_.shared_error_weight;
      } else {
        variance += along.dot(points[i - old].covariance * along);
      }
      variance =
          std::max(variance, options_.distance_floor * options_.distance_floor);
      transaction.AddConstraint(MakeMeasurement(
          relation, {others[i], id}, Eigen::VectorXd::Constant(1, distance),
          Eigen::MatrixXd::Constant(1, 1, weight / variance), kSource));
    }
    others.push_back(id);
    positions.push_back(point.position);
  }
  const TransactionResult result = graph_->Apply(std::move(transaction));
  std::map<int, int> on_surface;
  for (const NewPoint& point : points) ++on_surface[point.surface];
  for (std::size_t k = 0; k < points.size(); ++k) {
    const NewPoint& point = points[k];
    PointMatch match;
    match.feature = result.features[k];
    match.observation.position = point.position;
    match.observation.covariance = point.covariance;
    match.observation.share = 1.0 / on_surface.at(point.surface);
    record->points.push_back(match);
    directions_[match.feature] =
        NormalizeAngle(robot_.pose()[2] + point.direction);
    robot_.Add(match.feature, CovarianceFrom(point));
    ++num_created_;
  }
}

std::pair<std::size_t, std::size_t> PointMapBuilder::FarthestPair(
    const std::vector<NewPoint>& points) {
  std::pair<std::size_t, std::size_t> pair(0, 0);
  double farthest = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double distance = (points[i].position - points[j].position).norm();
      if (distance > farthest) {
        farthest = distance;
        pair = {j, i};
      }
    }
  }
  return pair;
}

Eigen::Matrix3d PointMapBuilder::CovarianceFrom(const NewPoint& point) const {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const double c = std::cos(robot_.pose()[2]);
  const double s = std::sin(robot_.pose()[2]);
  Eigen::Matrix2d axes;
  axes << c, -s, s, c;
  covariance.topLeftCorner<2, 2>() = axes * point.covariance * axes.transpose();
  const double angle = options_.extraction.angle_bias_sigma;
  covariance(2, 2) = angle * angle;
  return Symmetric(covariance);
}

void PointMapBuilder::WriteRobot() {
  const RelationType& relation = registry_.GetRelation("pose_point");
  robot_.Write(registry_, kSource, [&](FeatureId robot) {
    std::vector<Constraint> constraints;
    const Pose2 to_robot = Inverse(robot_.pose());
    for (const auto& link : robot_.links()) {
      const Eigen::Vector2d seen =
          TransformPoint(to_robot, PositionOf(graph_->GetFeature(link.first)));
      const Eigen::Matrix<double, 2, 3> jacobian =
          RobotJacobian(robot_.pose(), seen);
      const Eigen::Matrix2d covariance =
          jacobian * link.second * jacobian.transpose();
      const Eigen::Matrix2d information = covariance.inverse();
      constraints.push_back(
          MakeMeasurement(relation, {robot, link.first}, seen,
                          0.5 * (information + information.transpose()) /
                              static_cast<double>(robot_.links().size()),
                          kSource));
    }
    return constraints;
  });
}

void PointMapBuilder::WriteState(StateWriter* state) const {
  GraphBuilder::WriteState(state);
  std::map<FeatureId, double> directions = directions_;
  Exchange(*state, directions);
}

void PointMapBuilder::ReadState(StateReader* state) {
  GraphBuilder::ReadState(state);
  Exchange(*state, directions_);
}

}  // namespace plumbline
