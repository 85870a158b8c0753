#ifndef PLUMBLINE_DETECTORS_PARAMETERS_H_
#define PLUMBLINE_DETECTORS_PARAMETERS_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>

#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Ties the parameters of a detector, as flags and files know them, to the
/// fields of its options. A detector has one function that names each of them
/// once, with its field, range and meaning:
///
///   void Bind(ParameterBinder* parameters, RectangleOptions* options) {
///     parameters->Length("sigma", &options->sigma, 1e-6, kNoLimit,
///                        "tolerance of a wall across its side");
///     parameters->Angle("sigma_deg", &options->sigma_angle, 1e-6, 90.0,
///                       "and in direction");
///   }
///
/// and SetParameters runs it twice: over default options to list the
/// parameters, then over those of a detector to be made, to set what was given.
class ParameterBinder {
 public:
  static constexpr double kNoLimit = std::numeric_limits<double>::max();

  /// Lists what is bound.
  ParameterBinder() = default;
  /// Sets what is bound from the values given; `detector` stands for it in
  /// errors.
  ParameterBinder(std::string detector, DetectorParameters given);

  /// A length, m. Here and below: throws Error when the value given is not in
  /// [minimum, maximum].
  void Length(const std::string& name, double* metres, double minimum,
              double maximum, const std::string& description);
  /// An angle, given in degrees (as are its limits), kept in rad.
  void Angle(const std::string& name, double* radians, double minimum,
             double maximum, const std::string& description);
  /// Any other number, or one that is kept as it is given.
  void Number(const std::string& name, double* value, double minimum,
              double maximum, const std::string& unit,
              const std::string& description);
  /// A whole number.
  void Count(const std::string& name, int* value, int minimum,
             const std::string& description);
  /// Angles "prefix0", "prefix1", ..., given in degrees, kept in rad: by what
  /// stands behind the prefix, in the order of these texts.
  void AngleList(const std::string& prefix,
                 std::map<std::string, double>* radians, double minimum,
                 double maximum, const std::string& description);

  /// Throws Error that lists the known names when something was given that
  /// nothing was bound to.
  void CheckNames() const;
  /// What was bound.
  const std::vector<DetectorParameter>& parameters() const {
    return parameters_;
  }

 private:
  bool Find(const std::string& name, double minimum, double maximum,
            double* value);

  std::string detector_;
  DetectorParameters given_;
  std::set<std::string> known_;
  std::vector<DetectorParameter> parameters_;
};

/// Gives a type, which has its name already, the parameters that
/// `bind(ParameterBinder*, Options*)` names, and the factory that sets them and
/// calls `make(const Options&)`.
template <typename Options, typename Bind, typename Make>
void SetParameters(const Bind& bind, const Make& make, DetectorType* type) {
  Options defaults;
  ParameterBinder list;
  bind(&list, &defaults);
  type->parameters = list.parameters();
  type->make = [name = type->name, bind, make](const DetectorParameters& given)
      -> std::unique_ptr<StructureDetector> {
    Options options;
    ParameterBinder binder(name, given);
    bind(&binder, &options);
    binder.CheckNames();
    return make(options);
  };
}

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_PARAMETERS_H_
