#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/session.h>
#include <plumbline/frontend/joint_adjustment.h>
#include <plumbline/frontend/range_noise.h>
#include <plumbline/frontend/range_ratio.h>
#include <plumbline/frontend/relocalization.h>
#include <plumbline/pipeline/known_structure.h>
#include <plumbline/pipeline/placement_tie.h>
#include <plumbline/pipeline/several_logs.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Two placements of a log in a map are one place when they put it so near to
// each other where they are firmest, m and rad.
constexpr double kSamePlace = 1.0;
constexpr double kSamePlaceTurn = DegToRad(5.0);
// Maps that close no loop of their own are bent by so many times as much as
// those of one building may differ, and may be compared again so often after
// they were adjusted together.
constexpr double kMoreMisfit = 3.0;
constexpr int kMostTrials = 3;
// Longest piece of wall, m, that contradicts in maps that are bent, where what
// was opened and shut is not counted.
constexpr double kLongestContradicting = 2.5;
constexpr int kNever = 1000000;

// Key scans of an earlier map, as those of a log that was solved.
LogSolverResult ResultOf(const KeyScanArchive& earlier) {
  LogSolverResult result;
  result.trajectory = earlier.trajectory;
  result.refined = earlier.refined;
  result.records = earlier.records;
  result.scan_seconds.assign(earlier.scans.size(), 0.0f);
  RangeNoise noise;
  for (const Scan& scan : earlier.scans) noise.Add(scan);
  result.range_sigma = noise.sigma();
  result.noise_scale = RangeNoiseScale(result.range_sigma);
  return result;
}

// A log as far as its own first map.
struct FirstMap {
  std::unique_ptr<LogSolver> solver;
  LogSolverResult result;
  double wall_length = 0.0;
  std::size_t num_scans = 0;
  // By record of a key scan, frame of this map; whether their poses were
  // adjusted.
  std::vector<KeyView> views;
  bool is_straight = false;
  // Of its frame in that of the first log of its group, and its first key scan
  // in that of the one that it hangs on there, which is this one of the
  // group's.
  Pose2 pose = Pose2::Zero();
  UncertainPose2 tie;
  int tied_to = -1;
  // Its trajectory as it was adjusted together with the group's, frame of this
  // map; empty where it was placed without.
  std::vector<Pose2> together;
};

// Logs that were placed in each other's building.
struct Group {
  std::vector<std::size_t> logs;
  // Of all of them, frame of the first; whether their poses were adjusted.
  std::vector<KeyView> views;
  bool is_straight = false;
  // The largest of theirs.
  double noise_scale = 1.0;
};

// Ties a log to a group where it was placed there: `track` are its views,
// `map` those of the group.
void TieTo(const std::vector<KeyView>& map, const std::vector<KeyView>& track,
           const TrackPlacement& placement, FirstMap* log) {
  double way = 0.0;
  for (int k = 1; k <= placement.to; ++k) {
    way += (track[static_cast<std::size_t>(k)].pose -
            track[static_cast<std::size_t>(k) - 1].pose)
               .head<2>()
               .norm();
  }
  log->tied_to = placement.from;
  log->tie =
      PlacementTie(Between(map[static_cast<std::size_t>(placement.from)].pose,
                           Compose(placement.pose, track.front().pose)),
                   way);
}

// These views and, moved by a pose, those.
std::vector<KeyView> Joined(std::vector<KeyView> views, const Pose2& pose,
                            const std::vector<KeyView>& others) {
  views.reserve(views.size() + others.size());
  for (const KeyView& other : others) {
    views.push_back(other);
    views.back().pose = Compose(pose, other.pose);
  }
  return views;
}

// Options of PlaceTrack for maps that are bent and will be adjusted together: a
// place that they may have in common.
TrackPlacementOptions WhereBent(TrackPlacementOptions options) {
  options.max_misfit *= kMoreMisfit;
  options.max_misfit_per_metre *= kMoreMisfit;
  options.min_agreeing = options.min_plain_agreeing;
  options.max_contradicting_stretch = kLongestContradicting;
  options.min_moved_doors = kNever;
  options.min_exchanged = kNever;
  options.min_agreeing_per_change = 1;
  options.max_mirrored_share = kNever;
  options.min_certain_information_share =
      0.5 * options.min_sure_information_share;
  return options;
}

// Appends a log to a map of several, as if the robot had been lost and found
// again.
void Append(FirstMap* log, LogSolverResult* whole) {
  LogSolverResult& part = log->result;
  const bool is_first = whole->records.empty();
  const int scans = static_cast<int>(whole->refined.size());
  const int records = static_cast<int>(whole->records.size());
  // From the frame of refined odometry to the first log's map.
  const Pose2 shift = Compose(Compose(log->pose, part.trajectory.front()),
                              Inverse(part.refined.front().pose));
  for (RefinedScan& scan : part.refined) {
    scan.pose = Compose(shift, scan.pose);
    if (scan.since >= 0) scan.since += scans;
    if (scan.missed_since >= 0) scan.missed_since += scans;
  }
  for (KeyScanRecord& record : part.records) {
    record.scan += scans;
    if (record.from >= 0) record.from += records;
    record.pose = Compose(log->pose, record.pose);
    // Features of a map that does not outlive this.
    record.matches.clear();
    record.points.clear();
  }
  if (!is_first) {
    RefinedScan& first = part.refined.front();
    first.tie = TrackTie::kMatched;
    first.since = whole->records[static_cast<std::size_t>(log->tied_to)].scan;
    first.since_key = log->tie;
    part.records.front().from = log->tied_to;
    part.records.front().motion = log->tie;
  }
  for (LooseTrack& loose : part.loose) {
    loose.begin += scans;
    loose.end += scans;
  }
  for (LoopClosure& closure : part.closures) closure.scan += scans;
  for (Pose2& pose : part.trajectory) pose = Compose(log->pose, pose);
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(whole->trajectory, part.trajectory);
  append(whole->refined, part.refined);
  append(whole->records, part.records);
  append(whole->loose, part.loose);
  append(whole->closures, part.closures);
  append(whole->notes, part.notes);
  append(whole->scan_seconds, part.scan_seconds);
  whole->frontend_seconds += part.frontend_seconds;
  whole->relocalization_seconds += part.relocalization_seconds;
  whole->key_scans += part.key_scans;
  whole->wide_searches += part.wide_searches;
  whole->refused_matches += part.refused_matches;
  whole->lost_tracks += part.lost_tracks;
  // The noisiest laser has its say.
  whole->range_sigma = std::max(whole->range_sigma, part.range_sigma);
  whole->noise_scale = std::max(whole->noise_scale, part.noise_scale);
  whole->feature_matches += part.feature_matches;
  whole->features_created += part.features_created;
  whole->em.iterations += part.em.iterations;
  whole->initial_cost.measurement += part.initial_cost.measurement;
  whole->initial_cost.structure += part.initial_cost.structure;
}

class Merger {
 public:
  Merger(const Registry& registry, std::vector<Log> logs,
         const SeveralLogsOptions& options, const SeveralLogsControl& control)
      : registry_(registry),
        logs_(std::move(logs)),
        options_(options),
        control_(control) {
    control_.run.checkpoint = nullptr;
    options_.placement.points = options_.solver.odometry.points;
    options_.placement.matcher = options_.solver.odometry.matcher;
    result_.logs.resize(logs_.size());
  }

  SeveralLogsResult Run() {
    for (std::size_t i = 0; i < logs_.size(); ++i) {
      if (control_.begin_log) control_.begin_log(i);
      MakeFirstMap(i);
      if (result_.interrupted) return std::move(result_);
    }
    if (control_.run.step) control_.run.step("placing of logs");
    std::vector<std::size_t> left;
    for (std::size_t i = 0; i < logs_.size(); ++i) left.push_back(i);
    if (options_.earlier != nullptr) {
      FinishInEarlierMap(std::move(left));
      return std::move(result_);
    }
    while (!left.empty()) {
      Group group;
      group.logs.push_back(left.front());
      group.views = maps_[left.front()].views;
      group.is_straight = maps_[left.front()].is_straight;
      group.noise_scale = maps_[left.front()].result.noise_scale;
      left.erase(left.begin());
      Gather(&left, &group);
      if (IsStopped()) return std::move(result_);
      Finish(group);
      if (result_.interrupted) return std::move(result_);
    }
    return std::move(result_);
  }

 private:
  // Those of a map whose frame is that of this log, or the earlier map's. What
  // somebody says of places in the frame of the first log's map holds there.
  LogSolverOptions OptionsFrom(std::size_t front) const {
    LogSolverOptions options = options_.solver;
    if (front != 0 && options_.earlier == nullptr) {
      options.known = InAnotherFrame(std::move(options.known));
    }
    return options;
  }

  bool IsStopped() {
    if (!result_.interrupted && control_.run.stop && control_.run.stop()) {
      result_.interrupted = true;
    }
    return result_.interrupted;
  }

  void MakeFirstMap(std::size_t i) {
    FirstMap log;
    log.solver = std::make_unique<LogSolver>(registry_, OptionsFrom(i));
    log.result = log.solver->RunFirst(logs_[i], control_.run);
    result_.interrupted = result_.interrupted || log.result.interrupted;
    log.num_scans = logs_[i].scans.size();
    log.wall_length = LengthOfWalls(log.solver->graph());
    std::vector<int> keys;
    std::vector<Pose2> poses;
    for (const KeyScanRecord& record : log.result.records) {
      keys.push_back(record.scan);
      poses.push_back(
          log.result.trajectory[static_cast<std::size_t>(record.scan)]);
    }
    log.views = MakeKeyViews(logs_[i].scans, keys, poses,
                             PlacementWith(log.result.noise_scale).points);
    maps_.push_back(std::move(log));
  }

  // The options of placing that go with the noise of lasers.
  TrackPlacementOptions PlacementWith(double noise_scale) const {
    TrackPlacementOptions placement = options_.placement;
    placement.ScaleToNoise(noise_scale);
    return placement;
  }

  // Starts are given in the first log's frame, or the earlier map's.
  bool TakesStarts(const Group& group) const {
    return options_.earlier != nullptr || group.logs.front() == 0;
  }

  std::optional<Pose2> StartOf(std::size_t i) const {
    return i < options_.starts.size() ? options_.starts[i] : std::nullopt;
  }

  // Adds all logs that can be placed in the group. They leave `left`.
  void Gather(std::vector<std::size_t>* left, Group* group) {
    bool grows = true;
    while (grows) {
      grows = false;
      for (std::size_t k = 0; k < left->size();) {
        if (IsStopped()) return;
        if (!Place((*left)[k], group)) {
          ++k;
          continue;
        }
        left->erase(left->begin() + static_cast<std::ptrdiff_t>(k));
        // What did not fit before may fit now.
        grows = true;
      }
    }
  }

  void FinishInEarlierMap(std::vector<std::size_t> left) {
    const KeyScanArchive& earlier = *options_.earlier;
    Group group;
    std::vector<int> keys;
    for (const KeyScanRecord& record : earlier.records) {
      keys.push_back(record.scan);
    }
    earlier_result_ = ResultOf(earlier);
    group.noise_scale = earlier_result_.noise_scale;
    group.views = MakeKeyViews(earlier.scans, keys, earlier.trajectory,
                               PlacementWith(group.noise_scale).points);
    Gather(&left, &group);
    if (IsStopped()) return;
    result_.is_elsewhere = !left.empty();
    if (result_.is_elsewhere) return;
    if (options_.localize_only) {
      Localize(group);
    } else if (!FinishTogether(group)) {
      for (const std::size_t i : group.logs) RefuseTogether(i);
      result_.is_elsewhere = true;
    }
  }

  // The poses of the logs of the group in the earlier map.
  void Localize(const Group& group) {
    if (control_.run.step) control_.run.step("localization");
    MapOfLogs map;
    map.logs = group.logs;
    map.scans = options_.earlier->scans;
    map.result = std::move(earlier_result_);
    for (const std::size_t i : group.logs) {
      Append(&maps_[i], &map.result);
      std::move(logs_[i].scans.begin(), logs_[i].scans.end(),
                std::back_inserter(map.scans));
    }
    std::vector<Pose2> keys;
    for (const KeyScanRecord& record : map.result.records) {
      keys.push_back(
          map.result.trajectory[static_cast<std::size_t>(record.scan)]);
    }
    Graph graph;
    SolverSession session(&graph, registry_, options_.solver.session);
    JointAdjustmentOptions adjustment_options = options_.solver.adjustment;
    adjustment_options.ScaleToNoise(map.result.noise_scale);
    adjustment_options.num_held_records = options_.earlier->records.size();
    JointAdjustment adjustment(&graph, &session, registry_, map.scans,
                               map.result.refined, map.result.records, keys,
                               kNoId, adjustment_options, control_.run.stop);
    adjustment.Adjust();
    if (IsStopped()) return;
    adjustment.MatchAnew();
    adjustment.Adjust();
    if (IsStopped()) return;
    adjustment.EstimateVariances();
    map.result.scan_relations = adjustment.num_relations();
    map.result.trajectory = InterpolateScans(
        map.result.refined, map.result.records, adjustment.KeyPoses());
    TellOfRanges(&map);
    Add(std::move(map));
  }

  // Adds a log to the group if it has its place there.
  bool Place(std::size_t i, Group* group) {
    FirstMap& log = maps_[i];
    const double noise_scale =
        std::max(group->noise_scale, log.result.noise_scale);
    const TrackPlacementOptions options = PlacementWith(noise_scale);
    const std::optional<Pose2> start =
        TakesStarts(*group) ? StartOf(i) : std::nullopt;
    const auto place = [&] {
      TrackPlacement placement = PlaceTrack(group->views, log.views, start,
                                            options, control_.run.stop);
      if (placement.is_candidate && !placement.has_twin && !start) {
        PlaceTheOtherWay(group->views, log.views, options, &placement);
      }
      return placement;
    };
    TrackPlacement placement = place();
    // First maps are bent: what nearly fits may do so when they are not.
    if (!placement.found &&
        placement.agreeing >= options_.placement.min_agreeing && !IsStopped() &&
        Straighten(i, group)) {
      const TrackPlacement again = place();
      if (again.found || again.agreeing >= placement.agreeing) {
        placement = again;
      }
    }
    if (!placement.found && !start && !IsStopped()) {
      PlaceTogether(i, options, group, &placement);
    }
    Tell(i, *group, placement);
    if (!placement.found) return false;
    TieTo(group->views, log.views, placement, &log);
    log.pose = placement.pose;
    group->logs.push_back(i);
    group->noise_scale = noise_scale;
    group->views = Joined(std::move(group->views), log.pose, log.views);
    group->is_straight = false;
    return true;
  }

  // A log of which only a part is in the map says less than the map says that
  // has all of its place in the log: whether two logs are one building must not
  // hang on which comes first. Finds a mere candidate when the map finds its
  // place in the log there, by more than a corner that others have, too. Which
  // of two places is meant nobody can say.
  void PlaceTheOtherWay(const std::vector<KeyView>& map,
                        const std::vector<KeyView>& track,
                        const TrackPlacementOptions& options,
                        TrackPlacement* placement) {
    const TrackPlacement other =
        PlaceTrack(track, map, std::nullopt, options, control_.run.stop);
    if (!other.found || other.has_twin ||
        other.agreeing < options.min_plain_agreeing) {
      return;
    }
    const Pose2& seen_from = track[static_cast<std::size_t>(other.from)].pose;
    const Pose2 apart = Between(Compose(Inverse(other.pose), seen_from),
                                Compose(placement->pose, seen_from));
    if (apart.head<2>().norm() > kSamePlace ||
        std::abs(apart[2]) > kSamePlaceTurn) {
      return;
    }
    placement->found = true;
    placement->is_candidate = false;
    placement->doubt = placement->why_not + "; but the map fits in it";
    placement->why_not.clear();
  }

  // Where the track lies in the map, by the track's windows or else by the
  // map's.
  TrackPlacement PlaceEitherWay(const std::vector<KeyView>& map,
                                const std::vector<KeyView>& track,
                                const TrackPlacementOptions& options) {
    const TrackPlacement placement =
        PlaceTrack(map, track, std::nullopt, options, control_.run.stop);
    if (placement.found || placement.has_twin) return placement;
    TrackPlacement other =
        PlaceTrack(track, map, std::nullopt, options, control_.run.stop);
    if (!other.found || other.has_twin) return placement;
    other.pose = Inverse(other.pose);
    std::swap(other.from, other.to);
    std::swap(other.walls_through_map, other.walls_through_track);
    return other;
  }

  // Where much of a log is found, but not as certainly as it has to be, its map
  // and the group's may be too much bent for that: both are adjusted together
  // as if it was its place, and what was not certain is asked again of what
  // they are then. They stay as they were unless it is found.
  void PlaceTogether(std::size_t i, const TrackPlacementOptions& options,
                     Group* group, TrackPlacement* placement) {
    if (options_.earlier != nullptr || placement->has_twin ||
        placement->agreeing < options.min_plain_agreeing) {
      return;
    }
    FirstMap& log = maps_[i];
    std::vector<std::size_t> logs = group->logs;
    logs.push_back(i);
    std::vector<KeyView> map = group->views;
    std::vector<KeyView> track = log.views;
    for (int trial = 0; trial < kMostTrials; ++trial) {
      const TrackPlacement bent =
          PlaceEitherWay(map, track, WhereBent(options));
      if (!bent.found) return;
      TieTo(map, track, bent, &log);
      std::vector<KeyView> both = Joined(map, bent.pose, track);
      StraightenViews(logs, &both);
      if (IsStopped()) return;
      const auto middle =
          both.begin() + static_cast<std::ptrdiff_t>(map.size());
      map.assign(both.begin(), middle);
      track.assign(middle, both.end());
      TrackPlacement straight = PlaceEitherWay(map, track, options);
      if (!straight.found) continue;
      // In the frame of the log its first view stays where it is.
      const Pose2 frame =
          Compose(track.front().pose, Inverse(log.views.front().pose));
      for (KeyView& view : track) {
        view.pose = Compose(Inverse(frame), view.pose);
      }
      straight.pose = Compose(straight.pose, frame);
      *placement = straight;
      group->views = std::move(map);
      log.views = std::move(track);
      KeepTogether(log.views.begin(), &log);
      auto views = group->views.cbegin();
      for (const std::size_t other : group->logs) {
        views = KeepTogether(views, &maps_[other]);
      }
      return;
    }
  }

  // What a log's map of several begins with; returns where its views end.
  static std::vector<KeyView>::const_iterator KeepTogether(
      std::vector<KeyView>::const_iterator views, FirstMap* log) {
    const Pose2 frame = Compose(log->views.front().pose, Inverse(views->pose));
    std::vector<Pose2> keys;
    for (std::size_t k = 0; k < log->views.size(); ++k, ++views) {
      keys.push_back(Compose(frame, views->pose));
    }
    log->together =
        InterpolateScans(log->result.refined, log->result.records, keys);
    return views;
  }

  // What came nearest to being its place is what there is to say of it; a
  // candidate is what somebody can use.
  void Tell(std::size_t i, const Group& group,
            const TrackPlacement& placement) {
    LogInMap& log = result_.logs[i];
    const bool is_candidate =
        (placement.is_candidate || placement.needs_start) && TakesStarts(group);
    const bool is_more = is_candidate == log.candidate.has_value()
                             ? placement.agreeing >= log.placement.agreeing
                             : is_candidate;
    if (!placement.found && !is_more) return;
    log.placement = placement;
    log.candidate.reset();
    if (is_candidate) {
      log.candidate = Compose(placement.pose, maps_[i].views.front().pose);
    }
  }

  // Adjusts the poses that the views of the group and of a log are seen from,
  // which takes the time of a few scans; false when nothing is left to adjust.
  bool Straighten(std::size_t i, Group* group) {
    FirstMap& log = maps_[i];
    bool any = false;
    if (!log.is_straight) {
      StraightenViews({i}, &log.views);
      log.is_straight = any = true;
    }
    // An earlier map was adjusted.
    if (!group->is_straight && options_.earlier == nullptr) {
      if (group->logs.size() == 1 && maps_[group->logs.front()].is_straight) {
        group->views = maps_[group->logs.front()].views;
      } else {
        StraightenViews(group->logs, &group->views);
      }
      group->is_straight = any = true;
    }
    return any && !IsStopped();
  }

  // `views` are those of these logs, one after the other.
  void StraightenViews(const std::vector<std::size_t>& logs,
                       std::vector<KeyView>* views) {
    LogSolverResult whole;
    std::vector<Scan> scans;
    for (const std::size_t i : logs) {
      FirstMap copy;
      copy.result = maps_[i].result;
      copy.pose = maps_[i].pose;
      copy.tie = maps_[i].tie;
      copy.tied_to = maps_[i].tied_to;
      Append(&copy, &whole);
      scans.insert(scans.end(), logs_[i].scans.begin(), logs_[i].scans.end());
    }
    std::vector<Pose2> poses;
    for (const KeyView& view : *views) poses.push_back(view.pose);
    Graph graph;
    SolverSession session(&graph, registry_, options_.solver.session);
    JointAdjustmentOptions adjustment_options = options_.solver.adjustment;
    adjustment_options.ScaleToNoise(whole.noise_scale);
    JointAdjustment adjustment(&graph, &session, registry_, scans,
                               whole.refined, whole.records, poses, kNoId,
                               adjustment_options, control_.run.stop);
    adjustment.Adjust();
    if (IsStopped()) return;
    adjustment.MatchAnew();
    adjustment.Adjust();
    if (IsStopped()) return;
    poses = adjustment.KeyPoses();
    for (std::size_t k = 0; k < views->size(); ++k) (*views)[k].pose = poses[k];
  }

  void Finish(const Group& group) {
    if (group.logs.size() > 1 && FinishTogether(group)) return;
    for (const std::size_t i : group.logs) {
      if (group.logs.size() > 1) RefuseTogether(i);
      MapOfLogs map;
      map.logs = {i};
      map.scans = std::move(logs_[i].scans);
      map.solver = std::move(maps_[i].solver);
      map.result = map.solver->GoOn(map.scans, std::move(maps_[i].result), 0.0,
                                    control_.run);
      Add(std::move(map));
      if (result_.interrupted) return;
    }
  }

  void RefuseTogether(std::size_t i) {
    result_.logs[i].placement.found = false;
    result_.logs[i].placement.why_not =
        "the map of the logs together has hardly any walls";
  }

  // False when the logs have no map together.
  bool FinishTogether(const Group& group) {
    MapOfLogs map;
    map.logs = group.logs;
    LogSolverResult first;
    double wall_length = 0.0;
    std::size_t at = 0;
    if (options_.earlier != nullptr) {
      first = std::move(earlier_result_);
      map.scans = options_.earlier->scans;
      wall_length = options_.earlier_wall_length;
      at = map.scans.size();
    }
    std::vector<LogSolverResult> before;
    for (const std::size_t i : group.logs) {
      before.push_back(maps_[i].result);
      if (!maps_[i].together.empty()) {
        maps_[i].result.trajectory = maps_[i].together;
      }
      Append(&maps_[i], &first);
      std::move(logs_[i].scans.begin(), logs_[i].scans.end(),
                std::back_inserter(map.scans));
      wall_length = std::max(wall_length, maps_[i].wall_length);
    }
    map.solver =
        std::make_unique<LogSolver>(registry_, OptionsFrom(group.logs.front()));
    map.result = map.solver->GoOn(map.scans, std::move(first), wall_length,
                                  control_.run);
    if (map.result.second_map_refused) {
      for (std::size_t k = 0; k < group.logs.size(); ++k) {
        const std::size_t i = group.logs[k];
        for (Scan& scan : logs_[i].scans) scan = std::move(map.scans[at++]);
        maps_[i].result = std::move(before[k]);
      }
      return false;
    }
    TellOfRanges(&map);
    Add(std::move(map));
    return true;
  }

  // Tells of lasers that do not agree on the metre: poses bend until both see
  // one building, which is true to neither.
  void TellOfRanges(MapOfLogs* map) const {
    LogSolverResult& result = map->result;
    if (result.interrupted) return;
    std::vector<int> keys;
    std::vector<Pose2> poses;
    for (const KeyScanRecord& record : result.records) {
      keys.push_back(record.scan);
      poses.push_back(result.trajectory[static_cast<std::size_t>(record.scan)]);
    }
    const std::vector<KeyView> views = MakeKeyViews(
        map->scans, keys, poses, PlacementWith(result.noise_scale).points);
    std::size_t end =
        options_.earlier != nullptr ? options_.earlier->scans.size() : 0;
    const auto first_from = [&](std::size_t scan) {
      return views.begin() + (std::lower_bound(keys.begin(), keys.end(),
                                               static_cast<int>(scan)) -
                              keys.begin());
    };
    for (const std::size_t i : map->logs) {
      const auto first = first_from(end);
      end += maps_[i].num_scans;
      const std::optional<RangeRatio> ratio =
          CompareRanges({views.begin(), first}, {first, first_from(end)});
      if (!ratio || !ratio->is_significant()) continue;
      char text[200];
      std::snprintf(text, sizeof text,
                    "the ranges of log %zu are %.1f %% %s (+-%.1f) than those "
                    "of the map that it was placed in: one of the lasers is "
                    "off, and the map is true to neither",
                    i + 1, 100.0 * std::abs(ratio->excess),
                    ratio->excess > 0.0 ? "longer" : "shorter",
                    100.0 * ratio->sigma);
      result.notes.push_back(text);
    }
  }

  void Add(MapOfLogs map) {
    std::size_t begin =
        options_.earlier != nullptr ? options_.earlier->scans.size() : 0;
    for (const std::size_t i : map.logs) {
      LogInMap& log = result_.logs[i];
      log.map = result_.maps.size();
      log.begin = begin;
      log.end = begin += maps_[i].num_scans;
    }
    result_.interrupted = result_.interrupted || map.result.interrupted;
    result_.maps.push_back(std::move(map));
  }

  const Registry& registry_;
  std::vector<Log> logs_;
  SeveralLogsOptions options_;
  SeveralLogsControl control_;
  std::vector<FirstMap> maps_;
  // The earlier map's.
  LogSolverResult earlier_result_;
  SeveralLogsResult result_;
};

}  // namespace

SeveralLogsResult SolveSeveralLogs(const Registry& registry,
                                   std::vector<Log> logs,
                                   const SeveralLogsOptions& options,
                                   const SeveralLogsControl& control) {
  if (logs.empty()) throw PLUMBLINE_ERROR("no logs", "one or more");
  if (!ProfileOf(options.solver.features).has_walls ||
      options.solver.refine != Refinement::kFull) {
    throw PLUMBLINE_ERROR("several logs without a second map",
                          "segments and full refinement");
  }
  if (options.localize_only && options.earlier == nullptr) {
    throw PLUMBLINE_ERROR("nothing to localize in", "an earlier map");
  }
  if (options.earlier != nullptr && options.earlier->scans.empty()) {
    throw PLUMBLINE_ERROR("an earlier map without key scans", "key scans");
  }
  for (std::size_t i = 0; i < logs.size(); ++i) {
    if (logs[i].scans.empty()) {
      throw PLUMBLINE_ERROR("log " + std::to_string(i + 1) + " has no scans",
                            "scans");
    }
  }
  return Merger(registry, std::move(logs), options, control).Run();
}

}  // namespace plumbline
