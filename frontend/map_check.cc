#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/map_check.h>
#include <plumbline/frontend/place_grid.h>
#include <plumbline/frontend/way_lengths.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>

namespace plumbline {
namespace {

// A step between key scans counts as no more way than this, m.
constexpr double kLongestStep = 2.0;

// Between two times that `stop` is asked.
constexpr std::size_t kScansAtOnce = 128;
// Scans whose returns each thread keeps at least.
constexpr std::size_t kFewestKept = 64;

// In which parts of a track are compared.
constexpr std::size_t kRounds = 4;

// The returns of scans, those of some of the last ones kept.
class ScanReturns {
 public:
  // As many as lie around a few visits; some megabytes.
  static constexpr std::size_t kMostKept = 1024;

  // Scans and options must outlive it. At most so many scans are kept.
  ScanReturns(const std::vector<Scan>& scans, const ScanPointsOptions& options,
              std::size_t most_kept = kMostKept)
      : scans_(scans), options_(options), most_kept_(most_kept) {}

  // Valid until the next call.
  const std::vector<ScanPoint>& Of(int scan) {
    if (kept_.size() >= most_kept_) kept_.clear();
    const auto [entry, is_new] = kept_.try_emplace(scan);
    if (is_new) {
      ExtractScanPoints(scans_[static_cast<std::size_t>(scan)], options_,
                        &entry->second);
    }
    return entry->second;
  }

 private:
  const std::vector<Scan>& scans_;
  const ScanPointsOptions& options_;
  const std::size_t most_kept_;
  std::unordered_map<int, std::vector<ScanPoint>> kept_;
};

// How a scan at a pose agrees with what these key scans saw.
class MapComparison {
 public:
  // All must outlive it. `poses`: by key scan.
  MapComparison(const std::vector<Scan>& scans, const std::vector<int>& keys,
                const std::vector<Pose2>& poses, const MapCheckOptions& options)
      : scans_(scans), keys_(keys), poses_(poses), options_(options) {}

  // `others`: distance and index of key scans, of which the nearest count.
  // `returns`: of the same scans.
  ScanAgreement Compare(int scan_index, const Pose2& pose,
                        std::vector<std::pair<double, std::size_t>> others,
                        ScanReturns* returns) const {
    const auto count =
        std::min(others.size(), static_cast<std::size_t>(options_.max_others));
    std::partial_sort(others.begin(),
                      others.begin() + static_cast<std::ptrdiff_t>(count),
                      others.end());
    others.resize(count);
    std::vector<ScanPoint> reference;
    std::vector<Viewpoint> viewpoints;
    for (const auto& [distance, j] : others) {
      const PoseTransform transform(poses_[j]);
      viewpoints.push_back(
          {transform.Point(LaserOf(keys_[j])), reference.size()});
      for (const ScanPoint& point : returns->Of(keys_[j])) {
        reference.push_back(Moved(point, transform));
      }
    }
    ScanMatcher matcher(options_.matcher);
    matcher.SetReference(std::move(reference), std::move(viewpoints));
    return matcher.Compare(returns->Of(scan_index), pose, LaserOf(scan_index));
  }

 private:
  // Position of a scan's laser, robot's frame, m.
  Eigen::Vector2d LaserOf(int scan) const {
    return scans_[static_cast<std::size_t>(scan)].laser_offset.head<2>();
  }

  const std::vector<Scan>& scans_;
  const std::vector<int>& keys_;
  const std::vector<Pose2>& poses_;
  const MapCheckOptions& options_;
};

// Whether enough of a scan lies where the map knows what is there.
bool IsKnown(const ScanAgreement& agreement, const MapCheckOptions& options) {
  const int known = agreement.hits + agreement.intruders;
  return known >= options.min_returns &&
         known >= options.agreeing_known * (known + agreement.unknown);
}

// Whether a scan agrees with the map so well that it speaks for its place.
bool IsConfirming(const ScanAgreement& agreement,
                  const MapCheckOptions& options) {
  const int known = agreement.hits + agreement.intruders;
  return IsKnown(agreement, options) &&
         agreement.intruders <= options.agreeing_intruders * known &&
         agreement.seen_through <=
             options.agreeing_seen_through * agreement.seen;
}

// One pose for each `spacing` of the way.
std::vector<std::size_t> SpreadOver(const std::vector<double>& way,
                                    double spacing) {
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < way.size(); ++k) {
    if (chosen.empty() || way[k] - way[chosen.back()] >= spacing) {
      chosen.push_back(k);
    }
  }
  return chosen;
}

// What the scans of two parts of a track say of each other.
struct Evidence {
  int compared = 0;
  int contradicting = 0;
  std::vector<Eigen::Vector2d> confirming;

  // Standard deviation of the places in the direction where it is least, m.
  double Spread() const {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& place : confirming) mean += place;
    mean /= static_cast<double>(confirming.size());
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
    for (const Eigen::Vector2d& place : confirming) {
      covariance += (place - mean) * (place - mean).transpose();
    }
    covariance /= static_cast<double>(confirming.size());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance);
    return std::sqrt(std::max(0.0, solver.eigenvalues()[0]));
  }

  bool Confirms(const MapCheckOptions& options) const {
    return static_cast<int>(confirming.size()) >= options.min_confirming &&
           static_cast<double>(confirming.size()) >=
               options.min_confirming_share * compared &&
           contradicting <= options.max_contradicting_share * compared &&
           Spread() >= options.min_confirming_spread;
  }
};

// What other visits say of scans along the way; empty when it was stopped.
struct JudgedScans {
  // Of the keys, ascending.
  std::vector<std::size_t> looked_at;
  std::vector<ScanVerdict> verdicts;
};

JudgedScans JudgeScans(const std::vector<Scan>& scans,
                       const std::vector<int>& keys,
                       const std::vector<Pose2>& poses,
                       const MapCheckOptions& options,
                       const std::function<bool()>& stop) {
  if (keys.size() != poses.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(poses.size()) + " poses",
        "one for each of " + std::to_string(keys.size()) + " key scans");
  }
  const std::vector<double> way = WayLengths(poses, kLongestStep);
  std::vector<std::size_t> looked_at = SpreadOver(way, options.spacing);
  const PlaceGrid grid(poses, options.radius);
  const MapComparison comparison(scans, keys, poses, options);
  std::vector<ScanVerdict> verdicts(looked_at.size(), ScanVerdict::kUnknown);
  const auto judge = [&](std::size_t i, ScanReturns* returns) {
    const std::size_t k = looked_at[i];
    std::vector<std::pair<double, std::size_t>> others;
    grid.Around(poses[k].head<2>(), [&](std::size_t j) {
      const double distance = (poses[j] - poses[k]).head<2>().norm();
      if (distance <= options.radius &&
          std::abs(way[j] - way[k]) >= options.least_way) {
        others.emplace_back(distance, j);
      }
    });
    if (static_cast<int>(others.size()) < options.min_others) return;
    verdicts[i] = JudgeScan(
        comparison.Compare(keys[k], poses[k], std::move(others), returns),
        options);
  };
  ThreadTeam team(options.num_threads);
  const auto threads =
      static_cast<std::size_t>(std::max(1, options.num_threads));
  // Each used by one thread at a time.
  std::vector<ScanReturns> returns(
      threads,
      ScanReturns(scans, options.points,
                  std::max(kFewestKept, ScanReturns::kMostKept / threads)));
  for (std::size_t begin = 0; begin < looked_at.size(); begin += kScansAtOnce) {
    if (stop && stop()) return {};
    // Those that follow each other are compared with many of the same scans.
    const std::size_t count = std::min(kScansAtOnce, looked_at.size() - begin);
    team.For(threads, [&](std::size_t t) {
      for (std::size_t i = count * t / threads; i < count * (t + 1) / threads;
           ++i) {
        judge(begin + i, &returns[t]);
      }
    });
  }
  return {std::move(looked_at), std::move(verdicts)};
}

// What the parts of a track between its cuts have seen of each other.
class PartComparison {
 public:
  // All must outlive it.
  PartComparison(const std::vector<Scan>& scans, const std::vector<int>& keys,
                 const std::vector<Pose2>& trajectory,
                 const std::vector<TrackCut>& cuts,
                 const MapCheckOptions& options)
      : scans_(scans),
        keys_(keys),
        trajectory_(trajectory),
        cuts_(cuts),
        options_(options),
        poses_(PosesAt(keys, trajectory)),
        grid_(poses_, options.radius),
        comparison_(scans, keys_, poses_, options),
        returns_(scans, options.points) {
    for (const int key : keys) parts_.push_back(PartOf(key));
  }

  // Compares scans along the way with the parts around them; false when it was
  // stopped. Each round is spread over the way as evenly as all together: a
  // pair of which enough is known after one is not looked at in the next.
  bool Collect(const std::function<bool()>& stop) {
    const std::vector<std::size_t> looked_at =
        SpreadOver(WayLengths(poses_, kLongestStep), options_.spacing);
    for (std::size_t round = 0; round < kRounds; ++round) {
      for (std::size_t i = round; i < looked_at.size(); i += kRounds) {
        if (!Compare(looked_at[i], stop)) return false;
      }
      for (const auto& [pair, said] : evidence_) {
        if (said.compared >= options_.enough_compared) known_.insert(pair);
      }
    }
    return true;
  }

  // The parts that are seen to lie right to each other.
  DisjointSets Join() const {
    DisjointSets joined(cuts_.size() + 1);
    for (const auto& [pair, said] : evidence_) {
      if (said.Confirms(options_)) joined.Join(pair.first, pair.second);
    }
    return joined;
  }

  // Whether a scan of the log agrees with what all parts saw around it.
  bool Fits(int scan) {
    return FitsAt(scan, trajectory_[static_cast<std::size_t>(scan)]);
  }

  // Whether a scan next to a cut would fit, too, where odometry has it, seen
  // from the other side: along a corridor nothing tells where between both it
  // is.
  bool IsOpen(const TrackCut& cut) {
    return MayBeWhereOdometrySays(cut.begin, cut.end) ||
           MayBeWhereOdometrySays(cut.end, cut.begin);
  }

 private:
  bool MayBeWhereOdometrySays(int from, int scan) {
    const auto pose = [this](int i) {
      return trajectory_[static_cast<std::size_t>(i)];
    };
    const auto odometry = [this](int i) {
      return scans_[static_cast<std::size_t>(i)].odometry;
    };
    Pose2 there = Compose(pose(from), Between(odometry(from), odometry(scan)));
    there[2] = pose(scan)[2];
    return (there - pose(scan)).head<2>().norm() > options_.open_way &&
           FitsAt(scan, there);
  }

  bool FitsAt(int scan, const Pose2& pose) {
    std::vector<Neighbor> others;
    for (const auto& [part, of_part] : Near(pose)) {
      others.insert(others.end(), of_part.begin(), of_part.end());
    }
    return static_cast<int>(others.size()) >= options_.min_others &&
           IsConfirming(
               comparison_.Compare(scan, pose, std::move(others), &returns_),
               options_);
  }

  using Pair = std::pair<std::size_t, std::size_t>;
  // Distance, m, and index of a key scan.
  using Neighbor = std::pair<double, std::size_t>;

  // Of what lies between two parts.
  static constexpr std::size_t kNoPart =
      std::numeric_limits<std::size_t>::max();

  static std::vector<Pose2> PosesAt(const std::vector<int>& keys,
                                    const std::vector<Pose2>& trajectory) {
    std::vector<Pose2> poses;
    for (const int key : keys) {
      poses.push_back(trajectory[static_cast<std::size_t>(key)]);
    }
    return poses;
  }

  std::size_t PartOf(int scan) const {
    std::size_t part = 0;
    for (const TrackCut& cut : cuts_) {
      if (scan > cut.begin && scan < cut.end) return kNoPart;
      if (scan >= cut.end) ++part;
    }
    return part;
  }

  // Key scans near a pose, by the part that they are of.
  std::map<std::size_t, std::vector<Neighbor>> Near(const Pose2& pose) const {
    std::map<std::size_t, std::vector<Neighbor>> result;
    grid_.Around(pose.head<2>(), [&](std::size_t j) {
      const double distance = (poses_[j] - pose).head<2>().norm();
      if (distance <= options_.radius && parts_[j] != kNoPart) {
        result[parts_[j]].emplace_back(distance, j);
      }
    });
    return result;
  }

  // Compares a key scan with the parts around it; false when it was stopped.
  bool Compare(std::size_t k, const std::function<bool()>& stop) {
    if (parts_[k] == kNoPart) return true;
    // The parts just before and after its own are enough to join all, and what
    // is compared does not grow with the square of the visits.
    auto by_part = Near(poses_[k]);
    for (auto other = by_part.begin(); other != by_part.end();) {
      const bool is_enough =
          other->first != parts_[k] &&
          static_cast<int>(other->second.size()) >= options_.min_others;
      other = is_enough ? std::next(other) : by_part.erase(other);
    }
    const auto after = by_part.upper_bound(parts_[k]);
    const auto end = after == by_part.end() ? after : std::next(after);
    auto other = after == by_part.begin() ? after : std::prev(after);
    for (; other != end; ++other) {
      if (stop && stop()) return false;
      auto& [part, others] = *other;
      const Pair pair = std::minmax(part, parts_[k]);
      if (known_.count(pair) > 0) continue;
      TakeEvidence(poses_[k],
                   comparison_.Compare(keys_[k], poses_[k], std::move(others),
                                       &returns_),
                   pair);
    }
    return true;
  }

  void TakeEvidence(const Pose2& pose, const ScanAgreement& agreement,
                    const Pair& pair) {
    const bool contradicts =
        JudgeScan(agreement, options_) == ScanVerdict::kContradicts;
    if (!contradicts && !IsKnown(agreement, options_)) return;
    Evidence& of_pair = evidence_[pair];
    ++of_pair.compared;
    if (contradicts) ++of_pair.contradicting;
    if (IsConfirming(agreement, options_)) {
      of_pair.confirming.emplace_back(pose.head<2>());
    }
  }

  const std::vector<Scan>& scans_;
  const std::vector<int>& keys_;
  const std::vector<Pose2>& trajectory_;
  const std::vector<TrackCut>& cuts_;
  const MapCheckOptions& options_;
  // By key scan.
  std::vector<Pose2> poses_;
  std::vector<std::size_t> parts_;
  PlaceGrid grid_;
  MapComparison comparison_;
  ScanReturns returns_;
  std::map<Pair, Evidence> evidence_;
  // Pairs of which enough is known.
  std::set<Pair> known_;
};

}  // namespace

ScanVerdict JudgeScan(const ScanAgreement& agreement,
                      const MapCheckOptions& options) {
  const int known = agreement.hits + agreement.intruders;
  if (known < options.min_returns && agreement.seen < options.min_returns) {
    return ScanVerdict::kUnknown;
  }
  const bool contradicts =
      (known >= options.min_returns &&
       agreement.intruders > options.max_intruders * known) ||
      (agreement.seen >= options.min_returns &&
       agreement.seen_through > options.max_seen_through * agreement.seen);
  return contradicts ? ScanVerdict::kContradicts : ScanVerdict::kAgrees;
}

std::vector<MapContradiction> FindContradictions(
    const std::vector<Scan>& scans, const std::vector<int>& keys,
    const std::vector<Pose2>& poses, const MapCheckOptions& options,
    const std::function<bool()>& stop) {
  const auto [looked_at, verdicts] =
      JudgeScans(scans, keys, poses, options, stop);
  std::vector<MapContradiction> found;
  std::size_t i = 0;
  while (i < verdicts.size()) {
    if (verdicts[i] != ScanVerdict::kContradicts) {
      ++i;
      continue;
    }
    const std::size_t begin = i;
    std::size_t last = i;
    int contradictions = 0;
    for (int passed = 0; i < verdicts.size() && passed <= 1; ++i) {
      if (verdicts[i] == ScanVerdict::kContradicts) {
        ++contradictions;
        last = i;
        passed = 0;
      } else {
        ++passed;
      }
    }
    if (contradictions >= options.min_scans) {
      found.push_back({keys[looked_at[begin]], keys[looked_at[last]]});
    }
  }
  return found;
}

MapAgreement CountAgreement(const std::vector<Scan>& scans,
                            const std::vector<int>& keys,
                            const std::vector<Pose2>& poses,
                            const MapCheckOptions& options,
                            const std::function<bool()>& stop) {
  MapAgreement count;
  for (const ScanVerdict verdict :
       JudgeScans(scans, keys, poses, options, stop).verdicts) {
    count.agreeing += verdict == ScanVerdict::kAgrees ? 1 : 0;
    count.contradicting += verdict == ScanVerdict::kContradicts ? 1 : 0;
  }
  return count;
}

std::vector<TieVerdict> JudgeTies(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& trajectory,
                                  const std::vector<TrackCut>& cuts,
                                  const MapCheckOptions& options,
                                  const std::function<bool()>& stop) {
  if (trajectory.size() != scans.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(trajectory.size()) + " poses",
        "one for each of " + std::to_string(scans.size()) + " scans");
  }
  std::vector<TieVerdict> verdicts(cuts.size(), TieVerdict::kUnconfirmed);
  if (cuts.empty()) return verdicts;
  PartComparison parts(scans, keys, trajectory, cuts, options);
  if (!parts.Collect(stop)) return verdicts;
  DisjointSets joined = parts.Join();
  for (std::size_t c = 0; c < cuts.size(); ++c) {
    bool fits = joined.Find(c) == joined.Find(c + 1);
    for (int i = cuts[c].begin + 1; fits && i < cuts[c].end; ++i) {
      fits = parts.Fits(i);
    }
    if (!fits) continue;
    verdicts[c] =
        parts.IsOpen(cuts[c]) ? TieVerdict::kOpen : TieVerdict::kConfirmed;
  }
  return verdicts;
}

}  // namespace plumbline
