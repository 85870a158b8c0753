#ifndef MINE_EQUAL_RADIUS_DETECTOR_H_
#define MINE_EQUAL_RADIUS_DETECTOR_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>

#include <string>

namespace mine {

/// Which circles have one radius, and how tightly they are tied.
struct EqualRadiusOptions {
  /// Radii that differ by less are the same, m.
  double gate = 0.1;
  /// Tolerance of the relation, m.
  double sigma = 0.002;
};

/// Proposes equal_radius between circles of a level whose radii differ by less
/// than a gate: each circle with the one of the nearest radius that stood
/// before it in the graph, unless it has such a relation already.
class EqualRadiusDetector : public plumbline::StructureDetector {
 public:
  explicit EqualRadiusDetector(const EqualRadiusOptions& options)
      : options_(options) {}

  const std::string& name() const override;
  plumbline::Transaction Detect(
      const plumbline::Graph& graph, const plumbline::Registry& registry,
      const plumbline::DetectionScope& scope) const override;

 private:
  EqualRadiusOptions options_;
};

/// "equal_radius" with its parameters gate and sigma, m.
plumbline::DetectorType EqualRadiusDetectorType();

}  // namespace mine

#endif  // MINE_EQUAL_RADIUS_DETECTOR_H_
