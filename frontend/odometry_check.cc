#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/odometry_check.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// From one scan that is looked at to the next.
struct Step {
  int begin = 0;
  int end = 0;
  double by_map = 0.0;
  double by_odometry = 0.0;
  // After a jump: a stretch does not go on over it.
  bool begins = false;
};

std::vector<Step> StepsOf(const std::vector<Scan>& scans,
                          const std::vector<Pose2>& trajectory,
                          const OdometryCheckOptions& options) {
  std::vector<Step> steps;
  std::size_t last = 0;
  bool begins = true;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    const double moved =
        Between(scans[i - 1].odometry, scans[i].odometry).head<2>().norm();
    if (moved > options.jump) {
      last = i;
      begins = true;
      continue;
    }
    Step step;
    step.by_odometry =
        Between(scans[last].odometry, scans[i].odometry).head<2>().norm();
    if (step.by_odometry < options.spacing) continue;
    step.begin = static_cast<int>(last);
    step.end = static_cast<int>(i);
    step.by_map = Between(trajectory[last], trajectory[i]).head<2>().norm();
    step.begins = begins;
    begins = false;
    steps.push_back(step);
    last = i;
  }
  return steps;
}

double MedianScale(const std::vector<Step>& steps) {
  std::vector<double> scales;
  for (const Step& step : steps) {
    scales.push_back(step.by_map / step.by_odometry);
  }
  const auto middle =
      scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::nth_element(scales.begin(), middle, scales.end());
  return *middle;
}

bool IsShort(double by_map, double by_odometry, double scale,
             const OdometryCheckOptions& options) {
  return by_map < options.min_share * scale * by_odometry;
}

// First and last steps of stretches that are too short in the map.
std::vector<std::pair<std::size_t, std::size_t>> ShortStretches(
    const std::vector<Step>& steps, double scale,
    const OdometryCheckOptions& options) {
  std::vector<std::pair<std::size_t, std::size_t>> stretches;
  double by_map = 0.0;
  double by_odometry = 0.0;
  std::size_t first = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].begins) {
      by_map = by_odometry = 0.0;
      first = i;
    }
    by_map += steps[i].by_map;
    by_odometry += steps[i].by_odometry;
    while (by_odometry - steps[first].by_odometry >= options.stretch) {
      by_map -= steps[first].by_map;
      by_odometry -= steps[first].by_odometry;
      ++first;
    }
    if (by_odometry < options.stretch ||
        !IsShort(by_map, by_odometry, scale, options)) {
      continue;
    }
    if (stretches.empty() || first > stretches.back().second) {
      stretches.emplace_back(first, i);
    } else {
      stretches.back().second = i;
    }
  }
  return stretches;
}

std::vector<DisputedWay> DisputedWays(const std::vector<Step>& steps,
                                      double scale,
                                      const OdometryCheckOptions& options) {
  const auto is_short = [&](const Step& step) {
    return IsShort(step.by_map, step.by_odometry, scale, options);
  };
  std::vector<DisputedWay> disputed;
  for (auto [first, last] : ShortStretches(steps, scale, options)) {
    while (first < last && !is_short(steps[first])) ++first;
    while (first < last && !is_short(steps[last])) --last;
    DisputedWay way;
    way.begin = steps[first].begin;
    way.end = steps[last].end;
    for (std::size_t i = first; i <= last; ++i) {
      way.by_map += steps[i].by_map;
      way.by_odometry += scale * steps[i].by_odometry;
    }
    disputed.push_back(way);
  }
  return disputed;
}

double CourseOf(const std::vector<Step>& steps, const std::vector<Scan>& scans,
                const std::vector<Pose2>& trajectory,
                const OdometryCheckOptions& options) {
  double along = 0.0;
  double aside = 0.0;
  for (const Step& step : steps) {
    const auto begin = static_cast<std::size_t>(step.begin);
    const auto end = static_cast<std::size_t>(step.end);
    const Pose2 by_odometry =
        Between(scans[begin].odometry, scans[end].odometry);
    const Pose2 by_map = Between(trajectory[begin], trajectory[end]);
    if (std::abs(by_odometry[2]) > options.straight) continue;
    // A robot that was carried went far in the map and nowhere by odometry:
    // that is one step of many.
    const Eigen::Vector2d direction = by_map.head<2>().normalized();
    along += by_odometry.head<2>().dot(direction);
    aside += by_odometry[0] * direction[1] - by_odometry[1] * direction[0];
  }
  return std::atan2(aside, along);
}

bool AreTurnsOpposite(const std::vector<Scan>& scans,
                      const std::vector<Pose2>& trajectory,
                      const OdometryCheckOptions& options) {
  double products = 0.0;
  double squares_map = 0.0;
  double squares_odometry = 0.0;
  double turns = 0.0;
  std::size_t last = 0;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    const double by_odometry =
        NormalizeAngle(scans[i].odometry[2] - scans[last].odometry[2]);
    const double by_map =
        NormalizeAngle(trajectory[i][2] - trajectory[last][2]);
    if (std::max(std::abs(by_odometry), std::abs(by_map)) < options.turn) {
      continue;
    }
    last = i;
    products += by_map * by_odometry;
    squares_map += by_map * by_map;
    squares_odometry += by_odometry * by_odometry;
    turns += std::abs(by_odometry);
  }
  return turns >= options.min_turns &&
         products <
             -options.opposite * std::sqrt(squares_map * squares_odometry);
}

}  // namespace

OdometryAgreement CompareWithOdometry(const std::vector<Scan>& scans,
                                      const std::vector<Pose2>& trajectory,
                                      const OdometryCheckOptions& options) {
  if (trajectory.size() != scans.size()) {
    throw PLUMBLINE_ERROR(
        "a trajectory of " + std::to_string(trajectory.size()) + " poses",
        "one for each of " + std::to_string(scans.size()) + " scans");
  }
  OdometryAgreement agreement;
  const std::vector<Step> steps = StepsOf(scans, trajectory, options);
  double way = 0.0;
  for (const Step& step : steps) way += step.by_odometry;
  if (way >= options.min_way) {
    agreement.scale = MedianScale(steps);
    agreement.is_scale_disputed = agreement.scale > options.max_scale ||
                                  agreement.scale * options.max_scale < 1.0;
    agreement.course = CourseOf(steps, scans, trajectory, options);
    agreement.is_course_disputed =
        std::abs(agreement.course) > options.max_course;
  }
  // A scale that is nonsense is none to measure with.
  agreement.disputed =
      DisputedWays(steps,
                   agreement.is_scale_disputed ? std::max(1.0, agreement.scale)
                                               : agreement.scale,
                   options);
  agreement.turns_are_opposite = AreTurnsOpposite(scans, trajectory, options);
  return agreement;
}

}  // namespace plumbline
