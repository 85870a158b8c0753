#include <fcntl.h>
#include <plumbline/core/error.h>
#include <plumbline/core/text_file.h>
#include <plumbline/core/utf8.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

namespace plumbline {
namespace {

constexpr int kAskStopMs = 200;

// A file descriptor that is closed at the end.
class OpenFile {
 public:
  // Opening a named pipe waits for who writes to it, deaf to every `stop`,
  // unless O_NONBLOCK is given.
  explicit OpenFile(const std::string& path)
      : descriptor_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
    if (descriptor_ >= 0) {
      fcntl(descriptor_, F_SETFL, fcntl(descriptor_, F_GETFL) & ~O_NONBLOCK);
    }
  }
  ~OpenFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  bool is_open() const { return descriptor_ >= 0; }

  // Waits until there is something to read, or the end; false when it is time
  // to stop.
  bool Wait(const std::function<bool()>& stop) const {
    while (!stop || !stop()) {
      pollfd wanted = {descriptor_, POLLIN, 0};
      const int ready = poll(&wanted, 1, kAskStopMs);
      // Errors are for read() to find.
      if (ready > 0 || (ready < 0 && errno != EINTR)) return true;
    }
    return false;
  }

  // Bytes read, 0 at the end, negative after an error.
  ssize_t Read(std::vector<char>* piece) const {
    ssize_t count = -1;
    do {
      count = read(descriptor_, piece->data(), piece->size());
    } while (count < 0 && errno == EINTR);
    return count;
  }

 private:
  int descriptor_;
};

}  // namespace

std::string ReadTextFile(const std::string& path, std::size_t limit,
                         const std::function<bool()>& stop) {
  const auto fail = [&] {
    throw Error(path, 0, std::string("cannot be read: ") + std::strerror(errno),
                "a file that can be read");
  };
  const OpenFile file(path);
  if (!file.is_open()) fail();
  std::string text;
  std::vector<char> piece(1 << 16);
  while (file.Wait(stop)) {
    const ssize_t count = file.Read(&piece);
    // A directory opens but does not read.
    if (count < 0) fail();
    if (count == 0) break;
    if (std::count(piece.begin(), piece.begin() + count, '\0') > 0) {
      throw Error(path, 0, "holds bytes that are zero", "text");
    }
    if (static_cast<std::size_t>(count) > limit - text.size()) {
      throw Error(path, 0,
                  "holds more than " + std::to_string(limit) + " bytes",
                  "less text");
    }
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
  RemoveByteOrderMark(&text);
  return text;
}

}  // namespace plumbline
