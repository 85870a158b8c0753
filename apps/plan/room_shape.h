#ifndef PLUMBLINE_PLAN_ROOM_SHAPE_H_
#define PLUMBLINE_PLAN_ROOM_SHAPE_H_

#include <plumbline/plan/polygon.h>

#include <utility>

namespace plumbline {

/// The sides of a rectangle with the area and perimeter of `outline`, the
/// shorter one first, m.
std::pair<double, double> SidesOfRectangle(const Polygon& outline);

/// A corridor: as a rectangle of the same area and perimeter it is at most 4 m
/// wide and longer than 3.5 times that.
bool IsLongAndNarrow(const Polygon& outline);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_ROOM_SHAPE_H_
