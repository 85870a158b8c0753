#ifndef PLUMBLINE_FRONTEND_TRACK_SEARCH_H_
#define PLUMBLINE_FRONTEND_TRACK_SEARCH_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/tracking_options.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// A key scan of a track.
struct TrackKey {
  /// Index of the scan.
  int scan;
  /// Pose of the robot in the track's frame.
  Pose2 pose;
  /// Returns, robot's frame.
  std::vector<ScanPoint> points;
  /// Position of the laser in the robot's frame, m.
  Eigen::Vector2d laser;

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, TrackKey& key) {
    auto& [scan, pose, points, laser] = key;
    ExchangeAll(archive, scan, pose, points, laser);
  }
};

/// A key scan that is settled, thinned out.
struct SeenKey {
  int scan;
  /// Key scans whose relative poses are known are one part.
  int part;
  Pose2 pose;
  Eigen::Vector2d laser;
  /// Position and normal, robot's frame.
  std::vector<Eigen::Vector4f> points;

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, SeenKey& key) {
    auto& [scan, part, pose, laser, points] = key;
    ExchangeAll(archive, scan, part, pose, laser, points);
  }
};

/// Where some key scans of a track lie in what was seen.
struct FoundTrack {
  /// Of the middle one of them.
  Pose2 pose = Pose2::Zero();
  /// Of the returns alone, in the frame of `pose`'s parent.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  /// Share of the returns on what was seen there, of all that do not lie in
  /// the unknown.
  double support = 0.0;
  double quality = 0.0;
  /// It is good enough to be believed, whatever its rivals.
  bool holds = false;
  /// The visit that it was judged by: of the key scans searched in,
  /// [begin, end).
  std::size_t begin = 0;
  std::size_t end = 0;
};

/// Covariance of what was found as a motion from `from`, in its axes. A tie is
/// known no better than 3 cm and half a degree; what the returns leave open, to
/// 2 m.
Eigen::Matrix3d TieCovariance(const FoundTrack& found, const Pose2& from);

/// Keeps what was seen from key scans that are settled, and finds where key
/// scans of a track whose place is not known lie in it: one pose has to explain
/// them clearly better than every other.
class TrackSearch {
 public:
  /// Key scans of one visit to a place at least.
  static constexpr std::size_t kShortestVisit = 4;
  /// So far from itself a place may lie that is visited again, m and rad.
  static constexpr double kVisitDistance = 3.0;
  static constexpr double kVisitRotation = DegToRad(15.0);

  /// Starts with nothing seen.
  TrackSearch(const TrackingOptions& tracking,
              const ScanMatcherOptions& matcher)
      : tracking_(tracking), matcher_(matcher) {}

  /// For another noise of the laser.
  void set_matcher(const ScanMatcherOptions& matcher) { matcher_ = matcher; }
  /// Asked now and then; once it has returned true nothing is found. May be
  /// null.
  void set_stop(std::function<bool()> stop) { stop_ = std::move(stop); }
  /// Whether to stop.
  bool Stops() const { return stop_ && stop_(); }
  /// Called with a line on each decision.
  void set_trace(std::function<void(const std::string&)> trace) {
    trace_ = std::move(trace);
  }

  /// Passes a line on to who follows its decisions.
  void Trace(const std::string& line) const {
    if (trace_) trace_(line);
  }

  /// Keeps a key scan of this part.
  void Add(const TrackKey& key, int part);
  /// Those that were added, in this order.
  const std::vector<SeenKey>& seen() const { return seen_; }
  std::vector<SeenKey>& seen() { return seen_; }
  /// Some of them as key scans of a track.
  std::vector<TrackKey> Unpacked(const std::vector<std::size_t>& where) const;
  /// How one of them, at its pose, agrees with what others of them saw.
  ScanAgreement CompareKey(std::size_t key,
                           const std::vector<std::size_t>& others) const;
  /// Forgets them.
  void Clear() { std::vector<SeenKey>().swap(seen_); }

  /// Where key scans [begin, end) of a track lie in the reference, looked for
  /// over the full circle up to `window` (m) each way from `center`, the middle
  /// one's. `seen_through`: share of the reference that was before.
  bool FindHere(const std::vector<TrackKey>& keys, const ScanMatcher& reference,
                const Pose2& center, double window, std::size_t begin,
                std::size_t end, double seen_through, FoundTrack* found) const;

  /// Key scans of seen(), ascending, to be searched in: what was seen from
  /// them, around their middle, m each way. `where` has to outlive it.
  struct SearchArea {
    const std::vector<std::size_t>& where;
    ScanMatcher matcher;
    Pose2 center;
    double window;
  };
  SearchArea AreaOf(const std::vector<std::size_t>& where) const;
  /// Key scans of seen(), ascending, that say what was seen within `reach` (m)
  /// of a pose. Of the last one's part only: where others lie is a guess.
  std::vector<std::size_t> KeysAround(const Pose2& pose, double reach) const;

  /// The same in an area. Visits of `found` are positions in its `where`.
  /// `nodes`: as ScanMatcher::Peaks has it.
  bool FindAnywhere(const std::vector<TrackKey>& keys, const SearchArea& area,
                    std::size_t begin, std::size_t end, double seen_through,
                    std::int64_t* nodes, FoundTrack* found) const;
  /// Where they may lie in an area, each visit to a place by itself: of these
  /// FindAnywhere gives the one that IsClear.
  std::vector<FoundTrack> FindAll(const std::vector<TrackKey>& keys,
                                  const SearchArea& area, std::size_t begin,
                                  std::size_t end, double seen_through,
                                  std::int64_t* nodes) const;
  /// Whether the best of them holds and no other place comes near; sets it.
  bool IsClear(const std::vector<FoundTrack>& hypotheses,
               FoundTrack* best) const;

  /// How clearly key scans [begin, end) fit somewhere in the area, at a
  /// fraction of FindAnywhere's cost (ScanMatcher::ClearestScore).
  double Clearness(const std::vector<TrackKey>& keys, std::size_t begin,
                   std::size_t end, const SearchArea& area) const;

  /// Of the visit's key scans the nearest one to what was found there.
  std::size_t NearestOf(const FoundTrack& found,
                        const std::vector<std::size_t>& where) const;

 private:
  struct View;
  struct Visit;

  static View ViewOf(const std::vector<TrackKey>& keys, std::size_t begin,
                     std::size_t end);
  // What a visit says of a pose of the track; false when nothing there holds
  // it.
  bool Judge(const View& view, const ScoredPose& peak, const Visit& visit,
             double seen_through, bool is_global, FoundTrack* hypothesis) const;
  // `visits` gives what was seen around a pose, each time that the robot was
  // there. `is_global`: it was looked for in all that was seen.
  // None once it was stopped.
  std::vector<FoundTrack> Find(
      const std::vector<TrackKey>& keys, const ScanMatcher& reference,
      const std::function<std::vector<Visit>(const Pose2&)>& visits,
      const Pose2& center, double translation_window, std::size_t begin,
      std::size_t end, double seen_through, bool is_global,
      std::int64_t* nodes) const;
  // Sets what was seen from these key scans, [begin, end).
  void SetReference(const std::vector<std::size_t>& where, std::size_t begin,
                    std::size_t end, ScanMatcher* matcher) const;
  // Of these key scans, ascending, at most so many for each stretch of floor,
  // in even steps: what the same place looked like the twentieth time says
  // nothing new.
  std::vector<std::size_t> Thinned(const std::vector<std::size_t>& where) const;

  TrackingOptions tracking_;
  ScanMatcherOptions matcher_;
  std::function<bool()> stop_;
  std::function<void(const std::string&)> trace_;
  std::vector<SeenKey> seen_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TRACK_SEARCH_H_
