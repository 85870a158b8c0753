#include <fcntl.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace plumbline {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Fail(const std::string& path, const std::string& action,
                       int error_number) {
  const std::string reason =
      error_number != 0 ? std::string(": ") + std::strerror(error_number) : "";
  throw Error(path, 0, "cannot " + action + reason, "a writable place");
}

// Removes the temporary file unless it was renamed.
class TemporaryFile {
 public:
  // Creates a new file beside `target`; the user's umask applies.
  explicit TemporaryFile(const fs::path& target) {
    for (int attempt = 0; attempt < 100; ++attempt) {
      path_ = target.string() + ".tmp" + std::to_string(getpid()) + "_" +
              std::to_string(attempt);
      const int descriptor =
          open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
      if (descriptor >= 0) {
        close(descriptor);
        return;
      }
      if (errno != EEXIST) break;
    }
    const int error_number = errno;
    path_.clear();
    Fail(target.string(), "create a file", error_number);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (!path_.empty()) unlink(path_.c_str());
  }

  const std::string& path() const { return path_; }

  void RenameTo(const std::string& target) {
    if (std::rename(path_.c_str(), target.c_str()) != 0) {
      Fail(target, "replace the file", errno);
    }
    path_.clear();
  }

 private:
  std::string path_;
};

// Runs `write` on a stream to `file`; `path` is what messages name.
void WriteStream(const std::string& file, const std::string& path,
                 const std::function<void(std::ostream&)>& write) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  if (!stream) Fail(path, "open the file for writing", errno);
  write(stream);
  errno = 0;
  stream.flush();
  if (!stream) Fail(path, "write the file", errno);
  stream.close();
  if (!stream) Fail(path, "write the file", errno);
}

}  // namespace

void WriteFileAtomically(const std::string& path,
                         const std::function<void(std::ostream&)>& write) {
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  if (fs::is_directory(status)) Fail(path, "write the file", EISDIR);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    // A pipe or a terminal cannot be replaced, only written to.
    WriteStream(path, path, write);
    return;
  }
  // A symbolic link stays a link: what it points at is replaced.
  fs::path target = path;
  if (fs::exists(status)) {
    const fs::path resolved = fs::canonical(path, ignored);
    if (!ignored) target = resolved;
  }
  TemporaryFile temporary(target);
  WriteStream(temporary.path(), path, write);
  // The data must be on the disk before the name is, or a crash could leave
  // the new name with no content.
  const int descriptor = open(temporary.path().c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) Fail(path, "write the file", errno);
  const int sync_status = fsync(descriptor);
  const int sync_error = errno;
  close(descriptor);
  if (sync_status != 0 && sync_error != EINVAL) {
    Fail(path, "write the file", sync_error);
  }
  temporary.RenameTo(target.string());
}

}  // namespace plumbline
