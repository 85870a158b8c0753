#include <bzlib.h>
#include <lz4frame.h>
#include <plumbline/frontend/bags/chunk_unpacker.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

namespace plumbline {
namespace {

constexpr std::size_t kStep = std::size_t{1} << 18;

// Room for more output behind the first `used` bytes; false at the limit.
bool MakeRoom(std::size_t used, std::size_t limit, std::string* bytes) {
  if (used < bytes->size()) return true;
  if (used >= limit) return false;
  bytes->resize(std::min(limit, std::max(2 * used, kStep)));
  return true;
}

constexpr char kTooMuch[] = "unpacks to more than a chunk may have";

UnpackedChunk UnpackBzip2(std::string_view stored, std::size_t limit) {
  UnpackedChunk result;
  bz_stream stream = {};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) {
    result.damage = "libbz2 cannot be initialized";
    return result;
  }
  stream.next_in = const_cast<char*>(stored.data());
  stream.avail_in = static_cast<unsigned>(stored.size());
  std::size_t used = 0;
  while (true) {
    if (!MakeRoom(used, limit, &result.bytes)) {
      result.damage = kTooMuch;
      break;
    }
    const std::size_t room = result.bytes.size() - used;
    stream.next_out = result.bytes.data() + used;
    stream.avail_out = static_cast<unsigned>(room);
    const int status = BZ2_bzDecompress(&stream);
    const std::size_t count = room - stream.avail_out;
    used += count;
    if (status == BZ_STREAM_END) {
      result.is_whole = true;
      break;
    }
    if (status != BZ_OK) {
      result.damage = "bz2 data is corrupt";
      break;
    }
    if (stream.avail_in == 0 && count == 0) break;
  }
  result.consumed = stored.size() - stream.avail_in;
  result.bytes.resize(used);
  BZ2_bzDecompressEnd(&stream);
  return result;
}

UnpackedChunk UnpackLz4(std::string_view stored, std::size_t limit) {
  UnpackedChunk result;
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) {
    result.damage = "liblz4 cannot be initialized";
    return result;
  }
  std::size_t used = 0;
  while (true) {
    if (!MakeRoom(used, limit, &result.bytes)) {
      result.damage = kTooMuch;
      break;
    }
    std::size_t room = result.bytes.size() - used;
    std::size_t taken = stored.size() - result.consumed;
    const std::size_t status =
        LZ4F_decompress(context, result.bytes.data() + used, &room,
                        stored.data() + result.consumed, &taken, nullptr);
    if (LZ4F_isError(status)) {
      result.damage = "lz4 data is corrupt";
      break;
    }
    used += room;
    result.consumed += taken;
    if (status == 0) {
      result.is_whole = true;
      break;
    }
    if (room == 0 && taken == 0) break;
  }
  result.bytes.resize(used);
  LZ4F_freeDecompressionContext(context);
  return result;
}

UnpackedChunk UnpackZstd(std::string_view stored, std::size_t limit) {
  UnpackedChunk result;
  const std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context(
      ZSTD_createDCtx(), ZSTD_freeDCtx);
  if (context == nullptr) {
    result.damage = "libzstd cannot be initialized";
    return result;
  }
  std::size_t used = 0;
  ZSTD_inBuffer input = {stored.data(), stored.size(), 0};
  while (true) {
    if (!MakeRoom(used, limit, &result.bytes)) {
      result.damage = kTooMuch;
      break;
    }
    ZSTD_outBuffer output = {result.bytes.data(), result.bytes.size(), used};
    const std::size_t before = input.pos;
    const std::size_t status =
        ZSTD_decompressStream(context.get(), &output, &input);
    if (ZSTD_isError(status)) {
      result.damage = "zstd data is corrupt";
      break;
    }
    const bool went_on = output.pos > used || input.pos > before;
    used = output.pos;
    if (status == 0) {
      result.is_whole = true;
      break;
    }
    if (!went_on) break;
  }
  result.consumed = input.pos;
  result.bytes.resize(used);
  return result;
}

}  // namespace

bool IsKnownCompression(std::string_view compression) {
  return compression == "bz2" || compression == "lz4" || compression == "zstd";
}

UnpackedChunk UnpackChunk(std::string_view compression, std::string_view stored,
                          std::size_t limit) {
  if (compression == "bz2") return UnpackBzip2(stored, limit);
  if (compression == "lz4") return UnpackLz4(stored, limit);
  if (compression == "zstd") return UnpackZstd(stored, limit);
  UnpackedChunk result;
  result.damage = "is compressed in an unknown way";
  return result;
}

}  // namespace plumbline
