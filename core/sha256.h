#ifndef PLUMBLINE_CORE_SHA256_H_
#define PLUMBLINE_CORE_SHA256_H_

#include <memory>
#include <string>
#include <string_view>

namespace plumbline {

/// The SHA-256 digest of bytes that come piece by piece (FIPS 180-4), the same
/// as sha256sum prints.
class Sha256 {
 public:
  Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;
  ~Sha256();

  /// Takes the next bytes.
  void Update(std::string_view bytes);

  /// Digest of everything taken, 64 lowercase hexadecimal digits. What is taken
  /// afterwards begins another one.
  std::string HexDigest();

 private:
  // Of libnettle, which users of this header need not have.
  struct State;

  std::unique_ptr<State> state_;
};

/// Digest of a regular file's content; empty for anything else and when the
/// file cannot be read.
std::string Sha256OfFile(const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SHA256_H_
