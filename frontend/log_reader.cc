#include <plumbline/frontend/log_reader.h>

namespace plumbline {

const LogReaderType* RecognizeLog(const Registry& registry,
                                  std::string_view prefix) {
  for (const LogReaderType* reader : registry.All<LogReaderType>()) {
    if (reader->recognizes != nullptr && reader->recognizes(prefix)) {
      return reader;
    }
  }
  return nullptr;
}

}  // namespace plumbline
