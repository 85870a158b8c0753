#ifndef PLUMBLINE_TEST_PLAN_DRAWING_H_
#define PLUMBLINE_TEST_PLAN_DRAWING_H_

#include <plumbline/plan/space_grid.h>

#include <cmath>
#include <cstddef>

namespace plumbline {

/// A raster to draw rooms into, m; unknown where nothing was drawn.
class Drawing {
 public:
  Drawing(double width, double height) {
    space_.width = static_cast<int>(width / space_.resolution);
    space_.height = static_cast<int>(height / space_.resolution);
    space_.cells.assign(static_cast<std::size_t>(space_.width) * space_.height,
                        Space::kUnknown);
  }

  Drawing& Fill(double x1, double y1, double x2, double y2, Space what) {
    const auto cell = [&](double v) {
      return static_cast<int>(std::lround(v / space_.resolution));
    };
    for (int row = cell(y1); row < cell(y2); ++row) {
      for (int column = cell(x1); column < cell(x2); ++column) {
        space_.cells[static_cast<std::size_t>(row) * space_.width + column] =
            what;
      }
    }
    return *this;
  }
  // Fills the cells for whose middles, m, `is_inside` holds.
  template <typename IsInside>
  Drawing& FillWhere(Space what, const IsInside& is_inside) {
    for (int row = 0; row < space_.height; ++row) {
      for (int column = 0; column < space_.width; ++column) {
        if (!is_inside(space_.Middle(column, row))) continue;
        space_.cells[static_cast<std::size_t>(row) * space_.width + column] =
            what;
      }
    }
    return *this;
  }
  Drawing& Free(double x1, double y1, double x2, double y2) {
    return Fill(x1, y1, x2, y2, Space::kFree);
  }
  // A room whose faces lie on the rectangle: its rim is occupied.
  Drawing& Room(double x1, double y1, double x2, double y2) {
    Fill(x1 - 0.05, y1 - 0.05, x2 + 0.05, y2 + 0.05, Space::kOccupied);
    return Free(x1, y1, x2, y2);
  }
  const SpaceGrid& space() const { return space_; }

 private:
  SpaceGrid space_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_PLAN_DRAWING_H_
