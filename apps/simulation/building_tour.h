#ifndef PLUMBLINE_APPS_SIMULATION_BUILDING_TOUR_H_
#define PLUMBLINE_APPS_SIMULATION_BUILDING_TOUR_H_

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// A place off a corridor that the way may visit.
struct BuildingVisit {
  /// Where the way leaves and rejoins the corridor.
  Eigen::Vector2d junction = Eigen::Vector2d::Zero();
  /// Way points from there and back, without the junction.
  std::vector<Eigen::Vector2d> excursion;
  bool done = false;
};

/// Appends the way from `from` to `to`, m, without `from`, with the visits that
/// were not made yet and whose junctions lie between them.
void WalkCorridor(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                  std::vector<BuildingVisit>* visits,
                  std::vector<Eigen::Vector2d>* path);

/// A way along all horizontal corridors to and fro, then along all vertical
/// ones, with every visit. `xs` and `ys`: centre lines of the vertical and
/// horizontal corridors, ascending, m.
std::vector<Eigen::Vector2d> TourCorridors(const std::vector<double>& xs,
                                           const std::vector<double>& ys,
                                           std::vector<BuildingVisit> visits);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_BUILDING_TOUR_H_
