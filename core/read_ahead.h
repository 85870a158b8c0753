#ifndef PLUMBLINE_CORE_READ_AHEAD_H_
#define PLUMBLINE_CORE_READ_AHEAD_H_

#include <plumbline/core/parallel_for.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

namespace plumbline {

/// Makes values one after the other, a few ahead of who takes them, in a thread
/// of its own, so that making and taking go on at the same time. They come in
/// order, and so do the end and what is thrown on the way: the same as without
/// a thread.
///
/// Where ThreadsHere() is 1, or the system grants no thread, each value is made
/// when it is asked for, in the thread that asks: who wants one thread gets
/// one.
template <typename Value>
class ReadAhead {
 public:
  /// Sets the next value; false at the end, when it is not called again. Called
  /// by one thread at a time.
  using Make = std::function<bool(Value*)>;

  /// `most`: values that are made and not taken at most, 1 or more. Who waits
  /// is woken by the half of them, or after a fifth of a second: waking a
  /// thread for each value may take longer than making it.
  ReadAhead(std::size_t most, Make make) : most_(most), make_(std::move(make)) {
    const int threads = ThreadsHere();
    if (threads < 2) return;
    try {
      thread_ = std::thread([this, threads] {
        // What is made may use as many as who asked for it.
        const ThreadsScope scope(threads);
        Run();
      });
    } catch (const std::system_error&) {
    }
  }

  /// Waits for what is being made; `make` is not called any more.
  ~ReadAhead() {
    Stop();
    if (thread_.joinable()) thread_.join();
  }

  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// Whether a thread makes the values.
  bool has_thread() const { return thread_.joinable(); }

  /// Whether Next will not wait.
  bool HasNext() {
    if (!has_thread()) return true;
    const std::lock_guard<std::mutex> lock(mutex_);
    return is_finished_ || !made_.empty();
  }

  /// No value is begun from now on. Those that were are still to be taken.
  void Stop() {
    if (!has_thread()) {
      is_at_end_ = true;
      return;
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      is_stopped_ = true;
    }
    changed_.notify_all();
  }

  /// Takes the next value; false at the end. Throws what `make` threw, once all
  /// that came before is taken, and is at the end then. `stop` (may be null) is
  /// asked before, and five times a second while nothing comes: once it says
  /// true there is nothing more.
  bool Next(Value* value, const std::function<bool()>& stop = nullptr) {
    if (is_at_end_ || (stop && stop())) {
      is_at_end_ = true;
      return false;
    }
    if (!has_thread()) {
      is_at_end_ = true;
      is_at_end_ = !make_(value);
      return !is_at_end_;
    }
    std::unique_lock<std::mutex> lock(mutex_);
    while (!changed_.wait_for(lock, std::chrono::milliseconds(200), [this] {
      return is_finished_ || !made_.empty();
    })) {
      lock.unlock();
      is_at_end_ = stop && stop();
      if (is_at_end_) return false;
      lock.lock();
    }
    if (made_.empty()) {
      is_at_end_ = true;
      if (error_) std::rethrow_exception(error_);
      return false;
    }
    *value = std::move(made_.front());
    made_.pop_front();
    lock.unlock();
    changed_.notify_all();
    return true;
  }

 private:
  void Run() {
    while (true) {
      {
        std::unique_lock<std::mutex> lock(mutex_);
        changed_.wait(lock,
                      [this] { return is_stopped_ || made_.size() < most_; });
        if (is_stopped_) {
          is_finished_ = true;
          break;
        }
      }
      Value value{};
      bool is_one = false;
      bool is_to_wake = false;
      std::exception_ptr error;
      try {
        is_one = make_(&value);
      } catch (...) {
        error = std::current_exception();
      }
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (is_one) made_.push_back(std::move(value));
        error_ = error;
        is_finished_ = !is_one;
        is_to_wake = made_.size() >= (most_ + 7) / 8;
      }
      if (!is_one) break;
      if (is_to_wake) changed_.notify_all();
    }
    changed_.notify_all();
  }

  const std::size_t most_;
  const Make make_;
  // Of the thread that takes them.
  bool is_at_end_ = false;
  // Guards what follows, but for the thread itself.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Value> made_;
  std::exception_ptr error_;
  bool is_finished_ = false;
  bool is_stopped_ = false;
  std::thread thread_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_READ_AHEAD_H_
