#include <plumbline/factors/angle.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/track_windows.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Points that a search is made with lie so far apart, m.
constexpr double kSearchSpacing = 0.4;
// Counted returns of a window from which on its shares say something.
constexpr int kLeastReturns = 40;
// Known shares are not divided by less.
constexpr double kLeastKnown = 0.4;
// Position and direction of a window, m and rad, in the fit of the track.
constexpr double kWindowDistance = 0.1;
constexpr double kWindowTurn = DegToRad(1.0);
// Least weight of a window's position along its walls, as a share of that
// across them.
constexpr double kLeastAlong = 0.01;
constexpr int kFitSteps = 3;

}  // namespace

Eigen::Matrix2d PositionWeight(const WindowJudgement& judgement, double sigma) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(
      judgement.information);
  Eigen::Matrix2d weight = Eigen::Matrix2d::Identity();
  if (solver.eigenvalues()[1] > 0.0) {
    weight = judgement.information / solver.eigenvalues()[1] +
             kLeastAlong * Eigen::Matrix2d::Identity();
  }
  return weight / (sigma * sigma);
}

std::vector<TrackWindow> MakeTrackWindows(const std::vector<KeyView>& track,
                                          std::size_t size) {
  std::vector<TrackWindow> windows;
  const std::size_t count = std::max<std::size_t>(1, track.size() / size);
  for (std::size_t w = 0; w < count; ++w) {
    TrackWindow window;
    window.begin = w * track.size() / count;
    window.end = (w + 1) * track.size() / count;
    window.middle = track[(window.begin + window.end) / 2].pose;
    std::set<std::array<long, 2>> taken_sparse;
    std::set<std::array<long, 2>> taken_dense;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      window.relative.push_back(Between(window.middle, track[k].pose));
      const PoseTransform transform(window.relative.back());
      for (const ScanPoint& point : track[k].points) {
        const ScanPoint moved = Moved(point, transform);
        const auto cell = [&](double spacing) {
          return std::array<long, 2>{std::lround(moved.position.x() / spacing),
                                     std::lround(moved.position.y() / spacing)};
        };
        if (taken_sparse.insert(cell(kSearchSpacing)).second) {
          window.sparse.push_back(moved.position);
        }
        if (moved.normal.squaredNorm() > 0.0 &&
            taken_dense.insert(cell(kViewSpacing)).second) {
          window.dense.push_back(moved);
        }
      }
    }
    windows.push_back(std::move(window));
  }
  return windows;
}

WindowJudgement JudgeWindow(const std::vector<KeyView>& map,
                            const std::vector<KeyView>& track,
                            const TrackWindow& window, const Pose2& guess,
                            const TrackPlacementOptions& options) {
  WindowJudgement judgement;
  judgement.pose = guess;
  std::vector<KeyView> near;
  for (const std::size_t k :
       ViewsNear(map, guess, options.radius,
                 static_cast<std::size_t>(options.max_views))) {
    near.push_back(map[k]);
  }
  if (near.empty()) return judgement;
  ScanMatcher matcher(options.matcher);
  SetReference(near, &matcher);
  if (matcher.empty()) return judgement;
  const auto compare = [&](const Pose2& pose) {
    ScanAgreement sum;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      const ScanAgreement a = matcher.Compare(
          track[k].points, Compose(pose, window.relative[k - window.begin]),
          track[k].laser);
      sum.hits += a.hits;
      sum.intruders += a.intruders;
      sum.unknown += a.unknown;
      sum.seen += a.seen;
      sum.seen_through += a.seen_through;
    }
    return sum;
  };
  MatchPrior none;
  none.pose = guess;
  none.information =
      Eigen::Vector3d(1.0 / (options.max_shift * options.max_shift),
                      1.0 / (options.max_shift * options.max_shift),
                      1.0 / (options.max_turn * options.max_turn))
          .asDiagonal();
  const MatchResult match = matcher.Refine(window.dense, guess, none);
  const Pose2 moved = Between(guess, match.pose);
  const bool stays = moved.head<2>().norm() <= options.max_shift &&
                     std::abs(moved[2]) <= options.max_turn;
  const ScanAgreement sum = compare(stays ? match.pose : guess);
  const int known = sum.hits + sum.intruders;
  judgement.compared = known + sum.seen;
  judgement.contradicted = sum.intruders + sum.seen_through;
  const double known_share =
      static_cast<double>(known) / std::max(1, known + sum.unknown);
  if (known < kLeastReturns) return judgement;
  const double support = static_cast<double>(sum.hits) / known;
  const double through =
      sum.seen > 0 ? static_cast<double>(sum.seen_through) / sum.seen : 0.0;
  const double inliers =
      match.inlier_ratio / std::max(kLeastKnown, known_share);
  if (stays && known_share >= options.min_known &&
      support >= options.min_support && through <= options.max_seen_through &&
      inliers >= options.min_inliers) {
    judgement.verdict = WindowVerdict::kAgrees;
    judgement.pose = match.pose;
    judgement.information = match.curvature.topLeftCorner<2, 2>();
    judgement.quality = known_share * support * (1.0 - through);
  } else if (1.0 - support > options.max_intruders ||
             (sum.seen >= kLeastReturns &&
              through > options.max_looked_through)) {
    judgement.verdict = WindowVerdict::kContradicts;
  } else if (known_share >= options.min_known) {
    judgement.verdict = WindowVerdict::kDoubtful;
  }
  return judgement;
}

Pose2 FitTrack(const std::vector<TrackWindow>& windows,
               const std::vector<WindowJudgement>& judgements) {
  Eigen::Vector2d mean_map = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_track = Eigen::Vector2d::Zero();
  double weight = 0.0;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    if (judgements[w].verdict != WindowVerdict::kAgrees) continue;
    mean_map += judgements[w].pose.head<2>();
    mean_track += windows[w].middle.head<2>();
    weight += 1.0;
  }
  mean_map /= weight;
  mean_track /= weight;
  constexpr double kLever =
      (kWindowDistance / kWindowTurn) * (kWindowDistance / kWindowTurn);
  double sine = 0.0;
  double cosine = 0.0;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    if (judgements[w].verdict != WindowVerdict::kAgrees) continue;
    const Eigen::Vector2d p = judgements[w].pose.head<2>() - mean_map;
    const Eigen::Vector2d q = windows[w].middle.head<2>() - mean_track;
    const double turn = judgements[w].pose[2] - windows[w].middle[2];
    cosine += q.dot(p) + kLever * std::cos(turn);
    sine += q.x() * p.y() - q.y() * p.x() + kLever * std::sin(turn);
  }
  const double angle = std::atan2(sine, cosine);
  Eigen::Matrix2d rotation;
  rotation << std::cos(angle), -std::sin(angle), std::sin(angle),
      std::cos(angle);
  Pose2 fit;
  fit << mean_map - rotation * mean_track, angle;
  std::vector<Eigen::Matrix2d> weights;
  for (const WindowJudgement& judgement : judgements) {
    weights.push_back(PositionWeight(judgement, kWindowDistance));
  }
  for (int step = 0; step < kFitSteps; ++step) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    const PoseTransform transform(fit);
    for (std::size_t w = 0; w < windows.size(); ++w) {
      if (judgements[w].verdict != WindowVerdict::kAgrees) continue;
      const Eigen::Vector2d at = transform.Point(windows[w].middle.head<2>());
      const Eigen::Vector2d lever = at - fit.head<2>();
      Eigen::Matrix<double, 2, 3> jacobian;
      jacobian << Eigen::Matrix2d::Identity(),
          Eigen::Vector2d(-lever.y(), lever.x());
      normal += jacobian.transpose() * weights[w] * jacobian;
      gradient += jacobian.transpose() * weights[w] *
                  (judgements[w].pose.head<2>() - at);
      constexpr double kTurnWeight = 1.0 / (kWindowTurn * kWindowTurn);
      normal(2, 2) += kTurnWeight;
      gradient[2] +=
          kTurnWeight *
          NormalizeAngle(judgements[w].pose[2] - windows[w].middle[2] - fit[2]);
    }
    fit += normal.ldlt().solve(gradient);
    fit[2] = NormalizeAngle(fit[2]);
  }
  return fit;
}

}  // namespace plumbline
