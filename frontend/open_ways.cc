#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/symmetric_ordering.h>
#include <plumbline/frontend/open_ways.h>
#include <plumbline/frontend/place_grid.h>
#include <plumbline/frontend/way_lengths.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// A longer step between key scans is a jump, not a way, m.
constexpr double kLongestStep = 1.5;

// Shifts that are tried along the weakest direction, m.
constexpr std::array<double, 3> kShifts = {0.25, 0.5, 1.0};
// Where the curvature says no worse than this, m, it is no scatter of normals.
constexpr double kSureSigma = 0.03;
// A shifted scan keeps its place along the shift to within this, m.
constexpr double kHeldSigma = 0.01;
// What returns leave open in the other directions, m and rad, keeps the
// numbers finite.
constexpr double kFarSigma = 100.0;
constexpr double kOpenTurn = 1.0;
// Where the map is not asked whether it bends, rad.
constexpr double kKnownTurn = 1e-3;
// Without a match: the heading by odometry, rad a metre, and the way aside.
constexpr double kWheelTurn = DegToRad(5.0);

// Places between two whose distances are looked at.
constexpr std::size_t kDistanceStep = 4;

// Of a place, between two times that `stop` is asked.
constexpr std::size_t kPlacesAtOnce = 64;

// What a match says of the place of one scan.
struct Knowledge {
  // Place that the reference is bound to; -1: there is none.
  int from = -1;
  // In the map frame around the later place (m, m, rad).
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  // Standard deviation in the weakest direction, m.
  double weakest = std::numeric_limits<double>::infinity();
};

Eigen::Matrix3d Regular(const Eigen::Matrix3d& information) {
  Eigen::Matrix3d regular = information;
  regular.diagonal() += Eigen::Vector3d(1.0 / (kFarSigma * kFarSigma),
                                        1.0 / (kFarSigma * kFarSigma),
                                        1.0 / (kOpenTurn * kOpenTurn));
  return regular;
}

// Compares one scan with a reference.
class Comparison {
 public:
  // `scan` must outlive it.
  Comparison(const OpenWayOptions& options, std::vector<ScanPoint> reference,
             const std::vector<ScanPoint>& scan)
      : matcher_(Near(options)),
        independence_(options.matcher.independence),
        scan_(scan) {
    matcher_.SetReference(std::move(reference));
  }

  // What the returns say of the scan's place near this pose.
  Knowledge Run(const Pose2& pose) const {
    Knowledge knowledge;
    MatchPrior none;
    none.pose = pose;
    const MatchResult here = matcher_.Refine(scan_, pose, none);
    if (here.inliers < kFewest) return knowledge;
    const Eigen::Matrix3d information = Regular(here.information);
    // The weakest direction of the position, and the turn that goes with it.
    const Eigen::Vector2d coupling =
        information.topRightCorner<2, 1>() / information(2, 2);
    const Eigen::Matrix2d position =
        information.topLeftCorner<2, 2>() -
        information(2, 2) * coupling * coupling.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(position);
    const double curvature = solver.eigenvalues()[0];
    Eigen::Vector3d along;
    along.head<2>() = solver.eigenvectors().col(0);
    along[2] = -coupling.dot(along.head<2>());
    double known = curvature;
    if (curvature < 1.0 / (kSureSigma * kSureSigma)) {
      known = std::min(known, KnownByShifts(here, along));
    }
    known = std::max(known, 1.0 / (kFarSigma * kFarSigma));
    knowledge.weakest = 1.0 / std::sqrt(known);
    const Eigen::Matrix3d covariance =
        information.inverse() +
        (1.0 / known - 1.0 / curvature) * along * along.transpose();
    knowledge.information = covariance.inverse();
    return knowledge;
  }

 private:
  static constexpr int kFewest = 20;

  static ScanMatcherOptions Near(const OpenWayOptions& options) {
    ScanMatcherOptions matcher = options.matcher;
    matcher.initial_radius = matcher.final_radius;
    matcher.max_iterations = 5;
    matcher.coarse_points = std::numeric_limits<int>::max();
    return matcher;
  }

  // How much worse the scan fits where it is shifted along this direction, as
  // information, 1/m^2. It finds its place across it.
  double KnownByShifts(const MatchResult& here,
                       const Eigen::Vector3d& along) const {
    const Eigen::Vector2d direction = along.head<2>();
    MatchPrior prior;
    prior.information.topLeftCorner<2, 2>() =
        direction * direction.transpose() / (kHeldSigma * kHeldSigma);
    const double returns = here.inliers / here.inlier_ratio;
    double least = std::numeric_limits<double>::infinity();
    for (const double shift : kShifts) {
      for (const double sign : {1.0, -1.0}) {
        prior.pose = here.pose + sign * shift * along;
        const double cost =
            matcher_.Refine(scan_, prior.pose, prior).cost - here.cost;
        least = std::min(least, std::max(0.0, independence_ * returns * cost) /
                                    (shift * shift));
      }
    }
    return least;
  }

  ScanMatcher matcher_;
  double independence_;
  const std::vector<ScanPoint>& scan_;
};

// First and last place of a part of the way.
using Run = std::pair<std::size_t, std::size_t>;

// Places along the way, and what is known of each.
struct Places {
  // Of the keys, ascending.
  std::vector<std::size_t> keys;
  // From the first key, m; of all keys.
  std::vector<double> way;
  // Against what was seen just before, and on other visits.
  std::vector<Knowledge> before;
  std::vector<Knowledge> other;
  // Whether the robot came here from the place before, all the way.
  std::vector<bool> follows;

  double LengthOf(const Run& run) const {
    return way[keys[run.second]] - way[keys[run.first]];
  }

  // Whether the returns tell the place at least so well, m.
  bool IsTold(std::size_t p, double sigma) const {
    return std::min(before[p].weakest, other[p].weakest) <= sigma;
  }
};

class PlaceComparison {
 public:
  PlaceComparison(const std::vector<Scan>& scans, const std::vector<int>& keys,
                  const std::vector<Pose2>& poses,
                  const OpenWayOptions& options)
      : scans_(scans),
        keys_(keys),
        poses_(poses),
        options_(options),
        grid_(poses, options.radius) {}

  // What was seen just before says of a place; `place_of`: by key.
  Knowledge Before(const Places& places, const std::vector<int>& place_of,
                   std::size_t p) const {
    const std::size_t k = places.keys[p];
    std::vector<std::size_t> before;
    for (std::size_t j = k; places.follows[p] && j-- > 0 &&
                            places.way[k] - places.way[j] <= options_.visit;) {
      const bool is_jump =
          j + 1 < k &&
          !places.follows[static_cast<std::size_t>(place_of[j + 1])] &&
          places.keys[static_cast<std::size_t>(place_of[j + 1])] == j + 1;
      if (is_jump) break;
      before.push_back(j);
    }
    Knowledge knowledge = Compare(k, before);
    knowledge.from = before.empty() ? -1 : static_cast<int>(p) - 1;
    return knowledge;
  }

  // What was seen on other visits says of it.
  Knowledge Others(const Places& places, const std::vector<int>& place_of,
                   std::size_t p) const {
    const std::size_t k = places.keys[p];
    std::vector<std::pair<double, std::size_t>> others;
    grid_.Around(poses_[k].head<2>(), [&](std::size_t j) {
      const double distance = (poses_[j] - poses_[k]).head<2>().norm();
      if (distance <= options_.radius &&
          std::abs(places.way[j] - places.way[k]) >= options_.least_way) {
        others.emplace_back(distance, j);
      }
    });
    std::sort(others.begin(), others.end());
    std::vector<std::size_t> nearest;
    for (const auto& [distance, j] : others) nearest.push_back(j);
    Knowledge knowledge = Compare(k, nearest);
    knowledge.from = nearest.empty() ? -1 : place_of[nearest.front()];
    return knowledge;
  }

 private:
  std::vector<ScanPoint> Returns(std::size_t k) const {
    std::vector<ScanPoint> points;
    ExtractScanPoints(scans_[static_cast<std::size_t>(keys_[k])],
                      options_.points, &points);
    return points;
  }

  // With some of these, the first among them.
  Knowledge Compare(std::size_t k, const std::vector<std::size_t>& all) const {
    if (all.empty()) return Knowledge();
    std::vector<ScanPoint> reference;
    const std::size_t step =
        (all.size() + options_.max_others - 1) / options_.max_others;
    for (std::size_t i = 0; i < all.size(); i += step) {
      const PoseTransform transform(poses_[all[i]]);
      for (const ScanPoint& point : Returns(all[i])) {
        reference.push_back(Moved(point, transform));
      }
    }
    const std::vector<ScanPoint> scan = Returns(k);
    return Comparison(options_, std::move(reference), scan).Run(poses_[k]);
  }

  const std::vector<Scan>& scans_;
  const std::vector<int>& keys_;
  const std::vector<Pose2>& poses_;
  const OpenWayOptions& options_;
  PlaceGrid grid_;
};

// How good odometry is along the way: variance a metre, m, its scale, and the
// scale's variance.
struct WheelModel {
  double variance = 0.0;
  double scale = 1.0;
  double scale_variance = 0.0;
};

// From the pieces of the way along which the returns tell it.
WheelModel LearnWheels(const std::vector<Scan>& scans,
                       const std::vector<int>& keys,
                       const std::vector<Pose2>& poses, const Places& places,
                       const OpenWayOptions& options) {
  double by_wheels = 0.0;
  double by_map = 0.0;
  std::vector<std::pair<double, double>> pieces;
  for (std::size_t p = 1; p < places.keys.size(); ++p) {
    if (!places.follows[p] || !places.IsTold(p, kSureSigma) ||
        !places.IsTold(p - 1, kSureSigma)) {
      continue;
    }
    const std::size_t a = places.keys[p - 1];
    const std::size_t b = places.keys[p];
    const Pose2 wheels =
        Between(scans[static_cast<std::size_t>(keys[a])].odometry,
                scans[static_cast<std::size_t>(keys[b])].odometry);
    const double map = (poses[b] - poses[a]).head<2>().norm();
    pieces.emplace_back(wheels.head<2>().norm(), map);
    by_wheels += pieces.back().first;
    by_map += map;
  }
  WheelModel model;
  const double prior = options.odometry_sigma * options.odometry_sigma;
  double squares = prior * options.prior_way;
  const double scale_prior = options.scale_sigma * options.scale_sigma;
  // The scale that is likeliest with this noise.
  model.scale = (by_map * by_wheels + prior / scale_prior) /
                (by_wheels * by_wheels + prior / scale_prior);
  for (const auto& [wheels, map] : pieces) {
    // Slips are not what odometry usually does.
    const double left = std::min(
        std::abs(map - model.scale * wheels),
        3.0 * options.odometry_sigma * std::sqrt(std::max(wheels, 0.1)));
    squares += left * left;
  }
  model.variance = squares / (options.prior_way + by_wheels);
  model.scale_variance = 1.0 / (1.0 / scale_prior + by_wheels / model.variance);
  return model;
}

double SigmaByWheels(const WheelModel& wheels, double way) {
  return std::sqrt(wheels.variance * way + wheels.scale_variance * way * way);
}

// How much longer the map has this part of the way than odometry, m; nothing
// is said of short ones.
double MissedBy(const std::vector<Scan>& scans, const std::vector<int>& keys,
                const std::vector<Pose2>& poses, const Places& places,
                const WheelModel& wheels, const Run& run,
                const OpenWayOptions& options) {
  if (places.LengthOf(run) < options.least_length) return 0.0;
  double missed = 0.0;
  for (std::size_t p = run.first + 1; p <= run.second; ++p) {
    const std::size_t a = places.keys[p - 1];
    const std::size_t b = places.keys[p];
    missed += (poses[b] - poses[a]).head<2>().norm() -
              wheels.scale *
                  Between(scans[static_cast<std::size_t>(keys[a])].odometry,
                          scans[static_cast<std::size_t>(keys[b])].odometry)
                      .head<2>()
                      .norm();
  }
  return missed;
}

// How far the length of a part of the way in the map may be off: what is known
// of it has this standard deviation with what was seen and `by_wheels` without.
// The square root of the difference of the squares is how far the one may lead
// from the other; where the map lies farther off it is not what is known.
double SigmaOfMap(double sigma, double by_wheels, double missed) {
  const double explained = by_wheels * by_wheels - sigma * sigma;
  return std::sqrt(sigma * sigma +
                   std::max(0.0, missed * missed - std::max(0.0, explained)));
}

// Where the returns say less of the way than odometry does.
std::vector<Run> OpenRuns(const Places& places, const WheelModel& wheels,
                          const OpenWayOptions& options) {
  const double open_sigma = std::sqrt(wheels.variance * options.spacing);
  std::vector<Run> runs;
  for (std::size_t p = 1; p < places.keys.size(); ++p) {
    if (!places.follows[p] || places.IsTold(p, open_sigma)) continue;
    if (runs.empty() || runs.back().second + 1 != p) runs.push_back({p - 1, p});
    runs.back().second = p;
  }
  return runs;
}

// How much of the way from one place to another lies in runs, m.
double LengthWithin(const Places& places, const Run& part,
                    const std::vector<Run>& runs) {
  double length = 0.0;
  for (const Run& run : runs) {
    const Run common(std::max(part.first, run.first),
                     std::min(part.second, run.second));
    if (common.first < common.second) length += places.LengthOf(common);
  }
  return length;
}

// The places whose distances from `from` are looked at.
std::vector<std::size_t> FartherPlaces(const Places& places, std::size_t from,
                                       const OpenWayOptions& options) {
  std::vector<std::size_t> farther;
  for (std::size_t p = from + 1; p < places.keys.size() && places.follows[p] &&
                                 places.LengthOf({from, p}) <= options.most_way;
       ++p) {
    if ((p - from) % kDistanceStep == 0) farther.push_back(p);
  }
  return farther;
}

// The linear system of all places; their headings are known this well anyway,
// rad.
class Network {
 public:
  Network(const std::vector<Pose2>& poses, const Places& places,
          const WheelModel& wheels, double heading_sigma,
          const OpenWayOptions& options)
      : poses_(poses), places_(places), wheels_(wheels), options_(options) {
    const auto size = static_cast<Eigen::Index>(3 * places.keys.size());
    bias_ = Eigen::VectorXd::Zero(size);
    for (std::size_t p = 0; p < places.keys.size(); ++p) AddPlace(p);
    for (Eigen::Index i = 0; i < size; ++i) {
      const double least = i % 3 == 2 ? heading_sigma : kFarSigma;
      entries_.emplace_back(i, i, 1.0 / (least * least));
    }
    Eigen::SparseMatrix<double> normal(size, size);
    normal.setFromTriplets(entries_.begin(), entries_.end());
    solver_.compute(normal);
    by_scale_ = solver_.solve(bias_);
    // Odometry's scale is one more unknown of the system: all that is known of
    // the places tells it, not only the pieces that show it well.
    scale_variance_ =
        1.0 / std::max(1.0 / (options.scale_sigma * options.scale_sigma),
                       1.0 / (options.scale_sigma * options.scale_sigma) +
                           scale_information_ - bias_.dot(by_scale_));
  }

  // Standard deviation of the length of a part of the way, m.
  double SigmaOf(const Run& run) const {
    Eigen::VectorXd length = Eigen::VectorXd::Zero(bias_.size());
    for (std::size_t p = run.first + 1; p <= run.second; ++p) {
      const Eigen::Vector2d step = Step(p);
      const double way = step.norm();
      if (way == 0.0) continue;
      length.segment<2>(static_cast<Eigen::Index>(3 * p)) += step / way;
      length.segment<2>(static_cast<Eigen::Index>(3 * (p - 1))) -= step / way;
    }
    const double by_scale = length.dot(by_scale_);
    return std::sqrt(std::max(0.0, length.dot(solver_.solve(length))) +
                     scale_variance_ * by_scale * by_scale);
  }

  // The distance between two places that is known worst, and its standard
  // deviation, m.
  std::pair<double, double> WorstDistance() const {
    const std::size_t count = places_.keys.size();
    // Of the positions of a place, and of those of a place and a farther one.
    std::vector<Eigen::Matrix2d> own(count);
    std::vector<std::vector<Eigen::Matrix2d>> shared(count);
    std::vector<std::vector<std::size_t>> farther(count);
    for (std::size_t p = 0; p < count; p += kDistanceStep) {
      Eigen::MatrixXd position = Eigen::MatrixXd::Zero(bias_.size(), 2);
      position.middleRows<2>(static_cast<Eigen::Index>(3 * p)).setIdentity();
      const Eigen::MatrixXd covariance = solver_.solve(position);
      const auto of = [&](std::size_t other) -> Eigen::Matrix2d {
        return covariance.middleRows<2>(static_cast<Eigen::Index>(3 * other));
      };
      own[p] = of(p);
      farther[p] = FartherPlaces(places_, p, options_);
      for (const std::size_t q : farther[p]) shared[p].push_back(of(q));
    }
    std::pair<double, double> worst(0.0, 0.0);
    for (std::size_t p = 0; p < count; p += kDistanceStep) {
      for (std::size_t i = 0; i < farther[p].size(); ++i) {
        const std::size_t q = farther[p][i];
        const Eigen::Vector2d between = Difference(p, q);
        const double distance = between.norm();
        if (distance < options_.least_length) continue;
        const Eigen::Vector2d along = between / distance;
        const Eigen::Matrix2d covariance =
            own[p] + own[q] - shared[p][i] - shared[p][i].transpose();
        const double by_scale =
            along.dot(by_scale_.segment<2>(static_cast<Eigen::Index>(3 * q)) -
                      by_scale_.segment<2>(static_cast<Eigen::Index>(3 * p)));
        const double sigma =
            std::sqrt(std::max(0.0, along.dot(covariance * along)) +
                      scale_variance_ * by_scale * by_scale);
        if (sigma > worst.second) worst = {distance, sigma};
      }
    }
    return worst;
  }

 private:
  Eigen::Vector2d Difference(std::size_t from, std::size_t to) const {
    return (poses_[places_.keys[to]] - poses_[places_.keys[from]]).head<2>();
  }

  Eigen::Vector2d Step(std::size_t p) const { return Difference(p - 1, p); }

  void AddPlace(std::size_t p) {
    if (p > 0 && places_.follows[p]) AddWheels(p);
    for (const Knowledge* knowledge : {&places_.before[p], &places_.other[p]}) {
      if (knowledge->from < 0) continue;
      AddMatch(static_cast<std::size_t>(knowledge->from), p,
               knowledge->information);
    }
  }

  void AddWheels(std::size_t p) {
    const Eigen::Vector2d step = Step(p);
    const double way = std::max(0.01, step.norm());
    const Eigen::Vector2d along = step / way;
    const Eigen::Vector2d across(-along.y(), along.x());
    const double turn = kWheelTurn * way;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    information.topLeftCorner<2, 2>() =
        along * along.transpose() / (wheels_.variance * way) +
        across * across.transpose() /
            (wheels_.variance * way + turn * turn * way * way);
    information(2, 2) = 1.0 / (turn * turn);
    Add(p - 1, p, information);
    // Where a scale that is one unit too large would push both.
    const Eigen::Vector2d push = information.topLeftCorner<2, 2>() * step;
    scale_information_ += push.dot(step);
    bias_.segment<2>(static_cast<Eigen::Index>(3 * p)) += push;
    bias_.segment<2>(static_cast<Eigen::Index>(3 * (p - 1))) -= push;
    // The heading of the first takes the second along.
    bias_[static_cast<Eigen::Index>(3 * (p - 1) + 2)] -=
        Eigen::Vector2d(-step.y(), step.x()).dot(push);
  }

  void AddMatch(std::size_t from, std::size_t to,
                const Eigen::Matrix3d& information) {
    const Pose2 motion =
        Between(poses_[places_.keys[from]], poses_[places_.keys[to]]);
    const Eigen::Matrix3d covariance = Regular(information).inverse() +
                                       DriftCovariance(motion, options_.drift);
    Add(from, to, covariance.inverse());
  }

  // A relation between two places; `information` of the second's place in the
  // axes of the map.
  void Add(std::size_t from, std::size_t to,
           const Eigen::Matrix3d& information) {
    const Eigen::Vector2d step = Difference(from, to);
    Eigen::Matrix3d first = -Eigen::Matrix3d::Identity();
    first(0, 2) = step.y();
    first(1, 2) = -step.x();
    const std::array<std::pair<std::size_t, Eigen::Matrix3d>, 2> parts = {
        {{from, first}, {to, Eigen::Matrix3d::Identity()}}};
    for (const auto& [a, ja] : parts) {
      for (const auto& [b, jb] : parts) {
        const Eigen::Matrix3d block = ja.transpose() * information * jb;
        for (int row = 0; row < 3; ++row) {
          for (int column = 0; column < 3; ++column) {
            entries_.emplace_back(3 * a + row, 3 * b + column,
                                  block(row, column));
          }
        }
      }
    }
  }

  const std::vector<Pose2>& poses_;
  const Places& places_;
  const WheelModel& wheels_;
  const OpenWayOptions& options_;
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::VectorXd bias_;
  double scale_information_ = 0.0;
  SymmetricFactor<double> solver_;
  // How a scale that is one unit too large would move the places.
  Eigen::VectorXd by_scale_;
  double scale_variance_ = 0.0;
};

// Places along the way; nothing is known of them yet.
Places SpreadPlaces(const std::vector<Pose2>& poses,
                    const std::vector<bool>& follows,
                    const OpenWayOptions& options) {
  Places places;
  places.way = WayLengths(poses, kLongestStep);
  bool jumped = true;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const bool jumps =
        k > 0 && (!follows[k] ||
                  (poses[k] - poses[k - 1]).head<2>().norm() >= kLongestStep);
    jumped = jumped || jumps;
    if (!jumps && !places.keys.empty() &&
        places.way[k] - places.way[places.keys.back()] < options.spacing) {
      continue;
    }
    places.keys.push_back(k);
    places.follows.push_back(!jumped);
    jumped = false;
  }
  places.before.resize(places.keys.size());
  places.other.resize(places.keys.size());
  return places;
}

}  // namespace

double UncertainLengths::LargestSigma() const {
  double largest = 0.0;
  for (const OpenWay& way : ways) largest = std::max(largest, way.sigma);
  return largest;
}

std::vector<OpenWay> FindOpenWays(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& poses,
                                  const std::vector<bool>& follows,
                                  const OpenWayOptions& options,
                                  const std::function<bool()>& stop) {
  return FindUncertainLengths(scans, keys, poses, follows, options, stop).ways;
}

UncertainLengths FindUncertainLengths(const std::vector<Scan>& scans,
                                      const std::vector<int>& keys,
                                      const std::vector<Pose2>& poses,
                                      const std::vector<bool>& follows,
                                      const OpenWayOptions& options,
                                      const std::function<bool()>& stop) {
  if (keys.size() != poses.size() || keys.size() != follows.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(poses.size()) + " poses and " +
            std::to_string(follows.size()) + " steps",
        "one for each of " + std::to_string(keys.size()) + " key scans");
  }
  Places places = SpreadPlaces(poses, follows, options);
  const std::size_t count = places.keys.size();
  if (count < 2) return {};
  std::vector<int> place_of(poses.size(), -1);
  for (std::size_t p = 0; p < count; ++p) {
    const std::size_t end = p + 1 < count ? places.keys[p + 1] : poses.size();
    std::fill(place_of.begin() + static_cast<std::ptrdiff_t>(places.keys[p]),
              place_of.begin() + static_cast<std::ptrdiff_t>(end),
              static_cast<int>(p));
  }
  const PlaceComparison comparison(scans, keys, poses, options);
  // False when it was stopped.
  const auto for_all = [&](const auto& look) {
    for (std::size_t begin = 0; begin < count; begin += kPlacesAtOnce) {
      if (stop && stop()) return false;
      ParallelFor(std::min(kPlacesAtOnce, count - begin), options.num_threads,
                  [&](std::size_t i) { look(begin + i); });
    }
    return true;
  };
  if (!for_all([&](std::size_t p) {
        places.before[p] = comparison.Before(places, place_of, p);
      })) {
    return {};
  }
  // Odometry alone may be good enough: then nothing is left to be asked.
  const auto may_be_told = [&](const WheelModel& wheels, const Run& run) {
    return SigmaByWheels(wheels, places.LengthOf(run)) > options.told_sigma ||
           std::abs(MissedBy(scans, keys, poses, places, wheels, run,
                             options)) > options.told_sigma;
  };
  WheelModel wheels = LearnWheels(scans, keys, poses, places, options);
  std::vector<Run> runs = OpenRuns(places, wheels, options);
  const auto any_may_be_told = [&] {
    return std::any_of(runs.begin(), runs.end(), [&](const Run& run) {
      return may_be_told(wheels, run);
    });
  };
  const auto distance_may_be_told = [&] {
    for (std::size_t p = 0; p < count; p += kDistanceStep) {
      const std::vector<std::size_t> farther =
          FartherPlaces(places, p, options);
      if (!farther.empty() &&
          SigmaByWheels(wheels,
                        LengthWithin(places, {p, farther.back()}, runs)) >
              options.told_distance_sigma) {
        return true;
      }
    }
    return false;
  };
  if (!any_may_be_told() && !distance_may_be_told()) return {};
  if (!for_all([&](std::size_t p) {
        places.other[p] = comparison.Others(places, place_of, p);
      })) {
    return {};
  }
  wheels = LearnWheels(scans, keys, poses, places, options);
  runs = OpenRuns(places, wheels, options);
  UncertainLengths lengths;
  if (any_may_be_told()) {
    const Network network(poses, places, wheels, kOpenTurn, options);
    for (const Run& run : runs) {
      if (!may_be_told(wheels, run)) continue;
      OpenWay way;
      way.begin = keys[places.keys[run.first]];
      way.end = keys[places.keys[run.second]];
      way.length = places.LengthOf(run);
      way.sigma = SigmaOfMap(
          network.SigmaOf(run), SigmaByWheels(wheels, way.length),
          MissedBy(scans, keys, poses, places, wheels, run, options));
      if (way.sigma > options.told_sigma) lengths.ways.push_back(way);
    }
  }
  if (distance_may_be_told()) {
    const Network network(poses, places, wheels, kKnownTurn, options);
    const auto [distance, sigma] = network.WorstDistance();
    if (sigma > options.told_distance_sigma) {
      lengths.distance = distance;
      lengths.distance_sigma = sigma;
    }
  }
  return lengths;
}

}  // namespace plumbline
