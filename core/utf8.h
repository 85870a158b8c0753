#ifndef PLUMBLINE_CORE_UTF8_H_
#define PLUMBLINE_CORE_UTF8_H_

#include <string>
#include <string_view>

namespace plumbline {

/// The UTF-8 form of the byte order mark, with which some editors begin a file.
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Removes a byte order mark from the beginning of a text.
inline void RemoveByteOrderMark(std::string* text) {
  if (text->compare(0, kByteOrderMark.size(), kByteOrderMark) == 0) {
    text->erase(0, kByteOrderMark.size());
  }
}

/// The text with U+FFFD in place of every byte that is no part of well-formed
/// UTF-8 and of every character that XML 1.0 cannot hold or a terminal would
/// obey: controls (tabs and line ends, too), U+FFFE and U+FFFF. For names of
/// files and other words of users that are shown.
std::string PrintableUtf8(std::string_view text);

/// The same line by line, line ends kept: for messages.
std::string PrintableLines(std::string_view text);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_UTF8_H_
