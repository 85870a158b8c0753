#include <plumbline/core/utf8.h>

#include <cstddef>
#include <cstdint>

namespace plumbline {
namespace {

// Length in bytes of the character that the text begins with; 0 when it is
// ill-formed (RFC 3629: overlong forms, surrogates, past U+10FFFF).
std::size_t Decode(std::string_view text, std::uint32_t* character) {
  const auto byte = [&](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
  };
  const std::uint32_t first = byte(0);
  if (first < 0x80) {
    *character = first;
    return 1;
  }
  const std::size_t length = first >= 0xF0 && first < 0xF8   ? 4
                             : first >= 0xE0 && first < 0xF0 ? 3
                             : first >= 0xC0 && first < 0xE0 ? 2
                                                             : 0;
  if (length == 0 || text.size() < length) return 0;
  *character = first & (0x7Fu >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
    *character = *character << 6 | (byte(i) & 0x3F);
  }
  constexpr std::uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool is_surrogate = *character >= 0xD800 && *character < 0xE000;
  return *character < kLeast[length] || is_surrogate || *character > 0x10FFFF
             ? 0
             : length;
}

bool IsControl(std::uint32_t character) {
  return character < 0x20 || (character >= 0x7F && character < 0xA0) ||
         character == 0xFFFE || character == 0xFFFF;
}

}  // namespace

std::string PrintableUtf8(std::string_view text) {
  constexpr char kReplacement[] = "\xEF\xBF\xBD";
  std::string printable;
  printable.reserve(text.size());
  while (!text.empty()) {
    std::uint32_t character = 0;
    const std::size_t length = Decode(text, &character);
    if (length == 0 || IsControl(character)) {
      printable += kReplacement;
    } else {
      printable += text.substr(0, length);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return printable;
}

std::string PrintableLines(std::string_view text) {
  std::string printable;
  while (true) {
    const std::size_t end = text.find('\n');
    printable += PrintableUtf8(text.substr(0, end));
    if (end == std::string_view::npos) return printable;
    printable += '\n';
    text.remove_prefix(end + 1);
  }
}

}  // namespace plumbline
