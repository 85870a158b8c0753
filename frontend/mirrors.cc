#include <plumbline/frontend/beam_directions.h>
#include <plumbline/frontend/driven_way.h>
#include <plumbline/frontend/mirrors.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Once what was seen in mirrors is known more of them may be found: so often at
// most.
constexpr int kMostRounds = 4;
// Fewest returns of a wall that may be an image, and the largest share of them
// that were not seen across the line: something real may stand there as well.
constexpr std::size_t kFewestReturns = 20;
constexpr double kMostSeenOtherwise = 0.1;
// Share of it that the wall has before the mirror, and by how much this one may
// be longer than it was seen, m.
constexpr double kLeastOverlap = 0.5;
constexpr double kOverlapMargin = 0.2;
// Two walls one of which is so many times as long have its direction.
constexpr double kFarLonger = 3.0;
// How far beyond what was seen of the wall an end of the mirror may be, with
// wall beside it of this length, m.
constexpr double kFarthestEnd = 6.0;
constexpr double kLeastWallBeside = 0.2;
// Crossings of a line that are looked at first, and how many of them must be
// images with twice the tolerance.
constexpr std::size_t kFirstCrossings = 400;
constexpr double kFirstShare = 0.6;
// Lines are the same that are turned by no more, rad, lie no farther apart, m,
// and overlap.
constexpr double kSameTurn = DegToRad(0.5);
constexpr double kSameOffset = 0.03;
// The fit of a line: rounds, crossings beyond its ends that count, m, most
// crossings, and fewest that lie on a wall, within so many tolerances at first.
constexpr int kFitRounds = 3;
constexpr double kFitMargin = 0.5;
constexpr std::size_t kMostFitted = 3000;
constexpr int kFewestFitted = 20;
constexpr double kFirstTolerances = 1.5;
// Pieces of a line, m; fewest crossings of one that may be of a mirror, and the
// share of them that are images; most pieces in a row that are not.
constexpr double kPiece = 0.1;
constexpr int kFewestInPiece = 5;
constexpr double kPieceShare = 0.6;
constexpr int kMostMissing = 1;
// So far beside it hardly anything else was seen deeper than in a niche, m, as
// a share of what was seen in it.
constexpr double kBeside = 0.3;
constexpr double kDeeperThanNiche = 0.5;
constexpr double kMostBeside = 0.1;
// The wall beside it: how far it is looked for along and across, m, in pieces
// of this length, with so many returns in each that are not spread more across
// it, m. Pieces that it needs, and the share of them that may stand ahead of
// the mirror.
constexpr double kWallLength = 1.5;
constexpr double kWallDepth = 0.25;
constexpr double kWallPiece = 0.05;
constexpr std::size_t kFewestOnPiece = 2;
constexpr double kAcrossPiece = 0.12;
constexpr int kFewestPieces = 2;
constexpr double kMostAhead = 0.25;
// Largest share of returns on it, of beams that come from so far aside for each
// metre before it, m.
constexpr double kMostOnLine = 0.1;
constexpr double kOblique = 0.3;
// Largest share of looks out of it.
constexpr double kMostFromBehind = 0.03;
// Farther than this from its ends and its front nobody sees much in it, m.
constexpr double kFarthestLook = 20.0;
// Where else the image is compared, in tolerances.
constexpr double kAlong[] = {-18.0, -12.0, -7.0, -4.0, 4.0, 7.0, 12.0, 18.0};
constexpr double kAcross[] = {-6.0, -3.0, 3.0, 6.0};
// Beams so close beside a mirror are in it as well, m: the end is known so
// well.
constexpr double kEndMargin = 0.05;

Eigen::Vector2d Reflect(const Wall& line, const Eigen::Vector2d& place) {
  return place - 2.0 * line.Across(place) * line.normal();
}

// A line of which a part may be a mirror, seen from its left: the part that
// looks to one wall went through.
struct Candidate {
  Wall line;
  double weight = 0.0;
};

// A return seen across a line: where the look crosses it.
struct Crossing {
  Eigen::Vector2d origin;
  Eigen::Vector2d place;
  double along = 0.0;
  int cell = 0;
  bool is_image = false;
};

// Of the crossings within a part of a line.
struct Tally {
  int returns = 0;
  int images = 0;
  int confirmed = 0;
  int along[std::size(kAlong)] = {};
  int across[std::size(kAcross)] = {};
  std::set<std::pair<double, double>> origins;

  double Share(int count) const {
    return static_cast<double>(count) / std::max(1, returns);
  }
};

// The share of a beam's way, from `origin` to `place`, up to a mirror that it
// was reflected in; none when it was not.
std::optional<double> ShareBefore(const Mirror& mirror,
                                  const Eigen::Vector2d& origin,
                                  const Eigen::Vector2d& place,
                                  double min_depth) {
  const double before = mirror.wall.Across(origin);
  const double behind = -mirror.wall.Across(place);
  if (before <= 0.0 || behind < min_depth) return std::nullopt;
  const double share = before / (before + behind);
  const double along = mirror.wall.Along(origin + share * (place - origin));
  if (along < mirror.wall.begin - kEndMargin ||
      along > mirror.wall.end + kEndMargin) {
    return std::nullopt;
  }
  return share;
}

class MirrorFinder {
 public:
  MirrorFinder(const std::vector<Wall>& walls, const std::vector<Scan>& scans,
               const std::vector<Pose2>& poses, const MirrorOptions& options)
      : options_(options),
        returns_(walls, scans, poses, options.returns),
        poses_(poses),
        is_reflected_(returns_.returns().size(), false),
        seen_(returns_.num_cells(), 0) {
    for (const SampledReturns::Return& seen : returns_.returns()) {
      ++seen_[static_cast<std::size_t>(seen.cell)];
    }
  }

  std::vector<Mirror> Find(const std::function<bool()>& stop) {
    for (int round = 0; round < kMostRounds; ++round) {
      const std::size_t found = mirrors_.size();
      tried_.clear();
      for (const Candidate& candidate : FindCandidates()) {
        if (stop && stop()) return {};
        if (!IsKnown(candidate.line)) Check(candidate.line);
      }
      if (mirrors_.size() == found) break;
      MarkReflected();
    }
    std::stable_sort(
        mirrors_.begin(), mirrors_.end(),
        [](const Mirror& a, const Mirror& b) { return a.returns > b.returns; });
    return std::move(mirrors_);
  }

 private:
  // A look at a wall.
  struct Look {
    Eigen::Vector2d origin;
    Eigen::Vector2d place;
  };

  std::vector<std::vector<Look>> LooksByWall() const {
    std::vector<std::vector<Look>> looks(returns_.walls().size());
    for (const SampledReturns::View& view : returns_.views()) {
      for (std::size_t i = view.begin; i < view.end; ++i) {
        const SampledReturns::Return& seen = returns_.returns()[i];
        if (seen.wall < 0 || is_reflected_[i]) continue;
        looks[static_cast<std::size_t>(seen.wall)].push_back(
            {view.origin, seen.place});
      }
    }
    return looks;
  }

  // The lines about which one wall is the image of another, the ones of the
  // longest walls first.
  std::vector<Candidate> FindCandidates() const {
    std::vector<Candidate> candidates;
    const std::vector<std::vector<Look>> looks = LooksByWall();
    const std::vector<Wall>& walls = returns_.walls();
    for (std::size_t i = 0; i < walls.size(); ++i) {
      if (looks[i].size() < kFewestReturns) continue;
      for (const Wall& wall : walls) {
        if (!MayBeImage(walls[i], wall)) continue;
        Candidate candidate = {MiddleLine(walls[i], wall),
                               std::min(walls[i].length(), wall.length())};
        if (WereSeenAcross(looks[i], &candidate.line) &&
            HasWallBeside(candidate.line)) {
          candidates.push_back(std::move(candidate));
        }
      }
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) {
                       return a.weight > b.weight;
                     });
    return candidates;
  }

  // Whether a wall faces another one as its image would.
  bool MayBeImage(const Wall& image, const Wall& wall) const {
    if (image.direction.dot(wall.direction) > -std::cos(options_.max_turn)) {
      return false;
    }
    const double distance = wall.Across(image.Middle());
    if (distance < options_.min_distance || distance > options_.max_distance) {
      return false;
    }
    return Overlap(wall.IntervalOf(image),
                   {wall.begin - kOverlapMargin, wall.end + kOverlapMargin}) >=
           kLeastOverlap * image.length();
  }

  // The line about which they are images, seen from the wall's side.
  static Wall MiddleLine(const Wall& image, const Wall& wall) {
    Eigen::Vector2d direction = (image.direction - wall.direction).normalized();
    if (wall.length() > kFarLonger * image.length()) {
      direction = -wall.direction;
    } else if (image.length() > kFarLonger * wall.length()) {
      direction = image.direction;
    }
    const Eigen::Vector2d middle = image.Middle();
    return MakeWall(middle - 0.5 * wall.Across(middle) * wall.normal(),
                    std::atan2(direction.y(), direction.x()), 0.0, 0.0);
  }

  // Whether nearly all of the looks went through the line from its front: takes
  // its ends from them.
  static bool WereSeenAcross(const std::vector<Look>& looks, Wall* line) {
    std::size_t others = 0;
    std::vector<double> places;
    for (const Look& look : looks) {
      const double before = line->Across(look.origin);
      const double behind = -line->Across(look.place);
      if (before <= 0.0 || behind <= 0.0) {
        if (++others > kMostSeenOtherwise * looks.size()) return false;
        continue;
      }
      places.push_back(
          line->Along(look.origin +
                      before / (before + behind) * (look.place - look.origin)));
    }
    std::sort(places.begin(), places.end());
    const std::size_t strays = places.size() / 20;
    line->begin = places[strays];
    line->end = places[places.size() - 1 - strays];
    return true;
  }

  // Whether there may be a wall in line with it, on both sides.
  bool HasWallBeside(const Wall& line) const {
    return MeetsWall(line, line.begin, -1.0) && MeetsWall(line, line.end, 1.0);
  }

  bool MeetsWall(const Wall& line, double end, double side) const {
    const double step = options_.returns.cell_size;
    double length = 0.0;
    for (double beyond = 0.0; beyond < kFarthestEnd; beyond += step) {
      length = returns_.IsNear(line.At(end + side * beyond), step)
                   ? length + step
                   : 0.0;
      if (length >= kLeastWallBeside) return true;
    }
    return false;
  }

  bool IsKnown(const Wall& line) const {
    return std::any_of(tried_.begin(), tried_.end(), [&](const Wall& other) {
      return other.direction.dot(line.direction) >= std::cos(kSameTurn) &&
             std::abs(other.Across(line.Middle())) <= kSameOffset &&
             Overlap(other.IntervalOf(line), {other.begin, other.end}) >= 0.0;
    });
  }

  // Finds the mirrors that lie in the line about where it was looked through.
  void Check(Wall line) {
    std::vector<Crossing> crossings = CrossingsOf(line, kFirstCrossings);
    if (!MayReflect(line, crossings)) {
      tried_.push_back(line);
      return;
    }
    crossings = CrossingsOf(line, 0);
    Fit(crossings, &line);
    tried_.push_back(line);
    crossings = CrossingsOf(line, 0);
    MarkImages(line, &crossings);
    for (const Interval& opening : OpeningsOf(line, crossings)) {
      if (Overlap(opening, {line.begin, line.end}) < 0.0) continue;
      const std::optional<Mirror> mirror = MirrorIn(line, opening, crossings);
      if (mirror) Take(*mirror);
    }
  }

  // The looks across a line from its front, all or about `most` of them.
  std::vector<Crossing> CrossingsOf(const Wall& line, std::size_t most) const {
    std::size_t stride = 1;
    if (most > 0) {
      const std::size_t views = std::max<std::size_t>(1, most / 10);
      stride = std::max<std::size_t>(1, returns_.views().size() / views);
    }
    std::vector<Crossing> crossings;
    for (std::size_t v = 0; v < returns_.views().size(); v += stride) {
      const SampledReturns::View& view = returns_.views()[v];
      const double before = line.Across(view.origin);
      const double along = line.Along(view.origin);
      if (before <= 0.0 || before > kFarthestLook ||
          along < line.begin - kFarthestLook ||
          along > line.end + kFarthestLook) {
        continue;
      }
      for (std::size_t i = view.begin; i < view.end; ++i) {
        const SampledReturns::Return& seen = returns_.returns()[i];
        const double behind = -line.Across(seen.place);
        if (behind < options_.min_depth || is_reflected_[i]) continue;
        const double share = before / (before + behind);
        crossings.push_back({view.origin, seen.place,
                             along + share * (line.Along(seen.place) - along),
                             seen.cell, false});
      }
    }
    return crossings;
  }

  // A first look.
  bool MayReflect(const Wall& line,
                  const std::vector<Crossing>& crossings) const {
    int all = 0;
    int images = 0;
    for (const Crossing& crossing : crossings) {
      if (crossing.along < line.begin || crossing.along > line.end) continue;
      ++all;
      if (returns_.IsNear(Reflect(line, crossing.place),
                          2.0 * options_.tolerance)) {
        ++images;
      }
    }
    return images >= kFirstShare * all;
  }

  // Shifts and turns the line so that images lie on walls (least squares).
  void Fit(const std::vector<Crossing>& crossings, Wall* line) const {
    const double begin = line->begin - kFitMargin;
    const double end = line->end + kFitMargin;
    const std::size_t stride = 1 + crossings.size() / kMostFitted;
    double reach = kFirstTolerances * options_.tolerance;
    for (int round = 0; round < kFitRounds; ++round) {
      Eigen::Matrix2d information = 1e-6 * Eigen::Matrix2d::Identity();
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      int fitted = 0;
      for (std::size_t i = 0; i < crossings.size(); i += stride) {
        const Crossing& crossing = crossings[i];
        if (crossing.along < begin || crossing.along > end) continue;
        const Eigen::Vector2d image = Reflect(*line, crossing.place);
        const int number =
            returns_.WallAt(image, Reflect(*line, crossing.origin), reach);
        if (number < 0) continue;
        const Wall& wall = returns_.walls()[static_cast<std::size_t>(number)];
        // What a shift by 1 m and a turn by 1 rad do to the image.
        const Eigen::Vector2d arm = image - line->position;
        const Eigen::Vector2d slope(
            2.0 * wall.normal().dot(line->normal()),
            2.0 * wall.normal().dot(Eigen::Vector2d(-arm.y(), arm.x())));
        information += slope * slope.transpose();
        sum += wall.Across(image) * slope;
        ++fitted;
      }
      if (fitted < kFewestFitted) return;
      const Eigen::Vector2d change = -information.ldlt().solve(sum);
      *line = MakeWall(line->position + change[0] * line->normal(),
                       line->angle + change[1], line->begin, line->end);
      reach = options_.tolerance;
    }
  }

  void MarkImages(const Wall& line, std::vector<Crossing>* crossings) const {
    for (Crossing& crossing : *crossings) {
      crossing.is_image =
          returns_.IsNear(Reflect(line, crossing.place), options_.tolerance);
    }
  }

  // Parts of a line that were looked through at images.
  static std::vector<Interval> OpeningsOf(
      const Wall& line, const std::vector<Crossing>& crossings) {
    std::vector<Interval> openings;
    if (crossings.empty()) return openings;
    const double first = line.begin - 2.0 * kFarthestLook;
    const auto pieces = static_cast<std::size_t>(
        (line.length() + 4.0 * kFarthestLook) / kPiece + 1.0);
    std::vector<int> all(pieces, 0);
    std::vector<int> images(pieces, 0);
    for (const Crossing& crossing : crossings) {
      const double piece = std::floor((crossing.along - first) / kPiece);
      if (piece < 0.0 || piece >= static_cast<double>(pieces)) continue;
      ++all[static_cast<std::size_t>(piece)];
      if (crossing.is_image) ++images[static_cast<std::size_t>(piece)];
    }
    std::optional<std::size_t> last;
    for (std::size_t i = 0; i < pieces; ++i) {
      if (all[i] < kFewestInPiece || images[i] < kPieceShare * all[i]) continue;
      const double begin = first + static_cast<double>(i) * kPiece;
      if (!last || i - *last > kMostMissing + 1) {
        openings.emplace_back(begin, begin);
      }
      openings.back().second = begin + kPiece;
      last = i;
    }
    return openings;
  }

  // The ends of an opening as the images tell, which is finer than pieces.
  static Interval EndsOf(const Interval& opening,
                         const std::vector<Crossing>& crossings) {
    Interval ends(opening.second, opening.first);
    for (const Crossing& crossing : crossings) {
      if (!crossing.is_image || crossing.along < opening.first ||
          crossing.along > opening.second) {
        continue;
      }
      ends.first = std::min(ends.first, crossing.along);
      ends.second = std::max(ends.second, crossing.along);
    }
    return ends;
  }

  std::optional<Mirror> MirrorIn(const Wall& line, const Interval& opening,
                                 const std::vector<Crossing>& crossings) const {
    const Interval ends = EndsOf(opening, crossings);
    if (ends.second - ends.first < options_.min_width) return std::nullopt;
    const Tally tally = TallyOf(line, ends, crossings);
    if (!IsReflection(tally) || !EndsWithImages(line, ends, crossings) ||
        !LiesInWall(line, ends) || WasPassed(line, ends) ||
        WasSeenItself(line, ends, tally.returns) ||
        WasSeenFromBehind(line, ends, tally.returns)) {
      return std::nullopt;
    }
    Mirror mirror;
    mirror.wall = line;
    mirror.wall.begin = ends.first;
    mirror.wall.end = ends.second;
    mirror.returns = tally.returns;
    mirror.share = tally.Share(tally.images);
    return mirror;
  }

  Tally TallyOf(const Wall& line, const Interval& ends,
                const std::vector<Crossing>& crossings) const {
    std::vector<int> across_line(returns_.num_cells(), 0);
    for (const Crossing& crossing : crossings) {
      ++across_line[static_cast<std::size_t>(crossing.cell)];
    }
    Tally tally;
    for (const Crossing& crossing : crossings) {
      if (crossing.along < ends.first || crossing.along > ends.second) continue;
      ++tally.returns;
      if (crossing.is_image) ++tally.images;
      tally.origins.emplace(crossing.origin.x(), crossing.origin.y());
      const auto cell = static_cast<std::size_t>(crossing.cell);
      const int all = seen_[cell];
      const int others = all - across_line[cell];
      if (others >= 2 && 5 * others >= all) ++tally.confirmed;
      const Eigen::Vector2d image = Reflect(line, crossing.place);
      for (std::size_t i = 0; i < std::size(kAlong); ++i) {
        tally.along[i] += returns_.IsNear(
            image + kAlong[i] * options_.tolerance * line.direction,
            options_.tolerance);
      }
      for (std::size_t i = 0; i < std::size(kAcross); ++i) {
        tally.across[i] += returns_.IsNear(
            image + kAcross[i] * options_.tolerance * line.normal(),
            options_.tolerance);
      }
    }
    return tally;
  }

  // Whether what was seen is the image of what stands before it, and of nothing
  // else.
  bool IsReflection(const Tally& tally) const {
    const double share = tally.Share(tally.images);
    const auto drop = [&](const int* begin, const int* end) {
      return share - tally.Share(*std::max_element(begin, end));
    };
    return tally.returns >= options_.min_returns &&
           static_cast<int>(tally.origins.size()) >= options_.min_views &&
           share >= options_.min_share &&
           drop(std::begin(tally.along), std::end(tally.along)) >=
               options_.min_drop_along &&
           drop(std::begin(tally.across), std::end(tally.across)) >=
               options_.min_drop_across &&
           tally.Share(tally.confirmed) <= options_.max_confirmed;
  }

  // Whether the opening ends where the images end.
  static bool EndsWithImages(const Wall& line, const Interval& ends,
                             const std::vector<Crossing>& crossings) {
    int within = 0;
    int beside = 0;
    for (const Crossing& crossing : crossings) {
      const double off =
          std::max(ends.first - crossing.along, crossing.along - ends.second);
      if (off <= 0.0) ++within;
      if (off > kEndMargin && off <= kBeside && !crossing.is_image &&
          line.Across(crossing.place) < -kDeeperThanNiche) {
        ++beside;
      }
    }
    return beside <= kMostBeside * within;
  }

  // Whether a wall stands in its plane on both sides.
  bool LiesInWall(const Wall& line, const Interval& ends) const {
    return StandsBeside(line, ends.first, -1.0) &&
           StandsBeside(line, ends.second, 1.0);
  }

  bool StandsBeside(const Wall& line, double end, double side) const {
    std::vector<std::vector<double>> pieces(
        static_cast<std::size_t>(kWallLength / kWallPiece));
    for (const SampledReturns::View& view : returns_.views()) {
      if (line.Across(view.origin) <= 0.0) continue;
      for (std::size_t i = view.begin; i < view.end; ++i) {
        const Eigen::Vector2d& place = returns_.returns()[i].place;
        const double ahead = line.Across(place);
        if (std::abs(ahead) > kWallDepth || is_reflected_[i]) continue;
        const double piece = side * (line.Along(place) - end) / kWallPiece;
        if (piece < 0.0 || piece >= static_cast<double>(pieces.size())) {
          continue;
        }
        pieces[static_cast<std::size_t>(piece)].push_back(ahead);
      }
    }
    int in_plane = 0;
    int ahead = 0;
    for (std::vector<double>& piece : pieces) {
      if (piece.size() < kFewestOnPiece) continue;
      std::sort(piece.begin(), piece.end());
      const std::size_t strays = piece.size() / 10;
      const double nearest = piece[piece.size() - 1 - strays];
      if (nearest - piece[strays] > kAcrossPiece) {
        // The side of a niche, or a wall across, where the room ends.
        if (nearest > kAcrossPiece) break;
        continue;
      }
      const double middle = piece[piece.size() / 2];
      if (middle > options_.max_recess) {
        ++ahead;
      } else if (middle >= -options_.max_relief) {
        ++in_plane;
      }
    }
    return in_plane >= kFewestPieces &&
           ahead <= kMostAhead * (in_plane + ahead);
  }

  // Whether returns lie on it: a mirror shows itself from right before it only.
  bool WasSeenItself(const Wall& line, const Interval& ends,
                     int returns) const {
    int on_line = 0;
    for (const SampledReturns::View& view : returns_.views()) {
      const double before = line.Across(view.origin);
      if (before <= 0.0) continue;
      for (std::size_t i = view.begin; i < view.end; ++i) {
        const Eigen::Vector2d& place = returns_.returns()[i].place;
        if (std::abs(line.Across(place)) > options_.tolerance ||
            is_reflected_[i]) {
          continue;
        }
        const double along = line.Along(place);
        if (along > ends.first + kPiece && along < ends.second - kPiece &&
            std::abs(along - line.Along(view.origin)) > kOblique * before) {
          ++on_line;
        }
      }
    }
    return on_line > kMostOnLine * returns;
  }

  bool WasPassed(const Wall& line, const Interval& ends) const {
    return !DrivenWay(poses_)
                .Crossings(line.position, line.direction, ends.first,
                           ends.second)
                .empty();
  }

  bool WasSeenFromBehind(const Wall& line, const Interval& ends,
                         int returns) const {
    int looks = 0;
    for (const SampledReturns::View& view : returns_.views()) {
      const double behind = -line.Across(view.origin);
      if (behind < options_.min_depth) continue;
      for (std::size_t i = view.begin; i < view.end; ++i) {
        const Eigen::Vector2d& place = returns_.returns()[i].place;
        const double before = line.Across(place);
        if (before < options_.min_depth || is_reflected_[i]) continue;
        const double along = line.Along(
            view.origin + behind / (behind + before) * (place - view.origin));
        if (along > ends.first && along < ends.second) ++looks;
      }
    }
    return looks > kMostFromBehind * returns;
  }

  // Of two that overlap the one with more returns stays.
  void Take(const Mirror& mirror) {
    for (Mirror& other : mirrors_) {
      const bool is_same =
          std::abs(other.wall.direction.dot(mirror.wall.direction)) >=
              std::cos(options_.max_turn) &&
          std::abs(other.wall.Across(mirror.wall.Middle())) <=
              options_.min_depth &&
          Overlap(other.wall.IntervalOf(mirror.wall),
                  {other.wall.begin, other.wall.end}) > 0.0;
      if (!is_same) continue;
      if (mirror.returns > other.returns) other = mirror;
      return;
    }
    mirrors_.push_back(mirror);
  }

  // What was seen in the mirrors says nothing of what is there.
  void MarkReflected() {
    for (const SampledReturns::View& view : returns_.views()) {
      for (std::size_t i = view.begin; i < view.end; ++i) {
        const SampledReturns::Return& seen = returns_.returns()[i];
        if (is_reflected_[i] || !IsBehindAny(view.origin, seen.place)) continue;
        is_reflected_[i] = true;
        --seen_[static_cast<std::size_t>(seen.cell)];
      }
    }
  }

  bool IsBehindAny(const Eigen::Vector2d& origin,
                   const Eigen::Vector2d& place) const {
    return std::any_of(
        mirrors_.begin(), mirrors_.end(), [&](const Mirror& mirror) {
          return ShareBefore(mirror, origin, place, options_.min_depth)
              .has_value();
        });
  }

  const MirrorOptions& options_;
  const SampledReturns returns_;
  const std::vector<Pose2>& poses_;
  // By return: seen in a mirror that was found. By cell: returns that were not.
  std::vector<bool> is_reflected_;
  std::vector<int> seen_;
  // Lines that need not be looked at again.
  std::vector<Wall> tried_;
  std::vector<Mirror> mirrors_;
};

}  // namespace

std::vector<Mirror> FindMirrors(const std::vector<Wall>& walls,
                                const std::vector<Scan>& scans,
                                const std::vector<Pose2>& poses,
                                const MirrorOptions& options,
                                const std::function<bool()>& stop) {
  if (walls.size() < 2 || poses.empty()) return {};
  return MirrorFinder(walls, scans, poses, options).Find(stop);
}

std::vector<Scan> CutAtMirrors(const std::vector<Scan>& scans,
                               const std::vector<Pose2>& poses,
                               const std::vector<Mirror>& mirrors,
                               const MirrorOptions& options) {
  std::vector<Scan> cut = scans;
  BeamDirections beams;
  for (std::size_t i = 0; i < std::min(cut.size(), poses.size()); ++i) {
    Scan& scan = cut[i];
    const Pose2 laser = Compose(poses[i], scan.laser_offset);
    const PoseTransform transform(laser);
    const std::vector<Eigen::Vector2d>& directions = beams.Of(scan);
    for (std::size_t beam = 0; beam < directions.size(); ++beam) {
      const Eigen::Vector2d place = transform.Point(
          static_cast<double>(scan.ranges[beam]) * directions[beam]);
      double nearest = 1.0;
      for (const Mirror& mirror : mirrors) {
        nearest = std::min(nearest, ShareBefore(mirror, laser.head<2>(), place,
                                                options.min_depth)
                                        .value_or(1.0));
      }
      if (nearest < 1.0) {
        scan.ranges[beam] *= static_cast<float>(nearest);
      }
    }
  }
  return cut;
}

}  // namespace plumbline
