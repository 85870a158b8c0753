#ifndef PLUMBLINE_CORE_READ_AHEAD_H_
#define PLUMBLINE_CORE_READ_AHEAD_H_

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

namespace plumbline {

/// Makes items one after the other on a thread of its own, ahead of who takes
/// them, so that making and taking go on at the same time. What comes, and in
/// which order, is the same as without a thread.
template <typename Item>
class ReadAhead {
 public:
  /// Items come from `produce`, which is called by one thread at a time, until
  /// it returns nothing or throws. At most `capacity` of them (1 or more) wait
  /// to be taken. Without `has_thread`, or when the system grants none, each is
  /// made when it is asked for.
  ReadAhead(std::function<std::optional<Item>()> produce, std::size_t capacity,
            bool has_thread)
      : produce_(std::move(produce)), capacity_(capacity) {
    if (!has_thread) return;
    try {
      thread_ = std::thread([this] { Run(); });
    } catch (const std::system_error&) {
    }
  }
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;
  ~ReadAhead() {
    Stop();
    if (thread_.joinable()) thread_.join();
  }

  /// The next item, nothing after the last one. Throws what `produce` threw, in
  /// its place. After either `produce` is not called any more.
  std::optional<Item> Next() {
    if (!thread_.joinable()) {
      if (is_stopped_) return std::nullopt;
      return produce_();
    }
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return !items_.empty() || is_done_; });
    if (items_.empty()) {
      if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
      return std::nullopt;
    }
    std::optional<Item> item(std::move(items_.front()));
    items_.pop_front();
    changed_.notify_all();
    return item;
  }

  /// No item is begun from now on. Those that were are still to be taken.
  void Stop() {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_stopped_ = true;
    changed_.notify_all();
  }

 private:
  void Run() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!is_stopped_) {
      lock.unlock();
      std::optional<Item> item;
      std::exception_ptr error;
      try {
        item = produce_();
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      error_ = error;
      if (!item) break;
      items_.push_back(std::move(*item));
      changed_.notify_all();
      changed_.wait(
          lock, [this] { return is_stopped_ || items_.size() < capacity_; });
    }
    is_done_ = true;
    changed_.notify_all();
  }

  const std::function<std::optional<Item>()> produce_;
  const std::size_t capacity_;
  std::mutex mutex_;
  // Told whenever one of the following changes.
  std::condition_variable changed_;
  std::deque<Item> items_;
  bool is_stopped_ = false;
  bool is_done_ = false;
  std::exception_ptr error_;
  // Last, so that it starts when all else is there.
  std::thread thread_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_READ_AHEAD_H_
