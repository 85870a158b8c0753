#ifndef PLUMBLINE_FRONTEND_POINT_MAP_BUILDER_H_
#define PLUMBLINE_FRONTEND_POINT_MAP_BUILDER_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/point_association.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Options of the growth of a map of points.
struct PointMapBuilderOptions {
  /// Links from the robot to points farther away are cut, m.
  double link_radius = 10.0;
  /// Constraints from the robot that association may go along.
  int association_depth = 3;
  PointAssociationOptions association;
  SegmentExtractionOptions extraction;
  /// Distance between neighbouring points on a surface, m.
  double spacing = 0.5;
  /// Surfaces farther from the laser than this make no points, m: there few
  /// beams meet them, at grazing angles, and errors of heading move them most.
  double max_range = 8.0;
  /// Distance of points from the ends of a surface that is long enough, m.
  double end_margin = 0.1;
  /// Distances that a new point gets.
  int links_per_point = 5;
  /// Directions to the points that it is bound to differ by this, rad, as long
  /// as there are such: distances along one line do not hold a point across
  /// it.
  double link_angle = DegToRad(30.0);
  /// Standard deviation of a point's place along its surface in the scan that
  /// makes it, m. The place is chosen there, so it is small.
  double along_sigma = 0.005;
  /// Distances to earlier points share the robot's error: each counts by this
  /// much.
  double shared_error_weight = 0.4;
  /// A second look at two points measures their distance anew; such looks share
  /// errors, so each counts by this much.
  double second_look_weight = 0.2;
  /// A distance does not get more certain than this by second looks, m.
  double distance_floor = 0.004;
  /// Points nearer than this are not bound by a distance, m: it would say
  /// little and not be smooth.
  double min_distance = 0.1;
};

/// Grows a graph of points from scans (core/method.md, section 7, with points
/// as level 0): a scan is cut into straight surfaces, points of the map near
/// the robot are looked for on them, the robot alone is corrected, and where a
/// surface has no points yet it gets some. The map has distances between points
/// and nothing else, a few per point; what marginalized poses knew is in them.
class PointMapBuilder final : public GraphBuilder {
 public:
  /// The graph and registry must outlive the builder; the graph may have
  /// features already. Throws Error for a spacing or number of links that is
  /// not positive.
  PointMapBuilder(Graph* graph, const Registry& registry,
                  const PointMapBuilderOptions& options);

  std::string feature_type() const override { return "point"; }

  void AddScan(const KeyScan& scan) override;

  /// Takes a key scan by its surfaces; the rest as in KeyScan.
  void AddKeyScan(int scan, const UncertainPose2& motion,
                  const std::vector<SegmentObservation>& surfaces,
                  const Eigen::Vector2d& laser, const Pose2& start);

  void WriteRobot() override;

  void WriteState(StateWriter* state) const override;
  void ReadState(StateReader* state) override;

 private:
  // A point that this scan makes.
  struct NewPoint {
    Eigen::Vector2d position;  // robot's frame
    Eigen::Matrix2d covariance;
    double direction;
    int surface;
  };

  std::vector<PointCandidate> Candidates() const;
  void SecondLook(const std::vector<PointMatch>& matches);
  std::vector<NewPoint> FreePlaces(
      const std::vector<SegmentObservation>& surfaces,
      const std::vector<PointAssociation>& associations,
      const Eigen::Vector2d& laser) const;
  void Grow(const std::vector<NewPoint>& points, KeyScanRecord* record);
  // Indices, the smaller first.
  static std::pair<std::size_t, std::size_t> FarthestPair(
      const std::vector<NewPoint>& points);
  // Of the robot relative to a point that it has just made: the robot is where
  // it is, and the point's own error is the robot's, seen from the point.
  Eigen::Matrix3d CovarianceFrom(const NewPoint& point) const;

  PointMapBuilderOptions options_;
  // Direction of the surface that each point was last seen on, map frame, by
  // feature.
  std::map<FeatureId, double> directions_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_POINT_MAP_BUILDER_H_
