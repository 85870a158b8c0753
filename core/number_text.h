#ifndef PLUMBLINE_CORE_NUMBER_TEXT_H_
#define PLUMBLINE_CORE_NUMBER_TEXT_H_

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>

namespace plumbline {

/// Appends the shortest decimal number that reads back as the same double;
/// whatever the locale. Not finite ones become "nan", "inf" or "-inf".
inline void AppendNumber(double value, std::string* text) {
  char buffer[32];
  const std::to_chars_result result =
      std::to_chars(buffer, buffer + sizeof(buffer), value);
  text->append(buffer, result.ptr);
}

/// Appends a number with this many digits after the point, whatever the locale;
/// never "-0.00". Numbers past 1e15 are written with an exponent.
inline void AppendFixed(double value, int decimals, std::string* text) {
  char buffer[64];
  const bool is_large = !(value > -1e15 && value < 1e15);
  const std::to_chars_result result =
      is_large ? std::to_chars(buffer, buffer + sizeof(buffer), value)
               : std::to_chars(buffer, buffer + sizeof(buffer), value,
                               std::chars_format::fixed, decimals);
  std::string_view digits(buffer,
                          static_cast<std::size_t>(result.ptr - buffer));
  if (digits[0] == '-' &&
      digits.find_first_not_of("-0.") == std::string_view::npos) {
    digits.remove_prefix(1);
  }
  text->append(digits);
}

/// Appends a whole number.
inline void AppendNumber(std::int64_t value, std::string* text) {
  char buffer[32];
  const std::to_chars_result result =
      std::to_chars(buffer, buffer + sizeof(buffer), value);
  text->append(buffer, result.ptr);
}

/// Reads all of `text` as a number, with or without a sign. False when it is
/// not one or does not fit the type; what is too small for a double is 0.
template <typename Number>
bool ParseNumber(std::string_view text, Number* value) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') {
    text.remove_prefix(1);
  }
  const std::from_chars_result result =
      std::from_chars(text.data(), text.data() + text.size(), *value);
  if (result.ptr != text.data() + text.size()) return false;
  if constexpr (std::is_floating_point_v<Number>) {
    // Too large otherwise.
    if (result.ec == std::errc::result_out_of_range &&
        text.find_first_of("eE") != std::string_view::npos &&
        text[text.find_first_of("eE") + 1] == '-') {
      *value = 0;
      return true;
    }
  }
  return result.ec == std::errc();
}

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_NUMBER_TEXT_H_
