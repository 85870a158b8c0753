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

// Makes features of what a scan sees that the map does not have yet: bound to
// what the robot is linked to, and to each other.
class Growth {
 public:
  // All must outlive it. `fixes_gauge`: the best segment becomes fixed.
  Growth(const Graph& graph, const Registry& registry, const RobotLinks& robot,
         const MapBuilderOptions& options,
         std::vector<const SegmentObservation*> fresh, bool fixes_gauge)
      : graph_(graph),
        segment_(registry.GetFeature("segment")),
        relation_(registry.GetRelation("pose_pose")),
        robot_(robot),
        options_(options),
        fresh_(std::move(fresh)),
        gauge_(fixes_gauge ? Longest() : fresh_.size()),
        anchors_(BestLinks()) {}

  Transaction Run() {
    for (std::size_t k = 0; k < fresh_.size(); ++k) {
      const SegmentObservation& observation = *fresh_[k];
      const Pose2 pose = Compose(robot_.pose(), observation.pose);
      // Another piece of a wall that this scan has just made a feature of
      // (there is something in front of its middle).
      owner_.push_back(PieceOf(observation));
      if (owner_[k] != k) {
        Extend(pose, k);
        continue;
      }
      const FeatureId id = AddWall(pose, k);
      BindToMap(observation, pose, id);
      BindWithinScan(k, id);
    }
    return std::move(transaction_);
  }

  std::size_t size() const { return fresh_.size(); }
  const SegmentObservation& observation(std::size_t k) const {
    return *fresh_[k];
  }
  // Index among the added features.
  std::size_t FeatureOf(std::size_t k) const {
    return Transaction::ProvisionalIndex(ids_[k]);
  }
  // Whether the feature was made of this observation, not just extended by it.
  bool IsOwner(std::size_t k) const { return owner_[k] == k; }

 private:
  std::size_t Longest() const {
    std::size_t longest = 0;
    for (std::size_t k = 1; k < fresh_.size(); ++k) {
      if (fresh_[k]->length > fresh_[longest]->length) longest = k;
    }
    return longest;
  }

  // The links that tell most about where the robot is.
  std::vector<FeatureId> BestLinks() const {
    std::vector<std::pair<double, FeatureId>> links;
    for (const auto& [id, c] : robot_.links()) {
      links.emplace_back(c(0, 0) + c(1, 1) + 9.0 * c(2, 2), id);
    }
    std::sort(links.begin(), links.end());
    if (static_cast<int>(links.size()) > options_.links_per_feature) {
      links.resize(options_.links_per_feature);
    }
    std::vector<FeatureId> best;
    for (const auto& link : links) best.push_back(link.second);
    return best;
  }

  // The observation before it, an owner, that it is a piece of the same wall
  // with; its own place when there is none.
  std::size_t PieceOf(const SegmentObservation& observation) const {
    const std::size_t self = owner_.size();
    for (std::size_t j = 0; j < self; ++j) {
      if (owner_[j] != j) continue;
      const SegmentObservation& other = *fresh_[j];
      AssociationCandidate candidate;
      candidate.pose = other.pose;
      candidate.extent_begin = -0.5 * other.length;
      candidate.extent_end = 0.5 * other.length;
      // The other piece's own errors, its direction with the lever between the
      // two.
      const double lever =
          Between(other.pose, observation.pose).head<2>().norm();
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

  // Makes the wall that the k-th is a piece of longer.
  void Extend(const Pose2& pose, std::size_t k) {
    const FeatureId id = ids_[owner_[k]];
    Feature& wall =
        transaction_.added_features()[Transaction::ProvisionalIndex(id)];
    // The gauge is that of the whole wall.
    wall.fixed = wall.fixed || k == gauge_;
    const Pose2 relative = Between(PoseOf(wall), pose);
    const double half = 0.5 * fresh_[k]->length;
    wall.extent_begin = std::min(wall.extent_begin, relative[0] - half);
    wall.extent_end = std::max(wall.extent_end, relative[0] + half);
    ids_.push_back(id);
  }

  FeatureId AddWall(const Pose2& pose, std::size_t k) {
    Feature wall;
    wall.type = &segment_;
    wall.parameters = {pose[0], pose[1], pose[2]};
    wall.extent_begin = -0.5 * fresh_[k]->length;
    wall.extent_end = 0.5 * fresh_[k]->length;
    wall.observations = 1;
    wall.source = kSource;
    wall.fixed = k == gauge_;
    ids_.push_back(transaction_.AddFeature(std::move(wall)));
    return ids_.back();
  }

  // Relations to what the robot is linked to share the robot's error: each gets
  // its share of the information, so together they do not claim more than one
  // (covariance intersection).
  void BindToMap(const SegmentObservation& observation, const Pose2& pose,
                 FeatureId id) {
    const Eigen::Matrix3d of_observation =
        ObservationCovariance(observation, options_.along_sigma);
    const Eigen::Matrix3d j1 =
        ComposeJacobianFirst(robot_.pose(), observation.pose);
    const Eigen::Matrix3d j2 = ComposeJacobianSecond(robot_.pose());
    for (const FeatureId anchor : anchors_) {
      const Pose2 other = PoseOf(graph_.GetFeature(anchor));
      const Eigen::Matrix3d covariance =
          j1 * robot_.links().at(anchor) * j1.transpose() +
          j2 * of_observation * j2.transpose();
      transaction_.AddConstraint(
          MakeMeasurement(relation_, {anchor, id}, Between(other, pose),
                          Symmetric(ToFrame(covariance, other[2]).inverse()) /
                              static_cast<double>(anchors_.size()),
                          kSource));
    }
  }

  // Relations within the scan have no robot in between.
  void BindWithinScan(std::size_t k, FeatureId id) {
    const SegmentObservation& observation = *fresh_[k];
    std::vector<std::pair<double, std::size_t>> neighbors;
    for (std::size_t j = 0; j < k; ++j) {
      if (owner_[j] != j) continue;
      neighbors.emplace_back(
          (fresh_[j]->pose.head<2>() - observation.pose.head<2>()).norm(), j);
    }
    std::sort(neighbors.begin(), neighbors.end());
    if (static_cast<int>(neighbors.size()) > options_.links_within_scan) {
      neighbors.resize(options_.links_within_scan);
    }
    const UncertainPose2 second{
        observation.pose,
        ObservationCovariance(observation, options_.along_sigma)};
    for (const auto& neighbor : neighbors) {
      const SegmentObservation& other = *fresh_[neighbor.second];
      const UncertainPose2 first{
          other.pose, ObservationCovariance(other, options_.along_sigma)};
      const UncertainPose2 between = Compose(Inverse(first), second);
      transaction_.AddConstraint(MakeMeasurement(
          relation_, {ids_[neighbor.second], id}, between.mean,
          Symmetric(between.covariance.inverse()) / 2.0, kSource));
    }
  }

  const Graph& graph_;
  const FeatureType& segment_;
  const RelationType& relation_;
  const RobotLinks& robot_;
  const MapBuilderOptions& options_;
  std::vector<const SegmentObservation*> fresh_;
  // Among the observations; their number when nothing is to be fixed.
  std::size_t gauge_;
  std::vector<FeatureId> anchors_;
  Transaction transaction_;
  // By observation: the provisional id of its feature, and the observation that
  // the feature was made of: itself, mostly.
  std::vector<FeatureId> ids_;
  std::vector<std::size_t> owner_;
};

}  // namespace

MapBuilder::MapBuilder(Graph* graph, const Registry& registry,
                       const MapBuilderOptions& options)
    : GraphBuilder(graph, registry), options_(options) {}

void MapBuilder::AddScan(const KeyScan& scan) {
  Place(scan);
  SegmentExtractionOptions extraction = options_.extraction;
  extraction.ScaleToNoise(scan.noise_scale);
  AddKeyScan(
      scan.index, scan.motion,
      ExtractSegments(scan.returns, scan.laser, scan.angle_step, extraction),
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

void MapBuilder::Grow(const std::vector<SegmentObservation>& observations,
                      const std::vector<bool>& used, KeyScanRecord* record) {
  std::vector<const SegmentObservation*> fresh;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (!used[i]) fresh.push_back(&observations[i]);
  }
  if (fresh.empty()) return;
  // The first scan's best segment fixes the gauge.
  const bool is_first = robot_.links().empty() && num_created_ == 0;
  Growth growth(*graph_, registry_, robot_, options_, std::move(fresh),
                is_first);
  const TransactionResult result = graph_->Apply(growth.Run());
  for (std::size_t k = 0; k < growth.size(); ++k) {
    const SegmentObservation& observation = growth.observation(k);
    FeatureMatch match;
    match.feature = result.features[growth.FeatureOf(k)];
    match.observation = observation;
    record->matches.push_back(std::move(match));
    if (!growth.IsOwner(k)) continue;
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
      constraints.push_back(MakeMeasurement(
          relation, {link.first, robot}, Between(other, robot_.pose()),
          Symmetric(ToFrame(link.second, other[2]).inverse()) /
              static_cast<double>(robot_.links().size()),
          kSource));
    }
    return constraints;
  });
}

}  // namespace plumbline
