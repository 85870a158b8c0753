#ifndef PLUMBLINE_DETECTORS_CIRCLE_RANSAC_H_
#define PLUMBLINE_DETECTORS_CIRCLE_RANSAC_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/curve_search.h>

#include <string>

namespace plumbline {

/// Circles through connected "point" features of a level (core/method.md,
/// section 6): makes virtual "circle" features one level up with
/// point_circle_distance constraints (expected 0) of the standard deviation
/// sigma. See SearchCurves for how they are found and DetectCurves for how they
/// are extended.
class CircleRansac : public StructureDetector {
 public:
  /// Takes the options of the search for curves.
  explicit CircleRansac(const CurveSearchOptions& options);

  const std::string& name() const override;
  /// As many points as it takes to find one.
  int minimum_support() const override { return options_.min_circle_points; }
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  CurveSearchOptions options_;
};

/// "circle_ransac" with its parameters (m, degrees).
DetectorType CircleRansacType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CIRCLE_RANSAC_H_
