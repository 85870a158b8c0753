#include <plumbline/apps/evaluation/trajectory_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/utf8.h>
#include <plumbline/frontend/bags/bag_source.h>
#include <plumbline/frontend/bags/mcap.h>
#include <plumbline/frontend/bags/rosbag1.h>
#include <plumbline/frontend/bags/rosbag2.h>
#include <plumbline/frontend/eight_numbers.h>
#include <plumbline/frontend/input_stream.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string_view>

namespace plumbline {
namespace {

constexpr char kTumLine[] = "eight numbers, timestamp x y z qx qy qz qw";
constexpr char kKittiLine[] = "twelve numbers, the rows of a matrix [R t]";
constexpr char kFormats[] =
    "a trajectory: TUM (eight numbers a line), KITTI (twelve), or a ROS bag";
// Digits that files of rotations leave out.
constexpr double kRotationTolerance = 1e-3;

std::vector<std::string_view> Fields(std::string_view line) {
  constexpr char kBlanks[] = " \t\r";
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t begin = line.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos) return fields;
    line.remove_prefix(begin);
    fields.push_back(line.substr(0, line.find_first_of(kBlanks)));
    line.remove_prefix(fields.back().size());
  }
}

// Fields of the first line that has any and is no comment.
std::size_t FieldsOfFirstLine(std::string_view prefix) {
  while (!prefix.empty()) {
    const std::size_t end = prefix.find('\n');
    const std::vector<std::string_view> fields = Fields(prefix.substr(0, end));
    if (!fields.empty() && fields[0][0] != '#') return fields.size();
    if (end == std::string_view::npos) break;
    prefix.remove_prefix(end + 1);
  }
  return 0;
}

void ReadTumPoses(InputStream* input, TrajectoryFile* file) {
  std::string_view line;
  std::array<double, 8> row;
  std::string unused;
  while (input->ReadLine(&line)) {
    if (!ParseEightNumbers(*input, line, kTumLine, &row, &unused)) continue;
    TimedPose3 timed;
    timed.timestamp = row[0];
    timed.pose.translation = {row[1], row[2], row[3]};
    timed.pose.rotation = Eigen::Quaterniond(row[7], row[4], row[5], row[6]);
    if (std::abs(timed.pose.rotation.squaredNorm() - 1.0) > 0.02) {
      throw Error(input->name(), input->line_number(),
                  "quaternion is not of unit length", kTumLine);
    }
    timed.pose.rotation.normalize();
    file->poses.push_back(timed);
  }
}

void ReadKittiPoses(InputStream* input, TrajectoryFile* file) {
  const auto fail = [input](const std::string& what) {
    throw Error(input->name(), input->line_number(), what, kKittiLine);
  };
  std::string_view line;
  while (input->ReadLine(&line)) {
    const std::vector<std::string_view> fields = Fields(line);
    if (fields.empty() || fields[0][0] == '#') continue;
    if (fields.size() != 12) fail(std::to_string(fields.size()) + " fields");
    Eigen::Matrix<double, 3, 4> matrix;
    for (int i = 0; i < 12; ++i) {
      const std::string_view text = fields[static_cast<std::size_t>(i)];
      double& number = matrix(i / 4, i % 4);
      if (!ParseNumber(text, &number) || !std::isfinite(number)) {
        fail("'" + PrintableUtf8(text.substr(0, 40)) + "' is no finite number");
      }
      if (std::abs(number) > kAbsurdNumber) {
        fail("'" + PrintableUtf8(text.substr(0, 40)) + "' is absurd");
      }
    }
    const Eigen::Matrix3d rotation = matrix.leftCols<3>();
    const double off =
        (rotation * rotation.transpose() - Eigen::Matrix3d::Identity())
            .cwiseAbs()
            .maxCoeff();
    if (!(off <= kRotationTolerance) || rotation.determinant() < 0.0) {
      fail("the matrix is no rotation");
    }
    TimedPose3 timed;
    timed.timestamp = static_cast<double>(file->poses.size());
    timed.pose.translation = matrix.col(3);
    timed.pose.rotation = Eigen::Quaterniond(rotation).normalized();
    file->poses.push_back(timed);
  }
}

enum class PoseKind { kNone, kOdometry, kPose, kTransforms };

PoseKind KindOf(const BagTopic& topic) {
  if (topic.type == "nav_msgs/Odometry") return PoseKind::kOdometry;
  if (topic.type == "geometry_msgs/PoseStamped" ||
      topic.type == "geometry_msgs/PoseWithCovarianceStamped") {
    return PoseKind::kPose;
  }
  if (topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage") {
    return PoseKind::kTransforms;
  }
  return PoseKind::kNone;
}

double Seconds(std::int64_t nanoseconds) {
  return static_cast<double>(static_cast<long double>(nanoseconds) / 1e9L);
}

// The trajectories of a bag.
class BagTrajectories {
 public:
  BagTrajectories(BagSource* source, std::string topic)
      : source_(source), topic_(std::move(topic)) {
    if (topic_.compare(0, 3, "tf:") == 0) {
      const std::size_t dot = topic_.find('.', 3);
      if (dot == std::string::npos || dot == 3 || dot + 1 == topic_.size()) {
        throw Error("'" + topic_ + "'", 0, "names no two frames",
                    "tf:PARENT.CHILD, as in tf:map.base_link");
      }
      parent_ = PlainFrameName(topic_.substr(3, dot - 3));
      child_ = PlainFrameName(topic_.substr(dot + 1));
    }
  }

  void Read(TrajectoryFile* file) {
    source_->SetWanted([this](const BagTopic& topic) {
      const PoseKind kind = KindOf(topic);
      return WantsTransforms()
                 ? kind == PoseKind::kTransforms
                 : kind == PoseKind::kOdometry || kind == PoseKind::kPose;
    });
    BagMessage message;
    while (source_->Next(&message)) Take(message);
    for (const SkipReport& skip : source_->skipped()) {
      file->notes.push_back(std::to_string(skip.count) +
                            " passed over: " + skip.reason);
    }
    if (unusable_ > 0) {
      file->notes.push_back(std::to_string(unusable_) +
                            " passed over: messages that are no poses");
    }
    if (WantsTransforms()) {
      LookUpTransforms(file);
    } else {
      ChooseTopic(file);
    }
  }

 private:
  bool WantsTransforms() const { return !child_.empty(); }

  void Take(const BagMessage& message) {
    const BagTopic& topic = source_->topics()[message.topic];
    ++counts_[message.topic];
    const PoseKind kind = KindOf(topic);
    if (kind == PoseKind::kNone || message.data.empty()) return;
    std::string why;
    if (kind == PoseKind::kTransforms) {
      if (!WantsTransforms()) return;
      std::vector<TransformMessage> transforms;
      if (!DecodeTransforms(message.data, topic.encoding, &transforms, &why)) {
        ++unusable_;
        return;
      }
      const bool is_static = topic.name.find("tf_static") != std::string::npos;
      for (const TransformMessage& transform : transforms) {
        const std::int64_t time = transform.header.stamp;
        if (!tree_.Add(transform, message.time, 0, is_static)) {
          ++unusable_;
        } else if (!is_static) {
          times_[PlainFrameName(transform.child_frame)].insert(time);
        }
      }
      return;
    }
    if (WantsTransforms()) return;
    OdometryMessage decoded;
    TimedPose3 timed;
    const bool is_good =
        (kind == PoseKind::kOdometry
             ? DecodeOdometry(message.data, topic.encoding, &decoded, &why)
             : DecodePoseStamped(message.data, topic.encoding, &decoded,
                                 &why)) &&
        ToPose3(decoded.pose, &timed.pose);
    if (!is_good) {
      ++unusable_;
      return;
    }
    timed.timestamp = Seconds(decoded.header.stamp);
    poses_[message.topic].push_back(timed);
  }

  // "/odom (nav_msgs/Odometry, 1234)", ...
  std::string Describe() const {
    std::string list;
    for (std::size_t i = 0; i < source_->topics().size(); ++i) {
      const BagTopic& topic = source_->topics()[i];
      const auto count = counts_.find(i);
      list += (list.empty() ? "" : ", ") + PrintableUtf8(topic.name) + " (" +
              PrintableUtf8(topic.type) + ", " +
              std::to_string(count == counts_.end() ? 0 : count->second) + ")";
    }
    return list.empty() ? "nothing" : list;
  }

  void ChooseTopic(TrajectoryFile* file) {
    const auto plain = [](const std::string& name) {
      return PlainFrameName(name);
    };
    std::vector<std::size_t> found;
    for (const auto& [index, poses] : poses_) {
      if (topic_.empty() ||
          plain(source_->topics()[index].name) == plain(topic_)) {
        found.push_back(index);
      }
    }
    if (found.size() == 1) {
      file->source = source_->topics()[found[0]].name;
      file->poses = std::move(poses_[found[0]]);
      return;
    }
    throw Error(
        file->name, 0,
        (found.size() > 1 ? "has poses in several topics: "
         : topic_.empty() ? "has no topic of poses: "
                          : "has no poses in a topic '" + topic_ + "': ") +
            Describe(),
        found.size() > 1
            ? "--trajectory_topic or --reference_topic to name one, or "
              "tf:PARENT.CHILD"
            : "one of nav_msgs/Odometry, geometry_msgs/PoseStamped or "
              "PoseWithCovarianceStamped, or tf:PARENT.CHILD");
  }

  void LookUpTransforms(TrajectoryFile* file) {
    tree_.Sort();
    // The frames on the way, without what both have above them.
    std::vector<std::string> up = tree_.ChainOf(parent_);
    std::vector<std::string> down = tree_.ChainOf(child_);
    while (!up.empty() && !down.empty() && up.back() == down.back()) {
      up.pop_back();
      down.pop_back();
    }
    std::set<std::int64_t> times;
    std::int64_t begin = INT64_MIN;
    std::int64_t end = INT64_MAX;
    for (const std::vector<std::string>* way : {&up, &down}) {
      for (const std::string& frame : *way) {
        const auto moving = times_.find(frame);
        if (moving == times_.end()) continue;
        times.insert(moving->second.begin(), moving->second.end());
        begin = std::max(begin, *moving->second.begin());
        end = std::min(end, *moving->second.rbegin());
      }
    }
    for (const std::int64_t time : times) {
      TimedPose3 timed;
      // Outside of it the tree would hold on to an end.
      if (time < begin || time > end) continue;
      if (!tree_.LookupAnyWay(parent_, child_, time, &timed.pose)) break;
      timed.timestamp = Seconds(time);
      file->poses.push_back(timed);
    }
    file->source = topic_;
    if (file->poses.empty()) {
      throw Error(file->name, 0,
                  "has no transform over time from '" + parent_ + "' to '" +
                      child_ +
                      "': " + (tree_.empty() ? Describe() : tree_.Describe()),
                  "frames that tf joins");
    }
  }

  BagSource* source_;
  std::string topic_;
  std::string parent_;
  std::string child_;
  std::map<std::size_t, std::int64_t> counts_;
  std::map<std::size_t, std::vector<TimedPose3>> poses_;
  std::int64_t unusable_ = 0;
  TransformTree tree_;
  // Of each frame, when tf said where it is.
  std::map<std::string, std::set<std::int64_t>> times_;
};

void ReadBagPoses(BagSource* source, const std::string& topic,
                  TrajectoryFile* file) {
  file->format = source->format();
  BagTrajectories(source, topic).Read(file);
}

void NoteDisorder(TrajectoryFile* file) {
  std::size_t back = 0;
  for (std::size_t i = 1; i < file->poses.size(); ++i) {
    back += file->poses[i].timestamp < file->poses[i - 1].timestamp;
  }
  if (back == 0) return;
  file->notes.push_back("time stamps go back " + std::to_string(back) +
                        (back == 1 ? " time" : " times") +
                        ": poses are taken in the order of the file");
}

}  // namespace

TrajectoryFile ReadTrajectory(const std::string& path,
                              const std::string& topic) {
  TrajectoryFile file;
  file.name = path;
  if (path != "-" && LooksLikeRosbag2Folder(path)) {
    ReadBagPoses(OpenRosbag2Folder(path).get(), topic, &file);
  } else {
    InputStream input(path);
    file.name = input.name();
    const std::string_view prefix = input.Peek(1 << 16);
    const std::size_t fields = FieldsOfFirstLine(prefix);
    const auto open = LooksLikeRosbag1(prefix)  ? OpenRosbag1
                      : LooksLikeMcap(prefix)   ? OpenMcap
                      : LooksLikeSqlite(prefix) ? OpenRosbag2Sqlite
                                                : nullptr;
    if (open != nullptr) {
      ReadBagPoses(open(&input).get(), topic, &file);
    } else if (!topic.empty()) {
      throw Error(file.name, 0, "is no bag, and has no topic '" + topic + "'",
                  "a ROS bag, or no topic");
    } else if (fields == 12) {
      file.format = "KITTI";
      file.has_times = false;
      ReadKittiPoses(&input, &file);
    } else if (fields == 0 || prefix.find('\0') == std::string_view::npos) {
      file.format = "TUM";
      ReadTumPoses(&input, &file);
    } else {
      throw Error(file.name, 0, "is of a format that is not known", kFormats);
    }
    if (open == nullptr) RequireUndamaged(input);
  }
  if (file.poses.empty()) throw Error(file.name, 0, "holds no pose", kFormats);
  NoteDisorder(&file);
  return file;
}

std::vector<TimedPose> InPlane(const TrajectoryFile& trajectory) {
  std::vector<TimedPose> poses;
  poses.reserve(trajectory.poses.size());
  for (const TimedPose3& timed : trajectory.poses) {
    const Eigen::Quaterniond& q = timed.pose.rotation;
    TimedPose pose;
    pose.timestamp = timed.timestamp;
    pose.pose = Pose2(timed.pose.translation.x(), timed.pose.translation.y(),
                      std::atan2(2.0 * (q.w() * q.z() + q.x() * q.y()),
                                 q.w() * q.w() + q.x() * q.x() - q.y() * q.y() -
                                     q.z() * q.z()));
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace plumbline
