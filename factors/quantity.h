#ifndef PLUMBLINE_FACTORS_QUANTITY_H_
#define PLUMBLINE_FACTORS_QUANTITY_H_

#include <string>
#include <string_view>

namespace plumbline {

/// One number of a state or of a residual, in the words that files, reports and
/// errors use for it. The texts are not owned: they are literals, or live as
/// long as the process.
struct Quantity {
  /// Name: "x", "offset".
  std::string_view name;
  /// SI unit, "m" or "rad"; empty for a pure number.
  std::string_view unit;
  /// Name of one standard deviation of it, in a row of a residual:
  /// "offset tolerance". Empty for a parameter.
  std::string_view tolerance;
  /// Whether it is an angle, which people are shown in degrees. In a state,
  /// values that differ by 2 pi are the same, and a solve leaves it in
  /// (-pi, pi].
  bool is_angle = false;

  /// In m.
  static constexpr Quantity Length(std::string_view name,
                                   std::string_view tolerance = {}) {
    return {name, "m", tolerance, false};
  }
  /// In rad.
  static constexpr Quantity Angle(std::string_view name,
                                  std::string_view tolerance = {}) {
    return {name, "rad", tolerance, true};
  }
  /// Without a unit.
  static constexpr Quantity Number(std::string_view name,
                                   std::string_view tolerance = {}) {
    return {name, "", tolerance, false};
  }

  /// The unit in which people are shown it: "deg" for angles.
  constexpr std::string_view shown_unit() const {
    return is_angle ? std::string_view("deg") : unit;
  }

  /// Name and unit: "theta rad"; the name alone when there is no unit.
  std::string label() const {
    std::string text(name);
    if (!unit.empty()) text.append(" ").append(unit);
    return text;
  }
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_QUANTITY_H_
