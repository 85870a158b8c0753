#include <plumbline/detectors/same_curves.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <set>

namespace plumbline {
namespace {

// Whether a line ends before the other begins, by more than a line may have
// no points: walls in line with each other, of neighbouring buildings for
// one, are two.
bool IsApart(const PointGraph& points, const SupportedCurves& curves,
             const FoundCurve& curve, const FoundCurve& other, double max_gap) {
  const CurveRuler ruler(other.curve);
  const double infinity = std::numeric_limits<double>::infinity();
  double begin = infinity, end = -infinity;
  for (const int i : other.support) {
    const double along = ruler.Along(points.position(i));
    begin = std::min(begin, along);
    end = std::max(end, along);
  }
  double gap = infinity;
  for (const int i : curve.support) {
    const double along = ruler.Along(points.position(i));
    gap = std::min(gap, std::max(begin - along, along - end));
  }
  return gap > curves.GapLimit(other, max_gap);
}

// Whether the points of a curve would all join the other.
bool IsSame(const PointGraph& points, const SupportedCurves& curves,
            const FoundCurve& curve, const FoundCurve& other,
            const CurveSearchOptions& options) {
  const CurveRuler ruler(other.curve);
  return std::all_of(curve.support.begin(), curve.support.end(),
                     [&](int i) {
                       return std::abs(ruler.SignedDistance(
                                  points.position(i))) <= options.gate;
                     }) &&
         (curve.curve.kind == CurveKind::kCircle ||
          !IsApart(points, curves, curve, other, options.max_gap));
}

// Whether the curve is the same as one that it touches and that has more
// support.
bool IsSameAsLarger(const PointGraph& points, const SupportedCurves& curves,
                    std::size_t c, const std::vector<bool>& is_gone,
                    const CurveSearchOptions& options) {
  const FoundCurve& curve = curves[c].found;
  for (const std::size_t o : curves.Touching(c)) {
    const FoundCurve& other = curves[o].found;
    const std::size_t size = curve.support.size();
    const std::size_t other_size = other.support.size();
    if (other.curve.kind == curve.curve.kind && !is_gone[o] &&
        (size < other_size || (size == other_size && c > o)) &&
        IsSame(points, curves, curve, other, options)) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::vector<SupportedCurve> TakeOutSameCurves(const PointGraph& points,
                                              CurveKind kind,
                                              const CurveSearchOptions& options,
                                              SupportedCurves* curves) {
  std::set<std::size_t> compared;
  for (std::size_t c = 0; c < curves->size(); ++c) {
    if (!(*curves)[c].is_dirty) continue;
    compared.insert(c);
    for (const std::size_t o : curves->Touching(c)) compared.insert(o);
  }
  std::vector<bool> is_gone(curves->size(), false);
  bool has_gone = false;
  for (const std::size_t c : compared) {
    const SupportedCurve& curve = (*curves)[c];
    if (curve.found.curve.kind != kind || !curve.may_go) continue;
    if (IsSameAsLarger(points, *curves, c, is_gone, options)) {
      is_gone[c] = true;
      has_gone = true;
    }
  }
  std::vector<SupportedCurve> gone;
  if (!has_gone) return gone;
  for (const std::size_t c : compared) {
    if (!is_gone[c]) continue;
    for (const std::size_t o : curves->Touching(c)) {
      (*curves)[o].is_dirty = true;
    }
    gone.push_back((*curves)[c]);
  }
  curves->Remove(is_gone);
  return gone;
}

}  // namespace plumbline
