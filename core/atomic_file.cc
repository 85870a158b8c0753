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

// A file to write to that stands beside `target` until it takes its place. It
// has no name until it is whole, so that a process that ends before leaves
// nothing behind, whatever ended it. Not every file system has such files: then
// it has a name from the beginning, which is removed unless it was renamed.
class TemporaryFile {
 public:
  // The user's umask applies.
  explicit TemporaryFile(const fs::path& target) : target_(target.string()) {
    const fs::path folder = target.parent_path();
    descriptor_ = open(folder.empty() ? "." : folder.c_str(),
                       O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    // What it is given a name by in the end.
    if (descriptor_ >= 0 && access(Descriptor().c_str(), F_OK) != 0) {
      close(descriptor_);
      descriptor_ = -1;
    }
    if (descriptor_ >= 0) return;
    const bool has_name = TryNames([this](const std::string& name) {
      descriptor_ =
          open(name.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
      return descriptor_ >= 0;
    });
    if (!has_name) Fail(target_, "create a file", errno);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (!name_.empty()) unlink(name_.c_str());
    close(descriptor_);
  }

  int descriptor() const { return descriptor_; }

  void Replace() {
    if (name_.empty() && !TryNames([this](const std::string& name) {
          return linkat(AT_FDCWD, Descriptor().c_str(), AT_FDCWD, name.c_str(),
                        AT_SYMLINK_FOLLOW) == 0;
        })) {
      Fail(target_, "create a file", errno);
    }
    if (std::rename(name_.c_str(), target_.c_str()) != 0) {
      Fail(target_, "replace the file", errno);
    }
    name_.clear();
  }

 private:
  std::string Descriptor() const {
    return "/proc/self/fd/" + std::to_string(descriptor_);
  }

  // Names the file so as `make` could make it; false, with errno, when it could
  // not.
  template <typename Function>
  bool TryNames(const Function& make) {
    for (int attempt = 0; attempt < 100; ++attempt) {
      const std::string name = target_ + ".tmp" + std::to_string(getpid()) +
                               "_" + std::to_string(attempt);
      if (make(name)) {
        name_ = name;
        return true;
      }
      if (errno != EEXIST) break;
    }
    return false;
  }

  std::string target_;
  // Empty while it has none.
  std::string name_;
  int descriptor_ = -1;
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

// A pipe or a device, open for writing.
class OpenDevice {
 public:
  // Opening a pipe waits for its reader, for ever if none comes, unless
  // O_NONBLOCK is given.
  explicit OpenDevice(const std::string& path)
      : descriptor_(
            open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC | O_NONBLOCK)) {
    if (descriptor_ < 0 && errno == ENXIO) {
      throw Error(path, 0, "cannot open the pipe for writing: nobody reads it",
                  "a file, or a pipe with a reader");
    }
    if (descriptor_ < 0) Fail(path, "open the file for writing", errno);
    fcntl(descriptor_, F_SETFL, fcntl(descriptor_, F_GETFL) & ~O_NONBLOCK);
  }
  ~OpenDevice() { close(descriptor_); }
  OpenDevice(const OpenDevice&) = delete;
  OpenDevice& operator=(const OpenDevice&) = delete;

  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

// Runs `write` on a stream to `descriptor`, all of which is on the disk
// afterwards; `path` is what messages name.
void WriteStream(int descriptor, const std::string& path,
                 const std::function<void(std::ostream&)>& write) {
  DescriptorBuffer buffer(descriptor);
  std::ostream stream(&buffer);
  write(stream);
  stream.flush();
  if (!stream) Fail(path, "write the file", buffer.error_number());
  // The data must be on the disk before the name is, or a crash could leave
  // the new name with no content. Pipes and devices have no disk (EINVAL).
  if (fsync(descriptor) != 0 && errno != EINVAL && errno != EROFS) {
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
    const OpenDevice device(path);
    WriteStream(device.descriptor(), path, write);
    return;
  }
  // A symbolic link stays a link: what it points at is replaced.
  fs::path target = path;
  if (fs::exists(status)) {
    const fs::path resolved = fs::canonical(path, ignored);
    if (!ignored) target = resolved;
  }
  TemporaryFile temporary(target);
  WriteStream(temporary.descriptor(), path, write);
  temporary.Replace();
}

}  // namespace plumbline
