// Says how good a trajectory and a map are: against another trajectory, against
// true relations (Kuemmerle et al. 2009) and against the truth of a simulated
// building, and rooms against those of a real one.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/output_files.h>
#include <plumbline/apps/evaluation/closure_truth.h>
#include <plumbline/apps/evaluation/grid_file.h>
#include <plumbline/apps/evaluation/map_evaluation.h>
#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/evaluation/plan_evaluation.h>
#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/apps/evaluation/traced_rooms.h>
#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/apps/evaluation/trajectory_errors.h>
#include <plumbline/apps/evaluation/trajectory_file.h>
#include <plumbline/apps/evaluation/trajectory_plots.h>
#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/utf8.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

DEFINE_string(
    trajectory, "",
    "Trajectory to judge: TUM (trajectory.tum of a solve), KITTI or a "
    "ROS bag.");
DEFINE_string(trajectory_topic, "",
              "Topic of a bag that has the trajectory (Odometry, PoseStamped, "
              "PoseWithCovarianceStamped), or tf:PARENT.CHILD; empty: the "
              "only one.");
DEFINE_string(reference, "",
              "Trajectory to compare with, of the same kinds; both give the "
              "figures of evo.");
DEFINE_string(reference_topic, "", "The same for the reference.");
DEFINE_string(alignment, "auto",
              "How the trajectory is moved onto the reference: none; origin "
              "(first poses); se2 (in the plane: z, roll and pitch are "
              "dropped), se3, sim3 (with scale) by least squares; auto: se2 "
              "where one of them lies in the plane, else se3.");
PLUMBLINE_FLAG_CHOICES(alignment, "auto", "none", "origin", "se2", "se3",
                       "sim3");
DEFINE_double(max_time_difference, 0.01,
              "Poses of trajectory and reference match this close in time, s.");
PLUMBLINE_FLAG_RANGE(max_time_difference, 0, 1e6);
DEFINE_double(time_offset, 0.0,
              "Is added to the time stamps of the trajectory, s.");
PLUMBLINE_FLAG_RANGE(time_offset, -1e12, 1e12);
DEFINE_double(rpe_delta, 1.0,
              "Length of the steps that relative errors are of.");
PLUMBLINE_FLAG_RANGE(rpe_delta, 1e-6, 1e9);
DEFINE_string(rpe_unit, "frames",
              "What --rpe_delta counts: frames (poses) or m (of the "
              "trajectory's path).");
PLUMBLINE_FLAG_CHOICES(rpe_unit, "frames", "m");
DEFINE_bool(rpe_all_pairs, false,
            "Steps from every pose, not only one after another.");
DEFINE_string(plot, "",
              "Where to draw both paths and their errors over time: .svg or "
              ".png.");
DEFINE_string(pose_errors, "",
              "Where to write the errors of every pose as CSV.");
DEFINE_string(relations, "",
              "True displacements, `t1 t2 x y z roll pitch yaw` a line.");
DEFINE_string(truth, "", "Truth of a simulated building, as JSON.");
DEFINE_string(map, "", "Map to compare with the truth: map.json of a solve.");
DEFINE_string(plan, "",
              "Plan to compare with the truth or with --rooms: "
              "floorplan.geojson of a solve.");
DEFINE_string(rooms, "",
              "Rooms of the real building as traced by somebody, as JSON; they "
              "are placed over the grid of the same map by themselves.");
DEFINE_string(grid, "",
              "Grid to place --rooms over, of a map_server; empty: the "
              "occupancy.yaml beside --plan.");
DEFINE_string(output, "", "Where to write the results as JSON.");
DEFINE_string(relation_errors, "",
              "Where to write the error of every relation as CSV.");
DEFINE_double(time_tolerance, 1e-3,
              "Time stamps of relations and poses match this close, s.");
PLUMBLINE_FLAG_RANGE(time_tolerance, 0, 10);
DEFINE_double(minimum_wall_length, plumbline::MapTruthOptions().minimum_length,
              "Walls of which less was seen are not asked for, m.");
PLUMBLINE_FLAG_RANGE(minimum_wall_length, 0, 100);
DEFINE_double(maximum_wall_offset, plumbline::MapTruthOptions().maximum_offset,
              "Map segments farther beside a wall do not match it, m.");
PLUMBLINE_FLAG_RANGE(maximum_wall_offset, 0, 100);

namespace plumbline {
namespace {

using Json = nlohmann::ordered_json;

// So few of the poses match by coincidence, too.
constexpr double kSmallShare = 0.1;

// A figure that is of something; null else: the errors of what was not found
// are not 0, and a share of nothing is not 1.
Json Known(double value, bool is_known) {
  return is_known ? Json(value) : Json(nullptr);
}

// The same for people, with as many digits behind the point.
std::string KnownText(double value, bool is_known, int decimals) {
  if (!is_known) return "-";
  std::string text;
  AppendFixed(value, decimals, &text);
  return text;
}

Json ToJson(const ErrorStatistics& statistics) {
  const bool is_known = statistics.count > 0;
  return Json{{"mean", Known(statistics.mean, is_known)},
              {"std", Known(statistics.standard_deviation, is_known)},
              {"max", Known(statistics.maximum, is_known)},
              {"n", statistics.count}};
}

void PrintRow(const std::string& name, const std::string& unit,
              const ErrorStatistics& statistics) {
  const auto text = [&statistics](double value) {
    return KnownText(value, statistics.count > 0, 4);
  };
  std::printf("%-28s %-6s mean %10s  std %10s  max %10s  n %zu\n", name.c_str(),
              unit.c_str(), text(statistics.mean).c_str(),
              text(statistics.standard_deviation).c_str(),
              text(statistics.maximum).c_str(), statistics.count);
}

Json EvaluateAgainstRelations(const std::vector<TimedPose>& trajectory) {
  const std::vector<Relation> relations = ReadRelations(FLAGS_relations);
  const RelationEvaluation evaluation =
      EvaluateRelations(trajectory, relations, FLAGS_time_tolerance);
  if (evaluation.errors.empty()) {
    throw Error(FLAGS_relations, relations.front().line,
                "no relation has both its time stamps in " + FLAGS_trajectory,
                "the trajectory of the log that the relations belong to");
  }
  PrintRow("translational error", "m", evaluation.translation);
  PrintRow("squared translational error", "m^2",
           evaluation.squared_translation);
  PrintRow("rotational error", "deg", evaluation.rotation_deg);
  PrintRow("squared rotational error", "deg^2",
           evaluation.squared_rotation_deg);
  std::printf("relations: %zu matched, %zu not matched",
              evaluation.errors.size(), evaluation.unmatched.size());
  if (!evaluation.unmatched.empty()) {
    std::printf(" (%s:%d first)", FLAGS_relations.c_str(),
                evaluation.unmatched.front().line);
  }
  std::printf("\n");
  if (!FLAGS_relation_errors.empty()) {
    WriteFileAtomically(FLAGS_relation_errors, [&](std::ostream& output) {
      WriteRelationErrors(evaluation, output);
    });
  }
  return Json{
      {"file", FLAGS_relations},
      {"matched", evaluation.errors.size()},
      {"not_matched", evaluation.unmatched.size()},
      {"translation_m", ToJson(evaluation.translation)},
      {"squared_translation_m2", ToJson(evaluation.squared_translation)},
      {"rotation_deg", ToJson(evaluation.rotation_deg)},
      {"squared_rotation_deg2", ToJson(evaluation.squared_rotation_deg)}};
}

Json ToJson(const ErrorSummary& errors) {
  return Json{{"rmse", errors.rmse},     {"mean", errors.mean},
              {"median", errors.median}, {"std", errors.std},
              {"min", errors.min},       {"max", errors.max},
              {"sse", errors.sse},       {"n", errors.count}};
}

// A line of the table of errors, and the same as JSON.
Json TellErrors(const char* name, const std::vector<double>& errors) {
  const ErrorSummary summary = SummarizeErrors(errors);
  std::printf("%-20s %11.6f %11.6f %11.6f %11.6f %11.6f %11.6f %14.6f %7zu\n",
              name, summary.rmse, summary.mean, summary.median, summary.std,
              summary.min, summary.max, summary.sse, summary.count);
  return ToJson(summary);
}

void TellTrajectory(const char* role, const TrajectoryFile& file) {
  std::printf("%s: %s (%s%s%s, %zu poses)\n", role, file.name.c_str(),
              file.format.c_str(), file.source.empty() ? "" : " ",
              PrintableUtf8(file.source).c_str(), file.poses.size());
  for (const std::string& note : file.notes) {
    std::fprintf(stderr, "%s: %s\n", PrintableUtf8(file.name).c_str(),
                 PrintableUtf8(note).c_str());
  }
}

PoseAlignment AlignmentFromFlag(const TrajectoryFile& reference,
                                const TrajectoryFile& trajectory) {
  const std::string& name = FLAGS_alignment;
  if (name == "none") return PoseAlignment::kNone;
  if (name == "origin") return PoseAlignment::kOrigin;
  if (name == "se2") return PoseAlignment::kSe2;
  if (name == "se3") return PoseAlignment::kSe3;
  if (name == "sim3") return PoseAlignment::kSim3;
  return IsPlanar(reference.poses) || IsPlanar(trajectory.poses)
             ? PoseAlignment::kSe2
             : PoseAlignment::kSe3;
}

Json TellAlignment(PoseAlignment alignment,
                   const AlignmentTransform& transform) {
  const Eigen::Vector3d& t = transform.motion.translation;
  const Eigen::Quaterniond& q = transform.motion.rotation;
  const double yaw = RadToDeg(2.0 * std::atan2(q.z(), q.w()));
  const char* name = "none";
  switch (alignment) {
    case PoseAlignment::kNone:
      std::printf("alignment: none\n");
      break;
    case PoseAlignment::kSe2:
      name = "se2";
      std::printf("alignment: se2: by %.6f m, %.6f m, %.6f degrees\n", t.x(),
                  t.y(), RadToDeg(NormalizeAngle(DegToRad(yaw))));
      break;
    default:
      name = alignment == PoseAlignment::kOrigin ? "origin"
             : alignment == PoseAlignment::kSe3  ? "se3"
                                                 : "sim3";
      std::printf(
          "alignment: %s: by %.6f m, %.6f m, %.6f m, quaternion (x y z w) "
          "%.6f %.6f %.6f %.6f",
          name, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
      if (alignment == PoseAlignment::kSim3) {
        std::printf(", scale %.6f", transform.scale);
      }
      std::printf("\n");
  }
  return Json{{"kind", name},
              {"translation_m", {t.x(), t.y(), t.z()}},
              {"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}},
              {"scale", transform.scale}};
}

bool EndsIn(const std::string& text, const std::string& end) {
  return text.size() > end.size() &&
         text.compare(text.size() - end.size(), end.size(), end) == 0;
}

Json EvaluateAgainstReference(const TrajectoryFile& trajectory) {
  const TrajectoryFile reference =
      ReadTrajectory(FLAGS_reference, FLAGS_reference_topic);
  TellTrajectory("reference", reference);
  TellTrajectory("trajectory", trajectory);
  TrajectoryComparison comparison;
  comparison.has_times = reference.has_times;
  comparison.pairs = AssociatePoses(
      reference, trajectory, FLAGS_max_time_difference, FLAGS_time_offset);
  const std::size_t matched = comparison.pairs.times.size();
  std::printf("matched: %zu poses\n", matched);
  const std::size_t most =
      std::min(reference.poses.size(), trajectory.poses.size());
  if (static_cast<double>(matched) < kSmallShare * static_cast<double>(most)) {
    std::fprintf(stderr,
                 "only %zu of the %zu poses of the shorter trajectory have one "
                 "of the other within --max_time_difference: the two may be of "
                 "different drives, or need --time_offset\n",
                 matched, most);
  }
  const PoseAlignment alignment = AlignmentFromFlag(reference, trajectory);
  const AlignmentTransform transform = ForFlag(
      "alignment", [&] { return AlignPoses(alignment, &comparison.pairs); });
  const Json alignment_json = TellAlignment(alignment, transform);
  comparison.absolute = ComputeAbsoluteErrors(comparison.pairs);
  comparison.steps.delta = FLAGS_rpe_delta;
  comparison.steps.delta_is_m = std::string("m") == FLAGS_rpe_unit;
  comparison.steps.all_pairs = FLAGS_rpe_all_pairs;
  comparison.relative = ForFlag("rpe_delta", [&] {
    return ComputeRelativeErrors(comparison.pairs, comparison.steps);
  });
  std::printf("%-20s %11s %11s %11s %11s %11s %11s %14s %7s\n", "", "rmse",
              "mean", "median", "std", "min", "max", "sse", "n");
  Json ape{{"translation_m",
            TellErrors("APE translation, m", comparison.absolute.translation)},
           {"rotation_deg",
            TellErrors("APE rotation, deg", comparison.absolute.rotation_deg)}};
  Json rpe{{"delta", FLAGS_rpe_delta},
           {"unit", FLAGS_rpe_unit},
           {"all_pairs", FLAGS_rpe_all_pairs}};
  if (comparison.relative.steps.empty()) {
    std::printf("RPE: the path is too short for a step of %g %s\n",
                FLAGS_rpe_delta, FLAGS_rpe_unit.c_str());
  } else {
    rpe["translation_m"] =
        TellErrors("RPE translation, m", comparison.relative.translation);
    rpe["rotation_deg"] =
        TellErrors("RPE rotation, deg", comparison.relative.rotation_deg);
  }
  if (!FLAGS_pose_errors.empty()) {
    WriteFileAtomically(FLAGS_pose_errors, [&](std::ostream& output) {
      WritePoseErrors(comparison, output);
    });
  }
  if (EndsIn(FLAGS_plot, ".png")) {
    WritePlotPng(PlotComparison(comparison), FLAGS_plot);
  } else if (!FLAGS_plot.empty()) {
    const std::string svg = PlotSvg(PlotComparison(comparison));
    WriteFileAtomically(FLAGS_plot,
                        [&](std::ostream& output) { output << svg; });
  }
  return Json{{"file", FLAGS_reference},
              {"format", reference.format},
              {"poses", reference.poses.size()},
              {"matched", matched},
              {"alignment", alignment_json},
              {"ape", ape},
              {"rpe", rpe}};
}

void PrintAngles(const std::string& name, const std::vector<double>& degrees) {
  std::printf("%s: %zu", name.c_str(), degrees.size());
  const char* separator = " (";
  for (const double angle : degrees) {
    std::printf("%s%.2f", separator, angle);
    separator = ", ";
  }
  std::printf("%s\n", degrees.empty() ? "" : " deg)");
}

// Prints ids, a handful only.
template <typename Id>
void PrintIds(const std::vector<Id>& ids) {
  constexpr std::size_t kShown = 10;
  const char* separator = " (ids ";
  for (std::size_t i = 0; i < ids.size() && i < kShown; ++i) {
    std::printf("%s%lld", separator, static_cast<long long>(ids[i]));
    separator = ", ";
  }
  if (!ids.empty()) std::printf(ids.size() > kShown ? ", ...)" : ")");
  std::printf("\n");
}

// Prints how far the poses are off and returns it.
Json TellPoses(const PoseErrors& errors) {
  PrintRow("position error", "m", errors.position);
  PrintRow("heading error", "deg", errors.heading_deg);
  return Json{{"position_m", ToJson(errors.position)},
              {"heading_deg", ToJson(errors.heading_deg)}};
}

void PrintMap(const MapTruthEvaluation& evaluation, std::size_t found) {
  PrintRow("wall direction error", "deg", evaluation.direction_error_deg);
  PrintRow("wall offset error", "m", evaluation.offset_error);
  std::printf(
      "walls: %zu of %zu found; recall %s, precision %s (length)\n", found,
      evaluation.walls.size(),
      KnownText(evaluation.recall, evaluation.asked_length > 0.0, 4).c_str(),
      KnownText(evaluation.precision, evaluation.judged_length > 0.0, 4)
          .c_str());
  std::printf("missed walls: %zu", evaluation.missed_walls.size());
  PrintIds(evaluation.missed_walls);
  std::printf("false walls: %zu", evaluation.false_walls.size());
  PrintIds(evaluation.false_walls);
  std::printf("walls drawn twice: %.2f m\n", evaluation.doubled_length);
  PrintAngles("missed orientations", evaluation.missed_orientations_deg);
  PrintAngles("false orientations", evaluation.false_orientations_deg);
  std::printf("duplicate orientations: %d\n",
              evaluation.duplicate_orientations);
  std::printf("bend error: %s deg",
              KnownText(evaluation.bend_error_deg, evaluation.is_bend_known, 3)
                  .c_str());
  const char* separator = " (";
  for (const DirectionResult& direction : evaluation.directions) {
    std::printf("%s%.2f %+.3f", separator, direction.angle_deg,
                direction.error_deg);
    separator = ", ";
  }
  std::printf("%s\n", evaluation.directions.empty() ? "" : ")");
}

Json WallsToJson(const std::vector<WallResult>& walls) {
  Json rows = Json::array();
  for (const WallResult& wall : walls) {
    Json row{{"id", wall.id},
             {"seen_m", wall.seen},
             {"covered_m", wall.covered},
             {"found", wall.found}};
    if (wall.found) {
      row["direction_error_deg"] = wall.direction_error_deg;
      row["offset_error_m"] = wall.offset_error;
    }
    rows.push_back(row);
  }
  return rows;
}

Json DirectionsToJson(const std::vector<DirectionResult>& directions) {
  Json rows = Json::array();
  for (const DirectionResult& direction : directions) {
    rows.push_back({{"angle_deg", direction.angle_deg},
                    {"length_m", direction.length},
                    {"error_deg", direction.error_deg}});
  }
  return rows;
}

// Prints the loop closures against the truth and returns them.
Json TellClosures(const ClosureEvaluation& closures) {
  std::printf(
      "closures: %d right, %d of a door and its wall, %d wrong; broken: %d "
      "right, %d wrong; revisits closed: %d of %d\n",
      closures.right, closures.near, closures.wrong, closures.broken_right,
      closures.broken_wrong, closures.closed_revisits, closures.revisits);
  return Json{{"right", closures.right},
              {"near", closures.near},
              {"wrong", closures.wrong},
              {"broken_right", closures.broken_right},
              {"broken_wrong", closures.broken_wrong},
              {"wrong_pairs", closures.wrong_pairs},
              {"revisits", closures.revisits},
              {"closed_revisits", closures.closed_revisits}};
}

// Prints rooms against the truth and returns them.
Json TellRooms(const RoomEvaluation& rooms) {
  std::printf(
      "rooms: %d of %d found, %d of %d drawn are none of the true; mean IoU "
      "%s, precision %s, recall %s\n",
      rooms.found, rooms.asked, rooms.not_true, rooms.drawn,
      KnownText(rooms.mean_iou, rooms.asked > 0, 3).c_str(),
      KnownText(rooms.precision, rooms.judged > 0, 3).c_str(),
      KnownText(rooms.recall, rooms.asked > 0, 3).c_str());
  return Json{{"asked", rooms.asked},
              {"found", rooms.found},
              {"drawn", rooms.drawn},
              {"not_true", rooms.not_true},
              {"mean_iou", Known(rooms.mean_iou, rooms.asked > 0)},
              {"precision", Known(rooms.precision, rooms.judged > 0)},
              {"recall", Known(rooms.recall, rooms.asked > 0)},
              {"iou", rooms.iou}};
}

// Prints a plan against the truth and returns it.
Json TellPlan(const PlanEvaluation& plan) {
  Json result{{"file", FLAGS_plan}, {"rooms", TellRooms(plan.rooms)}};
  std::printf(
      "doors driven through: %d of %d found, width error %s m; %d of %d "
      "drawn are none\n",
      plan.doors_found, plan.doors_asked,
      KnownText(plan.door_width_error, plan.doors_found > 0, 3).c_str(),
      plan.doors_false, plan.doors_drawn);
  std::printf(
      "walls of the plan: completeness %s, correctness %s; %d of %d ends "
      "free, %d drawn twice\n",
      KnownText(plan.wall_completeness, plan.has_seen_walls, 3).c_str(),
      KnownText(plan.wall_correctness, plan.has_walls, 3).c_str(),
      plan.free_ends, plan.ends, plan.double_walls);
  result["doors"] = Json{
      {"asked", plan.doors_asked},
      {"found", plan.doors_found},
      {"drawn", plan.doors_drawn},
      {"false", plan.doors_false},
      {"width_error_m", Known(plan.door_width_error, plan.doors_found > 0)}};
  result["walls"] =
      Json{{"completeness", Known(plan.wall_completeness, plan.has_seen_walls)},
           {"correctness", Known(plan.wall_correctness, plan.has_walls)},
           {"ends", plan.ends},
           {"free_ends", plan.free_ends},
           {"drawn_twice", plan.double_walls}};
  return result;
}

// Compares the plan with rooms of the real building.
Json EvaluateAgainstRooms() {
  const std::string grid =
      FLAGS_grid.empty()
          ? (std::filesystem::path(FLAGS_plan).parent_path() / "occupancy.yaml")
                .string()
          : FLAGS_grid;
  const TracedRooms rooms = ReadTracedRooms(FLAGS_rooms);
  const BuildingPlan plan = ReadBuildingPlan(FLAGS_plan);
  const SpaceGrid space = ReadSpaceGrid(grid);
  const TracedEvaluation result =
      ForFlag("grid", [&] { return EvaluateTracedRooms(plan, rooms, space); });
  std::printf(
      "rooms of %s: %d of %d seen, %d of them found; %d drawn; mean IoU %s, "
      "precision %s, recall %s\n",
      PrintableUtf8(rooms.name).c_str(), result.seen, result.traced,
      result.found, result.drawn,
      KnownText(result.mean_iou, result.seen > 0, 3).c_str(),
      KnownText(result.precision, result.judged > 0, 3).c_str(),
      KnownText(result.recall, result.seen > 0, 3).c_str());
  const TracedPlacement& placement = result.placement;
  std::printf(
      "placed: overlap with free space %.3f, turned by %.1f degrees, scale "
      "%.2f, middle at %.2f %.2f\n",
      placement.overlap, RadToDeg(placement.turn), placement.scale,
      placement.center[0], placement.center[1]);
  Json iou = Json::array();
  for (const double value : result.iou) {
    iou.push_back(value < 0.0 ? Json() : Json(value));
  }
  return Json{{"file", FLAGS_rooms},
              {"plan", FLAGS_plan},
              {"grid", grid},
              {"name", rooms.name},
              {"traced", result.traced},
              {"seen", result.seen},
              {"found", result.found},
              {"drawn", result.drawn},
              {"mean_iou", Known(result.mean_iou, result.seen > 0)},
              {"precision", Known(result.precision, result.judged > 0)},
              {"recall", Known(result.recall, result.seen > 0)},
              {"iou", iou},
              {"placement",
               {{"overlap", placement.overlap},
                {"turn_deg", RadToDeg(placement.turn)},
                {"scale", placement.scale},
                {"center_m", {placement.center[0], placement.center[1]}}}}};
}

Json EvaluateAgainstTruth(const std::vector<TimedPose>& trajectory) {
  const MapTruth truth = ReadMapTruth(FLAGS_truth);
  const StraightMap map = ReadStraightMap(FLAGS_map);
  Pose2 alignment = Pose2::Zero();
  if (!trajectory.empty()) {
    alignment = AlignTrajectory(trajectory, truth);
  } else if (!truth.poses.empty()) {
    // The map's frame is then taken to be that of the first scan.
    alignment = truth.poses.front().pose;
  }
  MapTruthOptions options;
  options.minimum_length = FLAGS_minimum_wall_length;
  options.maximum_offset = FLAGS_maximum_wall_offset;
  const MapTruthEvaluation evaluation =
      EvaluateMap(map, truth, alignment, options);
  Json poses;
  if (!trajectory.empty()) {
    poses = TellPoses(EvaluatePoses(trajectory, truth, alignment));
  }
  const std::size_t found =
      evaluation.walls.size() - evaluation.missed_walls.size();
  PrintMap(evaluation, found);
  const Json closures =
      TellClosures(EvaluateClosures(map, truth, alignment, options));
  Json plan;
  if (!FLAGS_plan.empty()) {
    plan =
        TellPlan(EvaluatePlan(ReadBuildingPlan(FLAGS_plan), truth, alignment));
  }
  return Json{
      {"file", FLAGS_truth},
      {"plan", plan},
      {"poses", poses},
      {"map", FLAGS_map},
      {"alignment",
       {evaluation.alignment[0], evaluation.alignment[1],
        evaluation.alignment[2]}},
      {"walls_found", found},
      {"walls_asked", evaluation.walls.size()},
      {"recall", Known(evaluation.recall, evaluation.asked_length > 0.0)},
      {"precision",
       Known(evaluation.precision, evaluation.judged_length > 0.0)},
      {"direction_error_deg", ToJson(evaluation.direction_error_deg)},
      {"offset_error_m", ToJson(evaluation.offset_error)},
      {"missed_walls", evaluation.missed_walls},
      {"false_walls", evaluation.false_walls},
      {"doubled_length_m", evaluation.doubled_length},
      {"missed_orientations_deg", evaluation.missed_orientations_deg},
      {"false_orientations_deg", evaluation.false_orientations_deg},
      {"duplicate_orientations", evaluation.duplicate_orientations},
      {"directions", DirectionsToJson(evaluation.directions)},
      {"bend_error_deg",
       Known(evaluation.bend_error_deg, evaluation.is_bend_known)},
      {"closures", closures},
      {"walls", WallsToJson(evaluation.walls)}};
}

int UsageError(const std::string& message) {
  std::fprintf(stderr, "%s\nplumbline_evaluate: --help lists the flags\n",
               message.c_str());
  return kExitUsage;
}

// What is wrong with a flag that was given and says more of a comparison that
// was not asked for; empty without one.
std::string FlagWithoutEffect() {
  const std::map<std::string, std::pair<const char*, bool>> needed = {
      {"alignment", {"reference", !FLAGS_reference.empty()}},
      {"max_time_difference", {"reference", !FLAGS_reference.empty()}},
      {"time_offset", {"reference", !FLAGS_reference.empty()}},
      {"rpe_delta", {"reference", !FLAGS_reference.empty()}},
      {"rpe_unit", {"reference", !FLAGS_reference.empty()}},
      {"rpe_all_pairs", {"reference", !FLAGS_reference.empty()}},
      {"time_tolerance", {"relations", !FLAGS_relations.empty()}},
      {"minimum_wall_length", {"truth", !FLAGS_truth.empty()}},
      {"maximum_wall_offset", {"truth", !FLAGS_truth.empty()}},
      {"trajectory_topic", {"trajectory", !FLAGS_trajectory.empty()}},
  };
  for (const FlagValue& flag : ChangedFlags()) {
    const auto entry = needed.find(flag.name);
    if (entry == needed.end() || entry->second.second) continue;
    return "--" + flag.name + " needs --" + entry->second.first;
  }
  return "";
}

int Run() {
  if (!FLAGS_plan.empty() && FLAGS_truth.empty() && FLAGS_rooms.empty())
    return UsageError("--plan needs --truth or --rooms");
  if (FLAGS_relations.empty() && FLAGS_truth.empty() &&
      FLAGS_reference.empty() && FLAGS_rooms.empty()) {
    return UsageError(
        "nothing to compare with: expected --reference, --relations, --truth "
        "or --rooms");
  }
  if (!FLAGS_rooms.empty() && FLAGS_plan.empty())
    return UsageError("--rooms needs a plan: expected --plan");
  if (!FLAGS_grid.empty() && FLAGS_rooms.empty())
    return UsageError("--grid needs --rooms");
  if (FLAGS_truth.empty() != FLAGS_map.empty())
    return UsageError("--truth and --map go together: expected both");
  if (!FLAGS_relations.empty() && FLAGS_trajectory.empty())
    return UsageError("--relations needs a trajectory: expected --trajectory");
  if (!FLAGS_reference.empty() && FLAGS_trajectory.empty())
    return UsageError("--reference needs a trajectory: expected --trajectory");
  if (!FLAGS_relation_errors.empty() && FLAGS_relations.empty())
    return UsageError("--relation_errors needs --relations");
  if (FLAGS_reference.empty()) {
    for (const auto& [name, value] :
         {std::make_pair("plot", FLAGS_plot),
          std::make_pair("pose_errors", FLAGS_pose_errors),
          std::make_pair("reference_topic", FLAGS_reference_topic)}) {
      if (!value.empty()) {
        return UsageError(std::string("--") + name + " needs --reference");
      }
    }
  }
  const std::string without_effect = FlagWithoutEffect();
  if (!without_effect.empty()) return UsageError(without_effect);
  if (!FLAGS_plot.empty() && !EndsIn(FLAGS_plot, ".svg") &&
      !EndsIn(FLAGS_plot, ".png")) {
    return UsageError("--plot=" + FLAGS_plot +
                      ": expected a name that ends in .svg or .png");
  }

  CheckOutputFiles({{"trajectory", FLAGS_trajectory},
                    {"reference", FLAGS_reference},
                    {"relations", FLAGS_relations},
                    {"truth", FLAGS_truth},
                    {"map", FLAGS_map},
                    {"plan", FLAGS_plan},
                    {"rooms", FLAGS_rooms},
                    {"grid", FLAGS_grid}},
                   {{"output", FLAGS_output},
                    {"plot", FLAGS_plot},
                    {"pose_errors", FLAGS_pose_errors},
                    {"relation_errors", FLAGS_relation_errors}});
  std::vector<TimedPose> trajectory;
  Json result;
  if (!FLAGS_trajectory.empty()) {
    const TrajectoryFile file =
        ReadTrajectory(FLAGS_trajectory, FLAGS_trajectory_topic);
    result["trajectory"] =
        Json{{"file", FLAGS_trajectory}, {"poses", file.poses.size()}};
    if (!FLAGS_reference.empty()) {
      result["reference"] = EvaluateAgainstReference(file);
    }
    if (!file.has_times && !(FLAGS_relations.empty() && FLAGS_truth.empty())) {
      throw Error(file.name, 0,
                  "poses of " + file.format + " have no times to match by",
                  "a trajectory with times for --relations and --truth");
    }
    trajectory = InPlane(file);
  }
  if (!FLAGS_relations.empty())
    result["relations"] = EvaluateAgainstRelations(trajectory);
  if (!FLAGS_truth.empty()) result["truth"] = EvaluateAgainstTruth(trajectory);
  if (!FLAGS_rooms.empty()) result["rooms"] = EvaluateAgainstRooms();
  if (!FLAGS_output.empty()) {
    WriteFileAtomically(FLAGS_output, [&](std::ostream& output) {
      output << result.dump(2, ' ', false, Json::error_handler_t::replace)
             << '\n';
    });
  }
  return kExitSuccess;
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  plumbline::AppInfo info;
  info.name = "plumbline_evaluate";
  info.summary =
      "Says how good a trajectory is against another one (APE and RPE, as evo "
      "has them) or against true relations (Kuemmerle et al. 2009), and how "
      "good a map is against the truth of a simulated building, or its rooms "
      "against those of a real one.";
  info.usage = {"--trajectory=T.tum --reference=R.tum [flags]",
                "--trajectory=T.tum --relations=R [flags]",
                "--trajectory=T.tum --truth=TRUTH.json --map=map.json [flags]",
                "--plan=floorplan.geojson --rooms=ROOMS.json [flags]"};
  info.example =
      "plumbline_evaluate --trajectory=out/trajectory.tum "
      "--relations=intel.relations";
  info.groups = {
      {"Input",
       {"trajectory", "trajectory_topic", "reference", "reference_topic",
        "relations", "truth", "map", "plan", "rooms", "grid"}},
      {"Output", {"output", "plot", "pose_errors", "relation_errors"}},
      {"Comparison with a reference",
       {"alignment", "max_time_difference", "time_offset", "rpe_delta",
        "rpe_unit", "rpe_all_pairs"}},
      {"Comparison with relations and truth",
       {"time_tolerance", "minimum_wall_length", "maximum_wall_offset"}}};
  info.interrupts_end_it = true;
  plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain(plumbline::Run);
}
