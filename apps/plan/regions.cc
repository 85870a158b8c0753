#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/plan/min_cut.h>
#include <plumbline/plan/regions.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Space that was not seen is filled up to this, m^2.
constexpr double kMaxPocket = 5.0;
// Of a room that furniture hides in part: what was not seen of a face that is
// larger than a pocket, up to so much, m^2, counts so much less when so large a
// share of its border, and more, is wall or door, and not less up to this one.
// What is larger may be the next room, whose wall was seen from there alone.
constexpr double kMostHidden = 9.0;
constexpr double kHiddenFloor = 0.5;
constexpr double kEnclosed = 0.7;
constexpr double kBarelyEnclosed = 0.3;
// Share of a pocket's border that a room must have, and that may lie open to
// what is no room.
constexpr double kLeastPocketBorder = 0.2;
constexpr double kMaxExposed = 0.2;
// Furniture stands in a row for so much at most, m, and is so deep at least, m:
// else a wall juts out. So much wall on a line goes on behind it, m, and as a
// share of what it hides.
constexpr double kLongestFurniture = 2.5;
constexpr double kLeastDepth = 0.3;
constexpr double kGoesOn = 0.3;
constexpr double kSeenOfIt = 0.25;
// Rows of racks and benches in a hall are narrower than this, m.
constexpr double kWidestRow = 2.5;
// Share of the border of what lies within a wall, between two rooms; and of
// walls on the border, with what is no room, of what stands behind furniture.
constexpr double kWithinRooms = 0.7;
constexpr double kWalled = 0.8;
// What was seen from the room behind its furniture, as a share: walls that
// were seen there are the room's.
constexpr double kGlimpse = 0.1;
// What was seen of a space, m^2, and the share of doors on its border from
// which on it lies behind a door.
constexpr double kSeenThroughDoor = 1.0;
constexpr double kDoorBorder = 0.5;
// An opening, m, and its share of a region's width.
constexpr double kLeastOpening = 0.5;
constexpr double kWholeWidth = 0.6;
// A corridor is at least so many times as long as it is wide, and so large,
// m^2: niches and entrances belong to their rooms.
constexpr double kLeastLength = 2.0;
constexpr double kLeastCorridor = 5.0;
// A corridor goes straight on behind a bay that is wider than it is by less
// than this factor, and longer than it is wide by less than that: its two
// mouths face each other, by a cosine, with no more than this offset and these
// widths, as shares of the narrower one.
constexpr double kLargestBay = 2.0;
constexpr double kLongestBay = 5.0;
constexpr double kFacing = 0.95;
constexpr double kOffsetOfMouths = 0.5;
constexpr double kSameWidth = 1.3;
// Corners nearer to each other are one, m.
constexpr double kSameCorner = 2e-3;
// A side of a room has so much wall at least, m: else furniture stands there.
constexpr double kLeastSide = 2.0;
// What is narrower lies between two lines of one wall or along furniture, m.
constexpr double kSliver = 0.5;
// Regions that touch in no more than a corner are no neighbors, m.
constexpr double kLeastBorder = 0.1;

std::vector<BorderLengths> BordersOfFaces(const Arrangement& arrangement) {
  std::vector<BorderLengths> borders(arrangement.faces.size());
  for (const ArrangementEdge& edge : arrangement.edges) {
    for (const int face : {edge.left, edge.right}) {
      if (face >= 0) borders[static_cast<std::size_t>(face)].Add(edge.lengths);
    }
  }
  return borders;
}

// What a square metre of a face counts that was not seen. A bed hides half of a
// room that was looked into through its door, but not the walls around it.
double WeightOfUnknown(const Polygon& face, double unknown,
                       const BorderLengths& border) {
  const double length = border.length();
  if (length <= 0.0 || face.Area() <= kMaxPocket || unknown > kMostHidden) {
    return 1.0;
  }
  const double wall =
      (border.Of(Mark::kWall) + border.Of(Mark::kDoor)) / length;
  const double enclosed =
      (wall - kBarelyEnclosed) / (kEnclosed - kBarelyEnclosed);
  return 1.0 - kHiddenFloor * std::clamp(enclosed, 0.0, 1.0);
}

std::vector<bool> InsideOf(const Arrangement& arrangement,
                           const RegionOptions& options) {
  MinCut cut(arrangement.faces.size());
  const std::vector<BorderLengths> borders = BordersOfFaces(arrangement);
  for (std::size_t i = 0; i < arrangement.faces.size(); ++i) {
    cut.AddNodeCost(i, arrangement.free[i],
                    WeightOfUnknown(arrangement.faces[i],
                                    arrangement.unknown[i], borders[i]) *
                        arrangement.unknown[i]);
  }
  for (const ArrangementEdge& edge : arrangement.edges) {
    const double cost =
        options.border_cost *
        (edge.lengths.Of(Mark::kOpen) + edge.lengths.Of(Mark::kUnknown) +
         0.1 * (edge.lengths.Of(Mark::kWall) + edge.lengths.Of(Mark::kDoor)));
    if (edge.right < 0) {
      cut.AddNodeCost(static_cast<std::size_t>(edge.left), 0.0, cost);
    } else {
      cut.AddEdgeCost(static_cast<std::size_t>(edge.left),
                      static_cast<std::size_t>(edge.right), cost);
    }
  }
  return cut.Solve();
}

// Over -holds_apart: nothing keeps two regions apart.
double Openness(const BorderLengths& border) {
  const double length = border.length();
  return length < kLeastBorder ? -1.0 : -border.holds / length;
}

// How large a region is, m^2 and m.
struct Extent {
  double area = 0.0;
  double perimeter = 0.0;
  // What was seen of it.
  double free = 0.0;

  // Of a rectangle of the same area and perimeter: for corridors that branch,
  // their width.
  double Width() const {
    const double half = 0.25 * perimeter;
    return half - std::sqrt(std::max(0.0, half * half - area));
  }
};

// Lengths of borders by the drawn lines that they lie on.
using LineLengths = std::map<int, BorderLengths>;

// What lies between two regions.
struct Border {
  BorderLengths all;
  LineLengths of_line;

  void Add(int line, const BorderLengths& lengths) {
    all.Add(lengths);
    of_line[line].Add(lengths);
  }
  void Add(const Border& other) {
    all.Add(other.all);
    for (const auto& [line, lengths] : other.of_line) {
      of_line[line].Add(lengths);
    }
  }
};

void Subtract(const BorderLengths& part, BorderLengths* from) {
  for (std::size_t i = 0; i < part.metres.size(); ++i) {
    from->metres[i] -= part.metres[i];
  }
  from->holds -= part.holds;
}

// Over 0: nothing but an opening as wide as the spaces themselves, while a door
// has a wall beside it.
double Through(const BorderLengths& border, double width,
               const RegionOptions& options) {
  const double open = border.Of(Mark::kOpen) + border.Of(Mark::kDoor);
  if (open < kLeastOpening || open < kWholeWidth * width) return -1.0;
  return options.least_wall_share - border.Of(Mark::kWall) / border.length();
}

bool IsNarrow(const Polygon& polygon, double width) {
  return Offset(polygon, -0.5 * width).empty();
}

// Faces of no region in unseen spaces behind furniture or within it: small and
// narrow as a whole, up to the walls around them. For each face a number that
// its space has alone, -1 for the others.
std::vector<int> HiddenSpaces(const Arrangement& arrangement,
                              const RegionOptions& options,
                              const std::vector<int>& region) {
  const std::size_t size = arrangement.faces.size();
  DisjointSets spaces(size);
  for (const ArrangementEdge& edge : arrangement.edges) {
    if (edge.left < 0 || edge.right < 0 ||
        region[static_cast<std::size_t>(edge.left)] >= 0 ||
        region[static_cast<std::size_t>(edge.right)] >= 0 ||
        -Openness(edge.lengths) >= options.holds_apart) {
      continue;
    }
    spaces.Join(static_cast<std::size_t>(edge.left),
                static_cast<std::size_t>(edge.right));
  }
  std::map<std::size_t, std::vector<Polygon>> faces;
  std::map<std::size_t, double> free;
  for (std::size_t i = 0; i < size; ++i) {
    if (region[i] >= 0) continue;
    faces[spaces.Find(i)].push_back(arrangement.faces[i]);
    free[spaces.Find(i)] += arrangement.free[i];
  }
  std::vector<int> hidden(size, -1);
  for (std::size_t i = 0; i < size; ++i) {
    if (region[i] >= 0) continue;
    const std::vector<Polygon>& parts = faces[spaces.Find(i)];
    double area = 0.0;
    for (const Polygon& part : parts) area += part.Area();
    if (area > kMaxPocket) continue;
    // The more of it was seen, the deeper it may be.
    const double seen = std::min(1.0, free[spaces.Find(i)] / (kGlimpse * area));
    const double width = options.pocket_width +
                         seen * (options.glimpsed_width - options.pocket_width);
    const std::vector<Polygon> outlines = UnionOf(parts);
    if (std::all_of(
            outlines.begin(), outlines.end(),
            [&](const Polygon& whole) { return IsNarrow(whole, width); })) {
      hidden[i] = static_cast<int>(spaces.Find(i));
    }
  }
  return hidden;
}

// Regions and what lies between them while they grow.
class Regions {
 public:
  Regions(const Arrangement& arrangement, const std::vector<bool>& is_inside,
          const RegionOptions& options)
      : region_(arrangement.faces.size(), -1),
        borders_(region_.size()),
        of_solids_(region_.size()),
        sides_(region_.size()),
        extents_(region_.size()),
        is_sliver_(region_.size()) {
    for (std::size_t i = 0; i < region_.size(); ++i) {
      if (is_inside[i]) region_[i] = static_cast<int>(i);
      extents_[i].area = arrangement.faces[i].Area();
      extents_[i].perimeter = arrangement.faces[i].Perimeter();
      extents_[i].free = arrangement.free[i];
    }
    ParallelFor(region_.size(), ThreadsHere(), [&](std::size_t i) {
      is_sliver_[i] = IsNarrow(arrangement.faces[i], kSliver);
    });
    const std::vector<int> hidden = HiddenSpaces(arrangement, options, region_);
    for (const ArrangementEdge& edge : arrangement.edges) {
      if (edge.left == edge.right) continue;
      for (const int face : {edge.left, edge.right}) {
        if (face < 0) continue;
        sides_[static_cast<std::size_t>(face)][edge.line].Add(edge.lengths);
      }
      if (edge.right < 0) continue;
      for (const auto& [face, beside] :
           {std::make_pair(edge.left, edge.right),
            std::make_pair(edge.right, edge.left)}) {
        const int solid = hidden[static_cast<std::size_t>(beside)];
        if (region_[static_cast<std::size_t>(face)] < 0 || solid < 0) continue;
        of_solids_[static_cast<std::size_t>(face)][solid].Add(edge.lengths);
      }
      if (region_[static_cast<std::size_t>(edge.left)] < 0 ||
          region_[static_cast<std::size_t>(edge.right)] < 0) {
        continue;
      }
      BordersOf(edge.left)[edge.right].Add(edge.line, edge.lengths);
      BordersOf(edge.right)[edge.left].Add(edge.line, edge.lengths);
    }
  }

  const std::vector<int>& region() const { return region_; }

  // Joins across borders that are open, the most open first. What lies between
  // two lines close together goes first: the border beside it is short until
  // then, and may be open where the wall as a whole is not.
  void JoinOpen(const RegionOptions& options) {
    JoinOpen(options, /*only_slivers=*/true);
    JoinOpen(options, /*only_slivers=*/false);
  }

  // Joins across openings as wide as the wider space: a narrow one may be the
  // part of a room that was seen through its door. Walls that lie between the
  // two elsewhere, on other lines, do not matter: a corridor that is cut may
  // run beside its other part.
  // `left`: two that are left as they are.
  void JoinThrough(const RegionOptions& options,
                   std::array<int, 2> left = {-1, -1}) {
    const auto is_left = [&](int region) {
      return region == left[0] || region == left[1];
    };
    for (;;) {
      double best = 0.0;
      int best_a = -1;
      int best_b = -1;
      for (std::size_t a = 0; a < borders_.size(); ++a) {
        if (is_left(static_cast<int>(a))) continue;
        for (const auto& [b, border] : borders_[a]) {
          if (is_left(b)) continue;
          const double width =
              std::max(extents_[a].Width(),
                       extents_[static_cast<std::size_t>(b)].Width());
          double through = Through(border.all, width, options);
          for (const auto& [line, lengths] : border.of_line) {
            through = std::max(through, Through(lengths, width, options));
          }
          if (through <= best) continue;
          best = through;
          best_a = static_cast<int>(a);
          best_b = b;
        }
      }
      if (best_a < 0) return;
      Join(best_a, best_b);
    }
  }

 private:
  void JoinOpen(const RegionOptions& options, bool only_slivers) {
    // Then by number.
    using Pair = std::tuple<double, int, int>;
    std::set<Pair> queue;
    const auto key = [&](const Border& border, int a, int b) {
      const bool is_left = AreApart(border.all, a, b, options) ||
                           (only_slivers && !IsSliver(a) && !IsSliver(b));
      return Pair(is_left ? 1.0 : HoldsApart(border, a, b, options),
                  std::min(a, b), std::max(a, b));
    };
    for (std::size_t a = 0; a < borders_.size(); ++a) {
      for (const auto& [b, border] : borders_[a]) {
        queue.insert(key(border, static_cast<int>(a), b));
      }
    }
    while (!queue.empty()) {
      const auto [closed, a, b] = *queue.begin();
      // Slivers with walls on both sides are pockets (FillPockets).
      if (closed >= (only_slivers ? 0.0 : options.holds_apart)) break;
      if (closed >= options.doors_hold_apart && HaveOwnDoors(a, b, options)) {
        // It comes back with other borders when one of them grows.
        queue.erase(queue.begin());
        continue;
      }
      for (const int end : {a, b}) {
        for (const auto& [c, border] : BordersOf(end)) {
          queue.erase(key(border, end, c));
        }
      }
      Join(a, b);
      for (const auto& [c, border] : BordersOf(a)) {
        queue.insert(key(border, a, c));
      }
    }
  }

  bool CouldBeRoom(int region, const RegionOptions& options) const {
    const Extent& extent = extents_[static_cast<std::size_t>(region)];
    return extent.area >= options.min_area &&
           extent.Width() >= options.min_width;
  }

  // What holds two regions apart, mean along what lies between them: their
  // border, and what stands between them and was seen from both sides, as the
  // row of cupboards beside a passage.
  double HoldsApart(const Border& border, int a, int b,
                    const RegionOptions& options) const {
    const auto& others = of_solids_[static_cast<std::size_t>(b)];
    if (border.all.length() < kLeastBorder) return 1.0;
    if (!CouldBeRoom(a, options) || !CouldBeRoom(b, options)) {
      return border.all.holds / border.all.length();
    }
    double length = 0.0;
    double holds = 0.0;
    for (const auto& [line, between] : border.of_line) {
      const BorderLengths& side = SideWithDoor(line, between, a, b);
      length += side.length();
      holds += side.holds;
    }
    for (const auto& [solid, face] : of_solids_[static_cast<std::size_t>(a)]) {
      const auto other = others.find(solid);
      if (other == others.end()) continue;
      const double along = std::min(face.length(), other->second.length());
      length += along;
      holds += along * std::max(face.holds / face.length(),
                                other->second.holds / other->second.length());
    }
    return holds / length;
  }

  // What two regions have between them on a line. The wall beside a door is
  // that of the whole side of the room behind it, the smaller of the two,
  // whatever the space before it is divided into by then. Furniture makes no
  // side.
  const BorderLengths& SideWithDoor(int line, const BorderLengths& between,
                                    int a, int b) const {
    if (line < 0 || between.Of(Mark::kDoor) < kLeastOpening) return between;
    const auto key = [&](int region) {
      return std::make_pair(extents_[static_cast<std::size_t>(region)].area,
                            region);
    };
    const int room = key(a) < key(b) ? a : b;
    const BorderLengths& side = sides_[static_cast<std::size_t>(room)].at(line);
    return side.Of(Mark::kWall) >= kLeastSide ? side : between;
  }

  std::map<int, Border>& BordersOf(int region) {
    return borders_[static_cast<std::size_t>(region)];
  }

  bool IsSliver(int region) const {
    return is_sliver_[static_cast<std::size_t>(region)] != 0;
  }

  // Both were seen, but nobody looked from one into the other: two rooms, even
  // when hardly anything was seen of the wall between them.
  bool AreApart(const BorderLengths& border, int a, int b,
                const RegionOptions& options) const {
    return border.Of(Mark::kOpen) + border.Of(Mark::kDoor) < kLeastOpening &&
           std::min(extents_[static_cast<std::size_t>(a)].free,
                    extents_[static_cast<std::size_t>(b)].free) >=
               options.min_area;
  }

  // Each has a door to one and the same third, as offices along a corridor do,
  // of which lines that cross it may have made several until now.
  bool HaveOwnDoors(int a, int b, const RegionOptions& options) const {
    Regions trial = *this;
    trial.JoinSpacesInWalls({a, b});
    trial.JoinThrough(options, {a, b});
    return trial.HaveDoorsToOne(a, b, options);
  }

  // What lies in a doorway, between two lines of one wall, goes to the space
  // that it is most open to. `left`: two that are left as they are.
  void JoinSpacesInWalls(std::array<int, 2> left) {
    for (std::size_t i = 0; i < borders_.size(); ++i) {
      const int small = static_cast<int>(i);
      if (borders_[i].empty() || small == left[0] || small == left[1] ||
          !IsSliver(small)) {
        continue;
      }
      double most = kLeastOpening;
      int to = -1;
      for (const auto& [b, border] : borders_[i]) {
        if (b == left[0] || b == left[1]) continue;
        const double open =
            border.all.Of(Mark::kOpen) + border.all.Of(Mark::kDoor);
        if (open >= most) {
          most = open;
          to = b;
        }
      }
      if (to >= 0) Join(to, small);
    }
  }

  // Only a third that is a space of its own speaks for the two: pieces of one
  // room with gaps all around would vouch for each other.
  bool HaveDoorsToOne(int a, int b, const RegionOptions& options) {
    const std::map<int, Border>& others = BordersOf(b);
    const auto& around = BordersOf(a);
    const auto has_door = [&](int room, int third, const Border& border) {
      return border.all.Of(Mark::kDoor) >= kLeastOpening &&
             HoldsApart(border, room, third, options) >= options.holds_apart;
    };
    return std::any_of(around.begin(), around.end(), [&](const auto& entry) {
      const auto& [third, border] = entry;
      const auto other = others.find(third);
      return other != others.end() && has_door(a, third, border) &&
             has_door(b, third, other->second);
    });
  }

  // b goes into a.
  void Join(int a, int b) {
    is_sliver_[static_cast<std::size_t>(a)] = IsSliver(a) && IsSliver(b);
    Extent& extent = extents_[static_cast<std::size_t>(a)];
    const Extent& more = extents_[static_cast<std::size_t>(b)];
    extent.area += more.area;
    extent.free += more.free;
    extent.perimeter += more.perimeter - 2.0 * BordersOf(a)[b].all.length();
    LineLengths& sides = sides_[static_cast<std::size_t>(a)];
    for (const auto& [line, lengths] : sides_[static_cast<std::size_t>(b)]) {
      sides[line].Add(lengths);
    }
    for (const auto& [line, lengths] : BordersOf(a)[b].of_line) {
      Subtract(lengths, &sides[line]);
      Subtract(lengths, &sides[line]);
    }
    BordersOf(a).erase(b);
    BordersOf(b).erase(a);
    for (const auto& [c, border] : BordersOf(b)) {
      BordersOf(c).erase(b);
      BordersOf(a)[c].Add(border);
      BordersOf(c)[a].Add(border);
    }
    BordersOf(b).clear();
    for (const auto& [solid, face] : of_solids_[static_cast<std::size_t>(b)]) {
      of_solids_[static_cast<std::size_t>(a)][solid].Add(face);
    }
    of_solids_[static_cast<std::size_t>(b)].clear();
    std::replace(region_.begin(), region_.end(), b, a);
  }

  std::vector<int> region_;
  std::vector<std::map<int, Border>> borders_;
  // Borders with unseen spaces that belong to no region (HiddenSpaces), by
  // their numbers.
  std::vector<std::map<int, BorderLengths>> of_solids_;
  // All around each region, also where it borders on none.
  std::vector<LineLengths> sides_;
  std::vector<Extent> extents_;
  // Narrow faces that have not joined any others.
  std::vector<char> is_sliver_;
};

// Which faces lie where their region is wider than a corridor.
std::vector<char> WideFaces(const Arrangement& arrangement,
                            const std::vector<int>& region, double width) {
  std::map<int, std::vector<Polygon>> parts;
  for (std::size_t i = 0; i < region.size(); ++i) {
    if (region[i] < 0) continue;
    parts[region[i]].push_back(arrangement.faces[i]);
  }
  std::map<int, std::vector<Polygon>> wide;
  for (const auto& entry : parts) wide[entry.first];
  const std::vector<std::pair<int, std::vector<Polygon>>> regions(parts.begin(),
                                                                  parts.end());
  ParallelFor(regions.size(), ThreadsHere(), [&](std::size_t i) {
    std::vector<Polygon>& wide_here = wide.at(regions[i].first);
    for (Polygon outline : UnionOf(regions[i].second)) {
      // Furniture makes no space narrower.
      outline.holes.erase(
          std::remove_if(outline.holes.begin(), outline.holes.end(),
                         [](const Ring& hole) {
                           return std::abs(SignedArea(hole)) <= kMaxPocket ||
                                  IsNarrow(Polygon{hole, {}}, kWidestRow);
                         }),
          outline.holes.end());
      for (const Polygon& core : Offset(outline, -0.5 * width)) {
        const std::vector<Polygon> grown = Offset(core, 0.5 * width);
        wide_here.insert(wide_here.end(), grown.begin(), grown.end());
      }
    }
  });
  std::vector<char> is_wide(region.size(), 0);
  ParallelFor(region.size(), ThreadsHere(), [&](std::size_t i) {
    if (region[i] < 0) return;
    const Polygon& face = arrangement.faces[i];
    double area = 0.0;
    for (const Polygon& core : wide.at(region[i])) {
      for (const Polygon& part : IntersectionOf(face, core)) {
        area += part.Area();
      }
    }
    is_wide[i] = area >= 0.5 * face.Area();
  });
  return is_wide;
}

// Largest distance between two points of a part of `pieces` that hangs
// together, m: how wide a mouth is, with its corners cut.
double WidestChain(const std::vector<StraightPiece>& pieces) {
  DisjointSets chains(pieces.size());
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      for (const Vector2d& a : {pieces[i].first, pieces[i].second}) {
        for (const Vector2d& b : {pieces[j].first, pieces[j].second}) {
          if ((a - b).norm() < kSameCorner) {
            chains.Join(i, j);
          }
        }
      }
    }
  }
  double widest = 0.0;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      if (chains.Find(i) != chains.Find(j)) continue;
      for (const Vector2d& a : {pieces[i].first, pieces[i].second}) {
        for (const Vector2d& b : {pieces[j].first, pieces[j].second}) {
          widest = std::max(widest, (a - b).norm());
        }
      }
    }
  }
  return widest;
}

// Where a corridor opens into a wide space.
struct Mouth {
  std::size_t corridor = 0;
  Vector2d middle = Vector2d::Zero();
  // Out of the corridor.
  Vector2d out = Vector2d::Zero();
  double width = 0.0;
};

Mouth MouthOf(std::size_t corridor, const Polygon& outline,
              const std::vector<StraightPiece>& border) {
  Mouth mouth;
  mouth.corridor = corridor;
  mouth.width = WidestChain(border);
  double length = 0.0;
  Vector2d across = Vector2d::Zero();
  for (const auto& [begin, end] : border) {
    const double piece = (end - begin).norm();
    mouth.middle += 0.5 * piece * (begin + end);
    // Pieces run either way.
    const double sign = across.dot(end - begin) < 0.0 ? -1.0 : 1.0;
    across += sign * (end - begin);
    length += piece;
  }
  if (!(length > 0.0) || !(across.norm() > 0.0)) return mouth;
  mouth.middle /= length;
  const Vector2d normal = Vector2d(-across[1], across[0]).normalized();
  Vector2d center = Vector2d::Zero();
  for (const Vector2d& corner : outline.shell) center += corner;
  center /= static_cast<double>(outline.shell.size());
  mouth.out = normal.dot(mouth.middle - center) < 0.0 ? -normal : normal;
  return mouth;
}

// Whether a corridor goes on where another one, as wide as it is, leaves the
// same wide space opposite to it, no farther away than `kLongestBay` widths.
bool GoesStraightOn(std::size_t corridor, const std::vector<Mouth>& mouths) {
  for (const Mouth& mouth : mouths) {
    if (mouth.corridor != corridor) continue;
    for (const Mouth& other : mouths) {
      const Vector2d way = other.middle - mouth.middle;
      const double along = mouth.out.dot(way);
      const double least = std::min(mouth.width, other.width);
      if (other.corridor != corridor && mouth.out.dot(other.out) < -kFacing &&
          along > 0.0 && along <= kLongestBay * least &&
          (way - along * mouth.out).norm() <= kOffsetOfMouths * least &&
          std::max(mouth.width, other.width) <= kSameWidth * least) {
        return true;
      }
    }
  }
  return false;
}

// Makes regions of their own of corridors that open into wide spaces.
void CutCorridors(const Arrangement& arrangement, const RegionOptions& options,
                  std::vector<int>* region) {
  const std::vector<char> is_wide =
      WideFaces(arrangement, *region, options.corridor_width);
  DisjointSets pieces(region->size());
  const auto is_within = [&](const ArrangementEdge& edge) {
    return edge.left >= 0 && edge.right >= 0 &&
           (*region)[static_cast<std::size_t>(edge.left)] >= 0 &&
           (*region)[static_cast<std::size_t>(edge.left)] ==
               (*region)[static_cast<std::size_t>(edge.right)];
  };
  for (const ArrangementEdge& edge : arrangement.edges) {
    if (is_within(edge) && is_wide[static_cast<std::size_t>(edge.left)] ==
                               is_wide[static_cast<std::size_t>(edge.right)]) {
      pieces.Join(static_cast<std::size_t>(edge.left),
                  static_cast<std::size_t>(edge.right));
    }
  }
  // Narrow pieces and the wide ones beside them.
  std::map<std::size_t, std::map<std::size_t, std::vector<StraightPiece>>>
      borders;
  for (const ArrangementEdge& edge : arrangement.edges) {
    if (!is_within(edge)) continue;
    auto narrow = static_cast<std::size_t>(edge.left);
    auto wide = static_cast<std::size_t>(edge.right);
    if (is_wide[narrow]) std::swap(narrow, wide);
    if (pieces.Find(narrow) == pieces.Find(wide)) continue;
    borders[pieces.Find(narrow)][pieces.Find(wide)].emplace_back(edge.begin,
                                                                 edge.end);
  }
  std::map<std::size_t, std::vector<Polygon>> faces;
  for (std::size_t i = 0; i < region->size(); ++i) {
    if ((*region)[i] < 0) continue;
    faces[pieces.Find(i)].push_back(arrangement.faces[i]);
  }
  // A wide piece may lie beside many narrow ones.
  std::map<std::size_t, std::vector<Polygon>> spaces_of;
  const auto is_space = [&](std::size_t wide, double least) {
    std::vector<Polygon>& spaces = spaces_of[wide];
    if (spaces.empty()) spaces = UnionOf(faces[wide]);
    return std::any_of(spaces.begin(), spaces.end(), [&](const Polygon& space) {
      return !Offset(space, -least).empty();
    });
  };
  std::set<std::size_t> corridors;
  std::map<std::size_t, std::vector<Mouth>> mouths;
  for (const auto& [narrow, wides] : borders) {
    const std::vector<Polygon> outlines = UnionOf(faces[narrow]);
    Extent extent;
    extent.area = outlines.front().Area();
    extent.perimeter = outlines.front().Perimeter();
    const double width = extent.Width();
    if (extent.area < kLeastLength * width * width ||
        extent.area < kLeastCorridor || width < options.min_width) {
      continue;
    }
    corridors.insert(narrow);
    for (const auto& [wide, border] : wides) {
      mouths[wide].push_back(MouthOf(narrow, outlines.front(), border));
    }
  }
  DisjointSets joined(region->size());
  for (const auto& [narrow, wides] : borders) {
    for (const auto& [wide, border] : wides) {
      const double widening =
          GoesStraightOn(narrow, mouths[wide]) ? kLargestBay : options.widening;
      if (corridors.count(narrow) == 0 ||
          !is_space(wide, 0.5 * widening * WidestChain(border))) {
        joined.Join(narrow, wide);
      }
    }
  }
  for (std::size_t i = 0; i < region->size(); ++i) {
    if ((*region)[i] < 0) continue;
    (*region)[i] = static_cast<int>(joined.Find(pieces.Find(i)));
  }
}

// A corridor that was cut off from a wide space goes on through openings as
// wide as it is: while it was a part of that space they were too narrow for it.
// `before`: the regions before corridors were cut off.
void JoinCutCorridors(const Arrangement& arrangement,
                      const RegionOptions& options,
                      const std::vector<int>& before,
                      std::vector<int>* region) {
  std::map<int, double> widths;
  for (;;) {
    std::map<int, std::vector<Polygon>> faces;
    std::map<int, std::set<int>> was;
    std::map<int, std::set<int>> parts;
    for (std::size_t i = 0; i < region->size(); ++i) {
      const int id = (*region)[i];
      if (id < 0) continue;
      faces[id].push_back(arrangement.faces[i]);
      was[id].insert(before[i]);
      parts[before[i]].insert(id);
    }
    const auto is_cut = [&](int id) {
      return std::any_of(was[id].begin(), was[id].end(),
                         [&](int old) { return parts[old].size() > 1; });
    };
    const auto were_one = [&](int a, int b) {
      return std::any_of(was[a].begin(), was[a].end(),
                         [&](int old) { return was[b].count(old) > 0; });
    };
    std::map<std::pair<int, int>, Border> borders;
    for (const ArrangementEdge& edge : arrangement.edges) {
      if (edge.left < 0 || edge.right < 0) continue;
      const auto [a, b] =
          std::minmax({(*region)[static_cast<std::size_t>(edge.left)],
                       (*region)[static_cast<std::size_t>(edge.right)]});
      if (a >= 0 && a != b) borders[{a, b}].Add(edge.line, edge.lengths);
    }
    const auto width_of = [&](int id) {
      const auto known = widths.find(id);
      if (known != widths.end()) return known->second;
      const Polygon outline = UnionOf(faces[id]).front();
      Extent extent;
      extent.area = outline.Area();
      extent.perimeter = outline.Perimeter();
      return widths[id] = extent.Width();
    };
    double best = 0.0;
    std::pair<int, int> which(-1, -1);
    for (const auto& [pair, border] : borders) {
      const auto [a, b] = pair;
      if ((!is_cut(a) && !is_cut(b)) || were_one(a, b)) continue;
      const double width = std::max(width_of(a), width_of(b));
      double through = Through(border.all, width, options);
      for (const auto& [line, lengths] : border.of_line) {
        through = std::max(through, Through(lengths, width, options));
      }
      if (through <= best) continue;
      best = through;
      which = pair;
    }
    if (which.first < 0) return;
    std::replace(region->begin(), region->end(), which.second, which.first);
    // The others are what they were.
    widths.erase(which.first);
  }
}

// What lies between a pocket and what is no room without a wall, m.
struct Exposure {
  double all = 0.0;
  // What was not seen of it, by line.
  std::map<int, double> unseen;
};

// What is too small for a room goes to the neighbor from which least keeps it
// apart: space in front of and behind furniture, seen or not.
void FillPockets(const Arrangement& arrangement, const RegionOptions& options,
                 std::vector<int>* region) {
  const std::size_t size = arrangement.faces.size();
  // Pockets: regions that are no rooms, and narrow faces that were not seen.
  std::map<int, std::vector<Polygon>> parts;
  for (std::size_t i = 0; i < size; ++i) {
    if ((*region)[i] < 0) continue;
    parts[(*region)[i]].push_back(arrangement.faces[i]);
  }
  std::set<int> rooms;
  for (const auto& [id, polygons] : parts) {
    const std::vector<Polygon> outlines = UnionOf(polygons);
    if (outlines[0].Area() >= options.min_area &&
        !IsNarrow(outlines[0], options.min_width)) {
      rooms.insert(id);
    }
  }
  const std::vector<int> hidden = HiddenSpaces(arrangement, options, *region);
  // Pockets have numbers of their own: the region's, or that of the face.
  std::vector<int> pocket(size, -1);
  std::map<int, double> seen;
  std::map<int, double> areas;
  for (std::size_t i = 0; i < size; ++i) {
    if ((*region)[i] >= 0) {
      if (rooms.count((*region)[i]) == 0) pocket[i] = (*region)[i];
    } else if (hidden[i] >= 0) {
      pocket[i] = static_cast<int>(i);
    }
    if (pocket[i] < 0) continue;
    seen[pocket[i]] += arrangement.free[i];
    areas[pocket[i]] += arrangement.faces[i].Area();
  }
  // Wall between hidden spaces as a whole and rooms, by line: lines that meet
  // there cut what stands behind a wall into faces, whose fronts are shorter.
  std::map<std::pair<int, int>, std::map<int, double>> fronts;
  for (const ArrangementEdge& edge : arrangement.edges) {
    for (const auto& [a, b] : {std::make_pair(edge.left, edge.right),
                               std::make_pair(edge.right, edge.left)}) {
      if (a < 0 || b < 0) continue;
      const int space = hidden[static_cast<std::size_t>(a)];
      const int room = (*region)[static_cast<std::size_t>(b)];
      if (space < 0 || room < 0) continue;
      fronts[{space, room}][edge.line] += edge.lengths.Of(Mark::kWall);
    }
  }
  // The longest wall that a pocket has before it.
  const auto front_of = [&](int id, int room, const Border& border) {
    double longest = 0.0;
    for (const auto& [line, lengths] : border.of_line) {
      double front = lengths.Of(Mark::kWall);
      const auto found =
          fronts.find({hidden[static_cast<std::size_t>(id)], room});
      if (found != fronts.end()) {
        const auto on_line = found->second.find(line);
        if (on_line != found->second.end()) {
          front = std::max(front, on_line->second);
        }
      }
      longest = std::max(longest, front);
    }
    return longest;
  };
  for (;;) {
    // Borders of pockets with rooms.
    std::map<std::pair<int, int>, Border> borders;
    std::map<int, double> around;
    std::map<int, Exposure> exposed;
    // Wall around each pocket where it borders on no room.
    std::map<int, double> walled;
    // Wall around each room and pocket, by line; and what was not seen of it.
    std::map<std::pair<int, int>, double> walls;
    std::map<std::pair<int, int>, double> hidden_walls;
    const auto pocket_of = [&](int face) {
      return face < 0 ? -1 : pocket[static_cast<std::size_t>(face)];
    };
    const auto region_of = [&](int face) {
      return face < 0 ? -1 : (*region)[static_cast<std::size_t>(face)];
    };
    for (const ArrangementEdge& edge : arrangement.edges) {
      for (const auto& [a, b] : {std::make_pair(edge.left, edge.right),
                                 std::make_pair(edge.right, edge.left)}) {
        const int from = pocket_of(a);
        const int other = pocket_of(b);
        const int room = region_of(b);
        if (from < 0) {
          if (region_of(a) >= 0 && region_of(a) != room) {
            walls[{region_of(a), edge.line}] += edge.lengths.Of(Mark::kWall);
            hidden_walls[{region_of(a), edge.line}] +=
                edge.lengths.Of(Mark::kUnknown);
          }
          continue;
        }
        if (other == from) continue;
        around[from] += edge.length();
        if (other >= 0 || room < 0) {
          walled[from] += edge.lengths.Of(Mark::kWall);
        }
        if (other < 0 && room < 0) {
          const double open =
              std::max(0.0, edge.length() - std::max(0.0, edge.lengths.holds));
          exposed[from].all += open;
          exposed[from].unseen[edge.line] +=
              std::min(open, edge.lengths.Of(Mark::kUnknown));
          if (seen[from] >= kGlimpse * areas[from]) {
            walls[{from, edge.line}] += edge.lengths.Of(Mark::kWall);
          }
        }
        if (other < 0 && room >= 0) {
          borders[{from, room}].Add(edge.line, edge.lengths);
        }
      }
    }
    // Rooms that a pocket has a door to: of two it is the way from one to the
    // other. And what of its border is that of rooms.
    std::map<int, int> doors;
    std::map<int, double> beside_rooms;
    for (const auto& [pair, border] : borders) {
      doors[pair.first] += border.all.Of(Mark::kDoor) >= kLeastOpening;
      beside_rooms[pair.first] += border.all.length();
    }
    const auto length_on = [](const std::map<std::pair<int, int>, double>& of,
                              int line, int id) {
      const auto found = of.find({id, line});
      return found == of.end() ? 0.0 : found->second;
    };
    double best = 0.0;
    std::pair<int, int> which(-1, -1);
    for (const auto& [pair, border] : borders) {
      // Long and open borders before short and closed ones.
      const double length = border.all.length();
      if (length < kLeastPocketBorder * around[pair.first]) continue;
      // A room of which little was seen through its door is no niche.
      if (seen[pair.first] >= kSeenThroughDoor && doors[pair.first] < 2 &&
          border.all.Of(Mark::kDoor) > kDoorBorder * length) {
        continue;
      }
      // Space beyond a wall is no part of what lies before it. Behind furniture
      // the walls of the room go on.
      double open = exposed[pair.first].all;
      // Behind a wall that is longer than furniture, where nothing was seen and
      // lines alone close it, the walls beside it do: where the outside of a
      // building bends outwards.
      if (seen[pair.first] < kGlimpse * areas[pair.first] &&
          beside_rooms[pair.first] < kWithinRooms * around[pair.first] &&
          walled[pair.first] <
              kWalled * (around[pair.first] - beside_rooms[pair.first]) &&
          front_of(pair.first, pair.second, border) > kLongestFurniture) {
        continue;
      }
      const bool is_furniture = std::none_of(
          border.of_line.begin(), border.of_line.end(), [&](const auto& entry) {
            const double front = entry.second.Of(Mark::kWall);
            return front > kLongestFurniture ||
                   areas[pair.first] < kLeastDepth * front;
          });
      for (const auto& [line, unseen] : exposed[pair.first].unseen) {
        const double wall = length_on(walls, line, pair.first) +
                            length_on(walls, line, pair.second);
        const double hidden =
            unseen + length_on(hidden_walls, line, pair.second);
        if (is_furniture && line >= 0 &&
            wall >= std::max(kGoesOn, kSeenOfIt * hidden)) {
          open -= unseen;
        }
      }
      if (open > kMaxExposed * around[pair.first]) continue;
      const double score =
          (2.0 * length - border.all.holds) / around[pair.first];
      if (score > best) {
        best = score;
        which = pair;
      }
    }
    if (which.first < 0) return;
    for (std::size_t i = 0; i < size; ++i) {
      if (pocket[i] != which.first) continue;
      pocket[i] = -1;
      (*region)[i] = which.second;
    }
  }
}

}  // namespace

std::vector<int> FindRegions(const Arrangement& arrangement,
                             const RegionOptions& options) {
  Regions regions(arrangement, InsideOf(arrangement, options), options);
  regions.JoinOpen(options);
  regions.JoinThrough(options);
  std::vector<int> region = regions.region();
  FillPockets(arrangement, options, &region);
  const std::vector<int> whole = region;
  CutCorridors(arrangement, options, &region);
  JoinCutCorridors(arrangement, options, whole, &region);
  return region;
}

}  // namespace plumbline
