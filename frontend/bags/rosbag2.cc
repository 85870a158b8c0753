#include <fcntl.h>
#include <plumbline/core/error.h>
#include <plumbline/core/late_library.h>
#include <plumbline/core/text_file.h>
#include <plumbline/frontend/bags/chunk_unpacker.h>
#include <plumbline/frontend/bags/mcap.h>
#include <plumbline/frontend/bags/rosbag1.h>
#include <plumbline/frontend/bags/rosbag2.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <sstream>
#include <utility>

namespace plumbline {
namespace {

LateLibrary sqlite_library("libsqlite3.so.0");
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_close_v2);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_column_blob);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_column_bytes);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_column_int64);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_column_text);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_column_type);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_db_config);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_errcode);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_errmsg);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_exec);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_finalize);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_limit);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_open_v2);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_prepare_v2);
PLUMBLINE_LATE_FUNCTION(sqlite_library, sqlite3_step);

namespace fs = std::filesystem;

constexpr std::string_view kSqliteMagic("SQLite format 3\0", 16);
// Bytes of metadata.yaml, and of a message.
constexpr std::size_t kLargestMetadata = std::size_t{1} << 26;
constexpr std::size_t kLargestMessage = std::size_t{1} << 28;
// Bytes of a database before its first table.
constexpr std::size_t kSqliteHeader = 100;
constexpr char kExpected[] = "the messages and topics of a ROS 2 bag";

// A file that is gone when this is, with what a stream holds.
class TemporaryFile {
 public:
  // The file exists from here on, so that it goes whatever is thrown.
  explicit TemporaryFile(InputStream* input) : TemporaryFile() {
    for (;;) {
      const std::string_view piece = input->Peek(std::size_t{1} << 18);
      if (piece.empty()) break;
      Write(piece, *input);
      input->Consume(piece.size());
    }
    close(std::exchange(descriptor_, -1));
  }
  ~TemporaryFile() {
    if (descriptor_ >= 0) close(descriptor_);
    unlink(path_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  TemporaryFile() {
    std::error_code error;
    fs::path folder = fs::temp_directory_path(error);
    if (error) folder = "/tmp";
    path_ = (folder / "plumbline-XXXXXX").string();
    descriptor_ = mkostemp(path_.data(), O_CLOEXEC);
    if (descriptor_ < 0) {
      throw Error(path_, 0,
                  std::string("cannot be made: ") + std::strerror(errno),
                  "a folder to write to (TMPDIR)");
    }
  }

  void Write(std::string_view rest, const InputStream& input) {
    while (!rest.empty()) {
      const ssize_t count = write(descriptor_, rest.data(), rest.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) {
        throw Error(path_, 0,
                    std::string("cannot be written: ") + std::strerror(errno),
                    "room for " + input.name() + " unpacked (TMPDIR)");
      }
      rest.remove_prefix(static_cast<std::size_t>(count));
    }
  }

  std::string path_;
  int descriptor_ = -1;
};

struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const {
    sqlite3_finalize(statement);
  }
};
using Statement = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

// A path as the name in a URI.
std::string UriOf(const std::string& path, bool is_immutable) {
  std::string uri = "file:";
  for (const char c : path) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 ||
        std::strchr("/._-~", c) != nullptr) {
      uri += c;
    } else {
      static constexpr char kDigits[] = "0123456789abcdef";
      const auto byte = static_cast<unsigned char>(c);
      uri += '%';
      uri += kDigits[byte >> 4];
      uri += kDigits[byte & 15];
    }
  }
  return uri + (is_immutable ? "?mode=ro&immutable=1" : "?mode=ro");
}

// 0 where there is no header.
std::size_t PageSizeOf(std::string_view header) {
  if (header.size() < kSqliteHeader) return 0;
  const auto high = static_cast<unsigned char>(header[16]);
  const auto low = static_cast<unsigned char>(header[17]);
  const std::size_t size = std::size_t{high} << 8 | low;
  // The largest does not fit into the two bytes.
  return size == 1 ? std::size_t{1} << 16 : size;
}

class Rosbag2Sqlite : public BagSource {
 public:
  explicit Rosbag2Sqlite(InputStream* input)
      : BagSource("ROS 2 bag (db3)"), name_(input->name()) {
    std::string path = name_;
    const std::size_t page_size = PageSizeOf(input->Peek(kSqliteHeader));
    if (!input->is_plain_file()) {
      unpacked_ = std::make_unique<TemporaryFile>(input);
      path = unpacked_->path();
      if (!input->damage().empty()) {
        Skip(input->damage() + ": what was unpacked before it is used");
      }
    }
    if (EndsWithinAPage(path, page_size)) path = CutToPages(page_size, input);
    // A database that nobody closed has a journal beside it, which is read
    // where the folder lets that happen.
    if (!Open(UriOf(path, unpacked_ != nullptr)) && !Open(UriOf(path, true)) &&
        !OpenBroken()) {
      Refuse();
    }
    ReadTopics();
  }

  bool Next(BagMessage* message) override {
    if (messages_ == nullptr) PrepareMessages();
    while (!at_end_) {
      const int status = sqlite3_step(messages_.get());
      if (status != SQLITE_ROW) {
        at_end_ = true;
        if (status != SQLITE_DONE) {
          Skip(std::string("the database is damaged (") +
               sqlite3_errmsg(database_.get()) +
               "): messages before that are used, the rest is lost");
        }
        break;
      }
      CountMessage();
      const auto topic =
          topic_of_.find(sqlite3_column_int64(messages_.get(), 0));
      if (topic == topic_of_.end()) {
        Skip("message of a topic that the bag does not describe");
        continue;
      }
      message->topic = topic->second;
      message->time = sqlite3_column_int64(messages_.get(), 1);
      message->data = {};
      if (IsWanted(topics()[topic->second])) {
        const int type = sqlite3_column_type(messages_.get(), 2);
        if (type != SQLITE_BLOB) {
          Skip("message whose data are no bytes");
          continue;
        }
        const void* const data = sqlite3_column_blob(messages_.get(), 2);
        const int size = sqlite3_column_bytes(messages_.get(), 2);
        message->data =
            std::string_view(static_cast<const char*>(data),
                             data == nullptr ? 0 : static_cast<size_t>(size));
      }
      return true;
    }
    return false;
  }

 private:
  bool Open(const std::string& uri) {
    sqlite3* database = nullptr;
    const int status =
        sqlite3_open_v2(uri.c_str(), &database,
                        SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    database_.reset(database);
    if (status != SQLITE_OK) return false;
    // The file may come from anybody.
    sqlite3_db_config(database, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(database, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
    sqlite3_db_config(database, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
    sqlite3_limit(database, SQLITE_LIMIT_LENGTH,
                  static_cast<int>(kLargestMessage));
    sqlite3_exec(database, "PRAGMA cell_size_check=ON", nullptr, nullptr,
                 nullptr);
    return HasSchema();
  }

  // Whether the last page of the file is there in part. The rest of it would be
  // read as zeros, and these would be taken for what was measured.
  static bool EndsWithinAPage(const std::string& path, std::size_t page_size) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(path, error);
    return !error && page_size > 0 && size % page_size != 0;
  }

  // Makes the file a copy that ends with its last whole page; its path.
  std::string CutToPages(std::size_t page_size, InputStream* input) {
    if (unpacked_ == nullptr) {
      unpacked_ = std::make_unique<TemporaryFile>(input);
    }
    const std::string& path = unpacked_->path();
    std::error_code error;
    const std::uintmax_t size = fs::file_size(path, error);
    if (!error) fs::resize_file(path, size - size % page_size, error);
    if (error)
      throw Error(path, 0, error.message(), "a file to write (TMPDIR)");
    Skip("the database breaks off within a page, which is left out");
    return path;
  }

  // What Open() refused, if it has fewer pages than it says it has: SQLite
  // takes it only from who may write to the schema, which a file opened to be
  // read forbids again. What lies behind its end is an error where it is asked
  // for.
  bool OpenBroken() {
    if (sqlite3_errcode(database_.get()) != SQLITE_CORRUPT) return false;
    sqlite3_db_config(database_.get(), SQLITE_DBCONFIG_DEFENSIVE, 0, nullptr);
    sqlite3_exec(database_.get(), "PRAGMA writable_schema=ON", nullptr, nullptr,
                 nullptr);
    return HasSchema();
  }

  bool HasSchema() {
    return Prepare("SELECT count(*) FROM sqlite_master") != nullptr &&
           sqlite3_step(Prepare("SELECT count(*) FROM sqlite_master").get()) ==
               SQLITE_ROW;
  }

  Statement Prepare(const std::string& text) {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database_.get(), text.c_str(), -1, &statement,
                           nullptr) != SQLITE_OK) {
      sqlite3_finalize(statement);
      return nullptr;
    }
    return Statement(statement);
  }

  [[noreturn]] void Refuse() {
    throw Error(name_, 0,
                std::string("is an SQLite database that cannot be read (") +
                    sqlite3_errmsg(database_.get()) + ")",
                kExpected);
  }

  static std::string Text(sqlite3_stmt* statement, int column) {
    const unsigned char* const text = sqlite3_column_text(statement, column);
    return text == nullptr ? std::string()
                           : reinterpret_cast<const char*>(text);
  }

  void ReadTopics() {
    const Statement topics_statement =
        Prepare("SELECT id, name, type, serialization_format FROM topics");
    if (topics_statement == nullptr) Refuse();
    int status = SQLITE_OK;
    while ((status = sqlite3_step(topics_statement.get())) == SQLITE_ROW) {
      BagTopic topic;
      topic.encoding = MessageEncoding::kCdr;
      topic.name = Text(topics_statement.get(), 1);
      topic.type = PlainTypeName(Text(topics_statement.get(), 2));
      const std::string format = Text(topics_statement.get(), 3);
      if (topic.type.empty()) {
        topic.unreadable = "the bag does not say what type its messages have";
      } else if (format != "cdr") {
        topic.unreadable = "its messages are serialized as '" +
                           format.substr(0, 20) + "': cdr is known";
      }
      topic_of_[sqlite3_column_int64(topics_statement.get(), 0)] =
          AddTopic(topic);
    }
    if (status != SQLITE_DONE) Refuse();
  }

  void PrepareMessages() {
    // Data of other topics, images perhaps, are not even read from the disk.
    std::string wanted;
    for (const auto& [id, index] : topic_of_) {
      if (!IsWanted(topics()[index])) continue;
      wanted += (wanted.empty() ? "" : ",") + std::to_string(id);
    }
    messages_ =
        Prepare("SELECT topic_id, timestamp, CASE WHEN topic_id IN (" + wanted +
                ") THEN data END FROM messages NOT INDEXED ORDER BY rowid");
    if (messages_ == nullptr) Refuse();
  }

  std::string name_;
  std::unique_ptr<TemporaryFile> unpacked_;
  std::unique_ptr<sqlite3, CloseDatabase> database_;
  std::map<std::int64_t, std::size_t> topic_of_;
  Statement messages_;
  bool at_end_ = false;
};

bool EndsWith(const std::string& text, std::string_view ending) {
  return text.size() >= ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

bool IsBagFile(const std::string& name) {
  return EndsWith(name, ".db3") || EndsWith(name, ".mcap") ||
         EndsWith(name, ".db3.zstd") || EndsWith(name, ".mcap.zstd");
}

// A bag of ROS 1, as its recorder names it.
bool IsRosbag1File(const std::string& name) { return EndsWith(name, ".bag"); }

// bag_2.db3 before bag_10.db3.
bool NumbersInOrder(const std::string& a, const std::string& b) {
  std::size_t i = 0;
  std::size_t j = 0;
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const auto number = [&](const std::string& text, std::size_t* k) {
        while (*k < text.size() && text[*k] == '0') ++*k;
        const std::size_t begin = *k;
        while (*k < text.size() && is_digit(text[*k])) ++*k;
        return text.substr(begin, *k - begin);
      };
      const std::string left = number(a, &i);
      const std::string right = number(b, &j);
      if (left.size() != right.size()) return left.size() < right.size();
      if (left != right) return left < right;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  return a.size() - i < b.size() - j;
}

// What is needed of a metadata.yaml, which rosbag2 writes with a key or an
// entry of a list on each line.
struct Metadata {
  std::vector<std::string> files;
  // Of all topics; -1 where it is not said.
  std::int64_t message_count = -1;
  std::string compression;
  std::string compression_mode;
};

std::string Unquoted(std::string text) {
  const auto strip = [&text](const char* characters) {
    text.erase(0, std::min(text.find_first_not_of(characters), text.size()));
    text.erase(text.find_last_not_of(characters) + 1);
  };
  strip(" \t\r");
  if (text.size() >= 2 && (text.front() == '"' || text.front() == '\'') &&
      text.back() == text.front()) {
    text = text.substr(1, text.size() - 2);
  }
  return text;
}

Metadata ParseMetadata(const std::string& text) {
  Metadata metadata;
  std::istringstream lines(text);
  std::string line;
  bool in_files = false;
  std::size_t count_indent = std::string::npos;
  while (std::getline(lines, line)) {
    const std::string trimmed = Unquoted(line);
    const auto value_of = [&](std::string_view key, std::string* value) {
      if (trimmed.compare(0, key.size(), key) != 0) return false;
      *value = Unquoted(trimmed.substr(key.size()));
      return true;
    };
    std::string rest;
    if (value_of("relative_file_paths:", &rest)) {
      in_files = true;
    } else if (in_files && value_of("- ", &rest)) {
      metadata.files.push_back(fs::path(rest).filename().string());
    } else if (!trimmed.empty()) {
      in_files = false;
      value_of("compression_format:", &metadata.compression);
      value_of("compression_mode:", &metadata.compression_mode);
      // Topics and files have counts of their own, farther to the right.
      const std::size_t indent = line.find_first_not_of(" \t");
      if (indent < count_indent && value_of("message_count:", &rest)) {
        const auto [end, failure] = std::from_chars(
            rest.data(), rest.data() + rest.size(), metadata.message_count);
        if (failure != std::errc() || end != rest.data() + rest.size()) {
          metadata.message_count = -1;
        }
        count_indent = indent;
      }
    }
  }
  std::transform(metadata.compression_mode.begin(),
                 metadata.compression_mode.end(),
                 metadata.compression_mode.begin(),
                 [](unsigned char c) { return std::toupper(c); });
  return metadata;
}

std::vector<std::string> FilesIn(
    const std::string& folder,
    const std::function<bool(const std::string&)>& is_one) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator i(folder, error), end; !error && i != end;
       i.increment(error)) {
    const std::string name = i->path().filename().string();
    if (is_one(name)) names.push_back(name);
  }
  std::sort(names.begin(), names.end(), NumbersInOrder);
  return names;
}

// The number behind the last underscore, as in drive_0.bag and
// drive_2024-05-01-10-20-30_1.bag; -1 when there is none.
int PartNumber(const std::string& name) {
  const std::size_t end = name.rfind('.');
  const std::size_t begin = name.rfind('_', end);
  if (begin == std::string::npos) return -1;
  int number = -1;
  const char* const last = name.data() + end;
  const auto [stop, failure] =
      std::from_chars(name.data() + begin + 1, last, number);
  return failure == std::errc() && stop == last ? number : -1;
}

// The bags of ROS 1 in a folder that one recording was split into. Throws Error
// when they are anything else: drives that have nothing to do with each other
// are not one log.
std::vector<std::string> PartsOfRosbag1In(const std::string& folder) {
  std::vector<std::string> names = FilesIn(folder, IsRosbag1File);
  std::stable_sort(names.begin(), names.end(),
                   [](const std::string& a, const std::string& b) {
                     return PartNumber(a) < PartNumber(b);
                   });
  for (std::size_t i = 0; names.size() > 1 && i < names.size(); ++i) {
    if (PartNumber(names[i]) == static_cast<int>(i)) continue;
    throw Error(folder, 0,
                "holds ROS 1 bags that are not, by their names, the parts of "
                "one recording",
                "the parts and nothing else, ..._0.bag, ..._1.bag and so on; "
                "or bags of several drives one by one, with commas between");
  }
  return names;
}

bool IsRosbag2(const std::string& folder) {
  std::error_code error;
  return fs::exists(fs::path(folder) / "metadata.yaml", error) ||
         !FilesIn(folder, IsBagFile).empty();
}

class Rosbag2Folder : public BagSource {
 public:
  Rosbag2Folder(const std::string& path, std::function<bool()> stop,
                std::function<void(std::int64_t, std::int64_t)> progress)
      : BagSource(FilesIn(path, IsRosbag1File).empty() || IsRosbag2(path)
                      ? "ROS 2 bag (folder)"
                      : "ROS 1 bag (folder)"),
        folder_(path),
        stop_(std::move(stop)),
        progress_(std::move(progress)) {
    const fs::path metadata_path = fs::path(path) / "metadata.yaml";
    std::error_code error;
    if (fs::exists(metadata_path, error)) {
      const Metadata metadata =
          ParseMetadata(ReadTextFile(metadata_path.string(), kLargestMetadata));
      files_ = metadata.files;
      messages_stated_ = metadata.message_count;
      if (metadata.compression_mode == "MESSAGE") {
        compression_ = metadata.compression;
        if (!IsKnownCompression(compression_)) {
          throw Error(
              metadata_path.string(), 0,
              "messages have the unknown compression '" + compression_ + "'",
              "zstd or none");
        }
      }
      if (files_.empty()) {
        Skip(
            "metadata.yaml that names no files: those that are there are read");
      }
    } else if (IsRosbag2(path)) {
      Skip("metadata.yaml that is not there: the files are read by name");
    } else {
      files_ = PartsOfRosbag1In(path);
    }
    if (files_.empty()) files_ = FilesIn(path, IsBagFile);
    for (const std::string& file : files_) {
      const auto size = fs::file_size(PathOf(file), error);
      if (!error) size_ += static_cast<std::int64_t>(size);
    }
    OpenNext();
    if (source_ == nullptr) {
      throw Error(path, 0,
                  first_error_.empty()
                      ? std::string("holds no bag")
                      : "no file of it can be read: " + first_error_,
                  "a ROS 2 bag: metadata.yaml and .db3 or .mcap files; or the "
                  ".bag files that a ROS 1 bag was split into");
    }
  }

  bool Next(BagMessage* message) override {
    while (source_ != nullptr) {
      if (source_->Next(message)) {
        CountMessage();
        ++messages_found_;
        message->topic = TopicOf(message->topic);
        if (compression_.empty() || message->data.empty()) return true;
        UnpackedChunk unpacked =
            UnpackChunk(compression_, message->data, 0, kLargestMessage);
        if (!unpacked.is_whole) {
          Skip("message whose " + compression_ + " data is corrupt");
          continue;
        }
        unpacked_ = std::move(unpacked.bytes);
        message->data = unpacked_;
        return true;
      }
      TakeSkips();
      source_.reset();
      if (stop_ && stop_()) return false;
      OpenNext();
    }
    if (messages_found_ < messages_stated_) {
      Skip("message that metadata.yaml counts and that is not there",
           messages_stated_ - messages_found_);
      messages_stated_ = -1;
    }
    return false;
  }

 private:
  std::size_t TopicOf(std::size_t index) {
    while (topic_of_.size() < source_->topics().size()) {
      topic_of_.push_back(AddTopic(source_->topics()[topic_of_.size()]));
    }
    return topic_of_[index];
  }

  void TakeSkips() {
    for (const SkipReport& skip : source_->skipped()) {
      Skip(files_[next_file_ - 1] + ": " + skip.reason, skip.count);
    }
    for (const std::string& note : source_->notes()) {
      Note(files_[next_file_ - 1] + ": " + note);
    }
  }

  // Where a file lies that metadata.yaml names: a recorder that compresses
  // names what it wrote before, or somebody unpacked it.
  std::string PathOf(const std::string& name) const {
    constexpr std::string_view kPacked = ".zstd";
    const std::string path = (fs::path(folder_) / name).string();
    std::error_code error;
    if (fs::exists(path, error)) return path;
    const std::string other = EndsWith(path, kPacked)
                                  ? path.substr(0, path.size() - kPacked.size())
                                  : path + std::string(kPacked);
    return fs::exists(other, error) ? other : path;
  }

  // The next file that can be read; none at the end.
  void OpenNext() {
    while (source_ == nullptr && next_file_ < files_.size()) {
      const std::string path = PathOf(files_[next_file_++]);
      try {
        input_ = std::make_unique<InputStream>(path, stop_);
        if (progress_) {
          input_->SetProgress([this](std::int64_t done, std::int64_t) {
            progress_(done_ + done, size_);
          });
        }
        const std::string_view prefix = input_->Peek(kSqliteMagic.size());
        if (LooksLikeSqlite(prefix)) {
          source_ = OpenRosbag2Sqlite(input_.get());
        } else if (LooksLikeMcap(prefix)) {
          source_ = OpenMcap(input_.get());
        } else if (LooksLikeRosbag1(prefix) && IsRosbag1File(path)) {
          source_ = OpenRosbag1(input_.get());
        } else {
          throw Error(path, 0, "is neither an SQLite database nor MCAP",
                      "a file of a ROS 2 bag");
        }
        source_->SetWanted(
            [this](const BagTopic& topic) { return IsWanted(topic); });
        topic_of_.clear();
        for (std::size_t i = 0; i < source_->topics().size(); ++i) TopicOf(i);
      } catch (const Error& error) {
        source_.reset();
        if (first_error_.empty()) first_error_ = error.what();
        Skip(std::string("file of the bag that cannot be read: ") +
             error.what());
      }
      std::error_code error;
      const auto size = fs::file_size(path, error);
      if (!error && source_ == nullptr) {
        done_ += static_cast<std::int64_t>(size);
      }
    }
  }

  std::string folder_;
  std::function<bool()> stop_;
  std::function<void(std::int64_t, std::int64_t)> progress_;
  std::vector<std::string> files_;
  std::size_t next_file_ = 0;
  std::unique_ptr<InputStream> input_;
  std::unique_ptr<BagSource> source_;
  std::vector<std::size_t> topic_of_;
  std::string compression_;
  std::string unpacked_;
  std::string first_error_;
  std::int64_t messages_stated_ = -1;
  std::int64_t messages_found_ = 0;
  std::int64_t done_ = 0;
  std::int64_t size_ = 0;
};

}  // namespace

bool LooksLikeSqlite(std::string_view prefix) {
  return prefix.substr(0, kSqliteMagic.size()) == kSqliteMagic;
}

std::unique_ptr<BagSource> OpenRosbag2Sqlite(InputStream* input) {
  return std::make_unique<Rosbag2Sqlite>(input);
}

bool LooksLikeRosbag2Folder(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return false;
  return IsRosbag2(path) || !FilesIn(path, IsRosbag1File).empty();
}

std::unique_ptr<BagSource> OpenRosbag2Folder(
    const std::string& path, std::function<bool()> stop,
    std::function<void(std::int64_t done, std::int64_t size)> progress) {
  return std::make_unique<Rosbag2Folder>(path, std::move(stop),
                                         std::move(progress));
}

}  // namespace plumbline
