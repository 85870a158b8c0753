#ifndef PLUMBLINE_APPS_CLI_PROGRESS_H_
#define PLUMBLINE_APPS_CLI_PROGRESS_H_

#include <plumbline/core/stopwatch.h>

#include <cstdint>
#include <string>

namespace plumbline {

/// One line: "title [=====     ]  50% 1234/2468, 567 scans/s, 2 s left".
/// `total` of 0 means unknown: then there is no bar and no time left. At most
/// `columns` characters.
std::string ProgressLine(const std::string& title, const std::string& unit,
                         std::int64_t done, std::int64_t total, double seconds,
                         int columns);

/// Prints a line on stderr, as with printf, unless --quiet says otherwise: what
/// a person may want to know and did not ask for. A progress bar gives way.
void Remark(const char* format, ...) __attribute__((format(printf, 1, 2)));

/// The same, only with --verbose (and without --quiet): what is being done.
void Detail(const char* format, ...) __attribute__((format(printf, 1, 2)));

/// A progress bar on stderr for work that takes more than a second. Nothing is
/// shown while stderr is no terminal or with --quiet; the line is wiped in the
/// end. One at a time. Not thread safe.
class Progress {
 public:
  /// `total` of 0: how much there is to do is not known.
  Progress(std::string title, std::string unit, std::int64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Cheap enough to be called for every item.
  void Update(std::int64_t done);

  /// Wipes the line; done by the destructor, too.
  void Finish();

 private:
  std::string title_;
  std::string unit_;
  std::int64_t total_;
  bool enabled_;
  bool visible_ = false;
  Stopwatch watch_;
  // s on the watch.
  double last_shown_ = 0.0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_CLI_PROGRESS_H_
