#ifndef PLUMBLINE_FRONTEND_SAMPLED_RETURNS_H_
#define PLUMBLINE_FRONTEND_SAMPLED_RETURNS_H_

#include <plumbline/core/wall.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/cell_index.h>
#include <plumbline/frontend/scan.h>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace plumbline {

/// Options of the choice of returns that stand for all of a log.
struct SampledReturnsOptions {
  /// A scan is taken once the robot has moved or turned by so much since the
  /// last one, m and rad.
  double step = 0.2;
  double turn = DegToRad(10.0);
  /// Most scans, in even steps through those, and most beams of each, in even
  /// steps through the scan.
  std::size_t max_scans = 1500;
  std::size_t max_beams = 181;
  /// Returns that are nearer are the robot itself, and those farther away are
  /// left out, m.
  double minimum_range = 0.1;
  double usable_range = 30.0;
  /// Side of the cells in which returns are gathered, m.
  double cell_size = 0.08;
  /// A return lies on the nearest wall that it is so close to, m, across it and
  /// past its ends, and that the laser saw from its own side.
  double wall_offset = 0.06;
};

/// Returns of scans that are spread evenly along the way of a robot, each with
/// the wall that it lies on: enough to tell what is seen from where, at a cost
/// that does not grow with the rate of the scans. Map frame, m.
class SampledReturns {
 public:
  /// One of the scans: where its laser was, and its returns, [begin, end).
  struct View {
    Eigen::Vector2d origin;
    std::size_t begin = 0;
    std::size_t end = 0;
  };
  /// A return: its place, its cell, and the number of its wall, or -1.
  struct Return {
    Eigen::Vector2d place;
    int cell = 0;
    int wall = -1;
  };

  /// One pose per scan, map frame. Nothing is kept of the scans; the walls are
  /// copied.
  SampledReturns(const std::vector<Wall>& walls, const std::vector<Scan>& scans,
                 const std::vector<Pose2>& poses,
                 const SampledReturnsOptions& options);

  /// In the order of the scans.
  const std::vector<View>& views() const { return views_; }
  /// In the order of the views.
  const std::vector<Return>& returns() const { return returns_; }
  /// As they were given.
  const std::vector<Wall>& walls() const { return walls_; }
  /// Number of cells with returns.
  std::size_t num_cells() const { return cells_.size(); }
  /// Whether the mean of the returns in the cell of a place, or in one beside
  /// it, lies within `reach` of it.
  bool IsNear(const Eigen::Vector2d& place, double reach) const;
  /// The nearest wall within `offset` of a place that is seen from `origin`
  /// from its own side; -1 for none.
  int WallAt(const Eigen::Vector2d& place, const Eigen::Vector2d& origin,
             double offset) const;

 private:
  struct Cell {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    int count = 0;
  };

  void IndexWalls();
  int AddToCell(const Eigen::Vector2d& place);

  const SampledReturnsOptions options_;
  const std::vector<Wall> walls_;
  std::vector<View> views_;
  std::vector<Return> returns_;
  std::vector<Cell> cells_;
  CellIndex cell_of_;
  // Numbers of walls by the cells that they pass through.
  std::vector<std::vector<int>> walls_near_;
  CellIndex walls_near_of_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SAMPLED_RETURNS_H_
