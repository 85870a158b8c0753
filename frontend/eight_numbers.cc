#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/utf8.h>
#include <plumbline/frontend/eight_numbers.h>

#include <cmath>

namespace plumbline {
namespace {

constexpr char kBlanks[] = " \t\r";

}  // namespace

bool ParseEightNumbers(const InputStream& input, std::string_view line,
                       const std::string& expected,
                       std::array<double, 8>* numbers,
                       std::string* first_text) {
  std::size_t count = 0;
  while (true) {
    const std::size_t begin = line.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos) break;
    line.remove_prefix(begin);
    if (count == 0 && line.front() == '#') return false;
    const std::string_view token = line.substr(0, line.find_first_of(kBlanks));
    line.remove_prefix(token.size());
    if (count == 0) *first_text = std::string(token);
    if (count < numbers->size()) {
      double& number = (*numbers)[count];
      if (!ParseNumber(token, &number) || !std::isfinite(number)) {
        throw Error(
            input.name(), input.line_number(),
            "'" + PrintableUtf8(token.substr(0, 40)) + "' is no finite number",
            expected);
      }
      // Not of the first, the time: logs may say anything.
      if (count > 0 && std::abs(number) > kAbsurdNumber) {
        throw Error(input.name(), input.line_number(),
                    "'" + PrintableUtf8(token.substr(0, 40)) + "' is absurd",
                    expected + ", within 1e20");
      }
    }
    ++count;
  }
  if (count == 0) return false;
  if (count != numbers->size()) {
    throw Error(input.name(), input.line_number(),
                std::to_string(count) + " fields", expected);
  }
  return true;
}

void RequireUndamaged(const InputStream& input) {
  if (!input.damage().empty())
    throw Error(input.name(), input.line_number(), input.damage(),
                "a whole file");
}

}  // namespace plumbline
