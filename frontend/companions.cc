#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/companions.h>
#include <plumbline/frontend/near_points.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Neighbouring returns farther apart than this lie on two things, m.
constexpr double kEnd = 0.2;
// Beams over this angle go all around, rad.
constexpr double kRound = 6.1;
// Steps of odometry longer than this between two scans are jumps, m.
constexpr double kJump = 1.0;
// Comparisons that one thread makes in a row.
constexpr std::size_t kInTurn = 64;
// No points are put between beams this far apart, rad.
constexpr double kNoneBetween = 4.0;
// Comparisons and scans without it after which a companion is another one.
constexpr int kMostMissed = 2;
// Comparisons that tell how it looks where it is first and last found.
constexpr std::size_t kLooksAtAnEnd = 3;
// A scan that has other things in front of more than this share of it says
// nothing; so many scans in a row may be such.
constexpr double kMostHidden = 0.7;
constexpr int kLongestHidden = 50;
// Cosine of the angle up to which two directions are those of one beam.
const double kSameBeam = std::cos(DegToRad(1.0));

// What two scans say of what stands and what goes along.
struct Comparison {
  // Where things that go along are in the robot's frame, in groups.
  std::vector<std::vector<Vector2d>> things;
  // Returns that stand, and those that go along.
  int witnesses = 0;
  int along = 0;
};

// Whether what point `i` lies on ends before what lies beside it, in the order
// of beams (`way` 1 or -1; around where the scan `is_round`).
bool EndsFreely(const std::vector<ScanPoint>& points, std::size_t i, int way,
                bool is_round, const CompanionOptions& options) {
  double length = 0.0;
  for (std::size_t steps = 0; steps < points.size(); ++steps) {
    if (!is_round && (way > 0 ? i + 1 == points.size() : i == 0)) return false;
    const std::size_t next = way > 0 ? (i + 1) % points.size()
                                     : (i + points.size() - 1) % points.size();
    const double apart = (points[next].position - points[i].position).norm();
    if (apart > kEnd) {
      return points[next].range >= points[i].range + options.min_depth;
    }
    length += apart;
    if (length > options.max_length) return false;
    i = next;
  }
  return false;
}

Comparison Compare(const std::vector<ScanPoint>& before,
                   const std::vector<ScanPoint>& now, const Pose2& motion,
                   bool is_round, const CompanionOptions& options) {
  Comparison comparison;
  const NearPoints near(before);
  const PoseTransform transform(motion);
  std::vector<Vector2d> thing;
  std::size_t first = 0;
  std::size_t last = 0;
  const auto end_thing = [&] {
    if (static_cast<int>(thing.size()) >= options.min_returns &&
        EndsFreely(now, first, -1, is_round, options) &&
        EndsFreely(now, last, 1, is_round, options)) {
      comparison.things.push_back(thing);
    }
    thing.clear();
  };
  for (std::size_t i = 0; i < now.size(); ++i) {
    const ScanPoint& point = now[i];
    if (point.range > options.max_range || point.is_between) continue;
    const Vector2d was = transform.Point(point.position);
    const double says = ShiftAlongNormal(point, was);
    if (says < options.least_shift) continue;
    const bool stays = near.DistanceTo(point.position, point.normal) <=
                       std::min(NearPoints::kGate, options.stays * says);
    const bool stands =
        near.DistanceTo(was, transform.Direction(point.normal)) <=
        options.stands;
    comparison.witnesses += stands && !stays;
    if (stands || !stays) continue;
    ++comparison.along;
    if (!thing.empty() &&
        (point.position - thing.back()).norm() > options.gap) {
      end_thing();
    }
    if (thing.empty()) first = i;
    last = i;
    thing.push_back(point.position);
  }
  end_thing();
  return comparison;
}

Vector2d MiddleOf(const std::vector<Vector2d>& thing) {
  Vector2d sum = Vector2d::Zero();
  for (const Vector2d& place : thing) sum += place;
  return sum / static_cast<double>(thing.size());
}

// A thing that goes along from one comparison to the next.
struct Track {
  // Comparison, and where it was seen.
  std::vector<std::pair<int, std::vector<Vector2d>>> seen;
  Vector2d middle = Vector2d::Zero();

  int first() const { return seen.front().first; }
  int last() const { return seen.back().first; }
};

class CompanionSearch {
 public:
  CompanionSearch(const CompanionOptions& options,
                  const std::vector<Scan>& scans)
      : options_(options), scans_(scans) {
    for (int i = 0; i < static_cast<int>(scans.size()); ++i) {
      const double step =
          i == 0 ? 0.0
                 : (scans[Index(i)].odometry - scans[Index(i - 1)].odometry)
                       .head<2>()
                       .norm();
      way_.push_back((i == 0 ? 0.0 : way_.back()) +
                     (step <= kJump ? step : 0.0));
      if (stations_.empty() ||
          way_.back() - way_[Index(stations_.back())] >= options.step) {
        stations_.push_back(i);
      }
    }
  }

  std::vector<Track> Find() const {
    std::vector<Comparison> comparisons = CompareAll();
    std::vector<Track> open, found;
    for (int i = 0; i < static_cast<int>(comparisons.size()); ++i) {
      const Comparison& comparison = comparisons[Index(i)];
      std::vector<bool> taken(open.size(), false);
      std::vector<Track> begun;
      for (const std::vector<Vector2d>& thing : comparison.things) {
        const Vector2d middle = MiddleOf(thing);
        std::size_t best = open.size();
        double least = options_.max_shift;
        for (std::size_t k = 0; k < open.size(); ++k) {
          const double apart = (open[k].middle - middle).norm();
          if (taken[k] || apart > least) continue;
          least = apart;
          best = k;
        }
        if (best < open.size()) {
          taken[best] = true;
        } else {
          begun.emplace_back();
        }
        Track& track = best < open.size() ? open[best] : begun.back();
        track.seen.emplace_back(i, thing);
        track.middle = middle;
      }
      std::vector<Track> still_open = std::move(begun);
      for (Track& track : open) {
        (i - track.last() <= kMostMissed ? still_open : found)
            .push_back(std::move(track));
      }
      open = std::move(still_open);
    }
    for (Track& track : open) found.push_back(std::move(track));
    Keep(&found, [this](const Track& track) {
      return IsSteady(track) && IsSeenBetween(track);
    });
    // People who walk along together are not others to each other.
    for (const Track& track : found) {
      for (const auto& [i, thing] : track.seen) {
        comparisons[Index(i)].along -= static_cast<int>(thing.size());
      }
    }
    Keep(&found,
         [&](const Track& track) { return HasWitnesses(track, comparisons); });
    std::sort(found.begin(), found.end(), [](const Track& a, const Track& b) {
      return std::make_pair(a.first(), a.last()) <
             std::make_pair(b.first(), b.last());
    });
    return found;
  }

  // By odometry, m.
  double WayBetween(int begin, int end) const {
    return way_[Index(end)] - way_[Index(begin)];
  }

  // Whether the scans between those that were compared show it, too.
  bool IsSeenBetween(const Track& track) const {
    double shown = 0.0;
    double all = 0.0;
    std::vector<ScanPoint> points;
    for (const auto& [comparison, thing] : track.seen) {
      const int end = stations_[Index(comparison + 1)];
      for (int i = stations_[Index(comparison)] + 1; i < end; ++i) {
        Returns(scans_[Index(i)], &points);
        shown += Look(thing, LaserOf(i), points).shown;
        all += 1.0;
      }
    }
    return shown >= options_.min_share_between * all;
  }

  // Takes the returns of `track` out of `scans`.
  Companion TakeOut(const Track& track, std::vector<Scan>* scans) const {
    Companion companion;
    const int first = stations_[Index(track.first())];
    const int last = stations_[Index(track.last() + 1)];
    // Where the robot stands or turns on the spot two scans say nothing.
    companion.begin = Extended(track, first, -1, *scans);
    companion.end = Extended(track, last, 1, *scans);
    companion.way = WayBetween(companion.begin, companion.end);
    const double square = options_.reach * options_.reach;
    std::vector<ScanPoint> points;
    std::size_t next = 0;
    for (int i = companion.begin; i <= companion.end; ++i) {
      // What was seen in the last comparisons before this scan and in the next.
      while (next < track.seen.size() &&
             stations_[Index(track.seen[next].first + 1)] <= i) {
        ++next;
      }
      const bool is_extended = i < first || i > last;
      const std::size_t around = is_extended ? kLooksAtAnEnd : 1;
      const std::size_t begin = next < around ? 0 : next - around;
      const std::size_t end =
          std::min(track.seen.size(), next + (is_extended ? around : 1));
      Scan& scan = (*scans)[Index(i)];
      Returns(scan, &points);
      for (const ScanPoint& point : points) {
        bool is_near = false;
        for (std::size_t k = begin; k < end && !is_near; ++k) {
          const std::vector<Vector2d>& thing = track.seen[k].second;
          is_near = std::any_of(
              thing.begin(), thing.end(), [&](const Vector2d& place) {
                return (place - point.position).squaredNorm() <= square;
              });
        }
        if (!is_near) continue;
        scan.ranges[Index(point.beam)] = 0.0f;
        ++companion.returns;
      }
    }
    return companion;
  }

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }

  // What a scan shows of a thing: shares of it.
  struct Sight {
    double shown = 0.0;
    // Something else is in front of it.
    double hidden = 0.0;

    bool IsShown(double least) const {
      return shown >= least * (1.0 - hidden) && hidden <= kMostHidden;
    }
  };

  // `laser`: where it is in the robot's frame; `points`: of the scan.
  Sight Look(const std::vector<Vector2d>& thing, const Vector2d& laser,
             const std::vector<ScanPoint>& points) const {
    const double square = options_.reach_between * options_.reach_between;
    Sight sight;
    for (const Vector2d& place : thing) {
      const Vector2d to = place - laser;
      const double range = to.norm();
      bool is_shown = false;
      bool is_hidden = false;
      for (const ScanPoint& point : points) {
        is_shown = (point.position - place).squaredNorm() <= square;
        if (is_shown) break;
        is_hidden =
            is_hidden ||
            (point.range < range - options_.reach_between &&
             to.dot(point.position - laser) >= kSameBeam * range * point.range);
      }
      sight.shown += is_shown;
      sight.hidden += !is_shown && is_hidden;
    }
    sight.shown /= static_cast<double>(thing.size());
    sight.hidden /= static_cast<double>(thing.size());
    return sight;
  }

  // The last scan, from scan `end` on (`way` 1) or back (-1), that shows the
  // thing as the first or last comparisons have it.
  int Extended(const Track& track, int end, int way,
               const std::vector<Scan>& scans) const {
    const std::size_t count = std::min(kLooksAtAnEnd, track.seen.size());
    const std::size_t begin = way < 0 ? 0 : track.seen.size() - count;
    std::vector<ScanPoint> points;
    int missed = 0;
    int hidden = 0;
    for (int i = end + way; i >= 0 && i < static_cast<int>(scans.size()) &&
                            missed <= kMostMissed && hidden <= kLongestHidden;
         i += way) {
      Returns(scans[Index(i)], &points);
      bool is_shown = false;
      bool is_hidden = false;
      for (std::size_t k = begin; k < begin + count && !is_shown; ++k) {
        const Sight sight = Look(track.seen[k].second, LaserOf(i), points);
        is_shown = sight.IsShown(options_.min_share_between);
        is_hidden = is_hidden || sight.hidden > kMostHidden;
      }
      if (is_shown) {
        missed = hidden = 0;
        end = i;
      } else {
        ++(is_hidden ? hidden : missed);
      }
    }
    return end;
  }

  Vector2d LaserOf(int scan) const {
    return scans_[Index(scan)].laser_offset.head<2>();
  }

  // Those of the beams alone, near enough.
  void Returns(const Scan& scan, std::vector<ScanPoint>* points) const {
    ScanPointsOptions options = options_.points;
    options.max_beam_step = kNoneBetween;
    options.usable_range = options_.max_range + options_.reach;
    ExtractScanPoints(scan, options, points);
  }

  std::vector<Comparison> CompareAll() const {
    const std::size_t count = stations_.empty() ? 0 : stations_.size() - 1;
    std::vector<Comparison> comparisons(count);
    ParallelFor(
        (count + kInTurn - 1) / kInTurn, ThreadsHere(), [&](std::size_t turn) {
          // In the same memory: of a long log not all fit into it.
          std::vector<ScanPoint> before, now;
          const std::size_t begin = turn * kInTurn;
          const std::size_t end = std::min(count, begin + kInTurn);
          ExtractScanPoints(StationScan(begin), options_.points, &before);
          for (std::size_t i = begin; i < end; ++i) {
            ExtractScanPoints(StationScan(i + 1), options_.points, &now);
            comparisons[i] = CompareStations(i, before, now);
            before.swap(now);
          }
        });
    return comparisons;
  }

  const Scan& StationScan(std::size_t station) const {
    return scans_[Index(stations_[station])];
  }

  // Of a station with the next one; says nothing where the robot turned.
  Comparison CompareStations(std::size_t station,
                             const std::vector<ScanPoint>& before,
                             const std::vector<ScanPoint>& now) const {
    const Scan& scan = StationScan(station + 1);
    const Pose2 motion = Between(StationScan(station).odometry, scan.odometry);
    if (std::abs(motion[2]) > options_.max_turn ||
        motion.head<2>().norm() < 0.5 * options_.step) {
      return Comparison();
    }
    const bool is_round =
        std::abs(scan.angle_step) * static_cast<double>(scan.ranges.size()) >
        kRound;
    return Compare(before, now, motion, is_round, options_);
  }

  template <typename Test>
  static void Keep(std::vector<Track>* tracks, const Test& test) {
    tracks->erase(
        std::remove_if(tracks->begin(), tracks->end(),
                       [&test](const Track& track) { return !test(track); }),
        tracks->end());
  }

  bool IsSteady(const Track& track) const {
    const auto seen = static_cast<double>(track.seen.size());
    const double span = track.last() - track.first() + 1.0;
    return static_cast<int>(track.seen.size()) >= options_.min_steps &&
           seen >= options_.min_share * span;
  }

  // `comparisons`: of what goes along only what belongs to no track.
  bool HasWitnesses(const Track& track,
                    const std::vector<Comparison>& comparisons) const {
    int witnesses = 0;
    int others = 0;
    for (const auto& seen : track.seen) {
      witnesses += comparisons[Index(seen.first)].witnesses;
      others += comparisons[Index(seen.first)].along;
    }
    return witnesses >= options_.min_witnesses &&
           witnesses >= options_.min_witnesses_per_step *
                            static_cast<double>(track.seen.size()) &&
           witnesses >= options_.min_ratio * others;
  }

  const CompanionOptions& options_;
  const std::vector<Scan>& scans_;
  // Way by odometry up to each scan, m.
  std::vector<double> way_;
  // Scans that are compared, each with the next.
  std::vector<int> stations_;
};

}  // namespace

std::vector<Companion> TakeOutCompanions(const CompanionOptions& options,
                                         std::vector<Scan>* scans) {
  const CompanionSearch search(options, *scans);
  std::vector<Companion> all;
  for (const Track& track : search.Find()) {
    all.push_back(search.TakeOut(track, scans));
  }
  std::sort(all.begin(), all.end(), [](const Companion& a, const Companion& b) {
    return a.begin < b.begin;
  });
  std::vector<Companion> companions;
  for (const Companion& companion : all) {
    if (companions.empty() || companion.begin > companions.back().end) {
      companions.push_back(companion);
      continue;
    }
    Companion& last = companions.back();
    last.end = std::max(last.end, companion.end);
    last.way = search.WayBetween(last.begin, last.end);
    last.returns += companion.returns;
  }
  return companions;
}

}  // namespace plumbline
