#ifndef PLUMBLINE_OUTPUTS_OCCUPANCY_GRID_H_
#define PLUMBLINE_OUTPUTS_OCCUPANCY_GRID_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/beam_directions.h>
#include <plumbline/frontend/scan.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Options of a grid made of scans.
struct OccupancyOptions {
  /// Side of a cell, m.
  double resolution = 0.05;
  /// Returns that are nearer are the robot itself, m; returns that are farther
  /// hit nothing, and clear the way only so far.
  double minimum_range = 0.1;
  double usable_range = 50.0;
  /// A cell is occupied when at least this many scans hit it, and these are at
  /// least this share of the scans that hit it or saw through it. The share is
  /// the threshold at 0 of log-odds that go up by 3 for a hit and down by 1
  /// for a miss.
  int min_hits = 2;
  double occupied_share = 0.25;
  /// Free is what a way as wide as this leads to from where the robot was, m,
  /// and what lies close to it (ForgetUnreachable); 0: all that was seen
  /// through.
  double least_passage = 0.35;
  /// Rim of unknown cells around what was seen.
  int border = 10;
  /// Most scans that rays are cast for, in even steps through the log; 0: all.
  std::size_t max_scans = 0;
  /// Most cells that the grid may have (width times height).
  std::int64_t max_cells = 100'000'000;
  /// Threads that cast rays, with memory for a grid each; the grid does not
  /// depend on their number.
  int num_threads = 1;
};

/// A grid of what is free, occupied and unknown, from the rays of laser scans.
/// Memory is taken by tiles as they are seen: 6 bytes per cell.
class OccupancyGrid {
 public:
  /// Values of ROS' map_server for these in a PGM.
  static constexpr std::uint8_t kOccupied = 0;
  static constexpr std::uint8_t kUnknown = 205;
  static constexpr std::uint8_t kFree = 254;

  /// An unknown grid that holds everything between two corners (m, map frame)
  /// and the border. Its cells are aligned to multiples of the resolution.
  /// Throws Error when options make no sense or the grid has too many cells;
  /// the message says which resolution would do.
  OccupancyGrid(const Eigen::Vector2d& low, const Eigen::Vector2d& high,
                const OccupancyOptions& options);

  /// Casts the rays of a scan whose robot stood at `pose` (map frame). A cell
  /// is hit or seen through at most once per scan, and hit rather than seen
  /// through. Readings without return are passed over: a laser also sees none
  /// on glass and on black things. What lies outside of the grid is left out.
  void AddScan(const Scan& scan, const Pose2& pose);

  /// Takes in what later scans have added to another grid of the same corners
  /// and options: as if they had been added here, as long as both together are
  /// fewer than kMostScansCounted.
  void Merge(OccupancyGrid other);
  /// Counters of cells hold so many scans; from there on shares are kept.
  static constexpr std::size_t kMostScansCounted =
      std::numeric_limits<std::uint16_t>::max();

  /// Makes unknown what was seen of places that the robot cannot reach from
  /// where the scans were taken, as wide as OccupancyOptions::least_passage
  /// (KeepReachable): glimpses through windows, rays past walls. What lies
  /// within 1 m of what it can reach stays, as among furniture. Where rays are
  /// farther apart than a cell the space between them is no hindrance.
  void ForgetUnreachable();

  /// kOccupied, kFree or kUnknown; column from the left (x), row from the
  /// bottom (y).
  std::uint8_t Pixel(int column, int row) const;
  /// Pixels of a whole row from the left, one byte per cell.
  void Row(int row, std::string* pixels) const;

  /// Calls visit(column, row, pixel) for every cell that is not unknown, row by
  /// row: most cells of a large grid are.
  template <typename Visit>
  void VisitKnown(const Visit& visit) const {
    for (int row = 0; row < height_; ++row) {
      VisitKnownOfRow(row, [&](int column, std::uint8_t pixel) {
        visit(column, row, pixel);
      });
    }
  }

  /// Columns, rows, and the side of a cell, m.
  int width() const { return width_; }
  int height() const { return height_; }
  double resolution() const { return options_.resolution; }
  /// Lower left corner of the lower left cell, m, map frame.
  const Eigen::Vector2d& origin() const { return origin_; }

 private:
  static constexpr int kTileBits = 6;
  static constexpr int kTileSize = 1 << kTileBits;
  struct Cell {
    std::uint16_t hits = 0;
    std::uint16_t misses = 0;
    /// The scan that counted it last.
    std::uint16_t scan = 0;
  };
  struct Tile {
    std::array<Cell, kTileSize * kTileSize> cells;
    // Distance between neighboring rays where they leave it, at most, of the
    // scan that saw it from nearest, cells.
    double spacing = std::numeric_limits<double>::infinity();
  };

  template <typename Visit>
  void VisitKnownOfRow(int row, const Visit& visit) const {
    for (int begin = 0; begin < width_; begin += kTileSize) {
      const std::unique_ptr<Tile>& tile =
          tiles_[static_cast<std::size_t>(row >> kTileBits) * tile_columns_ +
                 (begin >> kTileBits)];
      if (tile == nullptr) continue;
      const Cell* const cells =
          tile->cells.data() + ((row & (kTileSize - 1)) << kTileBits);
      const int end = std::min(width_ - begin, kTileSize);
      for (int i = 0; i < end; ++i) {
        const std::uint8_t pixel = Shade(cells[i]);
        if (pixel != kUnknown) visit(begin + i, pixel);
      }
    }
  }
  Tile* TileAt(int column, int row);
  Cell* CellAt(int column, int row);
  std::uint8_t Shade(const Cell& cell) const {
    const int seen = cell.hits + cell.misses;
    if (seen == 0) return kUnknown;
    if (cell.hits >= options_.occupied_share * seen) {
      // Once is no evidence, neither that something is there nor that not.
      return cell.hits >= options_.min_hits ? kOccupied : kUnknown;
    }
    return kFree;
  }
  void Count(std::uint16_t Cell::*counter, Cell* cell);
  void Clear(int column0, int row0, int column1, int row1, bool with_last);

  OccupancyOptions options_;
  int width_ = 0;
  int height_ = 0;
  int tile_columns_ = 0;
  int tile_rows_ = 0;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  std::vector<std::unique_ptr<Tile>> tiles_;
  /// Number of the present scan, from 1, modulo 2^16: a cell that was seen last
  /// exactly this many scans ago is passed over once.
  std::uint16_t scan_ = 0;
  BeamDirections beams_;
  /// Between beams of the present scan, rad.
  double angle_step_ = 0.0;
  /// Cells that scans were taken in: column, row.
  std::vector<std::pair<int, int>> starts_;
  /// Ends of the present scan's rays.
  struct Ray {
    int column, row;
    bool is_hit;
  };
  std::vector<Ray> rays_;
};

/// What all scans have seen, or OccupancyOptions::max_scans of them, one pose
/// (map frame) per scan; poses that are not finite are passed over. Scans
/// without a pose may follow, as of a run that was interrupted. Throws as the
/// constructor does, also when there is nothing to be seen or a pose has no
/// scan.
OccupancyGrid GatherOccupancyGrid(const std::vector<Scan>& scans,
                                  const std::vector<Pose2>& poses,
                                  const OccupancyOptions& options);

/// GatherOccupancyGrid, and what cannot be reached is forgotten
/// (ForgetUnreachable). Throws Error also when there are more scans than poses:
/// then the two are not of one run.
OccupancyGrid MakeOccupancyGrid(const std::vector<Scan>& scans,
                                const std::vector<Pose2>& poses,
                                const OccupancyOptions& options);

/// Writes the grid as binary PGM, top row first, as map_server and Nav2 read
/// it.
void WriteOccupancyPgm(const OccupancyGrid& grid, std::ostream& output);

/// Writes what goes with the picture: image, mode, resolution (m per pixel),
/// origin (lower left corner, m, m, rad), negate, occupied_thresh, free_thresh.
/// The thresholds are those with which 0, 205 and 254 read as occupied, unknown
/// and free.
void WriteOccupancyYaml(const OccupancyGrid& grid, const std::string& image,
                        std::ostream& output);

/// Writes `stem`.pgm and then `stem`.yaml, each whole or not at all. Throws
/// Error when one cannot be written.
void WriteOccupancyMap(const OccupancyGrid& grid, const std::string& stem);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_OCCUPANCY_GRID_H_
