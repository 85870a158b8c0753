#ifndef PLUMBLINE_CORE_PARALLEL_FOR_H_
#define PLUMBLINE_CORE_PARALLEL_FOR_H_

#include <atomic>
#include <cstddef>
#include <exception>
#include <system_error>
#include <thread>
#include <vector>

namespace plumbline {

/// Calls function(i) for every i in [0, count), on up to `num_threads` threads
/// (1 or less: on the caller's alone). Each call must write to a place of its
/// own, so that the result does not depend on the number of threads. When calls
/// throw, the exception of the smallest i is thrown in the end. Threads that
/// the system does not grant are done without.
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
  try {
    for (int t = 1; t < num_threads && static_cast<std::size_t>(t) < count;
         ++t) {
      threads.emplace_back(work);
    }
  } catch (const std::system_error&) {
  }
  work();
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

/// Threads for loops of whoever is not told how many to use, as a detector:
/// what the ThreadsScope of this thread says, 1 where there is none. Threads of
/// a ParallelFor have none, so that loops within loops do not multiply them.
int ThreadsHere();

/// Sets ThreadsHere() of this thread while it lives.
class ThreadsScope {
 public:
  explicit ThreadsScope(int num_threads);
  ThreadsScope(const ThreadsScope&) = delete;
  ThreadsScope& operator=(const ThreadsScope&) = delete;
  ~ThreadsScope();

 private:
  const int before_;
};

/// How many of `wanted` threads (1 or more, the caller's among them) the system
/// grants at this moment, found by a try. For libraries with threads of their
/// own, which throw or abort when they get none.
int GrantedThreads(int wanted);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_PARALLEL_FOR_H_
