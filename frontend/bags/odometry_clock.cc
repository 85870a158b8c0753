#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/odometry_clock.h>
#include <plumbline/frontend/beam_directions.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

constexpr double kSecond = 1e9;  // in ns
// Between two scans that are compared, s. After less hardly anything has
// changed, after more the scans see other things.
constexpr double kLeastStep = 0.3;
constexpr double kMostStep = 3.0;
// Two clocks are told apart by pairs of scans between which the robot turned
// by so much more, rad, or went so much farther by one than by the other, m.
const double kTurn = DegToRad(3.0);
constexpr double kWay = 0.1;
// Pairs compared: those for which the clocks differ most.
constexpr std::size_t kMostPairs = 60;
// A return agrees with another scan within this and a share of its range, m.
constexpr double kAgreement = 0.1;
constexpr double kAgreementShare = 0.02;
// Fewer returns that both scans see say nothing.
constexpr int kFewestReturns = 20;
// By how much a larger share of returns has to agree for a vote; so many votes,
// and twice as many as against it, are believed.
constexpr double kMargin = 0.05;
constexpr int kFewestVotes = 5;
// The clock is looked for so far about the difference, s, in steps, then in
// finer ones.
constexpr double kSearchRadius = 2.5;
constexpr double kSearchStep = 0.1;
constexpr double kFineStep = 0.02;
// Where no delay speaks for it: so far about no difference, s, in such steps,
// by pairs that differ so far either way.
constexpr double kNearRadius = 0.5;
constexpr double kNearStep = 0.05;
constexpr double kNearReach = 0.2;
// A laser that sees less, rad, takes hardly any time to a scan.
const double kLeastSweep = DegToRad(200.0);
// Returns of a scan that the steps about the difference are compared by, at
// least; the finer ones, and what decides, take all.
constexpr std::size_t kCoarseReturns = 100;
// Scans farther from odometry than this, s, are out of its time.
constexpr double kFarOdometry = 1.0;

constexpr int kDirections = 360;

// A scan as ranges by direction, a degree each; 0 where nothing was seen.
class PolarView {
 public:
  explicit PolarView(const Scan& scan) {
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      if (!(scan.ranges[i] > 0.0f)) continue;
      float& range = ranges_[static_cast<std::size_t>(Cell(scan.Bearing(i)))];
      if (range == 0.0f || scan.ranges[i] < range) range = scan.ranges[i];
    }
  }

  enum class Answer { kUnseen, kAgrees, kDiffers };

  // What the scan says of a return there, in the frame of its laser.
  Answer Ask(double x, double y) const {
    const double range = std::sqrt(x * x + y * y);
    const double tolerance = kAgreement + kAgreementShare * range;
    const int cell = Cell(std::atan2(y, x));
    Answer answer = Answer::kUnseen;
    for (int d = -1; d <= 1; ++d) {
      const int at = (cell + d + kDirections) % kDirections;
      const auto seen =
          static_cast<double>(ranges_[static_cast<std::size_t>(at)]);
      if (seen == 0.0) continue;
      if (std::abs(seen - range) < tolerance) return Answer::kAgrees;
      answer = Answer::kDiffers;
    }
    return answer;
  }

 private:
  static int Cell(double angle) {
    // Of absurd odometry.
    if (!std::isfinite(angle)) return 0;
    const int cell = static_cast<int>(
        std::floor((NormalizeAngle(angle) + kPi) / (2.0 * kPi) * kDirections));
    return std::clamp(cell, 0, kDirections - 1);
  }

  std::array<float, kDirections> ranges_ = {};
};

class ClockSearch {
 public:
  ClockSearch(const LaserOptions& options, const std::vector<BagScan>& scans,
              const std::function<LaserPlacement(const BagScan&)>& mount_of,
              const BagMotion& motion)
      : options_(options),
        scans_(scans),
        mount_of_(mount_of),
        motion_(motion) {}

  ClockChoice Choose(std::int64_t difference) {
    // Of damaged stamps: times moved by more do not fit their type.
    if (difference > kMostTime || difference < -kMostTime) {
      return {OverlapsAsStamped() ? 0 : difference, false};
    }
    ChoosePairs(0, difference);
    const std::vector<double> as_stamped = SharesAt(0, Returns::kAll);
    if (Beats(as_stamped, SharesAt(difference, Returns::kAll))) {
      return {0, true};
    }
    const std::int64_t near =
        Best(difference, kSearchRadius, kSearchStep, Returns::kSome);
    if (Beats(SharesAt(near, Returns::kAll), as_stamped)) {
      return {Best(near, kSearchStep, kFineStep, Returns::kAll), true};
    }
    return {OverlapsAsStamped() ? 0 : difference, false};
  }

  ClockChoice ChooseNear() {
    if (!TellsWhenBeamsWereTaken()) return {};
    const auto reach = static_cast<std::int64_t>(kNearReach * kSecond);
    ChoosePairs(-reach, reach);
    const std::int64_t near = Best(0, kNearRadius, kNearStep, Returns::kSome);
    if (near == 0 ||
        !Beats(SharesAt(near, Returns::kAll), SharesAt(0, Returns::kAll))) {
      return {};
    }
    return {Best(near, kNearStep, kFineStep, Returns::kAll), true};
  }

 private:
  struct Pair {
    std::size_t first = 0;
    std::size_t second = 0;
    // By how much the two clocks differ about it.
    double weight = 0.0;
  };

  Pose2 MotionBetween(std::size_t a, std::size_t b,
                      std::int64_t difference) const {
    return Between(motion_.At(scans_[a].stamp - difference),
                   motion_.At(scans_[b].stamp - difference));
  }

  // Those between which the robot moved otherwise by one difference than by
  // another.
  void ChoosePairs(std::int64_t one, std::int64_t other) {
    std::size_t j = 0;
    for (std::size_t i = 0; i + 1 < scans_.size(); ++i) {
      j = std::max(j, i + 1);
      while (j + 1 < scans_.size() && StepOf(i, j) < kLeastStep) ++j;
      const double step = StepOf(i, j);
      if (step < kLeastStep || step > kMostStep) continue;
      const Pose2 apart =
          Between(MotionBetween(i, j, one), MotionBetween(i, j, other));
      const double turn = std::abs(NormalizeAngle(apart[2]));
      const double way = std::hypot(apart[0], apart[1]);
      if (turn < kTurn && way < kWay) continue;
      pairs_.push_back({i, j, turn / kTurn + way / kWay});
    }
    const std::size_t count = std::min(pairs_.size(), kMostPairs);
    std::partial_sort(
        pairs_.begin(), pairs_.begin() + static_cast<std::ptrdiff_t>(count),
        pairs_.end(), [](const Pair& a, const Pair& b) {
          return std::pair(-a.weight, a.first) < std::pair(-b.weight, b.first);
        });
    pairs_.resize(count);
  }

  double StepOf(std::size_t a, std::size_t b) const {
    return static_cast<double>(scans_[b].stamp - scans_[a].stamp) / kSecond;
  }

  enum class Returns { kAll, kSome };

  // Of each pair, the share of returns that lie on what the other scan saw;
  // negative where there are too few.
  std::vector<double> SharesAt(std::int64_t difference, Returns returns) const {
    BagMotion motion = motion_;
    motion.MoveBy(difference);
    ScanMaker maker(options_, &motion, scans_);
    SkipCounter skips;
    BeamDirections directions;
    std::vector<double> shares;
    for (const Pair& pair : pairs_) {
      const BagScan& a = scans_[pair.first];
      const BagScan& b = scans_[pair.second];
      shares.push_back(ShareOf(maker.Make(a, mount_of_(a), &skips),
                               maker.Make(b, mount_of_(b), &skips), returns,
                               &directions));
    }
    return shares;
  }

  static double ShareOf(const Scan& a, const Scan& b, Returns returns,
                        BeamDirections* directions) {
    const Pose2 between = Between(Compose(a.odometry, a.laser_offset),
                                  Compose(b.odometry, b.laser_offset));
    const PolarView view(a);
    const PoseTransform transform(between);
    const std::vector<Eigen::Vector2d>& beams = directions->Of(b);
    const std::size_t step =
        returns == Returns::kAll
            ? 1
            : std::max<std::size_t>(1, b.ranges.size() / kCoarseReturns);
    int agree = 0;
    int seen = 0;
    for (std::size_t i = 0; i < b.ranges.size(); i += step) {
      if (!(b.ranges[i] > 0.0f)) continue;
      const Eigen::Vector2d point =
          transform.Point(static_cast<double>(b.ranges[i]) * beams[i]);
      const PolarView::Answer answer = view.Ask(point.x(), point.y());
      if (answer == PolarView::Answer::kUnseen) continue;
      ++seen;
      if (answer == PolarView::Answer::kAgrees) ++agree;
    }
    return static_cast<int>(step) * seen < kFewestReturns
               ? -1.0
               : static_cast<double>(agree) / seen;
  }

  static bool Beats(const std::vector<double>& one,
                    const std::vector<double>& other) {
    int votes = 0;
    int against = 0;
    for (std::size_t i = 0; i < one.size(); ++i) {
      if (one[i] < 0.0 || other[i] < 0.0) continue;
      if (one[i] > other[i] + kMargin) ++votes;
      if (other[i] > one[i] + kMargin) ++against;
    }
    return votes >= kFewestVotes && votes > 2 * against;
  }

  // The best of the differences about a middle: that itself unless others are
  // better, and the first one of those that are as good.
  std::int64_t Best(std::int64_t middle, double radius, double step,
                    Returns returns) const {
    const int steps = static_cast<int>(std::lround(radius / step));
    std::vector<std::int64_t> differences = {middle};
    for (int k = -steps; k <= steps; ++k) {
      if (k == 0) continue;
      differences.push_back(
          middle + static_cast<std::int64_t>(std::llround(k * step * kSecond)));
    }
    std::vector<double> sums(differences.size());
    ParallelFor(differences.size(), ThreadsHere(), [&](std::size_t k) {
      sums[k] = SumOf(SharesAt(differences[k], returns));
    });
    return differences[static_cast<std::size_t>(
        std::max_element(sums.begin(), sums.end()) - sums.begin())];
  }

  static double SumOf(const std::vector<double>& shares) {
    double sum = 0.0;
    for (const double share : shares) sum += std::max(share, 0.0);
    return sum;
  }

  // Of most scans. Others may be sweeps stamped at one of their ends, which is
  // as if clocks differed, and are looked at later.
  bool TellsWhenBeamsWereTaken() const {
    const ScanMaker maker(options_, &motion_, scans_);
    const auto telling =
        std::count_if(scans_.begin(), scans_.end(), [&](const BagScan& scan) {
          const LaserScanMessage& message = scan.message;
          return maker.IsSweepBelieved(message) ||
                 std::abs(message.angle_increment) *
                         static_cast<double>(message.ranges.size()) <
                     kLeastSweep;
        });
    return 2 * static_cast<std::size_t>(telling) > scans_.size();
  }

  bool OverlapsAsStamped() const {
    const auto within = std::count_if(
        scans_.begin(), scans_.end(), [this](const BagScan& scan) {
          return static_cast<double>(motion_.DistanceTo(scan.stamp)) <=
                 kFarOdometry * kSecond;
        });
    return 2 * static_cast<std::size_t>(within) >= scans_.size();
  }

  const LaserOptions& options_;
  const std::vector<BagScan>& scans_;
  const std::function<LaserPlacement(const BagScan&)>& mount_of_;
  const BagMotion& motion_;
  std::vector<Pair> pairs_;
};

}  // namespace

ClockChoice ChooseClock(
    const LaserOptions& options, const std::vector<BagScan>& scans,
    const std::function<LaserPlacement(const BagScan&)>& mount_of,
    const BagMotion& motion, std::int64_t difference) {
  return ClockSearch(options, scans, mount_of, motion).Choose(difference);
}

ClockChoice FindSmallClockDifference(
    const LaserOptions& options, const std::vector<BagScan>& scans,
    const std::function<LaserPlacement(const BagScan&)>& mount_of,
    const BagMotion& motion) {
  return ClockSearch(options, scans, mount_of, motion).ChooseNear();
}

}  // namespace plumbline
