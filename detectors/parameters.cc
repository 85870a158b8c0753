#include <plumbline/core/error.h>
#include <plumbline/detectors/parameters.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

namespace plumbline {
namespace {

bool IsNumbered(const std::string& name, const std::string& prefix) {
  return name.size() > prefix.size() &&
         name.compare(0, prefix.size(), prefix) == 0 &&
         name.find_first_not_of("0123456789", prefix.size()) ==
             std::string::npos;
}

std::string Text(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

}  // namespace

ParameterReader::ParameterReader(
    std::string detector, const DetectorParameters& defaults,
    const DetectorParameters& given,
    const std::vector<std::string>& numbered_prefixes)
    : detector_(std::move(detector)), values_(defaults) {
  for (const auto& [name, value] : given) {
    if (defaults.count(name) == 0 &&
        std::none_of(numbered_prefixes.begin(), numbered_prefixes.end(),
                     [&given_name = name](const std::string& prefix) {
                       return IsNumbered(given_name, prefix);
                     })) {
      std::string known;
      for (const auto& [known_name, unused] : defaults) {
        known += (known.empty() ? "" : ", ") + known_name;
      }
      for (const std::string& prefix : numbered_prefixes) {
        known += ", " + prefix + "0 ...";
      }
      throw PLUMBLINE_ERROR(detector_ + " has no parameter \"" + name + "\"",
                            "one of " + known);
    }
    values_[name] = value;
  }
}

double ParameterReader::Get(const std::string& name, double minimum,
                            double maximum) const {
  const auto found = values_.find(name);
  if (found == values_.end()) {
    throw PLUMBLINE_ERROR(detector_ + " was not given \"" + name + "\"",
                          "a value");
  }
  const double value = found->second;
  if (!std::isfinite(value) || value < minimum || value > maximum) {
    std::string range = "a finite number";
    const bool bounded_below = minimum > std::numeric_limits<double>::lowest();
    const bool bounded_above = maximum < std::numeric_limits<double>::max();
    if (bounded_below) range += " of at least " + Text(minimum);
    if (bounded_above) {
      range += (bounded_below ? " and" : " of") + std::string(" at most ") +
               Text(maximum);
    }
    throw PLUMBLINE_ERROR(detector_ + ": " + name + " is " + Text(value),
                          range);
  }
  return value;
}

int ParameterReader::GetInt(const std::string& name, int minimum) const {
  const double value = Get(name, minimum, 1e9);
  if (value != std::floor(value)) {
    throw PLUMBLINE_ERROR(detector_ + ": " + name + " is " + Text(value),
                          "a whole number");
  }
  return static_cast<int>(value);
}

}  // namespace plumbline
