#ifndef PLUMBLINE_OUTPUTS_REPORT_GRID_H_
#define PLUMBLINE_OUTPUTS_REPORT_GRID_H_

#include <plumbline/outputs/occupancy_grid.h>

#include <Eigen/Core>
#include <string>

namespace plumbline {

/// An occupancy grid as a picture for a page, unknown cells clear.
struct ReportGrid {
  /// Lower left corner, map frame, m.
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  /// Side of a pixel, m.
  double resolution = 0.0;
  /// In pixels.
  int width = 0;
  int height = 0;
  /// PNG in base64 (RFC 4648).
  std::string png;
};

/// Most pixels of such a picture, and of that of a run that was interrupted:
/// somebody waits for it.
inline constexpr double kMostReportPixels = 4e6;
inline constexpr double kMostReportPixelsOfAPart = 1e6;

/// The picture of a grid; coarser where it has more cells than `most_pixels`: a
/// pixel is then occupied where one of its cells is. Throws Error when it is
/// empty, or too large to be one.
ReportGrid MakeReportGrid(const OccupancyGrid& grid,
                          double most_pixels = kMostReportPixels);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_REPORT_GRID_H_
