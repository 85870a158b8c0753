#include <plumbline/apps/evaluation/json_entry.h>
#include <plumbline/core/error.h>
#include <plumbline/core/utf8.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

using Json = nlohmann::json;

// Bytes; a JSON document takes several times as much memory.
constexpr std::size_t kLargestJson = std::size_t{1} << 28;

}  // namespace

JsonEntry::JsonEntry(const std::string& file, const Json& json,
                     std::string path)
    : file_(file), json_(json), path_(std::move(path)) {}

JsonEntry JsonEntry::operator[](const std::string& key) const {
  const std::string path = path_.empty() ? key : path_ + "." + key;
  if (!json_.is_object()) Refuse("is no object", "an object");
  const auto found = json_.find(key);
  if (found == json_.end())
    throw Error(file_, 0, "'" + path + "' is missing", "a value");
  return JsonEntry(file_, *found, path);
}

bool JsonEntry::Has(const std::string& key) const {
  return json_.is_object() && json_.contains(key);
}

std::vector<JsonEntry> JsonEntry::Elements() const {
  if (!json_.is_array()) Refuse("is no array", "an array");
  std::vector<JsonEntry> elements;
  elements.reserve(json_.size());
  for (std::size_t i = 0; i < json_.size(); ++i)
    elements.emplace_back(file_, json_[i],
                          path_ + "[" + std::to_string(i) + "]");
  return elements;
}

std::vector<double> JsonEntry::Numbers(std::size_t count) const {
  const std::vector<JsonEntry> elements = Elements();
  if (elements.size() != count) {
    Refuse("has " + std::to_string(elements.size()) + " elements",
           std::to_string(count) + " numbers");
  }
  std::vector<double> numbers;
  for (const JsonEntry& element : elements) numbers.push_back(element.Number());
  return numbers;
}

double JsonEntry::Number() const {
  if (!json_.is_number()) Refuse("is no number", "a number");
  const double value = json_.get<double>();
  if (!std::isfinite(value)) Refuse("is not finite", "a finite number");
  return value;
}

double JsonEntry::Metres() const {
  const double value = Number();
  if (std::abs(value) > kAbsurdCoordinate)
    Refuse("is absurd", "metres within 1e7");
  return value;
}

Eigen::Vector2d JsonEntry::Position() const {
  const std::vector<JsonEntry> elements = Elements();
  if (elements.size() != 2) {
    Refuse("has " + std::to_string(elements.size()) + " elements", "x and y");
  }
  return {elements[0].Metres(), elements[1].Metres()};
}

Ring JsonEntry::ReadRing() const {
  Ring ring;
  for (const JsonEntry& position : Elements()) {
    ring.push_back(position.Position());
  }
  if (ring.size() > 1 && ring.front() == ring.back()) ring.pop_back();
  if (ring.size() < 3) Refuse("has too few corners", "three or more");
  return ring;
}

Polygon JsonEntry::ReadPolygon() const {
  const std::vector<JsonEntry> rings = Elements();
  if (rings.empty()) Refuse("is empty", "rings of positions");
  Polygon polygon;
  for (const JsonEntry& ring : rings) {
    if (polygon.shell.empty()) {
      polygon.shell = ring.ReadRing();
    } else {
      polygon.holes.push_back(ring.ReadRing());
    }
  }
  return polygon;
}

std::int64_t JsonEntry::Integer() const {
  if (!json_.is_number_integer()) Refuse("is no integer", "an integer");
  return json_.get<std::int64_t>();
}

bool JsonEntry::Flag() const {
  if (!json_.is_boolean()) Refuse("is neither true nor false", "one of them");
  return json_.get<bool>();
}

std::string JsonEntry::Text() const {
  if (!json_.is_string()) Refuse("is no text", "a text");
  return json_.get<std::string>();
}

void JsonEntry::Refuse(const std::string& what,
                       const std::string& expected) const {
  throw Error(file_, 0,
              (path_.empty() ? "the document" : "'" + path_ + "'") + " " + what,
              expected);
}

nlohmann::json ParseJson(InputStream* input, const std::string& expected) {
  const std::string text = input->ReadRest(kLargestJson);
  if (!input->damage().empty())
    throw Error(input->name(), 0, input->damage(), "a whole file");
  try {
    return Json::parse(text);
  } catch (const Json::parse_error& error) {
    const std::size_t place = std::min<std::size_t>(error.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + place, '\n');
    throw Error(input->name(), static_cast<int>(line), "is no valid JSON",
                expected);
  } catch (const Json::out_of_range& error) {
    // "... number overflow parsing '1e400'"
    const std::string what = error.what();
    const std::size_t quote = what.find('\'');
    const std::string number =
        quote == std::string::npos
            ? ""
            : what.substr(quote + 1, what.rfind('\'') - quote - 1);
    const std::size_t place = std::min(text.find(number), text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + place, '\n');
    throw Error(
        input->name(), static_cast<int>(line),
        PrintableUtf8(number.substr(0, 40)) + " is too large for a number",
        "numbers up to 1.8e308");
  }
}

}  // namespace plumbline
