#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/frontend_state.h>
#include <plumbline/frontend/scan_relations.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

namespace plumbline {
namespace {

// Submaps between two questions whether to stop, for each thread: some tenths
// of a second.
constexpr std::size_t kSubmapsAtOnce = 16;

// A place with more submaps near it than this was visited many times over, and
// is matched with this share of max_submaps: twenty visits hold each other with
// fewer each than two do.
constexpr std::size_t kMany = 40;
constexpr double kShareOfMany = 0.7;

// The part of the weakest direction that is a shift, m, from which on it is one
// along something; keeps numbers finite, 1/m^2.
constexpr double kLeastShift = 0.5;
constexpr double kLeastInformation = 1e-9;

// Places [begin, end).
struct Submap {
  int begin = 0;
  int end = 0;
  int middle() const { return (begin + end) / 2; }
};

// Consecutive places by so many; none spans a gap in the track.
std::vector<Submap> Submaps(const std::vector<Place>& places, int size) {
  std::vector<Submap> submaps;
  const int count = static_cast<int>(places.size());
  for (int k = 0; k < count; ++k) {
    if (submaps.empty() || !places[k].follows_previous ||
        k - submaps.back().begin == size) {
      submaps.push_back({k, k});
    }
    submaps.back().end = k + 1;
  }
  return submaps;
}

// Poses of a submap's places in the frame of its middle, by refined odometry.
std::vector<Pose2> ByOdometry(const Submap& submap,
                              const std::vector<Place>& places) {
  std::vector<Pose2> poses(submap.end - submap.begin, Pose2::Zero());
  for (int k = submap.middle() + 1; k < submap.end; ++k) {
    poses[k - submap.begin] =
        Compose(poses[k - 1 - submap.begin], places[k].since_previous);
  }
  for (int k = submap.middle() - 1; k >= submap.begin; --k) {
    poses[k - submap.begin] = Compose(poses[k + 1 - submap.begin],
                                      Inverse(places[k + 1].since_previous));
  }
  return poses;
}

// The same by poses of the map.
std::vector<Pose2> ByMap(const Submap& submap,
                         const std::vector<Pose2>& map_poses) {
  std::vector<Pose2> poses;
  for (int k = submap.begin; k < submap.end; ++k) {
    poses.push_back(Between(map_poses[submap.middle()], map_poses[k]));
  }
  return poses;
}

std::vector<ScanPoint> Reference(const Submap& submap,
                                 const std::vector<Place>& places,
                                 const std::vector<Pose2>& poses) {
  std::vector<ScanPoint> reference;
  for (int k = submap.begin; k < submap.end; ++k) {
    const PoseTransform transform(poses[k - submap.begin]);
    for (const ScanPoint& point : places[k].reference) {
      reference.push_back(Moved(point, transform));
    }
  }
  return reference;
}

// About so many points of a scan are matched until poses are trusted: what they
// say is said anew then.
constexpr std::size_t kFewPoints = 90;

// One in so many of the points of a scan with a normal, evenly.
std::vector<ScanPoint> OneIn(std::size_t stride,
                             const std::vector<ScanPoint>& scan) {
  std::vector<ScanPoint> points;
  std::size_t left = stride / 2;
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    if (left-- > 0) continue;
    points.push_back(point);
    left = stride - 1;
  }
  return points;
}

std::size_t StrideToFew(const std::vector<ScanPoint>& scan) {
  const auto count = static_cast<std::size_t>(std::count_if(
      scan.begin(), scan.end(),
      [](const ScanPoint& point) { return point.normal.squaredNorm() > 0.0; }));
  return std::max<std::size_t>(1, count / kFewPoints);
}

// At most `most` of the submaps near a place, given nearest first: the nearest
// half, and others in even steps of time, so that every visit has its share.
// Those that it was matched with before come first: where many are near, the
// steps fall on others whenever a pose moves a little.
std::vector<int> Spread(const std::vector<std::pair<double, int>>& near,
                        int most, const std::function<bool(int)>& is_known) {
  std::vector<int> chosen, others;
  for (const auto& [distance, submap] : near) {
    const bool is_nearest = static_cast<int>(near.size()) <= most ||
                            static_cast<int>(chosen.size()) < (most + 1) / 2;
    (is_nearest ? chosen : others).push_back(submap);
  }
  if (others.empty()) return chosen;
  std::sort(others.begin(), others.end());
  std::size_t room = static_cast<std::size_t>(most) - chosen.size();
  std::vector<int> unknown;
  for (const int submap : others) {
    if (room > 0 && is_known(submap)) {
      chosen.push_back(submap);
      --room;
    } else {
      unknown.push_back(submap);
    }
  }
  for (std::size_t i = 0; i < std::min(room, unknown.size()); ++i) {
    chosen.push_back(unknown[(2 * i + 1) * unknown.size() / (2 * room)]);
  }
  return chosen;
}

// What a match says of the pose of a scan, given where the scan was before.
struct MatchMeasurement {
  Pose2 mean = Pose2::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

// Along what shows no place along it, as a corridor, a match moves a scan by
// what normals scatter, and matches against the way back all to one side. That
// is taken back but for what the returns know of it. What they know across it
// holds for where the scan is: it is uncertain by what may be different where
// the scan turns out to be, or else matches with slightly different directions
// of "along" would hold a scan in place where none of them knows one.
MatchMeasurement WithoutSlide(const Pose2& pose,
                              const Eigen::Matrix3d& information,
                              const MatchPrior& prior,
                              const ScanRelationOptions& options) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information);
  const Eigen::Vector3d along = solver.eigenvectors().col(0);
  const double shift = along.head<2>().norm();
  // A turn that nothing shows is no slide.
  if (shift < kLeastShift) return {pose, information};
  const Eigen::Vector3d by_metre = along / shift;
  const double by_returns = by_metre.dot(information * by_metre);
  const double by_prior = by_metre.dot(prior.information * by_metre);
  const double moved = by_metre.head<2>().dot((pose - prior.pose).head<2>());
  MatchMeasurement measurement;
  measurement.mean =
      pose - by_metre * (moved * by_prior / (by_prior + by_returns));
  measurement.mean[2] = NormalizeAngle(measurement.mean[2]);
  const double square =
      1.0 / std::max(by_returns,
                     1.0 / (options.longest_slide * options.longest_slide));
  const Eigen::Vector3d per_metre(options.slide_across, options.slide_across,
                                  options.slide_turn);
  const Eigen::Matrix<double, 3, 2> across =
      solver.eigenvectors().rightCols<2>();
  Eigen::Matrix2d covariance =
      square * across.transpose() * per_metre.cwiseAbs2().asDiagonal() * across;
  for (int i = 0; i < 2; ++i) {
    covariance(i, i) +=
        1.0 / std::max(kLeastInformation, solver.eigenvalues()[i + 1]);
  }
  measurement.information =
      across * covariance.inverse() * across.transpose() +
      std::max(0.0, solver.eigenvalues()[0]) * along * along.transpose();
  return measurement;
}

// For each submap the places to match with it, ascending. `is_known`: whether
// a submap and a place were matched before.
std::vector<std::vector<int>> Assign(
    const std::vector<Submap>& submaps, const std::vector<Pose2>& poses,
    const ScanRelationOptions& options,
    const std::function<bool(int submap, int place)>& is_known) {
  const auto cell = [&](const Pose2& pose) {
    return std::make_pair(
        static_cast<long>(std::floor(pose[0] / options.radius)),
        static_cast<long>(std::floor(pose[1] / options.radius)));
  };
  std::map<std::pair<long, long>, std::vector<int>> grid;
  for (std::size_t i = 0; i < submaps.size(); ++i) {
    grid[cell(poses[submaps[i].middle()])].push_back(static_cast<int>(i));
  }
  std::vector<std::vector<int>> keys(submaps.size());
  std::vector<std::pair<double, int>> near;
  for (int k = 0; k < static_cast<int>(poses.size()); ++k) {
    near.clear();
    const auto center = cell(poses[k]);
    for (long x = center.first - 1; x <= center.first + 1; ++x) {
      for (long y = center.second - 1; y <= center.second + 1; ++y) {
        const auto found = grid.find({x, y});
        if (found == grid.end()) continue;
        for (const int i : found->second) {
          const Submap& submap = submaps[i];
          if (k >= submap.begin && k < submap.end) continue;
          if (k < options.num_held && submap.end <= options.num_held) continue;
          const double distance =
              (poses[submap.middle()] - poses[k]).head<2>().norm();
          if (distance <= options.radius) near.emplace_back(distance, i);
        }
      }
    }
    std::sort(near.begin(), near.end());
    const auto was_matched = [&](int submap) { return is_known(submap, k); };
    const int most =
        near.size() <= kMany
            ? options.max_submaps
            : std::max(1, static_cast<int>(kShareOfMany * options.max_submaps));
    for (const int i : Spread(near, most, was_matched)) {
      keys[i].push_back(k);
    }
  }
  return keys;
}

}  // namespace

ScanMatchFinder::ScanMatchFinder(const std::vector<Place>& places,
                                 const ScanRelationOptions& options)
    : places_(places), options_(options) {
  if (options.submap_size < 1 || !(options.radius > 0.0) ||
      options.max_submaps < 1) {
    throw PLUMBLINE_ERROR("submap_size, radius or max_submaps out of range",
                          "positive values");
  }
  attempts_.resize(Submaps(places, options.submap_size).size());
}

void ScanMatchFinder::TrustPoses() {
  trusts_poses_ = true;
  for (std::map<int, Attempt>& attempts : attempts_) attempts.clear();
}

void ScanMatchFinder::WriteState(StateWriter* state) const {
  bool trusts_poses = trusts_poses_;
  std::vector<std::map<int, Attempt>> attempts = attempts_;
  ExchangeAll(*state, trusts_poses, attempts);
}

void ScanMatchFinder::ReadState(StateReader* state) {
  const std::size_t submaps = attempts_.size();
  ExchangeAll(*state, trusts_poses_, attempts_);
  if (attempts_.size() != submaps) {
    throw PLUMBLINE_ERROR(
        "the state is of " + std::to_string(attempts_.size()) + " submaps",
        std::to_string(submaps));
  }
}

std::vector<ScanRelation> ScanMatchFinder::Find(
    const std::vector<Pose2>& poses, const std::function<bool()>& stop) {
  if (places_.size() != poses.size()) {
    throw PLUMBLINE_ERROR(std::to_string(places_.size()) + " places and " +
                              std::to_string(poses.size()) + " poses",
                          "one pose per place");
  }
  const std::vector<Submap> submaps = Submaps(places_, options_.submap_size);
  const std::vector<std::vector<int>> keys =
      Assign(submaps, poses, options_, [this](int submap, int place) {
        return attempts_[static_cast<std::size_t>(submap)].count(place) > 0;
      });

  MatchPrior prior;
  prior.information =
      Eigen::Vector3d(
          1.0 / (options_.prior_translation * options_.prior_translation),
          1.0 / (options_.prior_translation * options_.prior_translation),
          1.0 / (options_.prior_rotation * options_.prior_rotation))
          .asDiagonal();
  std::vector<std::int64_t> tried(submaps.size(), 0);
  const auto match = [&](std::size_t i) {
    const int middle = submaps[i].middle();
    std::map<int, Attempt> attempts;
    ScanMatcher matcher(options_.matcher);
    bool has_reference = false;
    MatchPrior here = prior;
    for (const int k : keys[i]) {
      here.pose = Between(poses[middle], poses[k]);
      const auto known = attempts_[i].find(k);
      if (known != attempts_[i].end()) {
        const Pose2 change = Between(known->second.pose, here.pose);
        if (change.head<2>().norm() <= options_.retry_distance &&
            std::abs(change[2]) <= options_.retry_rotation) {
          attempts.insert(*known);
          continue;
        }
      }
      if (!has_reference) {
        matcher.SetReference(Reference(submaps[i], places_,
                                       trusts_poses_
                                           ? ByMap(submaps[i], poses)
                                           : ByOdometry(submaps[i], places_)));
        has_reference = true;
      }
      ++tried[i];
      Attempt attempt;
      attempt.pose = here.pose;
      const std::size_t stride =
          trusts_poses_ ? 1 : StrideToFew(places_[k].scan);
      std::vector<ScanPoint> few;
      if (stride > 1) few = OneIn(stride, places_[k].scan);
      const std::vector<ScanPoint>& scan = stride > 1 ? few : places_[k].scan;
      if (!matcher.empty() &&
          matcher.OverlapsBy(options_.min_overlap, scan, here.pose)) {
        const MatchResult match = matcher.Refine(scan, here.pose, here);
        if (match.inlier_ratio >= options_.min_inlier_ratio) {
          attempt.is_match = true;
          const MatchMeasurement measurement = WithoutSlide(
              match.pose, static_cast<double>(stride) * match.information, here,
              options_);
          attempt.relation = {middle, k, measurement.mean,
                              measurement.information};
        }
      }
      attempts.emplace(k, attempt);
    }
    attempts_[i] = std::move(attempts);
  };
  const std::size_t at_once =
      kSubmapsAtOnce * static_cast<std::size_t>(options_.num_threads);
  for (std::size_t i = 0; i < submaps.size(); i += at_once) {
    if (stop && stop()) break;
    ParallelFor(std::min(at_once, submaps.size() - i), options_.num_threads,
                [&](std::size_t j) { match(i + j); });
  }
  num_tried_ = 0;
  for (const std::int64_t number : tried) num_tried_ += number;
  std::vector<ScanRelation> relations;
  for (const auto& attempts : attempts_) {
    for (const auto& entry : attempts) {
      if (entry.second.is_match) relations.push_back(entry.second.relation);
    }
  }
  return relations;
}

}  // namespace plumbline
