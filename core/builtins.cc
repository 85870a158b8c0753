#include <plumbline/core/add_types.h>
#include <plumbline/core/builtins.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/factors/corridor.h>
#include <plumbline/factors/dcs_loss.h>
#include <plumbline/factors/delta_loss.h>
#include <plumbline/factors/geman_mcclure_loss.h>
#include <plumbline/factors/line_line.h>
#include <plumbline/factors/line_orientation.h>
#include <plumbline/factors/line_rectangle.h>
#include <plumbline/factors/orientation_orientation.h>
#include <plumbline/factors/point_circle_distance.h>
#include <plumbline/factors/point_line_distance.h>
#include <plumbline/factors/point_point_coincidence.h>
#include <plumbline/factors/point_point_distance.h>
#include <plumbline/factors/pose_end_points.h>
#include <plumbline/factors/pose_line.h>
#include <plumbline/factors/pose_point.h>
#include <plumbline/factors/pose_point_bearing.h>
#include <plumbline/factors/pose_pose.h>
#include <plumbline/factors/pose_prior.h>
#include <plumbline/factors/pose_segment_collinearity.h>
#include <plumbline/factors/pose_segment_points.h>
#include <plumbline/factors/position_prior.h>
#include <plumbline/factors/rectangle_orientation.h>
#include <plumbline/factors/segment_corridor.h>
#include <plumbline/factors/segment_orientation.h>
#include <plumbline/factors/segment_rectangle.h>
#include <plumbline/factors/segment_segment_collinearity.h>
#include <plumbline/factors/segment_segment_thickness.h>
#include <plumbline/factors/thickness.h>
#include <plumbline/factors/wall_visibility.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Quantiles of the chi-square distribution at which the classical kernels, made
// for scalar residuals, are placed for residuals of any dimension.
constexpr double kInlierProbability = 0.95;
// Tukey's biweight ignores what lies past this; with one degree of freedom
// that is 4.42 standard deviations, near its usual constant of 4.685.
constexpr double kRejectionProbability = 1.0 - 1e-5;

// AddFeature and AddRelation, but for what is there already.
template <typename BlockType>
void AddFeatureOnce(Registry* registry,
                    std::vector<G2oVertexFormat> formats = {}) {
  if (registry->FindFeature(BlockType::kName) != nullptr) return;
  AddFeature<BlockType>(registry, std::move(formats));
}
template <typename Relation>
void AddRelationOnce(Registry* registry,
                     std::vector<G2oEdgeFormat> formats = {}) {
  if (registry->FindRelation(Relation::kName) != nullptr) return;
  AddRelation<Relation>(registry, std::move(formats));
}

void AddLoss(
    Registry* registry, const std::string& name, const std::string& description,
    std::function<std::unique_ptr<ceres::LossFunction>(const double*, int)>
        make) {
  if (registry->FindLoss(name) != nullptr) return;
  LossType type;
  type.name = name;
  type.description = description;
  // A residual without information is always zero: no loss is needed, and
  // kernels are not defined for no degrees of freedom.
  type.make_loss = [make = std::move(make)](
                       const double* delta,
                       int degrees) -> std::unique_ptr<ceres::LossFunction> {
    if (degrees < 1) return nullptr;
    return make(delta, degrees);
  };
  registry->Register(std::move(type));
}

// Scale a of a kernel of |r| / a, from a probability.
double Scale(double probability, int degrees_of_freedom) {
  return std::sqrt(ChiSquareQuantile(probability, degrees_of_freedom));
}

G2oVertexFormat VertexFormat(const std::string& tag,
                             std::vector<std::string> extra_fields = {}) {
  G2oVertexFormat format;
  format.tag = tag;
  format.extra_fields = std::move(extra_fields);
  return format;
}

// The angle of a line's normal (g2o) is a right angle more than that of its
// direction.
double DirectionOfNormal(double theta) {
  return NormalizeAngle(theta - 0.5 * kPi);
}
double NormalOfDirection(double alpha) {
  return NormalizeAngle(alpha + 0.5 * kPi);
}

// Extent of a line between the points at its ends, when both are there.
void SetExtent(const std::vector<const Feature*>& ends, Feature* line) {
  if (std::count(ends.begin(), ends.end(), nullptr) == 0) {
    line->type->update_extent(ends, line);
  }
}

// g2o's line: the direction theta of its normal and its distance rho along
// the normal, and the ids of the points at its ends (-1: none).
G2oVertexFormat NormalFormVertex() {
  G2oVertexFormat format = VertexFormat("VERTEX_LINE2D", {"p1Id", "p2Id"});
  format.read = [](double* numbers) {
    const double theta = numbers[0];
    numbers[0] = numbers[1];
    numbers[1] = DirectionOfNormal(theta);
  };
  format.write = [](double* parameters) {
    const double alpha = parameters[1];
    parameters[1] = parameters[0];
    parameters[0] = NormalOfDirection(alpha);
  };
  format.extra_fields_are_ids = true;
  format.read_extra = SetExtent;
  return format;
}

G2oEdgeFormat EdgeFormat(const std::string& tag) {
  G2oEdgeFormat format;
  format.tag = tag;
  return format;
}

// TORO puts the entries that turns take part in last.
G2oEdgeFormat ToroEdge() {
  G2oEdgeFormat format = EdgeFormat("EDGE2");
  format.information_order = {{0, 0}, {0, 1}, {1, 1}, {2, 2}, {0, 2}, {1, 2}};
  return format;
}

// A line observed by (theta, rho).
G2oEdgeFormat NormalFormObservation() {
  G2oEdgeFormat format = EdgeFormat("EDGE_SE2_LINE2D");
  format.row_places = {1, 0};
  format.read = [](double* values) {
    values[1] = DirectionOfNormal(values[1]);
  };
  format.write = [](double* expected) {
    expected[1] = NormalOfDirection(expected[1]);
  };
  return format;
}

// A difference of lines by (theta, rho): no right angle is left of it.
G2oEdgeFormat NormalFormDifference() {
  G2oEdgeFormat format = EdgeFormat("EDGE_LINE2D");
  format.row_places = {1, 0};
  return format;
}

// The line comes first.
G2oEdgeFormat LinePointEdge() {
  G2oEdgeFormat format = EdgeFormat("EDGE_LINE2D_POINTXY");
  format.feature_places = {1, 0};
  return format;
}

void RegisterFeatures(Registry* registry) {
  AddFeatureOnce<PointBlock>(registry,
                             {VertexFormat("VERTEX_EXTREME_XY", {"weight"})});
  AddFeatureOnce<PoseBlock>(registry, {VertexFormat("VERTEX2")});
  AddFeatureOnce<SegmentBlock>(registry);
  AddFeatureOnce<LineBlock>(registry, {NormalFormVertex()});
  AddFeatureOnce<EndPointsBlock>(registry);
  AddFeatureOnce<CircleBlock>(registry);
  AddFeatureOnce<RectangleBlock>(registry);
  AddFeatureOnce<OrientationBlock>(registry);
  AddFeatureOnce<CorridorBlock>(registry);
  AddFeatureOnce<ThicknessBlock>(registry);
}

void RegisterRelations(Registry* registry) {
  AddRelationOnce<PointPointDistance>(registry);
  AddRelationOnce<PointPointCoincidence>(registry);
  AddRelationOnce<PointLineDistance>(registry, {LinePointEdge()});
  AddRelationOnce<PointCircleDistance>(registry);
  AddRelationOnce<PosePose>(registry, {ToroEdge()});
  AddRelationOnce<PosePoint>(registry);
  AddRelationOnce<PosePointBearing>(registry);
  AddRelationOnce<PoseLine>(registry, {NormalFormObservation()});
  AddRelationOnce<LineLine>(registry, {NormalFormDifference()});
  AddRelationOnce<PoseEndPoints>(registry);
  AddRelationOnce<PosePrior>(registry);
  AddRelationOnce<PosePositionPrior>(registry);
  AddRelationOnce<PointPrior>(registry);
  AddRelationOnce<PoseSegmentCollinearity>(registry);
  AddRelationOnce<PoseSegmentCollinearityClamped>(registry);
  AddRelationOnce<PoseSegmentPoints>(registry);
  AddRelationOnce<SegmentSegmentCollinearity>(registry);
  AddRelationOnce<SegmentSegmentOffset>(registry);
  AddRelationOnce<LineOrientation>(registry);
  AddRelationOnce<SegmentOrientation>(registry);
  AddRelationOnce<SegmentRectangle>(registry);
  AddRelationOnce<LineRectangle>(registry);
  AddRelationOnce<RectangleOrientation>(registry);
  AddRelationOnce<OrientationOrientation>(registry);
  AddRelationOnce<SegmentCorridor>(registry);
  AddRelationOnce<SegmentSegmentThickness>(registry);
  AddRelationOnce<WallVisibility>(registry);
}

void RegisterLosses(Registry* registry) {
  AddLoss(registry, "frozen",
          "weight held at the p-value of the last E-step (the paper)",
          [](const double* delta, int) {
            return std::make_unique<FrozenDeltaLoss>(delta);
          });
  AddLoss(registry, "continuous",
          "weight is the p-value at every step of a solve",
          [](const double*, int degrees) {
            return std::make_unique<ContinuousDeltaLoss>(degrees);
          });
  AddLoss(registry, "huber",
          "quadratic up to the 95 % chi-square quantile, then linear",
          [](const double*, int degrees) {
            return std::make_unique<ceres::HuberLoss>(
                Scale(kInlierProbability, degrees));
          });
  AddLoss(registry, "cauchy",
          "weight 1/2 at the 95 % chi-square quantile, falling as 1/s",
          [](const double*, int degrees) {
            return std::make_unique<ceres::CauchyLoss>(
                Scale(kInlierProbability, degrees));
          });
  AddLoss(registry, "tukey",
          "biweight, zero past the 1 - 1e-5 chi-square quantile",
          [](const double*, int degrees) {
            return std::make_unique<ceres::TukeyLoss>(
                Scale(kRejectionProbability, degrees));
          });
  AddLoss(registry, "geman_mcclure",
          "weight 1/4 at the 95 % chi-square quantile, falling as 1/s^2",
          [](const double*, int degrees) {
            return std::make_unique<GemanMcClureLoss>(
                Scale(kInlierProbability, degrees));
          });
  AddLoss(registry, "dcs",
          "dynamic covariance scaling, quadratic up to the 95 % chi-square "
          "quantile",
          [](const double*, int degrees) {
            return std::make_unique<DcsLoss>(
                ChiSquareQuantile(kInlierProbability, degrees));
          });
}

}  // namespace

void RegisterBuiltinRelations(Registry* registry) {
  RegisterFeatures(registry);
  RegisterRelations(registry);
  RegisterLosses(registry);
}

}  // namespace plumbline
