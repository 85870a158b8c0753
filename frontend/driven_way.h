#ifndef PLUMBLINE_FRONTEND_DRIVEN_WAY_H_
#define PLUMBLINE_FRONTEND_DRIVEN_WAY_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/cell_index.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// The way that a robot has driven: where it went through, no wall stands.
class DrivenWay {
 public:
  /// Poses of one robot in the order of time, m and rad, map frame. Steps of
  /// more than a metre are jumps and not driven.
  explicit DrivenWay(const std::vector<Pose2>& poses);

  /// Where the way crosses the part [begin, end] of the line through `point`
  /// along `direction` (of length 1): distances along the line from `point`, m,
  /// ascending.
  std::vector<double> Crossings(const Eigen::Vector2d& point,
                                const Eigen::Vector2d& direction, double begin,
                                double end) const;

 private:
  struct Step {
    Eigen::Vector2d from;
    Eigen::Vector2d to;
  };

  void Insert(const Step& step);

  std::vector<Step> steps_;
  // Numbers of the steps that begin, end or have their middle in a cell.
  CellIndex cell_of_;
  std::vector<std::vector<int>> cells_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_DRIVEN_WAY_H_
