#ifndef PLUMBLINE_DETECTORS_PARAMETERS_H_
#define PLUMBLINE_DETECTORS_PARAMETERS_H_

#include <plumbline/core/registry.h>

#include <limits>
#include <string>
#include <vector>

namespace plumbline {

/// The parameters of one detector: what was given over the defaults.
class ParameterReader {
 public:
  /// Throws Error that lists the known names when `given` has one that
  /// `defaults` has not. Names that begin with one of `numbered_prefixes` and
  /// go on with digits are known as well ("angle_0").
  ParameterReader(std::string detector, const DetectorParameters& defaults,
                  const DetectorParameters& given,
                  const std::vector<std::string>& numbered_prefixes = {});

  /// The value of a parameter. Throws Error when it is not a number in
  /// [minimum, maximum].
  double Get(const std::string& name,
             double minimum = std::numeric_limits<double>::lowest(),
             double maximum = std::numeric_limits<double>::max()) const;

  /// Get, rounded to a whole number; throws Error when it is not one.
  int GetInt(const std::string& name, int minimum) const;

  /// All parameters, what was given over the defaults.
  const DetectorParameters& values() const { return values_; }

 private:
  std::string detector_;
  DetectorParameters values_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_PARAMETERS_H_
