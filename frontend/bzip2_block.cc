#include <plumbline/frontend/bzip2_block.h>

#include <algorithm>
#include <cstring>

namespace plumbline {
namespace {

constexpr std::uint64_t kMarkBits = 48;
constexpr int kLongestCode = 20;
// Codes of up to so many bits are looked up at once.
constexpr int kTableBits = 10;
constexpr int kMaxSymbols = 258;
constexpr std::size_t kMaxCodes = 6;
constexpr int kSymbolsPerSelector = 50;
// What follows four equal bytes says how many more of them there are.
constexpr int kRun = 4;
constexpr std::size_t kLongestRun = kRun + 255;
// Parts of the permutation that are walked at once, and into how many it is cut
// so that all walkers come to an end at about the same time.
constexpr std::size_t kWalkers = 8;
constexpr std::size_t kMaxParts = 256;
constexpr std::size_t kLeastPart = 256;
constexpr std::uint32_t kPartBegins = std::uint32_t{1} << 31;

// CRC-32, highest bit first, of eight bytes at a time: the tables are those of
// a byte with 0 to 7 zeros behind it.
std::uint32_t CrcOf(std::string_view text) {
  using TableArray = std::array<std::array<std::uint32_t, 256>, 8>;
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
  std::uint32_t value = ~std::uint32_t{0};
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  std::size_t count = text.size();
  for (; count >= 8; count -= 8, bytes += 8) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::uint32_t byte = (value >> (24 - 8 * i) & 255) ^ bytes[i];
      sum ^= tables[7 - i][byte] ^ tables[3 - i][bytes[4 + i]];
    }
    value = sum;
  }
  for (; count > 0; --count, ++bytes) {
    value = value << 8 ^ tables[0][value >> 24 ^ *bytes];
  }
  return ~value;
}

}  // namespace

// Bytes as bits, the highest of each byte first; zeros behind their end.
class Bzip2Block::Bits {
 public:
  // From the bit `begin` on.
  Bits(std::string_view bytes, std::uint64_t begin)
      : bytes_(bytes), at_(static_cast<std::size_t>(begin / 8)) {
    Refill();
    Skip(static_cast<int>(begin % 8));
  }

  // The next `count` bits, 1 to 32, without passing over them.
  std::uint32_t Peek(int count) {
    if (available_ < count) Refill();
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

  // The bit that comes next, counted from the first byte's highest one.
  std::uint64_t position() const {
    return 8 * (at_ + made_up_) - static_cast<std::uint64_t>(available_);
  }

 private:
  void Refill() {
    while (available_ <= 56) {
      if (at_ < bytes_.size()) {
        bits_ |= std::uint64_t{static_cast<unsigned char>(bytes_[at_++])}
                 << (56 - available_);
      } else {
        ++made_up_;
      }
      available_ += 8;
    }
  }

  std::string_view bytes_;
  // The byte that comes next, and how many zeros came behind the last one.
  std::size_t at_ = 0;
  std::uint64_t made_up_ = 0;
  // The next bits, the first one highest, and how many they are.
  std::uint64_t bits_ = 0;
  int available_ = 0;
};

// A canonical Huffman code.
class Bzip2Block::Code {
 public:
  explicit Code(const std::vector<int>& lengths) {
    std::array<int, kLongestCode + 1> counts = {};
    for (const int length : lengths) ++counts[static_cast<std::size_t>(length)];
    std::int64_t code = 0;
    int place = 0;
    for (int length = 1; length <= kLongestCode; ++length) {
      const auto at = static_cast<std::size_t>(length);
      const int first_place = place;
      base_[at] = code - place;
      for (std::size_t s = 0; s < lengths.size(); ++s) {
        if (lengths[s] != length) continue;
        symbols_[static_cast<std::size_t>(place++)] = static_cast<int>(s);
      }
      last_[at] = code + counts[at] - 1;
      FillTable(length, code, first_place, counts[at]);
      code = 2 * (code + counts[at]);
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
      const auto at = static_cast<std::size_t>(length);
      if (code > last_[at]) continue;
      const std::int64_t place = code - base_[at];
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
  void FillTable(int length, std::int64_t code, int first_place, int count) {
    if (length > kTableBits) return;
    const int spare = kTableBits - length;
    for (int i = 0; i < count; ++i) {
      const std::int64_t begin = (code + i) << spare;
      if (begin >= std::int64_t{1} << kTableBits) return;
      const int symbol = symbols_[static_cast<std::size_t>(first_place + i)];
      std::fill_n(table_.begin() + begin, std::size_t{1} << spare,
                  static_cast<std::uint16_t>(symbol << 5 | length));
    }
  }

  // By the next bits: symbol << 5 | length, 0 for codes that are longer.
  std::array<std::uint16_t, std::size_t{1} << kTableBits> table_ = {};
  // By length: the last code, and the difference of code and place.
  std::array<std::int64_t, kLongestCode + 1> last_ = {};
  std::array<std::int64_t, kLongestCode + 1> base_ = {};
  // In the order of their codes.
  std::array<int, kMaxSymbols> symbols_ = {};
  int num_symbols_ = 0;
};

// The bytes of a block, those used last first. Most symbols ask for one of the
// first eight, which are held in a number, the first of them lowest.
class Bzip2Block::RecentBytes {
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

// Walks a permutation in parts, several at a time.
class Bzip2Block::Walkers {
 public:
  // A part of the way around, from the entry `begin` to where the part `next`
  // begins.
  struct Part {
    std::uint32_t begin = 0;
    const unsigned char* bytes = nullptr;
    std::size_t length = 0;
    std::size_t next = 0;
  };

  // `next`: the permutation, of `size` entries. The first part begins at
  // `begin`.
  Walkers(std::uint32_t* next, std::size_t size, std::uint32_t begin)
      : next_(next) {
    const std::size_t count =
        std::clamp(size / kLeastPart, std::size_t{1}, kMaxParts);
    BeginPart(begin);
    for (std::size_t i = 1; i < count; ++i) {
      BeginPart(static_cast<std::uint32_t>(i * size / count));
    }
    std::sort(begins_.begin(), begins_.end());
  }

  // Walks all parts. Their bytes lie in `output`, which has `room` bytes, and
  // at least as many as there are entries, for each walker: no entry is in two
  // parts.
  const std::vector<Part>& Walk(unsigned char* output, std::size_t room) {
    std::size_t active = 0;
    while (active < kWalkers && started_ < parts_.size()) {
      walkers_[active] = Start(output + active * room);
      ++active;
    }
    while (active > 0) {
      for (std::size_t w = 0; w < active; ++w) {
        Walker& walker = walkers_[w];
        *walker.output++ = static_cast<unsigned char>(walker.entry);
        const std::uint32_t at = walker.entry >> 8;
        walker.entry = next_[at];
        if ((walker.entry & kPartBegins) == 0) continue;
        End(walker, at);
        if (started_ < parts_.size()) {
          walker = Start(walker.output);
        } else {
          walkers_[w] = walkers_[--active];
        }
      }
    }
    return parts_;
  }

 private:
  struct Walker {
    std::uint32_t entry = 0;
    unsigned char* output = nullptr;
    std::size_t part = 0;
  };

  void BeginPart(std::uint32_t at) {
    if ((next_[at] & kPartBegins) != 0) return;
    next_[at] |= kPartBegins;
    begins_.emplace_back(at, parts_.size());
    parts_.emplace_back();
    parts_.back().begin = at;
  }

  Walker Start(unsigned char* output) {
    Part& part = parts_[started_];
    part.bytes = output;
    return {next_[part.begin] & ~kPartBegins, output, started_++};
  }

  void End(const Walker& walker, std::uint32_t at) {
    Part& part = parts_[walker.part];
    part.length = static_cast<std::size_t>(walker.output - part.bytes);
    part.next = std::lower_bound(begins_.begin(), begins_.end(),
                                 std::make_pair(at, std::size_t{0}))
                    ->second;
  }

  std::uint32_t* next_;
  std::vector<Part> parts_;
  // Where parts begin, ascending, and which.
  std::vector<std::pair<std::uint32_t, std::size_t>> begins_;
  std::array<Walker, kWalkers> walkers_;
  std::size_t started_ = 0;
};

bool Bzip2Block::Decode(std::string_view bytes, std::uint64_t begin,
                        std::uint64_t end, std::size_t capacity,
                        std::string* output) {
  output->clear();
  if (begin > end || end > 8 * std::uint64_t{bytes.size()}) return false;
  if (capacity > room_) {
    room_ = capacity;
    // What is not used is never touched.
    next_.reset(new std::uint32_t[room_]);
    walked_.reset(new unsigned char[kWalkers * room_]);
    block_.reset(new unsigned char[room_]);
  }
  Bits input(bytes, begin + kMarkBits);
  const std::uint32_t expected_crc = input.Take(32);
  const bool is_randomized = input.Take(1) != 0;
  const std::uint32_t origin = input.Take(24);
  if (is_randomized || !ReadSymbols(capacity, &input) ||
      input.position() != end || origin >= size_) {
    return false;
  }
  Untransform(origin);
  if (ExpandRuns(output) && CrcOf(*output) == expected_crc) return true;
  output->clear();
  return false;
}

bool Bzip2Block::ReadSymbols(std::size_t capacity, Bits* input) {
  std::array<unsigned char, 256> used = {};
  std::size_t num_bytes = 0;
  const std::uint32_t ranges = input->Take(16);
  for (unsigned range = 0; range < 16; ++range) {
    if ((ranges >> (15 - range) & 1) == 0) continue;
    const std::uint32_t in_range = input->Take(16);
    for (unsigned i = 0; i < 16; ++i) {
      if ((in_range >> (15 - i) & 1) == 0) continue;
      used[num_bytes++] = static_cast<unsigned char>(16 * range + i);
    }
  }
  std::size_t num_codes = 0;
  if (num_bytes == 0 || !ReadSelectors(input, &num_codes)) return false;
  // Two for runs, and one that ends the block.
  const int num_symbols = static_cast<int>(num_bytes) + 2;
  std::vector<Code> codes;
  std::vector<int> lengths(static_cast<std::size_t>(num_symbols));
  for (std::size_t c = 0; c < num_codes; ++c) {
    int length = static_cast<int>(input->Take(5));
    for (int& symbol_length : lengths) {
      while (true) {
        if (length < 1 || length > kLongestCode) return false;
        if (input->Take(1) == 0) break;
        length += input->Take(1) == 0 ? 1 : -1;
      }
      symbol_length = length;
    }
    codes.emplace_back(lengths);
  }
  RecentBytes recent(used);
  std::uint32_t* const output = next_.get();
  std::size_t size = 0;
  std::size_t run = 0;
  std::size_t run_step = 1;
  for (const unsigned char selector : selectors_) {
    const Code& code = codes[selector];
    for (int i = 0; i < kSymbolsPerSelector; ++i) {
      int symbol = 0;
      if (!code.Take(input, &symbol)) return false;
      if (symbol < 2) {
        // Digits 1 and 2 of a number in base 2, the lowest first.
        run += run_step << symbol;
        run_step *= 2;
        if (run > capacity - size) return false;
        continue;
      }
      if (run > 0) {
        std::fill_n(output + size, run, recent.front());
        size += run;
        run = 0;
        run_step = 1;
      }
      if (symbol == num_symbols - 1) {
        size_ = size;
        return true;
      }
      if (size == capacity) return false;
      output[size++] = recent.Use(static_cast<std::size_t>(symbol) - 1);
    }
  }
  return false;
}

bool Bzip2Block::ReadSelectors(Bits* input, std::size_t* num_codes) {
  *num_codes = input->Take(3);
  const std::uint32_t count = input->Take(15);
  if (*num_codes < 2 || *num_codes > kMaxCodes || count == 0) return false;
  std::array<unsigned char, kMaxCodes> order = {0, 1, 2, 3, 4, 5};
  selectors_.resize(count);
  for (unsigned char& selector : selectors_) {
    std::size_t place = 0;
    while (input->Take(1) != 0) {
      if (++place >= *num_codes) return false;
    }
    std::rotate(order.begin(),
                order.begin() + static_cast<std::ptrdiff_t>(place),
                order.begin() + static_cast<std::ptrdiff_t>(place) + 1);
    selector = order[0];
  }
  return true;
}

void Bzip2Block::Untransform(std::uint32_t origin) {
  std::uint32_t* const next = next_.get();
  std::array<std::uint32_t, 256> places = {};
  for (std::size_t i = 0; i < size_; ++i) ++places[next[i] & 255];
  std::uint32_t sum = 0;
  for (std::uint32_t& place : places) sum += std::exchange(place, sum);
  for (std::size_t i = 0; i < size_; ++i) {
    next[places[next[i] & 255]++] |= static_cast<std::uint32_t>(i) << 8;
  }
  Walkers walkers(next, size_, next[origin] >> 8);
  const std::vector<Walkers::Part>& parts = walkers.Walk(walked_.get(), room_);
  // Data that repeat themselves go around a part of the permutation several
  // times.
  std::size_t count = 0;
  std::size_t at = 0;
  while (count < size_) {
    const Walkers::Part& part = parts[at];
    const std::size_t length = std::min(part.length, size_ - count);
    std::memcpy(block_.get() + count, part.bytes, length);
    count += length;
    at = part.next;
  }
}

bool Bzip2Block::ExpandRuns(std::string* output) const {
  std::size_t count = 0;
  std::size_t taken = 0;
  int in_a_row = 0;
  unsigned char last = 0;
  while (taken < size_) {
    // As much as the rest has without runs, and room for one.
    if (output->size() < count + (size_ - taken) + kLongestRun) {
      output->resize(count + 2 * (size_ - taken) + 16 * kLongestRun);
    }
    char* const bytes = output->data();
    while (taken < size_ && in_a_row < kRun) {
      const unsigned char byte = block_[taken++];
      in_a_row = byte == last && in_a_row > 0 ? in_a_row + 1 : 1;
      last = byte;
      bytes[count++] = static_cast<char>(byte);
    }
    if (in_a_row < kRun) break;
    if (taken == size_) return false;
    const std::size_t repeats = block_[taken++];
    std::memset(bytes + count, last, repeats);
    count += repeats;
    in_a_row = 0;
  }
  output->resize(count);
  return true;
}

}  // namespace plumbline
