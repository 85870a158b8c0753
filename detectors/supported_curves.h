#ifndef PLUMBLINE_DETECTORS_SUPPORTED_CURVES_H_
#define PLUMBLINE_DETECTORS_SUPPORTED_CURVES_H_

#include <plumbline/core/graph.h>
#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/point_graph.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// A curve with the points that support it, those that are proposed included.
struct SupportedCurve {
  /// kNoId for a new one.
  FeatureId id = kNoId;
  FoundCurve found;
  /// Points of found.support that are not tied to it yet.
  std::vector<int> joining;
  /// Points that are tied to it and are to be let go.
  std::vector<int> leaving;
  /// It may be taken out when it turns out to be the same as another.
  bool may_go = true;
  /// It, or what lies near it, changed since it was last compared with others
  /// and extended.
  bool is_dirty = true;
};

/// The lines and circles of a graph that points are tied to, in the order of
/// ids, and those that were found since. Curves are named by their place.
class SupportedCurves {
 public:
  /// Reads the curves that live structure constraints tie points to. A curve
  /// may go that is virtual, held by nothing but structure, and whose points
  /// are all among `points`, which must outlive this.
  SupportedCurves(const Graph& graph, const PointGraph& points);

  /// The curves.
  std::size_t size() const { return curves_.size(); }
  const SupportedCurve& operator[](std::size_t c) const { return curves_[c]; }
  SupportedCurve& operator[](std::size_t c) { return curves_[c]; }
  const std::vector<SupportedCurve>& all() const { return curves_; }
  /// Points with a broken constraint to a curve that is still there.
  const std::vector<int>& outliers() const { return outliers_; }

  /// The curves that a point supports.
  const std::vector<std::size_t>& On(int point) const {
    return on_[static_cast<std::size_t>(point)];
  }
  /// Curves that have a point in common with another one, or two that are
  /// connected; ascending, without itself.
  std::vector<std::size_t> Touching(std::size_t curve) const;
  /// How long a curve may have no point: `max_gap`, or three times its usual
  /// spacing where that is longer; m.
  double GapLimit(const FoundCurve& found, double max_gap) const;

  /// Adds one that was found; its points are to be tied to it.
  void Add(FoundCurve found);
  /// Adds a point to the support of a curve, which is no longer ascending.
  void AddPoint(std::size_t curve, int point);
  /// Takes a point out of the support of a curve; until it is added again it is
  /// to be let go.
  void TakeOut(std::size_t curve, int point);
  /// Takes out those that are marked; what is left moves up.
  void Remove(const std::vector<bool>& is_removed);

 private:
  void Read(const Graph& graph);
  void IndexPoints();

  const PointGraph& points_;
  std::vector<SupportedCurve> curves_;
  std::vector<int> outliers_;
  // By point.
  std::vector<std::vector<std::size_t>> on_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_SUPPORTED_CURVES_H_
