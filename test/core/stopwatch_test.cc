#include <gtest/gtest.h>
#include <plumbline/core/stopwatch.h>

namespace plumbline {
namespace {

TEST(StopwatchTest, NeverGoesBack) {
  const Stopwatch watch;
  const double first = watch.Seconds();
  EXPECT_GE(first, 0.0);
  EXPECT_GE(watch.Seconds(), first);
}

TEST(StopwatchTest, ScopesAddUp) {
  double sum = 5.0;
  double inner = 0.0;
  {
    const ScopedTimer timer(&sum);
    const Stopwatch watch;
    while (watch.Seconds() < 1e-5) {
    }
    inner = watch.Seconds();
    // Only in the end.
    EXPECT_EQ(sum, 5.0);
  }
  EXPECT_GE(sum, 5.0 + 1e-5);
  EXPECT_GT(inner, 0.0);
}

}  // namespace
}  // namespace plumbline
