#include <plumbline/core/constraint_fault.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/number_text.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <istream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <ostream>
#include <unordered_map>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using nlohmann::json;

void AppendString(const std::string& value, std::string* text) {
  // Bytes that are not UTF-8 are replaced: JSON has no place for them.
  *text += json(value).dump(-1, ' ', false, json::error_handler_t::replace);
}

void AppendJsonNumber(double value, std::string* text) {
  if (value == 0.0 && std::signbit(value)) {
    // "-0" would be read as a whole number, which has no sign.
    *text += "-0.0";
  } else if (std::isfinite(value)) {
    AppendNumber(value, text);
  } else {
    *text += "null";
  }
}

// "[a, b, c]" of what `append` writes for each element.
template <typename Range, typename Append>
void AppendArray(const Range& range, const Append& append, std::string* text) {
  *text += '[';
  bool first = true;
  for (const auto& element : range) {
    if (!first) *text += ", ";
    first = false;
    append(element, text);
  }
  *text += ']';
}

template <typename Range>
void AppendNumbers(const Range& range, std::string* text) {
  AppendArray(range, AppendJsonNumber, text);
}

void AppendIds(const std::vector<std::int64_t>& ids, std::string* text) {
  AppendArray(
      ids, [](std::int64_t id, std::string* out) { AppendNumber(id, out); },
      text);
}

// Live structure constraints to features of lower levels.
std::vector<ConstraintId> SupportOf(const Graph& graph,
                                    const Feature& feature) {
  std::vector<ConstraintId> support;
  for (const ConstraintId id : graph.ConstraintsOf(feature.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (constraint.state != ConstraintState::kLive ||
        constraint.kind != ConstraintClass::kStructure) {
      continue;
    }
    for (const FeatureId other : constraint.features) {
      if (graph.GetFeature(other).level < feature.level) {
        support.push_back(id);
        break;
      }
    }
  }
  return support;
}

void AppendRows(const Eigen::MatrixXd& matrix, std::string* text) {
  *text += '[';
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (i > 0) *text += ", ";
    const Eigen::VectorXd row = matrix.row(i);
    AppendNumbers(std::vector<double>(row.data(), row.data() + row.size()),
                  text);
  }
  *text += ']';
}

// Without a covariance when null.
void AppendFeature(const Graph& graph, const Feature& feature,
                   const Eigen::MatrixXd* covariance, std::string* text) {
  *text += "{\"id\": ";
  AppendNumber(feature.id, text);
  *text += ", \"type\": ";
  AppendString(feature.type->name, text);
  *text += ", \"level\": ";
  AppendNumber(static_cast<std::int64_t>(feature.level), text);
  *text += ", \"virtual\": ";
  *text += feature.is_virtual ? "true" : "false";
  *text += ", \"fixed\": ";
  *text += feature.fixed ? "true" : "false";
  *text += ", \"parameters\": ";
  AppendNumbers(
      std::vector<double>(feature.data(), feature.data() + feature.type->size),
      text);
  *text += ", \"anchor\": ";
  AppendNumbers(std::vector<double>(feature.anchor.begin(),
                                    feature.anchor.begin() +
                                        feature.type->written_anchor_size()),
                text);
  *text += ", \"extent\": ";
  AppendNumbers(std::vector<double>{feature.extent_begin, feature.extent_end},
                text);
  *text += ", \"observations\": ";
  AppendNumber(static_cast<std::int64_t>(feature.observations), text);
  *text += ", \"source\": ";
  AppendString(feature.source, text);
  *text += ", \"support\": ";
  AppendIds(SupportOf(graph, feature), text);
  if (covariance != nullptr) {
    *text += ", \"covariance\": ";
    AppendRows(*covariance, text);
  }
  *text += '}';
}

void AppendConstraint(const Constraint& constraint, std::string* text) {
  *text += "{\"id\": ";
  AppendNumber(constraint.id, text);
  *text += ", \"type\": ";
  AppendString(constraint.type->name, text);
  *text += ", \"features\": ";
  AppendIds(constraint.features, text);
  *text += ", \"expected\": ";
  const Eigen::VectorXd& expected = constraint.expected;
  AppendNumbers(
      std::vector<double>(expected.data(), expected.data() + expected.size()),
      text);
  *text += ", \"information\": ";
  AppendRows(constraint.information, text);
  *text += ", \"class\": ";
  *text += constraint.kind == ConstraintClass::kStructure ? "\"structure\""
                                                          : "\"measurement\"";
  *text += ", \"delta\": ";
  AppendJsonNumber(constraint.delta, text);
  *text += ", \"state\": ";
  *text +=
      constraint.state == ConstraintState::kBroken ? "\"broken\"" : "\"live\"";
  *text += ", \"source\": ";
  AppendString(constraint.source, text);
  if (constraint.break_below != 1.0) {
    *text += ", \"break_below\": ";
    AppendJsonNumber(constraint.break_below, text);
  }
  *text += '}';
}

// A value of the document and where it stands.
class Node {
 public:
  Node(const std::string& name, std::string place, const json& value)
      : name_(name), place_(std::move(place)), value_(value) {}

  [[noreturn]] void Fail(const std::string& what,
                         const std::string& expected) const {
    throw Error(name_, 0, (place_.empty() ? "document" : place_) + " " + what,
                expected);
  }

  Node Get(const char* key) const {
    if (!value_.is_object()) Fail("is " + Kind(), "an object");
    const auto found = value_.find(key);
    if (found == value_.end()) {
      Fail("has no \"" + std::string(key) + "\"", "one");
    }
    return Node(name_, (place_.empty() ? "" : place_ + ".") + key, *found);
  }

  bool Has(const char* key) const {
    return value_.is_object() && value_.contains(key);
  }

  std::size_t ArraySize() const {
    if (!value_.is_array()) Fail("is " + Kind(), "an array");
    return value_.size();
  }
  void ExpectSize(std::size_t size) const {
    if (ArraySize() != size) {
      Fail("has " + std::to_string(value_.size()) + " elements",
           std::to_string(size));
    }
  }
  // ArraySize() was asked before.
  Node At(std::size_t index) const {
    return Node(name_, place_ + "[" + std::to_string(index) + "]",
                value_[index]);
  }

  double Number() const {
    if (!value_.is_number()) Fail("is " + Kind(), "a finite number");
    const double number = value_.get<double>();
    if (!std::isfinite(number)) Fail("is too large", "a finite number");
    return number;
  }
  std::int64_t Integer(std::int64_t maximum) const {
    if (!value_.is_number_integer() ||
        (value_.is_number_unsigned() &&
         value_.get<std::uint64_t>() > static_cast<std::uint64_t>(maximum)) ||
        value_.get<std::int64_t>() < 0) {
      Fail("is " + Kind(),
           "a whole number from 0 to " + std::to_string(maximum));
    }
    return value_.get<std::int64_t>();
  }
  bool Boolean() const {
    if (!value_.is_boolean()) Fail("is " + Kind(), "true or false");
    return value_.get<bool>();
  }
  const std::string& String() const {
    if (!value_.is_string()) Fail("is " + Kind(), "a string");
    return value_.get_ref<const std::string&>();
  }
  // True for `yes`, false for `no`.
  bool Choice(const std::string& yes, const std::string& no) const {
    const std::string& text = String();
    if (text != yes && text != no) {
      Fail("is \"" + text + "\"", yes + " or " + no);
    }
    return text == yes;
  }

 private:
  std::string Kind() const {
    if (value_.is_number()) {
      return value_.dump();
    }
    return std::string("of type ") + value_.type_name();
  }

  const std::string& name_;
  std::string place_;
  const json& value_;
};

constexpr std::int64_t kLargestInt = std::numeric_limits<int>::max();
constexpr std::int64_t kLargestId = std::numeric_limits<std::int64_t>::max();

Feature ReadFeature(const Node& node, const Registry& registry) {
  Feature feature;
  const Node type = node.Get("type");
  feature.type = registry.FindFeature(type.String());
  if (feature.type == nullptr) {
    std::string known;
    for (const FeatureType* other : registry.features()) {
      known += (known.empty() ? "" : ", ") + other->name;
    }
    type.Fail("is \"" + type.String() + "\"", "one of " + known);
  }
  feature.level = static_cast<int>(node.Get("level").Integer(kMaxLevel));
  feature.is_virtual = node.Get("virtual").Boolean();
  feature.fixed = node.Get("fixed").Boolean();
  const Node parameters = node.Get("parameters");
  parameters.ExpectSize(feature.type->size);
  for (int i = 0; i < feature.type->size; ++i) {
    feature.parameters[i] = parameters.At(i).Number();
  }
  const Node anchor = node.Get("anchor");
  const int anchor_size = feature.type->written_anchor_size();
  anchor.ExpectSize(anchor_size);
  for (int i = 0; i < anchor_size; ++i) {
    feature.anchor[i] = anchor.At(i).Number();
  }
  const Node extent = node.Get("extent");
  extent.ExpectSize(2);
  feature.extent_begin = extent.At(0).Number();
  feature.extent_end = extent.At(1).Number();
  feature.observations =
      static_cast<int>(node.Get("observations").Integer(kLargestInt));
  feature.source = node.Get("source").String();
  if (feature.is_virtual) feature.maker = registry.FindDetector(feature.source);
  return feature;
}

Constraint ReadConstraint(
    const Node& node, const Registry& registry,
    const std::unordered_map<std::int64_t, FeatureId>& feature_ids) {
  Constraint constraint;
  const Node type = node.Get("type");
  constraint.type = registry.FindRelation(type.String());
  if (constraint.type == nullptr) {
    std::string known;
    for (const RelationType* other : registry.relations()) {
      known += (known.empty() ? "" : ", ") + other->name;
    }
    type.Fail("is \"" + type.String() + "\"", "one of " + known);
  }
  const Node features = node.Get("features");
  features.ExpectSize(constraint.type->feature_types.size());
  for (std::size_t i = 0; i < features.ArraySize(); ++i) {
    const std::int64_t id = features.At(i).Integer(kLargestId);
    const auto found = feature_ids.find(id);
    if (found == feature_ids.end()) {
      features.At(i).Fail("is " + std::to_string(id), "the id of a feature");
    }
    constraint.features.push_back(found->second);
  }
  const int size = constraint.type->residual_size;
  const Node expected = node.Get("expected");
  const Node information = node.Get("information");
  expected.ExpectSize(size);
  information.ExpectSize(size);
  constraint.expected.resize(size);
  constraint.information.resize(size, size);
  for (int i = 0; i < size; ++i) {
    constraint.expected[i] = expected.At(i).Number();
    const Node row = information.At(i);
    row.ExpectSize(size);
    for (int j = 0; j < size; ++j) {
      constraint.information(i, j) = row.At(j).Number();
    }
  }
  constraint.kind = node.Get("class").Choice("structure", "measurement")
                        ? ConstraintClass::kStructure
                        : ConstraintClass::kMeasurement;
  constraint.state = node.Get("state").Choice("broken", "live")
                         ? ConstraintState::kBroken
                         : ConstraintState::kLive;
  constraint.delta = node.Get("delta").Number();
  constraint.source = node.Get("source").String();
  if (node.Has("break_below")) {
    const Node break_below = node.Get("break_below");
    constraint.break_below = break_below.Number();
    if (constraint.break_below < 0.0 || constraint.break_below > 1.0)
      break_below.Fail("is no p-value", "a number in [0, 1]");
  }
  return constraint;
}

// Line of a byte, from 1.
int LineOf(const std::string& text, std::size_t byte) {
  const std::size_t end = std::min(byte, text.size());
  return 1 +
         static_cast<int>(std::count(text.begin(), text.begin() + end, '\n'));
}

json Parse(const std::string& text, const std::string& name) {
  try {
    return json::parse(text);
  } catch (const json::parse_error& error) {
    throw Error(name, LineOf(text, error.byte == 0 ? 0 : error.byte - 1),
                "not JSON", "a map as plumbline writes it");
  } catch (const json::exception& error) {
    throw Error(name, 0, std::string("not JSON: ") + error.what(),
                "a map as plumbline writes it");
  }
}

}  // namespace

void WriteGraphJson(const Graph& graph, std::ostream& output,
                    const FeatureCovariances* covariances) {
  std::string text = "{\n\"features\": [";
  const char* separator = "\n";
  for (const Feature* feature : graph.Features()) {
    text += separator;
    separator = ",\n";
    const Eigen::MatrixXd* covariance = nullptr;
    if (covariances != nullptr) {
      const auto found = covariances->find(feature->id);
      if (found != covariances->end()) covariance = &found->second;
    }
    AppendFeature(graph, *feature, covariance, &text);
  }
  text += "\n],\n\"constraints\": [";
  separator = "\n";
  for (const Constraint* constraint : graph.Constraints()) {
    text += separator;
    separator = ",\n";
    AppendConstraint(*constraint, &text);
  }
  text += "\n]\n}\n";
  output.write(text.data(), static_cast<std::streamsize>(text.size()));
}

void ReadGraphJson(std::istream& input, const std::string& name,
                   const Registry& registry, Graph* graph) {
  if (graph->num_features() > 0 || graph->num_constraints() > 0) {
    throw PLUMBLINE_ERROR("the graph holds features already", "an empty graph");
  }
  const std::string text((std::istreambuf_iterator<char>(input)),
                         std::istreambuf_iterator<char>());
  if (input.bad()) throw Error(name, 0, "cannot read on", "");
  const json document = Parse(text, name);
  const Node root(name, "", document);

  Transaction transaction;
  std::unordered_map<std::int64_t, FeatureId> feature_ids;
  const Node features = root.Get("features");
  for (std::size_t i = 0; i < features.ArraySize(); ++i) {
    const Node node = features.At(i);
    const std::int64_t id = node.Get("id").Integer(kLargestId);
    const FeatureId provisional =
        transaction.AddFeature(ReadFeature(node, registry));
    if (!feature_ids.emplace(id, provisional).second) {
      node.Get("id").Fail("is " + std::to_string(id) + ", which is taken",
                          "each id once");
    }
  }
  const Node constraints = root.Get("constraints");
  for (std::size_t i = 0; i < constraints.ArraySize(); ++i) {
    transaction.AddConstraint(
        ReadConstraint(constraints.At(i), registry, feature_ids));
  }
  try {
    graph->Apply(std::move(transaction));
  } catch (const Error&) {
    // The graph knows what is wrong but not where. It has taken nothing.
    for (std::size_t i = 0; i < constraints.ArraySize(); ++i) {
      const ConstraintFault fault =
          FindFault(transaction.added_constraints()[i], transaction);
      if (!fault.what.empty()) {
        constraints.At(i).Fail("does not fit: " + fault.what, fault.expected);
      }
    }
    throw;
  }
}

}  // namespace plumbline
