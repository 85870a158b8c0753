#ifndef PLUMBLINE_FRONTEND_BZIP2_DECODER_H_
#define PLUMBLINE_FRONTEND_BZIP2_DECODER_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

namespace plumbline {

/// Unpacks bzip2 streams in less than half the time of libbz2. Most of that
/// time goes into the inverse of the Burrows-Wheeler transform, a walk around a
/// permutation of up to 900,000 entries that waits for memory at every step;
/// here several parts of the way are walked at once. Format: J. Tsai, "BZIP2:
/// Format Specification" (2016). Randomized blocks, which bzip2 before version
/// 0.9.5 (1999) wrote, count as corrupt.
class Bzip2Decoder {
 public:
  enum class State {
    /// There is more to unpack.
    kGoingOn,
    /// The stream is unpacked, and its checksums are right.
    kEnd,
    /// The stored bytes end before the stream does.
    kBreaksOff,
    /// A block or checksum is wrong. Blocks are unpacked before their checksum
    /// is known, so the last bytes may be wrong too.
    kCorrupt,
  };

  /// `more` returns the next stored bytes, from the head of a stream on, which
  /// stay valid until it is called again; none at the end of the input.
  explicit Bzip2Decoder(std::function<std::string_view()> more);
  ~Bzip2Decoder();
  Bzip2Decoder(const Bzip2Decoder&) = delete;
  Bzip2Decoder& operator=(const Bzip2Decoder&) = delete;

  /// Writes up to `capacity` unpacked bytes and returns their number, which is
  /// smaller only once the state is no longer kGoingOn.
  std::size_t Unpack(char* output, std::size_t capacity);

  State state() const;

  /// What follows a stream that was unpacked to its end.
  enum class Next { kNothing, kStream, kSomethingElse };
  /// Looks for the head of another stream, which Unpack then goes on with. To
  /// be called in the state kEnd.
  Next NextStream();

  /// Stored bytes up to the end of what was decoded.
  std::uint64_t consumed() const;

 private:
  class Decoder;
  std::unique_ptr<Decoder> decoder_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BZIP2_DECODER_H_
