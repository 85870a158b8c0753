#include <plumbline/core/disjoint_sets.h>
#include <plumbline/plan/arrangement.h>
#include <plumbline/plan/building_plan.h>
#include <plumbline/plan/drawn_lines.h>
#include <plumbline/plan/free_standing.h>
#include <plumbline/plan/furniture_rows.h>
#include <plumbline/plan/narrow_ends.h>
#include <plumbline/plan/room_shape.h>
#include <plumbline/plan/rooms_with_doors.h>
#include <plumbline/plan/sides.h>
#include <plumbline/plan/unseen_walls.h>
#include <plumbline/plan/wall_fronts.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// A wall of which only one face was seen is drawn this thick, m.
constexpr double kThinnestWall = 0.1;
// From this share of openings on a side of a room is no wall.
constexpr double kOpenSide = 0.75;
// Narrower openings are flaws of what closes a space without a wall, m.
constexpr double kFlaw = 0.3;
// Between the ends of two walls that are offset by no more than this there is a
// wall, too, though nothing was seen of it, m.
constexpr double kLongestJog = 1.0;
// A wide opening is a door when the wall between the two rooms goes on beside
// it for so many samples.
constexpr int kLeastJamb = 6;
// So many samples of a line are wall beside an opening, more than those where
// another wall meets it.
constexpr int kLeastOwnJamb = 5;
// What stands along a wall leaves less free space behind it than this, m; and
// how many rays to each side look for it.
constexpr double kDeeperThanFurniture = 1.0;
constexpr int kRaysAside = 3;
// Returns of the back of a niche lie at one depth to this, m, along this share
// of its width.
constexpr double kSameDepth = 0.1;
constexpr double kNicheShare = 0.6;
// A wall that stands within a room is so long at least, m, and was seen from
// both sides along this share: so far before its faces, m, is free floor, near
// them and deeper than a cupboard.
constexpr double kLeastStanding = 1.5;
constexpr double kSeenFromBoth = 0.5;
constexpr double kBeforeFace = 0.2;
constexpr double kBeforeCupboard = 0.6;
// A wall beyond all rooms is so long at least, m, where it meets another one,
// which is so near to its end, m, and where it stands alone, with cracks up to
// this, m, between its pieces.
constexpr double kLeastBeyond = 2.0;
constexpr double kMeetsBeyond = 0.2;
constexpr double kLeastAlone = 4.0;
constexpr double kCrack = 0.3;
// Walls without a trace are looked for again in the parts of a region, up to so
// many times.
constexpr int kUnseenRounds = 3;
// A corridor that leads to one room or none has so much floor, m^2.
constexpr double kLeastDeadEnd = 15.0;
// A way outside of all rooms is longer than this, m, and a larger share of all
// poses, where a space is missing. Lines are drawn on by so much farther then,
// if no more than so much of that way is left outside.
constexpr double kLongOutside = 10.0;
constexpr double kOftenOutside = 0.05;
constexpr double kFarther = 2.0;
constexpr double kLessOutside = 0.5;
// In a doorway the robot is outside of the rooms on both sides for no more than
// this, m.
constexpr double kDoorway = 2.0;
// What is a room then has so much wall around it, and lies open for no more.
constexpr double kClosedHall = 0.6;
constexpr double kOpenHall = 0.2;
// Rooms with an opening of this between them are reached from each other, m:
// the leaf of a door may hide much of it.
constexpr double kLeastWay = 0.25;
// Share of a room's width that makes an opening one of its whole width.
constexpr double kWholeWidth = 0.6;
// Doors between the same rooms nearer to each other than this are one, m.
constexpr double kSameDoor = 0.8;
// Doors at both ends of a passage through a wall face each other, by a cosine,
// so far from each other at most, m, and so far aside, m.
constexpr double kFacing = 0.95;
constexpr double kDeepestPassage = 2.0;
constexpr double kOffsetInPassage = 0.3;
// Walls with nearly one direction, by its cosine, whose lines or the middles of
// whose bodies are so near to each other, m, along so much, m, are one; what is
// left of the shorter one is a wall from this length on, m.
constexpr double kSameWallCosine = 0.996;
constexpr double kSameWall = 0.15;
constexpr double kLeastDouble = 0.4;
constexpr double kLeastRest = 0.1;

// How far the face of a line's wall lies to the left of a piece of it, m: where
// most of the wall is seen from there.
double FaceOf(const DrawnLine& on, const Vector2d& begin, const Vector2d& end,
              const SpaceGrid& space) {
  const WallLine& line = on.line;
  double from = line.Along(begin);
  double to = line.Along(end);
  const bool is_forward = from < to;
  if (!is_forward) std::swap(from, to);
  const double low = is_forward ? line.low : -line.high;
  const double high = is_forward ? line.high : -line.low;
  const Vector2d left = is_forward ? line.normal() : Vector2d(-line.normal());
  const WallProfile& profile = on.profile;
  std::vector<double> faces;
  int open = 0;
  const int first = std::max(0, profile.IndexOf(from));
  const int last = std::min(profile.size() - 1, profile.IndexOf(to));
  for (int i = first; i <= last; ++i) {
    const Mark mark = profile.marks[static_cast<std::size_t>(i)];
    open += mark == Mark::kOpen || mark == Mark::kDoor;
    if (mark != Mark::kWall) continue;
    const Vector2d here = line.At(profile.MiddleOf(i));
    for (double v = high + kBesideWall; v >= low - kBesideWall;
         v -= 0.5 * space.resolution) {
      if (space.At(Vector2d(here + v * left)) != Space::kOccupied) continue;
      // The cell's middle.
      faces.push_back(v - 0.25 * space.resolution);
      break;
    }
  }
  // Spaces that lie open to each other meet in the middle.
  if (open > kOpenSide * (last - first + 1)) return 0.0;
  if (faces.size() < 4) return high;
  const auto middle =
      faces.begin() + static_cast<std::ptrdiff_t>(faces.size() / 2);
  std::nth_element(faces.begin(), middle, faces.end());
  return *middle;
}

// A ring with each edge moved to the left, from the middle of its wall to the
// face.
Ring FacesOfRing(const std::vector<DrawnLine>& drawn, const SpaceGrid& space,
                 const Ring& ring) {
  struct Side {
    Vector2d point, along;
  };
  std::vector<Side> sides;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vector2d& a = ring[i];
    const Vector2d& b = ring[(i + 1) % ring.size()];
    const Vector2d along = (b - a).normalized();
    const int on = LineOf(drawn, a, b);
    double shift = 0.0;
    if (on >= 0) {
      shift = FaceOf(drawn[static_cast<std::size_t>(on)], a, b, space);
    }
    sides.push_back({a + shift * Vector2d(-along[1], along[0]), along});
  }
  Ring moved;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Side& before = sides[(i + ring.size() - 1) % ring.size()];
    const Side& after = sides[i];
    const double sine =
        before.along[0] * after.along[1] - before.along[1] * after.along[0];
    if (std::abs(sine) > 0.2) {
      const Vector2d between = after.point - before.point;
      const double t =
          (between[0] * after.along[1] - between[1] * after.along[0]) / sine;
      moved.push_back(before.point + t * before.along);
    } else {
      // Nearly in line: a step where the faces are not.
      moved.push_back(before.point +
                      before.along.dot(ring[i] - before.point) * before.along);
      if ((after.point - moved.back()).norm() > 1e-3) {
        moved.push_back(after.point);
      }
    }
  }
  return moved;
}

// The outline between the faces of the walls.
Polygon Within(const std::vector<DrawnLine>& drawn, const SpaceGrid& space,
               const Polygon& outline) {
  Polygon polygon;
  polygon.shell = FacesOfRing(drawn, space, outline.shell);
  for (const Ring& hole : outline.holes) {
    polygon.holes.push_back(FacesOfRing(drawn, space, hole));
  }
  return Mended(polygon);
}

// Regions that are rooms, the largest first.
std::vector<PlanRoom> RoomsOf(const Arrangement& arrangement,
                              const std::vector<int>& region,
                              const std::vector<DrawnLine>& drawn,
                              const SpaceGrid& space,
                              const BuildingPlanOptions& options,
                              std::vector<int>* room_of_face) {
  std::map<int, std::vector<Polygon>> parts;
  std::map<int, double> free;
  std::map<int, BorderLengths> borders;
  for (std::size_t i = 0; i < region.size(); ++i) {
    if (region[i] < 0) continue;
    parts[region[i]].push_back(arrangement.faces[i]);
    free[region[i]] += arrangement.free[i];
  }
  const auto region_of = [&](int face) {
    return face < 0 ? -1 : region[static_cast<std::size_t>(face)];
  };
  for (const ArrangementEdge& edge : arrangement.edges) {
    const int left = region_of(edge.left);
    const int right = region_of(edge.right);
    if (left == right) continue;
    if (left >= 0) borders[left].Add(edge.lengths);
    if (right >= 0) borders[right].Add(edge.lengths);
  }
  std::vector<std::pair<int, PlanRoom>> rooms;
  for (const auto& [id, polygons] : parts) {
    const BorderLengths& border = borders[id];
    if (border.Of(Mark::kWall) + border.Of(Mark::kDoor) <
            options.min_closed * border.length() ||
        border.Of(Mark::kOpen) > options.max_open * border.length()) {
      continue;
    }
    // Parts that touch in a corner only are left to the largest.
    PlanRoom room;
    room.outline = Within(drawn, space, UnionOf(polygons).front());
    room.area = room.outline.Area();
    if (room.area < options.regions.min_area ||
        free[id] < options.min_free * room.area ||
        Offset(room.outline, -0.5 * options.regions.min_width).empty()) {
      continue;
    }
    rooms.emplace_back(id, std::move(room));
  }
  std::stable_sort(rooms.begin(), rooms.end(),
                   [](const auto& a, const auto& b) {
                     return a.second.area > b.second.area;
                   });
  std::map<int, int> index;
  std::vector<PlanRoom> sorted;
  for (auto& [id, room] : rooms) {
    index[id] = static_cast<int>(sorted.size());
    sorted.push_back(std::move(room));
  }
  room_of_face->assign(region.size(), -1);
  for (std::size_t i = 0; i < region.size(); ++i) {
    const auto found = index.find(region[i]);
    if (found != index.end()) (*room_of_face)[i] = found->second;
  }
  return sorted;
}

// Drops rooms that open in their whole width to what is no room, while no way
// through doors and openings leads to them from a room that the robot was in.
// For a robot that drove outside these are alleys between houses and gaps
// between cars; within a building they are the parts of rooms that were seen
// through a door.
void DropUnreached(const Arrangement& arrangement, std::vector<PlanRoom>* rooms,
                   std::vector<int>* room_of_face) {
  const auto room_of = [&](int face) {
    return face < 0 ? -1 : (*room_of_face)[static_cast<std::size_t>(face)];
  };
  DisjointSets linked(rooms->size());
  std::map<std::pair<int, int>, double> openings;
  for (const ArrangementEdge& edge : arrangement.edges) {
    const auto sides = std::minmax({room_of(edge.left), room_of(edge.right)});
    if (sides.first == sides.second) continue;
    openings[sides] +=
        edge.lengths.Of(Mark::kOpen) + edge.lengths.Of(Mark::kDoor);
  }
  std::vector<bool> is_open(rooms->size(), false);
  for (const auto& [sides, width] : openings) {
    if (sides.first < 0) {
      const auto room = static_cast<std::size_t>(sides.second);
      is_open[room] =
          width >= kWholeWidth * SidesOfRectangle((*rooms)[room].outline).first;
    } else if (width >= kLeastWay) {
      linked.Join(static_cast<std::size_t>(sides.first),
                  static_cast<std::size_t>(sides.second));
    }
  }
  std::vector<bool> is_reached(rooms->size(), false);
  for (std::size_t i = 0; i < rooms->size(); ++i) {
    if ((*rooms)[i].is_entered) is_reached[linked.Find(i)] = true;
  }
  std::vector<int> index;
  std::vector<PlanRoom> kept;
  for (std::size_t i = 0; i < rooms->size(); ++i) {
    const bool is_kept = is_reached[linked.Find(i)] || !is_open[i];
    index.push_back(is_kept ? static_cast<int>(kept.size()) : -1);
    if (is_kept) kept.push_back(std::move((*rooms)[i]));
  }
  for (int& room : *room_of_face) {
    if (room >= 0) room = index[static_cast<std::size_t>(room)];
  }
  *rooms = std::move(kept);
}

// A strip that leads to no more than one other room is the part of a room that
// was seen beside its furniture, or a closet, when it is small.
PlanRoom::Kind KindOf(const PlanRoom& room) {
  const bool leads_on = room.neighbors.size() > 1 || room.area >= kLeastDeadEnd;
  return leads_on && IsLongAndNarrow(room.outline) ? PlanRoom::Kind::kCorridor
                                                   : PlanRoom::Kind::kRoom;
}

// A straight wall from sample `first` to `last` (not included) of a line.
PlanWall WallBetween(const DrawnLine& on, const Sides& sides, int first,
                     int last, const SpaceGrid& space) {
  const double from = on.profile.begin + first * WallProfile::kStep;
  const double to = on.profile.begin + last * WallProfile::kStep;
  PlanWall wall;
  wall.begin = on.line.At(from);
  wall.end = on.line.At(to);
  wall.left = FaceOf(on, wall.begin, wall.end, space);
  wall.right = FaceOf(on, wall.end, wall.begin, space);
  // Round the corner at an end where there is no opening.
  const double half = 0.5 * (wall.left + wall.right);
  const auto is_corner = [&](int outside) {
    return outside < 0 || outside >= on.profile.size() ||
           sides.left[static_cast<std::size_t>(outside)] == Sides::kNone;
  };
  if (is_corner(first - 1)) wall.begin -= half * on.line.along;
  if (is_corner(last)) wall.end += half * on.line.along;
  const double missing = kThinnestWall - (wall.left + wall.right);
  if (missing > 0.0) {
    // Nobody saw the other face: it lies away from the room.
    const auto middle = static_cast<std::size_t>((first + last) / 2);
    const bool has_left = sides.left[middle] >= 0;
    const bool has_right = sides.right[middle] >= 0;
    wall.left += has_left == has_right ? 0.5 * missing : !has_left * missing;
    wall.right += has_left == has_right ? 0.5 * missing : !has_right * missing;
  }
  return wall;
}

// How lines of walls divide the plane.
struct Division {
  std::vector<DrawnLine> drawn;
  Arrangement arrangement;
  std::vector<int> region;
};

std::vector<DrawnLine> DrawAndMeasure(const std::vector<WallLine>& lines,
                                      const SpaceGrid& space,
                                      const BuildingPlanOptions& options) {
  std::vector<DrawnLine> drawn =
      DrawLines(lines, options.reach, options.beyond);
  MeasureLines(space, options.doors, &drawn);
  return drawn;
}

Division Divide(std::vector<DrawnLine> drawn, const SpaceGrid& space,
                const std::vector<Pose2>& path,
                const BuildingPlanOptions& options) {
  Division division;
  division.drawn = std::move(drawn);
  division.arrangement = Arrange(division.drawn, space);
  division.region = FindRegions(division.arrangement, options.regions);
  JoinAcrossFurniture(division.arrangement, division.drawn, path,
                      &division.region);
  JoinAcrossFreeStanding(space, division.arrangement, division.drawn,
                         &division.region);
  JoinNarrowEnds(division.arrangement, path, &division.region);
  GiveFrontsToRooms(division.arrangement, division.drawn, &division.region);
  return division;
}

void Append(const std::vector<WallLine>& more, std::vector<WallLine>* lines) {
  lines->insert(lines->end(), more.begin(), more.end());
}

bool Cross(const Vector2d& a, const Vector2d& b, const Vector2d& c,
           const Vector2d& d) {
  const auto side = [](const Vector2d& p, const Vector2d& q,
                       const Vector2d& r) {
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]) > 0.0;
  };
  return side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b);
}

// Whether free space was seen deeper than a cupboard behind an opening, from
// sample `first` to `last` (not included), on its left (`side` 1) or right
// (-1): gaps between cupboards lead to the wall behind them.
bool LeadsSomewhere(const DrawnLine& on, int first, int last, int side,
                    const SpaceGrid& space) {
  const Vector2d beyond = side * on.line.normal();
  const double face = side > 0 ? on.line.high : -on.line.low;
  const double step = 0.5 * space.resolution;
  for (int i = first; i < last; ++i) {
    const Vector2d begin =
        on.line.At(on.profile.MiddleOf(i)) + (face + kBesideWall) * beyond;
    for (int k = -kRaysAside; k <= kRaysAside; ++k) {
      const double slope = static_cast<double>(k) / kRaysAside;
      const Vector2d way = beyond + slope * on.line.along;
      double depth = 0.0;
      while (depth < kDeeperThanFurniture &&
             space.At(Vector2d(begin + depth * way)) == Space::kFree) {
        depth += step;
      }
      if (depth >= kDeeperThanFurniture) return true;
    }
  }
  return false;
}

// What lies behind an opening that leads nowhere, from sample `first` to `last`
// (not included), on the left (`side` 1) or right (-1) of a line: the shut door
// of a recess, the back of a niche. A wall where returns lie at one depth, and
// its sides.
void AddNiche(const DrawnLine& on, int first, int last, int side,
              const SpaceGrid& space, std::vector<PlanWall>* walls) {
  const Vector2d beyond = side * on.line.normal();
  const double face = side > 0 ? on.line.high : -on.line.low;
  std::vector<double> depths;
  for (int i = first; i < last; ++i) {
    const Vector2d begin = on.line.At(on.profile.MiddleOf(i));
    for (double depth = face + kBesideWall; depth <= kDeeperThanFurniture;
         depth += 0.5 * space.resolution) {
      if (space.At(Vector2d(begin + depth * beyond)) != Space::kOccupied) {
        continue;
      }
      depths.push_back(depth);
      break;
    }
  }
  if (depths.empty()) return;
  const auto middle =
      depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const double depth = *middle;
  const auto near = std::count_if(
      depths.begin(), depths.end(),
      [&](double other) { return std::abs(other - depth) <= kSameDepth; });
  if (static_cast<double>(near) < kNicheShare * (last - first)) return;
  // Nobody saw how thick the walls around it are; they lie outside of it.
  const double half = 0.5 * kThinnestWall;
  PlanWall wall;
  wall.left = wall.right = half;
  const Vector2d begin =
      on.line.At(on.profile.begin + first * WallProfile::kStep);
  const Vector2d end = on.line.At(on.profile.begin + last * WallProfile::kStep);
  for (const Vector2d& jamb : {Vector2d(begin - half * on.line.along),
                               Vector2d(end + half * on.line.along)}) {
    wall.begin = jamb;
    wall.end = jamb + depth * beyond;
    walls->push_back(wall);
  }
  wall.begin = begin + (depth + half) * beyond;
  wall.end = end + (depth + half) * beyond;
  walls->push_back(wall);
}

// Whether two samples lie between the same rooms.
bool AreSame(const Sides& sides, int a, int b) {
  const auto i = static_cast<std::size_t>(a);
  const auto j = static_cast<std::size_t>(b);
  return sides.left[i] == sides.left[j] && sides.right[i] == sides.right[j];
}

// Whether the wall beside an opening, from sample `first` to `last` (not
// included), stands between the same two rooms.
bool HasJamb(const Sides& sides, const std::vector<bool>& is_open, int first,
             int last) {
  const int count = static_cast<int>(is_open.size());
  const int middle = (first + last) / 2;
  const auto has_wall = [&](int begin, int end) {
    int wall = 0;
    for (int k = std::max(0, begin); k < std::min(end, count); ++k) {
      wall +=
          AreSame(sides, k, middle) && !is_open[static_cast<std::size_t>(k)];
    }
    return wall >= kLeastJamb;
  };
  return has_wall(first - 2 * kLeastJamb, first) ||
         has_wall(last, last + 2 * kLeastJamb);
}

// Whether an opening, from sample `first` to `last` (not included), has a piece
// of its own wall on both sides, and not the wall across its end on one: beside
// the end of a bed or of a shelf there is a gap up to the wall. A wall across
// is no thicker than twice such a piece; where more stands, it is the opening's
// own, though the border of the room may run beside it.
bool HasBothJambs(const WallProfile& profile, const Sides& sides, int first,
                  int last) {
  const int middle = (first + last) / 2;
  const auto has_wall = [&](int from, int step) {
    int wall = 0;
    int own = 0;
    for (int k = from; k >= 0 && k < profile.size() &&
                       wall < 2 * kLeastOwnJamb && profile.At(k) == Mark::kWall;
         k += step) {
      ++wall;
      own += AreSame(sides, k, middle);
    }
    return own >= kLeastOwnJamb || wall >= 2 * kLeastOwnJamb;
  };
  return has_wall(first - 1, -1) && has_wall(last, 1);
}

// Walls and doors along a line.
void ReadLine(const DrawnLine& on, const Sides& sides, const SpaceGrid& space,
              const BuildingPlanOptions& options, BuildingPlan* plan) {
  const int count = on.profile.size();
  const auto is_border = [&](int i) {
    return sides.left[static_cast<std::size_t>(i)] != Sides::kNone;
  };
  // Runs that are open; short ones are flaws of the wall.
  std::vector<bool> is_open(static_cast<std::size_t>(count), false);
  for (int i = 0; i < count;) {
    const auto open = [&](int k) {
      return on.profile.At(k) == Mark::kOpen || on.profile.At(k) == Mark::kDoor;
    };
    int j = i;
    while (j < count && open(j)) ++j;
    // What is too narrow for a door is a crack beside a cupboard or a pane in
    // the wall, which goes on behind it.
    const double width = (j - i) * WallProfile::kStep;
    if (on.line.is_wall ? width + space.resolution >= options.min_door
                        : width >= kFlaw) {
      std::fill(is_open.begin() + i, is_open.begin() + j, true);
    }
    i = std::max(j, i + 1);
  }
  for (int i = 0; i < count;) {
    if (!is_border(i)) {
      ++i;
      continue;
    }
    const bool open = is_open[static_cast<std::size_t>(i)];
    int j = i;
    while (j < count && is_border(j) &&
           is_open[static_cast<std::size_t>(j)] == open) {
      ++j;
    }
    if (!open) {
      if (on.line.is_wall || (j - i) * WallProfile::kStep <= kLongestJog) {
        plan->walls.push_back(WallBetween(on, sides, i, j, space));
      }
      i = j;
      continue;
    }
    // Where a corridor ends as wide as it is there is no door. An opening onto
    // two rooms beside each other may be one to one of them.
    if ((j - i) * WallProfile::kStep + space.resolution >
            options.doors.narrow &&
        !HasJamb(sides, is_open, i, j)) {
      const int last = j;
      for (j = i; j < last && AreSame(sides, i, j);) ++j;
      if (!HasJamb(sides, is_open, i, j)) {
        i = j;
        continue;
      }
    }
    const auto middle = static_cast<std::size_t>((i + j) / 2);
    PlanDoor door;
    // Jambs lie in the middle of their cells.
    const double margin = 0.5 * space.resolution;
    door.begin = on.line.At(on.profile.begin + i * WallProfile::kStep - margin);
    door.end = on.line.At(on.profile.begin + j * WallProfile::kStep + margin);
    door.thickness = on.line.high - on.line.low;
    door.rooms = {std::max(-1, sides.left[middle]),
                  std::max(-1, sides.right[middle])};
    const bool is_between = i > 0 && j < count && on.line.is_wall;
    const bool has_both = door.rooms[0] >= 0 && door.rooms[1] >= 0;
    const bool is_door =
        has_both ||
        LeadsSomewhere(on, i, j, door.rooms[0] >= 0 ? -1 : 1, space);
    if (!has_both && is_door && !HasBothJambs(on.profile, sides, i, j)) {
      i = j;
      continue;
    }
    if (is_between && is_door && door.width() >= options.min_door &&
        door.width() <= (!has_both ? options.doors.narrow
                         : on.profile.marks[middle] == Mark::kDoor
                             ? options.doors.widest_front
                             : options.doors.wide)) {
      plan->doors.push_back(door);
    } else if (is_between && !is_door && door.width() <= options.doors.wide) {
      AddNiche(on, i, j, door.rooms[0] >= 0 ? -1 : 1, space, &plan->walls);
    }
    i = j;
  }
}

// Walls that end within a room and divide nothing: thin, and seen from both
// sides, while the edge of a piece of furniture is seen from one. `lines`: of
// one wall, in their order.
void AddStandingWalls(const std::vector<std::size_t>& lines,
                      const std::vector<DrawnLine>& drawn,
                      const std::vector<Sides>& sides, const SpaceGrid& space,
                      BuildingPlan* plan) {
  struct Sample {
    std::size_t line;
    int i;
  };
  std::vector<Sample> samples;
  for (const std::size_t line : lines) {
    for (int i = 0; i < drawn[line].profile.size(); ++i) {
      samples.push_back({line, i});
    }
  }
  const auto stands_at = [&](const Sample& at) {
    const WallProfile& profile = drawn[at.line].profile;
    return profile.At(at.i) == Mark::kWall &&
           profile.in_row[static_cast<std::size_t>(at.i)] &&
           sides[at.line].left[static_cast<std::size_t>(at.i)] == Sides::kNone;
  };
  // The room on one side (1: left), -1 when there is no free floor before the
  // face that is deeper than a cupboard.
  const auto room_beside = [&](const Sample& at, int side) {
    const WallLine& line = drawn[at.line].line;
    const double face = side > 0 ? line.high : -line.low;
    const auto before = [&](double depth) {
      return Vector2d(line.At(drawn[at.line].profile.MiddleOf(at.i)) +
                      side * (face + depth) * line.normal());
    };
    if (space.At(before(kBeforeFace)) != Space::kFree ||
        space.At(before(kBeforeCupboard)) != Space::kFree) {
      return -1;
    }
    for (std::size_t k = 0; k < plan->rooms.size(); ++k) {
      if (plan->rooms[k].outline.Contains(before(kBeforeFace)) &&
          plan->rooms[k].outline.Contains(before(kBeforeCupboard))) {
        return static_cast<int>(k);
      }
    }
    return -1;
  };
  for (std::size_t i = 0; i < samples.size();) {
    std::size_t j = i;
    int seen = 0;
    for (; j < samples.size() && stands_at(samples[j]); ++j) {
      const int left = room_beside(samples[j], 1);
      seen += left >= 0 && left == room_beside(samples[j], -1);
    }
    const auto size = static_cast<double>(j - i);
    if (size * WallProfile::kStep >= kLeastStanding &&
        seen >= kSeenFromBoth * size) {
      for (std::size_t first = i; first < j;) {
        std::size_t last = first;
        const std::size_t line = samples[first].line;
        while (last < j && samples[last].line == line) ++last;
        plan->walls.push_back(WallBetween(drawn[line], sides[line],
                                          samples[first].i,
                                          samples[last - 1].i + 1, space));
        first = last;
      }
    }
    i = std::max(j, i + 1);
  }
}

// Whether an end of `wall` lies on one of the first `count` of `walls`.
bool MeetsOne(const PlanWall& wall, std::size_t count,
              const std::vector<PlanWall>& walls) {
  const auto lies_on = [](const Vector2d& end, const PlanWall& other) {
    const Vector2d way = other.end - other.begin;
    const double length = way.norm();
    if (length <= 0.0) return false;
    const Vector2d along = way / length;
    const Vector2d from = end - other.begin;
    const double t = from.dot(along);
    const double aside = along.x() * from.y() - along.y() * from.x();
    return t >= -kMeetsBeyond && t <= length + kMeetsBeyond &&
           aside <= other.left + kMeetsBeyond &&
           aside >= -other.right - kMeetsBeyond;
  };
  return std::any_of(
      walls.begin(), walls.begin() + static_cast<std::ptrdiff_t>(count),
      [&](const PlanWall& other) {
        return lies_on(wall.begin, other) || lies_on(wall.end, other);
      });
}

// Walls that bound no room: those of a yard, of the open side of a hall, or of
// what was seen through a door but is no room. They were seen from a side with
// free floor deeper than a cupboard that belongs to no room. The first `count`
// walls of the plan are those of its rooms.
void AddWallsBeyondRooms(const DrawnLine& on, const Sides& sides,
                         const SpaceGrid& space, std::size_t count,
                         BuildingPlan* plan) {
  const WallProfile& profile = on.profile;
  const auto is_free_beyond = [&](const Vector2d& point) {
    return space.At(point) == Space::kFree &&
           std::none_of(plan->rooms.begin(), plan->rooms.end(),
                        [&](const PlanRoom& room) {
                          return room.outline.Contains(point);
                        });
  };
  const auto is_seen_from = [&](int i, int side) {
    const double face = side > 0 ? on.line.high : -on.line.low;
    const auto before = [&](double depth) {
      return Vector2d(on.line.At(profile.MiddleOf(i)) +
                      side * (face + depth) * on.line.normal());
    };
    return is_free_beyond(before(kBeforeFace)) &&
           is_free_beyond(before(kBeforeCupboard));
  };
  const auto is_beyond = [&](int i) {
    return sides.left[static_cast<std::size_t>(i)] == Sides::kNone;
  };
  const auto stands_at = [&](int i) {
    return is_beyond(i) && profile.At(i) == Mark::kWall &&
           profile.in_row[static_cast<std::size_t>(i)] &&
           (is_seen_from(i, 1) || is_seen_from(i, -1));
  };
  const int crack = static_cast<int>(kCrack / WallProfile::kStep);
  for (int i = 0; i < profile.size();) {
    if (!stands_at(i)) {
      ++i;
      continue;
    }
    int end = i + 1;
    for (int k = end; k < profile.size() && k - end < crack && is_beyond(k);
         ++k) {
      if (stands_at(k)) end = k + 1;
    }
    const double length = (end - i) * WallProfile::kStep;
    if (length >= kLeastBeyond) {
      const PlanWall wall = WallBetween(on, sides, i, end, space);
      if (length >= kLeastAlone || MeetsOne(wall, count, plan->walls)) {
        plan->walls.push_back(wall);
      }
    }
    i = end;
  }
}

// Doors that two lines close together found twice.
void DropDoubleDoors(std::vector<PlanDoor>* doors) {
  std::vector<PlanDoor> kept;
  for (const PlanDoor& door : *doors) {
    const Vector2d middle = 0.5 * (door.begin + door.end);
    const bool is_double =
        std::any_of(kept.begin(), kept.end(), [&](const PlanDoor& other) {
          const Vector2d there = 0.5 * (other.begin + other.end);
          const bool is_same_pair = std::minmax(door.rooms[0], door.rooms[1]) ==
                                    std::minmax(other.rooms[0], other.rooms[1]);
          return is_same_pair && (middle - there).norm() < kSameDoor;
        });
    if (!is_double) kept.push_back(door);
  }
  *doors = std::move(kept);
}

// Makes one door of two that face each other through a thick wall, each between
// a room and the passage, which is too small to be one.
void JoinDoorsOfPassages(const SpaceGrid& space, std::vector<PlanDoor>* doors) {
  const auto middle = [](const PlanDoor& door) {
    return Vector2d(0.5 * (door.begin + door.end));
  };
  // Where the passage lies: 0 left, 1 right, -1: it is no such door.
  const auto side_of_passage = [](const PlanDoor& door) {
    if ((door.rooms[0] < 0) == (door.rooms[1] < 0)) return -1;
    return door.rooms[0] < 0 ? 0 : 1;
  };
  const auto to_passage = [&](const PlanDoor& door) {
    const Vector2d along = (door.end - door.begin).normalized();
    const Vector2d left(-along[1], along[0]);
    return Vector2d(side_of_passage(door) == 0 ? left : Vector2d(-left));
  };
  const auto are_one = [&](const PlanDoor& a, const PlanDoor& b) {
    if (side_of_passage(a) < 0 || side_of_passage(b) < 0) return false;
    // Two doors of one room on the passage are no door of a thick wall.
    if (std::max(a.rooms[0], a.rooms[1]) == std::max(b.rooms[0], b.rooms[1])) {
      return false;
    }
    const Vector2d way = middle(b) - middle(a);
    const Vector2d through = to_passage(a);
    if (through.dot(to_passage(b)) > -kFacing ||
        through.dot(way) > kDeepestPassage || through.dot(way) <= 0.0 ||
        (way - through.dot(way) * through).norm() > kOffsetInPassage) {
      return false;
    }
    const double length = way.norm();
    for (double t = 0.0; t < length; t += 0.5 * space.resolution) {
      if (space.At(Vector2d(middle(a) + t / length * way)) != Space::kFree) {
        return false;
      }
    }
    return true;
  };
  for (std::size_t i = 0; i < doors->size(); ++i) {
    for (std::size_t j = i + 1; j < doors->size(); ++j) {
      PlanDoor& door = (*doors)[i];
      const PlanDoor& other = (*doors)[j];
      if (!are_one(door, other)) continue;
      const int side = side_of_passage(door);
      door.rooms[static_cast<std::size_t>(side)] =
          other.rooms[static_cast<std::size_t>(1 - side_of_passage(other))];
      door.thickness = (middle(other) - middle(door)).norm();
      const bool is_reversed =
          (door.end - door.begin).dot(other.end - other.begin) < 0.0;
      door.begin = 0.5 * (door.begin + (is_reversed ? other.end : other.begin));
      door.end = 0.5 * (door.end + (is_reversed ? other.begin : other.end));
      doors->erase(doors->begin() + static_cast<std::ptrdiff_t>(j));
      break;
    }
  }
}

// How much of the robot's way lies in rooms.
struct WayInRooms {
  // Poses.
  int inside = 0;
  int outside = 0;
  // m
  double outside_length = 0.0;
};

// Calls `visit` with the room (-1: none) of every pose that is one, in order,
// and how far it is from the one before, m. Where the way breaks off, 0.
template <typename Visit>
void ForEachRoomOnWay(const std::vector<Pose2>& path,
                      const std::vector<PlanRoom>& rooms, const Visit& visit) {
  std::size_t last = 0;  // mostly the robot is where it was before
  const auto room_at = [&](const Vector2d& place) {
    for (std::size_t i = 0; i < rooms.size(); ++i) {
      const std::size_t which = (last + i) % rooms.size();
      if (!rooms[which].outline.Contains(place)) continue;
      last = which;
      return static_cast<int>(which);
    }
    return -1;
  };
  Vector2d before = Vector2d::Constant(std::nan(""));
  for (const Pose2& pose : path) {
    const Vector2d here = pose.head<2>();
    if (here.allFinite()) {
      visit(room_at(here), before.allFinite() ? (here - before).norm() : 0.0);
    }
    before = here;
  }
}

// Marks the rooms that the robot was in.
WayInRooms MarkEntered(const std::vector<Pose2>& path,
                       std::vector<PlanRoom>* rooms) {
  WayInRooms way;
  ForEachRoomOnWay(path, *rooms, [&](int room, double step) {
    if (room >= 0) {
      (*rooms)[static_cast<std::size_t>(room)].is_entered = true;
      ++way.inside;
    } else {
      ++way.outside;
      way.outside_length += step;
    }
  });
  return way;
}

// How far the robot went outside of all rooms, m, but for doorways.
double WayOutside(const std::vector<Pose2>& path,
                  const std::vector<PlanRoom>& rooms) {
  double all = 0.0;
  double stretch = 0.0;
  ForEachRoomOnWay(path, rooms, [&](int room, double step) {
    if (room < 0) {
      stretch += step;
      return;
    }
    if (stretch > kDoorway) all += stretch;
    stretch = 0.0;
  });
  return stretch > kDoorway ? all + stretch : all;
}

// Which doors the robot drove through, and which rooms are neighbors.
void TakePath(const std::vector<Pose2>& path, BuildingPlan* plan) {
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Vector2d here = path[i].head<2>();
    if (i == 0 || !here.allFinite()) continue;
    const Vector2d before = path[i - 1].head<2>();
    if (!before.allFinite()) continue;
    for (PlanDoor& door : plan->doors) {
      if (!door.is_driven) {
        door.is_driven = Cross(before, here, door.begin, door.end);
      }
    }
  }
  for (const PlanDoor& door : plan->doors) {
    if (door.rooms[0] < 0 || door.rooms[1] < 0) continue;
    for (const int k : {0, 1}) {
      std::vector<int>& neighbors =
          plan->rooms[static_cast<std::size_t>(door.rooms[k])].neighbors;
      neighbors.push_back(door.rooms[1 - k]);
    }
  }
  for (PlanRoom& room : plan->rooms) {
    std::sort(room.neighbors.begin(), room.neighbors.end());
    room.neighbors.erase(
        std::unique(room.neighbors.begin(), room.neighbors.end()),
        room.neighbors.end());
  }
}

// Rooms as lines of walls have them.
struct Rooms {
  Division division;
  // The largest first.
  std::vector<PlanRoom> rooms;
  std::vector<int> room_of_face;
  WayInRooms way;
};

Rooms FindRooms(std::vector<WallLine> lines, const SpaceGrid& space,
                const std::vector<Pose2>& path,
                const BuildingPlanOptions& options) {
  // The edges of furniture are no walls.
  const std::vector<double> wall = WallOfChains(lines, options.min_wall);
  std::vector<WallLine> long_lines, short_lines;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool is_long = wall[i] >= options.min_wall || lines[i].curve >= 0;
    (is_long ? long_lines : short_lines).push_back(lines[i]);
  }
  lines = std::move(long_lines);
  std::vector<DrawnLine> drawn_lines = DrawAndMeasure(lines, space, options);
  const std::size_t count = lines.size();
  const Partitions partitions =
      FindPartitions(short_lines, drawn_lines, space, options.reach);
  Append(partitions.sure, &lines);
  if (!partitions.likely.empty()) {
    std::vector<WallLine> with = lines;
    Append(partitions.likely, &with);
    const Division trial =
        Divide(DrawAndMeasure(with, space, options), space, path, options);
    for (const int line : LinesBetweenRoomsWithDoors(
             trial.arrangement, trial.region, static_cast<int>(lines.size()),
             static_cast<int>(with.size()))) {
      lines.push_back(with[static_cast<std::size_t>(line)]);
    }
  }
  if (lines.size() > count) {
    drawn_lines = DrawAndMeasure(lines, space, options);
  }
  Rooms found;
  Division& division = found.division;
  division = Divide(std::move(drawn_lines), space, path, options);
  for (int i = 0; i < kUnseenRounds; ++i) {
    const std::vector<WallLine> unseen =
        FindUnseenWalls(division.arrangement, division.region, division.drawn,
                        space, options.unseen);
    if (unseen.empty()) break;
    Append(unseen, &lines);
    division =
        Divide(DrawAndMeasure(lines, space, options), space, path, options);
  }
  found.rooms = RoomsOf(division.arrangement, division.region, division.drawn,
                        space, options, &found.room_of_face);
  found.way = MarkEntered(path, &found.rooms);
  return found;
}

// Whether the robot drove through a space for a good part of its way that no
// room is.
bool LacksSpace(const WayInRooms& way) {
  return way.outside_length >= kLongOutside &&
         way.outside >= kOftenOutside * (way.inside + way.outside);
}

}  // namespace

Ring BodyOf(const PlanWall& wall) {
  const Vector2d along = (wall.end - wall.begin).normalized();
  const Vector2d left(-along[1], along[0]);
  return {wall.begin - wall.right * left, wall.end - wall.right * left,
          wall.end + wall.left * left, wall.begin + wall.left * left};
}

std::vector<PlanWall> WithoutDoubles(const std::vector<PlanWall>& walls) {
  const auto length = [&](std::size_t i) {
    return (walls[i].end - walls[i].begin).norm();
  };
  std::vector<std::size_t> order(walls.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(
      order.begin(), order.end(),
      [&](std::size_t a, std::size_t b) { return length(a) > length(b); });
  // How far the middle of a body lies to the left of begin to end, m.
  const auto body = [&](std::size_t i) {
    return 0.5 * (walls[i].left - walls[i].right);
  };
  // What is left of each wall, along it, m.
  using Pieces = std::vector<std::pair<double, double>>;
  std::vector<Pieces> left(walls.size());
  for (std::size_t place = 0; place < order.size(); ++place) {
    const std::size_t i = order[place];
    const PlanWall& wall = walls[i];
    const Vector2d along = (wall.end - wall.begin).normalized();
    left[i] = {{0.0, length(i)}};
    for (std::size_t before = 0; before < place; ++before) {
      const std::size_t j = order[before];
      const Vector2d other = (walls[j].end - walls[j].begin).normalized();
      if (std::abs(along.dot(other)) < kSameWallCosine) continue;
      for (const auto& [first, last] : left[j]) {
        const Vector2d begin = walls[j].begin + first * other;
        const Vector2d end = walls[j].begin + last * other;
        double from = along.dot(begin - wall.begin);
        double to = along.dot(end - wall.begin);
        if (from > to) std::swap(from, to);
        from = std::max(from, 0.0);
        to = std::min(to, length(i));
        if (to - from < kLeastDouble) continue;
        const Vector2d middle = wall.begin + 0.5 * (from + to) * along;
        const Vector2d across(-other[1], other[0]);
        const double apart = across.dot(middle - begin);
        const double side = along.dot(other) > 0.0 ? 1.0 : -1.0;
        if (std::abs(apart) > kSameWall &&
            std::abs(apart + side * body(i) - body(j)) > kSameWall) {
          continue;
        }
        Pieces rest;
        for (const auto& [a, b] : left[i]) {
          if (std::min(b, from) - a >= kLeastRest) {
            rest.emplace_back(a, std::min(b, from));
          }
          if (b - std::max(a, to) >= kLeastRest) {
            rest.emplace_back(std::max(a, to), b);
          }
        }
        left[i] = std::move(rest);
      }
    }
  }
  std::vector<PlanWall> kept;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const Vector2d along = (walls[i].end - walls[i].begin).normalized();
    for (const auto& [from, to] : left[i]) {
      PlanWall piece = walls[i];
      piece.begin = walls[i].begin + from * along;
      if (to < length(i)) piece.end = walls[i].begin + to * along;
      kept.push_back(piece);
    }
  }
  return kept;
}

const char* RoomKindName(PlanRoom::Kind kind) {
  return kind == PlanRoom::Kind::kCorridor ? "corridor" : "room";
}

BuildingPlan MakeBuildingPlan(const std::vector<KnownWall>& walls,
                              const std::vector<double>& directions,
                              const SpaceGrid& space,
                              const std::vector<Pose2>& path,
                              const BuildingPlanOptions& options) {
  const std::vector<WallLine> lines =
      FindWallLines(walls, directions, space, options.lines);
  Rooms found = FindRooms(lines, space, path, options);
  if (LacksSpace(found.way)) {
    // A hall so wide that some of its walls were not seen: the others are drawn
    // on farther until they meet.
    BuildingPlanOptions farther = options;
    farther.reach *= kFarther;
    farther.beyond = options.reach;
    // Drawn so far, the fronts of a yard meet, too.
    farther.min_closed = std::max(options.min_closed, kClosedHall);
    farther.max_open = std::min(options.max_open, kOpenHall);
    Rooms other = FindRooms(lines, space, path, farther);
    if (other.way.outside_length <= kLessOutside * found.way.outside_length) {
      found = std::move(other);
    }
  }
  const auto& [drawn, arrangement, region] = found.division;
  std::vector<int>& room_of_face = found.room_of_face;

  BuildingPlan plan;
  plan.rooms = std::move(found.rooms);
  if (found.way.inside < found.way.outside) {
    DropUnreached(arrangement, &plan.rooms, &room_of_face);
  }
  const std::vector<Sides> sides = SidesOf(arrangement, room_of_face, drawn);
  for (const std::vector<std::size_t>& lines : LinesOfWalls(drawn)) {
    for (const std::size_t line : lines) {
      ReadLine(drawn[line], sides[line], space, options, &plan);
    }
    if (drawn[lines.front()].line.is_wall) {
      AddStandingWalls(lines, drawn, sides, space, &plan);
    }
  }
  const std::size_t of_rooms = plan.walls.size();
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    if (drawn[i].line.is_wall) {
      AddWallsBeyondRooms(drawn[i], sides[i], space, of_rooms, &plan);
    }
  }
  plan.walls = WithoutDoubles(plan.walls);
  DropDoubleDoors(&plan.doors);
  JoinDoorsOfPassages(space, &plan.doors);
  TakePath(path, &plan);
  for (PlanRoom& room : plan.rooms) room.kind = KindOf(room);
  plan.way_outside = WayOutside(path, plan.rooms);
  return plan;
}

}  // namespace plumbline
