#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/outputs/occupancy_grid.h>
#include <plumbline/outputs/reachable_space.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Free space that cannot be reached is a pocket up to this far from what can,
// m.
constexpr double kPocket = 1.0;
// What was hit is kept this far behind free space that can be reached, m: walls
// are as thick as poses are uncertain.
constexpr double kBehindFree = 0.3;
// Gaps between free cells that hinder nobody, m; and those between rays that
// are so many cells apart across, along rows and columns.
constexpr double kLeastGap = 0.2;
constexpr double kSlanted = 1.5;
constexpr double kMostSpacing = 1e6;
// Cells of the grids that are filled side by side, all together. Memory is
// taken for those only that are seen.
constexpr double kMostCellsAtOnce = 1.5e8;

std::string Number(double value) {
  std::string text;
  AppendNumber(value, &text);
  return text;
}

// With two digits, rounded up: what is told to a person who has to give it.
std::string RoundedUp(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 1.0);
  std::string text;
  AppendFixed(std::ceil(value / unit) * unit,
              std::max(0, static_cast<int>(-std::floor(std::log10(unit)))),
              &text);
  return text;
}

}  // namespace

OccupancyGrid::OccupancyGrid(const Vector2d& low, const Vector2d& high,
                             const OccupancyOptions& options)
    : options_(options) {
  const double resolution = options_.resolution;
  if (!(resolution > 0.0) || !std::isfinite(resolution) ||
      options_.border < 0 || !(options_.usable_range > 0.0)) {
    throw PLUMBLINE_ERROR("occupancy grid with a resolution of " +
                              Number(resolution) + " m and a usable range of " +
                              Number(options_.usable_range) + " m",
                          "numbers over 0");
  }
  const Vector2d size = high - low;
  if (!(size[0] >= 0.0) || !(size[1] >= 0.0) || !size.allFinite()) {
    throw PLUMBLINE_ERROR("an occupancy grid of nothing",
                          "scans with returns at finite poses");
  }
  const Vector2d cells = (size / resolution).array() + 2.0 +
                         2.0 * static_cast<double>(options_.border);
  if (cells[0] * cells[1] > static_cast<double>(options_.max_cells)) {
    // Rims and rounding take a little more.
    const double needed =
        1.02 *
        std::sqrt(size[0] * size[1] / static_cast<double>(options_.max_cells));
    const double longest = size.maxCoeff() * 1.02 /
                           static_cast<double>(options_.max_cells) *
                           (2.0 + 2.0 * options_.border);
    throw Error("occupancy grid", 0,
                RoundedUp(size[0]) + " m x " + RoundedUp(size[1]) +
                    " m in cells of " + Number(resolution) + " m are " +
                    RoundedUp(cells[0] * cells[1]) + " cells",
                "at most " + std::to_string(options_.max_cells) +
                    ", as with cells of " +
                    RoundedUp(std::max(needed, longest)) + " m");
  }
  // Whole multiples of the cell keep the grids of two runs aligned.
  const Vector2d first =
      (low / resolution).array().floor() - static_cast<double>(options_.border);
  const Vector2d last = (high / resolution).array().floor() +
                        static_cast<double>(options_.border);
  origin_ = first * resolution;
  width_ = static_cast<int>(last[0] - first[0]) + 1;
  height_ = static_cast<int>(last[1] - first[1]) + 1;
  tile_columns_ = (width_ + kTileSize - 1) >> kTileBits;
  tile_rows_ = (height_ + kTileSize - 1) >> kTileBits;
  tiles_.resize(static_cast<std::size_t>(tile_columns_) * tile_rows_);
}

OccupancyGrid::Tile* OccupancyGrid::TileAt(int column, int row) {
  std::unique_ptr<Tile>& tile =
      tiles_[static_cast<std::size_t>(row >> kTileBits) * tile_columns_ +
             (column >> kTileBits)];
  if (tile == nullptr) tile = std::make_unique<Tile>();
  return tile.get();
}

OccupancyGrid::Cell* OccupancyGrid::CellAt(int column, int row) {
  return &TileAt(column, row)
              ->cells[static_cast<std::size_t>(
                  ((row & (kTileSize - 1)) << kTileBits) +
                  (column & (kTileSize - 1)))];
}

// Once a scan; the share is kept when a counter is full.
inline void OccupancyGrid::Count(std::uint16_t Cell::*counter, Cell* cell) {
  if (cell->scan == scan_) return;
  cell->scan = scan_;
  if (++(cell->*counter) == std::numeric_limits<std::uint16_t>::max()) {
    cell->hits /= 2;
    cell->misses /= 2;
  }
}

// Bresenham's line from one cell to another: all octants by one error term.
// What is known of a tile is looked up where the line enters it.
void OccupancyGrid::Clear(int column0, int row0, int column1, int row1,
                          bool with_last) {
  const int dx = std::abs(column1 - column0);
  const int dy = -std::abs(row1 - row0);
  const int step_x = column0 < column1 ? 1 : -1;
  const int step_y = row0 < row1 ? 1 : -1;
  int error = dx + dy;
  int x = column0;
  int y = row0;
  // Cells to go; the last one only if it is to be cleared.
  int left = std::max(dx, -dy) + (with_last ? 1 : 0);
  while (left > 0) {
    const int tile_x = x >> kTileBits;
    const int tile_y = y >> kTileBits;
    const bool is_inside = tile_x >= 0 && tile_y >= 0 &&
                           tile_x < tile_columns_ && tile_y < tile_rows_;
    // Places within the tile.
    int own_x = x & (kTileSize - 1);
    int own_y = y & (kTileSize - 1);
    Cell* cells = nullptr;
    if (is_inside) {
      Tile* const tile = TileAt(x, y);
      const std::int64_t wide = x - column0;
      const std::int64_t high = y - row0;
      // Where they leave it, at the latest.
      tile->spacing = std::min(
          tile->spacing,
          angle_step_ *
              (std::sqrt(static_cast<double>(wide * wide + high * high)) +
               1.5 * kTileSize));
      cells = tile->cells.data();
    }
    for (;;) {
      if (is_inside) {
        Count(&Cell::misses, &cells[(own_y << kTileBits) + own_x]);
      }
      if (--left == 0) return;
      const int doubled = 2 * error;
      if (doubled >= dy) {
        error += dy;
        own_x += step_x;
      }
      if (doubled <= dx) {
        error += dx;
        own_y += step_y;
      }
      if (((own_x | own_y) & ~(kTileSize - 1)) != 0) break;
    }
    x = tile_x * kTileSize + own_x;
    y = tile_y * kTileSize + own_y;
  }
}

void OccupancyGrid::AddScan(const Scan& scan, const Pose2& pose) {
  const Pose2 laser = Compose(pose, scan.laser_offset);
  if (!laser.allFinite()) return;
  // 0 is the mark of cells that no scan counted.
  if (++scan_ == 0) ++scan_;

  const double per_metre = 1.0 / options_.resolution;
  const Vector2d start = (laser.head<2>() - origin_) * per_metre;
  const double c = std::cos(laser[2]) * per_metre;
  const double s = std::sin(laser[2]) * per_metre;
  constexpr double kFarthestCell = 1e9;
  if (!(start.cwiseAbs().maxCoeff() < kFarthestCell)) return;
  const int column = static_cast<int>(std::floor(start[0]));
  const int row = static_cast<int>(std::floor(start[1]));
  angle_step_ = std::abs(scan.angle_step);
  if (column >= 0 && row >= 0 && column < width_ && row < height_ &&
      (starts_.empty() || starts_.back() != std::make_pair(column, row))) {
    starts_.emplace_back(column, row);
  }
  rays_.clear();
  const std::vector<Vector2d>& beams = beams_.Of(scan);
  for (std::size_t i = 0; i < beams.size(); ++i) {
    double range = scan.ranges[i];
    if (!(range >= options_.minimum_range)) continue;
    const bool is_hit = range <= options_.usable_range;
    range = std::min(range, options_.usable_range);
    const Vector2d& beam = beams[i];
    const double x = start[0] + range * (c * beam[0] - s * beam[1]);
    const double y = start[1] + range * (s * beam[0] + c * beam[1]);
    if (!(std::abs(x) < kFarthestCell && std::abs(y) < kFarthestCell)) continue;
    const Ray ray = {static_cast<int>(std::floor(x)),
                     static_cast<int>(std::floor(y)), is_hit};
    // Near walls several beams end in one cell, and count it once.
    if (rays_.empty() || ray.column != rays_.back().column ||
        ray.row != rays_.back().row || ray.is_hit != rays_.back().is_hit) {
      rays_.push_back(ray);
    }
  }
  for (const Ray& ray : rays_) {
    if (!ray.is_hit || ray.column < 0 || ray.row < 0 || ray.column >= width_ ||
        ray.row >= height_) {
      continue;
    }
    Count(&Cell::hits, CellAt(ray.column, ray.row));
  }
  for (const Ray& ray : rays_) {
    Clear(column, row, ray.column, ray.row, !ray.is_hit);
  }
}

void OccupancyGrid::Merge(OccupancyGrid other) {
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    std::unique_ptr<Tile>& own = tiles_[i];
    const std::unique_ptr<Tile>& added = other.tiles_[i];
    if (added == nullptr) continue;
    if (own == nullptr) {
      own = std::move(other.tiles_[i]);
      continue;
    }
    for (std::size_t k = 0; k < own->cells.size(); ++k) {
      Cell& cell = own->cells[k];
      cell.hits = static_cast<std::uint16_t>(cell.hits + added->cells[k].hits);
      cell.misses =
          static_cast<std::uint16_t>(cell.misses + added->cells[k].misses);
    }
    own->spacing = std::min(own->spacing, added->spacing);
  }
  for (const std::pair<int, int>& start : other.starts_) {
    if (starts_.empty() || starts_.back() != start) starts_.push_back(start);
  }
}

std::uint8_t OccupancyGrid::Pixel(int column, int row) const {
  const std::unique_ptr<Tile>& tile =
      tiles_[static_cast<std::size_t>(row >> kTileBits) * tile_columns_ +
             (column >> kTileBits)];
  if (tile == nullptr) return kUnknown;
  return Shade(tile->cells[((row & (kTileSize - 1)) << kTileBits) +
                           (column & (kTileSize - 1))]);
}

void OccupancyGrid::Row(int row, std::string* pixels) const {
  pixels->assign(static_cast<std::size_t>(width_), static_cast<char>(kUnknown));
  VisitKnownOfRow(row, [&](int column, std::uint8_t pixel) {
    (*pixels)[static_cast<std::size_t>(column)] = static_cast<char>(pixel);
  });
}

void OccupancyGrid::ForgetUnreachable() {
  if (!(options_.least_passage > 0.0)) return;
  SeenCells seen;
  seen.width = width_;
  seen.height = height_;
  seen.cells.resize(static_cast<std::size_t>(width_) * height_,
                    SeenCells::kUnknown);
  VisitKnown([&](int column, int row, std::uint8_t pixel) {
    seen.cells[static_cast<std::size_t>(row) * width_ + column] =
        pixel == kFree ? SeenCells::kFree : SeenCells::kOccupied;
  });
  const auto cells = [this](double metres) {
    return static_cast<int>(metres / options_.resolution + 1e-9);
  };
  ReachOptions options;
  // A disc of whole cells around its middle one.
  options.body = std::max(0, (cells(options_.least_passage) - 1) / 2);
  options.pocket = cells(kPocket);
  options.behind = std::max(2, cells(kBehindFree));
  const int least_gap = cells(kLeastGap);
  options.gap = [&](int column, int row) {
    const double spacing = TileAt(column, row)->spacing;
    return spacing < kMostSpacing
               ? std::max(least_gap, static_cast<int>(kSlanted * spacing))
               : least_gap;
  };
  KeepReachable(starts_, options, &seen);
  VisitKnown([&](int column, int row, std::uint8_t) {
    if (seen.cells[static_cast<std::size_t>(row) * width_ + column] ==
        SeenCells::kUnknown) {
      *CellAt(column, row) = Cell();
    }
  });
}

namespace {

// What a grid has to hold.
struct Corners {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = -low;

  void Add(const Vector2d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  void Add(const Corners& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
};

// Of the scans [begin, end).
Corners CornersOf(const std::vector<Scan>& scans,
                  const std::vector<Pose2>& poses, std::size_t begin,
                  std::size_t end, const OccupancyOptions& options) {
  Corners corners;
  BeamDirections directions;
  for (std::size_t i = begin; i < end; ++i) {
    const Scan& scan = scans[i];
    const std::vector<Vector2d>& beams = directions.Of(scan);
    const Pose2 laser = Compose(poses[i], scan.laser_offset);
    if (!laser.allFinite()) continue;
    const double c = std::cos(laser[2]);
    const double s = std::sin(laser[2]);
    for (std::size_t j = 0; j < beams.size(); ++j) {
      if (!(scan.ranges[j] >= options.minimum_range)) continue;
      const double range =
          std::min<double>(scan.ranges[j], options.usable_range);
      corners.Add(
          Vector2d(laser[0] + range * (c * beams[j][0] - s * beams[j][1]),
                   laser[1] + range * (s * beams[j][0] + c * beams[j][1])));
    }
    corners.Add(Vector2d(laser.head<2>()));
  }
  return corners;
}

}  // namespace

OccupancyGrid GatherOccupancyGrid(const std::vector<Scan>& scans,
                                  const std::vector<Pose2>& poses,
                                  const OccupancyOptions& options) {
  if (scans.size() < poses.size()) {
    throw PLUMBLINE_ERROR(std::to_string(poses.size()) + " poses for " +
                              std::to_string(scans.size()) + " scans",
                          "a scan for each pose");
  }
  const auto threads =
      static_cast<std::size_t>(std::max(1, options.num_threads));
  const auto begin_of = [](std::size_t count, std::size_t part,
                           std::size_t parts) { return count * part / parts; };
  std::vector<Corners> corners(threads);
  ParallelFor(threads, options.num_threads, [&](std::size_t part) {
    corners[part] =
        CornersOf(scans, poses, begin_of(poses.size(), part, threads),
                  begin_of(poses.size(), part + 1, threads), options);
  });
  for (const Corners& other : corners) corners[0].Add(other);
  OccupancyGrid grid(corners[0].low, corners[0].high, options);
  const std::size_t step =
      options.max_scans == 0
          ? 1
          : (poses.size() + options.max_scans - 1) / options.max_scans;
  const std::size_t count = (poses.size() + step - 1) / step;
  const double cells = 1.0 * grid.width() * grid.height();
  const std::size_t parts =
      std::min(threads, static_cast<std::size_t>(kMostCellsAtOnce / cells) + 1);
  if (parts == 1 || count >= OccupancyGrid::kMostScansCounted) {
    for (std::size_t i = 0; i < poses.size(); i += step) {
      grid.AddScan(scans[i], poses[i]);
    }
  } else {
    std::vector<OccupancyGrid> grids;
    for (std::size_t part = 0; part < parts; ++part) {
      grids.emplace_back(corners[0].low, corners[0].high, options);
    }
    ParallelFor(parts, options.num_threads, [&](std::size_t part) {
      for (std::size_t i = begin_of(count, part, parts);
           i < begin_of(count, part + 1, parts); ++i) {
        grids[part].AddScan(scans[i * step], poses[i * step]);
      }
    });
    for (OccupancyGrid& other : grids) grid.Merge(std::move(other));
  }
  return grid;
}

OccupancyGrid MakeOccupancyGrid(const std::vector<Scan>& scans,
                                const std::vector<Pose2>& poses,
                                const OccupancyOptions& options) {
  if (scans.size() != poses.size()) {
    throw PLUMBLINE_ERROR(std::to_string(poses.size()) + " poses for " +
                              std::to_string(scans.size()) + " scans",
                          "one pose per scan");
  }
  OccupancyGrid grid = GatherOccupancyGrid(scans, poses, options);
  grid.ForgetUnreachable();
  return grid;
}

void WriteOccupancyPgm(const OccupancyGrid& grid, std::ostream& output) {
  output << "P5\n# plumbline: " << Number(grid.resolution()) << " m a pixel\n"
         << grid.width() << ' ' << grid.height() << "\n255\n";
  std::string line;
  for (int row = grid.height() - 1; row >= 0; --row) {
    grid.Row(row, &line);
    output.write(line.data(), static_cast<std::streamsize>(line.size()));
  }
}

void WriteOccupancyYaml(const OccupancyGrid& grid, const std::string& image,
                        std::ostream& output) {
  // 205 stands for (255 - 205) / 255 = 0.19608, just not free.
  output << "image: " << image
         << "\nmode: trinary\nresolution: " << Number(grid.resolution())
         << "\norigin: [" << Number(grid.origin()[0]) << ", "
         << Number(grid.origin()[1])
         << ", 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
}

void WriteOccupancyMap(const OccupancyGrid& grid, const std::string& stem) {
  const std::string image = stem + ".pgm";
  WriteFileAtomically(image, [&grid](std::ostream& output) {
    WriteOccupancyPgm(grid, output);
  });
  WriteFileAtomically(stem + ".yaml", [&](std::ostream& output) {
    WriteOccupancyYaml(grid, std::filesystem::path(image).filename().string(),
                       output);
  });
}

}  // namespace plumbline
