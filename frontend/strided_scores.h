#ifndef PLUMBLINE_FRONTEND_STRIDED_SCORES_H_
#define PLUMBLINE_FRONTEND_STRIDED_SCORES_H_

#include <cstddef>
#include <cstdint>
#include <vector>

namespace plumbline {

/// Nodes of a row that a search looks at: [column, column + count).
struct NodeRun {
  int column;
  int row;
  int count;
};

/// Scores of a grid of cells in the order in which a search adds them up that
/// moves points by steps of kStride cells (nodes): those of cells that are a
/// step apart lie beside each other.
class StridedScores {
 public:
  /// Cells of a step, each way.
  static constexpr int kStride = 4;
  /// The largest score; the least is no less than this below zero.
  static constexpr double kMostScore = 255.0;
  /// Nodes that are added up together.
  static constexpr int kLanes = 16;

  /// Where the scores of a point lie that the nodes give it.
  struct Place {
    /// That of node (0, 0).
    std::ptrdiff_t begin;
    int row;
    int column;
  };

  /// `scores`: by rows, columns x rows.
  StridedScores(const std::vector<std::int16_t>& scores, int columns, int rows);

  /// Of the cell, which may lie outside of the grid, that node (0, 0) brings a
  /// point to.
  Place PlaceOf(int x, int y) const;

  /// For each node of the runs, kLanes at a time, the sum of the scores that it
  /// gives to the points at the places, which are in the order of rows; `sums`
  /// is as long as LanesOf says. Those of nodes none of which beside each other
  /// can be `least` are not added up, and are 0.
  void Sum(const std::vector<Place>& places, const NodeRun* runs,
           std::size_t num_runs, double least,
           std::vector<std::int32_t>* sums) const;

  /// How many sums a run has.
  static std::size_t LanesOf(const NodeRun& run) {
    return static_cast<std::size_t>((run.count + kLanes - 1) / kLanes * kLanes);
  }

 private:
  // Vectors of kLanes nodes whose sums stay in registers.
  static constexpr int kMostVectors = 4;

  std::ptrdiff_t Begin(int x, int y) const;
  template <int kVectors>
  void SumPart(const Place* first, const Place* last, const NodeRun& part,
               double least, std::int32_t* sums) const;

  int columns_;
  int rows_;
  // Of one row to the next.
  std::ptrdiff_t pitch_;
  std::vector<std::int16_t> scores_;
};

/// Rounded down.
inline int FloorDivided(int x, int by) {
  return x >= 0 ? x / by : -((by - 1 - x) / by);
}

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_STRIDED_SCORES_H_
