#ifndef PLUMBLINE_APPS_SOLVE_RUN_CLOCK_H_
#define PLUMBLINE_APPS_SOLVE_RUN_CLOCK_H_

#include <plumbline/apps/cli/progress.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/outputs/summary.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Times of a whole run and of its steps, and the bar over them: each step ends
/// where the next begins.
class RunClock {
 public:
  /// A step; one of the same name goes on.
  void Begin(const std::string& step);

  /// The bar over all steps.
  WorkProgress& bar() { return bar_; }

  /// The step that is under way.
  const std::string& step() const { return step_; }

  /// Puts the total and the steps until now into the summary.
  void Read(Summary* summary) const;

 private:
  using Steps = std::vector<std::pair<std::string, double>>;

  // Takes in the step that is under way.
  void Add(double seconds, Steps* steps) const;

  WorkProgress bar_;
  Stopwatch watch_;
  Steps steps_;
  std::string step_ = "start";
  // s on the watch.
  double step_begin_ = 0.0;
};

/// What WorkProgress::Update takes: below 0 when the whole is not known.
double ShareOf(std::int64_t done, std::int64_t total);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_RUN_CLOCK_H_
