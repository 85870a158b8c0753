#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/key_scan_archive.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;

UncertainPose2 OdometryMotion(double x) {
  UncertainPose2 motion;
  motion.mean = Pose2(x, 0.1, 0.2);
  motion.covariance << 0.01, 0.001, 0.002, 0.001, 0.02, 0.003, 0.002, 0.003,
      0.04;
  return motion;
}

// Five scans, of which three are keys: the third was found from the first.
struct SmallLog {
  std::vector<Scan> scans;
  std::vector<RefinedScan> refined;
  std::vector<KeyScanRecord> records;
  std::vector<Pose2> trajectory;

  SmallLog() {
    for (int i = 0; i < 5; ++i) {
      Scan scan;
      scan.timestamp = 100.5 + i;
      scan.timestamp_text = std::to_string(100 + i) + ".500000";
      scan.odometry = Pose2(i, 2.0 * i, 0.1 * i);
      scan.laser_offset = Pose2(0.2, 0.0, i < 3 ? 0.0 : 0.1);
      scan.start_angle = -1.5;
      scan.angle_step = 0.25;
      scan.maximum_range = 30.0;
      scan.ranges = {1.25f, 0.0f, 12.34f, 0.001f};
      if (i == 4) scan.bearings = {-1.5f, -1.2f, -1.0f, -0.75f};
      scans.push_back(scan);
      RefinedScan one;
      one.is_key = i % 2 == 0;
      refined.push_back(one);
      trajectory.emplace_back(0.1 * i, -0.3 * i, 0.01 * i);
      if (!one.is_key) continue;
      KeyScanRecord record;
      record.scan = i;
      record.motion = OdometryMotion(i);
      record.is_loose = i == 2;
      record.from = i == 4 ? 0 : -1;
      record.matches.resize(3);
      records.push_back(record);
    }
  }

  KeyScanArchive Archive() const {
    return MakeKeyScanArchive(scans, refined, records, trajectory);
  }
};

std::string TextOf(const KeyScanArchive& archive) {
  std::string text = "{";
  AppendKeyScans(archive, &text);
  return text + "}";
}

TEST(KeyScanArchiveTest, KeepsKeyScans) {
  const SmallLog log;
  const KeyScanArchive archive =
      ReadKeyScans(TextOf(log.Archive()), "map.json");
  ASSERT_EQ(archive.scans.size(), 3u);
  ASSERT_EQ(archive.refined.size(), 3u);
  ASSERT_EQ(archive.records.size(), 3u);
  ASSERT_EQ(archive.trajectory.size(), 3u);
  for (std::size_t k = 0; k < 3; ++k) {
    const Scan& scan = archive.scans[k];
    const Scan& was = log.scans[2 * k];
    EXPECT_EQ(scan.timestamp, was.timestamp);
    EXPECT_EQ(scan.timestamp_text, was.timestamp_text);
    EXPECT_EQ(scan.odometry, was.odometry);
    EXPECT_EQ(scan.laser_offset, was.laser_offset);
    EXPECT_EQ(scan.start_angle, was.start_angle);
    EXPECT_EQ(scan.angle_step, was.angle_step);
    EXPECT_EQ(scan.maximum_range, was.maximum_range);
    EXPECT_EQ(scan.ranges, was.ranges);
    EXPECT_EQ(scan.bearings, was.bearings);
    EXPECT_EQ(archive.trajectory[k], log.trajectory[2 * k]);
    const KeyScanRecord& record = archive.records[k];
    EXPECT_EQ(record.scan, static_cast<int>(k));
    EXPECT_EQ(record.motion.mean,
              OdometryMotion(2.0 * static_cast<double>(k)).mean);
    EXPECT_EQ(record.motion.covariance, OdometryMotion(0).covariance);
    EXPECT_EQ(record.pose, log.trajectory[2 * k]);
    EXPECT_TRUE(record.matches.empty());
    EXPECT_TRUE(archive.refined[k].is_key);
  }
  EXPECT_EQ(archive.refined[1].tie, TrackTie::kLoose);
  EXPECT_EQ(archive.refined[2].tie, TrackTie::kMatched);
  EXPECT_EQ(archive.refined[2].since, 0);
  EXPECT_EQ(archive.records[2].from, 0);
  // The same bytes again.
  EXPECT_EQ(TextOf(archive), TextOf(log.Archive()));
}

TEST(KeyScanArchiveTest, LeavesOutScansWithoutPoses) {
  SmallLog log;
  log.trajectory.resize(3);
  EXPECT_EQ(log.Archive().scans.size(), 2u);
}

TEST(KeyScanArchiveTest, TimesWithoutText) {
  SmallLog log;
  log.scans[2].timestamp_text.clear();
  EXPECT_EQ(ReadKeyScans(TextOf(log.Archive()), "m").scans[1].timestamp, 102.5);
}

TEST(KeyScanArchiveTest, RefusesWhatCannotBe) {
  const std::string text = TextOf(SmallLog().Archive());
  const auto why = [](const std::string& bad) {
    return Refusal([&] { ReadKeyScans(bad, "map.json"); });
  };
  EXPECT_EQ(why(text), "accepted");
  EXPECT_THAT(why("{"), HasSubstr("map.json: is not JSON"));
  EXPECT_THAT(why("[]"), HasSubstr("has no key scans"));
  EXPECT_THAT(why(R"({"features": []})"), HasSubstr("has no key scans"));
  EXPECT_THAT(why(R"({"lasers": [], "key_scans": []})"), HasSubstr("is empty"));
  using nlohmann::json;
  const auto with = [&](const std::string& place, const json& value) {
    json document = json::parse(text);
    document[json::json_pointer(place)] = value;
    return why(document.dump());
  };
  EXPECT_THAT(with("/key_scans", 5), HasSubstr("map.key_scans is no list"));
  EXPECT_THAT(with("/key_scans/1", 5), HasSubstr("key_scans[1] has no"));
  EXPECT_THAT(with("/key_scans/1/time", "noon"), HasSubstr("is no number"));
  EXPECT_THAT(with("/key_scans/1/time", 5), HasSubstr("is no text"));
  EXPECT_THAT(with("/key_scans/1/pose", json::array({1, 2})),
              HasSubstr("key_scans[1].pose has 2 numbers: expected 3"));
  EXPECT_THAT(with("/key_scans/1/pose/0", nullptr), HasSubstr("is no number"));
  EXPECT_THAT(with("/key_scans/1/pose/0", 1e300), HasSubstr("is absurd"));
  EXPECT_THAT(with("/key_scans/1/odometry/2", "a"), HasSubstr("is no number"));
  EXPECT_THAT(with("/key_scans/1/from", 1), HasSubstr("from does not fit"));
  EXPECT_THAT(with("/key_scans/1/from", -2), HasSubstr("from does not fit"));
  EXPECT_THAT(with("/key_scans/1/from", 18446744073709551615u),
              HasSubstr("from does not fit"));
  EXPECT_THAT(with("/key_scans/1/loose", 1), HasSubstr("neither true nor"));
  EXPECT_THAT(with("/key_scans/1/laser", 7), HasSubstr("laser does not fit"));
  EXPECT_THAT(with("/key_scans/1/covariance/0", -1.0),
              HasSubstr("is no covariance"));
  EXPECT_THAT(with("/key_scans/1/ranges", json::array()),
              HasSubstr("has 0 beams"));
  EXPECT_THAT(with("/key_scans/1/ranges", std::vector<int>(40, 1)),
              HasSubstr("more than a turn"));
  EXPECT_THAT(with("/key_scans/1/ranges/0", -1), HasSubstr("does not fit"));
  EXPECT_THAT(with("/key_scans/1/ranges/0", 1.5), HasSubstr("does not fit"));
  EXPECT_THAT(with("/key_scans/2/bearings", json::array({1.0})),
              HasSubstr("expected 4"));
  EXPECT_THAT(with("/lasers/0/maximum_range", 0.0), HasSubstr("not above 0"));
  EXPECT_THAT(with("/lasers/0/start_angle", 100.0), HasSubstr("is absurd"));
}

// Cut anywhere it is refused.
TEST(KeyScanArchiveTest, CutAnywhere) {
  const std::string text = TextOf(SmallLog().Archive());
  for (std::size_t size = 0; size < text.size(); ++size) {
    EXPECT_NE(Refusal([&] { ReadKeyScans(text.substr(0, size), "map.json"); }),
              "accepted");
  }
}

}  // namespace
}  // namespace plumbline
