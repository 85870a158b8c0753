#include <plumbline/frontend/skip_counter.h>

namespace plumbline {
namespace {

// Lies have no end.
constexpr std::size_t kMostReasons = 50;
constexpr std::size_t kMostPositions = 5;

}  // namespace

void SkipCounter::Add(const std::string& reason, int position,
                      std::int64_t count) {
  std::string kept = reason;
  if (index_.count(kept) == 0 && index_.size() >= kMostReasons) {
    kept = "further reasons";
  }
  const auto [entry, is_new] = index_.emplace(kept, reports_.size());
  if (is_new) {
    reports_.emplace_back();
    reports_.back().reason = kept;
  }
  SkipReport& report = reports_[entry->second];
  report.count += count;
  if (report.first_lines.size() < kMostPositions) {
    report.first_lines.push_back(position);
  }
}

}  // namespace plumbline
