#include <plumbline/core/error.h>
#include <plumbline/core/text_file.h>
#include <plumbline/core/utf8.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

namespace plumbline {

std::string ReadTextFile(const std::string& path, std::size_t limit) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  const auto fail = [&] {
    throw Error(path, 0,
                "cannot be read" +
                    (errno != 0 ? std::string(": ") + std::strerror(errno)
                                : std::string()),
                "a file that can be read");
  };
  if (!file) fail();
  std::string text;
  std::vector<char> piece(1 << 16);
  while (file) {
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    // A directory opens but does not read.
    if (file.bad()) fail();
    const auto count = static_cast<std::size_t>(file.gcount());
    if (std::count(piece.begin(), piece.begin() + file.gcount(), '\0') > 0) {
      throw Error(path, 0, "holds bytes that are zero", "text");
    }
    if (count > limit - text.size()) {
      throw Error(path, 0,
                  "holds more than " + std::to_string(limit) + " bytes",
                  "less text");
    }
    text.append(piece.data(), count);
  }
  RemoveByteOrderMark(&text);
  return text;
}

}  // namespace plumbline
