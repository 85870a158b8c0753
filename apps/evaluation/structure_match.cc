#include <plumbline/apps/evaluation/structure_match.h>
#include <plumbline/core/transaction.h>
#include <plumbline/core/wall.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <utility>

namespace plumbline {
namespace {

constexpr double kNoMatch = std::numeric_limits<double>::infinity();

double AxialDifference(double a, double b) {
  return std::abs(NormalizeAxial(a - b));
}

// A line feature in the frame of the truth.
struct PlacedLine {
  Eigen::Vector2d point;
  double direction;

  PlacedLine(const Feature& line, const RigidTransform& transform) {
    const Eigen::Vector3d frame = line.type->frame(line);
    point = transform * Eigen::Vector2d(frame.head<2>());
    direction = frame[2] +
                std::atan2(transform.rotation(1, 0), transform.rotation(0, 0));
  }

  double Distance(const Eigen::Vector2d& p) const {
    return std::abs((p.y() - point.y()) * std::cos(direction) -
                    (p.x() - point.x()) * std::sin(direction));
  }
};

// Pairs features with true ones, nearest first, each at most once; distances
// above 1 match nothing. Returns for every feature its true one or -1.
std::vector<int> Pair(std::size_t features, std::size_t truths,
                      const std::function<double(int, int)>& distance) {
  std::vector<std::pair<double, std::pair<int, int>>> pairs;
  for (std::size_t f = 0; f < features; ++f) {
    for (std::size_t t = 0; t < truths; ++t) {
      const double d = distance(static_cast<int>(f), static_cast<int>(t));
      if (d <= 1.0) {
        pairs.push_back({d, {static_cast<int>(f), static_cast<int>(t)}});
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<int> match(features, -1);
  std::vector<bool> is_taken(truths, false);
  for (const auto& [d, pair] : pairs) {
    if (match[pair.first] >= 0 || is_taken[pair.second]) continue;
    match[pair.first] = pair.second;
    is_taken[pair.second] = true;
  }
  return match;
}

MatchCount CountMatches(const std::vector<int>& match, std::size_t truths) {
  MatchCount count;
  count.found = static_cast<int>(
      std::count_if(match.begin(), match.end(), [](int m) { return m >= 0; }));
  count.missed = static_cast<int>(truths) - count.found;
  count.wrong = static_cast<int>(match.size()) - count.found;
  return count;
}

// Points on which a live constraint of the graph puts a feature.
std::vector<FeatureId> SupportOf(const Graph& graph, FeatureId id) {
  std::vector<FeatureId> support;
  for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
    const Constraint& constraint = graph.GetConstraint(constraint_id);
    if (constraint.state != ConstraintState::kLive ||
        constraint.kind != ConstraintClass::kStructure) {
      continue;
    }
    for (const FeatureId other : constraint.features) {
      if (other != id && graph.GetFeature(other).level == 0) {
        support.push_back(other);
      }
    }
  }
  return support;
}

void CountSupports(const std::vector<FeatureId>& support,
                   const std::vector<FeatureId>& points, MatchCount* count) {
  int right = 0;
  for (const FeatureId id : support) {
    if (std::binary_search(points.begin(), points.end(), id)) {
      ++right;
    } else {
      ++count->wrong;
    }
  }
  count->found += right;
}

Eigen::Vector2d PositionOf(const Feature& feature) {
  return {feature.parameters[0], feature.parameters[1]};
}

Constraint TrueRelation(const Registry& registry, const std::string& relation,
                        std::vector<FeatureId> features, double expected,
                        double sigma) {
  const RelationType& type = registry.GetRelation(relation);
  return MakeStructure(type, std::move(features),
                       Eigen::VectorXd::Constant(type.residual_size, expected),
                       InformationFromSigmas(Eigen::VectorXd::Constant(
                           type.residual_size, sigma)),
                       "truth");
}

Feature MakeVirtual(const Registry& registry, const std::string& type,
                    int level) {
  Feature feature;
  feature.type = &registry.GetFeature(type);
  feature.level = level;
  feature.is_virtual = true;
  feature.source = "truth";
  return feature;
}

}  // namespace

MatchCount StructureMatch::all() const {
  MatchCount sum;
  for (const MatchCount* count : {&lines, &circles, &centers, &orientations}) {
    sum.found += count->found;
    sum.missed += count->missed;
    sum.wrong += count->wrong;
  }
  return sum;
}

bool StructureMatch::is_exact() const {
  const MatchCount sum = all();
  return sum.missed == 0 && sum.wrong == 0;
}

StructureMatch MatchStructure(const Graph& graph, const SyntheticTruth& truth,
                              const StructureMatchOptions& options) {
  const RigidTransform transform = AlignToTruth(graph, truth);
  const double turn =
      std::atan2(transform.rotation(1, 0), transform.rotation(0, 0));
  std::vector<const Feature*> lines;
  std::vector<const Feature*> circles;
  std::vector<const Feature*> centers;
  std::vector<const Feature*> orientations;
  for (const Feature* feature : graph.Features()) {
    if (!feature->is_virtual) continue;
    const FeatureType& type = *feature->type;
    if (type.Is(FeatureRole::kWall)) lines.push_back(feature);
    if (type.Is(FeatureRole::kCircle)) circles.push_back(feature);
    if (type.Is(FeatureRole::kPoint)) centers.push_back(feature);
    if (type.Is(FeatureRole::kDirection)) orientations.push_back(feature);
  }

  StructureMatch result;
  std::vector<PlacedLine> placed;
  for (const Feature* line : lines) placed.emplace_back(*line, transform);
  const std::vector<int> line_match =
      Pair(lines.size(), truth.lines.size(), [&](int f, int t) {
        if (AxialDifference(placed[f].direction,
                            truth.orientations[truth.lines[t].orientation]) >
            DegToRad(options.line_angle_deg)) {
          return kNoMatch;
        }
        return std::max(placed[f].Distance(truth.lines[t].begin),
                        placed[f].Distance(truth.lines[t].end)) /
               options.line_distance;
      });
  result.lines = CountMatches(line_match, truth.lines.size());

  const std::vector<int> circle_match =
      Pair(circles.size(), truth.circles.size(), [&](int f, int t) {
        const double center =
            (transform * PositionOf(*circles[f]) - truth.circles[t].center)
                .norm() /
            options.circle_center;
        const double radius =
            std::abs(circles[f]->parameters[2] - truth.circles[t].radius) /
            options.circle_radius;
        return std::max(center, radius);
      });
  result.circles = CountMatches(circle_match, truth.circles.size());

  const std::vector<int> center_match =
      Pair(centers.size(), truth.centers.size(), [&](int f, int t) {
        return (transform * PositionOf(*centers[f]) - truth.centers[t]).norm() /
               options.common_center;
      });
  result.centers = CountMatches(center_match, truth.centers.size());

  const std::vector<int> orientation_match =
      Pair(orientations.size(), truth.orientations.size(), [&](int f, int t) {
        return AxialDifference(orientations[f]->parameters[0] + turn,
                               truth.orientations[t]) /
               DegToRad(options.orientation_deg);
      });
  result.orientations =
      CountMatches(orientation_match, truth.orientations.size());

  int points = 0;
  for (const SyntheticLine& line : truth.lines) {
    points += static_cast<int>(line.points.size());
  }
  for (const SyntheticCircle& circle : truth.circles) {
    points += static_cast<int>(circle.points.size());
  }
  const std::vector<FeatureId> none;
  for (std::size_t f = 0; f < lines.size(); ++f) {
    CountSupports(SupportOf(graph, lines[f]->id),
                  line_match[f] < 0 ? none : truth.lines[line_match[f]].points,
                  &result.supports);
  }
  for (std::size_t f = 0; f < circles.size(); ++f) {
    CountSupports(
        SupportOf(graph, circles[f]->id),
        circle_match[f] < 0 ? none : truth.circles[circle_match[f]].points,
        &result.supports);
  }
  result.supports.missed = points - result.supports.found;

  for (const FeatureId id : truth.outliers) {
    for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
      const Constraint& constraint = graph.GetConstraint(constraint_id);
      if (constraint.state == ConstraintState::kLive &&
          constraint.kind == ConstraintClass::kStructure) {
        ++result.tied_outliers;
        break;
      }
    }
  }
  return result;
}

void AddTrueStructure(const SyntheticTruth& truth,
                      const TrueStructureTolerances& tolerances,
                      const Registry& registry, Graph* graph) {
  // Features start where the truth has them, moved to where the points are.
  const RigidTransform to_truth = AlignToTruth(*graph, truth);
  const Eigen::Matrix2d back = to_truth.rotation.transpose();
  const double turn = std::atan2(back(1, 0), back(0, 0));
  const auto place = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return back * (p - to_truth.translation);
  };
  Transaction transaction;
  std::vector<FeatureId> orientations;
  for (const double angle : truth.orientations) {
    Feature feature = MakeVirtual(registry, "orientation", 2);
    feature.parameters[0] = NormalizeAngle(angle + turn);
    orientations.push_back(transaction.AddFeature(feature));
    if (orientations.size() > 1) {
      transaction.AddConstraint(
          TrueRelation(registry, "orientation_orientation",
                       {orientations.front(), orientations.back()},
                       NormalizeAxial(angle - truth.orientations.front()),
                       tolerances.relation));
    }
  }
  for (const SyntheticLine& line : truth.lines) {
    Feature feature = MakeVirtual(registry, "line", 1);
    const Eigen::Vector2d middle = place(0.5 * (line.begin + line.end));
    feature.anchor = {middle.x(), middle.y()};
    feature.parameters[1] =
        NormalizeAngle(truth.orientations[line.orientation] + turn);
    feature.extent_end = 0.5 * (line.end - line.begin).norm();
    feature.extent_begin = -feature.extent_end;
    const FeatureId id = transaction.AddFeature(feature);
    for (const FeatureId point : line.points) {
      transaction.AddConstraint(TrueRelation(
          registry, "point_line_distance", {point, id}, 0.0, tolerances.line));
    }
    transaction.AddConstraint(TrueRelation(registry, "line_orientation",
                                           {id, orientations[line.orientation]},
                                           0.0, tolerances.orientation));
  }
  std::vector<FeatureId> centers;
  for (const Eigen::Vector2d& center : truth.centers) {
    Feature feature = MakeVirtual(registry, "point", 2);
    const Eigen::Vector2d p = place(center);
    feature.parameters = {p.x(), p.y()};
    centers.push_back(transaction.AddFeature(feature));
  }
  for (const SyntheticCircle& circle : truth.circles) {
    if (circle.points.empty()) continue;
    Feature feature = MakeVirtual(registry, "circle", 1);
    const Eigen::Vector2d p = place(circle.center);
    feature.parameters = {p.x(), p.y(), circle.radius};
    const FeatureId id = transaction.AddFeature(feature);
    for (const FeatureId point : circle.points) {
      transaction.AddConstraint(TrueRelation(registry, "point_circle_distance",
                                             {point, id}, 0.0,
                                             tolerances.circle));
    }
    if (circle.common_center >= 0) {
      transaction.AddConstraint(TrueRelation(
          registry, "point_point_coincidence",
          {centers[circle.common_center], id}, 0.0, tolerances.center));
    }
  }
  graph->Apply(std::move(transaction));
}

}  // namespace plumbline
