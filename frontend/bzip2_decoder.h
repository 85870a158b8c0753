#ifndef PLUMBLINE_FRONTEND_BZIP2_DECODER_H_
#define PLUMBLINE_FRONTEND_BZIP2_DECODER_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

namespace plumbline {

/// Unpacks bzip2 streams with libbz2, ThreadsHere() blocks at a time: a block
/// of up to 900 kB depends on no other one. Blocks are found by the 48 bits
/// that each begins with, and given to libbz2 as streams of their own. Format:
/// J. Tsai, "BZIP2: Format Specification" (2016).
class Bzip2Decoder {
 public:
  /// How far the present stream is unpacked.
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
  /// smaller only once the state is no longer kGoingOn. Throws for lack of
  /// memory only.
  std::size_t Unpack(char* output, std::size_t capacity);

  /// Of what Unpack() has given out.
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
