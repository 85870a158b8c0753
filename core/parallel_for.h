#ifndef PLUMBLINE_CORE_PARALLEL_FOR_H_
#define PLUMBLINE_CORE_PARALLEL_FOR_H_

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace plumbline {

/// Alignment, bytes, of what one thread writes often while another writes what
/// lies beside it: two threads that write to one line of a processor's cache
/// wait for each other.
inline constexpr std::size_t kCacheLine = 64;

/// Threads that work on one loop after another and wait in between, for who has
/// many short loops: starting a thread takes longer than such a loop. They
/// start with the first loop and end with the team. One loop at a time.
class ThreadTeam {
 public:
  /// `num_threads` of them at most, the caller's among them (1 or less: it
  /// works alone).
  explicit ThreadTeam(int num_threads) : num_threads_(num_threads) {}
  ThreadTeam(const ThreadTeam&) = delete;
  ThreadTeam& operator=(const ThreadTeam&) = delete;
  ~ThreadTeam();

  /// Calls function(i) for every i in [0, count). Each call must write to a
  /// place of its own, so that the result does not depend on the number of
  /// threads. When calls throw, the exception of the smallest i is thrown in
  /// the end. Threads that the system does not grant are done without.
  template <typename Function>
  void For(std::size_t count, const Function& function) {
    if (num_threads_ <= 1 || count <= 1) {
      RunAlone(count, function);
      return;
    }
    std::vector<std::exception_ptr> errors(count);
    std::atomic<std::size_t> next{0};
    Run(count, [&] {
      for (std::size_t i = next++; i < count; i = next++) {
        try {
          function(i);
        } catch (...) {
          errors[i] = std::current_exception();
        }
      }
    });
    for (const std::exception_ptr& error : errors) {
      if (error) std::rethrow_exception(error);
    }
  }

 private:
  template <typename Function>
  static void RunAlone(std::size_t count, const Function& function) {
    std::exception_ptr error;
    for (std::size_t i = 0; i < count; ++i) {
      try {
        function(i);
      } catch (...) {
        if (!error) error = std::current_exception();
      }
    }
    if (error) std::rethrow_exception(error);
  }

  // `work` on all threads, the caller's among them. Comes back when all are
  // done who began before the caller had ended.
  void Run(std::size_t count, const std::function<void()>& work);
  void Start(std::size_t count);
  void Wait();

  const int num_threads_;
  std::vector<std::thread> threads_;
  std::mutex mutex_;
  // Told of a new loop and of the end.
  std::condition_variable begun_;
  // Told when the last thread at work is done.
  std::condition_variable done_;
  // The open loop, which threads may still join; null when there is none.
  const std::function<void()>* work_ = nullptr;
  // Loops so far.
  std::size_t loops_ = 0;
  int at_work_ = 0;
  bool has_ended_ = false;
};

/// Calls function(i) for every i in [0, count), on up to `num_threads` threads
/// (1 or less: on the caller's alone): a loop of a ThreadTeam of its own.
template <typename Function>
void ParallelFor(std::size_t count, int num_threads, const Function& function) {
  ThreadTeam(num_threads).For(count, function);
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
