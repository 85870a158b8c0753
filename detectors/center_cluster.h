#ifndef PLUMBLINE_DETECTORS_CENTER_CLUSTER_H_
#define PLUMBLINE_DETECTORS_CENTER_CLUSTER_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>

#include <string>

namespace plumbline {

/// Options of common centres of circles.
struct CenterClusterOptions {
  /// Largest distance of a circle's centre from the common one, m.
  double gate = 0.4;
  /// Tolerance of a centre against the common one, m.
  double sigma = 0.05;
  /// Fewest circles that make a common centre. With 1 every circle has a centre
  /// of its own unless it shares one.
  int minimum_support = 2;
};

/// Common centres of the "circle" features of a level (core/method.md, section
/// 6): clusters their centres and makes a virtual "point" one level up at the
/// centre of gravity of each cluster, with point_point_coincidence constraints
/// (expected (0, 0)) from the circles.
///
/// A circle that no live constraint ties to a common centre yet joins the
/// nearest one within the gate, one that is there already or a new one.
/// Concentric circles of the same radius are probably one circle found twice;
/// telling that is left to whoever makes circles.
///
/// Centres of single circles say nothing on their own and are there to be seen
/// in a row by line_ransac on the next level (core/method.md, Table 1).
class CenterCluster : public StructureDetector {
 public:
  /// `name` is the one under which the detector is registered.
  CenterCluster(std::string name, const CenterClusterOptions& options);

  const std::string& name() const override { return name_; }
  int minimum_support() const override { return options_.minimum_support; }
  bool keeps_followers() const override {
    return options_.minimum_support == 1;
  }
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  std::string name_;
  CenterClusterOptions options_;
};

/// "center_cluster": centres that at least two circles share. Parameters: gate
/// and sigma (m), minimum_support.
DetectorType CenterClusterType();

/// "circle_center": the centre of every circle, one for those that share it.
/// Parameters: gate and sigma (m).
DetectorType CircleCenterType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CENTER_CLUSTER_H_
