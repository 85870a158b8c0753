#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/outputs/live_report.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <system_error>

namespace plumbline {
namespace {

namespace fs = std::filesystem;

// Whether a file begins as a page of WriteReport does.
bool IsReport(const fs::path& path) {
  // Opening a pipe would wait for who writes to it.
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  std::string begin(1 << 10, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin.find("<title>plumbline report</title>") != std::string::npos;
}

}  // namespace

LiveReport::LiveReport(const fs::path& folder, double seconds)
    : path_(folder / "report.html"), seconds_(seconds), due_(seconds) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder, error)) {
    throw Error(folder.string(), 0, "cannot be made",
                "a folder that can be written to");
  }
  if (fs::exists(path_, error) && !IsReport(path_)) {
    throw Error(path_.string(), 0, "is there and is no report",
                "a folder whose report.html may be replaced");
  }
}

void LiveReport::Offer(const std::string& stage,
                       const std::function<Report()>& make) {
  const double begin = watch_.Seconds();
  if (begin < due_) return;
  Report report = make();
  report.stage = stage;
  report.reload_seconds = std::max(1, static_cast<int>(std::lround(seconds_)));
  report.written_at = static_cast<std::int64_t>(std::time(nullptr));
  WriteReport(report, path_.string());
  const double end = watch_.Seconds();
  due_ = end + std::max(seconds_, (end - begin) / kShare);
}

void LiveReport::Finish(const fs::path& report,
                        const std::function<Report()>& make) {
  std::ifstream file(report, std::ios::binary);
  if (!file) {
    WriteReport(make(), path_.string());
    return;
  }
  WriteFileAtomically(path_.string(), [&file](std::ostream& output) {
    output << file.rdbuf();
  });
}

}  // namespace plumbline
