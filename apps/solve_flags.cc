#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/detector_parameters.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/detectors/structure_prior.h>
#include <plumbline/pipeline/plan_dxf.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>

DEFINE_string(
    input, "",
    "Robot log (ROS 1 or 2 bag, a file or a folder; CARMEN; CSV) or graph "
    "(g2o), plain or compressed; - reads standard input. Several "
    "logs of one building, separated by commas, become one map");
DEFINE_string(output_dir, "", "Folder for the results; made if missing");
DEFINE_string(live_dir, "",
              "Folder, other than --output_dir, for a report.html that shows "
              "the map while the run is under way and renews itself");
DEFINE_double(live_every, 5.0,
              "Seconds between two pages of --live_dir; more where making them "
              "would take over 5 % of the time");
PLUMBLINE_FLAG_RANGE(live_every, 0.01, 86400.0);
DEFINE_string(log_reader, "",
              "Format of the log; empty: recognized by content");
DEFINE_string(
    map, "",
    "map.json of an earlier run on logs of the same building: its map "
    "is continued with --input, in its frame. Ends with status 4, and "
    "writes nothing, when a log fits nowhere in it");
DEFINE_bool(localize, false,
            "Only find --input in --map, which stays as it is: "
            "trajectory.tum has the poses in its frame");
DEFINE_string(plan, "",
              "Drawing of the building (DXF as text): walls of the map that "
              "agree with its lines are tied to them, and let go where the "
              "measurements contradict the plan. It may lie anywhere");
DEFINE_string(
    plan_layers, "",
    "Layers of --plan, separated by commas; WALL* stands for all that "
    "begin so. Empty: WALL* and A-WALL*");
DEFINE_string(plan_pose, "",
              "Where the origin of --plan lies in the map and how the plan is "
              "turned there, roughly, as x,y,degrees; empty: found by what "
              "walls and plan have in common");
DEFINE_double(plan_sigma, 0.03,
              "Tolerance of a wall against its line of --plan, m");
PLUMBLINE_FLAG_RANGE(plan_sigma, 0.001, 1);
DEFINE_string(constraints, "",
              "File of what is known of walls: which are one, how far apart, "
              "parallel or at right angles");
DEFINE_string(
    start_pose, "",
    "Where the first scan of a log is in the frame of the first "
    "log's map (or of --map), roughly, as log:x,y,degrees, several "
    "separated by slashes (2:3.5,-1,90/3:0,0,0); empty: found by what "
    "the logs saw");

DEFINE_string(
    initial_guess, "file",
    "Where the solve of a graph starts: file, odometry (each pose "
    "from the one before), spanning_tree (along the ways of the least "
    "uncertain heading), chordal (linear: headings, then positions)");
PLUMBLINE_FLAG_CHOICES(initial_guess, "file", "odometry", "spanning_tree",
                       "chordal");
DEFINE_int32(
    max_solver_iterations, 500,
    "Most steps of one solve of a graph; those of a log have their own "
    "bound");
PLUMBLINE_FLAG_RANGE(max_solver_iterations, 1, 1e9);
DEFINE_string(
    information_frame, "first",
    "Frame of the information of relative poses in a graph's file: "
    "first (that of the first pose: error is inverse(p1) (+) p2 minus "
    "what was measured), second (that of the second pose as measured: "
    "error is inverse(measured) (+) inverse(p1) (+) p2, as g2o has "
    "it). They agree where x and y are equally well known");
PLUMBLINE_FLAG_CHOICES(information_frame, "first", "second");

DEFINE_string(
    outputs, "default",
    "Files to write beside summary.json: all, default (those that are "
    "written without this flag), none, or names separated by commas; "
    "a minus in front takes one out: -report.html,-occupancy.pgm. "
    "Files that an earlier run wrote into the folder and this one "
    "does not are removed");
DEFINE_string(marginals, "none",
              "Features whose covariance goes into map.json: types, numbers of "
              "features, all, separated by commas; none: no covariances");
DEFINE_bool(marginals_hold_gauge, false,
            "Take the first feature of a part of the graph that nothing ties "
            "to the plane as known, for --marginals; false: an error there");
DEFINE_double(ellipse_sigmas, 0.0,
              "Standard deviations of the ellipses drawn into map.svg and "
              "map.png around the positions of --marginals; 0: none");
PLUMBLINE_FLAG_RANGE(ellipse_sigmas, 0.0, 1000.0);
DEFINE_string(align, "none",
              "Frame of all outputs: none (that of odometry: the first pose is "
              "as the log has it); "
              "building (turned and shifted so that the walls run along x and "
              "y and lie in the first quadrant; summary.json has the "
              "transform)");
PLUMBLINE_FLAG_CHOICES(align, "none", "building");
DEFINE_double(
    grid_resolution, 0.05,
    "Side of a cell of occupancy.pgm, m; at least 0.1 when interrupted. A map "
    "of more than 100000000 such cells, width times height, gets no grid");
PLUMBLINE_FLAG_RANGE(grid_resolution, 0.001, 10.0);

DEFINE_double(
    checkpoint_every, 60.0,
    "Shortest time between two states of a run on a log that are kept in the "
    "output folder (at the ends of stages), s; the same command goes on from "
    "there after the process was killed. 0: none is written or read");
PLUMBLINE_FLAG_RANGE(checkpoint_every, 0.0, 1e9);

DEFINE_bool(structure, true,
            "Find structure; false: measurements only, also of a graph that "
            "has structure");
DEFINE_string(hierarchy, "",
              "Detectors by level, levels separated by /, detectors of a level "
              "by commas; empty: by input (segments: "
              "orientation_mixture/orientation_relation; points: "
              "line_ransac,circle_ransac/center_cluster,orientation_mixture/"
              "orientation_relation)");
DEFINE_string(detector_parameters, "",
              "Parameters of detectors other than their defaults, as "
              "detector.name=value, separated by commas; they come before the "
              "flags that say the same");
DEFINE_string(allowed_angles, "0,45,90,135",
              "Angles between orientations that are looked for, degrees from "
              "-360 to 360, separated by commas");
DEFINE_double(angle_resolution, 0.0,
              "Look for all multiples of this angle in place of "
              "--allowed_angles, degrees, at least 0.01; 0: not set");
PLUMBLINE_FLAG_RANGE(angle_resolution, 0.0, 90.0);
DEFINE_string(structure_prior, "",
              "File that says which relations and angles are expected, and how "
              "tightly; it goes before the flags that say the same");
DEFINE_double(structure_sigma_segment_orientation, 0.1,
              "Tolerance of a wall or line against its orientation, degrees; "
              "in the final map of a log the error of a wall itself comes on "
              "top, about 2 degrees for 1 m and less for longer ones");
PLUMBLINE_FLAG_RANGE(structure_sigma_segment_orientation, 1e-3, 45.0);
DEFINE_double(structure_sigma_orientation_orientation, 0.02,
              "Tolerance of the angle between two orientations, degrees");
PLUMBLINE_FLAG_RANGE(structure_sigma_orientation_orientation, 1e-3, 45.0);
DEFINE_double(structure_sigma_point_line_distance, 0.02,
              "Tolerance of a point against its line, m");
PLUMBLINE_FLAG_RANGE(structure_sigma_point_line_distance, 1e-5, 10.0);
DEFINE_double(structure_sigma_point_circle_distance, 0.02,
              "Tolerance of a point against its circle, m");
PLUMBLINE_FLAG_RANGE(structure_sigma_point_circle_distance, 1e-5, 10.0);
DEFINE_double(structure_sigma_point_point_coincidence, 0.05,
              "Tolerance of the centre of a circle against a common centre, m");
PLUMBLINE_FLAG_RANGE(structure_sigma_point_point_coincidence, 1e-5, 10.0);

DEFINE_double(structure_sigma_same_wall, 0.05,
              "Tolerance of a wall seen on two visits against itself, across, "
              "m");
PLUMBLINE_FLAG_RANGE(structure_sigma_same_wall, 1e-4, 1.0);
DEFINE_double(structure_sigma_same_wall_angle, 0.3,
              "The same in direction, degrees");
PLUMBLINE_FLAG_RANGE(structure_sigma_same_wall_angle, 1e-3, 45.0);

DEFINE_double(delta_threshold, 0.3,
              "Break structure whose delta (p-value) is below it");
PLUMBLINE_FLAG_RANGE(delta_threshold, 0.0, 1.0);
DEFINE_string(full_weight_test, "auto",
              "Judge structure by a solve in which all of it has its full "
              "weight, in place of the weights of the last test: true, false, "
              "auto (true for points)");
PLUMBLINE_FLAG_CHOICES(full_weight_test, "auto", "true", "false");
DEFINE_string(delta_mode, "frozen",
              "Weighting of structure: frozen, continuous, huber, cauchy, "
              "tukey, geman_mcclure, dcs");
PLUMBLINE_FLAG_CHOICES(delta_mode, "frozen", "continuous", "huber", "cauchy",
                       "tukey", "geman_mcclure", "dcs");
DEFINE_string(minimizer, "resident",
              "Solves but small ones: ceres, resident (keeps the analysis of "
              "the graph between solves)");
PLUMBLINE_FLAG_CHOICES(minimizer, "ceres", "resident");
DEFINE_int32(em_every, 20,
             "Scans between EM steps while replaying; 0: only at the end");
PLUMBLINE_FLAG_RANGE(em_every, 0, 1e9);
DEFINE_int32(em_max_iterations, 50, "Most EM iterations at the end");
PLUMBLINE_FLAG_RANGE(em_max_iterations, 1, 100000);

DEFINE_string(features, "segments",
              "Raw features that a log's scans become: segments, or points "
              "(on walls, bound by distances; no loops are closed, and the "
              "final refinement is that of the map)");
PLUMBLINE_FLAG_CHOICES(features, "segments", "points");
DEFINE_bool(odometry_refinement, true,
            "Match each scan to what was seen last before association");
DEFINE_bool(range_offset, true,
            "Find by how much the laser's ranges are all too long or too "
            "short, from how scans that follow each other match, and take it "
            "out");
DEFINE_bool(mirrors, true,
            "Find mirrors, in which what stands before them is seen once more "
            "behind an opening, and leave it out of the map");
DEFINE_double(link_radius, 10.0,
              "Feature links are kept so far around the robot, m");
PLUMBLINE_FLAG_RANGE(link_radius, 0.5, 1000.0);
DEFINE_int32(association_depth, 3,
             "Links from the robot searched for association");
PLUMBLINE_FLAG_RANGE(association_depth, 1, 100);
DEFINE_bool(global_association, true,
            "Close loops: walls seen on different visits are proposed to be "
            "one, as structure that is weighed and broken like any other");
DEFINE_string(refine, "full",
              "What the final trajectory and map are adjusted with: none, map "
              "(every scan found again on the final map), or full (poses, "
              "walls and structure jointly)");
PLUMBLINE_FLAG_CHOICES(refine, "none", "map", "full");
DEFINE_double(usable_range, 50.0, "Returns farther away are left out, m");
PLUMBLINE_FLAG_RANGE(usable_range, 0.5, 10000.0);

DEFINE_string(scan_topic, "",
              "Topic of a bag's laser scans; empty: the only one that may be "
              "meant");
DEFINE_string(
    odometry_topic, "",
    "Topic of a bag's odometry, tf (the transform of odom to the "
    "robot) or none; empty: the only topic that may be meant, else tf, else "
    "none");

DEFINE_string(laser_start_angle, "",
              "Direction of the first beam, degrees; empty: as the log says or "
              "by the number of beams");
DEFINE_string(laser_step, "", "Angle between beams, degrees; empty: as above");
DEFINE_string(laser_max_range, "",
              "Readings from here on are no return, m; empty: as the log says");

DEFINE_uint64(seed, 1,
              "Seed of everything random: the search for lines and circles "
              "through points. Segments of a log draw nothing, so that their "
              "maps do not depend on it");
DEFINE_int32(num_threads, 0,
             "Threads; 0: all cores. The results do not depend on it");
PLUMBLINE_FLAG_RANGE(num_threads, 0, 1024);
DEFINE_string(plugins, "", "Shared objects to load, separated by commas");
DEFINE_bool(list_plugins, false,
            "Print what is registered under which name, and end");

namespace plumbline {
namespace {

// Bytes.
constexpr std::size_t kLargestPrior = std::size_t{1} << 24;
// Degrees; as orientation_relation has it.
constexpr double kSmallestResolution = 0.01;

std::optional<double> ParseOptional(const std::string& flag,
                                    const std::string& text) {
  if (text.empty()) return std::nullopt;
  double value = 0.0;
  const auto result =
      std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec != std::errc() || result.ptr != text.data() + text.size() ||
      !std::isfinite(value)) {
    throw FlagError(flag, "cannot read '" + text + "'", "a number");
  }
  return value;
}

// Throws unless a flag's value is what was expected.
void Require(const std::string& flag, const std::string& value, bool is_so,
             const std::string& expected) {
  if (!is_so) throw FlagError(flag, "is " + value, expected);
}

std::vector<double> ParseList(const std::string& flag,
                              const std::string& text) {
  std::vector<double> values;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    std::size_t end = text.find(',', begin);
    if (end == std::string::npos) end = text.size();
    const auto value = ParseOptional(flag, text.substr(begin, end - begin));
    if (!value) {
      throw FlagError(flag, "an empty entry in '" + text + "'",
                      "numbers separated by commas");
    }
    values.push_back(*value);
    begin = end + 1;
  }
  return values;
}

// Refuses values that no detector takes, in the name of the flag that gave
// them.
void CheckDetectorParameters(
    const Registry& registry,
    const std::map<std::string, DetectorParameters>& parameters) {
  const auto given = ParseDetectorParameters(FLAGS_detector_parameters);
  for (const auto& [detector, values] : parameters) {
    // What the other flags say of directions has limits that only the detector
    // knows.
    const std::string flag = given.count(detector) > 0 ? "detector_parameters"
                             : FLAGS_angle_resolution > 0.0 ? "angle_resolution"
                                                            : "allowed_angles";
    ForFlag(flag, [&registry, &name = detector, &given_values = values] {
      registry.GetDetector(name).make(given_values);
    });
  }
}

// Parameters of detectors by flags of their own, then those of
// --detector_parameters, which win.
std::map<std::string, DetectorParameters> DetectorParametersFromFlags(
    const Registry& registry) {
  std::map<std::string, DetectorParameters> parameters;
  const auto set = [&](const std::string& detector, const std::string& name,
                       double value) {
    if (registry.FindDetector(detector) != nullptr) {
      parameters[detector][name] = value;
    }
  };
  set("orientation_mixture", "sigma_deg",
      FLAGS_structure_sigma_segment_orientation);
  set("orientation_relation", "sigma_deg",
      FLAGS_structure_sigma_orientation_orientation);
  set("line_ransac", "sigma", FLAGS_structure_sigma_point_line_distance);
  set("circle_ransac", "sigma", FLAGS_structure_sigma_point_circle_distance);
  set("center_cluster", "sigma", FLAGS_structure_sigma_point_point_coincidence);
  set("same_wall", "sigma_offset", FLAGS_structure_sigma_same_wall);
  set("same_wall", "sigma_angle_deg", FLAGS_structure_sigma_same_wall_angle);
  if (FLAGS_angle_resolution > 0.0) {
    std::string value;
    AppendNumber(FLAGS_angle_resolution, &value);
    Require("angle_resolution", value,
            FLAGS_angle_resolution >= kSmallestResolution,
            "0, or 0.01 to 90 degrees");
    set("orientation_relation", "resolution_deg", FLAGS_angle_resolution);
  } else {
    const std::vector<double> angles =
        ParseList("allowed_angles", FLAGS_allowed_angles);
    for (std::size_t i = 0; i < angles.size(); ++i) {
      Require("allowed_angles", "'" + FLAGS_allowed_angles + "'",
              std::abs(angles[i]) <= 360.0,
              "degrees within a turn, separated by commas");
      set("orientation_relation", "angle_" + std::to_string(i), angles[i]);
    }
  }
  for (const auto& [detector, values] :
       ParseDetectorParameters(FLAGS_detector_parameters)) {
    for (const auto& [name, value] : values) parameters[detector][name] = value;
  }
  CheckDetectorParameters(registry, parameters);
  return parameters;
}

EmOptions EmOptionsFromFlags(RawFeatures features) {
  EmOptions options;
  options.delta_threshold = FLAGS_delta_threshold;
  options.full_weight_test = FLAGS_full_weight_test == "true" ||
                             (FLAGS_full_weight_test == "auto" &&
                              ProfileOf(features).full_weight_test);
  options.max_iterations = FLAGS_em_max_iterations;
  options.seed = FLAGS_seed;
  return options;
}

// All that is done with scans.
void TakeFrontEndFlags(LogSolverOptions* options) {
  options->odometry.match_scans = FLAGS_odometry_refinement;
  options->odometry.prepare_ahead = NumThreadsFromFlags() > 1;
  options->range_offset = FLAGS_range_offset;
  options->find_mirrors = FLAGS_mirrors;
  options->mirrors.returns.usable_range =
      std::min(options->mirrors.returns.usable_range, FLAGS_usable_range);
  options->odometry.points.usable_range = FLAGS_usable_range;
  options->builder.link_radius = FLAGS_link_radius;
  options->builder.association_depth = FLAGS_association_depth;
  options->point_builder.link_radius = FLAGS_link_radius;
  options->point_builder.association_depth = FLAGS_association_depth;
  options->em_every = FLAGS_em_every;
  options->global_association = FLAGS_global_association;
  options->refine = FLAGS_refine == "none"  ? Refinement::kNone
                    : FLAGS_refine == "map" ? Refinement::kMap
                                            : Refinement::kFull;
  options->adjustment.points = options->odometry.points;
  options->adjustment.num_threads = NumThreadsFromFlags();
  options->check.points = options->odometry.points;
  options->check.num_threads = NumThreadsFromFlags();
  options->way_check.num_threads = NumThreadsFromFlags();
  options->completion.num_threads = NumThreadsFromFlags();
}

// Throws when a flag was given this value, which needs segments. A default of
// the same value is passed over.
void RefuseForPoints(const std::string& flag, const std::string& value,
                     const std::string& why) {
  const gflags::CommandLineFlagInfo info =
      gflags::GetCommandLineFlagInfoOrDie(flag.c_str());
  if (info.is_default || info.current_value != value) return;
  throw Error("--" + flag, 0,
              "'" + value + "' does not go with --features=points: " + why,
              "another value, or --features=segments");
}

}  // namespace

std::vector<FlagGroup> SolveFlagGroups() {
  return {
      {"Input and output",
       {"input", "output_dir", "live_dir", "live_every", "log_reader", "map",
        "localize", "start_pose", "outputs", "align", "grid_resolution"}},
      {"Known beforehand",
       {"plan", "plan_layers", "plan_pose", "plan_sigma", "constraints"}},
      {"Graphs", GraphFlags()},
      {"Uncertainty", {"marginals", "marginals_hold_gauge", "ellipse_sigmas"}},
      {"Structure",
       {"structure", "hierarchy", "structure_prior", "detector_parameters",
        "allowed_angles", "angle_resolution",
        "structure_sigma_segment_orientation",
        "structure_sigma_orientation_orientation", "structure_sigma_same_wall",
        "structure_sigma_same_wall_angle",
        "structure_sigma_point_line_distance",
        "structure_sigma_point_circle_distance",
        "structure_sigma_point_point_coincidence"}},
      {"Expectation maximization",
       {"delta_threshold", "delta_mode", "full_weight_test", "em_every",
        "em_max_iterations", "minimizer"}},
      {"Front-end",
       {"features", "range_offset", "mirrors", "odometry_refinement",
        "link_radius", "association_depth", "global_association", "refine",
        "usable_range"}},
      {"Bags", {"scan_topic", "odometry_topic"}},
      {"Laser", {"laser_start_angle", "laser_step", "laser_max_range"}},
      {"Running",
       {"seed", "num_threads", "checkpoint_every", "plugins", "list_plugins",
        "quiet", "verbose"}},
  };
}

std::vector<std::string> GraphFlags() {
  return {"initial_guess", "max_solver_iterations", "information_frame"};
}

std::vector<std::string> StructureFlags() {
  return {"hierarchy",
          "structure_prior",
          "detector_parameters",
          "allowed_angles",
          "angle_resolution",
          "structure_sigma_segment_orientation",
          "structure_sigma_orientation_orientation",
          "structure_sigma_same_wall",
          "structure_sigma_same_wall_angle",
          "structure_sigma_point_line_distance",
          "structure_sigma_point_circle_distance",
          "structure_sigma_point_point_coincidence",
          "delta_threshold",
          "delta_mode",
          "full_weight_test"};
}

std::vector<std::string> LogFlags() {
  return {"align",
          "plan",
          "plan_layers",
          "plan_pose",
          "plan_sigma",
          "constraints",
          "map",
          "localize",
          "grid_resolution",
          "checkpoint_every",
          "em_every",
          "features",
          "range_offset",
          "mirrors",
          "odometry_refinement",
          "link_radius",
          "start_pose",
          "association_depth",
          "global_association",
          "refine",
          "usable_range",
          "laser_start_angle",
          "laser_step",
          "laser_max_range",
          "scan_topic",
          "odometry_topic"};
}

namespace {

constexpr std::size_t kLargestPlan = std::size_t{1} << 28;
constexpr std::size_t kLargestConstraints = std::size_t{1} << 20;

void TakeKnownStructureFlags(LogSolverOptions* options) {
  KnownStructure& known = options->known;
  known.plan_sigma_offset = FLAGS_plan_sigma;
  for (const std::string* file : {&FLAGS_plan, &FLAGS_constraints}) {
    if (file->empty() ||
        (options->structure && options->features == RawFeatures::kSegments &&
         options->refine == Refinement::kFull)) {
      continue;
    }
    throw Error(file == &FLAGS_plan ? "--plan" : "--constraints", 0,
                "does not go with --structure=false, --features=points, "
                "--refine=map or --refine=none",
                "structure, segments and full refinement");
  }
  if (!FLAGS_plan.empty()) {
    std::vector<std::string> layers;
    std::istringstream list(FLAGS_plan_layers);
    std::string layer;
    while (std::getline(list, layer, ',')) {
      if (!layer.empty()) layers.push_back(layer);
    }
    known.plan = ReadPlanDxf(ReadTextInput(FLAGS_plan, kLargestPlan),
                             FLAGS_plan, layers, &known.notes);
    if (!FLAGS_plan_pose.empty()) {
      const std::vector<double> pose = ParseList("plan_pose", FLAGS_plan_pose);
      if (pose.size() != 3) {
        throw FlagError("plan_pose", "is '" + FLAGS_plan_pose + "'",
                        "x,y,degrees: 3.5,-1,90");
      }
      known.plan_pose =
          Pose2(pose[0], pose[1], NormalizeAngle(DegToRad(pose[2])));
    }
  }
  if (!FLAGS_constraints.empty()) {
    known.statements = ReadWallStatements(
        ReadTextInput(FLAGS_constraints, kLargestConstraints),
        FLAGS_constraints);
  }
}

}  // namespace

LogSolverOptions LogSolverOptionsFromFlags(const Registry& registry) {
  LogSolverOptions options;
  if (FLAGS_features == "points") {
    options.features = RawFeatures::kPoints;
    RefuseForPoints("global_association", "true", "same_wall reads segments");
    RefuseForPoints("refine", "full", "returns vote for segments");
  }
  options.structure = FLAGS_structure;
  options.hierarchy = ParseHierarchy(FLAGS_hierarchy);
  options.detector_parameters = DetectorParametersFromFlags(registry);
  options.session.delta_mode = FLAGS_delta_mode;
  options.session.minimizer = FLAGS_minimizer;
  if (FLAGS_minimizer == "resident") {
    options.session.num_threads = NumThreadsFromFlags();
  }
  options.em = EmOptionsFromFlags(options.features);
  if (!FLAGS_structure_prior.empty()) {
    std::istringstream text(
        ReadTextInput(FLAGS_structure_prior, kLargestPrior));
    ApplyStructurePrior(
        ReadStructurePrior(text, FLAGS_structure_prior, registry), &options.em,
        &options.detector_parameters);
  }
  TakeFrontEndFlags(&options);
  TakeKnownStructureFlags(&options);
  return options;
}

GraphSolverOptions GraphSolverOptionsFromFlags(const Registry& registry) {
  LogSolverOptions of_log = LogSolverOptionsFromFlags(registry);
  GraphSolverOptions options;
  options.structure = of_log.structure;
  options.hierarchy = std::move(of_log.hierarchy);
  options.detector_parameters = std::move(of_log.detector_parameters);
  options.session = of_log.session;
  options.session.max_iterations = FLAGS_max_solver_iterations;
  options.em = std::move(of_log.em);
  if (FLAGS_full_weight_test != "auto") {
    options.full_weight_test = FLAGS_full_weight_test == "true";
  }
  return options;
}

InitialGuessOptions InitialGuessOptionsFromFlags() {
  InitialGuessOptions options;
  options.method =
      FLAGS_initial_guess == "odometry" ? InitialGuessMethod::kOdometry
      : FLAGS_initial_guess == "spanning_tree"
          ? InitialGuessMethod::kSpanningTree
      : FLAGS_initial_guess == "chordal" ? InitialGuessMethod::kChordal
                                         : InitialGuessMethod::kFile;
  return options;
}

G2oOptions G2oOptionsFromFlags() {
  G2oOptions options;
  options.information_at_second = FLAGS_information_frame == "second";
  return options;
}

OccupancyOptions OccupancyOptionsFromFlags() {
  OccupancyOptions options;
  options.resolution = FLAGS_grid_resolution;
  options.usable_range = FLAGS_usable_range;
  options.num_threads = NumThreadsFromFlags();
  return options;
}

LaserOptions LaserOptionsFromFlags() {
  LaserOptions options;
  options.laser_start_angle =
      ParseOptional("laser_start_angle", FLAGS_laser_start_angle);
  if (options.laser_start_angle) {
    Require("laser_start_angle", FLAGS_laser_start_angle,
            std::abs(*options.laser_start_angle) <= 360.0,
            "degrees within a turn");
    options.laser_start_angle = DegToRad(*options.laser_start_angle);
  }
  options.laser_step = ParseOptional("laser_step", FLAGS_laser_step);
  if (options.laser_step) {
    Require("laser_step", FLAGS_laser_step,
            *options.laser_step != 0.0 && std::abs(*options.laser_step) <= 180,
            "degrees, not zero and within half a turn");
    options.laser_step = DegToRad(*options.laser_step);
  }
  options.laser_max_range =
      ParseOptional("laser_max_range", FLAGS_laser_max_range);
  if (options.laser_max_range) {
    Require("laser_max_range", FLAGS_laser_max_range,
            *options.laser_max_range > 0.0, "metres above 0");
  }
  options.scan_topic = FLAGS_scan_topic;
  options.odometry_topic = FLAGS_odometry_topic;
  return options;
}

int NumThreadsFromFlags() {
  // Asked for once: a run that began with fewer keeps to them.
  static const int threads = [] {
    const unsigned cores = std::thread::hardware_concurrency();
    const int wanted = FLAGS_num_threads > 0 ? FLAGS_num_threads
                       : cores > 0           ? static_cast<int>(cores)
                                             : 1;
    return GrantedThreads(wanted);
  }();
  return threads;
}

std::vector<std::string> InputsFromFlags() {
  std::error_code ignored;
  if (FLAGS_input.find(',') == std::string::npos ||
      std::filesystem::exists(FLAGS_input, ignored)) {
    return {FLAGS_input};
  }
  std::vector<std::string> names;
  std::istringstream list(FLAGS_input);
  std::string name;
  while (std::getline(list, name, ',')) {
    if (!name.empty()) names.push_back(name);
  }
  return names;
}

void RefuseFlagsWithoutEffect() {
  const auto needs = [](const char* flag, bool has_needed, const char* needed) {
    const gflags::CommandLineFlagInfo info =
        gflags::GetCommandLineFlagInfoOrDie(flag);
    if (has_needed || info.current_value == info.default_value) return;
    throw Error("--" + std::string(flag), 0, "has no effect here",
                std::string(needed) + " with it");
  };
  for (const char* flag : {"plan_layers", "plan_pose", "plan_sigma"}) {
    needs(flag, !FLAGS_plan.empty(), "--plan");
  }
  needs("live_every", !FLAGS_live_dir.empty(), "--live_dir");
  needs("marginals_hold_gauge", FLAGS_marginals != "none", "--marginals");
}

std::vector<std::optional<Pose2>> StartPosesFromFlags(std::size_t num_logs) {
  std::vector<std::optional<Pose2>> starts(num_logs);
  const std::size_t first_log = FLAGS_map.empty() ? 2 : 1;
  if (!FLAGS_start_pose.empty() && num_logs < first_log) {
    throw Error("--start_pose", 0, "has no effect on a log alone",
                "a second log, or --map");
  }
  std::istringstream entries(FLAGS_start_pose);
  std::string entry;
  while (std::getline(entries, entry, '/')) {
    const std::size_t colon = entry.find(':');
    const auto refuse = [&] {
      throw Error("--start_pose", 0, "'" + entry + "'",
                  "log:x,y,degrees, the log from " + std::to_string(first_log) +
                      " to " + std::to_string(num_logs) +
                      " by its place in --input: " + std::to_string(first_log) +
                      ":3.5,-1,90");
    };
    if (colon == std::string::npos) refuse();
    std::size_t log = 0;
    const auto [end, error] =
        std::from_chars(entry.data(), entry.data() + colon, log);
    if (error != std::errc() || end != entry.data() + colon ||
        log < first_log || log > num_logs) {
      refuse();
    }
    const std::vector<double> numbers =
        ParseList("start_pose", entry.substr(colon + 1));
    if (numbers.size() != 3) refuse();
    starts[log - 1] =
        Pose2(numbers[0], numbers[1], NormalizeAngle(DegToRad(numbers[2])));
  }
  return starts;
}

}  // namespace plumbline
