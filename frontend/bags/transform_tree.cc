#include <plumbline/frontend/bags/transform_tree.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace plumbline {
namespace {

// Nothing stands farther from anything, m.
constexpr double kAbsurdCoordinate = 1e7;
// A longer chain is a circle.
constexpr std::size_t kLongestChain = 100;
constexpr std::size_t kMostFrames = 10000;
constexpr std::size_t kMostDescribed = 10;

bool IsSame(const Pose3& a, const Pose3& b) {
  return a.translation == b.translation &&
         a.rotation.coeffs() == b.rotation.coeffs();
}

}  // namespace

Pose3 Compose(const Pose3& a, const Pose3& b) {
  return {a.rotation * b.rotation, a.rotation * b.translation + a.translation};
}

Pose3 Inverse(const Pose3& pose) {
  const Eigen::Quaterniond back = pose.rotation.conjugate();
  return {back, -(back * pose.translation)};
}

Pose3 Interpolate(const Pose3& a, const Pose3& b, double share) {
  return {a.rotation.slerp(share, b.rotation),
          (1.0 - share) * a.translation + share * b.translation};
}

bool ToPose3(const Pose3Message& message, Pose3* pose) {
  pose->translation = {message.x, message.y, message.z};
  pose->rotation =
      Eigen::Quaterniond(message.qw, message.qx, message.qy, message.qz);
  const double norm = pose->rotation.norm();
  if (!(std::abs(norm - 1.0) <= 0.01) || !pose->translation.allFinite() ||
      pose->translation.cwiseAbs().maxCoeff() > kAbsurdCoordinate) {
    return false;
  }
  pose->rotation.coeffs() /= norm;
  return true;
}

std::string PlainFrameName(const std::string& frame) {
  return frame.substr(std::min(frame.find_first_not_of('/'), frame.size()));
}

bool TransformTree::Add(const TransformMessage& message, std::int64_t received,
                        int position, bool is_static) {
  const std::int64_t time = message.header.stamp;
  const std::string child = PlainFrameName(message.child_frame);
  const std::string parent = PlainFrameName(message.header.frame);
  Pose3 pose;
  if (child.empty() || parent.empty() || child == parent ||
      !ToPose3(message.transform, &pose)) {
    return false;
  }
  if (edges_.size() >= kMostFrames && edges_.count(child) == 0) return false;
  Edge& edge = edges_[child];
  if (edge.samples.empty()) {
    edge.parent = parent;
    edge.is_static = is_static;
  } else if (edge.parent != parent) {
    return false;
  }
  std::vector<Sample>& samples = edge.samples;
  if (edge.is_static) {
    // Said again, perhaps better: the last word holds.
    samples.assign(1, {time, received, position, pose});
    return true;
  }
  // Of what stands still the ends are enough.
  const std::size_t n = samples.size();
  if (n >= 2 && time >= samples[n - 1].time &&
      IsSame(samples[n - 1].pose, pose) && IsSame(samples[n - 2].pose, pose)) {
    samples.back().time = time;
    samples.back().received = received;
    samples.back().position = position;
  } else {
    samples.push_back({time, received, position, pose});
  }
  return true;
}

void TransformTree::AddFrames(const TransformTree& other) {
  edges_.insert(other.edges_.begin(), other.edges_.end());
}

void TransformTree::Sort() {
  for (auto& [child, edge] : edges_) {
    std::stable_sort(
        edge.samples.begin(), edge.samples.end(),
        [](const Sample& a, const Sample& b) { return a.time < b.time; });
  }
}

std::vector<std::string> TransformTree::Frames() const {
  std::vector<std::string> frames;
  for (const auto& [child, edge] : edges_) frames.push_back(child);
  return frames;
}

std::vector<std::string> TransformTree::ChainOf(
    const std::string& frame) const {
  std::vector<std::string> chain = {PlainFrameName(frame)};
  while (chain.size() < kLongestChain) {
    const auto edge = edges_.find(chain.back());
    if (edge == edges_.end() ||
        std::count(chain.begin(), chain.end(), edge->second.parent) > 0) {
      break;
    }
    chain.push_back(edge->second.parent);
  }
  return chain;
}

Pose3 TransformTree::At(const Edge& edge, std::int64_t time) {
  const std::vector<Sample>& samples = edge.samples;
  const auto after = std::upper_bound(
      samples.begin(), samples.end(), time,
      [](std::int64_t t, const Sample& sample) { return t < sample.time; });
  if (after == samples.begin()) return samples.front().pose;
  if (after == samples.end()) return samples.back().pose;
  const Sample& before = *(after - 1);
  return Interpolate(before.pose, after->pose,
                     static_cast<double>(time - before.time) /
                         static_cast<double>(after->time - before.time));
}

bool TransformTree::Lookup(const std::string& ancestor,
                           const std::string& frame, std::int64_t time,
                           Pose3* pose) const {
  const std::string wanted = PlainFrameName(ancestor);
  *pose = Pose3();
  for (const std::string& name : ChainOf(frame)) {
    if (name == wanted) return true;
    const auto edge = edges_.find(name);
    if (edge == edges_.end()) return false;
    *pose = Compose(At(edge->second, time), *pose);
  }
  return false;
}

bool TransformTree::LookupAnyWay(const std::string& reference,
                                 const std::string& frame, std::int64_t time,
                                 Pose3* pose) const {
  const std::vector<std::string> chain = ChainOf(frame);
  for (const std::string& name : ChainOf(reference)) {
    if (std::find(chain.begin(), chain.end(), name) == chain.end()) continue;
    Pose3 of_reference;
    Pose3 of_frame;
    if (!Lookup(name, reference, time, &of_reference) ||
        !Lookup(name, frame, time, &of_frame)) {
      return false;
    }
    *pose = Compose(Inverse(of_reference), of_frame);
    return true;
  }
  return false;
}

bool TransformTree::IsMoving(const std::string& frame) const {
  const auto edge = edges_.find(PlainFrameName(frame));
  if (edge == edges_.end()) return false;
  const std::vector<Sample>& samples = edge->second.samples;
  return std::any_of(samples.begin(), samples.end(), [&](const Sample& sample) {
    return !IsSame(sample.pose, samples.front().pose);
  });
}

const std::vector<TransformTree::Sample>* TransformTree::SamplesOf(
    const std::string& frame) const {
  const auto edge = edges_.find(PlainFrameName(frame));
  return edge == edges_.end() ? nullptr : &edge->second.samples;
}

std::string TransformTree::Describe() const {
  std::set<std::string> parents;
  for (const auto& [child, edge] : edges_) parents.insert(edge.parent);
  std::string text;
  std::size_t count = 0;
  for (const auto& [child, edge] : edges_) {
    if (parents.count(child) > 0) continue;
    if (++count > kMostDescribed) break;
    std::string way;
    for (const std::string& name : ChainOf(child)) {
      way = way.empty() ? name : name + " -> " + way;
    }
    text += (text.empty() ? "" : ", ") + way;
  }
  if (count > kMostDescribed) text += ", ...";
  return text;
}

}  // namespace plumbline
