#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/factors/segment_segment_collinearity.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {

const char kSameWallRelation[] = "segment_segment_collinearity";

namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr char kName[] = "same_wall";
// Wider searches wait until the narrowest are done; this much wider is the
// same.
constexpr double kSameWidth = 1.5;
// Walls whose directions differ by more hold a place together in both
// directions, rad.
constexpr double kCrossing = DegToRad(20.0);

// Steps of the longest way between two neighbours.
constexpr double kStepsOfLongest = 16.0;

using Pair = std::pair<int, int>;

Pair Ordered(int i, int j) { return {std::min(i, j), std::max(i, j)}; }

Wall Geometry(const PlaceWall& wall) {
  return MakeWall(wall.position, wall.direction, wall.begin, wall.end);
}

// A wall pair to be proposed.
struct Proposal {
  Pair pair;
  // Point of the second wall at which offset and direction are independent.
  double along = 0.0;
  double search = 0.0;
  double evidence = 0.0;
};

struct Place {
  int anchor = -1;
  Vector2d center = Vector2d::Zero();
  std::vector<int> walls;
};

struct Way {
  int to = -1;
  double length = 0.0;  // m
};

// Everything that a call to Detect knows.
class Search {
 public:
  Search(const Graph& graph, const SameWallOptions& options)
      : graph_(graph),
        options_(options),
        marginals_(graph, MarginalsOptions{/*hold_gauge=*/true}) {
    for (const Feature* feature : graph.Features()) {
      if (feature->level != 0 || feature->type->name != "segment") continue;
      index_[feature->id] = static_cast<int>(walls_.size());
      PlaceWall wall;
      wall.id = feature->id;
      wall.position = {feature->parameters[0], feature->parameters[1]};
      wall.direction = feature->parameters[2];
      wall.begin = feature->extent_begin;
      wall.end = feature->extent_end;
      walls_.push_back(wall);
    }
    classes_ = std::make_unique<DisjointSets>(walls_.size());
    parts_ = std::make_unique<DisjointSets>(
        static_cast<std::size_t>(graph.feature_id_end()));
    ReadConstraints();
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      walls_[i].group = static_cast<int>(classes_->Find(i));
    }
    MakeWays();
    MakePlaces();
  }

  std::vector<Proposal> Run() {
    FindKnown();
    MeasureAnchors();
    for (std::size_t i = 0; i < places_.size(); ++i) ComparePlace(i);
    return Choose();
  }

  const PlaceWall& wall(int i) const { return walls_[i]; }

 private:
  void ReadConstraints() {
    links_.resize(walls_.size());
    for (const Constraint* constraint : graph_.Constraints()) {
      if (constraint->state == ConstraintState::kLive) {
        for (const FeatureId id : constraint->features) {
          parts_->Join(static_cast<std::size_t>(constraint->features[0]),
                       static_cast<std::size_t>(id));
        }
      }
      if (constraint->features.size() != 2) continue;
      const auto first = index_.find(constraint->features[0]);
      const auto second = index_.find(constraint->features[1]);
      if (first == index_.end() || second == index_.end()) continue;
      const int i = first->second;
      const int j = second->second;
      if (constraint->kind == ConstraintClass::kMeasurement) {
        if (constraint->state != ConstraintState::kLive) continue;
        const double way = (walls_[i].position - walls_[j].position).norm();
        links_[i].push_back({j, way});
        links_[j].push_back({i, way});
      } else if (constraint->type->name == kSameWallRelation) {
        if (constraint->state == ConstraintState::kLive) {
          classes_->Join(i, j);
          closures_.push_back({i, j});
        } else {
          broken_.insert(Ordered(i, j));
        }
      }
    }
    for (auto& links : links_) {
      std::sort(links.begin(), links.end());
      links.erase(std::unique(links.begin(), links.end(),
                              [](const auto& a, const auto& b) {
                                return a.first == b.first;
                              }),
                  links.end());
    }
  }

  double Length(int i) const { return walls_[i].end - walls_[i].begin; }

  Vector2d Middle(int i) const { return Geometry(walls_[i]).Middle(); }

  double DistanceTo(int i, const Vector2d& point) const {
    const Wall wall = Geometry(walls_[i]);
    const Vector2d relative = point - wall.position;
    const double t = std::clamp(wall.Along(point), wall.begin, wall.end);
    return (relative - t * wall.direction).norm();
  }

  // Walls up to `depth` measurement links away with the number of links,
  // itself included.
  std::map<int, int> Within(int wall, int depth) const {
    std::map<int, int> distance = {{wall, 0}};
    std::vector<int> frontier = {wall};
    for (int d = 1; d <= depth; ++d) {
      std::vector<int> next;
      for (const int i : frontier) {
        for (const auto& link : links_[i]) {
          if (distance.emplace(link.first, d).second) {
            next.push_back(link.first);
          }
        }
      }
      frontier = std::move(next);
    }
    return distance;
  }

  void MakePlaces() {
    std::vector<std::vector<std::size_t>> places_of(walls_.size());
    for (int i = 0; i < static_cast<int>(walls_.size()); ++i) {
      if (Length(i) < options_.min_length) continue;
      const Vector2d center = Middle(i);
      const bool is_covered = std::any_of(
          places_of[i].begin(), places_of[i].end(), [&](std::size_t p) {
            return (places_[p].center - center).norm() < options_.place_spacing;
          });
      if (is_covered) continue;
      Place place;
      place.anchor = i;
      place.center = center;
      for (const auto& entry : Within(i, options_.place_links)) {
        if (Length(entry.first) < options_.min_length ||
            DistanceTo(entry.first, center) > options_.place_radius) {
          continue;
        }
        place.walls.push_back(entry.first);
        places_of[entry.first].push_back(places_.size());
      }
      places_.push_back(std::move(place));
    }
  }

  // Whether the surroundings of two walls that are one have another wall in
  // common, across them: then nothing is free to move between the two visits.
  bool HoldsTwoDirections(const Pair& closure) const {
    std::multimap<std::size_t, int> crossing;
    for (const auto& entry : Within(closure.first, options_.place_links)) {
      const double turn =
          walls_[entry.first].direction - walls_[closure.first].direction;
      if (std::abs(std::sin(turn)) > std::sin(kCrossing)) {
        crossing.emplace(classes_->Find(entry.first), entry.first);
      }
    }
    for (const auto& entry : Within(closure.second, options_.place_links)) {
      const auto same = crossing.equal_range(classes_->Find(entry.first));
      if (std::any_of(same.first, same.second, [&](const auto& wall) {
            return wall.second != entry.first;
          })) {
        return true;
      }
    }
    return false;
  }

  void MakeWays() {
    std::vector<Pair> shortcuts;
    for (const Pair& closure : closures_) {
      if (!HoldsTwoDirections(closure)) continue;
      shortcuts.push_back(closure);
      shortcuts.push_back({closure.second, closure.first});
    }
    std::sort(shortcuts.begin(), shortcuts.end());
    auto shortcut = shortcuts.begin();
    ways_begin_ = {0};
    for (int i = 0; i < static_cast<int>(walls_.size()); ++i) {
      for (const auto& link : links_[i]) {
        ways_.push_back({link.first, link.second});
      }
      for (; shortcut != shortcuts.end() && shortcut->first == i; ++shortcut) {
        const int j = shortcut->second;
        ways_.push_back({j, (walls_[i].position - walls_[j].position).norm()});
      }
      ways_begin_.push_back(static_cast<int>(ways_.size()));
    }
    // In terms of the longest, so that steps are not many more than links.
    double longest = 0.0;
    for (const Way& way : ways_) longest = std::max(longest, way.length);
    if (longest > 0.0) way_step_ = longest / kStepsOfLongest;
  }

  // Way along measurement links from a wall to every other, m. Closures that
  // hold two directions are links too: the way round a loop that is closed adds
  // nothing to what its ends do not know of each other.
  std::vector<double> WaysFrom(int wall) {
    std::vector<double> ways(walls_.size(),
                             std::numeric_limits<double>::infinity());
    ways[wall] = 0.0;
    // Nearest first to a step: a heap's order costs more than the few ways that
    // are shortened once more.
    if (buckets_.empty()) buckets_.resize(1);
    buckets_[0].push_back({wall, 0.0});
    for (std::size_t b = 0; b < buckets_.size(); ++b) {
      // Grows while it is gone through.
      for (std::size_t k = 0; k < buckets_[b].size(); ++k) {
        const Way nearest = buckets_[b][k];
        if (nearest.length > ways[nearest.to]) continue;
        for (int w = ways_begin_[nearest.to]; w < ways_begin_[nearest.to + 1];
             ++w) {
          const Way way = {ways_[w].to, nearest.length + ways_[w].length};
          if (!(way.length < ways[way.to])) continue;
          ways[way.to] = way.length;
          const auto step = static_cast<std::size_t>(way.length / way_step_);
          if (step >= buckets_.size()) buckets_.resize(step + 1);
          buckets_[step].push_back(way);
        }
      }
      buckets_[b].clear();
    }
    return ways;
  }

  // Of either coordinate, beyond what the graph says, m^2.
  double AddedVariance(double way) const {
    const double drift = options_.drift_rate * way;
    return drift * drift +
           options_.least_position_sigma * options_.least_position_sigma;
  }

  Matrix3d Prior(const Matrix3d& relative, double heading, double way) const {
    const double c = std::cos(heading);
    const double s = std::sin(heading);
    Matrix3d rotation = Matrix3d::Identity();
    rotation.topLeftCorner<2, 2>() << c, -s, s, c;
    Matrix3d prior = options_.covariance_scale * options_.covariance_scale *
                     (rotation * relative * rotation.transpose());
    prior(0, 0) += AddedVariance(way);
    prior(1, 1) += AddedVariance(way);
    prior(2, 2) += options_.least_angle_sigma * options_.least_angle_sigma;
    return prior;
  }

  // How well each place that there is a way from to another is known in the
  // frame of its part of the graph.
  void MeasureAnchors() {
    DisjointSets reached(walls_.size());
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      for (int k = ways_begin_[i]; k < ways_begin_[i + 1]; ++k) {
        reached.Join(i, static_cast<std::size_t>(ways_[k].to));
      }
    }
    std::vector<int> places_in(walls_.size(), 0);
    for (const Place& place : places_) ++places_in[reached.Find(place.anchor)];
    std::vector<FeatureId> anchors(places_.size(), kNoId);
    std::vector<FeatureId> wanted;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (places_in[reached.Find(places_[p].anchor)] < 2) continue;
      anchors[p] = walls_[places_[p].anchor].id;
      wanted.push_back(anchors[p]);
    }
    marginals_.Compute(wanted);
    sigmas_.assign(places_.size(), {0.0, 0.0});
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (anchors[p] == kNoId) continue;
      const Eigen::MatrixXd covariance = marginals_.Covariance(anchors[p]);
      sigmas_[p] = {
          std::sqrt(std::max(0.0, covariance(0, 0) + covariance(1, 1))),
          std::sqrt(std::max(0.0, covariance(2, 2)))};
    }
  }

  // No more than this is unknown of the second place's position seen from the
  // first, m: the relative position is a sum of what moves the second, what
  // moves the first, and what turns the first, and the deviation of a sum is
  // at most the sum of the deviations.
  double LargestSigma(std::size_t from, std::size_t to) const {
    const double distance = (walls_[places_[to].anchor].position -
                             walls_[places_[from].anchor].position)
                                .norm();
    return sigmas_[from].first + sigmas_[to].first +
           distance * sigmas_[from].second;
  }

  // Whether a place that is known like this may be the other, as far as their
  // distance tells.
  bool IsInReach(const Place& own, const Place& other,
                 double variance_of_position) const {
    return (other.center - own.center).norm() <=
           options_.match.gate *
                   std::sqrt(std::max(variance_of_position, 0.0)) +
               0.5 * options_.place_radius;
  }

  void ComparePlace(std::size_t index) {
    const Place& own = places_[index];
    const std::map<int, int> near = Within(own.anchor, options_.min_links - 1);
    const std::vector<double> ways = WaysFrom(own.anchor);
    // Earlier places only: each pair once.
    std::vector<std::size_t> others;
    std::vector<FeatureId> anchors;
    for (std::size_t p = 0; p < index; ++p) {
      if (near.count(places_[p].anchor) > 0) continue;
      const double way = ways[places_[p].anchor];
      if (!std::isfinite(way)) continue;
      const double sigma = options_.covariance_scale * LargestSigma(index, p);
      if (!IsInReach(own, places_[p],
                     sigma * sigma + 2.0 * AddedVariance(way))) {
        continue;
      }
      others.push_back(p);
      anchors.push_back(walls_[places_[p].anchor].id);
    }
    if (others.empty()) return;
    const std::vector<Matrix3d> covariances =
        marginals_.RelativeCovariances(walls_[own.anchor].id, anchors);

    std::vector<PlaceWall> own_walls;
    for (const int i : own.walls) own_walls.push_back(walls_[i]);
    struct Found {
      std::size_t place;
      PlaceMatch match;
    };
    std::vector<Found> found;
    for (std::size_t k = 0; k < others.size(); ++k) {
      const Place& other = places_[others[k]];
      const Matrix3d prior = Prior(covariances[k], walls_[own.anchor].direction,
                                   ways[other.anchor]);
      if (!IsInReach(own, other, prior(0, 0) + prior(1, 1))) continue;
      std::vector<PlaceWall> other_walls;
      for (const int i : other.walls) other_walls.push_back(walls_[i]);
      PlaceMatch match =
          MatchPlaces(own_walls, other_walls, walls_[other.anchor].position,
                      prior, options_.match);
      if (!match.matches.empty()) {
        found.push_back({others[k], std::move(match)});
      }
    }
    for (const Found& one : found) {
      for (const WallMatch& match : one.match.matches) {
        const int i = own.walls[match.first];
        const int j = places_[one.place].walls[match.second];
        const Vector2d normal(-std::sin(walls_[i].direction),
                              std::cos(walls_[i].direction));
        const bool is_contradicted =
            std::any_of(found.begin(), found.end(), [&](const Found& other) {
              return &other != &one &&
                     other.match.evidence >
                         one.match.evidence - options_.match.rival_margin &&
                     std::abs(normal.dot(
                         (other.match.displacement - one.match.displacement)
                             .head<2>())) > options_.contradiction;
            });
        if (is_contradicted) continue;
        Propose(i, j, match, one.match.search, one.match.evidence);
      }
    }
  }

  void Propose(int i, int j, const WallMatch& match, double search,
               double evidence) {
    if (i == j || classes_->Find(i) == classes_->Find(j)) return;
    Proposal proposal;
    proposal.pair = Ordered(i, j);
    proposal.along = match.along;
    if (proposal.pair.second != j) {
      // The point given along the second wall, found on the other.
      proposal.along =
          Geometry(walls_[i]).Along(Geometry(walls_[j]).At(match.along));
    }
    proposal.search = search;
    proposal.evidence = evidence;
    const auto inserted = proposals_.emplace(proposal.pair, proposal);
    Proposal& there = inserted.first->second;
    if (search < there.search ||
        (search == there.search && evidence > there.evidence)) {
      there = proposal;
    }
  }

  // Walls whose relative place is known well and that lie on each other.
  void FindKnown() {
    // Neighbours by a grid.
    constexpr double kCell = 4.0;
    std::map<std::pair<long, long>, std::vector<int>> grid;
    const auto cell = [](const Vector2d& point) {
      return std::make_pair(std::lround(point.x() / kCell),
                            std::lround(point.y() / kCell));
    };
    std::vector<std::set<std::pair<long, long>>> cells(walls_.size());
    for (int i = 0; i < static_cast<int>(walls_.size()); ++i) {
      if (Length(i) < options_.min_length) continue;
      const Wall wall = Geometry(walls_[i]);
      for (double t = wall.begin;; t += 0.5 * kCell) {
        cells[i].insert(cell(wall.At(std::min(t, wall.end))));
        if (t >= wall.end) break;
      }
      for (const auto& key : cells[i]) grid[key].push_back(i);
    }
    for (int i = 0; i < static_cast<int>(walls_.size()); ++i) {
      std::set<int> near;
      for (const auto& key : cells[i]) {
        for (const int j : grid[key]) {
          if (j > i) near.insert(j);
        }
      }
      std::vector<FeatureId> others;
      std::vector<WallMatch> matches;
      std::vector<int> indices;
      for (const int j : near) {
        WallMatch match;
        if (!LieOnEachOther(walls_[i], walls_[j], &match)) continue;
        if (classes_->Find(i) == classes_->Find(j) ||
            parts_->Find(static_cast<std::size_t>(walls_[i].id)) !=
                parts_->Find(static_cast<std::size_t>(walls_[j].id))) {
          continue;
        }
        others.push_back(walls_[j].id);
        indices.push_back(j);
        matches.push_back(match);
      }
      if (others.empty()) continue;
      const std::vector<Matrix3d> covariances =
          marginals_.RelativeCovariances(walls_[i].id, others);
      for (std::size_t k = 0; k < others.size(); ++k) {
        // Of the second wall's point at the middle of the common part.
        const double turn = walls_[indices[k]].direction - walls_[i].direction;
        const Vector3d across(0.0, 1.0, matches[k].along * std::cos(turn));
        const double sigma =
            std::sqrt(std::max(0.0, across.dot(covariances[k] * across)));
        if (options_.covariance_scale * sigma > options_.known_sigma) continue;
        Propose(i, indices[k], matches[k], 0.0, matches[k].overlap);
      }
    }
  }

  bool LieOnEachOther(const PlaceWall& first, const PlaceWall& second,
                      WallMatch* match) const {
    const double angle = NormalizeAngle(second.direction - first.direction);
    const auto noise = [&](const PlaceWall& wall) {
      const double length = std::max(wall.end - wall.begin, 0.1);
      const double sigma =
          options_.match.direction_noise / (length * std::sqrt(length));
      return sigma * sigma;
    };
    const double tolerance = options_.match.angle_tolerance;
    if (std::abs(angle) >
        options_.match.gate *
            std::sqrt(tolerance * tolerance + noise(first) + noise(second))) {
      return false;
    }
    const Wall one = Geometry(first);
    const Wall other = Geometry(second);
    const Interval interval = one.IntervalOf(other);
    const double low = std::max(one.begin, interval.first);
    const double high = std::min(one.end, interval.second);
    if (high - low < options_.match.min_overlap) return false;
    match->overlap = high - low;
    match->along = (0.5 * (low + high) - one.Along(other.position)) /
                   one.direction.dot(other.direction);
    match->offset = one.normal().dot(other.position - one.position +
                                     match->along * other.direction);
    return std::abs(match->offset) <= options_.known_offset;
  }

  std::vector<Proposal> Choose() {
    double narrowest = std::numeric_limits<double>::infinity();
    for (const auto& entry : proposals_) {
      if (broken_.count(entry.first) > 0) continue;
      narrowest = std::min(narrowest, entry.second.search);
    }
    const double widest =
        std::max(options_.match.narrow + options_.match.tolerance,
                 kSameWidth * narrowest);
    std::vector<Proposal> chosen;
    for (const auto& entry : proposals_) {
      if (entry.second.search <= widest) chosen.push_back(entry.second);
    }
    std::stable_sort(chosen.begin(), chosen.end(),
                     [](const Proposal& a, const Proposal& b) {
                       return a.evidence > b.evidence;
                     });
    // One constraint is enough to make two classes one.
    std::vector<Proposal> needed;
    for (const Proposal& proposal : chosen) {
      if (broken_.count(proposal.pair) > 0 ||
          classes_->Join(proposal.pair.first, proposal.pair.second)) {
        needed.push_back(proposal);
      }
    }
    return needed;
  }

  const Graph& graph_;
  const SameWallOptions& options_;
  Marginals marginals_;
  std::vector<PlaceWall> walls_;
  std::map<FeatureId, int> index_;
  // Of each wall the walls that measurements tie it to and how far they are.
  std::vector<std::vector<std::pair<int, double>>> links_;
  // The same with the closures that lead from one place to another, one wall's
  // after the other's.
  std::vector<Way> ways_;
  std::vector<int> ways_begin_;
  // Of the search for ways: those of each step of their length, m.
  double way_step_ = 1.0;
  std::vector<std::vector<Way>> buckets_;
  std::vector<Pair> closures_;
  std::set<Pair> broken_;
  // Walls that closures make one, and features that anything connects, by id.
  std::unique_ptr<DisjointSets> classes_;
  std::unique_ptr<DisjointSets> parts_;
  std::vector<Place> places_;
  // By place, of its anchor: standard deviations of the position (both
  // coordinates together, m) and of the direction (rad).
  std::vector<std::pair<double, double>> sigmas_;
  std::map<Pair, Proposal> proposals_;
};

}  // namespace

SameWall::SameWall(const SameWallOptions& options) : options_(options) {}

const std::string& SameWall::name() const {
  static const std::string name = kName;
  return name;
}

Transaction SameWall::Detect(const Graph& graph, const Registry& registry,
                             const DetectionScope& scope) const {
  Transaction transaction;
  if (scope.features != nullptr || scope.level != 0) return transaction;
  Search search(graph, options_);
  for (const Proposal& proposal : search.Run()) {
    const PlaceWall& first = search.wall(proposal.pair.first);
    const PlaceWall& second = search.wall(proposal.pair.second);
    Constraint constraint;
    constraint.type = &registry.GetRelation(kSameWallRelation);
    constraint.features = {first.id, second.id};
    constraint.expected = Eigen::VectorXd::Zero(2);
    constraint.information = CollinearityInformation(
        options_.sigma_offset, options_.sigma_angle, proposal.along);
    constraint.kind = ConstraintClass::kStructure;
    constraint.source = kName;
    transaction.AddConstraint(std::move(constraint));
  }
  return transaction;
}

DetectorType SameWallType() {
  const SameWallOptions defaults;
  DetectorType type;
  type.name = kName;
  type.description =
      "Loop closures: segments of different visits that are one wall, matched "
      "place by place in agreement on one displacement";
  type.reads = {"segment"};
  type.defaults = {
      {"sigma_offset", defaults.sigma_offset},
      {"sigma_angle_deg", RadToDeg(defaults.sigma_angle)},
      {"min_length", defaults.min_length},
      {"place_links", static_cast<double>(defaults.place_links)},
      {"place_radius", defaults.place_radius},
      {"place_spacing", defaults.place_spacing},
      {"min_links", static_cast<double>(defaults.min_links)},
      {"covariance_scale", defaults.covariance_scale},
      {"drift_rate", defaults.drift_rate},
      {"known_sigma", defaults.known_sigma},
      {"known_offset", defaults.known_offset},
      {"contradiction", defaults.contradiction},
      {"gate_sigmas", defaults.match.gate},
      {"tolerance", defaults.match.tolerance},
      {"angle_tolerance_deg", RadToDeg(defaults.match.angle_tolerance)},
      {"direction_noise_deg", RadToDeg(defaults.match.direction_noise)},
      {"min_overlap", defaults.match.min_overlap},
      {"narrow", defaults.match.narrow},
      {"min_evidence", defaults.match.min_evidence},
      {"rival_margin", defaults.match.rival_margin},
      {"rival_offset", defaults.match.rival_offset},
  };
  type.make = [known = type.defaults](const DetectorParameters& given) {
    const ParameterReader reader(kName, known, given);
    SameWallOptions options;
    options.sigma_offset = reader.Get("sigma_offset", 1e-6, 10.0);
    options.sigma_angle = DegToRad(reader.Get("sigma_angle_deg", 1e-6, 90.0));
    options.min_length = reader.Get("min_length", 0.0);
    options.place_links = reader.GetInt("place_links", 1);
    options.place_radius = reader.Get("place_radius", 0.1);
    options.place_spacing = reader.Get("place_spacing", 0.0);
    options.min_links = reader.GetInt("min_links", 1);
    options.covariance_scale = reader.Get("covariance_scale", 1e-3, 1e3);
    options.drift_rate = reader.Get("drift_rate", 0.0, 1.0);
    options.known_sigma = reader.Get("known_sigma", 0.0);
    options.known_offset = reader.Get("known_offset", 0.0);
    options.contradiction = reader.Get("contradiction", 0.0);
    options.match.gate = reader.Get("gate_sigmas", 0.1, 100.0);
    options.match.tolerance = reader.Get("tolerance", 1e-3, 10.0);
    options.match.angle_tolerance =
        DegToRad(reader.Get("angle_tolerance_deg", 1e-3, 45.0));
    options.match.direction_noise =
        DegToRad(reader.Get("direction_noise_deg", 0.0, 45.0));
    options.match.min_overlap = reader.Get("min_overlap", 0.0);
    options.match.narrow = reader.Get("narrow", 0.0);
    options.match.min_evidence = reader.Get("min_evidence");
    options.match.rival_margin = reader.Get("rival_margin", 0.0);
    options.match.rival_offset = reader.Get("rival_offset", 0.0);
    return std::make_unique<SameWall>(options);
  };
  return type;
}

}  // namespace plumbline
