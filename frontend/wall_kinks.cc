#include <plumbline/frontend/wall_kinks.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

constexpr std::size_t kFewestSamples = 12;

// Sums of a least squares line through samples along and across a wall, m.
struct LineSums {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;

  void Add(double along, double across) {
    n += 1.0;
    x += along;
    y += across;
    xx += along * along;
    xy += along * across;
    yy += across * across;
  }
  LineSums operator-(const LineSums& o) const {
    return {n - o.n, x - o.x, y - o.y, xx - o.xx, xy - o.xy, yy - o.yy};
  }
  // Sum of squares of the way along around its mean, m^2.
  double Spread() const { return std::max(xx - x * x / n, 1e-12); }
  double Slope() const { return (xy - x * y / n) / Spread(); }
  double SquaredError() const {
    const double cross = xy - x * y / n;
    return std::max(yy - y * y / n - cross * cross / Spread(), 0.0);
  }
};

bool IsKink(double turn, double sigma, const WallKinkOptions& options) {
  return turn >= options.min_turn && turn >= options.min_sigmas * sigma;
}

// First sample of the second of two walls, both long enough to have a
// direction of their own; 0 where one wall will do.
std::size_t FindBend(const std::vector<WallSample>& samples,
                     const LineSums& all, const WallKinkOptions& options) {
  const std::size_t n = samples.size();
  LineSums left;
  double best = all.SquaredError();
  std::size_t cut = 0;
  LineSums best_left, best_right;
  for (std::size_t k = 1; k < n; ++k) {
    left.Add(samples[k - 1].along, samples[k - 1].across);
    if (samples[k - 1].along - samples[0].along < options.min_length ||
        samples[n - 1].along - samples[k].along < options.min_length) {
      continue;
    }
    const LineSums right = all - left;
    const double error = left.SquaredError() + right.SquaredError();
    if (error < best) {
      best = error;
      cut = k;
      best_left = left;
      best_right = right;
    }
  }
  if (cut == 0) return 0;
  const double turn = std::abs(best_left.Slope() - best_right.Slope());
  const double sigma =
      std::sqrt(best / static_cast<double>(n - 4) *
                (1.0 / best_left.Spread() + 1.0 / best_right.Spread()));
  return IsKink(turn, sigma, options) ? cut : 0;
}

// The same for an end of another wall that is too short for a direction of
// its own: one line that turns (across = a + b x + c max(0, x - x0)) has the
// turn c at twice the precision.
std::size_t FindTurnedEnd(const std::vector<WallSample>& samples,
                          const LineSums& all, const WallKinkOptions& options) {
  const std::size_t n = samples.size();
  const double begin = samples.front().along;
  const double end = samples.back().along;
  const double cross = all.xy - all.x * all.y / all.n;
  LineSums left;
  double best = 0.0, turn = 0.0, best_information = 0.0;
  std::size_t cut = 0;
  for (std::size_t k = 1; k < n; ++k) {
    left.Add(samples[k - 1].along, samples[k - 1].across);
    const double shorter =
        std::min(samples[k - 1].along - begin, end - samples[k].along);
    if (shorter < options.min_end ||
        shorter > options.max_end_share * (end - begin)) {
      continue;
    }
    const LineSums right = all - left;
    const double x0 = 0.5 * (samples[k - 1].along + samples[k].along);
    // Sums of z = max(0, x - x0), reduced for a and b.
    const double z = right.x - x0 * right.n;
    const double zz = right.xx - 2.0 * x0 * right.x + x0 * x0 * right.n;
    const double xz = right.xx - x0 * right.x - all.x * z / all.n;
    const double information = zz - z * z / all.n - xz * xz / all.Spread();
    if (information <= 1e-9) continue;
    const double score =
        right.xy - x0 * right.y - all.y * z / all.n - xz * cross / all.Spread();
    if (score * score / information > best) {
      best = score * score / information;
      turn = std::abs(score / information);
      best_information = information;
      cut = k;
    }
  }
  if (cut == 0) return 0;
  const double residual = std::max(all.SquaredError() - best, 0.0);
  const double sigma =
      std::sqrt(residual / static_cast<double>(n - 3) / best_information);
  return IsKink(turn, sigma, options) ? cut : 0;
}

}  // namespace

std::size_t FindWallKink(const std::vector<WallSample>& samples,
                         const WallKinkOptions& options) {
  if (samples.size() < kFewestSamples) return 0;
  LineSums all;
  for (const WallSample& sample : samples) {
    all.Add(sample.along, sample.across);
  }
  const std::size_t bend = FindBend(samples, all, options);
  return bend != 0 ? bend : FindTurnedEnd(samples, all, options);
}

}  // namespace plumbline
