#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/pose_relaxation.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr int kNone = PoseSighting::kNone;

bool IsMeasurement(const Constraint& constraint) {
  return constraint.state == ConstraintState::kLive &&
         constraint.kind == ConstraintClass::kMeasurement &&
         !constraint.information.isZero(0.0);
}

class Guess {
 public:
  Guess(InitialGuessMethod method, Graph* graph)
      : method_(method), graph_(graph) {
    const auto size = static_cast<std::size_t>(graph->feature_id_end());
    pose_of_.assign(size, kNone);
    landmark_of_.assign(size, kNone);
    is_placed_.assign(size, false);
    FindPoses();
    FindSightings();
    FindRoots();
  }

  InitialGuessReport Make() {
    GrowTrees();
    PlaceLandmarks();
    if (method_ == InitialGuessMethod::kChordal) RelaxPoses(&network_);
    WritePoses();
    PlaceOthers();
    for (const Feature* feature : std::as_const(*graph_).Features()) {
      if (!feature->is_virtual && !feature->fixed &&
          !is_placed_[static_cast<std::size_t>(feature->id)]) {
        ++report_.kept;
      }
    }
    return report_;
  }

 private:
  static std::size_t At(int i) { return static_cast<std::size_t>(i); }
  int& PoseOf(FeatureId id) { return pose_of_[static_cast<std::size_t>(id)]; }
  int& LandmarkOf(FeatureId id) {
    return landmark_of_[static_cast<std::size_t>(id)];
  }

  void FindPoses() {
    for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
      if (!IsMeasurement(*constraint) ||
          !constraint->type->Is(RelationRole::kPose)) {
        continue;
      }
      for (const FeatureId id : constraint->features) PoseOf(id) = 0;
    }
    for (Feature* feature : graph_->MutableFeatures()) {
      if (PoseOf(feature->id) == kNone) continue;
      PoseOf(feature->id) = static_cast<int>(network_.poses.size());
      features_.push_back(feature);
      network_.poses.emplace_back(feature->parameters[0],
                                  feature->parameters[1],
                                  feature->parameters[2]);
    }
    links_.resize(network_.poses.size());
  }

  void FindSightings() {
    for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
      if (!IsMeasurement(*constraint)) continue;
      const std::vector<FeatureId>& ids = constraint->features;
      if (constraint->type->Is(RelationRole::kPose)) {
        const int index = static_cast<int>(network_.pose_sightings.size());
        network_.pose_sightings.push_back(
            {constraint->id, ids.size() == 1 ? kNone : PoseOf(ids[0]),
             PoseOf(ids.back()), constraint->expected,
             constraint->information});
        for (const FeatureId id : ids) {
          links_[At(PoseOf(id))].push_back(index);
        }
      } else if (constraint->type->Is(RelationRole::kPosition) &&
                 PoseOf(ids[0]) != kNone && PoseOf(ids[1]) == kNone) {
        if (LandmarkOf(ids[1]) == kNone) {
          LandmarkOf(ids[1]) = static_cast<int>(landmarks_.size());
          landmarks_.push_back(graph_->FindFeature(ids[1]));
          network_.is_known_landmark.push_back(landmarks_.back()->fixed);
        }
        network_.position_sightings.push_back(
            {PoseOf(ids[0]), LandmarkOf(ids[1]), constraint->expected,
             constraint->information});
      }
    }
  }

  // Fixed poses; in a part without, the lowest one with a prior; else the
  // lowest. What holds landmarks holds no heading, so they are no roots, and
  // parts are those that poses alone make.
  void FindRoots() {
    DisjointSets parts(network_.poses.size());
    std::vector<int> priors(network_.poses.size(), kNone);
    for (std::size_t i = 0; i < network_.pose_sightings.size(); ++i) {
      const PoseSighting& sighting = network_.pose_sightings[i];
      if (sighting.first == kNone) {
        int& prior = priors[At(sighting.second)];
        if (prior == kNone) prior = static_cast<int>(i);
      } else {
        parts.Join(At(sighting.first), At(sighting.second));
      }
    }
    network_.is_known_pose.resize(network_.poses.size());
    std::vector<bool> has_fixed(network_.poses.size(), false);
    std::vector<int> prior_pose(network_.poses.size(), kNone);
    for (std::size_t i = 0; i < network_.poses.size(); ++i) {
      const std::size_t part = parts.Find(i);
      network_.is_known_pose[i] = features_[i]->fixed;
      if (network_.is_known_pose[i]) has_fixed[part] = true;
      if (priors[i] != kNone && prior_pose[part] == kNone) {
        prior_pose[part] = static_cast<int>(i);
      }
    }
    is_root_ = network_.is_known_pose;
    for (std::size_t i = 0; i < network_.poses.size(); ++i) {
      if (parts.Find(i) != i) continue;
      ++report_.parts;
      if (has_fixed[i]) continue;
      if (prior_pose[i] == kNone) {
        is_root_[i] = network_.is_known_pose[i] = true;
      } else {
        // Free in the linear problems, where the prior holds it.
        is_root_[At(prior_pose[i])] = true;
        network_.poses[At(prior_pose[i])] =
            network_.pose_sightings[At(priors[At(prior_pose[i])])].value;
      }
    }
  }

  // What it costs to go over a relation.
  double StepCost(const PoseSighting& sighting) const {
    if (method_ == InitialGuessMethod::kOdometry) {
      return std::abs(sighting.first - sighting.second);
    }
    // Never zero, so that of equals the shorter way is taken.
    return 1.0 / std::max(sighting.information(2, 2),
                          std::numeric_limits<double>::min());
  }

  void GrowTrees() {
    const bool adds_up = method_ != InitialGuessMethod::kOdometry;
    // Cost, relation, pose to place and the one to place it from.
    using Step = std::tuple<double, ConstraintId, int, int, int>;
    std::priority_queue<Step, std::vector<Step>, std::greater<Step>> steps;
    std::vector<bool> is_done(network_.poses.size(), false);
    const auto leave = [&](int pose, double cost) {
      is_done[At(pose)] = true;
      for (const int index : links_[At(pose)]) {
        const PoseSighting& sighting = network_.pose_sightings[At(index)];
        if (sighting.first == kNone) continue;
        const int other =
            sighting.first == pose ? sighting.second : sighting.first;
        if (is_done[At(other)]) continue;
        steps.emplace((adds_up ? cost : 0.0) + StepCost(sighting), sighting.id,
                      index, other, pose);
      }
    };
    for (std::size_t i = 0; i < network_.poses.size(); ++i) {
      if (is_root_[i]) leave(static_cast<int>(i), 0.0);
    }
    while (!steps.empty()) {
      const auto [cost, id, index, to, from] = steps.top();
      steps.pop();
      if (is_done[At(to)]) continue;
      const PoseSighting& sighting = network_.pose_sightings[At(index)];
      network_.poses[At(to)] = Compose(
          network_.poses[At(from)],
          sighting.first == from ? sighting.value : Inverse(sighting.value));
      leave(to, cost);
    }
  }

  // Landmarks at the mean of where the poses see them.
  void PlaceLandmarks() {
    network_.landmarks.assign(landmarks_.size(), Eigen::Vector2d::Zero());
    std::vector<int> counts(landmarks_.size(), 0);
    for (const PositionSighting& sighting : network_.position_sightings) {
      network_.landmarks[At(sighting.landmark)] +=
          TransformPoint(network_.poses[At(sighting.pose)], sighting.value);
      ++counts[At(sighting.landmark)];
    }
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      if (landmarks_[i]->fixed) {
        network_.landmarks[i] = {landmarks_[i]->parameters[0],
                                 landmarks_[i]->parameters[1]};
      } else {
        network_.landmarks[i] /= counts[i];
      }
    }
  }

  static void CheckFinite(const Feature& feature, bool is_finite) {
    if (is_finite) return;
    throw PLUMBLINE_ERROR("the start of " + feature.type->name + " " +
                              std::to_string(feature.id) + " is not finite",
                          "measurements within the range of numbers");
  }

  void WritePoses() {
    for (std::size_t i = 0; i < network_.poses.size(); ++i) {
      CheckFinite(*features_[i], network_.poses[i].allFinite());
    }
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      CheckFinite(*landmarks_[i], network_.landmarks[i].allFinite());
    }
    for (std::size_t i = 0; i < network_.poses.size(); ++i) {
      Feature& feature = *features_[i];
      is_placed_[static_cast<std::size_t>(feature.id)] = true;
      if (feature.fixed) continue;
      ++report_.poses;
      feature.parameters[0] = network_.poses[i][0];
      feature.parameters[1] = network_.poses[i][1];
      feature.parameters[2] = NormalizeAngle(network_.poses[i][2]);
    }
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      Feature& feature = *landmarks_[i];
      is_placed_[static_cast<std::size_t>(feature.id)] = true;
      if (feature.fixed) continue;
      ++report_.landmarks;
      feature.parameters[0] = network_.landmarks[i][0];
      feature.parameters[1] = network_.landmarks[i][1];
    }
  }

  // What is seen otherwise: from the first relation that can tell.
  void PlaceOthers() {
    for (bool has_placed = true; has_placed;) {
      has_placed = false;
      for (const Constraint* constraint :
           std::as_const(*graph_).Constraints()) {
        if (!IsMeasurement(*constraint) || !constraint->type->place_second) {
          continue;
        }
        const Feature& first = *graph_->FindFeature(constraint->features[0]);
        Feature& second = *graph_->FindFeature(constraint->features[1]);
        if (second.fixed || second.is_virtual ||
            is_placed_[static_cast<std::size_t>(second.id)] ||
            !(first.fixed || is_placed_[static_cast<std::size_t>(first.id)])) {
          continue;
        }
        constraint->type->place_second(constraint->expected, first, &second);
        is_placed_[static_cast<std::size_t>(second.id)] = true;
        ++report_.landmarks;
        has_placed = true;
      }
    }
  }

  const InitialGuessMethod method_;
  Graph* const graph_;
  InitialGuessReport report_;
  // By feature id: place among the poses, or the landmarks; kNone.
  std::vector<int> pose_of_;
  std::vector<int> landmark_of_;
  std::vector<bool> is_placed_;
  // Poses and landmarks of the network, the poses in the order of ids.
  std::vector<Feature*> features_;
  std::vector<Feature*> landmarks_;
  PoseNetwork network_;
  // Where trees begin.
  std::vector<bool> is_root_;
  // Places among the pose sightings by pose.
  std::vector<std::vector<int>> links_;
};

}  // namespace

InitialGuessReport MakeInitialGuess(const InitialGuessOptions& options,
                                    Graph* graph) {
  if (options.method == InitialGuessMethod::kFile) return {};
  return Guess(options.method, graph).Make();
}

}  // namespace plumbline
