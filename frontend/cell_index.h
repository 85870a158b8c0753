#ifndef PLUMBLINE_FRONTEND_CELL_INDEX_H_
#define PLUMBLINE_FRONTEND_CELL_INDEX_H_

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace plumbline {

/// Key of a cell of a grid for hash tables.
inline std::int64_t CellKey(std::int64_t column, std::int64_t row) {
  // Unsigned, since a negative column cannot be shifted.
  return static_cast<std::int64_t>(
      static_cast<std::uint64_t>(column) << 32 |
      (static_cast<std::uint64_t>(row) & 0xffffffffu));
}

/// Numbers of cells by their keys, in an open table: one is looked up for every
/// return of a log, several times.
class CellIndex {
 public:
  /// Forgets all; the memory is kept.
  void Clear() {
    std::fill(slots_.begin(), slots_.end(), Slot());
    size_ = 0;
  }

  /// The number of a cell; a new one gets `next` (not negative).
  int FindOrAdd(std::int64_t key, int next) {
    if (2 * (size_ + 1) > slots_.size()) Grow();
    Slot& slot = slots_[PlaceOf(key)];
    if (slot.number < 0) {
      slot = {key, next};
      ++size_;
    }
    return slot.number;
  }

  /// -1: not there.
  int Find(std::int64_t key) const {
    return slots_.empty() ? -1 : slots_[PlaceOf(key)].number;
  }

 private:
  struct Slot {
    std::int64_t key = 0;
    // -1: none.
    int number = -1;
  };

  static constexpr std::size_t kSmallest = 64;
  static constexpr int kShiftOfSmallest = 58;

  std::size_t PlaceOf(std::int64_t key) const {
    constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;
    const std::size_t mask = slots_.size() - 1;
    std::size_t place = (static_cast<std::uint64_t>(key) * kGolden) >> shift_;
    while (slots_[place].number >= 0 && slots_[place].key != key) {
      place = (place + 1) & mask;
    }
    return place;
  }

  void Grow() {
    std::vector<Slot> old;
    old.swap(slots_);
    if (old.empty()) {
      slots_.resize(kSmallest);
      shift_ = kShiftOfSmallest;
      return;
    }
    slots_.resize(2 * old.size());
    --shift_;
    for (const Slot& slot : old) {
      if (slot.number >= 0) slots_[PlaceOf(slot.key)] = slot;
    }
  }

  // As many as a power of two, no more than half of them taken.
  std::vector<Slot> slots_;
  std::size_t size_ = 0;
  int shift_ = kShiftOfSmallest;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_CELL_INDEX_H_
