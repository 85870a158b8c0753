#include <plumbline/frontend/carmen_messages.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>

namespace plumbline {
namespace {

// No laser of these logs measures farther, m.
constexpr double kAbsurdRange = 1000.0;
// A stated maximum range above it is in another unit, m.
constexpr double kAbsurdMaximumRange = 200.0;
// Coordinates (m) and headings (rad) beyond it are garbage, not odometry.
constexpr double kAbsurdCoordinate = 1e7;
constexpr int kMaximumBeams = 100000;

constexpr char kBadReading[] =
    "reading that is no distance: expected a number from 0 to 1000 m "
    "(taken as no return)";

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

bool IsPlausible(const Pose2& pose) {
  return pose.allFinite() && pose.cwiseAbs().maxCoeff() < kAbsurdCoordinate;
}

bool NextPose(CarmenTokens* tokens, Pose2* pose) {
  return tokens->NextDouble(&(*pose)[0]) && tokens->NextDouble(&(*pose)[1]) &&
         tokens->NextDouble(&(*pose)[2]);
}

// ipc_timestamp ipc_host logger_timestamp, then the end.
bool NextTrailer(CarmenTokens* tokens, Scan* scan) {
  const std::string_view text = tokens->Next();
  double logger_timestamp = 0.0;
  if (!CarmenTokens::Parse(text, &scan->timestamp) ||
      !std::isfinite(scan->timestamp) || tokens->Next().empty() ||
      !tokens->NextDouble(&logger_timestamp) || !tokens->AtEnd())
    return false;
  scan->timestamp_text = std::string(text);
  return true;
}

// "m r1..rm"; a page of the format's documentation leaves them out, so their
// absence is told by the number of fields to the end.
bool SkipRemissions(CarmenMessages::Kind kind, CarmenTokens* tokens) {
  const int tail = kind == CarmenMessages::kRawLaser ? 3 : 14;
  const int left = tokens->Count();
  if (left == tail) return true;
  int count = 0;
  if (!tokens->NextInt(&count) || count < 0 || count != left - tail - 1)
    return false;
  for (int i = 0; i < count; ++i) tokens->Next();
  return true;
}

bool NextLaserPoses(CarmenTokens* tokens, Pose2* laser, Scan* scan) {
  if (!NextPose(tokens, laser) || !NextPose(tokens, &scan->odometry))
    return false;
  // Velocities, safety distances and turn axis.
  for (int i = 0; i < 5; ++i) {
    double unused = 0.0;
    if (!tokens->NextDouble(&unused)) return false;
  }
  return true;
}

}  // namespace

std::string_view CarmenTokens::Next() {
  SkipBlanks();
  std::size_t length = 0;
  while (length < text_.size() && !IsBlank(text_[length])) ++length;
  const std::string_view token = text_.substr(0, length);
  text_.remove_prefix(length);
  return token;
}

bool CarmenTokens::AtEnd() {
  SkipBlanks();
  return text_.empty();
}

int CarmenTokens::Count() const {
  CarmenTokens rest(text_);
  int count = 0;
  while (!rest.Next().empty()) ++count;
  return count;
}

bool CarmenTokens::NextInt(int* value) {
  const std::string_view token = Next();
  const char* const end = token.data() + token.size();
  const auto result = std::from_chars(token.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

bool CarmenTokens::Parse(std::string_view token, double* value) {
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

void CarmenTokens::SkipBlanks() {
  std::size_t count = 0;
  while (count < text_.size() && IsBlank(text_[count])) ++count;
  text_.remove_prefix(count);
}

void CarmenMessages::Garbled(const std::string& name,
                             const std::string& expected) {
  Skip("garbled or truncated " + name + ": expected " + expected);
}

void CarmenMessages::Read(std::string_view line, int line_number) {
  line_number_ = line_number;
  CarmenTokens tokens(line);
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
    ++counts_[std::string(name)];
  } else {
    UnknownMessage(name);
  }
}

void CarmenMessages::UnknownMessage(std::string_view name) {
  const bool is_name = name.size() <= 32 && name.front() >= 'A' &&
                       name.front() <= 'Z' &&
                       std::all_of(name.begin(), name.end(), [](char c) {
                         return (c >= 'A' && c <= 'Z') ||
                                (c >= '0' && c <= '9') || c == '_' || c == '-';
                       });
  if (!is_name) {
    Skip("line that starts with no message name");
    return;
  }
  constexpr std::size_t kMostNames = 20;
  std::string text(name);
  if (unknown_names_.count(text) == 0 && unknown_names_.size() >= kMostNames) {
    Skip("message that is not used: further names");
    return;
  }
  Skip("message that is not used: " + text);
  unknown_names_.insert(std::move(text));
}

bool CarmenMessages::NextRanges(CarmenTokens* tokens, int count, Scan* scan) {
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
bool CarmenMessages::NextBeamCount(const std::string& name,
                                   CarmenTokens* tokens, int* count) {
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

void CarmenMessages::Keep(Kind kind, Scan scan, const Pose2& laser) {
  if (bad_readings_ > 0) Skip(kBadReading, bad_readings_);
  scan.line = line_number_;
  ++counts_[kNames[kind]];
  scans_[kind].scans.push_back(std::move(scan));
  scans_[kind].lasers.push_back(laser);
}

void CarmenMessages::ReadOldLaser(Kind kind, CarmenTokens tokens) {
  const std::string name = kNames[kind];
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

void CarmenMessages::ReadNewLaser(Kind kind, CarmenTokens tokens) {
  const std::string name = kNames[kind];
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
  if (scan.angle_step == 0.0 && count > 1 && !is_step_given_) {
    Skip(name +
         " whose readings have no angle between them: expected an "
         "angular_resolution or a field_of_view, rad, or --laser_step");
    return;
  }
  if (!IsPlausible(laser) || !IsPlausible(scan.odometry)) {
    Skip(name + " with a pose that is not finite or absurd");
    return;
  }
  if (!(scan.maximum_range > 0.0) || scan.maximum_range > kAbsurdMaximumRange)
    scan.maximum_range = 0.0;
  if (kind == kRawLaser) {
    odometry_before_.push_back(static_cast<int>(odometry_.size()) - 1);
  }
  Keep(kind, std::move(scan), laser);
}

void CarmenMessages::ReadOdom(CarmenTokens tokens) {
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
  ++counts_["ODOM"];
}

void CarmenMessages::ReadParameter(CarmenTokens tokens) {
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
  parameters_[std::string(name)] = value;
  ++counts_["PARAM"];
}

double CarmenMessages::Parameter(const std::string& name,
                                 double otherwise) const {
  const auto entry = parameters_.find(name);
  double value = 0.0;
  return entry != parameters_.end() &&
                 CarmenTokens::Parse(entry->second, &value) &&
                 std::isfinite(value)
             ? value
             : otherwise;
}

}  // namespace plumbline
