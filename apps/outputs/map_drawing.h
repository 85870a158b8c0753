#ifndef PLUMBLINE_OUTPUTS_MAP_DRAWING_H_
#define PLUMBLINE_OUTPUTS_MAP_DRAWING_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace plumbline {

/// A straight wall, m, map frame.
struct DrawnWall {
  double x1 = 0.0;
  double y1 = 0.0;
  double x2 = 0.0;
  double y2 = 0.0;
  /// Index into MapDrawing::cluster_directions, or -1 for none.
  int cluster = -1;
  FeatureId id = kNoId;
  /// What was merged into it, ascending (MergeWalls); empty stands for the id.
  std::vector<FeatureId> members;
};

/// A circle, m, map frame.
struct DrawnCircle {
  double x = 0.0;
  double y = 0.0;
  double radius = 0.0;
  FeatureId id = kNoId;
};

/// A rectangle of walls, m, rad, map frame: half its sides along its direction
/// and across.
struct DrawnRectangle {
  double x = 0.0;
  double y = 0.0;
  double direction = 0.0;
  double half_length = 0.0;
  double half_width = 0.0;
  FeatureId id = kNoId;
};

/// Uncertainty of a position, m, map frame.
struct DrawnEllipse {
  double x = 0.0;
  double y = 0.0;
  /// Half axes, and the direction of the longer one, rad.
  double major = 0.0;
  double minor = 0.0;
  double direction = 0.0;
  FeatureId id = kNoId;
};

/// Walls of different visits that were supposed to be one, where neither is in
/// the map any more (LoopClosure).
struct PlacedClosure {
  /// Middle of what they have in common, and their direction; map frame.
  Pose2 place = Pose2::Zero();
  bool holds = false;
  /// p-value of the hypothesis.
  double delta = 0.0;
};

/// Content of a picture of a map. Whatever has a number that is not finite, or
/// lies more than 10,000 km from the origin, is passed over.
struct MapDrawing {
  std::vector<DrawnWall> walls;
  std::vector<DrawnCircle> circles;
  /// Tinted areas under everything, the large ones first.
  std::vector<DrawnRectangle> rectangles;
  /// Where walls of different visits were found to be one: x, y (m, map frame),
  /// direction of the wall (rad). A thin mark across the wall.
  std::vector<Pose2> closures;
  /// Drawn thin, over everything; below, what they show, for the legend.
  std::vector<DrawnEllipse> ellipses;
  std::string ellipses_title;
  /// Drawn thin and light under the walls.
  std::vector<Pose2> path;
  /// Scan points or landmarks, m, map frame: faint, under everything.
  std::vector<Eigen::Vector2d> points;
  /// Common centres of circles, m, map frame: crosses.
  std::vector<Eigen::Vector2d> centers;
  /// Direction of each orientation cluster, rad, modulo pi: for the legend.
  std::vector<double> cluster_directions;
  /// The orientation feature of each cluster; empty when not made from a graph.
  std::vector<FeatureId> cluster_features;
  /// One line above the map; may be empty.
  std::string title;
};

/// Draws the walls (segments and lines with an extent), circles, rectangles and
/// points of a graph; virtual points are common centres. A wall's cluster is
/// the orientation feature to which live structure ties it or the rectangle
/// that it is a side of; clusters are numbered by the length of wall that they
/// hold, longest first. An empty `path` is replaced by the graph's poses in the
/// order of ids.
MapDrawing DrawingFromGraph(const Graph& graph, const std::vector<Pose2>& path);

/// Ends of a wall feature (segment or line) in the map frame, m: x1, y1, x2,
/// y2. False when the feature is not a wall or has no extent.
bool WallEnds(const Feature& feature, DrawnWall* wall);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_MAP_DRAWING_H_
