#include <plumbline/core/wall.h>
#include <plumbline/frontend/missed_motion.h>
#include <plumbline/pipeline/map_review.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Of crossings whose times and those of what speaks against them enclose
// others' only these: the fault lies between.
std::vector<BlockedWay> Innermost(const std::vector<BlockedWay>& ways) {
  std::vector<BlockedWay> left;
  const auto span = [](const BlockedWay& way) {
    return std::minmax(way.crossing, way.seen);
  };
  for (const BlockedWay& way : ways) {
    const auto [begin, end] = span(way);
    const bool encloses =
        std::any_of(ways.begin(), ways.end(), [&](const BlockedWay& other) {
          const auto [first, last] = span(other);
          return first >= begin && last <= end &&
                 (first > begin || last < end || &other < &way);
        });
    if (!encloses) left.push_back(way);
  }
  return left;
}

void AddLoose(int begin, int end, std::string why,
              std::vector<LooseTrack>* loose) {
  LooseTrack track;
  track.begin = begin;
  track.end = end;
  track.found = true;
  track.why = std::move(why);
  loose->push_back(std::move(track));
}

void AddContradictions(const std::vector<MapContradiction>& parts,
                       std::vector<LooseTrack>* loose) {
  for (const MapContradiction& part : parts) {
    AddLoose(part.begin, part.end,
             "what the robot saw here contradicts what it saw on other visits",
             loose);
  }
}

void AddBlockedWays(const std::vector<BlockedWay>& ways,
                    std::vector<LooseTrack>* loose) {
  for (const BlockedWay& way : Innermost(ways)) {
    const auto [begin, end] = std::minmax(way.crossing, way.seen);
    // A tie between them that is reported already may be why.
    const bool is_explained =
        std::any_of(loose->begin(), loose->end(),
                    [begin = begin, end = end](const LooseTrack& track) {
                      return (track.begin >= begin && track.begin < end) ||
                             (track.end > begin && track.end <= end);
                    });
    if (is_explained) continue;
    AddLoose(begin, end,
             "between these two the robot went through what it has seen as a "
             "wall: that was moved, or the map is wrong",
             loose);
  }
}

// Where more than so much, m, was missing.
void AddBlindRuns(const std::vector<BlindRun>& runs, double most,
                  std::vector<LooseTrack>* loose) {
  for (const BlindRun& run : runs) {
    const double missed = run.missed.head<2>().norm();
    if (missed <= most) continue;
    const bool is_told = std::any_of(
        loose->begin(), loose->end(), [&run](const LooseTrack& track) {
          return track.begin <= run.begin && track.end >= run.end;
        });
    if (is_told) continue;
    char why[128];
    std::snprintf(why, sizeof why,
                  "odometry alone says how far the robot went here, and missed "
                  "%.1f m",
                  missed);
    AddLoose(run.begin, run.end, why, loose);
  }
}

void AddOpenWays(const std::vector<OpenWay>& ways,
                 std::vector<LooseTrack>* loose) {
  for (const OpenWay& way : ways) {
    char why[128];
    std::snprintf(why, sizeof why,
                  "nothing in sight shows how far the robot went: the %.0f m "
                  "of this way are known to %.1f m",
                  way.length, way.sigma);
    AddLoose(way.begin, way.end, why, loose);
  }
}

// Where the distance between two places is not known well.
void AddNoteOn(const UncertainLengths& lengths,
               std::vector<std::string>* notes) {
  if (lengths.distance_sigma == 0.0) return;
  char note[160];
  std::snprintf(note, sizeof note,
                "little in sight shows how far the robot went: places %.0f m "
                "from each other are known to %.1f m",
                lengths.distance, lengths.distance_sigma);
  notes->push_back(note);
}

void AddDisputedWays(const std::vector<DisputedWay>& ways,
                     std::vector<LooseTrack>* loose) {
  for (const DisputedWay& way : ways) {
    char why[160];
    std::snprintf(why, sizeof why,
                  "odometry has %.1f m of way here, the map %.1f m: wheels "
                  "slipped, or what the robot saw went along with it",
                  way.by_odometry, way.by_map);
    AddLoose(way.begin, way.end, why, loose);
  }
}

void AddContestedWays(const std::vector<ContestedWay>& ways,
                      const std::vector<DisputedWay>& told,
                      std::vector<LooseTrack>* loose) {
  for (const ContestedWay& way : ways) {
    const bool is_told = std::any_of(
        told.begin(), told.end(), [&way](const DisputedWay& disputed) {
          const int common = std::min(disputed.end, way.end) -
                             std::max(disputed.begin, way.begin);
          return 2 * common >= way.end - way.begin;
        });
    if (is_told) continue;
    char why[192];
    std::snprintf(
        why, sizeof why,
        "most of what is in sight goes along with the robot, or its "
        "wheels slip: odometry has %.1f m of way here, the map %.1f m",
        way.by_odometry, way.by_map);
    AddLoose(way.begin, way.end, why, loose);
  }
}

// Of level 0.
std::vector<Wall> WallsOf(const Graph& graph) {
  std::vector<Wall> walls;
  for (const Feature* feature : graph.Features()) {
    if (feature->level != 0) continue;
    if (const std::optional<Wall> wall = WallOf(*feature)) {
      walls.push_back(*wall);
    }
  }
  return walls;
}

}  // namespace

MapReview::MapReview(const std::vector<Scan>& scans,
                     const std::vector<KeyScanRecord>& records,
                     const std::vector<Pose2>& trajectory,
                     const MapCheckOptions& check,
                     const WayCheckOptions& way_check,
                     std::function<bool()> stop)
    : scans_(scans),
      trajectory_(trajectory),
      check_(check),
      way_check_(way_check),
      stop_(std::move(stop)) {
  for (const KeyScanRecord& record : records) {
    keys_.push_back(record.scan);
    follows_.push_back(FollowsTheOneBefore(record));
    poses_.push_back(trajectory[static_cast<std::size_t>(record.scan)]);
  }
}

bool MapReview::HasContradictions() const {
  return !FindContradictions(scans_, keys_, poses_, check_, stop_).empty();
}

MapAgreement MapReview::Agreement() const {
  return CountAgreement(scans_, keys_, poses_, check_, stop_);
}

UncertainLengths MapReview::Lengths() const {
  OpenWayOptions options;
  options.points = check_.points;
  // Normals over a decimetre help the map, but promise more than they hold.
  options.points.short_range = 0.0;
  options.matcher = check_.matcher;
  options.num_threads = check_.num_threads;
  return FindUncertainLengths(scans_, keys_, poses_, follows_, options, stop_);
}

double MapReview::LargestOpenSigma() const { return Lengths().LargestSigma(); }

void MapReview::Revise(const Graph& graph,
                       const std::vector<RefinedScan>& refined,
                       bool tell_open_ways, std::vector<LooseTrack>* loose,
                       std::vector<std::string>* notes) const {
  const std::vector<MapContradiction> contradictions =
      FindContradictions(scans_, keys_, poses_, check_, stop_);
  const std::vector<BlockedWay> blocked =
      FindBlockedWays(scans_, keys_, poses_, WallsOf(graph), way_check_, stop_);
  // Where something is wrong no tie is taken for sure.
  if (contradictions.empty() && blocked.empty()) DropConfirmed(loose);
  AddContradictions(contradictions, loose);
  AddBlockedWays(blocked, loose);
  AddBlindRuns(FindBlindRuns(refined), check_.open_way, loose);
  const OdometryAgreement odometry = Odometry();
  AddDisputedWays(odometry.disputed, loose);
  ContestedWayOptions contested;
  contested.points = check_.points;
  contested.num_threads = check_.num_threads;
  // A laser that looks elsewhere than the log says contests all of the way.
  if (!odometry.is_course_disputed) {
    AddContestedWays(
        FindContestedWays(scans_, trajectory_, odometry.scale, contested),
        odometry.disputed, loose);
  }
  if (tell_open_ways) {
    const UncertainLengths lengths = Lengths();
    AddOpenWays(lengths.ways, loose);
    AddNoteOn(lengths, notes);
  }
  std::stable_sort(loose->begin(), loose->end(),
                   [](const LooseTrack& a, const LooseTrack& b) {
                     return a.begin < b.begin;
                   });
}

void MapReview::DropConfirmed(std::vector<LooseTrack>* loose) const {
  std::vector<TrackCut> cuts;
  for (const LooseTrack& track : *loose) {
    // A guess is one from its first scan on.
    cuts.push_back({track.begin, track.found ? track.end : track.begin + 1});
  }
  const std::vector<TieVerdict> verdicts =
      JudgeTies(scans_, keys_, trajectory_, cuts, check_, stop_);
  std::vector<LooseTrack> left;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    LooseTrack& track = (*loose)[i];
    if (track.found && !track.is_ambiguous &&
        verdicts[i] == TieVerdict::kConfirmed) {
      continue;
    }
    if (track.found && verdicts[i] == TieVerdict::kOpen) WidenToStill(&track);
    left.push_back(std::move(track));
  }
  *loose = std::move(left);
}

// Where odometry stood still on either side, the robot need not have.
void MapReview::WidenToStill(LooseTrack* track) const {
  const auto stands = [this](int first, int second) {
    return Between(scans_[static_cast<std::size_t>(first)].odometry,
                   scans_[static_cast<std::size_t>(second)].odometry)
        .isZero(0.0);
  };
  const int begin = track->begin;
  const int end = track->end;
  const int last = static_cast<int>(scans_.size()) - 1;
  while (track->begin > 0 && stands(track->begin - 1, track->begin)) {
    --track->begin;
  }
  while (track->end < last && stands(track->end, track->end + 1)) ++track->end;
  if (track->begin == begin && track->end == end) return;
  track->why +=
      "; odometry stood still, and nothing in sight shows that the robot did";
}

}  // namespace plumbline
