#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/bag_sources.h>
#include <plumbline/frontend/bags/topic_choice.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <iterator>

namespace plumbline {
namespace {

// cos of the angle by which a laser's plane may be out of level.
const double kLevel = std::cos(DegToRad(20.0));
// Times at which it is looked up where a laser is, and poses are compared.
constexpr std::size_t kMostLookedAt = 200;
// Share of the scans of a topic whose stamps another has as well, and of its
// messages that one has at least that is as good.
constexpr double kSameScans = 0.9;
// A pose is that of tf within this, m and rad, at times that a topic has poses
// within, ns; for so many, and this share of them.
constexpr double kSamePlace = 0.02;
const double kSameHeading = DegToRad(1.0);
constexpr std::int64_t kNearPose = 200000000;
constexpr std::size_t kFewestPoses = 10;
constexpr double kSamePoses = 0.9;

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::size_t StrideOf(std::size_t count) {
  return std::max<std::size_t>(1, count / kMostLookedAt);
}

enum class Attitude { kUnknown, kLevel, kTilted };

// Of a frame against the highest one above it.
Attitude AttitudeAt(const std::string& frame, std::int64_t time,
                    const TransformTree& tree) {
  const std::vector<std::string> chain = tree.ChainOf(frame);
  Pose3 pose;
  if (chain.size() < 2 || !tree.Lookup(chain.back(), frame, time, &pose)) {
    return Attitude::kUnknown;
  }
  return std::abs(pose.rotation.toRotationMatrix()(2, 2)) < kLevel
             ? Attitude::kTilted
             : Attitude::kLevel;
}

// Whether a laser looks level all the time: one that is tilted up and down
// does now and then.
Attitude AttitudeOf(const BagScanSet& set, const TransformTree& tree) {
  for (std::size_t i = 0; i < set.list.size(); i += StrideOf(set.list.size())) {
    const BagScan& scan = set.list[i];
    const Attitude attitude =
        AttitudeAt(set.frames[scan.frame], scan.stamp, tree);
    if (attitude != Attitude::kLevel) return attitude;
  }
  return Attitude::kLevel;
}

bool IsCalledVertical(const BagStream& stream) {
  return Lower(stream.seen.name).find("vertical") != std::string::npos ||
         std::any_of(stream.scans.frames.begin(), stream.scans.frames.end(),
                     [](const std::string& frame) {
                       return Lower(frame).find("vertical") !=
                              std::string::npos;
                     });
}

// Ascending, each once.
std::vector<std::int64_t> StampsOf(const BagScanSet& set) {
  std::vector<std::int64_t> stamps;
  stamps.reserve(set.list.size());
  for (const BagScan& scan : set.list) stamps.push_back(scan.stamp);
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  return stamps;
}

// Whether one of two topics has the scans of the other, as a filter makes them.
// Stamps that nobody sets tell nothing.
bool AreOfOneLaser(const BagScanSet& a, const BagScanSet& b) {
  if (a.frames != b.frames || a.frames.size() != 1) return false;
  const std::vector<std::int64_t> of_a = StampsOf(a);
  const std::vector<std::int64_t> of_b = StampsOf(b);
  const std::size_t fewer = std::min(of_a.size(), of_b.size());
  if (2 * of_a.size() < a.list.size() || 2 * of_b.size() < b.list.size() ||
      (fewer == 1 && of_a.front() == 0)) {
    return false;
  }
  std::vector<std::int64_t> both;
  std::set_intersection(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(),
                        std::back_inserter(both));
  return static_cast<double>(both.size()) >=
         kSameScans * static_cast<double>(fewer);
}

std::int64_t ReturnsOf(const BagScanSet& set) {
  std::int64_t count = 0;
  for (const BagScan& scan : set.list) {
    for (const float range : scan.message.ranges) {
      if (range > 0.0f && range < scan.message.range_max) ++count;
    }
  }
  return count;
}

// Takes out what `is_out` says, with a reason, unless nothing would be left.
template <typename IsOut>
void LeaveOut(const IsOut& is_out, const std::string& why,
              std::vector<std::size_t>* topics, BagMessages* messages) {
  std::vector<std::size_t> left;
  std::vector<std::size_t> out;
  for (const std::size_t topic : *topics) {
    (is_out(topic) ? out : left).push_back(topic);
  }
  if (left.empty()) return;
  for (const std::size_t topic : out) {
    messages->streams[topic].seen.why_not = why;
  }
  *topics = std::move(left);
}

// Whether the poses of a topic are those of a transform.
bool IsTransform(const std::vector<BagPose>& poses,
                 const std::vector<BagPose>& transform) {
  BagMotion motion;
  motion.SetPoses(poses);
  std::size_t compared = 0;
  std::size_t same = 0;
  for (std::size_t i = 0; i < transform.size();
       i += StrideOf(transform.size())) {
    const BagPose& pose = transform[i];
    if (motion.DistanceTo(pose.stamp) > kNearPose) continue;
    ++compared;
    const Pose2 apart = motion.At(pose.stamp) - pose.pose;
    if (std::hypot(apart[0], apart[1]) <= kSamePlace &&
        std::abs(NormalizeAngle(apart[2])) <= kSameHeading) {
      ++same;
    }
  }
  return compared >= kFewestPoses &&
         static_cast<double>(same) >=
             kSamePoses * static_cast<double>(compared);
}

}  // namespace

std::vector<std::size_t> ScanTopicsThatMayBeMeant(BagMessages* messages) {
  std::vector<std::size_t> topics;
  for (std::size_t i = 0; i < messages->streams.size(); ++i) {
    if (!messages->streams[i].scans.list.empty()) topics.push_back(i);
  }
  if (topics.size() < 2) return topics;
  std::vector<Attitude> attitudes(messages->streams.size());
  for (const std::size_t topic : topics) {
    attitudes[topic] =
        AttitudeOf(messages->streams[topic].scans,
                   messages->TreeOf(messages->streams[topic].seen.name));
  }
  LeaveOut([&](std::size_t t) { return attitudes[t] == Attitude::kTilted; },
           "its laser is tilted by more than 20 degrees", &topics, messages);
  LeaveOut(
      [&](std::size_t t) {
        return attitudes[t] == Attitude::kUnknown &&
               IsCalledVertical(messages->streams[t]);
      },
      "it is called vertical", &topics, messages);
  // The best of a laser first.
  std::vector<std::int64_t> returns(messages->streams.size());
  std::size_t most = 0;
  for (const std::size_t topic : topics) {
    returns[topic] = ReturnsOf(messages->streams[topic].scans);
    most = std::max(most, messages->streams[topic].scans.list.size());
  }
  std::vector<std::size_t> order = topics;
  const auto has_most = [&](std::size_t t) {
    return static_cast<double>(messages->streams[t].scans.list.size()) >=
           kSameScans * static_cast<double>(most);
  };
  std::stable_sort(
      order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return has_most(a) != has_most(b) ? has_most(a)
                                          : returns[a] > returns[b];
      });
  std::vector<std::size_t> kept;
  for (const std::size_t topic : order) {
    BagStream& stream = messages->streams[topic];
    const auto same =
        std::find_if(kept.begin(), kept.end(), [&](std::size_t other) {
          return AreOfOneLaser(messages->streams[other].scans, stream.scans);
        });
    if (same == kept.end()) {
      kept.push_back(topic);
    } else {
      stream.seen.why_not =
          "it has the scans of " + messages->streams[*same].seen.name;
    }
  }
  return kept;
}

std::vector<std::size_t> OdometryTopicsThatMayBeMeant(
    const std::vector<std::size_t>& topics, const std::string& scan_topic,
    const std::vector<BagPose>& transform, BagMessages* messages) {
  std::vector<std::size_t> left = topics;
  const auto is_in_map = [&](std::size_t t) {
    return messages->streams[t].frame == "map";
  };
  const std::string why = "its poses are in the frame 'map'";
  if (!transform.empty() && std::all_of(left.begin(), left.end(), is_in_map)) {
    for (const std::size_t t : left) messages->streams[t].seen.why_not = why;
    return {};
  }
  LeaveOut(is_in_map, why, &left, messages);
  const std::string space = NamespaceOf(scan_topic);
  if (!space.empty()) {
    LeaveOut(
        [&](std::size_t t) {
          return NamespaceOf(messages->streams[t].seen.name)
                     .compare(0, space.size(), space) != 0;
        },
        "it is of another namespace than the scans", &left, messages);
  }
  if (left.size() < 2 || transform.empty()) return left;
  std::vector<std::size_t> same;
  for (const std::size_t topic : left) {
    if (IsTransform(messages->streams[topic].poses, transform)) {
      same.push_back(topic);
    }
  }
  if (same.empty()) return left;
  // What is the same twice is the same.
  const std::size_t best = *std::max_element(
      same.begin(), same.end(), [&](std::size_t a, std::size_t b) {
        return messages->streams[a].poses.size() <
               messages->streams[b].poses.size();
      });
  for (const std::size_t topic : left) {
    if (topic == best) continue;
    messages->streams[topic].seen.why_not =
        "tf has the poses of " + messages->streams[best].seen.name;
  }
  return {best};
}

BagStream* ChooseImu(BagMessages* messages) {
  BagStream* chosen = nullptr;
  bool is_chosen_tilted = false;
  for (BagStream& stream : messages->streams) {
    if (stream.kind != BagTopicKind::kImu || stream.rates.empty()) continue;
    const bool is_tilted = AttitudeAt(stream.frame, stream.rates.front().stamp,
                                      messages->tree) == Attitude::kTilted;
    const bool is_better =
        chosen == nullptr || (is_tilted != is_chosen_tilted
                                  ? is_chosen_tilted
                                  : stream.rates.size() > chosen->rates.size());
    BagStream* const other = is_better ? chosen : &stream;
    if (other != nullptr) {
      other->seen.why_not = is_tilted != is_chosen_tilted
                                ? "it is tilted, and another is not"
                                : "another has more messages";
    }
    if (!is_better) continue;
    chosen = &stream;
    is_chosen_tilted = is_tilted;
  }
  return chosen;
}

}  // namespace plumbline
