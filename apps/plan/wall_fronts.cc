#include <plumbline/plan/wall_fronts.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Two rows lie beside each other, by the cosine between them, when no farther
// apart than cupboards are deep, m.
constexpr double kSameDirectionCosine = 0.996;
constexpr double kDeepestFurniture = 0.8;
// Rows are in line when so far apart, beside their faces, at most, m, and with
// a gap of no more than this, m: the width of a corridor.
constexpr double kInLine = 0.1;
constexpr double kInLineGap = 6.0;
// The wall is longer than what stands before it by this factor at least: else
// nobody knows which is which.
constexpr double kClearly = 1.2;
// So much stands before a wall at least, m, and, as a share of the way from one
// end of the room to the other, at most: what closes it from wall to wall is
// the wall. Beside cupboards and between them so much of it was seen, as a
// share of their front.
constexpr double kLeastFront = 1.0;
constexpr double kMostOfFront = 0.9;
constexpr double kLeastOfWall = 0.5;
// Corners on a line, m.
constexpr double kOnLine = 0.02;
// Spaces change hands so often at most.
constexpr int kRounds = 4;

double WallOn(const DrawnLine& on) {
  const std::vector<Mark>& marks = on.profile.marks;
  return WallProfile::kStep * static_cast<double>(std::count(
                                  marks.begin(), marks.end(), Mark::kWall));
}

bool AreParallel(const WallLine& a, const WallLine& b) {
  return std::abs(a.along.dot(b.along)) >= kSameDirectionCosine;
}

// How far b lies to the left of a, in the middle of b, m.
double Offset(const WallLine& a, const DrawnLine& b) {
  return a.Across(b.line.At(0.5 * (b.from + b.to)));
}

// Metres of wall on each line and in line with it, in other rooms as well.
std::vector<double> WallInLine(const std::vector<DrawnLine>& drawn) {
  std::vector<double> on_line;
  for (const DrawnLine& line : drawn) on_line.push_back(WallOn(line));
  std::vector<double> wall;
  for (const DrawnLine& a : drawn) {
    double sum = 0.0;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      const DrawnLine& b = drawn[i];
      if (!b.line.is_wall || !AreParallel(a.line, b.line)) continue;
      const double thickness =
          0.5 * std::max(a.line.high - a.line.low, b.line.high - b.line.low);
      const auto [begin, end] =
          std::minmax({a.line.Along(b.line.At(b.line.begin)),
                       a.line.Along(b.line.At(b.line.end))});
      if (std::abs(Offset(a.line, b)) <= kInLine + thickness &&
          std::max(begin - a.line.end, a.line.begin - end) <= kInLineGap) {
        sum += on_line[i];
      }
    }
    wall.push_back(sum);
  }
  return wall;
}

// The faces beside a line for each sample of its profile.
struct FacesBeside {
  std::vector<int> left;
  std::vector<int> right;
};

std::vector<FacesBeside> FacesBesideLines(const Arrangement& arrangement,
                                          const std::vector<DrawnLine>& drawn) {
  std::vector<FacesBeside> beside(drawn.size());
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const auto size = static_cast<std::size_t>(drawn[i].profile.size());
    beside[i].left.assign(size, -1);
    beside[i].right.assign(size, -1);
  }
  for (const ArrangementEdge& edge : arrangement.edges) {
    if (edge.line < 0) continue;
    const auto line = static_cast<std::size_t>(edge.line);
    const WallProfile& profile = drawn[line].profile;
    int left = edge.left;
    int right = edge.right;
    double from = drawn[line].line.Along(edge.begin);
    double to = drawn[line].line.Along(edge.end);
    if (from > to) {
      std::swap(from, to);
      std::swap(left, right);
    }
    for (int i = std::max(0, profile.IndexOf(from));
         i < profile.size() && profile.MiddleOf(i) <= to; ++i) {
      if (profile.MiddleOf(i) < from) continue;
      beside[line].left[static_cast<std::size_t>(i)] = left;
      beside[line].right[static_cast<std::size_t>(i)] = right;
    }
  }
  return beside;
}

// The region that lies along most of a side of a line beside a face.
int RegionBeside(const DrawnLine& on, const std::vector<int>& faces,
                 const Polygon& face, const std::vector<int>& region) {
  double from = on.line.Along(face.shell.front());
  double to = from;
  for (const Vector2d& corner : face.shell) {
    from = std::min(from, on.line.Along(corner));
    to = std::max(to, on.line.Along(corner));
  }
  std::map<int, int> samples;
  const int last = std::min(on.profile.size() - 1, on.profile.IndexOf(to));
  for (int i = std::max(0, on.profile.IndexOf(from)); i <= last; ++i) {
    const int there = faces[static_cast<std::size_t>(i)];
    ++samples[there < 0 ? -1 : region[static_cast<std::size_t>(there)]];
  }
  int best = -1;
  int most = 0;
  for (const auto& [id, count] : samples) {
    if (count <= most) continue;
    best = id;
    most = count;
  }
  return best;
}

// A stretch of a line, m along it.
struct Stretch {
  double from = 0.0;
  double to = 0.0;
  double length() const { return std::max(0.0, to - from); }
};

// Where a region lies along a side of a line; `faces`: on that side.
Stretch SideOf(int id, const DrawnLine& on, const std::vector<int>& faces,
               const std::vector<int>& region) {
  Stretch stretch{on.to, on.from};
  for (int i = 0; i < on.profile.size(); ++i) {
    const int face = faces[static_cast<std::size_t>(i)];
    if (face < 0 || region[static_cast<std::size_t>(face)] != id) continue;
    const double middle = on.profile.MiddleOf(i);
    stretch.from = std::min(stretch.from, middle - 0.5 * WallProfile::kStep);
    stretch.to = std::max(stretch.to, middle + 0.5 * WallProfile::kStep);
  }
  return stretch;
}

// The same on another line.
Stretch StretchOn(const WallLine& other, const WallLine& line,
                  const Stretch& stretch) {
  const auto [from, to] = std::minmax(
      {other.Along(line.At(stretch.from)), other.Along(line.At(stretch.to))});
  return {from, to};
}

double WallWithin(const DrawnLine& on, const Stretch& stretch) {
  int wall = 0;
  for (int i = 0; i < on.profile.size(); ++i) {
    const double middle = on.profile.MiddleOf(i);
    wall += middle > stretch.from && middle < stretch.to &&
            on.profile.At(i) == Mark::kWall;
  }
  return wall * WallProfile::kStep;
}

// What lies between a wall and the front of what stands before it.
struct Strip {
  std::size_t wall = 0;
  std::size_t front = 0;
  // The front lies to the left of the wall.
  bool is_left = false;
  std::vector<std::size_t> faces;
};

std::vector<Strip> StripsBefore(const Arrangement& arrangement,
                                const std::vector<DrawnLine>& drawn) {
  const std::vector<double> wall = WallInLine(drawn);
  std::vector<Strip> strips;
  for (std::size_t a = 0; a < drawn.size(); ++a) {
    for (std::size_t b = 0; b < drawn.size(); ++b) {
      if (a == b || !drawn[a].line.is_wall || !drawn[b].line.is_wall ||
          wall[a] < kClearly * wall[b] ||
          !AreParallel(drawn[a].line, drawn[b].line)) {
        continue;
      }
      const double offset = Offset(drawn[a].line, drawn[b]);
      if (std::abs(offset) > kDeepestFurniture) continue;
      Strip strip;
      strip.wall = a;
      strip.front = b;
      strip.is_left = offset > 0.0;
      const double side = strip.is_left ? 1.0 : -1.0;
      const bool is_along = drawn[a].line.along.dot(drawn[b].line.along) > 0.0;
      // What is more of a wall than the front and stands between the two has
      // strips of its own.
      std::vector<std::size_t> between;
      for (std::size_t c = 0; c < drawn.size(); ++c) {
        if (c == a || c == b || !drawn[c].line.is_wall || wall[c] < wall[b] ||
            !AreParallel(drawn[a].line, drawn[c].line)) {
          continue;
        }
        const double there = side * Offset(drawn[a].line, drawn[c]);
        if (there > kOnLine && there < side * offset - kOnLine) {
          between.push_back(c);
        }
      }
      for (std::size_t i = 0; i < arrangement.faces.size(); ++i) {
        const Ring& shell = arrangement.faces[i].shell;
        if (!std::all_of(shell.begin(), shell.end(), [&](const Vector2d& p) {
              return side * drawn[a].line.Across(p) >= -kOnLine &&
                     side * (is_along ? 1.0 : -1.0) * drawn[b].line.Across(p) <=
                         kOnLine;
            })) {
          continue;
        }
        Vector2d middle = Vector2d::Zero();
        for (const Vector2d& corner : shell) middle += corner;
        middle /= static_cast<double>(shell.size());
        if (std::none_of(between.begin(), between.end(), [&](std::size_t c) {
              const double t = drawn[c].line.Along(middle);
              return t >= drawn[c].from && t <= drawn[c].to;
            })) {
          strip.faces.push_back(i);
        }
      }
      if (!strip.faces.empty()) strips.push_back(std::move(strip));
    }
  }
  return strips;
}

}  // namespace

void GiveFrontsToRooms(const Arrangement& arrangement,
                       const std::vector<DrawnLine>& drawn,
                       std::vector<int>* region) {
  const std::vector<Strip> strips = StripsBefore(arrangement, drawn);
  const std::vector<FacesBeside> beside = FacesBesideLines(arrangement, drawn);
  const auto behind_wall = [&](const Strip& strip) -> const std::vector<int>& {
    const FacesBeside& faces = beside[strip.wall];
    return strip.is_left ? faces.right : faces.left;
  };
  const auto before_front = [&](const Strip& strip) -> const std::vector<int>& {
    const FacesBeside& faces = beside[strip.front];
    const bool is_along =
        drawn[strip.wall].line.along.dot(drawn[strip.front].line.along) > 0.0;
    return strip.is_left == is_along ? faces.left : faces.right;
  };
  for (int round = 0; round < kRounds; ++round) {
    bool is_changed = false;
    for (const Strip& strip : strips) {
      const DrawnLine& wall = drawn[strip.wall];
      const DrawnLine& front = drawn[strip.front];
      // Faces by the regions behind the wall and before the front.
      std::map<std::pair<int, int>, std::vector<std::size_t>> faces;
      for (const std::size_t face : strip.faces) {
        const int here = (*region)[face];
        if (here < 0) continue;
        const Polygon& outline = arrangement.faces[face];
        const int behind =
            RegionBeside(wall, behind_wall(strip), outline, *region);
        if (here != behind) continue;
        const int before =
            RegionBeside(front, before_front(strip), outline, *region);
        if (before < 0 || before == behind) continue;
        faces[{behind, before}].push_back(face);
      }
      for (const auto& [sides, between] : faces) {
        const auto [behind, before] = sides;
        const Stretch side =
            SideOf(before, front, before_front(strip), *region);
        const Stretch other =
            StretchOn(front.line, wall.line,
                      SideOf(behind, wall, behind_wall(strip), *region));
        const Stretch common{std::max(side.from, other.from),
                             std::min(side.to, other.to)};
        const double stands = WallWithin(front, common);
        if (stands < kLeastFront || stands > kMostOfFront * common.length() ||
            WallWithin(wall, StretchOn(wall.line, front.line, common)) <
                kLeastOfWall * stands) {
          continue;
        }
        for (const std::size_t face : between) (*region)[face] = before;
        is_changed = true;
      }
    }
    if (!is_changed) return;
  }
}

}  // namespace plumbline
