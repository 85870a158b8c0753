#include <plumbline/detectors/circle_ransac.h>
#include <plumbline/detectors/curve_detection.h>
#include <plumbline/detectors/parameters.h>

#include <memory>

namespace plumbline {
namespace {

constexpr char kName[] = "circle_ransac";

}  // namespace

CircleRansac::CircleRansac(const CurveSearchOptions& options)
    : options_(options) {}

const std::string& CircleRansac::name() const {
  static const std::string name = kName;
  return name;
}

Transaction CircleRansac::Detect(const Graph& graph, const Registry& registry,
                                 const DetectionScope& scope) const {
  return DetectCurves(graph, registry, scope, CurveKind::kCircle, kName,
                      options_);
}

DetectorType CircleRansacType() {
  DetectorType type;
  type.name = kName;
  type.description =
      "Circles through connected points: RANSAC, kept when few would "
      "be expected by chance";
  type.reads = {"point"};
  type.makes = {"circle"};
  SetParameters<CurveSearchOptions>(
      BindCurveSearch,
      [](const CurveSearchOptions& options) {
        return std::make_unique<CircleRansac>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
