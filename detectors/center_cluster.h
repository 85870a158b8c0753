#ifndef PLUMBLINE_DETECTORS_CENTER_CLUSTER_H_
#define PLUMBLINE_DETECTORS_CENTER_CLUSTER_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>

#include <string>

namespace plumbline {

struct CenterClusterOptions {
  /// A circle whose centre is so near to a common centre has it, m.
  double gate = 0.4;
  /// Tolerance of a centre against the common one, m.
  double sigma = 0.05;
  /// Fewest circles that make a common centre.
  int minimum_support = 2;
};

/// Common centres of the "circle" features of a level (method.md, section 6):
/// clusters their centres and makes a virtual "point" one level up at the
/// centre of gravity of each cluster, with point_point_coincidence constraints
/// (expected (0, 0)) from the circles.
///
/// A circle that no live constraint ties to a common centre yet joins the
/// nearest one within the gate, one that is there already or a new one. Of
/// concentric circles of the same radius one is probably the other seen twice;
/// that is left to whoever makes circles.
class CenterCluster : public StructureDetector {
 public:
  explicit CenterCluster(const CenterClusterOptions& options);

  const std::string& name() const override;
  int minimum_support() const override { return options_.minimum_support; }
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  CenterClusterOptions options_;
};

/// "center_cluster" with its parameters (m).
DetectorType CenterClusterType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CENTER_CLUSTER_H_
