#include <plumbline/core/parallel_for.h>

#include <future>
#include <system_error>

namespace plumbline {
namespace {

thread_local int threads_here = 1;

}  // namespace

ThreadTeam::~ThreadTeam() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    has_ended_ = true;
  }
  begun_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void ThreadTeam::Run(std::size_t count, const std::function<void()>& work) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    work_ = &work;
    ++loops_;
  }
  begun_.notify_all();
  Start(count);
  work();
  std::unique_lock<std::mutex> lock(mutex_);
  work_ = nullptr;
  done_.wait(lock, [this] { return at_work_ == 0; });
}

// As many as there is work for.
void ThreadTeam::Start(std::size_t count) {
  try {
    while (static_cast<int>(threads_.size()) + 1 < num_threads_ &&
           threads_.size() + 1 < count) {
      threads_.emplace_back([this] { Wait(); });
    }
  } catch (const std::system_error&) {
  }
}

void ThreadTeam::Wait() {
  std::unique_lock<std::mutex> lock(mutex_);
  // The loop that was joined last.
  std::size_t joined = 0;
  while (true) {
    begun_.wait(lock, [&] {
      return has_ended_ || (work_ != nullptr && loops_ != joined);
    });
    if (has_ended_) return;
    joined = loops_;
    const std::function<void()>& work = *work_;
    ++at_work_;
    lock.unlock();
    work();
    lock.lock();
    if (--at_work_ == 0) done_.notify_one();
  }
}

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
