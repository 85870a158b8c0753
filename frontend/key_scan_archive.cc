#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/frontend/key_scan_archive.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <utility>

namespace plumbline {
namespace {

using nlohmann::json;

constexpr double kMillimetre = 1e-3;
// Coordinates (m) and angles (rad) beyond it are garbage.
constexpr double kAbsurdCoordinate = 1e7;
constexpr double kAbsurdRange = 1000.0;
constexpr double kLargestTurn = 2.1 * kPi;
constexpr std::size_t kMostBeams = 10000;
constexpr char kExpected[] = "a map.json that plumbline_solve made of a log";

bool SameLaser(const Scan& a, const Scan& b) {
  return a.laser_offset == b.laser_offset && a.start_angle == b.start_angle &&
         a.angle_step == b.angle_step && a.maximum_range == b.maximum_range;
}

template <typename Range>
void AppendList(const Range& numbers, std::string* text) {
  *text += '[';
  bool is_first = true;
  for (const auto number : numbers) {
    if (!is_first) *text += ", ";
    is_first = false;
    AppendNumber(number + 0, text);  // no -0
  }
  *text += ']';
}

void AppendPose(const Pose2& pose, std::string* text) {
  AppendList(std::initializer_list<double>{pose[0], pose[1], pose[2]}, text);
}

void AppendScan(const KeyScanArchive& archive, std::size_t k, std::size_t laser,
                std::string* text) {
  const Scan& scan = archive.scans[k];
  const KeyScanRecord& record = archive.records[k];
  std::string time = scan.timestamp_text;
  if (time.empty()) AppendNumber(scan.timestamp, &time);
  *text += "{\"time\": ";
  *text += json(time).dump(-1, ' ', false, json::error_handler_t::replace);
  *text += ", \"pose\": ";
  AppendPose(archive.trajectory[k], text);
  *text += ", \"odometry\": ";
  AppendPose(scan.odometry, text);
  *text += ", \"from\": ";
  AppendNumber(static_cast<std::int64_t>(record.from), text);
  *text += ", \"loose\": ";
  *text += record.is_loose ? "true" : "false";
  *text += ", \"motion\": ";
  AppendPose(record.motion.mean, text);
  *text += ", \"covariance\": ";
  const Eigen::Matrix3d& c = record.motion.covariance;
  AppendList(std::initializer_list<double>{c(0, 0), c(0, 1), c(0, 2), c(1, 1),
                                           c(1, 2), c(2, 2)},
             text);
  *text += ", \"laser\": ";
  AppendNumber(static_cast<std::int64_t>(laser), text);
  *text += ", \"ranges\": ";
  std::vector<std::int64_t> ranges;
  for (const float range : scan.ranges) {
    ranges.push_back(std::llround(static_cast<double>(range) / kMillimetre));
  }
  AppendList(ranges, text);
  if (!scan.bearings.empty()) {
    *text += ", \"bearings\": ";
    AppendList(std::vector<double>(scan.bearings.begin(), scan.bearings.end()),
               text);
  }
  *text += '}';
}

// A value in the document, and what it is called.
class Value {
 public:
  Value(const std::string& file, std::string place, const json& value)
      : file_(file), place_(std::move(place)), value_(value) {}

  [[noreturn]] void Fail(const std::string& what,
                         const std::string& expected) const {
    throw Error(file_, 0, place_ + " " + what, expected);
  }

  bool Has(const char* name) const {
    return value_.is_object() && value_.contains(name);
  }
  Value Get(const char* name) const {
    if (!Has(name)) Fail(std::string("has no ") + name, kExpected);
    return Value(file_, place_ + "." + name, value_.at(name));
  }
  std::size_t Size() const {
    if (!value_.is_array()) Fail("is no list", "a list");
    return value_.size();
  }
  Value At(std::size_t i) const {
    return Value(file_, place_ + "[" + std::to_string(i) + "]", value_.at(i));
  }
  double Number(double largest) const {
    if (!value_.is_number()) Fail("is no number", "a number");
    const double number = value_.get<double>();
    if (!(std::abs(number) <= largest)) Fail("is absurd", "a smaller number");
    return number;
  }
  std::int64_t Integer(std::int64_t least, std::int64_t most) const {
    const bool fits = value_.is_number_integer() &&
                      (!value_.is_number_unsigned() ||
                       value_.get<std::uint64_t>() <= std::uint64_t{1} << 62);
    if (!fits || value_.get<std::int64_t>() < least ||
        value_.get<std::int64_t>() > most) {
      Fail("does not fit", "a whole number from " + std::to_string(least) +
                               " to " + std::to_string(most));
    }
    return value_.get<std::int64_t>();
  }
  bool Boolean() const {
    if (!value_.is_boolean()) Fail("is neither true nor false", "one of them");
    return value_.get<bool>();
  }
  std::string Text() const {
    if (!value_.is_string()) Fail("is no text", "text");
    return value_.get<std::string>();
  }
  std::vector<double> Numbers(std::size_t count, double largest) const {
    if (Size() != count) {
      Fail("has " + std::to_string(Size()) + " numbers", std::to_string(count));
    }
    std::vector<double> numbers;
    for (std::size_t i = 0; i < count; ++i) {
      numbers.push_back(At(i).Number(largest));
    }
    return numbers;
  }
  Pose2 Pose() const {
    const std::vector<double> p = Numbers(3, kAbsurdCoordinate);
    return Pose2(p[0], p[1], p[2]);
  }

 private:
  const std::string& file_;
  std::string place_;
  const json& value_;
};

Scan ReadLaser(const Value& value) {
  Scan laser;
  laser.laser_offset = value.Get("offset").Pose();
  laser.start_angle = value.Get("start_angle").Number(kLargestTurn);
  laser.angle_step = value.Get("angle_step").Number(kLargestTurn);
  laser.maximum_range = value.Get("maximum_range").Number(kAbsurdRange);
  if (!(laser.maximum_range > 0.0)) {
    value.Get("maximum_range").Fail("is not above 0", "metres");
  }
  return laser;
}

void ReadRanges(const Value& value, Scan* scan) {
  const Value ranges = value.Get("ranges");
  const std::size_t beams = ranges.Size();
  if (beams == 0 || beams > kMostBeams) {
    ranges.Fail("has " + std::to_string(beams) + " beams",
                "1 to " + std::to_string(kMostBeams));
  }
  if (std::abs(scan->angle_step) * static_cast<double>(beams - 1) >
      kLargestTurn) {
    ranges.Fail("is of more than a turn", "fewer beams");
  }
  constexpr auto kMost = static_cast<std::int64_t>(kAbsurdRange / kMillimetre);
  for (std::size_t i = 0; i < beams; ++i) {
    scan->ranges.push_back(static_cast<float>(
        static_cast<double>(ranges.At(i).Integer(0, kMost)) / 1000.0));
  }
  if (!value.Has("bearings")) return;
  for (const double bearing :
       value.Get("bearings").Numbers(beams, 2.0 * kLargestTurn)) {
    scan->bearings.push_back(static_cast<float>(bearing));
  }
}

UncertainPose2 ReadMotion(const Value& value) {
  UncertainPose2 motion;
  motion.mean = value.Get("motion").Pose();
  const Value covariance = value.Get("covariance");
  const std::vector<double> c = covariance.Numbers(6, 1e12);
  motion.covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
  return motion;
}

}  // namespace

KeyScanArchive MakeKeyScanArchive(const std::vector<Scan>& scans,
                                  const std::vector<RefinedScan>& refined,
                                  const std::vector<KeyScanRecord>& records,
                                  const std::vector<Pose2>& trajectory) {
  KeyScanArchive archive;
  for (const KeyScanRecord& record : records) {
    const auto scan = static_cast<std::size_t>(record.scan);
    if (scan >= trajectory.size()) break;
    KeyScanRecord key;
    key.scan = static_cast<int>(archive.scans.size());
    key.motion = record.motion;
    key.from = record.from;
    key.is_loose = record.is_loose;
    key.pose = trajectory[scan];
    RefinedScan one = refined[scan];
    one.pose = trajectory[scan];
    one.since_key = record.motion;
    one.since = record.from;
    one.is_key = true;
    archive.scans.push_back(scans[scan]);
    archive.refined.push_back(std::move(one));
    archive.records.push_back(std::move(key));
    archive.trajectory.push_back(trajectory[scan]);
  }
  return archive;
}

void AppendKeyScans(const KeyScanArchive& archive, std::string* text) {
  std::vector<const Scan*> lasers;
  std::vector<std::size_t> laser_of;
  for (const Scan& scan : archive.scans) {
    // The one before, mostly.
    std::size_t laser = lasers.size();
    while (laser > 0 && !SameLaser(*lasers[laser - 1], scan)) --laser;
    if (laser == 0) {
      lasers.push_back(&scan);
      laser = lasers.size();
    }
    laser_of.push_back(laser - 1);
  }
  *text += "\"lasers\": [";
  for (std::size_t i = 0; i < lasers.size(); ++i) {
    *text += i > 0 ? ",\n{\"offset\": " : "\n{\"offset\": ";
    AppendPose(lasers[i]->laser_offset, text);
    *text += ", \"start_angle\": ";
    AppendNumber(lasers[i]->start_angle, text);
    *text += ", \"angle_step\": ";
    AppendNumber(lasers[i]->angle_step, text);
    *text += ", \"maximum_range\": ";
    AppendNumber(lasers[i]->maximum_range, text);
    *text += '}';
  }
  *text += "\n],\n\"key_scans\": [";
  for (std::size_t k = 0; k < archive.scans.size(); ++k) {
    *text += k > 0 ? ",\n" : "\n";
    AppendScan(archive, k, laser_of[k], text);
  }
  *text += "\n]";
}

KeyScanArchive ReadKeyScans(const std::string& text, const std::string& name) {
  json document;
  try {
    document = json::parse(text);
  } catch (const json::exception&) {
    throw Error(name, 0, "is not JSON", kExpected);
  }
  if (!document.is_object() || !document.contains("key_scans") ||
      !document.contains("lasers")) {
    throw Error(
        name, 0,
        "has no key scans: it is of a graph, or of an earlier version of "
        "plumbline",
        kExpected);
  }
  const Value root(name, "map", document);
  std::vector<Scan> lasers;
  const Value list = root.Get("lasers");
  for (std::size_t i = 0; i < list.Size(); ++i) {
    lasers.push_back(ReadLaser(list.At(i)));
  }
  const Value keys = root.Get("key_scans");
  const std::size_t count = keys.Size();
  if (count == 0) keys.Fail("is empty", kExpected);
  KeyScanArchive archive;
  for (std::size_t k = 0; k < count; ++k) {
    const Value key = keys.At(k);
    const auto laser = static_cast<std::size_t>(key.Get("laser").Integer(
        0, static_cast<std::int64_t>(lasers.size()) - 1));
    Scan scan = lasers[laser];
    scan.timestamp_text = key.Get("time").Text();
    if (!ParseNumber(scan.timestamp_text, &scan.timestamp) ||
        !std::isfinite(scan.timestamp)) {
      key.Get("time").Fail("is no number", "seconds");
    }
    scan.odometry = key.Get("odometry").Pose();
    scan.line = static_cast<int>(k) + 1;
    ReadRanges(key, &scan);

    KeyScanRecord record;
    record.scan = static_cast<int>(k);
    record.motion = ReadMotion(key);
    // The first one came from nowhere.
    if (k > 0 && !(record.motion.covariance.llt().info() == Eigen::Success)) {
      key.Get("covariance").Fail("is no covariance", "a positive definite one");
    }
    record.from = static_cast<int>(
        key.Get("from").Integer(-1, static_cast<std::int64_t>(k) - 1));
    record.is_loose = key.Get("loose").Boolean();
    record.pose = key.Get("pose").Pose();

    RefinedScan refined;
    refined.pose = record.pose;
    refined.since_key = record.motion;
    refined.since = record.from;
    refined.is_key = true;
    refined.tie = record.is_loose    ? TrackTie::kLoose
                  : record.from >= 0 ? TrackTie::kMatched
                                     : TrackTie::kNone;
    archive.trajectory.push_back(record.pose);
    archive.scans.push_back(std::move(scan));
    archive.refined.push_back(std::move(refined));
    archive.records.push_back(std::move(record));
  }
  return archive;
}

}  // namespace plumbline
