#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/range_ratio.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace plumbline {
namespace {

// Views that are compared lie so near to each other, m; so many are at most,
// spread evenly over the track, in so many parts, each of which has so many at
// least.
constexpr double kNear = 1.0;
constexpr std::size_t kMostPairs = 160;
constexpr std::size_t kParts = 8;
constexpr std::size_t kLeastPairsOfPart = 2;
// A return is on the surface of one that lies so near to it, m, and whose
// normal has this cosine with its own; from the first round to the last.
constexpr double kGates[] = {0.4, 0.3, 0.2, 0.2, 0.15, 0.15};
constexpr double kSameNormal = 0.95;
// Residuals, m, from which on a return weighs less, and returns of a view that
// say enough.
constexpr double kRobust = 0.03;
constexpr std::size_t kLeastReturns = 30;

// Pose of the view, share and offset of ranges.
using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

// What a pair of views says of share and offset, the pose left free.
struct Said {
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();

  void Add(const Said& other) {
    information += other.information;
    sum += other.sum;
  }
  // The share; false where nothing tells it.
  bool Share(double* share) const {
    const double least = 1e-6 * information.trace();
    if (!(information.determinant() > least * least)) return false;
    *share = information.ldlt().solve(sum)[0];
    return true;
  }
};

// Points that have normals, by x.
std::vector<ScanPoint> Sorted(const std::vector<ScanPoint>& points) {
  std::vector<ScanPoint> sorted;
  for (const ScanPoint& point : points) {
    if (!point.normal.isZero()) sorted.push_back(point);
  }
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const ScanPoint& a, const ScanPoint& b) {
                     return a.position.x() < b.position.x();
                   });
  return sorted;
}

const ScanPoint* Nearest(const std::vector<ScanPoint>& sorted,
                         const Eigen::Vector2d& place,
                         const Eigen::Vector2d& normal, double gate) {
  const ScanPoint* nearest = nullptr;
  double least = gate;
  auto it = std::lower_bound(
      sorted.begin(), sorted.end(), place.x() - gate,
      [](const ScanPoint& a, double x) { return a.position.x() < x; });
  for (; it != sorted.end() && it->position.x() <= place.x() + gate; ++it) {
    const double distance = (it->position - place).norm();
    if (distance >= least || it->normal.dot(normal) < kSameNormal) continue;
    least = distance;
    nearest = &*it;
  }
  return nearest;
}

// Lays a view, which has this pose in the frame of `reference`, on it.
bool Compare(const std::vector<ScanPoint>& reference, const KeyView& view,
             Pose2 pose, Said* said) {
  double share = 0.0;
  double offset = 0.0;
  for (const double gate : kGates) {
    Matrix5 information = Matrix5::Zero();
    Vector5 sum = Vector5::Zero();
    std::size_t returns = 0;
    const PoseTransform transform(pose);
    for (const ScanPoint& point : view.points) {
      if (point.normal.isZero()) continue;
      const Eigen::Vector2d ray = point.position - view.laser;
      const double range = ray.norm();
      if (!(range > 0.0)) continue;
      // As a laser sees it that agrees with the map's.
      const Eigen::Vector2d seen =
          view.laser + ray * (1.0 - share - offset / range);
      const Eigen::Vector2d place = transform.Point(seen);
      const ScanPoint* const other =
          Nearest(reference, place, transform.Direction(point.normal), gate);
      if (other == nullptr) continue;
      const Eigen::Vector2d& normal = other->normal;
      const double residual = normal.dot(other->position - place);
      const Eigen::Vector2d arm = place - pose.head<2>();
      const double along = normal.dot(transform.Direction(ray));
      Vector5 row;
      row << normal.x(), normal.y(),
          normal.y() * arm.x() - normal.x() * arm.y(), -along, -along / range;
      const double weight = 1.0 / (1.0 + std::pow(residual / kRobust, 2));
      information += weight * row * row.transpose();
      sum += weight * residual * row;
      ++returns;
    }
    if (returns < kLeastReturns) return false;
    // About zero, as all pairs are put together.
    const Eigen::LDLT<Eigen::Matrix3d> of_pose(
        information.topLeftCorner<3, 3>());
    if (of_pose.info() != Eigen::Success ||
        !(of_pose.vectorD().minCoeff() > 1e-6 * of_pose.vectorD().maxCoeff())) {
      return false;
    }
    const Eigen::Matrix<double, 3, 2> cross =
        information.topRightCorner<3, 2>();
    said->information = information.bottomRightCorner<2, 2>() -
                        cross.transpose() * of_pose.solve(cross);
    said->sum =
        sum.tail<2>() -
        cross.transpose() * of_pose.solve(Eigen::Vector3d(sum.head<3>()));
    // Held a little where the view does not tell one from the other.
    Eigen::Matrix2d held = said->information;
    held(0, 0) += 1.0;
    held(1, 1) += 1.0;
    const Eigen::Vector2d step = held.ldlt().solve(said->sum);
    const Eigen::Vector3d moved =
        of_pose.solve(Eigen::Vector3d(sum.head<3>() - cross * step));
    said->sum += said->information * Eigen::Vector2d(share, offset);
    share += step[0];
    offset += step[1];
    pose += moved;
  }
  return true;
}

// Index of the nearest view; -1 for none within kNear.
int NearestView(const std::vector<KeyView>& map, const KeyView& view) {
  int nearest = -1;
  double least = kNear;
  for (std::size_t k = 0; k < map.size(); ++k) {
    const double distance = (map[k].pose - view.pose).head<2>().norm();
    if (distance >= least) continue;
    least = distance;
    nearest = static_cast<int>(k);
  }
  return nearest;
}

}  // namespace

std::optional<RangeRatio> CompareRanges(const std::vector<KeyView>& map,
                                        const std::vector<KeyView>& track) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t k = 0; k < track.size(); ++k) {
    const int near = NearestView(map, track[k]);
    if (near >= 0) pairs.emplace_back(static_cast<std::size_t>(near), k);
  }
  const std::size_t stride = (pairs.size() + kMostPairs - 1) / kMostPairs;
  RangeRatio ratio;
  Said all;
  std::vector<Said> parts(kParts);
  std::vector<std::size_t> in_part(kParts, 0);
  for (std::size_t i = 0; i < pairs.size();
       i += std::max<std::size_t>(1, stride)) {
    const KeyView& other = map[pairs[i].first];
    const KeyView& view = track[pairs[i].second];
    Said said;
    if (!Compare(Sorted(other.points), view, Between(other.pose, view.pose),
                 &said)) {
      continue;
    }
    const std::size_t part = i * kParts / pairs.size();
    all.Add(said);
    parts[part].Add(said);
    ++in_part[part];
    ++ratio.pairs;
  }
  if (!all.Share(&ratio.excess)) return std::nullopt;
  double squares = 0.0;
  std::size_t told = 0;
  for (std::size_t p = 0; p < kParts; ++p) {
    double share = 0.0;
    if (in_part[p] < kLeastPairsOfPart || !parts[p].Share(&share)) continue;
    squares += std::pow(share - ratio.excess, 2);
    ++told;
  }
  if (told < kParts / 2) return std::nullopt;
  ratio.sigma = std::sqrt(squares / static_cast<double>(told * (told - 1)));
  return ratio;
}

}  // namespace plumbline
