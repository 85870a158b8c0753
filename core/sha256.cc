#include <nettle/sha2.h>
#include <plumbline/core/sha256.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <vector>

namespace plumbline {

struct Sha256::State {
  sha256_ctx context;
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  sha256_init(&state_->context);
}

Sha256::~Sha256() = default;

void Sha256::Update(std::string_view bytes) {
  sha256_update(&state_->context, bytes.size(),
                reinterpret_cast<const std::uint8_t*>(bytes.data()));
}

std::string Sha256::HexDigest() {
  std::array<std::uint8_t, SHA256_DIGEST_SIZE> bytes;
  sha256_digest(&state_->context, bytes.size(), bytes.data());
  constexpr char kDigits[] = "0123456789abcdef";
  std::string digest;
  for (const std::uint8_t byte : bytes) {
    digest += kDigits[byte >> 4];
    digest += kDigits[byte & 0xf];
  }
  return digest;
}

std::string Sha256OfFile(const std::string& path) {
  // Opening a pipe would wait for who writes to it, and a device has no end.
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return "";
  std::ifstream file(path, std::ios::binary);
  Sha256 digest;
  std::vector<char> buffer(1 << 16);
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    digest.Update({buffer.data(), static_cast<std::size_t>(file.gcount())});
  }
  return file.eof() ? digest.HexDigest() : "";
}

}  // namespace plumbline
