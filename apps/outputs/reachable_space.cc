#include <plumbline/outputs/reachable_space.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace plumbline {
namespace {

// 1 for cells of a raster that have something, 0 for the others.
struct Marks {
  Marks(int width, int height)
      : width(width),
        height(height),
        cells(static_cast<std::size_t>(width) * height, 0) {}

  std::size_t IndexOf(int column, int row) const {
    return static_cast<std::size_t>(row) * width + column;
  }
  bool Has(int column, int row) const {
    return column >= 0 && row >= 0 && column < width && row < height &&
           cells[IndexOf(column, row)] != 0;
  }

  int width;
  int height;
  std::vector<std::uint8_t> cells;
};

// Cells with a marked one within `radius`, from middle to middle.
Marks Around(const Marks& marks, int radius) {
  const int far = std::min(radius, 254) + 1;
  // How far the nearest in its row is, up to `far`.
  Marks nearest(marks.width, marks.height);
  for (int row = 0; row < marks.height; ++row) {
    const std::size_t begin = marks.IndexOf(0, row);
    int distance = far;
    const auto visit = [&](std::size_t i, bool is_first) {
      distance = marks.cells[i] != 0 ? 0 : std::min(far, distance + 1);
      if (is_first || distance < nearest.cells[i]) {
        nearest.cells[i] = static_cast<std::uint8_t>(distance);
      }
    };
    const auto width = static_cast<std::size_t>(marks.width);
    for (std::size_t i = 0; i < width; ++i) visit(begin + i, true);
    distance = far;
    for (std::size_t i = width; i-- > 0;) visit(begin + i, false);
  }
  Marks around(marks.width, marks.height);
  for (int step = 1 - far; step < far; ++step) {
    const auto wide = static_cast<int>(
        std::floor(std::sqrt((far - 1) * (far - 1) - step * step)));
    const int first = std::max(0, -step);
    const int last = std::min(marks.height, marks.height - step);
    for (int row = first; row < last; ++row) {
      const std::uint8_t* const from =
          &nearest.cells[marks.IndexOf(0, row + step)];
      std::uint8_t* const to = &around.cells[marks.IndexOf(0, row)];
      for (int i = 0; i < marks.width; ++i) to[i] |= from[i] <= wide;
    }
  }
  return around;
}

// Marks the unknown cells of a row or column of `count` cells, `step` apart,
// that lie between free ones and are no more than the gap there.
void BridgeGaps(const SeenCells& seen, std::size_t begin, std::size_t step,
                int count, const std::function<int(int)>& gap, Marks* open) {
  int last = -1;  // the last known cell, when it is free
  for (int i = 0; i < count; ++i) {
    const std::uint8_t here =
        seen.cells[begin + static_cast<std::size_t>(i) * step];
    if (here == SeenCells::kUnknown) continue;
    const bool is_free = here == SeenCells::kFree;
    if (is_free && last >= 0 && i - last > 1 && i - last - 1 <= gap(i)) {
      for (int k = last + 1; k < i; ++k) {
        open->cells[begin + static_cast<std::size_t>(k) * step] = 1;
      }
    }
    last = is_free ? i : -1;
  }
}

Marks OpenCells(const SeenCells& seen, const ReachOptions& options) {
  Marks open(seen.width, seen.height);
  for (std::size_t i = 0; i < open.cells.size(); ++i) {
    open.cells[i] = seen.cells[i] == SeenCells::kFree;
  }
  if (!options.gap) return open;
  for (int row = 0; row < seen.height; ++row) {
    BridgeGaps(
        seen, open.IndexOf(0, row), 1, seen.width,
        [&](int column) { return options.gap(column, row); }, &open);
  }
  for (int column = 0; column < seen.width; ++column) {
    BridgeGaps(
        seen, open.IndexOf(column, 0), static_cast<std::size_t>(seen.width),
        seen.height, [&](int row) { return options.gap(column, row); }, &open);
  }
  return open;
}

// The marked cells that hang together, by sides or corners, with one within
// `radius` of a start.
Marks Flooded(const Marks& marks,
              const std::vector<std::pair<int, int>>& starts, int radius) {
  Marks flooded(marks.width, marks.height);
  std::vector<std::pair<int, int>> next;
  const auto visit_around = [&](int column, int row, int reach) {
    for (int y = row - reach; y <= row + reach; ++y) {
      for (int x = column - reach; x <= column + reach; ++x) {
        if (!marks.Has(x, y) || flooded.Has(x, y)) continue;
        flooded.cells[flooded.IndexOf(x, y)] = 1;
        next.emplace_back(x, y);
      }
    }
  };
  for (const auto& [column, row] : starts) {
    if (column < 0 || row < 0 || column >= marks.width || row >= marks.height) {
      continue;
    }
    visit_around(column, row, radius);
  }
  while (!next.empty()) {
    const auto [column, row] = next.back();
    next.pop_back();
    visit_around(column, row, 1);
  }
  return flooded;
}

}  // namespace

void KeepReachable(const std::vector<std::pair<int, int>>& starts,
                   const ReachOptions& options, SeenCells* seen) {
  Marks marks = OpenCells(*seen, options);
  for (std::uint8_t& cell : marks.cells) cell = cell == 0;
  marks = Around(marks, options.body);
  for (std::uint8_t& cell : marks.cells) cell = cell == 0;
  // A cell more than the disc: walls are rough.
  marks = Around(Flooded(marks, starts, options.body), options.body + 1);
  Marks rest(seen->width, seen->height);
  for (std::size_t i = 0; i < rest.cells.size(); ++i) {
    const bool is_free = seen->cells[i] == SeenCells::kFree;
    rest.cells[i] = is_free && marks.cells[i] == 0;
    marks.cells[i] = is_free && marks.cells[i] != 0;
  }
  // Pockets lie beside what can be reached, glimpses lead away from it.
  marks = Around(marks, options.pocket);
  std::vector<std::pair<int, int>> away;
  for (int row = 0; row < seen->height; ++row) {
    for (int column = 0; column < seen->width; ++column) {
      const std::size_t i = rest.IndexOf(column, row);
      if (rest.cells[i] != 0 && marks.cells[i] == 0) {
        away.emplace_back(column, row);
      }
    }
  }
  const Marks glimpses = Flooded(rest, away, 0);
  for (std::size_t i = 0; i < marks.cells.size(); ++i) {
    std::uint8_t& cell = seen->cells[i];
    if (glimpses.cells[i] != 0) cell = SeenCells::kUnknown;
    marks.cells[i] = cell == SeenCells::kFree;
  }
  marks = Around(marks, options.behind);
  for (std::size_t i = 0; i < marks.cells.size(); ++i) {
    std::uint8_t& cell = seen->cells[i];
    if (cell == SeenCells::kOccupied && marks.cells[i] == 0) {
      cell = SeenCells::kUnknown;
    }
  }
}

}  // namespace plumbline
