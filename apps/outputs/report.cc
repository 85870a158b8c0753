#include <plumbline/core/atomic_file.h>
#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/version.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/report.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

namespace plumbline {

// report_page.html, by the build.
extern const char kReportPage[];

namespace {

using Json = nlohmann::ordered_json;

constexpr double kLeastWay = 0.1;  // m, between poses of the path

// To a tenth of a millimetre, or of the unit that it is in: the page stays
// small. What is not finite becomes null.
Json Rounded(double value, double steps = 1e4) {
  if (!std::isfinite(value)) return nullptr;
  const double rounded = std::round(value * steps) / steps;
  return rounded == 0.0 ? 0.0 : rounded;
}

// With six digits.
Json Digits(double value) {
  if (!std::isfinite(value) || value == 0.0) return Rounded(value);
  const double steps =
      std::pow(10.0, 5.0 - std::floor(std::log10(std::abs(value))));
  return std::isfinite(steps) && steps > 0.0 ? Rounded(value, steps)
                                             : Json(0.0);
}

Json RoundedArray(const std::vector<double>& values) {
  Json array = Json::array();
  for (const double value : values) {
    if (!std::isfinite(value)) return nullptr;
    array.push_back(Rounded(value));
  }
  return array;
}

// What is drawn of a feature: 4 numbers are the ends of a wall, 3 a circle, 2 a
// point, 8 the corners of a rectangle; null for what has no place.
Json Geometry(const Feature& feature) {
  const FeatureType& type = *feature.type;
  const auto& p = feature.parameters;
  DrawnWall wall;
  if (WallEnds(feature, &wall)) {
    return RoundedArray({wall.x1, wall.y1, wall.x2, wall.y2});
  }
  if (type.Is(FeatureRole::kCircle)) return RoundedArray({p[0], p[1], p[2]});
  if (type.Is(FeatureRole::kPoint)) return RoundedArray({p[0], p[1]});
  if (type.Is(FeatureRole::kRectangle)) {
    const Eigen::Vector2d center(p[0], p[1]);
    const Eigen::Vector2d along(p[3] * std::cos(p[2]), p[3] * std::sin(p[2]));
    const Eigen::Vector2d across(-p[4] * std::sin(p[2]), p[4] * std::cos(p[2]));
    std::vector<double> corners;
    const Eigen::Vector2d offsets[] = {-along - across, along - across,
                                       along + across, -along + across};
    for (const Eigen::Vector2d& offset : offsets) {
      const Eigen::Vector2d corner = center + offset;
      corners.push_back(corner[0]);
      corners.push_back(corner[1]);
    }
    return RoundedArray(corners);
  }
  return nullptr;
}

// Names in the order in which they first occur, and which one each element has.
class Names {
 public:
  int Add(const std::string& name) {
    const auto added = ids_.emplace(name, static_cast<int>(names_.size()));
    if (added.second) names_.push_back(name);
    return added.first->second;
  }
  Json ToJson() const { return names_; }

 private:
  std::map<std::string, int> ids_;
  Json names_ = Json::array();
};

// Of each relation of the graph's structure, the units in which its rows are
// shown: "deg" for what is kept in rad.
Json UnitsOfRows(const Graph& graph) {
  Json units = Json::object();
  for (const Constraint* constraint : graph.Constraints()) {
    const RelationType& type = *constraint->type;
    if (constraint->kind != ConstraintClass::kStructure ||
        units.contains(type.name)) {
      continue;
    }
    Json rows = Json::array();
    for (const Quantity& row : type.rows) {
      rows.push_back(std::string(row.shown_unit()));
    }
    units[type.name] = std::move(rows);
  }
  return units;
}

// In the relation's units; null when it is not finite.
Json ErrorToJson(const Eigen::VectorXd& error) {
  if (!error.allFinite()) return nullptr;
  Json array = Json::array();
  for (const double value : error) array.push_back(Digits(value));
  return array;
}

// f(x) (-) u at the present state, in the relation's units; null when it cannot
// be evaluated.
Json ErrorNow(const Graph& graph, const Constraint& constraint) {
  try {
    return ErrorToJson(plumbline::ErrorOf(graph, constraint));
  } catch (const std::exception&) {
    return nullptr;
  }
}

// Delta at the present state; null when it cannot be evaluated.
Json DeltaNow(const Graph& graph, const Constraint& constraint) {
  try {
    const double squared =
        WhitenedError(constraint, FeaturesOf(graph, constraint)).squaredNorm();
    if (!std::isfinite(squared)) return nullptr;
    const int degrees = InformationRank(constraint.information);
    return degrees < 1 ? Json(1.0) : Digits(ChiSquarePValue(squared, degrees));
  } catch (const std::exception&) {
    return nullptr;
  }
}

// One standard deviation of each row, the others left free to fit.
Json ToleranceOf(const Constraint& constraint) {
  Json array = Json::array();
  for (Eigen::Index i = 0; i < constraint.information.rows(); ++i) {
    const double information = constraint.information(i, i);
    if (!(information > 0.0)) return nullptr;
    array.push_back(Digits(1.0 / std::sqrt(information)));
  }
  return array;
}

// `clusters`: of each wall, the index into MapDrawing::cluster_features.
Json FeaturesToJson(const Report& report,
                    const std::map<FeatureId, int>& clusters, Names* types,
                    Names* sources) {
  const Graph& graph = *report.graph;
  Json id = Json::array(), type = Json::array(), level = Json::array();
  Json is_virtual = Json::array(), source = Json::array();
  Json scans = Json::array(), measured = Json::array();
  Json parameters = Json::array(), after = Json::array();
  Json before = Json::array(), cluster = Json::array();
  for (const Feature* feature : graph.Features()) {
    // A path is shown as such; thousands of poses would hide the rest.
    if (feature->type->Is(FeatureRole::kPose)) continue;
    id.push_back(feature->id);
    type.push_back(types->Add(feature->type->name));
    level.push_back(feature->level);
    is_virtual.push_back(feature->is_virtual ? 1 : 0);
    source.push_back(sources->Add(feature->source));
    scans.push_back(feature->observations);
    int measurements = 0;
    for (const ConstraintId constraint_id : graph.ConstraintsOf(feature->id)) {
      const Constraint& constraint = graph.GetConstraint(constraint_id);
      measurements += constraint.kind == ConstraintClass::kMeasurement &&
                      constraint.state == ConstraintState::kLive;
    }
    measured.push_back(measurements);
    after.push_back(Geometry(*feature));
    const auto of_wall = clusters.find(feature->id);
    cluster.push_back(of_wall == clusters.end() ? -1 : of_wall->second);
    // Walls say all by their ends.
    Json values = nullptr;
    if (after.back().is_null()) {
      values = Json::array();
      for (int i = 0; i < feature->type->size; ++i) {
        values.push_back(Digits(feature->parameters[i]));
      }
    }
    parameters.push_back(std::move(values));
    const auto found = report.before.features.find(feature->id);
    before.push_back(found == report.before.features.end()
                         ? Json(nullptr)
                         : Geometry(found->second));
  }
  Json json;
  json["id"] = std::move(id);
  json["type"] = std::move(type);
  json["level"] = std::move(level);
  json["virtual"] = std::move(is_virtual);
  json["source"] = std::move(source);
  json["scans"] = std::move(scans);
  json["measured"] = std::move(measured);
  json["parameters"] = std::move(parameters);
  json["after"] = std::move(after);
  json["cluster"] = std::move(cluster);
  json["before"] =
      report.before.features.empty() ? Json(nullptr) : std::move(before);
  return json;
}

// What tells why a constraint was broken, and whether it would be now.
Json BrokenToJson(const Report& report, const Constraint& constraint) {
  const Graph& graph = *report.graph;
  Json json = {
      {"limit",
       Digits(std::min(report.delta_threshold, constraint.break_below))},
      {"tolerance", ToleranceOf(constraint)},
      {"error", ErrorNow(graph, constraint)},
      {"delta", DeltaNow(graph, constraint)},
  };
  const auto record = report.breaks.find(constraint.id);
  if (record != report.breaks.end()) {
    json["iteration_then"] = record->second.iteration;
    json["error_then"] = ErrorToJson(record->second.error);
  }
  return json;
}

Json StructureToJson(const Report& report, Names* relations, Names* sources) {
  const Graph& graph = *report.graph;
  Json id = Json::array(), relation = Json::array(), features = Json::array();
  Json delta = Json::array(), live = Json::array(), source = Json::array();
  Json broken = Json::array();
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->kind != ConstraintClass::kStructure) continue;
    const bool is_live = constraint->state == ConstraintState::kLive;
    id.push_back(constraint->id);
    relation.push_back(relations->Add(constraint->type->name));
    features.push_back(constraint->features);
    delta.push_back(Digits(constraint->delta));
    live.push_back(is_live ? 1 : 0);
    broken.push_back(is_live ? Json(nullptr)
                             : BrokenToJson(report, *constraint));
    source.push_back(sources->Add(constraint->source));
  }
  Json json;
  json["id"] = std::move(id);
  json["relation"] = std::move(relation);
  json["features"] = std::move(features);
  json["delta"] = std::move(delta);
  json["live"] = std::move(live);
  json["source"] = std::move(source);
  json["broken"] = std::move(broken);
  return json;
}

// The poses of `path` that are worth drawing, by their indices.
std::vector<std::size_t> SparsePath(const std::vector<Pose2>& path) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (!path[i].allFinite()) continue;
    if (!indices.empty() &&
        (path[i] - path[indices.back()]).head<2>().norm() < kLeastWay) {
      continue;
    }
    indices.push_back(i);
  }
  return indices;
}

Json PathToJson(const std::vector<Pose2>& path,
                const std::vector<std::size_t>& indices) {
  Json json = Json::array();
  for (const std::size_t i : indices) {
    json.push_back(Rounded(path[i][0], 1e3));
    json.push_back(Rounded(path[i][1], 1e3));
  }
  return json;
}

// Rooms and doors by their numbers less one; null when they were not looked
// for.
Json BuildingToJson(const BuildingPlan* plan) {
  if (plan == nullptr) return nullptr;
  const auto ring_to_json = [](const Ring& ring) {
    std::vector<double> values;
    for (const Eigen::Vector2d& corner : ring) {
      values.insert(values.end(), {corner[0], corner[1]});
    }
    return RoundedArray(values);
  };
  Json rooms = Json::array(), doors = Json::array();
  for (const PlanRoom& room : plan->rooms) {
    Json rings = Json::array({ring_to_json(room.outline.shell)});
    for (const Ring& hole : room.outline.holes) {
      rings.push_back(ring_to_json(hole));
    }
    const Eigen::Vector2d middle = InnerPoint(room.outline);
    rooms.push_back({{"kind", RoomKindName(room.kind)},
                     {"area", Rounded(room.area, 1e3)},
                     {"entered", room.is_entered ? 1 : 0},
                     {"middle", RoundedArray({middle[0], middle[1]})},
                     {"rings", std::move(rings)}});
  }
  for (const PlanDoor& door : plan->doors) {
    doors.push_back({{"ends", RoundedArray({door.begin[0], door.begin[1],
                                            door.end[0], door.end[1]})},
                     {"width", Rounded(door.width(), 1e3)},
                     {"rooms", door.rooms},
                     {"driven", door.is_driven ? 1 : 0}});
  }
  Json walls = Json::array();
  for (const PlanWall& wall : plan->walls) {
    walls.push_back(ring_to_json(BodyOf(wall)));
  }
  return {{"rooms", std::move(rooms)},
          {"doors", std::move(doors)},
          {"walls", std::move(walls)}};
}

// Hypotheses that walls of different visits are one: their places among the
// structure of StructureToJson.
Json ClosuresToJson(const Graph& graph) {
  Json places = Json::array();
  int place = 0;
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->kind != ConstraintClass::kStructure) continue;
    if (constraint->type->Is(RelationRole::kSameWall)) places.push_back(place);
    ++place;
  }
  return places;
}

// x, y, direction, whether it holds, delta.
Json PlacedClosuresToJson(const std::vector<PlacedClosure>& closures) {
  Json array = Json::array();
  for (const PlacedClosure& closure : closures) {
    array.push_back({Rounded(closure.place[0]), Rounded(closure.place[1]),
                     Rounded(closure.place[2]), closure.holds ? 1 : 0,
                     Digits(closure.delta)});
  }
  return array;
}

Json GridToJson(const std::optional<ReportGrid>& grid) {
  if (!grid) return nullptr;
  return {{"x", Rounded(grid->origin.x())},
          {"y", Rounded(grid->origin.y())},
          {"resolution", Rounded(grid->resolution, 1e9)},
          {"width", grid->width},
          {"height", grid->height},
          {"png", grid->png}};
}

Json TraceToJson(const std::vector<EmTraceRow>& trace) {
  Json json = Json::array();
  for (const EmTraceRow& row : trace) {
    json.push_back(
        {{"iteration", row.phase.iteration},
         {"phase", row.phase.phase},
         {"measurement", Digits(row.phase.cost.measurement)},
         {"structure", Digits(row.phase.cost.structure)},
         {"constraints", row.phase.structure_constraints},
         {"broken", row.phase.broken_constraints},
         {"features", row.phase.features},
         {"error", row.mean_position_error ? Digits(*row.mean_position_error)
                                           : Json(nullptr)}});
  }
  return json;
}

Json DataToJson(const Report& report) {
  const Summary& summary = report.summary;
  Names types, sources, relations;
  Json json;
  json["title"] = report.title;
  json["input"] = summary.input;
  json["seed"] = summary.seed;
  json["version"] = kVersion;
  json["partial"] = summary.partial
                        ? Json{{"scans_in_log", summary.scans_in_log}}
                        : Json(nullptr);
  json["delta_threshold"] = Rounded(report.delta_threshold, 1e9);
  json["counts"] = Json::parse(CountsAsJson(summary));
  json["cost"] = {{"initial", Digits(summary.initial_cost)},
                  {"measurement", Digits(summary.measurement_cost)},
                  {"structure", Digits(summary.structure_cost)}};
  json["em"] = {
      {"iterations", summary.em_iterations},
      {"converged", summary.em_termination == EmTermination::kConvergence}};
  json["unsolved"] =
      summary.IsUnsolved() ? Json(summary.solver->hint) : Json(nullptr);
  json["orthogonality_deg"] = summary.orthogonality_deg
                                  ? Digits(*summary.orthogonality_deg)
                                  : Json(nullptr);
  json["skipped"] = Json::array();
  for (const SkipReport& skip : summary.skipped) {
    json["skipped"].push_back({{"reason", skip.reason}, {"count", skip.count}});
  }
  json["loose"] = Json::array();
  for (const Summary::Tracking::Loose& part : summary.tracking.loose) {
    json["loose"].push_back(
        {{"begin", part.begin}, {"end", part.end}, {"why", part.why}});
  }
  json["open_way_m"] = Digits(summary.open_way);
  json["uncertain"] = Json::array();
  for (const Summary::LogInput& log : summary.logs) {
    if (log.uncertain.empty()) continue;
    json["uncertain"].push_back({{"input", log.input}, {"why", log.uncertain}});
  }
  json["apart"] = Json::array();
  for (std::size_t i = 0; i < summary.logs.size(); ++i) {
    const Summary::LogInput& log = summary.logs[i];
    if (log.why_apart.empty()) continue;
    Json candidate = nullptr;
    if (log.candidate) {
      const Pose2& pose = *log.candidate;
      candidate = {Rounded(pose[0]), Rounded(pose[1]),
                   Rounded(RadToDeg(pose[2]))};
    }
    json["apart"].push_back({{"number", i + 1},
                             {"input", log.input},
                             {"map", log.map},
                             {"why", log.why_apart},
                             {"candidate", std::move(candidate)}});
  }
  // Colours are those of the map.
  const MapDrawing drawing = DrawingFromGraph(*report.graph, report.path);
  std::map<FeatureId, int> clusters;
  for (const DrawnWall& wall : drawing.walls) {
    for (const FeatureId member : wall.members) clusters[member] = wall.cluster;
  }
  json["clusters"] = drawing.cluster_features;
  json["features"] = FeaturesToJson(report, clusters, &types, &sources);
  json["structure"] = StructureToJson(report, &relations, &sources);
  json["closures"] = ClosuresToJson(*report.graph);
  json["placed_closures"] = PlacedClosuresToJson(report.closures);
  json["grid"] = GridToJson(report.grid);
  json["live"] = report.reload_seconds > 0
                     ? Json{{"stage", report.stage},
                            {"seconds", report.reload_seconds},
                            {"written_at", report.written_at}}
                     : Json(nullptr);
  json["types"] = types.ToJson();
  json["sources"] = sources.ToJson();
  json["relations"] = relations.ToJson();
  json["units"] = UnitsOfRows(*report.graph);
  const std::vector<std::size_t> way = SparsePath(report.path);
  json["path"] = PathToJson(report.path, way);
  json["path_before"] = report.before.path.size() == report.path.size()
                            ? PathToJson(report.before.path, way)
                            : Json(nullptr);
  json["building"] = BuildingToJson(report.building);
  json["trace"] = TraceToJson(report.trace);
  return json;
}

Json RunToJson(const Report& report) {
  const Summary& summary = report.summary;
  Json flags = Json::array();
  for (const FlagValue& flag : report.flags) {
    flags.push_back({{"name", flag.name},
                     {"value", flag.value},
                     {"default_value", flag.default_value}});
  }
  Json phase_seconds = Json::array();
  for (const EmTraceRow& row : report.trace) {
    phase_seconds.push_back(Digits(row.phase.seconds));
  }
  Json steps = Json::array();
  for (const auto& [name, seconds] : summary.step_seconds) {
    steps.push_back({name, Digits(seconds)});
  }
  return {{"flags", std::move(flags)},
          {"time_s", {{"total", Digits(summary.total_seconds)}}},
          {"steps", std::move(steps)},
          {"peak_memory_bytes", summary.peak_memory_bytes},
          {"phase_seconds", std::move(phase_seconds)}};
}

// As it may stand in a script element: nothing in it ends the element. Bytes
// that are no UTF-8 are replaced.
std::string ScriptText(const Json& json) {
  const std::string text =
      json.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string escaped;
  escaped.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      escaped += "\\u003c";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

}  // namespace

void WriteReport(const Report& report, std::ostream& output) {
  const std::string page = kReportPage;
  const std::string data_mark = "PLUMBLINE_DATA";
  const std::string run_mark = "PLUMBLINE_RUN";
  const std::size_t data = page.find(data_mark);
  const std::size_t run = page.find(run_mark);
  if (data == std::string::npos || run == std::string::npos || run < data) {
    throw PLUMBLINE_ERROR("the page has no place for its data",
                          data_mark + " and then " + run_mark);
  }
  output << page.substr(0, data) << ScriptText(DataToJson(report))
         << page.substr(data + data_mark.size(), run - data - data_mark.size())
         << ScriptText(RunToJson(report)) << page.substr(run + run_mark.size());
}

void WriteReport(const Report& report, const std::string& path) {
  WriteFileAtomically(
      path, [&report](std::ostream& output) { WriteReport(report, output); });
}

}  // namespace plumbline
