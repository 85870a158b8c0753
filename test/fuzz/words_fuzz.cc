// Feeds arbitrary bytes to what every reader and writer stands on: numbers,
// names that may not be UTF-8, text in XML, names of detectors.

#include <plumbline/core/error.h>
#include <plumbline/core/hierarchy_spec.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/utf8.h>
#include <plumbline/core/xml_text.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckNumbers(const std::string& text) {
  double value = 0.0;
  if (plumbline::ParseNumber(text, &value) && std::isfinite(value)) {
    std::string written;
    plumbline::AppendNumber(value, &written);
    double again = 0.0;
    Require(plumbline::ParseNumber(written, &again) && again == value);
    std::string fixed;
    plumbline::AppendFixed(value, 3, &fixed);
    Require(plumbline::ParseNumber(fixed, &again));
  }
  std::int64_t whole = 0;
  if (plumbline::ParseNumber(text, &whole)) {
    std::string written;
    plumbline::AppendNumber(whole, &written);
    std::int64_t again = 0;
    Require(plumbline::ParseNumber(written, &again) && again == whole);
  }
}

void CheckNames(const std::string& text) {
  const std::string printable = plumbline::PrintableUtf8(text);
  Require(plumbline::PrintableUtf8(printable) == printable);
  for (const char c : printable) {
    Require(static_cast<unsigned char>(c) >= 0x20 || c == '\t' || c == '\n' ||
            c == '\r');
  }
  const std::string xml = plumbline::EscapeXml(text);
  Require(xml.find_first_of("<>\"") == std::string::npos);
  std::string unmarked = text;
  plumbline::RemoveByteOrderMark(&unmarked);
  Require(unmarked.size() <= text.size());
}

void CheckHierarchy(const std::string& text) {
  try {
    const plumbline::HierarchySpec spec = plumbline::ParseHierarchy(text);
    Require(plumbline::ParseHierarchy(plumbline::FormatHierarchy(spec)) ==
            spec);
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  CheckNumbers(text);
  CheckNames(text);
  CheckHierarchy(text);
  return 0;
}
