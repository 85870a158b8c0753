#include <plumbline/core/em_scope.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/corridor.h>
#include <plumbline/detectors/corridor_axis.h>
#include <plumbline/detectors/corridor_model.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/wall_faces.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/factors/corridor.h>
#include <plumbline/factors/segment_corridor.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr char kName[] = "corridor";

// A face may go on beyond a wall across by this much, m: walls are thick.
constexpr double kBeyond = 0.3;
// So many pairs of faces may found a corridor; the one on which most faces fit
// does. The longest pair may have a niche or a row of cupboards for a side.
constexpr int kMaxRivals = 8;

// A corridor that is there, with the faces that are tied to it.
struct Existing {
  const Feature* feature = nullptr;
  // Of the graph.
  std::size_t part = 0;
  CorridorAxis axis;
  std::vector<Interval> intervals;
};

// What is found: a new corridor, or faces that join one that is there.
struct Found {
  const Feature* existing = nullptr;
  // Of the graph.
  std::size_t part = 0;
  CorridorAxis axis;
  Interval interval;
  std::vector<SideFace> faces;
  // Number of faces that did not fit.
  std::int64_t refused = 0;
};

// One call of Detect.
class CorridorSearch {
 public:
  CorridorSearch(const CorridorOptions& options, const Graph& graph,
                 std::vector<WallFace> faces)
      : options_(options),
        graph_(graph),
        faces_(std::move(faces)),
        is_used_(faces_.size(), false) {}

  void SetUsed(FeatureId id) {
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      if (faces_[i].feature->id == id) is_used_[i] = true;
    }
  }

  std::vector<Found> Run(std::vector<Existing> existing,
                         const DetectionScope& scope) {
    std::vector<Found> found;
    for (Existing& corridor : existing) {
      if (scope.ShouldStop()) return {};
      corridor.part = PartOf(*corridor.feature);
      std::optional<Found> more = Extend(corridor);
      if (more) found.push_back(std::move(*more));
    }
    const std::vector<Seed> seeds = Seeds();
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      if (scope.ShouldStop()) return {};
      if (!IsFree(seeds[i])) continue;
      const CorridorAxis axis =
          AxisBetween(faces_[seeds[i].first], faces_[seeds[i].second]);
      const std::size_t part = faces_[seeds[i].first].part;
      if (LiesInOneOf(existing, axis, part) || LiesInOneOf(found, axis, part)) {
        continue;
      }
      std::optional<Found> best = Complete(axis, seeds[i]);
      if (!best) continue;
      const Found first = *best;
      int rivals = 1;
      for (std::size_t j = i + 1; j < seeds.size() && rivals < kMaxRivals;
           ++j) {
        if (!IsFree(seeds[j]) || faces_[seeds[j].first].part != part) continue;
        const CorridorAxis rival_axis =
            AxisBetween(faces_[seeds[j].first], faces_[seeds[j].second]);
        if (!rival_axis.IsWithin(first.axis, first.interval)) continue;
        ++rivals;
        std::optional<Found> rival = Complete(rival_axis, seeds[j]);
        if (rival && TiedLength(*rival) > TiedLength(*best)) {
          best = std::move(rival);
        }
      }
      for (const SideFace& on : best->faces) is_used_[on.face] = true;
      refused_ += best->refused;
      found.push_back(std::move(*best));
    }
    scope.Count("faces", static_cast<std::int64_t>(faces_.size()));
    scope.Count("pairs of faces tried", tried_);
    scope.Count("pairs refused: a wall across", crossed_);
    scope.Count("pairs refused: not long, narrow and closed", not_long_);
    scope.Count("faces refused: innovation", refused_);
    return found;
  }

  const WallFace& face(std::size_t i) const { return faces_[i]; }

  // Standard deviations of a face's offset and direction against its side.
  Vector2d ToleranceOf(const WallFace& face) const {
    return {options_.sigma,
            std::hypot(
                options_.sigma_angle,
                OwnDirectionSigma(face.length, options_.own_direction_noise))};
  }

 private:
  struct Seed {
    std::size_t first = 0;
    std::size_t second = 0;
    double overlap = 0.0;
  };

  // Pairs of faces that look at each other, the longest first.
  std::vector<Seed> Seeds() const {
    std::vector<Seed> seeds;
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      if (is_used_[i] || faces_[i].length < options_.min_facing) continue;
      const Wall& first = faces_[i].wall;
      for (std::size_t j = i + 1; j < faces_.size(); ++j) {
        if (is_used_[j] || faces_[j].length < options_.min_facing ||
            faces_[j].part != faces_[i].part) {
          continue;
        }
        const Wall& second = faces_[j].wall;
        if (std::abs(NormalizeAngle(second.angle - first.angle + kPi)) >
            options_.max_turn) {
          continue;
        }
        const Interval interval = first.IntervalOf(second);
        const Interval common = {std::max(first.begin, interval.first),
                                 std::min(first.end, interval.second)};
        const double overlap = common.second - common.first;
        if (overlap < options_.min_facing) continue;
        // The second face at the middle of what they have in common.
        const Vector2d at = first.At(0.5 * (common.first + common.second));
        const double width = second.Across(at);
        if (width < options_.min_width || width > options_.max_width ||
            first.Across(faces_[j].middle) <= 0.0) {
          continue;
        }
        seeds.push_back({i, j, overlap});
      }
    }
    std::sort(seeds.begin(), seeds.end(), [](const Seed& a, const Seed& b) {
      return std::tie(b.overlap, a.first, a.second) <
             std::tie(a.overlap, b.first, b.second);
    });
    return seeds;
  }

  bool IsFree(const Seed& seed) const {
    return !is_used_[seed.first] && !is_used_[seed.second];
  }

  double TiedLength(const Found& found) const {
    double length = 0.0;
    for (const SideFace& on : found.faces) length += faces_[on.face].length;
    return length;
  }

  static bool LiesInOneOf(const std::vector<Existing>& existing,
                          const CorridorAxis& axis, std::size_t part) {
    return std::any_of(
        existing.begin(), existing.end(), [&](const Existing& corridor) {
          return corridor.part == part && !corridor.intervals.empty() &&
                 axis.IsWithin(corridor.axis, Hull(corridor.intervals));
        });
  }
  static bool LiesInOneOf(const std::vector<Found>& found,
                          const CorridorAxis& axis, std::size_t part) {
    return std::any_of(found.begin(), found.end(), [&](const Found& corridor) {
      return corridor.part == part &&
             axis.IsWithin(corridor.axis, corridor.interval);
    });
  }

  // Faces that are not used and lie along a side, joined on to `part` across
  // openings.
  std::vector<SideFace> Gather(const CorridorAxis& axis, std::size_t graph_part,
                               const Interval& reach, Interval part) const {
    std::vector<SideFace> candidates;
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      if (is_used_[i] || faces_[i].part != graph_part) continue;
      const SideFace on = OnSide(axis, faces_[i], i);
      if (std::abs(on.turn) > options_.max_turn ||
          std::abs(on.past) > options_.max_offset ||
          on.interval.first < reach.first - kBeyond ||
          on.interval.second > reach.second + kBeyond) {
        continue;
      }
      candidates.push_back(on);
    }
    return JoinedTo(part, candidates, options_.max_opening);
  }

  // Long, narrow, and with walls along both sides.
  bool IsCorridor(const CorridorAxis& axis,
                  const std::vector<SideFace>& faces) const {
    std::array<std::vector<Interval>, 2> sides;
    std::vector<Interval> all;
    for (const SideFace& on : faces) {
      sides[on.side].push_back(on.interval);
      all.push_back(on.interval);
    }
    if (sides[kRightSide].empty() || sides[kLeftSide].empty()) return false;
    const Interval hull = Hull(all);
    const double length = hull.second - hull.first;
    const double width = 2.0 * axis.half_width;
    return length >= options_.min_length &&
           length >= options_.min_ratio * width &&
           UnionLength(sides[kRightSide]) >= options_.min_coverage * length &&
           UnionLength(sides[kLeftSide]) >= options_.min_coverage * length;
  }

  CorridorModel MakeModel(const Feature* existing, const CorridorAxis& axis,
                          const std::vector<SideFace>& on_sides) {
    std::vector<const WallFace*> faces;
    std::vector<Eigen::Vector2d> tolerances;
    for (const SideFace& on : on_sides) {
      faces.push_back(&faces_[on.face]);
      tolerances.push_back(ToleranceOf(faces_[on.face]));
    }
    if (!marginals_) {
      MarginalsOptions options;
      options.hold_gauge = true;
      marginals_.emplace(graph_, options);
    }
    const Vector2d along = axis.direction();
    const Vector2d across(-along.y(), along.x());
    if (existing != nullptr) {
      return CorridorModel(
          on_sides, FaceCovariance({existing}, faces, across, &*marginals_),
          std::move(tolerances));
    }
    return CorridorModel::OfNewCorridor(
        on_sides, FaceCovariance({}, faces, across, &*marginals_),
        std::move(tolerances));
  }

  // The corridor that two faces found.
  std::optional<Found> Complete(const CorridorAxis& axis, const Seed& seed) {
    ++tried_;
    const Interval first = axis.IntervalOf(faces_[seed.first].wall);
    const Interval second = axis.IntervalOf(faces_[seed.second].wall);
    const Interval common = {std::max(first.first, second.first),
                             std::min(first.second, second.second)};
    const std::size_t part = faces_[seed.first].part;
    const std::optional<Interval> reach = FreeReach(axis, common, faces_, part);
    if (!reach) {
      ++crossed_;
      return std::nullopt;
    }
    const std::vector<SideFace> gathered = Gather(axis, part, *reach, common);
    // A face that ends beyond a wall across is none of them.
    std::vector<std::size_t> first_faces;
    for (std::size_t k = 0; k < gathered.size(); ++k) {
      if (gathered[k].face == seed.first || gathered[k].face == seed.second) {
        first_faces.push_back(k);
      }
    }
    if (first_faces.size() < 2 || !IsCorridor(axis, gathered)) {
      ++not_long_;
      return std::nullopt;
    }
    CorridorModel model = MakeModel(nullptr, axis, gathered);
    Found found;
    found.part = part;
    found.faces = model.TieFitting(first_faces, options_.gate);
    if (!IsCorridor(axis, found.faces)) {
      ++not_long_;
      return std::nullopt;
    }
    const Eigen::Vector3d correction = model.Correction();
    found.axis = axis;
    found.axis.origin +=
        correction[0] * Vector2d(-axis.direction().y(), axis.direction().x());
    found.axis.angle = NormalizeAngle(axis.angle + correction[1]);
    found.axis.half_width += correction[2];
    if (!(found.axis.half_width > 0.0)) return std::nullopt;
    std::vector<Interval> intervals;
    for (const SideFace& on : found.faces) {
      intervals.push_back(found.axis.IntervalOf(faces_[on.face].wall));
    }
    found.interval = Hull(intervals);
    found.refused =
        static_cast<std::int64_t>(gathered.size() - found.faces.size());
    return found;
  }

  std::optional<Found> Extend(const Existing& corridor) {
    if (corridor.intervals.empty()) return std::nullopt;
    const Interval hull = Hull(corridor.intervals);
    const std::optional<Interval> reach =
        FreeReach(corridor.axis, hull, faces_, corridor.part);
    // What is there is not taken apart for a wall across.
    if (!reach) return std::nullopt;
    const std::vector<SideFace> gathered =
        Gather(corridor.axis, corridor.part, *reach, hull);
    if (gathered.empty()) return std::nullopt;
    CorridorModel model = MakeModel(corridor.feature, corridor.axis, gathered);
    Found found;
    found.existing = corridor.feature;
    found.part = corridor.part;
    found.faces = model.TieFitting({}, options_.gate);
    refused_ += static_cast<std::int64_t>(gathered.size() - found.faces.size());
    if (found.faces.empty()) return std::nullopt;
    for (const SideFace& on : found.faces) is_used_[on.face] = true;
    found.axis = corridor.axis;
    found.interval = hull;
    return found;
  }

  // The part of the graph that a corridor is in: that of any of its faces.
  std::size_t PartOf(const Feature& corridor) const {
    for (const ConstraintId id : graph_.ConstraintsOf(corridor.id)) {
      const Constraint& constraint = graph_.GetConstraint(id);
      if (!IsLiveStructure(constraint)) continue;
      for (const WallFace& face : faces_) {
        if (face.feature->id == constraint.features[0]) return face.part;
      }
    }
    return std::numeric_limits<std::size_t>::max();
  }

  const CorridorOptions& options_;
  const Graph& graph_;
  std::vector<WallFace> faces_;
  std::vector<bool> is_used_;
  // Made when first needed.
  std::optional<Marginals> marginals_;
  std::int64_t tried_ = 0;
  std::int64_t crossed_ = 0;
  std::int64_t not_long_ = 0;
  std::int64_t refused_ = 0;
};

CorridorSide SideOf(const Constraint& constraint) {
  return std::cos(constraint.expected[1]) >= 0.0 ? kRightSide : kLeftSide;
}

Existing ReadCorridor(const Graph& graph, const RelationType& relation,
                      const Feature& feature) {
  Existing corridor;
  corridor.feature = &feature;
  const Eigen::Vector3d frame = feature.type->frame(feature);
  corridor.axis.origin = frame.head<2>();
  corridor.axis.angle = frame[2];
  corridor.axis.half_width = feature.parameters[2];
  for (const ConstraintId id : graph.ConstraintsOf(feature.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (!IsLiveStructure(constraint) || constraint.type != &relation) continue;
    const std::optional<Wall> wall =
        WallOf(graph.GetFeature(constraint.features[0]));
    if (!wall) continue;
    corridor.intervals.push_back(corridor.axis.IntervalOf(*wall));
  }
  return corridor;
}

void Bind(ParameterBinder* parameters, CorridorOptions* options) {
  ParameterBinder& p = *parameters;
  constexpr double kNoLimit = ParameterBinder::kNoLimit;
  p.Length("sigma", &options->sigma, 1e-6, kNoLimit,
           "tolerance of a face across its side");
  p.Angle("sigma_deg", &options->sigma_angle, 1e-6, 90.0,
          "tolerance of its direction");
  p.Angle("own_direction_noise_deg", &options->own_direction_noise, 0.0, 90.0,
          "how far the visible part of a face of 1 m may be off its direction");
  p.Number("innovation_gate", &options->gate, 0.0, kNoLimit, "",
           "largest chi-square of the innovation of a face");
  p.Length("max_offset", &options->max_offset, 1e-6, kNoLimit,
           "how near to a side a face is looked at");
  p.Angle("max_turn_deg", &options->max_turn, 1e-6, 40.0,
          "the same in direction");
  p.Length("min_face", &options->min_face, 0.0, kNoLimit,
           "shortest face that is looked at");
  p.Length("min_facing", &options->min_facing, 1e-3, kNoLimit,
           "least length over which two faces that found a corridor lie "
           "opposite each other");
  p.Length("min_width", &options->min_width, 1e-3, kNoLimit,
           "narrowest corridor");
  p.Length("max_width", &options->max_width, options->min_width, kNoLimit,
           "widest corridor");
  p.Length("min_length", &options->min_length, 0.0, kNoLimit,
           "shortest corridor");
  p.Number("min_ratio", &options->min_ratio, 0.0, kNoLimit, "",
           "length of a corridor over its width, at least");
  p.Number("min_coverage", &options->min_coverage, 0.0, 1.0, "",
           "least part of each side that faces cover");
  p.Length("max_opening", &options->max_opening, 0.0, kNoLimit,
           "widest opening without a face on either side");
}

}  // namespace

CorridorDetector::CorridorDetector(const CorridorOptions& options)
    : options_(options) {}

const std::string& CorridorDetector::name() const {
  static const std::string name = kName;
  return name;
}

bool CorridorDetector::IsSupported(
    const std::vector<const Constraint*>& support) const {
  std::set<CorridorSide> sides;
  for (const Constraint* constraint : support) {
    sides.insert(SideOf(*constraint));
  }
  return sides.size() == 2;
}

Transaction CorridorDetector::Detect(const Graph& graph,
                                     const Registry& registry,
                                     const DetectionScope& scope) const {
  Transaction transaction;
  if (scope.features != nullptr) return transaction;
  std::vector<WallFace> faces =
      CollectWallFaces(graph, scope, options_.min_face);
  if (faces.empty()) return transaction;

  const FeatureType& type = registry.GetFeature(CorridorBlock::kName);
  const RelationType& relation = registry.GetRelation(SegmentCorridor::kName);
  CorridorSearch search(options_, graph, std::move(faces));
  std::vector<Existing> existing;
  for (const FeatureId id : graph.VirtualFeatures(scope.level + 1)) {
    const Feature& feature = graph.GetFeature(id);
    if (feature.type == &type) {
      existing.push_back(ReadCorridor(graph, relation, feature));
    }
    for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
      const Constraint& constraint = graph.GetConstraint(constraint_id);
      if (IsLiveStructure(constraint) && constraint.type == &relation) {
        search.SetUsed(constraint.features[0]);
      }
    }
  }
  for (const Found& found : search.Run(existing, scope)) {
    FeatureId id = kNoId;
    if (found.existing != nullptr) {
      id = found.existing->id;
    } else {
      Feature feature;
      feature.type = &type;
      feature.level = scope.level + 1;
      feature.is_virtual = true;
      // The axis passes through the anchor.
      feature.anchor = {found.axis.origin.x(), found.axis.origin.y()};
      feature.parameters = {0.0, found.axis.angle, found.axis.half_width};
      feature.extent_begin = found.interval.first;
      feature.extent_end = found.interval.second;
      feature.source = kName;
      id = transaction.AddFeature(std::move(feature));
    }
    for (const SideFace& on : found.faces) {
      const WallFace& face = search.face(on.face);
      const Vector2d tolerance = search.ToleranceOf(face);
      Constraint tie = MakeStructure(
          relation, {face.feature->id, id},
          Vector2d(0.0, CorridorSideDirection(on.side)),
          CorridorInformation(tolerance[0], tolerance[1],
                              CorridorSideDirection(on.side), on.along),
          kName);
      // What was accepted by its innovation goes at the same gate.
      tie.break_below = ChiSquarePValue(options_.gate, 2);
      transaction.AddConstraint(std::move(tie));
    }
  }
  return transaction;
}

DetectorType CorridorType() {
  DetectorType type;
  type.name = kName;
  type.description =
      "Corridors: faces that look at each other across free space, in line "
      "across doors";
  type.reads = {"segment"};
  type.makes = {"corridor"};
  SetParameters<CorridorOptions>(
      Bind,
      [](const CorridorOptions& options) {
        return std::make_unique<CorridorDetector>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
