#include <plumbline/core/error.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/foreign_format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// The messages that can give scans, best first.
enum ScanKind { kFlaser, kRobotLaser, kRawLaser, kRlaser, kNumScanKinds };
constexpr std::array<const char*, kNumScanKinds> kScanNames = {
    "FLASER", "ROBOTLASER1", "RAWLASER1", "RLASER"};

constexpr double kDefaultMaximumRange = 80.0;
// A reading is no return from this far below the nominal maximum range on, m:
// logs round to centimetres and lasers report a little less than they claim.
constexpr double kMaximumRangeMargin = 0.05;
// No laser of these logs measures farther, m.
constexpr double kAbsurdRange = 1000.0;
// A stated maximum range above it is in another unit, m.
constexpr double kAbsurdMaximumRange = 200.0;
// Coordinates (m) and headings (rad) beyond it are garbage, not odometry.
constexpr double kAbsurdCoordinate = 1e7;
constexpr int kMaximumBeams = 100000;
// Of more than these every second, third, ... is used: 360 degrees in steps of
// 0.036 degrees, 3 mm apart at 5 m.
constexpr int kMostBeamsUsed = 10000;

constexpr char kBadReading[] =
    "reading that is no distance: expected a number from 0 to 1000 m "
    "(taken as no return)";

// Splits a line at blanks.
class Tokens {
 public:
  explicit Tokens(std::string_view text) : text_(text) {}

  // The next token; empty at the end.
  std::string_view Next() {
    SkipBlanks();
    std::size_t length = 0;
    while (length < text_.size() && !IsBlank(text_[length])) ++length;
    const std::string_view token = text_.substr(0, length);
    text_.remove_prefix(length);
    return token;
  }

  bool AtEnd() {
    SkipBlanks();
    return text_.empty();
  }

  // How many tokens are left.
  int Count() const {
    Tokens rest(text_);
    int count = 0;
    while (!rest.Next().empty()) ++count;
    return count;
  }

  bool NextDouble(double* value) { return Parse(Next(), value); }

  bool NextInt(int* value) {
    const std::string_view token = Next();
    const char* const end = token.data() + token.size();
    const auto result = std::from_chars(token.data(), end, *value);
    return result.ec == std::errc() && result.ptr == end;
  }

  // A number that may stand in a log: a leading plus is accepted, hexadecimal
  // is not, "nan" and "inf" are.
  static bool Parse(std::string_view token, double* value) {
    if (token.size() > 1 && token.front() == '+' && token[1] != '-')
      token.remove_prefix(1);
    const char* const end = token.data() + token.size();
    const auto result = std::from_chars(token.data(), end, *value);
    if (result.ptr != end) return false;
    if (result.ec == std::errc::result_out_of_range) {
      // Too small for a double or too large: the sign of the exponent tells.
      const bool tiny = token.find("e-") != std::string_view::npos ||
                        token.find("E-") != std::string_view::npos;
      *value = tiny ? 0.0 : HUGE_VAL;
      return true;
    }
    return result.ec == std::errc();
  }

 private:
  static bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
  void SkipBlanks() {
    std::size_t count = 0;
    while (count < text_.size() && IsBlank(text_[count])) ++count;
    text_.remove_prefix(count);
  }

  std::string_view text_;
};

// Keeps every k-th beam, from the first on, with the smallest k that leaves at
// most `most`; returns k. The work of matching grows with the square of the
// beams where they are far denser than walls ask for.
int ThinScan(int most, Scan* scan) {
  const int beams = static_cast<int>(scan->ranges.size());
  const int stride = beams <= most ? 1 : (beams + most - 1) / most;
  if (stride == 1) return 1;
  int kept = 0;
  for (int i = 0; i < beams; i += stride) {
    scan->ranges[kept++] = scan->ranges[i];
  }
  scan->ranges.resize(kept);
  scan->angle_step *= stride;
  return stride;
}

// Beams of the old messages, which carry no angles.
void OldFormatAngles(int beams, double resolution, double* start,
                     double* step) {
  const bool standard =
      beams == 180 || beams == 181 || beams == 360 || beams == 361;
  const int intervals = beams % 2 == 0 ? beams : beams - 1;
  *step = intervals > 0 ? kPi / intervals : 0.0;
  if (!standard && resolution > 0.0 && resolution * intervals <= 2.0 * kPi)
    *step = resolution;
  *start = -0.5 * *step * intervals;
}

// The laser's place is a difference of poses that have six digits after the
// point at most: rounded to the last of them, and an angle to the round one
// that it may stand for, it is what was written, so that a drive is the same in
// all formats.
double RoundPosition(double value) { return std::round(value * 1e6) / 1e6; }
double RoundMountAngle(double angle) {
  const double round = DegToRad(std::round(RadToDeg(angle) * 10.0) / 10.0);
  return std::abs(round - angle) < 2e-6 ? round : std::round(angle * 1e6) / 1e6;
}

double Median(std::vector<double> values) {
  const std::size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + middle, values.end());
  return values[middle];
}

// The value at which the readings below `limit` saturate: the smallest of a
// sharp pile at the top of the log's readings with (almost) nothing right below
// it, or 0 when there is none. A wall far away does not make such a pile: a
// flat wall 8 m away fills less than a tenth of the beams to within 1.5 cm.
double SaturatedRange(const std::vector<Scan>& scans, double limit) {
  constexpr double kSmallest = 7.5;
  constexpr int kMostBins = 20000;     // of 1 cm
  constexpr int kHalfPile = 15;        // bins
  constexpr int kBelow = 100;          // bins
  constexpr int kTop = 2 * kHalfPile;  // bins
  constexpr std::int64_t kMinimum = 20;
  const auto bin_of = [](float range) {
    return static_cast<int>(std::lround(range * 100.0));
  };
  std::vector<std::int64_t> histogram;
  std::int64_t total = 0;
  for (const Scan& scan : scans) {
    for (const float range : scan.ranges) {
      if (!(range > 0.0f && range < limit)) continue;
      ++total;
      const int bin = bin_of(range);
      if (bin >= kMostBins) continue;
      if (bin >= static_cast<int>(histogram.size())) {
        histogram.resize(static_cast<std::size_t>(bin) + 1, 0);
      }
      ++histogram[bin];
    }
  }
  const int bins = static_cast<int>(histogram.size());
  const std::int64_t enough = std::max(kMinimum, total / 1000);
  const auto sum = [&histogram, bins](int first, int last) {
    std::int64_t result = 0;
    for (int i = std::max(first, 0); i <= std::min(last, bins - 1); ++i)
      result += histogram[i];
    return result;
  };
  std::int64_t window = 0;
  int top = bins - 1;
  for (; top >= 0; --top) {
    // Readings in [top, top + kTop).
    window += histogram[top];
    if (top + kTop < bins) window -= histogram[top + kTop];
    if (window >= enough) break;
  }
  if (top < 0) return 0.0;
  const auto first = histogram.begin() + std::max(0, top - kHalfPile);
  const auto last = histogram.begin() + std::min(bins, top + kTop);
  const int peak =
      static_cast<int>(std::max_element(first, last) - histogram.begin());
  if (peak < kSmallest * 100.0) return 0.0;
  const std::int64_t pile = sum(peak - kHalfPile, peak + kHalfPile);
  const std::int64_t core = sum(peak - 1, peak + 1);
  const std::int64_t below =
      sum(peak - kHalfPile - kBelow, peak - kHalfPile - 1);
  if (pile < enough || 10 * pile > 9 * total || 2 * core < pile || below > pile)
    return 0.0;

  std::vector<char> beam_has_it;
  for (const Scan& scan : scans) {
    if (beam_has_it.size() < scan.ranges.size())
      beam_has_it.resize(scan.ranges.size(), 0);
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      const float range = scan.ranges[i];
      if (range > 0.0f && range < limit && std::abs(bin_of(range) - peak) <= 1)
        beam_has_it[i] = 1;
    }
  }
  const auto beams = std::count(beam_has_it.begin(), beam_has_it.end(), 1);
  if (10 * beams < static_cast<std::ptrdiff_t>(beam_has_it.size())) return 0.0;

  int lowest = peak;
  while (lowest > peak - kHalfPile &&
         1000 * histogram[lowest - 1] > histogram[peak])
    --lowest;
  return (lowest - 0.5) / 100.0;
}

class CarmenReader {
 public:
  CarmenReader(InputStream* input, const LaserOptions& options)
      : input_(input), options_(options) {
    const auto refuse = [](const char* name, double value, const char* range) {
      throw PLUMBLINE_ERROR(std::string(name) + " is " + std::to_string(value),
                            range);
    };
    if (options.laser_start_angle &&
        !(std::abs(*options.laser_start_angle) <= 2.0 * kPi))
      refuse("laser_start_angle", *options.laser_start_angle,
             "radians within a turn");
    if (options.laser_step &&
        !(*options.laser_step != 0.0 && std::abs(*options.laser_step) <= kPi))
      refuse("laser_step", *options.laser_step,
             "radians, not zero and within half a turn");
    if (options.laser_max_range && !(*options.laser_max_range > 0.0))
      refuse("laser_max_range", *options.laser_max_range, "metres above 0");
  }

  Log Read() {
    if (LooksLikeG2o(input_->Peek(std::size_t{1} << 16))) {
      throw Error(input_->name(), 0, "is a g2o graph", "a CARMEN log");
    }
    const std::string foreign =
        ForeignFormat(input_->Peek(std::size_t{1} << 16));
    if (!foreign.empty()) {
      throw Error(input_->name(), 0, "is " + foreign,
                  "a robot's log (CARMEN, or a ROS 1 or ROS 2 bag) or a graph "
                  "(g2o)");
    }
    std::string_view line;
    while (input_->ReadLine(&line)) {
      if (line.find('\0') != std::string_view::npos) {
        Skip("line with zero bytes: expected text");
        continue;
      }
      ReadMessage(line);
    }
    if (!input_->damage().empty()) {
      Skip(input_->damage() +
           ": what was unpacked before it is used, the rest is lost");
    }
    ChooseScans();
    PlaceRawScans();
    PlaceLaser();
    FindReturns();
    ThinScans();
    Examine();
    return std::move(log_);
  }

 private:
  // A RAWLASER1 scan waits for the ODOM after it.
  struct TimedPose {
    double timestamp;
    Pose2 pose;
  };

  void Skip(const std::string& reason, std::int64_t count = 1) {
    const auto [entry, is_new] =
        skip_index_.emplace(reason, log_.skipped.size());
    if (is_new) {
      log_.skipped.emplace_back();
      log_.skipped.back().reason = reason;
    }
    SkipReport& report = log_.skipped[entry->second];
    report.count += count;
    if (report.first_lines.size() < 5)
      report.first_lines.push_back(input_->line_number());
  }

  void ThinScans() {
    SkipReport report;
    report.reason = "beams of a scan of more than " +
                    std::to_string(kMostBeamsUsed) +
                    ": every second, third, ... is used";
    for (Scan& scan : log_.scans) {
      if (ThinScan(kMostBeamsUsed, &scan) == 1) continue;
      ++report.count;
      if (report.first_lines.size() < 5)
        report.first_lines.push_back(scan.line);
    }
    if (report.count > 0) log_.skipped.push_back(std::move(report));
  }

  void Garbled(const std::string& name, const std::string& expected) {
    Skip("garbled or truncated " + name + ": expected " + expected);
  }

  void ReadMessage(std::string_view line) {
    Tokens tokens(line);
    const std::string_view name = tokens.Next();
    if (name.empty() || name.front() == '#') return;
    if (name == "FLASER") {
      ReadOldLaser(kFlaser, tokens);
    } else if (name == "ODOM") {
      ReadOdom(tokens);
    } else if (name == "ROBOTLASER1") {
      ReadNewLaser(kRobotLaser, tokens);
    } else if (name == "RAWLASER1") {
      ReadNewLaser(kRawLaser, tokens);
    } else if (name == "RLASER") {
      ReadOldLaser(kRlaser, tokens);
    } else if (name == "PARAM") {
      ReadParameter(tokens);
    } else if (name == "SYNC" || name == "TRUEPOS" || name == "COMMENT") {
      ++log_.messages[std::string(name)];
    } else {
      UnknownMessage(name);
    }
  }

  void UnknownMessage(std::string_view name) {
    const bool is_name =
        name.size() <= 32 && name.front() >= 'A' && name.front() <= 'Z' &&
        std::all_of(name.begin(), name.end(), [](char c) {
          return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
                 c == '-';
        });
    if (!is_name) {
      Skip("line that starts with no message name");
      return;
    }
    const std::string reason = "message that is not used: " + std::string(name);
    constexpr int kMaximumKinds = 20;
    if (skip_index_.count(reason) == 0 && ++unknown_names_ > kMaximumKinds) {
      Skip("message that is not used: further names");
    } else {
      Skip(reason);
    }
  }

  static bool IsPlausible(const Pose2& pose) {
    return pose.allFinite() && pose.cwiseAbs().maxCoeff() < kAbsurdCoordinate;
  }

  static bool NextPose(Tokens* tokens, Pose2* pose) {
    return tokens->NextDouble(&(*pose)[0]) && tokens->NextDouble(&(*pose)[1]) &&
           tokens->NextDouble(&(*pose)[2]);
  }

  // ipc_timestamp ipc_host logger_timestamp, then the end.
  static bool NextTrailer(Tokens* tokens, Scan* scan) {
    const std::string_view text = tokens->Next();
    double logger_timestamp = 0.0;
    if (!Tokens::Parse(text, &scan->timestamp) ||
        !std::isfinite(scan->timestamp) || tokens->Next().empty() ||
        !tokens->NextDouble(&logger_timestamp) || !tokens->AtEnd())
      return false;
    scan->timestamp_text = std::string(text);
    return true;
  }

  bool NextRanges(Tokens* tokens, int count, Scan* scan) {
    scan->ranges.resize(count);
    for (float& range : scan->ranges) {
      double value = 0.0;
      if (!tokens->NextDouble(&value)) return false;
      if (value >= 0.0 && value <= kAbsurdRange) {
        range = static_cast<float>(value);
      } else {
        range = 0.0f;
        ++bad_readings_;
      }
    }
    return true;
  }

  // Numbers of beams that can be: zero and absurd ones are counted.
  bool NextBeamCount(const std::string& name, Tokens* tokens, int* count) {
    if (!tokens->NextInt(count)) {
      Garbled(name, "the number of readings");
      return false;
    }
    if (*count == 0) {
      Skip(name + " without readings");
      return false;
    }
    if (*count < 0 || *count > kMaximumBeams) {
      Garbled(name, "a number of readings from 1 to 100000");
      return false;
    }
    return true;
  }

  void Keep(ScanKind kind, Scan scan, const Pose2& laser) {
    if (bad_readings_ > 0) Skip(kBadReading, bad_readings_);
    scan.line = input_->line_number();
    ++log_.messages[kScanNames[kind]];
    scans_[kind].push_back(std::move(scan));
    lasers_[kind].push_back(laser);
  }

  void ReadOldLaser(ScanKind kind, Tokens tokens) {
    const std::string name = kScanNames[kind];
    bad_readings_ = 0;
    int count = 0;
    if (!NextBeamCount(name, &tokens, &count)) return;
    Scan scan;
    Pose2 laser;
    if (!NextRanges(&tokens, count, &scan) || !NextPose(&tokens, &laser) ||
        !NextPose(&tokens, &scan.odometry) || !NextTrailer(&tokens, &scan)) {
      Garbled(name,
              "n, n ranges, x y theta odom_x odom_y odom_theta, and "
              "ipc_timestamp ipc_host logger_timestamp");
      return;
    }
    if (!IsPlausible(laser) || !IsPlausible(scan.odometry)) {
      Skip(name + " with a pose that is not finite or absurd");
      return;
    }
    Keep(kind, std::move(scan), laser);
  }

  void ReadNewLaser(ScanKind kind, Tokens tokens) {
    const std::string name = kScanNames[kind];
    bad_readings_ = 0;
    int laser_type = 0;
    int remission_mode = 0;
    double field_of_view = 0.0;
    double accuracy = 0.0;
    Scan scan;
    if (!tokens.NextInt(&laser_type) || !tokens.NextDouble(&scan.start_angle) ||
        !tokens.NextDouble(&field_of_view) ||
        !tokens.NextDouble(&scan.angle_step) ||
        !tokens.NextDouble(&scan.maximum_range) ||
        !tokens.NextDouble(&accuracy) || !tokens.NextInt(&remission_mode)) {
      Garbled(name,
              "laser_type start_angle field_of_view angular_resolution "
              "maximum_range accuracy remission_mode first");
      return;
    }
    int count = 0;
    if (!NextBeamCount(name, &tokens, &count)) return;
    Pose2 laser = Pose2::Zero();
    const bool read =
        NextRanges(&tokens, count, &scan) && SkipRemissions(kind, &tokens) &&
        (kind == kRawLaser || NextLaserPoses(&tokens, &laser, &scan)) &&
        NextTrailer(&tokens, &scan);
    if (!read) {
      Garbled(name, kind == kRawLaser
                        ? "n ranges, m remissions, and the time stamps"
                        : "n ranges, m remissions, laser and robot pose, five "
                          "numbers, and the time stamps");
      return;
    }
    if (!(scan.angle_step > 0.0) && count > 1)
      scan.angle_step = field_of_view / (count - 1);
    if (!std::isfinite(scan.start_angle) || !std::isfinite(scan.angle_step) ||
        std::abs(scan.start_angle) > 2.1 * kPi ||
        std::abs(scan.angle_step) * (count - 1) > 2.1 * kPi) {
      Skip(name + " with absurd angles: expected radians within a turn");
      return;
    }
    if (!IsPlausible(laser) || !IsPlausible(scan.odometry)) {
      Skip(name + " with a pose that is not finite or absurd");
      return;
    }
    if (!(scan.maximum_range > 0.0) || scan.maximum_range > kAbsurdMaximumRange)
      scan.maximum_range = 0.0;
    if (kind == kRawLaser) {
      raw_odometry_index_.push_back(static_cast<int>(odometry_.size()) - 1);
    }
    Keep(kind, std::move(scan), laser);
  }

  // "m r1..rm"; a page of the format's documentation leaves them out, so their
  // absence is told by the number of fields to the end.
  static bool SkipRemissions(ScanKind kind, Tokens* tokens) {
    const int tail = kind == kRawLaser ? 3 : 14;
    const int left = tokens->Count();
    if (left == tail) return true;
    int count = 0;
    if (!tokens->NextInt(&count) || count < 0 || count != left - tail - 1)
      return false;
    for (int i = 0; i < count; ++i) tokens->Next();
    return true;
  }

  static bool NextLaserPoses(Tokens* tokens, Pose2* laser, Scan* scan) {
    if (!NextPose(tokens, laser) || !NextPose(tokens, &scan->odometry))
      return false;
    // Velocities, safety distances and turn axis.
    for (int i = 0; i < 5; ++i) {
      double unused = 0.0;
      if (!tokens->NextDouble(&unused)) return false;
    }
    return true;
  }

  void ReadOdom(Tokens tokens) {
    TimedPose odometry;
    if (!NextPose(&tokens, &odometry.pose) || !IsPlausible(odometry.pose)) {
      Garbled("ODOM", "x y theta tv rv accel and the time stamps");
      return;
    }
    double number = 0.0;
    Scan trailer;
    for (int i = 0; i < 3; ++i) {
      if (!tokens.NextDouble(&number)) {
        Garbled("ODOM", "x y theta tv rv accel and the time stamps");
        return;
      }
    }
    if (!NextTrailer(&tokens, &trailer)) {
      Garbled("ODOM", "x y theta tv rv accel and the time stamps");
      return;
    }
    odometry.timestamp = trailer.timestamp;
    odometry_.push_back(odometry);
    ++log_.messages["ODOM"];
  }

  void ReadParameter(Tokens tokens) {
    const std::string_view name = tokens.Next();
    const int left = tokens.Count();
    if (name.empty() || left == 0) {
      Garbled("PARAM", "a name and a value");
      return;
    }
    // A value of several words reaches to the time stamps.
    std::string value(tokens.Next());
    for (int i = 4; i < left; ++i) {
      value += ' ';
      value += tokens.Next();
    }
    log_.parameters[std::string(name)] = value;
    ++log_.messages["PARAM"];
  }

  // The number of a PARAM, or `otherwise`.
  double Parameter(const std::string& name, double otherwise) const {
    const auto entry = log_.parameters.find(name);
    double value = 0.0;
    return entry != log_.parameters.end() &&
                   Tokens::Parse(entry->second, &value) && std::isfinite(value)
               ? value
               : otherwise;
  }

  void ChooseScans() {
    int chosen = 0;
    while (chosen < kNumScanKinds && scans_[chosen].empty()) ++chosen;
    if (chosen == kNumScanKinds) {
      throw Error(input_->name(), 0, "no laser scan found: " + Found(),
                  "a CARMEN log with FLASER, ROBOTLASER1, RAWLASER1 or RLASER "
                  "messages");
    }
    kind_ = static_cast<ScanKind>(chosen);
    log_.scan_message = kScanNames[kind_];
    for (int other = chosen + 1; other < kNumScanKinds; ++other) {
      if (scans_[other].empty()) continue;
      SkipReport report;
      report.reason = std::string(kScanNames[other]) +
                      " passed over: the scans are taken from " +
                      kScanNames[kind_];
      report.count = static_cast<std::int64_t>(scans_[other].size());
      for (std::size_t i = 0; i < scans_[other].size() && i < 5; ++i)
        report.first_lines.push_back(scans_[other][i].line);
      log_.skipped.push_back(report);
    }
    log_.scans = std::move(scans_[kind_]);
  }

  // What the input holds in place of scans, for the refusal.
  std::string Found() const {
    if (input_->line_number() == 0 && input_->damage().empty())
      return "the input is empty";
    std::string found = std::to_string(input_->line_number()) + " lines";
    for (const auto& [name, count] : log_.messages)
      found += ", " + std::to_string(count) + " " + name;
    int listed = 0;
    for (const SkipReport& report : log_.skipped) {
      if (++listed > 3) break;
      found += "; " + std::to_string(report.count) + " x " + report.reason;
      if (!report.first_lines.empty() && report.first_lines.front() > 0)
        found += " (first in line " +
                 std::to_string(report.first_lines.front()) + ")";
    }
    return found;
  }

  void PlaceRawScans() {
    if (kind_ != kRawLaser || odometry_.empty()) return;
    for (std::size_t i = 0; i < log_.scans.size(); ++i) {
      Scan& scan = log_.scans[i];
      const int before = raw_odometry_index_[i];
      const TimedPose& last = odometry_[std::max(before, 0)];
      scan.odometry = last.pose;
      const std::size_t after = static_cast<std::size_t>(before + 1);
      if (before < 0 || after >= odometry_.size()) continue;
      const TimedPose& next = odometry_[after];
      const double span = next.timestamp - last.timestamp;
      const double part = (scan.timestamp - last.timestamp) / span;
      if (!(span > 0.0 && part >= 0.0 && part <= 1.0)) continue;
      Pose2 difference = next.pose - last.pose;
      difference[2] = NormalizeAngle(difference[2]);
      scan.odometry = last.pose + part * difference;
      scan.odometry[2] = NormalizeAngle(scan.odometry[2]);
    }
  }

  void PlaceLaser() {
    const bool rear = kind_ == kRlaser;
    const Pose2 parameter(
        Parameter(rear ? "robot_rearlaser_offset" : "robot_frontlaser_offset",
                  0.0),
        0.0, rear ? kPi : 0.0);
    Pose2 offset = parameter;
    if (kind_ != kRawLaser) {
      const std::vector<Pose2>& lasers = lasers_[kind_];
      std::vector<Pose2> offsets(lasers.size());
      std::array<std::vector<double>, 3> components;
      for (std::size_t i = 0; i < lasers.size(); ++i) {
        offsets[i] = Between(log_.scans[i].odometry, lasers[i]);
        // Near the first, so that the median does not straddle the cut.
        offsets[i][2] =
            offsets[0][2] + NormalizeAngle(offsets[i][2] - offsets[0][2]);
        for (int k = 0; k < 3; ++k) components[k].push_back(offsets[i][k]);
      }
      const Pose2 median(Median(components[0]), Median(components[1]),
                         Median(components[2]));
      std::vector<int> apart;
      for (std::size_t i = 0; i < offsets.size(); ++i) {
        const Pose2 difference = offsets[i] - median;
        if (difference.head<2>().norm() > 0.3 ||
            std::abs(NormalizeAngle(difference[2])) > DegToRad(10.0))
          apart.push_back(static_cast<int>(i));
      }
      const bool fixed =
          10 * apart.size() <= offsets.size() && median.head<2>().norm() < 5.0;
      if (fixed) {
        offset = Pose2(RoundPosition(median[0]), RoundPosition(median[1]),
                       RoundMountAngle(NormalizeAngle(median[2])));
      } else {
        SkipReport report;
        report.reason =
            "laser pose that is not at a fixed place on the robot (a corrected "
            "log?): the robot pose alone is used";
        report.count = static_cast<std::int64_t>(offsets.size());
        for (std::size_t i = 0; i < apart.size() && i < 5; ++i)
          report.first_lines.push_back(log_.scans[apart[i]].line);
        log_.skipped.push_back(report);
      }
    }
    for (Scan& scan : log_.scans)
      scan.laser_offset = offset + Pose2::Zero();  // no -0
  }

  void FindReturns() {
    const bool rear = kind_ == kRlaser;
    const bool old_format = kind_ == kFlaser || rear;
    double nominal =
        Parameter(rear ? "robot_rear_laser_max" : "robot_front_laser_max", 0.0);
    if (!(nominal > 0.0 && nominal <= kAbsurdMaximumRange))
      nominal = kDefaultMaximumRange;
    const double resolution = DegToRad(Parameter(
        rear ? "laser_rear_laser_resolution" : "laser_front_laser_resolution",
        0.0));
    double largest = 0.0;
    for (Scan& scan : log_.scans) {
      if (old_format) {
        OldFormatAngles(static_cast<int>(scan.ranges.size()), resolution,
                        &scan.start_angle, &scan.angle_step);
      }
      if (options_.laser_start_angle)
        scan.start_angle = *options_.laser_start_angle;
      if (options_.laser_step) scan.angle_step = *options_.laser_step;
      if (!(scan.maximum_range > 0.0)) scan.maximum_range = nominal;
      if (options_.laser_max_range)
        scan.maximum_range = *options_.laser_max_range;
      largest = std::max(largest, scan.maximum_range);
    }
    const double saturated =
        options_.laser_max_range
            ? 0.0
            : SaturatedRange(log_.scans, largest - kMaximumRangeMargin);
    for (Scan& scan : log_.scans) {
      double no_return = scan.maximum_range - kMaximumRangeMargin;
      if (saturated > 0.0 && saturated < no_return) {
        scan.maximum_range = saturated;
        no_return = saturated;
      }
      for (float& range : scan.ranges) {
        if (range >= no_return) range = 0.0f;
      }
    }
  }

  void Examine() {
    for (std::size_t i = 1; i < log_.scans.size(); ++i) {
      const Scan& before = log_.scans[i - 1];
      const Scan& scan = log_.scans[i];
      if (scan.odometry != log_.scans[0].odometry) log_.has_odometry = true;
      if (scan.ranges.size() != before.ranges.size()) ++log_.beam_count_changes;
      const double back = before.timestamp - scan.timestamp;
      if (back > 0.0) {
        ++log_.time_reversals;
        log_.largest_time_reversal = std::max(log_.largest_time_reversal, back);
      }
    }
  }

  InputStream* input_;
  LaserOptions options_;
  Log log_;
  ScanKind kind_ = kFlaser;
  std::array<std::vector<Scan>, kNumScanKinds> scans_;
  // Pose of the laser by odometry, one a scan.
  std::array<std::vector<Pose2>, kNumScanKinds> lasers_;
  std::vector<TimedPose> odometry_;
  // Index of the ODOM before each RAWLASER1 scan, or -1.
  std::vector<int> raw_odometry_index_;
  std::map<std::string, std::size_t> skip_index_;
  int unknown_names_ = 0;
  std::int64_t bad_readings_ = 0;
};

enum class TextFormat { kUnknown, kCarmen, kG2o };

TextFormat RecognizeFormat(std::string_view prefix) {
  constexpr std::array<std::string_view, 12> kCarmenNames = {
      "FLASER",    "RLASER",    "ODOM",        "PARAM",
      "SYNC",      "TRUEPOS",   "ROBOTLASER1", "ROBOTLASER2",
      "RAWLASER1", "RAWLASER2", "COMMENT",     "NMEA-GGA"};
  while (!prefix.empty()) {
    const std::size_t end = prefix.find('\n');
    const std::string_view tag = Tokens(prefix.substr(0, end)).Next();
    // VERTEX_SE2, and TORO's VERTEX2.
    if (tag.substr(0, 6) == "VERTEX" || tag.substr(0, 4) == "EDGE" ||
        tag.substr(0, 7) == "PARAMS_" || tag.substr(0, 10) == "PLUMBLINE_" ||
        tag == "FIX")
      return TextFormat::kG2o;
    if (std::find(kCarmenNames.begin(), kCarmenNames.end(), tag) !=
        kCarmenNames.end())
      return TextFormat::kCarmen;
    if (end == std::string_view::npos) break;
    prefix.remove_prefix(end + 1);
  }
  return TextFormat::kUnknown;
}

}  // namespace

Log ReadCarmenLog(const std::string& path, const LaserOptions& options) {
  InputStream input(path);
  return ReadCarmenLog(&input, options);
}

Log ReadCarmenLog(InputStream* input, const LaserOptions& options) {
  return CarmenReader(input, options).Read();
}

bool LooksLikeCarmenLog(std::string_view prefix) {
  return RecognizeFormat(prefix) == TextFormat::kCarmen;
}

bool LooksLikeG2o(std::string_view prefix) {
  return RecognizeFormat(prefix) == TextFormat::kG2o;
}

}  // namespace plumbline
