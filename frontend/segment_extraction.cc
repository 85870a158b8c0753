#include <plumbline/frontend/segment_extraction.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace plumbline {
namespace {

// Sums of a run of points, so that any run's line comes from two differences.
struct Moments {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
};

struct LineFit {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  // Mean squared distance across, m^2, and sum of squares along, m^2.
  double across = 0.0;
  double along_sum = 0.0;
};

class Extractor {
 public:
  Extractor(const std::vector<ScanPoint>& points, const Eigen::Vector2d& laser,
            double angle_step, const SegmentExtractionOptions& options)
      : points_(points),
        laser_(laser),
        angle_step_(std::abs(angle_step)),
        options_(options) {
    // Relative to the first point: sums of squares keep their digits.
    if (!points.empty()) origin_ = points.front().position;
    moments_.resize(points.size() + 1);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d p = points[i].position - origin_;
      Moments m = moments_[i];
      m.n += 1;
      m.x += p.x();
      m.y += p.y();
      m.xx += p.x() * p.x();
      m.xy += p.x() * p.y();
      m.yy += p.y() * p.y();
      moments_[i + 1] = m;
    }
  }

  std::vector<SegmentObservation> Run() {
    const int n = static_cast<int>(points_.size());
    int begin = 0;
    for (int i = 1; i <= n; ++i) {
      if (i < n && Connected(i - 1, i)) continue;
      runs_.clear();
      Split(begin, i);
      Merge();
      for (const auto& run : runs_) Emit(run.first, run.second);
      begin = i;
    }
    return std::move(segments_);
  }

 private:
  bool Connected(int a, int b) const {
    const int beams = points_[b].beam - points_[a].beam;
    if (beams > 5) return false;
    // Along a wall seen at a grazing angle returns lie far apart although the
    // beams are neighbours: allow what the beams spread at 70 degrees.
    const double spread = 3.0 * std::max(points_[a].range, points_[b].range) *
                          angle_step_ * beams;
    const double limit =
        std::max(options_.gap, options_.gap_factor / 3.0 * spread);
    return (points_[b].position - points_[a].position).squaredNorm() <=
           limit * limit;
  }

  LineFit Fit(int begin, int end) const {
    const Moments& a = moments_[begin];
    const Moments& b = moments_[end];
    const double n = b.n - a.n;
    const double mx = (b.x - a.x) / n;
    const double my = (b.y - a.y) / n;
    const double sxx = (b.xx - a.xx) - n * mx * mx;
    const double sxy = (b.xy - a.xy) - n * mx * my;
    const double syy = (b.yy - a.yy) - n * my * my;
    const double direction = 0.5 * std::atan2(2.0 * sxy, sxx - syy);
    const double half_trace = 0.5 * (sxx + syy);
    const double radical = std::hypot(0.5 * (sxx - syy), sxy);
    LineFit fit;
    fit.mean = origin_ + Eigen::Vector2d(mx, my);
    fit.direction = {std::cos(direction), std::sin(direction)};
    fit.across = std::max(0.0, half_trace - radical) / n;
    fit.along_sum = half_trace + radical;
    return fit;
  }

  static double SignedDistance(const LineFit& fit, const Eigen::Vector2d& p) {
    const Eigen::Vector2d d = p - fit.mean;
    return fit.direction.x() * d.y() - fit.direction.y() * d.x();
  }

  void Split(int begin, int end) {
    const int count = end - begin;
    if (count < options_.min_points) return;
    // The chord finds corners; the fit decides whether the run is straight.
    const Eigen::Vector2d a = points_[begin].position;
    const Eigen::Vector2d chord = points_[end - 1].position - a;
    const double length = chord.norm();
    int farthest = -1;
    double farthest_distance = -1.0;
    for (int i = begin; i < end; ++i) {
      const Eigen::Vector2d d = points_[i].position - a;
      const double distance =
          length > 1e-9
              ? std::abs(chord.x() * d.y() - chord.y() * d.x()) / length
              : d.norm();
      if (distance > farthest_distance) {
        farthest_distance = distance;
        farthest = i;
      }
    }
    if (Straight(begin, end)) {
      runs_.emplace_back(begin, end);
      return;
    }
    if (farthest <= begin || farthest >= end - 1) {
      // An end point sticks out: peel it off.
      if (farthest <= begin) {
        Split(begin + 1, end);
      } else {
        Split(begin, end - 1);
      }
      return;
    }
    Split(begin, farthest);
    Split(farthest, end);
  }

  bool Straight(int begin, int end) const {
    const LineFit fit = Fit(begin, end);
    const int window = std::min(options_.bend_window, end - begin);
    // The laser's noise as this run shows it from return to return, which a
    // step or bend hardly changes: means that noise explains are no bends.
    double squares = 0.0;
    double previous = SignedDistance(fit, points_[begin].position);
    for (int i = begin + 1; i < end; ++i) {
      const double distance = SignedDistance(fit, points_[i].position);
      squares += (distance - previous) * (distance - previous);
      previous = distance;
    }
    const double noise =
        std::sqrt(0.5 * squares / std::max(1, end - begin - 1));
    const double bend_limit =
        std::max(options_.bend_distance,
                 options_.bend_sigmas * noise / std::sqrt(window));
    double sum = 0.0;
    for (int i = begin; i < end; ++i) {
      const double distance = SignedDistance(fit, points_[i].position);
      if (std::abs(distance) > options_.split_distance) return false;
      sum += distance;
      if (i - begin >= window) {
        sum -= SignedDistance(fit, points_[i - window].position);
      }
      if (i - begin >= window - 1 && std::abs(sum) > bend_limit * window) {
        return false;
      }
    }
    return true;
  }

  void Merge() {
    std::size_t i = 0;
    while (i + 1 < runs_.size()) {
      const int begin = runs_[i].first;
      const int end = runs_[i + 1].second;
      // Only neighbours: what lies between two runs was not straight.
      if (runs_[i + 1].first - runs_[i].second <= 2 && Straight(begin, end)) {
        runs_[i].second = end;
        runs_.erase(runs_.begin() + i + 1);
      } else {
        ++i;
      }
    }
  }

  void Emit(int begin, int end) {
    // A corner's return belongs to both walls and bends either: leave the
    // outermost out where there are plenty.
    if (end - begin >= options_.min_points + 4) {
      ++begin;
      --end;
    }
    const int count = end - begin;
    if (count < options_.min_points) return;
    LineFit fit = Fit(begin, end);
    Eigen::Vector2d normal(-fit.direction.y(), fit.direction.x());
    if (normal.dot(laser_ - fit.mean) < 0.0) {
      fit.direction = -fit.direction;
      normal = -normal;
    }
    double low = 0.0, high = 0.0;
    for (int i : {begin, end - 1}) {
      const double t = fit.direction.dot(points_[i].position - fit.mean);
      low = std::min(low, t);
      high = std::max(high, t);
    }
    const double length = high - low;
    if (length < options_.min_length) return;
    SegmentObservation segment;
    const Eigen::Vector2d middle =
        fit.mean + 0.5 * (low + high) * fit.direction;
    segment.pose = Pose2(middle.x(), middle.y(),
                         std::atan2(fit.direction.y(), fit.direction.x()));
    segment.length = length;
    segment.points = count;
    const double variance =
        std::max(options_.point_sigma * options_.point_sigma,
                 fit.across * count / std::max(1, count - 2));
    if (variance / fit.along_sum * length * length >
        options_.max_end_sigma * options_.max_end_sigma) {
      return;
    }
    const double bend = options_.bias_sigma / length;
    segment.covariance(0, 0) =
        variance / count + options_.bias_sigma * options_.bias_sigma;
    segment.covariance(1, 1) =
        variance / fit.along_sum + 4.0 * bend * bend +
        options_.angle_bias_sigma * options_.angle_bias_sigma;
    segments_.push_back(segment);
  }

  const std::vector<ScanPoint>& points_;
  const Eigen::Vector2d laser_;
  const double angle_step_;
  const SegmentExtractionOptions& options_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  std::vector<Moments> moments_;
  std::vector<std::pair<int, int>> runs_;
  std::vector<SegmentObservation> segments_;
};

}  // namespace

std::vector<SegmentObservation> ExtractSegments(
    const std::vector<ScanPoint>& points, const Eigen::Vector2d& laser,
    double angle_step, const SegmentExtractionOptions& options) {
  const auto is_between = [](const ScanPoint& point) {
    return point.is_between;
  };
  if (std::none_of(points.begin(), points.end(), is_between)) {
    return Extractor(points, laser, angle_step, options).Run();
  }
  std::vector<ScanPoint> returns;
  std::remove_copy_if(points.begin(), points.end(), std::back_inserter(returns),
                      is_between);
  return Extractor(returns, laser, angle_step, options).Run();
}

}  // namespace plumbline
