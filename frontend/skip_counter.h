#ifndef PLUMBLINE_FRONTEND_SKIP_COUNTER_H_
#define PLUMBLINE_FRONTEND_SKIP_COUNTER_H_

#include <plumbline/frontend/scan.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// What a reader passed over: counts by reason, in the order in which reasons
/// came up first. After 50 of them the rest counts as one.
class SkipCounter {
 public:
  /// `position` is the number of the line or message at hand, from 1.
  void Add(const std::string& reason, int position, std::int64_t count = 1);
  const std::vector<SkipReport>& reports() const { return reports_; }

 private:
  std::map<std::string, std::size_t> index_;
  std::vector<SkipReport> reports_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SKIP_COUNTER_H_
