#include <plumbline/core/em_scope.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/wall_faces.h>
#include <plumbline/detectors/wall_thickness.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/factors/segment_segment_collinearity.h>
#include <plumbline/factors/segment_segment_thickness.h>
#include <plumbline/factors/thickness.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr char kName[] = "wall_thickness";

// A face behind another one hides it where it covers this part of it.
constexpr double kHidden = 0.5;

using FacePair = std::pair<FeatureId, FeatureId>;

// Two faces that look away from each other.
struct WallBody {
  std::size_t first = 0;
  std::size_t second = 0;
  // At the middle of what they have in common, along the first face, m.
  Interval common;
  double thickness = 0.0;
  // Of the second against the first but for half a turn, rad.
  double turn = 0.0;
  // Of both as the graph has them, m and rad.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  // Where the middle of what they have in common lies, along the second face
  // from its position, m.
  double lever = 0.0;
  // Standard deviations of its thickness and turn against its class.
  Vector2d tolerance = Vector2d::Zero();
};

// A class and what is known of its thickness, m and m^2.
struct SharedThickness {
  FeatureId id = kNoId;
  double thickness = 0.0;
  double variance = 0.0;
  std::vector<std::size_t> bodies;
};

struct Innovation {
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  Vector2d error = Vector2d::Zero();
  double chi_square = 0.0;

  double log_likelihood() const {
    return -0.5 * (chi_square + std::log(covariance.determinant()));
  }
};

Innovation Predict(const WallBody& body, const SharedThickness& shared) {
  Innovation innovation;
  innovation.error = Vector2d(body.thickness - shared.thickness, body.turn);
  innovation.covariance = body.covariance;
  innovation.covariance.diagonal() +=
      body.tolerance.cwiseProduct(body.tolerance);
  innovation.covariance(0, 0) += shared.variance;
  innovation.chi_square = innovation.error.dot(
      innovation.covariance.ldlt().solve(innovation.error));
  return innovation;
}

// What a wall that is tied to a class says of its thickness.
void Tie(const WallBody& body, std::size_t index, SharedThickness* shared) {
  const Innovation innovation = Predict(body, *shared);
  const Eigen::RowVector2d gain =
      shared->variance * innovation.covariance.inverse().row(0);
  shared->thickness += gain.dot(innovation.error);
  shared->variance -= gain[0] * shared->variance;
  shared->bodies.push_back(index);
}

// Whether the second face lies behind the first, back to back; fills in where.
bool IsBehind(const WallFace& first, const WallFace& second,
              const WallThicknessOptions& options, WallBody* body) {
  body->turn = NormalizeAngle(second.wall.angle - first.wall.angle - kPi);
  if (std::abs(body->turn) > options.max_turn) return false;
  const Interval other = first.wall.IntervalOf(second.wall);
  body->common = {std::max(first.wall.begin, other.first),
                  std::min(first.wall.end, other.second)};
  if (body->common.second - body->common.first < options.min_overlap) {
    return false;
  }
  const Vector2d at =
      first.wall.At(0.5 * (body->common.first + body->common.second));
  body->lever = second.wall.Along(at);
  body->thickness = -first.wall.Across(second.wall.At(body->lever));
  return body->thickness >= options.classes.min_thickness &&
         body->thickness <= options.classes.max_thickness;
}

// The walls of which both faces were seen: of several faces behind each other
// the nearest ones.
std::vector<WallBody> FindBodies(const std::vector<WallFace>& faces,
                                 const WallThicknessOptions& options) {
  std::vector<WallBody> candidates;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    for (std::size_t j = i + 1; j < faces.size(); ++j) {
      WallBody body;
      if (faces[i].part != faces[j].part ||
          !IsBehind(faces[i], faces[j], options, &body)) {
        continue;
      }
      body.first = i;
      body.second = j;
      body.tolerance = {
          options.sigma,
          std::hypot(
              options.sigma_angle,
              std::hypot(OwnDirectionSigma(faces[i].length,
                                           options.own_direction_noise),
                         OwnDirectionSigma(faces[j].length,
                                           options.own_direction_noise)))};
      candidates.push_back(body);
    }
  }
  std::map<std::size_t, std::vector<std::size_t>> by_face;
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    by_face[candidates[k].first].push_back(k);
    by_face[candidates[k].second].push_back(k);
  }
  std::vector<WallBody> bodies;
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    const WallBody& body = candidates[k];
    const auto hides = [&](std::size_t other, std::size_t face) {
      const WallBody& thinner = candidates[other];
      if (other == k || thinner.thickness >= body.thickness) return false;
      // Both along the face that they share.
      const Wall& shared = faces[face].wall;
      const auto along = [&](const WallBody& pair) {
        return shared.IntervalOf(
            faces[pair.first == face ? pair.second : pair.first].wall);
      };
      const Interval own = along(body);
      const Interval common = {std::max(own.first, shared.begin),
                               std::min(own.second, shared.end)};
      return Overlap(along(thinner), common) >
             kHidden * (common.second - common.first);
    };
    bool is_hidden = false;
    for (const std::size_t face : {body.first, body.second}) {
      for (const std::size_t other : by_face[face]) {
        is_hidden = is_hidden || hides(other, face);
      }
    }
    if (!is_hidden) bodies.push_back(body);
  }
  return bodies;
}

// What the graph says of a wall's thickness and of how parallel its faces are.
void SetCovariance(const std::vector<WallFace>& faces, Marginals* marginals,
                   WallBody* body) {
  const WallFace& first = faces[body->first];
  const WallFace& second = faces[body->second];
  // Of the middles of the faces; where the wall is looked at is so far from
  // them along each.
  const Eigen::MatrixXd of_faces =
      FaceCovariance({}, {&first, &second}, second.wall.normal(), marginals);
  const double along_first = 0.5 * (body->common.first + body->common.second) -
                             0.5 * (first.wall.begin + first.wall.end);
  const double along_second =
      body->lever - 0.5 * (second.wall.begin + second.wall.end);
  Eigen::Matrix<double, 2, 4> rows;
  rows << 1.0, along_first, 1.0, along_second,  //
      0.0, -1.0, 0.0, 1.0;
  body->covariance = rows * of_faces * rows.transpose();
}

// Ties bodies to classes: those of which most is known first, each to the class
// that fits best where it beats the others.
void Assign(const std::vector<WallBody>& bodies, double gate, double margin,
            std::vector<SharedThickness>* classes) {
  std::vector<bool> is_tied(bodies.size(), false);
  while (true) {
    std::size_t best_body = bodies.size();
    std::size_t best_class = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      if (is_tied[b]) continue;
      std::size_t fitting = classes->size();
      double likeliest = -std::numeric_limits<double>::infinity();
      double next = likeliest;
      for (std::size_t k = 0; k < classes->size(); ++k) {
        const double likelihood =
            Predict(bodies[b], (*classes)[k]).log_likelihood();
        if (likelihood > likeliest) {
          next = likeliest;
          likeliest = likelihood;
          fitting = k;
        } else {
          next = std::max(next, likelihood);
        }
      }
      if (fitting == classes->size() || !(likeliest - next >= margin)) continue;
      const Innovation innovation = Predict(bodies[b], (*classes)[fitting]);
      if (!(innovation.chi_square <= gate)) continue;
      const double size = innovation.covariance.determinant();
      if (size < least) {
        least = size;
        best_body = b;
        best_class = fitting;
      }
    }
    if (best_body == bodies.size()) break;
    Tie(bodies[best_body], best_body, &(*classes)[best_class]);
    is_tied[best_body] = true;
  }
}

void Bind(ParameterBinder* parameters, WallThicknessOptions* options) {
  ParameterBinder& p = *parameters;
  constexpr double kNoLimit = ParameterBinder::kNoLimit;
  p.Length("sigma", &options->sigma, 1e-6, kNoLimit,
           "tolerance of a wall against the thickness that it shares");
  p.Angle("sigma_deg", &options->sigma_angle, 1e-6, 90.0,
          "tolerance of its faces in direction");
  p.Angle("own_direction_noise_deg", &options->own_direction_noise, 0.0, 90.0,
          "how far the visible part of a face of 1 m may be off its direction");
  p.Number("innovation_gate", &options->gate, 0.0, kNoLimit, "",
           "largest chi-square of the innovation of a wall");
  p.Number("margin", &options->margin, 0.0, kNoLimit, "",
           "log-likelihood by which the best class has to beat the next one");
  p.Length("min_face", &options->min_face, 0.0, kNoLimit,
           "shortest face that is looked at");
  p.Length("min_overlap", &options->min_overlap, 1e-3, kNoLimit,
           "least length over which two faces lie back to back");
  p.Angle("max_turn_deg", &options->max_turn, 1e-6, 40.0,
          "how parallel two faces of a wall are");
  p.Length("max_uncertainty", &options->max_uncertainty, 0.0, kNoLimit,
           "walls of less certain thickness say nothing of classes");
  ThicknessClassOptions& classes = options->classes;
  p.Length("min_thickness", &classes.min_thickness, 0.0, kNoLimit,
           "thinnest wall");
  p.Length("max_thickness", &classes.max_thickness,
           classes.min_thickness + 1e-3, kNoLimit, "thickest wall");
  p.Count("min_support", &classes.min_support, 2,
          "fewest walls that share a thickness");
  p.Length("max_stddev", &classes.max_stddev, 1e-6, kNoLimit,
           "widest spread of walls that share a thickness");
  p.Length("min_separation", &classes.min_separation, 0.0, kNoLimit,
           "thicknesses nearer to each other are one");
  p.Number("significance", &classes.significance, 1e-300, 1.0, "",
           "chance at which walls of any thickness may look like a class");
}

}  // namespace

WallThicknessDetector::WallThicknessDetector(
    const WallThicknessOptions& options)
    : options_(options) {}

const std::string& WallThicknessDetector::name() const {
  static const std::string name = kName;
  return name;
}

Transaction WallThicknessDetector::Detect(const Graph& graph,
                                          const Registry& registry,
                                          const DetectionScope& scope) const {
  Transaction transaction;
  if (scope.features != nullptr) return transaction;
  const std::vector<WallFace> faces =
      CollectWallFaces(graph, scope, options_.min_face);
  const FeatureType& type = registry.GetFeature(ThicknessBlock::kName);
  const RelationType& relation =
      registry.GetRelation(SegmentSegmentThickness::kName);
  // What is there.
  std::vector<FeatureId> there;
  std::set<FacePair> tied;
  for (const FeatureId id : graph.VirtualFeatures(scope.level + 1)) {
    if (graph.GetFeature(id).type != &type) continue;
    there.push_back(id);
    for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
      const Constraint& constraint = graph.GetConstraint(constraint_id);
      if (IsLiveStructure(constraint) && constraint.type == &relation) {
        tied.insert({constraint.features[0], constraint.features[1]});
      }
    }
  }
  std::vector<WallBody> bodies = FindBodies(faces, options_);
  scope.Count("faces", static_cast<std::int64_t>(faces.size()));
  scope.Count("walls with two faces", static_cast<std::int64_t>(bodies.size()));
  bodies.erase(
      std::remove_if(bodies.begin(), bodies.end(),
                     [&](const WallBody& body) {
                       return tied.count({faces[body.first].feature->id,
                                          faces[body.second].feature->id}) > 0;
                     }),
      bodies.end());
  if (bodies.empty()) return transaction;

  MarginalsOptions marginals_options;
  marginals_options.hold_gauge = true;
  Marginals marginals(graph, marginals_options);
  std::vector<ThicknessSample> samples;
  for (WallBody& body : bodies) {
    if (scope.ShouldStop()) return transaction;
    SetCovariance(faces, &marginals, &body);
    const double variance = body.covariance(0, 0);
    if (variance <= options_.max_uncertainty * options_.max_uncertainty) {
      samples.push_back({body.thickness, variance});
    }
  }
  std::vector<SharedThickness> classes;
  std::vector<ThicknessClass> known;
  for (const FeatureId id : there) {
    SharedThickness shared;
    shared.id = id;
    shared.thickness = graph.GetFeature(id).parameters[0];
    shared.variance = marginals.Covariance(id)(0, 0);
    known.push_back({shared.thickness, options_.sigma});
    classes.push_back(shared);
  }
  for (const ThicknessClass& found :
       FindThicknessClasses(samples, known, options_.classes)) {
    SharedThickness shared;
    shared.thickness = found.thickness;
    shared.variance =
        found.stddev * found.stddev + options_.sigma * options_.sigma;
    classes.push_back(shared);
  }
  Assign(bodies, options_.gate, options_.margin, &classes);

  std::int64_t num_found = 0;
  std::int64_t num_tied = 0;
  for (const SharedThickness& shared : classes) {
    FeatureId id = shared.id;
    if (id == kNoId) {
      if (static_cast<int>(shared.bodies.size()) <
          options_.classes.min_support) {
        continue;
      }
      Feature feature;
      feature.type = &type;
      feature.level = scope.level + 1;
      feature.is_virtual = true;
      feature.parameters[0] = shared.thickness;
      feature.source = kName;
      id = transaction.AddFeature(std::move(feature));
      ++num_found;
    }
    for (const std::size_t index : shared.bodies) {
      const WallBody& body = bodies[index];
      Constraint tie = MakeStructure(
          relation,
          {faces[body.first].feature->id, faces[body.second].feature->id, id},
          Vector2d(0.0, kPi),
          CollinearityInformation(body.tolerance[0], body.tolerance[1],
                                  body.lever),
          kName);
      // What was accepted by its innovation goes at the same gate.
      tie.break_below = ChiSquarePValue(options_.gate, 2);
      transaction.AddConstraint(std::move(tie));
      ++num_tied;
    }
  }
  scope.Count("thicknesses found", num_found);
  scope.Count("walls refused: no thickness fits",
              static_cast<std::int64_t>(bodies.size()) - num_tied);
  return transaction;
}

DetectorType WallThicknessType() {
  DetectorType type;
  type.name = kName;
  type.description =
      "Thicknesses that walls share of which both faces were seen";
  type.reads = {"segment"};
  type.makes = {"thickness"};
  SetParameters<WallThicknessOptions>(
      Bind,
      [](const WallThicknessOptions& options) {
        return std::make_unique<WallThicknessDetector>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
