#include <plumbline/core/parallel_for.h>

#include <future>

namespace plumbline {
namespace {

thread_local int threads_here = 1;

}  // namespace

int ThreadsHere() { return threads_here; }

ThreadsScope::ThreadsScope(int num_threads) : before_(threads_here) {
  threads_here = num_threads;
}

ThreadsScope::~ThreadsScope() { threads_here = before_; }

int GrantedThreads(int wanted) {
  std::promise<void> counted;
  const std::shared_future<void> end = counted.get_future().share();
  std::vector<std::thread> threads;
  try {
    while (static_cast<int>(threads.size()) + 1 < wanted) {
      threads.emplace_back([end] { end.wait(); });
    }
  } catch (const std::system_error&) {
  }
  counted.set_value();
  for (std::thread& thread : threads) thread.join();
  return static_cast<int>(threads.size()) + 1;
}

}  // namespace plumbline
