#ifndef PLUMBLINE_FRONTEND_BZIP2_BLOCK_H_
#define PLUMBLINE_FRONTEND_BZIP2_BLOCK_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumbline {

/// Decodes blocks of bzip2 streams in a third to a fifth of libbz2's time, as
/// long as nothing is wrong with them: the Burrows-Wheeler transform, whose
/// inverse is a walk through memory that waits at every step, is undone from
/// several places at once. Format: J. Tsai, "BZIP2: Format Specification"
/// (2016).
///
/// It gives up on whatever is unusual or wrong (a checksum of the block above
/// all), so that libbz2 alone says what is to be had of damaged data.
class Bzip2Block {
 public:
  /// Decodes the block whose mark begins at the bit `begin` of `bytes` and
  /// which ends before the bit `end`, both counted from the first byte's
  /// highest one. `capacity`: bytes that a block of the stream may have, before
  /// runs are expanded (100,000 to 900,000). False, with nothing in `output`,
  /// unless the block takes up just these bits and its checksum is right.
  bool Decode(std::string_view bytes, std::uint64_t begin, std::uint64_t end,
              std::size_t capacity, std::string* output);

 private:
  class Bits;
  class Code;
  class RecentBytes;
  class Walkers;

  // Fills the low bytes of next_ with the block as it was transformed.
  bool ReadSymbols(std::size_t capacity, Bits* input);
  // Which code each group of symbols has, and how many codes there are.
  bool ReadSelectors(Bits* input, std::size_t* num_codes);
  // Makes block_, the block with its bytes in their order, of what next_ has.
  void Untransform(std::uint32_t origin);
  // Writes the block with its runs at full length; false when the last one
  // lacks its length.
  bool ExpandRuns(std::string* output) const;

  // Bytes that there is room for.
  std::size_t room_ = 0;
  // The permutation: the byte of an entry, and above it the entry that comes
  // next.
  std::unique_ptr<std::uint32_t[]> next_;
  std::unique_ptr<unsigned char[]> walked_;
  std::unique_ptr<unsigned char[]> block_;
  // Bytes of the block, runs as they are stored.
  std::size_t size_ = 0;
  std::vector<unsigned char> selectors_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BZIP2_BLOCK_H_
