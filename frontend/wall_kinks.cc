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

// Sums of one more term z of a line, across = a + b x + c z, over the samples.
struct TermSums {
  double z = 0.0, zz = 0.0, xz = 0.0, yz = 0.0;
};

// z = max(0, x - x0): the line turns at x0. `right`: the samples from there.
TermSums TurnAt(double x0, const LineSums& right) {
  return {right.x - x0 * right.n,
          right.xx - 2.0 * x0 * right.x + x0 * x0 * right.n,
          right.xx - x0 * right.x, right.xy - x0 * right.y};
}

// z = [x > x0]: it steps aside there.
TermSums StepAt(const LineSums& right) {
  return {right.n, right.n, right.x, right.y};
}

// A term that was fitted.
struct FittedTerm {
  // First sample behind it; 0 for none.
  std::size_t cut = 0;
  // c, its information at samples of variance 1, and by how much the term makes
  // the sum of squares smaller, m^2.
  double amount = 0.0;
  double information = 0.0;
  double explained = 0.0;

  // Fits it beside the line; the better of this and what was there stays.
  void Fit(const TermSums& term, const LineSums& all, std::size_t at) {
    const double x = term.xz - all.x * term.z / all.n;
    const double own = term.zz - term.z * term.z / all.n - x * x / all.Spread();
    if (own <= 1e-9) return;
    const double cross = all.xy - all.x * all.y / all.n;
    const double score =
        term.yz - all.y * term.z / all.n - x * cross / all.Spread();
    if (score * score / own <= explained) return;
    *this = {at, std::abs(score / own), own, score * score / own};
  }

  double Sigma(const LineSums& all) const {
    const double residual = std::max(all.SquaredError() - explained, 0.0);
    return std::sqrt(residual / (all.n - 3.0) / information);
  }
};

// The same for an end of another wall that is too short for a direction of
// its own, where one line that turns has the turn at twice the precision, and
// for two parallel walls: one line through both is tilted, by 2 degrees for a
// step of 5 cm in 2 m.
std::size_t FindTurnOrStep(const std::vector<WallSample>& samples,
                           const LineSums& all,
                           const WallKinkOptions& options) {
  const std::size_t n = samples.size();
  const double begin = samples.front().along;
  const double end = samples.back().along;
  LineSums left;
  FittedTerm turn, step;
  for (std::size_t k = 1; k < n; ++k) {
    left.Add(samples[k - 1].along, samples[k - 1].across);
    const double shorter =
        std::min(samples[k - 1].along - begin, end - samples[k].along);
    if (shorter < options.min_end) continue;
    const LineSums right = all - left;
    if (options.min_step > 0.0) step.Fit(StepAt(right), all, k);
    if (shorter <= options.max_end_share * (end - begin)) {
      turn.Fit(TurnAt(0.5 * (samples[k - 1].along + samples[k].along), right),
               all, k);
    }
  }
  if (step.explained > turn.explained && step.amount >= options.min_step &&
      step.amount >= options.min_sigmas * step.Sigma(all)) {
    return step.cut;
  }
  return turn.cut != 0 && IsKink(turn.amount, turn.Sigma(all), options)
             ? turn.cut
             : 0;
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
  return bend != 0 ? bend : FindTurnOrStep(samples, all, options);
}

}  // namespace plumbline
