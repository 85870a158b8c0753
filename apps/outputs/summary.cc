#include <plumbline/core/atomic_file.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/version.h>
#include <plumbline/detectors/merged_walls.h>
#include <plumbline/factors/angle.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/summary.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

namespace plumbline {
namespace {

// Keeps the order of the contract.
using Json = nlohmann::ordered_json;

constexpr double kLeastWallLength = 1.0;    // m
constexpr double kWindow = DegToRad(10.0);  // to either side
constexpr double kQuarterTurn = DegToRad(90.0);

double FoldedDifference(double a, double b) {
  return WrapAngle(a - b, kQuarterTurn);
}

/// Direction modulo 90 degrees with the most wall around it: the mode of the
/// density with the kernel 1 - (x / window)^2 on a grid of a quarter degree.
/// The mean within the window, iterated, climbs that same density.
double DominantDirectionGuess(const std::vector<WallDirection>& walls) {
  constexpr int kBins = 360;
  constexpr double kBinWidth = kQuarterTurn / kBins;
  std::array<double, kBins> histogram{};
  for (const WallDirection& wall : walls) {
    const double folded = WrapAngle(wall.direction, kQuarterTurn);
    const int bin =
        static_cast<int>(std::floor((folded + kQuarterTurn / 2.0) / kBinWidth));
    histogram[std::min(std::max(bin, 0), kBins - 1)] += wall.length;
  }
  constexpr int kReach = static_cast<int>(kWindow / kBinWidth);
  int best = 0;
  double best_density = -1.0;
  for (int bin = 0; bin < kBins; ++bin) {
    double density = 0.0;
    for (int offset = -kReach; offset <= kReach; ++offset) {
      const double x = offset * kBinWidth / kWindow;
      density += histogram[(bin + offset + kBins) % kBins] * (1.0 - x * x);
    }
    if (density > best_density) {
      best_density = density;
      best = bin;
    }
  }
  return (best + 0.5) * kBinWidth - kQuarterTurn / 2.0;
}

Json FlagToJson(const FlagValue& flag) {
  if (flag.type == "bool") return flag.value == "true";
  if (flag.type == "double") return std::strtod(flag.value.c_str(), nullptr);
  if (flag.type == "string") return flag.value;
  if (flag.type[0] == 'u') {
    return static_cast<std::uint64_t>(
        std::strtoull(flag.value.c_str(), nullptr, 10));
  }
  return static_cast<std::int64_t>(
      std::strtoll(flag.value.c_str(), nullptr, 10));
}

Json OptionalToJson(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json FlagsToJson(const std::vector<FlagValue>& flags) {
  Json json = Json::object();
  for (const FlagValue& flag : flags) json[flag.name] = FlagToJson(flag);
  return json;
}

Json CountsToJson(const Summary& summary) {
  Json features = Json::object();
  for (const auto& [type, count_by_level] : summary.features) {
    Json levels = Json::object();
    for (const auto& [level, count] : count_by_level) {
      levels[std::to_string(level)] = count;
    }
    features[type] = std::move(levels);
  }
  Json constraints = Json::object();
  for (const auto& [relation, counts] : summary.constraints) {
    constraints[relation] = {{"measurement", counts.measurement},
                             {"structure", counts.structure},
                             {"broken", counts.broken}};
  }
  return {{"scans", summary.scans},
          {"features", std::move(features)},
          {"constraints", std::move(constraints)}};
}

Json CostToJson(const Summary& summary) {
  return {{"initial", summary.initial_cost},
          {"measurement", summary.measurement_cost},
          {"structure", summary.structure_cost},
          {"total", summary.measurement_cost + summary.structure_cost}};
}

Json TimesToJson(const Summary& summary) {
  Json steps = Json::object();
  for (const auto& [name, seconds] : summary.step_seconds) {
    steps[name] = seconds;
  }
  return {{"total", summary.total_seconds},
          {"parse", summary.reading.seconds},
          {"parse_idle", summary.reading.idle_seconds},
          {"parse_cpu", summary.reading.cpu_seconds},
          {"frontend", summary.frontend_seconds},
          {"detect", summary.detect_seconds},
          {"solve", summary.solve_seconds},
          {"write", summary.write_seconds},
          {"steps", std::move(steps)}};
}

Json SolverToJson(const Summary& summary) {
  const Summary::Solver& solver = *summary.solver;
  return {{"objective", summary.measurement_cost + summary.structure_cost},
          {"iterations", solver.iterations},
          {"solves", solver.solves},
          {"converged", solver.converged},
          {"evaluation_s", solver.evaluation_seconds},
          {"linear_solver_s", solver.linear_solver_seconds},
          {"setup_s", solver.setup_seconds},
          {"start",
           {{"poses", solver.start_poses},
            {"landmarks", solver.start_landmarks},
            {"kept", solver.start_kept},
            {"seconds", solver.start_seconds}}}};
}

Json FrontendToJson(const Summary& summary) {
  Json skipped = Json::array();
  for (const SkipReport& skip : summary.skipped) {
    skipped.push_back({{"reason", skip.reason},
                       {"count", skip.count},
                       {"first_lines", skip.first_lines}});
  }
  Json json;
  json["skipped"] = std::move(skipped);
  if (!summary.log_format.empty()) json["format"] = summary.log_format;
  if (!summary.scan_source.empty()) json["scans"] = summary.scan_source;
  if (!summary.odometry_source.empty()) {
    json["odometry"] = summary.odometry_source;
  }
  if (!summary.notes.empty()) json["notes"] = summary.notes;
  const std::optional<double> early = MeanOfTenth(summary.scan_seconds, 1);
  const std::optional<double> late = MeanOfTenth(summary.scan_seconds, 9);
  json["scan_seconds_second_tenth"] = OptionalToJson(early);
  json["scan_seconds_last_tenth"] = OptionalToJson(late);
  json["scan_seconds_growth"] =
      early && late && *early > 0.0 ? Json(*late / *early) : Json(nullptr);
  json["range_noise_m"] = summary.range_noise;
  if (summary.odometry_scale > 0.0) {
    json["range_offset_m"] = summary.range_offset;
    json["odometry_scale"] = summary.odometry_scale;
    json["odometry_course_deg"] = RadToDeg(summary.odometry_course);
  }
  if (summary.open_way > 0.0) json["open_way_m"] = summary.open_way;
  return json;
}

Json LogToJson(const Summary::LogInput& log) {
  return {{"input", log.input},
          {"trajectory",
           log.trajectory.empty() ? Json(nullptr) : Json(log.trajectory)},
          {"scans", log.scans},
          {"map", log.map},
          {"parts", log.parts},
          {"agreeing", log.agreeing},
          {"contradicting", log.contradicting},
          {"changed_places", log.changed_places},
          {"uncertain",
           log.uncertain.empty() ? Json(nullptr) : Json(log.uncertain)},
          {"why_apart",
           log.why_apart.empty() ? Json(nullptr) : Json(log.why_apart)},
          {"candidate", log.candidate
                            ? Json({(*log.candidate)[0], (*log.candidate)[1],
                                    RadToDeg((*log.candidate)[2])})
                            : Json(nullptr)}};
}

Json TrackingToJson(const Summary::Tracking& tracking) {
  Json loose = Json::array();
  for (const Summary::Tracking::Loose& part : tracking.loose) {
    loose.push_back(
        {{"begin", part.begin}, {"end", part.end}, {"why", part.why}});
  }
  return {{"pieces", tracking.pieces}, {"loose", std::move(loose)}};
}

Json MirrorToJson(const Summary::Mirror& mirror) {
  return {{"begin", {mirror.begin.x(), mirror.begin.y()}},
          {"end", {mirror.end.x(), mirror.end.y()}},
          {"width_m", (mirror.end - mirror.begin).norm()},
          {"returns", mirror.returns},
          {"share", mirror.share}};
}

}  // namespace

std::optional<double> OrthogonalityDeg(
    const std::vector<WallDirection>& all_walls) {
  std::vector<WallDirection> walls;
  for (const WallDirection& wall : all_walls) {
    if (wall.length >= kLeastWallLength && std::isfinite(wall.length) &&
        std::isfinite(wall.direction)) {
      walls.push_back(wall);
    }
  }
  if (walls.empty()) return std::nullopt;

  double dominant = DominantDirectionGuess(walls);
  double square_sum = 0.0;
  double weight_sum = 0.0;
  // The set of walls inside the window changes a few times at most; the bound
  // is for walls that sit on its edge.
  for (int i = 0; i < 100; ++i) {
    double sum = 0.0;
    square_sum = 0.0;
    weight_sum = 0.0;
    for (const WallDirection& wall : walls) {
      const double deviation = FoldedDifference(wall.direction, dominant);
      if (std::abs(deviation) > kWindow) continue;
      sum += wall.length * deviation;
      square_sum += wall.length * deviation * deviation;
      weight_sum += wall.length;
    }
    // The guess has a wall within the window, and so has every mean after it.
    const double step = sum / weight_sum;
    if (std::abs(step) < 1e-12) break;
    dominant += step;
  }
  return RadToDeg(std::sqrt(square_sum / weight_sum));
}

std::optional<double> OrthogonalityDeg(const Graph& graph) {
  std::vector<WallDirection> walls;
  for (const MergedWall& merged : MergeWalls(graph)) {
    const Feature& wall = merged.wall;
    DrawnWall ends;
    if (!WallEnds(wall, &ends)) continue;
    walls.push_back(
        {wall.type->frame(wall)[2], wall.extent_end - wall.extent_begin});
  }
  return OrthogonalityDeg(walls);
}

std::int64_t PeakMemoryBytes() {
  rusage usage = {};
  if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
  return static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
}

std::optional<double> MeanOfTenth(const std::vector<double>& values,
                                  int tenth) {
  const std::size_t begin = values.size() * tenth / 10;
  const std::size_t end = values.size() * (tenth + 1) / 10;
  if (begin >= end) return std::nullopt;
  double sum = 0.0;
  for (std::size_t i = begin; i < end; ++i) sum += values[i];
  return sum / static_cast<double>(end - begin);
}

std::string CountsAsJson(const Summary& summary) {
  return CountsToJson(summary).dump(-1, ' ', false,
                                    Json::error_handler_t::replace);
}

void CountGraph(const Graph& graph, Summary* summary) {
  summary->features.clear();
  for (const Feature* feature : graph.Features()) {
    ++summary->features[feature->type->name][feature->level];
  }
  summary->constraints.clear();
  summary->closures = {};
  for (const Constraint* constraint : graph.Constraints()) {
    Summary::ConstraintCounts& counts =
        summary->constraints[constraint->type->name];
    const bool is_closure = constraint->type->Is(RelationRole::kSameWall);
    if (constraint->state == ConstraintState::kBroken) {
      ++counts.broken;
      if (is_closure) ++summary->closures.broken;
    } else if (constraint->kind == ConstraintClass::kStructure) {
      ++counts.structure;
      if (is_closure) ++summary->closures.live;
    } else {
      ++counts.measurement;
    }
  }
  summary->closures.proposed =
      summary->closures.live + summary->closures.broken;
  summary->orthogonality_deg = OrthogonalityDeg(graph);
}

void WriteSummary(const Summary& summary, std::ostream& output) {
  Json json;
  json["input"] = summary.input;
  json["seed"] = summary.seed;
  json["flags"] = FlagsToJson(summary.flags);
  json["counts"] = CountsToJson(summary);
  json["cost"] = CostToJson(summary);
  json["em"] = {
      {"iterations", summary.em_iterations},
      {"converged", summary.em_termination == EmTermination::kConvergence},
      {"termination", ToString(summary.em_termination)}};
  json["time_s"] = TimesToJson(summary);
  json["peak_memory_bytes"] = summary.peak_memory_bytes;
  json["orthogonality_deg"] = OptionalToJson(summary.orthogonality_deg);
  json["closures"] = {{"proposed", summary.closures.proposed},
                      {"live", summary.closures.live},
                      {"broken", summary.closures.broken}};
  json["version"] = kVersion;
  json["files"] = summary.files;
  json["sha256"] = summary.digests;
  json["partial"] = summary.partial;
  if (summary.partial && summary.scans_in_log > 0) {
    json["scans_in_log"] = summary.scans_in_log;
  }
  if (summary.solver) json["solver"] = SolverToJson(summary);
  if (summary.scans > 0) {
    json["frontend"] = FrontendToJson(summary);
    json["tracking"] = TrackingToJson(summary.tracking);
    if (summary.plan) {
      json["plan"] = {{"rooms", summary.plan->rooms},
                      {"doors", summary.plan->doors},
                      {"way_outside_m", summary.plan->way_outside}};
    }
    for (const Summary::Mirror& mirror : summary.mirrors) {
      json["mirrors"].push_back(MirrorToJson(mirror));
    }
    if (summary.alignment) {
      const Pose2& by = *summary.alignment;
      json["alignment"] = {{"kind", "building"},
                           {"x", by[0]},
                           {"y", by[1]},
                           {"theta_deg", RadToDeg(by[2])}};
    }
    for (const Summary::LogInput& log : summary.logs) {
      json["logs"].push_back(LogToJson(log));
    }
  }
  // A path may hold bytes that are no UTF-8.
  output << json.dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
}

void WriteSummary(const Summary& summary, const std::string& path) {
  WriteFileAtomically(path, [&summary](std::ostream& output) {
    WriteSummary(summary, output);
  });
}

}  // namespace plumbline
