#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/bags/bag_sources.h>
#include <plumbline/frontend/bags/topic_choice.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <utility>

namespace plumbline {
namespace {

constexpr double kNanoseconds = 1e9;  // in a second
// Between the time stamps of two sources and the times at which their messages
// were recorded the delays differ by less, s, or their clocks do.
constexpr double kClockDifference = 0.5;

// A clock that goes back by more, s, was set back; where scans and odometry
// agree on by how much to that, one clock was. More often than this nobody does
// it.
constexpr double kSetBack = 1.0;
constexpr std::size_t kMostSetBack = 10;
// Messages of a topic that are recorded after those of another though they were
// sent before.
constexpr std::size_t kUnderWay = 2;

template <typename T>
T MedianOf(std::vector<T> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// By how much messages are recorded later than they are stamped, ns. Times for
// which nobody sets a stamp say nothing: they are all the same.
template <typename Raw>
bool DelayOf(const std::vector<Raw>& messages, std::int64_t* delay) {
  std::vector<std::int64_t> delays;
  std::size_t standing = 0;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    delays.push_back(messages[i].received - messages[i].stamp);
    if (i > 0 && messages[i].stamp == messages[i - 1].stamp) ++standing;
  }
  if (delays.empty() || 2 * standing > messages.size() ||
      (messages.size() == 1 && messages[0].stamp == 0)) {
    return false;
  }
  *delay = MedianOf(std::move(delays));
  return true;
}

// Where a clock was set back: the messages before which it was, and by how much
// they are earlier than the one before, ns.
struct SetBack {
  std::size_t index = 0;
  std::int64_t by = 0;
};
template <typename Raw>
std::vector<SetBack> SetBacksOf(const std::vector<Raw>& messages) {
  std::vector<SetBack> found;
  for (std::size_t i = 1; i < messages.size(); ++i) {
    const std::int64_t by = messages[i - 1].stamp - messages[i].stamp;
    if (static_cast<double>(by) > kSetBack * kNanoseconds) {
      found.push_back({i, by});
    }
  }
  return found;
}

// Whether two clocks were set back at one place in the bag, but for messages
// that were under way. A recording that is played in a circle goes back by
// another time for each topic, since none has its first and last message at
// the very ends.
template <typename One, typename Other>
bool IsAtOnePlace(const std::vector<One>& ones, std::size_t one,
                  const std::vector<Other>& others, std::size_t other) {
  const auto begin = [](const auto& messages, std::size_t index) {
    return messages[index - std::min(index, kUnderWay + 1)].position;
  };
  const auto end = [](const auto& messages, std::size_t index) {
    return messages[std::min(index + kUnderWay, messages.size() - 1)].position;
  };
  return begin(ones, one) <= end(others, other) &&
         begin(others, other) <= end(ones, one);
}

// Adds to the times after the clock was set back what it was set back by.
template <typename Raw, typename Add>
void LetTimesGoOn(const std::vector<SetBack>& places,
                  const std::vector<std::int64_t>& by,
                  std::vector<Raw>* messages, const Add& add) {
  std::int64_t sum = 0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < messages->size(); ++i) {
    while (next < places.size() && places[next].index == i) sum += by[next++];
    add(sum, &(*messages)[i]);
  }
}

// Whether poses are not all the same.
bool Moves(const std::vector<BagPose>& poses) {
  return std::any_of(poses.begin(), poses.end(), [&](const BagPose& pose) {
    return pose.pose != poses.front().pose;
  });
}

class SourceChooser {
 public:
  SourceChooser(const std::string& name, const LaserOptions& options,
                BagMessages* messages, Log* log)
      : name_(name), options_(options), messages_(messages), log_(log) {}

  BagSources Choose() {
    ChooseScans();
    ChooseOdometry();
    UseClock();
    return std::move(sources_);
  }

 private:
  [[noreturn]] void Refuse(const std::string& what,
                           const std::string& expected) const {
    throw Error(name_, 0, what, expected);
  }

  void ChooseScans() {
    const std::string candidates = messages_->ListOf(BagTopicKind::kScan);
    if (!options_.scan_topic.empty()) {
      const auto named = std::find_if(
          messages_->topics.begin(), messages_->topics.end(),
          [&](const BagTopic& t) { return IsNamed(t, options_.scan_topic); });
      if (named == messages_->topics.end() ||
          KindOf(*named) != BagTopicKind::kScan) {
        Refuse((named == messages_->topics.end()
                    ? "has no topic " + options_.scan_topic
                    : "has messages of type " + named->type + " on " +
                          options_.scan_topic) +
                   "; it has " + messages_->Contents(),
               candidates.empty() ? "a bag with sensor_msgs/LaserScan or "
                                    "MultiEchoLaserScan"
                                  : "--scan_topic with one of " + candidates);
      }
    }
    const std::vector<std::size_t> topics = ScanTopicsThatMayBeMeant(messages_);
    if (topics.empty()) {
      Refuse("has no laser scan that can be used; it has " +
                 messages_->Contents() + messages_->Losses(),
             "messages of type sensor_msgs/LaserScan or MultiEchoLaserScan");
    }
    if (topics.size() > 1) {
      for (const std::size_t topic : topics) {
        messages_->streams[topic].seen.why_not = "several topics have scans";
      }
      Refuse("has laser scans on several topics: " + candidates,
             "--scan_topic with one of them");
    }
    BagStream& stream = messages_->streams[topics[0]];
    stream.seen.use = "scans";
    log_->scan_message = stream.seen.name;
    messages_->scans = std::move(stream.scans);
    messages_->ChooseTree(stream.seen.name);
    for (BagStream& other : messages_->streams) {
      other.scans = {};
      if (other.kind != BagTopicKind::kScan || &other == &stream ||
          other.seen.messages == 0) {
        continue;
      }
      if (other.seen.why_not.empty()) {
        other.seen.why_not = "another topic was chosen";
      } else {
        log_->notes.push_back("scans of " + other.seen.name +
                              " are not used: " + other.seen.why_not);
      }
    }
    NoteEnds(messages_->scans);
  }

  void NoteEnds(const BagScanSet& scans) {
    if (scans.other_ends == 0) return;
    char text[200];
    std::snprintf(text, sizeof text,
                  "%lld scans end at another angle than they say, the first at "
                  "%.2f degrees by angle_increment and at %.2f by angle_max: "
                  "angle_increment is believed (--laser_step says another)",
                  static_cast<long long>(scans.other_ends),
                  RadToDeg(scans.end_by_step), RadToDeg(scans.stated_end));
    log_->notes.push_back(text);
  }

  void ChooseOdometry() {
    const std::string& wanted = options_.odometry_topic;
    std::vector<std::size_t> candidates;
    for (std::size_t i = 0; i < messages_->streams.size(); ++i) {
      BagStream& stream = messages_->streams[i];
      if (stream.kind != BagTopicKind::kOdometry || stream.poses.empty()) {
        continue;
      }
      // What never moves says nothing; another source may.
      if (wanted.empty() && !Moves(stream.poses)) {
        stream.seen.why_not = "it never changes";
        log_->notes.push_back(stream.seen.name +
                              " never changes: it is taken for none");
        standing_base_ = stream.child_frame;
        continue;
      }
      candidates.push_back(i);
    }
    const std::string list = messages_->ListOf(BagTopicKind::kOdometry);
    if (wanted == "none") return;
    if (!wanted.empty() && wanted != "tf") {
      const auto named =
          std::find_if(messages_->topics.begin(), messages_->topics.end(),
                       [&](const BagTopic& t) { return IsNamed(t, wanted); });
      if (named == messages_->topics.end() ||
          KindOf(*named) != BagTopicKind::kOdometry || candidates.empty()) {
        Refuse((named == messages_->topics.end() ? "has no topic " + wanted
                : KindOf(*named) != BagTopicKind::kOdometry
                    ? "has messages of type " + named->type + " on " + wanted
                    : "has no odometry that can be used on " + wanted) +
                   "; it has " + messages_->Contents() + messages_->Losses(),
               "--odometry_topic with " +
                   (list.empty() ? std::string("tf or none")
                                 : "one of " + list + ", tf or none"));
      }
    }
    FindTransform();
    if (wanted.empty()) {
      const std::vector<std::size_t> all = candidates;
      candidates = OdometryTopicsThatMayBeMeant(all, log_->scan_message,
                                                transforms_, messages_);
      if (candidates.size() < 2) {
        for (const std::size_t i : all) {
          const LogTopic& seen = messages_->streams[i].seen;
          if (seen.why_not.empty()) continue;
          log_->notes.push_back("odometry of " + seen.name +
                                " is not used: " + seen.why_not);
        }
      }
    }
    if (wanted != "tf" && candidates.size() > 1) {
      for (const std::size_t i : candidates) {
        messages_->streams[i].seen.why_not = "several topics have odometry";
      }
      Refuse("has odometry on several topics: " + list,
             "--odometry_topic with one of them, tf or none");
    }
    if (wanted != "tf" && candidates.size() == 1) {
      transforms_.clear();
      odometry_ = &messages_->streams[candidates[0]];
      odometry_->seen.use = "odometry";
      log_->odometry_source = odometry_->seen.name;
      sources_.base = odometry_->child_frame;
      return;
    }
    ChooseTransform();
    if (sources_.base.empty()) sources_.base = standing_base_;
  }

  bool IsOdometryOf(const std::string& parent, const std::string& child) const {
    std::string low = parent;
    std::transform(low.begin(), low.end(), low.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    return low.find("odom") != std::string::npos &&
           messages_->tree.IsMoving(child);
  }

  // The frames from the laser to the root, odom -> base -> ... -> laser, and
  // where odometry ties in. If tf does not know the laser, as where nobody
  // recorded what stands still, the only robot that there is will be its.
  void FindTransform() {
    std::vector<std::string> chain =
        messages_->tree.ChainOf(messages_->scans.frames[0]);
    if (chain.size() == 1) {
      std::vector<std::string> robots;
      for (const std::string& frame : messages_->tree.Frames()) {
        const std::vector<std::string> above = messages_->tree.ChainOf(frame);
        if (IsOdometryOf(above[1], frame)) robots.push_back(frame);
      }
      if (robots.size() != 1) return;
      chain = messages_->tree.ChainOf(robots[0]);
    }
    for (std::size_t i = 1; i < chain.size(); ++i) {
      if (!IsOdometryOf(chain[i], chain[i - 1])) continue;
      transform_frame_ = chain[i];
      transform_base_ = chain[i - 1];
      for (const TransformTree::Sample& sample :
           *messages_->tree.SamplesOf(chain[i - 1])) {
        transforms_.push_back({sample.time, sample.received,
                               PoseInPlane(sample.pose), sample.position});
      }
      // In the order of the bag, as topics are.
      std::stable_sort(transforms_.begin(), transforms_.end(),
                       [](const BagPose& a, const BagPose& b) {
                         return a.position < b.position;
                       });
      return;
    }
  }

  void ChooseTransform() {
    if (!transforms_.empty()) {
      sources_.base = transform_base_;
      log_->odometry_source =
          "tf " + transform_frame_ + " -> " + transform_base_;
      messages_->NoteTransformsUsed("odometry");
      return;
    }
    if (options_.odometry_topic == "tf") {
      Refuse(
          "has no transform of a moving robot in a frame called odom above "
          "the laser's frame '" +
              messages_->scans.frames[0] + "'; tf has " +
              (messages_->tree.empty() ? "nothing"
                                       : messages_->tree.Describe()),
          "such a transform, or --odometry_topic=none");
    }
  }

  // Which times count, and by how much the other sources' may differ.
  void UseClock() {
    std::int64_t delay = 0;
    const bool is_stamped = DelayOf(messages_->scans.list, &delay);
    if (!is_stamped) {
      log_->notes.push_back(
          "scans have no time stamps of their own: the times "
          "at which they were recorded are used");
      for (BagScan& scan : messages_->scans.list) scan.stamp = scan.received;
    }
    const auto align = [&](const std::string& topic, auto* messages) {
      std::int64_t own = 0;
      if (!DelayOf(*messages, &own)) {
        for (auto& message : *messages) message.stamp = message.received;
        own = 0;
        log_->notes.push_back(topic +
                              " has no time stamps of its own: the times at "
                              "which it was recorded are used");
        if (!is_stamped) return;
      }
      // From its clock to the scans'.
      std::int64_t difference = 0;
      if (__builtin_sub_overflow(own, is_stamped ? delay : 0, &difference)) {
        return;
      }
      if (std::abs(static_cast<double>(difference)) <
          kClockDifference * kNanoseconds) {
        return;
      }
      sources_.clock_difference = difference;
    };
    if (!is_stamped) sources_.recording_delay = TimeBetweenScans();
    if (odometry_ != nullptr) {
      align(odometry_->seen.name, &odometry_->poses);
      LetTimesGoOnWhereBothWereSetBack(&odometry_->poses);
      sources_.motion.SetPoses(std::move(odometry_->poses));
    } else if (!transforms_.empty()) {
      align(log_->odometry_source, &transforms_);
      LetTimesGoOnWhereBothWereSetBack(&transforms_);
      sources_.motion.SetPoses(std::move(transforms_));
    } else {
      TakeYawRates(align);
    }
    for (BagStream& stream : messages_->streams) stream.poses = {};
  }

  // The median, ns; 0 where there is none.
  std::int64_t TimeBetweenScans() const {
    std::vector<std::int64_t> steps;
    for (std::size_t i = 1; i < messages_->scans.list.size(); ++i) {
      steps.push_back(messages_->scans.list[i].stamp -
                      messages_->scans.list[i - 1].stamp);
    }
    return steps.empty() ? 0 : MedianOf(std::move(steps));
  }

  // One clock stamps scans and odometry and was set back: a time that came
  // twice is another one for both.
  void LetTimesGoOnWhereBothWereSetBack(std::vector<BagPose>* all_poses) {
    std::vector<BagScan>& scans = messages_->scans.list;
    std::vector<BagPose>& poses = *all_poses;
    const std::vector<SetBack> of_scans = SetBacksOf(scans);
    const std::vector<SetBack> of_poses = SetBacksOf(poses);
    if (of_scans.empty() || of_scans.size() > kMostSetBack ||
        of_scans.size() != of_poses.size()) {
      return;
    }
    std::vector<std::int64_t> steps;
    for (std::size_t i = 1; i < poses.size(); ++i) {
      steps.push_back(poses[i].stamp - poses[i - 1].stamp);
    }
    const std::int64_t step = MedianOf(std::move(steps));
    std::vector<std::int64_t> by;
    double sum = 0.0;
    for (std::size_t k = 0; k < of_scans.size(); ++k) {
      const auto of_one = static_cast<double>(of_scans[k].by);
      const auto of_other = static_cast<double>(of_poses[k].by);
      if (std::abs(of_one - of_other) > kSetBack * kNanoseconds &&
          !IsAtOnePlace(scans, of_scans[k].index, poses, of_poses[k].index)) {
        return;
      }
      by.push_back(std::max(of_scans[k].by, of_poses[k].by) +
                   std::max<std::int64_t>(step, 0));
      sum += std::max(of_one, of_other) + static_cast<double>(step);
    }
    // Of damaged stamps the sums might not fit their type.
    if (sum > static_cast<double>(kMostTime) / 4.0) return;
    LetTimesGoOn(of_poses, by, &poses, [](std::int64_t more, BagPose* pose) {
      pose->stamp = std::min(pose->stamp + more, kMostTime);
    });
    LetTimesGoOn(of_scans, by, &scans, [](std::int64_t more, BagScan* scan) {
      scan->set_back = std::min(more, kMostTime - scan->stamp);
      scan->stamp += scan->set_back;
    });
    char text[120];
    std::snprintf(text, sizeof text,
                  "the clock was set back by %.3f s in all: odometry is that "
                  "of the same time",
                  sum / kNanoseconds);
    log_->notes.push_back(text);
  }

  template <typename Align>
  void TakeYawRates(const Align& align) {
    BagStream* const chosen = ChooseImu(messages_);
    if (chosen == nullptr) return;
    align(chosen->seen.name, &chosen->rates);
    std::stable_sort(chosen->rates.begin(), chosen->rates.end(),
                     [](const BagTurnRate& a, const BagTurnRate& b) {
                       return a.stamp < b.stamp;
                     });
    for (const BagTurnRate& rate : chosen->rates) {
      log_->yaw_rates.push_back({SecondsOf(rate.stamp), rate.rate});
    }
    chosen->seen.use = "turn rates";
    log_->yaw_rate_source = chosen->seen.name;
  }

  const std::string& name_;
  const LaserOptions& options_;
  BagMessages* messages_;
  Log* log_;
  // The topic of the odometry; null when there is none.
  BagStream* odometry_ = nullptr;
  // Odometry that comes as a transform.
  std::vector<BagPose> transforms_;
  // Its frame and the robot's.
  std::string transform_frame_;
  std::string transform_base_;
  // The robot's frame by odometry that never changes.
  std::string standing_base_;
  BagSources sources_;
};

}  // namespace

void BagMotion::SetPoses(std::vector<BagPose> poses) {
  poses_ = std::move(poses);
  std::stable_sort(
      poses_.begin(), poses_.end(),
      [](const BagPose& a, const BagPose& b) { return a.stamp < b.stamp; });
}

void BagMotion::MoveBy(std::int64_t difference) {
  for (BagPose& pose : poses_) {
    // Of damaged messages the sum may be too large.
    if (__builtin_add_overflow(pose.stamp, difference, &pose.stamp)) {
      pose.stamp = pose.received;
    }
    pose.stamp = std::clamp(pose.stamp, -kMostTime, kMostTime);
  }
  SetPoses(std::move(poses_));
}

Pose2 BagMotion::At(std::int64_t time) const {
  if (poses_.empty()) return Pose2::Zero();
  const auto after = std::upper_bound(
      poses_.begin(), poses_.end(), time,
      [](std::int64_t t, const BagPose& pose) { return t < pose.stamp; });
  if (after == poses_.begin()) return poses_.front().pose;
  const BagPose& before = *(after - 1);
  if (after == poses_.end() || before.stamp == time) return before.pose;
  const double share = static_cast<double>(time - before.stamp) /
                       static_cast<double>(after->stamp - before.stamp);
  Pose2 difference = after->pose - before.pose;
  difference[2] = NormalizeAngle(difference[2]);
  Pose2 pose = before.pose + share * difference;
  pose[2] = NormalizeAngle(pose[2]);
  return pose;
}

std::int64_t BagMotion::DistanceTo(std::int64_t time) const {
  if (poses_.empty()) return 0;
  const auto after = std::lower_bound(
      poses_.begin(), poses_.end(), time,
      [](const BagPose& pose, std::int64_t t) { return pose.stamp < t; });
  std::int64_t distance = -1;
  if (after != poses_.end() && after != poses_.begin() &&
      after->pose == (after - 1)->pose) {
    return 0;
  }
  if (after != poses_.end()) distance = after->stamp - time;
  if (after != poses_.begin()) {
    const std::int64_t back = time - (after - 1)->stamp;
    if (distance < 0 || back < distance) distance = back;
  }
  return distance;
}

BagSources ChooseBagSources(const std::string& name,
                            const LaserOptions& options, BagMessages* messages,
                            Log* log) {
  return SourceChooser(name, options, messages, log).Choose();
}

}  // namespace plumbline
