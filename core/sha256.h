#ifndef PLUMBLINE_CORE_SHA256_H_
#define PLUMBLINE_CORE_SHA256_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace plumbline {

/// The SHA-256 digest of bytes that come piece by piece (FIPS 180-4), the same
/// as sha256sum prints.
class Sha256 {
 public:
  /// Takes the next bytes.
  void Update(std::string_view bytes);

  /// Digest of everything taken, 64 lowercase hexadecimal digits. Nothing may
  /// be taken afterwards.
  std::string HexDigest();

 private:
  void TakeBlock(const unsigned char* block);

  std::array<std::uint32_t, 8> state_ = {0x6a09e667, 0xbb67ae85, 0x3c6ef372,
                                         0xa54ff53a, 0x510e527f, 0x9b05688c,
                                         0x1f83d9ab, 0x5be0cd19};
  std::array<unsigned char, 64> block_ = {};
  std::uint64_t size_ = 0;
};

/// Digest of a regular file's content; empty for anything else and when the
/// file cannot be read.
std::string Sha256OfFile(const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SHA256_H_
