#include <lz4frame.h>
#include <plumbline/core/late_library.h>
#include <plumbline/frontend/bags/chunk_unpacker.h>
#include <plumbline/frontend/bzip2_decoder.h>
#include <zstd.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace plumbline {
namespace {

LateLibrary lz4_library("liblz4.so.1");
PLUMBLINE_LATE_FUNCTION(lz4_library, LZ4F_createDecompressionContext);
PLUMBLINE_LATE_FUNCTION(lz4_library, LZ4F_decompress);
PLUMBLINE_LATE_FUNCTION(lz4_library, LZ4F_freeDecompressionContext);
PLUMBLINE_LATE_FUNCTION(lz4_library, LZ4F_isError);
LateLibrary zstd_library("libzstd.so.1");
PLUMBLINE_LATE_FUNCTION(zstd_library, ZSTD_createDCtx);
PLUMBLINE_LATE_FUNCTION(zstd_library, ZSTD_decompressStream);
PLUMBLINE_LATE_FUNCTION(zstd_library, ZSTD_freeDCtx);
PLUMBLINE_LATE_FUNCTION(zstd_library, ZSTD_isError);

constexpr std::size_t kStep = std::size_t{1} << 18;
// Few chunks unpack to more than so many times their size.
constexpr std::size_t kLikelyRatio = 64;

// How much is unpacked, bytes.
struct Sizes {
  std::size_t expected = 0;
  std::size_t limit = 0;
};

// Room for more output behind the first `used` bytes; false at the limit. What
// is expected is made room for at once.
bool MakeRoom(std::size_t used, const Sizes& sizes, std::string* bytes) {
  if (used < bytes->size()) return true;
  if (used >= sizes.limit) return false;
  // One more, for the end comes behind the last byte.
  bytes->resize(
      std::min(sizes.limit, std::max({2 * used, kStep, sizes.expected + 1})));
  return true;
}

constexpr char kTooMuch[] = "unpacks to more than a chunk may have";

UnpackedChunk UnpackBzip2(std::string_view stored, const Sizes& sizes) {
  using State = Bzip2Decoder::State;
  UnpackedChunk result;
  Bzip2Decoder decoder(
      [&stored] { return std::exchange(stored, std::string_view()); });
  std::size_t used = 0;
  while (decoder.state() == State::kGoingOn) {
    if (!MakeRoom(used, sizes, &result.bytes)) {
      result.damage = kTooMuch;
      break;
    }
    used +=
        decoder.Unpack(result.bytes.data() + used, result.bytes.size() - used);
  }
  if (decoder.state() == State::kCorrupt) {
    result.damage = "bz2 data is corrupt";
  }
  result.is_whole = decoder.state() == State::kEnd;
  result.consumed = static_cast<std::size_t>(decoder.consumed());
  result.bytes.resize(used);
  return result;
}

UnpackedChunk UnpackLz4(std::string_view stored, const Sizes& sizes) {
  UnpackedChunk result;
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) {
    result.damage = "liblz4 cannot be initialized";
    return result;
  }
  std::size_t used = 0;
  while (true) {
    if (!MakeRoom(used, sizes, &result.bytes)) {
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

UnpackedChunk UnpackZstd(std::string_view stored, const Sizes& sizes) {
  UnpackedChunk result;
  const auto free = [](ZSTD_DCtx* context) { ZSTD_freeDCtx(context); };
  const std::unique_ptr<ZSTD_DCtx, decltype(free)> context(ZSTD_createDCtx(),
                                                           free);
  if (context == nullptr) {
    result.damage = "libzstd cannot be initialized";
    return result;
  }
  std::size_t used = 0;
  ZSTD_inBuffer input = {stored.data(), stored.size(), 0};
  while (true) {
    if (!MakeRoom(used, sizes, &result.bytes)) {
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
                          std::size_t stated_size, std::size_t limit) {
  // The stated size may be a lie, which then costs little.
  Sizes sizes;
  sizes.expected = std::min(stated_size, kLikelyRatio * stored.size());
  sizes.limit = limit;
  if (compression == "bz2") return UnpackBzip2(stored, sizes);
  if (compression == "lz4") return UnpackLz4(stored, sizes);
  if (compression == "zstd") return UnpackZstd(stored, sizes);
  UnpackedChunk result;
  result.damage = "is compressed in an unknown way";
  return result;
}

}  // namespace plumbline
