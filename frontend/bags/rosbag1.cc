#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/bags/chunk_unpacker.h>
#include <plumbline/frontend/bags/chunked_bag.h>
#include <plumbline/frontend/bags/little_endian.h>
#include <plumbline/frontend/bags/rosbag1.h>

#include <algorithm>
#include <future>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr std::string_view kMagic = "#ROSBAG V";
constexpr std::string_view kVersion = "#ROSBAG V2.0\n";

// A record, and what a chunk unpacks to, may have so many bytes.
constexpr std::size_t kLargestRecord = std::size_t{1} << 28;
constexpr std::size_t kLargestHeader = std::size_t{1} << 16;
// Bytes that are searched for a record at once.
constexpr std::size_t kSearchStep = std::size_t{1} << 18;

enum Op : unsigned char {
  kMessage = 2,
  kBagHeader = 3,
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7,
};

using Fields = std::map<std::string_view, std::string_view>;

// "length name=value", one after another; false unless they fill `text`.
bool ParseFields(std::string_view text, Fields* fields) {
  fields->clear();
  while (!text.empty()) {
    if (text.size() < 4) return false;
    const std::size_t size = LittleEndian(text, 0, 4);
    text.remove_prefix(4);
    if (size > text.size()) return false;
    const std::string_view field = text.substr(0, size);
    const std::size_t equals = field.find('=');
    if (equals == std::string_view::npos || equals == 0) return false;
    (*fields)[field.substr(0, equals)] = field.substr(equals + 1);
    text.remove_prefix(size);
  }
  return true;
}

// A number of `size` bytes; false when the field is missing or has another
// size.
bool Number(const Fields& fields, std::string_view name, std::size_t size,
            std::uint64_t* value) {
  const auto entry = fields.find(name);
  if (entry == fields.end() || entry->second.size() != size) return false;
  *value = LittleEndian(entry->second, 0, size);
  return true;
}

std::string Text(const Fields& fields, std::string_view name) {
  const auto entry = fields.find(name);
  return entry == fields.end() ? std::string() : std::string(entry->second);
}

struct Record {
  unsigned char op = 0;
  Fields fields;
  // Bytes up to the data.
  std::size_t header_size = 0;
  std::size_t data_size = 0;
};

enum class Parsed { kRecord, kTooShort, kDamaged };

// The header of a record that `bytes` begin with.
Parsed ParseRecord(std::string_view bytes, Record* record) {
  if (bytes.size() < 4) return Parsed::kTooShort;
  const std::size_t size = LittleEndian(bytes, 0, 4);
  if (size < 8 || size > kLargestHeader) return Parsed::kDamaged;
  // Cheap, before anything is stored.
  if (bytes.size() >= 8 && LittleEndian(bytes, 4, 4) > size - 4) {
    return Parsed::kDamaged;
  }
  if (bytes.size() < size + 8) return Parsed::kTooShort;
  if (!ParseFields(bytes.substr(4, size), &record->fields)) {
    return Parsed::kDamaged;
  }
  std::uint64_t op = 0;
  std::uint64_t unused = 0;
  const Fields& fields = record->fields;
  if (!Number(fields, "op", 1, &op)) return Parsed::kDamaged;
  record->op = static_cast<unsigned char>(op);
  record->header_size = size + 8;
  record->data_size = LittleEndian(bytes, size + 4, 4);
  bool is_one = false;
  switch (op) {
    case kMessage:
      is_one = Number(fields, "conn", 4, &unused) &&
               Number(fields, "time", 8, &unused);
      break;
    case kBagHeader:
      is_one = Number(fields, "index_pos", 8, &unused);
      break;
    case kIndex:
      is_one = Number(fields, "count", 4, &unused);
      break;
    case kChunk:
      is_one =
          fields.count("compression") > 0 && Number(fields, "size", 4, &unused);
      break;
    case kChunkInfo:
      is_one = Number(fields, "count", 4, &unused);
      break;
    case kConnection:
      is_one = Number(fields, "conn", 4, &unused) && fields.count("topic") > 0;
      break;
    default:
      is_one = false;
  }
  return is_one ? Parsed::kRecord : Parsed::kDamaged;
}

class Rosbag1 : public ChunkedBag {
 public:
  explicit Rosbag1(InputStream* input) : ChunkedBag("ROS 1 bag", input) {
    const std::string_view start = input->Peek(kVersion.size());
    if (start != kVersion) {
      const std::size_t end = std::min(start.find('\n'), start.size());
      throw Error(
          input->name(), 0,
          "is a ROS bag of version " +
              std::string(start.substr(std::min(kMagic.size(), end),
                                       end - std::min(kMagic.size(), end))),
          "version 2.0 (rosbag fix brings older bags to it)");
    }
    input->Consume(kVersion.size());
  }

  bool Next(BagMessage* message) override {
    while (true) {
      if (!chunk()->empty()) {
        if (Step(chunk(), message)) return true;
        continue;
      }
      if (at_end_) {
        Close();
        return false;
      }
      if (Step(input(), message)) return true;
    }
  }

 private:
  // Takes a record; true when it is a message.
  template <typename Bytes>
  bool Step(Bytes* bytes, BagMessage* message) {
    constexpr bool kInChunk = std::is_same_v<Bytes, MemoryBytes>;
    if (PassOverLast(bytes) && bytes->Peek(1).empty()) {
      if (!kInChunk) at_end_ = true;
      return false;
    }
    Record record;
    Parsed parsed = ParseRecord(bytes->Peek(kUsualHeader), &record);
    if (parsed == Parsed::kTooShort) {
      parsed = ParseRecord(bytes->Peek(kLargestHeader + 8), &record);
    }
    if (parsed != Parsed::kRecord) {
      if (bytes->Peek(1).empty()) {
        if (!kInChunk) at_end_ = true;
        return false;
      }
      Skip(parsed == Parsed::kTooShort
               ? "record that breaks off"
               : "bytes that are no record of a bag: reading goes on with the "
                 "next record");
      bytes->Consume(1);
      FindRecord(bytes);
      return false;
    }
    if (record.op == kMessage) return TakeMessage(record, bytes, message);
    switch (record.op) {
      case kChunk:
        if (kInChunk) {
          PassOver(record, bytes);
        } else {
          TakeChunk(record);
        }
        break;
      case kConnection:
        TakeConnection(record, bytes);
        break;
      case kBagHeader:
        TakeBagHeader(record);
        PassOver(record, bytes);
        break;
      case kChunkInfo:
        ++infos_found_;
        PassOver(record, bytes);
        break;
      case kIndex:
        PassOverIndex(record, bytes);
        break;
      default:
        PassOver(record, bytes);
    }
    return false;
  }

  // On to the next record that can be one, or the end.
  template <typename Bytes>
  void FindRecord(Bytes* bytes) {
    Record record;
    while (true) {
      const std::string_view view =
          bytes->Peek(kSearchStep + kLargestHeader + 8);
      const std::size_t end = std::min(view.size(), kSearchStep);
      for (std::size_t i = 0; i < end; ++i) {
        if (ParseRecord(view.substr(i), &record) == Parsed::kRecord) {
          bytes->Consume(i);
          return;
        }
      }
      bytes->Consume(end);
      if (end < kSearchStep) return;
    }
  }

  template <typename Bytes>
  void PassOver(const Record& record, Bytes* bytes) {
    const std::uint64_t size = record.header_size + record.data_size;
    if (bytes->Consume(size) < size) Skip("record that breaks off");
  }

  // Says what the data's size is: public bags state more than there is.
  template <typename Bytes>
  void PassOverIndex(const Record& record, Bytes* bytes) {
    std::uint64_t count = 0;
    Number(record.fields, "count", 4, &count);
    const std::uint64_t by_count = 12 * count;
    Record next;
    if (by_count != record.data_size && by_count < kSearchStep) {
      const std::string_view view =
          bytes->Peek(record.header_size + by_count + kUsualHeader);
      if (view.size() > record.header_size + by_count &&
          ParseRecord(view.substr(record.header_size + by_count), &next) ==
              Parsed::kRecord) {
        bytes->Consume(record.header_size + by_count);
        Skip("index that states another size than it has");
        return;
      }
    }
    PassOver(record, bytes);
  }

  template <typename Bytes>
  bool TakeMessage(const Record& record, Bytes* bytes, BagMessage* message) {
    std::uint64_t connection = 0;
    std::uint64_t time = 0;
    Number(record.fields, "conn", 4, &connection);
    Number(record.fields, "time", 8, &time);
    const auto topic = connections_.find(connection);
    CountMessage();
    if (record.data_size > kLargestRecord) {
      Skip("message that says it has more than 256 MiB");
      bytes->Consume(record.header_size);
      FindRecord(bytes);
      return false;
    }
    if (topic == connections_.end()) {
      Skip("message of a topic that the bag does not describe");
      PassOver(record, bytes);
      return false;
    }
    message->topic = topic->second;
    message->time = static_cast<std::int64_t>(time & 0xffffffffu) * 1000000000 +
                    static_cast<std::int64_t>(time >> 32);
    return TakeData(record.header_size, record.header_size + record.data_size,
                    "record that breaks off", bytes, message);
  }

  template <typename Bytes>
  void TakeConnection(const Record& record, Bytes* bytes) {
    std::uint64_t connection = 0;
    Number(record.fields, "conn", 4, &connection);
    BagTopic topic;
    topic.name = Text(record.fields, "topic");
    topic.encoding = MessageEncoding::kRos1;
    if (record.data_size > kLargestRecord) {
      Skip("record that says it has more than 256 MiB");
      bytes->Consume(record.header_size);
      FindRecord(bytes);
      return;
    }
    const std::size_t header_size = record.header_size;
    const std::size_t size = header_size + record.data_size;
    const std::string_view view = bytes->Peek(size);
    Fields fields;
    if (view.size() < size || !ParseFields(view.substr(header_size), &fields)) {
      Skip("description of a topic that is damaged");
      bytes->Consume(header_size);
      if (view.size() < size) {
        FindRecord(bytes);
      } else {
        bytes->Consume(size - header_size);
      }
      return;
    }
    topic.type = Text(fields, "type");
    if (topic.type.empty()) {
      topic.unreadable = "the bag does not say what type its messages have";
    } else {
      const std::string sum = Text(fields, "md5sum");
      const auto known = kDefinitions().find(topic.type);
      if (known != kDefinitions().end() && !sum.empty() && sum != "*" &&
          sum != known->second) {
        topic.unreadable = "its messages are " + topic.type +
                           " of another definition (MD5 " + sum +
                           ", expected " + known->second + ")";
      }
    }
    connections_[connection] = AddTopic(topic);
    bytes->Consume(size);
  }

  // Checksums of the definitions that the decoder knows.
  static const std::map<std::string, std::string>& kDefinitions() {
    static const auto* const definitions =
        new std::map<std::string, std::string>{
            {"sensor_msgs/LaserScan", "90c7ef2dc6895d81024acba2ac42f369"},
            {"sensor_msgs/MultiEchoLaserScan",
             "6fefb0c6da89d7c8abe4b339f5c2f8fb"},
            {"nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"},
            {"sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"},
            {"tf2_msgs/TFMessage", "94810edda583a504dfda3829e70d7eec"},
            {"tf/tfMessage", "94810edda583a504dfda3829e70d7eec"}};
    return *definitions;
  }

  void TakeBagHeader(const Record& record) {
    if (!Text(record.fields, "encryptor").empty()) {
      throw Error(input()->name(), 0,
                  "is encrypted by " + Text(record.fields, "encryptor"),
                  "a bag that is not");
    }
    std::uint64_t count = 0;
    if (Number(record.fields, "chunk_count", 4, &count)) {
      chunks_stated_ = static_cast<std::int64_t>(count);
    }
    // 0 in a bag that nobody closed.
    std::uint64_t index = 0;
    has_index_ = Number(record.fields, "index_pos", 8, &index) && index > 0;
  }

  void TakeChunk(const Record& record) {
    ++chunks_found_;
    const std::string compression = Text(record.fields, "compression");
    std::uint64_t size = 0;
    Number(record.fields, "size", 4, &size);
    const std::size_t stored_size = record.data_size;
    // The records of a plain chunk follow like all others; its size need not be
    // believed.
    if (compression == "none") {
      input()->Consume(record.header_size);
      plain_end_ = input()->position() + stored_size;
      return;
    }
    if (!IsKnownCompression(compression) || compression == "zstd") {
      Skip("chunk with the unknown compression '" + compression.substr(0, 20) +
           "': none, bz2 and lz4 are known");
      PassOver(record, input());
      return;
    }
    input()->Consume(record.header_size);
    UnpackedChunk ahead;
    if (TakeAhead(compression, stored_size, static_cast<std::size_t>(size),
                  &ahead)) {
      input()->Consume(stored_size);
      SetChunk(std::move(ahead));
      return;
    }
    std::size_t shown = std::min(stored_size, kLargestRecord);
    std::string_view stored = input()->Peek(shown);
    UnpackedChunk unpacked = UnpackChunk(
        compression, stored, static_cast<std::size_t>(size), kLargestRecord);
    if (!unpacked.is_whole && unpacked.damage.empty() &&
        stored.size() == shown) {
      // More follows than the chunk says.
      shown = std::min<std::size_t>(
          kLargestRecord,
          shown + static_cast<std::size_t>(size) + kLargestHeader);
      stored = input()->Peek(shown);
      unpacked = UnpackChunk(compression, stored,
                             static_cast<std::size_t>(size), kLargestRecord);
    }
    if (unpacked.is_whole) {
      input()->Consume(unpacked.consumed);
      if (unpacked.consumed != stored_size) {
        Skip("chunk that states another size than it has");
        FindRecord(input());
      }
    } else {
      SkipDamagedChunk(unpacked);
      Record next;
      const std::string_view after = input()->Peek(stored_size + kUsualHeader);
      if (after.size() > stored_size &&
          ParseRecord(after.substr(stored_size), &next) == Parsed::kRecord) {
        input()->Consume(stored_size);
      } else {
        FindRecord(input());
      }
    }
    SetChunk(std::move(unpacked));
  }

  // A chunk that is unpacked ahead.
  struct Job {
    std::string compression;
    // Of its stored bytes: where they begin in the input, how many they are by
    // its record, and the bytes.
    std::uint64_t begin = 0;
    std::size_t stored_size = 0;
    std::string stored;
    std::size_t size = 0;
    UnpackedChunk unpacked;
  };

  // The chunk whose stored bytes the input is at, unpacked, where it and its
  // record's sizes are as they should be; false else, and where there is one
  // thread. Chunks hold a block of bzip2 or so: the next ones are unpacked with
  // it, one for each thread, and those behind them while their messages are
  // taken.
  bool TakeAhead(const std::string& compression, std::size_t stored_size,
                 std::size_t size, UnpackedChunk* unpacked) {
    if (ThreadsHere() < 2) return false;
    const std::uint64_t place = input()->position();
    if (ahead_.count(place) == 0) {
      ahead_.clear();
      std::vector<Job> jobs;
      if (next_.valid()) jobs = next_.get();
      if (jobs.empty() || jobs.front().begin != place) {
        Job first;
        first.compression = compression;
        first.begin = place;
        first.stored_size = stored_size;
        first.size = size;
        jobs = Unpacked(JobsFrom(std::move(first)), ThreadsHere());
      }
      UnpackBehind(jobs);
      for (Job& job : jobs) ahead_[job.begin] = std::move(job.unpacked);
    }
    const auto found = ahead_.find(place);
    if (found == ahead_.end()) return false;
    *unpacked = std::move(found->second);
    ahead_.erase(found);
    return unpacked->is_whole && unpacked->consumed == stored_size;
  }

  // A chunk and those that follow, one for each thread, as far as they are near
  // and whole. `job` may be empty: the first one then lies behind `begin` and
  // `stored_size`.
  std::vector<Job> JobsFrom(Job job) {
    const auto most = static_cast<std::size_t>(ThreadsHere());
    const std::uint64_t place = input()->position();
    std::vector<Job> jobs;
    while (true) {
      const std::uint64_t begin = job.begin - place;
      const std::uint64_t end = begin + job.stored_size;
      if (end > kFarthestAhead) break;
      if (!job.compression.empty()) {
        const std::string_view view = input()->Peek(end);
        // What breaks off is left to who says so.
        if (view.size() < end) break;
        job.stored = view.substr(begin);
        jobs.push_back(std::move(job));
        if (jobs.size() == most) break;
      }
      const std::string_view view = input()->Peek(end + kUsualHeader);
      Record record;
      if (view.size() <= end ||
          ParseRecord(view.substr(end), &record) != Parsed::kRecord ||
          (record.op != kIndex && record.op != kChunk)) {
        break;
      }
      job = Job();
      job.begin = place + end + record.header_size;
      job.stored_size = record.data_size;
      if (record.op == kIndex) continue;
      std::uint64_t size = 0;
      Number(record.fields, "size", 4, &size);
      job.size = static_cast<std::size_t>(size);
      job.compression = Text(record.fields, "compression");
      // There is nothing to unpack.
      if (!IsKnownCompression(job.compression)) break;
    }
    return jobs;
  }

  static std::vector<Job> Unpacked(std::vector<Job> jobs, int num_threads) {
    ParallelFor(jobs.size(), num_threads, [&jobs](std::size_t i) {
      jobs[i].unpacked = UnpackChunk(jobs[i].compression, jobs[i].stored,
                                     jobs[i].size, kLargestRecord);
      jobs[i].stored = std::string();
    });
    return jobs;
  }

  // Begins to unpack the chunks behind these.
  void UnpackBehind(const std::vector<Job>& jobs) {
    if (jobs.empty()) return;
    Job last;
    last.begin = jobs.back().begin;
    last.stored_size = jobs.back().stored_size;
    std::vector<Job> behind = JobsFrom(std::move(last));
    if (behind.empty()) return;
    try {
      next_ = std::async(std::launch::async, Unpacked, std::move(behind),
                         ThreadsHere());
    } catch (const std::system_error&) {
      // They are unpacked when it is their turn.
    }
  }

  // What the bag says it has and has not.
  void Close() {
    if (!input()->damage().empty()) {
      Skip(input()->damage() + ": what was unpacked before it is used");
    } else if (chunks_stated_ > chunks_found_) {
      Skip("chunk that the bag says it has and that is not there",
           chunks_stated_ - chunks_found_);
    } else if (input()->position() < plain_end_) {
      Skip("chunk that breaks off: what came before is used");
    } else if (has_index_ && infos_found_ < chunks_stated_) {
      Skip("index that breaks off: the messages before it are all there");
    } else if (!has_index_ && !is_closed_) {
      Note(
          "the bag was not closed by its recorder and has no index: what there "
          "is of it is used");
    }
    is_closed_ = true;
    chunks_stated_ = 0;
    plain_end_ = 0;
  }

  // So many stored bytes are looked ahead.
  static constexpr std::size_t kFarthestAhead = std::size_t{1} << 26;
  // Headers are seldom longer.
  static constexpr std::size_t kUsualHeader = 512;

  std::map<std::uint64_t, std::size_t> connections_;
  // Chunks that are unpacked, by the place of their stored bytes, and those
  // that are being unpacked.
  std::map<std::uint64_t, UnpackedChunk> ahead_;
  std::future<std::vector<Job>> next_;
  std::int64_t chunks_stated_ = 0;
  std::int64_t chunks_found_ = 0;
  bool has_index_ = false;
  bool is_closed_ = false;
  std::int64_t infos_found_ = 0;
  // Where the last chunk that is not compressed says that it ends, counted as
  // the input's position.
  std::uint64_t plain_end_ = 0;
  bool at_end_ = false;
};

}  // namespace

bool LooksLikeRosbag1(std::string_view prefix) {
  return prefix.substr(0, kMagic.size()) == kMagic;
}

std::unique_ptr<BagSource> OpenRosbag1(InputStream* input) {
  return std::make_unique<Rosbag1>(input);
}

}  // namespace plumbline
