#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/factors/dcs_loss.h>
#include <plumbline/factors/delta_loss.h>
#include <plumbline/factors/geman_mcclure_loss.h>
#include <plumbline/factors/line_line.h>
#include <plumbline/factors/line_manifold.h>
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
        update_extent = nullptr,
    std::vector<G2oVertexFormat> other_g2o_formats = {}) {
  if (registry->FindFeature(name) != nullptr) return;
  FeatureType type;
  type.name = name;
  type.size = static_cast<int>(parameter_names.size());
  type.g2o_tag = g2o_tag;
  type.parameter_names = std::move(parameter_names);
  type.description = description;
  type.make_manifold = std::move(manifold);
  type.update_extent = std::move(update_extent);
  type.other_g2o_formats = std::move(other_g2o_formats);
  registry->Register(std::move(type));
}

// What few relations have.
struct RelationExtras {
  std::vector<G2oEdgeFormat> other_g2o_formats;
  Sighting sighting = Sighting::kNone;
  std::function<void(const Eigen::VectorXd&, const Feature&, Feature*)>
      place_second;
};

void AddRelation(Registry* registry, const std::string& name,
                 const std::string& g2o_tag,
                 std::vector<std::vector<std::string>> feature_types, int size,
                 const std::string& description,
                 std::function<CostPointer(const RelationArguments&)> make,
                 RelationExtras extras = {}) {
  if (registry->FindRelation(name) != nullptr) return;
  const std::size_t arity = feature_types.size();
  RelationType type;
  type.name = name;
  type.g2o_tag = g2o_tag;
  type.feature_types = std::move(feature_types);
  type.residual_size = size;
  type.description = description;
  type.other_g2o_formats = std::move(extras.other_g2o_formats);
  type.sighting = extras.sighting;
  type.place_second = std::move(extras.place_second);
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

G2oVertexFormat VertexFormat(const std::string& tag,
                             std::vector<std::string> extra_fields = {}) {
  G2oVertexFormat format;
  format.tag = tag;
  format.extra_fields = std::move(extra_fields);
  return format;
}

Pose2 PoseOf(const Feature& feature) {
  return Pose2(feature.parameters[0], feature.parameters[1],
               feature.parameters[2]);
}

Eigen::Vector2d AnchorOf(const Feature& feature) {
  return Eigen::Vector2d(feature.anchor[0], feature.anchor[1]);
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
    UpdateLineExtent(ends, line);
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

void PlacePose(const Eigen::VectorXd& expected, const Feature& first,
               Feature* second) {
  const Pose2 pose = Compose(PoseOf(first), Pose2(expected));
  std::copy(pose.data(), pose.data() + 3, second->parameters.begin());
}

void PlacePoint(const Eigen::VectorXd& expected, const Feature& first,
                Feature* second) {
  const Eigen::Vector2d point =
      TransformPoint(PoseOf(first), Eigen::Vector2d(expected));
  std::copy(point.data(), point.data() + 2, second->parameters.begin());
}

void PlaceLine(const Eigen::VectorXd& expected, const Feature& first,
               Feature* second) {
  const Pose2 pose = PoseOf(first);
  const double alpha = NormalizeAngle(pose[2] + expected[1]);
  const Eigen::Vector2d from_anchor = pose.head<2>() - AnchorOf(*second);
  second->parameters[0] = expected[0] - from_anchor[0] * std::sin(alpha) +
                          from_anchor[1] * std::cos(alpha);
  second->parameters[1] = alpha;
}

void PlaceEndPoints(const Eigen::VectorXd& expected, const Feature& first,
                    Feature* second) {
  for (int i = 0; i < 4; i += 2) {
    const Eigen::Vector2d end = TransformPoint(
        PoseOf(first), Eigen::Vector2d(expected[i], expected[i + 1]));
    second->parameters[i] = end[0];
    second->parameters[i + 1] = end[1];
  }
}

void RegisterFeatures(Registry* registry) {
  // Poses and segments have no manifold: their residuals wrap angles, the
  // session wraps headings after a solve, and Jacobians are cheaper so.
  AddFeature(registry, "point", "VERTEX_XY", {"x m", "y m"},
             "Point of the plane: laser points, trees, common centres", nullptr,
             nullptr, {VertexFormat("VERTEX_EXTREME_XY", {"weight"})});
  AddFeature(registry, "pose", "VERTEX_SE2", {"x m", "y m", "theta rad"},
             "Pose of the robot", nullptr, nullptr, {VertexFormat("VERTEX2")});
  AddFeature(registry, "segment", "PLUMBLINE_SEGMENT",
             {"x m", "y m", "theta rad"},
             "Wall segment: a pose on it, x along the wall", nullptr);
  AddFeature(registry, "line", "PLUMBLINE_LINE", {"d m", "alpha rad"},
             "Line: signed distance from its anchor and direction",
             [] { return std::make_unique<LineManifold>(); }, UpdateLineExtent,
             {NormalFormVertex()});
  AddFeature(registry, "end_points", "VERTEX_SEGMENT2D",
             {"x1 m", "y1 m", "x2 m", "y2 m"}, "Wall given by both its ends",
             nullptr);
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
      },
      {{LinePointEdge()}, Sighting::kNone, nullptr});
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
      },
      {{ToroEdge()}, Sighting::kPose, PlacePose});
  AddRelation(
      registry, "pose_point", "EDGE_SE2_XY", {{"pose"}, {"point"}}, 2,
      "point seen from the pose minus u; m, m (EDGE_SE2_XY of g2o)",
      [](const RelationArguments& a) {
        return CostPointer(PosePoint::Create(a.expected, a.sqrt_information));
      },
      {{}, Sighting::kPosition, PlacePoint});
  AddRelation(registry, "pose_point_bearing", "EDGE_BEARING_SE2_XY",
              {{"pose"}, {"point"}}, 1,
              "direction in which the pose sees the point minus u; rad "
              "(EDGE_BEARING_SE2_XY of g2o)",
              [](const RelationArguments& a) {
                return CostPointer(PosePointBearing::Create(
                    a.expected[0], a.sqrt_information(0, 0)));
              });
  AddRelation(registry, "pose_line", "PLUMBLINE_POSE_LINE",
              {{"pose"}, {"line"}}, 2,
              "line (d, alpha) seen from the pose minus u; m, rad "
              "(EDGE_SE2_LINE2D of g2o)",
              [](const RelationArguments& a) {
                return CostPointer(PoseLine::Create(
                    a.expected, AnchorOf(*a.features[1]), a.sqrt_information));
              },
              {{NormalFormObservation()}, Sighting::kNone, PlaceLine});
  AddRelation(registry, "line_line", "PLUMBLINE_LINE_LINE",
              {{"line"}, {"line"}}, 2,
              "difference of distances from the origin and of directions, "
              "minus u; m, rad (EDGE_LINE2D of g2o)",
              [](const RelationArguments& a) {
                return CostPointer(LineLine::Create(
                    a.expected, AnchorOf(*a.features[0]),
                    AnchorOf(*a.features[1]), a.sqrt_information));
              },
              {{NormalFormDifference()}, Sighting::kNone, nullptr});
  AddRelation(registry, "pose_end_points", "EDGE_SE2_SEGMENT2D",
              {{"pose"}, {"end_points"}}, 4,
              "both ends seen from the pose minus u; m, m, m, m "
              "(EDGE_SE2_SEGMENT2D of g2o)",
              [](const RelationArguments& a) {
                return CostPointer(
                    PoseEndPoints::Create(a.expected, a.sqrt_information));
              },
              {{}, Sighting::kNone, PlaceEndPoints});
  AddRelation(
      registry, "pose_prior", "EDGE_PRIOR_SE2", {{"pose"}}, 3,
      "inverse(u) (+) p; m, m, rad (EDGE_PRIOR_SE2 of g2o)",
      [](const RelationArguments& a) {
        return CostPointer(PosePrior::Create(a.expected, a.sqrt_information));
      },
      {{}, Sighting::kPose, nullptr});
  // One tag a type in g2o, so two relations.
  AddRelation(registry, "pose_position_prior", "EDGE_PRIOR_SE2_XY", {{"pose"}},
              2,
              "position of the pose minus u; m, m (EDGE_PRIOR_SE2_XY of g2o)",
              [](const RelationArguments& a) {
                return CostPointer(
                    PositionPrior::Create<3>(a.expected, a.sqrt_information));
              });
  AddRelation(registry, "point_prior", "EDGE_PRIOR_XY", {{"point"}}, 2,
              "point minus u; m, m (EDGE_PRIOR_XY of g2o)",
              [](const RelationArguments& a) {
                return CostPointer(
                    PositionPrior::Create<2>(a.expected, a.sqrt_information));
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
  AddRelation(registry, "line_rectangle", "PLUMBLINE_LINE_RECTANGLE",
              {{"line"}, {"rectangle"}}, 2,
              "segment_rectangle with a line, its distance taken at the "
              "middle of the "
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
