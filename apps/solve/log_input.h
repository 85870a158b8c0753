#ifndef PLUMBLINE_APPS_SOLVE_LOG_INPUT_H_
#define PLUMBLINE_APPS_SOLVE_LOG_INPUT_H_

#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/run_clock.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/outputs/summary.h>
#include <plumbline/pipeline/log_solver.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace plumbline {

/// Tells the bar how much of an input is read, while it lives.
class ReadingProgress {
 public:
  ReadingProgress(InputStream* input, RunClock* clock);
  ~ReadingProgress() { input_->SetProgress(nullptr); }
  ReadingProgress(const ReadingProgress&) = delete;
  ReadingProgress& operator=(const ReadingProgress&) = delete;

 private:
  InputStream* input_;
};

/// A log and what reads it: by the stream of a file's bytes, or, where that is
/// null, by its path.
struct LogInput {
  std::string name;
  const LogReaderType* reader = nullptr;
  InputStream* stream = nullptr;
  /// Opening it, which reads its beginning.
  Summary::Reading opening;
};

/// An input, and its stream where it is not read by its path.
struct OpenInput {
  LogInput log;
  std::optional<InputStream> stream;
  bool is_graph = false;
};

/// Opens an input and finds out what reads it; null when that was interrupted.
/// `reader`: that of --log_reader, or null.
std::unique_ptr<OpenInput> Open(const std::string& name,
                                const Registry& registry,
                                const LogReaderType* reader);

/// Reads a log, and says what was passed over and taken for granted. Throws
/// Error.
Log ReadLog(const LogInput& input, RunClock* clock, Summary* summary);

/// Makes odometry of the scans of a log that has none. Undoes the motion during
/// the scans of one that has. Then takes out by how much the laser's ranges are
/// all too long or too short, where the scans show it.
void CompleteLog(const std::string& name, const LogSolverOptions& options,
                 RunClock* clock, Log* log, Summary* summary);

/// Stages of a run on logs, by the names of its steps. `sizes`: of each log,
/// its scans as a share of those of a middling one of them.
std::vector<WorkStage> StagesOfLogs(const std::vector<double>& sizes,
                                    const LogSolverOptions& options);

/// The same for what is left once the log turned out to have no odometry.
std::vector<WorkStage> StagesWithMatching(const std::vector<double>& sizes,
                                          const LogSolverOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_LOG_INPUT_H_
