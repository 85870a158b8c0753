#include <gtest/gtest.h>
#include <plumbline/core/parallel_for.h>

#include <stdexcept>
#include <string>
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

}  // namespace
}  // namespace plumbline
