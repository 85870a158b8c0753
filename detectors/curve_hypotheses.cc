#include <plumbline/detectors/curve_hypotheses.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

// Points of a neighbourhood in which hypotheses are drawn; more where they are
// dense, until it is kNeighborhoodReach tolerances wide.
constexpr std::size_t kNeighborhood = 24;
constexpr std::size_t kMaxNeighborhood = 200;
constexpr double kNeighborhoodReach = 5.0;
constexpr int kLineDraws = 24;
// Points that are shuffled together.
constexpr int kShuffled = 1024;
constexpr int kCircleDraws = 48;
constexpr int kMaxRefits = 8;
// Points that a drawn curve is measured against between two looks whether it
// can still be the best.
constexpr Eigen::Index kGainsAtOnce = 32;
// Points that so many hypotheses explain are not grown from any more.
constexpr int kEnoughHypotheses = 2;
// Between two questions whether to stop: some milliseconds.
constexpr std::int64_t kDrawsPerStop = 64;

// Steele, Lea and Flood 2014: good numbers from any state, so that every point
// can have its own at no cost.
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t state) : state_(state) {}

  std::uint64_t operator()() {
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

 private:
  std::uint64_t state_;
};

class HypothesisDrawer {
 public:
  HypothesisDrawer(const CurvePoints& points, std::uint64_t seed)
      : points_(points),
        seed_(seed),
        random_(seed),
        size_(static_cast<std::size_t>(points.size())),
        inlier_stamp_(size_, 0),
        visit_stamp_(size_, 0),
        visit_gap_(size_, 0) {}

  std::vector<CurveHypothesis> Run(const DetectionScope& scope) {
    const std::vector<int> seeds = ShuffledSeeds();
    std::vector<CurveHypothesis> hypotheses;
    std::vector<int> neighborhood;
    std::int64_t draws = 0;
    std::int64_t explained_already = 0;
    for (int start = 0; start < kCurveStarts; ++start) {
      const double tolerance =
          points_.options().tolerance *
          std::pow(2.0, -0.5 * kCurveLevelsPerStart * start);
      for (const CurveKind kind : {CurveKind::kLine, CurveKind::kCircle}) {
        std::vector<int> explained(size_, 0);
        for (const int seed : seeds) {
          if (explained[static_cast<std::size_t>(seed)] >= kEnoughHypotheses) {
            ++explained_already;
            continue;
          }
          if (draws % kDrawsPerStop == 0 && scope.ShouldStop()) return {};
          ++draws;
          random_ = SplitMix(numbers_[static_cast<std::size_t>(seed)] +
                             2 * start + (kind == CurveKind::kLine ? 0 : 1));
          GrowNeighborhood(seed, tolerance, &neighborhood);
          CurveHypothesis hypothesis;
          if (!Draw(kind, neighborhood, tolerance, &hypothesis.curve) ||
              !Refine(neighborhood, tolerance, &hypothesis)) {
            continue;
          }
          for (const int i : hypothesis.inliers) {
            ++explained[static_cast<std::size_t>(i)];
          }
          hypotheses.push_back(std::move(hypothesis));
        }
      }
    }
    const auto found = static_cast<std::int64_t>(hypotheses.size());
    scope.Count("points", points_.size());
    scope.Count("points refused: claimed",
                points_.size() - static_cast<std::int64_t>(seeds.size()));
    scope.Count("draws", draws);
    scope.Count("draws left out: enough hypotheses there", explained_already);
    scope.Count("draws refused: not significant", draws - found);
    return hypotheses;
  }

 private:
  // A number below `bound`; the bias of the remainder is far below what
  // matters.
  int Draw(std::size_t bound) { return static_cast<int>(random_() % bound); }

  // A point's own number. It depends on nothing else, so that what is found
  // somewhere does not depend on what there is elsewhere.
  std::uint64_t NumberOf(int i) const {
    return SplitMix(seed_ ^
                    SplitMix(static_cast<std::uint64_t>(points_.id(i)))())();
  }

  // The free points, shuffled, but those far apart not with each other: points
  // that are near have near numbers mostly, and lie near each other in memory.
  std::vector<int> ShuffledSeeds() {
    std::vector<int> seeds;
    for (int i = 0; i < points_.size(); ++i) {
      if (points_.IsFree(i)) seeds.push_back(i);
    }
    numbers_.assign(size_, 0);
    for (const int i : seeds) {
      numbers_[static_cast<std::size_t>(i)] = NumberOf(i);
    }
    std::sort(seeds.begin(), seeds.end(), [this](int a, int b) {
      return std::make_tuple(a / kShuffled,
                             numbers_[static_cast<std::size_t>(a)], a) <
             std::make_tuple(b / kShuffled,
                             numbers_[static_cast<std::size_t>(b)], b);
    });
    return seeds;
  }

  // The free points that are nearest to `seed` along the edges.
  void GrowNeighborhood(int seed, double tolerance,
                        std::vector<int>* neighborhood) {
    ++stamp_;
    neighborhood->assign(1, seed);
    visit_stamp_[static_cast<std::size_t>(seed)] = stamp_;
    const double reach = kNeighborhoodReach * tolerance;
    bool is_wide = false;
    for (std::size_t k = 0; k < neighborhood->size(); ++k) {
      for (const int i : points_.neighbors((*neighborhood)[k])) {
        if (neighborhood->size() >=
            (is_wide ? kNeighborhood : kMaxNeighborhood)) {
          return;
        }
        auto& visited = visit_stamp_[static_cast<std::size_t>(i)];
        if (visited == stamp_ || !points_.IsFree(i)) continue;
        visited = stamp_;
        neighborhood->push_back(i);
        is_wide = is_wide ||
                  (points_.position(i) - points_.position(seed)).squaredNorm() >
                      reach * reach;
      }
    }
  }

  // The best of some curves through points drawn from the neighbourhood.
  bool Draw(CurveKind kind, const std::vector<int>& neighborhood,
            double tolerance, PlanarCurve* best) {
    if (neighborhood.size() < points_.MinPoints(kind)) return false;
    const int draws = kind == CurveKind::kLine ? kLineDraws : kCircleDraws;
    nearby_.resize(2, static_cast<Eigen::Index>(neighborhood.size()));
    for (std::size_t k = 0; k < neighborhood.size(); ++k) {
      nearby_.col(static_cast<Eigen::Index>(k)) =
          points_.position(neighborhood[k]);
    }
    double best_gain = 0.0;
    for (int draw = 0; draw < draws; ++draw) {
      PlanarCurve curve;
      std::array<Eigen::Vector2d, 3> sample;
      for (Eigen::Vector2d& position : sample) {
        position = nearby_.col(Draw(neighborhood.size()));
      }
      if (kind == CurveKind::kLine) {
        const Eigen::Vector2d along = sample[1] - sample[0];
        if (along.squaredNorm() == 0.0) continue;
        curve.position = sample[0];
        curve.direction = std::atan2(along.y(), along.x());
      } else if (!CircleThrough(sample[0], sample[1], sample[2], &curve) ||
                 curve.radius > points_.options().max_radius) {
        continue;
      }
      const double gain = Gain(curve, tolerance, best_gain);
      if (gain > best_gain) {
        best_gain = gain;
        *best = curve;
      }
    }
    return best_gain > 0.0;
  }

  // How well a curve fits to the points nearby, each at most 1; less than
  // `least` where it can't be more.
  double Gain(const PlanarCurve& curve, double tolerance, double least) const {
    const double inverse = 1.0 / tolerance;
    const double c = inverse * std::cos(curve.direction);
    const double s = inverse * std::sin(curve.direction);
    const double radius = inverse * curve.radius;
    const Eigen::Index size = nearby_.cols();
    double gain = 0.0;
    Eigen::Array<double, 1, kGainsAtOnce> ratios;
    for (Eigen::Index begin = 0; begin < size; begin += kGainsAtOnce) {
      if (gain + static_cast<double>(size - begin) <= least) return 0.0;
      const Eigen::Index count = std::min(size - begin, kGainsAtOnce);
      const auto x =
          nearby_.row(0).segment(begin, count).array() - curve.position.x();
      const auto y =
          nearby_.row(1).segment(begin, count).array() - curve.position.y();
      if (curve.kind == CurveKind::kCircle) {
        ratios.head(count) =
            inverse * (x.square() + y.square()).sqrt() - radius;
      } else {
        ratios.head(count) = c * y - s * x;
      }
      gain += (1.0 - ratios.head(count).square()).max(0.0).sum();
    }
    return gain;
  }

  // Extends and tightens a drawn curve; false when it is not significant.
  bool Refine(const std::vector<int>& neighborhood, double tolerance,
              CurveHypothesis* best) {
    CurveHypothesis current;
    current.curve = best->curve;
    current.inliers = neighborhood;
    for (int level = 0; level < kCurveLevelsPerStart; ++level) {
      current.tolerance = tolerance * std::pow(2.0, -0.5 * level);
      std::size_t last_count = 0;
      for (int i = 0; i < kMaxRefits; ++i) {
        if (!Extend(&current) ||
            !points_.Fit(current.inliers, &current.curve)) {
          return best->inliers.size() > 0;
        }
        if (current.inliers.size() == last_count) break;
        last_count = current.inliers.size();
      }
      if (!Extend(&current)) break;
      SortOut(&current);
      current.significance = CurveSignificance(points_, current, nullptr);
      if (current.significance >= -points_.options().max_log_false_alarms &&
          current.significance > best->significance) {
        *best = current;
      }
    }
    return best->inliers.size() > 0;
  }

  // Replaces the inliers by the largest connected set of free points within the
  // tolerance that has one of them, and the bystanders by all points beside it.
  // False when it is too small.
  bool Extend(CurveHypothesis* hypothesis) {
    const PlanarCurve& curve = hypothesis->curve;
    const double tolerance = hypothesis->tolerance;
    const CurveRuler ruler(curve);
    const auto is_inlier = [&](int i) {
      return std::abs(ruler.SignedDistance(points_.position(i))) <= tolerance;
    };
    const std::vector<int> starts = std::move(hypothesis->inliers);
    hypothesis->inliers.clear();
    hypothesis->bystanders.clear();
    const int epoch = ++stamp_;
    std::vector<int> inliers, bystanders;
    for (const int start : starts) {
      if (inlier_stamp_[static_cast<std::size_t>(start)] == epoch ||
          !points_.IsFree(start) || !is_inlier(start)) {
        continue;
      }
      inliers.assign(1, start);
      bystanders.clear();
      inlier_stamp_[static_cast<std::size_t>(start)] = epoch;
      const int visit = ++stamp_;
      // Points with the number of points off the curve on the way to them;
      // those on the curve first, the last found of them before all.
      on_curve_.assign(1, start);
      off_curve_.clear();
      std::size_t next = 0;
      while (!on_curve_.empty() || next < off_curve_.size()) {
        std::pair<int, int> entry;
        if (on_curve_.empty()) {
          entry = off_curve_[next++];
        } else {
          entry = {on_curve_.back(), 0};
          on_curve_.pop_back();
        }
        const auto [from, gap] = entry;
        for (const int i : points_.neighbors(from)) {
          const auto k = static_cast<std::size_t>(i);
          if (!points_.IsFree(i) || inlier_stamp_[k] == epoch) continue;
          const bool was_visited = visit_stamp_[k] == visit;
          if (was_visited && visit_gap_[k] <= gap + 1) continue;
          // What was visited is off the curve.
          if (!was_visited && is_inlier(i)) {
            inlier_stamp_[k] = epoch;
            inliers.push_back(i);
            on_curve_.push_back(i);
            continue;
          }
          if (!was_visited) bystanders.push_back(i);
          visit_stamp_[k] = visit;
          visit_gap_[k] = gap + 1;
          if (gap < points_.options().max_gap_points) {
            off_curve_.emplace_back(i, gap + 1);
          }
        }
      }
      if (inliers.size() > hypothesis->inliers.size()) {
        hypothesis->inliers.swap(inliers);
        hypothesis->bystanders.swap(bystanders);
      }
    }
    if (curve.kind == CurveKind::kLine) {
      points_.CutAtGaps(curve, &hypothesis->inliers);
    }
    return hypothesis->inliers.size() >= points_.MinPoints(curve.kind);
  }

  // Tells bystanders from strangers, which only the significance asks for.
  // Points beyond the ends of a line say nothing about it.
  void SortOut(CurveHypothesis* hypothesis) {
    const PlanarCurve& curve = hypothesis->curve;
    const CurveRuler ruler(curve);
    double begin = std::numeric_limits<double>::infinity(), end = -begin;
    for (const int i : hypothesis->inliers) {
      const double along = ruler.Along(points_.position(i));
      begin = std::min(begin, along);
      end = std::max(end, along);
    }
    const double near =
        std::max(points_.options().tolerance, 2.0 * hypothesis->tolerance);
    const auto is_beyond = [&](int i) {
      if (curve.kind == CurveKind::kCircle) return false;
      const double along = ruler.Along(points_.position(i));
      return along < begin || along > end;
    };
    const auto is_far = [&](int i) {
      return std::abs(ruler.SignedDistance(points_.position(i))) > near;
    };
    std::vector<int>& bystanders = hypothesis->bystanders;
    bystanders.erase(
        std::remove_if(bystanders.begin(), bystanders.end(),
                       [&](int i) { return is_far(i) || is_beyond(i); }),
        bystanders.end());
    hypothesis->strangers.clear();
    const int visit = ++stamp_;
    for (const int from : hypothesis->inliers) {
      for (const int i : points_.neighbors(from)) {
        auto& visited = visit_stamp_[static_cast<std::size_t>(i)];
        if (visited == visit) continue;
        visited = visit;
        if (points_.IsFree(i) && is_far(i) && !is_beyond(i)) {
          hypothesis->strangers.push_back(i);
        }
      }
    }
  }

  const CurvePoints& points_;
  const std::uint64_t seed_;
  SplitMix random_;
  std::size_t size_;
  // Of each free point, as NumberOf says.
  std::vector<std::uint64_t> numbers_;

  // Scratch.
  int stamp_ = 0;
  std::vector<int> inlier_stamp_;
  std::vector<int> visit_stamp_;
  std::vector<int> visit_gap_;
  std::vector<int> on_curve_;
  std::vector<std::pair<int, int>> off_curve_;
  // Positions of a neighbourhood, by columns.
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> nearby_;
};

}  // namespace

std::vector<CurveHypothesis> DrawCurveHypotheses(const CurvePoints& points,
                                                 std::uint64_t seed,
                                                 const DetectionScope& scope) {
  return HypothesisDrawer(points, seed).Run(scope);
}

}  // namespace plumbline
