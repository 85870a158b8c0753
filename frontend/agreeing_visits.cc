#include <ceres/ceres.h>
#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose_pose.h>
#include <plumbline/frontend/agreeing_visits.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/track_windows.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// A window is looked for so far from where it is, m and rad.
constexpr double kReach = 6.0;
constexpr double kTurn = DegToRad(10.0);
// Least score of a place that a search finds, its share of the best, and how
// many are looked at.
constexpr double kLeastScore = 0.4;
constexpr double kPeakShare = 0.7;
constexpr int kMostPeaks = 6;
// Windows of a visit are so many apart from each other and from the window that
// is held against them; more than so many visits are not asked.
constexpr std::size_t kApart = 4;
constexpr std::size_t kMostVisits = 4;
// Another place is as likely when it agrees with this share of the quality.
constexpr double kAsClearly = 0.9;
// A window lies elsewhere when it is farther off than this, m; so many have to.
constexpr double kElsewhere = 0.3;
constexpr int kLeastElsewhere = 2;
// Standard deviations: of a window in another visit, of the next one by the
// way, and where the way is not known, m and rad.
constexpr double kMatchDistance = 0.05;
constexpr double kMatchTurn = DegToRad(0.5);
constexpr double kWayDistance = 0.05;
constexpr double kWayTurn = DegToRad(0.5);
constexpr double kUnknownDistance = 0.3;
constexpr double kUnknownTurn = DegToRad(3.0);
// A match that is so many standard deviations off counts half, in one solve
// after the other: what is right may be metres off, and would count for nothing
// beside what holds a fault.
constexpr std::array<double, 4> kLossScales = {100.0, 30.0, 10.0, 3.0};

// A stretch of the way.
struct Stretch {
  TrackWindow window;
  // Whether the way from the one before is known.
  bool follows = false;
  std::size_t middle() const { return (window.begin + window.end) / 2; }
};

// Where a stretch lies in what was seen on another visit.
struct Match {
  std::size_t visit = 0;
  WindowJudgement judgement;
  bool is_elsewhere = false;
};

std::vector<Stretch> CutIntoStretches(const std::vector<KeyView>& views,
                                      const std::vector<bool>& follows,
                                      std::size_t size) {
  std::vector<Stretch> stretches;
  for (std::size_t begin = 0; begin < views.size();) {
    std::size_t end = begin + 1;
    while (end < views.size() && follows[end]) ++end;
    const std::vector<KeyView> piece(
        views.begin() + static_cast<std::ptrdiff_t>(begin),
        views.begin() + static_cast<std::ptrdiff_t>(end));
    bool is_first = true;
    for (TrackWindow& window : MakeTrackWindows(piece, size)) {
      window.begin += begin;
      window.end += begin;
      stretches.push_back({std::move(window), !is_first});
      is_first = false;
    }
    begin = end;
  }
  return stretches;
}

class VisitMatcher {
 public:
  VisitMatcher(const std::vector<KeyView>& views,
               const std::vector<Stretch>& stretches,
               const TrackPlacementOptions& options)
      : views_(views), stretches_(stretches), options_(options) {}

  // What a stretch says of each other visit near it, the nearest first.
  std::vector<Match> Find(std::size_t s) const {
    std::vector<Match> matches;
    for (const std::vector<std::size_t>& visit : VisitsNear(s)) {
      if (const std::optional<Match> match = MatchWith(s, visit)) {
        matches.push_back(*match);
      }
    }
    return matches;
  }

 private:
  // Runs of other stretches near this one, the nearest run first.
  std::vector<std::vector<std::size_t>> VisitsNear(std::size_t s) const {
    const Eigen::Vector2d here = stretches_[s].window.middle.head<2>();
    std::vector<std::pair<double, std::vector<std::size_t>>> visits;
    std::size_t last = stretches_.size();
    for (std::size_t other = 0; other < stretches_.size(); ++other) {
      const std::size_t apart = other > s ? other - s : s - other;
      const double distance =
          (stretches_[other].window.middle.head<2>() - here).norm();
      if (apart <= kApart || distance > options_.radius + kReach) continue;
      if (last == stretches_.size() || other > last + kApart) {
        visits.push_back({distance, {}});
      }
      visits.back().first = std::min(visits.back().first, distance);
      visits.back().second.push_back(other);
      last = other;
    }
    std::stable_sort(
        visits.begin(), visits.end(),
        [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<std::vector<std::size_t>> nearest;
    for (auto& [distance, visit] : visits) {
      if (nearest.size() == kMostVisits) break;
      nearest.push_back(std::move(visit));
    }
    return nearest;
  }

  std::optional<Match> MatchWith(std::size_t s,
                                 const std::vector<std::size_t>& visit) const {
    const TrackWindow& window = stretches_[s].window;
    std::vector<KeyView> map;
    for (const std::size_t other : visit) {
      const TrackWindow& seen = stretches_[other].window;
      map.insert(map.end(),
                 views_.begin() + static_cast<std::ptrdiff_t>(seen.begin),
                 views_.begin() + static_cast<std::ptrdiff_t>(seen.end));
    }
    WindowJudgement best =
        JudgeWindow(map, views_, window, window.middle, options_);
    if (best.verdict != WindowVerdict::kAgrees) {
      if (best.verdict == WindowVerdict::kUnknown) return std::nullopt;
      best = WindowJudgement();
      ScanMatcher matcher(options_.matcher);
      SetReference(map, &matcher);
      double rival = 0.0;
      for (const ScoredPose& peak : matcher.Peaks(
               window.sparse, window.middle, kReach, kTurn, kLeastScore,
               kPeakShare, kMostPeaks, options_.radius)) {
        const WindowJudgement there =
            JudgeWindow(map, views_, window, peak.pose, options_);
        if (there.verdict != WindowVerdict::kAgrees) continue;
        if ((there.pose - best.pose).head<2>().norm() < kElsewhere &&
            best.quality > 0.0) {
          continue;
        }
        rival = std::max(rival, std::min(best.quality, there.quality));
        if (there.quality > best.quality) best = there;
      }
      if (best.quality == 0.0 || rival > kAsClearly * best.quality) {
        return std::nullopt;
      }
    }
    Match match;
    match.judgement = best;
    match.is_elsewhere =
        (best.pose - window.middle).head<2>().norm() > kElsewhere;
    double nearest = -1.0;
    for (const std::size_t other : visit) {
      const double distance =
          (stretches_[other].window.middle - best.pose).head<2>().norm();
      if (nearest >= 0.0 && distance >= nearest) continue;
      nearest = distance;
      match.visit = other;
    }
    return match;
  }

  const std::vector<KeyView>& views_;
  const std::vector<Stretch>& stretches_;
  const TrackPlacementOptions& options_;
};

Eigen::Matrix3d SqrtInformation(double distance, double turn) {
  return Eigen::Vector3d(1.0 / distance, 1.0 / distance, 1.0 / turn)
      .asDiagonal();
}

// Of a match, in the frame of the pose that it is seen from.
Eigen::Matrix3d SqrtInformation(const Match& match, const Pose2& from) {
  Eigen::Matrix2d rotation;
  rotation << std::cos(from[2]), -std::sin(from[2]), std::sin(from[2]),
      std::cos(from[2]);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  information.topLeftCorner<2, 2>() =
      rotation.transpose() * PositionWeight(match.judgement, kMatchDistance) *
      rotation;
  information(2, 2) = 1.0 / (kMatchTurn * kMatchTurn);
  return information.llt().matrixU();
}

// Poses of the stretches' middles that bend the way least; nothing when they
// cannot be solved for.
std::vector<Pose2> Bend(const std::vector<Stretch>& stretches,
                        const std::vector<std::vector<Match>>& matches) {
  std::vector<Pose2> poses;
  for (const Stretch& stretch : stretches) {
    poses.push_back(stretch.window.middle);
  }
  const std::vector<Pose2> start = poses;
  ceres::LossFunctionWrapper loss(nullptr, ceres::TAKE_OWNERSHIP);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    if (s > 0) {
      const bool is_known = stretches[s].follows;
      problem.AddResidualBlock(
          PosePose::Create(
              Between(start[s - 1], start[s]),
              is_known ? SqrtInformation(kWayDistance, kWayTurn)
                       : SqrtInformation(kUnknownDistance, kUnknownTurn)),
          is_known ? nullptr : &loss, poses[s - 1].data(), poses[s].data());
    }
    for (const Match& match : matches[s]) {
      const Pose2& from = start[match.visit];
      problem.AddResidualBlock(
          PosePose::Create(Between(from, match.judgement.pose),
                           SqrtInformation(match, from)),
          &loss, poses[match.visit].data(), poses[s].data());
    }
  }
  problem.SetParameterBlockConstant(poses.front().data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  for (const double scale : kLossScales) {
    loss.Reset(new ceres::CauchyLoss(scale), ceres::TAKE_OWNERSHIP);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) return {};
  }
  return poses;
}

}  // namespace

std::vector<Pose2> PosesOfAgreeingVisits(const std::vector<KeyView>& views,
                                         const std::vector<bool>& follows,
                                         const TrackPlacementOptions& options,
                                         int num_threads,
                                         const std::function<bool()>& stop) {
  if (views.size() != follows.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(follows.size()) + " entries",
        "one for each of " + std::to_string(views.size()) + " views");
  }
  if (views.empty()) return {};
  const std::vector<Stretch> stretches = CutIntoStretches(
      views, follows, static_cast<std::size_t>(options.window_keys));
  if (stretches.size() < 2) return {};
  const VisitMatcher matcher(views, stretches, options);
  std::vector<std::vector<Match>> matches(stretches.size());
  ThreadTeam team(num_threads);
  const auto batch = static_cast<std::size_t>(8 * std::max(1, num_threads));
  for (std::size_t begin = 0; begin < stretches.size(); begin += batch) {
    if (stop && stop()) return {};
    team.For(std::min(batch, stretches.size() - begin), [&](std::size_t i) {
      matches[begin + i] = matcher.Find(begin + i);
    });
  }
  std::ptrdiff_t elsewhere = 0;
  for (const std::vector<Match>& of_stretch : matches) {
    elsewhere += std::count_if(of_stretch.begin(), of_stretch.end(),
                               [](const Match& m) { return m.is_elsewhere; });
  }
  if (elsewhere < kLeastElsewhere) return {};
  const std::vector<Pose2> bent = Bend(stretches, matches);
  if (bent.empty()) return {};
  std::vector<Pose2> poses(views.size());
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    const auto moved_by = [&](std::size_t other, std::size_t k) {
      return Compose(bent[other],
                     Between(stretches[other].window.middle, views[k].pose));
    };
    for (std::size_t k = stretches[s].window.begin; k < stretches[s].window.end;
         ++k) {
      poses[k] = moved_by(s, k);
      // Halfway to the next one it is moved as both.
      const std::size_t middle = stretches[s].middle();
      const bool is_before = k < middle;
      const std::size_t other = is_before ? s - 1 : s + 1;
      if ((is_before && !stretches[s].follows) ||
          (!is_before &&
           (other == stretches.size() || !stretches[other].follows))) {
        continue;
      }
      const auto distance = [k](std::size_t to) {
        return static_cast<double>(k > to ? k - to : to - k);
      };
      const double share =
          distance(middle) /
          (distance(middle) + distance(stretches[other].middle()));
      const Pose2 by_other = moved_by(other, k);
      Pose2 difference = by_other - poses[k];
      difference[2] = NormalizeAngle(difference[2]);
      poses[k] += share * difference;
      poses[k][2] = NormalizeAngle(poses[k][2]);
    }
  }
  return poses;
}

}  // namespace plumbline
