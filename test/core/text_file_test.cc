#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/text_file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstddef>
#include <cstdio>
#include <fstream>
#include <string>
#include <thread>

namespace plumbline {
namespace {

using ::testing::HasSubstr;

std::string Refusal(const std::string& path, std::size_t limit) {
  try {
    ReadTextFile(path, limit);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(TextFileTest, ReadsUpToItsLimit) {
  const std::string path =
      ::testing::TempDir() + "text_file_test_" + std::to_string(getpid());
  for (const std::size_t size : {0, 1, 65536, 200000}) {
    const std::string text(size, 'x');
    std::ofstream(path, std::ios::binary) << text;
    EXPECT_EQ(ReadTextFile(path, size), text);
    if (size == 0) continue;
    EXPECT_THAT(Refusal(path, size - 1), HasSubstr("holds more than"));
  }
  std::ofstream(path, std::ios::binary) << "\xEF\xBB\xBFtext\n";
  EXPECT_EQ(ReadTextFile(path, 100), "text\n");
  std::remove(path.c_str());
}

TEST(TextFileTest, WhatIsNoTextFile) {
  EXPECT_THAT(Refusal("/no/such", 9),
              HasSubstr("/no/such: cannot be read: No"));
  EXPECT_THAT(Refusal(::testing::TempDir(), 9), HasSubstr("directory"));
  EXPECT_THAT(Refusal("/dev/zero", 1 << 30),
              HasSubstr("/dev/zero: holds bytes that are zero"));
}

// Opening one waits for its writer; reading before there is one finds an end.
TEST(TextFileTest, NamedPipes) {
  const std::string path =
      ::testing::TempDir() + "text_file_pipe_" + std::to_string(getpid());
  std::remove(path.c_str());
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  int asked = 0;
  EXPECT_EQ(ReadTextFile(path, 100, [&] { return ++asked > 2; }), "");
  std::thread writer([&] {
    usleep(100000);
    std::ofstream(path) << "a\nb\n";
  });
  EXPECT_EQ(ReadTextFile(path, 100), "a\nb\n");
  writer.join();
  std::remove(path.c_str());
}

}  // namespace
}  // namespace plumbline
