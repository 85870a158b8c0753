#include <plumbline/detectors/rectangle_fit.h>

#include <algorithm>

namespace plumbline {
namespace {

// Which side of a rectangle in this direction the first of the given ones is.
std::size_t FirstSide(double theta, const WallsOfSides& walls) {
  const VisibleWall& first = *walls[0][0];
  const Eigen::Vector2d outward = first.middle - walls[2][0]->middle;
  Eigen::Vector2d normal(first.direction.y(), -first.direction.x());
  if (normal.dot(outward) < 0.0) normal = -normal;
  std::size_t best = 0;
  double largest = -2.0;
  for (std::size_t k = 0; k < WalledRectangle::kSides.size(); ++k) {
    const double angle = theta + WalledRectangle::kSides[k];
    const double cosine =
        normal.dot(Eigen::Vector2d(std::sin(angle), -std::cos(angle)));
    if (cosine > largest) {
      largest = cosine;
      best = k;
    }
  }
  return best;
}

}  // namespace

double CommonArea(const WalledRectangle& first, const WalledRectangle& second) {
  const Eigen::Vector2d x = first.Direction(0);
  const Eigen::Vector2d y(-x.y(), x.x());
  const Eigen::Vector2d offset = second.center - first.center;
  const bool is_turned =
      std::abs(std::sin(second.theta - first.theta)) > std::sqrt(0.5);
  const double a = is_turned ? second.b : second.a;
  const double b = is_turned ? second.a : second.b;
  const double width =
      Overlap({-first.a, first.a}, {x.dot(offset) - a, x.dot(offset) + a});
  const double height =
      Overlap({-first.b, first.b}, {y.dot(offset) - b, y.dot(offset) + b});
  return std::max(width, 0.0) * std::max(height, 0.0);
}

WalledRectangle FitRectangle(const WallsOfSides& walls) {
  // Sums of the doubled doubled angle tell a direction modulo 90 degrees.
  double cosine = 0.0, sine = 0.0;
  for (const auto& side : walls) {
    for (const VisibleWall* wall : side) {
      // The variance of a direction falls with the length cubed.
      const double weight = std::pow(wall->half_length, 3.0);
      cosine += weight * std::cos(4.0 * wall->angle);
      sine += weight * std::sin(4.0 * wall->angle);
    }
  }
  WalledRectangle rectangle;
  rectangle.theta = 0.25 * std::atan2(sine, cosine);
  const Eigen::Vector2d origin = walls[0][0]->middle;
  // Offsets of the sides outward. The given sides turn counterclockwise from
  // any of the four.
  std::array<double, WalledRectangle::kNumSides> offsets{};
  const std::size_t first = FirstSide(rectangle.theta, walls);
  for (std::size_t given = 0; given < walls.size(); ++given) {
    const std::size_t k = (first + given) % walls.size();
    const Eigen::Vector2d normal = rectangle.Normal(static_cast<int>(k));
    double sum = 0.0, weights = 0.0;
    for (const VisibleWall* wall : walls[given]) {
      sum += wall->half_length * normal.dot(wall->middle - origin);
      weights += wall->half_length;
    }
    offsets[k] = sum / weights;
    for (const VisibleWall* wall : walls[given]) {
      rectangle.sides[k].push_back({wall->feature, {}, true});
    }
  }
  rectangle.a = 0.5 * (offsets[1] + offsets[3]);
  rectangle.b = 0.5 * (offsets[0] + offsets[2]);
  rectangle.center = origin +
                     0.5 * (offsets[1] - offsets[3]) * rectangle.Normal(1) +
                     0.5 * (offsets[2] - offsets[0]) * rectangle.Normal(2);
  return rectangle;
}

std::optional<Interval> IntervalOnSide(const VisibleWall& wall,
                                       const WalledRectangle& rectangle,
                                       int side, double gate,
                                       double gate_angle) {
  const double angle =
      rectangle.theta + WalledRectangle::kSides[static_cast<std::size_t>(side)];
  const Eigen::Vector2d middle = rectangle.Middle(side);
  if (std::abs(NormalizeAxial(wall.angle - angle)) > gate_angle) {
    return std::nullopt;
  }
  // Across where the wall is nearest to the middle of the side: a long wall
  // may go far beyond it, and a short one says little about what is beyond.
  const double along = std::clamp(wall.direction.dot(middle - wall.middle),
                                  -wall.half_length, wall.half_length);
  const Eigen::Vector2d nearest = wall.middle + along * wall.direction;
  if (std::abs(rectangle.Normal(side).dot(nearest - middle)) > gate) {
    return std::nullopt;
  }
  const Interval interval =
      IntervalAlong(wall, middle, rectangle.Direction(side));
  const double half = rectangle.HalfLength(side);
  const bool is_on =
      Overlap(interval, {-half, half}) >= std::min(wall.half_length, half);
  if (!is_on) return std::nullopt;
  return interval;
}

}  // namespace plumbline
