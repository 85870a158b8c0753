#include <plumbline/core/error.h>
#include <plumbline/frontend/frontend_state.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/relocalization.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Records to either side that help to find the one that the robot goes on from.
constexpr int kNeighbors = 3;

// How well the robot is known there against what it saw, m and rad.
constexpr double kPlacedPosition = 0.05;
constexpr double kPlacedHeading = DegToRad(1.0);

std::vector<FeatureId> SeenFeatures(const KeyScanRecord& record) {
  std::vector<FeatureId> ids;
  for (const FeatureMatch& match : record.matches) ids.push_back(match.feature);
  for (const PointMatch& match : record.points) ids.push_back(match.feature);
  return ids;
}

}  // namespace

void GraphBuilder::Place(const KeyScan& scan) {
  from_ = -1;
  is_loose_ = scan.is_loose;
  if (scan.since < 0) return;
  const auto found =
      std::lower_bound(records_.begin(), records_.end(), scan.since,
                       [](const KeyScanRecord& record, int index) {
                         return record.scan < index;
                       });
  if (found == records_.end() || found->scan != scan.since) {
    throw PLUMBLINE_ERROR("motion since scan " + std::to_string(scan.since) +
                              ", which is not in the map",
                          "a key scan that was added");
  }
  const int from = static_cast<int>(found - records_.begin());
  int begin = from;
  while (begin > std::max(0, from - kNeighbors) &&
         FollowsTheOneBefore(records_[begin])) {
    --begin;
  }
  int end = from + 1;
  while (end < std::min(static_cast<int>(records_.size()),
                        from + kNeighbors + 1) &&
         FollowsTheOneBefore(records_[end])) {
    ++end;
  }
  std::vector<KeyScanRecord> near(records_.begin() + begin,
                                  records_.begin() + end);
  near.front().from = -1;
  std::set<FeatureId> seen;
  for (int k = std::max(begin, from - 1); k < std::min(end, from + 2); ++k) {
    for (const FeatureId id : SeenFeatures(records_[k])) {
      if (graph_->FindFeature(id) != nullptr) seen.insert(id);
    }
  }
  from_ = from;
  const Pose2 pose = RelocalizeKeyScans(*graph_, near, {})[from - begin];
  robot_.set_pose(pose);
  if (seen.empty()) return;
  const Eigen::Matrix3d covariance =
      Eigen::Vector3d(kPlacedPosition * kPlacedPosition,
                      kPlacedPosition * kPlacedPosition,
                      kPlacedHeading * kPlacedHeading)
          .asDiagonal();
  robot_.ClearLinks();
  for (const FeatureId id : seen) robot_.Add(id, covariance);
}

void GraphBuilder::EndScan(KeyScanRecord record) {
  record.pose = robot_.pose();
  if (record.is_loose) {
    RobotLinks::Links links;
    for (const FeatureId id : SeenFeatures(record)) {
      const auto link = robot_.links().find(id);
      if (link != robot_.links().end()) links.insert(*link);
    }
    if (!links.empty()) {
      robot_.ClearLinks();
      for (const auto& link : links) robot_.Add(link.first, link.second);
    }
  }
  records_.push_back(std::move(record));
}

KeyScanRecord GraphBuilder::BeginScan(
    int scan, const UncertainPose2& motion, const Pose2& start,
    double link_radius, const std::function<double(const Feature&)>& distance) {
  KeyScanRecord record;
  record.scan = scan;
  if (records_.empty()) {
    robot_.set_pose(start);
  } else {
    record.motion = motion;
    record.from = from_;
    record.is_loose = is_loose_;
    from_ = -1;
    is_loose_ = false;
    robot_.Predict(motion);
    robot_.Cut(link_radius, distance);
  }
  return record;
}

void GraphBuilder::WriteState(StateWriter* state) const {
  robot_.WriteState(state);
  std::vector<KeyScanRecord> records = records_;
  std::int64_t num_matches = num_matches_;
  std::int64_t num_created = num_created_;
  ExchangeAll(*state, records, num_matches, num_created);
}

void GraphBuilder::ReadState(StateReader* state) {
  robot_.ReadState(state);
  ExchangeAll(*state, records_, num_matches_, num_created_);
}

}  // namespace plumbline
