#include <plumbline/plan/room_shape.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

// A corridor is longer than so many times its width, and no wider than this, m.
constexpr double kCorridorRatio = 3.5;
constexpr double kCorridorWidth = 4.0;

}  // namespace

std::pair<double, double> SidesOfRectangle(const Polygon& outline) {
  const double half = 0.25 * outline.Perimeter();
  const double root = std::sqrt(std::max(0.0, half * half - outline.Area()));
  return {half - root, half + root};
}

bool IsLongAndNarrow(const Polygon& outline) {
  const auto [width, length] = SidesOfRectangle(outline);
  return length >= kCorridorRatio * width && width <= kCorridorWidth;
}

}  // namespace plumbline
