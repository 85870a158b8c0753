#ifndef PLUMBLINE_PIPELINE_LOG_SOLVER_H_
#define PLUMBLINE_PIPELINE_LOG_SOLVER_H_

#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/joint_adjustment.h>
#include <plumbline/frontend/map_builder.h>
#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/point_map_builder.h>
#include <plumbline/frontend/relocalization.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/wall_completion.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

/// What the final trajectory and map are adjusted with.
enum class Refinement {
  /// The trajectory is what it was when each scan came in.
  kNone,
  /// Every scan is found again on the final map.
  kMap,
  /// And then poses, walls and structure are adjusted jointly.
  kFull,
};

/// Raw features that a log's scans become: level 0 of the hierarchy.
enum class RawFeatures {
  kSegments,
  kPoints,
};

struct LogSolverOptions {
  /// With points there are no walls at level 0 and hence no global association,
  /// no completion of walls, and no refinement further than Refinement::kMap.
  RawFeatures features = RawFeatures::kSegments;
  /// Find structure. False: measurements only.
  bool structure = true;
  /// Detectors by level (MakeHierarchy); empty: DefaultHierarchy.
  std::string hierarchy;
  std::map<std::string, DetectorParameters> detector_parameters;
  OdometryRefinementOptions odometry;
  /// Of segments, and of points.
  MapBuilderOptions builder;
  PointMapBuilderOptions point_builder;
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
  /// Add walls that no single scan saw well, in the end.
  bool complete_walls = true;
  WallCompletionOptions completion;
  Refinement refine = Refinement::kFull;
  JointAdjustmentOptions adjustment;
  /// Scans between EM steps while replaying; 0: only at the end.
  int em_every = 20;
  /// Constraints from the robot that an EM step while replaying reaches.
  int em_depth = 3;
  /// While the map has fewer features than this, EM steps take in all of it:
  /// the first orientations come from few walls and are still to move.
  int small_map = 150;
};

struct LogSolverResult {
  /// One a scan of the log, map frame.
  std::vector<Pose2> trajectory;
  EmReport em;
  CostReport initial_cost;
  CostReport final_cost;
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
  /// Observations recognized as a raw feature, and raw features made.
  std::int64_t feature_matches = 0;
  std::int64_t features_created = 0;
  /// Ended early because `stop` said so: what there is, is whole.
  bool interrupted = false;
  /// What the front-end made of each scan and of the key scans: enough to
  /// replay the log in another way (without_structure.h).
  std::vector<RefinedScan> refined;
  std::vector<KeyScanRecord> records;
};

/// What grows the graph from a log's scans, by options.features. The graph and
/// registry must outlive it.
std::unique_ptr<GraphBuilder> MakeGraphBuilder(const LogSolverOptions& options,
                                               Graph* graph,
                                               const Registry& registry);

/// A scan as a GraphBuilder takes it: `refined` and `returns` are what odometry
/// refinement made of the scan with this index.
KeyScan MakeKeyScan(int index, const Scan& scan, const RefinedScan& refined,
                    const std::vector<ScanPoint>& returns);

/// Replays a log: front-end, EM steps near the robot on the way, EM on the
/// whole map at the end, and every scan found again on the final map.
class LogSolver {
 public:
  /// The registry must outlive the solver and have the built-ins. Throws Error
  /// when options do not fit.
  LogSolver(const Registry& registry, const LogSolverOptions& options);
  ~LogSolver();

  /// `progress` (may be null) is called with the scans done and in all; `stop`
  /// (may be null) ends the replay when it returns true; `step` (may be null)
  /// is told, in a few words, of each step after the last scan as it begins.
  LogSolverResult Run(
      const Log& log,
      const std::function<void(std::size_t, std::size_t)>& progress = nullptr,
      const std::function<bool()>& stop = nullptr,
      const std::function<void(const char*)>& step = nullptr);

  const Graph& graph() const { return graph_; }
  const SolverSession& session() const { return *session_; }
  /// Rows of em_trace.csv: the EM on the whole map at the end.
  const std::vector<EmPhase>& trace() const { return trace_; }

 private:
  // Loosens the relations between features and lets closures be proposed.
  void BeginClosing();
  // Rows of the trace, counted on over both orchestrators.
  void TraceEm();

  const Registry& registry_;
  LogSolverOptions options_;
  Graph graph_;
  std::unique_ptr<SolverSession> session_;
  std::unique_ptr<EmOrchestrator> em_;
  // Of the orchestrator that was there before closing began.
  EmReport before_closing_;
  std::vector<EmPhase> trace_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_LOG_SOLVER_H_
