#include <plumbline/core/constraint_fault.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/number_text.h>

#include <algorithm>
#include <cmath>
#include <istream>
#include <limits>
#include <ostream>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace plumbline {
namespace {

constexpr char kFeatureTag[] = "PLUMBLINE_FEATURE";
constexpr char kConstraintTag[] = "PLUMBLINE_CONSTRAINT";
constexpr char kFixTag[] = "FIX";
constexpr char kDefaultSource[] = "g2o";
// Room for new ids above it.
constexpr std::int64_t kLargestFileId =
    std::numeric_limits<std::int64_t>::max() / 2;

// Splits at blanks, in place.
void Split(std::string_view line, std::vector<std::string_view>* fields) {
  constexpr std::string_view kBlanks = " \t\r\v\f";
  fields->clear();
  std::size_t begin = line.find_first_not_of(kBlanks);
  while (begin != std::string_view::npos) {
    std::size_t end = line.find_first_of(kBlanks, begin);
    if (end == std::string_view::npos) end = line.size();
    fields->push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlanks, end);
  }
}

// A source as one field.
void AppendSource(const std::string& source, std::string* text) {
  if (source.empty()) {
    *text += '-';
    return;
  }
  for (const char c : source) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte <= ' ' || byte == 0x7f || c == '%' || source == "-") {
      constexpr char kDigits[] = "0123456789ABCDEF";
      *text += {'%', kDigits[byte / 16], kDigits[byte % 16]};
    } else {
      *text += c;
    }
  }
}

bool ParseSource(std::string_view text, std::string* source) {
  source->clear();
  if (text == "-") return true;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      *source += text[i];
      continue;
    }
    unsigned int byte = 0;
    if (i + 2 >= text.size() ||
        std::from_chars(&text[i + 1], &text[i + 1] + 2, byte, 16).ptr !=
            &text[i + 1] + 2) {
      return false;
    }
    *source += static_cast<char>(byte);
    i += 2;
  }
  return true;
}

// What stands on a PLUMBLINE_FEATURE line.
struct FeatureLine {
  int line;
  std::string text;
  FeatureId position;
  std::int64_t file_id;
  Feature attributes;
};

struct FixLine {
  int line;
  FeatureId position;
  std::int64_t file_id;
};

// An edge as it was read: its vertices may come later in the file.
struct Edge {
  int line;
  std::string text;
  // The own line below it, which shares its fate.
  std::string own_text;
  FeatureId position;
  std::vector<std::int64_t> file_ids;
  Constraint constraint;
};

class Reader {
 public:
  Reader(const std::string& name, const Registry& registry)
      : name_(name), registry_(registry) {}

  G2oFile Read(std::istream& input, Graph* graph) {
    if (graph->num_features() > 0 || graph->num_constraints() > 0) {
      throw PLUMBLINE_ERROR("the graph holds features already",
                            "an empty graph");
    }
    first_id_ = graph->feature_id_end();
    file_.file_ids.assign(first_id_, kNoId);
    std::string line;
    while (std::getline(input, line)) {
      ++line_;
      ReadLine(line);
    }
    if (input.bad()) throw Error(name_, line_, "cannot read on", "");
    Transaction transaction;
    AddFeatures(&transaction);
    std::vector<const Edge*> added = AddConstraints(&transaction);
    try {
      graph->Apply(transaction);
    } catch (const Error&) {
      // The graph knows what is wrong but not where.
      for (std::size_t i = 0; i < added.size(); ++i) {
        const ConstraintFault fault =
            FindFault(transaction.added_constraints()[i], transaction);
        if (!fault.what.empty()) {
          Fail(added[i]->line, fault.what, fault.expected);
        }
      }
      throw;
    }
    return std::move(file_);
  }

 private:
  enum class Above { kNothing, kEdge, kUnknown };

  [[noreturn]] void Fail(int line, const std::string& what,
                         const std::string& expected) const {
    throw Error(name_, line, what, expected);
  }

  std::int64_t Integer(std::string_view field, const std::string& what,
                       std::int64_t minimum, std::int64_t maximum) const {
    std::int64_t value = 0;
    if (!ParseNumber(field, &value) || value < minimum || value > maximum) {
      Fail(line_, what + " is \"" + std::string(field) + "\"",
           "a whole number from " + std::to_string(minimum) + " to " +
               std::to_string(maximum));
    }
    return value;
  }

  std::int64_t Id(std::string_view field) const {
    return Integer(field, "id", 0, kLargestFileId);
  }

  double Number(std::string_view field) const {
    double value = 0.0;
    if (!ParseNumber(field, &value) || !std::isfinite(value)) {
      Fail(line_, "\"" + std::string(field) + "\"", "a finite number");
    }
    return value;
  }

  std::string Source(std::string_view field) const {
    std::string source;
    if (!ParseSource(field, &source)) {
      Fail(line_, "source \"" + std::string(field) + "\"",
           "two hexadecimal digits after each %");
    }
    return source;
  }

  void ExpectFields(std::size_t count, const std::string& what) const {
    if (fields_.size() != count + 1) {
      Fail(line_,
           std::string(fields_[0]) + " has " +
               std::to_string(fields_.size() - 1) + " fields",
           std::to_string(count) + " (" + what + ")");
    }
  }

  // The feature whose vertex was read last.
  FeatureId Position() const {
    if (features_.empty()) return kNoId;
    return first_id_ + static_cast<FeatureId>(features_.size()) - 1;
  }

  void Keep(const std::string& line, FeatureId position) {
    file_.unknown_lines.push_back(line);
    file_.unknown_line_positions.push_back(position);
  }

  void ReadLine(const std::string& line) {
    Split(line, &fields_);
    if (fields_.empty()) return;
    if (fields_[0][0] == '#') {
      Keep(line, Position());
      return;
    }
    const std::string tag(fields_[0]);
    const Above above = above_;
    above_ = Above::kNothing;
    if (tag == kConstraintTag) {
      if (above == Above::kUnknown) {
        Keep(line, Position());
      } else if (above == Above::kEdge) {
        ReadConstraintLine(line);
      } else {
        Fail(line_, tag + " without an edge", "an edge above it");
      }
    } else if (tag == kFixTag) {
      if (fields_.size() < 2) {
        Fail(line_, "FIX without an id", "ids of vertices");
      }
      for (std::size_t i = 1; i < fields_.size(); ++i) {
        fix_lines_.push_back({line_, Position(), Id(fields_[i])});
      }
    } else if (tag == kFeatureTag) {
      ReadFeatureLine(line);
    } else if (const FeatureType* type = registry_.FindFeatureByTag(tag)) {
      ReadVertex(*type);
    } else if (const RelationType* relation =
                   registry_.FindRelationByTag(tag)) {
      ReadEdge(*relation, line);
      above_ = Above::kEdge;
    } else {
      ++file_.unknown_tags[tag];
      std::int64_t id = 0;
      if (MayBeVertex(tag) && fields_.size() > 1 &&
          ParseNumber(fields_[1], &id)) {
        unknown_ids_.insert(id);
      }
      Keep(line, Position());
      above_ = Above::kUnknown;
    }
  }

  void ReadVertex(const FeatureType& type) {
    std::string what = "id";
    for (const std::string& name : type.parameter_names) what += ", " + name;
    ExpectFields(type.size + 1, what);
    const std::int64_t id = Id(fields_[1]);
    if (!index_.emplace(id, features_.size()).second) {
      Fail(line_, "id " + std::to_string(id) + " is taken", "each vertex once");
    }
    Feature feature;
    feature.type = &type;
    feature.source = kDefaultSource;
    for (int i = 0; i < type.size; ++i) {
      feature.parameters[i] = Number(fields_[i + 2]);
    }
    features_.push_back(std::move(feature));
    file_.file_ids.push_back(id);
  }

  void ReadFeatureLine(const std::string& line) {
    ExpectFields(9,
                 "id, level, virtual, anchor_x, anchor_y, extent_begin, "
                 "extent_end, observations, source");
    FeatureLine own;
    own.line = line_;
    own.text = line;
    own.position = Position();
    own.file_id = Id(fields_[1]);
    Feature& feature = own.attributes;
    feature.level = static_cast<int>(
        Integer(fields_[2], "level", 0, std::numeric_limits<int>::max()));
    feature.is_virtual = Integer(fields_[3], "virtual", 0, 1) == 1;
    feature.anchor = {Number(fields_[4]), Number(fields_[5])};
    feature.extent_begin = Number(fields_[6]);
    feature.extent_end = Number(fields_[7]);
    feature.observations = static_cast<int>(Integer(
        fields_[8], "observations", 0, std::numeric_limits<int>::max()));
    feature.source = Source(fields_[9]);
    feature_lines_.push_back(std::move(own));
  }

  void ReadEdge(const RelationType& type, const std::string& line) {
    const std::size_t arity = type.feature_types.size();
    const int size = type.residual_size;
    ExpectFields(arity + size + size * (size + 1) / 2,
                 std::to_string(arity) + " ids, " + std::to_string(size) +
                     " expected values, the upper triangle of the information");
    Edge edge;
    edge.line = line_;
    edge.text = line;
    edge.position = Position();
    std::size_t field = 1;
    for (std::size_t i = 0; i < arity; ++i) {
      edge.file_ids.push_back(Id(fields_[field++]));
    }
    Constraint& constraint = edge.constraint;
    constraint.type = &type;
    constraint.source = kDefaultSource;
    constraint.expected.resize(size);
    constraint.information.resize(size, size);
    for (int i = 0; i < size; ++i) {
      constraint.expected[i] = Number(fields_[field++]);
    }
    for (int i = 0; i < size; ++i) {
      for (int j = i; j < size; ++j) {
        constraint.information(i, j) = Number(fields_[field++]);
        constraint.information(j, i) = constraint.information(i, j);
      }
    }
    edges_.push_back(std::move(edge));
  }

  // `above_` was an edge.
  void ReadConstraintLine(const std::string& line) {
    ExpectFields(4, "class, state, delta, source");
    edges_.back().own_text = line;
    Constraint& constraint = edges_.back().constraint;
    if (fields_[1] == "structure") {
      constraint.kind = ConstraintClass::kStructure;
    } else if (fields_[1] != "measurement") {
      Fail(line_, "class \"" + std::string(fields_[1]) + "\"",
           "measurement or structure");
    }
    if (fields_[2] == "broken") {
      constraint.state = ConstraintState::kBroken;
    } else if (fields_[2] != "live") {
      Fail(line_, "state \"" + std::string(fields_[2]) + "\"",
           "live or broken");
    }
    constraint.delta = Number(fields_[3]);
    if (constraint.delta < 0.0 || constraint.delta > 1.0) {
      Fail(line_, "delta " + std::string(fields_[3]), "a number in [0, 1]");
    }
    constraint.source = Source(fields_[4]);
  }

  // The vertex with this id; null when its tag is unknown.
  Feature* FindVertex(int line, std::int64_t file_id) {
    const auto found = index_.find(file_id);
    if (found != index_.end()) return &features_[found->second];
    if (unknown_ids_.count(file_id) == 0) {
      Fail(line, "no vertex " + std::to_string(file_id),
           "the id of a vertex in the file");
    }
    return nullptr;
  }

  void AddFeatures(Transaction* transaction) {
    for (const FixLine& fix : fix_lines_) {
      Feature* feature = FindVertex(fix.line, fix.file_id);
      if (feature != nullptr) {
        feature->fixed = true;
      } else {
        Keep(kFixTag + (" " + std::to_string(fix.file_id)), fix.position);
      }
    }
    std::unordered_set<std::int64_t> seen;
    for (const FeatureLine& own : feature_lines_) {
      if (!seen.insert(own.file_id).second) {
        Fail(own.line,
             "a second " + std::string(kFeatureTag) + " of vertex " +
                 std::to_string(own.file_id),
             "one a vertex");
      }
      Feature* feature = FindVertex(own.line, own.file_id);
      if (feature == nullptr) {
        Keep(own.text, own.position);
        continue;
      }
      feature->level = own.attributes.level;
      feature->is_virtual = own.attributes.is_virtual;
      feature->anchor = own.attributes.anchor;
      feature->extent_begin = own.attributes.extent_begin;
      feature->extent_end = own.attributes.extent_end;
      feature->observations = own.attributes.observations;
      feature->source = own.attributes.source;
    }
    for (const Feature& feature : features_) transaction->AddFeature(feature);
  }

  // Returns the edge of each constraint that it added.
  std::vector<const Edge*> AddConstraints(Transaction* transaction) {
    std::vector<const Edge*> added;
    for (Edge& edge : edges_) {
      bool known = true;
      for (const std::int64_t file_id : edge.file_ids) {
        if (FindVertex(edge.line, file_id) == nullptr) {
          known = false;
          continue;
        }
        edge.constraint.features.push_back(
            Transaction::ProvisionalId(index_[file_id]));
      }
      if (!known) {
        Keep(edge.text, edge.position);
        if (!edge.own_text.empty()) Keep(edge.own_text, edge.position);
        continue;
      }
      transaction->AddConstraint(std::move(edge.constraint));
      added.push_back(&edge);
    }
    return added;
  }

  // Whether the first field after an unknown tag can be the id of a vertex.
  static bool MayBeVertex(const std::string& tag) {
    return tag.find("EDGE") == std::string::npos &&
           tag.find("LASER") == std::string::npos &&
           tag.rfind("PARAMS", 0) != 0;
  }

  const std::string& name_;
  const Registry& registry_;
  int line_ = 0;
  std::vector<std::string_view> fields_;
  Above above_ = Above::kNothing;
  FeatureId first_id_ = 0;
  std::vector<Feature> features_;
  // Position in features_ by the id in the file.
  std::unordered_map<std::int64_t, std::size_t> index_;
  // Ids of vertices with unknown tags.
  std::unordered_set<std::int64_t> unknown_ids_;
  std::vector<FixLine> fix_lines_;
  std::vector<FeatureLine> feature_lines_;
  std::vector<Edge> edges_;
  G2oFile file_;
};

// Ids in the file for all features of the graph, by feature id.
std::vector<std::int64_t> FileIds(const Graph& graph, const G2oFile* file) {
  std::vector<std::int64_t> ids;
  std::int64_t next = 0;
  if (file != nullptr) {
    ids = file->file_ids;
    for (const std::int64_t id : ids) next = std::max(next, id + 1);
    std::vector<std::string_view> fields;
    for (const std::string& line : file->unknown_lines) {
      std::int64_t id = 0;
      Split(line, &fields);
      if (fields.size() > 1 && ParseNumber(fields[1], &id) &&
          id <= kLargestFileId) {
        next = std::max(next, id + 1);
      }
    }
  }
  ids.resize(graph.feature_id_end(), kNoId);
  for (const Feature* feature : graph.Features()) {
    if (ids[feature->id] == kNoId) ids[feature->id] = next++;
  }
  return ids;
}

void AppendFeature(const Feature& feature, std::int64_t file_id,
                   std::string* text) {
  *text += feature.type->g2o_tag;
  *text += ' ';
  AppendNumber(file_id, text);
  for (int i = 0; i < feature.type->size; ++i) {
    *text += ' ';
    AppendNumber(feature.parameters[i], text);
  }
  *text += '\n';
  if (feature.fixed) {
    *text += kFixTag;
    *text += ' ';
    AppendNumber(file_id, text);
    *text += '\n';
  }
  const bool is_plain =
      feature.level == 0 && !feature.is_virtual && feature.anchor[0] == 0.0 &&
      feature.anchor[1] == 0.0 && feature.extent_begin == 0.0 &&
      feature.extent_end == 0.0 && feature.observations == 0 &&
      feature.source == kDefaultSource;
  if (is_plain) return;
  *text += kFeatureTag;
  *text += ' ';
  AppendNumber(file_id, text);
  *text += ' ';
  AppendNumber(static_cast<std::int64_t>(feature.level), text);
  *text += feature.is_virtual ? " 1" : " 0";
  for (const double number : {feature.anchor[0], feature.anchor[1],
                              feature.extent_begin, feature.extent_end}) {
    *text += ' ';
    AppendNumber(number, text);
  }
  *text += ' ';
  AppendNumber(static_cast<std::int64_t>(feature.observations), text);
  *text += ' ';
  AppendSource(feature.source, text);
  *text += '\n';
}

void AppendConstraint(const Constraint& constraint,
                      const std::vector<std::int64_t>& file_ids,
                      std::string* text) {
  *text += constraint.type->g2o_tag;
  for (const FeatureId id : constraint.features) {
    *text += ' ';
    AppendNumber(file_ids[id], text);
  }
  for (Eigen::Index i = 0; i < constraint.expected.size(); ++i) {
    *text += ' ';
    AppendNumber(constraint.expected[i], text);
  }
  for (Eigen::Index i = 0; i < constraint.information.rows(); ++i) {
    for (Eigen::Index j = i; j < constraint.information.cols(); ++j) {
      *text += ' ';
      AppendNumber(constraint.information(i, j), text);
    }
  }
  *text += '\n';
  const bool is_plain = constraint.kind == ConstraintClass::kMeasurement &&
                        constraint.state == ConstraintState::kLive &&
                        constraint.delta == 1.0 &&
                        constraint.source == kDefaultSource;
  if (is_plain) return;
  *text += kConstraintTag;
  *text += constraint.kind == ConstraintClass::kStructure ? " structure"
                                                          : " measurement";
  *text += constraint.state == ConstraintState::kBroken ? " broken " : " live ";
  AppendNumber(constraint.delta, text);
  *text += ' ';
  AppendSource(constraint.source, text);
  *text += '\n';
}

}  // namespace

G2oFile ReadG2o(std::istream& input, const std::string& name,
                const Registry& registry, Graph* graph) {
  return Reader(name, registry).Read(input, graph);
}

void WriteG2o(const Graph& graph, const G2oFile* file, std::ostream& output) {
  const std::vector<std::int64_t> file_ids = FileIds(graph, file);
  // Unknown lines in the order of the vertices that they follow.
  std::vector<std::pair<FeatureId, const std::string*>> unknown;
  if (file != nullptr) {
    for (std::size_t i = 0; i < file->unknown_lines.size(); ++i) {
      const bool placed = i < file->unknown_line_positions.size();
      unknown.emplace_back(placed ? file->unknown_line_positions[i] : kNoId,
                           &file->unknown_lines[i]);
    }
    std::stable_sort(
        unknown.begin(), unknown.end(),
        [](const auto& a, const auto& b) { return a.first < b.first; });
  }
  auto next = unknown.begin();
  std::string text;
  const auto append_unknown = [&](FeatureId before) {
    for (; next != unknown.end() && next->first < before; ++next) {
      text += *next->second;
      text += '\n';
    }
  };
  for (const Feature* feature : graph.Features()) {
    append_unknown(feature->id);
    AppendFeature(*feature, file_ids[feature->id], &text);
  }
  append_unknown(graph.feature_id_end());
  for (const Constraint* constraint : graph.Constraints()) {
    AppendConstraint(*constraint, file_ids, &text);
  }
  output.write(text.data(), static_cast<std::streamsize>(text.size()));
}

}  // namespace plumbline
