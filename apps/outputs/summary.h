#ifndef PLUMBLINE_OUTPUTS_SUMMARY_H_
#define PLUMBLINE_OUTPUTS_SUMMARY_H_

#include <plumbline/core/em.h>
#include <plumbline/core/flag_value.h>
#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Direction and length of a wall.
struct WallDirection {
  /// rad; only its value modulo pi/2 counts.
  double direction = 0.0;
  /// m
  double length = 0.0;
};

/// Over walls of at least 1 m: the RMS deviation in degrees, weighted by
/// length, of the direction from the nearest multiple of 90 degrees off the
/// dominant direction; walls farther than 10 degrees from any multiple are left
/// out (evaluation.md). The dominant direction is the weighted mean, modulo 90
/// degrees, of the walls within 10 degrees of it, started at the direction
/// with the most wall around it. None without any wall of at least 1 m.
std::optional<double> OrthogonalityDeg(const std::vector<WallDirection>& walls);

/// Orthogonality of the walls of a graph (MergeWalls).
std::optional<double> OrthogonalityDeg(const Graph& graph);

/// Most memory that the process has held so far, bytes.
std::int64_t PeakMemoryBytes();

/// Mean of the values in one tenth of a series, counted from 0 to 9 (indices
/// n tenth / 10 up to n (tenth + 1) / 10); none when that tenth is empty.
std::optional<double> MeanOfTenth(const std::vector<double>& values, int tenth);

/// Summary of a run, written as summary.json.
struct Summary {
  /// Constraints of one relation.
  struct ConstraintCounts {
    /// Live ones by class, and broken ones of either.
    std::int64_t measurement = 0;
    std::int64_t structure = 0;
    std::int64_t broken = 0;
  };

  /// The file that was read, and the seed of all that is drawn at random.
  std::string input;
  std::uint64_t seed = 1;
  /// Those that differ from the defaults: ChangedFlags().
  std::vector<FlagValue> flags;
  /// Names of the files that the run wrote beside this one, and their SHA-256
  /// digests by name.
  std::vector<std::string> files;
  std::map<std::string, std::string> digests;
  /// The run was interrupted: the files hold what was done until then.
  bool partial = false;

  /// 0 for a graph.
  std::int64_t scans = 0;
  /// Scans that were read; of a log only.
  std::int64_t scans_in_log = 0;
  /// By type name and level.
  std::map<std::string, std::map<int, std::int64_t>> features;
  /// By relation name.
  std::map<std::string, ConstraintCounts> constraints;

  /// Closures: hypotheses that walls of different visits are one, in the map
  /// and in a first map that it stands for, all that
  /// were taken up, those that still hold, and those that were broken.
  struct Closures {
    std::int64_t proposed = 0;
    std::int64_t live = 0;
    std::int64_t broken = 0;
  };
  Closures closures;

  /// Of a log whose plan was made (BuildingPlan): rooms, doors, and how far the
  /// robot went outside of all rooms, m.
  struct Plan {
    std::int64_t rooms = 0;
    std::int64_t doors = 0;
    double way_outside = 0.0;
  };
  std::optional<Plan> plan;

  /// Sums of squared whitened residuals (CostReport): before anything was
  /// optimized, and at the end.
  double initial_cost = 0.0;
  double measurement_cost = 0.0;
  double structure_cost = 0.0;

  /// Iterations of EM on the whole graph, and why they ended.
  int em_iterations = 0;
  EmTermination em_termination = EmTermination::kNoConvergence;
  /// Whether EM ended without convergence after solves of a graph that did not
  /// reach their tolerance: the state is no minimum.
  bool IsUnsolved() const {
    return em_termination != EmTermination::kConvergence && !partial &&
           solver && !solver->converged;
  }

  /// Seconds.
  double total_seconds = 0.0;
  /// Of reading: what the run waited for it, for how much of that its own
  /// thread did nothing (it waited for the disk, for threads that unpack, for a
  /// processor), and what all threads computed meanwhile.
  struct Reading {
    double seconds = 0.0;
    double idle_seconds = 0.0;
    double cpu_seconds = 0.0;

    /// Adds that of another log, or of another part.
    void Add(const Reading& other) {
      seconds += other.seconds;
      idle_seconds += other.idle_seconds;
      cpu_seconds += other.cpu_seconds;
    }
  };
  Reading reading;
  double frontend_seconds = 0.0;
  double detect_seconds = 0.0;
  double solve_seconds = 0.0;
  double write_seconds = 0.0;
  /// Steps of the run in the order in which they first began, and what each
  /// took: together total_seconds.
  std::vector<std::pair<std::string, double>> step_seconds;

  /// PeakMemoryBytes().
  std::int64_t peak_memory_bytes = 0;
  /// Deviation of the directions of walls from right angles (OrthogonalityDeg).
  std::optional<double> orthogonality_deg;

  /// Of a graph only: what the start placed (InitialGuessReport) and all solves
  /// together did.
  struct Solver {
    std::int64_t start_poses = 0;
    std::int64_t start_landmarks = 0;
    std::int64_t start_kept = 0;
    double start_seconds = 0.0;
    int solves = 0;
    /// Every solve reached its tolerance.
    bool converged = true;
    /// Where not: what may help, for people ("--initial_guess=chordal may
    /// help"). Not in summary.json.
    std::string hint;
    /// Steps computed, each a factorization.
    int iterations = 0;
    double evaluation_seconds = 0.0;
    double linear_solver_seconds = 0.0;
    /// Building, ordering, copying.
    double setup_seconds = 0.0;
  };
  std::optional<Solver> solver;

  /// Of a log only: how the track of the robot hangs together.
  struct Tracking {
    /// A part of the track that is tied to the rest by a guess or a single
    /// match: time stamps of the last scan before it that is sure and of its
    /// own last one (of the first one that was matched), s, and what happened.
    struct Loose {
      double begin = 0.0;
      double end = 0.0;
      std::string why;
    };
    std::vector<Loose> loose;
    /// Parts of the map whose places to each other are not a guess.
    std::int64_t pieces = 1;
  };
  Tracking tracking;

  /// Of a log only: a mirror, or another thing that reflects the laser, from
  /// one end to the other, m, seen from its left; of the returns seen in it
  /// that were looked at, the share that lies on images of what stands before
  /// it.
  struct Mirror {
    Eigen::Vector2d begin = Eigen::Vector2d::Zero();
    Eigen::Vector2d end = Eigen::Vector2d::Zero();
    std::int64_t returns = 0;
    double share = 0.0;
  };
  std::vector<Mirror> mirrors;

  /// Of a log only: how all outputs were moved, m and rad. What lay at p in the
  /// frame of the solver lies at TransformPoint(*alignment, p); none when
  /// nothing was moved.
  std::optional<Pose2> alignment;

  /// One of several logs that were solved together.
  struct LogInput {
    /// The file, and its trajectory among the outputs; empty when that was not
    /// written.
    std::string input;
    std::string trajectory;
    std::int64_t scans = 0;
    /// Folder of its map below the output folder; empty: the output folder.
    std::string map;
    /// How it was placed among the logs before it in this map: parts of it that
    /// were compared with what they saw, those that agree with it, those that
    /// contradict it. All 0 for the first log of a map.
    int parts = 0;
    int agreeing = 0;
    int contradicting = 0;
    /// Where it or the rest of the map has wall that the other looks through.
    int changed_places = 0;
    /// What is to be said of its place though it was placed; empty when it is
    /// clear.
    std::string uncertain;
    /// Why it was kept apart; empty when it was not.
    std::string why_apart;
    /// Where it may begin all the same, in the first map's frame, m and rad:
    /// --start_pose puts it there.
    std::optional<Pose2> candidate;
  };
  /// Empty where there is one.
  std::vector<LogInput> logs;

  /// Of a log only (scans > 0): what was passed over, and the time that each
  /// scan took, s, in the order of scans; may be empty.
  std::vector<SkipReport> skipped;
  std::vector<double> scan_seconds;
  /// Of a log without odometry: m of the way along which the scans do not tell
  /// how far the robot went; 0: too little to mention.
  double open_way = 0.0;
  /// Of a log: noise of the laser's ranges (standard deviation, m).
  double range_noise = 0.0;
  /// Of a log: by how much they were too long, m (negative: too short), which
  /// was taken out; 0: by nothing that shows. Of several logs the notes tell.
  double range_offset = 0.0;
  /// Of one log: what a metre of its odometry was taken for, m, and by how much
  /// the robot drove to the left of where its laser looks by the log, rad. A
  /// scale of 0: of several logs; neither is written.
  double odometry_scale = 0.0;
  double odometry_course = 0.0;
  /// Of a log only: its format, what gave the scans and the odometry, and what
  /// was taken for granted, for people. Empty: not written.
  std::string log_format;
  std::string scan_source;
  std::string odometry_source;
  std::vector<std::string> notes;
};

/// Fills in features, constraints, closures and orthogonality_deg.
void CountGraph(const Graph& graph, Summary* summary);

/// The part `counts` of summary.json, as JSON text.
std::string CountsAsJson(const Summary& summary);

/// Writes the keys of the product's contract, in its order: input, seed, flags,
/// counts {scans, features {type {level}}, constraints {type {measurement,
/// structure, broken}}}, cost {initial, measurement, structure, total}, em
/// {iterations, converged, termination}, time_s {total, parse, frontend,
/// detect, solve, write, steps {name}}, peak_memory_bytes, orthogonality_deg
/// (null when there is no wall), closures {proposed, live, broken}, version,
/// files, sha256 {file}, partial (the run was interrupted; for a log `scans`
/// then says how many were solved, and `scans_in_log` how many there are); for
/// a graph also solver {objective (cost.total), iterations, solves, converged,
/// evaluation_s, linear_solver_s, setup_s, start {poses, landmarks, kept,
/// seconds}}; for a log also frontend {skipped [{reason, count, first_lines}],
/// scan_seconds_second_tenth, scan_seconds_last_tenth, scan_seconds_growth
/// (their quotient), range_noise_m (of the laser, as the scans show it),
/// range_offset_m (by which its ranges were too long, and which was taken out),
/// odometry_scale, odometry_course_deg (what a metre of odometry was taken for,
/// and by how much the robot drove to the left of where its laser looks),
/// open_way_m (along which nothing tells how far the robot went; of logs
/// without odometry), format, scans, odometry (names; of logs that tell), notes
/// [text]}, tracking {pieces, loose [{begin, end, why}]}, where a plan was made
/// plan {rooms, doors, way_outside_m (of the robot, in no room; stretches of
/// over 2 m)}, where mirrors were found mirrors [{begin, end (each [x, y]),
/// width_m, returns, share}], where the outputs were moved alignment {kind, x,
/// y, theta_deg} (m and degrees), and where there were several logs
/// [{input, trajectory (or null), scans, map, parts, agreeing, contradicting,
/// changed_places, uncertain (why it may be another building; or null),
/// why_apart (or null), candidate ([x, y, degrees] that --start_pose takes; or
/// null)}]. Numbers that are not finite become null.
void WriteSummary(const Summary& summary, std::ostream& output);

/// Writes it to a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteSummary(const Summary& summary, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_SUMMARY_H_
