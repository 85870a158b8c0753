#include <plumbline/core/error.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/place_match.h>
#include <plumbline/factors/solve_symmetric.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Walls in line to this (m) and within this angle are one line.
constexpr double kSameLineOffset = 0.15;
constexpr double kSameLineAngle = DegToRad(3.0);
// Lines whose directions differ by less tell of the same direction of the
// displacement.
constexpr double kParallel = DegToRad(20.0);
// A line counts in full from this length on, m.
constexpr double kFullLength = 1.0;
// A wall in conflict costs as much, nats.
constexpr double kConflict = 1.0;
// Wall whose direction differs more cannot hide the other, rad.
constexpr double kConflictAngle = DegToRad(10.0);
// Of two candidates for a wall the worse is left out when it is farther off by
// more, m.
constexpr double kClearlyWorse = 0.03;
constexpr int kRefinements = 3;
constexpr int kSolverRounds = 2;
// Displacements this close are one, m.
constexpr double kCell = 0.03;

// A wall of one of the two places, with what its comparison needs.
struct ComparedWall : Wall {
  double noise = 0.0;
  int group = -1;
};

ComparedWall Prepare(const PlaceWall& wall, const PlaceMatchOptions& options) {
  ComparedWall prepared;
  static_cast<Wall&>(prepared) =
      MakeWall(wall.position, wall.direction, wall.begin, wall.end);
  prepared.group = wall.group;
  const double length = std::max(wall.end - wall.begin, 0.1);
  prepared.noise = options.direction_noise / (length * std::sqrt(length));
  return prepared;
}

// Moves walls by one displacement.
class Mover {
 public:
  Mover(const Vector2d& pivot, const Vector3d& displacement)
      : pivot_(pivot), displacement_(displacement) {
    const double c = std::cos(displacement[2]);
    const double s = std::sin(displacement[2]);
    rotation_ << c, -s, s, c;
  }

  ComparedWall Move(const ComparedWall& wall) const {
    ComparedWall moved = wall;
    moved.position =
        pivot_ + rotation_ * (wall.position - pivot_) + displacement_.head<2>();
    moved.direction = rotation_ * wall.direction;
    moved.angle = wall.angle + displacement_[2];
    return moved;
  }

 private:
  Vector2d pivot_;
  Vector3d displacement_;
  Eigen::Matrix2d rotation_;
};

// Cells of displacements, in an open table: there are some hundred for a pair
// of places, and most are asked for more than once.
class DisplacementCells {
 public:
  using Cell = std::array<long, 3>;

  // False when it is there already.
  bool Insert(const Cell& cell) {
    if (2 * (size_ + 1) > slots_.size()) Grow();
    Slot& slot = slots_[PlaceOf(cell)];
    if (slot.is_taken) return false;
    slot = {cell, true};
    ++size_;
    return true;
  }

 private:
  struct Slot {
    Cell cell;
    bool is_taken = false;
  };
  static constexpr std::size_t kFewest = 256;

  std::size_t PlaceOf(const Cell& cell) const {
    constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;
    std::uint64_t hash = 0;
    for (const long part : cell) {
      hash = (hash ^ static_cast<std::uint64_t>(part)) * kGolden;
      hash ^= hash >> 32;
    }
    // As many as a power of two.
    const std::size_t mask = slots_.size() - 1;
    std::size_t place = static_cast<std::size_t>(hash) & mask;
    while (slots_[place].is_taken && slots_[place].cell != cell) {
      place = (place + 1) & mask;
    }
    return place;
  }

  void Grow() {
    std::vector<Slot> old(std::max(kFewest, 2 * slots_.size()));
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.is_taken) slots_[PlaceOf(slot.cell)] = slot;
    }
  }

  std::vector<Slot> slots_;
  std::size_t size_ = 0;
};

// How `second` lies beside `first`.
struct Comparison {
  double overlap;  // m, negative for a gap
  double middle;   // of the overlap, m along the first
  double offset;   // of the second at the middle, to the left of the first
  double angle;
  // Along the second.
  double second_middle;
};

// Direction of the second against the first.
double Turn(const ComparedWall& first, const ComparedWall& second) {
  return NormalizeAngle(second.angle - first.angle);
}

Comparison Compare(const ComparedWall& first, const ComparedWall& second) {
  Comparison c;
  c.angle = Turn(first, second);
  const double from = first.Along(second.At(second.begin));
  const double to = first.Along(second.At(second.end));
  const double low = std::max(first.begin, std::min(from, to));
  const double high = std::min(first.end, std::max(from, to));
  c.overlap = high - low;
  c.middle = 0.5 * (low + high);
  const double cosine = first.direction.dot(second.direction);
  const double reference = first.Along(second.position);
  c.second_middle =
      std::abs(cosine) > 0.1 ? (c.middle - reference) / cosine : 0.0;
  c.offset = first.Across(second.At(c.second_middle));
  return c;
}

class Matcher {
 public:
  Matcher(const std::vector<PlaceWall>& first,
          const std::vector<PlaceWall>& second, const Vector2d& pivot,
          const Matrix3d& covariance, const PlaceMatchOptions& options)
      : options_(options),
        pivot_(pivot),
        covariance_(covariance),
        prior_(covariance.inverse()) {
    for (const PlaceWall& wall : first)
      first_.push_back(Prepare(wall, options));
    for (const PlaceWall& wall : second) {
      second_.push_back(Prepare(wall, options));
    }
    FindCandidates();
  }

  PlaceMatch Match(double widest) {
    PlaceMatch result;
    result.outcome = candidates_.empty() ? PlaceMatch::Outcome::kNothingFits
                                         : PlaceMatch::Outcome::kNoNews;
    if (!has_news_) return result;
    if (covariance_(2, 2) > options_.max_turn * options_.max_turn) {
      result.outcome = PlaceMatch::Outcome::kTurnUnknown;
      return result;
    }
    const double narrowest = NarrowestRange();
    if (narrowest > widest) {
      result.outcome = PlaceMatch::Outcome::kTooWide;
      result.search = narrowest;
      return result;
    }
    MeasureCandidates();
    const std::vector<bool> is_paired = WallsToPair();
    Try(Vector3d::Zero());
    std::vector<char> crosses;
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      Try(Solve(std::array<Candidate, 1>{candidates_[i]}));
      if (!is_paired[candidates_[i].second]) continue;
      if (crosses.empty()) crosses = CrossingWalls();
      const std::size_t row = candidates_[i].first * first_.size();
      for (std::size_t j = 0; j < i; ++j) {
        if (!is_paired[candidates_[j].second]) continue;
        if (crosses[row + candidates_[j].first] == 0) continue;
        if (candidates_[i].second == candidates_[j].second) continue;
        Try(Solve(std::array<Candidate, 2>{candidates_[i], candidates_[j]}));
      }
    }
    result.outcome = PlaceMatch::Outcome::kNothingFits;
    if (hypotheses_.empty()) return result;
    std::size_t best = 0;
    for (std::size_t i = 1; i < hypotheses_.size(); ++i) {
      if (hypotheses_[i].worth > hypotheses_[best].worth) best = i;
    }
    return Conclude(best);
  }

 private:
  struct Candidate {
    int first;
    int second;
  };
  struct Line {
    // Of the second place.
    int wall;
    double overlap = 0.0;
    // log of the inverse chance of a hit, nats, and half width of the search.
    double gain = 0.0;
    double range = 0.0;
  };
  struct Hypothesis {
    Vector3d displacement;
    double worth;
  };
  struct Explanation {
    std::vector<WallMatch> matches;
    // Best match of each wall: candidate for the refinement.
    std::vector<Candidate> best;
    double worth = 0.0;
  };

  double AngleGate(const ComparedWall& a, const ComparedWall& b,
                   double variance) const {
    return options_.gate *
           std::sqrt(variance +
                     options_.angle_tolerance * options_.angle_tolerance +
                     a.noise * a.noise + b.noise * b.noise);
  }

  // Half width of the search for a wall at `point` in direction `unit`.
  double Range(const Vector2d& unit, const Vector2d& point) const {
    const Vector2d lever = point - pivot_;
    const Vector3d jacobian(unit.x(), unit.y(),
                            unit.dot(Vector2d(-lever.y(), lever.x())));
    return options_.gate *
           std::sqrt(std::max(0.0, jacobian.dot(covariance_ * jacobian)));
  }

  void FindCandidates() {
    ranges_.resize(second_.size());
    rivals_.resize(second_.size());
    by_second_.resize(second_.size());
    first_candidate_.resize(second_.size());
    for (std::size_t j = 0; j < second_.size(); ++j) {
      const ComparedWall& wall = second_[j];
      const Vector2d middle = wall.Middle();
      const double across = Range(wall.normal(), middle) + options_.tolerance;
      const double along = Range(wall.direction, middle);
      ranges_[j] = across;
      first_candidate_[j] = candidates_.size();
      std::vector<double> offsets;
      for (std::size_t i = 0; i < first_.size(); ++i) {
        if (std::abs(Turn(first_[i], wall)) >
            AngleGate(first_[i], wall, covariance_(2, 2))) {
          continue;
        }
        const Comparison c = Compare(first_[i], wall);
        if (c.overlap + along < options_.min_overlap) continue;
        const Vector2d to_first = first_[i].position - middle;
        const double offset = -first_[i].normal().dot(to_first);
        if (std::abs(offset) > across) continue;
        by_second_[j].push_back(static_cast<int>(i));
        candidates_.push_back({static_cast<int>(i), static_cast<int>(j)});
        has_news_ =
            has_news_ || wall.group < 0 || wall.group != first_[i].group;
        offsets.push_back(offset);
      }
      // Different lines among them.
      std::sort(offsets.begin(), offsets.end());
      int lines = 0;
      double last = 0.0;
      for (const double offset : offsets) {
        if (lines == 0 || offset - last > kSameLineOffset) {
          ++lines;
          last = offset;
        }
      }
      rivals_[j] = std::max(1, lines);
    }
  }

  // Of the walls that have candidates; no match is found in a narrower search.
  double NarrowestRange() const {
    double narrowest = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < second_.size(); ++j) {
      if (!by_second_[j].empty()) narrowest = std::min(narrowest, ranges_[j]);
    }
    return narrowest;
  }

  // Walls of the second place whose candidates are tried two at a time: all, or
  // the longest where that would be too many. What explains such a wall and
  // rivals of it are tried alike.
  std::vector<bool> WallsToPair() const {
    std::vector<std::size_t> order(second_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [this](std::size_t a, std::size_t b) {
                       return second_[a].end - second_[a].begin >
                              second_[b].end - second_[b].begin;
                     });
    const auto most = static_cast<std::size_t>(options_.max_tried_pairs);
    std::vector<bool> is_paired(second_.size(), false);
    std::size_t candidates = 0;
    for (const std::size_t j : order) {
      const std::size_t with = candidates + by_second_[j].size();
      if (with * with / 2 > most) continue;
      candidates = with;
      is_paired[j] = true;
    }
    return is_paired;
  }

  // Pairs of walls of the first place that are not parallel, by rows.
  std::vector<char> CrossingWalls() const {
    const std::size_t count = first_.size();
    std::vector<char> crosses(count * count, 0);
    const double least = std::sin(kParallel);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const bool is_crossing =
            std::abs(std::sin(first_[i].angle - first_[j].angle)) >= least;
        crosses[i * count + j] = crosses[j * count + i] = is_crossing ? 1 : 0;
      }
    }
    return crosses;
  }

  // What a pair of walls adds to the normal equations of a displacement.
  struct Pull {
    // Of the offset.
    Matrix3d normal;
    Vector3d right;
    // Of the direction.
    double turn_information;
    double turn;

    void AddTo(Matrix3d* normal_sum, Vector3d* right_sum) const {
      *normal_sum += normal;
      *right_sum -= right;
      (*normal_sum)(2, 2) += turn_information;
      (*right_sum)[2] -= turn;
    }
  };

  Pull PullOf(const Candidate& pair, const Mover& mover,
              const Vector3d& displacement) const {
    const double sigma_offset = 0.5 * options_.tolerance;
    const ComparedWall& first = first_[pair.first];
    const ComparedWall moved = mover.Move(second_[pair.second]);
    Comparison c = Compare(first, moved);
    if (c.overlap <= 0.0) {
      // Not side by side yet: the second's own middle.
      c.second_middle = 0.5 * (moved.begin + moved.end);
      c.offset = first.Across(moved.At(c.second_middle));
    }
    const Vector2d lever =
        moved.At(c.second_middle) - pivot_ - displacement.head<2>();
    const Vector2d normal_of_first = first.normal();
    const Vector3d across(normal_of_first.x(), normal_of_first.y(),
                          normal_of_first.dot(Vector2d(-lever.y(), lever.x())));
    const double weight = 1.0 / (sigma_offset * sigma_offset);
    const double sigma_angle_squared =
        options_.angle_tolerance * options_.angle_tolerance +
        first.noise * first.noise + moved.noise * moved.noise;
    Pull pull;
    pull.normal = weight * across * across.transpose();
    pull.right = weight * c.offset * across;
    pull.turn_information = 1.0 / sigma_angle_squared;
    pull.turn = c.angle / sigma_angle_squared;
    return pull;
  }

  // Every solve begins where nothing is moved: what candidates say there is
  // computed once, as are their gates.
  void MeasureCandidates() {
    const Vector3d unmoved = Vector3d::Zero();
    const Mover mover(pivot_, unmoved);
    unmoved_pulls_.reserve(candidates_.size());
    angle_gates_.reserve(candidates_.size());
    for (const Candidate& pair : candidates_) {
      unmoved_pulls_.push_back(PullOf(pair, mover, unmoved));
      angle_gates_.push_back(
          AngleGate(first_[pair.first], second_[pair.second], 0.0));
    }
  }

  const Pull& UnmovedPull(const Candidate& pair) const {
    const std::vector<int>& firsts = by_second_[pair.second];
    const auto found =
        std::lower_bound(firsts.begin(), firsts.end(), pair.first);
    return unmoved_pulls_[first_candidate_[pair.second] +
                          static_cast<std::size_t>(found - firsts.begin())];
  }

  // Most probable displacement when these pairs, a range of candidates, are one
  // wall each.
  template <typename Pairs>
  Vector3d Solve(const Pairs& pairs) const {
    Vector3d displacement = Vector3d::Zero();
    for (int round = 0; round < kSolverRounds; ++round) {
      Matrix3d normal = prior_;
      Vector3d right = -prior_ * displacement;
      if (round == 0) {
        for (const Candidate& pair : pairs) {
          UnmovedPull(pair).AddTo(&normal, &right);
        }
      } else {
        const Mover mover(pivot_, displacement);
        for (const Candidate& pair : pairs) {
          PullOf(pair, mover, displacement).AddTo(&normal, &right);
        }
      }
      displacement += SolveSymmetric(normal, right);
    }
    return displacement;
  }

  // Holds until the next call: nothing is allocated anew for each of many.
  const Explanation& Explain(const Vector3d& displacement) {
    Explanation& explanation = explanation_;
    explanation.matches.clear();
    explanation.best.clear();
    std::vector<Line>& lines = lines_;
    lines.clear();
    std::vector<WallMatch>& found = found_;
    double conflicts = 0.0;
    const Mover mover(pivot_, displacement);
    for (std::size_t j = 0; j < second_.size(); ++j) {
      if (by_second_[j].empty()) continue;
      const ComparedWall moved = mover.Move(second_[j]);
      double least = options_.tolerance;
      double in_conflict = 0.0;
      found.clear();
      const double* gate = angle_gates_.data() + first_candidate_[j];
      for (const int i : by_second_[j]) {
        // Most walls are across the other, which needs no more.
        const double turn = std::abs(Turn(first_[i], moved));
        const bool is_parallel = turn <= *gate++;
        if (!is_parallel && turn > kConflictAngle) continue;
        const Comparison c = Compare(first_[i], moved);
        if (c.overlap < options_.min_overlap) continue;
        const double offset = std::abs(c.offset);
        if (offset <= options_.tolerance && is_parallel) {
          found.push_back(
              {i, static_cast<int>(j), c.second_middle, c.overlap, c.offset});
          least = std::min(least, offset);
        } else if (offset <= options_.conflict_depth &&
                   turn <= kConflictAngle) {
          in_conflict = std::max(in_conflict, c.overlap);
        }
      }
      if (found.empty()) {
        conflicts += std::min(1.0, in_conflict / kFullLength);
        continue;
      }
      double overlap = 0.0;
      const WallMatch* closest = nullptr;
      for (const WallMatch& match : found) {
        if (std::abs(match.offset) > least + kClearlyWorse) continue;
        explanation.matches.push_back(match);
        overlap += match.overlap;
        if (closest == nullptr || match.overlap > closest->overlap) {
          closest = &match;
        }
      }
      explanation.best.push_back({closest->first, closest->second});
      AddToLines(static_cast<int>(j), overlap, &lines);
    }
    double worth =
        -kConflict * conflicts - 0.5 * displacement.dot(prior_ * displacement);
    for (const Line& line : lines) {
      worth += line.gain * std::min(1.0, line.overlap / kFullLength);
    }
    explanation.worth = worth;
    return explanation;
  }

  // Takes a matched wall of the second place into the line that it is part of.
  void AddToLines(int wall, double overlap, std::vector<Line>* lines) const {
    const ComparedWall& own = second_[wall];
    const Vector2d middle = own.Middle();
    for (Line& line : *lines) {
      const ComparedWall& other = second_[line.wall];
      if (std::abs(NormalizeAngle(own.angle - other.angle)) <= kSameLineAngle &&
          std::abs(other.Across(middle)) <= kSameLineOffset) {
        line.overlap += overlap;
        return;
      }
    }
    Line line;
    line.wall = wall;
    line.overlap = overlap;
    line.range = ranges_[wall];
    line.gain = std::log(
        std::max(1.5, ranges_[wall] / (rivals_[wall] * options_.tolerance)));
    lines->push_back(line);
  }

  void Try(Vector3d displacement) {
    for (int round = 0;; ++round) {
      if (displacement.dot(prior_ * displacement) >
          options_.gate * options_.gate) {
        return;
      }
      const DisplacementCells::Cell cell = {
          std::lround(displacement[0] / kCell),
          std::lround(displacement[1] / kCell),
          std::lround(displacement[2] / DegToRad(0.3))};
      if (!tried_.Insert(cell)) return;
      const Explanation& explanation = Explain(displacement);
      if (explanation.matches.empty()) return;
      hypotheses_.push_back({displacement, explanation.worth});
      if (round == kRefinements) return;
      displacement = Solve(explanation.best);
    }
  }

  PlaceMatch Conclude(std::size_t best) {
    PlaceMatch result;
    result.displacement = hypotheses_[best].displacement;
    const Explanation& explanation = Explain(result.displacement);
    std::vector<Line> lines;
    for (const WallMatch& match : explanation.matches) {
      if (IsAmbiguous(match, best)) continue;
      result.matches.push_back(match);
      AddToLines(match.second, match.overlap, &lines);
    }
    // Directions that the lines are of: the first line of each fixes the
    // displacement.
    struct Direction {
      Vector2d along;
      double range = 0.0;
      bool has_opposite = false;
    };
    std::vector<Direction> directions;
    bool is_wide = false;
    for (const Line& line : lines) {
      const ComparedWall& wall = second_[line.wall];
      const double weight = std::min(1.0, line.overlap / kFullLength);
      result.search = std::max(result.search, line.range);
      is_wide = is_wide || line.range > options_.narrow + options_.tolerance;
      Direction* same = nullptr;
      for (Direction& direction : directions) {
        const double cross = direction.along.x() * wall.direction.y() -
                             direction.along.y() * wall.direction.x();
        if (std::abs(cross) <= std::sin(kParallel)) {
          same = &direction;
          break;
        }
      }
      double gain = line.gain * weight;
      if (same == nullptr) {
        // Two directions fix it; what a third says is said beyond that.
        if (directions.size() < 2) {
          gain -= std::log(std::max(1.0, line.range / options_.tolerance));
        }
        directions.push_back({wall.direction, line.range, false});
      } else if (!same->has_opposite && same->along.dot(wall.direction) < 0.0) {
        same->has_opposite = true;
        gain *= 0.5;
      }
      result.evidence += gain;
    }
    if (result.matches.empty()) {
      result.outcome = PlaceMatch::Outcome::kAmbiguous;
    } else if (is_wide && result.evidence < options_.min_evidence) {
      result.outcome = PlaceMatch::Outcome::kTooLittleEvidence;
      result.matches.clear();
    }
    std::vector<Candidate> kept;
    for (const WallMatch& match : result.matches) {
      kept.push_back({match.first, match.second});
    }
    if (!kept.empty()) result.displacement = Solve(kept);
    return result;
  }

  bool IsAmbiguous(const WallMatch& match, std::size_t best) const {
    const Hypothesis& own = hypotheses_[best];
    const ComparedWall moved =
        Mover(pivot_, own.displacement).Move(second_[match.second]);
    const Vector2d point = moved.At(match.along);
    for (const Hypothesis& rival : hypotheses_) {
      if (rival.worth < own.worth - options_.rival_margin) continue;
      const ComparedWall elsewhere =
          Mover(pivot_, rival.displacement).Move(second_[match.second]);
      const Vector2d other = elsewhere.At(match.along);
      if (std::abs(moved.normal().dot(other - point)) > options_.rival_offset) {
        return true;
      }
    }
    return false;
  }

  const PlaceMatchOptions& options_;
  Vector2d pivot_;
  Matrix3d covariance_;
  Matrix3d prior_;
  std::vector<ComparedWall> first_;
  std::vector<ComparedWall> second_;
  std::vector<Candidate> candidates_;
  // Some candidates are not known to be one wall.
  bool has_news_ = false;
  // Of each wall of the second place: half width of its search, number of lines
  // of the first place in it, and the candidates.
  std::vector<double> ranges_;
  std::vector<int> rivals_;
  std::vector<std::vector<int>> by_second_;
  // Of each wall of the second place its first candidate, and what each
  // candidate says before anything is moved.
  std::vector<std::size_t> first_candidate_;
  std::vector<Pull> unmoved_pulls_;
  // Of each candidate once it is moved.
  std::vector<double> angle_gates_;
  DisplacementCells tried_;
  std::vector<Hypothesis> hypotheses_;
  // Of Explain.
  Explanation explanation_;
  std::vector<Line> lines_;
  std::vector<WallMatch> found_;
};

}  // namespace

PlaceMatch MatchPlaces(const std::vector<PlaceWall>& first,
                       const std::vector<PlaceWall>& second,
                       const Vector2d& pivot, const Matrix3d& covariance,
                       const PlaceMatchOptions& options, double widest) {
  if (!covariance.allFinite() || covariance.llt().info() != Eigen::Success) {
    throw PLUMBLINE_ERROR("the covariance of a displacement is not one",
                          "a positive definite matrix");
  }
  return Matcher(first, second, pivot, covariance, options).Match(widest);
}

}  // namespace plumbline
