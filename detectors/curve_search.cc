#include <plumbline/detectors/curve_search.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <set>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

// Tolerances e, each smaller by the square root of two than the one before.
// Hypotheses are drawn at every kLevelsPerStart-th and tightened in between:
// structure finer than the coarsest tolerance would be lost in it.
constexpr int kStarts = 3;
constexpr int kLevelsPerStart = 3;
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
// Points over which false alarms are counted, however many there are: what is
// found in a building does not depend on how many others are on the map.
constexpr double kPointsPerFalseAlarm = 1000.0;
// Points that so many hypotheses explain are not grown from any more.
constexpr int kEnoughHypotheses = 2;
// Gaps longer than so many times the usual spacing end a line.
constexpr double kGapPerSpacing = 3.0;

// Connected points within so many tolerances of a curve are its outliers.
constexpr double kShade = 1.5;

// Pieces are joined when the root mean square of all distances grows by less
// than this factor (drift bends a wall by more than the noise on it), and none
// is beyond the tolerance.
constexpr double kJoinRatio = 5.0;

// Chains of lines that are compared with a circle, and between how many places
// their sides are looked for.
constexpr int kMaxSides = 4;
constexpr std::size_t kMaxBreaks = 32;

// What is within so many times the root mean square distance of the support is
// left over of a curve.
constexpr double kLeftOverSpreads = 3.0;

struct Hypothesis {
  PlanarCurve curve;
  double tolerance = 0.0;
  std::vector<int> inliers;
  // Connected points that are near the curve but not within the tolerance.
  std::vector<int> bystanders;
  // Neighbours of inliers that are farther away.
  std::vector<int> strangers;
  double significance = -std::numeric_limits<double>::infinity();
};

// Places along a curve: how much of it the points cover.
struct Coverage {
  // m; gaps are left out.
  double length = 0.0;
  // Points that are `separation` apart from each other, and gaps between them.
  int separated = 0;
  bool is_closed = false;
  // Angle from the first to the last point of a circle, rad.
  double arc = 0.0;
};

double MedianGap(const std::vector<double>& along) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < along.size(); ++i) {
    gaps.push_back(along[i] - along[i - 1]);
  }
  if (gaps.empty()) return 0.0;
  const auto middle =
      gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  return *middle;
}

// Sums of points, for the line that fits a run of them.
struct Moments {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;

  void Add(const Eigen::Vector2d& p) {
    n += 1.0;
    x += p.x();
    y += p.y();
    xx += p.x() * p.x();
    yy += p.y() * p.y();
    xy += p.x() * p.y();
  }
  Moments Minus(const Moments& other) const {
    Moments result;
    result.n = n - other.n;
    result.x = x - other.x;
    result.y = y - other.y;
    result.xx = xx - other.xx;
    result.yy = yy - other.yy;
    result.xy = xy - other.xy;
    return result;
  }
  // Sum of squared distances from the best line.
  double LineError() const {
    if (n < 2.5) return 0.0;
    const double cxx = xx - x * x / n;
    const double cyy = yy - y * y / n;
    const double cxy = xy - x * y / n;
    const double difference = cxx - cyy;
    const double root = std::sqrt(difference * difference + 4.0 * cxy * cxy);
    return std::max(0.0, 0.5 * (cxx + cyy - root));
  }
};

// Whether a chain of up to kMaxSides lines explains the points, which are in
// order along the circle, better than the circle does by the Bayesian
// information criterion: a corner is not an arc.
bool IsPolygon(const std::vector<Eigen::Vector2d>& points,
               const PlanarCurve& circle) {
  // Where sides may end: not at every point when there are many.
  std::vector<Moments> sums(1);
  const std::size_t stride = (points.size() + kMaxBreaks - 1) / kMaxBreaks;
  Moments sum;
  double circle_error = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    sum.Add(points[i] - circle.position);
    const double distance = circle.SignedDistance(points[i]);
    circle_error += distance * distance;
    if ((i + 1) % stride == 0 || i + 1 == points.size()) sums.push_back(sum);
  }
  const auto n = static_cast<double>(points.size());
  // Below this, distances are rounding.
  const double floor = n * 1e-12 * circle.radius * circle.radius;
  const auto criterion = [&](double error, int parameters) {
    return n * std::log(error + floor) + parameters * std::log(n);
  };
  const double limit = criterion(circle_error, 3);
  const std::size_t breaks = sums.size();
  // Of the line from one break to another.
  std::vector<double> side_errors(breaks * breaks, 0.0);
  for (std::size_t end = 1; end < breaks; ++end) {
    for (std::size_t begin = 0; begin < end; ++begin) {
      side_errors[end * breaks + begin] =
          sums[end].Minus(sums[begin]).LineError();
    }
  }
  // Smallest error of the points before each break with so many sides.
  std::vector<double> errors(breaks, std::numeric_limits<double>::infinity());
  errors[0] = 0.0;
  for (int sides = 1; sides <= kMaxSides; ++sides) {
    std::vector<double> next(breaks, std::numeric_limits<double>::infinity());
    for (std::size_t end = 1; end < breaks; ++end) {
      for (std::size_t begin = 0; begin < end; ++begin) {
        next[end] = std::min(next[end],
                             errors[begin] + side_errors[end * breaks + begin]);
      }
    }
    errors.swap(next);
    // Two parameters a side, and where each but the last ends.
    if (criterion(errors.back(), 3 * sides - 1) < limit) return true;
  }
  return false;
}

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

class CurveSearcher {
 public:
  CurveSearcher(const PointGraph& points, const std::vector<bool>& is_claimed,
                const std::vector<FoundCurve>& known, std::uint64_t seed,
                const CurveSearchOptions& options)
      : points_(points),
        known_(known),
        options_(options),
        seed_(seed),
        random_(seed),
        is_free_(static_cast<std::size_t>(points.size())),
        inlier_stamp_(static_cast<std::size_t>(points.size()), 0),
        visit_stamp_(static_cast<std::size_t>(points.size()), 0),
        visit_gap_(static_cast<std::size_t>(points.size()), 0) {
    for (std::size_t i = 0; i < is_free_.size(); ++i) {
      is_free_[i] = !is_claimed[i];
    }
  }

  std::vector<FoundCurve> Run() {
    MakeHypotheses();
    std::vector<int> all(hypotheses_.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
    std::vector<int> selected = Select(all);
    selected = Exchange(std::move(selected));
    Reassign(&selected);
    selected = Prune(Join(std::move(selected)));

    std::vector<FoundCurve> result;
    for (const int index : selected) {
      Hypothesis& hypothesis = hypotheses_[static_cast<std::size_t>(index)];
      FoundCurve found;
      found.support = owned_[static_cast<std::size_t>(index)];
      found.curve = hypothesis.curve;
      Fit(found.support, &found.curve);
      found.significance =
          selected_significance_[static_cast<std::size_t>(index)];
      std::sort(found.support.begin(), found.support.end());
      result.push_back(std::move(found));
    }
    std::stable_sort(result.begin(), result.end(),
                     [](const FoundCurve& a, const FoundCurve& b) {
                       return a.significance > b.significance;
                     });
    return result;
  }

 private:
  bool IsFree(int i) const { return is_free_[static_cast<std::size_t>(i)]; }

  // A number below `bound`; the bias of the remainder is far below what
  // matters.
  int Draw(std::size_t bound) { return static_cast<int>(random_() % bound); }

  // A point's own number. It depends on nothing else, so that what is found
  // somewhere does not depend on what there is elsewhere.
  std::uint64_t NumberOf(int i) const {
    return SplitMix(seed_ ^
                    SplitMix(static_cast<std::uint64_t>(points_.id(i)))())();
  }

  std::size_t MinPoints(CurveKind kind) const {
    return static_cast<std::size_t>(kind == CurveKind::kLine
                                        ? options_.min_line_points
                                        : options_.min_circle_points);
  }

  bool Fit(const std::vector<int>& indices, PlanarCurve* curve) {
    positions_.clear();
    for (const int i : indices) positions_.push_back(points_.position(i));
    PlanarCurve fitted;
    const bool is_fitted = curve->kind == CurveKind::kLine
                               ? FitLine(positions_, &fitted)
                               : FitCircle(positions_, &fitted);
    if (!is_fitted || fitted.radius > options_.max_radius) return false;
    *curve = fitted;
    return true;
  }

  // -- Hypotheses -------------------------------------------------------------

  void MakeHypotheses() {
    std::vector<int> seeds;
    for (int i = 0; i < points_.size(); ++i) {
      if (IsFree(i)) seeds.push_back(i);
    }
    // Shuffled, but those far apart not with each other: points that are near
    // have near numbers mostly, and lie near each other in memory.
    std::vector<std::uint64_t> numbers(is_free_.size());
    for (const int i : seeds) {
      numbers[static_cast<std::size_t>(i)] = NumberOf(i);
    }
    std::sort(seeds.begin(), seeds.end(), [&numbers](int a, int b) {
      return std::make_tuple(a / kShuffled,
                             numbers[static_cast<std::size_t>(a)], a) <
             std::make_tuple(b / kShuffled,
                             numbers[static_cast<std::size_t>(b)], b);
    });
    std::vector<int> neighborhood;
    for (int start = 0; start < kStarts; ++start) {
      const double tolerance =
          options_.tolerance * std::pow(2.0, -0.5 * kLevelsPerStart * start);
      for (const CurveKind kind : {CurveKind::kLine, CurveKind::kCircle}) {
        std::vector<int> explained(is_free_.size(), 0);
        for (const int seed : seeds) {
          if (explained[static_cast<std::size_t>(seed)] >= kEnoughHypotheses) {
            continue;
          }
          random_ = SplitMix(numbers[static_cast<std::size_t>(seed)] +
                             2 * start + (kind == CurveKind::kLine ? 0 : 1));
          GrowNeighborhood(seed, tolerance, &neighborhood);
          Hypothesis hypothesis;
          if (!Draw(kind, neighborhood, tolerance, &hypothesis.curve) ||
              !Refine(neighborhood, tolerance, &hypothesis)) {
            continue;
          }
          for (const int i : hypothesis.inliers) {
            ++explained[static_cast<std::size_t>(i)];
          }
          hypotheses_.push_back(std::move(hypothesis));
        }
      }
    }
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
        if (visited == stamp_ || !IsFree(i)) continue;
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
    if (neighborhood.size() < MinPoints(kind)) return false;
    const int draws = kind == CurveKind::kLine ? kLineDraws : kCircleDraws;
    double best_gain = 0.0;
    for (int draw = 0; draw < draws; ++draw) {
      PlanarCurve curve;
      std::array<Eigen::Vector2d, 3> sample;
      for (Eigen::Vector2d& position : sample) {
        position = points_.position(
            neighborhood[static_cast<std::size_t>(Draw(neighborhood.size()))]);
      }
      if (kind == CurveKind::kLine) {
        const Eigen::Vector2d along = sample[1] - sample[0];
        if (along.squaredNorm() == 0.0) continue;
        curve.position = sample[0];
        curve.direction = std::atan2(along.y(), along.x());
      } else if (!CircleThrough(sample[0], sample[1], sample[2], &curve) ||
                 curve.radius > options_.max_radius) {
        continue;
      }
      const CurveRuler ruler(curve);
      double gain = 0.0;
      for (const int i : neighborhood) {
        const double ratio =
            ruler.SignedDistance(points_.position(i)) / tolerance;
        gain += std::max(0.0, 1.0 - ratio * ratio);
      }
      if (gain > best_gain) {
        best_gain = gain;
        *best = curve;
      }
    }
    return best_gain > 0.0;
  }

  // Extends and tightens a drawn curve; false when it is not significant.
  bool Refine(const std::vector<int>& neighborhood, double tolerance,
              Hypothesis* best) {
    Hypothesis current;
    current.curve = best->curve;
    current.inliers = neighborhood;
    for (int level = 0; level < kLevelsPerStart; ++level) {
      current.tolerance = tolerance * std::pow(2.0, -0.5 * level);
      std::size_t last_count = 0;
      for (int i = 0; i < kMaxRefits; ++i) {
        if (!Extend(&current) || !Fit(current.inliers, &current.curve)) {
          return best->inliers.size() > 0;
        }
        if (current.inliers.size() == last_count) break;
        last_count = current.inliers.size();
      }
      if (!Extend(&current)) break;
      current.significance = Significance(current, nullptr);
      if (current.significance >= -options_.max_log_false_alarms &&
          current.significance > best->significance) {
        *best = current;
      }
    }
    return best->inliers.size() > 0;
  }

  // Replaces the inliers by the largest connected set of free points within the
  // tolerance that has one of them. False when it is too small.
  bool Extend(Hypothesis* hypothesis) {
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
          !IsFree(start) || !is_inlier(start)) {
        continue;
      }
      inliers.assign(1, start);
      bystanders.clear();
      inlier_stamp_[static_cast<std::size_t>(start)] = epoch;
      const int visit = ++stamp_;
      // Points with the number of points off the curve on the way to them;
      // those on the curve first.
      std::deque<std::pair<int, int>> queue = {{start, 0}};
      while (!queue.empty()) {
        const auto [from, gap] = queue.front();
        queue.pop_front();
        for (const int i : points_.neighbors(from)) {
          const auto k = static_cast<std::size_t>(i);
          if (!IsFree(i) || inlier_stamp_[k] == epoch) continue;
          if (visit_stamp_[k] == visit && visit_gap_[k] <= gap + 1) continue;
          if (is_inlier(i)) {
            inlier_stamp_[k] = epoch;
            inliers.push_back(i);
            queue.emplace_front(i, 0);
            continue;
          }
          if (visit_stamp_[k] != visit) bystanders.push_back(i);
          visit_stamp_[k] = visit;
          visit_gap_[k] = gap + 1;
          if (gap < options_.max_gap_points) queue.emplace_back(i, gap + 1);
        }
      }
      if (inliers.size() > hypothesis->inliers.size()) {
        hypothesis->inliers.swap(inliers);
        hypothesis->bystanders.swap(bystanders);
      }
    }
    if (curve.kind == CurveKind::kLine) CutAtGaps(hypothesis);
    if (hypothesis->inliers.size() < MinPoints(curve.kind)) return false;
    SortOut(hypothesis);
    return true;
  }

  // Leaves the longest part of a line.
  void CutAtGaps(Hypothesis* hypothesis) const {
    const CurveRuler ruler(hypothesis->curve);
    std::vector<std::pair<double, int>> order;
    std::vector<double> along;
    for (const int i : hypothesis->inliers) {
      order.emplace_back(ruler.Along(points_.position(i)), i);
    }
    std::sort(order.begin(), order.end());
    for (const auto& entry : order) along.push_back(entry.first);
    const double limit = GapLimit(along);
    std::size_t best_begin = 0, best_end = 0, begin = 0;
    for (std::size_t i = 1; i <= order.size(); ++i) {
      if (i < order.size() && along[i] - along[i - 1] <= limit) continue;
      if (i - begin > best_end - best_begin) {
        best_begin = begin;
        best_end = i;
      }
      begin = i;
    }
    hypothesis->inliers.clear();
    for (std::size_t i = best_begin; i < best_end; ++i) {
      hypothesis->inliers.push_back(order[i].second);
    }
  }

  double GapLimit(const std::vector<double>& along) const {
    return std::max(options_.max_gap, kGapPerSpacing * MedianGap(along));
  }

  // Tells bystanders from strangers. Points beyond the ends of a line say
  // nothing about it.
  void SortOut(Hypothesis* hypothesis) {
    const PlanarCurve& curve = hypothesis->curve;
    const CurveRuler ruler(curve);
    double begin = std::numeric_limits<double>::infinity(), end = -begin;
    for (const int i : hypothesis->inliers) {
      const double along = ruler.Along(points_.position(i));
      begin = std::min(begin, along);
      end = std::max(end, along);
    }
    const double near =
        std::max(options_.tolerance, 2.0 * hypothesis->tolerance);
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
        if (IsFree(i) && is_far(i) && !is_beyond(i)) {
          hypothesis->strangers.push_back(i);
        }
      }
    }
  }

  // -- Significance -----------------------------------------------------------

  // `places`: along the curve, with the points there; comes back in order, on
  // a circle from the end of the longest gap.
  Coverage Cover(const PlanarCurve& curve, double separation,
                 std::vector<std::pair<double, int>>* places) const {
    Coverage coverage;
    std::sort(places->begin(), places->end());
    std::vector<double> along;
    for (const auto& place : *places) along.push_back(place.first);
    double limit = GapLimit(along);
    if (curve.kind == CurveKind::kCircle) {
      const double around = 2.0 * kPi * curve.radius;
      double longest = along.front() + around - along.back();
      std::size_t first = 0;
      for (std::size_t i = 1; i < along.size(); ++i) {
        if (along[i] - along[i - 1] > longest) {
          longest = along[i] - along[i - 1];
          first = i;
        }
      }
      const auto offset = static_cast<std::ptrdiff_t>(first);
      for (std::size_t i = 0; i < first; ++i) along[i] += around;
      std::rotate(along.begin(), along.begin() + offset, along.end());
      std::rotate(places->begin(), places->begin() + offset, places->end());
      limit = std::max(std::min(options_.max_gap, curve.radius),
                       kGapPerSpacing * MedianGap(along));
      coverage.arc = (around - longest) / curve.radius;
      coverage.is_closed = longest <= limit;
      if (coverage.is_closed) coverage.length = longest;
    }
    double last = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < along.size(); ++i) {
      if (i > 0 && along[i] - along[i - 1] <= limit) {
        coverage.length += along[i] - along[i - 1];
      }
      if (along[i] - last >= separation) {
        ++coverage.separated;
        last = along[i];
      }
    }
    return coverage;
  }

  // Minus log10 of the number of false alarms, by the points that nobody owns.
  double Significance(const Hypothesis& hypothesis,
                      const std::vector<bool>* is_owned) const {
    const auto is_available = [is_owned](int i) {
      return is_owned == nullptr || !(*is_owned)[static_cast<std::size_t>(i)];
    };
    constexpr double kNone = -std::numeric_limits<double>::infinity();
    const PlanarCurve& curve = hypothesis.curve;
    const CurveRuler ruler(curve);
    const double e = hypothesis.tolerance;
    std::vector<std::pair<double, int>> places;
    for (const int i : hypothesis.inliers) {
      if (is_available(i)) {
        places.emplace_back(ruler.Along(points_.position(i)), i);
      }
    }
    if (places.size() < MinPoints(curve.kind)) return kNone;
    const auto count = static_cast<double>(places.size());
    double misses = 0.0;
    for (const int i : hypothesis.bystanders) {
      if (is_available(i)) misses += 1.0;
    }
    // While curves are not told apart, strangers may well be on others.
    if (is_owned != nullptr) {
      for (const int i : hypothesis.strangers) {
        if (is_available(i)) misses += 1.0;
      }
    }

    const bool is_circle = curve.kind == CurveKind::kCircle;
    // Centre and circle are told apart from a blob only by a larger radius.
    if (is_circle && curve.radius < 2.0 * e) return kNone;
    // Slightly less than 2 e, for points that are just so far apart.
    const Coverage coverage = Cover(curve, 1.999 * e, &places);
    if (is_circle && coverage.arc < options_.min_arc) return kNone;
    if (!(coverage.length > 0.0)) return kNone;
    const int steps = coverage.separated - (coverage.is_closed ? 0 : 1);
    if (steps < 1) return kNone;
    const double spacing = std::max(2.0 * e, coverage.length / steps);
    const double p = 2.0 / kPi * std::asin(e / spacing);
    const double share = count / (count + misses);
    if (share <= p) return kNone;
    const double trials = coverage.separated / share;
    double divergence = share * std::log(share / p);
    if (share < 1.0) {
      divergence += (1.0 - share) * std::log((1.0 - share) / (1.0 - p));
    }
    // Places where a curve of this size could begin, its offset there, its
    // direction and bend by what the tolerance can tell, and the tolerances.
    const double resolution = std::max(1.0, coverage.length / e);
    double tests = std::max(1.0, kPointsPerFalseAlarm / count) / p *
                   resolution * kStarts * kLevelsPerStart;
    if (is_circle) tests *= std::sqrt(resolution);
    const double significance =
        (trials * divergence - std::log(tests)) / std::log(10.0);
    if (is_circle && significance >= -options_.max_log_false_alarms) {
      std::vector<Eigen::Vector2d> positions;
      for (const auto& place : places) {
        positions.push_back(points_.position(place.second));
      }
      if (IsPolygon(positions, curve)) return kNone;
    }
    return significance;
  }

  // -- Selection --------------------------------------------------------------

  // The most significant hypothesis takes its points, and so on. Points owned
  // before stay so. What a curve takes from another's surroundings makes that
  // one more significant, so this is repeated until nothing changes.
  std::vector<int> Select(std::vector<int> candidates) {
    owned_.resize(hypotheses_.size());
    shaded_.resize(hypotheses_.size());
    selected_significance_.resize(hypotheses_.size(), 0.0);
    if (is_owned_.empty()) is_owned_.assign(is_free_.size(), false);
    std::vector<int> selected;
    for (;;) {
      const std::size_t before = selected.size();
      SelectOnce(&candidates, &selected);
      if (selected.size() == before) return selected;
    }
  }

  // Leaves those that were not selected.
  void SelectOnce(std::vector<int>* candidates, std::vector<int>* selected) {
    using Entry = std::pair<double, int>;
    // By significance, then the one made first.
    const auto is_less = [](const Entry& a, const Entry& b) {
      return std::tie(a.first, b.second) < std::tie(b.first, a.second);
    };
    std::priority_queue<Entry, std::vector<Entry>, decltype(is_less)> queue(
        is_less);
    for (const int index : *candidates) {
      queue.emplace(Significance(index), index);
    }
    candidates->clear();
    while (!queue.empty()) {
      const auto [last, index] = queue.top();
      queue.pop();
      if (last < -options_.max_log_false_alarms) {
        if (!std::isinf(last)) candidates->push_back(index);
        continue;
      }
      const double significance = Significance(index);
      if (significance < last) {
        queue.emplace(significance, index);
        continue;
      }
      Own(index);
      selected_significance_[static_cast<std::size_t>(index)] = significance;
      selected->push_back(index);
    }
    std::sort(candidates->begin(), candidates->end());
  }

  double Significance(int index) const {
    return Significance(hypotheses_[static_cast<std::size_t>(index)],
                        &is_owned_);
  }

  void Own(int index) {
    const Hypothesis& hypothesis = hypotheses_[static_cast<std::size_t>(index)];
    std::vector<int>& owned = owned_[static_cast<std::size_t>(index)];
    owned.clear();
    for (const int i : hypothesis.inliers) {
      if (is_owned_[static_cast<std::size_t>(i)]) continue;
      owned.push_back(i);
      is_owned_[static_cast<std::size_t>(i)] = true;
    }
    std::vector<int>& shaded = shaded_[static_cast<std::size_t>(index)];
    shaded.clear();
    for (const int i : hypothesis.bystanders) {
      if (is_owned_[static_cast<std::size_t>(i)] ||
          std::abs(hypothesis.curve.SignedDistance(points_.position(i))) >
              kShade * hypothesis.tolerance) {
        continue;
      }
      shaded.push_back(i);
      is_owned_[static_cast<std::size_t>(i)] = true;
    }
  }

  void Disown(int index) {
    for (const int i : owned_[static_cast<std::size_t>(index)]) {
      is_owned_[static_cast<std::size_t>(i)] = false;
    }
    for (const int i : shaded_[static_cast<std::size_t>(index)]) {
      is_owned_[static_cast<std::size_t>(i)] = false;
    }
  }

  void Reown(int index) {
    for (const int i : owned_[static_cast<std::size_t>(index)]) {
      is_owned_[static_cast<std::size_t>(i)] = true;
    }
    for (const int i : shaded_[static_cast<std::size_t>(index)]) {
      is_owned_[static_cast<std::size_t>(i)] = true;
    }
  }

  // Lets each selected curve give way to others on its points when they are
  // more significant together.
  std::vector<int> Exchange(std::vector<int> selected) {
    std::vector<std::vector<int>> hypotheses_of(is_free_.size());
    for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
      for (const int i : hypotheses_[h].inliers) {
        hypotheses_of[static_cast<std::size_t>(i)].push_back(
            static_cast<int>(h));
      }
    }
    std::vector<bool> is_taken(hypotheses_.size(), false);
    for (const int index : selected) {
      is_taken[static_cast<std::size_t>(index)] = true;
    }
    std::vector<int> kept;
    for (const int index : selected) {
      const std::vector<int> points = owned_[static_cast<std::size_t>(index)];
      std::vector<int> rivals;
      for (const int i : points) {
        for (const int rival : hypotheses_of[static_cast<std::size_t>(i)]) {
          if (rival != index) rivals.push_back(rival);
        }
      }
      std::sort(rivals.begin(), rivals.end());
      rivals.erase(std::unique(rivals.begin(), rivals.end()), rivals.end());
      // Those selected own points and are not available.
      rivals.erase(
          std::remove_if(rivals.begin(), rivals.end(),
                         [&](int rival) {
                           return is_taken[static_cast<std::size_t>(rival)];
                         }),
          rivals.end());
      Disown(index);
      const std::vector<int> others = Select(rivals);
      double sum = 0.0;
      for (const int other : others) {
        sum += selected_significance_[static_cast<std::size_t>(other)];
      }
      if (sum > selected_significance_[static_cast<std::size_t>(index)]) {
        for (const int other : others) {
          is_taken[static_cast<std::size_t>(other)] = true;
        }
        kept.insert(kept.end(), others.begin(), others.end());
        continue;
      }
      for (const int other : others) Disown(other);
      Reown(index);
      kept.push_back(index);
    }
    return kept;
  }

  // Points that can be reached from a point by at most one more step than there
  // may be points in a gap.
  void Reach(int from, std::vector<int>* reached) {
    const int visit = ++stamp_;
    visit_stamp_[static_cast<std::size_t>(from)] = visit;
    reached->assign(1, from);
    std::size_t begin = 0;
    for (int step = 0; step <= options_.max_gap_points; ++step) {
      const std::size_t end = reached->size();
      for (; begin < end; ++begin) {
        for (const int i : points_.neighbors((*reached)[begin])) {
          auto& visited = visit_stamp_[static_cast<std::size_t>(i)];
          if (visited == visit) continue;
          visited = visit;
          reached->push_back(i);
        }
      }
    }
  }

  double SquaredSum(const PlanarCurve& curve,
                    const std::vector<int>& indices) const {
    const CurveRuler ruler(curve);
    double sum = 0.0;
    for (const int i : indices) {
      const double distance = ruler.SignedDistance(points_.position(i));
      sum += distance * distance;
    }
    return sum;
  }

  // Gives each point to the curve near it that has most of its neighbours:
  // where curves cross, the first one took points of the others.
  void Reassign(std::vector<int>* selected) {
    std::vector<int> owner(is_free_.size(), -1);
    for (const int index : *selected) {
      for (const int i : owned_[static_cast<std::size_t>(index)]) {
        owner[static_cast<std::size_t>(i)] = index;
      }
    }
    std::vector<int> next = owner;
    std::map<int, int> votes;
    for (int i = 0; i < points_.size(); ++i) {
      const int own = owner[static_cast<std::size_t>(i)];
      if (own < 0) continue;
      votes.clear();
      for (const int j : points_.neighbors(i)) {
        const int other = owner[static_cast<std::size_t>(j)];
        if (other >= 0) ++votes[other];
      }
      int best = own;
      for (const auto& [other, count] : votes) {
        const Hypothesis& hypothesis =
            hypotheses_[static_cast<std::size_t>(other)];
        if (count > votes[best] &&
            std::abs(hypothesis.curve.SignedDistance(points_.position(i))) <=
                kShade * hypothesis.tolerance) {
          best = other;
        }
      }
      next[static_cast<std::size_t>(i)] = best;
    }
    for (const int index : *selected) {
      owned_[static_cast<std::size_t>(index)].clear();
    }
    for (int i = 0; i < points_.size(); ++i) {
      const int own = next[static_cast<std::size_t>(i)];
      if (own >= 0) owned_[static_cast<std::size_t>(own)].push_back(i);
    }
    // What is left of some is too little.
    std::vector<int> kept;
    for (const int index : *selected) {
      Hypothesis& hypothesis = hypotheses_[static_cast<std::size_t>(index)];
      std::vector<int>& owned = owned_[static_cast<std::size_t>(index)];
      hypothesis.inliers.swap(owned);
      if (hypothesis.curve.kind == CurveKind::kLine) CutAtGaps(&hypothesis);
      owned = hypothesis.inliers;
      if (owned.size() >= MinPoints(hypothesis.curve.kind)) {
        kept.push_back(index);
      }
    }
    selected->swap(kept);
  }

  // Puts pieces of one curve together. Drift bends long walls, and a piece with
  // a small tolerance is more significant than the whole with a large one.
  std::vector<int> Join(std::vector<int> selected) {
    std::vector<int> owner(is_free_.size(), -1);
    for (const int index : selected) {
      Hypothesis& hypothesis = hypotheses_[static_cast<std::size_t>(index)];
      hypothesis.inliers = owned_[static_cast<std::size_t>(index)];
      Fit(hypothesis.inliers, &hypothesis.curve);
      for (const int i : hypothesis.inliers) {
        owner[static_cast<std::size_t>(i)] = index;
      }
    }
    std::vector<int> reached;
    for (std::size_t s = 0; s < selected.size(); ++s) {
      const int index = selected[s];
      if (index < 0) continue;
      bool has_joined = true;
      while (has_joined) {
        has_joined = false;
        std::vector<int> touching;
        for (const int i : owned_[static_cast<std::size_t>(index)]) {
          Reach(i, &reached);
          for (const int j : reached) {
            const int other = owner[static_cast<std::size_t>(j)];
            if (other >= 0 && other != index) touching.push_back(other);
          }
        }
        std::sort(touching.begin(), touching.end());
        touching.erase(std::unique(touching.begin(), touching.end()),
                       touching.end());
        for (const int other : touching) {
          if (!TryJoin(index, other)) continue;
          for (const int i : owned_[static_cast<std::size_t>(index)]) {
            owner[static_cast<std::size_t>(i)] = index;
          }
          std::replace(selected.begin(), selected.end(), other, -1);
          has_joined = true;
        }
      }
    }
    selected.erase(std::remove(selected.begin(), selected.end(), -1),
                   selected.end());
    return selected;
  }

  // Takes out curves that are left-overs of a more significant one which they
  // touch, and lines that go on where another ends.
  std::vector<int> Prune(std::vector<int> selected) {
    std::stable_sort(selected.begin(), selected.end(), [this](int a, int b) {
      return selected_significance_[static_cast<std::size_t>(a)] >
             selected_significance_[static_cast<std::size_t>(b)];
    });
    // A point may support several of those known.
    std::vector<std::vector<const FoundCurve*>> owners(is_free_.size());
    for (const FoundCurve& curve : known_) {
      for (const int i : curve.support) {
        owners[static_cast<std::size_t>(i)].push_back(&curve);
      }
    }
    std::deque<FoundCurve> kept_curves;
    std::vector<int> kept, reached;
    for (const int index : selected) {
      FoundCurve found;
      found.curve = hypotheses_[static_cast<std::size_t>(index)].curve;
      found.support = owned_[static_cast<std::size_t>(index)];
      std::set<const FoundCurve*> seen;
      bool is_part = false;
      for (const int i : found.support) {
        Reach(i, &reached);
        for (const int j : reached) {
          for (const FoundCurve* other : owners[static_cast<std::size_t>(j)]) {
            is_part = is_part ||
                      (seen.insert(other).second && IsLeftOver(found, *other));
          }
        }
      }
      if (is_part) continue;
      kept.push_back(index);
      kept_curves.push_back(std::move(found));
      for (const int i : kept_curves.back().support) {
        owners[static_cast<std::size_t>(i)].push_back(&kept_curves.back());
      }
    }
    return kept;
  }

  bool IsKnown(const FoundCurve& curve) const {
    const std::less<const FoundCurve*> before;
    return !before(&curve, known_.data()) &&
           before(&curve, known_.data() + known_.size());
  }

  double Spread(const FoundCurve& found) const {
    return std::sqrt(SquaredSum(found.curve, found.support) /
                     static_cast<double>(found.support.size()));
  }

  // A precise curve next to another one is one, a vague one is not.
  bool IsLeftOver(const FoundCurve& found, const FoundCurve& other) const {
    double near = std::max({options_.gate, kLeftOverSpreads * Spread(other),
                            2.0 * kLeftOverSpreads * Spread(found)});
    // A known curve has been solved for: its support looks precise by now, and
    // so do the pieces that drift kept apart.
    if (IsKnown(other) && found.support.size() < other.support.size()) {
      near = std::max(near, options_.tolerance);
    }
    std::vector<double> distances;
    for (const int i : found.support) {
      distances.push_back(
          std::abs(other.curve.SignedDistance(points_.position(i))));
    }
    std::sort(distances.begin(), distances.end());
    if (distances[distances.size() / 2] <= near) return true;
    return found.curve.kind == CurveKind::kLine &&
           other.curve.kind == CurveKind::kLine && distances.front() <= near &&
           std::abs(
               NormalizeAxial(found.curve.direction - other.curve.direction)) <
               options_.min_corner;
  }

  // Distance from a line of the point of another's support that is nearest to
  // the middle of its own.
  double DistanceOfNearEnd(const Hypothesis& line,
                           const Hypothesis& other) const {
    double nearest = std::numeric_limits<double>::infinity();
    double distance = 0.0;
    for (const int i : other.inliers) {
      const double along = std::abs(line.curve.Along(points_.position(i)));
      if (along >= nearest) continue;
      nearest = along;
      distance = std::abs(line.curve.SignedDistance(points_.position(i)));
    }
    return distance;
  }

  bool TryJoin(int index, int other) {
    const Hypothesis& a = hypotheses_[static_cast<std::size_t>(index)];
    const Hypothesis& b = hypotheses_[static_cast<std::size_t>(other)];
    if (a.curve.kind != b.curve.kind) return false;
    if (a.curve.kind == CurveKind::kLine &&
        std::abs(NormalizeAxial(a.curve.direction - b.curve.direction)) >
            options_.min_corner) {
      return false;
    }
    Hypothesis both;
    both.curve.kind = a.curve.kind;
    both.inliers = a.inliers;
    both.inliers.insert(both.inliers.end(), b.inliers.begin(), b.inliers.end());
    if (!Fit(both.inliers, &both.curve)) return false;
    const auto count = static_cast<double>(both.inliers.size());
    const double apart = std::sqrt(
        (SquaredSum(a.curve, a.inliers) + SquaredSum(b.curve, b.inliers)) /
        count);
    const double together =
        std::sqrt(SquaredSum(both.curve, both.inliers) / count);
    // Pieces of a bent line meet; lines beside each other do not.
    if (a.curve.kind == CurveKind::kLine &&
        (DistanceOfNearEnd(a, b) > options_.tolerance ||
         DistanceOfNearEnd(b, a) > options_.tolerance)) {
      return false;
    }
    if (together > std::max(0.5 * options_.gate, kJoinRatio * apart)) {
      return false;
    }
    both.tolerance = 0.0;
    for (const int i : both.inliers) {
      both.tolerance =
          std::max(both.tolerance,
                   std::abs(both.curve.SignedDistance(points_.position(i))));
    }
    if (both.tolerance > options_.tolerance) return false;
    if (both.curve.kind == CurveKind::kLine) {
      std::vector<double> along;
      for (const int i : both.inliers) {
        along.push_back(both.curve.Along(points_.position(i)));
      }
      std::sort(along.begin(), along.end());
      const double limit = GapLimit(along);
      for (std::size_t i = 1; i < along.size(); ++i) {
        if (along[i] - along[i - 1] > limit) return false;
      }
    }
    const auto k = static_cast<std::size_t>(index);
    const auto o = static_cast<std::size_t>(other);
    selected_significance_[k] += selected_significance_[o];
    owned_[k] = both.inliers;
    owned_[o].clear();
    shaded_[k].insert(shaded_[k].end(), shaded_[o].begin(), shaded_[o].end());
    hypotheses_[k] = std::move(both);
    return true;
  }

  const PointGraph& points_;
  const std::vector<FoundCurve>& known_;
  const CurveSearchOptions& options_;
  const std::uint64_t seed_;
  SplitMix random_;
  std::vector<bool> is_free_;
  std::vector<Hypothesis> hypotheses_;

  // Points that each selected hypothesis owns, and its significance by them.
  std::vector<std::vector<int>> owned_;
  // Points near it that count as its outliers, and not for others.
  std::vector<std::vector<int>> shaded_;
  std::vector<double> selected_significance_;
  std::vector<bool> is_owned_;

  // Scratch.
  int stamp_ = 0;
  std::vector<int> inlier_stamp_;
  std::vector<int> visit_stamp_;
  std::vector<int> visit_gap_;
  std::vector<Eigen::Vector2d> positions_;
};

}  // namespace

std::vector<FoundCurve> SearchCurves(const PointGraph& points,
                                     const std::vector<bool>& is_claimed,
                                     const std::vector<FoundCurve>& known,
                                     std::uint64_t seed,
                                     const CurveSearchOptions& options) {
  return CurveSearcher(points, is_claimed, known, seed, options).Run();
}

}  // namespace plumbline
