#include <plumbline/frontend/guessed_turns.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

namespace plumbline {
namespace {

constexpr double kQuarter = DegToRad(90.0);
constexpr int kBins = 180;
constexpr double kBin = kQuarter / kBins;

// Into [-45, 45) degrees: walls at right angles have one direction.
double FoldedAngle(double angle) {
  return angle - kQuarter * std::floor(angle / kQuarter + 0.5);
}

// How many returns have which direction of wall, up to right angles.
class DirectionCounts {
 public:
  void Add(const SeenKey& key, double sign) {
    for (const Eigen::Vector4f& point : key.points) {
      const double angle =
          key.pose[2] + std::atan2(static_cast<double>(point[3]),
                                   static_cast<double>(point[2]));
      const double folded = FoldedAngle(angle) + 0.5 * kQuarter;
      const auto bin = std::min<std::size_t>(
          static_cast<std::size_t>(folded / kBin), kBins - 1);
      counts_[bin] += sign;
      total_ += sign;
    }
  }

  // The direction of most, unless the rest is too much; folded.
  std::optional<double> Direction(const GuessedTurnOptions& options) const {
    if (total_ <= 0.0) return std::nullopt;
    const int reach = static_cast<int>(options.width / kBin);
    const auto at = [&](int b) {
      return counts_[static_cast<std::size_t>((b + kBins) % kBins)];
    };
    std::array<double, kBins> sums;
    for (int b = 0; b < kBins; ++b) {
      double& sum = sums[static_cast<std::size_t>(b)];
      sum = 0.0;
      for (int d = -reach; d <= reach; ++d) sum += at(b + d);
    }
    const int best = static_cast<int>(
        std::max_element(sums.begin(), sums.end()) - sums.begin());
    const double most = sums[static_cast<std::size_t>(best)];
    double rival = 0.0;
    for (int d = 2 * reach + 1; d < kBins - 2 * reach; ++d) {
      rival =
          std::max(rival, sums[static_cast<std::size_t>((best + d) % kBins)]);
    }
    if (most < options.least_share * total_ ||
        rival > options.most_of_rival * most) {
      return std::nullopt;
    }
    double moment = 0.0;
    for (int d = -reach; d <= reach; ++d) moment += d * at(best + d);
    return FoldedAngle((best + 0.5 + moment / most) * kBin - 0.5 * kQuarter);
  }

 private:
  std::array<double, kBins> counts_{};
  double total_ = 0.0;
};

// Directions of the walls along key scans [begin, end).
struct TrackDirections {
  std::optional<double> first;
  std::optional<double> last;
  bool keeps = true;
};

TrackDirections DirectionsOf(const std::vector<SeenKey>& seen,
                             std::size_t begin, std::size_t end,
                             const GuessedTurnOptions& options) {
  TrackDirections directions;
  const std::size_t size = std::min(
      end - begin, static_cast<std::size_t>(std::max(1, options.window_keys)));
  if (size < static_cast<std::size_t>(options.least_keys)) return directions;
  DirectionCounts counts;
  for (std::size_t k = begin; k < begin + size; ++k) counts.Add(seen[k], 1.0);
  directions.first = counts.Direction(options);
  std::optional<double> before = directions.first;
  const std::size_t step = std::max<std::size_t>(1, size / 4);
  std::size_t from = begin;
  directions.last = directions.first;
  while (from + size < end) {
    const std::size_t next = std::min(from + step, end - size);
    for (; from < next; ++from) {
      counts.Add(seen[from], -1.0);
      counts.Add(seen[from + size], 1.0);
    }
    directions.last = counts.Direction(options);
    if (!directions.last) continue;
    if (before && std::abs(FoldedAngle(*directions.last - *before)) >
                      options.most_change) {
      directions.keeps = false;
    }
    before = directions.last;
  }
  return directions;
}

}  // namespace

std::vector<GuessedTurn> FindGuessedTurns(const std::vector<SeenKey>& seen,
                                          const std::vector<int>& loose_of,
                                          const std::vector<BlindWay>& blind,
                                          const GuessedTurnOptions& options) {
  std::vector<GuessedTurn> turns;
  std::optional<TrackDirections> before;
  int newest = seen.empty() ? 0 : seen.front().part;
  for (std::size_t begin = 0; begin < seen.size();) {
    std::size_t end = begin + 1;
    while (end < seen.size() && seen[end].part == seen[begin].part) ++end;
    const TrackDirections here = DirectionsOf(seen, begin, end, options);
    // A part of before that is taken up again was found.
    const bool is_guess = seen[begin].part > newest;
    newest = std::max(newest, seen[begin].part);
    if (is_guess && before && before->keeps && here.keeps && before->last &&
        here.first) {
      const double turn = FoldedAngle(*before->last - *here.first);
      const int scan = seen[begin].scan;
      double most = options.most_turn;
      if (std::any_of(blind.begin(), blind.end(),
                      [&](const BlindWay& way) { return way.to == scan; })) {
        const double over_gap =
            NormalizeAngle(seen[begin].pose[2] - seen[begin - 1].pose[2]);
        most = std::min(
            most, options.least_turn + options.most_share * std::abs(over_gap));
      }
      if (std::abs(turn) <= most) {
        const auto part = static_cast<std::size_t>(seen[begin].part);
        turns.push_back({scan, turn, loose_of[part - 1]});
      }
    }
    before = here;
    begin = end;
  }
  return turns;
}

Pose2 WithTurn(const Pose2& motion, double turn) {
  const Pose2 half(0.0, 0.0, 0.5 * turn);
  return Compose(Compose(half, motion), half);
}

}  // namespace plumbline
