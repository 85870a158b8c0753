#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/text_file.h>

#include <cstddef>
#include <cstdio>
#include <fstream>
#include <string>

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
  const std::string path = ::testing::TempDir() + "text_file_test";
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

}  // namespace
}  // namespace plumbline
