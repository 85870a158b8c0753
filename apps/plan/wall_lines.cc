#include <plumbline/core/disjoint_sets.h>
#include <plumbline/plan/curved_walls.h>
#include <plumbline/plan/wall_lines.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <queue>
#include <tuple>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Share of a row's length that must be occupied, and of a known face's.
constexpr double kLeastCovered = 0.5;
constexpr double kLeastSupport = 0.25;

// Chords of a curved wall: between their ends, m, and directions, rad.
constexpr double kChainGap = 0.4;
constexpr double kLeastBend = DegToRad(2.0);
constexpr double kLargestBend = DegToRad(25.0);
// What lies on one side of a wall, bent as the map is, is no farther apart than
// this, m.
constexpr double kOneSide = 0.2;
// Beyond a gap of more than this, m, a wall has no larger step than that, m:
// what has one is the front of a cupboard or a leaf of a door in the next room.
constexpr double kNextRoom = 1.0;
constexpr double kLargestStep = 0.1;
// Two parts of one straight wall are offset by no more than this, m, and lie
// beside each other along no more than that.
constexpr double kInLineOffset = 0.1;
constexpr double kInLineOverlap = 0.5;
// Long walls that are offset by no more than this, m, may have a longer gap
// between them, m: a corridor runs through there, with rooms on its sides.
constexpr double kSameLine = 0.05;
constexpr double kLongInLineGap = 8.0;
// The two faces of a thick wall lie beside each other along so much, m, and
// this share of the shorter one. Along no more than this share of that may
// anything look free between them: laser points go astray. And beside either
// the other one is seen along no more than this, m.
constexpr double kLongFace = 3.0;
constexpr double kFacingEachOther = 0.6;
constexpr double kSeenThrough = 0.1;
constexpr double kBesideCupboards = 0.3;
// Free cells before a face begin within this many cells of it, and lie beside
// this share of a face that was seen from there.
constexpr int kCellsBefore = 3;
constexpr double kSeenShare = 0.5;

// A face in one straight piece.
struct Face {
  // Index into the directions; -1: its own.
  int direction = -1;
  Vector2d begin, end;
  // It was seen from the left or from the right of begin to end.
  bool from_left = false;
  bool from_right = false;
  double length() const { return (end - begin).norm(); }
};

Vector2d Direction(double angle) { return {std::cos(angle), std::sin(angle)}; }

// The directions and those across them, each once.
std::vector<Vector2d> AllDirections(const std::vector<double>& directions,
                                    double same) {
  std::vector<double> angles;
  for (const double direction : directions) {
    for (const double angle : {direction, direction + 0.5 * kPi}) {
      const bool is_new =
          std::none_of(angles.begin(), angles.end(), [&](double other) {
            return std::abs(NormalizeAxial(angle - other)) < same;
          });
      if (is_new) angles.push_back(NormalizeAxial(angle));
    }
  }
  std::vector<Vector2d> vectors;
  for (const double angle : angles) vectors.push_back(Direction(angle));
  return vectors;
}

// Occupied cells of a raster, some of which are explained already.
class Returns {
 public:
  Returns(const SpaceGrid& space, const WallLineOptions& options)
      : space_(space), options_(options) {
    row_begin_.reserve(static_cast<std::size_t>(space.height) + 1);
    for (int row = 0; row < space.height; ++row) {
      row_begin_.push_back(points_.size());
      for (int column = 0; column < space.width; ++column) {
        if (space.At(column, row) != Space::kOccupied) continue;
        points_.push_back(space.Middle(column, row));
        columns_.push_back(column);
      }
    }
    row_begin_.push_back(points_.size());
    is_explained_.assign(points_.size(), false);
  }

  // Whether occupied cells speak for a piece: along a share of its length, and
  // along as much as was seen through. A wall that was seen at grazing angles
  // has gaps behind which nothing was seen.
  bool Support(const Vector2d& begin, const Vector2d& end) const {
    const double length = (end - begin).norm();
    const double step = space_.resolution;
    const int steps = std::max(1, static_cast<int>(length / step));
    const Vector2d along = (end - begin) / length;
    const Vector2d normal(-along[1], along[0]);
    const int reach = static_cast<int>(options_.cell_distance / step);
    int covered = 0;
    int open = 0;
    for (int i = 0; i < steps; ++i) {
      const Vector2d here = begin + (i + 0.5) * length / steps * along;
      bool is_occupied = false;
      bool is_free = true;
      for (int k = -reach; k <= reach; ++k) {
        const Space at = space_.At(Vector2d(here + k * step * normal));
        is_occupied = is_occupied || at == Space::kOccupied;
        is_free = is_free && at == Space::kFree;
      }
      covered += is_occupied;
      open += is_free;
    }
    return covered >= kLeastSupport * steps && covered >= open;
  }

  void Explain(const std::vector<Face>& faces) {
    // By strips of the raster.
    const double step = 0.5 * space_.resolution;
    const int reach = static_cast<int>(options_.cell_distance / step);
    for (const Face& face : faces) {
      const double length = face.length();
      const Vector2d along = (face.end - face.begin) / length;
      const Vector2d normal(-along[1], along[0]);
      for (double t = 0.0; t <= length; t += step) {
        for (int k = -reach; k <= reach; ++k) {
          const Vector2d p = face.begin + t * along + k * step * normal;
          if (space_.At(p) != Space::kOccupied) continue;
          is_explained_[IndexAt(p)] = true;
        }
      }
    }
  }

  // Straight rows of cells that nothing explains in a direction, the longest
  // first; they are explained then.
  std::vector<Face> TakeRows(const Vector2d& along, int direction) {
    const Vector2d normal(-along[1], along[0]);
    const double step = space_.resolution;
    // Cells by rows of half a cell across.
    struct Cell {
      double t, v;
      std::size_t index;
    };
    std::vector<Cell> cells;
    double least = 0.0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (is_explained_[i]) continue;
      const Vector2d relative = points_[i] - space_.origin;
      cells.push_back({along.dot(relative), normal.dot(relative), i});
      least = std::min(least, cells.back().v);
    }
    double most = least;
    for (const Cell& cell : cells) most = std::max(most, cell.v);
    std::vector<std::vector<Cell>> rows(
        static_cast<std::size_t>((most - least) / step) + 2);
    for (const Cell& cell : cells) {
      rows[static_cast<std::size_t>((cell.v - least) / step)].push_back(cell);
    }
    struct Run {
      double covered;
      std::size_t row;
      double begin, end, offset;
      bool operator<(const Run& other) const {
        return std::make_tuple(covered, -static_cast<double>(row), -begin) <
               std::make_tuple(other.covered, -static_cast<double>(other.row),
                               -other.begin);
      }
    };
    // The runs of a row and the next one together.
    const auto runs_of = [&](std::size_t row) {
      std::vector<Cell> both;
      for (std::size_t k = row; k < std::min(row + 2, rows.size()); ++k) {
        for (const Cell& cell : rows[k]) {
          if (!is_explained_[cell.index]) both.push_back(cell);
        }
      }
      std::sort(both.begin(), both.end(), [](const Cell& a, const Cell& b) {
        return std::make_tuple(a.t, a.index) < std::make_tuple(b.t, b.index);
      });
      std::vector<Run> runs;
      for (std::size_t i = 0; i < both.size();) {
        std::size_t j = i;
        double covered = 0.0;
        double sum = both[i].v;
        while (j + 1 < both.size() &&
               both[j + 1].t - both[j].t <= options_.max_gap) {
          ++j;
          covered += std::min(step, both[j].t - both[j - 1].t);
          sum += both[j].v;
        }
        const double length = both[j].t - both[i].t;
        if (length >= options_.min_length &&
            covered >= kLeastCovered * length) {
          runs.push_back({covered, row, both[i].t, both[j].t,
                          sum / static_cast<double>(j - i + 1)});
        }
        i = j + 1;
      }
      return runs;
    };
    std::priority_queue<Run> queue;
    for (std::size_t row = 0; row < rows.size(); ++row) {
      for (const Run& run : runs_of(row)) queue.push(run);
    }
    std::vector<Face> faces;
    while (!queue.empty()) {
      const Run best = queue.top();
      queue.pop();
      // Cells may have gone to others since.
      const std::vector<Run> now = runs_of(best.row);
      const auto same =
          std::find_if(now.begin(), now.end(), [&](const Run& run) {
            return run.begin == best.begin && run.end == best.end &&
                   run.covered == best.covered;
          });
      if (same == now.end()) {
        // What is left of it, each part once: those that were not queued.
        for (const Run& run : now) {
          if (run.begin >= best.begin && run.end <= best.end &&
              run.covered < best.covered) {
            queue.push(run);
          }
        }
        continue;
      }
      Face face;
      face.direction = direction;
      face.begin = space_.origin + best.begin * along + best.offset * normal;
      face.end = space_.origin + best.end * along + best.offset * normal;
      faces.push_back(face);
      Explain({face});
    }
    return faces;
  }

 private:
  // Of the occupied cell that a point lies in: few are, and the raster is
  // large.
  std::size_t IndexAt(const Vector2d& p) const {
    const Vector2d cell = (p - space_.origin) / space_.resolution;
    const auto row = static_cast<std::size_t>(std::floor(cell[1]));
    const auto begin = columns_.begin();
    const auto found = std::lower_bound(
        begin + static_cast<std::ptrdiff_t>(row_begin_[row]),
        begin + static_cast<std::ptrdiff_t>(row_begin_[row + 1]),
        static_cast<int>(std::floor(cell[0])));
    return static_cast<std::size_t>(found - begin);
  }

  const SpaceGrid& space_;
  const WallLineOptions& options_;
  // By rows, and in each by columns.
  std::vector<Vector2d> points_;
  std::vector<int> columns_;
  std::vector<std::size_t> row_begin_;
  std::vector<bool> is_explained_;
};

// Whether free space lies before most of a face on its left (`side` 1) or right
// (-1).
bool IsSeenFrom(const Face& face, int side, const SpaceGrid& space) {
  const Vector2d along = (face.end - face.begin).normalized();
  const Vector2d before =
      side * space.resolution * Vector2d(-along[1], along[0]);
  const int steps =
      std::max(1, static_cast<int>(face.length() / space.resolution));
  int free = 0;
  for (int i = 0; i < steps; ++i) {
    const Vector2d here =
        face.begin + (i + 0.5) / steps * (face.end - face.begin);
    for (int k = 1; k <= kCellsBefore; ++k) {
      if (space.At(Vector2d(here + k * before)) != Space::kFree) continue;
      ++free;
      break;
    }
  }
  return free > kSeenShare * steps;
}

// Faces that make one line.
struct Group {
  WallLine line;
  int direction = -1;
  std::vector<Face> faces;
};

// Whether two faces can be those of one wall: far apart only when nothing was
// seen between them, where the wall would be.
bool AreOneWall(const WallLine& line, const Face& a, const Face& b) {
  const auto across = [&](const Face& face) {
    return 0.5 * (line.Across(face.begin) + line.Across(face.end));
  };
  const double between = across(a) - across(b);
  if (std::abs(between) <= kOneSide) return true;
  const auto from = [&](const Face& face, bool left) {
    const bool is_along = line.along.dot(face.end - face.begin) > 0.0;
    return left == is_along ? face.from_left : face.from_right;
  };
  return !from(between > 0.0 ? a : b, false) &&
         !from(between > 0.0 ? b : a, true);
}

// The step between what lies on one side of two parts of a line, where they are
// nearest to each other, m; 0 when they have no side in common.
double StepBetween(const WallLine& line, const std::vector<Face>& a,
                   const std::vector<Face>& b) {
  const auto is_seen_from = [&](const Face& face, bool left) {
    const bool is_along = line.along.dot(face.end - face.begin) > 0.0;
    return left == is_along ? face.from_left : face.from_right;
  };
  double nearest = std::numeric_limits<double>::infinity();
  double step = 0.0;
  for (const Face& face : a) {
    const auto [begin, end] =
        std::minmax({line.Along(face.begin), line.Along(face.end)});
    for (const Face& other : b) {
      if (!(is_seen_from(face, true) && is_seen_from(other, true)) &&
          !(is_seen_from(face, false) && is_seen_from(other, false))) {
        continue;
      }
      const auto [other_begin, other_end] =
          std::minmax({line.Along(other.begin), line.Along(other.end)});
      const double gap = std::max({other_begin - end, begin - other_end, 0.0});
      const double between =
          0.5 * std::abs(line.Across(face.begin) + line.Across(face.end) -
                         line.Across(other.begin) - line.Across(other.end));
      if (gap > nearest || (gap == nearest && between >= step)) continue;
      nearest = gap;
      step = between;
    }
  }
  return step;
}

// Adds a face to a group when it is a part of the same wall; how far it is off,
// or -1 when it is not.
double Fits(const Group& group, const Face& face,
            const WallLineOptions& options) {
  const WallLine& line = group.line;
  if (group.direction != face.direction) return -1.0;
  const Vector2d along = (face.end - face.begin).normalized();
  if (face.direction < 0 &&
      std::abs(line.along.dot(along)) < std::cos(options.same_direction)) {
    return -1.0;
  }
  const double a = line.Across(face.begin);
  const double b = line.Across(face.end);
  const double low = std::min({line.low, a, b});
  const double high = std::max({line.high, a, b});
  if (high - low > options.max_thickness) return -1.0;
  const double begin = std::min(line.Along(face.begin), line.Along(face.end));
  const double end = std::max(line.Along(face.begin), line.Along(face.end));
  const double gap = std::max(begin - line.end, line.begin - end);
  if (gap > options.in_line_gap) return -1.0;
  if (!std::all_of(
          group.faces.begin(), group.faces.end(),
          [&](const Face& other) { return AreOneWall(line, face, other); })) {
    return -1.0;
  }
  if (gap > kNextRoom &&
      StepBetween(line, group.faces, {face}) > kLargestStep) {
    return -1.0;
  }
  // In line before near.
  return std::max(0.0, high - low - (line.high - line.low)) +
         0.02 * std::max(0.0, gap);
}

void Add(const Face& face, Group* group) {
  WallLine& line = group->line;
  const double a = line.Along(face.begin);
  const double b = line.Along(face.end);
  line.begin = std::min({line.begin, a, b});
  line.end = std::max({line.end, a, b});
  const double across = 0.5 * (line.Across(face.begin) + line.Across(face.end));
  line.low = std::min(line.low, across);
  line.high = std::max(line.high, across);
  line.weight += face.length();
  group->faces.push_back(face);
  const double middle = 0.5 * (line.low + line.high);
  line.origin += middle * line.normal();
  line.low -= middle;
  line.high -= middle;
}

// Whether two groups are one straight wall: one goes on where the other one
// ends. Each began with a long piece of its own, and shorter ones between them
// went to either.
bool AreInLine(const Group& a, const Group& b, const WallLineOptions& options) {
  if (a.direction != b.direction ||
      (a.direction < 0 && std::abs(a.line.along.dot(b.line.along)) <
                              std::cos(options.same_direction))) {
    return false;
  }
  const WallLine& line = a.line;
  double low = line.low;
  double high = line.high;
  double begin = line.Along(b.faces.front().begin);
  double end = begin;
  for (const Face& face : b.faces) {
    const double across =
        0.5 * (line.Across(face.begin) + line.Across(face.end));
    low = std::min(low, across);
    high = std::max(high, across);
    for (const Vector2d& at : {face.begin, face.end}) {
      begin = std::min(begin, line.Along(at));
      end = std::max(end, line.Along(at));
    }
  }
  const double gap = std::max(begin - line.end, line.begin - end);
  const bool are_long = a.direction >= 0 &&
                        std::min(line.weight, b.line.weight) >= kLongFace &&
                        std::abs(line.Across(b.line.origin)) <= kSameLine;
  if (gap > (are_long ? kLongInLineGap : options.in_line_gap) ||
      gap < -kInLineOverlap || high - low > options.max_thickness ||
      high - low > kInLineOffset + std::max(line.high - line.low,
                                            b.line.high - b.line.low) ||
      (gap > kNextRoom && StepBetween(line, a.faces, b.faces) > kLargestStep)) {
    return false;
  }
  return std::all_of(a.faces.begin(), a.faces.end(), [&](const Face& face) {
    return std::all_of(b.faces.begin(), b.faces.end(), [&](const Face& other) {
      return AreOneWall(line, face, other);
    });
  });
}

// Makes one group of those that are one straight wall.
void JoinInLine(const WallLineOptions& options, std::vector<Group>* groups) {
  for (std::size_t i = 0; i < groups->size(); ++i) {
    for (std::size_t j = i + 1; j < groups->size();) {
      if (!AreInLine((*groups)[i], (*groups)[j], options)) {
        ++j;
        continue;
      }
      for (const Face& face : (*groups)[j].faces) Add(face, &(*groups)[i]);
      groups->erase(groups->begin() + static_cast<std::ptrdiff_t>(j));
      // It reaches farther now.
      j = i + 1;
    }
  }
}

// Whether two groups are the faces of one thick wall: each is seen from its own
// side only, they face each other, and nothing was seen between them where they
// do. Cupboards before a wall end somewhere, and the wall is seen beside them.
bool AreThickWall(const Group& a, const Group& b, const SpaceGrid& space,
                  const WallLineOptions& options) {
  if (a.direction < 0 || a.direction != b.direction) return false;
  const WallLine& line = a.line;
  double low = line.Across(b.faces.front().begin);
  double high = low;
  double begin = line.Along(b.faces.front().begin);
  double end = begin;
  for (const Face& face : b.faces) {
    for (const Vector2d& at : {face.begin, face.end}) {
      low = std::min(low, line.Across(at));
      high = std::max(high, line.Across(at));
      begin = std::min(begin, line.Along(at));
      end = std::max(end, line.Along(at));
    }
  }
  if (std::max(high, line.high) - std::min(low, line.low) >
          options.thickest_solid ||
      std::min(b.line.weight, line.weight) < kLongFace ||
      !std::all_of(a.faces.begin(), a.faces.end(), [&](const Face& face) {
        return std::all_of(
            b.faces.begin(), b.faces.end(),
            [&](const Face& other) { return AreOneWall(line, face, other); });
      })) {
    return false;
  }
  const double from = std::min(high, line.high) + options.cell_distance;
  const double to = std::max(low, line.low) - options.cell_distance;
  double both = 0.0;
  double seen_through = 0.0;
  double beside_a = 0.0;
  double beside_b = 0.0;
  const double step = space.resolution;
  for (double t = std::min(begin, line.begin); t < std::max(end, line.end);
       t += step) {
    const auto at = [&](double v) {
      return space.At(Vector2d(line.At(t) + v * line.normal()));
    };
    const auto has_face = [&](double first, double last) {
      for (double v = first - options.cell_distance;
           v <= last + options.cell_distance; v += step) {
        if (at(v) == Space::kOccupied) return true;
      }
      return false;
    };
    int all = 0;
    int free = 0;
    for (double v = from; v <= to; v += step) {
      ++all;
      free += at(v) == Space::kFree;
    }
    // Beyond its ends what lies there is of other lines.
    const bool has_a =
        t >= line.begin && t <= line.end && has_face(line.low, line.high);
    const bool has_b = t >= begin && t <= end && has_face(low, high);
    if (has_a && has_b) {
      both += step;
      if (free > 0) seen_through += step;
    } else if (all > 0 && free == all) {
      if (has_a) beside_b += step;
      if (has_b) beside_a += step;
    }
  }
  return both >= std::max(
                     kLongFace,
                     kFacingEachOther * std::min(line.weight, b.line.weight)) &&
         seen_through <= kSeenThrough * both &&
         std::max(beside_a, beside_b) <= kBesideCupboards;
}

// Makes one group of the two faces of a thick wall.
void JoinThickWalls(const SpaceGrid& space, const WallLineOptions& options,
                    std::vector<Group>* groups) {
  for (std::size_t i = 0; i < groups->size(); ++i) {
    for (std::size_t j = i + 1; j < groups->size();) {
      if (!AreThickWall((*groups)[i], (*groups)[j], space, options)) {
        ++j;
        continue;
      }
      for (const Face& face : (*groups)[j].faces) Add(face, &(*groups)[i]);
      groups->erase(groups->begin() + static_cast<std::ptrdiff_t>(j));
    }
  }
}

// The edges of curved walls as lines.
std::vector<WallLine> EdgesOf(const std::vector<CurvedWall>& walls) {
  std::vector<WallLine> edges;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const std::vector<Vector2d>& corners = walls[i].corners;
    for (std::size_t k = 0; k + 1 < corners.size(); ++k) {
      WallLine edge;
      const Vector2d way = corners[k + 1] - corners[k];
      edge.origin = corners[k];
      edge.along = way.normalized();
      edge.end = way.norm();
      edge.low = walls[i].low;
      edge.high = walls[i].high;
      edge.weight = edge.end;
      edge.curve = static_cast<int>(i);
      edge.begins_in_corner = k > 0 || walls[i].is_closed();
      edge.ends_in_corner = k + 2 < corners.size() || walls[i].is_closed();
      edges.push_back(edge);
    }
  }
  return edges;
}

// Both faces of a line's wall.
std::vector<Face> FacesOf(const WallLine& line) {
  std::vector<Face> faces;
  for (const double across : {line.low, line.high}) {
    Face face;
    face.begin = line.At(line.begin) + across * line.normal();
    face.end = line.At(line.end) + across * line.normal();
    faces.push_back(face);
  }
  return faces;
}

// Whether one line goes on where the other one ends, as chords of a curved wall
// do.
bool GoesOn(const WallLine& a, const WallLine& b) {
  const double cosine = std::abs(a.along.dot(b.along));
  if (cosine < std::cos(kLargestBend) || cosine > std::cos(kLeastBend)) {
    return false;
  }
  for (const double end : {a.begin, a.end}) {
    const Vector2d here = a.At(end);
    for (const double other : {b.begin, b.end}) {
      if ((b.At(other) - here).norm() > kChainGap) continue;
      // Away from each other.
      const Vector2d from = a.At(a.begin + a.end - end) - here;
      const Vector2d to = b.At(b.begin + b.end - other) - b.At(other);
      if (from.dot(to) < 0.0) return true;
    }
  }
  return false;
}

}  // namespace

std::vector<WallLine> FindWallLines(const std::vector<KnownWall>& pieces,
                                    const std::vector<double>& directions,
                                    const SpaceGrid& space,
                                    const WallLineOptions& options) {
  const std::vector<Vector2d> all =
      AllDirections(directions, options.same_direction);
  Returns returns(space, options);
  std::vector<KnownWall> straight;
  for (const KnownWall& piece : pieces) {
    if (piece.begin == piece.end) continue;
    if (returns.Support(piece.begin, piece.end)) straight.push_back(piece);
  }
  const std::vector<WallLine> edges =
      EdgesOf(TakeCurvedWalls(space, options, {}, &straight));
  std::vector<Face> faces;
  for (const KnownWall& piece : straight) {
    Face face;
    face.begin = piece.begin;
    face.end = piece.end;
    const double length = face.length();
    if (!(length >= options.min_length)) continue;
    Vector2d along = (face.end - face.begin) / length;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const double cosine = along.dot(all[i]);
      if (std::abs(cosine) < std::cos(options.same_direction)) continue;
      const Vector2d middle = 0.5 * (face.begin + face.end);
      along = cosine < 0.0 ? Vector2d(-all[i]) : all[i];
      face.begin = middle - 0.5 * length * along;
      face.end = middle + 0.5 * length * along;
      face.direction = static_cast<int>(i);
      break;
    }
    faces.push_back(face);
  }
  returns.Explain(faces);
  for (const WallLine& edge : edges) returns.Explain(FacesOf(edge));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const std::vector<Face> rows =
        returns.TakeRows(all[i], static_cast<int>(i));
    faces.insert(faces.end(), rows.begin(), rows.end());
  }
  for (Face& face : faces) {
    face.from_left = IsSeenFrom(face, 1, space);
    face.from_right = IsSeenFrom(face, -1, space);
  }
  std::stable_sort(
      faces.begin(), faces.end(),
      [](const Face& a, const Face& b) { return a.length() > b.length(); });
  std::vector<Group> groups;
  for (const Face& face : faces) {
    int best = -1;
    double best_misfit = 0.0;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      const double misfit = Fits(groups[i], face, options);
      if (misfit < 0.0 || (best >= 0 && misfit >= best_misfit)) continue;
      best = static_cast<int>(i);
      best_misfit = misfit;
    }
    if (best < 0) {
      Group group;
      group.direction = face.direction;
      group.line.origin = face.begin;
      group.line.is_aligned = face.direction >= 0;
      group.line.along = face.direction >= 0
                             ? all[static_cast<std::size_t>(face.direction)]
                             : (face.end - face.begin).normalized();
      best = static_cast<int>(groups.size());
      groups.push_back(group);
      // Not from the origin that it was made with.
      groups.back().line.begin = groups.back().line.Along(face.begin);
      groups.back().line.end = groups.back().line.begin;
    }
    Add(face, &groups[static_cast<std::size_t>(best)]);
  }
  JoinInLine(options, &groups);
  JoinThickWalls(space, options, &groups);
  std::vector<WallLine> lines;
  lines.reserve(groups.size() + edges.size());
  for (const Group& group : groups) lines.push_back(group.line);
  lines.insert(lines.end(), edges.begin(), edges.end());
  return lines;
}

std::vector<double> WallOfChains(const std::vector<WallLine>& lines,
                                 double longest) {
  DisjointSets chains(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].weight >= longest) continue;
    for (std::size_t j = 0; j < i; ++j) {
      if (lines[j].weight < longest && GoesOn(lines[i], lines[j])) {
        chains.Join(i, j);
      }
    }
  }
  std::map<std::size_t, double> wall;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    wall[chains.Find(i)] += lines[i].weight;
  }
  std::vector<double> of_lines;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    of_lines.push_back(wall[chains.Find(i)]);
  }
  return of_lines;
}

}  // namespace plumbline
