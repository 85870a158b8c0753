#include <plumbline/core/session.h>
#include <plumbline/pipeline/without_structure.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

namespace plumbline {

std::map<FeatureId, Feature> SolveWithoutStructure(const Graph& graph,
                                                   const Registry& registry) {
  Transaction transaction;
  std::vector<FeatureId> ids;
  std::map<FeatureId, FeatureId> provisional;
  for (const Feature* feature : graph.Features()) {
    if (feature->is_virtual) continue;
    for (const double value : feature->parameters) {
      if (!std::isfinite(value)) return {};
    }
    Feature copy = *feature;
    copy.id = kNoId;
    ids.push_back(feature->id);
    provisional[feature->id] = transaction.AddFeature(std::move(copy));
  }
  bool has_structure = false;
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->state != ConstraintState::kLive) continue;
    if (constraint->kind == ConstraintClass::kStructure) {
      has_structure = true;
      continue;
    }
    Constraint copy = *constraint;
    copy.id = kNoId;
    bool is_raw = true;
    for (FeatureId& id : copy.features) {
      const auto found = provisional.find(id);
      is_raw &= found != provisional.end();
      if (is_raw) id = found->second;
    }
    if (is_raw) transaction.AddConstraint(std::move(copy));
  }
  if (!has_structure) return {};

  Graph measured;
  measured.Apply(std::move(transaction));
  SolverSession session(&measured, registry, SessionOptions());
  if (!session.SolveGlobal().usable) return {};
  std::map<FeatureId, Feature> result;
  const std::vector<const Feature*> solved = std::as_const(measured).Features();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    Feature feature = *solved[i];
    feature.id = ids[i];
    result.emplace(ids[i], std::move(feature));
  }
  return result;
}

MapWithoutStructure ReplayWithoutStructure(const std::vector<Scan>& scans,
                                           const Registry& registry,
                                           const LogSolverOptions& options,
                                           const LogSolverResult& result,
                                           const std::function<bool()>& stop) {
  MapWithoutStructure map;
  const auto is_stopped = [&stop] { return stop && stop(); };
  if (!options.structure || result.records.empty()) return map;
  Graph graph;
  LogSolverOptions front_end = options;
  if (RecoversPoses(options)) {
    front_end.builder.association.max_gap = options.max_gap_of_final_map;
  }
  const std::unique_ptr<GraphBuilder> builder =
      ProfileOf(options.features).make_builder(front_end, &graph, registry);
  ScanPointsOptions points_options = options.odometry.points;
  points_options.ScaleToNoise(result.noise_scale);
  std::vector<ScanPoint> points;
  for (const KeyScanRecord& record : result.records) {
    if (is_stopped()) {
      map.interrupted = true;
      return map;
    }
    const Scan& scan = scans[static_cast<std::size_t>(record.scan)];
    const RefinedScan& refined =
        result.refined[static_cast<std::size_t>(record.scan)];
    ExtractScanPoints(scan, points_options, &points);
    builder->AddScan(
        MakeKeyScan(record.scan, scan, refined, points, result.noise_scale));
  }
  builder->WriteRobot();
  std::vector<FeatureId> places;
  if (RecoversPoses(options)) {
    places = RecoverPoses(builder->records(),
                          RelocalizeKeyScans(graph, builder->records(),
                                             options.relocalization),
                          builder->robot_id(), RecoveryOptions(options),
                          registry, &graph)
                 .places;
  }
  SolverSession session(&graph, registry, options.session);
  session.SetStop(is_stopped);
  const bool usable = session.SolveGlobal().usable;
  map.interrupted = is_stopped();
  if (!usable || map.interrupted) return map;

  std::vector<Pose2> keys;
  if (!places.empty()) {
    keys = KeyPosesOfPlaces(graph, places, builder->records(),
                            options.adjustment.place_stride);
  } else if (options.refine != Refinement::kNone) {
    keys =
        RelocalizeKeyScans(graph, builder->records(), options.relocalization);
  }
  for (std::size_t i = 0; i < result.records.size(); ++i) {
    const KeyScanRecord& here = result.records[i];
    const KeyScanRecord& there = builder->records()[i];
    if (keys.size() == i) keys.push_back(there.pose);
    for (const FeatureMatch& match : here.matches) {
      if (map.features.count(match.feature) > 0) continue;
      for (const FeatureMatch& other : there.matches) {
        if (other.observation.pose != match.observation.pose) continue;
        const Feature* feature = graph.FindFeature(other.feature);
        if (feature == nullptr) continue;
        map.features[match.feature] = *feature;
        map.features[match.feature].id = match.feature;
        break;
      }
    }
    // Where a scan saw a point, this map may have chosen another one on the
    // same surface.
    for (const PointMatch& match : here.points) {
      if (map.features.count(match.feature) > 0) continue;
      const PointMatch* nearest = nullptr;
      double smallest = options.point_builder.spacing;
      for (const PointMatch& other : there.points) {
        const double distance =
            (other.observation.position - match.observation.position).norm();
        if (distance >= smallest ||
            graph.FindFeature(other.feature) == nullptr) {
          continue;
        }
        smallest = distance;
        nearest = &other;
      }
      if (nearest == nullptr) continue;
      map.features[match.feature] = graph.GetFeature(nearest->feature);
      map.features[match.feature].id = match.feature;
    }
  }
  map.path = InterpolateScans(result.refined, builder->records(), keys);
  // Two maps that are laid over each other begin at the same pose.
  const auto first = static_cast<std::size_t>(result.records.front().scan);
  const Pose2 by = Compose(result.trajectory[first], Inverse(map.path[first]));
  return Moved(by, std::move(map));
}

}  // namespace plumbline
