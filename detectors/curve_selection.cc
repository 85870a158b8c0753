#include <plumbline/detectors/curve_selection.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <queue>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

// Connected points within so many tolerances of a curve are its outliers.
constexpr double kShade = 1.5;

class CurveSelection {
 public:
  CurveSelection(const CurvePoints& points,
                 std::vector<CurveHypothesis> hypotheses)
      : points_(points),
        size_(static_cast<std::size_t>(points.size())),
        hypotheses_(std::move(hypotheses)) {}

  std::vector<SelectedCurve> Run(const DetectionScope& scope) {
    std::vector<int> all(hypotheses_.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
    std::vector<int> selected = Select(std::move(all));
    selected = Exchange(std::move(selected));
    const auto count = static_cast<std::int64_t>(selected.size());
    Reassign(&selected);
    const auto left = static_cast<std::int64_t>(selected.size());
    const auto total = static_cast<std::int64_t>(hypotheses_.size());
    scope.Count("curves", total);
    scope.Count("curves refused: others explain the points", total - count);
    scope.Count("curves refused: too few points left", count - left);

    std::vector<SelectedCurve> result;
    for (const int index : selected) {
      const auto k = static_cast<std::size_t>(index);
      SelectedCurve curve;
      curve.found.curve = hypotheses_[k].curve;
      curve.found.support = std::move(owned_[k]);
      curve.found.significance = selected_significance_[k];
      curve.hypothesis = index;
      result.push_back(std::move(curve));
    }
    return result;
  }

 private:
  // The most significant hypothesis takes its points, and so on. Points owned
  // before stay so. What a curve takes from another's surroundings makes that
  // one more significant, so this is repeated until nothing changes.
  std::vector<int> Select(std::vector<int> candidates) {
    owned_.resize(hypotheses_.size());
    shaded_.resize(hypotheses_.size());
    selected_significance_.resize(hypotheses_.size(), 0.0);
    if (is_owned_.empty()) is_owned_.assign(size_, false);
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
      if (last < -points_.options().max_log_false_alarms) {
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
    return CurveSignificance(
        points_, hypotheses_[static_cast<std::size_t>(index)], &is_owned_);
  }

  void Own(int index) {
    const CurveHypothesis& hypothesis =
        hypotheses_[static_cast<std::size_t>(index)];
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
    std::vector<std::vector<int>> hypotheses_of(size_);
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

  // Gives each point to the curve near it that has most of its neighbours:
  // where curves cross, the first one took points of the others.
  void Reassign(std::vector<int>* selected) {
    std::vector<int> owner(size_, -1);
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
        const CurveHypothesis& hypothesis =
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
      const CurveHypothesis& hypothesis =
          hypotheses_[static_cast<std::size_t>(index)];
      std::vector<int>& owned = owned_[static_cast<std::size_t>(index)];
      if (hypothesis.curve.kind == CurveKind::kLine) {
        points_.CutAtGaps(hypothesis.curve, &owned);
      }
      if (owned.size() >= points_.MinPoints(hypothesis.curve.kind)) {
        kept.push_back(index);
      }
    }
    selected->swap(kept);
  }

  const CurvePoints& points_;
  std::size_t size_;
  std::vector<CurveHypothesis> hypotheses_;
  // Points that each selected hypothesis owns, and its significance by them.
  std::vector<std::vector<int>> owned_;
  // Points near it that count as its outliers, and not for others.
  std::vector<std::vector<int>> shaded_;
  std::vector<double> selected_significance_;
  std::vector<bool> is_owned_;
};

}  // namespace

std::vector<SelectedCurve> SelectCurves(const CurvePoints& points,
                                        std::vector<CurveHypothesis> hypotheses,
                                        const DetectionScope& scope) {
  return CurveSelection(points, std::move(hypotheses)).Run(scope);
}

}  // namespace plumbline
