#include <plumbline/frontend/localization.h>
#include <plumbline/frontend/map_builder.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

constexpr char kSource[] = "frontend";

// Nothing is learnt along a wall from a second look, m.
constexpr double kUnknownAlong = 50.0;

Eigen::Matrix3d Symmetric(const Eigen::Matrix3d& m) {
  return 0.5 * (m + m.transpose());
}

// Turns a covariance between the axes of the map frame and those of a frame
// with this heading.
Eigen::Matrix3d ToFrame(const Eigen::Matrix3d& covariance, double heading) {
  const double c = std::cos(heading);
  const double s = std::sin(heading);
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  rotation.topLeftCorner<2, 2>() << c, s, -s, c;
  return Symmetric(rotation * covariance * rotation.transpose());
}

Eigen::Matrix3d ObservationCovariance(const SegmentObservation& observation,
                                      double along_sigma) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  covariance(0, 0) = along_sigma * along_sigma;
  covariance(1, 1) = observation.covariance(0, 0);
  covariance(2, 2) = observation.covariance(1, 1);
  covariance(1, 2) = covariance(2, 1) = observation.covariance(0, 1);
  // From the segment's own axes to the robot's.
  return ToFrame(covariance, -observation.pose[2]);
}

Pose2 PoseOf(const Feature& feature) {
  return Pose2(feature.parameters[0], feature.parameters[1],
               feature.parameters[2]);
}

// Distance from a point to the visible part of a segment.
double DistanceTo(const Feature& feature, const Eigen::Vector2d& point) {
  const double c = std::cos(feature.parameters[2]);
  const double s = std::sin(feature.parameters[2]);
  const double dx = point.x() - feature.parameters[0];
  const double dy = point.y() - feature.parameters[1];
  const double along = c * dx + s * dy;
  const double across = -s * dx + c * dy;
  const double beyond =
      std::max({0.0, feature.extent_begin - along, along - feature.extent_end});
  return std::hypot(beyond, across);
}

}  // namespace

MapBuilder::MapBuilder(Graph* graph, const Registry& registry,
                       const MapBuilderOptions& options)
    : GraphBuilder(graph, registry), options_(options) {}

void MapBuilder::AddScan(const KeyScan& scan) {
  Place(scan);
  AddKeyScan(scan.index, scan.motion,
             ExtractSegments(scan.returns, scan.laser, scan.angle_step,
                             options_.extraction),
             scan.start);
}

void MapBuilder::AddKeyScan(int scan, const UncertainPose2& motion,
                            const std::vector<SegmentObservation>& observations,
                            const Pose2& start) {
  KeyScanRecord record =
      BeginScan(scan, motion, start, options_.link_radius,
                [this](const Feature& feature) {
                  return DistanceTo(feature, robot_.pose().head<2>());
                });

  // What may be seen: features near in the graph and within sight.
  std::vector<AssociationCandidate> candidates;
  const Eigen::Matrix3d widest = robot_.Widest();
  for (FeatureId id : Neighborhood(options_.association_depth)) {
    if (id == robot_.id() || record.is_loose) continue;
    const Feature& feature = graph_->GetFeature(id);
    if (feature.is_virtual) continue;
    AssociationCandidate candidate;
    candidate.feature = id;
    candidate.pose = PoseOf(feature);
    candidate.extent_begin = feature.extent_begin;
    candidate.extent_end = feature.extent_end;
    const auto link = robot_.links().find(id);
    candidate.robot_covariance =
        link != robot_.links().end() ? link->second : widest;
    candidates.push_back(candidate);
  }

  const auto associate = [&](const Pose2& pose) {
    return Associate(pose, observations, candidates, options_.association);
  };
  std::vector<Association> associations = associate(robot_.pose());
  CorrectRobot(
      candidates, associate,
      [&](const Eigen::Matrix3d& prior,
          const std::vector<Association>& recognized) {
        return LocalizeRobot(robot_.pose(), prior, observations, candidates,
                             recognized, options_.association);
      },
      &associations);

  std::vector<bool> used(observations.size(), false);
  for (const Association& association : associations) {
    const SegmentObservation& observation =
        observations[association.observation];
    used[association.observation] = true;
    FeatureMatch match;
    match.feature = candidates[association.candidate].feature;
    match.observation = observation;
    Feature& feature = graph_->GetFeature(match.feature);
    const Pose2 relative =
        Between(PoseOf(feature), Compose(robot_.pose(), observation.pose));
    feature.extent_begin =
        std::min(feature.extent_begin, relative[0] - 0.5 * observation.length);
    feature.extent_end =
        std::max(feature.extent_end, relative[0] + 0.5 * observation.length);
    ++feature.observations;
    ++num_matches_;
    record.matches.push_back(std::move(match));
  }
  SecondLook(record.matches);
  Grow(observations, used, &record);
  EndScan(std::move(record));
}

void MapBuilder::SecondLook(const std::vector<FeatureMatch>& matches) {
  // The feature's frame as seen from the robot: the observation's line, at the
  // feature's own place along it.
  std::map<FeatureId, UncertainPose2> seen;
  for (const FeatureMatch& match : matches) {
    const Pose2 feature = PoseOf(graph_->GetFeature(match.feature));
    const Pose2 observed = Compose(robot_.pose(), match.observation.pose);
    const double along = Between(observed, feature)[0];
    UncertainPose2 observation;
    observation.mean = match.observation.pose;
    observation.covariance =
        ObservationCovariance(match.observation, kUnknownAlong);
    UncertainPose2 shift;
    shift.mean = Pose2(along, 0.0, 0.0);
    const UncertainPose2 frame = Compose(observation, shift);
    const auto inserted = seen.emplace(match.feature, frame);
    if (!inserted.second &&
        frame.covariance(2, 2) < inserted.first->second.covariance(2, 2)) {
      inserted.first->second = frame;
    }
  }
  for (const auto& entry : seen) {
    for (ConstraintId id : graph_->ConstraintsOf(entry.first)) {
      const Constraint& constraint = graph_->GetConstraint(id);
      if (constraint.features[0] != entry.first ||
          constraint.features.size() != 2 ||
          constraint.kind != ConstraintClass::kMeasurement) {
        continue;
      }
      const auto other = seen.find(constraint.features[1]);
      if (other == seen.end()) continue;
      const UncertainPose2 relation =
          Compose(Inverse(entry.second), other->second);
      Eigen::Matrix3d information = options_.second_look_weight *
                                    Symmetric(relation.covariance.inverse());
      const Eigen::Matrix3d before = constraint.information;
      const double floor_position =
          options_.relation_floor_position * options_.relation_floor_position;
      const double floor_angle =
          options_.relation_floor_angle * options_.relation_floor_angle;
      // As much of the look as keeps within the floor.
      double share = 1.0;
      for (int row = 0; row < 3; ++row) {
        const double most = 1.0 / (row == 2 ? floor_angle : floor_position);
        if (information(row, row) > 0.0) {
          share = std::min(share,
                           (most - before(row, row)) / information(row, row));
        }
      }
      if (share <= 0.0) continue;
      information *= share;
      const Eigen::Matrix3d fused = Symmetric(before + information);
      Eigen::Vector3d difference = relation.mean - constraint.expected;
      difference[2] = NormalizeAngle(difference[2]);
      // Not the same walls, or badly seen: a relation does not jump.
      if (difference.dot(information * difference) > 9.0) continue;
      Eigen::Vector3d expected =
          constraint.expected + fused.inverse() * (information * difference);
      expected[2] = NormalizeAngle(expected[2]);
      graph_->UpdateConstraint(id, expected, fused);
    }
  }
}

std::size_t MapBuilder::PieceOf(
    const SegmentObservation& observation,
    const std::vector<SegmentObservation>& observations,
    const std::vector<int>& fresh,
    const std::vector<std::size_t>& owner) const {
  const std::size_t self = owner.size();
  for (std::size_t j = 0; j < self; ++j) {
    if (owner[j] != j) continue;
    const SegmentObservation& other = observations[fresh[j]];
    AssociationCandidate candidate;
    candidate.pose = other.pose;
    candidate.extent_begin = -0.5 * other.length;
    candidate.extent_end = 0.5 * other.length;
    // The other piece's own errors, its direction with the lever between the
    // two.
    const double lever = Between(other.pose, observation.pose).head<2>().norm();
    AssociationOptions options = options_.association;
    options.feature_offset_sigma = std::sqrt(
        other.covariance(0, 0) + lever * lever * other.covariance(1, 1));
    options.feature_angle_sigma = std::sqrt(other.covariance(1, 1));
    options.max_offset = options_.same_scan_offset;
    if (!Associate(Pose2::Zero(), {observation}, {candidate}, options)
             .empty()) {
      return j;
    }
  }
  return self;
}

void MapBuilder::Grow(const std::vector<SegmentObservation>& observations,
                      const std::vector<bool>& used, KeyScanRecord* record) {
  std::vector<int> fresh;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (!used[i]) fresh.push_back(static_cast<int>(i));
  }
  if (fresh.empty()) return;
  const FeatureType& segment_type = registry_.GetFeature("segment");
  const RelationType& relation = registry_.GetRelation("pose_pose");

  // The links that tell most about where the robot is.
  std::vector<std::pair<double, FeatureId>> anchors;
  for (const auto& link : robot_.links()) {
    const Eigen::Matrix3d& c = link.second;
    anchors.emplace_back(c(0, 0) + c(1, 1) + 9.0 * c(2, 2), link.first);
  }
  std::sort(anchors.begin(), anchors.end());
  if (static_cast<int>(anchors.size()) > options_.links_per_feature) {
    anchors.resize(options_.links_per_feature);
  }

  Transaction transaction;
  std::vector<FeatureId> provisional;
  // For each fresh observation the one whose feature it is: itself, mostly.
  std::vector<std::size_t> owner;
  // The first scan's best segment fixes the gauge.
  int gauge = -1;
  if (robot_.links().empty() && num_created_ == 0) {
    for (int index : fresh) {
      if (gauge < 0 ||
          observations[index].length > observations[gauge].length) {
        gauge = index;
      }
    }
  }
  for (std::size_t k = 0; k < fresh.size(); ++k) {
    const SegmentObservation& observation = observations[fresh[k]];
    const Pose2 pose = Compose(robot_.pose(), observation.pose);
    // Another piece of a wall that this scan has just made a feature of (there
    // is something in front of its middle).
    const std::size_t piece_of =
        PieceOf(observation, observations, fresh, owner);
    owner.push_back(piece_of);
    if (piece_of != k) {
      Feature& wall =
          transaction.added_features()[Transaction::ProvisionalIndex(
              provisional[piece_of])];
      // The gauge is that of the whole wall.
      wall.fixed = wall.fixed || fresh[k] == gauge;
      const Pose2 relative = Between(
          Pose2(wall.parameters[0], wall.parameters[1], wall.parameters[2]),
          pose);
      wall.extent_begin =
          std::min(wall.extent_begin, relative[0] - 0.5 * observation.length);
      wall.extent_end =
          std::max(wall.extent_end, relative[0] + 0.5 * observation.length);
      provisional.push_back(provisional[piece_of]);
      continue;
    }
    Feature feature;
    feature.type = &segment_type;
    feature.parameters = {pose[0], pose[1], pose[2]};
    feature.extent_begin = -0.5 * observation.length;
    feature.extent_end = 0.5 * observation.length;
    feature.observations = 1;
    feature.source = kSource;
    feature.fixed = fresh[k] == gauge;
    const FeatureId id = transaction.AddFeature(feature);
    const Eigen::Matrix3d observation_covariance =
        ObservationCovariance(observation, options_.along_sigma);

    // Relations to what the robot is linked to share the robot's error: each
    // gets its share of the information, so together they do not claim more
    // than one (covariance intersection).
    for (const auto& anchor : anchors) {
      const Eigen::Matrix3d& link = robot_.links().at(anchor.second);
      const Pose2 other = PoseOf(graph_->GetFeature(anchor.second));
      const Eigen::Matrix3d j1 =
          ComposeJacobianFirst(robot_.pose(), observation.pose);
      const Eigen::Matrix3d j2 = ComposeJacobianSecond(robot_.pose());
      const Eigen::Matrix3d covariance =
          j1 * link * j1.transpose() +
          j2 * observation_covariance * j2.transpose();
      Constraint constraint;
      constraint.type = &relation;
      constraint.features = std::vector<FeatureId>{anchor.second, id};
      constraint.expected = Between(other, pose);
      constraint.information =
          Symmetric(ToFrame(covariance, other[2]).inverse()) /
          static_cast<double>(anchors.size());
      constraint.source = kSource;
      transaction.AddConstraint(std::move(constraint));
    }
    // Relations within the scan have no robot in between.
    std::vector<std::pair<double, std::size_t>> neighbors;
    for (std::size_t j = 0; j < k; ++j) {
      if (owner[j] != j) continue;
      neighbors.emplace_back(
          (observations[fresh[j]].pose.head<2>() - observation.pose.head<2>())
              .norm(),
          j);
    }
    std::sort(neighbors.begin(), neighbors.end());
    if (static_cast<int>(neighbors.size()) > options_.links_within_scan) {
      neighbors.resize(options_.links_within_scan);
    }
    for (const auto& neighbor : neighbors) {
      const SegmentObservation& other = observations[fresh[neighbor.second]];
      const UncertainPose2 first{
          other.pose, ObservationCovariance(other, options_.along_sigma)};
      const UncertainPose2 second{observation.pose, observation_covariance};
      const UncertainPose2 between = Compose(Inverse(first), second);
      Constraint constraint;
      constraint.type = &relation;
      constraint.features =
          std::vector<FeatureId>{provisional[neighbor.second], id};
      constraint.expected = between.mean;
      constraint.information = Symmetric(between.covariance.inverse()) / 2.0;
      constraint.source = kSource;
      transaction.AddConstraint(std::move(constraint));
    }
    provisional.push_back(id);
  }
  const TransactionResult result = graph_->Apply(std::move(transaction));
  for (std::size_t k = 0; k < fresh.size(); ++k) {
    const SegmentObservation& observation = observations[fresh[k]];
    FeatureMatch match;
    match.feature =
        result.features[Transaction::ProvisionalIndex(provisional[k])];
    match.observation = observation;
    record->matches.push_back(std::move(match));
    if (owner[k] != k) continue;
    // The robot relative to the new feature: only the observation's error.
    const Eigen::Matrix3d j2 = ComposeJacobianSecond(robot_.pose());
    const Eigen::Matrix3d j1 =
        ComposeJacobianFirst(robot_.pose(), observation.pose);
    // r = f (-) o to first order: J1 dr = -J2 do.
    const Eigen::Matrix3d j = j1.inverse() * j2;
    robot_.Add(
        record->matches.back().feature,
        Symmetric(j * ObservationCovariance(observation, options_.along_sigma) *
                  j.transpose()));
    ++num_created_;
  }
}

void MapBuilder::WriteRobot() {
  const RelationType& relation = registry_.GetRelation("pose_pose");
  robot_.Write(registry_, kSource, [&](FeatureId robot) {
    std::vector<Constraint> constraints;
    for (const auto& link : robot_.links()) {
      const Pose2 other = PoseOf(graph_->GetFeature(link.first));
      Constraint constraint;
      constraint.type = &relation;
      constraint.features = std::vector<FeatureId>{link.first, robot};
      constraint.expected = Between(other, robot_.pose());
      constraint.information =
          Symmetric(ToFrame(link.second, other[2]).inverse()) /
          static_cast<double>(robot_.links().size());
      constraint.source = kSource;
      constraints.push_back(std::move(constraint));
    }
    return constraints;
  });
}

}  // namespace plumbline
