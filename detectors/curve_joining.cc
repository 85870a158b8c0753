#include <plumbline/detectors/curve_joining.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Pieces are joined when the root mean square of all distances grows by less
// than this factor (drift bends a wall by more than the noise on it), and none
// is beyond the tolerance.
constexpr double kJoinRatio = 5.0;
// What is within so many times the root mean square distance of the support is
// left over of a curve.
constexpr double kLeftOverSpreads = 3.0;

// Distance from a line of the point of another's support that is nearest to the
// middle of its own.
double DistanceOfNearEnd(const CurvePoints& points, const FoundCurve& line,
                         const FoundCurve& other) {
  double nearest = std::numeric_limits<double>::infinity();
  double distance = 0.0;
  for (const int i : other.support) {
    const double along = std::abs(line.curve.Along(points.position(i)));
    if (along >= nearest) continue;
    nearest = along;
    distance = std::abs(line.curve.SignedDistance(points.position(i)));
  }
  return distance;
}

// The points of a line leave no gap that would end it.
bool IsWithoutGaps(const CurvePoints& points, const FoundCurve& line) {
  std::vector<double> along;
  for (const int i : line.support) {
    along.push_back(line.curve.Along(points.position(i)));
  }
  std::sort(along.begin(), along.end());
  const double limit = points.GapLimit(along);
  for (std::size_t i = 1; i < along.size(); ++i) {
    if (along[i] - along[i - 1] > limit) return false;
  }
  return true;
}

// Makes one curve of two pieces, the points of `b` after those of `a`; false
// when they are two.
bool TryJoin(const CurvePoints& points, const FoundCurve& a,
             const FoundCurve& b, FoundCurve* joined) {
  const CurveSearchOptions& options = points.options();
  if (a.curve.kind != b.curve.kind) return false;
  const bool is_line = a.curve.kind == CurveKind::kLine;
  if (is_line &&
      std::abs(NormalizeAxial(a.curve.direction - b.curve.direction)) >
          options.min_corner) {
    return false;
  }
  FoundCurve both;
  both.curve.kind = a.curve.kind;
  both.support = a.support;
  both.support.insert(both.support.end(), b.support.begin(), b.support.end());
  both.significance = a.significance + b.significance;
  if (!points.Fit(both.support, &both.curve)) return false;
  const auto count = static_cast<double>(both.support.size());
  const double apart = std::sqrt((points.SquaredSum(a.curve, a.support) +
                                  points.SquaredSum(b.curve, b.support)) /
                                 count);
  const double together =
      std::sqrt(points.SquaredSum(both.curve, both.support) / count);
  // Pieces of a bent line meet; lines beside each other do not.
  if (is_line && (DistanceOfNearEnd(points, a, b) > options.tolerance ||
                  DistanceOfNearEnd(points, b, a) > options.tolerance)) {
    return false;
  }
  if (together > std::max(0.5 * options.gate, kJoinRatio * apart)) return false;
  double farthest = 0.0;
  for (const int i : both.support) {
    farthest = std::max(
        farthest, std::abs(both.curve.SignedDistance(points.position(i))));
  }
  if (farthest > options.tolerance) return false;
  if (is_line && !IsWithoutGaps(points, both)) return false;
  *joined = std::move(both);
  return true;
}

// Tells what is left over of a curve.
class LeftOvers {
 public:
  LeftOvers(const CurvePoints& points, const std::vector<FoundCurve>& known)
      : points_(points), reach_(points), owners_(points.size()) {
    for (const FoundCurve& curve : known) Add(&curve, /*is_known=*/true);
  }

  // `curve` must stay where it is.
  void Add(const FoundCurve* curve, bool is_known) {
    for (const int i : curve->support) {
      owners_[static_cast<std::size_t>(i)].push_back({curve, is_known});
    }
  }

  // Whether a curve is left over of one that it touches.
  bool Contain(const FoundCurve& found) {
    std::set<const FoundCurve*> seen;
    for (const int i : found.support) {
      for (const int j : reach_.From(i)) {
        for (const Owner& owner : owners_[static_cast<std::size_t>(j)]) {
          if (seen.insert(owner.curve).second && IsLeftOver(found, owner)) {
            return true;
          }
        }
      }
    }
    return false;
  }

 private:
  struct Owner {
    const FoundCurve* curve;
    bool is_known;
  };

  double Spread(const FoundCurve& found) const {
    return std::sqrt(points_.SquaredSum(found.curve, found.support) /
                     static_cast<double>(found.support.size()));
  }

  // A precise curve next to another one is one, a vague one is not.
  bool IsLeftOver(const FoundCurve& found, const Owner& owner) const {
    const CurveSearchOptions& options = points_.options();
    const FoundCurve& other = *owner.curve;
    double near = std::max({options.gate, kLeftOverSpreads * Spread(other),
                            2.0 * kLeftOverSpreads * Spread(found)});
    // A known curve has been solved for: its support looks precise by now, and
    // so do the pieces that drift kept apart.
    if (owner.is_known && found.support.size() < other.support.size()) {
      near = std::max(near, options.tolerance);
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
           std::abs(NormalizeAxial(found.curve.direction -
                                   other.curve.direction)) < options.min_corner;
  }

  const CurvePoints& points_;
  GapReach reach_;
  // A point may support several of those known.
  std::vector<std::vector<Owner>> owners_;
};

}  // namespace

std::vector<FoundCurve> JoinCurves(const CurvePoints& points,
                                   std::vector<SelectedCurve> curves,
                                   const DetectionScope& scope) {
  // Of each point, the index of its curve.
  std::vector<int> owner(static_cast<std::size_t>(points.size()), -1);
  const auto own = [&](std::size_t curve) {
    for (const int i : curves[curve].found.support) {
      owner[static_cast<std::size_t>(i)] = static_cast<int>(curve);
    }
  };
  for (std::size_t c = 0; c < curves.size(); ++c) {
    points.Fit(curves[c].found.support, &curves[c].found.curve);
    own(c);
  }
  GapReach reach(points);
  std::vector<bool> is_joined(curves.size(), false);
  for (std::size_t c = 0; c < curves.size(); ++c) {
    if (is_joined[c]) continue;
    bool has_joined = true;
    while (has_joined) {
      has_joined = false;
      std::vector<std::pair<int, std::size_t>> touching;
      for (const int i : curves[c].found.support) {
        for (const int j : reach.From(i)) {
          const int other = owner[static_cast<std::size_t>(j)];
          if (other < 0 || other == static_cast<int>(c)) continue;
          const auto o = static_cast<std::size_t>(other);
          touching.emplace_back(curves[o].hypothesis, o);
        }
      }
      std::sort(touching.begin(), touching.end());
      touching.erase(std::unique(touching.begin(), touching.end()),
                     touching.end());
      for (const auto& [hypothesis, o] : touching) {
        FoundCurve& found = curves[c].found;
        if (!TryJoin(points, found, curves[o].found, &found)) continue;
        own(c);
        is_joined[o] = true;
        has_joined = true;
      }
    }
  }
  std::vector<FoundCurve> result;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    if (!is_joined[c]) result.push_back(std::move(curves[c].found));
  }
  scope.Count("curves joined with others",
              static_cast<std::int64_t>(curves.size() - result.size()));
  return result;
}

std::vector<FoundCurve> PruneCurves(const CurvePoints& points,
                                    std::vector<FoundCurve> curves,
                                    const std::vector<FoundCurve>& known,
                                    const DetectionScope& scope) {
  std::stable_sort(curves.begin(), curves.end(),
                   [](const FoundCurve& a, const FoundCurve& b) {
                     return a.significance > b.significance;
                   });
  LeftOvers left_overs(points, known);
  std::deque<FoundCurve> kept;
  for (FoundCurve& curve : curves) {
    if (left_overs.Contain(curve)) continue;
    kept.push_back(std::move(curve));
    left_overs.Add(&kept.back(), /*is_known=*/false);
  }
  scope.Count("curves refused: left over of another",
              static_cast<std::int64_t>(curves.size() - kept.size()));
  return {std::make_move_iterator(kept.begin()),
          std::make_move_iterator(kept.end())};
}

}  // namespace plumbline
