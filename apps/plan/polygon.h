#ifndef PLUMBLINE_PLAN_POLYGON_H_
#define PLUMBLINE_PLAN_POLYGON_H_

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace plumbline {

/// Corners in order; the last is joined to the first, which is not repeated.
using Ring = std::vector<Eigen::Vector2d>;

/// Area that a ring encloses, positive when it runs counterclockwise.
double SignedArea(const Ring& ring);

/// A plane figure, m: the shell runs counterclockwise, holes clockwise.
struct Polygon {
  Ring shell;
  std::vector<Ring> holes;

  /// m^2, without the holes.
  double Area() const;
  /// m, holes included.
  double Perimeter() const;
  /// True inside the shell and outside all holes; undefined on the border.
  bool Contains(const Eigen::Vector2d& point) const;
};

/// A straight piece, m.
using StraightPiece = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

/// The bounded faces into which straight pieces cut the plane, corners rounded
/// to a millimetre. All points where pieces cross are corners of the faces, so
/// neighbours share whole edges; pieces that end within a face are left out.
std::vector<Polygon> FacesOf(const std::vector<StraightPiece>& pieces);

/// The union of polygons that lie side by side; corners in a straight line are
/// left out. One polygon for each connected part, the largest first.
std::vector<Polygon> UnionOf(const std::vector<Polygon>& polygons);

/// The polygon shrunk (negative) or grown by `distance`, m, with sharp corners:
/// one polygon for each part that is left, the largest first.
std::vector<Polygon> Offset(const Polygon& polygon, double distance);

/// The intersection of two polygons, the largest part first. Polygons that
/// cross themselves are repaired first.
std::vector<Polygon> IntersectionOf(const Polygon& a, const Polygon& b);

/// The part of `a` outside of `b`, the largest piece first.
std::vector<Polygon> DifferenceOf(const Polygon& a, const Polygon& b);

/// A point as far from the border as can be, to 10 cm: where a label goes. The
/// origin for an empty polygon.
Eigen::Vector2d InnerPoint(const Polygon& polygon);

/// The polygon, repaired where its border crosses itself: the largest part;
/// empty when nothing with an area is left.
Polygon Mended(const Polygon& polygon);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_POLYGON_H_
