#include <gtest/gtest.h>
#include <plumbline/core/read_ahead.h>

#include <atomic>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <thread>
#include <vector>

namespace plumbline {
namespace {

class ReadAheadTest : public testing::TestWithParam<bool> {};

INSTANTIATE_TEST_SUITE_P(WithoutAndWithThread, ReadAheadTest, testing::Bool());

TEST_P(ReadAheadTest, ItemsComeInOrderAndEnd) {
  int next = 0;
  ReadAhead<int> ahead(
      [&]() -> std::optional<int> {
        if (next == 1000) return std::nullopt;
        return next++;
      },
      3, GetParam());
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(ahead.Next(), i);
  EXPECT_FALSE(ahead.Next().has_value());
  EXPECT_FALSE(ahead.Next().has_value());
}

// What is thrown comes after the items that were made before.
TEST_P(ReadAheadTest, ThrowsInItsPlace) {
  int next = 0;
  ReadAhead<int> ahead(
      [&]() -> std::optional<int> {
        if (next == 2) throw std::runtime_error("broken");
        return next++;
      },
      10, GetParam());
  EXPECT_EQ(ahead.Next(), 0);
  EXPECT_EQ(ahead.Next(), 1);
  EXPECT_THROW(ahead.Next(), std::runtime_error);
}

// Once stopped, what was made is still there and nothing new is begun.
TEST_P(ReadAheadTest, NothingThatWasMadeIsLostByStopping) {
  std::atomic<int> made{0};
  ReadAhead<int> ahead([&]() -> std::optional<int> { return made++; }, 4,
                       GetParam());
  EXPECT_EQ(ahead.Next(), 0);
  ahead.Stop();
  int taken = 1;
  while (const std::optional<int> item = ahead.Next()) {
    EXPECT_EQ(*item, taken);
    ++taken;
  }
  EXPECT_EQ(taken, made.load());
}

// No more than the capacity is made ahead, and whoever does not take the rest
// does not have to.
TEST(ReadAheadTest, WaitsWhenEnoughIsThere) {
  std::atomic<int> made{0};
  {
    ReadAhead<int> ahead([&]() -> std::optional<int> { return made++; }, 4,
                         true);
    for (int k = 0; k < 200 && made < 4; ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    EXPECT_LE(made, 4);
  }
  EXPECT_GE(made, 0);
}

}  // namespace
}  // namespace plumbline
