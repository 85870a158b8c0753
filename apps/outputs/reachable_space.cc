#include <plumbline/outputs/reachable_space.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

namespace plumbline {
namespace {

// Cells of a row that are passed over together.
constexpr int kBlock = 64;

// 1 for cells of a raster that have something, 0 for the others.
struct Marks {
  Marks(int width, int height) : width(width), height(height) {}

  // No cell has anything.
  void Reset() { cells.assign(static_cast<std::size_t>(width) * height, 0); }

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

// How far the nearest cell of the row with this mark is, up to `far`, for all
// cells of a row: run by run of such and of other cells.
void FillNearest(const std::uint8_t* marks, int mark, int width, int far,
                 std::uint8_t* nearest) {
  const auto find = [&](int begin, int value) {
    const void* const found = std::memchr(marks + begin, value, width - begin);
    return found == nullptr
               ? width
               : static_cast<int>(static_cast<const std::uint8_t*>(found) -
                                  marks);
  };
  std::fill(nearest, nearest + width, static_cast<std::uint8_t>(far));
  for (int begin = find(0, mark), last = 0; begin < width;) {
    for (int i = std::max(last, begin - far); i < begin; ++i) {
      nearest[i] = std::min(nearest[i], static_cast<std::uint8_t>(begin - i));
    }
    last = find(begin, 1 - mark);
    std::fill(nearest + begin, nearest + last, std::uint8_t{0});
    for (int i = last; i < std::min(width, last + far); ++i) {
      nearest[i] = static_cast<std::uint8_t>(i - last + 1);
    }
    begin = last < width ? find(last, mark) : width;
  }
}

// Rasters of one size that are filled again and again: what one of them takes
// comes from the system page by page, which costs more than to fill it.
struct Scratch {
  Scratch(int width, int height)
      : nearest(width, height), around(width, height) {}

  Marks nearest;
  Marks around;
};

// Blocks of cells of rows, and whether each has something.
class Blocks {
 public:
  explicit Blocks(const Marks& marks)
      : width_(marks.width),
        per_row_((marks.width + kBlock - 1) / kBlock),
        has_(static_cast<std::size_t>(per_row_) * marks.height, 0) {}

  std::uint8_t* Row(int row) {
    return &has_[static_cast<std::size_t>(row) * per_row_];
  }
  int per_row() const { return per_row_; }
  int EndOf(int block) const { return std::min(width_, (block + 1) * kBlock); }

 private:
  int width_;
  int per_row_;
  std::vector<std::uint8_t> has_;
};

// The rows up to `radius` from one, and how wide a disc about a cell of it is
// in each.
template <typename Visit>
void VisitDisc(int radius, int row, int height, const Visit& visit) {
  for (int step = std::max(-radius, -row);
       step <= std::min(radius, height - 1 - row); ++step) {
    visit(row + step, static_cast<std::uint8_t>(std::floor(
                          std::sqrt(radius * radius - step * step))));
  }
}

// Radii beyond it are cut.
int DiscRadius(int radius) { return std::min(radius, 254); }

// Marks all cells with a marked one within `radius`, from middle to middle, and
// no others.
void Widen(int radius, Marks* widened, Scratch* scratch) {
  const Marks& marks = *widened;
  const int far = DiscRadius(radius) + 1;
  Marks& nearest = scratch->nearest;
  nearest.cells.resize(marks.cells.size());
  // Most of a raster is far from all marks.
  Blocks near(marks);
  for (int row = 0; row < marks.height; ++row) {
    std::uint8_t* const own = &nearest.cells[marks.IndexOf(0, row)];
    FillNearest(&marks.cells[marks.IndexOf(0, row)], 1, marks.width, far, own);
    for (int block = 0; block < near.per_row(); ++block) {
      std::uint8_t least = own[block * kBlock];
      for (int i = block * kBlock; i < near.EndOf(block); ++i) {
        least = std::min(least, own[i]);
      }
      near.Row(row)[block] = least < far;
    }
  }
  Marks& around = scratch->around;
  around.Reset();
  for (int row = 0; row < marks.height; ++row) {
    std::uint8_t* const to = &around.cells[marks.IndexOf(0, row)];
    VisitDisc(far - 1, row, marks.height, [&](int other, std::uint8_t wide) {
      const std::uint8_t* const from = &nearest.cells[marks.IndexOf(0, other)];
      for (int block = 0; block < near.per_row(); ++block) {
        if (near.Row(other)[block] == 0) continue;
        const int end = near.EndOf(block);
        for (int i = block * kBlock; i < end; ++i) {
          to[i] |= static_cast<std::uint8_t>(from[i] <= wide);
        }
      }
    });
  }
  std::swap(*widened, around);
}

// Leaves marked only what has nothing unmarked within `radius`.
void Shrink(int radius, Marks* marks, Scratch* scratch) {
  const int far = DiscRadius(radius) + 1;
  Marks& nearest = scratch->nearest;
  nearest.cells.resize(marks->cells.size());
  Blocks marked(*marks);
  for (int row = 0; row < marks->height; ++row) {
    const std::uint8_t* const own = &marks->cells[marks->IndexOf(0, row)];
    FillNearest(own, 0, marks->width, far,
                &nearest.cells[marks->IndexOf(0, row)]);
    for (int block = 0; block < marked.per_row(); ++block) {
      marked.Row(row)[block] =
          std::memchr(own + block * kBlock, 1,
                      static_cast<std::size_t>(marked.EndOf(block) -
                                               block * kBlock)) != nullptr;
    }
  }
  for (int row = 0; row < marks->height; ++row) {
    std::uint8_t* const to = &marks->cells[marks->IndexOf(0, row)];
    VisitDisc(far - 1, row, marks->height, [&](int other, std::uint8_t wide) {
      const std::uint8_t* const from = &nearest.cells[marks->IndexOf(0, other)];
      for (int block = 0; block < marked.per_row(); ++block) {
        if (marked.Row(row)[block] == 0) continue;
        const int end = marked.EndOf(block);
        for (int i = block * kBlock; i < end; ++i) {
          to[i] &= static_cast<std::uint8_t>(from[i] > wide);
        }
      }
    });
  }
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
  open.cells.resize(seen.cells.size());
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

// Makes `flooded` the marked cells that hang together, by sides or corners,
// with one within `radius` of a start.
void Flood(const Marks& marks, const std::vector<std::pair<int, int>>& starts,
           int radius, Marks* flooded) {
  flooded->Reset();
  std::vector<std::pair<int, int>> next;
  const auto visit_around = [&](int column, int row, int reach) {
    for (int y = row - reach; y <= row + reach; ++y) {
      for (int x = column - reach; x <= column + reach; ++x) {
        if (!marks.Has(x, y) || flooded->Has(x, y)) continue;
        flooded->cells[flooded->IndexOf(x, y)] = 1;
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
}

}  // namespace

void KeepReachable(const std::vector<std::pair<int, int>>& starts,
                   const ReachOptions& options, SeenCells* seen) {
  Scratch scratch(seen->width, seen->height);
  Marks marks = OpenCells(*seen, options);
  Shrink(options.body, &marks, &scratch);
  Flood(marks, starts, options.body, &scratch.around);
  std::swap(marks, scratch.around);
  // A cell more than the disc: walls are rough.
  Widen(options.body + 1, &marks, &scratch);
  Marks rest(seen->width, seen->height);
  rest.cells.resize(seen->cells.size());
  for (std::size_t i = 0; i < rest.cells.size(); ++i) {
    const bool is_free = seen->cells[i] == SeenCells::kFree;
    rest.cells[i] = is_free && marks.cells[i] == 0;
    marks.cells[i] = is_free && marks.cells[i] != 0;
  }
  // Pockets lie beside what can be reached, glimpses lead away from it.
  Widen(options.pocket, &marks, &scratch);
  std::vector<std::pair<int, int>> away;
  for (int row = 0; row < seen->height; ++row) {
    for (int column = 0; column < seen->width; ++column) {
      const std::size_t i = rest.IndexOf(column, row);
      if (rest.cells[i] != 0 && marks.cells[i] == 0) {
        away.emplace_back(column, row);
      }
    }
  }
  Marks& glimpses = scratch.nearest;
  Flood(rest, away, 0, &glimpses);
  for (std::size_t i = 0; i < marks.cells.size(); ++i) {
    std::uint8_t& cell = seen->cells[i];
    if (glimpses.cells[i] != 0) cell = SeenCells::kUnknown;
    marks.cells[i] = cell == SeenCells::kFree;
  }
  Widen(options.behind, &marks, &scratch);
  for (std::size_t i = 0; i < marks.cells.size(); ++i) {
    std::uint8_t& cell = seen->cells[i];
    if (cell == SeenCells::kOccupied && marks.cells[i] == 0) {
      cell = SeenCells::kUnknown;
    }
  }
}

}  // namespace plumbline
