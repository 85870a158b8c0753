#include <archive.h>
#include <archive_entry.h>
#include <fcntl.h>
#include <plumbline/core/error.h>
#include <plumbline/core/late_library.h>
#include <plumbline/core/read_ahead.h>
#include <plumbline/core/utf8.h>
#include <plumbline/frontend/bzip2_decoder.h>
#include <plumbline/frontend/input_stream.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

namespace plumbline {
namespace {

// Loaded when a stream is compressed in a way of its own.
LateLibrary archive_library("libarchive.so.13");
PLUMBLINE_LATE_FUNCTION(archive_library, archive_entry_filetype);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_error_string);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_data);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_free);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_new);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_next_header);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_open);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_support_filter_lz4);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_support_filter_xz);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_support_filter_zstd);
PLUMBLINE_LATE_FUNCTION(archive_library, archive_read_support_format_raw);
PLUMBLINE_LATE_FUNCTION(archive_library,
                        archive_read_support_format_zip_streamable);
LateLibrary zlib_library("libz.so.1");
PLUMBLINE_LATE_FUNCTION(zlib_library, inflate);
PLUMBLINE_LATE_FUNCTION(zlib_library, inflateEnd);
PLUMBLINE_LATE_FUNCTION(zlib_library, inflateInit2_);
PLUMBLINE_LATE_FUNCTION(zlib_library, inflateReset);

constexpr std::size_t kChunk = std::size_t{1} << 18;
constexpr std::size_t kLeastChunk = std::size_t{1} << 12;
// Pieces of a chunk that are unpacked ahead at most.
constexpr std::size_t kMostAhead = 16;
// Some messages of libarchive end with the end of a line.
std::string OneLine(std::string message) {
  const auto is_control = [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
  };
  std::replace_if(message.begin(), message.end(), is_control, ' ');
  // Nothing is left of blanks alone.
  message.erase(message.find_last_not_of(' ') + 1);
  return message;
}

// Of as many bytes at once without any other it is plain that no text comes.
constexpr std::size_t kManyZeros = std::size_t{1} << 14;

// The bytes as they are stored: a file descriptor or a string.
class StoredBytes {
 public:
  StoredBytes(std::string name, int descriptor, bool owned, bool is_pipe,
              std::function<bool()> stop)
      : name_(std::move(name)),
        descriptor_(descriptor),
        owned_(owned),
        is_pipe_(is_pipe),
        stop_(std::move(stop)) {
    buffer_.resize(kChunk);
  }
  StoredBytes(std::string name, const std::string& contents)
      : name_(std::move(name)),
        buffer_(contents.begin(), contents.end()),
        end_(buffer_.size()) {}
  ~StoredBytes() {
    if (owned_) close(descriptor_);
  }
  StoredBytes(const StoredBytes&) = delete;
  StoredBytes& operator=(const StoredBytes&) = delete;

  const char* data() const { return buffer_.data() + begin_; }
  std::size_t size() const { return end_ - begin_; }
  void Consume(std::size_t count) { begin_ += count; }
  void SetStop(std::function<bool()> stop) { stop_ = std::move(stop); }
  std::int64_t bytes_read() const { return bytes_read_; }
  // How many bytes it is worth to unpack at a time.
  std::size_t chunk() const {
    return std::clamp(buffer_.size(), kLeastChunk, kChunk);
  }

  // Reads on until at least `count` bytes are there; false when the end comes
  // first.
  bool Require(std::size_t count) {
    while (size() < count) {
      if (descriptor_ < 0) return false;
      std::memmove(buffer_.data(), buffer_.data() + begin_, size());
      end_ -= begin_;
      begin_ = 0;
      if (!WaitForInput()) return false;
      const ssize_t got =
          read(descriptor_, buffer_.data() + end_, buffer_.size() - end_);
      if (got < 0) {
        if (errno == EINTR) continue;
        throw Error(name_, 0,
                    std::string("cannot be read: ") + std::strerror(errno),
                    "a readable file");
      }
      if (got == 0) return false;
      end_ += static_cast<std::size_t>(got);
      bytes_read_ += got;
    }
    return true;
  }

 private:
  // Until there is something to read; false when it is time to stop.
  bool WaitForInput() const {
    // Reading a named pipe that nobody has opened to write ends at once.
    if (!stop_ && !is_pipe_) return true;
    while (!stop_ || !stop_()) {
      pollfd descriptor = {descriptor_, POLLIN, 0};
      const int ready = poll(&descriptor, 1, 200);
      // Errors are for read() to find.
      if (ready > 0 || (ready < 0 && errno != EINTR)) return true;
    }
    return false;
  }

  std::string name_;
  int descriptor_ = -1;
  bool owned_ = false;
  bool is_pipe_ = false;
  std::function<bool()> stop_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::int64_t bytes_read_ = 0;
};

bool StartsWithGzip(const StoredBytes& bytes) {
  return bytes.size() >= 3 && std::memcmp(bytes.data(), "\x1f\x8b\x08", 3) == 0;
}

bool StartsWithBzip2(const StoredBytes& bytes) {
  return bytes.size() >= 4 && std::memcmp(bytes.data(), "BZh", 3) == 0 &&
         bytes.data()[3] >= '1' && bytes.data()[3] <= '9';
}

// xz, zstd, lz4 or zip.
bool StartsWithArchive(const StoredBytes& bytes) {
  if (bytes.size() < 4) return false;
  for (const char* mark :
       {"\xfd"
        "7zX",
        "\x28\xb5\x2f\xfd", "\x04\x22\x4d\x18", "PK\x03\x04"}) {
    if (std::memcmp(bytes.data(), mark, 4) == 0) return true;
  }
  return false;
}

}  // namespace

// Plain unless told otherwise by the subclasses' Unpack.
class InputStream::Unpacker {
 public:
  explicit Unpacker(std::unique_ptr<StoredBytes> bytes)
      : bytes_(std::move(bytes)) {}
  virtual ~Unpacker() = default;

  // Writes at most `capacity` bytes; 0 only at the end.
  virtual std::size_t Unpack(char* output, std::size_t capacity) {
    if (!bytes_->Require(1)) return 0;
    const std::size_t count = std::min(capacity, bytes_->size());
    std::memcpy(output, bytes_->data(), count);
    bytes_->Consume(count);
    return count;
  }

  // The bytes as they are stored.
  virtual bool is_plain() const { return true; }

  const std::string& damage() const { return damage_; }
  // Stored bytes that what was unpacked is made of.
  virtual std::int64_t bytes_read() const { return bytes_->bytes_read(); }
  virtual std::size_t chunk() const { return bytes_->chunk(); }

  static std::unique_ptr<Unpacker> Create(std::unique_ptr<StoredBytes> bytes);

  // The same ahead of who reads, in a thread of its own. `stop`: that of the
  // stored bytes.
  static std::unique_ptr<Unpacker> Ahead(std::unique_ptr<Unpacker> unpacker,
                                         std::function<bool()> stop);

 protected:
  std::unique_ptr<StoredBytes> bytes_;
  std::string damage_;

 private:
  class Gzip;
  class Bzip2;
  class Archive;
  class InThread;
};

class InputStream::Unpacker::Gzip : public Unpacker {
 public:
  explicit Gzip(std::unique_ptr<StoredBytes> bytes)
      : Unpacker(std::move(bytes)) {
    // 16: expect a gzip header and trailer, so that the checksum is tested.
    if (inflateInit2(&stream_, 15 + 16) != Z_OK)
      throw PLUMBLINE_ERROR("zlib cannot be initialized", "enough memory");
  }
  ~Gzip() override { inflateEnd(&stream_); }
  bool is_plain() const override { return false; }

  std::size_t Unpack(char* output, std::size_t capacity) override {
    while (!done_) {
      if (!bytes_->Require(1)) {
        damage_ = "gzip data breaks off before its end";
        done_ = true;
        return 0;
      }
      const uInt given =
          static_cast<uInt>(std::min(bytes_->size(), std::size_t{1} << 30));
      stream_.next_in =
          reinterpret_cast<Bytef*>(const_cast<char*>(bytes_->data()));
      stream_.avail_in = given;
      stream_.next_out = reinterpret_cast<Bytef*>(output);
      stream_.avail_out = static_cast<uInt>(capacity);
      const int status = inflate(&stream_, Z_NO_FLUSH);
      bytes_->Consume(given - stream_.avail_in);
      const std::size_t count = capacity - stream_.avail_out;
      if (status == Z_STREAM_END) {
        NextMember();
      } else if (status != Z_OK && status != Z_BUF_ERROR) {
        damage_ = std::string("gzip data is corrupt") +
                  (stream_.msg ? std::string(": ") + stream_.msg : "");
        done_ = true;
      }
      if (count > 0) return count;
    }
    return 0;
  }

 private:
  void NextMember() {
    // Tapes and block devices pad with zeros.
    while (bytes_->Require(1) && *bytes_->data() == 0) bytes_->Consume(1);
    bytes_->Require(3);
    if (StartsWithGzip(*bytes_)) {
      inflateReset(&stream_);
      return;
    }
    if (bytes_->size() > 0) damage_ = "gzip data is followed by something else";
    done_ = true;
  }

  z_stream stream_ = {};
  bool done_ = false;
};

class InputStream::Unpacker::Bzip2 : public Unpacker {
 public:
  explicit Bzip2(std::unique_ptr<StoredBytes> bytes)
      : Unpacker(std::move(bytes)), decoder_([this] { return More(); }) {}
  bool is_plain() const override { return false; }

  std::size_t Unpack(char* output, std::size_t capacity) override {
    while (!done_) {
      const std::size_t count = decoder_.Unpack(output, capacity);
      switch (decoder_.state()) {
        case Bzip2Decoder::State::kGoingOn:
          break;
        case Bzip2Decoder::State::kEnd:
          NextMember();
          break;
        case Bzip2Decoder::State::kBreaksOff:
          damage_ = "bzip2 data breaks off before its end";
          done_ = true;
          break;
        case Bzip2Decoder::State::kCorrupt:
          damage_ = "bzip2 data is corrupt";
          done_ = true;
      }
      if (count > 0) return count;
    }
    return 0;
  }

 private:
  std::string_view More() {
    bytes_->Consume(given_);
    bytes_->Require(1);
    given_ = bytes_->size();
    return {bytes_->data(), given_};
  }

  void NextMember() {
    const Bzip2Decoder::Next next = decoder_.NextStream();
    if (next == Bzip2Decoder::Next::kStream) return;
    if (next == Bzip2Decoder::Next::kSomethingElse)
      damage_ = "bzip2 data is followed by something else";
    done_ = true;
  }

  Bzip2Decoder decoder_;
  std::size_t given_ = 0;
  bool done_ = false;
};

class InputStream::Unpacker::Archive : public Unpacker {
 public:
  explicit Archive(std::unique_ptr<StoredBytes> bytes)
      : Unpacker(std::move(bytes)) {
    archive_.reset(archive_read_new());
    if (archive_ == nullptr) {
      throw PLUMBLINE_ERROR("libarchive cannot be initialized",
                            "enough memory");
    }
    is_zip_ = *bytes_->data() == 'P';
    archive_read_support_filter_xz(archive_.get());
    archive_read_support_filter_zstd(archive_.get());
    archive_read_support_filter_lz4(archive_.get());
    if (is_zip_) {
      archive_read_support_format_zip_streamable(archive_.get());
    } else {
      archive_read_support_format_raw(archive_.get());
    }
    archive_entry* entry = nullptr;
    done_ = archive_read_open(archive_.get(), this, nullptr, Read, nullptr) !=
            ARCHIVE_OK;
    while (!done_) {
      const int status = archive_read_next_header(archive_.get(), &entry);
      done_ = status != ARCHIVE_OK && status != ARCHIVE_WARN;
      if (!is_zip_ || archive_entry_filetype(entry) != AE_IFDIR) break;
    }
    if (done_) Damage();
  }
  bool is_plain() const override { return false; }

  std::size_t Unpack(char* output, std::size_t capacity) override {
    if (done_) return 0;
    const la_ssize_t count =
        archive_read_data(archive_.get(), output, capacity);
    if (count > 0) return static_cast<std::size_t>(count);
    done_ = true;
    if (count < 0) {
      Damage();
    } else if (is_zip_) {
      archive_entry* entry = nullptr;
      if (archive_read_next_header(archive_.get(), &entry) == ARCHIVE_OK) {
        damage_ = "the zip holds more than one file, and the first is read";
      }
    }
    return 0;
  }

 private:
  struct Free {
    void operator()(archive* a) const { archive_read_free(a); }
  };

  static la_ssize_t Read(archive*, void* self, const void** data) {
    auto* const unpacker = static_cast<Archive*>(self);
    StoredBytes& stored = *unpacker->bytes_;
    stored.Consume(unpacker->given_);
    unpacker->given_ = 0;
    // An exception must not pass through libarchive.
    try {
      if (!stored.Require(1)) return 0;
    } catch (const Error& error) {
      unpacker->reading_failed_ = error.what();
      return -1;
    }
    unpacker->given_ = stored.size();
    *data = stored.data();
    return static_cast<la_ssize_t>(stored.size());
  }

  void Damage() {
    damage_ = "compressed data is corrupt or breaks off";
    if (!reading_failed_.empty()) {
      damage_ += ": " + reading_failed_;
    } else if (const char* why = archive_error_string(archive_.get())) {
      damage_ += ": " + OneLine(why);
    }
  }

  std::unique_ptr<archive, Free> archive_;
  std::string reading_failed_;
  bool is_zip_ = false;
  std::size_t given_ = 0;
  bool done_ = false;
};

// Takes what another one unpacks in a thread.
class InputStream::Unpacker::InThread : public Unpacker {
 public:
  InThread(std::unique_ptr<Unpacker> unpacker, std::function<bool()> stop)
      : Unpacker(std::make_unique<StoredBytes>(std::string(), std::string())),
        unpacker_(std::move(unpacker)),
        chunk_(unpacker_->chunk()),
        stop_(std::move(stop)) {
    // Who reads is asked by its own thread alone.
    unpacker_->bytes_->SetStop([this] { return is_stopped_.load(); });
    pieces_.emplace(kMostAhead, [this](Piece* piece) { return Make(piece); });
    if (!pieces_->has_thread()) unpacker_->bytes_->SetStop(stop_);
  }
  ~InThread() override { is_stopped_ = true; }
  bool is_plain() const override { return unpacker_->is_plain(); }
  std::int64_t bytes_read() const override { return piece_.bytes_read; }
  std::size_t chunk() const override { return chunk_; }

  std::size_t Unpack(char* output, std::size_t capacity) override {
    if (taken_ == piece_.bytes.size()) {
      taken_ = 0;
      if (!pieces_->Next(&piece_, stop_)) piece_.bytes.clear();
      damage_ = piece_.damage;
    }
    const std::size_t count = std::min(capacity, piece_.bytes.size() - taken_);
    std::copy_n(piece_.bytes.data() + taken_, count, output);
    taken_ += count;
    return count;
  }

 private:
  struct Piece {
    // Empty at the end.
    std::vector<char> bytes;
    std::int64_t bytes_read = 0;
    std::string damage;
  };

  // In the thread.
  bool Make(Piece* piece) {
    if (is_ended_) return false;
    piece->bytes.resize(chunk_);
    const std::size_t count = unpacker_->Unpack(piece->bytes.data(), chunk_);
    piece->bytes.resize(count);
    piece->bytes_read = unpacker_->bytes_read();
    piece->damage = unpacker_->damage();
    // The end says what was wrong, too.
    is_ended_ = count == 0;
    return true;
  }

  std::unique_ptr<Unpacker> unpacker_;
  const std::size_t chunk_;
  std::function<bool()> stop_;
  std::atomic<bool> is_stopped_{false};
  bool is_ended_ = false;
  Piece piece_;
  std::size_t taken_ = 0;
  // Ends before what its thread uses.
  std::optional<ReadAhead<Piece>> pieces_;
};

std::unique_ptr<InputStream::Unpacker> InputStream::Unpacker::Ahead(
    std::unique_ptr<Unpacker> unpacker, std::function<bool()> stop) {
  return std::make_unique<InThread>(std::move(unpacker), std::move(stop));
}

std::unique_ptr<InputStream::Unpacker> InputStream::Unpacker::Create(
    std::unique_ptr<StoredBytes> bytes) {
  bytes->Require(4);
  if (StartsWithGzip(*bytes)) return std::make_unique<Gzip>(std::move(bytes));
  if (StartsWithBzip2(*bytes)) return std::make_unique<Bzip2>(std::move(bytes));
  if (StartsWithArchive(*bytes)) {
    return std::make_unique<Archive>(std::move(bytes));
  }
  return std::make_unique<Unpacker>(std::move(bytes));
}

InputStream::InputStream(const std::string& path, std::function<bool()> stop)
    : name_(path) {
  int descriptor = STDIN_FILENO;
  const bool owned = path != "-";
  if (owned) {
    // Opening a named pipe waits for who writes to it, deaf to `stop`, unless
    // O_NONBLOCK is given.
    descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor < 0) {
      throw Error(path, 0,
                  std::string("cannot be opened: ") + std::strerror(errno),
                  "a readable file");
    }
  } else {
    name_ = "standard input";
  }
  struct stat status = {};
  const bool is_known = fstat(descriptor, &status) == 0;
  auto bytes = std::make_unique<StoredBytes>(
      name_, descriptor, owned, is_known && S_ISFIFO(status.st_mode), stop);
  if (is_known && S_ISDIR(status.st_mode))
    throw Error(name_, 0, "is a directory", "a file");
  if (owned) {
    fcntl(descriptor, F_SETFL, fcntl(descriptor, F_GETFL) & ~O_NONBLOCK);
  }
  if (S_ISREG(status.st_mode)) size_ = status.st_size;
  unpacker_ = Unpacker::Create(std::move(bytes));
  is_plain_file_ = owned && S_ISREG(status.st_mode) && unpacker_->is_plain();
  if (ThreadsHere() > 1) {
    unpacker_ = Unpacker::Ahead(std::move(unpacker_), std::move(stop));
  }
  SkipByteOrderMark();
}

InputStream::InputStream(const std::string& name, std::string contents)
    : name_(name),
      unpacker_(
          Unpacker::Create(std::make_unique<StoredBytes>(name, contents))) {
  SkipByteOrderMark();
}

InputStream::~InputStream() = default;

void InputStream::SkipByteOrderMark() {
  if (Peek(kByteOrderMark.size()) == kByteOrderMark) {
    begin_ += kByteOrderMark.size();
  }
}

bool InputStream::Fill() {
  if (begin_ > 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  const std::size_t wanted = end_ + unpacker_->chunk();
  if (buffer_.size() < wanted) {
    buffer_.resize(std::max(wanted, 2 * buffer_.size()));
  }
  const std::size_t count =
      unpacker_->Unpack(buffer_.data() + end_, buffer_.size() - end_);
  end_ += count;
  if (progress_) progress_(unpacker_->bytes_read(), size_);
  return count > 0;
}

void InputStream::SetProgress(
    std::function<void(std::int64_t done, std::int64_t size)> progress) {
  progress_ = std::move(progress);
}

bool InputStream::ReadLine(std::string_view* line) {
  std::size_t searched = 0;
  std::size_t length = 0;
  std::size_t consumed = 0;
  while (true) {
    const char* const start = buffer_.data() + begin_;
    const std::size_t available = end_ - begin_;
    const void* const newline =
        available > searched
            ? std::memchr(start + searched, '\n', available - searched)
            : nullptr;
    if (newline != nullptr) {
      length =
          static_cast<std::size_t>(static_cast<const char*>(newline) - start);
      consumed = length + 1;
      break;
    }
    if (available > kMaximumLineLength) {
      throw Error(name_, line_number_ + 1, "line is longer than 16 MiB",
                  "text with line ends");
    }
    searched = available;
    if (!Fill()) {
      if (available == 0) return false;
      length = available;
      consumed = available;
      break;
    }
  }
  *line = std::string_view(buffer_.data() + begin_, length);
  if (!line->empty() && line->back() == '\r') line->remove_suffix(1);
  begin_ += consumed;
  ++line_number_;
  return true;
}

std::string_view InputStream::Peek(std::size_t count) {
  while (end_ - begin_ < count && Fill()) {
  }
  return std::string_view(buffer_.data() + begin_,
                          std::min(count, end_ - begin_));
}

std::uint64_t InputStream::Consume(std::uint64_t count) {
  std::uint64_t left = count;
  while (left > 0) {
    if (begin_ == end_ && !Fill()) break;
    const std::uint64_t taken = std::min<std::uint64_t>(left, end_ - begin_);
    begin_ += static_cast<std::size_t>(taken);
    left -= taken;
  }
  position_ += count - left;
  return count - left;
}

std::string InputStream::ReadRest(std::size_t limit) {
  std::string rest;
  do {
    const std::string_view piece(buffer_.data() + begin_, end_ - begin_);
    // Corrupt data may have some.
    if (piece.size() >= kManyZeros &&
        piece.find_first_not_of('\0') == std::string_view::npos) {
      throw Error(name_, 0, "holds bytes that are zero", "text");
    }
    if (piece.size() > limit - rest.size()) {
      throw Error(name_, 0,
                  "holds more than " + std::to_string(limit >> 20) + " MiB",
                  "less text");
    }
    rest.append(piece);
    begin_ = end_;
  } while (Fill());
  return rest;
}

const std::string& InputStream::damage() const { return unpacker_->damage(); }

}  // namespace plumbline
