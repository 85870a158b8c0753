#ifndef PLUMBLINE_PIPELINE_SECOND_MAP_H_
#define PLUMBLINE_PIPELINE_SECOND_MAP_H_

#include <plumbline/core/registry.h>
#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/joint_adjustment.h>
#include <plumbline/frontend/track_placement_options.h>
#include <plumbline/pipeline/guessed_parts.h>
#include <plumbline/pipeline/log_run.h>
#include <plumbline/pipeline/map_review.h>
#include <plumbline/pipeline/solved_map.h>

#include <atomic>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace plumbline {

/// The second map of full refinement (core/method.md, section 7): poses that
/// are adjusted by all scans alone, walls that the returns show from there, and
/// both adjusted jointly, in three steps. It takes the first map's place in the
/// SolvedMap; the first one is kept until the second stands, and comes back
/// when it was time to stop or the second one is no better.
class SecondMap {
 public:
  /// Nothing is copied, and all must outlive this. `run` has the trajectory of
  /// the first map, which lies in `map`.
  SecondMap(const Registry& registry, const LogSolverOptions& options,
            LogRun* run, SolvedMap* map);
  ~SecondMap();

  /// Whether it is under way.
  bool is_begun() const { return adjustment_ != nullptr; }

  /// Length of the first map's walls, m, that this one's are measured by, where
  /// the first map does not lie in the SolvedMap; 0: it does.
  void SetFirstLength(double length) { first_length_ = length; }

  /// Begins to gather what was seen from the places (GatherPlaces), on a thread
  /// of its own while the first map is made; without ThreadsHere() to spare
  /// AdjustPoses does it. From now on the refined scans and records of the run
  /// stay as they are.
  void GatherAhead();
  /// What was begun is not needed any more.
  void DropGathered();

  /// Adjusts the poses alone, from the key poses of the run or from odometry,
  /// whichever agrees better with what was seen. Sets the places and the
  /// trajectory of the run. Parts of the log whose place is not sure are then
  /// looked for in the rest (PlaceUnsureParts), if `find_parts`, and where the
  /// map contradicts itself the way is bent so that visits agree
  /// (PosesOfAgreeingVisits); all is adjusted once more after either, a few
  /// times. Throws Error when a solve fails; likewise below.
  void AdjustPoses(bool find_parts = false);
  /// Adds walls to adjusted poses.
  void MakeWalls();
  /// Adjusts poses and walls; then this map stands, or is refused
  /// (LogSolverResult::second_map_refused) and the first one is back. Where
  /// walls bend what the scans say (AreBentByWalls), all of it is done again
  /// with shorter walls that hold the poses loosely
  /// (LogSolverResult::loose_walls).
  void AdjustWalls();

  /// JointAdjustment::vote_variance_excess of the map that stands.
  double vote_excess() const { return vote_excess_; }

  /// Goes on with the map's session, which was made anew.
  void TakeSession();

  /// What is kept of the first map, as a StateWriter or StateReader.
  template <typename Archive>
  void ExchangeFirst(Archive& archive) {
    ExchangeAll(archive, first_map_, first_trajectory_, first_length_,
                vote_excess_, first_refined_, first_records_, first_loose_);
  }
  /// The adjustment that is under way; nothing where none is.
  void WriteAdjustment(StateWriter* state);
  void ReadAdjustment(StateReader* state);

 private:
  void KeepFirst();
  void ReturnToFirst();
  // The poses alone, from those of the run or by odometry.
  void AdjustPosesOfRun();
  // Whether parts whose place was not sure were found; their poses in the run
  // are moved. `ties`: as in PlaceUnsureParts.
  bool FindParts(PartTies* ties);
  TrackPlacementOptions PartPlacement() const;
  // Poses of the key scans, from those that are adjusted; none where they
  // agree.
  std::vector<Pose2> WhereVisitsAgree() const;
  void ForgetParts();
  // The poses alone by all scans, from these of the key scans.
  void AdjustFrom(const std::vector<Pose2>& start,
                  const JointAdjustmentOptions& options);
  void AddWalls(const WallCompletionOptions& completion);
  // Poses and walls.
  void AdjustBoth();
  // A start that is far off ends in a wrong place: where scans contradict each
  // other, lengths hang on odometry, or the map has a kink that odometry does
  // not have, the better of two starts stands. Nothing to start from is none.
  // Returns whether the new one does.
  bool TryFrom(const std::vector<Pose2>& start, bool has_kink);
  MapReview Review() const;
  // Not when the map is not to be checked.
  bool HasContradictions();
  double LargestOpenSigma();

  const Registry& registry_;
  const LogSolverOptions& options_;
  LogRun& run_;
  SolvedMap& map_;
  std::unique_ptr<JointAdjustment> adjustment_;
  // While it is under way.
  std::string first_map_;
  std::vector<Pose2> first_trajectory_;
  // Where parts were found: what the run had of them before; else empty.
  std::vector<RefinedScan> first_refined_;
  std::vector<KeyScanRecord> first_records_;
  std::vector<LooseTrack> first_loose_;
  double first_length_ = 0.0;
  // Whether the adjusted map contradicts itself, once that was asked.
  std::optional<bool> contradicts_;
  double vote_excess_ = 1.0;
  std::atomic<bool> is_gathering_dropped_{false};
  // None once they are taken. Last, as it uses the others.
  std::future<std::vector<Place>> gathered_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_SECOND_MAP_H_
