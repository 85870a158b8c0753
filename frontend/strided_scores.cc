#include <plumbline/frontend/strided_scores.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

// Compiled once more for processors that add 16 numbers at a time, the same
// sums: which of the two runs is decided when the program starts, earlier than
// a sanitizer is ready.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define PLUMBLINE_FOR_WIDE_LANES \
  __attribute__((target_clones("avx2", "default")))
#else
#define PLUMBLINE_FOR_WIDE_LANES
#endif

namespace plumbline {
namespace {

// Numbers of 16 bits, which compilers add in one instruction or two.
using Lanes = std::int16_t __attribute__((vector_size(32)));
static_assert(sizeof(Lanes) == StridedScores::kLanes * sizeof(std::int16_t));

// Points whose scores are added up between two looks whether what is left can
// still be enough; a lane can hold the sum of 128.
constexpr std::ptrdiff_t kPlacesAtOnce = 64;
static_assert(kPlacesAtOnce * StridedScores::kMostScore <=
              std::numeric_limits<std::int16_t>::max());

}  // namespace

StridedScores::StridedScores(const std::vector<std::int16_t>& scores,
                             int columns, int rows)
    : columns_((columns + kStride - 1) / kStride),
      rows_((rows + kStride - 1) / kStride),
      pitch_(columns_ + 2 * kMostVectors * kLanes),
      scores_(static_cast<std::size_t>(pitch_) *
              static_cast<std::size_t>(rows_ * kStride * kStride)) {
  for (int y = 0; y < rows; ++y) {
    const std::int16_t* from = &scores[static_cast<std::size_t>(y) * columns];
    for (int first = 0; first < kStride; ++first) {
      std::int16_t* to =
          scores_.data() + Begin(first, y % kStride) + pitch_ * (y / kStride);
      for (int x = first; x < columns; x += kStride) *to++ = from[x];
    }
  }
}

StridedScores::Place StridedScores::PlaceOf(int x, int y) const {
  const int column = FloorDivided(x, kStride);
  const int row = FloorDivided(y, kStride);
  return {
      Begin(x - kStride * column, y - kStride * row) + pitch_ * row + column,
      row, column};
}

// Sums of as many nodes as kVectors vectors have lanes, from the first of the
// part on.
template <int kVectors>
__attribute__((always_inline)) inline void StridedScores::SumPart(
    const Place* first, const Place* last, const NodeRun& part, double least,
    std::int32_t* sums) const {
  constexpr int kNodes = kVectors * kLanes;
  const std::int16_t* const scores =
      scores_.data() + pitch_ * part.row + part.column;
  std::fill_n(sums, kNodes, 0);
  while (first != last) {
    const Place* const end =
        first + std::min<std::ptrdiff_t>(last - first, kPlacesAtOnce);
    std::array<Lanes, kVectors> lanes{};
    for (; first != end; ++first) {
      const int column = first->column + part.column;
      // Of no node here, or of no score.
      if (column <= -kNodes || column >= columns_) continue;
      for (int v = 0; v < kVectors; ++v) {
        Lanes score;
        std::memcpy(&score, scores + first->begin + v * kLanes, sizeof(score));
        lanes[v] += score;
      }
    }
    std::array<std::int16_t, kNodes> part_sums;
    std::memcpy(part_sums.data(), lanes.data(), sizeof(part_sums));
    std::int32_t most = std::numeric_limits<std::int32_t>::lowest();
    for (int k = 0; k < kNodes; ++k) {
      sums[k] += part_sums[k];
      most = std::max(most, sums[k]);
    }
    if (most + kMostScore * static_cast<double>(last - first) < least) {
      std::fill_n(sums, kNodes, 0);
      return;
    }
  }
}

PLUMBLINE_FOR_WIDE_LANES void StridedScores::Sum(
    const std::vector<Place>& places, const NodeRun* runs, std::size_t num_runs,
    double least, std::vector<std::int32_t>* sums) const {
  std::size_t size = 0;
  for (std::size_t r = 0; r < num_runs; ++r) size += LanesOf(runs[r]);
  sums->resize(size);
  std::int32_t* to = sums->data();
  const auto is_before = [](const Place& place, int row) {
    return place.row < row;
  };
  const Place* const end = places.data() + places.size();
  for (const NodeRun* run = runs; run != runs + num_runs; ++run) {
    // The nodes of a row bring the same points onto the grid.
    const Place* const first =
        std::lower_bound(places.data(), end, -run->row, is_before);
    const Place* const last =
        std::lower_bound(first, end, rows_ - run->row, is_before);
    const auto lanes = static_cast<int>(LanesOf(*run));
    for (int k = 0; k < lanes; k += kMostVectors * kLanes) {
      const NodeRun part = {run->column + k, run->row, lanes - k};
      switch (std::min(kMostVectors, part.count / kLanes)) {
        case 1:
          SumPart<1>(first, last, part, least, to + k);
          break;
        case 2:
          SumPart<2>(first, last, part, least, to + k);
          break;
        case 3:
          SumPart<3>(first, last, part, least, to + k);
          break;
        default:
          SumPart<kMostVectors>(first, last, part, least, to + k);
      }
    }
    to += lanes;
  }
}

// Index of the first score of the cells at (x, y) modulo kStride. Before and
// behind each row is no score for as many as are added up together.
std::ptrdiff_t StridedScores::Begin(int x, int y) const {
  return (std::ptrdiff_t{y} * kStride + x) * pitch_ * rows_ +
         kMostVectors * kLanes;
}

}  // namespace plumbline
