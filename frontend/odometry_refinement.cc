#include <plumbline/core/error.h>
#include <plumbline/frontend/frontend_state.h>
#include <plumbline/frontend/odometry_refinement.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Points of a track that are searched with lie so far apart, m, and those that
// are kept of old key scans.
constexpr double kSearchSpacing = 0.2;
constexpr double kArchiveSpacing = 0.1;
// First and last key scans of a track that are searched with.
constexpr std::size_t kLocalKeys = 12;
constexpr std::size_t kGlobalKeys = 24;
// Key scans that far from a pose say what was seen around it, m.
constexpr double kNearArchive = 5.0;
// Key scans of one visit to a place.
constexpr std::size_t kShortestVisit = 4;
constexpr std::size_t kLongestVisit = 40;
// Visits to a place that are looked at, and key scans that are searched in for
// each square of the floor, whose side is this, m.
constexpr std::size_t kMostVisits = 8;
constexpr std::size_t kMostThere = 32;
constexpr double kThere = 1.0;
// Scans that wait for a tie at most while nothing can be tracked.
constexpr std::size_t kMostPending = 1000;
// So far from itself a place may lie that is visited again, m and rad.
constexpr double kVisitDistance = 3.0;
constexpr double kVisitRotation = DegToRad(15.0);
// Peaks of a search that are looked at, the least score of one and its share of
// the best.
constexpr int kPeaks = 16;
constexpr double kLeastScore = 0.25;
constexpr double kPeakShare = 0.6;
// No robot of a building moves faster, m/s and rad/s, but for so much, m and
// rad: odometry has jumped.
constexpr double kFastest = 3.0;
constexpr double kFastestTurn = DegToRad(200.0);
constexpr double kJumpWay = 0.3;
constexpr double kJumpTurn = DegToRad(15.0);
// Nor changes its speed by more from scan to scan, m/s.
constexpr double kFastestChange = 1.0;
// A pose explains a scan clearly better than another from this difference on,
// in squared standard deviations of returns that lie apart.
constexpr double kClearly = 10.0;
// From here on a robot has moved while odometry stood still, m and rad.
constexpr double kMovedWay = 0.2;
constexpr double kMovedTurn = DegToRad(8.0);
// The usual time between scans follows with this share.
constexpr double kUsualShare = 0.05;
// Share by which the noise of the laser has to change before it is followed.
constexpr double kNoiseStep = 0.05;
// Returns that lie so far from each other count one by one, m.
constexpr double kApart = 0.15;
// Counted returns from which on a share of them says something.
constexpr int kLeastIntruders = 5;
constexpr int kLeastSeenThrough = 20;
// A returns' share of what is known is not divided by less.
constexpr double kLeastKnown = 0.4;
// Standard deviations of a tie: m and rad, and those that grow with the way.
constexpr double kTieSigma = 0.03;
constexpr double kTieAngle = DegToRad(0.5);
// On the variances that odometry and a track's drift are given.
constexpr double kGenerous = 4.0;
// Motions between key scans from which on odometry's own noise is believed,
// and the largest chi-square of one.
constexpr int kLeastMotions = 20;
constexpr double kUsualInnovation = 9.0;
// The least share of the usual variance that odometry is believed to have: a
// fifth of the usual standard deviation. What is measured holds for single
// motions; over a gap errors of scale add up that it does not show.
constexpr double kLeastOdometryScale = 0.04;
// Where the returns say nothing, m.
constexpr double kOpenSigma = 2.0;
// Of a loose one, m and rad: a weak pull that keeps the map in one frame, not a
// belief.
constexpr double kLooseSigma = 3.0;
constexpr double kLooseAngle = DegToRad(20.0);

// Parts that are looked for in the rest when all scans are in, at most.
constexpr int kMostLateParts = 24;
// A part is looked for again when the rest has grown by this factor.
constexpr double kMoreRest = 1.25;
// Points at most that tell how clearly a window of a part fits somewhere, and
// nodes of the searches for all windows of a part.
constexpr std::size_t kClearPoints = 128;
constexpr std::int64_t kLateNodes = 12000000;
// A tie that is known worse than this is a rough one: the part is still loose,
// m and rad.
constexpr double kLateSigma = 0.5;
constexpr double kLateAngle = DegToRad(5.0);
// A rough one that is known worse than this is not taken: a guess is as good.
constexpr double kRoughSigma = 10.0;
constexpr double kRoughAngle = DegToRad(20.0);

Eigen::Matrix3d Diagonal(double translation, double rotation) {
  return Eigen::Vector3d(translation * translation, translation * translation,
                         rotation * rotation)
      .asDiagonal();
}

ScanPoint PointOf(const Eigen::Vector4f& values) {
  ScanPoint point{};
  point.position = values.head<2>().cast<double>();
  point.normal = values.tail<2>().cast<double>();
  return point;
}

double Square(double x) { return x * x; }

double SeenThrough(const ScanAgreement& a) {
  return a.seen > 0 ? static_cast<double>(a.seen_through) / a.seen : 0.0;
}

// Share of the returns that do not lie in the unknown.
double KnownShare(const ScanAgreement& a) {
  const int known = a.hits + a.intruders;
  return static_cast<double>(known) / std::max(1, known + a.unknown);
}

// Chi-square of what a match leaves the prior by.
double SquaredInnovation(const MatchResult& match, const MatchPrior& prior) {
  Eigen::Vector3d left = match.pose - prior.pose;
  left[2] = NormalizeAngle(left[2]);
  return left.dot(prior.information * left);
}

// From the parent frame's axes to the pose's.
Eigen::Matrix3d RotationInto(const Pose2& pose) {
  const double c = std::cos(pose[2]);
  const double s = std::sin(pose[2]);
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  rotation.topLeftCorner<2, 2>() << c, s, -s, c;
  return rotation;
}

// Returns that lie apart: neighbours on one surface say the same.
int CountApart(const std::vector<ScanPoint>& points) {
  int count = 0;
  const ScanPoint* last = nullptr;
  for (const ScanPoint& point : points) {
    if (last != nullptr && (point.position - last->position).norm() < kApart) {
      continue;
    }
    last = &point;
    ++count;
  }
  return count;
}

// Cauchy's loss: wheels slip more often than a normal distribution says.
double OdometryCost(double squared_innovation, double scale) {
  return scale * std::log1p(squared_innovation / scale);
}

// Share of the returns on what the reference has seen, of all that do not lie
// in the unknown.
double Support(const ScanAgreement& a) {
  return static_cast<double>(a.hits) / std::max(1, a.hits + a.intruders);
}

// How much of a scan the reference explains, at most 1.
double Quality(const ScanAgreement& a) {
  return (a.hits * (1.0 - SeenThrough(a)) - 2.0 * a.intruders) /
         std::max(1, a.hits + a.intruders + a.unknown);
}

}  // namespace

Eigen::Matrix3d OdometryCovariance(const Pose2& motion,
                                   const OdometryNoise& noise) {
  const double distance = motion.head<2>().norm();
  const double turn = std::abs(NormalizeAngle(motion[2]));
  const double translation = noise.translation +
                             noise.translation_per_metre * distance +
                             noise.translation_per_radian * turn;
  const double rotation = noise.rotation + noise.rotation_per_metre * distance +
                          noise.rotation_per_radian * turn;
  return Diagonal(translation, rotation);
}

struct OdometryRefiner::Outcome {
  enum class Verdict { kBelieved, kOdometry, kContradicted };
  Verdict verdict = Verdict::kOdometry;
  RefinedScan refined;
  // Of the returns alone, in the last key scan's frame.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  std::string why;
  // Share of the reference that the scan before looked through.
  double seen_through = 0.0;
};

OdometryRefiner::OdometryRefiner(const OdometryRefinementOptions& options)
    : usual_options_(options), options_(options), track_(options.matcher) {
  SetNoiseScale(RangeNoiseScale(options.range_sigma));
}

void OdometryRefiner::RebuildReference(Track* track) {
  std::vector<ScanPoint> reference;
  std::vector<Viewpoint> viewpoints;
  for (const KeyScan& key : track->keys) {
    // Where odometry has jumped: nothing is in sight of both.
    if ((key.pose - track->keys.back().pose).head<2>().norm() >
        2.0 * options_.points.usable_range) {
      continue;
    }
    const PoseTransform transform(key.pose);
    viewpoints.push_back({transform.Point(key.laser), reference.size()});
    for (const ScanPoint& point : key.points) {
      reference.push_back(Moved(point, transform));
    }
  }
  track->matcher.SetReference(std::move(reference), std::move(viewpoints));
}

MatchResult OdometryRefiner::MatchPoints(const std::vector<ScanPoint>& points,
                                         const MatchPrior& prior,
                                         const Pose2& motion) {
  const ScanMatcher& matcher = track_.matcher;
  const double distance = motion.head<2>().norm();
  const double turn = std::abs(motion[2]);
  MatchResult match = matcher.Refine(points, prior.pose, prior);
  if (match.inlier_ratio < options_.good_inlier_ratio ||
      turn > options_.search_turn) {
    ++wide_searches_;
    // Twice the distance: some odometry gives the way travelled backwards
    // as if it were forwards.
    const Pose2 found = matcher.Search(
        points, prior.pose,
        std::min(options_.search_translation + 2.0 * (distance + track_.way),
                 options_.max_search_translation),
        std::min(kPi, options_.search_rotation + turn + track_.turn), nullptr);
    MatchPrior overruled = prior;
    overruled.information.row(2).setZero();
    overruled.information.col(2).setZero();
    const MatchResult wide = matcher.Refine(points, found, overruled);
    // The scan has to speak clearly for another pose than odometry's, and for
    // one farther away more so than odometry speaks against it.
    const double scale = options_.tracking.odometry_tail;
    const double against = OdometryCost(SquaredInnovation(wide, prior), scale) -
                           OdometryCost(SquaredInnovation(match, prior), scale);
    if (wide.cost < match.cost - 0.02 &&
        (match.cost - wide.cost) * CountApart(points) > against) {
      match = wide;
    }
  }
  return match;
}

std::vector<ScanPoint> OdometryRefiner::WithoutClutter(const Scan& scan) const {
  std::vector<ScanPoint> standing;
  std::vector<bool> clutter;
  const int marked = MarkClutter(scan, points_, options_.clutter, &clutter);
  if (marked > options_.max_clutter * static_cast<double>(points_.size())) {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (!clutter[i]) standing.push_back(points_[i]);
    }
  }
  return standing;
}

MatchPrior OdometryRefiner::PriorOf(const Pose2& pose,
                                    const UncertainPose2& step) const {
  MatchPrior prior;
  prior.pose = pose;
  // What was not matched since adds up.
  const Pose2& motion = step.mean;
  const Pose2 unmatched = track_.refused == 0
                              ? motion
                              : Pose2(motion.head<2>().norm() + track_.way, 0.0,
                                      std::abs(motion[2]) + track_.turn);
  const Eigen::Matrix3d covariance =
      is_dead_ ? Eigen::Matrix3d((track_.refused + 1) * step.covariance)
               : OdometryCovariance(unmatched, options_.noise);
  prior.information = covariance.inverse();
  return prior;
}

void OdometryRefiner::MatchWithoutClutter(const Scan& scan,
                                          const MatchPrior& prior,
                                          const Pose2& motion,
                                          MatchResult* match) {
  std::vector<ScanPoint> standing = WithoutClutter(scan);
  if (standing.empty()) return;
  const MatchResult other = MatchPoints(standing, prior, motion);
  const Pose2 apart = Between(match->pose, other.pose);
  if (other.inlier_ratio >= options_.minimum_inlier_ratio &&
      other.inliers >= options_.minimum_points &&
      (apart.head<2>().norm() > options_.clutter_distance ||
       std::abs(apart[2]) > options_.clutter_rotation)) {
    *match = other;
    points_ = std::move(standing);
    track_.moving = options_.clutter_memory;
    if (trace_) trace_("without clutter");
  }
}

void OdometryRefiner::MatchWithoutIntruders(const std::vector<bool>& intruders,
                                            const MatchPrior& prior,
                                            const Eigen::Vector2d& laser,
                                            MatchResult* match,
                                            ScanAgreement* here) const {
  std::vector<ScanPoint> standing;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!intruders[i]) standing.push_back(points_[i]);
  }
  const MatchResult other = track_.matcher.Refine(standing, prior.pose, prior);
  const ScanAgreement agreement =
      track_.matcher.Compare(points_, other.pose, laser);
  if (Quality(agreement) >= Quality(*here)) {
    *match = other;
    *here = agreement;
  }
}

bool OdometryRefiner::Contradicts(const ScanAgreement& agreement,
                                  double seen_through) const {
  const TrackingOptions& tracking = options_.tracking;
  const double most = track_.after_gap ? tracking.max_intruders_after_gap
                                       : tracking.max_intruders;
  const double through = track_.after_gap ? tracking.max_seen_through_after_gap
                                          : tracking.max_seen_through;
  return (agreement.intruders >= kLeastIntruders &&
          agreement.intruders >
              most * (agreement.hits + agreement.intruders)) ||
         (agreement.seen_through >= kLeastSeenThrough &&
          SeenThrough(agreement) > through + seen_through);
}

bool OdometryRefiner::StandsUpTo(const Scan& scan, const MatchPrior& prior,
                                 double innovation, MatchResult* match,
                                 Outcome* outcome) const {
  const TrackingOptions& tracking = options_.tracking;
  const Eigen::Vector2d laser = scan.laser_offset.head<2>();
  std::vector<bool> intruders;
  const ScanAgreement there =
      track_.matcher.Compare(points_, prior.pose, laser, &intruders);
  ScanAgreement here = track_.matcher.Compare(points_, match->pose, laser);
  // What moves is not what stands: without what has come into the way the scan
  // may speak for odometry.
  if (there.intruders >= kLeastIntruders && !track_.after_gap) {
    MatchWithoutIntruders(intruders, prior, laser, match, &here);
    innovation = SquaredInnovation(*match, prior);
  }
  // Few returns fit in many places: they may leave odometry by little.
  const bool agrees =
      innovation <=
      tracking.max_innovation *
          std::min(1.0, static_cast<double>(here.hits) / tracking.min_hits);
  // What contradicted the scan before already is no news.
  const double before = track_.after_gap
                            ? SeenThrough(track_.matcher.Compare(
                                  track_.last_points, track_.last_pose, laser))
                            : 0.0;
  const double ratio =
      match->inlier_ratio / std::max(kLeastKnown, KnownShare(here));
  // After a gap a match must be better.
  const double least = !track_.after_gap ? options_.minimum_inlier_ratio
                       : agrees          ? tracking.min_ratio_after_gap
                                         : options_.good_inlier_ratio;
  const bool believed =
      ratio >= least && match->inliers >= options_.minimum_points &&
      (agrees || here.hits >= tracking.min_hits) &&
      (agrees || !track_.after_gap ||
       Support(here) >= tracking.min_unexpected_support) &&
      !((track_.after_gap || !agrees) && Contradicts(here, before));
  if (!believed && (track_.after_gap || Contradicts(there, before))) {
    outcome->verdict = Outcome::Verdict::kContradicted;
    outcome->why = track_.after_gap
                       ? "scans are missing and the next one does not fit"
                       : "what the robot sees contradicts what it saw before";
  }
  outcome->seen_through = before;
  if (trace_) {
    char text[256];
    std::snprintf(text, sizeof text,
                  "%s gap %d ratio %.2f/%.2f n %d chi %.1f hits %d intr %d "
                  "unk %d seen %d thr %d before %.2f refused %d",
                  believed               ? "believed"
                  : outcome->why.empty() ? "odometry"
                                         : "contra",
                  static_cast<int>(track_.after_gap), match->inlier_ratio,
                  ratio, match->inliers, innovation, here.hits, here.intruders,
                  here.unknown, here.seen, here.seen_through, before,
                  track_.refused);
    trace_(text);
  }
  return believed;
}

bool OdometryRefiner::Leaps(const Pose2& matched, const Pose2& motion) const {
  // Scans without times leap as they like.
  if (track_.after_gap || track_.seconds <= 0.0) return false;
  const double most = options_.search_translation +
                      options_.tracking.gap_speed * track_.seconds;
  const auto way = [](const Pose2& pose) { return pose.head<2>().norm(); };
  return way(Between(track_.last_pose, matched)) > most &&
         way(Between(Compose(track_.last_pose, motion), matched)) > most;
}

UncertainPose2 OdometryRefiner::StepOf(const Pose2& by_wheels) {
  if (by_wheels.isZero(0.0)) {
    if (still_++ == 0) still_pose_ = track_.last_pose;
    if (is_dead_) return steady_.Step();
    return {by_wheels, OdometryCovariance(by_wheels, options_.noise)};
  }
  const Pose2 motion =
      options_.match_scans ? odometry_scale_.Scaled(by_wheels) : by_wheels;
  UncertainPose2 step = {motion, OdometryCovariance(motion, options_.noise)};
  // Odometry that has only been late catches up with all of the way at once.
  if (is_dead_ && IsLate(motion)) {
    step.mean = Between(track_.last_pose, Compose(still_pose_, motion));
  }
  last_motion_ = motion;
  still_ = 0;
  is_dead_ = false;
  ahead_.exists = false;
  return step;
}

bool OdometryRefiner::IsLate(const Pose2& motion) const {
  const Pose2 once = steady_.Step().mean;
  const auto apart = [&](double times) {
    const Pose2 left = motion - times * once;
    return left.head<2>().norm() + std::abs(left[2]);
  };
  return apart(still_ + 1.0) < apart(1.0);
}

bool OdometryRefiner::MovesOn(bool leapt, UncertainPose2* since_key,
                              MatchPrior* prior, MatchResult* match) {
  if (is_dead_ || (still_ == 0 && !leapt)) return false;
  // The returns may lead on by themselves.
  const Pose2 moved = Between(still_pose_, match->pose);
  if (!leapt && steady_.IsMoving() &&
      (moved.head<2>().norm() > kMovedWay || std::abs(moved[2]) > kMovedTurn)) {
    is_dead_ = true;
    return false;
  }
  if (!ahead_.exists) {
    // A robot that slows down stands in the end.
    const bool abruptly =
        leapt ? !track_.after_gap : steady_.Explains(last_motion_);
    if (!steady_.IsMoving() || !abruptly) return false;
    ahead_ = {true, track_.last_pose, track_.since_key, steady_.Step()};
  }
  ahead_.since_key = Compose(ahead_.since_key, ahead_.step);
  MatchPrior moving;
  moving.pose = Compose(ahead_.pose, ahead_.step.mean);
  moving.information = ahead_.step.covariance.inverse();
  const MatchResult other = track_.matcher.Refine(points_, moving.pose, moving);
  ahead_.pose = other.pose;
  const Pose2 apart = Between(match->pose, other.pose);
  const double clearly = (match->cost - other.cost) * CountApart(points_);
  const bool same = apart.head<2>().norm() <= options_.clutter_distance &&
                    std::abs(apart[2]) <= options_.clutter_rotation;
  // No robot leaps: what the returns do not speak against holds.
  const bool moves = (leapt || !same) &&
                     other.inlier_ratio >= options_.minimum_inlier_ratio &&
                     clearly > (leapt ? -kClearly : kClearly);
  if (trace_) {
    char text[200];
    std::snprintf(
        text, sizeof text,
        "ahead %d leapt %d apart %.3f %.1f clearly %.1f ratio %.2f %.2f "
        "cost %.3f %.3f",
        static_cast<int>(moves), static_cast<int>(leapt),
        apart.head<2>().norm(), RadToDeg(apart[2]), clearly,
        match->inlier_ratio, other.inlier_ratio, match->cost, other.cost);
    trace_(text);
  }
  // Where both lead to one place nothing is open; where it cannot be, neither.
  if (leapt || moves || same || clearly < -kClearly) ahead_.exists = false;
  if (!moves) return false;
  is_dead_ = !leapt;
  *since_key = ahead_.since_key;
  *prior = moving;
  *match = other;
  return true;
}

OdometryRefiner::Outcome OdometryRefiner::Match(const Scan& scan,
                                                const UncertainPose2& step,
                                                bool leapt) {
  Outcome outcome;
  Pose2 motion = step.mean;
  RefinedScan& result = outcome.refined;
  result.since_key = Compose(track_.since_key, step);
  result.pose = Compose(track_.last_pose, motion);
  result.odometry_only = true;
  if (!options_.match_scans || track_.matcher.empty() ||
      static_cast<int>(points_.size()) < options_.minimum_points) {
    return outcome;
  }
  MatchPrior prior = PriorOf(result.pose, step);
  MatchResult match = MatchPoints(points_, prior, motion);
  const bool moves_on = MovesOn(leapt, &result.since_key, &prior, &match);
  if (moves_on) {
    result.pose = prior.pose;
    motion = Between(track_.last_pose, result.pose);
  }
  if (moves_on || is_dead_) odometry_scale_.Break();
  // What may move is not what stands: where it speaks for another pose than the
  // rest, the rest counts.
  if (track_.moving > 0) --track_.moving;
  if (track_.moving > 0 || match.inlier_ratio < options_.good_inlier_ratio ||
      SquaredInnovation(match, prior) > options_.clutter_innovation) {
    MatchWithoutClutter(scan, prior, motion, &match);
  }
  bool believed = match.inlier_ratio >= options_.good_inlier_ratio;
  const double innovation = SquaredInnovation(match, prior);
  // Few returns fit in many places.
  const bool sees_little = 2 * points_.size() < scan.ranges.size();
  if (!believed || track_.after_gap ||
      (sees_little && innovation > options_.tracking.max_innovation)) {
    believed = StandsUpTo(scan, prior, innovation, &match, &outcome);
  }
  believed = believed && !Leaps(match.pose, motion);
  if (!believed && moves_on && leapt) return Match(scan, step, false);
  if (!believed) {
    ++refusals_;
    return outcome;
  }
  outcome.verdict = Outcome::Verdict::kBelieved;
  result.pose = match.pose;
  result.odometry_only = false;
  const Pose2 key_pose = track_.keys.back().pose;
  result.since_key.mean = Between(key_pose, match.pose);
  // What the returns leave open is as uncertain as all the odometry since
  // the key scan, not as that of the last step alone.
  const Eigen::Matrix3d rotation = RotationInto(key_pose);
  outcome.information = rotation * match.information * rotation.transpose();
  result.since_key.covariance =
      (outcome.information + result.since_key.covariance.inverse()).inverse();
  result.since_key.covariance += DriftCovariance(result.since_key.mean);
  return outcome;
}

double OdometryRefiner::range_sigma() const {
  return usual_options_.range_sigma > 0.0 ? usual_options_.range_sigma
                                          : noise_.sigma();
}

void OdometryRefiner::AllowForNoise(const Scan& scan) {
  noise_.Add(scan);
  const double scale = RangeNoiseScale(range_sigma());
  if (std::abs(scale / noise_scale_ - 1.0) > kNoiseStep) SetNoiseScale(scale);
}

void OdometryRefiner::SetNoiseScale(double scale) {
  noise_scale_ = scale;
  options_ = usual_options_;
  options_.ScaleToNoise(scale);
  track_.matcher.set_point_sigma(options_.matcher.point_sigma);
  if (open_ != nullptr) {
    open_->before.matcher.set_point_sigma(options_.matcher.point_sigma);
  }
}

void OdometryRefiner::NoteGap(double seconds) {
  if (seconds > options_.tracking.gap_seconds &&
      seconds > options_.tracking.gap_factor * usual_step_) {
    track_.after_gap = true;
  }
  if (seconds > 0.0) {
    usual_step_ = usual_step_ == 0.0
                      ? seconds
                      : usual_step_ + kUsualShare * (seconds - usual_step_);
  }
}

void OdometryRefiner::NoteMatch(const Outcome& outcome, const Pose2& motion) {
  if (outcome.verdict == Outcome::Verdict::kBelieved) {
    // What follows on a gap, or was not matched, is no motion of one scan.
    const Pose2 moved = Between(track_.last_pose, outcome.refined.pose);
    if (track_.refused > 0 || (track_.after_gap && !steady_.Explains(moved))) {
      steady_.Break();
    } else {
      steady_.Add(moved);
    }
    track_.way = 0.0;
    track_.turn = 0.0;
    track_.refused = 0;
    track_.seconds = 0.0;
    track_.after_gap = false;
    track_.jumped = false;
  } else if (options_.match_scans) {
    track_.way += motion.head<2>().norm();
    track_.turn += std::abs(motion[2]);
    ++track_.refused;
  }
}

bool OdometryRefiner::IsContradicted(const Outcome& outcome) const {
  // One scan that contradicts may be a door or a person: without a gap in
  // the log it takes several in a row.
  return outcome.verdict == Outcome::Verdict::kContradicted &&
         (track_.after_gap ||
          track_.refused >= options_.tracking.min_contradictions);
}

bool OdometryRefiner::IsLost(const Outcome& outcome) const {
  if (outcome.verdict == Outcome::Verdict::kBelieved || !options_.match_scans) {
    return false;
  }
  return IsContradicted(outcome) ||
         track_.way > options_.tracking.max_blind_way ||
         track_.turn > options_.tracking.max_blind_turn;
}

void OdometryRefiner::Lose(int scan, double seconds, const Outcome& outcome) {
  const TrackingOptions& tracking = options_.tracking;
  if (trace_) trace_("LOST " + outcome.why);
  const double blind_way = track_.way;
  const double blind_turn = track_.turn;
  const bool jumped = track_.jumped;
  const bool contradicted = IsContradicted(outcome);
  const bool tiny =
      open_ != nullptr &&
      static_cast<int>(open_->keys.size()) < tracking.min_tie_keys &&
      pending_.size() < kMostPending;
  if (open_ != nullptr && !tiny) Tie(true);
  ++losses_;
  if (open_ == nullptr) {
    // The scans that were refused are settled already.
    open_ = std::make_unique<OpenTie>(std::move(track_));
    open_->last_sure = scan - open_->before.refused;
    open_->why = outcome.why.empty()
                     ? "nothing that the robot saw could be matched"
                     : outcome.why;
    open_->way = blind_way;
    open_->turn = blind_turn;
    open_->seconds = std::max(0.0, seconds);
  } else {
    // What has been tracked since is too little to be a track.
    for (SettledScan& pending : pending_) {
      pending.refined.is_key = false;
      pending.refined.odometry_only = true;
      pending.refined.tie = TrackTie::kNone;
      pending.refined.since_key = UncertainPose2();
      pending.refined.since_key.mean =
          Between(open_->before.keys.back().pose, pending.refined.pose);
      pending.points.clear();
    }
    open_->keys.clear();
  }
  open_->seen_through = outcome.seen_through;
  open_->odometry_holds = open_->odometry_holds && !contradicted && !jumped;
  open_->first = scan;
  open_->blind_way = open_->way;
  open_->blind_turn = open_->turn;
  open_->next_attempt = tracking.min_tie_keys;
  open_->next_global = tracking.first_global_keys;
  track_ = Track(options_.matcher);
}

void OdometryRefiner::BeginTrack(const Scan& scan, SettledScan* first) {
  RefinedScan& refined = first->refined;
  refined.is_key = true;
  first->points = points_;
  track_.last_pose = refined.pose;
  track_.last_points = points_;
  key_odometry_ = scan.odometry;
  odometry_scale_.Break();
  track_.keys.push_back(
      {first->index, refined.pose, points_, scan.laser_offset.head<2>()});
  RebuildReference(&track_);
}

void OdometryRefiner::ContinueTrack(const Scan& scan,
                                    const Eigen::Matrix3d& information,
                                    SettledScan* next) {
  RefinedScan& refined = next->refined;
  track_.since_key = refined.since_key;
  track_.last_pose = refined.pose;
  track_.last_points = points_;
  const bool moved =
      refined.since_key.mean.head<2>().norm() >= options_.key_distance ||
      std::abs(refined.since_key.mean[2]) >= options_.key_rotation;
  // A scan that was refused anchors nothing.
  if (!moved || (refined.odometry_only && options_.match_scans)) return;
  refined.is_key = true;
  CompareOdometry(scan, refined, information);
  next->points = points_;
  // Where things move, what may move enters no reference.
  if (track_.moving > 0) {
    std::vector<ScanPoint> standing = WithoutClutter(scan);
    if (!standing.empty()) points_ = std::move(standing);
  }
  track_.keys.push_back(
      {next->index, refined.pose, points_, scan.laser_offset.head<2>()});
  while (static_cast<int>(track_.keys.size()) > options_.window) {
    track_.keys.pop_front();
  }
  RebuildReference(&track_);
  track_.since_key = UncertainPose2();
}

RefinedScan OdometryRefiner::Process(const Scan& scan) {
  AllowForNoise(scan);
  ExtractScanPoints(scan, options_.points, &points_);
  SettledScan done;
  done.index = count_++;
  const Pose2 by_wheels =
      started_ ? Between(last_odometry_, scan.odometry) : Pose2::Zero();
  const UncertainPose2 step = StepOf(by_wheels);
  const Pose2& motion = step.mean;
  const double seconds = started_ ? scan.timestamp - last_time_ : 0.0;
  last_odometry_ = scan.odometry;
  last_time_ = scan.timestamp;
  if (!started_) {
    started_ = true;
    done.refined.pose = scan.odometry;
    BeginTrack(scan, &done);
    Archive(track_.keys.back());
    settled_.push_back(done);
    return done.refined;
  }

  NoteGap(seconds);
  track_.seconds += std::max(0.0, seconds);
  const bool jumped =
      motion.head<2>().norm() > kJumpWay + kFastest * std::max(0.0, seconds) ||
      std::abs(motion[2]) > kJumpTurn + kFastestTurn * std::max(0.0, seconds);
  track_.jumped = track_.jumped || jumped;
  const Pose2 change = motion - steady_.Step().mean;
  const bool leapt =
      steady_.IsMoving() && !steady_.Explains(motion) &&
      (jumped || change.head<2>().norm() >
                     kJumpWay + kFastestChange * std::max(0.0, seconds));
  if (open_ != nullptr) {
    open_->way += motion.head<2>().norm();
    open_->turn += std::abs(motion[2]);
    open_->seconds += std::max(0.0, seconds);
  }
  const Outcome outcome = Match(scan, step, leapt);
  NoteMatch(outcome, motion);
  done.refined = outcome.refined;
  const bool is_lost = IsLost(outcome);
  if (is_lost) {
    Lose(done.index, seconds, outcome);
    BeginTrack(scan, &done);
  } else {
    ContinueTrack(scan, outcome.information, &done);
  }
  if (open_ == nullptr) {
    if (done.refined.is_key) Archive(track_.keys.back());
    settled_.push_back(done);
    return done.refined;
  }
  pending_.push_back(done);
  if (!done.refined.is_key) return done.refined;
  open_->keys.push_back(track_.keys.back());
  if (!is_lost) {
    const int keys = static_cast<int>(open_->keys.size());
    if (keys >= options_.tracking.max_open_keys) {
      Tie(true);
    } else if (keys >= open_->next_attempt) {
      Tie(false);
    }
  }
  return done.refined;
}

OdometryRefiner::TrackView OdometryRefiner::ViewOf(
    const std::vector<KeyScan>& keys, std::size_t begin, std::size_t end) {
  TrackView view;
  std::set<std::array<long, 2>> taken;
  std::set<std::array<long, 2>> taken_dense;
  const Pose2& middle = keys[(begin + end) / 2].pose;
  for (std::size_t k = begin; k < end; ++k) {
    view.keys.push_back(&keys[k]);
    view.relative.push_back(Between(middle, keys[k].pose));
    const PoseTransform transform(view.relative.back());
    for (const ScanPoint& point : keys[k].points) {
      const ScanPoint moved = Moved(point, transform);
      const auto cell = [&](double spacing) {
        return std::array<long, 2>{std::lround(moved.position.x() / spacing),
                                   std::lround(moved.position.y() / spacing)};
      };
      if (taken.insert(cell(kSearchSpacing)).second) {
        view.sparse.push_back(moved.position);
      }
      if (moved.normal.squaredNorm() > 0.0 &&
          taken_dense.insert(cell(kArchiveSpacing)).second) {
        view.dense.push_back(moved);
      }
    }
  }
  return view;
}

bool OdometryRefiner::Judge(const TrackView& view, const ScoredPose& peak,
                            const Visit& visit, double seen_through,
                            bool is_global, Hypothesis* hypothesis) const {
  const TrackingOptions& tracking = options_.tracking;
  MatchPrior none;
  none.pose = peak.pose;
  const MatchResult match = visit.matcher->Refine(view.dense, peak.pose, none);
  const Pose2 moved = Between(peak.pose, match.pose);
  // Nothing there to hold it.
  if (moved.head<2>().norm() > ScanMatcher::kPeakDistance ||
      std::abs(moved[2]) > ScanMatcher::kPeakRotation) {
    return false;
  }
  hypothesis->pose = match.pose;
  hypothesis->information = match.information;
  hypothesis->begin = visit.begin;
  hypothesis->end = visit.end;
  ScanAgreement sum;
  for (std::size_t k = 0; k < view.keys.size(); ++k) {
    const ScanAgreement a = visit.matcher->Compare(
        view.keys[k]->points, Compose(match.pose, view.relative[k]),
        view.keys[k]->laser);
    sum.hits += a.hits;
    sum.intruders += a.intruders;
    sum.unknown += a.unknown;
    sum.seen += a.seen;
    sum.seen_through += a.seen_through;
  }
  const double min_support =
      is_global ? tracking.min_global_support : tracking.min_tie_support;
  const double min_inliers =
      is_global ? tracking.min_global_inliers : tracking.min_tie_inliers;
  const double inliers =
      match.inlier_ratio / std::max(kLeastKnown, KnownShare(sum));
  hypothesis->support = Support(sum);
  hypothesis->quality = Quality(sum) * std::min(1.0, inliers);
  hypothesis->holds =
      peak.score >= tracking.min_tie_score &&
      hypothesis->support >= min_support && inliers >= min_inliers &&
      SeenThrough(sum) <= tracking.max_tie_seen_through + seen_through &&
      KnownShare(sum) >= tracking.min_tie_known &&
      sum.hits >= tracking.min_tie_hits * static_cast<int>(view.keys.size());
  if (trace_) {
    char text[256];
    std::snprintf(text, sizeof text,
                  "  peak %.2f visit %d-%d -> %.2f %.2f %.1f ratio %.2f "
                  "hits %d intr %d unk %d seen %d thr %d q %.3f holds %d",
                  peak.score, static_cast<int>(visit.begin),
                  static_cast<int>(visit.end), match.pose[0], match.pose[1],
                  RadToDeg(match.pose[2]), match.inlier_ratio, sum.hits,
                  sum.intruders, sum.unknown, sum.seen, sum.seen_through,
                  hypothesis->quality, static_cast<int>(hypothesis->holds));
    trace_(text);
  }
  return true;
}

bool OdometryRefiner::FindTie(
    const std::vector<KeyScan>& keys, const ScanMatcher& reference,
    const std::function<std::vector<Visit>(const Pose2&)>& visits,
    const Pose2& center, double translation_window, std::size_t begin,
    std::size_t end, double seen_through, bool is_global, std::int64_t* nodes,
    Hypothesis* found) {
  const TrackView view = ViewOf(keys, begin, end);
  const std::vector<ScoredPose> peaks = reference.Peaks(
      view.sparse, center, translation_window, kPi, kLeastScore, kPeakShare,
      kPeaks,
      is_global ? kNearArchive : std::numeric_limits<double>::infinity(), stop_,
      nodes);
  std::vector<Hypothesis> hypotheses;
  for (const ScoredPose& peak : peaks) {
    for (const Visit& visit : visits(peak.pose)) {
      if (stop_ && stop_()) return false;
      Hypothesis hypothesis;
      if (Judge(view, peak, visit, seen_through, is_global, &hypothesis)) {
        hypotheses.push_back(hypothesis);
      }
    }
  }
  const Hypothesis* best = nullptr;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (best == nullptr || hypothesis.quality > best->quality) {
      best = &hypothesis;
    }
  }
  if (best == nullptr || !best->holds) return false;
  for (const Hypothesis& rival : hypotheses) {
    // Seen on another visit a place lies beside itself.
    const bool same_visit = rival.begin < best->end
                                ? best->begin < rival.end
                                : rival.begin == best->begin;
    const Pose2 apart = Between(best->pose, rival.pose);
    if (apart.head<2>().norm() <
            (same_visit ? ScanMatcher::kPeakDistance : kVisitDistance) &&
        std::abs(apart[2]) <
            (same_visit ? ScanMatcher::kPeakRotation : kVisitRotation)) {
      continue;
    }
    if (rival.quality > options_.tracking.rival_share * best->quality) {
      return false;
    }
  }
  *found = *best;
  return true;
}

void OdometryRefiner::Tie(bool last) {
  const TrackingOptions& tracking = options_.tracking;
  const int count = static_cast<int>(open_->keys.size());
  // In steps that grow.
  open_->next_attempt = count + std::max(1, count / 3);
  if (trace_) trace_("TIE attempt keys " + std::to_string(count));
  RefinedScan first;
  Hypothesis found;
  const KeyScan& start = open_->keys.front();
  std::size_t middle = 0;
  if (count >= tracking.min_tie_keys) {
    const std::size_t end =
        std::min<std::size_t>(open_->keys.size(), kLocalKeys);
    middle = end / 2;
    const double window =
        std::min(tracking.max_local_search,
                 0.5 + 0.5 * open_->way + tracking.gap_speed * open_->seconds);
    const ScanMatcher& reference = open_->before.matcher;
    if (FindTie(
            open_->keys, reference,
            [&reference](const Pose2&) {
              return std::vector<Visit>{{&reference, 0, 0}};
            },
            open_->keys[middle].pose, window, 0, end, open_->seen_through,
            false, nullptr, &found)) {
      const bool is_expected =
          AgreesWithOdometry(found, middle, archive_.size() - 1);
      // Where the robot was carried the right place need not be among those
      // that were searched, and the next door looks like this one.
      if (is_expected || (!open_->odometry_holds &&
                          found.support >= tracking.min_unexpected_support)) {
        first.tie = TrackTie::kMatched;
      }
    }
  }
  if (first.tie == TrackTie::kNone && count >= tracking.first_global_keys &&
      (last || count >= open_->next_global)) {
    open_->next_global = 2 * count;
    std::vector<std::size_t> where(archive_.size());
    std::iota(where.begin(), where.end(), std::size_t{0});
    const std::size_t end = open_->keys.size();
    const std::size_t begin = end > kGlobalKeys ? end - kGlobalKeys : 0;
    middle = (begin + end) / 2;
    if (FindInArchive(open_->keys, ViewOfArchive(where), begin, end,
                      open_->seen_through, nullptr, &found)) {
      const std::size_t nearest = NearestOf(found, where);
      const ArchivedKey& key = archive_[nearest];
      if (!open_->odometry_holds ||
          AgreesWithOdometry(found, middle, nearest)) {
        first.tie = TrackTie::kMatched;
        first.since = key.scan;
        first.since_key.mean = key.pose;
        part_ = key.part;
      }
    }
  }
  if (first.tie == TrackTie::kMatched) {
    const Pose2 from =
        first.since < 0 ? open_->before.keys.back().pose : first.since_key.mean;
    std::vector<Pose2> back;
    for (std::size_t k = middle + 1; k-- > 0;) {
      back.push_back(open_->keys[k].pose);
    }
    const UncertainPose2 tie{Between(from, found.pose),
                             TieCovariance(found, from)};
    first.since_key = Compose(tie, Along(back));
    first.pose = Compose(from, first.since_key.mean);
  }
  if (first.tie == TrackTie::kNone) {
    if (!last) return;
    first.pose = start.pose;
    first.since_key.mean = Between(open_->before.keys.back().pose, start.pose);
    const Eigen::Matrix3d covariance = BlindMotion().covariance;
    if (open_->odometry_holds &&
        covariance.topLeftCorner<2, 2>().diagonal().maxCoeff() <=
            Square(tracking.max_odometry_sigma) &&
        covariance(2, 2) <= Square(tracking.max_odometry_angle)) {
      first.tie = TrackTie::kOdometry;
      first.since_key.covariance = covariance;
    } else {
      first.tie = TrackTie::kLoose;
      first.since_key.covariance = Diagonal(kLooseSigma, kLooseAngle);
      part_ = num_parts_++;
    }
  }
  if (trace_) {
    trace_("TIED as " + std::to_string(static_cast<int>(first.tie)) +
           " since " + std::to_string(first.since));
  }
  Settle(Compose(first.pose, Inverse(start.pose)), first);
}

void OdometryRefiner::CompareOdometry(const Scan& scan,
                                      const RefinedScan& refined,
                                      const Eigen::Matrix3d& information) {
  const Pose2 by_wheels = Between(key_odometry_, scan.odometry);
  key_odometry_ = scan.odometry;
  if (refined.odometry_only || track_.keys.empty()) return;
  const Pose2 motion = odometry_scale_.Scaled(by_wheels);
  odometry_scale_.Compare(by_wheels,
                          OdometryCovariance(by_wheels, options_.noise),
                          refined.since_key.mean, information);
  Pose2 left = refined.since_key.mean - motion;
  left[2] = NormalizeAngle(left[2]);
  const double innovation =
      left.dot(OdometryCovariance(motion, options_.noise).inverse() * left);
  // Slips and jumps are not what odometry usually does.
  squared_innovations_ += std::min(kUsualInnovation, innovation);
  ++compared_motions_;
}

double OdometryRefiner::OdometryVarianceScale() const {
  if (compared_motions_ < kLeastMotions) return 1.0;
  return std::clamp(
      kGenerous * squared_innovations_ / (3.0 * compared_motions_),
      kLeastOdometryScale, 1.0);
}

UncertainPose2 OdometryRefiner::BlindMotion() const {
  Eigen::Matrix3d covariance =
      OdometryVarianceScale() *
      OdometryCovariance({open_->blind_way, 0.0, open_->blind_turn},
                         options_.noise);
  // The heading is uncertain on the way, too.
  const double aside =
      open_->blind_way * open_->blind_way * covariance(2, 2) / 4.0;
  covariance.topLeftCorner<2, 2>().diagonal().array() += aside;
  return {Between(open_->before.keys.back().pose, open_->keys.front().pose),
          covariance};
}

bool OdometryRefiner::AgreesWithOdometry(const Hypothesis& found,
                                         std::size_t middle,
                                         std::size_t since) const {
  std::vector<Pose2> before;
  for (std::size_t k = since; k < archive_.size(); ++k) {
    // A guess lies between.
    if (archive_[k].part != archive_.back().part) return true;
    before.push_back(archive_[k].pose);
  }
  std::vector<Pose2> after;
  for (std::size_t k = 0; k <= middle; ++k) {
    after.push_back(open_->keys[k].pose);
  }
  // What neighbouring matches have in common adds up faster than a random walk.
  const auto generous = [this](const std::vector<Pose2>& poses) {
    UncertainPose2 way = Along(poses);
    way.covariance *= kGenerous;
    return way;
  };
  const UncertainPose2 predicted =
      Compose(Compose(generous(before), BlindMotion()), generous(after));
  const Pose2 from = archive_[since].pose;
  Pose2 left = Between(from, found.pose) - predicted.mean;
  left[2] = NormalizeAngle(left[2]);
  const Eigen::Matrix3d covariance =
      predicted.covariance + Diagonal(kTieSigma, kTieAngle);
  const double innovation = left.dot(covariance.inverse() * left);
  if (trace_) trace_("odometry against it " + std::to_string(innovation));
  return innovation <= options_.tracking.max_innovation;
}

void OdometryRefiner::Settle(const Pose2& shift, const RefinedScan& first) {
  for (SettledScan& done : pending_) {
    if (done.index == open_->first) {
      done.refined.tie = first.tie;
      done.refined.since = first.since;
      done.refined.since_key = first.since_key;
    } else if (done.index < open_->first) {
      // Lost between the tracks: with the one that follows.
    }
    if (done.index >= open_->first) {
      done.refined.pose = Compose(shift, done.refined.pose);
    }
    settled_.push_back(std::move(done));
  }
  pending_.clear();
  const bool goes_on = first.tie != TrackTie::kLoose && first.since < 0;
  if (!goes_on || open_->blind_way > options_.tracking.max_silent_way) {
    if (guessed_ >= 0 && !goes_on) {
      loose_[guessed_].end = open_->last_sure;
      guessed_ = -1;
    }
    LooseTrack part;
    part.begin = open_->last_sure;
    part.end = open_->first;
    part.found = first.tie != TrackTie::kLoose;
    part.why =
        open_->why + (first.tie == TrackTie::kOdometry
                          ? "; odometry alone tells where it went on"
                      : part.found ? "; found again on what it saw earlier"
                                   : "; where it went on is a guess");
    if (!part.found) {
      guessed_ = static_cast<int>(loose_.size());
      loose_of_.push_back(guessed_);
    }
    loose_.push_back(std::move(part));
  }
  for (KeyScan& key : open_->keys) {
    key.pose = Compose(shift, key.pose);
    Archive(key);
  }
  for (KeyScan& key : track_.keys) key.pose = Compose(shift, key.pose);
  track_.last_pose = Compose(shift, track_.last_pose);
  // What was seen before goes on being the reference.
  if (first.tie == TrackTie::kMatched && first.since < 0) {
    std::deque<KeyScan>& before = open_->before.keys;
    while (static_cast<int>(track_.keys.size()) < options_.window &&
           !before.empty()) {
      track_.keys.push_front(std::move(before.back()));
      before.pop_back();
    }
  }
  RebuildReference(&track_);
  open_.reset();
}

Eigen::Matrix3d OdometryRefiner::TieCovariance(const Hypothesis& found,
                                               const Pose2& from) const {
  const Eigen::Matrix3d rotation = RotationInto(from);
  const Eigen::Matrix3d information =
      rotation * found.information * rotation.transpose() +
      Diagonal(kOpenSigma, kPi).inverse();
  return information.inverse() + Diagonal(kTieSigma, kTieAngle);
}

UncertainPose2 OdometryRefiner::Along(const std::vector<Pose2>& poses) const {
  UncertainPose2 sum;
  sum.covariance.setZero();
  for (std::size_t k = 1; k < poses.size(); ++k) {
    const Pose2 step = Between(poses[k - 1], poses[k]);
    sum = Compose(sum, {step, DriftCovariance(step)});
  }
  return sum;
}

Eigen::Matrix3d OdometryRefiner::DriftCovariance(const Pose2& motion) const {
  const MatchDrift& drift = options_.drift;
  const double way = motion.head<2>().norm();
  const double turned = std::abs(motion[2]);
  const double translation =
      drift.translation_per_root_metre * drift.translation_per_root_metre * way;
  const double heading =
      drift.rotation_per_root_metre * drift.rotation_per_root_metre * way +
      drift.rotation_per_root_radian * drift.rotation_per_root_radian * turned;
  return Eigen::Vector3d(translation, translation, heading).asDiagonal();
}

void OdometryRefiner::SetArchive(const std::vector<std::size_t>& where,
                                 std::size_t begin, std::size_t end,
                                 ScanMatcher* matcher) const {
  std::vector<ScanPoint> reference;
  std::vector<Viewpoint> viewpoints;
  for (std::size_t i = begin; i < end; ++i) {
    const ArchivedKey& key = archive_[where[i]];
    const PoseTransform transform(key.pose);
    viewpoints.push_back({transform.Point(key.laser), reference.size()});
    for (const Eigen::Vector4f& values : key.points) {
      reference.push_back(Moved(PointOf(values), transform));
    }
  }
  matcher->SetReference(std::move(reference), std::move(viewpoints));
}

std::vector<std::size_t> OdometryRefiner::Thinned(
    const std::vector<std::size_t>& where) const {
  std::map<std::pair<long, long>, std::vector<std::size_t>> there;
  for (const std::size_t k : where) {
    const Eigen::Vector2d at = archive_[k].pose.head<2>() / kThere;
    there[{std::lround(at.x()), std::lround(at.y())}].push_back(k);
  }
  std::vector<std::size_t> thinned;
  for (const auto& entry : there) {
    const std::vector<std::size_t>& all = entry.second;
    const std::size_t count = std::min(all.size(), kMostThere);
    for (std::size_t i = 0; i < count; ++i) {
      thinned.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
    }
  }
  std::sort(thinned.begin(), thinned.end());
  return thinned;
}

OdometryRefiner::ArchiveView OdometryRefiner::ViewOfArchive(
    const std::vector<std::size_t>& where) const {
  Eigen::Vector2d low = archive_[where.front()].pose.head<2>();
  Eigen::Vector2d high = low;
  for (const std::size_t k : where) {
    low = low.cwiseMin(archive_[k].pose.head<2>());
    high = high.cwiseMax(archive_[k].pose.head<2>());
  }
  const Eigen::Vector2d center = 0.5 * (low + high);
  ArchiveView view{where, ScanMatcher(options_.matcher),
                   Pose2(center.x(), center.y(), 0.0),
                   0.5 * (high - low).maxCoeff() + 1.0};
  const std::vector<std::size_t> thinned = Thinned(where);
  SetArchive(thinned, 0, thinned.size(), &view.matcher);
  return view;
}

bool OdometryRefiner::FindInArchive(const std::vector<KeyScan>& keys,
                                    const ArchiveView& archive,
                                    std::size_t begin, std::size_t end,
                                    double seen_through, std::int64_t* nodes,
                                    Hypothesis* found) {
  const std::vector<std::size_t>& where = archive.where;
  std::deque<ScanMatcher> around;
  const auto visits = [&](const Pose2& pose) {
    std::vector<std::pair<std::size_t, std::size_t>> all;
    std::size_t k = 0;
    while (k < where.size()) {
      const auto is_near = [&](std::size_t i) {
        return (archive_[where[i]].pose - pose).head<2>().norm() <=
               kNearArchive;
      };
      if (!is_near(k)) {
        ++k;
        continue;
      }
      const std::size_t first = k;
      while (k < where.size() && is_near(k) && k - first < kLongestVisit) ++k;
      if (k - first >= kShortestVisit) all.emplace_back(first, k);
    }
    // In even steps where they are many.
    const std::size_t count = std::min(all.size(), kMostVisits);
    std::vector<Visit> result;
    around.clear();
    for (std::size_t i = 0; i < count; ++i) {
      const auto& [first, last] = all[(2 * i + 1) * all.size() / (2 * count)];
      around.emplace_back(options_.matcher);
      SetArchive(where, first, last, &around.back());
      result.push_back({&around.back(), first, last});
    }
    return result;
  };
  return FindTie(keys, archive.matcher, visits, archive.center, archive.window,
                 begin, end, seen_through, true, nodes, found);
}

std::size_t OdometryRefiner::NearestOf(
    const Hypothesis& found, const std::vector<std::size_t>& where) const {
  return *std::min_element(
      where.begin() + static_cast<std::ptrdiff_t>(found.begin),
      where.begin() + static_cast<std::ptrdiff_t>(found.end),
      [&](std::size_t a, std::size_t b) {
        return (archive_[a].pose - found.pose).head<2>().norm() <
               (archive_[b].pose - found.pose).head<2>().norm();
      });
}

void OdometryRefiner::Archive(const KeyScan& key) {
  ArchivedKey kept;
  kept.scan = key.scan;
  kept.part = part_;
  kept.pose = key.pose;
  kept.laser = key.laser;
  Eigen::Vector2d last = Eigen::Vector2d::Constant(1e9);
  for (const ScanPoint& point : key.points) {
    if ((point.position - last).norm() < kArchiveSpacing) continue;
    last = point.position;
    Eigen::Vector4f values;
    values << point.position.cast<float>(), point.normal.cast<float>();
    kept.points.push_back(values);
  }
  kept.points.shrink_to_fit();
  archive_.push_back(std::move(kept));
}

std::vector<std::vector<std::size_t>> OdometryRefiner::Parts() const {
  std::vector<std::vector<std::size_t>> parts(
      static_cast<std::size_t>(num_parts_));
  for (std::size_t k = 0; k < archive_.size(); ++k) {
    parts[static_cast<std::size_t>(archive_[k].part)].push_back(k);
  }
  return parts;
}

void OdometryRefiner::JoinParts() {
  // The largest part takes in others, largest first, until none is found.
  const std::vector<LooseTrack> loose = loose_;
  // Key scans that a part was looked for in, by part.
  std::vector<std::size_t> tried(static_cast<std::size_t>(num_parts_), 0);
  bool is_joined = num_parts_ > 1;
  int looked_for = 0;
  while (is_joined) {
    is_joined = false;
    std::vector<std::vector<std::size_t>> parts = Parts();
    std::stable_sort(
        parts.begin(), parts.end(),
        [](const auto& a, const auto& b) { return a.size() > b.size(); });
    for (std::size_t p = 1; p < parts.size() && !is_joined; ++p) {
      if (parts[p].empty()) break;
      std::size_t& before =
          tried[static_cast<std::size_t>(archive_[parts[p].front()].part)];
      const std::size_t rest = parts[0].size();
      if (static_cast<double>(rest) < kMoreRest * static_cast<double>(before)) {
        continue;
      }
      before = rest;
      // A log of many parts comes to an end, too.
      if (++looked_for > kMostLateParts) break;
      if (stop_ && stop_()) break;
      is_joined = JoinPart(parts[0], parts[p]);
    }
  }
  if (stop_ && stop_()) {
    loose_ = loose;
    late_ties_.clear();
  }
  std::sort(late_ties_.begin(), late_ties_.end(),
            [](const LateTie& a, const LateTie& b) { return a.scan < b.scan; });
}

bool OdometryRefiner::JoinPart(const std::vector<std::size_t>& rest,
                               const std::vector<std::size_t>& part) {
  const auto least =
      static_cast<std::size_t>(options_.tracking.first_global_keys);
  if (part.size() < least || rest.size() < kShortestVisit) return false;
  std::vector<KeyScan> keys;
  for (const std::size_t k : part) {
    const ArchivedKey& kept = archive_[k];
    keys.push_back({kept.scan, kept.pose, {}, kept.laser});
    for (const Eigen::Vector4f& values : kept.points) {
      keys.back().points.push_back(PointOf(values));
    }
  }
  const std::size_t size = std::min(kGlobalKeys, part.size());
  const ArchiveView view = ViewOfArchive(rest);
  const std::vector<std::size_t> windows = WindowsOf(keys, size, view);
  // What a window says stands when another one says the same, or the part is
  // too short for another: one that fits nowhere is no reason to believe it.
  const bool is_short = NumLateWindows(part.size(), size) == 1;
  std::vector<LateVote> votes;
  LateVote best_vote;
  std::optional<LateTie> best;
  const auto variance = [](const LateTie& tie) {
    const Eigen::Matrix3d& covariance = tie.since_key.covariance;
    return std::max({covariance(0, 0) / Square(kLateSigma),
                     covariance(1, 1) / Square(kLateSigma),
                     covariance(2, 2) / Square(kLateAngle)});
  };
  std::int64_t nodes = kLateNodes;
  for (const std::size_t begin : windows) {
    if (stop_ && stop_()) return false;
    if (nodes <= 0) break;
    // A jump within a window is none of the track's: parts are whole.
    LateVote vote{begin + size / 2, {}};
    if (!FindInArchive(keys, view, begin, begin + size, 0.0, &nodes,
                       &vote.found)) {
      continue;
    }
    if (trace_) trace_("LATE window found");
    const auto confirms = [&](const LateVote& other) {
      const Pose2 expected =
          Compose(other.found.pose,
                  Between(keys[other.middle].pose, keys[vote.middle].pose));
      const Pose2 apart = Between(expected, vote.found.pose);
      return apart.head<2>().norm() < kVisitDistance &&
             std::abs(apart[2]) < kVisitRotation;
    };
    std::vector<const LateVote*> agreeing;
    for (const LateVote& other : votes) {
      if (confirms(other)) agreeing.push_back(&other);
    }
    if (!agreeing.empty() || is_short) {
      agreeing.push_back(&vote);
      for (const LateVote* other : agreeing) {
        const LateTie tie = LateTieOf(rest, part, *other);
        const bool is_narrow = variance(tie) <= 1.0;
        const bool is_better =
            !best || (is_narrow && variance(*best) <= 1.0
                          ? other->found.quality > best_vote.found.quality
                          : variance(tie) < variance(*best));
        if (is_better) {
          best = tie;
          best_vote = *other;
        }
      }
      if (variance(*best) <= 1.0) break;
    }
    votes.push_back(vote);
  }
  if (!best ||
      best->since_key.covariance.diagonal().head<2>().maxCoeff() >
          Square(kRoughSigma) ||
      best->since_key.covariance(2, 2) > Square(kRoughAngle)) {
    return false;
  }
  AddLateTie(rest, part, best_vote, *best, variance(*best) > 1.0);
  return true;
}

std::size_t OdometryRefiner::NumLateWindows(std::size_t keys,
                                            std::size_t size) const {
  return std::min(static_cast<std::size_t>(options_.tracking.max_late_windows),
                  1 + 2 * (keys - size) / size);
}

std::vector<std::size_t> OdometryRefiner::WindowsOf(
    const std::vector<KeyScan>& keys, std::size_t size,
    const ArchiveView& rest) const {
  const std::size_t room = keys.size() - size;
  const std::size_t windows = NumLateWindows(keys.size(), size);
  std::vector<std::pair<double, std::size_t>> scored;
  for (std::size_t w = 0; w < windows; ++w) {
    if (stop_ && stop_()) return {};
    const std::size_t begin = windows > 1 ? w * room / (windows - 1) : 0;
    const std::vector<Eigen::Vector2d> all =
        ViewOf(keys, begin, begin + size).sparse;
    std::vector<Eigen::Vector2d> few;
    const std::size_t step = (all.size() + kClearPoints - 1) / kClearPoints;
    for (std::size_t i = 0; i < all.size(); i += step) few.push_back(all[i]);
    scored.emplace_back(
        windows > 1 ? rest.matcher.ClearestScore(few, rest.center, rest.window,
                                                 kPi, kNearArchive, stop_)
                    : 1.0,
        begin);
  }
  std::stable_sort(
      scored.begin(), scored.end(),
      [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::size_t> begins;
  for (const auto& [score, begin] : scored) {
    if (score >= options_.tracking.min_tie_score) begins.push_back(begin);
  }
  return begins;
}

LateTie OdometryRefiner::LateTieOf(const std::vector<std::size_t>& rest,
                                   const std::vector<std::size_t>& part,
                                   const LateVote& vote) const {
  // The match says where the part's key scan is among the rest. The one of the
  // two that begins later hangs on what was seen before it began.
  const std::size_t at_rest = NearestOf(vote.found, rest);
  const std::size_t at_part = part[vote.middle];
  const Pose2 match = Between(archive_[at_rest].pose, vote.found.pose);
  const bool is_later = part.front() > rest.front();
  const std::vector<std::size_t>& later = is_later ? part : rest;
  const std::vector<std::size_t>& earlier = is_later ? rest : part;
  const std::size_t at_later = is_later ? at_part : at_rest;
  const std::size_t at_earlier = is_later ? at_rest : at_part;
  const auto last_before = std::prev(
      std::lower_bound(earlier.begin(), earlier.end(), later.front()));
  const std::size_t since = std::min(*last_before, at_earlier);
  const auto along = [&](const std::vector<std::size_t>& keys, std::size_t from,
                         std::size_t to) {
    std::vector<Pose2> poses;
    for (const std::size_t k : keys) {
      if (std::min(from, to) <= k && k <= std::max(from, to)) {
        poses.push_back(archive_[k].pose);
      }
    }
    if (to < from) std::reverse(poses.begin(), poses.end());
    return Along(poses);
  };
  UncertainPose2 tie{match, TieCovariance(vote.found, archive_[at_rest].pose)};
  if (!is_later) tie = Inverse(tie);
  LateTie late;
  late.scan = archive_[later.front()].scan;
  late.since = archive_[since].scan;
  late.since_key = Compose(Compose(along(earlier, since, at_earlier), tie),
                           along(later, at_later, later.front()));
  return late;
}

void OdometryRefiner::AddLateTie(const std::vector<std::size_t>& rest,
                                 const std::vector<std::size_t>& part,
                                 const LateVote& vote, const LateTie& tie,
                                 bool is_rough) {
  late_ties_.push_back(tie);
  if (trace_) {
    trace_("JOINED scan " + std::to_string(tie.scan) + " since " +
           std::to_string(tie.since) + (is_rough ? " roughly" : ""));
  }
  const bool is_later = part.front() > rest.front();
  const std::vector<std::size_t>& later = is_later ? part : rest;
  const std::vector<std::size_t>& earlier = is_later ? rest : part;
  // Parts are numbered in the order in which they began.
  const int number = archive_[later.front()].part;
  LooseTrack& loose = loose_[loose_of_[static_cast<std::size_t>(number) - 1]];
  loose.why = loose.why.substr(0, loose.why.find(';')) +
              "; found again on what was seen later";
  if (is_rough) {
    loose.why += ", roughly";
  } else {
    loose.found = true;
    loose.end = tie.scan;
  }
  const Pose2 shift =
      Compose(vote.found.pose, Inverse(archive_[part[vote.middle]].pose));
  const int into = archive_[earlier.front()].part;
  for (const std::size_t k : part) {
    archive_[k].pose = Compose(shift, archive_[k].pose);
  }
  for (const std::size_t k : later) archive_[k].part = into;
}

bool OdometryRefiner::TakeSettled(SettledScan* settled) {
  if (settled_.empty()) return false;
  *settled = std::move(settled_.front());
  settled_.pop_front();
  return true;
}

void OdometryRefiner::Finish(const std::function<bool()>& stop) {
  stop_ = stop;
  if (open_ != nullptr) Tie(true);
  if (guessed_ >= 0) loose_[guessed_].end = count_ - 1;
  guessed_ = -1;
  JoinParts();
  stop_ = nullptr;
  // No scan follows.
  std::vector<ArchivedKey>().swap(archive_);
}

template <typename StateArchive>
void OdometryRefiner::ExchangeState(StateArchive& archive) {
  ExchangeAll(archive, track_, points_, started_, count_, last_odometry_,
              last_time_, usual_step_, archive_, part_, num_parts_, loose_of_,
              wide_searches_, refusals_, losses_, loose_, guessed_, noise_,
              noise_scale_, key_odometry_, squared_innovations_,
              compared_motions_, odometry_scale_, steady_, still_, last_motion_,
              still_pose_, is_dead_, ahead_);
}

void OdometryRefiner::WriteState(StateWriter* state) {
  if (!IsSettled()) {
    throw PLUMBLINE_ERROR("scans are not settled", "none of them open");
  }
  ExchangeState(*state);
}

void OdometryRefiner::ReadState(StateReader* state) {
  ExchangeState(*state);
  SetNoiseScale(noise_scale_);
  if (started_) RebuildReference(&track_);
}

}  // namespace plumbline
