#ifndef PLUMBLINE_FRONTEND_TRACK_REFERENCE_H_
#define PLUMBLINE_FRONTEND_TRACK_REFERENCE_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/reference_points.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/track_search.h>

#include <Eigen/Core>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

namespace plumbline {

/// Makes the reference that a track's scans are matched with: the returns of
/// its last key scans. With the next key scan most of them come again, so that
/// a thread can put them together while scans are matched; the reference is the
/// same with and without it.
class TrackReference {
 public:
  /// Whether a thread is used.
  explicit TrackReference(bool prepares_ahead)
      : prepares_ahead_(prepares_ahead) {}
  TrackReference(const TrackReference&) = delete;
  TrackReference& operator=(const TrackReference&) = delete;
  ~TrackReference();

  /// Makes the key scans (one at least) the reference of the matcher, but those
  /// farther than `reach`, m, from the last one: where odometry has jumped,
  /// nothing is in sight of both. `window`: so many there are at most, the
  /// first one goes when another one comes. `merge_distance`: as
  /// ReferencePoints has it.
  void Set(const std::deque<TrackKey>& keys, double reach, int window,
           double merge_distance, ScanMatcher* matcher);

 private:
  // A key scan, with its returns in the track's frame.
  struct Seen {
    int scan;
    Pose2 pose;
    Eigen::Vector2d laser;
    std::shared_ptr<const std::vector<ReferencePoint>> points;
  };
  // The points of some key scans.
  struct Base {
    std::vector<Seen> keys;
    ReferencePoints points;

    void Gather();
    bool IsOf(const std::vector<Seen>& others, double merge_distance) const;
  };

  Seen See(const TrackKey& key) const;
  ReferencePoints PointsOf(const std::vector<Seen>& keys,
                           double merge_distance);
  void Prepare(std::vector<Seen> keys, double merge_distance);
  void Work();

  const bool prepares_ahead_;
  // Of the last reference.
  std::vector<Seen> seen_;

  std::thread thread_;
  std::mutex mutex_;
  // Told of a base to be made, of one that is made, and of the end.
  std::condition_variable changed_;
  // To be made; being made; made.
  std::optional<Base> wanted_;
  bool is_at_work_ = false;
  std::optional<Base> made_;
  bool has_ended_ = false;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TRACK_REFERENCE_H_
