#include <bzlib.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/input_stream.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string Gzip(const std::string& text) {
  z_stream stream = {};
  EXPECT_EQ(
      deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY),
      Z_OK);
  std::string packed(deflateBound(&stream, text.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

std::string Bzip2(const std::string& text) {
  unsigned size = static_cast<unsigned>(text.size() + text.size() / 50 + 1000);
  std::string packed(size, '\0');
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(
                packed.data(), &size, const_cast<char*>(text.data()),
                static_cast<unsigned>(text.size()), 1, 0, 0),
            BZ_OK);
  packed.resize(size);
  return packed;
}

std::vector<std::string> Lines(InputStream* input) {
  std::vector<std::string> lines;
  std::string_view line;
  while (input->ReadLine(&line)) lines.emplace_back(line);
  return lines;
}

std::vector<std::string> Lines(const std::string& contents) {
  InputStream input("test", contents);
  return Lines(&input);
}

// Text that does not compress to nothing: 20000 numbered lines.
std::string LongText() {
  std::string text;
  unsigned state = 12345;
  for (int i = 0; i < 20000; ++i) {
    state = state * 1664525u + 1013904223u;
    text += std::to_string(i) + " " + std::to_string(state) + "\n";
  }
  return text;
}

TEST(InputStreamTest, SplitsLines) {
  EXPECT_THAT(Lines("a\nb c\n\nd\n"), ElementsAre("a", "b c", "", "d"));
}

TEST(InputStreamTest, LastLineMayLackItsEnd) {
  EXPECT_THAT(Lines("a\nb"), ElementsAre("a", "b"));
  EXPECT_THAT(Lines("\n"), ElementsAre(""));
  EXPECT_THAT(Lines(""), IsEmpty());
}

TEST(InputStreamTest, CarriageReturnsGo) {
  EXPECT_THAT(Lines("a\r\nb\r\n\r\nc\rd\r\n"),
              ElementsAre("a", "b", "", "c\rd"));
}

TEST(InputStreamTest, NumbersLines) {
  InputStream input("test", "a\n\nb");
  std::string_view line;
  EXPECT_EQ(input.line_number(), 0);
  input.ReadLine(&line);
  EXPECT_EQ(input.line_number(), 1);
  input.ReadLine(&line);
  input.ReadLine(&line);
  EXPECT_EQ(line, "b");
  EXPECT_EQ(input.line_number(), 3);
  EXPECT_FALSE(input.ReadLine(&line));
  EXPECT_EQ(input.line_number(), 3);
}

TEST(InputStreamTest, UnpacksByContent) {
  for (const std::string& packed : {Gzip("a\nb\n"), Bzip2("a\nb\n")}) {
    InputStream input("test", packed);
    EXPECT_THAT(Lines(&input), ElementsAre("a", "b"));
    EXPECT_EQ(input.damage(), "");
  }
}

TEST(InputStreamTest, ReadsSeveralMembers) {
  for (const std::string& packed :
       {Gzip("a\nb") + Gzip("") + Gzip("c\nd\n"),
        Bzip2("a\nb") + Bzip2("") + Bzip2("c\nd\n")}) {
    InputStream input("test", packed);
    EXPECT_THAT(Lines(&input), ElementsAre("a", "bc", "d"));
    EXPECT_EQ(input.damage(), "");
  }
}

TEST(InputStreamTest, LongInputsComeThroughWhole) {
  const std::string text = LongText();
  for (const std::string& packed : {text, Gzip(text), Bzip2(text)}) {
    InputStream input("test", packed);
    EXPECT_TRUE(input.ReadRest() == text);
    EXPECT_EQ(input.damage(), "");
  }
}

TEST(InputStreamTest, HalfAFileGivesItsFirstPart) {
  const std::string text = LongText();
  const std::string gzip = Gzip(text);
  InputStream half_gzip("test", gzip.substr(0, gzip.size() / 2));
  const std::string from_gzip = half_gzip.ReadRest();
  EXPECT_GT(from_gzip.size(), text.size() / 3);
  EXPECT_TRUE(from_gzip == text.substr(0, from_gzip.size()));
  EXPECT_THAT(half_gzip.damage(), HasSubstr("gzip data breaks off"));

  // bzip2 gives whole blocks of 100 kB only.
  const std::string bzip2 = Bzip2(text);
  InputStream half_bzip2("test", bzip2.substr(0, bzip2.size() * 2 / 3));
  const std::string from_bzip2 = half_bzip2.ReadRest();
  EXPECT_GE(from_bzip2.size(), 99000u);
  EXPECT_TRUE(from_bzip2 == text.substr(0, from_bzip2.size()));
  EXPECT_THAT(half_bzip2.damage(), HasSubstr("bzip2 data breaks off"));
}

TEST(InputStreamTest, CorruptDataIsReported) {
  const std::string text = LongText();
  std::string gzip = Gzip(text);
  gzip[gzip.size() - 6] ^= 1;  // in the checksum
  InputStream bad_checksum("test", gzip);
  EXPECT_TRUE(bad_checksum.ReadRest() == text);
  EXPECT_THAT(bad_checksum.damage(), HasSubstr("gzip data is corrupt"));

  std::string bzip2 = Bzip2(text);
  bzip2[bzip2.size() / 2] ^= 0x55;
  InputStream bad_block("test", bzip2);
  const std::string rest = bad_block.ReadRest();
  EXPECT_LT(rest.size(), text.size());
  // The block before the corrupt one came through.
  EXPECT_TRUE(rest.substr(0, 99000) == text.substr(0, 99000));
  EXPECT_THAT(bad_block.damage(), HasSubstr("bzip2 data is corrupt"));
}

TEST(InputStreamTest, WhatFollowsCompressedDataIsReported) {
  InputStream garbage("test", Gzip("a\n") + "garbage");
  EXPECT_THAT(Lines(&garbage), ElementsAre("a"));
  EXPECT_THAT(garbage.damage(), HasSubstr("followed by something else"));
  // Zeros are padding.
  InputStream padded("test", Gzip("a\n") + std::string(512, '\0'));
  EXPECT_THAT(Lines(&padded), ElementsAre("a"));
  EXPECT_EQ(padded.damage(), "");
}

TEST(InputStreamTest, PeekConsumesNothing) {
  InputStream input("test", Gzip("first\nsecond\n"));
  EXPECT_EQ(input.Peek(3), "fir");
  EXPECT_EQ(input.Peek(1000), "first\nsecond\n");
  std::string_view line;
  input.ReadLine(&line);
  EXPECT_EQ(line, "first");
  EXPECT_EQ(input.Peek(6), "second");
  EXPECT_EQ(input.ReadRest(), "second\n");
  EXPECT_EQ(input.Peek(1), "");
}

TEST(InputStreamTest, LinesLongerThanABufferComeWhole) {
  const std::string line(1000000, 'x');
  EXPECT_THAT(Lines("a\n" + line + "\nb"), ElementsAre("a", line, "b"));
}

TEST(InputStreamTest, EndlessLinesAreRefused) {
  const std::string text =
      "a\n" + std::string(InputStream::kMaximumLineLength + 300000, 'x');
  InputStream input("zeros", Gzip(text));
  std::string_view line;
  input.ReadLine(&line);
  try {
    input.ReadLine(&line);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("zeros:2: line is longer"));
  }
}

TEST(InputStreamTest, ReadsFiles) {
  const std::string path = ::testing::TempDir() + "input_stream_test.txt";
  std::ofstream(path) << "a\nb\n";
  InputStream input(path);
  EXPECT_EQ(input.name(), path);
  EXPECT_THAT(Lines(&input), ElementsAre("a", "b"));
}

TEST(InputStreamTest, MissingFilesAndDirectoriesAreRefused) {
  try {
    InputStream input("no/such/file");
    FAIL() << "opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("no/such/file: cannot be opened: No such file"));
  }
  try {
    InputStream input(::testing::TempDir());
    FAIL() << "opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("is a directory: expected a file"));
  }
}

TEST(InputStreamTest, AByteOrderMarkIsPassedOver) {
  const std::string text =
      "\xEF\xBB\xBF"
      "a\n\xEF\xBB\xBF"
      "b\n";
  for (const std::string& stored : {text, Gzip(text), Bzip2(text)}) {
    EXPECT_THAT(Lines(stored), ElementsAre("a",
                                           "\xEF\xBB\xBF"
                                           "b"));
    InputStream input("test", stored);
    EXPECT_EQ(input.Peek(2), "a\n");
    EXPECT_EQ(input.ReadRest(), text.substr(3));
  }
  EXPECT_THAT(Lines("\xEF\xBB\xBF"), IsEmpty());
  EXPECT_THAT(Lines("\xEF\xBB"), ElementsAre("\xEF\xBB"));
}

// What has no end, or is unpacked to far more than it was.
TEST(InputStreamTest, LimitsOfWhatIsReadAtOnce) {
  const auto message = [](InputStream* input, std::size_t limit) {
    try {
      input->ReadRest(limit);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  InputStream zeros("/dev/zero");
  EXPECT_THAT(message(&zeros, std::size_t{1} << 30),
              HasSubstr("/dev/zero: holds bytes that are zero"));
  const std::string bomb = Gzip(std::string(10 << 20, 'x'));
  ASSERT_LT(bomb.size(), 100000u);
  InputStream packed("bomb", bomb);
  EXPECT_EQ(message(&packed, 4 << 20),
            "bomb: holds more than 4 MiB: expected less text");
  InputStream enough("bomb", bomb);
  EXPECT_EQ(message(&enough, 10 << 20), "");
}

// Opening one waits for its writer; reading before there is one finds an end.
TEST(InputStreamTest, NamedPipes) {
  const std::string path = ::testing::TempDir() + "input_stream_pipe";
  std::remove(path.c_str());
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  int asked = 0;
  InputStream stopped(path, [&] { return ++asked > 2; });
  EXPECT_THAT(Lines(&stopped), IsEmpty());
  for (const bool may_stop : {false, true}) {
    std::thread writer([&] {
      usleep(100000);
      std::ofstream(path) << "a\nb\n";
    });
    std::function<bool()> stop;
    if (may_stop) stop = [] { return false; };
    InputStream input(path, stop);
    EXPECT_THAT(Lines(&input), ElementsAre("a", "b"));
    writer.join();
  }
  std::remove(path.c_str());
}

TEST(InputStreamTest, TellsHowFarItIs) {
  // Several chunks of the buffer, packed by about five.
  std::string text;
  for (int i = 0; i < 200000; ++i) text += std::to_string(i * 7919) + "\n";
  const std::string packed = Gzip(text);
  const std::string path = ::testing::TempDir() + "/input_stream_progress.gz";
  std::ofstream(path, std::ios::binary) << packed;
  InputStream input(path);
  std::int64_t last = 0;
  int calls = 0;
  input.SetProgress([&](std::int64_t done, std::int64_t size) {
    EXPECT_EQ(size, static_cast<std::int64_t>(packed.size()));
    EXPECT_GE(done, last);
    last = done;
    ++calls;
  });
  // Not EXPECT_EQ: what differs would be looked for line by line.
  EXPECT_TRUE(input.ReadRest() == text);
  EXPECT_EQ(last, static_cast<std::int64_t>(packed.size()));
  EXPECT_GT(calls, 3);
  std::remove(path.c_str());
}

// All that is to be had of a file: its bytes and what is wrong with them.
std::pair<std::string, std::string> ContentsOfFile(const std::string& path) {
  InputStream input(path);
  std::string bytes = input.ReadRest();
  return {std::move(bytes), input.damage()};
}

// A thread that unpacks ahead changes nothing: whole, cut, wrong and empty
// files are the same to the byte.
TEST(InputStreamTest, TheSameWithAThreadThatReadsAhead) {
  std::string text;
  for (int i = 0; i < 16; ++i) text += LongText();
  // More than is read ahead.
  ASSERT_GT(text.size(), std::size_t{1} << 22);
  const std::string path = ::testing::TempDir() + "input_stream_ahead";
  for (const std::string& stored :
       {text, Gzip(text), Bzip2(text), std::string(), std::string("a")}) {
    for (const double part : {1.0, 0.7}) {
      for (const bool is_wrong : {false, true}) {
        std::string bytes =
            stored.substr(0, static_cast<std::size_t>(
                                 part * static_cast<double>(stored.size())));
        if (is_wrong && bytes.size() > 100) bytes[2 * bytes.size() / 3] ^= 16;
        std::ofstream(path, std::ios::binary) << bytes;
        const auto alone = ContentsOfFile(path);
        const ThreadsScope scope(2);
        const auto ahead = ContentsOfFile(path);
        EXPECT_TRUE(ahead.first == alone.first)
            << ahead.first.size() << ", expected " << alone.first.size();
        EXPECT_EQ(ahead.second, alone.second);
      }
    }
  }
  std::remove(path.c_str());
}

// Who has seen enough, or is told to stop, does not wait for the rest; an
// endless file has none.
TEST(InputStreamTest, AThreadThatReadsAheadEndsWithWhoReads) {
  const ThreadsScope scope(2);
  for (const std::size_t count :
       {std::size_t{0}, std::size_t{1} << 16, std::size_t{1} << 24}) {
    InputStream zeros("/dev/zero");
    EXPECT_EQ(zeros.Peek(count).size(), count);
  }
  int asked = 0;
  InputStream stopped("/dev/zero", [&asked] { return ++asked > 10; });
  EXPECT_GT(stopped.Consume(std::uint64_t{1} << 40), 0u);
  // Nobody ever writes.
  const std::string path = ::testing::TempDir() + "input_stream_silent";
  std::remove(path.c_str());
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  asked = 0;
  InputStream silent(path, [&asked] { return ++asked > 2; });
  EXPECT_THAT(Lines(&silent), IsEmpty());
  std::remove(path.c_str());
}

}  // namespace
}  // namespace plumbline
