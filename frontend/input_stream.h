#ifndef PLUMBLINE_FRONTEND_INPUT_STREAM_H_
#define PLUMBLINE_FRONTEND_INPUT_STREAM_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace plumbline {

/// Input read line by line, or as bytes, from a plain or compressed file (gzip,
/// bzip2, xz, zstd, lz4, or a zip that holds one file), recognized by content
/// and not by name. Files made of several compressed members are read through
/// to their end. A byte order mark at the beginning is passed over.
///
/// Compressed data that breaks off or is corrupt ends the input there: what
/// was unpacked before is read as usual and damage() then says what happened.
/// Checksums stand at the end of a block, so the last bytes before corrupt
/// data ends may be wrong themselves.
///
/// A file is read and unpacked up to 4 MiB ahead in a thread of its own where
/// ThreadsHere() is more than 1 (ReadAhead), and as it is asked for otherwise.
/// What is to be called back is called in the thread that reads.
class InputStream {
 public:
  /// Longest line that is accepted, bytes.
  static constexpr std::size_t kMaximumLineLength = std::size_t{1} << 24;

  /// Opens the file `path`, or standard input when it is "-". Throws Error
  /// when it cannot be opened or read, or is a directory.
  ///
  /// `stop` (may be empty) is asked before every read, and five times a second
  /// while nothing comes: once it returns true, the input ends there.
  explicit InputStream(const std::string& path,
                       std::function<bool()> stop = nullptr);

  /// Reads from memory in place of a file (plain or compressed too); `name`
  /// stands for the file's in messages.
  InputStream(const std::string& name, std::string contents);

  ~InputStream();
  InputStream(const InputStream&) = delete;
  InputStream& operator=(const InputStream&) = delete;

  /// Takes the next line, without its end ("\n" or "\r\n"), into `line`, which
  /// stays valid until the next call. The last line may lack its end. Returns
  /// false at the end of the input. Throws Error on a read error and on a line
  /// longer than kMaximumLineLength.
  bool ReadLine(std::string_view* line);

  /// The next bytes, at most `count` and fewer only at the end of the input,
  /// without consuming them; valid until the next call. For recognizing the
  /// format.
  std::string_view Peek(std::size_t count);

  /// Passes over the next bytes, at most `count` and fewer only at the end of
  /// the input; how many they were. They need not have been peeked at.
  std::uint64_t Consume(std::uint64_t count);

  /// How many bytes were consumed by Consume(), as they are unpacked.
  std::uint64_t position() const { return position_; }

  /// Everything that was not consumed yet, for readers that want a
  /// std::istream. Throws Error on a read error, for more than `limit` bytes
  /// and for nothing but bytes that are zero: what is unpacked may be far
  /// larger than the file, and a device may have no end.
  std::string ReadRest(std::size_t limit = std::size_t{1} << 30);

  /// `progress` is called whenever more that was unpacked is taken, with the
  /// stored bytes of the file up to there and the file's size (0 when it is not
  /// known: standard input from a pipe).
  void SetProgress(
      std::function<void(std::int64_t done, std::int64_t size)> progress);

  /// Number of the line that ReadLine returned last, from 1; 0 before.
  int line_number() const { return line_number_; }

  /// The path, or "standard input".
  const std::string& name() const { return name_; }

  /// Whether the bytes of the file `name()` are these very bytes: no
  /// compression, no pipe, no standard input.
  bool is_plain_file() const { return is_plain_file_; }

  /// What was wrong with the compressed data, empty when nothing was (known
  /// for certain only once the end is reached).
  const std::string& damage() const;

 private:
  class Unpacker;

  void SkipByteOrderMark();

  // Appends unpacked bytes to the buffer; false at the end.
  bool Fill();

  std::string name_;
  std::unique_ptr<Unpacker> unpacker_;
  std::function<void(std::int64_t, std::int64_t)> progress_;
  std::int64_t size_ = 0;
  bool is_plain_file_ = false;
  std::vector<char> buffer_;
  // Unconsumed bytes are buffer_[begin_, end_).
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t position_ = 0;
  int line_number_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_INPUT_STREAM_H_
