#ifndef PLUMBLINE_FRONTEND_BAGS_TRANSFORM_TREE_H_
#define PLUMBLINE_FRONTEND_BAGS_TRANSFORM_TREE_H_

#include <plumbline/frontend/bags/message_decoder.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// A rigid motion in space that maps points of a frame into its parent.
struct Pose3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  /// m
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

/// a, then b in the frame that a leads to.
Pose3 Compose(const Pose3& a, const Pose3& b);
Pose3 Inverse(const Pose3& pose);
/// The way from a (share 0) to b (share 1): straight, turning evenly.
Pose3 Interpolate(const Pose3& a, const Pose3& b, double share);

/// Converts a message; false when a number is not finite or absurd, or the
/// quaternion is not of unit length (1 % off is accepted and normalized).
bool ToPose3(const Pose3Message& message, Pose3* pose);

/// The frames of /tf and /tf_static over time. Names are taken without a slash
/// in front.
class TransformTree {
 public:
  /// A frame's pose in its parent at a time.
  struct Sample {
    /// ns, as stamped.
    std::int64_t time = 0;
    /// ns, when it was recorded.
    std::int64_t received = 0;
    /// Number of the message in the bag.
    int position = 0;
    Pose3 pose;
  };

  /// Adds a transform, recorded at `received` (ns) by the message of that
  /// number. A frame keeps its first parent; false when another is given, the
  /// frame is its own parent, or its transform is no rigid motion: nothing is
  /// added then.
  bool Add(const TransformMessage& message, std::int64_t received, int position,
           bool is_static);

  /// Adds the frames of another tree that this one does not have.
  void AddFrames(const TransformTree& other);

  /// Puts what was added in the order of time. Call once all is in.
  void Sort();

  /// All frames that have a parent.
  std::vector<std::string> Frames() const;

  /// `frame`, its parent, and so on to the root.
  std::vector<std::string> ChainOf(const std::string& frame) const;

  /// The pose of `frame` in its ancestor `ancestor` at `time`, interpolated;
  /// before the first and after the last transform theirs holds. False when
  /// there is no such way.
  bool Lookup(const std::string& ancestor, const std::string& frame,
              std::int64_t time, Pose3* pose) const;

  /// The same between any two frames that have an ancestor in common.
  bool LookupAnyWay(const std::string& reference, const std::string& frame,
                    std::int64_t time, Pose3* pose) const;

  /// Whether the pose of `frame` in its parent was given over time and changed.
  bool IsMoving(const std::string& frame) const;

  /// The poses of `frame` in its parent over time; of a time in which it stood
  /// still, the ends. Null when it has none.
  const std::vector<Sample>* SamplesOf(const std::string& frame) const;

  /// "odom -> base_link -> laser, ...": every way from a root, for people.
  std::string Describe() const;

  /// True before the first transform.
  bool empty() const { return edges_.empty(); }

 private:
  struct Edge {
    std::string parent;
    bool is_static = false;
    std::vector<Sample> samples;
  };
  static Pose3 At(const Edge& edge, std::int64_t time);

  // By the name of the child.
  std::map<std::string, Edge> edges_;
};

/// "/laser" as "laser".
std::string PlainFrameName(const std::string& frame);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_TRANSFORM_TREE_H_
