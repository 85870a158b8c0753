#include <plumbline/outputs/reachable_space.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace plumbline {
namespace {

// Bits of a word.
constexpr int kBits = 64;
// Radii beyond it are cut.
constexpr int kMostRadius = 254;

using Word = std::uint64_t;

// The cells of a raster that have something, a bit each: most of what is done
// with them goes 64 cells at a time, and takes little memory, which comes from
// the system page by page and costs more than to fill it.
class Marks {
 public:
  Marks(int width, int height)
      : width_(width),
        height_(height),
        per_row_((static_cast<std::size_t>(width) + kBits - 1) / kBits),
        words_(per_row_ * static_cast<std::size_t>(height), 0) {}

  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t per_row() const { return per_row_; }
  Word* Row(int row) { return words_.data() + row * per_row_; }
  const Word* Row(int row) const { return words_.data() + row * per_row_; }

  // Within the raster.
  bool Is(int column, int row) const {
    return (Row(row)[column / kBits] >> (column % kBits) & 1) != 0;
  }
  void Set(int column, int row) {
    Row(row)[column / kBits] |= Word{1} << (column % kBits);
  }
  bool Has(int column, int row) const {
    return column >= 0 && row >= 0 && column < width_ && row < height_ &&
           Is(column, row);
  }

  // The bits of a row's last word that stand for cells.
  Word LastMask() const {
    const int rest = width_ % kBits;
    return rest == 0 ? ~Word{0} : (Word{1} << rest) - 1;
  }
  // Marks what is not marked, and no longer what is.
  void Invert() {
    for (Word& word : words_) word = ~word;
    for (int row = 0; row < height_; ++row)
      Row(row)[per_row_ - 1] &= LastMask();
  }
  // Visits the marked cells, row by row.
  template <typename Visit>
  void ForEach(const Visit& visit) const {
    for (int row = 0; row < height_; ++row) {
      for (std::size_t k = 0; k < per_row_; ++k) {
        for (Word word = Row(row)[k]; word != 0; word &= word - 1) {
          visit(static_cast<int>(k) * kBits + __builtin_ctzll(word), row);
        }
      }
    }
  }
  // Combines the words of both, which have one size.
  template <typename Combine>
  void CombineWith(const Marks& other, const Combine& combine) {
    for (std::size_t k = 0; k < words_.size(); ++k) {
      words_[k] = combine(words_[k], other.words_[k]);
    }
  }

 private:
  int width_;
  int height_;
  std::size_t per_row_;
  std::vector<Word> words_;
};

// Of the raster, the cells that `is_marked(value)` says.
template <typename IsMarked>
Marks MarksOf(const SeenCells& seen, const IsMarked& is_marked) {
  Marks marks(seen.width, seen.height);
  const std::uint8_t* cell = seen.cells.data();
  for (int row = 0; row < seen.height; ++row) {
    for (int column = 0; column < seen.width; ++column) {
      if (is_marked(*cell++)) marks.Set(column, row);
    }
  }
  return marks;
}

// Marks the neighbours in the row of what is marked in it as well.
void WidenRow(const Word* from, std::size_t words, Word last_mask, Word* to) {
  Word before = 0;
  for (std::size_t k = 0; k < words; ++k) {
    const Word word = from[k];
    const Word after = k + 1 < words ? from[k + 1] : 0;
    to[k] = word | word << 1 | before >> (kBits - 1) | word >> 1 |
            after << (kBits - 1);
    before = word;
  }
  to[words - 1] &= last_mask;
}

// Of all cells with a marked one within `radius`, from middle to middle.
Marks Widened(int radius, const Marks& marks) {
  radius = std::min(radius, kMostRadius);
  Marks widened(marks.width(), marks.height());
  const std::size_t words = marks.per_row();
  // How wide a disc is in the rows of it, and a row widened by so much.
  std::vector<int> half_widths;
  for (int step = 0; step <= radius; ++step) {
    half_widths.push_back(
        static_cast<int>(std::floor(std::sqrt(radius * radius - step * step))));
  }
  std::vector<Word> wide((static_cast<std::size_t>(radius) + 1) * words);
  for (int row = 0; row < marks.height(); ++row) {
    const Word* const own = marks.Row(row);
    // Most of a raster is far from all marks.
    if (std::all_of(own, own + words, [](Word word) { return word == 0; })) {
      continue;
    }
    std::copy(own, own + words, wide.begin());
    for (int by = 1; by <= radius; ++by) {
      WidenRow(&wide[(by - 1) * words], words, marks.LastMask(),
               &wide[by * words]);
    }
    for (int step = -radius; step <= radius; ++step) {
      if (row + step < 0 || row + step >= marks.height()) continue;
      const Word* const from = &wide[half_widths[std::abs(step)] * words];
      Word* const to = widened.Row(row + step);
      for (std::size_t k = 0; k < words; ++k) to[k] |= from[k];
    }
  }
  return widened;
}

// Of what has nothing unmarked within `radius`.
Marks Shrunk(int radius, Marks marks) {
  marks.Invert();
  Marks shrunk = Widened(radius, marks);
  shrunk.Invert();
  return shrunk;
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
  Marks open =
      MarksOf(seen, [](std::uint8_t cell) { return cell == SeenCells::kFree; });
  if (!options.gap) return open;
  // Columns side by side: memory is visited in its order.
  std::vector<GapBridge> columns(static_cast<std::size_t>(seen.width));
  for (int row = 0; row < seen.height; ++row) {
    GapBridge along;
    const std::uint8_t* const cells =
        seen.cells.data() + static_cast<std::size_t>(row) * seen.width;
    for (int column = 0; column < seen.width; ++column) {
      const auto gap = [&] { return options.gap(column, row); };
      along.Take(column, cells[column], gap, [&](int k) { open.Set(k, row); });
      columns[static_cast<std::size_t>(column)].Take(
          row, cells[column], gap, [&](int k) { open.Set(column, k); });
    }
  }
  return open;
}

// Of the marked cells that hang together, by sides or corners, with one within
// `radius` of a start.
Marks Flooded(const Marks& marks,
              const std::vector<std::pair<int, int>>& starts, int radius) {
  Marks flooded(marks.width(), marks.height());
  std::vector<std::pair<int, int>> next;
  const auto visit_around = [&](int column, int row, int reach) {
    for (int y = row - reach; y <= row + reach; ++y) {
      for (int x = column - reach; x <= column + reach; ++x) {
        if (!marks.Has(x, y) || flooded.Is(x, y)) continue;
        flooded.Set(x, y);
        next.emplace_back(x, y);
      }
    }
  };
  for (const auto& [column, row] : starts) {
    if (column < 0 || row < 0 || column >= marks.width() ||
        row >= marks.height()) {
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
  if (seen->width <= 0 || seen->height <= 0) return;
  const auto forget = [seen](int column, int row) {
    seen->cells[static_cast<std::size_t>(row) * seen->width + column] =
        SeenCells::kUnknown;
  };
  // A cell more than the disc: walls are rough.
  Marks kept = Widened(options.body + 1,
                       Flooded(Shrunk(options.body, OpenCells(*seen, options)),
                               starts, options.body));
  Marks rest = MarksOf(
      *seen, [](std::uint8_t cell) { return cell == SeenCells::kFree; });
  kept.CombineWith(rest, [](Word k, Word free) { return k & free; });
  rest.CombineWith(kept, [](Word free, Word k) { return free & ~k; });
  // Pockets lie beside what can be reached, glimpses lead away from it.
  Marks away = rest;
  away.CombineWith(Widened(options.pocket, kept),
                   [](Word r, Word near) { return r & ~near; });
  std::vector<std::pair<int, int>> starts_away;
  away.ForEach(
      [&](int column, int row) { starts_away.emplace_back(column, row); });
  const Marks glimpses = Flooded(rest, starts_away, 0);
  glimpses.ForEach(forget);
  // What is free now.
  kept.CombineWith(rest, [](Word k, Word r) { return k | r; });
  kept.CombineWith(glimpses, [](Word k, Word g) { return k & ~g; });
  Marks behind = MarksOf(
      *seen, [](std::uint8_t cell) { return cell == SeenCells::kOccupied; });
  behind.CombineWith(Widened(options.behind, kept),
                     [](Word hit, Word near) { return hit & ~near; });
  behind.ForEach(forget);
}

}  // namespace plumbline
