#ifndef PLUMBLINE_FRONTEND_BAGS_CHUNKED_BAG_H_
#define PLUMBLINE_FRONTEND_BAGS_CHUNKED_BAG_H_

#include <plumbline/frontend/bags/bag_source.h>
#include <plumbline/frontend/bags/chunk_unpacker.h>
#include <plumbline/frontend/bags/little_endian.h>
#include <plumbline/frontend/input_stream.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

namespace plumbline {

/// A bag in one file whose records lie in chunks or beside them (ROS 1, MCAP).
/// `Bytes` is where a record comes from: the chunk at hand (MemoryBytes) or the
/// file (InputStream).
class ChunkedBag : public BagSource {
 protected:
  /// `format`: as BagSource::format(). The stream is not owned.
  ChunkedBag(std::string format, InputStream* input)
      : BagSource(std::move(format)), input_(input) {}

  /// The file.
  InputStream* input() const { return input_; }
  /// What is left of the present chunk; empty when there is none.
  MemoryBytes* chunk() { return &chunk_; }

  /// Makes unpacked data the present chunk.
  void SetChunk(UnpackedChunk unpacked) {
    unpacked_ = std::move(unpacked.bytes);
    chunk_ = MemoryBytes(unpacked_);
  }

  /// Counts a chunk that could not be unpacked to its end.
  void SkipDamagedChunk(const UnpackedChunk& unpacked) {
    Skip(unpacked.damage.empty()
             ? "chunk that breaks off: what was unpacked before is used"
             : "chunk whose " + unpacked.damage +
                   ": what was unpacked before is used");
  }

  /// Takes a message's record of `size` bytes, of which those from
  /// `header_size` on are its data: they are set when its topic is wanted, and
  /// stay until PassOverLast. False, and counted as `broken`, when bytes are
  /// missing.
  template <typename Bytes>
  bool TakeData(std::size_t header_size, std::size_t size, const char* broken,
                Bytes* bytes, BagMessage* message) {
    message->data = {};
    const bool is_wanted = IsWanted(topics()[message->topic]);
    const std::string_view view =
        is_wanted ? bytes->Peek(size) : std::string_view();
    if (is_wanted && view.size() == size) {
      message->data = view.substr(header_size);
      pending_ = size;
      return true;
    }
    if (bytes->Consume(size) == size) return true;
    Skip(broken);
    return false;
  }

  /// Passes over the record whose data TakeData gave last, which were in use
  /// until now; false when there was none.
  template <typename Bytes>
  bool PassOverLast(Bytes* bytes) {
    if (pending_ == 0) return false;
    bytes->Consume(std::exchange(pending_, 0));
    return true;
  }

 private:
  InputStream* input_;
  std::string unpacked_;
  MemoryBytes chunk_;
  // Size of the record whose data are in use.
  std::size_t pending_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_CHUNKED_BAG_H_
