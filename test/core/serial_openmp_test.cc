#include <gtest/gtest.h>
#include <plumbline/core/serial_openmp.h>

#include <atomic>
#include <thread>

// As GCC's compiled code calls it; the library's own unless it is overridden.
extern "C" void GOMP_parallel(void (*region)(void*), void* data,
                              unsigned num_threads, unsigned flags);

namespace plumbline {
namespace {

struct Visits {
  std::atomic<int> count{0};
  std::atomic<int> elsewhere{0};
  std::thread::id thread = std::this_thread::get_id();
};

void Visit(void* data) {
  auto* const visits = static_cast<Visits*>(data);
  ++visits->count;
  if (std::this_thread::get_id() != visits->thread) ++visits->elsewhere;
}

void RunRegion(Visits* visits) { GOMP_parallel(&Visit, visits, 4, 0); }

TEST(SerialOpenMpTest, RegionsStayOnTheThread) {
  Visits visits;
  {
    const SerialOpenMp outer;
    RunRegion(&visits);
    EXPECT_EQ(visits.count, 1);
    {
      const SerialOpenMp inner;
      RunRegion(&visits);
    }
    RunRegion(&visits);
  }
  EXPECT_EQ(visits.count, 3);
  EXPECT_EQ(visits.elsewhere, 0);
}

TEST(SerialOpenMpTest, WhatOthersAskForIsPassedOn) {
  const SerialOpenMp serial;
  // Whether it runs on more than one thread is up to the OpenMP library.
  int count = 0;
  std::thread([&count] {
    Visits visits;
    RunRegion(&visits);
    count = visits.count;
  }).join();
  EXPECT_GE(count, 1);
}

}  // namespace
}  // namespace plumbline
