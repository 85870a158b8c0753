#ifndef PLUMBLINE_CORE_SIGHT_LINES_H_
#define PLUMBLINE_CORE_SIGHT_LINES_H_

#include <plumbline/core/feature.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/wall.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

namespace plumbline {

/// What a sensor saw at one time from one place: the straight lines from the
/// sensor to what it hit are free of walls.
struct Look {
  /// The feature in whose frame the positions are given, and with which the
  /// sight lines move: the pose of the sensor, or a wall that it saw at that
  /// time where poses are marginalized out. kNoId: the map frame.
  FeatureId frame = kNoId;
  /// Where the sensor stood, m.
  Eigen::Vector2d sensor = Eigen::Vector2d::Zero();
  /// Where the sight lines end, m.
  std::vector<Eigen::Vector2d> ends;
};

/// Looks in any order; whoever has none works without.
using Looks = std::vector<Look>;

/// A detector that reads sight lines, which are not in the graph.
class LooksReader {
 public:
  virtual ~LooksReader() = default;
  /// From now on it reads these; null for none.
  virtual void SetLooks(std::shared_ptr<const Looks> looks) = 0;
};

/// Gives looks to every detector of the hierarchy that is a LooksReader.
/// Returns how many there are.
int GiveLooks(const std::shared_ptr<const Looks>& looks,
              const Hierarchy& hierarchy);

/// Where a sight line goes through the line of a wall.
struct SightCrossing {
  /// Place on the wall, m along it.
  double along = 0.0;
  /// How far the sight line's end lies behind the wall, m.
  double beyond = 0.0;
  /// Side of the sensor: 1 left of the wall's direction, -1 right.
  double side = 1.0;
  /// Sine of the angle between sight line and wall, in (0, 1].
  double slant = 1.0;
};

/// The crossing of the sight line from `sensor` to `end` with the line of a
/// wall (one frame, m); none when both are on one side.
std::optional<SightCrossing> CrossingOf(const Wall& wall,
                                        const Eigen::Vector2d& sensor,
                                        const Eigen::Vector2d& end);

/// Looks where they stand in the present state of a graph.
class PlacedLooks {
 public:
  /// Looks on frames that are not in the graph, or have no frame in the plane,
  /// are left out. `looks` must outlive this.
  PlacedLooks(const Looks& looks, const Graph& graph);

  /// How many there are.
  std::size_t size() const { return placed_.size(); }
  /// One of them, by index.
  const Look& look(std::size_t i) const { return *placed_[i].look; }
  /// The frame of a look in the map.
  const Pose2& frame(std::size_t i) const { return placed_[i].frame; }
  /// Those whose sensor stands within `range`, m, of the visible part of a
  /// wall (map frame), in no order that means anything.
  std::vector<std::size_t> Near(const Wall& wall, double range) const;
  /// Where the sensor of a look stands in the map, m.
  const Eigen::Vector2d& sensor(std::size_t i) const {
    return placed_[i].sensor;
  }
  /// A direction of the map in the frame of a look.
  Eigen::Vector2d DirectionSeen(std::size_t i,
                                const Eigen::Vector2d& direction) const {
    const Eigen::Vector2d& axis = placed_[i].axis;
    return {axis.dot(direction),
            axis.x() * direction.y() - axis.y() * direction.x()};
  }
  /// A wall of the map in the frame of a look.
  Wall Seen(std::size_t i, const Wall& wall) const;

 private:
  struct Placed {
    const Look* look = nullptr;
    Pose2 frame = Pose2::Zero();
    // The frame's x axis in the map.
    Eigen::Vector2d axis = Eigen::Vector2d::UnitX();
    // The sensor in the map.
    Eigen::Vector2d sensor = Eigen::Vector2d::Zero();
  };
  // Position of a sensor in the map, which is cut into rows along x.
  struct Position {
    double row = 0.0;
    double x = 0.0;
    double y = 0.0;
    std::size_t index = 0;
  };
  // The row of a place, by its y.
  static double RowAt(double y);

  std::vector<Placed> placed_;
  // Ascending by row, and by x within each.
  std::vector<Position> positions_;
};

/// When a piece of a wall counts as seen through.
struct SeenThroughOptions {
  /// The wall is cut into pieces of this length, m.
  double piece = 0.1;
  /// Ends within this distance lie on the wall, and sight lines that end at
  /// least `passed` behind it went through, m.
  double thickness = 0.08;
  double passed = 0.3;
  /// Sine of the least angle between sight line and wall.
  double min_slant = 0.3;
  /// Sight lines that went through a piece, at least, and more than this many
  /// for each that ended on it.
  int min_lines = 3;
  double min_ratio = 3.0;
};

/// Counts of what looks say about the pieces of a wall.
class SeenPieces {
 public:
  /// Of the wall from `begin` to `end`, m along it.
  SeenPieces(double begin, double end, const SeenThroughOptions& options);

  /// Adds a look; wall and look in one frame.
  void Add(const Wall& wall, const Look& look);

  /// Stretches of at least `min_width`, m, that were seen through, in order; a
  /// piece without evidence within one does not end it.
  std::vector<Interval> Through(double min_width) const;

 private:
  std::optional<std::size_t> PieceAt(double along) const;

  SeenThroughOptions options_;
  double begin_;
  double end_;
  std::vector<int> passed_;
  std::vector<int> kept_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SIGHT_LINES_H_
