#ifndef PLUMBLINE_FRONTEND_PEAK_SEARCH_H_
#define PLUMBLINE_FRONTEND_PEAK_SEARCH_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan_matcher.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

namespace plumbline {

/// Cells of no score that a grid for FindPeaks has before its first column and
/// row: as many as a node of the coarsest level has each way.
constexpr int kPeakPad = 4;

/// Scores of the cells of a grid, by rows, the pad included, and for each
/// coarser level the best of 2^level cells each way from a cell on.
std::vector<std::vector<std::int16_t>> ScoreLevels(
    std::vector<std::int16_t> scores, int columns, int rows);

/// What FindPeaks looks at.
struct PeakGrid {
  /// Of ScoreLevels(); the score of a cell is 255 at most.
  const std::vector<std::vector<std::int16_t>>& levels;
  /// Size with the pad, cells.
  int columns;
  int rows;
  /// Of the first cell that is not of the pad, m.
  Eigen::Vector2d origin;
  /// Side of a cell, m.
  double resolution;
  const std::vector<Viewpoint>& viewpoints;
};

/// What a peak is.
struct PeakOptions {
  /// Least score, as a share of what all points on surfaces would have.
  double minimum_score = 0.0;
  /// Least share of the best one's score.
  double share = 0.0;
  /// How many are wanted.
  int max_peaks = 1;
  /// Farthest from a viewpoint, m.
  double reach = 0.0;
  /// If not null: nodes of the search below the coarsest ones that may be
  /// looked at, less those that were. A search ends with what it has when there
  /// are none left.
  std::int64_t* nodes = nullptr;
};

/// The poses in a window around `center` at which points (m) score best on a
/// grid, best first, none beside another: branch and bound over translations
/// (cells) and rotations, with the window's half widths in m and rad. Exact,
/// but empty where there is too much to search, and once `stop` (asked now and
/// then; may be null) has returned true.
std::vector<ScoredPose> FindPeaks(
    const PeakGrid& grid, const std::vector<Eigen::Vector2d>& points,
    const Pose2& center, double translation_window, double rotation_window,
    const PeakOptions& options, const std::function<bool()>& stop);

/// A score that some pose of the window has, close to the best one's mostly:
/// that of the pose that the best nodes of a rotation lead to. At a fraction of
/// the cost of FindPeaks; 0 once `stop` has returned true.
double ClearestScore(const PeakGrid& grid,
                     const std::vector<Eigen::Vector2d>& points,
                     const Pose2& center, double translation_window,
                     double rotation_window, double reach,
                     const std::function<bool()>& stop);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_PEAK_SEARCH_H_
