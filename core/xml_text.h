#ifndef PLUMBLINE_CORE_XML_TEXT_H_
#define PLUMBLINE_CORE_XML_TEXT_H_

#include <plumbline/core/utf8.h>

#include <string>

namespace plumbline {

/// Text as it stands in XML, in elements and in attributes in double quotes:
/// &, <, > and " are written as entities; what XML cannot hold is replaced
/// (PrintableUtf8).
inline std::string EscapeXml(const std::string& text) {
  std::string escaped;
  escaped.reserve(text.size());
  for (const char c : PrintableUtf8(text)) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_XML_TEXT_H_
