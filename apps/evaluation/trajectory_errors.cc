#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/apps/evaluation/trajectory_errors.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

namespace plumbline {
namespace {

// Of decimal time stamps, s.
constexpr double kRounding = 1e-9;
constexpr double kFlat = 1e-9;
// Of a step in metres, of its length.
constexpr double kStepTolerance = 0.1;

std::string Text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

double HeadingOf(const Eigen::Quaterniond& q) {
  return std::atan2(
      2.0 * (q.w() * q.z() + q.x() * q.y()),
      q.w() * q.w() + q.x() * q.x() - q.y() * q.y() - q.z() * q.z());
}

Pose2 ToPlane(const Pose3& pose) {
  return Pose2(pose.translation.x(), pose.translation.y(),
               HeadingOf(pose.rotation));
}

Pose3 FromPlane(const Pose2& pose) {
  return {
      Eigen::Quaterniond(Eigen::AngleAxisd(pose[2], Eigen::Vector3d::UnitZ())),
      Eigen::Vector3d(pose[0], pose[1], 0.0)};
}

// 0 to 180.
double AngleDeg(const Eigen::Quaterniond& q) {
  return RadToDeg(2.0 * std::atan2(q.vec().norm(), std::abs(q.w())));
}

// The times of poses in ascending order, and whose they are.
class TimeIndex {
 public:
  TimeIndex(const std::vector<TimedPose3>& poses, double offset) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      entries_.emplace_back(poses[i].timestamp + offset, i);
    }
    std::sort(entries_.begin(), entries_.end());
  }

  // Of those nearest in time the first of the file.
  std::pair<double, std::size_t> Nearest(double time) const {
    const auto after = std::lower_bound(entries_.begin(), entries_.end(),
                                        std::make_pair(time, std::size_t{0}));
    double least = std::numeric_limits<double>::infinity();
    std::size_t nearest = 0;
    const auto offer = [&](double stamp) {
      const double difference = std::abs(stamp - time);
      const auto first =
          std::lower_bound(entries_.begin(), entries_.end(),
                           std::make_pair(stamp, std::size_t{0}));
      if (difference < least ||
          (difference == least && first->second < nearest)) {
        least = difference;
        nearest = first->second;
      }
    };
    if (after != entries_.begin()) offer((after - 1)->first);
    if (after != entries_.end()) offer(after->first);
    return {least, nearest};
  }

  double first() const { return entries_.front().first; }
  double last() const { return entries_.back().first; }

 private:
  std::vector<std::pair<double, std::size_t>> entries_;
};

// Umeyama 1991, equations 34 to 43.
AlignmentTransform FitTransform(const PosePairs& pairs, bool with_scale) {
  const auto n = static_cast<double>(pairs.reference.size());
  Eigen::Vector3d from_center = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_center = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < pairs.reference.size(); ++i) {
    from_center += pairs.estimate[i].translation / n;
    to_center += pairs.reference[i].translation / n;
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double spread = 0.0;
  for (std::size_t i = 0; i < pairs.reference.size(); ++i) {
    const Eigen::Vector3d from = pairs.estimate[i].translation - from_center;
    const Eigen::Vector3d to = pairs.reference[i].translation - to_center;
    covariance += to * from.transpose() / n;
    spread += from.squaredNorm() / n;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d values = svd.singularValues();
  if (!(values[1] > 1e-12 * values[0]) || !(values[0] > 0.0)) {
    throw PLUMBLINE_ERROR(
        "the positions lie on one line: they do not say how to turn it",
        "positions in a plane or in space, or another --alignment");
  }
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) {
    sign[2] = -1.0;
  }
  const Eigen::Matrix3d rotation =
      svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  AlignmentTransform transform;
  if (with_scale) transform.scale = values.dot(sign) / spread;
  transform.motion.rotation = Eigen::Quaterniond(rotation).normalized();
  transform.motion.translation =
      to_center - transform.scale * (rotation * from_center);
  return transform;
}

std::vector<std::pair<std::size_t, std::size_t>> Steps(
    const PosePairs& pairs, const RelativeErrorOptions& options) {
  const std::size_t n = pairs.estimate.size();
  std::vector<std::pair<std::size_t, std::size_t>> steps;
  if (!options.delta_is_m) {
    const auto delta = static_cast<std::size_t>(options.delta);
    for (std::size_t i = 0; i + delta < n; i += options.all_pairs ? 1 : delta) {
      steps.emplace_back(i, i + delta);
    }
    return steps;
  }
  // m, to a pose from the one before, and from the first.
  std::vector<double> lengths(n, 0.0);
  for (std::size_t i = 1; i < n; ++i) {
    lengths[i] =
        (pairs.estimate[i].translation - pairs.estimate[i - 1].translation)
            .norm();
  }
  std::vector<double> way(n);
  std::partial_sum(lengths.begin(), lengths.end(), way.begin());
  if (options.all_pairs) {
    for (std::size_t i = 0; i < n; ++i) {
      const double end = way[i] + options.delta;
      const auto after = static_cast<std::size_t>(
          std::lower_bound(way.begin(), way.end(), end) - way.begin());
      std::size_t best = i;
      double least = kStepTolerance * options.delta;
      for (std::size_t j = std::max(after, i + 2) - 1; j <= after && j < n;
           ++j) {
        if (j == i || std::abs(way[j] - end) > least) continue;
        least = std::abs(way[j] - end);
        best = j;
      }
      if (best != i) steps.emplace_back(i, best);
    }
    return steps;
  }
  std::vector<std::size_t> ends;
  double length = 0.0;
  for (std::size_t i = 1; i < n; ++i) {
    length += lengths[i];
    if (length < options.delta) continue;
    ends.push_back(i);
    length = 0.0;
  }
  for (std::size_t i = 1; i < ends.size(); ++i) {
    steps.emplace_back(ends[i - 1], ends[i]);
  }
  return steps;
}

}  // namespace

ErrorSummary SummarizeErrors(const std::vector<double>& errors) {
  ErrorSummary summary;
  summary.count = errors.size();
  if (errors.empty()) return summary;
  const auto n = static_cast<double>(errors.size());
  std::vector<double> sorted = errors;
  std::sort(sorted.begin(), sorted.end());
  for (const double error : errors) {
    summary.sse += error * error;
    summary.mean += error / n;
  }
  for (const double error : errors) {
    summary.std += (error - summary.mean) * (error - summary.mean) / n;
  }
  summary.std = std::sqrt(summary.std);
  summary.rmse = std::sqrt(summary.sse / n);
  const std::size_t middle = sorted.size() / 2;
  summary.median = sorted.size() % 2 == 1
                       ? sorted[middle]
                       : 0.5 * (sorted[middle - 1] + sorted[middle]);
  summary.min = sorted.front();
  summary.max = sorted.back();
  return summary;
}

PosePairs AssociatePoses(const TrajectoryFile& reference,
                         const TrajectoryFile& estimate, double max_difference,
                         double offset) {
  PosePairs pairs;
  const auto add = [&](std::size_t of_reference, std::size_t of_estimate) {
    pairs.times.push_back(reference.poses[of_reference].timestamp);
    pairs.reference.push_back(reference.poses[of_reference].pose);
    pairs.estimate.push_back(estimate.poses[of_estimate].pose);
  };
  if (reference.has_times != estimate.has_times) {
    const TrajectoryFile& timeless = reference.has_times ? estimate : reference;
    throw Error(timeless.name, 0,
                "poses of " + timeless.format + " have no times to match by",
                "times in both trajectories or in neither");
  }
  if (!reference.has_times) {
    if (reference.poses.size() != estimate.poses.size()) {
      throw Error(
          estimate.name, 0,
          std::to_string(estimate.poses.size()) + " poses without times, " +
              std::to_string(reference.poses.size()) + " in " + reference.name,
          "as many in both");
    }
    for (std::size_t i = 0; i < reference.poses.size(); ++i) add(i, i);
    return pairs;
  }
  const bool estimate_is_longer =
      estimate.poses.size() > reference.poses.size();
  const TimeIndex of_reference(reference.poses, 0.0);
  const TimeIndex of_estimate(estimate.poses, offset);
  const TrajectoryFile& shorter = estimate_is_longer ? reference : estimate;
  for (std::size_t i = 0; i < shorter.poses.size(); ++i) {
    const double time =
        shorter.poses[i].timestamp + (estimate_is_longer ? 0.0 : offset);
    const auto [difference, match] =
        (estimate_is_longer ? of_estimate : of_reference).Nearest(time);
    if (difference > max_difference + kRounding) continue;
    if (estimate_is_longer) {
      add(i, match);
    } else {
      add(match, i);
    }
  }
  if (pairs.times.empty()) {
    throw Error(estimate.name, 0,
                "no pose (" + Text(of_estimate.first()) + " s to " +
                    Text(of_estimate.last()) + " s) is within " +
                    Text(max_difference) + " s of one of " + reference.name +
                    " (" + Text(of_reference.first()) + " s to " +
                    Text(of_reference.last()) + " s)",
                "trajectories of the same time, --time_offset or a larger "
                "--max_time_difference");
  }
  return pairs;
}

bool IsPlanar(const std::vector<TimedPose3>& poses) {
  return std::all_of(poses.begin(), poses.end(), [](const TimedPose3& timed) {
    return std::abs(timed.pose.translation.z()) <= kFlat &&
           std::hypot(timed.pose.rotation.x(), timed.pose.rotation.y()) <=
               kFlat;
  });
}

AlignmentTransform AlignPoses(PoseAlignment alignment, PosePairs* pairs) {
  AlignmentTransform transform;
  switch (alignment) {
    case PoseAlignment::kNone:
      return transform;
    case PoseAlignment::kOrigin:
      transform.motion =
          Compose(pairs->reference.front(), Inverse(pairs->estimate.front()));
      break;
    case PoseAlignment::kSe2: {
      if (pairs->reference.size() < 2) {
        throw PLUMBLINE_ERROR("one pose matches: it fits anywhere",
                              "two poses, or another --alignment");
      }
      std::vector<Pose2> from;
      std::vector<Pose2> to;
      for (std::size_t i = 0; i < pairs->reference.size(); ++i) {
        from.push_back(ToPlane(pairs->estimate[i]));
        to.push_back(ToPlane(pairs->reference[i]));
        pairs->estimate[i] = FromPlane(from.back());
        pairs->reference[i] = FromPlane(to.back());
      }
      transform.motion = FromPlane(FitRigidTransform(from, to));
      break;
    }
    case PoseAlignment::kSe3:
    case PoseAlignment::kSim3:
      transform = FitTransform(*pairs, alignment == PoseAlignment::kSim3);
      break;
  }
  for (Pose3& pose : pairs->estimate) {
    pose.translation *= transform.scale;
    pose = Compose(transform.motion, pose);
  }
  return transform;
}

AbsoluteErrors ComputeAbsoluteErrors(const PosePairs& pairs) {
  AbsoluteErrors errors;
  for (std::size_t i = 0; i < pairs.reference.size(); ++i) {
    const Pose3 between =
        Compose(Inverse(pairs.reference[i]), pairs.estimate[i]);
    errors.translation.push_back(between.translation.norm());
    errors.rotation_deg.push_back(AngleDeg(between.rotation));
  }
  return errors;
}

RelativeErrors ComputeRelativeErrors(const PosePairs& pairs,
                                     const RelativeErrorOptions& options) {
  if (!(options.delta > 0.0) || !std::isfinite(options.delta) ||
      (!options.delta_is_m &&
       (options.delta != std::floor(options.delta) || options.delta > 1e9))) {
    throw PLUMBLINE_ERROR(
        "steps of " + Text(options.delta) +
            (options.delta_is_m ? " m" : " poses"),
        options.delta_is_m ? "a length over 0" : "a whole number from 1 on");
  }
  RelativeErrors errors;
  errors.steps = Steps(pairs, options);
  for (const auto& [begin, end] : errors.steps) {
    const Pose3 truth =
        Compose(Inverse(pairs.reference[begin]), pairs.reference[end]);
    const Pose3 found =
        Compose(Inverse(pairs.estimate[begin]), pairs.estimate[end]);
    const Pose3 between = Compose(Inverse(truth), found);
    errors.translation.push_back(between.translation.norm());
    errors.rotation_deg.push_back(AngleDeg(between.rotation));
  }
  return errors;
}

}  // namespace plumbline
