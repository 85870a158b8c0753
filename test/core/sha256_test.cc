#include <gtest/gtest.h>
#include <plumbline/core/sha256.h>
#include <sys/stat.h>

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

namespace plumbline {
namespace {

std::string Digest(const std::string& text) {
  Sha256 digest;
  digest.Update(text);
  return digest.HexDigest();
}

// Examples of NIST's and of RFC 6234.
TEST(Sha256Test, PublishedExamples) {
  EXPECT_EQ(Digest(""),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Digest("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(Digest(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256Test, PiecesMakeNoDifference) {
  std::string text;
  for (int i = 0; i < 300; ++i) text += static_cast<char>(i);
  for (const std::size_t piece : {1, 7, 55, 56, 63, 64, 65, 200}) {
    Sha256 digest;
    for (std::size_t i = 0; i < text.size(); i += piece) {
      digest.Update(text.substr(i, piece));
    }
    EXPECT_EQ(digest.HexDigest(), Digest(text)) << piece;
  }
}

TEST(Sha256Test, OfAFile) {
  const std::string path = ::testing::TempDir() + "sha256_test";
  const std::string text(200001, 'x');
  std::ofstream(path, std::ios::binary) << text;
  EXPECT_EQ(Sha256OfFile(path), Digest(text));
  std::filesystem::remove(path);
  EXPECT_EQ(Sha256OfFile(path), "");
  EXPECT_EQ(Sha256OfFile(::testing::TempDir()), "");
  // It would not come back from one of these.
  EXPECT_EQ(Sha256OfFile("/dev/zero"), "");
  const std::string pipe = path + ".pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(Sha256OfFile(pipe), "");
  std::remove(pipe.c_str());
}

}  // namespace
}  // namespace plumbline
