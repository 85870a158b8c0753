// Says how good a trajectory and a map are: against true relations (Kuemmerle
// et al. 2009) and against the truth of a simulated building.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/evaluation/closure_truth.h>
#include <plumbline/apps/evaluation/map_evaluation.h>
#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/evaluation/plan_evaluation.h>
#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/tum.h>

#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

DEFINE_string(trajectory, "",
              "Trajectory in the TUM format: trajectory.tum of a solve.");
DEFINE_string(relations, "",
              "True displacements, `t1 t2 x y z roll pitch yaw` a line.");
DEFINE_string(truth, "", "Truth of a simulated building, as JSON.");
DEFINE_string(map, "", "Map to compare with the truth: map.json of a solve.");
DEFINE_string(plan, "",
              "Plan to compare with the truth, too: floorplan.geojson of a "
              "solve.");
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

Json ToJson(const ErrorStatistics& statistics) {
  return Json{{"mean", statistics.mean},
              {"std", statistics.standard_deviation},
              {"max", statistics.maximum},
              {"n", statistics.count}};
}

void PrintRow(const std::string& name, const std::string& unit,
              const ErrorStatistics& statistics) {
  std::printf("%-28s %-6s mean %10.4f  std %10.4f  max %10.4f  n %zu\n",
              name.c_str(), unit.c_str(), statistics.mean,
              statistics.standard_deviation, statistics.maximum,
              statistics.count);
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
  std::printf("walls: %zu of %zu found; recall %.4f, precision %.4f (length)\n",
              found, evaluation.walls.size(), evaluation.recall,
              evaluation.precision);
  std::printf("missed walls: %zu", evaluation.missed_walls.size());
  PrintIds(evaluation.missed_walls);
  std::printf("false walls: %zu", evaluation.false_walls.size());
  PrintIds(evaluation.false_walls);
  std::printf("walls drawn twice: %.2f m\n", evaluation.doubled_length);
  PrintAngles("missed orientations", evaluation.missed_orientations_deg);
  PrintAngles("false orientations", evaluation.false_orientations_deg);
  std::printf("duplicate orientations: %d\n",
              evaluation.duplicate_orientations);
  std::printf("bend error: %.3f deg", evaluation.bend_error_deg);
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
      "%.3f, precision %.3f, recall %.3f\n",
      rooms.found, rooms.asked, rooms.not_true, rooms.drawn, rooms.mean_iou,
      rooms.precision, rooms.recall);
  return Json{{"asked", rooms.asked},       {"found", rooms.found},
              {"drawn", rooms.drawn},       {"not_true", rooms.not_true},
              {"mean_iou", rooms.mean_iou}, {"precision", rooms.precision},
              {"recall", rooms.recall},     {"iou", rooms.iou}};
}

// Prints a plan against the truth and returns it.
Json TellPlan(const PlanEvaluation& plan) {
  Json result{{"file", FLAGS_plan}, {"rooms", TellRooms(plan.rooms)}};
  std::printf(
      "doors driven through: %d of %d found, width error %.3f m; %d of %d "
      "drawn are none\n",
      plan.doors_found, plan.doors_asked, plan.door_width_error,
      plan.doors_false, plan.doors_drawn);
  std::printf(
      "walls of the plan: completeness %.3f, correctness %.3f; %d of %d ends "
      "free, %d drawn twice\n",
      plan.wall_completeness, plan.wall_correctness, plan.free_ends, plan.ends,
      plan.double_walls);
  result["doors"] = Json{{"asked", plan.doors_asked},
                         {"found", plan.doors_found},
                         {"drawn", plan.doors_drawn},
                         {"false", plan.doors_false},
                         {"width_error_m", plan.door_width_error}};
  result["walls"] = Json{{"completeness", plan.wall_completeness},
                         {"correctness", plan.wall_correctness},
                         {"ends", plan.ends},
                         {"free_ends", plan.free_ends},
                         {"drawn_twice", plan.double_walls}};
  return result;
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
  return Json{{"file", FLAGS_truth},
              {"plan", plan},
              {"poses", poses},
              {"map", FLAGS_map},
              {"alignment",
               {evaluation.alignment[0], evaluation.alignment[1],
                evaluation.alignment[2]}},
              {"walls_found", found},
              {"walls_asked", evaluation.walls.size()},
              {"recall", evaluation.recall},
              {"precision", evaluation.precision},
              {"direction_error_deg", ToJson(evaluation.direction_error_deg)},
              {"offset_error_m", ToJson(evaluation.offset_error)},
              {"missed_walls", evaluation.missed_walls},
              {"false_walls", evaluation.false_walls},
              {"doubled_length_m", evaluation.doubled_length},
              {"missed_orientations_deg", evaluation.missed_orientations_deg},
              {"false_orientations_deg", evaluation.false_orientations_deg},
              {"duplicate_orientations", evaluation.duplicate_orientations},
              {"directions", DirectionsToJson(evaluation.directions)},
              {"bend_error_deg", evaluation.bend_error_deg},
              {"closures", closures},
              {"walls", WallsToJson(evaluation.walls)}};
}

int UsageError(const std::string& message) {
  std::fprintf(stderr, "%s\nplumbline_evaluate: --help lists the flags\n",
               message.c_str());
  return kExitUsage;
}

int Run() {
  if (!FLAGS_plan.empty() && FLAGS_truth.empty())
    return UsageError("--plan needs --truth");
  if (FLAGS_relations.empty() && FLAGS_truth.empty())
    return UsageError("nothing to compare with: expected --relations, --truth");
  if (FLAGS_truth.empty() != FLAGS_map.empty())
    return UsageError("--truth and --map go together: expected both");
  if (!FLAGS_relations.empty() && FLAGS_trajectory.empty())
    return UsageError("--relations needs a trajectory: expected --trajectory");
  if (!FLAGS_relation_errors.empty() && FLAGS_relations.empty())
    return UsageError("--relation_errors needs --relations");

  std::vector<TimedPose> trajectory;
  Json result;
  if (!FLAGS_trajectory.empty()) {
    trajectory = ReadTum(FLAGS_trajectory);
    result["trajectory"] =
        Json{{"file", FLAGS_trajectory}, {"poses", trajectory.size()}};
  }
  if (!FLAGS_relations.empty())
    result["relations"] = EvaluateAgainstRelations(trajectory);
  if (!FLAGS_truth.empty()) result["truth"] = EvaluateAgainstTruth(trajectory);
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
      "Says how good a trajectory is against true relations (Kuemmerle et al. "
      "2009), and how good a map is against the truth of a simulated building.";
  info.usage = {"--trajectory=T.tum --relations=R [flags]",
                "--trajectory=T.tum --truth=TRUTH.json --map=map.json [flags]"};
  info.example =
      "plumbline_evaluate --trajectory=out/trajectory.tum "
      "--relations=intel.relations";
  info.groups = {
      {"Input", {"trajectory", "relations", "truth", "map", "plan"}},
      {"Output", {"output", "relation_errors"}},
      {"Comparison",
       {"time_tolerance", "minimum_wall_length", "maximum_wall_offset"}}};
  plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain(plumbline::Run);
}
