#include <gtest/gtest.h>
#include <plumbline/frontend/cell_index.h>

#include <cstdint>
#include <map>

namespace plumbline {
namespace {

TEST(CellIndexTest, FindsWhatAMapFinds) {
  CellIndex index;
  EXPECT_EQ(index.Find(CellKey(0, 0)), -1);
  std::map<std::int64_t, int> numbers;
  for (int round = 0; round < 2; ++round) {
    // More than it has room for at first, and each twice.
    for (int again = 0; again < 2; ++again) {
      for (std::int64_t column = -20; column < 20; ++column) {
        for (std::int64_t row = -20; row < 20; ++row) {
          const std::int64_t key = CellKey(7 * column, 5 * row);
          const int next = static_cast<int>(numbers.size());
          EXPECT_EQ(index.FindOrAdd(key, next),
                    numbers.emplace(key, next).first->second);
        }
      }
    }
    for (const auto& [key, number] : numbers) {
      EXPECT_EQ(index.Find(key), number);
    }
    EXPECT_EQ(index.Find(CellKey(1, 1)), -1);
    index.Clear();
    numbers.clear();
    EXPECT_EQ(index.Find(CellKey(0, 0)), -1);
  }
}

}  // namespace
}  // namespace plumbline
