#ifndef PLUMBLINE_PIPELINE_LOG_SOLVER_H_
#define PLUMBLINE_PIPELINE_LOG_SOLVER_H_

#include <plumbline/core/break_log.h>
#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy_spec.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/joint_adjustment.h>
#include <plumbline/frontend/late_metre.h>
#include <plumbline/frontend/map_builder.h>
#include <plumbline/frontend/map_check.h>
#include <plumbline/frontend/mirrors.h>
#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/point_map_builder.h>
#include <plumbline/frontend/pose_recovery.h>
#include <plumbline/frontend/relocalization.h>
#include <plumbline/frontend/returns_ahead.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/wall_completion.h>
#include <plumbline/frontend/way_check.h>
#include <plumbline/pipeline/known_structure.h>
#include <plumbline/pipeline/loop_closures.h>
#include <plumbline/pipeline/raw_features.h>
#include <plumbline/pipeline/run_control.h>
#include <plumbline/pipeline/solved_map.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

/// How the final trajectory and map are adjusted.
enum class Refinement {
  /// Every pose stays as it was when its scan came in.
  kNone,
  /// Every scan is found again on the final map.
  kMap,
  /// Then poses, walls and structure are adjusted jointly, too.
  kFull,
};

/// Options of turning a log into a map.
struct LogSolverOptions {
  /// What this kind cannot do is off, whatever the options below say.
  RawFeatures features = RawFeatures::kSegments;
  /// Find structure. False: measurements only.
  bool structure = true;
  /// Detectors by level; empty: DefaultHierarchy.
  HierarchySpec hierarchy;
  std::map<std::string, DetectorParameters> detector_parameters;
  OdometryRefinementOptions odometry;
  /// Of segments, and of points.
  MapBuilderOptions builder;
  PointMapBuilderOptions point_builder;
  /// In place of AssociationOptions::max_gap where poses are recovered
  /// (RecoversPoses): the first map's walls are final there, and a wall that
  /// was joined with what goes on behind it bends them.
  double max_gap_of_final_map = 0.0;
  SessionOptions session;
  EmOptions em;
  RelocalizationOptions relocalization;
  /// Close loops once the whole log is in and its structure is found: the EM
  /// loop runs again with same_wall among the detectors of level 0. Needs
  /// structure.
  bool global_association = true;
  /// Standard deviations of positions in the relations between features are
  /// taken this many times larger from then on. Only the last robot pose was
  /// kept, so the relations neglect what their errors have in common, and the
  /// way round a loop would be stiffer than it is: on the public logs walls
  /// seen again lie 3 to 5 of their standard deviations off.
  double closing_position_scale = 3.0;
  /// EmOptions::break_share while closing: a wrong closure bends the map and
  /// must not take right ones with it.
  double closing_break_share = 0.25;
  /// Add walls that no single scan saw well, in the end; with Refinement::kMap
  /// only: full refinement grows all walls anew.
  bool complete_walls = true;
  WallCompletionOptions completion;
  Refinement refine = Refinement::kFull;
  JointAdjustmentOptions adjustment;
  /// Whether programs that read a log take the offset of its laser's ranges
  /// out (FindRangeOffset). The solver itself takes ranges as they are.
  bool range_offset = true;
  /// Compare each part of the final trajectory with what was seen on other
  /// visits, and report those that contradict it, and walls that the robot has
  /// gone through.
  bool check_map = true;
  MapCheckOptions check;
  WayCheckOptions way_check;
  /// Find mirrors once poses are adjusted, and leave out of the walls what was
  /// seen in them; full refinement of segments only.
  bool find_mirrors = true;
  MirrorOptions mirrors;
  LateMetreOptions late_metre;
  /// What is known of the building beforehand; needs structure and full
  /// refinement of segments.
  KnownStructure known;
  /// Scans after which a run can be resumed before all are in: EM and the
  /// minimizer start anew there, and what was broken may be proposed again. 0:
  /// never.
  int scans_per_stage = 20000;
  /// Scans between EM steps while replaying; 0: only at the end.
  int em_every = 20;
  /// Constraints from the robot that an EM step while replaying reaches.
  int em_depth = 3;
  /// While the map has fewer features than this, EM steps take in all of it:
  /// the first orientations come from few walls and are still to move.
  int small_map = 150;
};

/// Result of solving a log; the map itself is the solver's graph.
struct LogSolverResult {
  /// One pose per scan of the log, map frame.
  std::vector<Pose2> trajectory;
  EmReport em;
  CostReport initial_cost;
  CostReport final_cost;
  /// Scans without the EM steps between them; detecting and solving of all EM
  /// steps; finding scans again; completing walls; the second map of full
  /// refinement, with its walls and the EM that follows.
  double frontend_seconds = 0.0;
  double detect_seconds = 0.0;
  double solve_seconds = 0.0;
  double relocalization_seconds = 0.0;
  double completion_seconds = 0.0;
  double adjustment_seconds = 0.0;
  std::int64_t glimpsed_walls = 0;
  /// Of the joint adjustment: matches of key scans with each other, and places
  /// whose returns speak for a wall.
  std::int64_t scan_relations = 0;
  std::int64_t wall_votes = 0;
  /// Seconds that each scan took, EM steps included.
  std::vector<float> scan_seconds;
  std::int64_t key_scans = 0;
  std::int64_t wide_searches = 0;
  std::int64_t refused_matches = 0;
  /// Number of times that the robot was lost, and parts of the track that hang
  /// on the rest of the map or contradict it, in the order of scans.
  std::int64_t lost_tracks = 0;
  std::vector<LooseTrack> loose;
  /// Observations recognized as a raw feature, and raw features made.
  std::int64_t feature_matches = 0;
  std::int64_t features_created = 0;
  /// The second map had hardly any of the walls of the first, which stands.
  bool second_map_refused = false;
  /// The building bends by a little everywhere, which straight walls had drawn
  /// straight (AreBentByWalls): they hold the poses loosely.
  bool loose_walls = false;
  /// Ended early because `stop` said so: what there is, is whole.
  bool interrupted = false;
  /// What the front-end made of each scan and of the key scans: enough to
  /// replay the log in another way (without_structure.h).
  std::vector<RefinedScan> refined;
  std::vector<KeyScanRecord> records;
  /// Mirrors, map frame: what was seen in them is not in the map
  /// (CutAtMirrors).
  std::vector<Mirror> mirrors;
  /// How each broken constraint of the map was broken.
  BreakRecords breaks;
  /// Noise of the laser's ranges (standard deviation, m), and the factor by
  /// which the options' distances were larger for it.
  double range_sigma = 0.0;
  double noise_scale = 1.0;
  /// Of one log, in the end: what a metre of its odometry was taken for, m, and
  /// by how much the robot drove to the left of where its laser looks by the
  /// log, rad (odometry_calibration.h). A scale of 0: of several logs.
  double odometry_scale = 0.0;
  double odometry_course = 0.0;
  /// What became of LogSolverOptions::known, and what was corrected, for
  /// people.
  std::vector<std::string> notes;
  /// Of the first map, where a second one stands for it.
  std::vector<LoopClosure> closures;
};

/// Whether poses are recovered once all scans are in (pose_recovery.h): the map
/// of segments is final, and odometry was refined.
bool RecoversPoses(const LogSolverOptions& options);

/// The options of the recovery of poses that go with those of the log.
PoseRecoveryOptions RecoveryOptions(const LogSolverOptions& options);

/// A scan as a GraphBuilder takes it: `refined` and `returns` are what odometry
/// refinement made of the scan with this index, `noise_scale` is what it
/// allowed for (OdometryRefiner::noise_scale).
KeyScan MakeKeyScan(int index, const Scan& scan, const RefinedScan& refined,
                    const std::vector<ScanPoint>& returns, double noise_scale);

/// Turns the scans of a log into a map: front-end and EM steps near the robot
/// scan by scan, then, once all are in, EM on the whole map, closing of loops,
/// and, with full refinement, a second map on poses that were adjusted without
/// walls (core/method.md, section 7).
///
///     LogSolver solver(registry, {});
///     for (...) robot = solver.AddScan(scan);    // the map so far: graph()
///     const LogSolverResult result = solver.Finish();
///
/// Run does all of it for a log in memory. A solver solves one log.
///
/// Scans are looked at as they come in (RequireUsable in usable_input.h): one
/// with a pose, time, angle or range that is not finite is an Error.
///
/// A run that was killed can be resumed. The state between two stages is small:
/// the map, what the front-end made of the scans, and counts; the minimizer and
/// EM start anew in each stage, whether the run was resumed or not. So a stage
/// depends on these bytes alone (RunControl::checkpoint), and Resume ends with
/// the bytes of a run that was never interrupted. Only the stage that was under
/// way is lost. The stages: taking scans_per_stage scans each; finding their
/// structure; closing loops and finding scans again; adjusting poses; making
/// walls anew; adjusting both; finding structure in these; the end.
class LogSolver {
 public:
  /// The registry must outlive the solver and have the built-ins. Throws Error
  /// when options do not fit, are no numbers, or are counts below 0.
  LogSolver(const Registry& registry, const LogSolverOptions& options);
  ~LogSolver();

  /// Takes the next scan and returns the robot's pose as it is known now (map
  /// frame). The cost does not depend on the size of the map. A copy of the
  /// scan is kept until Finish. Throws Error after Finish or Run, and for a
  /// scan that cannot be used, of which nothing is kept: the next one may
  /// follow.
  Pose2 AddScan(Scan scan);

  /// The pose of every scan so far, found again on the present map (with
  /// Refinement::kNone as it was when the scan came in). Cost: linear in the
  /// scans. Throws Error after Finish or Run: the result has it.
  std::vector<Pose2> Trajectory() const;

  /// Completes the map once all scans are in. Throws Error when called again.
  LogSolverResult Finish(const RunControl& control = {});

  /// AddScan for each scan of the log, which is not copied, then Finish: the
  /// same bytes. Throws Error when scans were added before, or one of the log's
  /// cannot be used.
  LogSolverResult Run(const Log& log, const RunControl& control = {});

  /// Goes on where RunControl::checkpoint made `state`, in a solver with the
  /// same options, registry and log: the same bytes as Run, timings apart.
  /// Throws Error when the state does not fit, or scans were added before.
  LogSolverResult Resume(const Log& log, const std::string& state,
                         const RunControl& control = {});

  /// Run as far as the first map, in which structure is found and loops are
  /// closed, but poses are not adjusted yet: what is left for GoOn. The result
  /// has its trajectory, the refined scans and the records of key scans.
  LogSolverResult RunFirst(const Log& log, const RunControl& control = {});

  /// Does what RunFirst has left. In a new solver `first` may be of a log that
  /// was put together of several (SolveSeveralLogs): `trajectory`, `refined`
  /// and `records` are what the second map is made of, `noise_scale` is what is
  /// allowed for, and `wall_length`, the
  /// length of the walls of the first map, m, is what it is measured by (0: the
  /// solver's own first map).
  LogSolverResult GoOn(const std::vector<Scan>& scans, LogSolverResult first,
                       double wall_length = 0.0,
                       const RunControl& control = {});

  /// The map as it stands: after any scan, and after Finish.
  const Graph& graph() const { return map_.graph(); }
  const SolverSession& session() const { return map_.session(); }
  /// Rows of em_trace.csv: the EM on the whole map at the end.
  const std::vector<EmPhase>& trace() const { return map_.trace(); }

 private:
  // A stage, by what it does.
  enum class Stage : int {
    kTakeScans,
    kFindStructure,
    kCloseLoops,
    kAdjustPoses,
    kMakeWalls,
    kAdjustWalls,
    kFindStructureAgain,
    kEnd,
  };
  struct Context;

  void RequireUnfinished() const;
  void RequireFresh() const;
  struct Processed;

  // Odometry refinement of the next scan, which does not touch the map. Without
  // `returns` they are made here.
  Processed Process(const Scan& scan, ReturnsAhead* returns);
  // Scans that the refiner has settled.
  std::vector<SettledScan> Settled();
  // A scan by itself: key scans enter the map, now and then with an EM step.
  // Takes the next of the scans.
  void TakeScan(const std::vector<Scan>& scans, const Processed& processed);
  // Takes those that are left; stages end on the way.
  void TakeScans(const std::vector<Scan>& scans, const RunControl& control);
  // Those of a stage, refined on a thread of their own ahead of the map where
  // there is one, and returns made for it where this one has nothing to do;
  // false when it is time to stop.
  bool TakeStage(const std::vector<Scan>& scans, const RunControl& control);
  // Whether a stage that began with `begin` scans ends after so many.
  bool EndsStage(std::size_t begin, std::size_t end,
                 const Processed& last) const;
  // Those whose place is settled go on into the map; `noise_scale` as it was
  // when they were (the refiner may be ahead).
  void TakeSettled(const std::vector<Scan>& scans,
                   const std::vector<SettledScan>& all, double noise_scale,
                   double* em_seconds);
  void TakeKeyScan(const std::vector<Scan>& scans, const SettledScan& settled,
                   double noise_scale, double* em_seconds);
  // Makes the map once more: parts of the track that hung loose were found
  // when all scans were in.
  void TakeAnew(const std::vector<Scan>& scans, double* em_seconds);
  // Takes the steps that neither odometry nor the matches noticed into the
  // track, and tells of them.
  std::vector<LooseTrack> CorrectMissedSteps(Context* context);
  void RunEmNearRobot();

  // Allows for the laser's noise in what follows once all scans are in.
  void ScaleToNoise(double scale);
  // The stages once all scans are in, in order.
  LogSolverResult FinishWith(const std::vector<Scan>& scans, Stage end,
                             const RunControl& control);
  // The stages from `stage` on; `end` is kAdjustPoses, which is left then, or
  // kEnd.
  LogSolverResult FinishFrom(Stage stage, Stage end, Context* context);
  void FindStructure(Context* context);
  void CloseLoops(Context* context);
  void BringPosesBack(Context* context);
  void FindScansAgain(Context* context);
  void BeginAtOdometry(Context* context);
  void CompleteWalls(Context* context);
  // The second map, in three stages.
  void AdjustPoses(Context* context);
  void MakeWalls(Context* context);
  void AdjustWalls(Context* context);
  void FindStructureAgain(Context* context);
  void TieToPlan(KnownStructureBinder* known, Context* context);
  // Tells what hangs loosely, or contradicts the rest of the map.
  void CheckMap(Context* context) const;
  // Between stages: all that is left is in the state.
  void BeginStage(Stage stage, Context* context);
  template <typename Archive>
  void ExchangeState(Archive& archive, Stage* stage, Context* context);
  template <typename Archive>
  void ExchangeScansState(Archive& archive);

  void RunEm(Context* context);
  // Loosens the relations between features and lets closures be proposed.
  void BeginClosing(Context* context);
  HierarchySpec HierarchyOfOptions() const;
  Hierarchy StructureDetectors() const;
  Hierarchy MakeDetectors(const HierarchySpec& spec) const;
  std::vector<Pose2> KeyPoses(const std::vector<KeyScanRecord>& records) const;

  const Registry& registry_;
  const RawFeatureProfile& profile_;
  LogSolverOptions options_;
  SolvedMap map_;
  OdometryRefiner refiner_;
  // While scans come in.
  std::unique_ptr<GraphBuilder> builder_;
  // Of AddScan; empty with Run.
  std::vector<Scan> scans_;
  // One per scan.
  std::vector<RefinedScan> refined_;
  std::size_t num_settled_ = 0;
  // Of them, when the present stage began.
  std::size_t stage_begin_ = 0;
  std::vector<float> scan_seconds_;
  double frontend_seconds_ = 0.0;
  // Since the last EM step near the robot.
  int scans_since_em_ = 0;
  std::size_t features_at_last_global_ = 0;
  bool is_finished_ = false;
};

/// Length of the walls of a map (level 0), m.
double LengthOfWalls(const Graph& graph);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_LOG_SOLVER_H_
