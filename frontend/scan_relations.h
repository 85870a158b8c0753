#ifndef PLUMBLINE_FRONTEND_SCAN_RELATIONS_H_
#define PLUMBLINE_FRONTEND_SCAN_RELATIONS_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <vector>

namespace plumbline {

/// Options for which scans are matched with each other, and which matches stay.
struct ScanRelationOptions {
  ScanMatcherOptions matcher;
  /// Consecutive places that make one submap.
  int submap_size = 4;
  /// Largest distance of a place from a submap's middle, m.
  double radius = 4.0;
  /// Submaps that one place is matched with: bounds the cost where a robot
  /// stays long or comes again and again. Half of them are the nearest, the
  /// others are spread over the visits.
  int max_submaps = 10;
  /// Shares of the scan's returns that must have a partner before and after
  /// the match.
  double min_overlap = 0.4;
  double min_inlier_ratio = 0.5;
  /// Standard deviations of the present poses while matching, m and rad.
  double prior_translation = 0.3;
  double prior_rotation = DegToRad(3.0);
  /// By how much another place and heading would be measured across a corridor,
  /// m and rad, for each metre that the scan turns out to be farther along it,
  /// and the farthest that it may, m: walls bend and normals scatter by so
  /// much.
  double slide_across = 0.02;
  double slide_turn = 0.002;
  double longest_slide = 1.0;
  /// Two places whose relative pose has changed by more, m or rad, since they
  /// were matched or tried are matched anew.
  double retry_distance = 0.1;
  double retry_rotation = DegToRad(1.5);
  /// The first this many places are not matched with each other.
  int num_held = 0;
  /// The result does not depend on it.
  int num_threads = 1;
};

/// A return on a straight surface: what is kept of the returns of all scans,
/// which are many. In single precision it is exact to micrometres: the frame is
/// that of the place.
struct SurfaceReturn {
  /// m.
  Eigen::Vector2f position;
  /// Unit normal of the surface, towards the laser.
  Eigen::Vector2f normal;
};

/// A place of the robot, with what it saw from there.
struct Place {
  /// Returns of the place's own scan, in its frame.
  std::vector<ScanPoint> scan;
  /// Those of the key scans up to the next place, in the frame of the place:
  /// what others are matched with.
  std::vector<ScanPoint> reference;
  /// Those of all scans up to the next place that lie on straight surfaces, in
  /// the frame of the place, and how many scans they are from.
  std::vector<SurfaceReturn> returns;
  int num_scans = 1;
  /// Whether the robot came here from the place before, tracked all the way.
  bool follows_previous = true;
  /// Pose in the frame of that place by refined odometry; not used for the
  /// first place.
  Pose2 since_previous = Pose2::Zero();
};

/// What the scans of two places that need not follow each other say about their
/// relative pose.
struct ScanRelation {
  /// Indices of places; `from` is the middle of the submap.
  int from = 0;
  int to = 0;
  /// Pose of `to` in the frame of `from`.
  Pose2 mean = Pose2::Zero();
  /// Inverse covariance of `mean` in the frame of `from` from the returns alone
  /// (m, m, rad): rank deficient along a corridor, where `mean` is as before
  /// the match.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

/// Matches each place's scan with the submaps of other places near it, seen
/// shortly before or after or on another visit, point to line. It remembers
/// what it has matched: when the poses have changed, only what has moved or
/// come near since is matched anew.
class ScanMatchFinder {
 public:
  /// `places` must outlive this. Throws Error when options are out of range.
  ScanMatchFinder(const std::vector<Place>& places,
                  const ScanRelationOptions& options);

  /// All relations at these poses: one per place, in one frame, good to within
  /// the matcher's initial radius where scans overlap. They come in the order
  /// of submaps, then of places. Cost: linear in the places. `stop` (may be
  /// null) is polled regularly by the calling thread; once it has returned true
  /// no more is matched, and the result is incomplete.
  std::vector<ScanRelation> Find(const std::vector<Pose2>& poses,
                                 const std::function<bool()>& stop = nullptr);

  /// Forgets what was matched, and takes the places of a submap from now on
  /// where the poses given to Find have them: for poses that are adjusted.
  /// Until then they lie as refined odometry has them: over these few metres it
  /// is better than a map that is still to be adjusted, and what is matched
  /// with a bent submap keeps it bent.
  void TrustPoses();

  /// Writes what it remembers, to be read by another finder with the same
  /// places and options.
  void WriteState(StateWriter* state) const;
  void ReadState(StateReader* state);

  /// Pairs that the last call matched or tried to.
  std::int64_t num_tried() const { return num_tried_; }

 private:
  // What is known of a submap and a place.
  struct Attempt {
    // Relative pose when it was made.
    Pose2 pose = Pose2::Zero();
    bool is_match = false;
    ScanRelation relation;

    template <typename Archive>
    friend void Exchange(Archive& archive, Attempt& attempt) {
      auto& [pose, is_match, relation] = attempt;
      ExchangeAll(archive, pose, is_match, relation);
    }
  };

  const std::vector<Place>& places_;
  ScanRelationOptions options_;
  bool trusts_poses_ = false;
  // By submap and place.
  std::vector<std::map<int, Attempt>> attempts_;
  std::int64_t num_tried_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SCAN_RELATIONS_H_
