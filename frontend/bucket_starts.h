#ifndef PLUMBLINE_FRONTEND_BUCKET_STARTS_H_
#define PLUMBLINE_FRONTEND_BUCKET_STARTS_H_

#include <algorithm>
#include <cstddef>
#include <vector>

namespace plumbline {

/// How many points lie in the cells of a raster before each cell, row by row:
/// where the points of a cell begin when they are sorted so. For rasters most
/// of whose cells are empty: these take a number for every kBlock of them.
class BucketStarts {
 public:
  /// Neighbouring cells of a row that have numbers of their own, or one.
  static constexpr int kBlock = 16;

  /// Begins a raster without points.
  void Reset(int columns, int rows) {
    // One more column: the end of a row is the begin of the next one.
    blocks_per_row_ =
        static_cast<std::size_t>(columns) / static_cast<std::size_t>(kBlock) +
        1;
    blocks_.resize(blocks_per_row_ * static_cast<std::size_t>(rows));
    starts_.clear();
    num_blocks_ = 0;
  }

  /// Points of a cell come next, after `start` others. Cells come row by row,
  /// and in each by columns, each once.
  void Begin(int column, int row, int start) {
    const std::size_t block = BlockOf(column, row);
    if (num_blocks_ <= block) {
      FillUpTo(block, start);
      blocks_[block] = static_cast<int>(starts_.size());
      ++num_blocks_;
    }
    const std::size_t size = static_cast<std::size_t>(blocks_[block]) +
                             static_cast<std::size_t>(column % kBlock) + 1;
    starts_.resize(size, start);
  }

  /// All `count` points have come.
  void Finish(int count) { FillUpTo(blocks_.size(), count); }

  /// The points in cells before this one; `column` may be one beyond the last.
  int Before(int column, int row) const {
    const int block = blocks_[BlockOf(column, row)];
    return block < 0 ? ~block
                     : starts_[static_cast<std::size_t>(block) +
                               static_cast<std::size_t>(column % kBlock)];
  }

 private:
  std::size_t BlockOf(int column, int row) const {
    return static_cast<std::size_t>(row) * blocks_per_row_ +
           static_cast<std::size_t>(column / kBlock);
  }

  // Cells from the last one that has points on, up to a block, have `start`
  // before them.
  void FillUpTo(std::size_t block, int start) {
    constexpr std::size_t kSize = kBlock;
    starts_.resize((starts_.size() + kSize - 1) / kSize * kSize, start);
    std::fill(blocks_.begin() + static_cast<std::ptrdiff_t>(num_blocks_),
              blocks_.begin() + static_cast<std::ptrdiff_t>(block), ~start);
    num_blocks_ = block;
  }

  std::size_t blocks_per_row_ = 1;
  // What lies before all cells of a block, inverted; or where the numbers of
  // its cells are.
  std::vector<int> blocks_;
  std::vector<int> starts_;
  // Blocks that are known.
  std::size_t num_blocks_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BUCKET_STARTS_H_
