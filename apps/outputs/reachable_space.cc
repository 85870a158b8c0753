#include <plumbline/outputs/reachable_space.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

namespace plumbline {
namespace {

// Cells of a row that are passed over together.
constexpr int kBlock = 64;

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

// How far the nearest marked cell in its row is, up to `far`, for all cells of
// a row: run by run of marked and of other cells.
void FillNearest(const std::uint8_t* marks, int width, int far,
                 std::uint8_t* nearest) {
  const auto find = [&](int begin, int value) {
    const void* const found = std::memchr(marks + begin, value, width - begin);
    return found == nullptr
               ? width
               : static_cast<int>(static_cast<const std::uint8_t*>(found) -
                                  marks);
  };
  std::fill(nearest, nearest + width, static_cast<std::uint8_t>(far));
  for (int begin = find(0, 1), last = 0; begin < width;) {
    for (int i = std::max(last, begin - far); i < begin; ++i) {
      nearest[i] = std::min(nearest[i], static_cast<std::uint8_t>(begin - i));
    }
    last = find(begin, 0);
    std::fill(nearest + begin, nearest + last, std::uint8_t{0});
    for (int i = last; i < std::min(width, last + far); ++i) {
      nearest[i] = static_cast<std::uint8_t>(i - last + 1);
    }
    begin = last < width ? find(last, 1) : width;
  }
}

// Cells with a marked one within `radius`, from middle to middle.
Marks Around(const Marks& marks, int radius) {
  const int far = std::min(radius, 254) + 1;
  Marks nearest(marks.width, marks.height);
  // Most of a raster is far from all marks: blocks of cells of a row say where.
  const int blocks = (marks.width + kBlock - 1) / kBlock;
  std::vector<std::uint8_t> is_near(
      static_cast<std::size_t>(blocks) * marks.height, 0);
  const auto end_of = [&](int block) {
    return std::min(marks.width, (block + 1) * kBlock);
  };
  for (int row = 0; row < marks.height; ++row) {
    std::uint8_t* const own = &nearest.cells[marks.IndexOf(0, row)];
    FillNearest(&marks.cells[marks.IndexOf(0, row)], marks.width, far, own);
    for (int block = 0; block < blocks; ++block) {
      std::uint8_t least = own[block * kBlock];
      for (int i = block * kBlock; i < end_of(block); ++i) {
        least = std::min(least, own[i]);
      }
      is_near[static_cast<std::size_t>(row) * blocks + block] = least < far;
    }
  }
  Marks around(marks.width, marks.height);
  for (int row = 0; row < marks.height; ++row) {
    std::uint8_t* const to = &around.cells[marks.IndexOf(0, row)];
    const int first = std::max(1 - far, -row);
    const int last = std::min(far, marks.height - row);
    for (int step = first; step < last; ++step) {
      const auto wide = static_cast<std::uint8_t>(
          std::floor(std::sqrt((far - 1) * (far - 1) - step * step)));
      const std::uint8_t* const from =
          &nearest.cells[marks.IndexOf(0, row + step)];
      const std::uint8_t* const near =
          &is_near[static_cast<std::size_t>(row + step) * blocks];
      for (int block = 0; block < blocks; ++block) {
        if (near[block] == 0) continue;
        const int end = end_of(block);
        for (int i = block * kBlock; i < end; ++i) {
          to[i] |= static_cast<std::uint8_t>(from[i] <= wide);
        }
      }
    }
  }
  return around;
}

// Bridges the unknown cells of a row or column that lie between free ones and
// are no more than the gap there.
class GapBridge {
 public:
  // Takes the cells in turn; calls `open(k)` with the places of those that are
  // bridged before this one.
  template <typename Gap, typename Open>
  void Take(int place, std::uint8_t cell, const Gap& gap, const Open& open) {
    if (cell == SeenCells::kUnknown) return;
    const bool is_free = cell == SeenCells::kFree;
    if (is_free && last_ >= 0 && place - last_ > 1 &&
        place - last_ - 1 <= gap()) {
      for (int k = last_ + 1; k < place; ++k) open(k);
    }
    last_ = is_free ? place : -1;
  }

 private:
  int last_ = -1;  // the last known cell, when it is free
};

Marks OpenCells(const SeenCells& seen, const ReachOptions& options) {
  Marks open(seen.width, seen.height);
  for (std::size_t i = 0; i < open.cells.size(); ++i) {
    open.cells[i] = seen.cells[i] == SeenCells::kFree;
  }
  if (!options.gap) return open;
  // Columns side by side: memory is visited in its order.
  std::vector<GapBridge> columns(static_cast<std::size_t>(seen.width));
  for (int row = 0; row < seen.height; ++row) {
    GapBridge along;
    const std::uint8_t* const cells = &seen.cells[open.IndexOf(0, row)];
    for (int column = 0; column < seen.width; ++column) {
      const auto gap = [&] { return options.gap(column, row); };
      along.Take(column, cells[column], gap,
                 [&](int k) { open.cells[open.IndexOf(k, row)] = 1; });
      columns[static_cast<std::size_t>(column)].Take(
          row, cells[column], gap,
          [&](int k) { open.cells[open.IndexOf(column, k)] = 1; });
    }
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
