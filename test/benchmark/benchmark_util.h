#ifndef PLUMBLINE_TEST_BENCHMARK_BENCHMARK_UTIL_H_
#define PLUMBLINE_TEST_BENCHMARK_BENCHMARK_UTIL_H_

#include <time.h>

#include <algorithm>
#include <vector>

namespace plumbline {

// Seconds of processor time of this process, all threads together. Ratios of
// it hold on a machine that does other things at the same time.
inline double CpuSeconds() {
  timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * time.tv_nsec;
}

// Processor time of a call, s.
template <typename Function>
double CpuSecondsOf(const Function& function) {
  const double begin = CpuSeconds();
  function();
  return CpuSeconds() - begin;
}

// Upper median; 0 for no values.
inline double Median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_BENCHMARK_BENCHMARK_UTIL_H_
