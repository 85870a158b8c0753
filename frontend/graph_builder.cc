#include <plumbline/frontend/graph_builder.h>

namespace plumbline {

KeyScanRecord GraphBuilder::BeginScan(
    int scan, const UncertainPose2& motion, const Pose2& start,
    double link_radius, const std::function<double(const Feature&)>& distance) {
  KeyScanRecord record;
  record.scan = scan;
  if (records_.empty()) {
    robot_.set_pose(start);
  } else {
    record.motion = motion;
    robot_.Predict(motion);
    robot_.Cut(link_radius, distance);
  }
  return record;
}

}  // namespace plumbline
