#include <bzlib.h>
#include <lz4frame.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/sha256.h>
#include <sqlite3.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <new>
#include <set>
#include <sstream>

namespace plumbline {
namespace {

namespace fs = std::filesystem;

constexpr char kMetadata[] = "metadata.yaml";

void Put(std::uint64_t value, std::size_t size, std::string* bytes) {
  for (std::size_t i = 0; i < size; ++i) {
    *bytes += static_cast<char>(value >> (8 * i) & 0xff);
  }
}

// Length, then the bytes.
void PutText(const std::string& text, std::string* bytes) {
  Put(text.size(), 4, bytes);
  *bytes += text;
}

class Encoder {
 public:
  Encoder(MessageEncoding encoding, bool big_endian)
      : encoding_(encoding), big_endian_(big_endian) {
    if (encoding == MessageEncoding::kCdr) {
      bytes_ = std::string(big_endian ? "\0\0\0\0" : "\0\1\0\0", 4);
      origin_ = 4;
    }
  }
  void Number(std::uint64_t value, std::size_t size) {
    if (encoding_ == MessageEncoding::kCdr) {
      while ((bytes_.size() - origin_) % size != 0) bytes_ += '\0';
    }
    std::string number;
    Put(value, size, &number);
    if (big_endian_) std::reverse(number.begin(), number.end());
    bytes_ += number;
  }
  void Float32(double value) {
    const auto narrow = static_cast<float>(value);
    std::uint32_t bits = 0;
    std::memcpy(&bits, &narrow, sizeof bits);
    Number(bits, 4);
  }
  void Float64(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    Number(bits, 8);
  }
  void Zeros(int count) {
    for (int i = 0; i < count; ++i) Float64(0.0);
  }
  void Text(const std::string& text) {
    const bool has_end = encoding_ == MessageEncoding::kCdr;
    Number(text.size() + (has_end ? 1 : 0), 4);
    bytes_ += text;
    if (has_end) bytes_ += '\0';
  }
  void Header(const MessageHeader& header) {
    if (encoding_ == MessageEncoding::kRos1) Number(0, 4);
    Number(static_cast<std::uint64_t>(header.stamp / 1000000000), 4);
    Number(static_cast<std::uint64_t>(header.stamp % 1000000000), 4);
    Text(header.frame);
  }
  void Pose(const Pose3Message& pose) {
    for (const double value :
         {pose.x, pose.y, pose.z, pose.qx, pose.qy, pose.qz, pose.qw}) {
      Float64(value);
    }
  }
  std::string Take() { return std::move(bytes_); }

 private:
  MessageEncoding encoding_;
  bool big_endian_;
  std::string bytes_;
  std::size_t origin_ = 0;
};

constexpr char kHeader1[] =
    "================================================================="
    "===============\n"
    "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
constexpr char kHeader2[] =
    "================================================================="
    "===============\n"
    "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    "================================================================="
    "===============\n"
    "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
constexpr char kRule[] =
    "================================================================="
    "===============\n";

struct Definition {
  const char* md5;
  // Without the header's.
  std::string text;
};

// Of the types that are written.
const Definition& DefinitionOf(const std::string& type) {
  static const auto* const definitions = new std::map<std::string, Definition>{
      {"sensor_msgs/LaserScan",
       {"90c7ef2dc6895d81024acba2ac42f369",
        "Header header\nfloat32 angle_min\nfloat32 angle_max\n"
        "float32 angle_increment\nfloat32 time_increment\nfloat32 scan_time\n"
        "float32 range_min\nfloat32 range_max\nfloat32[] ranges\n"
        "float32[] intensities\n"}},
      {"sensor_msgs/MultiEchoLaserScan",
       {"6fefb0c6da89d7c8abe4b339f5c2f8fb",
        "Header header\nfloat32 angle_min\nfloat32 angle_max\n"
        "float32 angle_increment\nfloat32 time_increment\nfloat32 scan_time\n"
        "float32 range_min\nfloat32 range_max\nLaserEcho[] ranges\n"
        "LaserEcho[] intensities\n" +
            std::string(kRule) +
            "MSG: sensor_msgs/LaserEcho\nfloat32[] echoes\n"}},
      {"sensor_msgs/Imu",
       {"6a62c6daae103f4ff57a132d6f95cec2",
        "Header header\ngeometry_msgs/Quaternion orientation\n"
        "float64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\n"
        "float64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\n"
        "float64[9] linear_acceleration_covariance\n" +
            std::string(kRule) +
            "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\n"
            "float64 w\n" +
            kRule +
            "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"}},
      {"nav_msgs/Odometry",
       {"cd5e73d190d741a2f92e81eda573aca7",
        "Header header\nstring child_frame_id\n"
        "geometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist\n" +
            std::string(kRule) +
            "MSG: geometry_msgs/PoseWithCovariance\nPose pose\n"
            "float64[36] covariance\n" +
            kRule +
            "MSG: geometry_msgs/Pose\nPoint position\nQuaternion "
            "orientation\n" +
            kRule +
            "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n" +
            kRule +
            "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\n"
            "float64 w\n" +
            kRule +
            "MSG: geometry_msgs/TwistWithCovariance\nTwist twist\n"
            "float64[36] covariance\n" +
            kRule +
            "MSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n" +
            kRule +
            "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"}},
      {"tf2_msgs/TFMessage",
       {"94810edda583a504dfda3829e70d7eec",
        "geometry_msgs/TransformStamped[] transforms\n" + std::string(kRule) +
            "MSG: geometry_msgs/TransformStamped\nHeader header\n"
            "string child_frame_id\nTransform transform\n" +
            kRule +
            "MSG: geometry_msgs/Transform\nVector3 translation\n"
            "Quaternion rotation\n" +
            kRule +
            "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n" +
            kRule +
            "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\n"
            "float64 w\n"}}};
  static const auto* const unknown = new Definition{"*", ""};
  const auto entry = definitions->find(type);
  return entry == definitions->end() ? *unknown : entry->second;
}

// As ROS 2 has it, where "Header" needs its package.
std::string Ros2Definition(const std::string& type) {
  std::string text = DefinitionOf(type).text;
  std::size_t place = 0;
  while ((place = text.find("Header header", place)) != std::string::npos) {
    text.insert(place, "std_msgs/");
    place += 20;
  }
  return text.find("std_msgs/") == std::string::npos ? text : text + kHeader2;
}

std::string Ros2Type(const std::string& type) {
  const std::size_t slash = type.find('/');
  return slash == std::string::npos
             ? type
             : type.substr(0, slash) + "/msg" + type.substr(slash);
}

std::string Compressed(const std::string& kind, const std::string& bytes) {
  std::string packed;
  if (kind == "none") return bytes;
  if (kind == "bz2") {
    unsigned size =
        static_cast<unsigned>(bytes.size() + bytes.size() / 50 + 1000);
    packed.resize(size);
    if (BZ2_bzBuffToBuffCompress(
            packed.data(), &size, const_cast<char*>(bytes.data()),
            static_cast<unsigned>(bytes.size()), 9, 0, 0) != BZ_OK) {
      throw PLUMBLINE_ERROR("libbz2 cannot compress", "enough memory");
    }
    packed.resize(size);
  } else if (kind == "lz4") {
    packed.resize(LZ4F_compressFrameBound(bytes.size(), nullptr));
    const std::size_t size = LZ4F_compressFrame(
        packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr);
    if (LZ4F_isError(size)) {
      throw PLUMBLINE_ERROR("liblz4 cannot compress", "enough memory");
    }
    packed.resize(size);
  } else if (kind == "zstd") {
    packed.resize(ZSTD_compressBound(bytes.size()));
    const std::size_t size = ZSTD_compress(packed.data(), packed.size(),
                                           bytes.data(), bytes.size(), 3);
    if (ZSTD_isError(size)) {
      throw PLUMBLINE_ERROR("libzstd cannot compress", "enough memory");
    }
    packed.resize(size);
  } else {
    throw PLUMBLINE_ERROR("unknown compression '" + kind + "'",
                          "none, bz2, lz4 or zstd");
  }
  return packed;
}

// Index of each record's topic, in the order in which they first occur.
std::vector<std::size_t> Topics(const std::vector<BagRecord>& records,
                                std::vector<const BagRecord*>* topics) {
  std::map<std::string, std::size_t> known;
  std::vector<std::size_t> indices;
  for (const BagRecord& record : records) {
    const auto [entry, is_new] = known.emplace(record.topic, topics->size());
    if (is_new) topics->push_back(&record);
    indices.push_back(entry->second);
  }
  return indices;
}

// Fields of a record's header: name and value.
using Fields = std::vector<std::pair<std::string, std::string>>;

std::string Number(std::uint64_t value, std::size_t size) {
  std::string bytes;
  Put(value, size, &bytes);
  return bytes;
}

std::string FieldBytes(const Fields& fields) {
  std::string bytes;
  for (const auto& [name, value] : fields) PutText(name + "=" + value, &bytes);
  return bytes;
}

void PutRecord(const Fields& header, const std::string& data,
               std::string* bytes) {
  PutText(FieldBytes(header), bytes);
  PutText(data, bytes);
}

std::string RosTime(std::int64_t time) {
  return Number(static_cast<std::uint64_t>(time / 1000000000), 4) +
         Number(static_cast<std::uint64_t>(time % 1000000000), 4);
}

void PutConnection(const BagRecord& topic, std::size_t index,
                   std::string* bytes) {
  const Definition& definition = DefinitionOf(topic.type);
  const std::string number = Number(index, 4);
  PutRecord(
      {{"conn", number}, {"op", "\x07"}, {"topic", topic.topic}},
      FieldBytes({{"message_definition",
                   definition.text.find("Header header") == std::string::npos
                       ? definition.text
                       : definition.text + kHeader1},
                  {"md5sum", definition.md5},
                  {"topic", topic.topic},
                  {"type", topic.type}}),
      bytes);
}

struct Chunk1 {
  std::uint64_t place = 0;
  std::int64_t begin = 0;
  std::int64_t end = 0;
  // By topic: time and place in the chunk of each message.
  std::map<std::size_t, std::vector<std::pair<std::int64_t, std::size_t>>>
      messages;
};

constexpr std::size_t kBagHeaderSize = 4096;

std::string BagHeader1(std::uint64_t index, std::size_t topics,
                       std::size_t chunks) {
  const std::string header = FieldBytes({{"chunk_count", Number(chunks, 4)},
                                         {"conn_count", Number(topics, 4)},
                                         {"index_pos", Number(index, 8)},
                                         {"op", "\x03"}});
  std::string bytes;
  PutText(header, &bytes);
  PutText(std::string(kBagHeaderSize - 8 - header.size(), ' '), &bytes);
  return bytes;
}

// Makes an MCAP file.
class McapFile {
 public:
  McapFile(const std::vector<BagRecord>& records,
           const BagWriterOptions& options)
      : records_(records),
        options_(options),
        topic_of_(Topics(records, &topics_)) {}

  std::string Make() {
    bytes_ = kMagic;
    std::string header;
    PutText("ros2", &header);
    PutText("plumbline", &header);
    PutMcap(kHeader, header, &bytes_);
    std::vector<bool> described(topics_.size(), false);
    for (std::size_t i = 0; i < records_.size(); ++i) {
      if (content_.empty()) info_.begin = records_[i].time;
      const std::size_t topic = topic_of_[i];
      if (!described[topic]) PutTopic(topic, &content_);
      described[topic] = true;
      PutMessage(i);
      if (content_.size() >= options_.chunk_size) CloseChunk();
    }
    CloseChunk();
    // Checksums of 0 are none.
    PutMcap(kDataEnd, Number(0, 4), &bytes_);
    const std::size_t summary = options_.index ? bytes_.size() : 0;
    if (options_.index) PutSummary();
    PutMcap(kFooter, Number(summary, 8) + Number(0, 8) + Number(0, 4), &bytes_);
    return bytes_ + kMagic;
  }

 private:
  enum Opcode : unsigned char {
    kHeader = 0x01,
    kFooter = 0x02,
    kSchema = 0x03,
    kChannel = 0x04,
    kMessage = 0x05,
    kChunk = 0x06,
    kMessageIndex = 0x07,
    kChunkIndex = 0x08,
    kStatistics = 0x0b,
    kDataEnd = 0x0f,
  };

  // What the index says of a chunk.
  struct ChunkInfo {
    std::int64_t begin = 0;
    std::int64_t end = 0;
    std::size_t place = 0;
    std::size_t size = 0;
    std::size_t index_size = 0;
    std::size_t packed_size = 0;
    std::size_t content_size = 0;
    // By topic: time and place in the chunk of each message.
    std::map<std::size_t, std::vector<std::pair<std::int64_t, std::size_t>>>
        messages;
    // By topic: where the index of its messages stands in the file.
    std::map<std::size_t, std::size_t> index_places;
  };

  static void PutMcap(Opcode opcode, const std::string& content,
                      std::string* bytes) {
    *bytes += static_cast<char>(opcode);
    Put(content.size(), 8, bytes);
    *bytes += content;
  }

  static std::string Time(std::int64_t time) {
    return Number(static_cast<std::uint64_t>(time), 8);
  }

  std::string Compression() const {
    return options_.compression == "none" ? "" : options_.compression;
  }

  // Schema and channel.
  void PutTopic(std::size_t topic, std::string* bytes) const {
    std::string schema = Number(topic + 1, 2);
    PutText(Ros2Type(topics_[topic]->type), &schema);
    PutText("ros2msg", &schema);
    PutText(Ros2Definition(topics_[topic]->type), &schema);
    PutMcap(kSchema, schema, bytes);
    std::string channel = Number(topic, 2) + Number(topic + 1, 2);
    PutText(topics_[topic]->topic, &channel);
    PutText("cdr", &channel);
    Put(0, 4, &channel);
    PutMcap(kChannel, channel, bytes);
  }

  void PutMessage(std::size_t i) {
    const std::int64_t time = records_[i].time;
    info_.messages[topic_of_[i]].emplace_back(time, content_.size());
    info_.end = time;
    PutMcap(kMessage,
            Number(topic_of_[i], 2) + Number(i, 4) + Time(time) + Time(time) +
                records_[i].data,
            &content_);
  }

  void CloseChunk() {
    if (content_.empty()) return;
    if (options_.chunks) {
      PutChunk();
    } else {
      bytes_ += content_;
    }
    info_ = ChunkInfo();
    content_.clear();
  }

  void PutChunk() {
    const std::string packed = Compressed(options_.compression, content_);
    std::string chunk = Time(info_.begin) + Time(info_.end);
    Put(content_.size(), 8, &chunk);
    Put(crc32(0, reinterpret_cast<const Bytef*>(content_.data()),
              static_cast<uInt>(content_.size())),
        4, &chunk);
    PutText(Compression(), &chunk);
    Put(packed.size(), 8, &chunk);
    chunk += packed;
    info_.place = bytes_.size();
    PutMcap(kChunk, chunk, &bytes_);
    info_.size = bytes_.size() - info_.place;
    info_.packed_size = packed.size();
    info_.content_size = content_.size();
    if (!options_.index) return;
    const std::size_t index = bytes_.size();
    for (const auto& [topic, messages] : info_.messages) {
      std::string entries;
      for (const auto& [time, place] : messages) {
        entries += Time(time) + Number(place, 8);
      }
      info_.index_places[topic] = bytes_.size();
      std::string content = Number(topic, 2);
      PutText(entries, &content);
      PutMcap(kMessageIndex, content, &bytes_);
    }
    info_.index_size = bytes_.size() - index;
    chunks_.push_back(std::move(info_));
  }

  // All topics, counts, and where the chunks are.
  void PutSummary() {
    for (std::size_t i = 0; i < topics_.size(); ++i) PutTopic(i, &bytes_);
    std::map<std::size_t, std::uint64_t> counts;
    std::int64_t begin = records_.empty() ? 0 : records_.front().time;
    std::int64_t end = begin;
    for (std::size_t i = 0; i < records_.size(); ++i) {
      ++counts[topic_of_[i]];
      begin = std::min(begin, records_[i].time);
      end = std::max(end, records_[i].time);
    }
    std::string by_topic;
    for (const auto& [topic, count] : counts) {
      by_topic += Number(topic, 2) + Number(count, 8);
    }
    // No attachments, no metadata.
    std::string statistics =
        Number(records_.size(), 8) + Number(topics_.size(), 2) +
        Number(topics_.size(), 4) + Number(0, 4) + Number(0, 4) +
        Number(chunks_.size(), 4) + Time(begin) + Time(end);
    PutText(by_topic, &statistics);
    PutMcap(kStatistics, statistics, &bytes_);
    for (const ChunkInfo& info : chunks_) {
      std::string places;
      for (const auto& [topic, place] : info.index_places) {
        places += Number(topic, 2) + Number(place, 8);
      }
      std::string content = Time(info.begin) + Time(info.end) +
                            Number(info.place, 8) + Number(info.size, 8);
      PutText(places, &content);
      Put(info.index_size, 8, &content);
      PutText(Compression(), &content);
      content += Number(info.packed_size, 8) + Number(info.content_size, 8);
      PutMcap(kChunkIndex, content, &bytes_);
    }
  }

  static inline const std::string kMagic{"\x89MCAP0\r\n", 8};

  const std::vector<BagRecord>& records_;
  const BagWriterOptions& options_;
  std::vector<const BagRecord*> topics_;
  std::vector<std::size_t> topic_of_;
  std::string bytes_;
  // Of the present chunk.
  std::string content_;
  ChunkInfo info_;
  std::vector<ChunkInfo> chunks_;
};

// A number with so many digits, as the text of a CARMEN log would give it back.
double Rounded(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return std::strtod(text, nullptr);
}

Pose3Message ToPose(const Pose2& pose) {
  Pose3Message message;
  message.x = Rounded(pose[0], 6);
  message.y = Rounded(pose[1], 6);
  const double half = 0.5 * Rounded(pose[2], 6);
  message.qz = std::sin(half);
  message.qw = std::cos(half);
  return message;
}

// Microseconds, as the text of a CARMEN log has them.
std::int64_t StampOf(double time) { return std::llround(time * 1e6) * 1000; }

// In memory, so that the file comes to stand whole.
class Database {
 public:
  // `path`: what messages name.
  explicit Database(const std::string& path) : path_(path) {
    if (sqlite3_open_v2(":memory:", &database_,
                        SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE,
                        nullptr) != SQLITE_OK) {
      Fail();
    }
  }
  ~Database() { sqlite3_close(database_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void Run(const char* text) {
    if (sqlite3_exec(database_, text, nullptr, nullptr, nullptr) != SQLITE_OK) {
      Fail();
    }
  }
  sqlite3_stmt* Prepare(const char* text) {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database_, text, -1, &statement, nullptr) !=
        SQLITE_OK) {
      Fail();
    }
    return statement;
  }
  void Step(sqlite3_stmt* statement) {
    if (sqlite3_step(statement) != SQLITE_DONE) Fail();
    sqlite3_reset(statement);
  }
  // The content of a file with this database.
  std::string Bytes() {
    sqlite3_int64 size = 0;
    unsigned char* const bytes = sqlite3_serialize(database_, "main", &size, 0);
    if (bytes == nullptr) throw std::bad_alloc();
    const std::string content(reinterpret_cast<const char*>(bytes),
                              static_cast<std::size_t>(size));
    sqlite3_free(bytes);
    return content;
  }
  [[noreturn]] void Fail() {
    throw Error(path_, 0,
                std::string("cannot be made: ") + sqlite3_errmsg(database_),
                "messages that fit into a database");
  }

 private:
  std::string path_;
  sqlite3* database_ = nullptr;
};

std::string MakeDatabase(const std::vector<BagRecord>& records,
                         const std::vector<const BagRecord*>& topics,
                         const std::vector<std::size_t>& topic_of,
                         const std::string& path) {
  Database database(path);
  database.Run(
      "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF; BEGIN;"
      "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,"
      "ros_distro TEXT NOT NULL);"
      "CREATE TABLE metadata(id INTEGER PRIMARY KEY,"
      "metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);"
      "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,"
      "type TEXT NOT NULL,serialization_format TEXT NOT NULL,"
      "offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY,"
      "topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL,"
      "data BLOB NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
      "INSERT INTO schema VALUES (3, 'humble');");
  sqlite3_stmt* const topic =
      database.Prepare("INSERT INTO topics VALUES (?,?,?,'cdr','')");
  for (std::size_t i = 0; i < topics.size(); ++i) {
    const std::string type = Ros2Type(topics[i]->type);
    sqlite3_bind_int64(topic, 1, static_cast<sqlite3_int64>(i + 1));
    sqlite3_bind_text(topic, 2, topics[i]->topic.c_str(), -1, SQLITE_TRANSIENT);
    sqlite3_bind_text(topic, 3, type.c_str(), -1, SQLITE_TRANSIENT);
    database.Step(topic);
  }
  sqlite3_finalize(topic);
  sqlite3_stmt* const message = database.Prepare(
      "INSERT INTO messages(topic_id,timestamp,data) VALUES (?,?,?)");
  for (std::size_t i = 0; i < records.size(); ++i) {
    sqlite3_bind_int64(message, 1, static_cast<sqlite3_int64>(topic_of[i] + 1));
    sqlite3_bind_int64(message, 2, records[i].time);
    sqlite3_bind_blob(message, 3, records[i].data.data(),
                      static_cast<int>(records[i].data.size()), SQLITE_STATIC);
    database.Step(message);
  }
  sqlite3_finalize(message);
  database.Run("COMMIT");
  return database.Bytes();
}

std::string DigestOf(const std::string& text) {
  Sha256 digest;
  digest.Update(text);
  return digest.HexDigest();
}

// metadata.yaml begins with lines that prove who wrote the bag: the digests
// that the database may have, and that of the lines of YAML that follow.
constexpr char kDatabaseLine[] = "# plumbline: SHA-256 of the database: ";
constexpr char kTextLine[] = "# plumbline: SHA-256 of the lines below: ";

std::string SignedMetadata(const std::set<std::string>& digests,
                           const std::string& text) {
  std::string content;
  for (const std::string& digest : digests) {
    content += kDatabaseLine + digest + '\n';
  }
  return content + kTextLine + DigestOf(text) + '\n' + text;
}

// Whether all that is in a folder are files of SignedMetadata and the database
// that it tells of, if that is there.
bool IsOurBag(const fs::path& folder, const std::string& database) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if ((name != kMetadata && name != database) ||
        !fs::is_regular_file(fs::symlink_status(entry->path(), error))) {
      return false;
    }
  }
  std::ifstream file(folder / kMetadata, std::ios::binary);
  std::set<std::string> digests;
  std::string line;
  const auto value = [&line](const std::string& key) {
    return line.compare(0, key.size(), key) == 0 ? line.substr(key.size()) : "";
  };
  while (std::getline(file, line) && !value(kDatabaseLine).empty()) {
    digests.insert(value(kDatabaseLine));
  }
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return value(kTextLine) == DigestOf(text) &&
         (!fs::exists(folder / database, error) ||
          digests.count(Sha256OfFile((folder / database).string())) > 0);
}

// Folders on the way to one, itself included, that are not there yet, the
// innermost first.
std::vector<fs::path> MissingFolders(const fs::path& folder) {
  std::vector<fs::path> missing;
  std::error_code error;
  fs::path path = folder.lexically_normal();
  // "bag/" is "bag".
  if (path.filename().empty()) path = path.parent_path();
  while (!path.empty() && !fs::exists(fs::symlink_status(path, error))) {
    missing.push_back(path);
    path = path.parent_path();
  }
  return missing;
}

// Takes back what was begun of a bag unless it is done: the description that
// was there before, or none, and no folder that was made for it.
class BeginningOfBag {
 public:
  BeginningOfBag(const fs::path& folder, const std::string& database)
      : metadata_(folder / kMetadata),
        database_(folder / database),
        made_(MissingFolders(folder)) {
    std::error_code error;
    has_old_ = fs::exists(metadata_, error);
    has_old_database_ = fs::exists(database_, error);
    if (!has_old_) return;
    std::ifstream file(metadata_, std::ios::binary);
    old_.assign(std::istreambuf_iterator<char>(file), {});
  }
  ~BeginningOfBag() {
    if (is_done_) return;
    std::error_code ignored;
    if (!has_old_database_) fs::remove(database_, ignored);
    if (!has_old_) {
      fs::remove(metadata_, ignored);
    } else if (!is_old_replaced_) {
      try {
        WriteFileAtomically(metadata_.string(),
                            [this](std::ostream& out) { out << old_; });
      } catch (const Error&) {
        // The description that says nothing but whose the bag is stays.
      }
    }
    // Only those that are empty go.
    for (const fs::path& folder : made_) fs::remove(folder, ignored);
  }
  BeginningOfBag(const BeginningOfBag&) = delete;
  BeginningOfBag& operator=(const BeginningOfBag&) = delete;

  // The new database is there, which an older description is not of.
  void DatabaseIsWritten() { is_old_replaced_ = has_old_database_; }
  void Done() { is_done_ = true; }

 private:
  fs::path metadata_, database_;
  std::vector<fs::path> made_;
  std::string old_;
  bool has_old_ = false;
  bool has_old_database_ = false;
  bool is_old_replaced_ = false;
  bool is_done_ = false;
};

// What LaserScan and MultiEchoLaserScan begin with.
void EncodeScanUpToRanges(const LaserScanMessage& message, Encoder* encoder) {
  encoder->Header(message.header);
  for (const double value :
       {message.angle_min, message.angle_max, message.angle_increment,
        message.time_increment, message.scan_time, message.range_min,
        message.range_max}) {
    encoder->Float32(value);
  }
  encoder->Number(message.ranges.size(), 4);
}

}  // namespace

std::string EncodeLaserScan(const LaserScanMessage& message,
                            MessageEncoding encoding, bool big_endian) {
  Encoder encoder(encoding, big_endian);
  EncodeScanUpToRanges(message, &encoder);
  for (const float range : message.ranges) encoder.Float32(range);
  encoder.Number(0, 4);
  return encoder.Take();
}

std::string EncodeMultiEchoLaserScan(const LaserScanMessage& message,
                                     MessageEncoding encoding,
                                     bool big_endian) {
  Encoder encoder(encoding, big_endian);
  EncodeScanUpToRanges(message, &encoder);
  for (std::size_t i = 0; i < message.ranges.size(); ++i) {
    const float range = message.ranges[i];
    if (!(range > 0.0f) || !std::isfinite(range)) {
      encoder.Number(0, 4);
      continue;
    }
    const bool is_double = i % 3 == 0;
    encoder.Number(is_double ? 2 : 1, 4);
    encoder.Float32(range);
    if (is_double) encoder.Float32(range + 0.5f);
  }
  encoder.Number(0, 4);
  return encoder.Take();
}

std::string EncodeOdometry(const OdometryMessage& message,
                           MessageEncoding encoding, bool big_endian) {
  Encoder encoder(encoding, big_endian);
  encoder.Header(message.header);
  encoder.Text(message.child_frame);
  encoder.Pose(message.pose);
  encoder.Zeros(36 + 6 + 36);
  return encoder.Take();
}

std::string EncodeTransforms(const std::vector<TransformMessage>& messages,
                             MessageEncoding encoding, bool big_endian) {
  Encoder encoder(encoding, big_endian);
  encoder.Number(messages.size(), 4);
  for (const TransformMessage& message : messages) {
    encoder.Header(message.header);
    encoder.Text(message.child_frame);
    encoder.Pose(message.transform);
  }
  return encoder.Take();
}

std::string EncodeImu(const ImuMessage& message, MessageEncoding encoding,
                      bool big_endian) {
  Encoder encoder(encoding, big_endian);
  encoder.Header(message.header);
  encoder.Pose({0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0});
  encoder.Zeros(6 + 2);
  encoder.Float64(message.yaw_rate);
  encoder.Zeros(9 + 3 + 9);
  return encoder.Take();
}

std::string MakeRosbag1(const std::vector<BagRecord>& records,
                        const BagWriterOptions& options) {
  std::vector<const BagRecord*> topics;
  const std::vector<std::size_t> topic_of = Topics(records, &topics);
  std::string bytes = "#ROSBAG V2.0\n";
  const std::size_t header_place = bytes.size();
  bytes += BagHeader1(0, 0, 0);
  std::vector<Chunk1> chunks;
  Chunk1 chunk;
  std::string content;
  std::vector<bool> described(topics.size(), false);
  const auto close = [&] {
    if (content.empty()) return;
    chunk.place = bytes.size();
    PutRecord({{"compression", options.compression},
               {"op", "\x05"},
               {"size", Number(content.size(), 4)}},
              Compressed(options.compression, content), &bytes);
    for (const auto& [topic, messages] : chunk.messages) {
      std::string data;
      for (const auto& [time, place] : messages) {
        data += RosTime(time) + Number(place, 4);
      }
      PutRecord({{"conn", Number(topic, 4)},
                 {"count", Number(messages.size(), 4)},
                 {"op", "\x04"},
                 {"ver", Number(1, 4)}},
                data, &bytes);
    }
    chunks.push_back(std::move(chunk));
    chunk = Chunk1();
    content.clear();
  };
  for (std::size_t i = 0; i < records.size(); ++i) {
    const std::size_t topic = topic_of[i];
    if (!described[topic]) PutConnection(*topics[topic], topic, &content);
    described[topic] = true;
    if (chunk.messages.empty()) chunk.begin = records[i].time;
    chunk.end = records[i].time;
    chunk.messages[topic].emplace_back(records[i].time, content.size());
    PutRecord({{"conn", Number(topic, 4)},
               {"op", "\x02"},
               {"time", RosTime(records[i].time)}},
              records[i].data, &content);
    if (content.size() >= options.chunk_size) close();
  }
  close();
  if (!options.index) return bytes;
  const std::size_t index = bytes.size();
  for (std::size_t i = 0; i < topics.size(); ++i) {
    PutConnection(*topics[i], i, &bytes);
  }
  for (const Chunk1& info : chunks) {
    std::string data;
    for (const auto& [topic, messages] : info.messages) {
      data += Number(topic, 4) + Number(messages.size(), 4);
    }
    PutRecord({{"chunk_pos", Number(info.place, 8)},
               {"count", Number(info.messages.size(), 4)},
               {"end_time", RosTime(info.end)},
               {"op", "\x06"},
               {"start_time", RosTime(info.begin)},
               {"ver", Number(1, 4)}},
              data, &bytes);
  }
  bytes.replace(header_place, kBagHeaderSize,
                BagHeader1(index, topics.size(), chunks.size()));
  return bytes;
}

std::string MakeMcap(const std::vector<BagRecord>& records,
                     const BagWriterOptions& options) {
  return McapFile(records, options).Make();
}

void WriteRosbag2(const std::vector<BagRecord>& records,
                  const std::string& folder) {
  std::error_code error;
  const fs::path path(folder);
  std::string name = path.filename().string();
  if (name.empty()) name = path.parent_path().filename().string();
  const std::string file = name + "_0.db3";
  if (fs::exists(fs::symlink_status(path, error)) &&
      !(fs::is_directory(path, error) &&
        (fs::is_empty(path, error) || IsOurBag(path, file)))) {
    throw Error(folder, 0, "holds something else than this program wrote there",
                "a new or empty folder, or a ROS 2 bag that was simulated "
                "there and not changed");
  }
  BeginningOfBag beginning(path, file);
  fs::create_directories(path, error);
  if (error) {
    throw Error(folder, 0, "cannot be made: " + error.message(),
                "a folder to write to");
  }
  const std::string whole = (path / file).string();
  const std::string metadata = (path / kMetadata).string();
  std::vector<const BagRecord*> topics;
  const std::vector<std::size_t> topic_of = Topics(records, &topics);
  const std::string database = MakeDatabase(records, topics, topic_of, whole);
  const std::string digest = DigestOf(database);
  const auto write = [](const std::string& place, const std::string& content) {
    WriteFileAtomically(
        place, [&content](std::ostream& output) { output << content; });
  };
  // Until all is there the description says nothing but whose the bag is.
  std::set<std::string> digests = {digest};
  if (fs::exists(whole, error)) digests.insert(Sha256OfFile(whole));
  write(metadata, SignedMetadata(digests, ""));
  write(whole, database);
  beginning.DatabaseIsWritten();
  std::vector<std::int64_t> counts(topics.size(), 0);
  for (const std::size_t topic : topic_of) ++counts[topic];
  std::int64_t begin = records.empty() ? 0 : records.front().time;
  std::int64_t end = begin;
  for (const BagRecord& record : records) {
    begin = std::min(begin, record.time);
    end = std::max(end, record.time);
  }
  // Of times that cannot be, too.
  const std::uint64_t duration =
      static_cast<std::uint64_t>(end) - static_cast<std::uint64_t>(begin);
  std::ostringstream text;
  text << "rosbag2_bagfile_information:\n"
          "  version: 5\n"
          "  storage_identifier: sqlite3\n"
          "  duration:\n"
          "    nanoseconds: "
       << duration
       << "\n  starting_time:\n"
          "    nanoseconds_since_epoch: "
       << begin << "\n  message_count: " << records.size()
       << "\n  topics_with_message_count:\n";
  for (std::size_t i = 0; i < topics.size(); ++i) {
    text << "    - topic_metadata:\n        name: " << topics[i]->topic
         << "\n        type: " << Ros2Type(topics[i]->type)
         << "\n        serialization_format: cdr\n"
            "        offered_qos_profiles: \"\"\n"
            "      message_count: "
         << counts[i] << '\n';
  }
  text << "  compression_format: \"\"\n"
          "  compression_mode: \"\"\n"
          "  relative_file_paths:\n    - "
       << file << '\n';
  write(metadata, SignedMetadata({digest}, text.str()));
  beginning.Done();
}

std::vector<BagRecord> SimulatedMessages(const Simulation& simulation,
                                         const LaserModel& laser,
                                         MessageEncoding encoding) {
  std::vector<BagRecord> records;
  if (simulation.states.empty()) return records;
  const std::int64_t start = StampOf(simulation.states.front().time);
  TransformMessage mount;
  mount.header = {start, "base_link"};
  mount.child_frame = "laser";
  mount.transform = ToPose(Pose2(laser.offset, 0.0, 0.0));
  records.push_back({"/tf_static", "tf2_msgs/TFMessage", start,
                     EncodeTransforms({mount}, encoding)});
  const int intervals = laser.beams % 2 == 0 ? laser.beams : laser.beams - 1;
  for (const SimulatedState& state : simulation.states) {
    const std::int64_t stamp = StampOf(state.time);
    OdometryMessage odometry;
    odometry.header = {stamp, "odom"};
    odometry.child_frame = "base_link";
    odometry.pose = ToPose(state.odometry);
    records.push_back({"/odom", "nav_msgs/Odometry", stamp,
                       EncodeOdometry(odometry, encoding)});
    TransformMessage transform;
    transform.header = odometry.header;
    transform.child_frame = odometry.child_frame;
    transform.transform = odometry.pose;
    records.push_back({"/tf", "tf2_msgs/TFMessage", stamp,
                       EncodeTransforms({transform}, encoding)});
    if (state.ranges.empty()) continue;
    LaserScanMessage scan;
    scan.header = {stamp, "laser"};
    scan.angle_increment = kPi / intervals;
    scan.angle_min = -0.5 * kPi;
    scan.angle_max =
        scan.angle_min +
        scan.angle_increment * static_cast<double>(state.ranges.size() - 1);
    scan.range_min = 0.005;
    scan.range_max = laser.maximum_range;
    for (const double range : state.ranges) {
      scan.ranges.push_back(IsReturn(range, laser)
                                ? static_cast<float>(Rounded(range, 2))
                                : std::numeric_limits<float>::infinity());
    }
    records.push_back({"/scan", "sensor_msgs/LaserScan", stamp,
                       EncodeLaserScan(scan, encoding)});
  }
  return records;
}

}  // namespace plumbline
