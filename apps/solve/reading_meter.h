#ifndef PLUMBLINE_APPS_SOLVE_READING_METER_H_
#define PLUMBLINE_APPS_SOLVE_READING_METER_H_

#include <plumbline/core/stopwatch.h>
#include <plumbline/outputs/summary.h>

namespace plumbline {

/// What reading takes: made before, asked after. Other work of the process
/// meanwhile counts as reading.
class ReadingMeter {
 public:
  ReadingMeter();

  /// What was taken since.
  Summary::Reading Read() const;

 private:
  Stopwatch watch_;
  // s, of all threads and of this one.
  double process_begin_;
  double thread_begin_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_READING_METER_H_
