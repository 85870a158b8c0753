#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/factors/dcs_loss.h>
#include <plumbline/factors/delta_loss.h>
#include <plumbline/factors/geman_mcclure_loss.h>
#include <plumbline/factors/line_manifold.h>
#include <plumbline/factors/line_orientation.h>
#include <plumbline/factors/line_rectangle.h>
#include <plumbline/factors/orientation_orientation.h>
#include <plumbline/factors/point_circle_distance.h>
#include <plumbline/factors/point_line_distance.h>
#include <plumbline/factors/point_point_coincidence.h>
#include <plumbline/factors/point_point_distance.h>
#include <plumbline/factors/pose_pose.h>
#include <plumbline/factors/pose_segment_collinearity.h>
#include <plumbline/factors/pose_segment_points.h>
#include <plumbline/factors/rectangle_orientation.h>
#include <plumbline/factors/segment_orientation.h>
#include <plumbline/factors/segment_rectangle.h>
#include <plumbline/factors/segment_segment_collinearity.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace plumbline {
namespace {

using CostPointer = std::unique_ptr<ceres::CostFunction>;

// Quantiles of the chi-square distribution at which the classical kernels, made
// for scalar residuals, are placed for residuals of any dimension.
constexpr double kInlierProbability = 0.95;
// Tukey's biweight ignores what lies past this; with one degree of freedom
// that is 4.42 standard deviations, near its usual constant of 4.685.
constexpr double kRejectionProbability = 1.0 - 1e-5;

void AddFeature(
    Registry* registry, const std::string& name, const std::string& g2o_tag,
    std::vector<std::string> parameter_names, const std::string& description,
    std::function<std::unique_ptr<ceres::Manifold>()> manifold,
    std::function<void(const std::vector<const Feature*>&, Feature*)>
        update_extent = nullptr) {
  if (registry->FindFeature(name) != nullptr) return;
  FeatureType type;
  type.name = name;
  type.size = static_cast<int>(parameter_names.size());
  type.g2o_tag = g2o_tag;
  type.parameter_names = std::move(parameter_names);
  type.description = description;
  type.make_manifold = std::move(manifold);
  type.update_extent = std::move(update_extent);
  registry->Register(std::move(type));
}

void AddRelation(Registry* registry, const std::string& name,
                 const std::string& g2o_tag,
                 std::vector<std::vector<std::string>> feature_types, int size,
                 const std::string& description,
                 std::function<CostPointer(const RelationArguments&)> make) {
  if (registry->FindRelation(name) != nullptr) return;
  const std::size_t arity = feature_types.size();
  RelationType type;
  type.name = name;
  type.g2o_tag = g2o_tag;
  type.feature_types = std::move(feature_types);
  type.residual_size = size;
  type.description = description;
  type.make_cost = [name, arity, size,
                    make = std::move(make)](const RelationArguments& a) {
    if (a.features.size() != arity || a.expected.size() != size ||
        a.sqrt_information.rows() != size ||
        a.sqrt_information.cols() != size) {
      throw PLUMBLINE_ERROR("arguments do not fit " + name,
                            std::to_string(arity) + " features and " +
                                std::to_string(size) + " rows");
    }
    return make(a);
  };
  registry->Register(std::move(type));
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

// Calls make with the size of a point-like block (its type begins with x, y) as
// a compile-time constant.
template <typename Function>
CostPointer WithPointSize(const Feature& feature, const Function& make) {
  switch (feature.type->size) {
    case 2:
      return make(std::integral_constant<int, 2>());
    case 3:
      return make(std::integral_constant<int, 3>());
    default:
      throw PLUMBLINE_ERROR("no point in a block of " +
                                std::to_string(feature.type->size) +
                                " parameters",
                            "2 or 3");
  }
}

// Points, poses and circles (by their centres) carry a line; a line carried by
// none keeps its extent.
void UpdateLineExtent(const std::vector<const Feature*>& support,
                      Feature* line) {
  const double c = std::cos(line->parameters[1]);
  const double s = std::sin(line->parameters[1]);
  double begin = std::numeric_limits<double>::infinity();
  double end = -begin;
  for (const Feature* feature : support) {
    const std::string& type = feature->type->name;
    if (type != "point" && type != "pose" && type != "circle") continue;
    // The foot point is seen from the anchor at right angles to the line.
    const double along = c * (feature->parameters[0] - line->anchor[0]) +
                         s * (feature->parameters[1] - line->anchor[1]);
    if (!std::isfinite(along)) continue;
    begin = std::min(begin, along);
    end = std::max(end, along);
  }
  if (begin > end) return;
  line->extent_begin = begin;
  line->extent_end = end;
}

void RegisterFeatures(Registry* registry) {
  // Poses and segments have no manifold: their residuals wrap angles, the
  // session wraps headings after a solve, and Jacobians are cheaper so.
  AddFeature(registry, "point", "VERTEX_XY", {"x m", "y m"},
             "Point of the plane: laser points, trees, common centres",
             nullptr);
  AddFeature(registry, "pose", "VERTEX_SE2", {"x m", "y m", "theta rad"},
             "Pose of the robot", nullptr);
  AddFeature(registry, "segment", "PLUMBLINE_SEGMENT",
             {"x m", "y m", "theta rad"},
             "Wall segment: a pose on it, x along the wall", nullptr);
  AddFeature(
      registry, "line", "PLUMBLINE_LINE", {"d m", "alpha rad"},
      "Line: signed distance from its anchor and direction",
      [] { return std::make_unique<LineManifold>(); }, UpdateLineExtent);
  AddFeature(registry, "circle", "PLUMBLINE_CIRCLE", {"x m", "y m", "R m"},
             "Circle: centre and radius", nullptr);
  AddFeature(registry, "rectangle", "PLUMBLINE_RECTANGLE",
             {"x m", "y m", "theta rad", "half_length m", "half_width m"},
             "Rectangle: centre, direction, half its size along it and across",
             nullptr);
  AddFeature(registry, "orientation", "PLUMBLINE_ORIENTATION", {"theta rad"},
             "Direction shared by walls, modulo pi",
             [] { return std::make_unique<AngleManifold>(); });
}

void RegisterRelations(Registry* registry) {
  const std::vector<std::string> points = {"point", "pose", "circle"};
  const std::vector<std::string> poses = {"pose", "segment"};

  AddRelation(registry, "point_point_distance",
              "PLUMBLINE_POINT_POINT_DISTANCE", {points, points}, 1,
              "|p2 - p1| - u; m (Eq. 14)", [](const RelationArguments& a) {
                return WithPointSize(*a.features[0], [&](auto first) {
                  return WithPointSize(*a.features[1], [&](auto second) {
                    return CostPointer(
                        PointPointDistance::Create<decltype(first)::value,
                                                   decltype(second)::value>(
                            a.expected[0], a.sqrt_information(0, 0)));
                  });
                });
              });
  AddRelation(registry, "point_point_coincidence",
              "PLUMBLINE_POINT_POINT_COINCIDENCE", {points, points}, 2,
              "p2 - p1 - u; m, m (method.md, section 4)",
              [](const RelationArguments& a) {
                return WithPointSize(*a.features[0], [&](auto first) {
                  return WithPointSize(*a.features[1], [&](auto second) {
                    return CostPointer(
                        PointPointCoincidence::Create<decltype(first)::value,
                                                      decltype(second)::value>(
                            a.expected, a.sqrt_information));
                  });
                });
              });
  AddRelation(
      registry, "point_line_distance", "PLUMBLINE_POINT_LINE_DISTANCE",
      {points, {"line"}}, 1,
      "-d - x sin(alpha) + y cos(alpha) - u, x and y from the line's anchor; "
      "m (Eq. 16)",
      [](const RelationArguments& a) {
        const std::array<double, 2>& anchor = a.features[1]->anchor;
        return WithPointSize(*a.features[0], [&](auto first) {
          return CostPointer(PointLineDistance::Create<decltype(first)::value>(
              a.expected[0], Eigen::Vector2d(anchor[0], anchor[1]),
              a.sqrt_information(0, 0)));
        });
      });
  AddRelation(registry, "point_circle_distance",
              "PLUMBLINE_POINT_CIRCLE_DISTANCE",
              {{"point", "pose"}, {"circle"}}, 1, "|p - c| - R - u; m (Eq. 18)",
              [](const RelationArguments& a) {
                return WithPointSize(*a.features[0], [&](auto first) {
                  return CostPointer(
                      PointCircleDistance::Create<decltype(first)::value>(
                          a.expected[0], a.sqrt_information(0, 0)));
                });
              });
  AddRelation(
      registry, "pose_pose", "EDGE_SE2", {poses, poses}, 3,
      "inverse(p1) (+) p2 (-) u; m, m, rad (Eq. 19)",
      [](const RelationArguments& a) {
        return CostPointer(PosePose::Create(a.expected, a.sqrt_information));
      });
  AddRelation(registry, "pose_segment_collinearity",
              "PLUMBLINE_POSE_SEGMENT_COLLINEARITY", {poses, {"segment"}}, 2,
              "distance of the pose across the segment and angle between them, "
              "minus u; m, rad (Eq. 20)",
              [](const RelationArguments& a) {
                return CostPointer(PoseSegmentCollinearity::Create(
                    a.expected, a.sqrt_information));
              });
  AddRelation(
      registry, "pose_segment_collinearity_clamped",
      "PLUMBLINE_POSE_SEGMENT_COLLINEARITY_CLAMPED", {poses, {"segment"}}, 2,
      "pose_segment_collinearity that does not move the segment; m, rad "
      "(Eq. 21)",
      [](const RelationArguments& a) {
        return CostPointer(PoseSegmentCollinearityClamped::Create(
            a.expected, a.sqrt_information));
      });
  AddRelation(registry, "pose_segment_points", "PLUMBLINE_POSE_SEGMENT_POINTS",
              {poses, {"segment"}}, 3,
              "normal of the segment in the pose's frame and distance of the "
              "pose from it, minus u: points seen on it; -, -, m (Eq. 16)",
              [](const RelationArguments& a) {
                return CostPointer(
                    PoseSegmentPoints::Create(a.expected, a.sqrt_information));
              });
  AddRelation(registry, "segment_segment_collinearity",
              "PLUMBLINE_SEGMENT_SEGMENT_COLLINEARITY",
              {{"segment"}, {"segment"}}, 2,
              "distance of the second segment across the first and angle "
              "between them, minus u; m, rad (Eq. 20)",
              [](const RelationArguments& a) {
                return CostPointer(SegmentSegmentCollinearity::Create(
                    a.expected, a.sqrt_information));
              });
  AddRelation(registry, "line_orientation", "PLUMBLINE_LINE_ORIENTATION",
              {{"line"}, {"orientation"}}, 1,
              "o - alpha - u modulo pi; rad (Eq. 22)",
              [](const RelationArguments& a) {
                return CostPointer(LineOrientation::Create(
                    a.expected[0], a.sqrt_information(0, 0)));
              });
  AddRelation(registry, "segment_orientation", "PLUMBLINE_SEGMENT_ORIENTATION",
              {{"segment"}, {"orientation"}}, 1,
              "o - theta - u modulo pi; rad (Eq. 22)",
              [](const RelationArguments& a) {
                return CostPointer(SegmentOrientation::Create(
                    a.expected[0], a.sqrt_information(0, 0)));
              });
  AddRelation(
      registry, "segment_rectangle", "PLUMBLINE_SEGMENT_RECTANGLE",
      {{"segment"}, {"rectangle"}}, 2,
      "distance past the side in the direction u1 of the rectangle minus u0, "
      "and angle between them minus u1 modulo pi; m, rad (Table 1, #4)",
      [](const RelationArguments& a) {
        return CostPointer(
            SegmentRectangle::Create(a.expected, a.sqrt_information));
      });
  AddRelation(
      registry, "line_rectangle", "PLUMBLINE_LINE_RECTANGLE",
      {{"line"}, {"rectangle"}}, 2,
      "segment_rectangle with a line, its distance taken at the middle of the "
      "side; m, rad (Table 1, #4)",
      [](const RelationArguments& a) {
        const std::array<double, 2>& anchor = a.features[0]->anchor;
        return CostPointer(LineRectangle::Create(
            a.expected, Eigen::Vector2d(anchor[0], anchor[1]),
            a.sqrt_information));
      });
  AddRelation(registry, "rectangle_orientation",
              "PLUMBLINE_RECTANGLE_ORIENTATION",
              {{"rectangle"}, {"orientation"}}, 1,
              "o - theta - u modulo pi; rad (Table 1, #4)",
              [](const RelationArguments& a) {
                return CostPointer(RectangleOrientation::Create(
                    a.expected[0], a.sqrt_information(0, 0)));
              });
  AddRelation(
      registry, "orientation_orientation", "PLUMBLINE_ORIENTATION_ORIENTATION",
      {{"orientation"}, {"orientation"}}, 1,
      "o2 - o1 - u modulo pi; rad (Eq. 23)", [](const RelationArguments& a) {
        return CostPointer(OrientationOrientation::Create(
            a.expected[0], a.sqrt_information(0, 0)));
      });
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
