#ifndef PLUMBLINE_CORE_PARALLEL_FOR_H_
#define PLUMBLINE_CORE_PARALLEL_FOR_H_

#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

namespace plumbline {

/// Calls function(i) for every i in [0, count), on up to `num_threads` threads
/// (1 or less: on the caller's alone). Each call must write to a place of its
/// own, so that the result does not depend on the number of threads. When calls
/// throw, the exception of the smallest i is thrown in the end.
template <typename Function>
void ParallelFor(std::size_t count, int num_threads, const Function& function) {
  std::vector<std::exception_ptr> errors(count);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        function(i);
      } catch (...) {
        errors[i] = std::current_exception();
      }
    }
  };
  std::vector<std::thread> threads;
  for (int t = 1; t < num_threads && static_cast<std::size_t>(t) < count; ++t) {
    threads.emplace_back(work);
  }
  work();
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_PARALLEL_FOR_H_
