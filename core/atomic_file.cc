#include <fcntl.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <streambuf>
#include <vector>

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

// Writes to a descriptor and keeps why it failed: a std::ofstream forgets the
// reason of a write in the middle of a large file.
class DescriptorBuffer : public std::streambuf {
 public:
  explicit DescriptorBuffer(int descriptor)
      : descriptor_(descriptor), buffer_(1 << 16) {
    setp(buffer_.data(), buffer_.data() + buffer_.size());
  }

  // Of the first write that failed; 0 when none did.
  int error_number() const { return error_number_; }

 protected:
  int_type overflow(int_type c) override {
    if (!Flush()) return traits_type::eof();
    if (!traits_type::eq_int_type(c, traits_type::eof())) {
      sputc(traits_type::to_char_type(c));
    }
    return traits_type::not_eof(c);
  }
  int sync() override { return Flush() ? 0 : -1; }

 private:
  bool Flush() {
    const char* begin = pbase();
    while (error_number_ == 0 && begin < pptr()) {
      const ssize_t count =
          ::write(descriptor_, begin, static_cast<std::size_t>(pptr() - begin));
      if (count >= 0) {
        begin += count;
      } else if (errno != EINTR) {
        error_number_ = errno;
      }
    }
    setp(buffer_.data(), buffer_.data() + buffer_.size());
    return error_number_ == 0;
  }

  int descriptor_;
  std::vector<char> buffer_;
  int error_number_ = 0;
};

// Opens a file that exists for writing.
class OpenFile {
 public:
  // Opening a pipe waits for its reader, for ever if none comes, unless
  // O_NONBLOCK is given.
  OpenFile(const std::string& file, const std::string& path)
      : descriptor_(
            open(file.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC | O_NONBLOCK)) {
    if (descriptor_ < 0 && errno == ENXIO) {
      throw Error(path, 0, "cannot open the pipe for writing: nobody reads it",
                  "a file, or a pipe with a reader");
    }
    if (descriptor_ < 0) Fail(path, "open the file for writing", errno);
    fcntl(descriptor_, F_SETFL, fcntl(descriptor_, F_GETFL) & ~O_NONBLOCK);
  }
  ~OpenFile() { close(descriptor_); }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

// Runs `write` on a stream to `file`, all of which is on the disk afterwards;
// `path` is what messages name.
void WriteStream(const std::string& file, const std::string& path,
                 const std::function<void(std::ostream&)>& write) {
  const OpenFile open_file(file, path);
  DescriptorBuffer buffer(open_file.descriptor());
  std::ostream stream(&buffer);
  write(stream);
  stream.flush();
  if (!stream) Fail(path, "write the file", buffer.error_number());
  // The data must be on the disk before the name is, or a crash could leave
  // the new name with no content. Pipes and devices have no disk (EINVAL).
  if (fsync(open_file.descriptor()) != 0 && errno != EINVAL && errno != EROFS) {
    Fail(path, "write the file", errno);
  }
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
  temporary.RenameTo(target.string());
}

}  // namespace plumbline
