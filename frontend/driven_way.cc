#include <plumbline/frontend/driven_way.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace plumbline {
namespace {

// Size of a cell, m.
constexpr double kCell = 1.0;
// Of the steps that the way is taken in, m.
constexpr double kShortest = 0.05;
constexpr double kLongest = 1.0;

std::int64_t CellOf(double place) {
  return static_cast<std::int64_t>(std::floor(place / kCell));
}

}  // namespace

DrivenWay::DrivenWay(const std::vector<Pose2>& poses) {
  for (std::size_t i = 1, from = 0; i < poses.size(); ++i) {
    const Step step = {poses[from].head<2>(), poses[i].head<2>()};
    const double length = (step.to - step.from).norm();
    if (length < kShortest) continue;
    from = i;
    if (length <= kLongest) Insert(step);
  }
}

void DrivenWay::Insert(const Step& step) {
  const int number = static_cast<int>(steps_.size());
  steps_.push_back(step);
  for (const double share : {0.0, 0.5, 1.0}) {
    const Eigen::Vector2d place = step.from + share * (step.to - step.from);
    const int next = static_cast<int>(cells_.size());
    const int cell =
        cell_of_.FindOrAdd(CellKey(CellOf(place.x()), CellOf(place.y())), next);
    if (cell == next) cells_.emplace_back();
    std::vector<int>& steps = cells_[static_cast<std::size_t>(cell)];
    if (steps.empty() || steps.back() != number) steps.push_back(number);
  }
}

std::vector<double> DrivenWay::Crossings(const Eigen::Vector2d& point,
                                         const Eigen::Vector2d& direction,
                                         double begin, double end) const {
  std::vector<int> near;
  const int pieces =
      std::max(1, static_cast<int>(std::ceil((end - begin) / (0.5 * kCell))));
  for (int k = 0; k <= pieces; ++k) {
    const Eigen::Vector2d place =
        point + (begin + (end - begin) * k / pieces) * direction;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int cell = cell_of_.Find(
            CellKey(CellOf(place.x()) + dx, CellOf(place.y()) + dy));
        if (cell < 0) continue;
        const std::vector<int>& steps = cells_[static_cast<std::size_t>(cell)];
        near.insert(near.end(), steps.begin(), steps.end());
      }
    }
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  const Eigen::Vector2d normal(-direction.y(), direction.x());
  std::vector<double> crossings;
  for (const int number : near) {
    const Step& step = steps_[static_cast<std::size_t>(number)];
    const double from = normal.dot(step.from - point);
    const double to = normal.dot(step.to - point);
    // Of the two steps that meet on the line one crosses it.
    if ((from < 0.0) == (to < 0.0)) continue;
    const double share = from / (from - to);
    const double along =
        direction.dot(step.from + share * (step.to - step.from) - point);
    if (along >= begin && along <= end) crossings.push_back(along);
  }
  std::sort(crossings.begin(), crossings.end());
  return crossings;
}

}  // namespace plumbline
