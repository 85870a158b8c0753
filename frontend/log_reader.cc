#include <plumbline/core/error.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/log_reader.h>

#include <filesystem>
#include <system_error>

namespace plumbline {
namespace {

// So much of a log is shown to the readers.
constexpr std::size_t kRecognizedBytes = std::size_t{1} << 16;

}  // namespace

const LogReaderType* RecognizeLog(const Registry& registry,
                                  std::string_view prefix) {
  for (const LogReaderType* reader : registry.All<LogReaderType>()) {
    if (reader->recognizes != nullptr && reader->recognizes(prefix)) {
      return reader;
    }
  }
  return nullptr;
}

const LogReaderType* RecognizeLogPath(const Registry& registry,
                                      const std::string& path) {
  for (const LogReaderType* reader : registry.All<LogReaderType>()) {
    if (reader->recognizes_path != nullptr && reader->read_path != nullptr &&
        reader->recognizes_path(path)) {
      return reader;
    }
  }
  return nullptr;
}

void RefuseFolder(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) return;
  throw Error(path, 0, "is a directory",
              "a file, or the folder of a ROS 2 bag with metadata.yaml, or of "
              "the parts of a ROS 1 bag");
}

Log ReadLog(const std::string& path, const Registry& registry,
            const LaserOptions& options) {
  if (path != "-") {
    const LogReaderType* reader = RecognizeLogPath(registry, path);
    if (reader != nullptr) return reader->read_path(path, options);
    RefuseFolder(path);
  }
  InputStream input(path, options.stop);
  const LogReaderType* reader =
      RecognizeLog(registry, input.Peek(kRecognizedBytes));
  if (reader == nullptr && LooksLikeG2o(input.Peek(kRecognizedBytes))) {
    throw Error(input.name(), 0, "is a graph (g2o), not a log", "a log");
  }
  if (reader == nullptr) {
    std::string names;
    for (const LogReaderType* known : registry.All<LogReaderType>()) {
      names += (names.empty() ? "" : ", ") + known->name;
    }
    // What breaks off may be one, if there were more of it.
    throw Error(input.name(), 0,
                "is no log of a known format" +
                    (input.damage().empty() ? "" : ", and " + input.damage()),
                names.empty() ? "log readers in the registry"
                              : "a log for one of the readers " + names);
  }
  return reader->read(&input, options);
}

}  // namespace plumbline
