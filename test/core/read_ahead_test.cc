#include <gtest/gtest.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/read_ahead.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace plumbline {
namespace {

// 0, 1, 2, ... below `end`.
ReadAhead<int>::Make NumbersBelow(int end) {
  return [next = 0, end](int* value) mutable {
    if (next == end) return false;
    *value = next++;
    return true;
  };
}

TEST(ReadAheadTest, GivesAllInOrder) {
  for (const int threads : {1, 2, 4}) {
    const ThreadsScope scope(threads);
    for (const int count : {0, 1, 3, 1000}) {
      ReadAhead<int> ahead(3, NumbersBelow(count));
      EXPECT_EQ(ahead.has_thread(), threads > 1);
      std::vector<int> got;
      for (int value = 0; ahead.Next(&value);) got.push_back(value);
      ASSERT_EQ(got.size(), static_cast<std::size_t>(count));
      for (int i = 0; i < count; ++i) {
        EXPECT_EQ(got[static_cast<std::size_t>(i)], i);
      }
      int value = 7;
      EXPECT_FALSE(ahead.Next(&value));
    }
  }
}

TEST(ReadAheadTest, IsNeverFartherAheadThanItSays) {
  const ThreadsScope scope(2);
  std::atomic<int> made{0};
  ReadAhead<int> ahead(5, [&made](int* value) {
    *value = made++;
    return true;
  });
  for (int taken = 0; taken < 200; ++taken) {
    // One is in hand, and one is being made.
    EXPECT_LE(made, taken + 6);
    int value = -1;
    ASSERT_TRUE(ahead.Next(&value));
    ASSERT_EQ(value, taken);
  }
  // It goes on without being asked.
  while (made < 205) std::this_thread::yield();
}

// Whoever has enough goes, whether the next value is under way, waits for room,
// or nothing was asked for at all.
TEST(ReadAheadTest, EndsWhenNobodyTakesTheRest) {
  for (const int threads : {1, 2}) {
    const ThreadsScope scope(threads);
    for (int taken = 0; taken < 20; ++taken) {
      std::atomic<bool> is_gone{false};
      {
        ReadAhead<std::string> ahead(4, [&is_gone](std::string* value) {
          EXPECT_FALSE(is_gone);
          *value = std::string(1000, 'x');
          return true;
        });
        std::string value;
        for (int i = 0; i < taken; ++i) ASSERT_TRUE(ahead.Next(&value));
      }
      is_gone = true;
    }
  }
}

TEST(ReadAheadTest, AnErrorComesAtItsPlace) {
  for (const int threads : {1, 2}) {
    const ThreadsScope scope(threads);
    for (const int good : {0, 1, 10}) {
      ReadAhead<int> ahead(3, [next = 0, good](int* value) mutable {
        if (next == good) throw std::runtime_error("broken");
        *value = next++;
        return true;
      });
      int value = -1;
      for (int i = 0; i < good; ++i) {
        ASSERT_TRUE(ahead.Next(&value));
        ASSERT_EQ(value, i);
      }
      EXPECT_THROW(ahead.Next(&value), std::runtime_error);
      EXPECT_FALSE(ahead.Next(&value));
    }
  }
}

TEST(ReadAheadTest, AsksWhetherToStop) {
  for (const int threads : {1, 2}) {
    const ThreadsScope scope(threads);
    int asked = 0;
    ReadAhead<int> ahead(3, NumbersBelow(100));
    int value = -1;
    const auto stop = [&asked] { return ++asked > 4; };
    int taken = 0;
    while (ahead.Next(&value, stop)) ++taken;
    EXPECT_EQ(taken, 4);
    EXPECT_FALSE(ahead.Next(&value));
  }
}

// Who waits is asked by its own thread.
TEST(ReadAheadTest, AsksWhileNothingComes) {
  const ThreadsScope scope(2);
  std::atomic<bool> may_go_on{false};
  ReadAhead<int> ahead(3, [&may_go_on](int*) {
    while (!may_go_on) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
  });
  const std::thread::id here = std::this_thread::get_id();
  int asked = 0;
  int value = -1;
  EXPECT_FALSE(ahead.Next(&value, [&] {
    EXPECT_EQ(std::this_thread::get_id(), here);
    return ++asked > 2;
  }));
  EXPECT_EQ(asked, 3);
  may_go_on = true;
}

TEST(ReadAheadTest, TheThreadMayUseAsManyAsWhoAskedForIt) {
  for (const int threads : {1, 2, 3}) {
    const ThreadsScope scope(threads);
    ReadAhead<int> ahead(1, [](int* value) {
      *value = ThreadsHere();
      return true;
    });
    int value = 0;
    ASSERT_TRUE(ahead.Next(&value));
    EXPECT_EQ(value, threads);
  }
}

// Once stopped, what was made is still there and nothing new is begun.
TEST(ReadAheadTest, NothingThatWasMadeIsLostByStopping) {
  for (const int threads : {1, 2}) {
    const ThreadsScope scope(threads);
    std::atomic<int> made{0};
    ReadAhead<int> ahead(4, [&made](int* value) {
      *value = made++;
      return true;
    });
    int value = -1;
    ASSERT_TRUE(ahead.Next(&value));
    EXPECT_EQ(value, 0);
    ahead.Stop();
    int taken = 1;
    for (; ahead.Next(&value); ++taken) EXPECT_EQ(value, taken);
    EXPECT_EQ(taken, made);
    EXPECT_TRUE(ahead.HasNext());
  }
}

TEST(ReadAheadTest, TellsWhetherItWouldWait) {
  {
    ReadAhead<int> alone(1, NumbersBelow(0));
    EXPECT_TRUE(alone.HasNext());
  }
  const ThreadsScope scope(2);
  std::atomic<bool> may_go_on{false};
  ReadAhead<int> ahead(1, [&may_go_on, next = 0](int* value) mutable {
    while (!may_go_on) std::this_thread::yield();
    *value = next++;
    return next == 1;
  });
  EXPECT_FALSE(ahead.HasNext());
  may_go_on = true;
  while (!ahead.HasNext()) std::this_thread::yield();
  int value = -1;
  ASSERT_TRUE(ahead.Next(&value));
  EXPECT_FALSE(ahead.Next(&value));
  EXPECT_TRUE(ahead.HasNext());
}

}  // namespace
}  // namespace plumbline
