#include <plumbline/frontend/robot_links.h>

#include <Eigen/LU>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

namespace plumbline {
namespace {

Eigen::Matrix3d Symmetric(const Eigen::Matrix3d& m) {
  return 0.5 * (m + m.transpose());
}

}  // namespace

void RobotLinks::Predict(const UncertainPose2& motion) {
  const Eigen::Matrix3d j1 = ComposeJacobianFirst(pose_, motion.mean);
  const Eigen::Matrix3d j2 = ComposeJacobianSecond(pose_);
  const Eigen::Matrix3d added = j2 * motion.covariance * j2.transpose();
  pose_ = Compose(pose_, motion.mean);
  for (auto& link : links_) {
    Eigen::Matrix3d& covariance = link.second;
    covariance = Symmetric(j1 * covariance * j1.transpose() + added);
  }
}

void RobotLinks::Cut(double radius,
                     const std::function<double(const Feature&)>& distance) {
  FeatureId best = kNoId;
  double smallest = std::numeric_limits<double>::infinity();
  for (const auto& link : links_) {
    const double trace = link.second.trace();
    if (graph_->FindFeature(link.first) != nullptr && trace < smallest) {
      smallest = trace;
      best = link.first;
    }
  }
  std::vector<FeatureId> far;
  for (const auto& link : links_) {
    const Feature* feature = graph_->FindFeature(link.first);
    if (feature == nullptr || distance(*feature) > radius) {
      far.push_back(link.first);
    }
  }
  const bool keep_best = far.size() == links_.size();
  for (const FeatureId id : far) {
    if (keep_best && id == best) continue;
    links_.erase(id);
  }
}

void RobotLinks::Correct(const Pose2& pose, const Eigen::Matrix3d& information,
                         const std::vector<FeatureId>& seen) {
  const Eigen::Matrix3d widest = Widest();
  pose_ = pose;
  for (auto& link : links_) {
    Eigen::Matrix3d& covariance = link.second;
    covariance = Symmetric((covariance.inverse() + information).inverse());
  }
  for (const FeatureId id : seen) {
    if (links_.count(id) > 0) continue;
    links_.emplace(id, Symmetric((widest.inverse() + information).inverse()));
  }
}

Eigen::Matrix3d RobotLinks::Widest() const {
  Eigen::Matrix3d widest = Eigen::Matrix3d::Zero();
  for (const auto& link : links_) {
    if (link.second.trace() > widest.trace()) widest = link.second;
  }
  return widest;
}

Eigen::Matrix3d RobotLinks::Tightest() const {
  Eigen::Matrix3d tightest = Eigen::Matrix3d::Identity() * 1e6;
  for (const auto& link : links_) {
    if (link.second.trace() < tightest.trace()) tightest = link.second;
  }
  return tightest;
}

std::vector<FeatureId> RobotLinks::Neighborhood(int depth) const {
  std::vector<FeatureId> ids;
  std::vector<bool> is_in(static_cast<std::size_t>(graph_->feature_id_end()),
                          false);
  const auto add = [&](FeatureId id) {
    if (is_in[static_cast<std::size_t>(id)]) return;
    is_in[static_cast<std::size_t>(id)] = true;
    ids.push_back(id);
  };
  for (const auto& link : links_) add(link.first);
  // Those of the depth before.
  std::size_t begin = 0;
  for (int d = 2; d <= depth; ++d) {
    const std::size_t end = ids.size();
    for (std::size_t i = begin; i < end; ++i) {
      for (const ConstraintId cid : graph_->ConstraintsOf(ids[i])) {
        const Constraint& constraint = graph_->GetConstraint(cid);
        if (constraint.kind != ConstraintClass::kMeasurement) continue;
        for (const FeatureId other : constraint.features) {
          if (other != id_) add(other);
        }
      }
    }
    begin = end;
  }
  if (id_ != kNoId) add(id_);
  std::sort(ids.begin(), ids.end());
  return ids;
}

void RobotLinks::Write(
    const Registry& registry, const std::string& source,
    const std::function<std::vector<Constraint>(FeatureId)>& constraints) {
  Transaction transaction;
  FeatureId robot = id_;
  if (robot == kNoId) {
    Feature feature;
    feature.type = &registry.GetFeature("pose");
    feature.source = source;
    feature.parameters = {pose_[0], pose_[1], pose_[2]};
    robot = transaction.AddFeature(feature);
  } else {
    for (ConstraintId id : graph_->ConstraintsOf(id_)) {
      transaction.RemoveConstraint(id);
    }
    Feature& feature = graph_->GetFeature(id_);
    feature.parameters = {pose_[0], pose_[1], pose_[2]};
  }
  for (Constraint& constraint : constraints(robot)) {
    transaction.AddConstraint(std::move(constraint));
  }
  const TransactionResult result = graph_->Apply(std::move(transaction));
  if (id_ == kNoId) id_ = result.features.front();
}

void RobotLinks::Read() {
  if (id_ == kNoId) return;
  const Feature& feature = graph_->GetFeature(id_);
  pose_ = Pose2(feature.parameters[0], feature.parameters[1],
                NormalizeAngle(feature.parameters[2]));
}

void RobotLinks::WriteState(StateWriter* state) const {
  RobotLinks copy = *this;
  ExchangeAll(*state, copy.pose_, copy.id_, copy.links_);
}

void RobotLinks::ReadState(StateReader* state) {
  ExchangeAll(*state, pose_, id_, links_);
}

}  // namespace plumbline
