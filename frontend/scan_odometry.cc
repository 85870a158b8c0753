#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/scan_odometry.h>
#include <plumbline/frontend/scan_sweep.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Key scans that a scan is matched with, and the motion after which there is a
// new one, m and rad.
constexpr std::size_t kWindow = 12;
constexpr double kKeyDistance = 0.2;
constexpr double kKeyTurn = 0.15;
// Share of returns matched below which a match is looked for more widely, and
// below which it is not believed; returns that it needs.
constexpr double kGoodRatio = 0.8;
constexpr double kLeastRatio = 0.4;
constexpr int kLeastPoints = 5;
// A wider match has to be better by so much (cost of a return).
constexpr double kClearlyBetter = 0.02;
// Motion that is always possible between scans, m and rad, and how many
// standard deviations are searched.
constexpr double kLeastMotion = 0.01;
constexpr double kLeastTurn = DegToRad(0.5);
constexpr double kSearchSigmas = 2.5;
// Longer than this the robot does not go steadily, and from times that are
// nearer to each other no speed is told, s.
constexpr double kLongestStep = 0.5;
constexpr double kShortestStep = 1e-6;
// Where a scan and the last ones leave the place open by more than this, m
// (standard deviation), in a direction, the way in it is open.
constexpr double kOpenSigma = 0.05;
// Robust fit of the gyroscope: scans it needs, and the share of the residuals
// that are the largest and do not count.
constexpr std::size_t kFewestTurns = 30;
constexpr double kTrimmed = 0.1;
constexpr int kFitRounds = 20;

// Turn during a scan from which on it matters, rad; scans with one that it
// takes to tell, and poses that a sweep is divided by.
constexpr double kSweepTurn = DegToRad(1.0);
constexpr std::size_t kFewestSweeps = 20;
constexpr int kSweepParts = 8;
// Scans that are matched to tell, where odometry carries the log.
constexpr std::size_t kTrialScans = 150;
// Scans are missing where the next one comes after so many times the usual.
constexpr double kGapPeriods = 3.0;
// Share of the scans that have to fit better as sweeps: all may do so in the
// mean where one run was lost and the other was not.
constexpr double kMostlyBetter = 0.6;
// What sweeps less, rad, is not taken for a turning laser.
constexpr double kLeastSweep = DegToRad(200.0);

// Turned angle by a gyroscope over time.
class TurnIntegral {
 public:
  explicit TurnIntegral(const std::vector<TimedYawRate>& rates) {
    for (const TimedYawRate& rate : rates) {
      if (!times_.empty() && !(rate.timestamp > times_.back())) continue;
      const double step = times_.empty() ? 0.0
                                         : 0.5 * (rate.rate + last_) *
                                               (rate.timestamp - times_.back());
      sums_.push_back(sums_.empty() ? 0.0 : sums_.back() + step);
      times_.push_back(rate.timestamp);
      last_ = rate.rate;
    }
  }

  // Mean rate between two times; false where it was not measured throughout.
  bool MeanRate(double begin, double end, double* rate) const {
    if (times_.size() < 2 || !(end > begin) || begin < times_.front() ||
        end > times_.back()) {
      return false;
    }
    if (end - begin < kShortestStep) return false;
    *rate = (At(end) - At(begin)) / (end - begin);
    return std::isfinite(*rate);
  }

 private:
  double At(double time) const {
    const auto after = std::upper_bound(times_.begin(), times_.end(), time);
    if (after == times_.end()) return sums_.back();
    const auto i = static_cast<std::size_t>(after - times_.begin());
    const double share = (time - times_[i - 1]) / (times_[i] - times_[i - 1]);
    return sums_[i - 1] + share * (sums_[i] - sums_[i - 1]);
  }

  std::vector<double> times_;
  std::vector<double> sums_;
  double last_ = 0.0;
};

struct Calibration {
  bool holds = false;
  double scale = 1.0;
  double bias = 0.0;
  double explained = 0.0;
};

// What remains when the largest are left out.
double TrimmedSum(std::vector<double> squares) {
  std::sort(squares.begin(), squares.end());
  squares.resize(squares.size() -
                 static_cast<std::size_t>(kTrimmed * squares.size()));
  double sum = 0.0;
  for (const double square : squares) sum += square;
  return sum;
}

// turn = scale * rate + bias, by trimmed least squares.
Calibration Fit(const std::vector<std::pair<double, double>>& pairs) {
  Calibration result;
  if (pairs.size() < kFewestTurns) return result;
  std::vector<std::pair<double, double>> used = pairs;
  const auto line = [&] {
    double mean_x = 0.0;
    double mean_y = 0.0;
    for (const auto& [x, y] : used) {
      mean_x += x / used.size();
      mean_y += y / used.size();
    }
    double xx = 0.0;
    double xy = 0.0;
    for (const auto& [x, y] : used) {
      xx += (x - mean_x) * (x - mean_x);
      xy += (x - mean_x) * (y - mean_y);
    }
    if (!(xx > 0.0)) return false;
    result.scale = xy / xx;
    result.bias = mean_y - result.scale * mean_x;
    return std::isfinite(result.scale) && std::isfinite(result.bias);
  };
  const auto residual = [&](const std::pair<double, double>& pair) {
    return std::abs(pair.second - result.scale * pair.first - result.bias);
  };
  for (int round = 0; round < kFitRounds; ++round) {
    if (!line()) return result;
    used = pairs;
    std::stable_sort(used.begin(), used.end(),
                     [&](const auto& a, const auto& b) {
                       return residual(a) < residual(b);
                     });
    used.resize(used.size() - static_cast<std::size_t>(kTrimmed * used.size()));
  }
  double mean = 0.0;
  for (const auto& [x, y] : pairs) mean += y / pairs.size();
  std::vector<double> left;
  std::vector<double> all;
  for (const auto& pair : pairs) {
    left.push_back(residual(pair) * residual(pair));
    all.push_back((pair.second - mean) * (pair.second - mean));
  }
  const double total = TrimmedSum(std::move(all));
  result.explained =
      total > 0.0 ? 1.0 - TrimmedSum(std::move(left)) / total : 0.0;
  result.holds = true;
  return result;
}

// Whether scans fit each other better as sweeps of a turning laser.
class SweepTrial {
 public:
  SweepTrial(const std::vector<Scan>& scans, const TurnIntegral& turns,
             const Calibration* yaw) {
    // Velocity at each scan, in the robot's frame, and how long a sweep takes.
    std::vector<double> steps;
    for (std::size_t i = 1; i < scans.size(); ++i) {
      steps.push_back(scans[i].timestamp - scans[i - 1].timestamp);
    }
    if (steps.empty()) return;
    std::nth_element(steps.begin(), steps.begin() + steps.size() / 2,
                     steps.end());
    period_ = steps[steps.size() / 2];
    if (!(period_ >= kShortestStep) || period_ > kLongestStep) return;
    velocities_.assign(scans.size(), Pose2::Zero());
    for (std::size_t i = 1; i < scans.size(); ++i) {
      if (scans[i].timestamp - scans[i - 1].timestamp > kGapPeriods * period_) {
        gaps_.push_back(i);
      }
    }
    for (std::size_t i = 1; i + 1 < scans.size(); ++i) {
      const double span = scans[i + 1].timestamp - scans[i - 1].timestamp;
      const Scan& scan = scans[i];
      if (!(span >= kShortestStep) || span > kGapPeriods * period_ ||
          !scan.bearings.empty() ||
          scan.angle_step * static_cast<double>(scan.ranges.size()) <
              kLeastSweep) {
        continue;
      }
      Pose2& velocity = velocities_[i];
      velocity = Between(scans[i - 1].odometry, scans[i + 1].odometry) / span;
      double rate = 0.0;
      if (yaw != nullptr &&
          turns.MeanRate(scan.timestamp, scan.timestamp + period_, &rate)) {
        velocity[2] = yaw->scale * rate + yaw->bias;
      }
      if (std::abs(velocity[2]) * period_ >= kSweepTurn) turning_.push_back(i);
    }
  }

  // Scans while whose sweep the robot turned.
  const std::vector<std::size_t>& turning() const { return turning_; }

  // The first scan after this one before which scans are missing, or the end.
  std::size_t NextGap(std::size_t scan) const {
    const auto gap = std::upper_bound(gaps_.begin(), gaps_.end(), scan);
    return gap == gaps_.end() ? velocities_.size() : *gap;
  }

  // The share of these scans of which the second costs are less.
  double ShareOfLess(const std::vector<double>& costs,
                     const std::vector<double>& others) const {
    std::size_t less = 0;
    for (const std::size_t i : turning_) less += others[i] < costs[i] ? 1 : 0;
    return static_cast<double>(less) / static_cast<double>(turning_.size());
  }

  double MeanCost(const std::vector<double>& costs) const {
    double sum = 0.0;
    for (const std::size_t i : turning_) sum += costs[i];
    return sum / static_cast<double>(turning_.size());
  }

  // Takes the scans for sweeps in the order of beams (1) or against it (-1),
  // seen from where the robot was `origin` periods after a sweep began.
  void Undo(int direction, double origin, std::vector<Scan>* scans) const {
    for (std::size_t i = 0; i < scans->size(); ++i) {
      Scan& scan = (*scans)[i];
      if (velocities_[i] == Pose2::Zero()) continue;
      std::vector<Pose2> places;
      for (int k = 0; k <= kSweepParts; ++k) {
        const double share =
            0.5 + direction * (static_cast<double>(k) / kSweepParts - 0.5);
        const double time = period_ * (share - origin);
        places.push_back(
            Compose(Inverse(scan.laser_offset),
                    Compose(Pose2(velocities_[i] * time), scan.laser_offset)));
      }
      UndoSweep(places, &scan);
    }
  }

  // A sweep is stamped when it begins, and matched as seen from its middle.
  void MoveOdometryToBegin(std::vector<Scan>* scans) const {
    for (std::size_t i = 0; i < scans->size(); ++i) {
      Pose2& odometry = (*scans)[i].odometry;
      odometry =
          Compose(odometry, Pose2(velocities_[i] * (-kMiddle * period_)));
    }
  }

  // As seen from here scans are matched as a whole.
  static constexpr double kMiddle = 0.5;

 private:
  double period_ = 0.0;
  std::vector<Pose2> velocities_;
  std::vector<std::size_t> turning_;
  // Scans before which others are missing.
  std::vector<std::size_t> gaps_;
};

// Figures of Matcher::Run.
struct MatchFigures {
  std::size_t unmatched = 0;
  double way = 0.0;
  double open_way = 0.0;

  void Tell(ScanOdometryReport* report) const {
    report->unmatched = unmatched;
    report->way = way;
    report->open_way = open_way;
  }
};

// What of a displacement, in the frame of the match, its returns leave open.
double OpenPart(const Eigen::Matrix3d& information,
                const Eigen::Vector2d& displacement) {
  Eigen::Matrix2d position = information.topLeftCorner<2, 2>();
  if (information(2, 2) > 0.0) {
    position -= information.topRightCorner<2, 1>() *
                information.bottomLeftCorner<1, 2>() / information(2, 2);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(position);
  double squares = 0.0;
  for (int k = 0; k < 2; ++k) {
    if (solver.eigenvalues()[k] >= 1.0 / (kOpenSigma * kOpenSigma)) continue;
    const double along = solver.eigenvectors().col(k).dot(displacement);
    squares += along * along;
  }
  return std::sqrt(squares);
}

class Matcher {
 public:
  Matcher(const ScanOdometryOptions& options, const TurnIntegral& turns)
      : options_(options), turns_(turns), matcher_(options.matcher) {}

  // Places the scans. `yaw` and `turns` may be null; `costs` gets the cost of
  // every match, at the bound where there is none.
  bool Run(const Calibration* yaw, std::vector<Scan>* scans,
           MatchFigures* figures, std::vector<std::pair<double, double>>* turns,
           std::vector<double>* costs) {
    costs->assign(scans->size(), 0.0);
    Pose2 pose = Pose2::Zero();
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    double last_time = 0.0;
    std::vector<ScanPoint> points;
    *figures = MatchFigures();
    for (std::size_t i = 0; i < scans->size(); ++i) {
      if (options_.stop && options_.stop()) return false;
      Scan& scan = (*scans)[i];
      ExtractScanPoints(scan, options_.points, &points);
      if (i == 0) {
        scan.odometry = pose;
        AddKey(pose, points);
        last_time = scan.timestamp;
        continue;
      }
      const double seconds = std::max(scan.timestamp - last_time, 0.0);
      const double step = std::min(seconds, kLongestStep);
      double rate = 0.0;
      const bool is_measured =
          turns_.MeanRate(last_time, scan.timestamp, &rate);
      const bool is_guided = yaw != nullptr && is_measured;
      last_time = scan.timestamp;

      Pose2 motion = velocity * step;
      // A gyroscope has measured all of it, however long it took.
      if (is_guided) {
        motion[2] = NormalizeAngle((yaw->scale * rate + yaw->bias) * seconds);
      }
      const double sigma = kLeastMotion + options_.speed_noise * step;
      const double turn_sigma =
          kLeastTurn +
          (is_guided ? options_.gyroscope_noise : options_.turn_noise) * step;
      Pose2 matched;
      const Pose2 guess = Compose(pose, motion);
      Eigen::Matrix3d information;
      const bool found = Match(points, guess, sigma, turn_sigma, &matched,
                               &information, &(*costs)[i]);
      if (found) {
        const Pose2 moved = Between(pose, matched);
        const Eigen::Vector2d displacement = (matched - pose).head<2>();
        figures->way += displacement.norm();
        figures->open_way += OpenPart(information, displacement);
        if (step >= kShortestStep) {
          velocity = moved / seconds;
          if (turns != nullptr && is_measured && seconds <= kLongestStep) {
            turns->emplace_back(rate, moved[2] / seconds);
          }
        }
        pose = matched;
      } else {
        ++figures->unmatched;
        figures->way += motion.head<2>().norm();
        figures->open_way += motion.head<2>().norm();
        pose = guess;
        velocity *= 0.5;
      }
      Limit(&velocity);
      scan.odometry = pose;
      const Pose2 since = Between(keys_.back().pose, pose);
      if (found && (since.head<2>().norm() >= kKeyDistance ||
                    std::abs(since[2]) >= kKeyTurn)) {
        AddKey(pose, points);
      }
      if (options_.progress) options_.progress(i, scans->size());
    }
    return true;
  }

 private:
  struct Key {
    Pose2 pose;
    std::vector<ScanPoint> points;
  };

  void Limit(Eigen::Vector3d* velocity) const {
    const double speed = velocity->head<2>().norm();
    if (speed > options_.max_speed) {
      velocity->head<2>() *= options_.max_speed / speed;
    }
    (*velocity)[2] =
        std::clamp((*velocity)[2], -options_.max_turn, options_.max_turn);
  }

  void AddKey(const Pose2& pose, const std::vector<ScanPoint>& points) {
    keys_.push_back({pose, points});
    if (keys_.size() > kWindow) keys_.pop_front();
    std::vector<ScanPoint> reference;
    for (const Key& key : keys_) {
      const PoseTransform transform(key.pose);
      for (const ScanPoint& point : key.points) {
        reference.push_back(Moved(point, transform));
      }
    }
    matcher_.SetReference(std::move(reference));
  }

  bool Match(const std::vector<ScanPoint>& points, const Pose2& guess,
             double sigma, double turn_sigma, Pose2* pose,
             Eigen::Matrix3d* information, double* cost) const {
    if (matcher_.empty() || static_cast<int>(points.size()) < kLeastPoints) {
      return false;
    }
    MatchPrior prior;
    prior.pose = guess;
    prior.information =
        Eigen::Vector3d(1.0 / (sigma * sigma), 1.0 / (sigma * sigma),
                        1.0 / (turn_sigma * turn_sigma))
            .asDiagonal();
    MatchResult match = matcher_.Refine(points, guess, prior);
    if (match.inlier_ratio < kGoodRatio ||
        turn_sigma > options_.matcher.rotation_step) {
      const Pose2 start = matcher_.Search(
          points, guess,
          std::max(kSearchSigmas * sigma, options_.matcher.search_step),
          std::min(kPi, kSearchSigmas * turn_sigma), nullptr);
      const MatchResult wide = matcher_.Refine(points, start, prior);
      if (wide.cost < match.cost - kClearlyBetter) match = wide;
    }
    *pose = match.pose;
    *information = match.information;
    *cost = match.cost;
    return match.inlier_ratio >= kLeastRatio && match.inliers >= kLeastPoints;
  }

  const ScanOdometryOptions& options_;
  const TurnIntegral& turns_;
  ScanMatcher matcher_;
  std::deque<Key> keys_;
};

// Scans taken for sweeps in a direction, or as they are (0), and matched.
struct SweepRun {
  int direction = 0;
  std::vector<Scan> scans;
  std::vector<double> costs;
  MatchFigures figures;
  // False when the work was stopped.
  bool is_done = false;
};

// Matches copies of the scans in each direction. None needs another one: they
// are run side by side.
std::vector<SweepRun> RunSweeps(const ScanOdometryOptions& options,
                                const TurnIntegral& turns,
                                const Calibration* guide,
                                const SweepTrial& trial,
                                const std::vector<int>& directions,
                                const std::vector<Scan>& scans) {
  std::vector<SweepRun> runs(directions.size());
  ParallelFor(runs.size(), ThreadsHere(), [&](std::size_t i) {
    SweepRun& run = runs[i];
    run.direction = directions[i];
    run.scans = scans;
    if (run.direction != 0) {
      trial.Undo(run.direction, SweepTrial::kMiddle, &run.scans);
    }
    ScanOdometryOptions own = options;
    // One of them tells for all.
    if (i > 0) own.progress = nullptr;
    run.is_done =
        Matcher(own, turns)
            .Run(guide, &run.scans, &run.figures, nullptr, &run.costs);
  });
  return runs;
}

// The run in whose direction scans, whose matches have these costs as they are,
// fit each other better as sweeps; null for none.
SweepRun* ChooseSweep(const ScanOdometryOptions& options,
                      const SweepTrial& trial, const std::vector<double>& costs,
                      std::vector<SweepRun>* runs) {
  double best = (1.0 - options.min_sweep_gain) * trial.MeanCost(costs);
  SweepRun* chosen = nullptr;
  for (SweepRun& run : *runs) {
    if (!run.is_done) return nullptr;
    if (run.direction == 0) continue;
    const double cost = trial.MeanCost(run.costs);
    if (cost >= best || trial.ShareOfLess(costs, run.costs) < kMostlyBetter) {
      continue;
    }
    best = cost;
    chosen = &run;
  }
  return chosen;
}

}  // namespace

ScanOdometryReport AddScanOdometry(const ScanOdometryOptions& options,
                                   Log* log) {
  ScanOdometryReport report;
  const TurnIntegral turns(log->yaw_rates);
  std::vector<Scan>& scans = log->scans;
  std::vector<double> costs;
  std::vector<std::pair<double, double>> pairs;
  MatchFigures figures;
  if (!Matcher(options, turns).Run(nullptr, &scans, &figures, &pairs, &costs)) {
    return report;
  }
  Calibration yaw = Fit(pairs);
  report.explained = yaw.explained;
  report.used_yaw_rates = yaw.holds && yaw.explained >= options.min_explained;
  const Calibration* const guide = report.used_yaw_rates ? &yaw : nullptr;
  if (report.used_yaw_rates) {
    report.yaw_scale = yaw.scale;
    report.yaw_bias = yaw.bias;
    if (!Matcher(options, turns)
             .Run(guide, &scans, &figures, nullptr, &costs)) {
      return report;
    }
  }

  figures.Tell(&report);

  const SweepTrial trial(scans, turns, guide);
  if (trial.turning().size() < kFewestSweeps) return report;
  std::vector<SweepRun> runs =
      RunSweeps(options, turns, guide, trial, {1, -1}, scans);
  SweepRun* const chosen = ChooseSweep(options, trial, costs, &runs);
  if (chosen == nullptr) return report;
  report.sweep = chosen->direction;
  chosen->figures.Tell(&report);
  trial.MoveOdometryToBegin(&chosen->scans);
  trial.Undo(report.sweep, 0.0, &scans);
  for (std::size_t i = 0; i < scans.size(); ++i) {
    scans[i].odometry = chosen->scans[i].odometry;
  }
  return report;
}

int UndoSweepsByOdometry(const ScanOdometryOptions& options, Log* log) {
  std::vector<Scan>& scans = log->scans;
  const TurnIntegral no_turns({});
  const SweepTrial whole(scans, no_turns, nullptr);
  const std::vector<std::size_t>& turning = whole.turning();
  if (turning.size() < kFewestSweeps) return 0;
  // The stretch with most scans that tell, of which none are missing: a run
  // that is lost there costs more whatever the laser is.
  std::size_t begin = turning.front();
  std::size_t most = 0;
  for (std::size_t first = 0, last = 0; first < turning.size(); ++first) {
    const std::size_t stretch_end =
        std::min(turning[first] + kTrialScans, whole.NextGap(turning[first]));
    while (last < turning.size() && turning[last] < stretch_end) ++last;
    if (last - first <= most) continue;
    most = last - first;
    begin = turning[first];
  }
  const std::size_t end = std::min(begin + kTrialScans, whole.NextGap(begin));
  std::vector<Scan> stretch(scans.begin() + static_cast<std::ptrdiff_t>(begin),
                            scans.begin() + static_cast<std::ptrdiff_t>(end));
  const SweepTrial trial(stretch, no_turns, nullptr);
  if (trial.turning().size() < kFewestSweeps) return 0;
  // Odometry in place of a gyroscope.
  std::vector<TimedYawRate> rates;
  for (std::size_t i = 1; i < stretch.size(); ++i) {
    const double step = stretch[i].timestamp - stretch[i - 1].timestamp;
    if (!(step >= kShortestStep)) continue;
    const double turn =
        Between(stretch[i - 1].odometry, stretch[i].odometry)[2];
    rates.push_back({stretch[i].timestamp - 0.5 * step, turn / step});
  }
  const TurnIntegral turns(rates);
  Calibration odometry;
  odometry.holds = true;
  std::vector<SweepRun> runs =
      RunSweeps(options, turns, &odometry, trial, {0, 1, -1}, stretch);
  const SweepRun* const chosen =
      ChooseSweep(options, trial, runs.front().costs, &runs);
  const int sweep = chosen == nullptr ? 0 : chosen->direction;
  if (sweep != 0) whole.Undo(sweep, 0.0, &scans);
  return sweep;
}

}  // namespace plumbline
