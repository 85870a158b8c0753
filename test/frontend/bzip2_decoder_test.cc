#include <bzlib.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/bzip2_decoder.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using State = Bzip2Decoder::State;

std::string PackWithLibbz2(const std::string& bytes, int level) {
  unsigned size =
      static_cast<unsigned>(bytes.size() + bytes.size() / 50 + 1000);
  std::string packed(size, '\0');
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(
                packed.data(), &size, const_cast<char*>(bytes.data()),
                static_cast<unsigned>(bytes.size()), level, 0, 0),
            BZ_OK);
  packed.resize(size);
  return packed;
}

struct Unpacked {
  std::string bytes;
  State state = State::kGoingOn;
  std::uint64_t consumed = 0;
};

Unpacked UnpackWithLibbz2(const std::string& packed) {
  Unpacked result;
  bz_stream stream = {};
  EXPECT_EQ(BZ2_bzDecompressInit(&stream, 0, 0), BZ_OK);
  stream.next_in = const_cast<char*>(packed.data());
  stream.avail_in = static_cast<unsigned>(packed.size());
  std::vector<char> output(1 << 16);
  while (result.state == State::kGoingOn) {
    stream.next_out = output.data();
    stream.avail_out = static_cast<unsigned>(output.size());
    const int status = BZ2_bzDecompress(&stream);
    const std::size_t count = output.size() - stream.avail_out;
    result.bytes.append(output.data(), count);
    if (status == BZ_STREAM_END) {
      result.state = State::kEnd;
    } else if (status != BZ_OK) {
      result.state = State::kCorrupt;
    } else if (count == 0 && stream.avail_in == 0) {
      result.state = State::kBreaksOff;
    }
  }
  result.consumed = packed.size() - stream.avail_in;
  BZ2_bzDecompressEnd(&stream);
  return result;
}

// Gives the stored bytes in pieces of `piece` bytes, each in a place of its
// own, and takes at most `capacity` bytes at once.
Unpacked Unpack(const std::string& packed, std::size_t piece = 1 << 18,
                std::size_t capacity = 1 << 16) {
  Unpacked result;
  std::size_t given = 0;
  std::string held;
  Bzip2Decoder decoder([&] {
    held = packed.substr(given, piece);
    given += held.size();
    return std::string_view(held);
  });
  std::vector<char> output(capacity);
  while (decoder.state() == State::kGoingOn) {
    const std::size_t count = decoder.Unpack(output.data(), output.size());
    result.bytes.append(output.data(), count);
  }
  result.state = decoder.state();
  result.consumed = decoder.consumed();
  return result;
}

std::string RandomText(std::size_t size, int letters, unsigned seed) {
  std::mt19937 random(seed);
  std::string text(size, '\0');
  for (char& c : text) {
    c = static_cast<char>(random() % static_cast<unsigned>(letters));
  }
  return text;
}

std::vector<std::string> Samples() {
  std::vector<std::string> samples = {"", "a", "aaaa", "abcabcabc"};
  // Runs around the lengths at which they are packed.
  std::string runs;
  for (int length = 1; length < 600; ++length) {
    runs += std::string(static_cast<std::size_t>(length),
                        static_cast<char>(length % 3));
  }
  samples.push_back(runs);
  samples.push_back(std::string(3000000, '\0'));
  // Data that repeat themselves: the permutation has many cycles.
  std::string periodic;
  while (periodic.size() < 150000) periodic += "range 1.25 ";
  samples.push_back(periodic);
  samples.push_back(RandomText(5000, 2, 1));
  // Incompressible, with all byte values, in several blocks.
  samples.push_back(RandomText(250000, 256, 2));
  // Symbols of very different frequency have long codes.
  std::mt19937 random(3);
  std::string skewed(200000, '\0');
  for (char& c : skewed) {
    int letter = 0;
    while (letter < 200 && random() % 10 < 6) ++letter;
    c = static_cast<char>(letter);
  }
  samples.push_back(skewed);
  return samples;
}

TEST(Bzip2DecoderTest, UnpacksWhatLibbz2Packs) {
  for (const std::string& sample : Samples()) {
    for (const int level : {1, 9}) {
      const std::string packed = PackWithLibbz2(sample, level);
      const Unpacked whole = Unpack(packed + "more");
      EXPECT_EQ(whole.state, State::kEnd);
      EXPECT_TRUE(whole.bytes == sample) << sample.size();
      EXPECT_EQ(whole.consumed, packed.size());
    }
  }
}

TEST(Bzip2DecoderTest, PiecesMayBeOfAnySize) {
  const std::string sample =
      RandomText(3000, 7, 4) + std::string(1000, 'x') + RandomText(50, 3, 5);
  const std::string packed = PackWithLibbz2(sample, 1);
  for (const std::size_t piece : {1, 3, 8, 1000}) {
    for (const std::size_t capacity : {1, 5, 100}) {
      const Unpacked unpacked = Unpack(packed, piece, capacity);
      EXPECT_EQ(unpacked.state, State::kEnd);
      EXPECT_TRUE(unpacked.bytes == sample) << piece << " " << capacity;
    }
  }
}

// Whoever writes to a pipe may wait for an answer.
TEST(Bzip2DecoderTest, AsksForNoMoreThanItNeeds) {
  const std::string packed = PackWithLibbz2("text", 9);
  std::size_t given = 0;
  Bzip2Decoder decoder([&] {
    EXPECT_LT(given, packed.size());
    return std::string_view(packed).substr(given++, 1);
  });
  char output[16];
  EXPECT_EQ(decoder.Unpack(output, sizeof(output)), 4u);
  EXPECT_EQ(decoder.state(), State::kEnd);
}

TEST(Bzip2DecoderTest, StreamsFollowOneAnother) {
  // The first has smaller blocks than the second.
  const std::string large = RandomText(300000, 9, 6);
  std::string packed =
      PackWithLibbz2("a", 1) + PackWithLibbz2("", 1) + PackWithLibbz2(large, 9);
  for (const bool has_rest : {false, true}) {
    if (has_rest) packed += "?";
    std::string_view rest = packed;
    Bzip2Decoder decoder([&rest] { return std::exchange(rest, {}); });
    std::string bytes(large.size() + 2, '\0');
    std::size_t count = 0;
    int streams = 0;
    Bzip2Decoder::Next next = Bzip2Decoder::Next::kStream;
    while (next == Bzip2Decoder::Next::kStream) {
      while (decoder.state() == State::kGoingOn) {
        count += decoder.Unpack(bytes.data() + count, bytes.size() - count);
      }
      ASSERT_EQ(decoder.state(), State::kEnd);
      ++streams;
      next = decoder.NextStream();
    }
    EXPECT_EQ(streams, 3);
    EXPECT_EQ(next, has_rest ? Bzip2Decoder::Next::kSomethingElse
                             : Bzip2Decoder::Next::kNothing);
    bytes.resize(count);
    EXPECT_TRUE(bytes == "a" + large);
  }
}

// Cut at every byte: libbz2 tells what is there before.
TEST(Bzip2DecoderTest, DataThatBreakOffGiveTheBlocksBefore) {
  const std::string packed = PackWithLibbz2(RandomText(101000, 2, 7), 1);
  const Unpacked whole = Unpack(packed);
  for (std::size_t size = 0; size < packed.size();
       size += size < 100 || size + 30 > packed.size() ? 1 : 499) {
    const Unpacked cut = Unpack(packed.substr(0, size));
    const Unpacked expected = UnpackWithLibbz2(packed.substr(0, size));
    ASSERT_EQ(cut.state, State::kBreaksOff) << size;
    ASSERT_TRUE(cut.bytes == expected.bytes)
        << size << ": " << cut.bytes.size() << ", expected "
        << expected.bytes.size();
    ASSERT_EQ(cut.consumed, size);
  }
}

// A block that does not end, as in a file that is zeros from some place on: not
// all of the rest is asked for.
TEST(Bzip2DecoderTest, NoMoreIsAskedForThanABlockMayHave) {
  std::string packed = PackWithLibbz2(RandomText(400000, 200, 12), 1);
  packed.resize(packed.size() / 2);
  constexpr std::size_t kPiece = std::size_t{1} << 18;
  const std::string zeros(kPiece, '\0');
  std::size_t asked = 0;
  Bzip2Decoder decoder(
      [&] { return std::string_view(asked++ == 0 ? packed : zeros); });
  std::vector<char> output(1 << 16);
  while (decoder.state() == State::kGoingOn) {
    decoder.Unpack(output.data(), output.size());
    ASSERT_LT(asked, 100u);
  }
  EXPECT_EQ(decoder.state(), State::kCorrupt);
  EXPECT_LE(asked * kPiece, std::size_t{6} << 20);
}

// Each bit of the heads and codes wrong in turn, and bits anywhere: what comes
// out is what comes out of libbz2 for the whole, with any number of threads.
TEST(Bzip2DecoderTest, WrongBitsAreFound) {
  std::mt19937 random(8);
  for (const std::string& sample :
       {RandomText(600, 5, 9), RandomText(301000, 3, 10),
        std::string(5000, 'a') + "bcd"}) {
    const std::string packed = PackWithLibbz2(sample, 1);
    for (std::size_t i = 0; i < (sample.size() > 10000 ? 300u : 2200u); ++i) {
      std::size_t bit = i;
      if (bit >= std::min<std::size_t>(600, 8 * packed.size())) {
        bit = random() % (8 * packed.size());
      }
      std::string broken = packed;
      broken[bit / 8] = static_cast<char>(broken[bit / 8] ^ 128 >> bit % 8);
      const ThreadsScope threads(1 + static_cast<int>(i % 3));
      const Unpacked unpacked = Unpack(broken);
      const Unpacked expected = UnpackWithLibbz2(broken);
      ASSERT_NE(unpacked.state, State::kGoingOn);
      ASSERT_EQ(unpacked.state == State::kEnd, expected.state == State::kEnd)
          << bit;
      // How much libbz2 gives of a wrong block depends on the room there is.
      const std::size_t common =
          std::min(unpacked.bytes.size(), expected.bytes.size());
      ASSERT_TRUE(
          unpacked.bytes.compare(0, common, expected.bytes, 0, common) == 0)
          << bit;
      if (expected.state == State::kEnd) {
        ASSERT_EQ(unpacked.bytes.size(), expected.bytes.size()) << bit;
      }
    }
  }
}

TEST(Bzip2DecoderTest, SameWithAnyNumberOfThreads) {
  const std::string sample = RandomText(1200000, 200, 11);
  const std::string packed = PackWithLibbz2(sample, 1);
  for (const int threads : {1, 2, 3, 20}) {
    const ThreadsScope scope(threads);
    const Unpacked unpacked = Unpack(packed + "?");
    EXPECT_EQ(unpacked.state, State::kEnd);
    EXPECT_TRUE(unpacked.bytes == sample) << threads;
    EXPECT_EQ(unpacked.consumed, packed.size());
  }
}

// A text of bytes whose table in the head of a block is what blocks begin with.
TEST(Bzip2DecoderTest, BlocksMayHoldTheMarkOfABlock) {
  std::string letters;
  const unsigned groups[] = {0x3141, 0x5926, 0x5359};
  for (int g = 0; g < 3; ++g) {
    for (int i = 0; i < 16; ++i) {
      if ((groups[g] >> (15 - i) & 1) != 0) {
        letters.push_back(static_cast<char>(64 + 16 * g + i));
      }
    }
  }
  std::mt19937 random(12);
  std::string sample(250000, '\0');
  for (char& c : sample) c = letters[random() % letters.size()];
  for (const int threads : {1, 2}) {
    const ThreadsScope scope(threads);
    const Unpacked unpacked = Unpack(PackWithLibbz2(sample, 1));
    EXPECT_EQ(unpacked.state, State::kEnd);
    EXPECT_TRUE(unpacked.bytes == sample);
  }
}

TEST(Bzip2DecoderTest, OtherDataAreNone) {
  EXPECT_EQ(Unpack("").state, State::kBreaksOff);
  EXPECT_EQ(Unpack("BZh").state, State::kBreaksOff);
  EXPECT_EQ(Unpack("BZh0 and so on").state, State::kCorrupt);
  EXPECT_EQ(Unpack("something else").state, State::kCorrupt);
  EXPECT_EQ(Unpack("BZh9 and no block").state, State::kCorrupt);
}

}  // namespace
}  // namespace plumbline
