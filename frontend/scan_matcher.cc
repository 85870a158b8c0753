#include <plumbline/frontend/scan_matcher.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace plumbline {
namespace {

// Beyond this the reference is dropped, so that one wild return cannot blow up
// the grids, m.
constexpr double kReferenceReach = 120.0;

// No grid goes so far; fits an integer.
constexpr double kFarthestBucket = 1e9;

// Distance at which a return's likelihood in the search has fallen to
// exp(-1/2), in cells.
constexpr double kFieldSigmaCells = 1.0;
constexpr int kFieldRadius = 3;

}  // namespace

ScanMatcher::ScanMatcher(const ScanMatcherOptions& options)
    : options_(options) {}

void ScanMatcher::SetReference(std::vector<ScanPoint> points) {
  reference_.clear();
  bucket_begin_.assign(1, 0);
  bucket_columns_ = 0;
  bucket_rows_ = 0;
  field_valid_ = false;
  if (points.empty()) return;
  // The grids reach so far around the middle of the points: one wild return
  // cannot blow them up.
  std::vector<double> xs, ys;
  xs.reserve(points.size());
  ys.reserve(points.size());
  for (const ScanPoint& point : points) {
    xs.push_back(point.position.x());
    ys.push_back(point.position.y());
  }
  const auto middle = static_cast<std::ptrdiff_t>(points.size() / 2);
  std::nth_element(xs.begin(), xs.begin() + middle, xs.end());
  std::nth_element(ys.begin(), ys.begin() + middle, ys.end());
  const Eigen::Vector2d center(xs[middle], ys[middle]);
  const Eigen::Vector2d reach = Eigen::Vector2d::Constant(kReferenceReach);
  Eigen::Vector2d minimum = center;
  Eigen::Vector2d maximum = center;
  for (const ScanPoint& point : points) {
    minimum = minimum.cwiseMin(point.position);
    maximum = maximum.cwiseMax(point.position);
  }
  minimum = minimum.cwiseMax(center - reach);
  maximum = maximum.cwiseMin(center + reach);
  const double margin = 1.0;
  origin_ = minimum.array() - margin;
  const Eigen::Vector2d size = (maximum - minimum).array() + 2.0 * margin;
  bucket_columns_ = static_cast<int>(std::ceil(size.x() / bucket_size_)) + 1;
  bucket_rows_ = static_cast<int>(std::ceil(size.y() / bucket_size_)) + 1;
  const std::size_t cells =
      static_cast<std::size_t>(bucket_columns_) * bucket_rows_;
  bucket_begin_.assign(cells + 1, 0);
  std::vector<int> cell_of(points.size(), -1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d local = (points[i].position - origin_) / bucket_size_;
    if (!(local.x() >= 0.0 && local.y() >= 0.0 && local.x() < bucket_columns_ &&
          local.y() < bucket_rows_)) {
      continue;
    }
    const int column = static_cast<int>(local.x());
    const int row = static_cast<int>(local.y());
    cell_of[i] = row * bucket_columns_ + column;
    ++bucket_begin_[cell_of[i] + 1];
  }
  for (std::size_t c = 0; c < cells; ++c) {
    bucket_begin_[c + 1] += bucket_begin_[c];
  }
  reference_.resize(bucket_begin_[cells]);
  std::vector<int> next(bucket_begin_.begin(), bucket_begin_.end() - 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (cell_of[i] < 0) continue;
    reference_[next[cell_of[i]]++] = {points[i].position, points[i].normal};
  }
}

int ScanMatcher::NearestReference(const Eigen::Vector2d& point,
                                  const Eigen::Vector2d& normal,
                                  double radius) const {
  if (reference_.empty()) return -1;
  const Eigen::Vector2d local = point - origin_;
  const bool has_normal = normal.squaredNorm() > 0.0;
  int best = -1;
  double best_distance = radius * radius;
  // Of two at the same distance the first of the reference, whatever the order
  // of the search.
  const auto look = [&](int row, int column_begin, int column_end) {
    column_end = std::min(bucket_columns_ - 1, column_end);
    if (column_begin > column_end) return;
    const int base = row * bucket_columns_;
    const int end = bucket_begin_[base + column_end + 1];
    for (int i = bucket_begin_[base + column_begin]; i < end; ++i) {
      const Surface& candidate = reference_[i];
      const double distance = (candidate.position - point).squaredNorm();
      if (distance > best_distance ||
          (distance == best_distance && (best < 0 || i >= best))) {
        continue;
      }
      if (has_normal && candidate.normal.dot(normal) < 0.7) continue;
      best_distance = distance;
      best = i;
    }
  };
  // Of coordinates left of the first bucket the first.
  const double buckets_per_metre = 1.0 / bucket_size_;
  const auto cell = [&](double value) {
    return static_cast<int>(
        std::clamp(value * buckets_per_metre, 0.0, kFarthestBucket));
  };
  // The point's own bucket first: what it holds narrows the rest.
  const int own_row = cell(local.y());
  const int own_column = cell(local.x());
  if (own_row < bucket_rows_) look(own_row, own_column, own_column);
  // Rows outwards from there.
  const int row_begin = std::max(0, cell(local.y() - radius));
  const int row_end = std::min(bucket_rows_ - 1, cell(local.y() + radius));
  const auto look_at_row = [&](int row) {
    const double low = row * bucket_size_ - local.y();
    const double across = std::max({low, -low - bucket_size_, 0.0});
    const double left = best_distance - across * across;
    if (left < 0.0) return;
    const double half = std::sqrt(left);
    const int begin = cell(local.x() - half);
    const int end = cell(local.x() + half);
    if (row != own_row) {
      look(row, begin, end);
    } else {
      look(row, begin, std::min(end, own_column - 1));
      look(row, std::max(begin, own_column + 1), end);
    }
  };
  for (int step = 0; own_row - step >= row_begin || own_row + step <= row_end;
       ++step) {
    if (own_row - step >= row_begin && own_row - step <= row_end) {
      look_at_row(own_row - step);
    }
    if (step > 0 && own_row + step >= row_begin && own_row + step <= row_end) {
      look_at_row(own_row + step);
    }
  }
  return best;
}

MatchResult ScanMatcher::Refine(const std::vector<ScanPoint>& scan,
                                const Pose2& guess,
                                const MatchPrior& prior) const {
  MatchResult result;
  result.pose = guess;
  const double inverse_variance =
      1.0 / (options_.point_sigma * options_.point_sigma);
  Eigen::Matrix3d information;
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    // The gate shrinks over the first iterations: wide to be pulled in, narrow
    // to be exact.
    const double progress = std::min(1.0, iteration / 6.0);
    const double radius =
        options_.initial_radius +
        progress * (options_.final_radius - options_.initial_radius);
    const double c = std::cos(result.pose[2]);
    const double s = std::sin(result.pose[2]);
    information.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    double cost = 0.0;
    int inliers = 0;
    int tried = 0;
    for (const ScanPoint& point : scan) {
      if (point.normal.squaredNorm() == 0.0) continue;
      ++tried;
      const Eigen::Vector2d rotated(
          c * point.position.x() - s * point.position.y(),
          s * point.position.x() + c * point.position.y());
      const Eigen::Vector2d position = rotated + result.pose.head<2>();
      const Eigen::Vector2d normal(c * point.normal.x() - s * point.normal.y(),
                                   s * point.normal.x() + c * point.normal.y());
      const int index = NearestReference(position, normal, radius);
      if (index < 0) {
        cost += 4.0;
        continue;
      }
      const Surface& partner = reference_[index];
      const Eigen::Vector2d n = partner.normal;
      const double error = n.dot(position - partner.position);
      const double squared = error * error * inverse_variance;
      // Cauchy weight.
      const double weight = 1.0 / (1.0 + squared / 4.0);
      cost += std::min(4.0, squared);
      ++inliers;
      const Eigen::Vector3d jacobian(n.x(), n.y(),
                                     n.y() * rotated.x() - n.x() * rotated.y());
      information.noalias() +=
          (weight * inverse_variance) * jacobian * jacobian.transpose();
      gradient.noalias() += (weight * inverse_variance * error) * jacobian;
    }
    information *= options_.independence;
    gradient *= options_.independence;
    result.inliers = inliers;
    result.inlier_ratio = tried > 0 ? static_cast<double>(inliers) / tried : 0;
    result.cost = tried > 0 ? cost / tried : 4.0;
    Eigen::Vector3d difference = result.pose - prior.pose;
    difference[2] = NormalizeAngle(difference[2]);
    // The prior is heavy tailed: odometry that is plainly wrong (a slip, a
    // turn, a direction of travel with the wrong sign) must not drag along.
    const double prior_squared = difference.dot(prior.information * difference);
    const double prior_weight = 1.0 / (1.0 + prior_squared / 3.0);
    Eigen::Matrix3d hessian = information + prior_weight * prior.information;
    gradient += prior_weight * (prior.information * difference);
    hessian.diagonal().array() += 1e-9;
    const Eigen::Vector3d step = hessian.ldlt().solve(-gradient);
    result.information = information;
    result.covariance = hessian.inverse();
    if (!step.allFinite()) break;
    result.pose += step;
    result.pose[2] = NormalizeAngle(result.pose[2]);
    if (progress >= 1.0 && step.head<2>().norm() < options_.convergence &&
        std::abs(step[2]) < options_.convergence) {
      break;
    }
  }
  return result;
}

double ScanMatcher::Overlap(const std::vector<ScanPoint>& scan,
                            const Pose2& pose) const {
  const PoseTransform transform(pose);
  int tried = 0;
  int found = 0;
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    ++tried;
    if (NearestReference(transform.Point(point.position),
                         transform.Direction(point.normal),
                         options_.initial_radius) >= 0) {
      ++found;
    }
  }
  return tried > 0 ? static_cast<double>(found) / tried : 0.0;
}

void ScanMatcher::BuildField() const {
  const double resolution = options_.grid_resolution;
  field_columns_ =
      static_cast<int>(bucket_columns_ * bucket_size_ / resolution) + 1;
  field_rows_ = static_cast<int>(bucket_rows_ * bucket_size_ / resolution) + 1;
  field_.assign(static_cast<std::size_t>(field_columns_) * field_rows_, 0);
  std::uint8_t kernel[2 * kFieldRadius + 1][2 * kFieldRadius + 1];
  for (int y = -kFieldRadius; y <= kFieldRadius; ++y) {
    for (int x = -kFieldRadius; x <= kFieldRadius; ++x) {
      kernel[y + kFieldRadius][x + kFieldRadius] = static_cast<std::uint8_t>(
          std::lround(255.0 * std::exp(-0.5 * (x * x + y * y) /
                                       (kFieldSigmaCells * kFieldSigmaCells))));
    }
  }
  for (const Surface& point : reference_) {
    const Eigen::Vector2d local = (point.position - origin_) / resolution;
    const int column = static_cast<int>(local.x());
    const int row = static_cast<int>(local.y());
    if (column < kFieldRadius || row < kFieldRadius ||
        column >= field_columns_ - kFieldRadius ||
        row >= field_rows_ - kFieldRadius) {
      continue;
    }
    std::uint8_t& center =
        field_[static_cast<std::size_t>(row) * field_columns_ + column];
    if (center == 255) continue;
    for (int y = -kFieldRadius; y <= kFieldRadius; ++y) {
      std::uint8_t* cells =
          &field_[static_cast<std::size_t>(row + y) * field_columns_ + column -
                  kFieldRadius];
      for (int x = 0; x <= 2 * kFieldRadius; ++x) {
        cells[x] = std::max(cells[x], kernel[y + kFieldRadius][x]);
      }
    }
  }
  field_valid_ = true;
}

Pose2 ScanMatcher::Search(const std::vector<ScanPoint>& scan,
                          const Pose2& center, double translation_window,
                          double rotation_window, double* score) const {
  if (score != nullptr) *score = 0.0;
  if (reference_.empty()) return center;
  if (!field_valid_) BuildField();
  // Thin the scan out: near walls carry many returns that say the same.
  std::vector<Eigen::Vector2d> points;
  points.reserve(scan.size());
  for (const ScanPoint& point : scan) {
    if (points.empty() ||
        (points.back() - point.position).squaredNorm() > 0.15 * 0.15) {
      points.push_back(point.position);
    }
  }
  if (points.empty()) return center;

  const double resolution = options_.grid_resolution;
  const int rotations =
      static_cast<int>(std::ceil(rotation_window / options_.rotation_step));
  const int steps = static_cast<int>(
      std::ceil(translation_window / options_.search_step - 1e-9));
  Pose2 best = center;
  // Where nothing fits at all the prediction stands.
  double best_score = 0.0;
  std::vector<Eigen::Vector2d> rotated(points.size());
  const double normalization = 1.0 / (255.0 * points.size());
  for (int k = -rotations; k <= rotations; ++k) {
    const double offset =
        rotations > 0 ? k * (rotation_window / rotations) : 0.0;
    const double theta = center[2] + offset;
    const double c = std::cos(theta) / resolution;
    const double s = std::sin(theta) / resolution;
    const Eigen::Vector2d shift = (center.head<2>() - origin_) / resolution;
    for (std::size_t i = 0; i < points.size(); ++i) {
      rotated[i] =
          shift + Eigen::Vector2d(c * points[i].x() - s * points[i].y(),
                                  s * points[i].x() + c * points[i].y());
    }
    for (int iy = -steps; iy <= steps; ++iy) {
      for (int ix = -steps; ix <= steps; ++ix) {
        const double dx = ix * options_.search_step;
        const double dy = iy * options_.search_step;
        const double cx = dx / resolution;
        const double cy = dy / resolution;
        int sum = 0;
        for (const Eigen::Vector2d& point : rotated) {
          const int column = static_cast<int>(point.x() + cx);
          const int row = static_cast<int>(point.y() + cy);
          if (static_cast<unsigned>(column) <
                  static_cast<unsigned>(field_columns_) &&
              static_cast<unsigned>(row) < static_cast<unsigned>(field_rows_)) {
            sum +=
                field_[static_cast<std::size_t>(row) * field_columns_ + column];
          }
        }
        // Ties go to the pose nearest to the prediction.
        const double value = sum * normalization *
                             (1.0 - 0.05 * std::abs(offset) / DegToRad(30.0) -
                              0.03 * std::hypot(dx, dy) / 0.5);
        if (value > best_score) {
          best_score = value;
          best = Pose2(center[0] + dx, center[1] + dy, theta);
        }
      }
    }
  }
  best[2] = NormalizeAngle(best[2]);
  if (score != nullptr) *score = best_score;
  return best;
}

}  // namespace plumbline
