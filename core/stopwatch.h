#ifndef PLUMBLINE_CORE_STOPWATCH_H_
#define PLUMBLINE_CORE_STOPWATCH_H_

#include <chrono>

namespace plumbline {

/// Time that has passed since it was made, by a clock that never jumps.
class Stopwatch {
 public:
  /// s
  double Seconds() const {
    return std::chrono::duration<double>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;

  Clock::time_point start_ = Clock::now();
};

/// Adds the time for which it lives to a sum, s.
class ScopedTimer {
 public:
  /// `sum` must outlive it.
  explicit ScopedTimer(double* sum) : sum_(sum) {}
  ~ScopedTimer() { *sum_ += watch_.Seconds(); }
  ScopedTimer(const ScopedTimer&) = delete;
  ScopedTimer& operator=(const ScopedTimer&) = delete;

 private:
  double* sum_;
  Stopwatch watch_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_STOPWATCH_H_
