#include <plumbline/detectors/corridor_axis.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <limits>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// A wall that reaches beyond this part of the half width on both sides of the
// axis closes the corridor.
constexpr double kCrossing = 0.5;

}  // namespace

double CorridorSideDirection(CorridorSide side) {
  return side == kRightSide ? 0.0 : kPi;
}

double CorridorSideSign(CorridorSide side) {
  return side == kRightSide ? 1.0 : -1.0;
}

Vector2d CorridorAxis::Local(const Vector2d& point) const {
  const Vector2d along = direction();
  const Vector2d relative = point - origin;
  return {along.dot(relative),
          along.x() * relative.y() - along.y() * relative.x()};
}

Interval CorridorAxis::IntervalOf(const Wall& wall) const {
  const double begin = Local(wall.At(wall.begin)).x();
  const double end = Local(wall.At(wall.end)).x();
  return std::minmax(begin, end);
}

bool CorridorAxis::IsWithin(const CorridorAxis& other,
                            const Interval& interval) const {
  const Vector2d local = other.Local(origin);
  return std::abs(local.y()) < other.half_width && local.x() > interval.first &&
         local.x() < interval.second &&
         std::abs(NormalizeAxial(angle - other.angle)) < 0.25 * kPi;
}

CorridorAxis AxisBetween(const WallFace& first, const WallFace& second) {
  CorridorAxis axis;
  // A long face knows its direction best.
  const double weight =
      std::pow(first.length, 3.0) /
      (std::pow(first.length, 3.0) + std::pow(second.length, 3.0));
  const double turn =
      NormalizeAngle(second.wall.angle - first.wall.angle + kPi);
  axis.angle = NormalizeAngle(first.wall.angle + (1.0 - weight) * turn);
  const Interval other = first.wall.IntervalOf(second.wall);
  const double along = 0.5 * (std::max(first.wall.begin, other.first) +
                              std::min(first.wall.end, other.second));
  const Vector2d right = first.wall.At(along);
  const Vector2d left = second.wall.At(second.wall.Along(right));
  axis.origin = 0.5 * (right + left);
  axis.half_width = 0.5 * second.wall.Across(right);
  return axis;
}

SideFace OnSide(const CorridorAxis& axis, const WallFace& face,
                std::size_t index) {
  SideFace on;
  on.face = index;
  const double difference = NormalizeAngle(face.wall.angle - axis.angle);
  on.side = std::abs(difference) < 0.5 * kPi ? kRightSide : kLeftSide;
  on.turn = NormalizeAngle(difference - CorridorSideDirection(on.side));
  const Vector2d local = axis.Local(face.middle);
  on.along = local.x();
  on.past = -CorridorSideSign(on.side) * local.y() - axis.half_width;
  on.interval = axis.IntervalOf(face.wall);
  return on;
}

std::optional<Interval> FreeReach(const CorridorAxis& axis,
                                  const Interval& part,
                                  const std::vector<WallFace>& faces,
                                  std::size_t graph_part) {
  Interval reach = {-std::numeric_limits<double>::infinity(),
                    std::numeric_limits<double>::infinity()};
  const double middle = 0.5 * (part.first + part.second);
  for (const WallFace& face : faces) {
    if (face.part != graph_part) continue;
    const Vector2d begin = axis.Local(face.wall.At(face.wall.begin));
    const Vector2d end = axis.Local(face.wall.At(face.wall.end));
    const double far = kCrossing * axis.half_width;
    if (std::min(begin.y(), end.y()) > -far ||
        std::max(begin.y(), end.y()) < far) {
      continue;
    }
    const double share = begin.y() / (begin.y() - end.y());
    const double at = begin.x() + share * (end.x() - begin.x());
    if (at > part.first && at < part.second) return std::nullopt;
    double& limit = at < middle ? reach.first : reach.second;
    limit = at < middle ? std::max(limit, at) : std::min(limit, at);
  }
  return reach;
}

std::vector<SideFace> JoinedTo(const Interval& part,
                               const std::vector<SideFace>& faces,
                               double max_opening) {
  Interval joined = part;
  std::vector<bool> is_in(faces.size(), false);
  for (bool has_grown = true; has_grown;) {
    has_grown = false;
    for (std::size_t k = 0; k < faces.size(); ++k) {
      if (is_in[k] || -Overlap(faces[k].interval, joined) > max_opening) {
        continue;
      }
      is_in[k] = true;
      has_grown = true;
      joined = Hull({joined, faces[k].interval});
    }
  }
  std::vector<SideFace> result;
  for (std::size_t k = 0; k < faces.size(); ++k) {
    if (is_in[k]) result.push_back(faces[k]);
  }
  return result;
}

Interval Hull(const std::vector<Interval>& intervals) {
  Interval hull = intervals.front();
  for (const auto& [begin, end] : intervals) {
    hull.first = std::min(hull.first, begin);
    hull.second = std::max(hull.second, end);
  }
  return hull;
}

double UnionLength(std::vector<Interval> intervals) {
  std::sort(intervals.begin(), intervals.end());
  double covered = 0.0;
  double end = -std::numeric_limits<double>::infinity();
  for (const auto& [begin, its_end] : intervals) {
    covered += std::max(0.0, its_end - std::max(begin, end));
    end = std::max(end, its_end);
  }
  return covered;
}

}  // namespace plumbline
