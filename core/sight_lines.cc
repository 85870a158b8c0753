#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/sight_lines.h>

#include <algorithm>
#include <cmath>

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
  for (const Look& look : looks) {
    Placed placed;
    placed.look = &look;
    if (look.frame != kNoId) {
      const Feature* feature = graph.FindFeature(look.frame);
      if (feature == nullptr || !feature->type->frame) continue;
      placed.frame = feature->type->frame(*feature);
    }
    placed.sensor = TransformPoint(placed.frame, look.sensor);
    by_x_.emplace_back(placed.sensor.x(), placed_.size());
    placed_.push_back(placed);
  }
  std::sort(by_x_.begin(), by_x_.end());
}

std::vector<std::size_t> PlacedLooks::Near(const Wall& wall,
                                           double range) const {
  const Eigen::Vector2d begin = wall.At(wall.begin);
  const Eigen::Vector2d end = wall.At(wall.end);
  const double first = std::min(begin.x(), end.x()) - range;
  const double last = std::max(begin.x(), end.x()) + range;
  std::vector<std::size_t> near;
  for (auto entry = std::lower_bound(by_x_.begin(), by_x_.end(),
                                     std::make_pair(first, std::size_t{0}));
       entry != by_x_.end() && entry->first <= last; ++entry) {
    const Eigen::Vector2d& sensor = placed_[entry->second].sensor;
    const double along = std::clamp(wall.Along(sensor), wall.begin, wall.end);
    if ((sensor - wall.At(along)).squaredNorm() > range * range) continue;
    near.push_back(entry->second);
  }
  std::sort(near.begin(), near.end());
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
