#include <plumbline/frontend/bzip2_decoder.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr int kLongestCode = 20;
// Codes of up to so many bits are looked up at once.
constexpr int kTableBits = 10;
constexpr int kMaxSymbols = 258;
constexpr int kMaxCodes = 6;
constexpr int kSymbolsPerSelector = 50;
// What follows four equal bytes says how many more of them there are.
constexpr int kRun = 4;
// Parts of the permutation that are walked at once, and into how many it is cut
// so that all walkers come to an end at about the same time.
constexpr int kWalkers = 8;
constexpr std::size_t kMaxParts = 256;
constexpr std::size_t kLeastPart = 256;
constexpr std::uint32_t kPartBegins = std::uint32_t{1} << 31;
constexpr std::uint32_t kBlockMark[] = {0x314159, 0x265359};
constexpr std::uint32_t kEndMark[] = {0x177245, 0x385090};

// The stored bytes as bits, the highest of each byte first; zeros behind their
// end.
class Bits {
 public:
  explicit Bits(std::function<std::string_view()> more)
      : more_(std::move(more)) {}

  // The next `count` bits, 1 to 32, without passing over them.
  std::uint32_t Peek(int count) {
    if (available_ < count) Refill(count);
    return static_cast<std::uint32_t>(bits_ >> (64 - count));
  }
  void Skip(int count) {
    bits_ <<= count;
    available_ -= count;
  }
  std::uint32_t Take(int count) {
    const std::uint32_t value = Peek(count);
    Skip(count);
    return value;
  }
  void SkipToByte() { Skip(static_cast<int>(available_ % 8)); }

  // Whether bits behind the end were taken.
  bool is_past_end() const { return available_ < 8 * made_up_; }
  std::uint64_t consumed() const {
    return is_past_end()
               ? taken_
               : taken_ - static_cast<std::uint64_t>(available_ / 8 - made_up_);
  }

 private:
  void Refill(int count) {
    while (available_ <= 56) {
      if (piece_.empty()) {
        // Whoever writes to a pipe may wait for what is decoded so far.
        if (available_ >= count) return;
        if (made_up_ == 0) piece_ = more_();
        if (piece_.empty()) {
          available_ += 8;
          ++made_up_;
          continue;
        }
      }
      bits_ |= std::uint64_t{static_cast<unsigned char>(piece_.front())}
               << (56 - available_);
      available_ += 8;
      piece_.remove_prefix(1);
      ++taken_;
    }
  }

  std::function<std::string_view()> more_;
  std::string_view piece_;
  // The next bits, the first one highest, and how many they are.
  std::uint64_t bits_ = 0;
  std::int64_t available_ = 0;
  // Bytes that went into bits_, and zeros behind them.
  std::uint64_t taken_ = 0;
  std::int64_t made_up_ = 0;
};

// A canonical Huffman code.
class Code {
 public:
  explicit Code(const std::vector<int>& lengths) {
    std::array<int, kLongestCode + 2> counts = {};
    for (const int length : lengths) ++counts[length];
    std::int64_t code = 0;
    int place = 0;
    for (int length = 1; length <= kLongestCode; ++length) {
      first_place_[length] = place;
      base_[length] = code - place;
      for (std::size_t s = 0; s < lengths.size(); ++s) {
        if (lengths[s] == length) symbols_[place++] = static_cast<int>(s);
      }
      last_[length] = code + counts[length] - 1;
      FillTable(length, code, counts[length]);
      code = 2 * (code + counts[length]);
    }
    num_symbols_ = place;
  }

  // Takes a symbol; false when the bits are none.
  bool Take(Bits* input, int* symbol) const {
    const std::uint32_t bits = input->Peek(kLongestCode);
    const std::uint16_t entry = table_[bits >> (kLongestCode - kTableBits)];
    if (entry != 0) {
      input->Skip(entry & 31);
      *symbol = entry >> 5;
      return true;
    }
    for (int length = kTableBits + 1; length <= kLongestCode; ++length) {
      const std::int64_t code = bits >> (kLongestCode - length);
      if (code > last_[length]) continue;
      const std::int64_t place = code - base_[length];
      if (place < 0 || place >= num_symbols_) return false;
      input->Skip(length);
      *symbol = symbols_[static_cast<std::size_t>(place)];
      return true;
    }
    return false;
  }

 private:
  // Enters `count` codes from `code` on. Lengths that claim more codes than
  // there are (broken data) keep to the shorter ones.
  void FillTable(int length, std::int64_t code, int count) {
    if (length > kTableBits) return;
    const int spare = kTableBits - length;
    for (int i = 0; i < count; ++i) {
      const std::int64_t begin = (code + i) << spare;
      if (begin >= std::int64_t{1} << kTableBits) return;
      const int symbol = symbols_[first_place_[length] + i];
      std::fill_n(table_.begin() + begin, std::size_t{1} << spare,
                  static_cast<std::uint16_t>(symbol << 5 | length));
    }
  }

  // By the next bits: symbol << 5 | length, 0 for codes that are longer.
  std::array<std::uint16_t, std::size_t{1} << kTableBits> table_ = {};
  // By length: the last code, and the difference of code and place.
  std::array<std::int64_t, kLongestCode + 1> last_ = {};
  std::array<std::int64_t, kLongestCode + 1> base_ = {};
  std::array<int, kLongestCode + 1> first_place_ = {};
  // In the order of their codes.
  std::array<int, kMaxSymbols> symbols_ = {};
  int num_symbols_ = 0;
};

// The bytes of a block, those used last first. Most symbols ask for one of the
// first eight, which are held in a number, the first of them lowest.
class RecentBytes {
 public:
  explicit RecentBytes(const std::array<unsigned char, 256>& bytes) {
    for (std::size_t i = 0; i < 8; ++i) {
      first_ |= std::uint64_t{bytes[i]} << 8 * i;
    }
    std::copy(bytes.begin() + 8, bytes.end(), others_.begin());
  }

  unsigned char front() const { return static_cast<unsigned char>(first_); }

  // Moves the byte at `place` to the front; that byte.
  unsigned char Use(std::size_t place) {
    if (place < 8) {
      const std::uint64_t moved = ~std::uint64_t{0} >> (56 - 8 * place);
      const std::uint64_t byte = first_ >> 8 * place & 255;
      first_ = (first_ & ~moved) | (first_ << 8 & moved) | byte;
      return static_cast<unsigned char>(byte);
    }
    const unsigned char byte = others_[place - 8];
    std::memmove(others_.data() + 1, others_.data(), place - 8);
    others_[0] = static_cast<unsigned char>(first_ >> 56);
    first_ = first_ << 8 | byte;
    return byte;
  }

 private:
  std::uint64_t first_ = 0;
  std::array<unsigned char, 248> others_;
};

// CRC-32, highest bit first, of eight bytes at a time: the tables are those of
// a byte with 0 to 7 zeros behind it.
class Crc {
 public:
  void Add(const char* data, std::size_t count) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(data);
    const auto& tables = Tables();
    for (; count >= 8; count -= 8, bytes += 8) {
      std::uint32_t sum = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        const std::uint32_t byte = (value_ >> (24 - 8 * i) & 255) ^ bytes[i];
        sum ^= tables[7 - i][byte] ^ tables[3 - i][bytes[4 + i]];
      }
      value_ = sum;
    }
    for (; count > 0; --count, ++bytes) {
      value_ = value_ << 8 ^ tables[0][value_ >> 24 ^ *bytes];
    }
  }
  std::uint32_t value() const { return ~value_; }

 private:
  using TableArray = std::array<std::array<std::uint32_t, 256>, 8>;

  static const TableArray& Tables() {
    static const TableArray tables = [] {
      TableArray made = {};
      for (std::uint32_t i = 0; i < 256; ++i) {
        std::uint32_t crc = i << 24;
        for (int bit = 0; bit < 8; ++bit) {
          crc = crc << 1 ^ (crc >> 31 != 0 ? 0x04c11db7u : 0u);
        }
        made[0][i] = crc;
      }
      for (std::size_t t = 1; t < made.size(); ++t) {
        for (std::size_t i = 0; i < 256; ++i) {
          const std::uint32_t crc = made[t - 1][i];
          made[t][i] = crc << 8 ^ made[0][crc >> 24];
        }
      }
      return made;
    }();
    return tables;
  }

  std::uint32_t value_ = ~std::uint32_t{0};
};

}  // namespace

class Bzip2Decoder::Decoder {
 public:
  explicit Decoder(std::function<std::string_view()> more)
      : input_(std::move(more)) {}

  std::size_t Unpack(char* output, std::size_t capacity) {
    std::size_t count = 0;
    while (state_ == State::kGoingOn && count < capacity) {
      if (!in_block_) {
        Require(BeginBlock());
        continue;
      }
      const std::size_t added = ExpandRuns(output + count, capacity - count);
      crc_.Add(output + count, added);
      count += added;
      if (taken_ == size_ && repeats_ == 0) Require(EndBlock());
    }
    return count;
  }

  State state() const { return state_; }
  std::uint64_t consumed() const { return input_.consumed(); }

  Next NextStream() {
    const bool is_one = TakeHead();
    if (is_one) {
      has_head_ = true;
      state_ = State::kGoingOn;
      return Next::kStream;
    }
    return input_.consumed() > end_of_stream_ ? Next::kSomethingElse
                                              : Next::kNothing;
  }

 private:
  void Require(bool is_right) {
    if (is_right) return;
    state_ = input_.is_past_end() ? State::kBreaksOff : State::kCorrupt;
  }

  bool TakeMark(const std::uint32_t (&mark)[2]) {
    return input_.Take(24) == mark[0] && input_.Take(24) == mark[1];
  }

  bool TakeHead() {
    for (const char c : {'B', 'Z', 'h'}) {
      if (input_.Take(8) != static_cast<unsigned char>(c)) return false;
    }
    const std::uint32_t level = input_.Take(8);
    if (level < '1' || level > '9') return false;
    const std::size_t room = 100000 * (level - '0');
    if (room > room_) {
      room_ = room;
      // What is not used is never touched.
      next_.reset(new std::uint32_t[room_]);
      walked_.reset(new unsigned char[kWalkers * room_]);
      block_.reset(new unsigned char[room_]);
    }
    stream_room_ = room;
    stream_crc_ = 0;
    return true;
  }

  // The head of the next block, or the end of the stream, and all that the
  // block holds. False when it cannot be.
  bool BeginBlock() {
    if (!has_head_ && !TakeHead()) return false;
    has_head_ = true;
    const std::uint32_t mark = input_.Take(24);
    if (mark == kEndMark[0]) return EndStream();
    if (mark != kBlockMark[0] || input_.Take(24) != kBlockMark[1]) return false;
    expected_crc_ = input_.Take(32);
    const bool is_randomized = input_.Take(1) != 0;
    const std::uint32_t origin = input_.Take(24);
    if (is_randomized || !ReadSymbols() || input_.is_past_end() ||
        origin >= size_) {
      return false;
    }
    Untransform(origin);
    in_block_ = true;
    taken_ = 0;
    in_a_row_ = 0;
    repeats_ = 0;
    crc_ = Crc();
    return true;
  }

  bool EndBlock() {
    in_block_ = false;
    stream_crc_ = (stream_crc_ << 1 | stream_crc_ >> 31) ^ expected_crc_;
    // A run lacks its length.
    return in_a_row_ < kRun && crc_.value() == expected_crc_;
  }

  bool EndStream() {
    if (input_.Take(24) != kEndMark[1]) return false;
    if (input_.Take(32) != stream_crc_ || input_.is_past_end()) return false;
    input_.SkipToByte();
    end_of_stream_ = input_.consumed();
    state_ = State::kEnd;
    return true;
  }

  // Fills the low bytes of next_ with the block as it was transformed.
  bool ReadSymbols() {
    std::array<unsigned char, 256> used = {};
    const std::size_t num_bytes = ReadUsedBytes(&used);
    if (num_bytes == 0 || !ReadSelectors()) return false;
    // Two for runs, and one that ends the block.
    const int num_symbols = static_cast<int>(num_bytes) + 2;
    if (!ReadCodes(num_symbols)) return false;
    RecentBytes bytes(used);
    size_ = 0;
    std::uint32_t* const output = next_.get();
    std::size_t size = 0;
    std::size_t run = 0;
    std::size_t run_step = 1;
    for (const unsigned char selector : selectors_) {
      const Code& code = codes_[selector];
      for (int i = 0; i < kSymbolsPerSelector; ++i) {
        int symbol = 0;
        if (!code.Take(&input_, &symbol)) return false;
        if (symbol < 2) {
          // Digits 1 and 2 of a number in base 2, the lowest first.
          run += run_step << symbol;
          run_step *= 2;
          if (run > stream_room_ - size) return false;
          continue;
        }
        if (run > 0) {
          std::fill_n(output + size, run, bytes.front());
          size += run;
          run = 0;
          run_step = 1;
        }
        if (symbol == num_symbols - 1) {
          size_ = size;
          return true;
        }
        if (size == stream_room_) return false;
        output[size++] = bytes.Use(static_cast<std::size_t>(symbol) - 1);
      }
    }
    return false;
  }

  // Which bytes the block has, in their order.
  std::size_t ReadUsedBytes(std::array<unsigned char, 256>* bytes) {
    std::size_t count = 0;
    const std::uint32_t ranges = input_.Take(16);
    for (unsigned range = 0; range < 16; ++range) {
      if ((ranges >> (15 - range) & 1) == 0) continue;
      const std::uint32_t used = input_.Take(16);
      for (unsigned i = 0; i < 16; ++i) {
        if ((used >> (15 - i) & 1) == 0) continue;
        (*bytes)[count++] = static_cast<unsigned char>(16 * range + i);
      }
    }
    return count;
  }

  // Which code each group of symbols has.
  bool ReadSelectors() {
    num_codes_ = input_.Take(3);
    const std::uint32_t count = input_.Take(15);
    if (num_codes_ < 2 || num_codes_ > kMaxCodes || count == 0) return false;
    std::array<unsigned char, kMaxCodes> order = {0, 1, 2, 3, 4, 5};
    selectors_.resize(count);
    for (unsigned char& selector : selectors_) {
      std::size_t place = 0;
      while (input_.Take(1) != 0) {
        if (++place >= num_codes_) return false;
      }
      std::rotate(order.begin(), order.begin() + place,
                  order.begin() + place + 1);
      selector = order[0];
    }
    return true;
  }

  bool ReadCodes(int num_symbols) {
    codes_.clear();
    std::vector<int> lengths(static_cast<std::size_t>(num_symbols));
    for (std::uint32_t c = 0; c < num_codes_; ++c) {
      int length = static_cast<int>(input_.Take(5));
      for (int& symbol_length : lengths) {
        while (true) {
          if (length < 1 || length > kLongestCode) return false;
          if (input_.Take(1) == 0) break;
          length += input_.Take(1) == 0 ? 1 : -1;
        }
        symbol_length = length;
      }
      codes_.emplace_back(lengths);
    }
    return true;
  }

  // Makes block_, the block with its bytes in their order, of what next_ has.
  void Untransform(std::uint32_t origin) {
    std::uint32_t* const next = next_.get();
    std::array<std::uint32_t, 256> places = {};
    for (std::size_t i = 0; i < size_; ++i) ++places[next[i] & 255];
    std::uint32_t sum = 0;
    for (std::uint32_t& place : places) sum += std::exchange(place, sum);
    for (std::size_t i = 0; i < size_; ++i) {
      next[places[next[i] & 255]++] |= static_cast<std::uint32_t>(i) << 8;
    }
    const std::vector<Part> parts = Walk(next[origin] >> 8);
    // Data that repeat themselves go around a part of the permutation several
    // times.
    std::size_t count = 0;
    std::size_t part = 0;
    while (count < size_) {
      const std::size_t length = std::min(parts[part].length, size_ - count);
      std::memcpy(block_.get() + count, parts[part].bytes, length);
      count += length;
      part = parts[part].next;
    }
  }

  // A part of the way around the permutation, from the entry `begin` to where
  // the part `next` begins.
  struct Part {
    std::uint32_t begin = 0;
    const unsigned char* bytes = nullptr;
    std::size_t length = 0;
    std::size_t next = 0;
  };

  // Walks the permutation from `begin`, where the first part begins.
  std::vector<Part> Walk(std::uint32_t begin) {
    std::uint32_t* const next = next_.get();
    const std::size_t count =
        std::clamp(size_ / kLeastPart, std::size_t{1}, kMaxParts);
    std::vector<Part> parts;
    std::vector<std::pair<std::uint32_t, std::size_t>> begins;
    const auto begin_part = [&](std::uint32_t at) {
      if ((next[at] & kPartBegins) != 0) return;
      next[at] |= kPartBegins;
      begins.emplace_back(at, parts.size());
      parts.emplace_back();
      parts.back().begin = at;
    };
    begin_part(begin);
    for (std::size_t i = 1; i < count; ++i) {
      begin_part(static_cast<std::uint32_t>(i * size_ / count));
    }
    std::sort(begins.begin(), begins.end());

    struct Walker {
      std::uint32_t entry;
      unsigned char* output;
      std::size_t part;
    };
    std::array<Walker, kWalkers> walkers;
    std::size_t started = 0;
    const auto start = [&](unsigned char* output) {
      parts[started].bytes = output;
      return Walker{next[parts[started].begin] & ~kPartBegins, output,
                    started++};
    };
    std::size_t active = 0;
    while (active < kWalkers && started < parts.size()) {
      walkers[active] = start(walked_.get() + active * room_);
      ++active;
    }
    while (active > 0) {
      for (std::size_t w = 0; w < active; ++w) {
        Walker& walker = walkers[w];
        *walker.output++ = static_cast<unsigned char>(walker.entry);
        const std::uint32_t at = walker.entry >> 8;
        walker.entry = next[at];
        if ((walker.entry & kPartBegins) == 0) continue;
        Part& part = parts[walker.part];
        part.length = static_cast<std::size_t>(walker.output - part.bytes);
        part.next = std::lower_bound(begins.begin(), begins.end(),
                                     std::make_pair(at, std::size_t{0}))
                        ->second;
        if (started < parts.size()) {
          walker = start(walker.output);
        } else {
          walkers[w] = walkers[--active];
        }
      }
    }
    return parts;
  }

  // Writes the block's bytes with their runs at full length, as many as there
  // is room for.
  std::size_t ExpandRuns(char* output, std::size_t capacity) {
    std::size_t count = 0;
    while (count < capacity) {
      if (repeats_ > 0) {
        const std::size_t repeated = std::min(repeats_, capacity - count);
        std::memset(output + count, last_, repeated);
        repeats_ -= repeated;
        count += repeated;
        continue;
      }
      if (in_a_row_ == kRun && taken_ < size_) {
        repeats_ = block_[taken_++];
        in_a_row_ = 0;
        continue;
      }
      const std::size_t end = std::min(size_, taken_ + capacity - count);
      if (taken_ == end) break;
      while (taken_ < end && in_a_row_ < kRun) {
        const unsigned char byte = block_[taken_++];
        in_a_row_ = byte == last_ && in_a_row_ > 0 ? in_a_row_ + 1 : 1;
        last_ = byte;
        output[count++] = static_cast<char>(byte);
      }
    }
    return count;
  }

  Bits input_;
  State state_ = State::kGoingOn;
  bool has_head_ = false;
  std::uint32_t stream_crc_ = 0;
  std::uint64_t end_of_stream_ = 0;

  std::uint32_t num_codes_ = 0;
  std::vector<Code> codes_;
  std::vector<unsigned char> selectors_;

  // Bytes that a block of this stream may have, runs counted as they are
  // stored, and that there is room for.
  std::size_t stream_room_ = 0;
  std::size_t room_ = 0;
  // The permutation of the present block: the byte of an entry, and above it
  // the entry that comes next.
  std::unique_ptr<std::uint32_t[]> next_;
  std::unique_ptr<unsigned char[]> walked_;
  std::unique_ptr<unsigned char[]> block_;
  std::size_t size_ = 0;
  bool in_block_ = false;
  std::uint32_t expected_crc_ = 0;
  Crc crc_;

  // Bytes of the block that were taken, the last one, how often it came in a
  // row, and how often it is to be written yet.
  std::size_t taken_ = 0;
  unsigned char last_ = 0;
  int in_a_row_ = 0;
  std::size_t repeats_ = 0;
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
