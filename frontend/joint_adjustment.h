#ifndef PLUMBLINE_FRONTEND_JOINT_ADJUSTMENT_H_
#define PLUMBLINE_FRONTEND_JOINT_ADJUSTMENT_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_relations.h>
#include <plumbline/frontend/wall_junctions.h>
#include <plumbline/frontend/wall_votes.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

namespace plumbline {

/// Options of the joint adjustment.
struct JointAdjustmentOptions {
  ScanPointsOptions points;
  /// One in this many key scans is a place whose pose is adjusted; what was
  /// seen up to the next one is bound to it by refined odometry.
  int place_stride = 3;
  ScanRelationOptions relations;
  WallVoteOptions votes;
  WallJunctionOptions junctions;
  /// Chi-square at which a scan relation counts half (Cauchy).
  double loss_scale = 2.0;
  /// Bounds of the factors by which EstimateVariances changes variances.
  double min_variance_factor = 0.08;
  double max_variance_factor = 4.0;
  /// Smallest factor of the variances of votes that covariances are reported
  /// with (ReportVoteVariances). In simulated buildings residuals show less
  /// than a hundredth, as looks at one wall share what no residual shows.
  double min_reported_factor = 0.03;
  /// Rounds of taking votes and weights anew, each followed by a solve.
  int rounds = 3;
  /// Then places that have come near each other are matched, and all of it is
  /// repeated at most this often while a pose moves by more than this, m.
  int max_passes = 5;
  double settled_distance = 0.05;
  /// Places of this many records, the first, stay where they are: the map that
  /// the others are found in. Only without walls.
  std::size_t num_held_records = 0;
  /// The result does not depend on it.
  int num_threads = 1;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    points.ScaleToNoise(scale);
    relations.matcher.ScaleToNoise(scale);
    votes.ScaleToNoise(scale);
  }
};

/// The poses of all key scans (map frame, one per record) where these places
/// stand in the graph, as JointAdjustment::places lists them: those between
/// places by refined odometry, what is missing at the next place spread over
/// the way.
std::vector<Pose2> KeyPosesOfPlaces(const Graph& graph,
                                    const std::vector<FeatureId>& places,
                                    const std::vector<KeyScanRecord>& records,
                                    int place_stride);

/// Divides the variances of the votes for walls by JointAdjustment::
/// vote_variance_excess: the last thing that is done to a map. Solves give
/// votes more room than their residuals ask for, since the edges of walls at
/// small angles need it; covariances of walls would come out too wide with it.
void ReportVoteVariances(double excess, const Registry& registry, Graph* graph);

/// What was seen from the places into which the records divide the log, one
/// every `options.place_stride` key scans; how they follow each other is left
/// open. `refined` has one entry per scan. Once `stop` (may be null) says so
/// the rest of the places is left empty. Uses options.num_threads threads.
/// Cost: linear in the returns.
std::vector<Place> GatherPlaces(const std::vector<Scan>& scans,
                                const std::vector<RefinedScan>& refined,
                                const std::vector<KeyScanRecord>& records,
                                const JointAdjustmentOptions& options,
                                const std::function<bool()>& stop = nullptr);

/// Joint adjustment of poses, walls and structure to all scans (not in the
/// paper, whose method, core/method.md, section 7, ends with finding the scans
/// again on a map that stays as it is).
///
/// The poses of key scans, which the front-end had marginalized out one by
/// one, come back into the graph. They are bound to each other by refined
/// odometry and by matches of scans that saw the same place, at the same time
/// or on another visit (ScanMatchFinder), and to the walls by every return
/// that lies on one (CollectWallVotes). These are what the scans say in full,
/// so the relations between walls that stood for the marginalized poses go;
/// walls that no return votes for keep theirs. Structure stays as it is, live
/// or broken, and can go on being found and broken on the graph.
///
/// On an empty graph only the poses are adjusted, free of what the front-end
/// took for walls; AddWalls then brings those that the returns show from there.
class JointAdjustment {
 public:
  /// Puts places into the graph, where `key_poses` say (map frame, one per
  /// record). `robot`: the pose that the front-end keeps in the graph, which
  /// leaves it (kNoId: none). `refined` has one entry per scan. Pointers are
  /// not owned and must outlive this, and so must `registry`, `records` and
  /// what `stop` (may be null) refers to: it is asked now and then here and
  /// below; once it has returned true the work ends early, the graph whole but
  /// unfinished. `gathered`: what GatherPlaces made of the same; none: that is
  /// done here.
  JointAdjustment(Graph* graph, SolverSession* session,
                  const Registry& registry, const std::vector<Scan>& scans,
                  const std::vector<RefinedScan>& refined,
                  const std::vector<KeyScanRecord>& records,
                  const std::vector<Pose2>& key_poses, FeatureId robot,
                  const JointAdjustmentOptions& options,
                  std::function<bool()> stop = nullptr,
                  std::vector<Place> gathered = {});

  /// Goes on from what WriteState of another one wrote that was made with the
  /// same scans, records and options, on an equal graph.
  JointAdjustment(Graph* graph, SolverSession* session,
                  const Registry& registry, const std::vector<Scan>& scans,
                  const std::vector<RefinedScan>& refined,
                  const std::vector<KeyScanRecord>& records, StateReader* state,
                  const JointAdjustmentOptions& options,
                  std::function<bool()> stop = nullptr);
  void WriteState(StateWriter* state);

  /// Solves with another session on the same graph from now on.
  void SetSession(SolverSession* session) { session_ = session; }

  /// Matches all scans anew at the poses as they are now: once they are
  /// adjusted they are better than the odometry that placed the scans of one
  /// submap until then.
  void MatchAnew();

  /// Scales the variances of refined odometry, of the matches of scans and of
  /// the votes for walls by one factor each to what their residuals show
  /// (variance components, Foerstner 1979, by the median, since some matches
  /// are wrong), then solves once. Of a vote the innovation counts: where its
  /// returns alone would have the wall. Scans promise too much or too little by
  /// what surfaces and a laser are; links that are given too much room let
  /// structure bend the map. Few links say little: kPriorLinks more with a
  /// factor of 1 are counted. Throws Error when the solve fails.
  void EstimateVariances();
  static constexpr double kPriorLinks = 10.0;

  /// The factors: 1 until they are estimated.
  double motion_variance_factor() const { return motion_factor_; }
  double relation_variance_factor() const { return relation_factor_; }
  double vote_variance_factor() const { return vote_factor_; }
  /// How many times wider the variances of votes are in the graph than they are
  /// to be reported; at least 1.
  double vote_variance_excess() const { return vote_excess_; }

  /// Adds walls (segments of level 0 without constraints, as they lie among the
  /// poses at present), each bound to the poses by the votes of its returns;
  /// walls that get none are left out. The graph must not have had walls.
  void AddWalls(Transaction walls);

  /// Takes votes and weights anew at the present state and solves, `rounds`
  /// times, then matches what has come near and starts again, until the poses
  /// have settled or `stop` returns true. Walls that have lost all their
  /// returns to others go then. Throws Error when a solve fails.
  void Adjust();

  /// How badly what was measured fits the poses as they stand: refined odometry
  /// and the matches of scans, each as uncertain as it was said to be, with the
  /// loss of the adjustment. In units of chi-square.
  double Misfit() const;

  /// Whether these poses fit what was measured better than others, from another
  /// start, of which these two numbers are known. A match that there is in one
  /// and not in the other counts there as an outlier: what has come apart fits
  /// better, too.
  bool FitsBetterThan(double misfit, std::int64_t num_relations) const;

  /// The key poses as they stand (KeyPosesOfPlaces).
  std::vector<Pose2> KeyPoses() const;

  /// The features of the places, in the order of the log.
  const std::vector<FeatureId>& places() const { return poses_; }

  /// Matches of scans and votes for walls that are live.
  std::int64_t num_relations() const {
    return static_cast<std::int64_t>(relations_.size());
  }
  std::int64_t num_votes() const {
    return static_cast<std::int64_t>(votes_.size());
  }

 private:
  // Without places in the graph.
  JointAdjustment(Graph* graph, SolverSession* session,
                  const Registry& registry, const std::vector<Scan>& scans,
                  const std::vector<RefinedScan>& refined,
                  const std::vector<KeyScanRecord>& records,
                  const JointAdjustmentOptions& options,
                  std::function<bool()> stop, std::vector<Place> places);
  template <typename Archive>
  void ExchangeState(Archive& archive);
  std::vector<Pose2> PlacePoses() const;
  // Binds every wall that gets votes to the place that gave it most; returns
  // these places by wall.
  std::map<FeatureId, std::size_t> HoldAlong(const std::vector<Pose2>& poses,
                                             Transaction* change) const;
  void Match();
  void Vote();
  // Has `wanted` measurements in place of old ones, whose constraints stay
  // where they are of the same features: most come again, a little changed.
  // Returns the ids of all.
  std::vector<ConstraintId> Replace(const std::vector<ConstraintId>& old,
                                    std::vector<Constraint> wanted) const;
  // Drops walls whose returns have all gone to others.
  void DropWallsWithoutVotes();
  // The information of a match, by the factor and the loss at the poses as they
  // stand.
  Eigen::Matrix3d WeighedInformation(const ScanRelation& relation) const;
  void Reweigh();
  // Solves to the tolerance of the session when `is_last`, else coarsely.
  void Solve(bool is_last);

  Graph* graph_;
  SolverSession* session_;
  const Registry& registry_;
  JointAdjustmentOptions options_;
  std::function<bool()> stop_;
  const std::vector<KeyScanRecord>& records_;
  std::vector<Place> places_;
  // The record that each place begins with.
  std::vector<std::size_t> begins_;
  // By place.
  std::vector<FeatureId> poses_;
  std::unique_ptr<ScanMatchFinder> finder_;
  std::vector<ScanRelation> relations_;
  // By relation.
  std::vector<ConstraintId> relation_constraints_;
  // Of refined odometry, with what it said of its information.
  std::vector<std::pair<ConstraintId, Eigen::Matrix3d>> motions_;
  double motion_factor_ = 1.0;
  double relation_factor_ = 1.0;
  double vote_factor_ = 1.0;
  double vote_excess_ = 1.0;
  // Live vote constraints.
  std::vector<ConstraintId> votes_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_JOINT_ADJUSTMENT_H_
