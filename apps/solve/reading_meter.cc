#include <plumbline/apps/solve/reading_meter.h>

#include <algorithm>
#include <ctime>

namespace plumbline {
namespace {

double SecondsOnProcessor(clockid_t clock) {
  timespec time = {};
  if (clock_gettime(clock, &time) != 0) return 0.0;
  return static_cast<double>(time.tv_sec) +
         1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

ReadingMeter::ReadingMeter()
    : process_begin_(SecondsOnProcessor(CLOCK_PROCESS_CPUTIME_ID)),
      thread_begin_(SecondsOnProcessor(CLOCK_THREAD_CPUTIME_ID)) {}

Summary::Reading ReadingMeter::Read() const {
  Summary::Reading reading;
  reading.seconds = watch_.Seconds();
  reading.idle_seconds = std::max(
      0.0, reading.seconds -
               (SecondsOnProcessor(CLOCK_THREAD_CPUTIME_ID) - thread_begin_));
  reading.cpu_seconds =
      SecondsOnProcessor(CLOCK_PROCESS_CPUTIME_ID) - process_begin_;
  return reading;
}

}  // namespace plumbline
