#ifndef PLUMBLINE_APPS_INSPECTION_LOG_INSPECTION_H_
#define PLUMBLINE_APPS_INSPECTION_LOG_INSPECTION_H_

#include <plumbline/core/registry.h>
#include <plumbline/frontend/log_reader.h>

#include <string>

namespace plumbline {

/// What is in a robot's log, and what of it would be used.
struct LogInspection {
  /// Whether no reader takes the log: the texts say why.
  bool is_refused = false;
  /// JSON (UTF-8, with a line end), for programs.
  std::string json;
  /// Lines for people.
  std::string text;
};

/// Inspects the log `path` with the log readers of `readers`. A log that is
/// refused is no error: LogInspection::is_refused. Of a graph, which is solved
/// though it is no log, only that is said.
LogInspection InspectLog(const std::string& path, const Registry& readers,
                         const LaserOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_INSPECTION_LOG_INSPECTION_H_
