#include <plumbline/core/parallel_for.h>
#include <plumbline/plan/drawn_lines.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr double kStep = WallProfile::kStep;
constexpr double kBeside = kBesideWall;
// Wall that goes on behind an opening is in line to this, m.
constexpr double kInLineOffset = 0.6;
// Samples of a row, and gaps in it.
constexpr int kLeastRow = 6;
constexpr int kRowGap = 2;
// How far around a place wall in line with it speaks for it, m.
constexpr double kAround = 5.0;
// So many metres of it are enough.
constexpr double kFullWall = 4.0;
// What a lone piece of wall holds, an unknown place, and what a door lets
// through: alone, and how much less in a long wall.
constexpr double kLeastWallHolds = 0.4;
constexpr double kUnknownHolds = 0.2;
constexpr double kDoorHolds = 0.2;
constexpr double kImportantDoor = 0.6;
// Share of wall around an opening from which on it counts as a door, and from
// which on fully.
constexpr double kBareFlanks = 0.3;
constexpr double kFullFlanks = 0.6;
// An opening in a long wall, up to the widest door, counts as much as a door.
constexpr double kFrontAsDoor = 0.6;

// What nobody saw beside an opening, behind furniture or where no room is, says
// less against a wall there than what was seen to be open.
constexpr double kUnseenBeside = 0.5;
// A line is a wall where another one crosses it when so much of it is, within
// this distance before or after the crossing, m.
constexpr double kBesideCrossing = 0.3;
constexpr double kWallThere = 0.6;
// What stands before a wall hides it along so many samples at most, to either
// side of the crossing.
constexpr int kHiddenBeside = 20;
// So many of them may look open: laser points go astray.
constexpr int kStraySamples = 2;
// A wall ends where one crosses it and so many samples, from so many behind the
// crossing on, are free, by this share.
constexpr int kBehindCrossing = 4;
constexpr int kBeyondWall = 20;
constexpr double kFreeBeyond = 0.9;
// It goes straight on when that holds on both sides, within this, m.
constexpr double kStraightOn = 1.5;
// What stands before a wall in a corridor is no deeper than this, m.
constexpr double kDeepestFurniture = 0.8;
// What stands between openings is a column up to this, m; and a screen up to
// that, where so many stand in a row.
constexpr double kWidestColumn = 0.6;
constexpr double kLongestScreen = 1.5;
constexpr std::size_t kLeastScreens = 2;
// Lines with less wall, m, are partitions: others are drawn on past them, to
// the walls that close a space.
constexpr double kFullLine = 2.0;
// A wall that is crossed this far within another's end is met there, m.
constexpr double kAtTheEnd = 0.4;
// Share of a partition that may look open: laser points go astray.
constexpr double kMostSeenThrough = 0.05;
// Metres of wall in a partition that may have doors.
constexpr double kLeastPartition = 1.5;
// Metres of wall in what may be a partition between two rooms with doors of
// their own, and the share of it that nobody looked through.
constexpr double kLeastLikelyPartition = 1.0;
constexpr double kLikelyShare = 0.5;

// Where two lines meet: along each.
bool Crossing(const WallLine& a, const WallLine& b, double* t_a, double* t_b) {
  const double sine = a.along[0] * b.along[1] - a.along[1] * b.along[0];
  if (std::abs(sine) < std::sin(DegToRad(10.0))) return false;
  const Vector2d between = b.origin - a.origin;
  *t_a = (between[0] * b.along[1] - between[1] * b.along[0]) / sine;
  *t_b = (between[0] * a.along[1] - between[1] * a.along[0]) / sine;
  return true;
}

// Draws lines on to those that they would meet.
void DrawOn(double reach, double beyond_other, std::vector<DrawnLine>* drawn) {
  constexpr int kMeetings = 2;
  struct Meeting {
    double distance;
    std::size_t other;
    double t, t_other;
  };
  const std::size_t size = drawn->size();
  std::vector<std::pair<double, double>> ends(size);
  for (std::size_t i = 0; i < size; ++i) {
    ends[i] = {(*drawn)[i].line.begin, (*drawn)[i].line.end};
  }
  const auto stretch = [&](std::size_t i, double t) {
    const WallLine& line = (*drawn)[i].line;
    if (!line.begins_in_corner) ends[i].first = std::min(ends[i].first, t);
    if (!line.ends_in_corner) ends[i].second = std::max(ends[i].second, t);
  };
  for (std::size_t i = 0; i < size; ++i) {
    const WallLine& line = (*drawn)[i].line;
    std::vector<Meeting> before, after;
    for (std::size_t j = 0; j < size; ++j) {
      if (j == i) continue;
      const WallLine& other = (*drawn)[j].line;
      double t, t_other;
      if (!Crossing(line, other, &t, &t_other)) {
        // The wall that goes on behind an opening.
        const double begin = std::min(line.Along(other.At(other.begin)),
                                      line.Along(other.At(other.end)));
        const double end = std::max(line.Along(other.At(other.begin)),
                                    line.Along(other.At(other.end)));
        const double across = std::abs(
            line.Across(other.At(begin > line.end ? other.begin : other.end)));
        if (across > kInLineOffset) continue;
        if (begin > line.end && begin - line.end <= reach) stretch(i, begin);
        if (end < line.begin && line.begin - end <= reach) stretch(i, end);
        continue;
      }
      const double beyond =
          std::max({0.0, other.begin - t_other, t_other - other.end});
      if (beyond > beyond_other) continue;
      const double low = line.begin - t;
      const double high = t - line.end;
      // What a line meets within itself may still have to be drawn up to it.
      if (low <= 0.0 && high <= 0.0) {
        stretch(j, t_other);
      } else if (low > 0.0 && low <= reach) {
        before.push_back({low, j, t, t_other});
      } else if (high > 0.0 && high <= reach) {
        after.push_back({high, j, t, t_other});
      }
    }
    for (std::vector<Meeting>* meetings : {&before, &after}) {
      std::sort(meetings->begin(), meetings->end(),
                [](const Meeting& a, const Meeting& b) {
                  return std::make_tuple(a.distance, a.other) <
                         std::make_tuple(b.distance, b.other);
                });
      double last = -1.0;
      int count = 0;
      for (const Meeting& meeting : *meetings) {
        // Lines close together count as one.
        if (last >= 0.0 && meeting.distance > last + 0.5 &&
            count >= kMeetings) {
          break;
        }
        if ((*drawn)[meeting.other].line.weight >= kFullLine &&
            (last < 0.0 || meeting.distance > last + 0.5)) {
          ++count;
          last = meeting.distance;
        }
        stretch(i, meeting.t);
        stretch(meeting.other, meeting.t_other);
      }
    }
  }
  // A little more, so that rounding leaves no gap.
  for (std::size_t i = 0; i < size; ++i) {
    const WallLine& line = (*drawn)[i].line;
    (*drawn)[i].from = ends[i].first - (line.begins_in_corner ? 0.0 : 0.01);
    (*drawn)[i].to = ends[i].second + (line.ends_in_corner ? 0.0 : 0.01);
  }
}

// Lines across the ends of others: without them a space whose end was not seen
// would not be closed.
std::vector<DrawnLine> Caps(const std::vector<DrawnLine>& drawn, double reach) {
  std::vector<DrawnLine> caps;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const WallLine& line = drawn[i].line;
    for (const double end : {line.begin, line.end}) {
      bool is_met =
          end == line.begin ? line.begins_in_corner : line.ends_in_corner;
      for (std::size_t j = 0; j < drawn.size() && !is_met; ++j) {
        double t, t_other;
        if (j == i || !Crossing(line, drawn[j].line, &t, &t_other)) continue;
        is_met = std::abs(t - end) < 0.4 && t_other >= drawn[j].from &&
                 t_other <= drawn[j].to;
      }
      if (is_met) continue;
      DrawnLine cap;
      cap.line.is_wall = false;
      cap.line.origin = line.At(end);
      cap.line.along = line.normal();
      double before = -reach, after = reach;
      bool has_before = false, has_after = false;
      for (std::size_t j = 0; j < drawn.size(); ++j) {
        double t, t_other;
        if (j == i || !Crossing(cap.line, drawn[j].line, &t, &t_other))
          continue;
        if (t_other < drawn[j].from || t_other > drawn[j].to) continue;
        if (t > 0.2 && t < after) {
          after = t;
          has_after = true;
        } else if (t < -0.2 && t > before) {
          before = t;
          has_before = true;
        }
      }
      cap.from = has_before ? before - 0.01 : 0.0;
      cap.to = has_after ? after + 0.01 : 0.0;
      cap.line.begin = cap.from;
      cap.line.end = cap.to;
      if (cap.to > cap.from) caps.push_back(cap);
    }
  }
  return caps;
}

Mark MarkAt(const WallLine& line, double t, const SpaceGrid& space) {
  const double step = space.resolution;
  const Vector2d here = line.At(t);
  int free = 0;
  int all = 0;
  for (double v = line.low - kBeside; v <= line.high + kBeside + 1e-9;
       v += step) {
    switch (space.At(Vector2d(here + v * line.normal()))) {
      case Space::kOccupied:
        return Mark::kWall;
      case Space::kFree:
        ++free;
        break;
      case Space::kUnknown:
        break;
    }
    ++all;
  }
  return free >= 0.7 * all ? Mark::kOpen : Mark::kUnknown;
}

// Which samples are in rows of occupied cells along a wall, not only beside
// some furniture. `lines`: the wall's, one after the other, as its profile.
void FindRows(const SpaceGrid& space, const std::vector<DrawnLine*>& lines,
              WallProfile* whole) {
  WallProfile& profile = *whole;
  const WallLine& first = lines.front()->line;
  const int count = profile.size();
  profile.in_row.assign(profile.marks.size(), false);
  std::vector<bool> before(profile.marks.size(), false);
  for (double v = first.low - kBeside; v <= first.high + kBeside + 1e-9;
       v += space.resolution) {
    std::vector<bool> here(profile.marks.size(), false);
    std::size_t at = 0;
    for (const DrawnLine* drawn : lines) {
      const WallLine& line = drawn->line;
      for (int i = 0; i < drawn->profile.size(); ++i, ++at) {
        if (profile.marks[at] != Mark::kWall) continue;
        here[at] = space.At(Vector2d(line.At(drawn->profile.MiddleOf(i)) +
                                     v * line.normal())) == Space::kOccupied;
      }
    }
    int begin = -1;
    int last = -1;
    const auto finish = [&] {
      if (begin >= 0 && last - begin + 1 >= kLeastRow) {
        std::fill(profile.in_row.begin() + begin,
                  profile.in_row.begin() + last + 1, true);
      }
    };
    for (int i = 0; i < count; ++i) {
      if (!here[static_cast<std::size_t>(i)] &&
          !before[static_cast<std::size_t>(i)]) {
        continue;
      }
      if (begin < 0 || i - last - 1 > kRowGap) {
        finish();
        begin = i;
      }
      last = i;
    }
    finish();
    before = std::move(here);
  }
}

// What lies along a line as the raster has it, without rows.
void Measure(const SpaceGrid& space, DrawnLine* drawn) {
  WallProfile& profile = drawn->profile;
  profile.begin = drawn->from;
  const int count = std::max(
      1, static_cast<int>(std::ceil((drawn->to - drawn->from) / kStep)));
  profile.marks.resize(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    profile.marks[static_cast<std::size_t>(i)] =
        MarkAt(drawn->line, profile.MiddleOf(i), space);
  }
}

// Share of wall within `reach` of a place on a line.
double WallShare(const WallProfile& profile, double t, double reach) {
  const int first = std::max(0, profile.IndexOf(t - reach));
  const int last = std::min(profile.size() - 1, profile.IndexOf(t + reach));
  if (last < first) return 0.0;
  const auto begin = profile.marks.begin();
  return static_cast<double>(
             std::count(begin + first, begin + last + 1, Mark::kWall)) /
         (last - first + 1);
}

// Where walls cross a line, along it.
struct Crossings {
  std::vector<double> all;
  // Also where walls that are drawn on would cross it.
  std::vector<double> drawn;
  // Those of walls that go on on both sides of the line.
  std::vector<double> straight_on;
};

// Openings up to a door's width in a wall are wall.
WallProfile WithDoorsShut(WallProfile profile, double narrow) {
  const auto count = profile.size();
  int after = -1;
  for (int i = 0; i < count; ++i) {
    if (profile.At(i) != Mark::kWall) continue;
    if (after >= 0 && (i - after) * kStep <= narrow) {
      std::fill(profile.marks.begin() + after, profile.marks.begin() + i,
                Mark::kWall);
    }
    after = i + 1;
  }
  return profile;
}

// `shut`: profiles of the lines with their doors shut.
Crossings WallCrossings(const std::vector<DrawnLine>& drawn,
                        const std::vector<WallProfile>& shut,
                        std::size_t line) {
  Crossings crossings;
  for (std::size_t j = 0; j < drawn.size(); ++j) {
    double t, t_other;
    const int curve = drawn[line].line.curve;
    if (j == line || !drawn[j].line.is_wall ||
        (curve >= 0 && curve == drawn[j].line.curve) ||
        !Crossing(drawn[line].line, drawn[j].line, &t, &t_other) ||
        t < drawn[line].from || t > drawn[line].to || t_other < drawn[j].from ||
        t_other > drawn[j].to) {
      continue;
    }
    crossings.drawn.push_back(t);
    const auto share = [&](const WallProfile& profile, double beside) {
      return WallShare(profile, t_other + beside, std::abs(beside));
    };
    if (std::max(share(drawn[j].profile, -kBesideCrossing),
                 share(drawn[j].profile, kBesideCrossing)) >= kWallThere) {
      crossings.all.push_back(t);
    }
    if (std::min(share(shut[j], -kStraightOn), share(shut[j], kStraightOn)) >=
        kWallThere) {
      crossings.straight_on.push_back(t);
    }
  }
  return crossings;
}

// The profiles of a wall's lines one after the other, which begin where the
// first one does.
WallProfile WholeProfile(const std::vector<DrawnLine*>& lines) {
  WallProfile whole;
  whole.begin = lines.front()->profile.begin;
  for (const DrawnLine* line : lines) {
    const std::vector<Mark>& marks = line->profile.marks;
    whole.marks.insert(whole.marks.end(), marks.begin(), marks.end());
  }
  return whole;
}

// Gives each line its part of the profile of its wall.
void TakeProfile(const WallProfile& whole,
                 const std::vector<DrawnLine*>& lines) {
  std::ptrdiff_t first = 0;
  for (DrawnLine* line : lines) {
    WallProfile& profile = line->profile;
    const std::ptrdiff_t last = first + profile.size();
    const auto part = [&](const auto& all, auto* own) {
      own->assign(all.begin() + first, all.begin() + last);
    };
    part(whole.marks, &profile.marks);
    part(whole.holds, &profile.holds);
    part(whole.in_row, &profile.in_row);
    part(whole.is_seen_open, &profile.is_seen_open);
    first = last;
  }
}

// Where walls cross a wall, along its whole profile.
Crossings CrossingsOfWall(const std::vector<DrawnLine>& drawn,
                          const std::vector<WallProfile>& shut,
                          const std::vector<std::size_t>& lines) {
  Crossings whole;
  double begin = drawn[lines.front()].profile.begin;
  for (const std::size_t line : lines) {
    const WallProfile& profile = drawn[line].profile;
    const double shift = begin - profile.begin;
    const Crossings own = WallCrossings(drawn, shut, line);
    const auto add = [&](const std::vector<double>& from,
                         std::vector<double>* to) {
      for (const double t : from) to->push_back(t + shift);
    };
    add(own.all, &whole.all);
    add(own.drawn, &whole.drawn);
    add(own.straight_on, &whole.straight_on);
    begin += profile.size() * kStep;
  }
  return whole;
}

// What is in no row of cells is furniture, unless another wall crosses there.
void DropSpecks(const std::vector<double>& crossings, WallProfile* profile) {
  for (int i = 0; i < profile->size(); ++i) {
    Mark& mark = profile->marks[static_cast<std::size_t>(i)];
    if (profile->in_row[static_cast<std::size_t>(i)]) {
      mark = Mark::kWall;
    } else if (mark == Mark::kWall) {
      const double t = profile->MiddleOf(i);
      const bool is_crossed = std::any_of(
          crossings.begin(), crossings.end(),
          [&](double crossing) { return std::abs(crossing - t) <= 0.2; });
      if (!is_crossed) mark = Mark::kOpen;
    }
  }
}

// Openings that belong together, in samples; `last` is not included.
struct Passage {
  int first = 0;
  int last = 0;
};

// For every sample the passage it lies in, an empty one for wall. Openings with
// nothing but short pieces of wall between them, at which no other wall ends,
// are one: what stands there is furniture or columns. Two of them may be two
// doors of one room, though.
std::vector<Passage> PassagesOf(const std::vector<Mark>& marks, double begin,
                                const std::vector<double>& crossings) {
  const auto count = static_cast<int>(marks.size());
  const auto mark = [&](int i) { return marks[static_cast<std::size_t>(i)]; };
  std::vector<Passage> runs;
  std::vector<bool> is_open;
  for (int i = 0; i < count;) {
    int j = i;
    int open = 0;
    while (j < count && mark(j) != Mark::kWall) {
      open += mark(j) == Mark::kOpen;
      ++j;
    }
    if (j > i) {
      runs.push_back({i, j});
      is_open.push_back(2 * open >= j - i);
    }
    i = std::max(j, i + 1);
  }
  // The last opening that is one with another.
  const auto last_of = [&](std::size_t i, double longest) {
    for (; i + 1 < runs.size() && is_open[i] && is_open[i + 1]; ++i) {
      const double from = begin + runs[i].last * kStep;
      const double to = begin + runs[i + 1].first * kStep;
      if (to - from > longest ||
          std::any_of(crossings.begin(), crossings.end(), [&](double t) {
            return t >= from - kBesideCrossing && t <= to + kBesideCrossing;
          })) {
        break;
      }
    }
    return i;
  };
  std::vector<Passage> passages(marks.size());
  for (std::size_t i = 0; i < runs.size(); ++i) {
    std::size_t last = last_of(i, kLongestScreen);
    if (last < i + kLeastScreens) last = last_of(i, kWidestColumn);
    const Passage whole{runs[i].first, runs[last].last};
    std::fill(passages.begin() + whole.first, passages.begin() + whole.last,
              whole);
    i = last;
  }
  return passages;
}

// How far a wall that has an opening goes on from there, sample `from`, up to
// sample `to`: it ends where another wall crosses it and nothing but free space
// lies in line with it beyond.
int EndOfWall(const WallProfile& profile, const Crossings& crossings, int from,
              int to) {
  const int step = to < from ? -1 : 1;
  int end = to;
  for (const double crossing : crossings.all) {
    const int at = profile.IndexOf(crossing);
    if (step * (at - from) < 0 || step * (at - end) >= 0) continue;
    if (std::any_of(crossings.straight_on.begin(), crossings.straight_on.end(),
                    [&](double t) {
                      return std::abs(t - crossing) <= kBesideCrossing;
                    })) {
      continue;
    }
    int open = 0;
    int all = 0;
    for (int i = at + step * kBehindCrossing;
         step * (i - to) < 0 && all < kBeyondWall; i += step) {
      const int sample = step > 0 ? i : i - 1;
      ++all;
      open += profile.At(sample) == Mark::kOpen;
    }
    if (all == kBeyondWall && open >= kFreeBeyond * all) {
      end = at + step * kBehindCrossing;
      if (step * (end - to) > 0) end = to;
    }
  }
  return end;
}

// Finds doors, openings with wall on both sides, and what each place holds.
void Weigh(const DoorOptions& options, bool is_wall, const Crossings& crossings,
           WallProfile* profile) {
  std::vector<Mark>& marks = profile->marks;
  const int count = profile->size();
  profile->holds.assign(marks.size(), -1.0);
  const int around = static_cast<int>(kAround / kStep);
  std::vector<int> walls_before(marks.size() + 1, 0);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    walls_before[i + 1] = walls_before[i] + (marks[i] == Mark::kWall);
  }
  std::vector<int> seen_before(marks.size() + 1, 0);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    seen_before[i + 1] = seen_before[i] + (marks[i] != Mark::kUnknown);
  }
  const auto between = [&](const std::vector<int>& before, int first,
                           int last) {
    return before[static_cast<std::size_t>(std::min(last, count))] -
           before[static_cast<std::size_t>(std::max(first, 0))];
  };
  const auto walls = [&](int first, int last) {
    return between(walls_before, first, last);
  };
  const auto goes_straight_on = [&](int i) {
    return std::any_of(crossings.straight_on.begin(),
                       crossings.straight_on.end(), [&](double crossing) {
                         return std::abs(crossing - profile->begin -
                                         i * kStep) <= kDeepestFurniture;
                       });
  };
  const std::vector<Passage> passages =
      PassagesOf(marks, profile->begin, crossings.drawn);
  for (int i = 0; i < count;) {
    const Passage whole = passages[static_cast<std::size_t>(i)];
    if (whole.last <= i) {
      const double near = walls(i - around, i + around + 1) * kStep;
      profile->holds[static_cast<std::size_t>(i)] =
          is_wall ? kLeastWallHolds + (1.0 - kLeastWallHolds) *
                                          std::min(1.0, near / kFullWall)
                  : 0.0;
      ++i;
      continue;
    }
    const int size = whole.last - whole.first;
    const double width = size * kStep;
    const int first = EndOfWall(*profile, crossings, whole.first,
                                std::max(0, whole.first - around));
    const int last = EndOfWall(*profile, crossings, whole.last,
                               std::min(count, whole.last + around));
    const int seen = between(seen_before, first, last) -
                     between(seen_before, whole.first, whole.last);
    const int unseen = last - first - size - seen;
    const int beside = walls(first, last) - walls(whole.first, whole.last);
    const double covered =
        beside / std::max(1.0, seen + kUnseenBeside * unseen);
    const bool is_between =
        is_wall && whole.first > 0 && whole.last < count &&
        !(width > options.narrow && goes_straight_on(whole.first) &&
          goes_straight_on(whole.last));
    const double flanked = std::clamp(
        (covered - kBareFlanks) / (kFullFlanks - kBareFlanks), 0.0, 1.0);
    const double important = std::min(1.0, beside * kStep / kFullWall);
    // An office that is open to the hall beside it: nothing stands in its front
    // but the wall that goes on.
    const bool is_front = walls(whole.first, whole.last) == 0 &&
                          flanked >= 1.0 && important >= 1.0;
    const double wide = is_front ? options.widest_front : options.wide;
    const double wider = std::clamp(
        (width - options.narrow) / (options.wide - options.narrow), 0.0, 1.0);
    double narrow = 1.0 - wider * wider;
    if (is_front) {
      narrow = std::max(
          narrow,
          kFrontAsDoor *
              std::clamp((wide - width) / (wide - options.wide), 0.0, 1.0));
    }
    const double as_door = is_between ? narrow * flanked : 0.0;
    const double holds =
        -1.0 + as_door * (1.0 - kDoorHolds + kImportantDoor * important);
    for (int k = whole.first; k < whole.last; ++k) {
      const bool is_unknown =
          marks[static_cast<std::size_t>(k)] == Mark::kUnknown;
      profile->holds[static_cast<std::size_t>(k)] =
          is_unknown ? (is_wall ? kUnknownHolds : 0.0) : holds;
    }
    // Each opening is a door of its own.
    while (i < whole.last) {
      int j = i;
      int open = 0;
      while (j < whole.last &&
             marks[static_cast<std::size_t>(j)] != Mark::kWall) {
        open += marks[static_cast<std::size_t>(j)] == Mark::kOpen;
        ++j;
      }
      if (is_between && width <= wide && open * 2 >= j - i && covered >= 0.4) {
        std::fill(marks.begin() + i, marks.begin() + j, Mark::kDoor);
      }
      i = std::max(j, i + 1);
    }
  }
}

// Whether a place that was not seen lies between two pieces of a wall, behind
// what stands before it.
bool IsHiddenWithin(const WallProfile& profile, double t) {
  const auto wall_at = [&](int step) {
    const int first = profile.IndexOf(t);
    int open = 0;
    for (int i = 0; i <= kHiddenBeside && open <= kStraySamples; ++i) {
      const int at = first + i * step;
      if (at < 0 || at >= profile.size()) return false;
      if (profile.At(at) == Mark::kWall) return true;
      open += profile.At(at) != Mark::kUnknown;
    }
    return false;
  };
  return wall_at(-1) && wall_at(1);
}

// Where a line meets a wall first on its way from `from` on, along it, within
// `reach`; `sign` 1: forwards. Negative when it meets none.
double WayToWall(const WallLine& line, double from, int sign,
                 const std::vector<DrawnLine>& drawn, double reach) {
  double nearest = -1.0;
  for (const DrawnLine& other : drawn) {
    double t, t_other;
    if (!other.line.is_wall || !Crossing(line, other.line, &t, &t_other) ||
        t_other < other.from || t_other > other.to) {
      continue;
    }
    const double way = sign * (t - from);
    if (way < -kAtTheEnd || way > reach || (nearest >= 0.0 && way >= nearest)) {
      continue;
    }
    if (std::max(WallShare(other.profile, t_other - kBesideCrossing,
                           kBesideCrossing),
                 WallShare(other.profile, t_other + kBesideCrossing,
                           kBesideCrossing)) >= kWallThere ||
        IsHiddenWithin(other.profile, t_other)) {
      nearest = std::max(0.0, way);
    }
  }
  return nearest;
}

}  // namespace

Partitions FindPartitions(const std::vector<WallLine>& lines,
                          const std::vector<DrawnLine>& drawn,
                          const SpaceGrid& space, double reach) {
  Partitions found;
  for (const WallLine& line : lines) {
    if (!line.is_aligned) continue;
    const double before = WayToWall(line, line.begin, -1, drawn, reach);
    const double after = WayToWall(line, line.end, 1, drawn, reach);
    if (before < 0.0 || after < 0.0) continue;
    DrawnLine whole;
    whole.line = line;
    whole.from = line.begin - before;
    whole.to = line.end + after;
    Measure(space, &whole);
    const auto& marks = whole.profile.marks;
    const auto open = std::count(marks.begin(), marks.end(), Mark::kOpen);
    const auto wall = std::count(marks.begin(), marks.end(), Mark::kWall);
    const auto all = static_cast<double>(marks.size());
    const bool is_wall = line.weight >= kLeastPartition &&
                         static_cast<double>(wall) >= kWallThere * all;
    if (is_wall || static_cast<double>(open) <= kMostSeenThrough * all) {
      found.sure.push_back(line);
    } else if (line.weight >= kLeastLikelyPartition &&
               static_cast<double>(open) <= (1.0 - kLikelyShare) * all) {
      found.likely.push_back(line);
    }
  }
  return found;
}

std::vector<std::vector<std::size_t>> LinesOfWalls(
    const std::vector<DrawnLine>& drawn) {
  std::vector<std::vector<std::size_t>> walls;
  std::map<int, std::size_t> curves;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const int curve = drawn[i].line.curve;
    const auto known = curve < 0 ? curves.end() : curves.find(curve);
    if (known != curves.end()) {
      walls[known->second].push_back(i);
      continue;
    }
    if (curve >= 0) curves[curve] = walls.size();
    walls.push_back({i});
  }
  return walls;
}

std::vector<DrawnLine> DrawLines(const std::vector<WallLine>& lines,
                                 double reach, double beyond) {
  std::vector<DrawnLine> drawn;
  for (const WallLine& line : lines) {
    DrawnLine entry;
    entry.line = line;
    drawn.push_back(std::move(entry));
  }
  DrawOn(reach, beyond, &drawn);
  std::vector<DrawnLine> caps = Caps(drawn, reach);
  drawn.insert(drawn.end(), std::make_move_iterator(caps.begin()),
               std::make_move_iterator(caps.end()));
  return drawn;
}

void MeasureLines(const SpaceGrid& space, const DoorOptions& options,
                  std::vector<DrawnLine>* drawn) {
  ParallelFor(drawn->size(), ThreadsHere(),
              [&](std::size_t i) { Measure(space, &(*drawn)[i]); });
  std::vector<WallProfile> shut;
  for (const DrawnLine& line : *drawn) {
    shut.push_back(WithDoorsShut(line.profile, options.narrow));
  }
  const std::vector<std::vector<std::size_t>> walls = LinesOfWalls(*drawn);
  std::vector<Crossings> crossings(walls.size());
  for (std::size_t i = 0; i < walls.size(); ++i) {
    crossings[i] = CrossingsOfWall(*drawn, shut, walls[i]);
  }
  for (std::size_t i = 0; i < walls.size(); ++i) {
    std::vector<DrawnLine*> lines;
    for (const std::size_t line : walls[i]) lines.push_back(&(*drawn)[line]);
    WallProfile profile = WholeProfile(lines);
    FindRows(space, lines, &profile);
    DropSpecks(crossings[i].all, &profile);
    for (const Mark mark : profile.marks) {
      profile.is_seen_open.push_back(mark == Mark::kOpen);
    }
    Weigh(options, lines.front()->line.is_wall, crossings[i], &profile);
    TakeProfile(profile, lines);
  }
}

}  // namespace plumbline
