#ifndef PLUMBLINE_OUTPUTS_REACHABLE_SPACE_H_
#define PLUMBLINE_OUTPUTS_REACHABLE_SPACE_H_

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

namespace plumbline {

/// What was seen of the cells of a raster.
struct SeenCells {
  enum : std::uint8_t { kUnknown, kFree, kOccupied };
  int width = 0;
  int height = 0;
  /// width * height of the values above, row by row.
  std::vector<std::uint8_t> cells;
};

/// Lengths in cells.
struct ReachOptions {
  /// A disc of this radius around its middle cell moves through free space.
  int body = 3;
  /// Free cells that it does not reach are kept when all that hang together, by
  /// sides or corners, lie this near to reached ones: pockets in furniture.
  int pocket = 20;
  /// What was hit is kept up to this far from free space that is kept.
  int behind = 6;
  /// Up to this many unknown cells between two free ones in a row or a column
  /// hinder the disc no more than free ones: rays are that far apart there.
  /// Empty: 0.
  std::function<int(int column, int row)> gap;
};

/// Makes unknown what was seen, but cannot be reached from where the robot was
/// (`starts`, columns and rows; those outside are passed over): free cells that
/// a disc does not touch on a way over free cells alone and that lead away from
/// those that it does, and what was hit beyond those that are left. Such are
/// glimpses through panes and cracks, and rays that graze past walls.
///
/// The disc starts anywhere within its radius of a start. Takes time in
/// proportion to the cells, and a few bytes for each of them.
void KeepReachable(const std::vector<std::pair<int, int>>& starts,
                   const ReachOptions& options, SeenCells* seen);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_REACHABLE_SPACE_H_
