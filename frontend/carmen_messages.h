#ifndef PLUMBLINE_FRONTEND_CARMEN_MESSAGES_H_
#define PLUMBLINE_FRONTEND_CARMEN_MESSAGES_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/skip_counter.h>

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumbline {

/// Splits a line at blanks. Views are valid as long as the line.
class CarmenTokens {
 public:
  explicit CarmenTokens(std::string_view line) : text_(line) {}

  /// The next token; empty at the end.
  std::string_view Next();

  /// Whether nothing but blanks is left.
  bool AtEnd();

  /// How many tokens are left.
  int Count() const;

  /// The next token as a number; false when it is not one.
  bool NextDouble(double* value) { return Parse(Next(), value); }
  bool NextInt(int* value);

  /// A number that may stand in a log: a leading plus is accepted, hexadecimal
  /// is not, "nan" and "inf" are.
  static bool Parse(std::string_view token, double* value);

 private:
  void SkipBlanks();

  std::string_view text_;
};

/// What the messages of a log say, line by line.
class CarmenMessages {
 public:
  /// Messages that can give scans, best first.
  enum Kind { kFlaser, kRobotLaser, kRawLaser, kRlaser };
  static constexpr int kNumKinds = 4;
  /// Their names.
  static constexpr std::array<const char*, kNumKinds> kNames = {
      "FLASER", "ROBOTLASER1", "RAWLASER1", "RLASER"};

  /// Scans of one kind as their messages have them.
  struct Scans {
    /// Scan::angle_step is 0 where the message carries no angles (of a message
    /// that should, only if the step is given),
    /// Scan::maximum_range where it carries none or an absurd one.
    std::vector<Scan> scans;
    /// For each the pose of the laser by odometry; zero for kRawLaser.
    std::vector<Pose2> lasers;
  };

  /// A pose of an ODOM message, m and rad, and its time, s.
  struct TimedPose {
    double timestamp;
    Pose2 pose;
  };

  /// `is_step_given`: the angle between beams is known from elsewhere, so that
  /// messages that say 0 are usable.
  explicit CarmenMessages(bool is_step_given = false)
      : is_step_given_(is_step_given) {}

  /// Takes a line in. Lines that are garbled, unknown or implausible are
  /// counted in skips(); nothing is thrown.
  void Read(std::string_view line, int line_number);

  /// The scans of a kind, in the order of their lines.
  const Scans& scans(Kind kind) const { return scans_[kind]; }
  /// Moves the scans of a kind out.
  Scans TakeScans(Kind kind) { return std::move(scans_[kind]); }
  const std::vector<TimedPose>& odometry() const { return odometry_; }
  /// For each kRawLaser scan the index into odometry() of the last pose before
  /// it, or -1.
  const std::vector<int>& odometry_before() const { return odometry_before_; }
  /// Values of PARAM messages by name.
  const std::map<std::string, std::string>& parameters() const {
    return parameters_;
  }
  /// The number that a PARAM is; `otherwise` where there is none.
  double Parameter(const std::string& name, double otherwise) const;
  /// Messages taken in, by name.
  const std::map<std::string, std::int64_t>& counts() const { return counts_; }
  /// What was passed over, by line.
  SkipCounter& skips() { return skips_; }

 private:
  void Skip(const std::string& reason, std::int64_t count = 1) {
    skips_.Add(reason, line_number_, count);
  }
  void Garbled(const std::string& name, const std::string& expected);
  void UnknownMessage(std::string_view name);
  bool NextRanges(CarmenTokens* tokens, int count, Scan* scan);
  bool NextBeamCount(const std::string& name, CarmenTokens* tokens, int* count);
  void Keep(Kind kind, Scan scan, const Pose2& laser);
  void ReadOldLaser(Kind kind, CarmenTokens tokens);
  void ReadNewLaser(Kind kind, CarmenTokens tokens);
  void ReadOdom(CarmenTokens tokens);
  void ReadParameter(CarmenTokens tokens);

  bool is_step_given_ = false;
  int line_number_ = 0;
  std::array<Scans, kNumKinds> scans_;
  std::vector<TimedPose> odometry_;
  std::vector<int> odometry_before_;
  std::map<std::string, std::string> parameters_;
  std::map<std::string, std::int64_t> counts_;
  SkipCounter skips_;
  // Names of messages that are not used.
  std::set<std::string> unknown_names_;
  std::int64_t bad_readings_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_CARMEN_MESSAGES_H_
