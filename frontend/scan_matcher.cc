#include <plumbline/frontend/lattice_search.h>
#include <plumbline/frontend/peak_search.h>
#include <plumbline/frontend/scan_matcher.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

namespace plumbline {
namespace {

// Along either axis the grids reach so far beyond the places that the reference
// was seen from, and no farther from the middle of all, m.
constexpr double kAroundViewpoints = 30.0;
constexpr double kFarthestReach = 250.0;

// Empty buckets around those of a reference.
constexpr int kMarginBuckets = 10;

// No grid goes so far; fits an integer.
constexpr double kFarthestBucket = 1e9;

// Distance at which a return's likelihood in the search has fallen to
// exp(-1/2), in cells.
constexpr double kFieldSigmaCells = 1.0;
constexpr int kFieldRadius = 3;

// A beam says that all is free up to so far before its return, m, and no
// farther away than this: grazing beams are not where they seem to be.
constexpr double kFreeMargin = 0.3;
constexpr double kFreeReach = 20.0;
// Likelihood from which on a return lies on something: two cells away.
constexpr int kHitLikelihood = 34;
// Returns that are compared lie so far apart, m.
constexpr double kCompareSpacing = 0.15;
// Bearings of a scan for what it looks through, and the share of the distance
// that counts as margin.
constexpr int kBearings = 360;
constexpr double kFreeShare = 0.03;

// Peaks: what a point costs where the reference has looked through.
constexpr std::int16_t kThrough = -128;

// Cosine of the largest angle between the normals of partners.
constexpr double kSameSide = 0.7;
// The reference points around a point are kept when it moved by less than this
// since it was looked up last, m, and those so much farther away than its
// partner, m.
constexpr double kListStep = 0.02;
constexpr double kListMargin = 0.004;
// The list serves until the normal has changed by so much.
constexpr double kListTurn = 0.05;
constexpr double kRounding = 1e-9;

// The gate shrinks over so many iterations, or until a step is smaller than
// this, m and rad.
constexpr double kShrinkingIterations = 6.0;
constexpr double kCalmShift = 0.005;
constexpr double kCalmTurn = 0.0015;

// What a return without a partner costs, in squared sigmas: the most that any
// does.
constexpr double kUnmatchedCost = 4.0;

// So that nothing is quite unknown, 1/m^2 and 1/rad^2.
constexpr double kLeastInformation = 1e-9;

// Reference points that are compared at a time, and what single precision may
// be off by within twice kFarthestReach, m.
constexpr int kBlock = 4;
constexpr double kFloatMargin = 2e-4;

// The nearest reference point found so far. Of two at the same distance the
// first of the reference, whatever the order of the search.
struct Nearest {
  int index;
  double squared_distance;
  bool IsBetter(int i, double distance) const {
    return distance < squared_distance ||
           (distance == squared_distance && index >= 0 && i < index);
  }
};

// Whether points lie so far apart that some may be out of reach of the middle
// of all.
bool IsTooWide(const std::vector<ReferencePoint>& points, double reach) {
  Eigen::AlignedBox2d box;
  for (const ReferencePoint& point : points) box.extend(point.position);
  return !(box.sizes().maxCoeff() < reach - kRounding);
}

// The middle of points along either axis: one wild return cannot move it.
Eigen::Vector2d MiddleOf(const std::vector<ReferencePoint>& points) {
  std::vector<double> xs, ys;
  xs.reserve(points.size());
  ys.reserve(points.size());
  for (const ReferencePoint& point : points) {
    xs.push_back(point.position.x());
    ys.push_back(point.position.y());
  }
  const auto middle = static_cast<std::ptrdiff_t>(points.size() / 2);
  std::nth_element(xs.begin(), xs.begin() + middle, xs.end());
  std::nth_element(ys.begin(), ys.begin() + middle, ys.end());
  return {xs[middle], ys[middle]};
}

// The points that the grids may reach: within `reach` of the middle of all, or
// near where they were seen from. One wild return cannot blow them up.
std::vector<ReferencePoint> WithinReach(
    const std::vector<ReferencePoint>& points, double reach,
    const std::vector<Viewpoint>& viewpoints) {
  const auto around = [](const Eigen::Vector2d& place, double distance) {
    const Eigen::Vector2d offset = Eigen::Vector2d::Constant(distance);
    return Eigen::AlignedBox2d(place - offset, place + offset);
  };
  const Eigen::Vector2d middle = MiddleOf(points);
  Eigen::AlignedBox2d seen;
  for (const Viewpoint& viewpoint : viewpoints) {
    seen.extend(around(viewpoint.position, kAroundViewpoints));
  }
  const Eigen::AlignedBox2d near = around(middle, reach);
  seen = seen.intersection(around(middle, kFarthestReach));
  std::vector<ReferencePoint> within;
  for (const ReferencePoint& point : points) {
    if (near.contains(point.position) || seen.contains(point.position)) {
      within.push_back(point);
    }
  }
  return within;
}

// Poses that an iteration went through.
class PosesBefore {
 public:
  // Whether it has come back to where it was, within a step that ends it: it
  // goes round as points change partners to and fro. Then sets the mean of the
  // poses on the way round.
  bool ClosesCircle(double least_step, Pose2* pose) {
    poses_.push_back(*pose);
    for (std::size_t k = poses_.size() - 1; k-- > 0;) {
      if (!IsNear(*pose, poses_[k], least_step)) continue;
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t i = k + 1; i < poses_.size(); ++i) {
        Eigen::Vector3d difference = poses_[i] - *pose;
        difference[2] = NormalizeAngle(difference[2]);
        sum += difference;
      }
      *pose += sum / static_cast<double>(poses_.size() - k - 1);
      (*pose)[2] = NormalizeAngle((*pose)[2]);
      return true;
    }
    return false;
  }

 private:
  static bool IsNear(const Pose2& a, const Pose2& b, double least_step) {
    return (a - b).head<2>().norm() < least_step &&
           std::abs(NormalizeAngle(a[2] - b[2])) < least_step;
  }

  std::vector<Pose2> poses_;
};

// The part of a symmetric matrix of information (m, m, rad) whose eigenvalues
// are positive, a turn counted by what it moves at the returns.
Eigen::Matrix3d WithoutNegative(const Eigen::Matrix3d& information) {
  const double lever = std::sqrt(std::max(0.0, information(2, 2)) /
                                 (information(0, 0) + information(1, 1)));
  if (!std::isfinite(lever) || lever == 0.0) return Eigen::Matrix3d::Zero();
  const Eigen::Vector3d scale(1.0, 1.0, lever);
  const Eigen::Vector3d inverse = scale.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(
      inverse.asDiagonal() * information * inverse.asDiagonal());
  const Eigen::Matrix3d half =
      scale.asDiagonal() * solver.eigenvectors() *
      solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  return half * half.transpose();
}

// Share of the points with a normal that are returns, which alone inform.
double OwnShare(const std::vector<ScanPoint>& scan) {
  int points = 0;
  int returns = 0;
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    ++points;
    if (!point.is_between) ++returns;
  }
  return points > 0 ? static_cast<double>(returns) / points : 1.0;
}

}  // namespace

ScanMatcher::ScanMatcher(const ScanMatcherOptions& options)
    : options_(options) {}

void ScanMatcher::SetReference(const std::vector<ScanPoint>& points) {
  SetReference(points, {});
}

void ScanMatcher::SetReference(const std::vector<ScanPoint>& points,
                               std::vector<Viewpoint> viewpoints) {
  std::vector<ReferencePoint> given;
  given.reserve(points.size());
  for (const ScanPoint& point : points) {
    given.push_back({point.position, point.normal});
  }
  ReferencePoints reference(merge_distance());
  reference.Add(std::move(given));
  SetReference(std::move(reference), std::move(viewpoints));
}

void ScanMatcher::SetReference(ReferencePoints points,
                               std::vector<Viewpoint> viewpoints) {
  viewpoints_ = std::move(viewpoints);
  rays_.clear();
  free_valid_ = false;
  levels_.clear();
  reference_.clear();
  bucket_columns_ = 0;
  bucket_rows_ = 0;
  field_valid_ = false;
  if (points.given().empty()) return;
  if (IsTooWide(points.given(), options_.reference_reach)) {
    if (!viewpoints_.empty()) rays_ = points.given();
    ReferencePoints within(points.merge_distance());
    within.Add(
        WithinReach(points.given(), options_.reference_reach, viewpoints_));
    points = std::move(within);
  } else if (!viewpoints_.empty()) {
    rays_ = points.TakeGiven();
  }
  const std::vector<ReferencePoints::Bucket>& buckets = points.buckets();
  if (buckets.empty()) return;
  int low_column = buckets[0].column;
  int high_column = low_column;
  for (const ReferencePoints::Bucket& bucket : buckets) {
    low_column = std::min(low_column, bucket.column);
    high_column = std::max(high_column, bucket.column);
  }
  const int low_row = buckets.front().row;
  const int high_row = buckets.back().row;
  origin_ =
      Eigen::Vector2d(low_column - kMarginBuckets, low_row - kMarginBuckets) *
      bucket_size_;
  bucket_columns_ = high_column - low_column + 1 + 2 * kMarginBuckets;
  bucket_rows_ = high_row - low_row + 1 + 2 * kMarginBuckets;
  bucket_starts_.Reset(bucket_columns_, bucket_rows_);
  for (const ReferencePoints::Bucket& bucket : buckets) {
    bucket_starts_.Begin(bucket.column - low_column + kMarginBuckets,
                         bucket.row - low_row + kMarginBuckets, bucket.begin);
  }
  reference_ = points.TakePoints();
  bucket_starts_.Finish(static_cast<int>(reference_.size()));
  // The last block may be read beyond the end.
  reference_x_.assign(reference_.size() + kBlock, 0.0f);
  reference_y_.assign(reference_.size() + kBlock, 0.0f);
  for (std::size_t i = 0; i < reference_.size(); ++i) {
    const Eigen::Vector2d local = reference_[i].position - origin_;
    reference_x_[i] = static_cast<float>(local.x());
    reference_y_[i] = static_cast<float>(local.y());
  }
}

template <typename Look>
void ScanMatcher::VisitBuckets(const Eigen::Vector2d& point,
                               const double* squared_radius,
                               const Look& look) const {
  const Eigen::Vector2d local = point - origin_;
  // Of coordinates left of the first bucket the first.
  const double buckets_per_metre = 1.0 / bucket_size_;
  const auto cell = [&](double value) {
    return static_cast<int>(
        std::clamp(value * buckets_per_metre, 0.0, kFarthestBucket));
  };
  const int own_row = cell(local.y());
  // Rows outwards from there.
  const double reach = std::sqrt(*squared_radius);
  const int row_begin = std::max(0, cell(local.y() - reach));
  const int row_end = std::min(bucket_rows_ - 1, cell(local.y() + reach));
  const auto look_at_row = [&](int row) {
    const double low = row * bucket_size_ - local.y();
    const double across = std::max({low, -low - bucket_size_, 0.0});
    const double left = *squared_radius - across * across;
    if (left < 0.0) return;
    const double half = std::sqrt(left);
    const int begin = cell(local.x() - half);
    const int end = std::min(bucket_columns_ - 1, cell(local.x() + half));
    if (begin > end) return;
    look(bucket_starts_.Before(begin, row),
         bucket_starts_.Before(end + 1, row));
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
}

template <typename Look>
void ScanMatcher::VisitNear(int begin, int end, const Eigen::Vector2d& point,
                            const double* squared_radius,
                            const Look& look) const {
  using Block = Eigen::Array<float, kBlock, 1>;
  const Eigen::Vector2f local = (point - origin_).cast<float>();
  double radius = -1.0;
  float bound = 0.0f;
  for (int i = begin; i < end; i += kBlock) {
    if (radius != *squared_radius) {
      radius = *squared_radius;
      const double reach = std::sqrt(radius) + kFloatMargin;
      bound = static_cast<float>(reach * reach);
    }
    const Block x = Eigen::Map<const Block>(&reference_x_[i]) - local.x();
    const Block y = Eigen::Map<const Block>(&reference_y_[i]) - local.y();
    const Block distances = x * x + y * y;
    if (distances.minCoeff() > bound) continue;
    const int count = std::min(kBlock, end - i);
    for (int j = 0; j < count; ++j) {
      if (distances[j] <= bound) look(i + j);
    }
  }
}

int ScanMatcher::NearestReference(const Eigen::Vector2d& point,
                                  const Eigen::Vector2d& normal, double radius,
                                  int hint) const {
  if (reference_.empty()) return -1;
  const bool has_normal = normal.squaredNorm() > 0.0;
  Nearest nearest{-1, radius * radius};
  const auto consider = [&](int i) {
    const Surface& candidate = reference_[i];
    const double distance = (candidate.position - point).squaredNorm();
    if (!nearest.IsBetter(i, distance)) return;
    if (has_normal && candidate.normal.dot(normal) < kSameSide) return;
    nearest = {i, distance};
  };
  if (hint >= 0) consider(hint);
  VisitBuckets(point, &nearest.squared_distance, [&](int begin, int end) {
    VisitNear(begin, end, point, &nearest.squared_distance, consider);
  });
  return nearest.index;
}

int ScanMatcher::AnyReference(const Eigen::Vector2d& point,
                              const Eigen::Vector2d& normal, double radius,
                              int hint) const {
  if (reference_.empty()) return -1;
  const double squared_radius = radius * radius;
  const auto fits = [&](int i) {
    return (reference_[i].position - point).squaredNorm() < squared_radius &&
           !(reference_[i].normal.dot(normal) < kSameSide);
  };
  if (hint >= 0 && fits(hint)) return hint;
  int found = -1;
  double left = squared_radius;
  VisitBuckets(point, &left, [&](int begin, int end) {
    for (int i = begin; i < end && found < 0; ++i) {
      if (fits(i)) found = i;
    }
    if (found >= 0) left = -1.0;
  });
  return found;
}

int ScanMatcher::NearestAndAround(const Eigen::Vector2d& point,
                                  const Eigen::Vector2d& normal, double radius,
                                  double margin, int hint,
                                  Lookup* lookup) const {
  Nearest nearest{-1, radius * radius};
  double reach = radius + margin;
  double squared_reach = reach * reach;
  const auto begin = static_cast<std::ptrdiff_t>(around_.size());
  const auto consider = [&](int i) {
    const Surface& candidate = reference_[i];
    const double distance = (candidate.position - point).squaredNorm();
    if (distance > squared_reach) return;
    const double cosine = candidate.normal.dot(normal);
    if (cosine < kSameSide - kListTurn - kRounding) return;
    around_.push_back({candidate, i});
    if (cosine < kSameSide || !nearest.IsBetter(i, distance)) return;
    nearest = {i, distance};
    reach = std::sqrt(distance) + margin;
    squared_reach = reach * reach;
  };
  if (hint >= 0) {
    consider(hint);
    // It comes once more.
    around_.erase(around_.begin() + begin, around_.end());
  }
  VisitBuckets(point, &squared_reach, [&](int first, int last) {
    VisitNear(first, last, point, &squared_reach, consider);
  });
  // Some were taken in before the nearest was known.
  around_.erase(
      std::remove_if(around_.begin() + begin, around_.end(),
                     [&](const Neighbour& one) {
                       return (one.surface.position - point).squaredNorm() >
                              squared_reach;
                     }),
      around_.end());
  lookup->center = point;
  lookup->normal = normal;
  lookup->begin = static_cast<int>(begin);
  lookup->end = static_cast<int>(around_.size());
  lookup->reach = reach;
  return nearest.index;
}

int ScanMatcher::NearestAgain(const Eigen::Vector2d& point,
                              const Eigen::Vector2d& normal, double radius,
                              double step, int hint, Lookup* lookup) const {
  if (reference_.empty()) return -1;
  if (lookup->reach >= 0.0 &&
      (normal - lookup->normal).squaredNorm() < kListTurn * kListTurn) {
    // What is not in the list is farther away than this, whatever was rounded.
    const double known =
        lookup->reach - (point - lookup->center).norm() - kRounding;
    Nearest nearest{-1, radius * radius};
    for (int k = lookup->begin; k < lookup->end; ++k) {
      const Neighbour& candidate = around_[k];
      const double distance =
          (candidate.surface.position - point).squaredNorm();
      if (!nearest.IsBetter(candidate.index, distance) ||
          candidate.surface.normal.dot(normal) < kSameSide) {
        continue;
      }
      nearest = {candidate.index, distance};
    }
    if (known > 0.0 && nearest.squared_distance < known * known) {
      return nearest.index;
    }
  }
  // A list pays once the point hardly moves.
  if (step < kListStep) {
    return NearestAndAround(point, normal, radius,
                            std::max(2.0 * step, kListMargin), hint, lookup);
  }
  lookup->reach = -1.0;
  return NearestReference(point, normal, radius, hint);
}

ScanMatcher::Sums ScanMatcher::SumUp(const Pose2& pose, double radius,
                                     std::size_t stride,
                                     const Eigen::Vector3d& step) const {
  Sums sums;
  const double inverse_variance =
      1.0 / (options_.point_sigma * options_.point_sigma);
  const double c = std::cos(pose[2]);
  const double s = std::sin(pose[2]);
  const double shift = step.head<2>().norm();
  const double turn = std::abs(step[2]);
  double xx = 0.0, xy = 0.0, xt = 0.0, yy = 0.0, yt = 0.0, tt = 0.0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Eigen::Matrix3d crossed = Eigen::Matrix3d::Zero();
  int neighbour = -1;
  for (std::size_t i = stride / 2; i < points_.size(); i += stride) {
    const Surface& point = points_[i];
    ++sums.tried;
    const Eigen::Vector2d rotated(
        c * point.position.x() - s * point.position.y(),
        s * point.position.x() + c * point.position.y());
    const Eigen::Vector2d position = rotated + pose.head<2>();
    const Eigen::Vector2d normal(c * point.normal.x() - s * point.normal.y(),
                                 s * point.normal.x() + c * point.normal.y());
    // The partner that it had is near, as is that of the beam before.
    Lookup& lookup = lookups_[i];
    const int index = NearestAgain(
        position, normal, radius, shift + turn * rotated.lpNorm<1>(),
        lookup.partner >= 0 ? lookup.partner : neighbour, &lookup);
    lookup.partner = index;
    neighbour = index;
    if (index < 0) {
      sums.cost += kUnmatchedCost;
      continue;
    }
    const Surface& partner = reference_[index];
    const Eigen::Vector2d& n = partner.normal;
    const double error = n.dot(position - partner.position);
    const double squared = error * error * inverse_variance;
    // Cauchy weight.
    const double weight = inverse_variance / (1.0 + squared / 4.0);
    sums.cost += std::min(kUnmatchedCost, squared);
    ++sums.inliers;
    // The error's derivatives are the normal and this one.
    const double by_turn = n.y() * rotated.x() - n.x() * rotated.y();
    const double wx = weight * n.x();
    const double wy = weight * n.y();
    const double wt = weight * by_turn;
    xx += wx * n.x();
    xy += wx * n.y();
    xt += wx * by_turn;
    yy += wy * n.y();
    yt += wy * by_turn;
    tt += wt * by_turn;
    const Eigen::Vector3d weighted(wx, wy, wt);
    gradient += error * weighted;
    crossed += weighted * Eigen::RowVector3d(normal.x(), normal.y(),
                                             normal.y() * rotated.x() -
                                                 normal.x() * rotated.y());
  }
  sums.information << xx, xy, xt, xy, yy, yt, xt, yt, tt;
  sums.gradient = gradient;
  sums.crossed = 0.5 * (crossed + crossed.transpose());
  return sums;
}

MatchResult ScanMatcher::Refine(const std::vector<ScanPoint>& scan,
                                const Pose2& guess,
                                const MatchPrior& prior) const {
  MatchResult result;
  result.pose = guess;
  points_.clear();
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    points_.push_back({point.position, point.normal});
  }
  lookups_.assign(points_.size(), Lookup());
  around_.clear();
  // Far apart they share less; points between them add nothing of their own.
  const double independence = std::min(options_.independence, OwnShare(scan));
  // The gate shrinks over the first iterations: wide to be pulled in, narrow to
  // be exact, and at once where the pose hardly moves. Until it is narrow some
  // of the points are enough.
  const std::size_t stride = std::max<std::size_t>(
      1, points_.size() /
             static_cast<std::size_t>(std::max(1, options_.coarse_points)));
  double progress = 0.0;
  PosesBefore before;
  Eigen::Matrix3d by_prior = Eigen::Matrix3d::Zero();
  Eigen::Vector3d step = Eigen::Vector3d::Constant(kFarthestReach);
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    const bool is_coarse = progress < 1.0;
    const double radius =
        options_.initial_radius +
        progress * (options_.final_radius - options_.initial_radius);
    const Sums sums = SumUp(result.pose, radius, is_coarse ? stride : 1, step);
    const double share = is_coarse ? independence * stride : independence;
    const Eigen::Matrix3d information = share * sums.information;
    Eigen::Vector3d gradient = share * sums.gradient;
    result.inliers = sums.inliers;
    result.inlier_ratio =
        sums.tried > 0 ? static_cast<double>(sums.inliers) / sums.tried : 0.0;
    result.cost = sums.tried > 0 ? sums.cost / sums.tried : kUnmatchedCost;
    Eigen::Vector3d difference = result.pose - prior.pose;
    difference[2] = NormalizeAngle(difference[2]);
    // The prior may be heavy tailed: odometry that is plainly wrong (a slip, a
    // turn, a direction of travel with the wrong sign) must not drag along.
    const double prior_squared = difference.dot(prior.information * difference);
    const double prior_weight =
        prior.is_heavy_tailed ? 1.0 / (1.0 + prior_squared / 3.0) : 1.0;
    Eigen::Matrix3d hessian = information + prior_weight * prior.information;
    gradient += prior_weight * (prior.information * difference);
    hessian.diagonal().array() += kLeastInformation;
    step = hessian.ldlt().solve(-gradient);
    result.information = share * sums.crossed;
    result.curvature = information;
    by_prior = prior_weight * prior.information;
    if (!step.allFinite()) break;
    result.pose += step;
    result.pose[2] = NormalizeAngle(result.pose[2]);
    const double shift = step.head<2>().norm();
    const double turn = std::abs(step[2]);
    if (!is_coarse && shift < options_.convergence &&
        turn < options_.convergence) {
      break;
    }
    if (!is_coarse && before.ClosesCircle(options_.convergence, &result.pose)) {
      break;
    }
    if (shift < kCalmShift && turn < kCalmTurn) progress = 1.0;
    progress = std::max(progress,
                        std::min(1.0, (iteration + 1) / kShrinkingIterations));
  }
  result.information = WithoutNegative(result.information);
  by_prior.diagonal().array() += kLeastInformation;
  result.covariance = (result.information + by_prior).inverse();
  return result;
}

double ScanMatcher::Overlap(const std::vector<ScanPoint>& scan,
                            const Pose2& pose) const {
  const PoseTransform transform(pose);
  int tried = 0;
  int found = 0;
  int neighbour = -1;
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    ++tried;
    neighbour = AnyReference(transform.Point(point.position),
                             transform.Direction(point.normal),
                             options_.initial_radius, neighbour);
    if (neighbour >= 0) ++found;
  }
  return tried > 0 ? static_cast<double>(found) / tried : 0.0;
}

bool ScanMatcher::OverlapsBy(double least, const std::vector<ScanPoint>& scan,
                             const Pose2& pose) const {
  const auto tried = std::count_if(
      scan.begin(), scan.end(),
      [](const ScanPoint& point) { return point.normal.squaredNorm() > 0.0; });
  if (tried == 0) return 0.0 >= least;
  const auto is_enough = [&](std::ptrdiff_t found) {
    return static_cast<double>(found) / static_cast<double>(tried) >= least;
  };
  if (is_enough(0)) return true;
  const PoseTransform transform(pose);
  std::ptrdiff_t found = 0;
  std::ptrdiff_t left = tried;
  int neighbour = -1;
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    --left;
    neighbour = AnyReference(transform.Point(point.position),
                             transform.Direction(point.normal),
                             options_.initial_radius, neighbour);
    if (neighbour >= 0 && is_enough(++found)) return true;
    if (neighbour < 0 && !is_enough(found + left)) return false;
  }
  return false;
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

void ScanMatcher::BuildFree() const {
  if (!field_valid_) BuildField();
  const double resolution = options_.grid_resolution;
  free_.assign(field_.size(), 0);
  const auto is_on_grid = [this](const Eigen::Vector2d& cell) {
    return cell.x() >= 0.0 && cell.y() >= 0.0 && cell.x() < field_columns_ &&
           cell.y() < field_rows_;
  };
  for (std::size_t v = 0; v < viewpoints_.size(); ++v) {
    const Eigen::Vector2d origin =
        (viewpoints_[v].position - origin_) / resolution;
    const std::size_t end =
        v + 1 < viewpoints_.size() ? viewpoints_[v + 1].begin : rays_.size();
    for (std::size_t i = viewpoints_[v].begin; i < end; ++i) {
      const Eigen::Vector2d ray =
          (rays_[i].position - origin_) / resolution - origin;
      const double length = ray.norm();
      const double reach =
          std::min(length - kFreeMargin / resolution, kFreeReach / resolution);
      if (!(reach > 0.0)) continue;
      const Eigen::Vector2d step = ray / length;
      // Numbers are converted to int in one instruction, to std::size_t in
      // many.
      const auto mark = [&](const Eigen::Vector2d& cell) {
        free_[static_cast<std::size_t>(static_cast<int>(cell.y())) *
                  field_columns_ +
              static_cast<std::size_t>(static_cast<int>(cell.x()))] = 1;
      };
      const int count = static_cast<int>(std::ceil(reach));
      if (is_on_grid(origin) && is_on_grid(origin + (count - 1) * step)) {
        for (int k = 0; k < count; ++k) mark(origin + k * step);
        continue;
      }
      for (int k = 0; k < count; ++k) {
        const Eigen::Vector2d cell = origin + k * step;
        if (!is_on_grid(cell)) break;
        mark(cell);
      }
    }
  }
  free_valid_ = true;
}

void ScanMatcher::BuildLevels() const {
  if (!free_valid_) BuildFree();
  const int columns = field_columns_ + kPeakPad;
  const int rows = field_rows_ + kPeakPad;
  std::vector<std::int16_t> scores(static_cast<std::size_t>(columns) * rows, 0);
  for (int y = 0; y < field_rows_; ++y) {
    for (int x = 0; x < field_columns_; ++x) {
      const std::size_t cell = static_cast<std::size_t>(y) * field_columns_ + x;
      scores[static_cast<std::size_t>(y + kPeakPad) * columns + x + kPeakPad] =
          field_[cell] == 0 && free_[cell] != 0
              ? kThrough
              : static_cast<std::int16_t>(field_[cell]);
    }
  }
  levels_ = ScoreLevels(std::move(scores), columns, rows);
}

std::vector<ScoredPose> ScanMatcher::Peaks(
    const std::vector<Eigen::Vector2d>& points, const Pose2& center,
    double translation_window, double rotation_window, double minimum_score,
    double share, int max_peaks, double reach,
    const std::function<bool()>& stop, std::int64_t* nodes) const {
  if (reference_.empty() || points.empty()) return {};
  return FindPeaks(GridOfPeaks(), points, center, translation_window,
                   rotation_window,
                   {minimum_score, share, max_peaks, reach, nodes}, stop);
}

double ScanMatcher::ClearestScore(const std::vector<Eigen::Vector2d>& points,
                                  const Pose2& center,
                                  double translation_window,
                                  double rotation_window, double reach,
                                  const std::function<bool()>& stop) const {
  if (reference_.empty() || points.empty()) return 0.0;
  return plumbline::ClearestScore(GridOfPeaks(), points, center,
                                  translation_window, rotation_window, reach,
                                  stop);
}

PeakGrid ScanMatcher::GridOfPeaks() const {
  if (levels_.empty()) BuildLevels();
  return {levels_, field_columns_ + kPeakPad, field_rows_ + kPeakPad,
          origin_, options_.grid_resolution,  viewpoints_};
}

std::vector<double> ScanMatcher::Errors(const std::vector<ScanPoint>& scan,
                                        const Pose2& pose) const {
  std::vector<double> errors(scan.size(),
                             std::numeric_limits<double>::infinity());
  const PoseTransform transform(pose);
  int neighbour = -1;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (scan[i].normal.squaredNorm() == 0.0) continue;
    const Eigen::Vector2d position = transform.Point(scan[i].position);
    const int index =
        NearestReference(position, transform.Direction(scan[i].normal),
                         options_.final_radius, neighbour);
    if (index < 0) continue;
    neighbour = index;
    const Surface& partner = reference_[index];
    errors[i] = std::abs(partner.normal.dot(position - partner.position));
  }
  return errors;
}

ScanAgreement ScanMatcher::Compare(const std::vector<ScanPoint>& scan,
                                   const Pose2& pose,
                                   const Eigen::Vector2d& laser,
                                   std::vector<bool>* intruders) const {
  ScanAgreement agreement;
  if (intruders != nullptr) intruders->assign(scan.size(), false);
  if (reference_.empty() || scan.empty()) return agreement;
  if (!free_valid_) BuildFree();
  const double resolution = options_.grid_resolution;
  const PoseTransform transform(pose);
  Eigen::Vector2d last = Eigen::Vector2d::Constant(1e9);
  // Nearest and farthest return by bearing.
  std::vector<double> nearest(kBearings, 0.0);
  for (const ScanPoint& point : scan) {
    const Eigen::Vector2d ray = point.position - laser;
    const int bearing = static_cast<int>((std::atan2(ray.y(), ray.x()) + kPi) *
                                         (kBearings / (2.0 * kPi))) %
                        kBearings;
    double& range = nearest[bearing];
    if (range == 0.0 || ray.norm() < range) range = ray.norm();
    const bool counts = (last - point.position).squaredNorm() >=
                        kCompareSpacing * kCompareSpacing;
    if (counts) last = point.position;
    if (!counts && intruders == nullptr) continue;
    const Eigen::Vector2d local =
        (transform.Point(point.position) - origin_) / resolution;
    bool hits = false;
    bool intrudes = false;
    if (local.x() >= 0.0 && local.y() >= 0.0 && local.x() < field_columns_ &&
        local.y() < field_rows_) {
      const std::size_t cell =
          static_cast<std::size_t>(local.y()) * field_columns_ +
          static_cast<std::size_t>(local.x());
      hits = field_[cell] >= kHitLikelihood;
      intrudes = field_[cell] == 0 && free_[cell] != 0;
    }
    if (intruders != nullptr) (*intruders)[&point - scan.data()] = intrudes;
    if (counts) {
      ++(hits       ? agreement.hits
         : intrudes ? agreement.intruders
                    : agreement.unknown);
    }
  }
  // The other way round; beside a beam its neighbours must look through too.
  const Pose2 inverse = Inverse(pose);
  const PoseTransform back(inverse);
  last = Eigen::Vector2d::Constant(1e9);
  const Eigen::Vector2d eye = transform.Point(laser);
  for (const Surface& surface : rays_) {
    const Eigen::Vector2d& position = surface.position;
    // Surfaces that look away have been seen from behind.
    if (surface.normal.dot(eye - position) < 0.0) continue;
    if ((last - position).squaredNorm() < kCompareSpacing * kCompareSpacing) {
      continue;
    }
    last = position;
    const Eigen::Vector2d ray = back.Point(position) - laser;
    const double distance = ray.norm();
    const int bearing = static_cast<int>((std::atan2(ray.y(), ray.x()) + kPi) *
                                         (kBearings / (2.0 * kPi))) %
                        kBearings;
    double range = std::numeric_limits<double>::infinity();
    for (int step = -1; step <= 1; ++step) {
      range =
          std::min(range, nearest[(bearing + step + kBearings) % kBearings]);
    }
    const double margin = kFreeMargin + kFreeShare * distance;
    if (distance > kFreeReach || range == 0.0 || distance > range + margin) {
      continue;
    }
    ++agreement.seen;
    if (distance < range - margin) ++agreement.seen_through;
  }
  return agreement;
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

  const int steps = static_cast<int>(
      std::ceil(translation_window / options_.search_step - 1e-9));
  const FieldView field{
      field_, field_columns_, field_rows_, options_.grid_resolution,
      (center.head<2>() - origin_) / options_.grid_resolution};
  const Lattice lattice{center[2], rotation_window, options_.rotation_step,
                        steps, options_.search_step};
  const LatticePose best = FindBestOnLattice(field, points, lattice);
  if (score != nullptr) *score = best.score;
  // Where nothing fits at all the prediction stands.
  return Pose2(center[0] + best.column * options_.search_step,
               center[1] + best.row * options_.search_step,
               NormalizeAngle(center[2] + best.angle));
}

}  // namespace plumbline
