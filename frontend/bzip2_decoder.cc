#include <bzlib.h>
#include <plumbline/core/error.h>
#include <plumbline/core/late_library.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/bzip2_decoder.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <deque>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

LateLibrary bzip2_library("libbz2.so.1.0");
PLUMBLINE_LATE_FUNCTION(bzip2_library, BZ2_bzDecompress);
PLUMBLINE_LATE_FUNCTION(bzip2_library, BZ2_bzDecompressEnd);
PLUMBLINE_LATE_FUNCTION(bzip2_library, BZ2_bzDecompressInit);

constexpr std::uint64_t kBlockMark = 0x314159265359;
constexpr std::uint64_t kEndMark = 0x177245385090;
constexpr std::uint64_t kMarkBits = 48;
constexpr std::uint64_t kMarkMask = (std::uint64_t{1} << kMarkBits) - 1;
constexpr std::uint64_t kCrcBits = 32;
constexpr int kInMark = 16;
// A block has up to 900,000 symbols of 20 bits and some tables.
constexpr std::uint64_t kMostBlockBits = std::uint64_t{8} << 22;
// "BZh" and the size of blocks, a digit.
constexpr std::size_t kHeadBytes = 4;
constexpr std::size_t kOutputStep = std::size_t{1} << 20;

// A mark in the stored bytes, at a bit counted from their beginning.
struct Mark {
  std::uint64_t bit = 0;
  bool is_end = false;
};

// The stored bytes that are not decoded yet, and the marks in them.
class StoredBits {
 public:
  explicit StoredBits(std::function<std::string_view()> more)
      : more_(std::move(more)) {}

  // Whether there are bits up to `end`; asks for more.
  bool Require(std::uint64_t end) {
    while (this->end() < end) {
      if (is_ended_) return false;
      const std::string_view piece = more_();
      is_ended_ = piece.empty();
      bytes_.append(piece);
    }
    return true;
  }

  // The first mark that begins at `from` or later, at `last` at the latest;
  // false when there is none.
  bool FindMark(std::uint64_t from, std::uint64_t last, Mark* mark) {
    while (true) {
      while (!marks_.empty() && marks_.front().bit < first_bit()) {
        marks_.pop_front();
      }
      const auto found = std::find_if(
          marks_.begin(), marks_.end(),
          [from](const Mark& candidate) { return candidate.bit >= from; });
      if (found != marks_.end()) {
        *mark = *found;
        return found->bit <= last;
      }
      if (8 * scanned_ >= last + kMarkBits) return false;
      if (!Require(8 * (scanned_ + 1))) return false;
      Scan();
    }
  }

  // `count` bits from `bit` on, at most 64. They must be there.
  std::uint64_t At(std::uint64_t bit, std::uint64_t count) const {
    std::uint64_t value = 0;
    for (std::uint64_t i = bit; i < bit + count; ++i) {
      value = value << 1 | (Byte(i / 8) >> (7 - i % 8) & 1);
    }
    return value;
  }

  unsigned char Byte(std::uint64_t index) const {
    return static_cast<unsigned char>(bytes_[index - first_]);
  }

  // Forgets the bytes before a bit, now and then.
  void Drop(std::uint64_t bit) {
    const std::uint64_t count = bit / 8 - first_;
    if (count < bytes_.size() / 2) return;
    bytes_.erase(0, count);
    first_ += count;
  }

  // Marks before a bit are none.
  void ScanFrom(std::uint64_t bit) {
    marks_.clear();
    scanned_ = bit / 8;
    window_ = 0;
  }

  std::uint64_t end() const { return 8 * (first_ + bytes_.size()); }

 private:
  std::uint64_t first_bit() const { return 8 * first_; }

  // Whether a mark of which a bit of the last byte is the end may have this
  // byte so many bits (kInMark) before that byte's end: one in 16 passes.
  static bool MayBeInMark(unsigned char byte) {
    static const std::array<bool, 256> is_in_mark = [] {
      std::array<bool, 256> made = {};
      for (const std::uint64_t mark : {kBlockMark, kEndMark}) {
        for (int shift = 0; shift < 8; ++shift) {
          made[mark << shift >> kInMark & 255] = true;
        }
      }
      return made;
    }();
    return is_in_mark[byte];
  }

  // Looks for marks in what there is.
  void Scan() {
    const std::uint64_t end = first_ + bytes_.size();
    for (; scanned_ < end; ++scanned_) {
      window_ = window_ << 8 | Byte(scanned_);
      if (!MayBeInMark(static_cast<unsigned char>(window_ >> kInMark)))
        continue;
      for (std::uint64_t shift = 8; shift-- > 0;) {
        const std::uint64_t bits = window_ >> shift & kMarkMask;
        if (bits != kBlockMark && bits != kEndMark) continue;
        marks_.push_back(
            {8 * (scanned_ + 1) - shift - kMarkBits, bits == kEndMark});
      }
    }
  }

  std::function<std::string_view()> more_;
  bool is_ended_ = false;
  std::string bytes_;
  // Of all stored bytes: the first of bytes_, and the first one that was not
  // looked at for marks, with the bits before it.
  std::uint64_t first_ = 0;
  std::uint64_t scanned_ = 0;
  std::uint64_t window_ = 0;
  std::deque<Mark> marks_;
};

// Bytes from bits.
class BitWriter {
 public:
  explicit BitWriter(std::string* bytes) : bytes_(bytes) {}
  void Add(std::uint64_t bits, std::uint64_t count) {
    while (count > 0) {
      const std::uint64_t taken = std::min<std::uint64_t>(count, 8 - held_);
      count -= taken;
      byte_ = byte_ << taken | (bits >> count & ((1u << taken) - 1));
      held_ += taken;
      if (held_ == 8) Write();
    }
  }
  // Fills the last byte with zeros.
  void Finish() {
    if (held_ > 0) Add(0, 8 - held_);
  }

 private:
  void Write() {
    bytes_->push_back(static_cast<char>(byte_));
    byte_ = held_ = 0;
  }
  std::string* bytes_;
  std::uint64_t byte_ = 0;
  std::uint64_t held_ = 0;
};

enum class Outcome { kRight, kBreaksOff, kCorrupt };

struct UnpackedBlock {
  std::string bytes;
  Outcome outcome = Outcome::kCorrupt;
};

UnpackedBlock UnpackWithLibbz2(std::string stream) {
  UnpackedBlock block;
  bz_stream bz = {};
  if (BZ2_bzDecompressInit(&bz, 0, 0) != BZ_OK)
    throw PLUMBLINE_ERROR("libbz2 cannot be initialized", "enough memory");
  bz.next_in = stream.data();
  bz.avail_in = static_cast<unsigned>(stream.size());
  std::size_t used = 0;
  while (true) {
    block.bytes.resize(std::max(2 * used, kOutputStep));
    const std::size_t room = block.bytes.size() - used;
    bz.next_out = block.bytes.data() + used;
    bz.avail_out = static_cast<unsigned>(room);
    const int status = BZ2_bzDecompress(&bz);
    used += room - bz.avail_out;
    if (status == BZ_STREAM_END) block.outcome = Outcome::kRight;
    if (status != BZ_OK) break;
    if (bz.avail_out > 0) {
      block.outcome = Outcome::kBreaksOff;
      break;
    }
  }
  BZ2_bzDecompressEnd(&bz);
  block.bytes.resize(used);
  return block;
}

// A block among the stored bits, as libbz2 left it.
struct Block {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  // Whether a mark follows, which says that the block is whole.
  bool is_whole = false;
  // Whether no block is so long.
  bool is_too_long = false;
  UnpackedBlock unpacked;
};

// A block as a stream of its own.
std::string StreamOf(const Block& block, char level, const StoredBits& stored) {
  std::string stream = "BZh";
  stream.push_back(level);
  stream.reserve(kHeadBytes + (block.end - block.begin) / 8 + 16);
  BitWriter writer(&stream);
  const std::uint64_t shift = block.begin % 8;
  std::uint64_t bit = block.begin;
  for (; bit + 8 <= block.end; bit += 8) {
    const std::uint64_t byte = bit / 8;
    const unsigned high = stored.Byte(byte);
    const unsigned low = shift == 0 ? 0u : stored.Byte(byte + 1);
    stream.push_back(
        static_cast<char>((high << shift | low >> (8 - shift)) & 255));
  }
  writer.Add(stored.At(bit, block.end - bit), block.end - bit);
  if (!block.is_whole) {
    writer.Finish();
    return stream;
  }
  writer.Add(kEndMark, kMarkBits);
  // The checksum of a stream of one block is the block's.
  writer.Add(stored.At(block.begin + kMarkBits, kCrcBits), kCrcBits);
  writer.Finish();
  return stream;
}

}  // namespace

class Bzip2Decoder::Decoder {
 public:
  explicit Decoder(std::function<std::string_view()> more)
      : stored_(std::move(more)) {}

  std::size_t Unpack(char* output, std::size_t capacity) {
    std::size_t count = 0;
    while (count < capacity) {
      if (!unpacked_.empty()) {
        const std::string& bytes = unpacked_.front();
        const std::size_t taken =
            std::min(capacity - count, bytes.size() - taken_);
        std::memcpy(output + count, bytes.data() + taken_, taken);
        count += taken;
        taken_ += taken;
        if (taken_ == bytes.size()) {
          unpacked_.pop_front();
          taken_ = 0;
        }
      } else if (decoded_ != State::kGoingOn) {
        break;
      } else {
        Decode();
      }
    }
    if (unpacked_.empty()) state_ = decoded_;
    return count;
  }

  State state() const { return state_; }

  Next NextStream() {
    if (!stored_.Require(at_ + 8)) return Next::kNothing;
    if (!ReadHead()) return Next::kSomethingElse;
    Mark mark;
    if (!stored_.Require(at_ + kMarkBits) ||
        !stored_.FindMark(at_, at_, &mark)) {
      is_begun_ = false;
      at_ -= 8 * kHeadBytes;
      return Next::kSomethingElse;
    }
    decoded_ = state_ = State::kGoingOn;
    return Next::kStream;
  }

  std::uint64_t consumed() const { return (at_ + 7) / 8; }

 private:
  // The head of a stream at `at_`, which it passes over.
  bool ReadHead() {
    if (!stored_.Require(at_ + 8 * kHeadBytes)) return false;
    const std::uint64_t byte = at_ / 8;
    if (stored_.Byte(byte) != 'B' || stored_.Byte(byte + 1) != 'Z' ||
        stored_.Byte(byte + 2) != 'h') {
      return false;
    }
    level_ = static_cast<char>(stored_.Byte(byte + 3));
    if (level_ < '1' || level_ > '9') return false;
    at_ += 8 * kHeadBytes;
    is_begun_ = true;
    crc_ = 0;
    stored_.ScanFrom(at_);
    return true;
  }

  // Decodes some blocks, or the end of the stream.
  void Decode() {
    if (!is_begun_ && !ReadHead()) {
      BreakOff(at_ + 8 * kHeadBytes);
      return;
    }
    Mark mark;
    if (!stored_.Require(at_ + kMarkBits) ||
        !stored_.FindMark(at_, at_, &mark)) {
      BreakOff(at_ + kMarkBits);
      return;
    }
    if (mark.is_end) {
      ReadEnd();
      return;
    }
    std::vector<Block> blocks = FindBlocks();
    ParallelFor(blocks.size(), ThreadsHere(), [&](std::size_t i) {
      blocks[i].unpacked =
          UnpackWithLibbz2(StreamOf(blocks[i], level_, stored_));
    });
    for (Block& block : blocks) {
      // What was decoded as part of a block that seemed to end before.
      if (block.begin < at_) continue;
      if (!Take(&block)) return;
    }
    stored_.Drop(at_);
  }

  // The next blocks, one for each thread, up to the end of the stream.
  std::vector<Block> FindBlocks() {
    std::vector<Block> blocks;
    std::uint64_t begin = at_;
    while (static_cast<int>(blocks.size()) < std::max(1, ThreadsHere())) {
      blocks.push_back(BlockAt(begin, begin + kMarkBits + kCrcBits));
      Mark next;
      const std::uint64_t end = blocks.back().end;
      if (!blocks.back().is_whole || !stored_.FindMark(end, end, &next) ||
          next.is_end) {
        break;
      }
      begin = next.bit;
    }
    return blocks;
  }

  // The block at a bit, up to the first mark from `least_end` on.
  Block BlockAt(std::uint64_t begin, std::uint64_t least_end) {
    Block block;
    block.begin = begin;
    Mark next;
    const std::uint64_t last = begin + kMostBlockBits;
    block.is_whole = stored_.FindMark(least_end, last, &next);
    // Without it the rest of a large file would be held, for nothing.
    block.is_too_long = !block.is_whole && stored_.end() > last;
    block.end = block.is_whole ? next.bit : std::min(last, stored_.end());
    return block;
  }

  // Takes what a block was unpacked to; false where the stream cannot be
  // decoded any further.
  bool Take(Block* block) {
    if (block->is_whole && block->unpacked.outcome != Outcome::kRight) {
      // In one of 10^8 gigabytes the bits of a mark are found in a block.
      Block longer = BlockAt(block->begin, block->end + 1);
      if (longer.is_whole) {
        longer.unpacked = UnpackWithLibbz2(StreamOf(longer, level_, stored_));
        if (longer.unpacked.outcome == Outcome::kRight) {
          *block = std::move(longer);
        }
      }
    }
    if (!block->unpacked.bytes.empty()) {
      unpacked_.push_back(std::move(block->unpacked.bytes));
    }
    if (!block->is_whole && !block->is_too_long &&
        block->unpacked.outcome == Outcome::kBreaksOff) {
      at_ = stored_.end();
      decoded_ = State::kBreaksOff;
      return false;
    }
    if (block->unpacked.outcome != Outcome::kRight) {
      decoded_ = State::kCorrupt;
      return false;
    }
    crc_ = (crc_ << 1 | crc_ >> 31) ^ static_cast<std::uint32_t>(stored_.At(
                                          block->begin + kMarkBits, kCrcBits));
    at_ = block->end;
    return true;
  }

  void ReadEnd() {
    const std::uint64_t end = at_ + kMarkBits + kCrcBits;
    if (!stored_.Require(end)) {
      BreakOff(end);
      return;
    }
    const bool is_right = stored_.At(at_ + kMarkBits, kCrcBits) == crc_;
    decoded_ = is_right ? State::kEnd : State::kCorrupt;
    at_ = (end + 7) / 8 * 8;
    stored_.Drop(at_);
  }

  // What should reach up to the bit `end` is not there, or is wrong.
  void BreakOff(std::uint64_t end) {
    const bool is_there = stored_.Require(end);
    decoded_ = is_there ? State::kCorrupt : State::kBreaksOff;
    if (!is_there) at_ = stored_.end();
  }

  StoredBits stored_;
  // Of what was unpacked and taken, and of what was decoded.
  State state_ = State::kGoingOn;
  State decoded_ = State::kGoingOn;
  // The stored bit up to which blocks are decoded.
  std::uint64_t at_ = 0;
  bool is_begun_ = false;
  char level_ = '9';
  std::uint32_t crc_ = 0;
  std::deque<std::string> unpacked_;
  // Bytes of the first one that were taken.
  std::size_t taken_ = 0;
};

Bzip2Decoder::Bzip2Decoder(std::function<std::string_view()> more)
    : decoder_(std::make_unique<Decoder>(std::move(more))) {}

Bzip2Decoder::~Bzip2Decoder() = default;

std::size_t Bzip2Decoder::Unpack(char* output, std::size_t capacity) {
  return decoder_->Unpack(output, capacity);
}

Bzip2Decoder::State Bzip2Decoder::state() const { return decoder_->state(); }

Bzip2Decoder::Next Bzip2Decoder::NextStream() { return decoder_->NextStream(); }

std::uint64_t Bzip2Decoder::consumed() const { return decoder_->consumed(); }

}  // namespace plumbline
