#include <plumbline/core/late_library.h>
#include <plumbline/frontend/bags/chunk_unpacker.h>
#include <plumbline/frontend/bags/chunked_bag.h>
#include <plumbline/frontend/bags/little_endian.h>
#include <plumbline/frontend/bags/mcap.h>
#include <zlib.h>

#include <algorithm>
#include <map>
#include <string>
#include <utility>

namespace plumbline {
namespace {

LateLibrary zlib_library("libz.so.1");
PLUMBLINE_LATE_FUNCTION(zlib_library, crc32);

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);

constexpr std::size_t kLargestRecord = std::size_t{1} << 28;
constexpr std::size_t kSearchStep = std::size_t{1} << 18;
// Opcode and length.
constexpr std::size_t kRecordHeader = 9;
// Of a message, up to its data: channel, number, two times.
constexpr std::size_t kMessageHeader = 2 + 4 + 8 + 8;
// Of a chunk, up to the name of its compression.
constexpr std::size_t kChunkHeader = 8 + 8 + 8 + 4;

enum Opcode : unsigned char {
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kLastKnown = 0x0f,
  kDataEnd = 0x0f,
};

// Fields one after another; ok() is false once one was missing.
class FieldReader {
 public:
  explicit FieldReader(std::string_view bytes) : bytes_(bytes) {}
  std::uint64_t Number(std::size_t size) {
    if (!ok_ || bytes_.size() < size) {
      ok_ = false;
      return 0;
    }
    const std::uint64_t value = LittleEndian(bytes_, 0, size);
    bytes_.remove_prefix(size);
    return value;
  }
  std::string Text() {
    const std::uint64_t size = Number(4);
    if (!ok_ || bytes_.size() < size) {
      ok_ = false;
      return {};
    }
    std::string text(bytes_.substr(0, size));
    bytes_.remove_prefix(size);
    return text;
  }
  std::size_t left() const { return bytes_.size(); }
  bool ok() const { return ok_; }

 private:
  std::string_view bytes_;
  bool ok_ = true;
};

// What a chunk's record says before its messages.
struct ChunkHead {
  std::uint64_t size = 0;
  std::uint32_t checksum = 0;
  std::string compression;
  std::uint64_t stored_size = 0;
  // Bytes of the record up to the stored ones.
  std::size_t begin = 0;
};

bool ParseChunkHead(std::string_view content, ChunkHead* head) {
  FieldReader fields(content.substr(0, kChunkHeader + 64));
  const std::size_t all = fields.left();
  fields.Number(8);
  fields.Number(8);
  head->size = fields.Number(8);
  head->checksum = static_cast<std::uint32_t>(fields.Number(4));
  head->compression = fields.Text();
  head->stored_size = fields.Number(8);
  head->begin = all - fields.left();
  return fields.ok();
}

class Mcap : public ChunkedBag {
 public:
  explicit Mcap(InputStream* input) : ChunkedBag("MCAP file", input) {
    input->Consume(kMagic.size());
  }

  bool Next(BagMessage* message) override {
    while (true) {
      if (!chunk()->empty()) {
        if (Step(chunk(), message)) return true;
        continue;
      }
      if (at_end_) return false;
      if (Step(input(), message)) return true;
    }
  }

 private:
  // Takes a record; true when it is a message.
  template <typename Bytes>
  bool Step(Bytes* bytes, BagMessage* message) {
    constexpr bool kInChunk = std::is_same_v<Bytes, MemoryBytes>;
    PassOverLast(bytes);
    const std::string_view head = bytes->Peek(kRecordHeader);
    if (head.size() < kRecordHeader) {
      bytes->Consume(kRecordHeader);
      if (kInChunk) {
        if (!head.empty()) Skip("record that breaks off");
      } else {
        BreakOff();
      }
      return false;
    }
    const auto opcode = static_cast<unsigned char>(head[0]);
    const std::uint64_t size = LittleEndian(head, 1, 8);
    if (!kInChunk && (opcode == kDataEnd || opcode == kFooter)) {
      at_end_ = true;
      return false;
    }
    if (opcode == kMessage) return TakeMessage(size, bytes, message);
    if (opcode == 0 || (opcode > kLastKnown && opcode < 0x80)) {
      Skip("record of an unknown kind");
      Recover(bytes);
      return false;
    }
    if (opcode == kChunk && !kInChunk) {
      TakeChunk(size);
      return false;
    }
    if (opcode == kSchema || opcode == kChannel) {
      if (size > kLargestRecord) {
        Skip("record that says it has more than 256 MiB");
        Recover(bytes);
        return false;
      }
      const std::size_t whole = kRecordHeader + static_cast<std::size_t>(size);
      const std::string_view view = bytes->Peek(whole);
      if (view.size() == whole) {
        const std::string_view content = view.substr(kRecordHeader);
        opcode == kSchema ? TakeSchema(content) : TakeChannel(content);
      }
    }
    PassOver(size, bytes);
    return false;
  }

  template <typename Bytes>
  void PassOver(std::uint64_t size, Bytes* bytes) {
    if (bytes->Consume(kRecordHeader) < kRecordHeader ||
        bytes->Consume(size) < size) {
      Skip("record that breaks off");
    }
  }

  // The data ended without the record that says so.
  void BreakOff() {
    at_end_ = true;
    Skip(input()->damage().empty()
             ? std::string("the file breaks off before its end")
             : input()->damage() + ": what was unpacked before it is used");
  }

  // A record cannot be believed: on to the next chunk, which says its size
  // twice, or to the end.
  void Recover(MemoryBytes* bytes) { bytes->Consume(~std::uint64_t{0}); }
  void Recover(InputStream* input) {
    input->Consume(1);
    while (true) {
      const std::string_view view =
          input->Peek(kSearchStep + kRecordHeader + kChunkHeader + 64);
      const std::size_t end = std::min(view.size(), kSearchStep);
      for (std::size_t i = 0; i < end; ++i) {
        if (IsChunk(view.substr(i))) {
          input->Consume(i);
          return;
        }
      }
      input->Consume(end);
      if (end < kSearchStep) return;
    }
  }

  static bool IsChunk(std::string_view bytes) {
    ChunkHead head;
    return bytes.size() > kRecordHeader && bytes[0] == kChunk &&
           LittleEndian(bytes, 1, 8) <= kLargestRecord &&
           ParseChunkHead(bytes.substr(kRecordHeader), &head) &&
           (head.compression.empty() || IsKnownCompression(head.compression)) &&
           head.begin + head.stored_size == LittleEndian(bytes, 1, 8);
  }

  void TakeSchema(std::string_view content) {
    FieldReader fields(content);
    const std::uint64_t id = fields.Number(2);
    const std::string name = fields.Text();
    if (!fields.ok() || id == 0) {
      Skip("schema that is damaged");
      return;
    }
    schemas_[id] = name;
  }

  void TakeChannel(std::string_view content) {
    FieldReader fields(content);
    const std::uint64_t id = fields.Number(2);
    const std::uint64_t schema = fields.Number(2);
    BagTopic topic;
    topic.name = fields.Text();
    const std::string encoding = fields.Text();
    if (!fields.ok()) {
      Skip("channel that is damaged");
      return;
    }
    const auto type = schemas_.find(schema);
    if (type == schemas_.end() || type->second.empty()) {
      topic.unreadable = "no schema says what type its messages have";
    } else {
      topic.type = PlainTypeName(type->second);
    }
    if (encoding == "cdr") {
      topic.encoding = MessageEncoding::kCdr;
    } else if (encoding == "ros1") {
      topic.encoding = MessageEncoding::kRos1;
    } else {
      topic.unreadable = "its messages are encoded as '" +
                         encoding.substr(0, 20) + "': cdr and ros1 are known";
    }
    channels_[id] = AddTopic(topic);
  }

  template <typename Bytes>
  bool TakeMessage(std::uint64_t size, Bytes* bytes, BagMessage* message) {
    CountMessage();
    const std::string_view head = bytes->Peek(kRecordHeader + kMessageHeader);
    if (size < kMessageHeader || size > kLargestRecord ||
        head.size() < kRecordHeader + kMessageHeader) {
      Skip(size > kLargestRecord ? "message that says it has more than 256 MiB"
                                 : "message that breaks off");
      Recover(bytes);
      return false;
    }
    const auto channel = channels_.find(LittleEndian(head, kRecordHeader, 2));
    if (channel == channels_.end()) {
      Skip("message of a channel that the file does not describe");
      PassOver(size, bytes);
      return false;
    }
    message->topic = channel->second;
    message->time =
        static_cast<std::int64_t>(LittleEndian(head, kRecordHeader + 2 + 4, 8));
    return TakeData(kRecordHeader + kMessageHeader,
                    kRecordHeader + static_cast<std::size_t>(size),
                    "message that breaks off", bytes, message);
  }

  void TakeChunk(std::uint64_t size) {
    ChunkHead head;
    const std::string_view start =
        input()->Peek(kRecordHeader + kChunkHeader + 64);
    if (!ParseChunkHead(start.substr(kRecordHeader), &head)) {
      Skip("chunk that is damaged or breaks off");
      Recover(input());
      return;
    }
    if (!head.compression.empty() &&
        (!IsKnownCompression(head.compression) || head.compression == "bz2")) {
      Skip("chunk with the unknown compression '" +
           head.compression.substr(0, 20) + "': none, lz4 and zstd are known");
      PassOver(size, input());
      return;
    }
    // The record's size and that of its content have to agree.
    const bool agrees = head.begin + head.stored_size == size;
    if (head.stored_size > kLargestRecord) {
      Skip("chunk that says it has more than 256 MiB");
      Recover(input());
      return;
    }
    const std::size_t begin = kRecordHeader + head.begin;
    const std::string_view view =
        input()->Peek(begin + static_cast<std::size_t>(head.stored_size));
    const std::string_view stored = view.substr(std::min(begin, view.size()));
    const bool is_short = stored.size() < head.stored_size;
    UnpackedChunk unpacked;
    if (head.compression.empty()) {
      unpacked.bytes = std::string(stored);
      unpacked.is_whole = !is_short;
      unpacked.consumed = stored.size();
    } else {
      unpacked =
          UnpackChunk(head.compression, stored,
                      static_cast<std::size_t>(head.size), kLargestRecord);
    }
    if (!unpacked.is_whole) {
      SkipDamagedChunk(unpacked);
    } else if (head.checksum != 0 &&
               crc32(0, reinterpret_cast<const Bytef*>(unpacked.bytes.data()),
                     static_cast<uInt>(unpacked.bytes.size())) !=
                   head.checksum) {
      Skip("chunk whose checksum is wrong");
      unpacked.bytes.clear();
    }
    if (agrees) {
      input()->Consume(kRecordHeader + size);
    } else {
      Skip("chunk that states another size than it has");
      input()->Consume(begin + unpacked.consumed - 1);
      Recover(input());
    }
    SetChunk(std::move(unpacked));
  }

  std::map<std::uint64_t, std::string> schemas_;
  std::map<std::uint64_t, std::size_t> channels_;
  bool at_end_ = false;
};

}  // namespace

bool LooksLikeMcap(std::string_view prefix) {
  return prefix.substr(0, kMagic.size()) == kMagic;
}

std::unique_ptr<BagSource> OpenMcap(InputStream* input) {
  return std::make_unique<Mcap>(input);
}

}  // namespace plumbline
