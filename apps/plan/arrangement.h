#ifndef PLUMBLINE_PLAN_ARRANGEMENT_H_
#define PLUMBLINE_PLAN_ARRANGEMENT_H_

#include <plumbline/plan/drawn_lines.h>
#include <plumbline/plan/polygon.h>
#include <plumbline/plan/space_grid.h>

#include <Eigen/Core>
#include <array>
#include <map>
#include <vector>

namespace plumbline {

/// Lengths along a border by what lies there, m.
struct BorderLengths {
  /// By Mark.
  std::array<double, 4> metres = {0.0, 0.0, 0.0, 0.0};
  /// Integral of WallProfile::holds over the border, m.
  double holds = 0.0;

  /// Length with a mark, m.
  double Of(Mark mark) const { return metres[static_cast<std::size_t>(mark)]; }
  /// Sum over all marks, m.
  double length() const {
    return metres[0] + metres[1] + metres[2] + metres[3];
  }
  /// Adds the lengths of another border.
  void Add(const BorderLengths& other) {
    for (std::size_t i = 0; i < 4; ++i) metres[i] += other.metres[i];
    holds += other.holds;
  }
};

/// A piece of a line between two faces.
struct ArrangementEdge {
  /// m, map frame.
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// The faces to the left and to the right of begin to end; -1 for the
  /// unbounded one.
  int left = -1;
  int right = -1;
  /// The drawn line that it lies on, or -1.
  int line = -1;
  BorderLengths lengths;

  /// m
  double length() const { return (end - begin).norm(); }
};

/// The faces into which drawn lines cut the plane.
struct Arrangement {
  std::vector<Polygon> faces;
  /// Free and unknown area of each face, m^2.
  std::vector<double> free;
  std::vector<double> unknown;
  std::vector<ArrangementEdge> edges;
};

/// The faces of a region, and m^2 of them all.
struct RegionParts {
  std::vector<Polygon> faces;
  double area = 0.0;
};

/// By the number of the region what belongs to it. `region`: that of each face,
/// -1 for none.
std::map<int, RegionParts> PartsOfRegions(const Arrangement& arrangement,
                                          const std::vector<int>& region);

/// Cuts the plane along lines. The same lines give the same faces in order.
Arrangement Arrange(const std::vector<DrawnLine>& drawn,
                    const SpaceGrid& space);

/// The drawn line that a straight piece lies on, or -1.
int LineOf(const std::vector<DrawnLine>& drawn, const Eigen::Vector2d& begin,
           const Eigen::Vector2d& end);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_ARRANGEMENT_H_
