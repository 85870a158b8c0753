#include <plumbline/detectors/curve_detection.h>
#include <plumbline/detectors/line_ransac.h>
#include <plumbline/detectors/parameters.h>

#include <memory>

namespace plumbline {
namespace {

constexpr char kName[] = "line_ransac";

}  // namespace

LineRansac::LineRansac(const CurveSearchOptions& options) : options_(options) {}

const std::string& LineRansac::name() const {
  static const std::string name = kName;
  return name;
}

Transaction LineRansac::Detect(const Graph& graph, const Registry& registry,
                               const DetectionScope& scope) const {
  return DetectCurves(graph, registry, scope, CurveKind::kLine, kName,
                      options_);
}

DetectorType LineRansacType() {
  DetectorType type;
  type.name = kName;
  type.description =
      "Lines through connected points: RANSAC, kept when few would "
      "be expected by chance";
  type.reads = {"point"};
  type.makes = {"line"};
  SetParameters<CurveSearchOptions>(
      BindCurveSearch,
      [](const CurveSearchOptions& options) {
        return std::make_unique<LineRansac>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
