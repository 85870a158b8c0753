#include <bzlib.h>
#include <gtest/gtest.h>
#include <plumbline/frontend/bzip2_block.h>

#include <cstdint>
#include <random>
#include <string>

namespace plumbline {
namespace {

constexpr std::size_t kHeadBits = 32;
constexpr std::size_t kLevelBytes = 100000;

// A stream of one block by libbz2, and the bit at which the block ends.
struct PackedBlock {
  std::string stream;
  std::uint64_t end = 0;
};

PackedBlock PackBlock(const std::string& bytes) {
  PackedBlock packed;
  unsigned size =
      static_cast<unsigned>(bytes.size() + bytes.size() / 50 + 1000);
  packed.stream.resize(size);
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(
                packed.stream.data(), &size, const_cast<char*>(bytes.data()),
                static_cast<unsigned>(bytes.size()), 1, 0, 0),
            BZ_OK);
  packed.stream.resize(size);
  // The last mark, the checksum and up to 7 bits follow.
  for (std::uint64_t bit = 8 * size - 87; bit <= 8 * size - 80; ++bit) {
    std::uint64_t mark = 0;
    for (std::uint64_t i = bit; i < bit + 48; ++i) {
      const auto byte = static_cast<unsigned char>(packed.stream[i / 8]);
      mark = mark << 1 | (byte >> (7 - i % 8) & 1);
    }
    if (mark == 0x177245385090) packed.end = bit;
  }
  EXPECT_GT(packed.end, 0u);
  return packed;
}

std::string Letters(std::size_t size, unsigned letters, unsigned seed) {
  std::mt19937 random(seed);
  std::string text(size, '\0');
  for (char& c : text) c = static_cast<char>(random() % letters);
  return text;
}

TEST(Bzip2BlockTest, DecodesABlockAnywhereInItsBytes) {
  Bzip2Block decoder;
  for (const std::string& sample :
       {std::string("a"), std::string(4, 'x'), std::string(99000, '\0'),
        Letters(60000, 3, 1), Letters(60000, 256, 2),
        Letters(300, 2, 3) + std::string(259, 'q')}) {
    const PackedBlock packed = PackBlock(sample);
    std::string output = "left over";
    ASSERT_TRUE(decoder.Decode(packed.stream, kHeadBits, packed.end,
                               kLevelBytes, &output));
    EXPECT_TRUE(output == sample) << sample.size();
    // Three bits later.
    std::string moved(packed.stream.size() + 1, '\0');
    for (std::size_t i = 0; i < packed.stream.size(); ++i) {
      const auto byte = static_cast<unsigned char>(packed.stream[i]);
      moved[i] = static_cast<char>(moved[i] | byte >> 3);
      moved[i + 1] = static_cast<char>(byte << 5);
    }
    ASSERT_TRUE(decoder.Decode(moved, kHeadBits + 3, packed.end + 3,
                               kLevelBytes, &output));
    EXPECT_TRUE(output == sample) << sample.size();
  }
}

TEST(Bzip2BlockTest, GivesUpOnWhatIsNoBlock) {
  Bzip2Block decoder;
  const std::string sample = Letters(5000, 9, 4);
  const PackedBlock packed = PackBlock(sample);
  std::string output;
  const auto decodes = [&](std::uint64_t begin, std::uint64_t end,
                           std::size_t capacity) {
    const bool is_one =
        decoder.Decode(packed.stream, begin, end, capacity, &output);
    EXPECT_EQ(output.empty(), !is_one);
    return is_one;
  };
  EXPECT_TRUE(decodes(kHeadBits, packed.end, kLevelBytes));
  EXPECT_FALSE(decodes(kHeadBits, packed.end - 1, kLevelBytes));
  EXPECT_FALSE(decodes(kHeadBits, packed.end + 1, kLevelBytes));
  EXPECT_FALSE(decodes(kHeadBits + 1, packed.end, kLevelBytes));
  EXPECT_FALSE(decodes(kHeadBits, 8 * packed.stream.size() + 1, kLevelBytes));
  EXPECT_FALSE(decodes(8 * packed.stream.size(), 0, kLevelBytes));
  // More than a block of its stream may have.
  EXPECT_FALSE(decodes(kHeadBits, packed.end, 4999));
}

// Bits that are wrong, and bytes that are missing, anywhere.
TEST(Bzip2BlockTest, TakesNoWrongBytes) {
  Bzip2Block decoder;
  std::mt19937 random(5);
  for (const std::string& sample :
       {Letters(700, 5, 6), Letters(50000, 4, 7), std::string(5000, 'a')}) {
    const PackedBlock packed = PackBlock(sample);
    for (int i = 0; i < 600; ++i) {
      std::string broken = packed.stream;
      for (unsigned k = 0; k < 1 + random() % 3; ++k) {
        const std::size_t bit =
            kHeadBits + random() % (i < 300 ? 400 : packed.end - kHeadBits);
        if (bit >= packed.end) continue;
        broken[bit / 8] = static_cast<char>(broken[bit / 8] ^ 128 >> bit % 8);
      }
      if (i % 5 == 0) broken.resize(random() % broken.size());
      std::string output;
      if (decoder.Decode(broken, kHeadBits, packed.end, kLevelBytes, &output)) {
        EXPECT_TRUE(output == sample) << i;
      }
    }
  }
}

}  // namespace
}  // namespace plumbline
