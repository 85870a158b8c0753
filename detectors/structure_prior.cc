#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/detectors/structure_prior.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/orientation_orientation.h>

#include <charconv>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <sstream>
#include <utility>

namespace plumbline {
namespace {

constexpr char kAngleDetector[] = "orientation_relation";
// Angles nearer to each other are one, degrees.
constexpr double kSameAngle = 1e-6;

// The unit in which a tolerance of a row is given; "1" for pure numbers.
std::string ToleranceUnit(const Quantity& row) {
  const std::string unit(row.shown_unit());
  return unit.empty() ? "1" : unit;
}

// "offset tolerance in m, angle tolerance in deg".
std::string Tolerances(const RelationType& type) {
  std::string text;
  for (const Quantity& row : type.rows) {
    if (!text.empty()) text += ", ";
    text += row.tolerance.empty() ? "tolerance of " + std::string(row.name)
                                  : std::string(row.tolerance);
    text += " in " + ToleranceUnit(row);
  }
  return text;
}

class PriorReader {
 public:
  PriorReader(std::istream& input, std::string name, const Registry& registry)
      : input_(input), name_(std::move(name)), registry_(registry) {}

  StructurePrior Read() {
    std::string line;
    while (std::getline(input_, line)) {
      ++line_;
      std::istringstream words(line.substr(0, line.find('#')));
      words_.clear();
      for (std::string word; words >> word;) words_.push_back(word);
      if (words_.empty()) continue;
      if (words_[0] == "angle") {
        ReadAngle();
      } else if (words_[0] == "relation") {
        ReadRelation();
      } else {
        Refuse("'" + words_[0] + "' is no statement", "angle or relation");
      }
    }
    if (input_.bad()) throw Error(name_, 0, "cannot be read", "a text");
    if (prior_.angles.empty() && prior_.relations.empty()) {
      throw Error(name_, 0, "says nothing",
                  "lines that begin with angle or relation");
    }
    return std::move(prior_);
  }

 private:
  [[noreturn]] void Refuse(const std::string& what,
                           const std::string& expected) const {
    throw Error(name_, line_, what, expected);
  }

  double Number(std::size_t i) const {
    const std::string& word = words_[i];
    double value = 0.0;
    const auto result =
        std::from_chars(word.data(), word.data() + word.size(), value);
    if (result.ec != std::errc() || result.ptr != word.data() + word.size() ||
        !std::isfinite(value)) {
      Refuse("cannot read '" + word + "'", "a number");
    }
    return value;
  }

  double Sigma(std::size_t i, double most) const {
    const double sigma = Number(i);
    if (sigma < 1e-6 || sigma > most) {
      std::string limit;
      AppendNumber(most, &limit);
      Refuse("a tolerance of " + words_[i], "1e-6 to " + limit);
    }
    return sigma;
  }

  void ReadAngle() {
    if (words_.size() < 2 || words_.size() > 3) {
      Refuse("an angle with " + std::to_string(words_.size() - 1) + " numbers",
             "angle DEGREES [TOLERANCE]");
    }
    PriorAngle angle;
    angle.angle_deg = Number(1);
    if (std::abs(angle.angle_deg) > 360.0) {
      Refuse("an angle of " + words_[1] + " degrees", "-360 to 360");
    }
    if (words_.size() > 2) angle.sigma_deg = Sigma(2, 45.0);
    const auto folded = [](double degrees) {
      return std::abs(RadToDeg(NormalizeAxial(DegToRad(degrees))));
    };
    for (std::size_t i = 0; i < prior_.angles.size(); ++i) {
      if (std::abs(folded(prior_.angles[i].angle_deg) -
                   folded(angle.angle_deg)) < kSameAngle) {
        Refuse("an angle of " + words_[1] + " degrees again",
               "each angle once; it is in line " +
                   std::to_string(angle_lines_[i]));
      }
    }
    angle_lines_.push_back(line_);
    prior_.angles.push_back(angle);
  }

  void ReadRelation() {
    if (words_.size() < 3) {
      Refuse("a relation without a tolerance",
             "relation NAME TOLERANCE m|deg ..., or relation NAME no");
    }
    const RelationType* type = registry_.FindRelation(words_[1]);
    if (type == nullptr) {
      std::string known;
      for (const RelationType* relation : registry_.relations()) {
        known += (known.empty() ? "one of " : ", ") + relation->name;
      }
      Refuse("there is no relation '" + words_[1] + "'", known);
    }
    const auto [said, is_new] = relation_lines_.insert({type->name, line_});
    if (!is_new) {
      Refuse(
          "the relation " + type->name + " again",
          "each relation once; it is in line " + std::to_string(said->second));
    }
    PriorRelation relation;
    if (words_[2] == "no" && words_.size() == 3) {
      relation.is_expected = false;
      prior_.relations[type->name] = relation;
      return;
    }
    const auto rows = static_cast<std::size_t>(type->residual_size);
    if (words_.size() != 2 + 2 * rows) {
      Refuse(type->name + " with " + std::to_string(words_.size() - 2) +
                 " words behind it",
             std::to_string(rows) +
                 (rows == 1 ? " tolerance with its unit: "
                            : " tolerances, each with its unit: ") +
                 Tolerances(*type));
    }
    for (std::size_t row = 0; row < rows; ++row) {
      const std::string& unit = words_[3 + 2 * row];
      const std::string expected = ToleranceUnit(type->rows[row]);
      if (unit != expected) {
        Refuse("the unit " + unit + " in row " + std::to_string(row) + " of " +
                   type->name,
               expected);
      }
      PriorTolerance tolerance;
      tolerance.is_angle = type->rows[row].is_angle;
      tolerance.unit = unit;
      tolerance.sigma = Sigma(2 + 2 * row, tolerance.is_angle ? 45.0 : 1e3);
      relation.tolerances.push_back(tolerance);
    }
    prior_.relations[type->name] = std::move(relation);
  }

  std::istream& input_;
  std::string name_;
  const Registry& registry_;
  int line_ = 0;
  std::vector<std::string> words_;
  StructurePrior prior_;
  std::vector<int> angle_lines_;
  std::map<std::string, int> relation_lines_;
};

}  // namespace

StructurePrior ReadStructurePrior(std::istream& input, const std::string& name,
                                  const Registry& registry) {
  return PriorReader(input, name, registry).Read();
}

void WriteStructurePrior(const StructurePrior& prior, std::ostream& output) {
  for (const PriorAngle& angle : prior.angles) {
    std::string line = "angle ";
    AppendNumber(angle.angle_deg, &line);
    if (angle.sigma_deg > 0.0) {
      line += ' ';
      AppendNumber(angle.sigma_deg, &line);
    }
    output << line << '\n';
  }
  for (const auto& [name, relation] : prior.relations) {
    std::string line = "relation " + name;
    if (!relation.is_expected) line += " no";
    for (const PriorTolerance& tolerance : relation.tolerances) {
      line += ' ';
      AppendNumber(tolerance.sigma, &line);
      line += ' ' + (!tolerance.unit.empty() ? tolerance.unit
                     : tolerance.is_angle    ? "deg"
                                             : "m");
    }
    output << line << '\n';
  }
}

void ApplyStructurePrior(
    const StructurePrior& prior, EmOptions* options,
    std::map<std::string, DetectorParameters>* detector_parameters) {
  DetectorParameters& angles = (*detector_parameters)[kAngleDetector];
  for (const auto& [name, relation] : prior.relations) {
    RelationPrior& expected = options->relation_priors[name];
    expected.is_expected = relation.is_expected;
    expected.sigmas.clear();
    // The detector knows which angle has a tolerance of its own.
    if (name == OrientationOrientation::kName && relation.is_expected) {
      angles["sigma_deg"] = relation.tolerances.at(0).sigma;
      continue;
    }
    for (const PriorTolerance& tolerance : relation.tolerances) {
      expected.sigmas.push_back(tolerance.is_angle ? DegToRad(tolerance.sigma)
                                                   : tolerance.sigma);
    }
  }
  if (!prior.angles.empty()) {
    for (auto it = angles.begin(); it != angles.end();) {
      const bool is_angle = it->first.rfind("angle_", 0) == 0;
      it = is_angle || it->first == "resolution_deg" ? angles.erase(it)
                                                     : std::next(it);
    }
    for (std::size_t i = 0; i < prior.angles.size(); ++i) {
      const std::string number = std::to_string(i);
      angles["angle_" + number] = prior.angles[i].angle_deg;
      if (prior.angles[i].sigma_deg > 0.0) {
        angles["angle_sigma_deg_" + number] = prior.angles[i].sigma_deg;
      }
    }
  }
  if (angles.empty()) detector_parameters->erase(kAngleDetector);
}

}  // namespace plumbline
