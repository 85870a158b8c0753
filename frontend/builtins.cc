#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/log_reader.h>

#include <utility>

namespace plumbline {

void RegisterBuiltinLogReaders(Registry* registry) {
  if (registry->Find<LogReaderType>("carmen") == nullptr) {
    LogReaderType carmen;
    carmen.name = "carmen";
    carmen.description =
        "CARMEN: FLASER, RLASER, ROBOTLASER1, RAWLASER1, ODOM, PARAM";
    carmen.recognizes = LooksLikeCarmenLog;
    carmen.read = [](InputStream* input, const LaserOptions& options) {
      return ReadCarmenLog(input, options);
    };
    registry->Register(std::move(carmen));
  }
}

}  // namespace plumbline
