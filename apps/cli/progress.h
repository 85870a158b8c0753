#ifndef PLUMBLINE_APPS_CLI_PROGRESS_H_
#define PLUMBLINE_APPS_CLI_PROGRESS_H_

#include <plumbline/core/stopwatch.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

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

/// A part of long work, and how much there is to do in it in a unit that all
/// parts share.
struct WorkStage {
  std::string title;
  double weight = 1.0;
};

/// How far work of several stages has come, when it is not known of each how
/// much of it is done: a stage that does not say is taken to advance as fast,
/// for its weight, as those before it did, and more and more slowly once it
/// takes longer. Never goes back.
class WorkEstimate {
 public:
  /// Stages that are still to come, in order.
  void Plan(std::vector<WorkStage> stages);

  /// The next stage with this title begins, at a time in s from the beginning,
  /// and those before it have ended. One that is not to come is part of the
  /// present one.
  void Begin(const std::string& title, double seconds);

  /// Share of all work that is done at this time, 0 to 1. `share`: of the
  /// present stage; below 0 when it is not known.
  double Done(double seconds, double share = -1.0);

 private:
  // Those that ended, the present one, and those to come.
  double weight_before_ = 0.0;
  WorkStage present_ = {"", 0.0};
  std::vector<WorkStage> left_;
  // s
  double begin_ = 0.0;
  double last_ = 0.0;
};

/// One line: "closing of loops [=====     ]  50%, 12 s left": for all stages
/// together; "reading, 12 s" while there is nothing to tell from. At most
/// `columns` characters.
std::string WorkLine(const std::string& title, double done, double seconds,
                     int columns);

/// A bar over all stages of long work, otherwise as Progress: shown after a
/// second, on a terminal only and not with --quiet, wiped in the end. While it
/// lives no other bar is shown. Not thread safe.
class WorkProgress {
 public:
  WorkProgress();
  ~WorkProgress();
  WorkProgress(const WorkProgress&) = delete;
  WorkProgress& operator=(const WorkProgress&) = delete;

  /// As in WorkEstimate.
  void Plan(std::vector<WorkStage> stages);
  void Begin(const std::string& title);
  /// What stands before the bar until the next stage.
  void SetTitle(const std::string& title) { title_ = title; }
  /// Cheap enough to be called for every item. `share` as in WorkEstimate.
  void Update(double share = -1.0);
  void Finish();

 private:
  WorkEstimate estimate_;
  // Of the step, which may be part of a stage.
  std::string title_;
  bool enabled_;
  bool visible_ = false;
  Stopwatch watch_;
  // s on the watch.
  double last_shown_ = 0.0;
};

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
