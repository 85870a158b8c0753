#include <plumbline/core/error.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <cstddef>
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

// "of at least 0 and at most 1".
std::string Range(double minimum, double maximum) {
  std::string range = "a finite number";
  const bool is_bounded_below = minimum > -ParameterBinder::kNoLimit;
  if (is_bounded_below) range += " of at least " + Text(minimum);
  if (maximum < ParameterBinder::kNoLimit) {
    range += (is_bounded_below ? " and" : " of") + std::string(" at most ") +
             Text(maximum);
  }
  return range;
}

}  // namespace

ParameterBinder::ParameterBinder(std::string detector, DetectorParameters given)
    : detector_(std::move(detector)), given_(std::move(given)) {}

bool ParameterBinder::Find(const std::string& name, double minimum,
                           double maximum, double* value) {
  known_.insert(name);
  const auto found = given_.find(name);
  if (found == given_.end()) return false;
  *value = found->second;
  if (!std::isfinite(*value) || *value < minimum || *value > maximum) {
    throw PLUMBLINE_ERROR(detector_ + ": " + name + " is " + Text(*value),
                          Range(minimum, maximum));
  }
  return true;
}

void ParameterBinder::Length(const std::string& name, double* metres,
                             double minimum, double maximum,
                             const std::string& description) {
  Number(name, metres, minimum, maximum, "m", description);
}

void ParameterBinder::Angle(const std::string& name, double* radians,
                            double minimum, double maximum,
                            const std::string& description) {
  parameters_.push_back({name, RadToDeg(*radians), "deg", description});
  double degrees = 0.0;
  if (Find(name, minimum, maximum, &degrees)) *radians = DegToRad(degrees);
}

void ParameterBinder::Number(const std::string& name, double* value,
                             double minimum, double maximum,
                             const std::string& unit,
                             const std::string& description) {
  parameters_.push_back({name, *value, unit, description});
  Find(name, minimum, maximum, value);
}

void ParameterBinder::Count(const std::string& name, int* value, int minimum,
                            const std::string& description) {
  parameters_.push_back({name, static_cast<double>(*value), "", description});
  double given = 0.0;
  if (!Find(name, minimum, 1e9, &given)) return;
  if (given != std::floor(given)) {
    throw PLUMBLINE_ERROR(detector_ + ": " + name + " is " + Text(given),
                          "a whole number");
  }
  *value = static_cast<int>(given);
}

void ParameterBinder::AngleList(const std::string& prefix,
                                std::map<std::string, double>* radians,
                                double minimum, double maximum,
                                const std::string& description) {
  parameters_.push_back({prefix, 0.0, "deg", description, /*is_list=*/true});
  for (const auto& [name, unused] : given_) {
    if (!IsNumbered(name, prefix)) continue;
    double degrees = 0.0;
    Find(name, minimum, maximum, &degrees);
    (*radians)[name.substr(prefix.size())] = DegToRad(degrees);
  }
}

void ParameterBinder::CheckNames() const {
  for (const auto& [name, unused] : given_) {
    if (known_.count(name) > 0) continue;
    std::string names;
    for (const DetectorParameter& parameter : parameters_) {
      names += (names.empty() ? "" : ", ") + parameter.name +
               (parameter.is_list ? "0 ..." : "");
    }
    if (names.empty()) {
      throw PLUMBLINE_ERROR(detector_ + " has no parameter \"" + name + "\"",
                            "none");
    }
    throw PLUMBLINE_ERROR(detector_ + " has no parameter \"" + name + "\"",
                          "one of " + names);
  }
}

}  // namespace plumbline
