#include <gflags/gflags.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/core/utf8.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <utility>

DEFINE_bool(quiet, false,
            "Print errors only: no progress bar (there is one on a terminal "
            "only), no remarks, no closing lines");
DEFINE_bool(verbose, false, "Print what is being done, one line per step");

namespace plumbline {
namespace {

// s
constexpr double kPatience = 1.0;
constexpr double kInterval = 0.2;

// There is a bar on the terminal.
bool bar_is_shown = false;
// A bar over all stages is alive.
bool work_is_shown = false;

void WipeBar() {
  if (!bar_is_shown) return;
  std::fputs("\r\033[K", stderr);
  bar_is_shown = false;
}

void PrintLine(const char* format, va_list arguments) {
  va_list again;
  va_copy(again, arguments);
  const int size = std::vsnprintf(nullptr, 0, format, again);
  va_end(again);
  std::string line(static_cast<std::size_t>(std::max(size, 0)) + 1, '\0');
  std::vsnprintf(line.data(), line.size(), format, arguments);
  line.pop_back();
  WipeBar();
  // A terminal would obey what a name may hold.
  std::fprintf(stderr, "%s\n", PrintableLines(line).c_str());
}

int TerminalColumns() {
  winsize size = {};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) {
    return 80;
  }
  return size.ws_col;
}

std::string FormatDuration(double seconds) {
  // A long way off is far enough; also keeps the conversion in range.
  const long long rounded =
      std::llround(std::min(std::max(seconds, 0.0), 3.6e8));
  char text[48];
  if (rounded < 60) {
    std::snprintf(text, sizeof(text), "%lld s", rounded);
  } else if (rounded < 3600) {
    std::snprintf(text, sizeof(text), "%lld min %02lld s", rounded / 60,
                  rounded % 60);
  } else {
    std::snprintf(text, sizeof(text), "%lld h %02lld min", rounded / 3600,
                  rounded % 3600 / 60);
  }
  return text;
}

std::string FormatRate(double rate) {
  char text[32];
  std::snprintf(text, sizeof(text), rate < 10.0 ? "%.1f" : "%.0f", rate);
  return text;
}

}  // namespace

std::string ProgressLine(const std::string& title, const std::string& unit,
                         std::int64_t done, std::int64_t total, double seconds,
                         int columns) {
  const double rate = seconds > 0.0 ? done / seconds : 0.0;
  std::string numbers = std::to_string(done);
  if (total > 0) numbers += "/" + std::to_string(total);
  numbers += ", " + FormatRate(rate) + " " + unit + "/s";
  std::string bar;
  if (total > 0) {
    const double fraction =
        std::min(1.0, std::max(0.0, static_cast<double>(done) / total));
    if (rate > 0.0) {
      numbers += ", " + FormatDuration((total - done) / rate) + " left";
    }
    // The bar takes what the words leave, within reason.
    const int room =
        columns - static_cast<int>(title.size() + numbers.size()) - 9;
    const int width = std::min(30, room);
    if (width >= 5) {
      const int filled = static_cast<int>(fraction * width);
      bar = "[" + std::string(filled, '=') + std::string(width - filled, ' ') +
            "] ";
    }
    char percent[16];
    std::snprintf(percent, sizeof(percent), "%3d%% ",
                  static_cast<int>(fraction * 100.0));
    bar += percent;
  }
  std::string line = title + " " + bar + numbers;
  if (static_cast<int>(line.size()) > columns) {
    line.resize(static_cast<std::size_t>(std::max(columns, 0)));
  }
  return line;
}

void Remark(const char* format, ...) {
  if (FLAGS_quiet) return;
  va_list arguments;
  va_start(arguments, format);
  PrintLine(format, arguments);
  va_end(arguments);
}

void Detail(const char* format, ...) {
  if (FLAGS_quiet || !FLAGS_verbose) return;
  va_list arguments;
  va_start(arguments, format);
  PrintLine(format, arguments);
  va_end(arguments);
}

Progress::Progress(std::string title, std::string unit, std::int64_t total)
    : title_(std::move(title)),
      unit_(std::move(unit)),
      total_(total),
      enabled_(!FLAGS_quiet && !work_is_shown && isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() { Finish(); }

void Progress::Update(std::int64_t done) {
  if (!enabled_) return;
  const double elapsed = watch_.Seconds();
  if (elapsed < kPatience) return;
  if (visible_ && elapsed - last_shown_ < kInterval) return;
  // One column is left free: some terminals wrap when the last one is used.
  const std::string line =
      ProgressLine(title_, unit_, done, total_, elapsed, TerminalColumns() - 1);
  std::fprintf(stderr, "\r\033[K%s", line.c_str());
  std::fflush(stderr);
  visible_ = true;
  bar_is_shown = true;
  last_shown_ = elapsed;
}

void Progress::Finish() {
  if (!visible_) return;
  WipeBar();
  std::fflush(stderr);
  visible_ = false;
}

void WorkEstimate::Plan(std::vector<WorkStage> stages) {
  left_ = std::move(stages);
}

void WorkEstimate::Begin(const std::string& title, double seconds) {
  const auto next = std::find_if(
      left_.begin(), left_.end(),
      [&title](const WorkStage& stage) { return stage.title == title; });
  if (next == left_.end()) return;
  // What was passed over was not done: it is no part of the work any more.
  weight_before_ += present_.weight;
  present_ = *next;
  left_.erase(left_.begin(), next + 1);
  begin_ = seconds;
}

double WorkEstimate::Done(double seconds, double share) {
  if (share < 0.0) {
    // As fast as before; where nothing was before, nothing can be said.
    const double expected =
        weight_before_ > 0.0 ? begin_ * present_.weight / weight_before_ : 0.0;
    const double passed =
        expected > 0.0 ? std::max(0.0, seconds - begin_) / expected : 0.0;
    constexpr double kEven = 0.7;
    share =
        passed <= kEven
            ? passed
            : 1.0 - (1.0 - kEven) * std::exp(-(passed - kEven) / (1.0 - kEven));
  }
  double total = weight_before_ + present_.weight;
  for (const WorkStage& stage : left_) total += stage.weight;
  if (!(total > 0.0)) return last_;
  const double done =
      (weight_before_ + present_.weight * std::clamp(share, 0.0, 1.0)) / total;
  last_ = std::clamp(done, last_, 1.0);
  return last_;
}

std::string WorkLine(const std::string& title, double done, double seconds,
                     int columns) {
  std::string line;
  if (!(done > 0.0)) {
    line = title + ", " + FormatDuration(seconds);
  } else {
    std::string numbers;
    // The first few percent say little about the rest.
    if (done >= 0.02) {
      numbers = ", " + FormatDuration(seconds * (1.0 - done) / done) + " left";
    }
    char percent[16];
    std::snprintf(percent, sizeof(percent), "%3d%%",
                  static_cast<int>(100.0 * std::min(done, 1.0)));
    const int room =
        columns - static_cast<int>(title.size() + numbers.size()) - 8;
    const int width = std::min(30, room);
    std::string bar;
    if (width >= 5) {
      const int filled = static_cast<int>(std::min(done, 1.0) * width);
      bar = "[" + std::string(filled, '=') + std::string(width - filled, ' ') +
            "] ";
    }
    line = title + " " + bar + percent + numbers;
  }
  line.resize(
      std::min(line.size(), static_cast<std::size_t>(std::max(columns, 0))));
  return line;
}

WorkProgress::WorkProgress()
    : enabled_(!FLAGS_quiet && isatty(STDERR_FILENO) != 0) {
  work_is_shown = true;
}

WorkProgress::~WorkProgress() { Finish(); }

void WorkProgress::Plan(std::vector<WorkStage> stages) {
  estimate_.Plan(std::move(stages));
}

void WorkProgress::Begin(const std::string& title) {
  title_ = title;
  estimate_.Begin(title, watch_.Seconds());
}

void WorkProgress::Update(double share) {
  if (!enabled_) return;
  const double elapsed = watch_.Seconds();
  if (elapsed < kPatience) return;
  if (visible_ && elapsed - last_shown_ < kInterval) return;
  const std::string line = WorkLine(title_, estimate_.Done(elapsed, share),
                                    elapsed, TerminalColumns() - 1);
  std::fprintf(stderr, "\r\033[K%s", line.c_str());
  std::fflush(stderr);
  visible_ = true;
  bar_is_shown = true;
  last_shown_ = elapsed;
}

void WorkProgress::Finish() {
  work_is_shown = false;
  enabled_ = false;
  if (!visible_) return;
  WipeBar();
  std::fflush(stderr);
  visible_ = false;
}

}  // namespace plumbline
