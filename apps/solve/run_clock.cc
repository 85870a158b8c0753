#include <plumbline/apps/solve/run_clock.h>

#include <algorithm>

namespace plumbline {

void RunClock::Begin(const std::string& step) {
  bar_.Begin(step);
  const double now = watch_.Seconds();
  Add(now - step_begin_, &steps_);
  step_ = step;
  step_begin_ = now;
}

void RunClock::Read(Summary* summary) const {
  summary->total_seconds = watch_.Seconds();
  summary->step_seconds = steps_;
  Add(summary->total_seconds - step_begin_, &summary->step_seconds);
}

void RunClock::Add(double seconds, Steps* steps) const {
  const auto same =
      std::find_if(steps->begin(), steps->end(),
                   [this](const auto& step) { return step.first == step_; });
  if (same == steps->end()) {
    steps->emplace_back(step_, seconds);
  } else {
    same->second += seconds;
  }
}

double ShareOf(std::int64_t done, std::int64_t total) {
  return total > 0 ? static_cast<double>(done) / static_cast<double>(total)
                   : -1.0;
}

}  // namespace plumbline
