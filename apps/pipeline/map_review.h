#ifndef PLUMBLINE_PIPELINE_MAP_REVIEW_H_
#define PLUMBLINE_PIPELINE_MAP_REVIEW_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/contested_ways.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/map_check.h>
#include <plumbline/frontend/odometry_check.h>
#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/open_ways.h>
#include <plumbline/frontend/part_joining.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/way_check.h>

#include <functional>
#include <string>
#include <vector>

namespace plumbline {

/// What the scans of a log say of a map that was made of them: whether it
/// contradicts itself, and where (core/method.md, section 7).
class MapReview {
 public:
  /// `trajectory` has the pose of every scan, map frame; `records` name the key
  /// scans, at which the map is looked at. Scans, options and trajectory are
  /// not copied and must outlive the review. Once `stop` (may be null) has
  /// returned true, what is asked for comes back empty.
  MapReview(const std::vector<Scan>& scans,
            const std::vector<KeyScanRecord>& records,
            const std::vector<Pose2>& trajectory, const MapCheckOptions& check,
            const WayCheckOptions& way_check, std::function<bool()> stop);

  /// Whether what the robot saw contradicts itself (FindContradictions).
  bool HasContradictions() const;
  /// How uncertain the length of a way is that hangs on odometry (FindOpenWays;
  /// standard deviation of the most uncertain one, m); 0 where none does.
  double LargestOpenSigma() const;
  /// What of the map's lengths is not known (FindUncertainLengths).
  UncertainLengths Lengths() const;
  /// How odometry agrees with the map.
  OdometryAgreement Odometry() const {
    return CompareWithOdometry(scans_, trajectory_, OdometryCheckOptions());
  }
  /// How far the map agrees with itself.
  MapAgreement Agreement() const;

  /// Revises `loose`, the parts of the track that hang on the rest by a single
  /// match or a guess: adds those that contradict what was seen on other
  /// visits, ways through walls of `graph`, scans that odometry alone placed
  /// while it missed much (`refined`, one per scan), ways that odometry has
  /// longer by far or that what was in sight contests and, with
  /// `tell_open_ways`, ways whose length hangs on odometry; drops those that
  /// turn out to be right. Ordered by their first scans. What holds of no part
  /// in particular is said in `notes`.
  void Revise(const Graph& graph, const std::vector<RefinedScan>& refined,
              bool tell_open_ways, std::vector<LooseTrack>* loose,
              std::vector<std::string>* notes) const;

 private:
  void DropConfirmed(std::vector<LooseTrack>* loose) const;
  void WidenToStill(LooseTrack* track) const;

  const std::vector<Scan>& scans_;
  const std::vector<Pose2>& trajectory_;
  const MapCheckOptions& check_;
  const WayCheckOptions& way_check_;
  std::function<bool()> stop_;
  // The scans of the records, whether they follow the ones before, and where
  // they are.
  std::vector<int> keys_;
  std::vector<bool> follows_;
  std::vector<Pose2> poses_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_MAP_REVIEW_H_
