#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/sight_lines.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace plumbline {

int GiveLooks(const std::shared_ptr<const Looks>& looks,
              const Hierarchy& hierarchy) {
  int count = 0;
  for (const auto& level : hierarchy) {
    for (const auto& detector : level) {
      auto* const reader = dynamic_cast<LooksReader*>(detector.get());
      if (reader == nullptr) continue;
      reader->SetLooks(looks);
      ++count;
    }
  }
  return count;
}

std::optional<SightCrossing> CrossingOf(const Wall& wall,
                                        const Eigen::Vector2d& sensor,
                                        const Eigen::Vector2d& end) {
  const double from = wall.Across(sensor);
  const double to = wall.Across(end);
  if ((from < 0.0) == (to < 0.0) || from == 0.0) return std::nullopt;
  const Eigen::Vector2d line = end - sensor;
  SightCrossing crossing;
  crossing.along = wall.Along(sensor + from / (from - to) * line);
  crossing.beyond = std::abs(to);
  crossing.side = from < 0.0 ? -1.0 : 1.0;
  crossing.slant = std::abs(from - to) / line.norm();
  return crossing;
}

PlacedLooks::PlacedLooks(const Looks& looks, const Graph& graph) {
  placed_.reserve(looks.size());
  positions_.reserve(looks.size());
  // Looks of one frame mostly follow each other.
  FeatureId last = kNoId;
  Placed placed;
  PoseTransform to_map(placed.frame);
  bool has_place = true;
  for (const Look& look : looks) {
    if (look.frame != last) {
      last = look.frame;
      placed.frame = Pose2::Zero();
      has_place = true;
      if (last != kNoId) {
        const Feature* feature = graph.FindFeature(last);
        has_place = feature != nullptr && feature->type->frame;
        if (has_place) placed.frame = feature->type->frame(*feature);
      }
      to_map = PoseTransform(placed.frame);
      placed.axis = to_map.Direction(Eigen::Vector2d::UnitX());
    }
    if (!has_place) continue;
    placed.look = &look;
    placed.sensor = to_map.Point(look.sensor);
    positions_.push_back({RowAt(placed.sensor.y()), placed.sensor.x(),
                          placed.sensor.y(), placed_.size()});
    placed_.push_back(placed);
  }
  std::sort(positions_.begin(), positions_.end(),
            [](const Position& a, const Position& b) {
              return std::tie(a.row, a.x, a.index) <
                     std::tie(b.row, b.x, b.index);
            });
}

double PlacedLooks::RowAt(double y) {
  // As high as what is asked for reaches: few rows, and little else in them.
  constexpr double kHeight = 4.0;
  return std::floor(y / kHeight);
}

Wall PlacedLooks::Seen(std::size_t i, const Wall& wall) const {
  const Placed& placed = placed_[i];
  Wall seen;
  seen.position = DirectionSeen(i, wall.position - placed.frame.head<2>());
  seen.angle = NormalizeAngle(wall.angle - placed.frame[2]);
  seen.direction = DirectionSeen(i, wall.direction);
  seen.begin = wall.begin;
  seen.end = wall.end;
  return seen;
}

std::vector<std::size_t> PlacedLooks::Near(const Wall& wall,
                                           double range) const {
  const Eigen::Vector2d begin = wall.At(wall.begin);
  const Eigen::Vector2d end = wall.At(wall.end);
  const double left = std::min(begin.x(), end.x());
  const double right = std::max(begin.x(), end.x());
  const double below = std::min(begin.y(), end.y());
  const double above = std::max(begin.y(), end.y());
  std::vector<std::size_t> near;
  if (!(wall.begin <= wall.end)) return near;
  const double last_row = RowAt(above + range);
  auto entry = std::lower_bound(
      positions_.begin(), positions_.end(), RowAt(below - range),
      [](const Position& position, double row) { return position.row < row; });
  while (entry != positions_.end() && entry->row <= last_row) {
    const auto row_end =
        std::upper_bound(entry, positions_.end(), entry->row,
                         [](double row, const Position& position) {
                           return row < position.row;
                         });
    entry = std::lower_bound(
        entry, row_end, left - range,
        [](const Position& position, double x) { return position.x < x; });
    for (; entry != row_end && entry->x <= right + range; ++entry) {
      const Eigen::Vector2d sensor(entry->x, entry->y);
      const double along = std::clamp(wall.Along(sensor), wall.begin, wall.end);
      if ((sensor - wall.At(along)).squaredNorm() > range * range) continue;
      near.push_back(entry->index);
    }
    entry = row_end;
  }
  return near;
}

SeenPieces::SeenPieces(double begin, double end,
                       const SeenThroughOptions& options)
    : options_(options), begin_(begin), end_(end) {
  const double length = end - begin;
  if (!(length > 0.0) || !std::isfinite(length)) return;
  const auto size = static_cast<std::size_t>(std::ceil(length / options.piece));
  passed_.resize(size, 0);
  kept_.resize(size, 0);
}

std::optional<std::size_t> SeenPieces::PieceAt(double along) const {
  if (!(along >= begin_ && along < end_) || passed_.empty()) {
    return std::nullopt;
  }
  return std::min(passed_.size() - 1,
                  static_cast<std::size_t>((along - begin_) / options_.piece));
}

void SeenPieces::Add(const Wall& wall, const Look& look) {
  for (const Eigen::Vector2d& end : look.ends) {
    if (std::abs(wall.Across(end)) <= options_.thickness) {
      if (const auto piece = PieceAt(wall.Along(end))) ++kept_[*piece];
      continue;
    }
    const std::optional<SightCrossing> crossing =
        CrossingOf(wall, look.sensor, end);
    if (!crossing || crossing->beyond < options_.passed ||
        crossing->slant < options_.min_slant) {
      continue;
    }
    if (const auto piece = PieceAt(crossing->along)) ++passed_[*piece];
  }
}

std::vector<Interval> SeenPieces::Through(double min_width) const {
  std::vector<Interval> stretches;
  const auto is_through = [this](std::size_t i) {
    return passed_[i] >= options_.min_lines &&
           passed_[i] > options_.min_ratio * kept_[i];
  };
  const auto says_nothing = [this](std::size_t i) {
    return passed_[i] == 0 && kept_[i] == 0;
  };
  const std::size_t size = passed_.size();
  for (std::size_t i = 0; i < size; ++i) {
    if (!is_through(i)) continue;
    std::size_t last = i;
    for (std::size_t k = i + 1; k < size && k <= last + 2; ++k) {
      if (is_through(k)) {
        last = k;
      } else if (!says_nothing(k)) {
        break;
      }
    }
    const double begin = begin_ + static_cast<double>(i) * options_.piece;
    const double end =
        std::min(end_, begin_ + static_cast<double>(last + 1) * options_.piece);
    if (end - begin >= min_width - 1e-9) stretches.emplace_back(begin, end);
    i = last;
  }
  return stretches;
}

}  // namespace plumbline
