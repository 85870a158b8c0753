#include <plumbline/factors/angle.h>
#include <plumbline/plan/curved_walls.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Neighbouring faces of one curve: the gap between their ends, m, and the bend
// between them, rad.
constexpr double kNeighborGap = 1.0;
constexpr double kLeastBend = DegToRad(2.0);
constexpr double kLargestBend = DegToRad(60.0);
// Faces of so many directions, rad apart, are on a curve: those of two walls
// that meet have two.
constexpr std::size_t kLeastDirections = 3;
// A face runs along the circle where it lies, rad.
constexpr double kTangent = DegToRad(10.0);
// Points of a face that a circle is fitted to lie so far apart, m.
constexpr double kPointStep = 0.1;
constexpr int kFitRounds = 10;
constexpr int kGrowRounds = 10;
// Shorter faces are none, m.
constexpr double kShortest = 0.2;
// Places along an arc lie so far apart, m.
constexpr double kStep = 0.05;
// Both faces of a wall run at one distance to this, m, along this share of the
// shorter one.
constexpr double kSameDistance = 0.07;
constexpr double kBesideEachOther = 0.5;
// A thick wall is no thicker, m: a curved desk is. Nothing looks free between
// its faces along more than this share: laser points go astray.
constexpr double kThickest = 0.45;
constexpr double kSeenThrough = 0.2;
// One curve goes on from another one: m, rad.
constexpr double kGoesOnGap = 0.6;
constexpr double kGoesOnBend = DegToRad(30.0);
// What is seen to be open along so much, m, and not along more than that, is an
// opening, with so much wall before and after it on its edge.
constexpr double kLeastOpening = 0.4;
constexpr double kLargestOpening = 3.0;
constexpr double kJamb = 0.3;
// An edge runs so far from its arc, m, and has such a length, m.
constexpr double kEdgeSagitta = 0.03;
constexpr double kShortestEdge = 0.4;
constexpr double kLongestEdge = 2.0;
// Beyond the last face returns on the circle go on with it: with gaps up to
// this, m, and beyond an opening where so much of it goes on, m.
constexpr double kCrack = 0.3;
constexpr double kBeyondOpening = 0.6;

struct Face {
  Vector2d begin, end;
  Vector2d middle() const { return 0.5 * (begin + end); }
  double length() const { return (end - begin).norm(); }
  double angle() const {
    return std::atan2(end[1] - begin[1], end[0] - begin[0]);
  }
};

struct Circle {
  Vector2d center = Vector2d::Zero();
  double radius = 0.0;
  double Off(const Vector2d& p) const { return (p - center).norm() - radius; }
};

// Part of a circle, angles `from` < `to` seen from the center.
struct Arc {
  Circle circle;
  double from = 0.0;
  double to = 0.0;
  std::vector<std::size_t> faces;
  // Metres of faces.
  double wall = 0.0;
  // Where the faces of the wall lie outside of the circle, m.
  double low = 0.0;
  double high = 0.0;

  double turn() const { return to - from; }
  double length() const { return turn() * circle.radius; }
  bool is_closed() const { return turn() >= 2.0 * kPi; }
  Vector2d At(double angle) const {
    return circle.center +
           circle.radius * Vector2d(std::cos(angle), std::sin(angle));
  }
  // The angle of a point, from `from` on.
  double AngleOf(const Vector2d& p) const {
    const Vector2d way = p - circle.center;
    double angle = std::fmod(std::atan2(way[1], way[0]) - from, 2.0 * kPi);
    if (angle < 0.0) angle += 2.0 * kPi;
    return from + angle;
  }
};

// The circle with least squared distances from points; false when they lie in
// line.
bool FitCircle(const std::vector<Vector2d>& points, Circle* circle) {
  Vector2d middle = Vector2d::Zero();
  for (const Vector2d& p : points) middle += p;
  middle /= static_cast<double>(points.size());
  // Algebraically first: |p|^2 = 2 c'p + (r^2 - |c|^2).
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Vector2d& p : points) {
    const Vector2d q = p - middle;
    const Vector3d row(2.0 * q[0], 2.0 * q[1], 1.0);
    normal += row * row.transpose();
    right += q.squaredNorm() * row;
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> decomposition(normal);
  if (!decomposition.isInvertible()) return false;
  const Vector3d solution = decomposition.solve(right);
  const double square = solution[2] + solution.head<2>().squaredNorm();
  if (!(square > 0.0) || !solution.allFinite()) return false;
  circle->center = middle + solution.head<2>();
  circle->radius = std::sqrt(square);
  for (int i = 0; i < kFitRounds; ++i) {
    normal.setZero();
    right.setZero();
    for (const Vector2d& p : points) {
      const Vector2d way = p - circle->center;
      const double distance = way.norm();
      if (distance <= 0.0) continue;
      const Vector3d row(-way[0] / distance, -way[1] / distance, -1.0);
      normal += row * row.transpose();
      right -= (distance - circle->radius) * row;
    }
    const Vector3d change = normal.ldlt().solve(right);
    if (!change.allFinite()) return false;
    circle->center += change.head<2>();
    circle->radius += change[2];
    if (change.norm() < 1e-6) break;
  }
  return circle->radius > 0.0;
}

void AddPoints(const Face& face, std::vector<Vector2d>* points) {
  const int steps =
      std::max(2, static_cast<int>(std::ceil(face.length() / kPointStep)));
  for (int i = 0; i < steps; ++i) {
    points->push_back(face.begin + (i + 0.5) / steps * (face.end - face.begin));
  }
}

bool LiesOn(const Face& face, const Circle& circle, double low, double high,
            double on_circle) {
  const Vector2d middle = face.middle();
  for (const Vector2d& p : {face.begin, middle, face.end}) {
    const double off = circle.Off(p);
    if (off < low - on_circle || off > high + on_circle) return false;
  }
  const Vector2d out = (middle - circle.center).normalized();
  const Vector2d along = (face.end - face.begin).normalized();
  return std::abs(out.dot(along)) <= std::sin(kTangent);
}

// Whether one face goes on where the other one ends, with a bend between them.
bool AreNeighbors(const Face& a, const Face& b) {
  const double bend = std::abs(NormalizeAxial(a.angle() - b.angle()));
  if (bend < kLeastBend || bend > kLargestBend) return false;
  for (const bool at_end : {false, true}) {
    const Vector2d& here = at_end ? a.end : a.begin;
    const Vector2d& back = at_end ? a.begin : a.end;
    for (const bool at_other_end : {false, true}) {
      const Vector2d& other = at_other_end ? b.end : b.begin;
      const Vector2d& on = at_other_end ? b.begin : b.end;
      if ((other - here).norm() <= kNeighborGap &&
          (back - here).dot(on - other) < 0.0) {
        return true;
      }
    }
  }
  return false;
}

// Of each face the others whose box is no farther from its own than `gap`, m.
std::vector<std::vector<std::size_t>> NearFaces(const std::vector<Face>& faces,
                                                double gap) {
  std::vector<std::size_t> order(faces.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto low = [&](std::size_t i) {
    return Vector2d(faces[i].begin.cwiseMin(faces[i].end));
  };
  const auto high = [&](std::size_t i) {
    return Vector2d(faces[i].begin.cwiseMax(faces[i].end));
  };
  std::stable_sort(
      order.begin(), order.end(),
      [&](std::size_t a, std::size_t b) { return low(a)[0] < low(b)[0]; });
  std::vector<std::vector<std::size_t>> near(faces.size());
  for (std::size_t place = 0; place < order.size(); ++place) {
    const std::size_t i = order[place];
    const Vector2d from = low(i);
    const Vector2d to = high(i);
    for (std::size_t next = place + 1; next < order.size(); ++next) {
      const std::size_t j = order[next];
      if (low(j)[0] > to[0] + gap) break;
      if (low(j)[1] > to[1] + gap || high(j)[1] < from[1] - gap) continue;
      near[i].push_back(j);
      near[j].push_back(i);
    }
  }
  for (std::vector<std::size_t>& list : near) {
    std::sort(list.begin(), list.end());
  }
  return near;
}

class CurveFinder {
 public:
  CurveFinder(const SpaceGrid& space, const WallLineOptions& lines,
              const CurvedWallOptions& options, std::vector<Face> faces)
      : space_(space),
        lines_(lines),
        options_(options),
        faces_(std::move(faces)),
        near_(NearFaces(faces_, std::max(options.max_gap, kNeighborGap) +
                                    options.on_circle)),
        is_taken_(faces_.size(), false) {}

  std::vector<CurvedWall> Find() {
    std::vector<Arc> candidates;
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      for (const std::size_t j : near_[i]) {
        if (j <= i || !AreNeighbors(faces_[i], faces_[j])) continue;
        Arc arc;
        if (Grow(i, j, &arc)) candidates.push_back(std::move(arc));
      }
    }
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [](const Arc& a, const Arc& b) { return a.wall > b.wall; });
    std::vector<Arc> arcs;
    for (const Arc& candidate : candidates) {
      const bool is_free =
          std::none_of(candidate.faces.begin(), candidate.faces.end(),
                       [&](std::size_t face) { return is_taken_[face]; });
      // What is left of it may be a curve of its own.
      Arc arc = candidate;
      if (!is_free && !Regrow(candidate, &arc)) continue;
      for (const std::size_t face : arc.faces) is_taken_[face] = true;
      arcs.push_back(std::move(arc));
    }
    JoinFaces(&arcs);
    for (std::size_t i = 0; i < arcs.size(); ++i) {
      DrawOn(i, &arcs);
      TakeOtherFaces(&arcs[i]);
    }
    TakeBeside(arcs);
    return Join(arcs);
  }

  const std::vector<bool>& is_taken() const { return is_taken_; }

 private:
  // Grows the curve through two neighbours.
  bool Grow(std::size_t i, std::size_t j, Arc* arc) const {
    arc->faces = {i, j};
    return Regrow(*arc, arc);
  }

  // The curve through those faces of another one that are not taken.
  bool Regrow(const Arc& seed, Arc* arc) const {
    std::vector<std::size_t> faces;
    for (const std::size_t face : seed.faces) {
      if (!is_taken_[face]) faces.push_back(face);
    }
    for (int round = 0; round < kGrowRounds; ++round) {
      if (faces.size() < 2) return false;
      std::vector<Vector2d> points;
      for (const std::size_t face : faces) AddPoints(faces_[face], &points);
      Circle circle;
      if (!FitCircle(points, &circle) || circle.radius < options_.min_radius ||
          circle.radius > options_.max_radius) {
        return false;
      }
      Arc grown;
      grown.circle = circle;
      Gather(faces.front(), &grown);
      const bool is_settled = grown.faces == faces;
      faces = grown.faces;
      *arc = std::move(grown);
      if (is_settled) break;
    }
    return IsCurve(*arc);
  }

  // The faces on a circle that go on from one of them, in the order of their
  // numbers, and the arc that they cover.
  void Gather(std::size_t first, Arc* arc) const {
    struct Piece {
      double from, to;
      std::size_t face;
    };
    // From the opposite of the first one on, so that it is in the middle.
    const Vector2d way = faces_[first].middle() - arc->circle.center;
    arc->from = std::atan2(way[1], way[0]) - kPi;
    std::vector<Piece> pieces;
    for (const std::size_t i : FacesOn(arc->circle, first)) {
      const double middle = arc->AngleOf(faces_[i].middle());
      const double half = 0.5 * faces_[i].length() / arc->circle.radius;
      pieces.push_back({middle - half, middle + half, i});
    }
    std::sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
      return std::tie(a.from, a.face) < std::tie(b.from, b.face);
    });
    const double gap = options_.max_gap / arc->circle.radius;
    const double opposite = arc->from + kPi;
    // The run of pieces without a larger gap that the first one is in.
    std::size_t begin = 0;
    std::size_t end = 0;
    double to = 0.0;
    bool has_first = false;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (i == begin || pieces[i].from > to + gap) {
        if (has_first) break;
        begin = i;
        to = pieces[i].to;
      }
      to = std::max(to, pieces[i].to);
      end = i + 1;
      has_first = has_first || pieces[i].face == first;
    }
    if (!has_first) {
      // It does not lie on the circle that was fitted to it and others.
      arc->from = opposite;
      arc->to = opposite;
      return;
    }
    arc->from = pieces[begin].from;
    arc->to = to;
    for (std::size_t i = begin; i < end; ++i) {
      arc->faces.push_back(pieces[i].face);
      arc->wall += faces_[pieces[i].face].length();
    }
    std::sort(arc->faces.begin(), arc->faces.end());
    // All around.
    if (arc->from + 2.0 * kPi <= arc->to + gap) arc->to = arc->from + 2.0 * kPi;
  }

  // The faces on a circle that are reached from one of them, each near to one
  // before.
  std::vector<std::size_t> FacesOn(const Circle& circle,
                                   std::size_t first) const {
    std::vector<std::size_t> found;
    std::set<std::size_t> seen = {first};
    const auto lies_on = [&](std::size_t face) {
      return !is_taken_[face] &&
             LiesOn(faces_[face], circle, 0.0, 0.0, options_.on_circle);
    };
    if (lies_on(first)) found.push_back(first);
    for (std::size_t k = 0; k < found.size(); ++k) {
      for (const std::size_t face : near_[found[k]]) {
        if (seen.insert(face).second && lies_on(face)) found.push_back(face);
      }
    }
    return found;
  }

  bool IsCurve(const Arc& arc) const {
    if (arc.wall < options_.min_wall || arc.turn() < options_.min_turn) {
      return false;
    }
    const double half = std::min(0.5 * arc.turn(), kPi);
    if (arc.circle.radius * (1.0 - std::cos(half)) < options_.min_sagitta) {
      return false;
    }
    std::vector<double> directions;
    for (const std::size_t face : arc.faces) {
      const double angle = faces_[face].angle();
      const bool is_new =
          std::all_of(directions.begin(), directions.end(), [&](double other) {
            return std::abs(NormalizeAxial(angle - other)) >= kLeastBend;
          });
      if (is_new) directions.push_back(angle);
    }
    if (directions.size() < kLeastDirections) return false;
    const std::vector<bool> covered = Covered(arc);
    const auto wall = std::count(covered.begin(), covered.end(), true);
    return static_cast<double>(wall) >=
           options_.min_share * static_cast<double>(covered.size());
  }

  // Which places along an arc, kStep apart, returns lie at.
  std::vector<bool> Covered(const Arc& arc) const {
    const int count =
        std::max(1, static_cast<int>(std::ceil(arc.length() / kStep)));
    std::vector<bool> covered;
    for (int i = 0; i < count; ++i) {
      covered.push_back(
          IsCovered(arc, arc.from + (i + 0.5) / count * arc.turn()));
    }
    return covered;
  }

  // Whether returns lie on an arc.
  bool IsCovered(const Arc& arc, double angle) const {
    const double beside = lines_.cell_distance;
    const Vector2d out(std::cos(angle), std::sin(angle));
    for (double v = arc.low - beside; v <= arc.high + beside + 1e-9;
         v += 0.5 * space_.resolution) {
      const Vector2d p = arc.circle.center + (arc.circle.radius + v) * out;
      if (space_.At(p) == Space::kOccupied) return true;
    }
    return false;
  }

  // Draws an arc on, at both ends, as far as returns lie on its circle and not
  // on that of another one.
  void DrawOn(std::size_t which, std::vector<Arc>* arcs) const {
    Arc* const arc = &(*arcs)[which];
    if (arc->is_closed()) return;
    Arc rest = *arc;
    rest.from = arc->to;
    rest.to = arc->from + 2.0 * kPi;
    std::vector<bool> covered = Covered(rest);
    for (std::size_t i = 0; i < covered.size(); ++i) {
      const Vector2d p = rest.At(
          rest.from + (static_cast<double>(i) + 0.5) /
                          static_cast<double>(covered.size()) * rest.turn());
      for (std::size_t k = 0; k < arcs->size() && covered[i]; ++k) {
        const Arc& other = (*arcs)[k];
        const double off = other.circle.Off(p);
        covered[i] = k == which || off < other.low - lines_.cell_distance ||
                     off > other.high + lines_.cell_distance ||
                     other.AngleOf(p) > other.to;
      }
    }
    const double step = rest.turn() / static_cast<double>(covered.size());
    const double after = WayOn(covered, step * arc->circle.radius);
    std::reverse(covered.begin(), covered.end());
    const double before = WayOn(covered, step * arc->circle.radius);
    if (after + before + options_.max_gap >= rest.length()) {
      arc->to = arc->from + 2.0 * kPi;
      return;
    }
    arc->to += after / arc->circle.radius;
    arc->from -= before / arc->circle.radius;
  }

  // How far what is covered goes on from the first place, m; `step`: between
  // places, m.
  double WayOn(const std::vector<bool>& covered, double step) const {
    std::size_t end = 0;
    for (std::size_t i = 0; i < covered.size();) {
      if (!covered[i]) {
        ++i;
        continue;
      }
      // With the pieces that follow after cracks.
      std::size_t last = i + 1;
      double wall = step;
      for (std::size_t k = last;
           k < covered.size() && static_cast<double>(k - last) * step <= kCrack;
           ++k) {
        if (!covered[k]) continue;
        last = k + 1;
        wall += step;
      }
      const double gap = static_cast<double>(i - end) * step;
      if (gap > options_.max_gap || (gap > kCrack && wall < kBeyondOpening)) {
        break;
      }
      end = last;
      i = last;
    }
    return static_cast<double>(end) * step;
  }

  // Makes one of the two faces of a wall.
  void JoinFaces(std::vector<Arc>* arcs) const {
    for (std::size_t i = 0; i < arcs->size(); ++i) {
      for (std::size_t j = i + 1; j < arcs->size(); ++j) {
        Arc& arc = (*arcs)[i];
        const Arc& other = (*arcs)[j];
        double least = 0.0;
        double most = 0.0;
        int both = 0;
        int free = 0;
        const int count =
            std::max(4, static_cast<int>(other.length() / kPointStep));
        for (int k = 0; k < count; ++k) {
          const Vector2d p =
              other.At(other.from + (k + 0.5) / count * other.turn());
          if (arc.AngleOf(p) > arc.to) continue;
          const double off = arc.circle.Off(p);
          least = both > 0 ? std::min(least, off) : off;
          most = both > 0 ? std::max(most, off) : off;
          ++both;
          const Vector2d between =
              p - 0.5 * off * (p - arc.circle.center).normalized();
          free += space_.At(between) == Space::kFree;
        }
        const double along = both * other.length() / count;
        if (both == 0 ||
            along < kBesideEachOther * std::min(arc.length(), other.length()) ||
            most - least > 2.0 * kSameDistance) {
          continue;
        }
        const double thickness =
            std::max(most, arc.high) - std::min(least, arc.low);
        if (thickness >
            (free > kSeenThrough * both ? lines_.max_thickness : kThickest)) {
          continue;
        }
        const double off = 0.5 * (least + most);
        arc.low = std::min(arc.low, off);
        arc.high = std::max(arc.high, off);
        // It may go on beyond the end.
        const double begin = arc.AngleOf(other.At(other.from));
        const double end = arc.AngleOf(other.At(other.to));
        const double more = std::max(0.0, other.turn());
        if (begin > arc.to && arc.from + 2.0 * kPi - begin < more) {
          arc.from = begin - 2.0 * kPi;
        }
        if (end > arc.to && end - arc.to < more) {
          arc.to = std::min(end, arc.from + 2.0 * kPi);
        }
        arc.to = std::min(arc.to, arc.from + 2.0 * kPi);
        arc.wall = std::max(arc.wall, other.wall);
        arcs->erase(arcs->begin() + static_cast<std::ptrdiff_t>(j));
        j = i;
      }
      CenterOn(&(*arcs)[i]);
    }
  }

  // Moves an arc to the middle of its wall.
  static void CenterOn(Arc* arc) {
    const double middle = 0.5 * (arc->low + arc->high);
    arc->circle.radius += middle;
    arc->low -= middle;
    arc->high -= middle;
  }

  // Makes faces that are left, and run beside an arc, the other face of its
  // wall: returns lie on both, and nothing was seen between them.
  void TakeOtherFaces(Arc* arc) {
    double low = arc->low;
    double high = arc->high;
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      if (is_taken_[i]) continue;
      double least = 0.0;
      double most = 0.0;
      int both = 0;
      int free = 0;
      const int count =
          std::max(4, static_cast<int>(faces_[i].length() / kStep));
      for (int k = 0; k < count; ++k) {
        const Vector2d p =
            faces_[i].begin +
            (k + 0.5) / count * (faces_[i].end - faces_[i].begin);
        const double off = arc->circle.Off(p);
        least = k > 0 ? std::min(least, off) : off;
        most = k > 0 ? std::max(most, off) : off;
        const double angle = arc->AngleOf(p);
        if (angle > arc->to || !IsCovered(*arc, angle)) continue;
        ++both;
        const Vector2d out = (p - arc->circle.center).normalized();
        free += space_.At(Vector2d(p - 0.5 * off * out)) == Space::kFree;
      }
      if (both < kBesideEachOther * count || free > kSeenThrough * both ||
          most - least > 2.0 * kSameDistance ||
          std::max(most, high) - std::min(least, low) > kThickest) {
        continue;
      }
      is_taken_[i] = true;
      low = std::min(low, 0.5 * (least + most));
      high = std::max(high, 0.5 * (least + most));
    }
    arc->low = low;
    arc->high = high;
    CenterOn(arc);
  }

  // Takes faces that lie on arcs, or within their walls.
  void TakeBeside(const std::vector<Arc>& arcs) {
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      for (const Arc& arc : arcs) {
        if (is_taken_[i]) break;
        is_taken_[i] = LiesOn(faces_[i], arc.circle, arc.low, arc.high,
                              options_.on_circle) &&
                       arc.AngleOf(faces_[i].middle()) <= arc.to;
      }
    }
  }

  // Corners along an arc: an opening lies within one edge.
  std::vector<Vector2d> CornersOf(const Arc& arc) const {
    const std::vector<bool> covered = Covered(arc);
    const auto count = static_cast<int>(covered.size());
    const double step = arc.length() / count;
    // Edges over openings, m along the arc.
    std::vector<std::pair<double, double>> over;
    for (int i = 0; i < count;) {
      int j = i;
      while (j < count && !covered[static_cast<std::size_t>(j)]) ++j;
      const double width = (j - i) * step;
      if (i > 0 && j < count && width >= kLeastOpening &&
          width <= kLargestOpening) {
        const double from = std::max(0.0, i * step - kJamb);
        const double to = std::min(arc.length(), j * step + kJamb);
        if (!over.empty() && from < over.back().second + kShortestEdge) {
          over.back().second = to;
        } else {
          over.emplace_back(from, to);
        }
      }
      i = std::max(j, i + 1);
    }
    const double edge =
        std::clamp(std::sqrt(8.0 * arc.circle.radius * kEdgeSagitta),
                   kShortestEdge, kLongestEdge);
    std::vector<Vector2d> corners;
    const auto add = [&](double along) {
      corners.push_back(arc.At(arc.from + along / arc.circle.radius));
    };
    double last = 0.0;
    add(last);
    const auto go_to = [&](double along) {
      const int edges =
          std::max(1, static_cast<int>(std::ceil((along - last) / edge)));
      for (int k = 1; k <= edges; ++k) add(last + k * (along - last) / edges);
      last = along;
    };
    for (const auto& [from, to] : over) {
      if (from > last + 1e-6) go_to(from);
      add(to);
      last = to;
    }
    if (arc.length() > last + 1e-6) go_to(arc.length());
    if (arc.is_closed()) corners.back() = corners.front();
    return corners;
  }

  // Closed curves begin in the middle of their longest piece of wall: their
  // ends have wall before and after them.
  Arc FromWall(const Arc& arc) const {
    if (!arc.is_closed()) return arc;
    const std::vector<bool> covered = Covered(arc);
    const std::size_t count = covered.size();
    std::size_t best = 0;
    std::size_t longest = 0;
    std::size_t run = 0;
    for (std::size_t i = 0; i < 2 * count; ++i) {
      run = covered[i % count] ? run + 1 : 0;
      if (run <= longest) continue;
      longest = run;
      best = i + 1 - (run + 1) / 2;
    }
    Arc turned = arc;
    turned.from += static_cast<double>(best % count) /
                   static_cast<double>(count) * arc.turn();
    turned.to = turned.from + 2.0 * kPi;
    return turned;
  }

  // Arcs as polylines, those that go on from each other as one.
  std::vector<CurvedWall> Join(const std::vector<Arc>& arcs) const {
    std::vector<CurvedWall> walls;
    for (const Arc& arc : arcs) {
      CurvedWall wall;
      wall.corners = CornersOf(FromWall(arc));
      // Counterclockwise: the center lies to the left.
      wall.low = -arc.high;
      wall.high = -arc.low;
      walls.push_back(std::move(wall));
    }
    for (std::size_t i = 0; i < walls.size(); ++i) {
      for (std::size_t j = i + 1; j < walls.size();) {
        if (!JoinEnds(walls[j], &walls[i])) {
          ++j;
          continue;
        }
        walls.erase(walls.begin() + static_cast<std::ptrdiff_t>(j));
        j = i + 1;
      }
    }
    return walls;
  }

  static CurvedWall Reversed(CurvedWall wall) {
    std::reverse(wall.corners.begin(), wall.corners.end());
    std::swap(wall.low, wall.high);
    wall.low = -wall.low;
    wall.high = -wall.high;
    return wall;
  }

  // Joins another curve to the end of a curve that it goes on from.
  static bool JoinEnds(const CurvedWall& other, CurvedWall* wall) {
    if (wall->is_closed() || other.is_closed()) return false;
    for (const bool from_begin : {false, true}) {
      const CurvedWall a = from_begin ? Reversed(*wall) : *wall;
      for (const bool is_turned : {false, true}) {
        const CurvedWall b = is_turned ? Reversed(other) : other;
        const Vector2d out =
            (a.corners.back() - a.corners[a.corners.size() - 2]).normalized();
        const Vector2d in = (b.corners[1] - b.corners[0]).normalized();
        if ((b.corners.front() - a.corners.back()).norm() > kGoesOnGap ||
            out.dot(in) < std::cos(kGoesOnBend)) {
          continue;
        }
        *wall = a;
        wall->corners.back() = 0.5 * (a.corners.back() + b.corners.front());
        wall->corners.insert(wall->corners.end(), b.corners.begin() + 1,
                             b.corners.end());
        wall->low = std::min(a.low, b.low);
        wall->high = std::max(a.high, b.high);
        return true;
      }
    }
    return false;
  }

  const SpaceGrid& space_;
  const WallLineOptions& lines_;
  const CurvedWallOptions& options_;
  const std::vector<Face> faces_;
  // Of each face those that a curve may go on with.
  const std::vector<std::vector<std::size_t>> near_;
  std::vector<bool> is_taken_;
};

}  // namespace

std::vector<CurvedWall> TakeCurvedWalls(const SpaceGrid& space,
                                        const WallLineOptions& line_options,
                                        const CurvedWallOptions& options,
                                        std::vector<KnownWall>* pieces) {
  std::vector<Face> faces;
  std::vector<std::size_t> piece_of;
  for (std::size_t i = 0; i < pieces->size(); ++i) {
    const Face face{(*pieces)[i].begin, (*pieces)[i].end};
    if (!(face.length() >= kShortest) || !std::isfinite(face.length()))
      continue;
    faces.push_back(face);
    piece_of.push_back(i);
  }
  CurveFinder finder(space, line_options, options, std::move(faces));
  std::vector<CurvedWall> walls = finder.Find();
  std::vector<bool> is_taken(pieces->size(), false);
  for (std::size_t i = 0; i < piece_of.size(); ++i) {
    is_taken[piece_of[i]] = finder.is_taken()[i];
  }
  std::vector<KnownWall> left;
  for (std::size_t i = 0; i < pieces->size(); ++i) {
    if (!is_taken[i]) left.push_back((*pieces)[i]);
  }
  *pieces = std::move(left);
  return walls;
}

}  // namespace plumbline
