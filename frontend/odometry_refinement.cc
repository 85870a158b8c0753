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

// First and last key scans of a track that are searched with.
constexpr std::size_t kLocalKeys = 12;
constexpr std::size_t kGlobalKeys = 24;
// Around the place where odometry has them they are looked for so far, m.
constexpr double kOdometryReach = 15.0;
// Odometry that moves by no more has not moved, m and rad; so many scans after
// a gap it may still tell of the way at once.
constexpr double kStandsWay = 0.02;
constexpr double kStandsTurn = DegToRad(1.0);
constexpr int kMostLate = 5;
// Scans that wait for a tie at most while nothing can be tracked.
constexpr std::size_t kMostPending = 1000;
// No robot of a building moves faster, m/s and rad/s, but for so much, m and
// rad: odometry has jumped.
constexpr double kFastest = 3.0;
constexpr double kFastestTurn = DegToRad(200.0);
constexpr double kJumpWay = 0.3;
constexpr double kJumpTurn = DegToRad(15.0);
// Wheels of a robot that is carried are rolled by no more, m and rad.
constexpr double kRolledWay = 1.0;
constexpr double kRolledTurn = DegToRad(90.0);
// Nor changes its speed by more from scan to scan, m/s.
constexpr double kFastestChange = 1.0;
// A pose explains a scan clearly better than another from this difference on,
// in squared standard deviations of returns that lie apart.
constexpr double kClearly = 10.0;
// The same of all scans since they lie apart: what they say is much the same.
constexpr double kClearlyInAll = 20.0;
// Where a robot stands or goes on are one place when they are nearer to each
// other than this share of the way between.
constexpr double kNearShare = 0.25;
// From here on a robot has moved while odometry stood still, m and rad.
constexpr double kMovedWay = 0.2;
constexpr double kMovedTurn = DegToRad(8.0);
// What wheels that do not slip are off by since the last key scan, one standard
// deviation: m, and m a metre; so many of them are far, and so many near.
constexpr double kWheelSigma = 0.02;
constexpr double kWheelSigmaPerMetre = 0.05;
constexpr double kFarFromWheels = 3.0;
constexpr double kNearWheels = 2.0;
// By how much more information odometry holds a scan where it has it, and by
// how much better (ScanAgreement::Quality) the scan agrees there with what was
// seen, of places that are apart by more than noise.
constexpr double kHeld = 25.0;
constexpr double kBetter = 0.1;
// A robot that goes by less between two scans may do so in any direction, m.
constexpr double kLeastWayAhead = 0.02;
// A return says something of a direction when the cosine of its normal with it
// is no smaller than this. So deep a thing is, m, that may be all that says
// something, and so large its least share of it.
constexpr double kSays = 0.5;
constexpr double kThing = 1.0;
constexpr double kOfOneThing = 0.8;
// What speaks for one of two poses is nearer to what was seen there by so large
// a share of what lies between them. For wheels at least so many that lie apart
// have to, and this share of those that speak for the match.
constexpr double kSpeaks = 0.5;
constexpr int kLeastForWheels = 4;
constexpr double kShareForWheels = 0.5;
// They lead elsewhere along the way by a cosine of at least this.
constexpr double kAlongWay = 0.7;
// So many scans after the robot was last seen to move as its wheels turn these
// count while they turn as before, where at least so much speaks for them.
constexpr int kMostEven = 20;
constexpr int kLeastWhenUnsteady = 2;
// The usual time between scans follows with this share.
constexpr double kUsualShare = 0.05;
// Share by which the noise of the laser has to change before it is followed.
constexpr double kNoiseStep = 0.05;
// Returns that lie so far from each other count one by one, m.
constexpr double kApart = 0.15;
// Counted returns from which on a share of them says something.
constexpr int kLeastIntruders = 5;
constexpr int kLeastSeenThrough = 20;
// Share of a scan that must not lie in the unknown where odometry, which is in
// doubt, speaks of another place.
constexpr double kLeastKnown = 0.8;
// Standard deviations of odometry within which a place is looked for that it
// leads to over a gap.
constexpr double kNearSigmas = 2.0;
// Within so many a place that fits a scan by this share as well, and lies so
// far from the match, m, looks alike. Places are tried so far apart, m, where
// the scan fits by a share of that without being moved.
constexpr double kAlikeSigmas = 3.0;
constexpr double kAlikeShare = 0.8;
constexpr double kLeastAlike = 0.3;
constexpr double kAlikeStep = 0.1;
constexpr double kAlikeToTry = 0.6;
// A match that leaves odometry by no more standard deviations stays. Where
// places look alike it is held by this where odometry leads, m.
constexpr double kOffAlike = 1.5;
constexpr double kHeldWhereAlike = 0.02;
// It fits there as well where so much of what it sees is known, and no more of
// that, by this share, has come in between.
constexpr double kKnownWhereAlike = 0.6;
constexpr double kAsWell = 0.02;
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
// Of a loose one, m and rad: a weak pull that keeps the map in one frame, not a
// belief.
constexpr double kLooseSigma = 3.0;
constexpr double kLooseAngle = DegToRad(20.0);

Eigen::Matrix3d Diagonal(double translation, double rotation) {
  return Eigen::Vector3d(translation * translation, translation * translation,
                         rotation * rotation)
      .asDiagonal();
}

double Square(double x) { return x * x; }

bool Stands(const Pose2& motion) {
  return motion.head<2>().norm() <= kStandsWay &&
         std::abs(NormalizeAngle(motion[2])) <= kStandsTurn;
}

// By so much odometry of a way (m) and a turn (rad) may have turned wrongly,
// rad: by less than a quarter of a circle, after which much of a building looks
// the same. Over a gap nothing but the sum of its turns is known.
double MostWrongTurn(double way, double turn) {
  return std::min(DegToRad(75.0),
                  DegToRad(30.0) + DegToRad(2.0) * way + 0.3 * std::abs(turn));
}

// Farther than wheels are rolled when a robot is taken up or set down.
bool IsFar(const Pose2& motion) {
  return motion.head<2>().norm() > kRolledWay ||
         std::abs(NormalizeAngle(motion[2])) > kRolledTurn;
}

// Whether odometry tells of a way over a gap in the log, and has not begun anew
// in it.
bool GoesOn(const Pose2& before, const Pose2& after) {
  return IsFar(Between(before, after)) && (IsFar(after) || !IsFar(before));
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

// Where the stretch of kThing begins that has nearly all of these depths; none
// where there is no such.
std::optional<double> OneThing(std::vector<double> depths) {
  std::sort(depths.begin(), depths.end());
  std::size_t most = 0;
  double begin = 0.0;
  for (std::size_t first = 0, end = 0; first < depths.size(); ++first) {
    while (end < depths.size() && depths[end] <= depths[first] + kThing) ++end;
    if (end - first > most) {
      most = end - first;
      begin = depths[first];
    }
  }
  if (most == 0 || most < kOfOneThing * depths.size()) return std::nullopt;
  return begin;
}

// Cauchy's loss: wheels slip more often than a normal distribution says.
double OdometryCost(double squared_innovation, double scale) {
  return scale * std::log1p(squared_innovation / scale);
}

// Wheels slip along their way, and get the way's sign wrong, but do not go to
// the side of it: there odometry's cost is that of a normal distribution. 0
// where the robot stands, as `motion` (in the frame of a pose turned by
// `heading`) says.
double CostAcross(const MatchResult& match, const MatchPrior& prior,
                  double heading, const Pose2& motion) {
  const double way = motion.head<2>().norm();
  if (way < kLeastWayAhead) return 0.0;
  const double direction = heading + std::atan2(motion[1], motion[0]);
  const Eigen::Vector2d across(-std::sin(direction), std::cos(direction));
  const double off = across.dot((match.pose - prior.pose).head<2>());
  const Eigen::Matrix2d covariance =
      prior.information.topLeftCorner<2, 2>().inverse();
  return 0.5 * off * off / across.dot(covariance * across);
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
  // The robot is known to have gone on while odometry stood still.
  bool has_gone_on = false;
};

OdometryRefiner::OdometryRefiner(const OdometryRefinementOptions& options)
    : usual_options_(options),
      options_(options),
      track_(options.matcher),
      reference_(std::make_unique<TrackReference>(options.prepare_ahead)),
      search_(options.tracking, options.matcher) {
  SetNoiseScale(RangeNoiseScale(options.range_sigma));
}

void OdometryRefiner::RebuildReference(Track* track) {
  reference_->Set(track->keys, 2.0 * options_.points.usable_range,
                  options_.window, track->matcher.merge_distance(),
                  &track->matcher);
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
    const MatchResult wide = MatchOverruling(points, found, prior);
    if (IsClearlyBetter(wide, match, points, prior)) match = wide;
  }
  return match;
}

MatchResult OdometryRefiner::MatchOverruling(
    const std::vector<ScanPoint>& points, const Pose2& guess,
    const MatchPrior& prior) const {
  MatchPrior overruled = prior;
  overruled.information.row(2).setZero();
  overruled.information.col(2).setZero();
  return track_.matcher.Refine(points, guess, overruled);
}

bool OdometryRefiner::IsClearlyBetter(const MatchResult& wide,
                                      const MatchResult& match,
                                      const std::vector<ScanPoint>& points,
                                      const MatchPrior& prior) const {
  // The scan has to speak clearly for another pose than odometry's, and for
  // one farther away more so than odometry speaks against it.
  const double scale = options_.tracking.odometry_tail;
  const double against = OdometryCost(SquaredInnovation(wide, prior), scale) -
                         OdometryCost(SquaredInnovation(match, prior), scale);
  return wide.cost < match.cost - 0.02 &&
         (match.cost - wide.cost) * CountApart(points) > against;
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

void OdometryRefiner::GoByWheels(const Pose2& motion, bool leapt,
                                 MatchPrior* prior) {
  WheelTrack& wheels = track_.wheels;
  if (track_.refused > 0 || track_.after_gap || track_.jumped || leapt ||
      is_dead_ || still_ > 0) {
    wheels.Reset();
  }
  if (!wheels.exists()) return;
  wheels.Move(motion, track_.last_pose[2]);
  prior->pose.head<2>() = wheels.position();
  prior->information.topLeftCorner<2, 2>() = wheels.Covariance().inverse();
}

void OdometryRefiner::MatchWithoutClutter(const Scan& scan,
                                          const MatchPrior& prior,
                                          const Pose2& motion,
                                          MatchResult* match) {
  std::vector<ScanPoint> standing = WithoutClutter(scan);
  if (standing.empty()) return;
  MatchResult other = MatchPoints(standing, prior, motion);
  // The rest may fit where all do, too, far from odometry.
  const MatchResult same = MatchOverruling(standing, match->pose, prior);
  if (IsClearlyBetter(same, other, standing, prior)) other = same;
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

void OdometryRefiner::NoteWheels(bool leapt) {
  const bool undisturbed = track_.refused == 0 && still_ == 0 && !is_dead_ &&
                           !track_.after_gap && !track_.jumped && !leapt;
  const bool steady =
      undisturbed && steady_.IsMoving() && steady_.Explains(last_motion_);
  steady_wheels_ = steady ? steady_wheels_ + 1 : 0;
  // Wheels that go on as they did before what matches say became unsteady.
  const bool go_on = undisturbed && wheel_steps_.IsMoving() &&
                     wheel_steps_.Explains(last_motion_);
  even_wheels_ = go_on ? even_wheels_ + 1 : 0;
  since_steady_ = steady ? 0 : go_on ? since_steady_ + 1 : kMostEven + 1;
  if (!undisturbed) wheel_steps_.Break();
  wheel_steps_.Add(last_motion_);
  ++scans_since_key_;
}

bool OdometryRefiner::HaveWheelsBeenSteady() const {
  // The step to the key scan, too: what odometry was late by then comes after.
  return steady_wheels_ > scans_since_key_;
}

bool OdometryRefiner::HaveWheelsGoneOn() const {
  return even_wheels_ > scans_since_key_ && since_steady_ <= kMostEven;
}

Pose2 OdometryRefiner::ByWheels(const Scan& scan) const {
  return Compose(
      track_.keys.back().pose,
      odometry_calibration_.Corrected(Between(key_odometry_, scan.odometry)));
}

// Along a corridor one thing may be all that says how far the robot went. When
// it moves, a door that is opened or somebody with a trolley, each scan is
// pulled by less than odometry may be off by from scan to scan, and all of them
// add up. Wheels that slip do not turn on as the robot moved before.
void OdometryRefiner::MatchAsWheelsSay(const Scan& scan,
                                       const MatchPrior& prior,
                                       MatchResult* match) {
  const Pose2 by_wheels = ByWheels(scan);
  const auto apart = [&](const Pose2& pose) {
    return (pose - by_wheels).head<2>().norm();
  };
  const double sigma =
      kWheelSigma + kWheelSigmaPerMetre *
                        (by_wheels - track_.keys.back().pose).head<2>().norm();
  if (apart(match->pose) <= kFarFromWheels * sigma) return;
  const bool steady = HaveWheelsBeenSteady();
  const Pose2 usual = (HaveWheelsGoneOn() ? wheel_steps_ : steady_).Step().mean;
  const auto change = [&](const Pose2& motion) {
    return (motion - usual).head<2>().norm();
  };
  if (change(Between(track_.last_pose, match->pose)) < change(last_motion_)) {
    return;
  }
  const Pose2 guess(by_wheels[0], by_wheels[1], match->pose[2]);
  const Eigen::Vector2d direction =
      PoseTransform(Inverse(guess))
          .Direction((match->pose - by_wheels).head<2>())
          .normalized();
  std::vector<ScanPoint> standing;
  if (steady) standing = WithoutOneThing(direction);
  // What goes ahead or beside takes a match along; aside of the way it is
  // wheels that turned by a little more or less.
  const Eigen::Vector2d way = (by_wheels - track_.keys.back().pose).head<2>();
  const bool is_along =
      std::abs(way.dot((match->pose - by_wheels).head<2>())) >=
      kAlongWay * way.norm() * apart(match->pose);
  if (standing.empty() && is_along) {
    standing = WithoutWhatGoes(direction, guess, match->pose,
                               steady ? 0 : kLeastWhenUnsteady);
  }
  if (standing.empty()) return;
  MatchPrior wheels;
  wheels.pose = guess;
  wheels.pose[2] = prior.pose[2];
  wheels.information.diagonal() << 1.0 / (sigma * sigma), 1.0 / (sigma * sigma),
      prior.information(2, 2);
  const MatchResult other = track_.matcher.Refine(standing, guess, wheels);
  if (apart(other.pose) > kNearWheels * sigma ||
      other.inlier_ratio < options_.good_inlier_ratio ||
      other.inliers < options_.minimum_points ||
      Contradicts(track_.matcher.Compare(standing, other.pose,
                                         scan.laser_offset.head<2>()),
                  0.0)) {
    return;
  }
  if (trace_) trace_("as wheels say");
  *match = other;
  points_ = standing;
  track_.moving = options_.clutter_memory;
}

// Where a scan has little in common with what was seen before, the returns that
// it has slide along to wherever more of them find a partner.
void OdometryRefiner::StayUnlessClear(const MatchPrior& prior,
                                      const Pose2& motion,
                                      const Eigen::Vector2d& laser,
                                      MatchResult* match) {
  if (SquaredInnovation(*match, prior) <= options_.tracking.max_innovation) {
    return;
  }
  MatchPrior held = prior;
  held.pose[2] = match->pose[2];
  held.information *= kHeld;
  held.is_heavy_tailed = false;
  const MatchResult there = track_.matcher.Refine(points_, held.pose, held);
  const double better =
      track_.matcher.Compare(points_, there.pose, laser).Quality() -
      track_.matcher.Compare(points_, match->pose, laser).Quality();
  const bool is_clear =
      better <= kBetter && IsClearlyBetter(*match, there, points_, prior) &&
      (there.cost - match->cost) * CountApart(points_) >
          CostAcross(*match, prior, track_.last_pose[2], motion);
  if (trace_) {
    char text[100];
    std::snprintf(text, sizeof text, "far %s cost %.3f there %.3f better %.3f",
                  is_clear ? "clear" : "stays", match->cost, there.cost,
                  better);
    trace_(text);
  }
  if (!is_clear) *match = there;
}

std::vector<ScanPoint> OdometryRefiner::WithoutOneThing(
    const Eigen::Vector2d& direction) const {
  const auto says = [&](const ScanPoint& point) {
    return std::abs(point.normal.dot(direction)) >= kSays;
  };
  std::vector<double> depths;
  for (const ScanPoint& point : points_) {
    if (says(point)) depths.push_back(point.position.dot(direction));
  }
  const std::optional<double> thing = OneThing(std::move(depths));
  std::vector<ScanPoint> rest;
  if (!thing) return rest;
  for (const ScanPoint& point : points_) {
    const double depth = point.position.dot(direction);
    if (!says(point) || depth < *thing || depth > *thing + kThing) {
      rest.push_back(point);
    }
  }
  return rest;
}

// A vehicle in an aisle has more returns than the corners of all shelves, and
// takes the match along. Wheels that slip have next to nothing on their side,
// and all that stands against them.
std::vector<ScanPoint> OdometryRefiner::WithoutWhatGoes(
    const Eigen::Vector2d& direction, const Pose2& by_wheels,
    const Pose2& matched, int least) const {
  const std::vector<double> there = track_.matcher.Errors(points_, by_wheels);
  const std::vector<double> here = track_.matcher.Errors(points_, matched);
  const double apart = (matched - by_wheels).head<2>().norm();
  std::vector<ScanPoint> rest;
  std::vector<ScanPoint> for_wheels;
  std::vector<ScanPoint> for_match;
  std::vector<double> depths;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ScanPoint& point = points_[i];
    const double says = std::abs(point.normal.dot(direction));
    const double better = kSpeaks * says * apart;
    if (says >= kSays && here[i] + better < there[i]) {
      for_match.push_back(point);
      depths.push_back(point.position.dot(direction));
      continue;
    }
    if (says >= kSays && there[i] + better < here[i]) {
      for_wheels.push_back(point);
    }
    rest.push_back(point);
  }
  const int wheels = CountApart(for_wheels);
  const bool many = wheels >= kLeastForWheels &&
                    wheels >= kShareForWheels * CountApart(for_match);
  return many || (wheels >= least && OneThing(std::move(depths)))
             ? rest
             : std::vector<ScanPoint>();
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
  if (agreement.Quality() >= here->Quality()) {
    *match = other;
    *here = agreement;
  }
}

MatchResult OdometryRefiner::MatchNearOdometry(const MatchPrior& prior,
                                               const Eigen::Vector2d& laser,
                                               double seen_through) const {
  const ScanMatcher& matcher = track_.matcher;
  MatchPrior held = prior;
  held.is_heavy_tailed = false;
  const MatchResult there = matcher.Refine(points_, prior.pose, held);
  const ScanAgreement agreement = matcher.Compare(points_, there.pose, laser);
  if (!Contradicts(agreement, seen_through)) return there;
  const Eigen::Vector3d sigmas =
      prior.information.inverse().diagonal().cwiseSqrt();
  const Pose2 found =
      matcher.Search(points_, prior.pose,
                     std::min(kNearSigmas * sigmas.head<2>().maxCoeff(),
                              options_.max_search_translation),
                     std::min(kNearSigmas * sigmas[2], kPi), nullptr);
  const MatchResult searched = matcher.Refine(points_, found, held);
  return matcher.Compare(points_, searched.pose, laser).Quality() >
                 agreement.Quality()
             ? searched
             : there;
}

bool OdometryRefiner::LooksAlikeNear(const MatchPrior& prior,
                                     const MatchResult& match,
                                     const Eigen::Vector2d& laser) const {
  const ScanMatcher& matcher = track_.matcher;
  MatchPrior held = prior;
  held.is_heavy_tailed = false;
  const auto quality_at = [&](const Pose2& pose) {
    return matcher.Compare(points_, pose, laser).Quality();
  };
  const auto is_elsewhere = [&](const Pose2& pose) {
    return (pose - match.pose).head<2>().norm() >= kLeastAlike;
  };
  const double alike = kAlikeShare * quality_at(match.pose);
  const Eigen::Matrix2d covariance =
      prior.information.inverse().topLeftCorner<2, 2>();
  const Eigen::Matrix2d within = covariance.inverse();
  const double farthest =
      std::min(kAlikeSigmas * std::sqrt(covariance.diagonal().maxCoeff()),
               options_.max_search_translation);
  const int steps = static_cast<int>(farthest / kAlikeStep);
  for (int i = -steps; i <= steps; ++i) {
    for (int k = -steps; k <= steps; ++k) {
      Pose2 there = prior.pose;
      there.head<2>() += kAlikeStep * Eigen::Vector2d(i, k);
      there[2] = match.pose[2];
      const Eigen::Vector2d left = there.head<2>() - prior.pose.head<2>();
      if (left.dot(within * left) > Square(kAlikeSigmas) ||
          !is_elsewhere(there) || quality_at(there) < kAlikeToTry * alike) {
        continue;
      }
      const MatchResult refined = matcher.Refine(points_, there, held);
      if (is_elsewhere(refined.pose) && quality_at(refined.pose) >= alike) {
        return true;
      }
    }
  }
  return false;
}

bool OdometryRefiner::StayWhereAlike(const MatchPrior& prior,
                                     const Eigen::Vector2d& laser,
                                     double seen_through,
                                     MatchResult* match) const {
  const Eigen::Vector2d way = (match->pose - prior.pose).head<2>();
  if (SquaredInnovation(*match, prior) <= Square(kOffAlike) ||
      way.norm() < kLeastAlike) {
    return true;
  }
  const ScanMatcher& matcher = track_.matcher;
  const Eigen::Vector3d along(way[0] / way.norm(), way[1] / way.norm(), 0.0);
  MatchPrior held = prior;
  held.is_heavy_tailed = false;
  held.information += along * along.transpose() / Square(kHeldWhereAlike);
  MatchResult there = matcher.Refine(points_, prior.pose, held);
  const ScanAgreement agreement = matcher.Compare(points_, there.pose, laser);
  const bool fits = !Contradicts(agreement, seen_through);
  const bool fits_as_well =
      fits && agreement.hits >= options_.tracking.min_hits &&
      agreement.KnownShare() >= kKnownWhereAlike &&
      agreement.Support() >=
          matcher.Compare(points_, match->pose, laser).Support() - kAsWell;
  if (!fits_as_well && !LooksAlikeNear(prior, *match, laser)) return true;
  if (trace_) trace_(fits ? "alike: where odometry leads" : "alike: nowhere");
  if (!fits) return false;
  const Eigen::Matrix3d aside =
      Eigen::Matrix3d::Identity() - along * along.transpose();
  there.information = (aside * there.information * aside).eval();
  *match = there;
  return true;
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
          agreement.SeenThroughShare() > through + seen_through);
}

double OdometryRefiner::RoomSinceMatch(const MatchPrior& prior,
                                       const Pose2& motion) const {
  if (track_.refused == 0) return 0.0;
  const double usual = OdometryCovariance(motion, options_.noise).determinant();
  return std::max(0.0, -std::log(usual * prior.information.determinant()));
}

bool OdometryRefiner::StandsUpTo(const Scan& scan, const MatchPrior& prior,
                                 double innovation, double room,
                                 MatchResult* match, Outcome* outcome) const {
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
  // Few returns fit in many places: they may leave odometry by little, and by
  // less the more places odometry leaves open. On a way over a gap in the log
  // it leaves too many open for that, and may be off by less than a look-alike.
  const bool is_far =
      track_.after_gap && IsFar(Between(track_.last_pose, prior.pose));
  const auto agrees_with_odometry = [&] {
    const bool has_many = here.hits >= tracking.min_hits;
    if (is_far &&
        (!has_many ||
         std::abs(NormalizeAngle(match->pose[2] - prior.pose[2])) >
             MostWrongTurn(last_motion_.head<2>().norm(), last_motion_[2]))) {
      return false;
    }
    return has_many ? innovation <= tracking.max_innovation
                    : innovation + room <= tracking.max_innovation * here.hits /
                                               tracking.min_hits;
  };
  bool agrees = agrees_with_odometry();
  // What contradicted the scan before already is no news.
  const double before =
      track_.after_gap
          ? track_.matcher.Compare(track_.last_points, track_.last_pose, laser)
                .SeenThroughShare()
          : 0.0;
  // Where odometry went on over a gap the robot lies ahead, where little was
  // seen as yet, and places behind it that look alike are known all around: it
  // is where odometry leads, or lost.
  const bool goes_on = track_.after_gap && !track_.jumped &&
                       GoesOn(track_.matched_odometry, last_odometry_);
  if (!agrees && goes_on) {
    *match = MatchNearOdometry(prior, laser, before);
    here = track_.matcher.Compare(points_, match->pose, laser);
    innovation = SquaredInnovation(*match, prior);
    agrees = agrees_with_odometry();
  }
  const double ratio = here.OfKnown(match->inlier_ratio);
  // After a gap a match must be better, and so must one that leaves odometry.
  double least = options_.minimum_inlier_ratio;
  if (!agrees || track_.after_gap) least = tracking.min_ratio_after_gap;
  if (!agrees && track_.after_gap) least = options_.good_inlier_ratio;
  bool believed =
      ratio >= least && match->inliers >= options_.minimum_points &&
      (agrees || here.hits >= tracking.min_hits) &&
      (agrees || !track_.after_gap ||
       (!goes_on && here.Support() >= tracking.min_unexpected_support &&
        here.KnownShare() >= kLeastKnown)) &&
      !((track_.after_gap || !agrees) && Contradicts(here, before));
  if (believed && goes_on) {
    believed = StayWhereAlike(prior, laser, before, match);
  }
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
                  "%s gap %d ratio %.2f/%.2f n %d chi %.1f room %.1f hits %d "
                  "intr %d "
                  "unk %d seen %d thr %d before %.2f refused %d",
                  believed               ? "believed"
                  : outcome->why.empty() ? "odometry"
                                         : "contra",
                  static_cast<int>(track_.after_gap), match->inlier_ratio,
                  ratio, match->inliers, innovation, room, here.hits,
                  here.intruders, here.unknown, here.seen, here.seen_through,
                  before, track_.refused);
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
  const Pose2 motion = options_.match_scans
                           ? odometry_calibration_.Corrected(by_wheels)
                           : by_wheels;
  UncertainPose2 step = {motion, OdometryCovariance(motion, options_.noise)};
  if (still_ > 0 && IsLate(motion)) {
    // Odometry that has only been late catches up with all of the way at once.
    step.mean = Between(track_.last_pose, Compose(still_pose_, motion));
  } else if (ahead_.exists && !is_dead_) {
    // While odometry stood still nothing in sight told whether the robot did.
    const Pose2 perhaps = Between(track_.last_pose, ahead_.pose);
    step.covariance += perhaps * perhaps.transpose();
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
                              MatchPrior* prior, MatchResult* match,
                              bool* returns_lead) {
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
    ahead_ = {true, track_.last_pose, track_.since_key, steady_.Step(), 0.0};
  }
  ahead_.since_key = Compose(ahead_.since_key, ahead_.step);
  MatchPrior moving;
  moving.pose = Compose(ahead_.pose, ahead_.step.mean);
  moving.information = ahead_.step.covariance.inverse();
  const MatchResult other = track_.matcher.Refine(points_, moving.pose, moving);
  ahead_.pose = other.pose;
  const Pose2 apart = Between(match->pose, other.pose);
  const double clearly = (match->cost - other.cost) * CountApart(points_);
  // A slow robot has not gone far: returns lead both to one place where they
  // are much nearer to each other than what it would have gone by then.
  const double gone = still_ * ahead_.step.mean.head<2>().norm();
  const double near = leapt ? options_.clutter_distance
                            : std::min(options_.clutter_distance,
                                       std::max(kStandsWay, kNearShare * gone));
  const bool same = apart.head<2>().norm() <= near &&
                    std::abs(apart[2]) <= options_.clutter_rotation;
  *returns_lead = same && !leapt;
  // What each scan says is little where little shows how far the robot went.
  ahead_.evidence += clearly;
  // No robot leaps: what the returns do not speak against holds.
  const bool moves = (leapt || !same) &&
                     other.inlier_ratio >= options_.minimum_inlier_ratio &&
                     (clearly > (leapt ? -kClearly : kClearly) ||
                      (clearly > 0.0 && ahead_.evidence > kClearlyInAll));
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
  if (is_dead_) steady_.GoOn(ahead_.step.mean);
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
  GoByWheels(motion, leapt, &prior);
  MatchResult match = MatchPoints(points_, prior, motion);
  const Pose2 by_odometry = result.pose;
  bool returns_lead = false;
  const bool moves_on =
      MovesOn(leapt, &result.since_key, &prior, &match, &returns_lead);
  outcome.has_gone_on = moves_on && is_dead_;
  if (moves_on) {
    track_.wheels.Reset();
    result.pose = prior.pose;
    motion = Between(track_.last_pose, result.pose);
  }
  if (moves_on || is_dead_) odometry_calibration_.Break();
  // What may move is not what stands: where it speaks for another pose than the
  // rest, the rest counts.
  if (track_.moving > 0) --track_.moving;
  if (track_.moving > 0 || match.inlier_ratio < options_.good_inlier_ratio ||
      SquaredInnovation(match, prior) > options_.clutter_innovation) {
    MatchWithoutClutter(scan, prior, motion, &match);
  }
  if (HaveWheelsBeenSteady() || HaveWheelsGoneOn()) {
    MatchAsWheelsSay(scan, prior, &match);
  }
  if (!moves_on && !returns_lead && !is_dead_ && !leapt && !track_.jumped &&
      !track_.after_gap && track_.refused == 0) {
    StayUnlessClear(prior, motion, scan.laser_offset.head<2>(), &match);
  }
  bool believed = match.inlier_ratio >= options_.good_inlier_ratio;
  const double innovation = SquaredInnovation(match, prior);
  // Few returns fit in many places.
  const bool sees_little = 2 * points_.size() < scan.ranges.size();
  if (!believed || track_.after_gap ||
      (sees_little &&
       (track_.refused > 0 || innovation > options_.tracking.max_innovation))) {
    believed = StandsUpTo(scan, prior, innovation,
                          RoomSinceMatch(prior, motion), &match, &outcome);
  }
  believed = believed && !Leaps(match.pose, motion);
  if (!believed && moves_on && leapt) return Match(scan, step, false);
  if (!believed) {
    track_.wheels.Reset();
    ++refusals_;
    return outcome;
  }
  track_.wheels.Follow(match.pose.head<2>(), match.information);
  outcome.verdict = Outcome::Verdict::kBelieved;
  if (track_.refused > 0 || outcome.has_gone_on) {
    result.missed = Between(by_odometry, match.pose);
    // The last scan before this one that was refused, or where odometry stood.
    result.missed_since = count_ - 1 - std::max(track_.refused + 1, still_);
  }
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
  result.since_key.covariance +=
      DriftCovariance(result.since_key.mean, options_.drift);
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
  search_.set_matcher(options_.matcher);
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
    // Nor is what odometry leapt over.
    if (track_.refused > 0 || track_.jumped ||
        (track_.after_gap && !steady_.Explains(moved))) {
      steady_.Break();
    } else if (!outcome.has_gone_on) {
      steady_.Add(moved);
    }
    track_.way = 0.0;
    track_.turn = 0.0;
    track_.refused = 0;
    track_.seconds = 0.0;
    track_.after_gap = false;
    track_.jumped = false;
    track_.matched_pose = outcome.refined.pose;
    track_.matched_odometry = last_odometry_;
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

Pose2 OdometryRefiner::Lose(int scan, const Outcome& outcome) {
  const TrackingOptions& tracking = options_.tracking;
  if (trace_) trace_("LOST " + outcome.why);
  const double blind_way = track_.way;
  const double blind_turn = track_.turn;
  const double blind_seconds = track_.seconds;
  const bool jumped = track_.jumped;
  const bool contradicted = IsContradicted(outcome);
  const bool tiny =
      open_ != nullptr &&
      static_cast<int>(open_->keys.size()) < tracking.min_tie_keys &&
      pending_.size() < kMostPending;
  const Pose2 last_pose = track_.last_pose;
  if (open_ != nullptr && !tiny) Tie(true);
  const Pose2 shift = Compose(track_.last_pose, Inverse(last_pose));
  ++losses_;
  bool goes_on = false;
  if (open_ == nullptr) {
    // The scans that were refused are settled already.
    open_ = std::make_unique<OpenTie>(std::move(track_));
    open_->last_sure = scan - open_->before.refused;
    open_->why = outcome.why.empty()
                     ? "nothing that the robot saw could be matched"
                     : outcome.why;
    open_->way = blind_way;
    open_->turn = blind_turn;
    open_->seconds = blind_seconds;
    open_->is_late =
        open_->before.after_gap &&
        Stands(Between(open_->before.matched_odometry, last_odometry_));
    // Where it is off on a long way what is seen contradicts, too.
    goes_on = open_->before.after_gap &&
              GoesOn(open_->before.matched_odometry, last_odometry_);
  } else {
    // What has been tracked since is too little to be a track.
    for (SettledScan& pending : pending_) {
      pending.refined.is_key = false;
      pending.refined.odometry_only = true;
      pending.refined.tie = TrackTie::kNone;
      pending.refined.missed = Pose2::Zero();
      pending.refined.missed_since = -1;
      pending.refined.since_key = UncertainPose2();
      pending.refined.since_key.mean =
          Between(open_->before.keys.back().pose, pending.refined.pose);
      pending.points.clear();
    }
    open_->keys.clear();
  }
  open_->seen_through = outcome.seen_through;
  open_->odometry_holds =
      open_->odometry_holds && (!contradicted || goes_on) && !jumped;
  open_->first = scan;
  open_->blind_way = open_->way;
  open_->blind_turn = open_->turn;
  open_->blind_seconds = open_->seconds;
  open_->next_attempt = tracking.min_tie_keys;
  open_->next_global = tracking.first_global_keys;
  track_ = Track(options_.matcher);
  return shift;
}

void OdometryRefiner::CatchUp(const Scan& scan, const Pose2& by_wheels,
                              const Pose2& matched, SettledScan* now) {
  if (++open_->late_scans > kMostLate) open_->is_late = false;
  if (!open_->is_late || Stands(by_wheels)) return;
  open_->is_late = false;
  // What the scans have seen of this motion was not on the way over the gap.
  const Pose2 seen = now->refined.odometry_only ? Pose2::Zero() : matched;
  const Pose2 unseen = by_wheels - seen;
  if (unseen.head<2>().norm() <= kJumpWay &&
      std::abs(NormalizeAngle(unseen[2])) <= kJumpTurn) {
    return;
  }
  const Track& before = open_->before;
  const Pose2 way = odometry_calibration_.Corrected(
      Between(before.matched_odometry, scan.odometry));
  const double length = way.head<2>().norm();
  const double turn = std::abs(way[2]);
  // What a robot cannot do in that time is a jump of odometry's.
  if (length > kJumpWay + kFastest * open_->seconds ||
      turn > kJumpTurn + kFastestTurn * open_->seconds) {
    return;
  }
  open_->has_caught_up = true;
  open_->odometry_holds = true;
  open_->blind_way = length;
  open_->blind_turn = turn;
  const Pose2 shift =
      Compose(Compose(before.matched_pose, way), Inverse(now->refined.pose));
  if (trace_) trace_("CAUGHT UP");
  for (SettledScan& pending : pending_) {
    pending.refined.pose = Compose(shift, pending.refined.pose);
  }
  now->refined.pose = Compose(shift, now->refined.pose);
  for (TrackKey& key : open_->keys) key.pose = Compose(shift, key.pose);
  MoveTrack(shift);
  RebuildReference(&track_);
}

void OdometryRefiner::MoveTrack(const Pose2& shift) {
  for (TrackKey& key : track_.keys) key.pose = Compose(shift, key.pose);
  track_.wheels.MoveBy(shift);
  for (Pose2* pose :
       {&track_.last_pose, &track_.matched_pose, &still_pose_, &ahead_.pose}) {
    *pose = Compose(shift, *pose);
  }
}

void OdometryRefiner::BeginTrack(const Scan& scan, SettledScan* first) {
  RefinedScan& refined = first->refined;
  refined.is_key = true;
  first->points = points_;
  track_.last_pose = refined.pose;
  track_.matched_pose = refined.pose;
  track_.matched_odometry = scan.odometry;
  track_.last_points = points_;
  key_odometry_ = scan.odometry;
  scans_since_key_ = 0;
  ahead_.exists = false;
  odometry_calibration_.Break();
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
  CompareOdometry(scan, *next, information);
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
  return Process(scan, [&](double, std::vector<ScanPoint>* points) {
    ExtractScanPoints(scan, options_.points, points);
  });
}

RefinedScan OdometryRefiner::Process(const Scan& scan,
                                     const ReturnsOf& returns_of) {
  AllowForNoise(scan);
  returns_of(noise_scale_, &points_);
  SettledScan done;
  done.index = count_++;
  const Pose2 by_wheels =
      started_ ? Between(last_odometry_, scan.odometry) : Pose2::Zero();
  const UncertainPose2 step = started_ ? StepOf(by_wheels) : UncertainPose2();
  const Pose2& motion = step.mean;
  const double seconds = started_ ? scan.timestamp - last_time_ : 0.0;
  last_odometry_ = scan.odometry;
  last_step_ = by_wheels.head<2>().norm();
  last_time_ = scan.timestamp;
  if (!started_) {
    started_ = true;
    done.refined.pose = scan.odometry;
    BeginTrack(scan, &done);
    search_.Add(track_.keys.back(), part_);
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
  NoteWheels(leapt);
  const Outcome outcome = Match(scan, step, leapt);
  NoteMatch(outcome, motion);
  done.refined = outcome.refined;
  const bool is_lost = IsLost(outcome);
  Pose2 last_pose = track_.last_pose;
  if (is_lost) {
    const Pose2 shift = Lose(done.index, outcome);
    last_pose = Compose(shift, last_pose);
    done.refined.pose = Compose(shift, done.refined.pose);
    BeginTrack(scan, &done);
  } else {
    ContinueTrack(scan, outcome.information, &done);
  }
  if (open_ != nullptr && open_->is_late) {
    CatchUp(scan, by_wheels, Between(last_pose, done.refined.pose), &done);
  }
  if (open_ == nullptr) {
    if (done.refined.is_key) search_.Add(track_.keys.back(), part_);
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

void OdometryRefiner::Tie(bool last) {
  const TrackingOptions& tracking = options_.tracking;
  const int count = static_cast<int>(open_->keys.size());
  // In steps that grow.
  open_->next_attempt = count + std::max(1, count / 3);
  if (trace_) trace_("TIE attempt keys " + std::to_string(count));
  RefinedScan first;
  FoundTrack found;
  const TrackKey& start = open_->keys.front();
  std::size_t middle = 0;
  if (count >= tracking.min_tie_keys) {
    const std::size_t end =
        std::min<std::size_t>(open_->keys.size(), kLocalKeys);
    middle = end / 2;
    const double window =
        std::min(tracking.max_local_search,
                 0.5 + 0.5 * open_->way + tracking.gap_speed * open_->seconds);
    if (search_.FindHere(open_->keys, open_->before.matcher,
                         open_->keys[middle].pose, window, 0, end,
                         open_->seen_through, &found)) {
      const bool is_expected =
          AgreesWithOdometry(found, middle, search_.seen().size() - 1);
      // Where the robot was carried the right place need not be among those
      // that were searched, and the next door looks like this one.
      if (is_expected) first.tie = TrackTie::kMatched;
    }
  }
  if (first.tie == TrackTie::kNone && count >= tracking.first_global_keys &&
      (last || count >= open_->next_global)) {
    open_->next_global = 2 * count;
    const std::size_t end = open_->keys.size();
    const std::size_t begin = end > kGlobalKeys ? end - kGlobalKeys : 0;
    middle = (begin + end) / 2;
    std::size_t since = 0;
    if (FindWhereOdometryLeads(begin, end, &found, &since) ||
        FindInAll(begin, end, &found, &since)) {
      const SeenKey& key = search_.seen()[since];
      first.tie = TrackTie::kMatched;
      first.since = key.scan;
      first.since_key.mean = key.pose;
      part_ = key.part;
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
    first.since_key = Compose(tie, DriftAlong(back, options_.drift));
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
      first.since_key.covariance = LooseCovariance();
      if (open_->odometry_holds) {
        blind_ways_.push_back(
            {open_->before.keys.back().scan, start.scan, BlindMotion(),
             MostWrongTurn(open_->blind_way, open_->blind_turn)});
      }
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
                                      const SettledScan& settled,
                                      const Eigen::Matrix3d& information) {
  const RefinedScan& refined = settled.refined;
  const Pose2 by_wheels = Between(key_odometry_, scan.odometry);
  key_odometry_ = scan.odometry;
  scans_since_key_ = 0;
  if (refined.odometry_only || track_.keys.empty()) return;
  const Pose2 motion = odometry_calibration_.Corrected(by_wheels);
  const Eigen::Matrix3d covariance =
      OdometryCovariance(by_wheels, options_.noise);
  MetreUse use;
  use.scan = settled.index;
  use.way = by_wheels.head<2>().norm();
  use.used = odometry_calibration_.scale();
  odometry_calibration_.Compare(by_wheels, covariance, refined.since_key.mean,
                                information, last_step_);
  use.learnt = odometry_calibration_.scale();
  use.variance = odometry_calibration_.scale_variance();
  use.added_variance = OdometryCalibration::AddedVariance(use.way);
  // The match is the mean of odometry and of what the returns say.
  const Eigen::Matrix3d of_wheels = covariance.inverse();
  use.change = (information + of_wheels).inverse() * of_wheels *
               Eigen::Vector3d(by_wheels[0], by_wheels[1], 0.0);
  metre_uses_.push_back(use);
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

Eigen::Matrix3d OdometryRefiner::BlindCovariance() const {
  return OdometryVarianceScale() *
         OdometryCovariance({open_->blind_way, 0.0, open_->blind_turn},
                            options_.noise);
}

double OdometryRefiner::BlindVarianceAside() const {
  return open_->blind_way * open_->blind_way * BlindCovariance()(2, 2) / 4.0;
}

UncertainPose2 OdometryRefiner::BlindMotion() const {
  Eigen::Matrix3d covariance = BlindCovariance();
  covariance.topLeftCorner<2, 2>().diagonal().array() += BlindVarianceAside();
  return {Between(open_->before.keys.back().pose, open_->keys.front().pose),
          covariance};
}

Eigen::Matrix3d OdometryRefiner::LooseCovariance() const {
  const Eigen::Matrix3d loose = Diagonal(kLooseSigma, kLooseAngle);
  if (!open_->odometry_holds) return loose;
  const Eigen::Matrix3d own = BlindCovariance();
  // On a straight way the heading leads aside only.
  const Eigen::Vector2d way = BlindMotion().mean.head<2>();
  const double straight =
      std::min(1.0, way.norm() / std::max(open_->blind_way, kStandsWay));
  const double aside = BlindVarianceAside();
  const Eigen::Vector3d variances(
      own(0, 0) + (1.0 - straight * straight) * aside, own(1, 1) + aside,
      own(2, 2));
  const Eigen::Matrix3d across_and_along =
      variances.cwiseMin(loose.diagonal()).asDiagonal();
  const Eigen::Matrix3d rotation =
      RotationInto(Pose2(0.0, 0.0, -std::atan2(way.y(), way.x())));
  return rotation * across_and_along * rotation.transpose();
}

bool OdometryRefiner::IsInReach(const FoundTrack& found, std::size_t middle,
                                std::size_t since) const {
  // Scans without times may be of any time, and a guess lies between.
  if (open_->blind_seconds <= 0.0 ||
      search_.seen()[since].part != search_.seen().back().part) {
    return true;
  }
  const Pose2 first = Compose(
      found.pose, Between(open_->keys[middle].pose, open_->keys.front().pose));
  return Between(open_->before.matched_pose, first).head<2>().norm() <=
         kJumpWay + kFastest * open_->blind_seconds;
}

double OdometryRefiner::AgainstOdometry(const FoundTrack& found,
                                        std::size_t middle,
                                        std::size_t since) const {
  // What neighbouring matches have in common adds up faster than a random walk.
  const auto generous = [this](const std::vector<Pose2>& poses) {
    UncertainPose2 way = DriftAlong(poses, options_.drift);
    way.covariance *= kGenerous;
    return way;
  };
  UncertainPose2 predicted;
  std::vector<Pose2> piece;
  for (std::size_t k = since; k < search_.seen().size(); ++k) {
    const SeenKey& key = search_.seen()[k];
    if (!piece.empty() && key.part != search_.seen()[k - 1].part) {
      const auto way = std::find_if(
          blind_ways_.rbegin(), blind_ways_.rend(),
          [&key](const BlindWay& one) { return one.to == key.scan; });
      // A guess lies between of which nothing tells.
      if (way == blind_ways_.rend()) return 0.0;
      predicted = Compose(Compose(predicted, generous(piece)), way->motion);
      piece.clear();
    }
    piece.push_back(key.pose);
  }
  std::vector<Pose2> after;
  for (std::size_t k = 0; k <= middle; ++k) {
    after.push_back(open_->keys[k].pose);
  }
  predicted =
      Compose(Compose(Compose(predicted, generous(piece)), BlindMotion()),
              generous(after));
  const Pose2 from = search_.seen()[since].pose;
  Pose2 left = Between(from, found.pose) - predicted.mean;
  left[2] = NormalizeAngle(left[2]);
  const Eigen::Matrix3d covariance =
      predicted.covariance + Diagonal(kTieSigma, kTieAngle);
  const double innovation = left.dot(covariance.inverse() * left);
  if (trace_) trace_("odometry against it " + std::to_string(innovation));
  return std::abs(left[2]) <= MostWrongTurn(open_->blind_way, open_->blind_turn)
             ? innovation
             : std::numeric_limits<double>::infinity();
}

bool OdometryRefiner::AgreesWithOdometry(const FoundTrack& found,
                                         std::size_t middle,
                                         std::size_t since) const {
  return AgainstOdometry(found, middle, since) <=
         options_.tracking.max_innovation;
}

bool OdometryRefiner::FindWhereOdometryLeads(std::size_t begin, std::size_t end,
                                             FoundTrack* found,
                                             std::size_t* since) const {
  if (!open_->odometry_holds) return false;
  const std::size_t middle = (begin + end) / 2;
  const Pose2& there = open_->keys[middle].pose;
  const std::vector<std::size_t> where =
      search_.KeysAround(there, kOdometryReach);
  if (where.size() < TrackSearch::kShortestVisit) return false;
  TrackSearch::SearchArea area = search_.AreaOf(where);
  area.center = there;
  area.window = kOdometryReach;
  std::vector<FoundTrack> hypotheses;
  for (FoundTrack& one : search_.FindAll(open_->keys, area, begin, end,
                                         open_->seen_through, nullptr)) {
    const std::size_t nearest = search_.NearestOf(one, where);
    if (!IsInReach(one, middle, nearest)) continue;
    const double against = AgainstOdometry(one, middle, nearest);
    if (against > options_.tracking.max_innovation) continue;
    // As likely as odometry has it there, so is it a rival.
    one.quality *= std::exp(-0.5 * against);
    hypotheses.push_back(one);
  }
  if (!search_.IsClear(hypotheses, found)) return false;
  *since = search_.NearestOf(*found, where);
  return true;
}

bool OdometryRefiner::FindInAll(std::size_t begin, std::size_t end,
                                FoundTrack* found, std::size_t* since) const {
  std::vector<std::size_t> where(search_.seen().size());
  std::iota(where.begin(), where.end(), std::size_t{0});
  if (!search_.FindAnywhere(open_->keys, search_.AreaOf(where), begin, end,
                            open_->seen_through, nullptr, found)) {
    return false;
  }
  const std::size_t middle = (begin + end) / 2;
  *since = search_.NearestOf(*found, where);
  return IsInReach(*found, middle, *since) &&
         (!open_->odometry_holds || AgreesWithOdometry(*found, middle, *since));
}

void OdometryRefiner::Settle(const Pose2& shift, const RefinedScan& first) {
  // Found again near by: the robot moved as it did before.
  const bool has_missed = first.tie == TrackTie::kMatched && first.since < 0 &&
                          !open_->before.after_gap;
  for (SettledScan& done : pending_) {
    if (done.index == open_->first) {
      if (has_missed) {
        const Pose2& predicted = done.refined.pose;
        done.refined.missed = Between(predicted, Compose(shift, predicted));
        done.refined.missed_since = open_->last_sure;
      }
      done.refined.tie = first.tie;
      done.refined.since = first.since;
      done.refined.since_key = first.since_key;
    }
    if (done.index >= open_->first) {
      done.refined.pose = Compose(shift, done.refined.pose);
    }
    settled_.push_back(std::move(done));
  }
  pending_.clear();
  const bool goes_on = first.tie != TrackTie::kLoose && first.since < 0;
  const bool is_by_late_odometry =
      first.tie == TrackTie::kOdometry && open_->has_caught_up;
  if (!goes_on || is_by_late_odometry ||
      open_->blind_way > options_.tracking.max_silent_way) {
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
    } else if (first.since >= 0) {
      found_ties_.push_back(
          {open_->first, first.since, static_cast<int>(loose_.size())});
    }
    loose_.push_back(std::move(part));
  }
  for (TrackKey& key : open_->keys) {
    key.pose = Compose(shift, key.pose);
    search_.Add(key, part_);
  }
  MoveTrack(shift);
  // What was seen before goes on being the reference.
  if (first.tie == TrackTie::kMatched && first.since < 0) {
    std::deque<TrackKey>& before = open_->before.keys;
    while (static_cast<int>(track_.keys.size()) < options_.window &&
           !before.empty()) {
      track_.keys.push_front(std::move(before.back()));
      before.pop_back();
    }
  }
  RebuildReference(&track_);
  open_.reset();
}

bool OdometryRefiner::TakeSettled(SettledScan* settled) {
  if (settled_.empty()) return false;
  *settled = std::move(settled_.front());
  settled_.pop_front();
  return true;
}

void OdometryRefiner::Finish(const std::function<bool()>& stop) {
  search_.set_stop(stop);
  if (open_ != nullptr) Tie(true);
  if (guessed_ >= 0) loose_[guessed_].end = count_ - 1;
  guessed_ = -1;
  const std::vector<GuessedTurn> turns = FindGuessedTurns(
      search_.seen(), loose_of_, blind_ways_, options_.guessed_turns);
  late_ties_ = JoinParts(options_.tracking, options_.drift, loose_of_,
                         blind_ways_, &search_, &loose_);
  JoinDoubtfulParts();
  for (const GuessedTurn& turn : turns) {
    const bool is_tied =
        std::any_of(late_ties_.begin(), late_ties_.end(),
                    [&](const LateTie& tie) { return tie.scan == turn.scan; });
    search_.Trace("TURN of the guess at scan " + std::to_string(turn.scan) +
                  ": " + std::to_string(RadToDeg(turn.turn)) +
                  (is_tied ? " (tied)" : ""));
    if (!is_tied) guessed_turns_.push_back(turn);
  }
  search_.set_stop(nullptr);
  // No scan follows.
  search_.Clear();
}

void OdometryRefiner::JoinDoubtfulParts() {
  std::vector<FoundTie> ties = found_ties_;
  for (const LateTie& late : late_ties_) {
    ties.push_back({late.scan, late.since, late.loose});
  }
  const CutTies cut = CutDoubtfulTies(std::move(ties), &search_, &loose_of_);
  if (cut.doubts.empty()) return;
  std::map<int, LateTie> by_scan;
  for (const LateTie& late : late_ties_) by_scan[late.scan] = late;
  for (const LateTie& better :
       JoinParts(options_.tracking, options_.drift, loose_of_, blind_ways_,
                 &search_, &loose_, cut)) {
    by_scan[better.scan] = better;
  }
  late_ties_.clear();
  for (auto& [scan, late] : by_scan) late_ties_.push_back(std::move(late));
}

template <typename StateArchive>
void OdometryRefiner::ExchangeState(StateArchive& archive) {
  ExchangeAll(archive, track_, points_, started_, count_, last_odometry_,
              last_time_, usual_step_, search_.seen(), part_, num_parts_,
              loose_of_, blind_ways_, found_ties_, wide_searches_, refusals_,
              losses_, loose_, guessed_, noise_, noise_scale_, last_step_,
              key_odometry_, squared_innovations_, compared_motions_,
              odometry_calibration_, metre_uses_, steady_, still_, last_motion_,
              steady_wheels_, wheel_steps_, even_wheels_, since_steady_,
              scans_since_key_, still_pose_, is_dead_, ahead_);
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
