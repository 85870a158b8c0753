#ifndef PLUMBLINE_FRONTEND_BAGS_LITTLE_ENDIAN_H_
#define PLUMBLINE_FRONTEND_BAGS_LITTLE_ENDIAN_H_

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace plumbline {

/// The unsigned number in `size` bytes of `bytes` from `offset` on, the least
/// significant byte first. They must be there.
inline std::uint64_t LittleEndian(std::string_view bytes, std::size_t offset,
                                  std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = size; i-- > 0;) {
    value = value << 8 | static_cast<unsigned char>(bytes[offset + i]);
  }
  return value;
}

/// Bytes in memory that are read like an InputStream.
class MemoryBytes {
 public:
  MemoryBytes() = default;
  explicit MemoryBytes(std::string_view bytes) : bytes_(bytes) {}

  std::string_view Peek(std::size_t count) const {
    return bytes_.substr(0, count);
  }
  std::uint64_t Consume(std::uint64_t count) {
    const std::size_t taken =
        count < bytes_.size() ? static_cast<std::size_t>(count) : bytes_.size();
    bytes_.remove_prefix(taken);
    return taken;
  }
  bool empty() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_LITTLE_ENDIAN_H_
