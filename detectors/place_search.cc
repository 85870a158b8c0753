#include <plumbline/core/parallel_for.h>
#include <plumbline/detectors/place_search.h>
#include <plumbline/detectors/wall_ways.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;

// Places that are compared by all threads together, and between two questions
// whether to stop.
constexpr std::size_t kPlacesAtOnce = 128;
// Without candidates in searches of the least width those of so many times that
// are looked at before all others.
constexpr double kWiden = 6.0;
// A bound times this is one whatever was rounded.
constexpr double kOverRounding = 1.0 + 1e-9;

// How well an anchor is known in the frame of its part of the graph: standard
// deviations of the position (both coordinates together, m) and of the
// direction (rad).
struct AnchorSigma {
  double position = 0.0;
  double direction = 0.0;
};

class PlaceSearch {
 public:
  PlaceSearch(const WallGraph& walls, const SameWallOptions& options,
              const DetectionScope& scope, Marginals* marginals,
              ClosureCandidates* candidates)
      : walls_(walls),
        options_(options),
        scope_(scope),
        marginals_(*marginals),
        candidates_(*candidates),
        team_(ThreadsHere()),
        ways_(walls, options.place_links),
        parts_(ways_.Parts()),
        places_in_(parts_.size(), 0),
        places_(FindPlaces(walls, options)) {
    for (const WallPlace& place : places_) ++places_in_[parts_[place.anchor]];
  }

  // Wider searches are proposed once the narrower ones are done: what they
  // would find is not looked for before.
  void Run(double width) {
    MeasureAnchors();
    MeasureWaysFromFirst();
    FindPairs();
    double up_to = width;
    while (Compare(up_to) && candidates_.Widest(width) > up_to) {
      const double widest = candidates_.Widest(width);
      up_to = std::isfinite(widest) || up_to > width ? widest : kWiden * width;
    }
    scope_.Count("places", static_cast<std::int64_t>(places_.size()));
    scope_.Count("place pairs", totals_.pairs);
    scope_.Count("place pairs refused: one visit", totals_.same_visit);
    scope_.Count("place pairs refused: no way between them", totals_.no_way);
    scope_.Count("place pairs refused: out of reach", totals_.out_of_reach);
    scope_.Count("place pairs refused: no news", totals_.no_news);
    scope_.Count("place pairs refused: nothing fits", totals_.nothing_fits);
    scope_.Count("place pairs refused: ambiguous", totals_.ambiguous);
    scope_.Count("place pairs refused: too little evidence", totals_.weak);
    scope_.Count("place pairs refused: turn not known", totals_.turn_unknown);
    std::int64_t waiting = 0;
    for (const std::vector<Pair>& pairs : pairs_) {
      waiting += static_cast<std::int64_t>(pairs.size());
    }
    scope_.Count("place pairs refused: wider search than the narrowest",
                 waiting);
    scope_.Count("wall matches", matches_);
    scope_.Count("wall matches refused: contradicted", contradicted_);
    scope_.Count("wall matches refused: one already", one_already_);
  }

 private:
  // A place that explains the one that is compared.
  struct Found {
    std::size_t place;
    PlaceMatch match;
  };

  // Pairs of places, and why they were refused.
  struct Tally {
    std::int64_t pairs = 0;
    std::int64_t same_visit = 0;
    std::int64_t no_way = 0;
    std::int64_t out_of_reach = 0;
    std::int64_t no_news = 0;
    std::int64_t nothing_fits = 0;
    std::int64_t ambiguous = 0;
    std::int64_t weak = 0;
    std::int64_t turn_unknown = 0;

    Tally& operator+=(const Tally& o) {
      pairs += o.pairs;
      same_visit += o.same_visit;
      no_way += o.no_way;
      out_of_reach += o.out_of_reach;
      no_news += o.no_news;
      nothing_fits += o.nothing_fits;
      ambiguous += o.ambiguous;
      weak += o.weak;
      turn_unknown += o.turn_unknown;
      return *this;
    }
    void Count(PlaceMatch::Outcome outcome) {
      no_news += outcome == PlaceMatch::Outcome::kNoNews;
      nothing_fits += outcome == PlaceMatch::Outcome::kNothingFits;
      ambiguous += outcome == PlaceMatch::Outcome::kAmbiguous;
      weak += outcome == PlaceMatch::Outcome::kTooLittleEvidence;
      turn_unknown += outcome == PlaceMatch::Outcome::kTurnUnknown;
    }
  };

  // A place before this one that it is compared with.
  struct Pair {
    std::size_t place;
    // Length of the way between them, m.
    double way;
    // Half width, m, that a search has at least.
    double least;
  };

  // Of one place with those before it.
  struct alignas(kCacheLine) Comparison {
    std::vector<Found> found;
    Tally tally;
    WallWays::Search search;
  };

  // Calls `work(place, comparison)` for these places, by several threads, and
  // takes in what each found in their order; false when it is time to stop.
  template <typename Work>
  bool ForPlaces(const std::vector<std::size_t>& places, const Work& work) {
    comparisons_.resize(kPlacesAtOnce);
    for (std::size_t i = 0; i < places.size(); i += kPlacesAtOnce) {
      if (scope_.ShouldStop()) return false;
      const std::size_t count = std::min(kPlacesAtOnce, places.size() - i);
      team_.For(count, [&](std::size_t k) {
        comparisons_[k].found.clear();
        comparisons_[k].tally = Tally();
        work(places[i + k], &comparisons_[k]);
      });
      for (std::size_t k = 0; k < count; ++k) {
        const Comparison& comparison = comparisons_[k];
        totals_ += comparison.tally;
        for (const Found& one : comparison.found) {
          AddMatches(places_[places[i + k]], one, comparison.found);
        }
      }
    }
    return true;
  }

  void FindPairs() {
    pairs_.resize(places_.size());
    std::vector<std::size_t> all(places_.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    ForPlaces(all, [this](std::size_t index, Comparison* comparison) {
      pairs_[index] = PairsWithinReach(index, comparison);
    });
  }

  // Compares places in searches up to this half width, m; false when it is time
  // to stop. Comparisons change nothing; what they tell is taken in one by one.
  bool Compare(double widest) {
    std::vector<std::size_t> places;
    for (std::size_t index = 0; index < pairs_.size(); ++index) {
      const std::vector<Pair>& pairs = pairs_[index];
      if (std::any_of(pairs.begin(), pairs.end(),
                      [&](const Pair& pair) { return pair.least <= widest; })) {
        places.push_back(index);
      }
    }
    return ForPlaces(places, [&](std::size_t index, Comparison* comparison) {
      Match(index, widest, comparison);
      // What another place puts elsewhere is no match: all have a say.
      if (!comparison->found.empty()) {
        Match(index, std::numeric_limits<double>::infinity(), comparison);
        std::sort(
            comparison->found.begin(), comparison->found.end(),
            [](const Found& a, const Found& b) { return a.place < b.place; });
      }
    });
  }

  const PlaceWall& Anchor(std::size_t place) const {
    return walls_.wall(places_[place].anchor);
  }

  // Whether there is a way from this place to another.
  bool IsCompared(const WallPlace& place) const {
    return places_in_[parts_[place.anchor]] > 1;
  }

  // Of each place that is compared. From then on nobody asks for covariances
  // that are not known, which makes marginals_ safe to ask from several
  // threads.
  void MeasureAnchors() {
    std::vector<FeatureId> anchors(places_.size(), kNoId);
    std::vector<FeatureId> wanted;
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (!IsCompared(places_[p])) continue;
      anchors[p] = Anchor(p).id;
      wanted.push_back(anchors[p]);
    }
    marginals_.Compute(wanted);
    sigmas_.resize(places_.size());
    for (std::size_t p = 0; p < places_.size(); ++p) {
      if (anchors[p] == kNoId) continue;
      const Eigen::MatrixXd covariance = marginals_.Covariance(anchors[p]);
      sigmas_[p] = {
          std::sqrt(std::max(0.0, covariance(0, 0) + covariance(1, 1))),
          std::sqrt(std::max(0.0, covariance(2, 2)))};
    }
  }

  void MeasureWaysFromFirst() {
    ways_from_first_.assign(parts_.size(), 0.0);
    std::vector<bool> is_measured(parts_.size(), false);
    WallWays::Search search;
    for (const WallPlace& place : places_) {
      const std::size_t part = parts_[place.anchor];
      if (is_measured[part] || !IsCompared(place)) continue;
      is_measured[part] = true;
      const std::vector<double> ways =
          ways_.From(static_cast<int>(part), &search);
      for (std::size_t i = 0; i < ways.size(); ++i) {
        if (parts_[i] == part) ways_from_first_[i] = ways[i];
      }
    }
  }

  // Of either coordinate, beyond what the graph says, m^2.
  double AddedVariance(double way) const {
    const double drift = options_.drift_rate * way;
    return drift * drift +
           options_.least_position_sigma * options_.least_position_sigma;
  }

  // Covariance of a place's displacement in the axes of the map, from that of
  // its anchor seen from another of this heading.
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

  // No more than this is unknown of the second place's position seen from the
  // first, m: the relative position is a sum of what moves the second, what
  // moves the first, and what turns the first, and the deviation of a sum is
  // at most the sum of the deviations.
  double LargestSigma(std::size_t from, std::size_t to) const {
    const double distance =
        (Anchor(to).position - Anchor(from).position).norm();
    return sigmas_[from].position + sigmas_[to].position +
           distance * sigmas_[from].direction;
  }

  // Whether a place that is known like this may be the other, as far as their
  // distance tells.
  bool IsInReach(const WallPlace& own, const WallPlace& other,
                 double variance_of_position) const {
    return (other.center - own.center).norm() <=
           options_.match.gate *
                   std::sqrt(std::max(variance_of_position, 0.0)) +
               0.5 * options_.place_radius;
  }

  std::vector<PlaceWall> WallsOf(const WallPlace& place) const {
    std::vector<PlaceWall> walls;
    for (const int i : place.walls) walls.push_back(walls_.wall(i));
    return walls;
  }

  // The places before this one that it has to be compared with: each pair
  // once.
  std::vector<Pair> PairsWithinReach(std::size_t index,
                                     Comparison* comparison) const {
    const std::vector<std::size_t> others =
        PerhapsWithinReach(index, &comparison->tally);
    if (others.empty()) return {};
    std::vector<int> anchors;
    for (const std::size_t p : others) anchors.push_back(places_[p].anchor);
    const std::vector<double> ways =
        ways_.From(places_[index].anchor, anchors, &comparison->search);
    std::vector<Pair> pairs;
    for (const std::size_t p : others) {
      const double way = ways[places_[p].anchor];
      if (MayBeWithinReach(index, p, way))
        pairs.push_back({p, way, Least(way)});
    }
    comparison->tally.out_of_reach +=
        static_cast<std::int64_t>(others.size() - pairs.size());
    return pairs;
  }

  // A search is no narrower than this, m, after a way of this length, whatever
  // the graph says.
  double Least(double way) const {
    return (options_.match.gate * std::sqrt(AddedVariance(way)) +
            options_.match.tolerance) /
           kOverRounding;
  }

  // Whether one place may be the other, when the way between them is so long.
  bool MayBeWithinReach(std::size_t index, std::size_t p, double way) const {
    const double sigma = options_.covariance_scale * LargestSigma(index, p);
    return IsInReach(places_[index], places_[p],
                     sigma * sigma + 2.0 * AddedVariance(way));
  }

  // Places before this one, of other visits, that may be within reach if the
  // ways to them are as long as those by way of one wall: most are not, and no
  // way to them is looked for.
  std::vector<std::size_t> PerhapsWithinReach(std::size_t index,
                                              Tally* tally) const {
    const WallPlace& own = places_[index];
    const std::map<int, int> near =
        walls_.Within(own.anchor, options_.min_links - 1);
    std::vector<std::size_t> others;
    for (std::size_t p = 0; p < index; ++p) {
      ++tally->pairs;
      const int anchor = places_[p].anchor;
      if (near.count(anchor) > 0) {
        ++tally->same_visit;
        continue;
      }
      if (parts_[anchor] != parts_[own.anchor]) {
        ++tally->no_way;
        continue;
      }
      const double longest = kOverRounding * (ways_from_first_[own.anchor] +
                                              ways_from_first_[anchor]);
      if (!MayBeWithinReach(index, p, longest)) {
        ++tally->out_of_reach;
        continue;
      }
      others.push_back(p);
    }
    return others;
  }

  // Compares a place with those whose searches may be so narrow. They are done
  // with, but for those whose searches are wider.
  void Match(std::size_t index, double widest, Comparison* comparison) {
    std::vector<Pair> waiting;
    std::vector<Pair> pairs;
    for (const Pair& pair : pairs_[index]) {
      (pair.least <= widest ? pairs : waiting).push_back(pair);
    }
    if (pairs.empty()) return;
    std::vector<FeatureId> anchors;
    for (const Pair& pair : pairs) anchors.push_back(Anchor(pair.place).id);
    const std::vector<Matrix3d> covariances =
        marginals_.RelativeCovariances(Anchor(index).id, anchors);
    const std::vector<PlaceWall> own_walls = WallsOf(places_[index]);
    Tally& tally = comparison->tally;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const WallPlace& other = places_[pairs[k].place];
      const Matrix3d prior =
          Prior(covariances[k], Anchor(index).direction, pairs[k].way);
      if (!IsInReach(places_[index], other, prior(0, 0) + prior(1, 1))) {
        ++tally.out_of_reach;
        continue;
      }
      PlaceMatch match = MatchPlaces(own_walls, WallsOf(other),
                                     Anchor(pairs[k].place).position, prior,
                                     options_.match, widest);
      if (match.outcome == PlaceMatch::Outcome::kTooWide) {
        waiting.push_back(pairs[k]);
        waiting.back().least = match.search;
        continue;
      }
      tally.Count(match.outcome);
      if (!match.matches.empty()) {
        comparison->found.push_back({pairs[k].place, std::move(match)});
      }
    }
    pairs_[index] = std::move(waiting);
  }

  void AddMatches(const WallPlace& own, const Found& one,
                  const std::vector<Found>& found) {
    for (const WallMatch& match : one.match.matches) {
      ++matches_;
      const int i = own.walls[match.first];
      const int j = places_[one.place].walls[match.second];
      if (IsContradicted(walls_.wall(i), one, found)) {
        ++contradicted_;
      } else if (!candidates_.Add(i, j, match, one.match.search,
                                  one.match.evidence)) {
        ++one_already_;
      }
    }
  }

  // Another place that explains nearly as much puts the wall elsewhere.
  bool IsContradicted(const PlaceWall& wall, const Found& one,
                      const std::vector<Found>& found) const {
    const Vector2d normal(-std::sin(wall.direction), std::cos(wall.direction));
    return std::any_of(found.begin(), found.end(), [&](const Found& other) {
      return &other != &one &&
             other.match.evidence >
                 one.match.evidence - options_.match.rival_margin &&
             std::abs(
                 normal.dot((other.match.displacement - one.match.displacement)
                                .head<2>())) > options_.contradiction;
    });
  }

  const WallGraph& walls_;
  const SameWallOptions& options_;
  const DetectionScope& scope_;
  Marginals& marginals_;
  ClosureCandidates& candidates_;
  ThreadTeam team_;
  WallWays ways_;
  // Of each wall its part, and of each part its places.
  std::vector<std::size_t> parts_;
  std::vector<int> places_in_;
  // Of each wall of a part with places that are compared: length of the way to
  // the part's first wall, m.
  std::vector<double> ways_from_first_;
  std::vector<WallPlace> places_;
  std::vector<AnchorSigma> sigmas_;
  // Of each place, those that it was not compared with yet.
  std::vector<std::vector<Pair>> pairs_;
  std::vector<Comparison> comparisons_;

  Tally totals_;
  std::int64_t matches_ = 0;
  std::int64_t contradicted_ = 0;
  std::int64_t one_already_ = 0;
};

}  // namespace

std::vector<WallPlace> FindPlaces(const WallGraph& walls,
                                  const SameWallOptions& options) {
  std::vector<WallPlace> places;
  std::vector<std::vector<std::size_t>> places_of(
      static_cast<std::size_t>(walls.size()));
  for (int i = 0; i < walls.size(); ++i) {
    if (walls.Length(i) < options.min_length) continue;
    const Vector2d center = walls.Middle(i);
    const bool is_covered = std::any_of(
        places_of[i].begin(), places_of[i].end(), [&](std::size_t p) {
          return (places[p].center - center).norm() < options.place_spacing;
        });
    if (is_covered) continue;
    WallPlace place;
    place.anchor = i;
    place.center = center;
    for (const auto& entry : walls.Within(i, options.place_links)) {
      if (walls.Length(entry.first) < options.min_length ||
          walls.DistanceTo(entry.first, center) > options.place_radius) {
        continue;
      }
      place.walls.push_back(entry.first);
      places_of[entry.first].push_back(places.size());
    }
    places.push_back(std::move(place));
  }
  return places;
}

void ComparePlaces(const WallGraph& walls, const SameWallOptions& options,
                   double width, const DetectionScope& scope,
                   Marginals* marginals, ClosureCandidates* candidates) {
  PlaceSearch(walls, options, scope, marginals, candidates).Run(width);
}

}  // namespace plumbline
