#include <plumbline/core/error.h>
#include <plumbline/frontend/carmen_messages.h>
#include <plumbline/frontend/csv_reader.h>
#include <plumbline/frontend/slow_odometry.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr double kDefaultMaximumRange = 80.0;
// No laser of a robot sees farther, m, and no scan is of more than a turn.
constexpr double kAbsurdRange = 1000.0;
constexpr double kLargestTurn = 2.1 * kPi;
// Coordinates (m) and angles (rad) beyond it are garbage.
constexpr double kAbsurdCoordinate = 1e7;
// Of more beams every second, third, ... is used.
constexpr std::size_t kMostBeamsUsed = 10000;
// A reading this near to the largest range is none, m.
constexpr double kMaximumRangeMargin = 0.001;
constexpr int kShownLines = 5;

std::string_view Trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

// Where the cell that begins the line may end at the earliest: behind the
// quotes, if it is in quotes, whatever stands in them. Quotes in them are
// doubled; those that nothing closes reach to the end of the line.
std::size_t QuotesEnd(std::string_view line, std::string_view separators) {
  std::size_t begin = 0;
  while (begin < line.size() && (line[begin] == ' ' || line[begin] == '\t') &&
         separators.find(line[begin]) == std::string_view::npos) {
    ++begin;
  }
  if (begin >= line.size() || line[begin] != '"') return 0;
  std::size_t end = line.find('"', begin + 1);
  while (end != std::string_view::npos) {
    if (end + 1 >= line.size() || line[end + 1] != '"') return end + 1;
    end = line.find('"', end + 2);
  }
  return line.size();
}

// What stands between the cells of a table with this header: a comma, or what
// spreadsheets write where the comma stands in numbers.
char SeparatorOf(std::string_view header) {
  constexpr std::string_view kSeparators = ",;\t";
  const std::size_t found =
      header.find_first_of(kSeparators, QuotesEnd(header, kSeparators));
  return found == std::string_view::npos ? ',' : header[found];
}

// R and others put names in quotes. Quotes in them stay doubled.
std::string_view Unquoted(std::string_view cell) {
  cell = Trimmed(cell);
  if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') {
    cell = Trimmed(cell.substr(1, cell.size() - 2));
  }
  return cell;
}

std::vector<std::string_view> Cells(std::string_view line, char separator) {
  std::vector<std::string_view> cells;
  while (true) {
    const std::size_t end =
        line.find(separator, QuotesEnd(line, {&separator, 1}));
    cells.push_back(Unquoted(line.substr(0, end)));
    if (end == std::string_view::npos) return cells;
    line.remove_prefix(end + 1);
  }
}

// The next line of `text`, which is taken off it. Lines end as on any system:
// with CR and LF, LF, or CR alone.
std::string_view TakeLine(std::string_view* text) {
  const std::size_t end = text->find_first_of("\r\n");
  const std::string_view line = text->substr(0, end);
  if (end == std::string_view::npos) {
    *text = {};
    return line;
  }
  const bool is_pair = text->substr(end, 2) == "\r\n";
  text->remove_prefix(end + (is_pair ? 2 : 1));
  return line;
}

// None when the cell is anything but a number. Where cells are not separated by
// commas numbers may have one.
std::optional<double> Number(std::string_view cell, char separator) {
  std::string with_point;
  const std::size_t comma = cell.find(',');
  if (separator != ',' && comma != std::string_view::npos) {
    with_point = std::string(cell);
    with_point[comma] = '.';
    cell = with_point;
  }
  double value = 0.0;
  if (!CarmenTokens::Parse(cell, &value)) return std::nullopt;
  return value;
}

// What R, Python and databases write for a number that is missing.
bool IsMissing(std::string_view cell) {
  if (cell.empty()) return true;
  std::string word(cell.substr(0, 5));
  std::transform(word.begin(), word.end(), word.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return word == "na" || word == "none" || word == "null";
}

// A name as it was before it was put in quotes.
std::string WithSingleQuotes(std::string_view name) {
  std::string text;
  for (std::size_t i = 0; i < name.size(); ++i) {
    text += name[i];
    if (name.substr(i, 2) == "\"\"") ++i;
  }
  return text;
}

// Index of a column of ranges: "r12"; none when it is no such column.
std::optional<std::size_t> BeamOf(std::string_view name) {
  if (name.size() < 2 || name[0] != 'r') return std::nullopt;
  std::size_t beam = 0;
  const char* const begin = name.data() + 1;
  const char* const end = name.data() + name.size();
  const auto result = std::from_chars(begin, end, beam);
  if (result.ec != std::errc() || result.ptr != end) return std::nullopt;
  // r01 is r1 for nobody.
  if (end - begin > 1 && *begin == '0') return std::nullopt;
  return beam;
}

// The columns that are no ranges.
constexpr std::array<std::string_view, 10> kNames = {
    "time",    "x",           "y",           "theta",      "laser_x",
    "laser_y", "laser_theta", "start_angle", "angle_step", "max_range"};

class CsvReader {
 public:
  CsvReader(InputStream* input, const LaserOptions& options)
      : input_(input), options_(options) {
    log_.format = "CSV of scans";
    log_.scan_message = "r0, r1, ...";
  }

  Log Read() {
    std::string_view lines;
    bool has_header = false;
    while (input_->ReadLine(&lines)) {
      // More than one where lines end with CR alone.
      do {
        ++line_number_;
        // With its tabs, which may stand for empty cells.
        const std::string_view line = TakeLine(&lines);
        const std::string_view text = Trimmed(line);
        if (text.empty() || text.front() == '#') continue;
        if (!has_header) {
          ReadHeader(line);
          has_header = true;
        } else {
          ReadScan(line);
        }
      } while (!lines.empty());
    }
    if (!input_->damage().empty()) {
      Skip(input_->damage() +
           ": what was unpacked before it is used, the rest is lost");
    }
    if (log_.scans.empty()) {
      throw Error(input_->name(), line_number_,
                  has_header ? "no line is a scan" + FirstReason()
                             : "no line names columns",
                  "a line that names the columns, then a line per scan");
    }
    if (has_poses_) SpreadSlowOdometry(&log_);
    Examine();
    return std::move(log_);
  }

 private:
  Error Refuse(const std::string& what, const std::string& expected) const {
    return Error(input_->name(), line_number_, what, expected);
  }

  std::string FirstReason() const {
    return log_.skipped.empty() ? "" : ": " + log_.skipped.front().reason;
  }

  void ReadHeader(std::string_view line) {
    separator_ = SeparatorOf(line);
    const std::vector<std::string_view> names = Cells(line, separator_);
    num_cells_ = names.size();
    std::string unused;
    int num_unused = 0;
    std::map<std::size_t, std::size_t> beams;
    for (std::size_t c = 0; c < names.size(); ++c) {
      const std::string name = WithSingleQuotes(names[c]);
      bool is_new = true;
      if (const auto beam = BeamOf(names[c])) {
        is_new = beams.emplace(*beam, c).second;
      } else if (std::find(kNames.begin(), kNames.end(), name) !=
                 kNames.end()) {
        is_new = columns_.emplace(name, c).second;
      } else if (++num_unused <= kShownLines) {
        unused += (unused.empty() ? "" : ", ") + name;
      }
      if (!is_new) throw Refuse("two columns '" + name + "'", "one");
    }
    if (columns_.count("time") == 0) {
      throw Refuse("no column 'time'", "time, s");
    }
    for (const auto& [beam, cell] : beams) {
      if (beam != beams_.size()) {
        throw Refuse("no column 'r" + std::to_string(beams_.size()) + "'",
                     "r0, r1, r2 and so on without a gap");
      }
      beams_.push_back(cell);
    }
    if (beams_.empty()) throw Refuse("no column 'r0'", "ranges: r0, r1, ...");
    const int poses = Count({"x", "y", "theta"});
    if (poses != 0 && poses != 3) {
      throw Refuse("odometry without x, y or theta", "all three, or none");
    }
    has_poses_ = poses == 3;
    log_.odometry_source = has_poses_ ? "x, y, theta" : "";
    if (columns_.count("start_angle") == 0 && !options_.laser_start_angle) {
      throw Refuse("no column 'start_angle'",
                   "the direction of r0, rad, or --laser_start_angle");
    }
    if (columns_.count("angle_step") == 0 && !options_.laser_step) {
      throw Refuse("no column 'angle_step'",
                   "the step between beams, rad, or --laser_step");
    }
    if (num_unused > 0) {
      log_.notes.push_back(
          "columns that are not used: " + unused +
          (num_unused > kShownLines
               ? " and " + std::to_string(num_unused - kShownLines) + " more"
               : ""));
    }
  }

  int Count(std::initializer_list<const char*> names) const {
    int count = 0;
    for (const char* name : names) {
      count += static_cast<int>(columns_.count(name));
    }
    return count;
  }

  void ReadScan(std::string_view line) {
    const std::vector<std::string_view> cells = Cells(line, separator_);
    if (cells.size() != num_cells_) {
      Skip("line with another number of cells than there are columns");
      return;
    }
    bool is_good = true;
    // Of a column; `missing` where there is none.
    const auto number = [&](const char* name, double missing) {
      const auto column = columns_.find(name);
      if (column == columns_.end()) return missing;
      const std::optional<double> value =
          Number(cells[column->second], separator_);
      if (value && std::isfinite(*value)) return *value;
      if (is_good) {
        Skip("line whose " + std::string(name) +
             " is not a finite number: expected one");
      }
      is_good = false;
      return missing;
    };
    Scan scan;
    scan.timestamp = number("time", 0.0);
    scan.timestamp_text = std::string(cells[columns_.at("time")]);
    std::replace(scan.timestamp_text.begin(), scan.timestamp_text.end(), ',',
                 '.');
    if (scan.timestamp_text[0] == '+') scan.timestamp_text.erase(0, 1);
    if (has_poses_) {
      scan.odometry = Pose2(number("x", 0.0), number("y", 0.0),
                            NormalizeAngle(number("theta", 0.0)));
    }
    scan.laser_offset = Pose2(number("laser_x", 0.0), number("laser_y", 0.0),
                              NormalizeAngle(number("laser_theta", 0.0)));
    scan.start_angle =
        options_.laser_start_angle.value_or(number("start_angle", 0.0));
    scan.angle_step = options_.laser_step.value_or(number("angle_step", 0.0));
    scan.maximum_range = options_.laser_max_range.value_or(
        number("max_range", kDefaultMaximumRange));
    if (!is_good) return;
    const double turn =
        scan.angle_step * static_cast<double>(beams_.size() - 1);
    if (scan.angle_step == 0.0 || std::abs(scan.start_angle) > kLargestTurn ||
        std::abs(turn) > kLargestTurn) {
      Skip("line with absurd angles: expected radians within a turn");
      return;
    }
    if (!(scan.maximum_range > 0.0 && scan.maximum_range <= kAbsurdRange)) {
      Skip("line with an absurd max_range: expected 0 to 1000 m");
      return;
    }
    if (scan.odometry.cwiseAbs().maxCoeff() > kAbsurdCoordinate ||
        scan.laser_offset.cwiseAbs().maxCoeff() > kAbsurdCoordinate) {
      Skip("line with an absurd pose: expected metres and radians");
      return;
    }
    scan.line = line_number_;
    const std::size_t stride =
        (beams_.size() + kMostBeamsUsed - 1) / kMostBeamsUsed;
    scan.angle_step *= static_cast<double>(stride);
    scan.ranges.reserve(beams_.size() / stride + 1);
    for (std::size_t i = 0; i < beams_.size(); i += stride) {
      const std::string_view cell = cells[beams_[i]];
      const std::optional<double> range = Number(cell, separator_);
      if (!range && !IsMissing(cell)) {
        // A shifted column or a damaged line: nobody saw nothing there.
        Skip(
            "line with a range that is text: expected a number, or an empty "
            "cell, inf, nan, NA, none or null for no return");
        return;
      }
      const bool is_return = range && *range > 0.0 &&
                             *range < scan.maximum_range - kMaximumRangeMargin;
      scan.ranges.push_back(is_return ? static_cast<float>(*range) : 0.0f);
    }
    if (stride > 1) {
      Skip(
          "beams of a scan of more than 10000: every second, third, ... is "
          "used");
    }
    if (scan.angle_step < 0.0) {
      std::reverse(scan.ranges.begin(), scan.ranges.end());
      scan.start_angle +=
          scan.angle_step * static_cast<double>(scan.ranges.size() - 1);
      scan.angle_step = -scan.angle_step;
    }
    log_.scans.push_back(std::move(scan));
    ++log_.messages["scan"];
  }

  void Skip(const std::string& reason) {
    auto found = std::find_if(
        log_.skipped.begin(), log_.skipped.end(),
        [&](const SkipReport& skip) { return skip.reason == reason; });
    if (found == log_.skipped.end()) {
      log_.skipped.push_back({reason, 0, {}});
      found = log_.skipped.end() - 1;
    }
    ++found->count;
    if (static_cast<int>(found->first_lines.size()) < kShownLines) {
      found->first_lines.push_back(line_number_);
    }
  }

  void Examine() {
    for (std::size_t i = 1; i < log_.scans.size(); ++i) {
      const Scan& scan = log_.scans[i];
      if (scan.odometry != log_.scans[0].odometry) log_.has_odometry = true;
      const double back = log_.scans[i - 1].timestamp - scan.timestamp;
      if (back > 0.0) {
        ++log_.time_reversals;
        log_.largest_time_reversal = std::max(log_.largest_time_reversal, back);
      }
    }
  }

  InputStream* input_;
  const LaserOptions& options_;
  Log log_;
  int line_number_ = 0;
  char separator_ = ',';
  std::size_t num_cells_ = 0;
  // Cells by name, and of the ranges.
  std::map<std::string, std::size_t> columns_;
  std::vector<std::size_t> beams_;
  bool has_poses_ = false;
};

}  // namespace

Log ReadCsvLog(InputStream* input, const LaserOptions& options) {
  return CsvReader(input, options).Read();
}

bool LooksLikeCsvLog(std::string_view prefix) {
  while (!prefix.empty()) {
    const std::string_view line = Trimmed(TakeLine(&prefix));
    if (line.empty() || line.front() == '#') continue;
    bool has_time = false;
    bool has_ranges = false;
    for (const std::string_view cell : Cells(line, SeparatorOf(line))) {
      has_time = has_time || cell == "time";
      has_ranges = has_ranges || cell == "r0";
    }
    return has_time && has_ranges;
  }
  return false;
}

}  // namespace plumbline
