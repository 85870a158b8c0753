#ifndef PLUMBLINE_FRONTEND_MAP_BUILDER_H_
#define PLUMBLINE_FRONTEND_MAP_BUILDER_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/association.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace plumbline {

/// Options of the growth of a map of segments.
struct MapBuilderOptions {
  /// Links from the robot to features farther away are cut, m.
  double link_radius = 10.0;
  /// Constraints from the robot that association may go along: 1 looks at the
  /// linked features only.
  int association_depth = 3;
  AssociationOptions association;
  SegmentExtractionOptions extraction;
  /// Numbers of features that a new one is bound to: of those that the robot is
  /// linked to, and of the new ones of its own scan.
  int links_per_feature = 5;
  int links_within_scan = 3;
  /// Two pieces of one scan are one wall only when they are in line to within
  /// this, m.
  double same_scan_offset = 0.05;
  /// Standard deviation of a segment's position along itself in the scan that
  /// makes it a feature, m. The position is chosen there, so it is small.
  double along_sigma = 0.01;
  /// A second look at two features measures their relation anew; such looks
  /// share errors, so each counts by this much.
  double second_look_weight = 0.2;
  /// A relation does not get more certain than this by second looks: across
  /// (m) and direction (rad).
  double relation_floor_position = 0.005;
  double relation_floor_angle = DegToRad(0.3);
};

/// Grows a graph of segments from scans (core/method.md, section 7, steps 1 to
/// 4): predicts, associates by distance in the graph, corrects the robot alone,
/// adds what is new. What marginalized poses knew is in the relations between
/// segments.
class MapBuilder final : public GraphBuilder {
 public:
  /// The graph and registry must outlive the builder; the graph may have
  /// features already.
  MapBuilder(Graph* graph, const Registry& registry,
             const MapBuilderOptions& options);

  std::string feature_type() const override { return "segment"; }

  void AddScan(const KeyScan& scan) override;

  /// Takes a key scan as it was processed: `motion` since the last one (ignored
  /// for the first, which starts at `start`), and what it saw.
  void AddKeyScan(int scan, const UncertainPose2& motion,
                  const std::vector<SegmentObservation>& observations,
                  const Pose2& start);

  void WriteRobot() override;

 private:
  void SecondLook(const std::vector<FeatureMatch>& matches);
  void Grow(const std::vector<SegmentObservation>& observations,
            const std::vector<bool>& used, KeyScanRecord* record);

  MapBuilderOptions options_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MAP_BUILDER_H_
