#ifndef PLUMBLINE_PLAN_DRAWN_LINES_H_
#define PLUMBLINE_PLAN_DRAWN_LINES_H_

#include <plumbline/plan/space_grid.h>
#include <plumbline/plan/wall_lines.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace plumbline {

/// What is found at a place on a line of walls.
enum class Mark : std::uint8_t { kUnknown, kOpen, kWall, kDoor };

/// What is known along a line, sampled every few centimetres.
struct WallProfile {
  /// Between samples, m.
  static constexpr double kStep = 0.05;

  /// Where the first sample begins, along the line, m.
  double begin = 0.0;
  std::vector<Mark> marks;
  /// How strongly each sample separates its two sides: 1 for a wall, -1 for
  /// nothing at all.
  std::vector<double> holds;
  /// Samples that lie in a row of occupied cells along the line.
  std::vector<bool> in_row;
  /// Samples that were seen to be open; of a door the leaf may hide others.
  std::vector<bool> is_seen_open;

  /// Number of samples.
  int size() const { return static_cast<int>(marks.size()); }
  /// The mark of a sample, 0 to size() - 1.
  Mark At(int i) const { return marks[static_cast<std::size_t>(i)]; }
  /// The sample at `t`, m; may lie outside.
  int IndexOf(double t) const {
    return static_cast<int>(std::floor((t - begin) / kStep));
  }
  /// Middle of a sample, along the line, m.
  double MiddleOf(int i) const { return begin + (i + 0.5) * kStep; }
};

/// The drawn part of a line of walls, m along it.
struct DrawnLine {
  WallLine line;
  double from = 0.0;
  double to = 0.0;
  WallProfile profile;
};

/// Options for what is a door.
struct DoorOptions {
  /// Openings up to this width in a wall are doors, m, ...
  double narrow = 1.2;
  /// ... wider than this they are not, and in between to a degree.
  double wide = 3.0;
  /// An opening in which nothing stands, in a wall that goes on beside it (4 m
  /// of it, and 60 % of what was seen, within 5 m), counts 0.6 at least up to
  /// `wide`, and less from there on up to this.
  double widest_front = 4.0;
};

/// Occupied cells this far beside the faces of a wall still belong to it, m.
constexpr double kBesideWall = 0.1;

/// Draws lines on to others that they meet within `reach`, m, no more than
/// `beyond`, m, from the end of the other, and closes spaces whose ends were
/// not seen with further lines, across the ends of walls, which have
/// WallLine::is_wall false.
std::vector<DrawnLine> DrawLines(const std::vector<WallLine>& lines,
                                 double reach, double beyond);

/// Lines with little wall that may divide rooms.
struct Partitions {
  /// In a direction of the building, from wall to wall, and wall for the most
  /// part or without a place that was seen through: a partition of which little
  /// was seen, at grazing angles or behind furniture, while furniture itself
  /// leaves gaps to the walls beside it.
  std::vector<WallLine> sure;
  /// Those of which no more than half was seen through: a row of cupboards, or
  /// a wall of which cupboards hide most. What else speaks for a wall decides.
  std::vector<WallLine> likely;
};

/// The partitions among `lines`. `drawn` has the profiles of the lines that are
/// known to be walls.
Partitions FindPartitions(const std::vector<WallLine>& lines,
                          const std::vector<DrawnLine>& drawn,
                          const SpaceGrid& space, double reach);

/// The lines of each wall, as indices into `drawn`: one, or the edges of a
/// curved wall in their order.
std::vector<std::vector<std::size_t>> LinesOfWalls(
    const std::vector<DrawnLine>& drawn);

/// Fills the profiles of all lines.
///
/// A sample is wall where a row of occupied cells runs along the line (legs of
/// chairs and the edges of other walls make no row). An opening with wall on
/// both sides is a door, the more so the narrower it is and the more wall there
/// is in line with it.
void MeasureLines(const SpaceGrid& space, const DoorOptions& options,
                  std::vector<DrawnLine>* drawn);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_DRAWN_LINES_H_
