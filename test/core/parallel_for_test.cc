#include <gtest/gtest.h>
#include <plumbline/core/parallel_for.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <future>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace plumbline {
namespace {

TEST(ParallelForTest, EveryIndexOnce) {
  for (const int threads : {-1, 0, 1, 2, 7, 64}) {
    std::vector<int> calls(23, 0);
    ParallelFor(calls.size(), threads, [&](std::size_t i) { ++calls[i]; });
    EXPECT_EQ(calls, std::vector<int>(23, 1)) << threads;
  }
}

TEST(ParallelForTest, NothingToDo) {
  ParallelFor(0, 4, [](std::size_t) { FAIL(); });
}

TEST(ParallelForTest, TheFirstExceptionIsThrownAfterAllIsDone) {
  for (const int threads : {1, 3}) {
    std::vector<int> calls(9, 0);
    try {
      ParallelFor(calls.size(), threads, [&](std::size_t i) {
        ++calls[i];
        if (i == 3 || i == 7) throw std::runtime_error(std::to_string(i));
      });
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "3");
    }
    EXPECT_EQ(calls, std::vector<int>(9, 1));
  }
}

TEST(ThreadTeamTest, ManyLoopsOnTheSameThreads) {
  for (const int threads : {-1, 1, 2, 5}) {
    ThreadTeam team(threads);
    std::mutex mutex;
    std::set<std::thread::id> at_work;
    for (std::size_t count = 0; count < 300; ++count) {
      std::vector<int> calls(count, 0);
      team.For(count, [&](std::size_t i) {
        ++calls[i];
        const std::lock_guard<std::mutex> lock(mutex);
        at_work.insert(std::this_thread::get_id());
      });
      ASSERT_EQ(calls, std::vector<int>(count, 1)) << threads;
    }
    EXPECT_LE(static_cast<int>(at_work.size()), std::max(1, threads));
    EXPECT_EQ(at_work.count(std::this_thread::get_id()), 1u);
  }
}

// Two calls that wait for each other come to an end only on two threads, in
// later loops, too.
TEST(ThreadTeamTest, ThreadsWorkAtTheSameTime) {
  ThreadTeam team(2);
  for (int loop = 0; loop < 3; ++loop) {
    std::promise<void> here[2];
    std::future<void> there[2] = {here[0].get_future(), here[1].get_future()};
    team.For(2, [&](std::size_t i) {
      here[i].set_value();
      EXPECT_EQ(there[1 - i].wait_for(std::chrono::seconds(60)),
                std::future_status::ready);
    });
  }
}

TEST(ThreadTeamTest, GoesOnAfterAnException) {
  for (const int threads : {1, 3}) {
    ThreadTeam team(threads);
    EXPECT_THROW(team.For(9,
                          [&](std::size_t i) {
                            if (i == 4) throw std::runtime_error("4");
                          }),
                 std::runtime_error);
    std::atomic<int> calls{0};
    team.For(9, [&](std::size_t) { ++calls; });
    EXPECT_EQ(calls, 9);
  }
}

TEST(ParallelForTest, GrantedThreads) {
  for (const int threads : {1, 2, 9})
    EXPECT_EQ(GrantedThreads(threads), threads);
}

// Who is not told asks for the scope, which threads of a loop do not inherit.
TEST(ParallelForTest, ThreadsHereAreThoseOfTheScope) {
  EXPECT_EQ(ThreadsHere(), 1);
  {
    const ThreadsScope outer(4);
    {
      const ThreadsScope inner(2);
      EXPECT_EQ(ThreadsHere(), 2);
    }
    EXPECT_EQ(ThreadsHere(), 4);
    int of_thread = 0;
    std::thread([&] { of_thread = ThreadsHere(); }).join();
    EXPECT_EQ(of_thread, 1);
  }
  EXPECT_EQ(ThreadsHere(), 1);
}

// As many threads as there is room for do the work. (In a process of its own:
// the limit stays.)
TEST(ParallelForTest, ThreadsThatAreNotGrantedAreDoneWithout) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers take address space of their own";
#endif
  const auto work_in_little_room = [] {
    std::ifstream pages("/proc/self/statm");
    rlim_t size = 0;
    pages >> size;
    rlimit limit = {};
    getrlimit(RLIMIT_AS, &limit);
    // A few stacks of 8 MB.
    limit.rlim_cur =
        size * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + (rlim_t{40} << 20);
    if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(3);
    std::atomic<int> calls{0};
    ParallelFor(1000, 200, [&](std::size_t) { ++calls; });
    if (calls != 1000) _exit(4);
    const int granted = GrantedThreads(200);
    _exit(granted >= 1 && granted < 200 ? 0 : 5);
  };
  EXPECT_EXIT(work_in_little_room(), testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace plumbline
