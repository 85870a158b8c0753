#include <archive.h>
#include <archive_entry.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/log_reader.h>

#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr int kScans = 10;

la_ssize_t Append(archive*, void* text, const void* bytes, std::size_t size) {
  static_cast<std::string*>(text)->append(static_cast<const char*>(bytes),
                                          size);
  return static_cast<la_ssize_t>(size);
}

void Check(int status, archive* writer) {
  if (status != ARCHIVE_OK) {
    throw std::runtime_error(archive_error_string(writer));
  }
}

void AddFile(const std::string& name, const std::string& text,
             archive* writer) {
  archive_entry* const entry = archive_entry_new();
  archive_entry_set_pathname(entry, name.c_str());
  archive_entry_set_filetype(entry, AE_IFREG);
  archive_entry_set_perm(entry, 0644);
  archive_entry_set_size(entry, static_cast<la_int64_t>(text.size()));
  Check(archive_write_header(writer, entry), writer);
  archive_write_data(writer, text.data(), text.size());
  archive_entry_free(entry);
}

// The bytes of a file packed as "gz", "bz2", "xz", "zst" or "lz4", or of a
// "zip" of files.
std::string Packed(const std::string& kind,
                   const std::vector<std::string>& files) {
  std::string bytes;
  archive* const writer = archive_write_new();
  if (kind == "zip") {
    Check(archive_write_set_format_zip(writer), writer);
  } else {
    Check(archive_write_set_format_raw(writer), writer);
    Check(kind == "gz"    ? archive_write_add_filter_gzip(writer)
          : kind == "bz2" ? archive_write_add_filter_bzip2(writer)
          : kind == "xz"  ? archive_write_add_filter_xz(writer)
          : kind == "zst" ? archive_write_add_filter_zstd(writer)
                          : archive_write_add_filter_lz4(writer),
          writer);
  }
  archive_write_set_bytes_in_last_block(writer, 1);
  Check(archive_write_open(writer, &bytes, nullptr, Append, nullptr), writer);
  for (const std::string& file : files) {
    AddFile("file_" + std::to_string(&file - files.data()), file, writer);
  }
  Check(archive_write_close(writer), writer);
  archive_write_free(writer);
  return bytes;
}

const std::vector<std::string>& Kinds() {
  static const auto* const kinds =
      new std::vector<std::string>{"gz", "bz2", "xz", "zst", "lz4", "zip"};
  return *kinds;
}

// A small log in every format that is read from a stream.
std::vector<std::pair<std::string, std::string>> Logs() {
  std::vector<BagRecord> ros1;
  std::vector<BagRecord> cdr;
  std::string carmen;
  std::string csv =
      "time,x,y,theta,start_angle,angle_step,"
      "r0,r1,r2\n";
  constexpr std::int64_t kSecond = 1000000000;
  for (int i = 0; i < kScans; ++i) {
    LaserScanMessage scan;
    scan.header = {(1000 + i) * kSecond, "laser"};
    scan.angle_min = -1.0;
    scan.angle_max = 1.0;
    scan.angle_increment = 1.0;
    scan.range_min = 0.1;
    scan.range_max = 10.0;
    scan.ranges = {1.0f, 2.0f, 3.0f + 0.1f * static_cast<float>(i)};
    for (const MessageEncoding encoding :
         {MessageEncoding::kRos1, MessageEncoding::kCdr}) {
      (encoding == MessageEncoding::kRos1 ? ros1 : cdr)
          .push_back({"/scan", "sensor_msgs/LaserScan", scan.header.stamp,
                      EncodeLaserScan(scan, encoding)});
    }
    const std::string number = std::to_string(i);
    const std::string time = std::to_string(1000 + i);
    carmen += "FLASER 3 1.0 2.0 3." + number + " " + number + " 0 0 " + number +
              " 0 0 " + time + " host " + time + "\n";
    csv += time + "," + number + ",0,0,-1,1,1.0,2.0,3." + number + "\n";
  }
  return {{"carmen", carmen},
          {"csv", csv},
          {"ros1", MakeRosbag1(ros1, {})},
          {"mcap", MakeMcap(cdr, {})}};
}

Log ReadPacked(const std::string& bytes) {
  static const Registry* const registry = [] {
    auto* const all = new Registry;
    RegisterBuiltinLogReaders(all);
    return all;
  }();
  InputStream input("packed", bytes);
  const LogReaderType* const reader =
      RecognizeLog(*registry, input.Peek(1 << 16));
  if (reader == nullptr) throw Error("packed", 0, "is not recognized", "a log");
  return reader->read(&input, {});
}

TEST(PackedLogsTest, EveryReaderReadsEveryKind) {
  for (const auto& [format, plain] : Logs()) {
    const Log log = ReadPacked(plain);
    ASSERT_EQ(log.scans.size(), kScans) << format;
    for (const std::string& kind : Kinds()) {
      SCOPED_TRACE(format + " in " + kind);
      const std::string packed = Packed(kind, {plain});
      ASSERT_NE(packed, plain);
      const Log unpacked = ReadPacked(packed);
      EXPECT_THAT(unpacked.skipped, IsEmpty());
      ASSERT_EQ(unpacked.scans.size(), kScans);
      for (std::size_t i = 0; i < kScans; ++i) {
        EXPECT_EQ(unpacked.scans[i].ranges, log.scans[i].ranges);
        EXPECT_EQ(unpacked.scans[i].timestamp, log.scans[i].timestamp);
      }
    }
  }
}

TEST(PackedLogsTest, EveryCutIsSaidOrRefused) {
  for (const auto& [format, plain] : Logs()) {
    for (const std::string& kind : Kinds()) {
      const std::string packed = Packed(kind, {plain});
      for (std::size_t k = 1; k < 50; ++k) {
        SCOPED_TRACE(format + " in " + kind + " cut at " + std::to_string(k) +
                     "/50");
        try {
          const Log log = ReadPacked(packed.substr(0, packed.size() * k / 50));
          if (log.scans.size() < kScans) {
            EXPECT_THAT(log.skipped, Not(IsEmpty()));
          }
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("packed"));
        }
      }
    }
  }
}

// What is damaged is read to the damage, never differently without a word.
TEST(PackedLogsTest, DamagedBytesAreSaidOrRefused) {
  for (const auto& [format, plain] : Logs()) {
    const Log whole = ReadPacked(plain);
    for (const std::string& kind : Kinds()) {
      // libarchive writes zstd without a checksum.
      if (kind == "zst") continue;
      const std::string packed = Packed(kind, {plain});
      for (std::size_t k = 1; k < 50; ++k) {
        SCOPED_TRACE(format + " in " + kind + " damaged at " +
                     std::to_string(k) + "/50");
        std::string damaged = packed;
        damaged[packed.size() * k / 50] ^= 0x10;
        try {
          const Log log = ReadPacked(damaged);
          if (!log.skipped.empty()) continue;
          ASSERT_EQ(log.scans.size(), kScans);
          for (std::size_t i = 0; i < kScans; ++i) {
            EXPECT_EQ(log.scans[i].ranges, whole.scans[i].ranges);
          }
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("packed"));
        }
      }
    }
  }
}

// A zip of one file that is not packed and says that it is 3 bytes longer.
TEST(PackedLogsTest, WhatIsSaidOfDamageIsOneLine) {
  const std::string text = "FLASER 1 1 0 0 0 0 0 0 1 h 1\n";
  std::string zip("PK\x03\x04", 4);
  const auto append = [&zip](std::size_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) {
      zip += static_cast<char>((value >> (8 * i)) & 0xff);
    }
  };
  append(20, 2);               // version
  append(0, 4);                // flags, method
  append(0x21, 4);             // time, date
  append(0, 4);                // checksum
  append(text.size(), 4);      // packed
  append(text.size() + 3, 4);  // unpacked
  append(5, 4);                // length of the name, of what is extra
  zip += "a.clf" + text;
  InputStream input("test", zip);
  EXPECT_LE(input.ReadRest().size(), text.size());
  EXPECT_THAT(input.damage(), HasSubstr("wrong size"));
  EXPECT_EQ(input.damage().back(), ')');
  for (const char c : input.damage()) EXPECT_GE(c, ' ');
}

TEST(PackedLogsTest, OfAZipOfSeveralFilesTheFirstIsRead) {
  const std::string carmen = Logs().front().second;
  const Log log = ReadPacked(Packed("zip", {carmen, "and another"}));
  EXPECT_EQ(log.scans.size(), kScans);
  ASSERT_THAT(log.skipped, Not(IsEmpty()));
  EXPECT_THAT(log.skipped.back().reason, HasSubstr("more than one file"));
}

}  // namespace
}  // namespace plumbline
