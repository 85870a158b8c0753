#ifndef PLUMBLINE_DETECTORS_LINE_RANSAC_H_
#define PLUMBLINE_DETECTORS_LINE_RANSAC_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/curve_search.h>

#include <string>

namespace plumbline {

/// Lines through connected "point" features of a level (core/method.md, section
/// 6): makes virtual "line" features one level up, anchored at the middle of
/// their points, with point_line_distance constraints (expected 0) of the
/// standard deviation sigma. See SearchCurves for how they are found and
/// DetectCurves for how they are extended. Virtual points (circle centres) are
/// connected as PointGraph says.
class LineRansac : public StructureDetector {
 public:
  /// Takes the options of the search for curves.
  explicit LineRansac(const CurveSearchOptions& options);

  const std::string& name() const override;
  /// As many points as it takes to find one.
  int minimum_support() const override { return options_.min_line_points; }
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;

 private:
  CurveSearchOptions options_;
};

/// "line_ransac" with its parameters (m, degrees).
DetectorType LineRansacType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_LINE_RANSAC_H_
