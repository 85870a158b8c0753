#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/log_reader.h>
#include <sqlite3.h>
#include <zstd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "frontend/bags/bag_records.h"

namespace plumbline {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// The scans of SmallDrive.
constexpr std::size_t kScans = 10;

std::string FileText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file),
          std::istreambuf_iterator<char>()};
}

std::string Zstd(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(),
                              bytes.size(), 3));
  return packed;
}

// A way to keep messages in a file.
struct Container {
  // For the names of tests.
  friend void PrintTo(const Container& container, std::ostream* output) {
    *output << container.name;
  }
  std::string name;
  MessageEncoding encoding;
  // Writes messages into a folder; the path that is read, and the file.
  std::function<void(const std::vector<BagRecord>&, const Folder&)> write;
  std::string path;
  std::string file;
};

void WriteDb3(const std::vector<BagRecord>& records, const Folder& folder) {
  std::filesystem::remove_all(folder / "bag");
  WriteRosbag2(records, folder / "bag");
}

std::vector<Container> Containers() {
  std::vector<Container> all;
  const auto add = [&](const std::string& kind, const std::string& compression,
                       bool index, bool chunks) {
    BagWriterOptions options;
    options.compression = compression;
    options.index = index;
    options.chunks = chunks;
    options.chunk_size = 700;
    const bool is_ros1 = kind == "ros1";
    all.push_back(
        {kind + " " + compression + (index ? " with index" : " without index") +
             (chunks ? "" : " without chunks"),
         is_ros1 ? kRos1 : kCdr,
         [is_ros1, options](const std::vector<BagRecord>& records,
                            const Folder& folder) {
           WriteText(folder / "bag", is_ros1 ? MakeRosbag1(records, options)
                                             : MakeMcap(records, options));
         },
         "bag", "bag"});
  };
  for (const bool index : {true, false}) {
    for (const char* compression : {"none", "bz2", "lz4"}) {
      add("ros1", compression, index, true);
    }
    for (const char* compression : {"none", "lz4", "zstd"}) {
      add("mcap", compression, index, true);
    }
    add("mcap", "none", index, false);
  }
  all.push_back({"folder of a db3", kCdr, WriteDb3, "bag", "bag/bag_0.db3"});
  all.push_back({"db3", kCdr, WriteDb3, "bag/bag_0.db3", "bag/bag_0.db3"});
  all.push_back(
      {"folder of a db3.zstd", kCdr,
       [](const std::vector<BagRecord>& records, const Folder& folder) {
         WriteDb3(records, folder);
         WriteText(folder / "bag/bag_0.db3.zstd",
                   Zstd(FileText(folder / "bag/bag_0.db3")));
         std::filesystem::remove(folder / "bag/bag_0.db3");
       },
       "bag", "bag/bag_0.db3.zstd"});
  return all;
}

class ContainersTest : public ::testing::TestWithParam<Container> {
 protected:
  std::vector<BagRecord> Drive() const {
    return SmallDrive(GetParam().encoding);
  }
  Log ReadOf(const std::vector<BagRecord>& records) const {
    GetParam().write(records, folder_);
    return ReadPath(folder_ / GetParam().path);
  }
  // What is said of a bag that is refused.
  std::string WhatOfRecords(const std::vector<BagRecord>& records) const {
    try {
      ReadOf(records);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  Folder folder_;
  // Of bags of ROS 1 several chunks are unpacked at once.
  const ThreadsScope threads_{3};
};

// That the poses and readings are among those of the whole drive.
void ExpectPartOf(const Log& whole, const Log& part) {
  for (const Scan& scan : part.scans) {
    const auto same = std::find_if(
        whole.scans.begin(), whole.scans.end(),
        [&](const Scan& s) { return s.timestamp == scan.timestamp; });
    ASSERT_NE(same, whole.scans.end());
    EXPECT_EQ(scan.ranges, same->ranges);
  }
}

std::int64_t MessagesIn(const Log& log) {
  std::int64_t count = 0;
  for (const auto& [name, messages] : log.messages) count += messages;
  return count;
}

TEST_P(ContainersTest, EveryCutIsSaidOrRefused) {
  // Several pages of a database.
  const bool is_database = GetParam().name.find("db3") != std::string::npos;
  const std::vector<BagRecord> records =
      SmallDrive(GetParam().encoding, is_database ? 200 : 10);
  const Log whole = ReadOf(records);
  EXPECT_THAT(whole.skipped, IsEmpty());
  const std::string bytes = FileText(folder_ / GetParam().file);
  std::vector<std::size_t> cuts;
  for (std::size_t k = 0; k < 50; ++k) cuts.push_back(bytes.size() * k / 50);
  // Where a message ends nothing is broken, yet the rest lacks. In what is
  // compressed none is found.
  std::size_t place = 0;
  for (const BagRecord& record : records) {
    const std::size_t next = bytes.find(record.data, place);
    if (next == std::string::npos) continue;
    place = next + record.data.size();
    cuts.push_back(place);
  }
  for (const std::size_t size : cuts) {
    SCOPED_TRACE("cut to " + std::to_string(size) + " of " +
                 std::to_string(bytes.size()) + " bytes");
    WriteText(folder_ / GetParam().file, bytes.substr(0, size));
    try {
      const Log log = ReadPath(folder_ / GetParam().path);
      ExpectPartOf(whole, log);
      // Half a map is never silent. What is cut off behind the last message,
      // an index, is no loss.
      if (MessagesIn(log) == MessagesIn(whole)) continue;
      std::string said;
      for (const SkipReport& skip : log.skipped) said += skip.reason + "; ";
      for (const std::string& note : log.notes) said += note + "; ";
      EXPECT_THAT(said, AnyOf(HasSubstr("breaks off"), HasSubstr("not there"),
                              HasSubstr("is lost"), HasSubstr("not closed")));
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("bag"), HasSubstr("expected")));
    }
  }
}

// A byte that is wrong spoils a chunk, a block or a page at most where there
// are checksums, and nothing that is kept is wrong.
TEST_P(ContainersTest, DamagedBytesAreSaidOrHarmless) {
  const Log whole = ReadOf(Drive());
  const std::string bytes = FileText(folder_ / GetParam().file);
  const std::string& name = GetParam().name;
  // Of MCAP every chunk has a checksum, and of bzip2 every block.
  const bool has_checksums = name.find("bz2") != std::string::npos ||
                             (name.find("mcap") == 0 &&
                              name.find("without chunks") == std::string::npos);
  for (std::size_t k = 0; k < 50; ++k) {
    const std::size_t place = (2 * k + 1) * bytes.size() / 100;
    SCOPED_TRACE("byte " + std::to_string(place) + " of " +
                 std::to_string(bytes.size()));
    std::string damaged = bytes;
    damaged[place] = static_cast<char>(damaged[place] ^ 0x55);
    WriteText(folder_ / GetParam().file, damaged);
    try {
      const Log log = ReadPath(folder_ / GetParam().path);
      // Chunks that are unpacked ahead say the same as one after the other.
      const ThreadsScope alone(1);
      const Log same = ReadPath(folder_ / GetParam().path);
      ASSERT_EQ(log.scans.size(), same.scans.size());
      for (std::size_t i = 0; i < log.scans.size(); ++i) {
        EXPECT_EQ(log.scans[i].ranges, same.scans[i].ranges);
        EXPECT_EQ(log.scans[i].odometry, same.scans[i].odometry);
      }
      ASSERT_EQ(log.skipped.size(), same.skipped.size());
      for (std::size_t i = 0; i < log.skipped.size(); ++i) {
        EXPECT_EQ(log.skipped[i].reason, same.skipped[i].reason);
        EXPECT_EQ(log.skipped[i].count, same.skipped[i].count);
        EXPECT_EQ(log.skipped[i].first_lines, same.skipped[i].first_lines);
      }
      if (!has_checksums) continue;
      ExpectPartOf(whole, log);
      if (MessagesIn(log) < MessagesIn(whole)) {
        EXPECT_THAT(log.skipped, Not(IsEmpty()));
      }
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("expected"));
    }
  }
}

TEST_P(ContainersTest, MessagesThatCannotBeReadAreCounted) {
  std::vector<BagRecord> records = Drive();
  const MessageEncoding encoding = GetParam().encoding;
  const std::string scan = EncodeLaserScan(PlainScan(kBagStart), encoding);
  const auto add = [&](const std::string& data) {
    records.push_back({"/scan", "sensor_msgs/LaserScan", kBagStart, data});
  };
  // No bytes, and cut at every place.
  for (std::size_t size = 0; size + 4 < scan.size(); ++size) {
    add(scan.substr(0, size));
  }
  const auto cut = static_cast<std::int64_t>(scan.size() - 4);
  records.push_back({"/odom", "nav_msgs/Odometry", kBagStart, ""});
  records.push_back({"/tf_static", "tf2_msgs/TFMessage", kBagStart, ""});
  Log log = ReadOf(records);
  EXPECT_EQ(log.scans.size(), kScans);
  EXPECT_EQ(SkippedInBag(log, "LaserScan on /scan that "), cut);
  EXPECT_EQ(SkippedInBag(log, "LaserScan on /scan that has no bytes"), 1);
  EXPECT_EQ(SkippedInBag(log, "Odometry on /odom that has no bytes"), 1);
  EXPECT_EQ(SkippedInBag(log, "TFMessage on /tf_static that has no bytes"), 1);

  // Readings that would take 16 GiB, and a name of 4 GiB.
  records = Drive();
  std::string lie = scan;
  lie.replace(scan.size() - 4 - 5 * 4 - 4, 4, "\xff\xff\xff\xff");
  add(lie);
  lie = scan;
  lie.replace(lie.find("laser") - 4, 4, "\xff\xff\xff\xff");
  add(lie);
  log = ReadOf(records);
  EXPECT_EQ(log.scans.size(), kScans);
  EXPECT_EQ(SkippedInBag(log, "says that more follows than does"), 2);
}

TEST_P(ContainersTest, RepresentationsOfCdr) {
  if (GetParam().encoding != kCdr) return;
  std::vector<BagRecord> records;
  for (int i = 0; i < 4; ++i) {
    const LaserScanMessage scan = PlainScan(kBagStart + i * kSecond);
    records.push_back({"/scan", "sensor_msgs/LaserScan", scan.header.stamp,
                       EncodeLaserScan(scan, kCdr, i % 2 == 1)});
  }
  // A parameter list is none.
  records.push_back({"/scan", "sensor_msgs/LaserScan", kBagStart,
                     std::string("\0\x03\0\0rest", 8)});
  const Log log = ReadOf(records);
  ASSERT_EQ(log.scans.size(), 4u);
  EXPECT_EQ(log.scans[1].ranges, log.scans[0].ranges);
  EXPECT_EQ(SkippedInBag(log, "no plain CDR"), 1);
}

TEST_P(ContainersTest, TopicsOfAnotherType) {
  std::vector<BagRecord> records = Drive();
  records.push_back({"/points", "sensor_msgs/PointCloud2", kBagStart, "junk"});
  EXPECT_EQ(ReadOf(records).scans.size(), kScans);
  EXPECT_THAT(WhatOfRecords({records.back()}),
              AllOf(HasSubstr("/points (sensor_msgs/PointCloud2, 1)"),
                    HasSubstr("expected"), HasSubstr("sensor_msgs/LaserScan")));
  // Scans by name, something else by type.
  records = Drive();
  for (BagRecord& record : records) {
    if (record.topic == "/scan") record.type = "sensor_msgs/Range";
  }
  EXPECT_THAT(
      WhatOfRecords(records),
      AllOf(HasSubstr("/scan (sensor_msgs/Range, 10)"), HasSubstr("expected")));
}

TEST_P(ContainersTest, TypesThatNobodySays) {
  std::vector<BagRecord> records = Drive();
  for (BagRecord& record : records) {
    if (record.topic == "/scan") record.type.clear();
  }
  EXPECT_THAT(WhatOfRecords(records),
              AllOf(HasSubstr("10 x message of /scan: "),
                    HasSubstr("what type its messages have"),
                    HasSubstr("/scan (type unknown, 10)")));
}

// Times of recording may be anything where they have 64 bits.
TEST_P(ContainersTest, TimesThatCannotBe) {
  if (GetParam().encoding != kCdr) return;
  std::vector<BagRecord> records = Drive();
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (i % 3 == 1) records[i].time = kMost;
    if (i % 3 == 2) records[i].time = -kMost - 1;
  }
  EXPECT_EQ(ReadOf(records).scans.size(), kScans);
}

TEST_P(ContainersTest, TfThatLacksTheLaserIsSaid) {
  std::vector<BagRecord> records = Drive();
  records.front() = TfRecord(
      Transform(kBagStart, "base_link", "camera", Pose2(0.2, 0.0, 0.1)),
      GetParam().encoding, "/tf_static");
  const Log log = ReadOf(records);
  EXPECT_EQ(log.scans.size(), kScans);
  EXPECT_EQ(log.scans[0].laser_offset, Pose2::Zero());
  EXPECT_THAT(log.notes,
              ::testing::Contains(
                  AllOf(HasSubstr("'laser'"), HasSubstr("robot's centre"))));
}

INSTANTIATE_TEST_SUITE_P(All, ContainersTest, ::testing::ValuesIn(Containers()),
                         [](const ::testing::TestParamInfo<Container>& info) {
                           std::string name = info.param.name;
                           std::replace_if(
                               name.begin(), name.end(),
                               [](char c) { return c == ' ' || c == '.'; },
                               '_');
                           return name;
                         });

// Databases.

class DatabaseTest : public ::testing::Test {
 protected:
  DatabaseTest() { WriteRosbag2(SmallDrive(kCdr), folder_ / "bag"); }

  // Changes the database; what is then said of it, and of its log.
  std::string Change(const std::string& statement, Log* log = nullptr) {
    sqlite3* database = nullptr;
    EXPECT_EQ(sqlite3_open((folder_ / "bag/bag_0.db3").c_str(), &database),
              SQLITE_OK);
    EXPECT_EQ(
        sqlite3_exec(database, statement.c_str(), nullptr, nullptr, nullptr),
        SQLITE_OK)
        << sqlite3_errmsg(database);
    sqlite3_close(database);
    try {
      const Log read = ReadPath(folder_ / "bag");
      if (log != nullptr) *log = read;
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  Folder folder_;
};

TEST_F(DatabaseTest, WithoutItsTables) {
  EXPECT_THAT(Change("ALTER TABLE messages RENAME TO letters"),
              AllOf(HasSubstr("bag_0.db3"), HasSubstr("messages"),
                    HasSubstr("expected")));
  EXPECT_THAT(Change("DROP TABLE topics"),
              AllOf(HasSubstr("bag_0.db3"), HasSubstr("topics"),
                    HasSubstr("expected")));
}

TEST_F(DatabaseTest, WhatIsSerializedInAnotherWayIsCounted) {
  EXPECT_THAT(Change("UPDATE topics SET serialization_format = 'protobuf'"),
              AllOf(HasSubstr("'protobuf'"), HasSubstr("cdr is known")));
}

TEST_F(DatabaseTest, MessagesOfNoTopicAndWithoutBytesAreCounted) {
  Log log;
  EXPECT_EQ(Change("UPDATE messages SET topic_id = 99 WHERE id = 3;"
                   "UPDATE messages SET data = 'text' WHERE id = 5;"
                   "UPDATE messages SET data = x'' WHERE id = 7",
                   &log),
            "");
  EXPECT_EQ(SkippedInBag(log, "topic that the bag does not describe"), 1);
  EXPECT_EQ(SkippedInBag(log, "data are no bytes"), 1);
  EXPECT_EQ(SkippedInBag(log, "has no bytes"), 1);
  EXPECT_EQ(log.scans.size(), kScans - 3);
}

TEST_F(DatabaseTest, MessagesThatTheDescriptionCountsAndThatLackAreSaid) {
  Log log;
  EXPECT_EQ(Change("DELETE FROM messages WHERE id > 15", &log), "");
  EXPECT_EQ(SkippedInBag(log, "metadata.yaml counts and that is not there"), 7);
  EXPECT_LT(log.scans.size(), kScans);
}

TEST_F(DatabaseTest, DescriptionOfAnUnknownCompression) {
  WriteText(folder_ / "bag/metadata.yaml",
            "rosbag2_bagfile_information:\n  message_count: 22\n"
            "  compression_format: rar5\n  compression_mode: MESSAGE\n"
            "  relative_file_paths:\n    - bag_0.db3\n");
  EXPECT_THAT(Change(""), AllOf(HasSubstr("unknown compression 'rar5'"),
                                HasSubstr("zstd or none")));
}

// The copy of a recording, cut off at a page of the database and within one.
TEST_F(DatabaseTest, WhatBreaksOffIsUsedUpToThere) {
  std::filesystem::remove_all(folder_ / "bag");
  WriteRosbag2(SmallDrive(kCdr, 300), folder_ / "bag");
  const std::string whole = FileText(folder_ / "bag/bag_0.db3");
  Log all;
  ASSERT_EQ(Change("", &all), "");
  const std::size_t pages = whole.size() / 4096;
  ASSERT_GT(pages, 20u);
  const std::size_t cuts[] = {whole.size() - 4096, whole.size() - 3000,
                              whole.size() - 100, pages / 2 * 4096,
                              pages / 2 * 4096 + 2000};
  for (const bool is_packed : {false, true}) {
    for (const std::size_t size : cuts) {
      SCOPED_TRACE(std::to_string(size) + " of " +
                   std::to_string(whole.size()));
      std::filesystem::remove(folder_ / "bag/bag_0.db3");
      const std::string cut = whole.substr(0, size);
      WriteText(folder_ / (is_packed ? "bag/bag_0.db3.zstd" : "bag/bag_0.db3"),
                is_packed ? Zstd(cut) : cut);
      Log log;
      ASSERT_NO_THROW(log = ReadPath(folder_ / "bag"));
      EXPECT_EQ(SkippedInBag(log, "database is damaged"), 1);
      EXPECT_EQ(SkippedInBag(log, "breaks off within a page"),
                size % 4096 == 0 ? 0 : 1);
      EXPECT_EQ(SkippedInBag(log, "does not describe"), 0);
      // The last page holds odometry alone.
      EXPECT_EQ(log.scans.size() < all.scans.size(),
                size < whole.size() / 2 + 4096);
      EXPECT_GT(log.scans.size(), all.scans.size() / 4);
      for (std::size_t i = 0; i < log.scans.size(); ++i) {
        EXPECT_EQ(log.scans[i].timestamp, all.scans[i].timestamp);
        EXPECT_EQ(log.scans[i].ranges, all.scans[i].ranges);
      }
    }
  }
}

// A recorder splits what gets long. Transforms that stand still are in the
// first file alone.
TEST_F(DatabaseTest, SeveralFilesAreOneLog) {
  const std::vector<BagRecord> records = SmallDrive(kCdr);
  const auto middle = records.begin() + 12;
  std::filesystem::remove_all(folder_ / "bag");
  WriteRosbag2({records.begin(), middle}, folder_ / "bag");
  WriteRosbag2({middle, records.end()}, folder_ / "other");
  std::filesystem::rename(folder_ / "other/other_0.db3",
                          folder_ / "bag/bag_1.db3");
  const std::string description =
      "rosbag2_bagfile_information:\n  message_count: 22\n"
      "  relative_file_paths:\n    - bag_0.db3\n    - bag_1.db3\n";
  WriteText(folder_ / "bag/metadata.yaml", description);
  Log log;
  EXPECT_EQ(Change("", &log), "");
  EXPECT_THAT(log.skipped, IsEmpty());
  ASSERT_EQ(log.scans.size(), kScans);
  for (std::size_t i = 0; i < kScans; ++i) {
    EXPECT_NEAR(log.scans[i].odometry[0], 0.1 * static_cast<double>(i), 1e-9);
    EXPECT_NEAR(log.scans[i].laser_offset[0], 0.2, 1e-9);
  }
  // One of them lacks.
  std::filesystem::rename(folder_ / "bag/bag_1.db3", folder_ / "bag/elsewhere");
  EXPECT_EQ(Change("", &log), "");
  EXPECT_LT(log.scans.size(), kScans);
  EXPECT_EQ(SkippedInBag(log, "bag_1.db3"), 1);
  EXPECT_EQ(SkippedInBag(log, "metadata.yaml counts and that is not there"),
            10);
  // It was compressed after metadata.yaml was written.
  WriteText(folder_ / "bag/bag_1.db3.zstd",
            Zstd(FileText(folder_ / "bag/elsewhere")));
  EXPECT_EQ(Change("", &log), "");
  EXPECT_THAT(log.skipped, IsEmpty());
  EXPECT_EQ(log.scans.size(), kScans);
}

}  // namespace
}  // namespace plumbline
