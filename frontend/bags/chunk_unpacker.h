#ifndef PLUMBLINE_FRONTEND_BAGS_CHUNK_UNPACKER_H_
#define PLUMBLINE_FRONTEND_BAGS_CHUNK_UNPACKER_H_

#include <cstddef>
#include <string>
#include <string_view>

namespace plumbline {

/// Result of unpacking a compressed chunk.
struct UnpackedChunk {
  std::string bytes;
  /// Stored bytes up to the end of the compressed stream.
  std::size_t consumed = 0;
  /// The stream ended before the stored bytes did, or with them.
  bool is_whole = false;
  /// What is wrong with the data beyond breaking off; empty when nothing is.
  std::string damage;
};

/// Whether `compression` is one that UnpackChunk knows: "bz2", "lz4" (frames),
/// "zstd".
bool IsKnownCompression(std::string_view compression);

/// Unpacks the stream that `stored` begins with, up to `limit` bytes; more than
/// that counts as damage. Room is made for `stated_size` bytes at once, which
/// need not be right (0: not stated). Checksums in the stream are tested.
/// Throws for lack of memory only.
UnpackedChunk UnpackChunk(std::string_view compression, std::string_view stored,
                          std::size_t stated_size, std::size_t limit);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_CHUNK_UNPACKER_H_
