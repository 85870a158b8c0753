#include <plumbline/core/constraint_fault.h>
#include <plumbline/core/error.h>
#include <plumbline/core/g2o_lines.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/utf8.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <istream>
#include <map>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace plumbline {
namespace {

constexpr char kLaserTag[] = "ROBOTLASER1";

// A tag and how its line is written. Null formats: the type's own tag, in
// order.
struct VertexTag {
  const FeatureType* type;
  const G2oVertexFormat* format;
};
struct EdgeTag {
  const RelationType* type;
  const G2oEdgeFormat* format;
};

// What stands on a PLUMBLINE_FEATURE line.
struct FeatureLine {
  int line;
  std::int64_t file_id;
  // Coordinates that it gives.
  int anchor_size;
  Feature attributes;
};

struct UnknownLine {
  int line = 0;
  std::string tag;
};

struct FixLine {
  int line;
  std::int64_t file_id;
};

// A vertex with fields that name others, which may come later in the file.
struct ExtraFields {
  std::size_t feature;
  const G2oVertexFormat* format;
  std::vector<std::int64_t> numbers;
};

// An edge as it was read: its vertices may come later in the file.
struct Edge {
  int line;
  // Whether a PLUMBLINE_CONSTRAINT line follows.
  bool has_attributes = false;
  // Its features are ids in the file.
  Constraint constraint;
};

[[noreturn]] void Fail(const std::string& name, int line,
                       const std::string& what, const std::string& expected) {
  // Fields of the file may be any bytes.
  throw Error(name, line, PrintableUtf8(what), expected);
}

// The fields of a line, with errors that say where they are.
class LineFields {
 public:
  explicit LineFields(const std::string& name) : name_(name) {}

  // `text` must outlive the fields.
  void Set(int line, std::string_view text) {
    line_ = line;
    SplitG2oLine(text, &fields_);
  }

  int line() const { return line_; }
  bool empty() const { return fields_.empty(); }
  std::size_t size() const { return fields_.size(); }
  std::string_view operator[](std::size_t i) const { return fields_[i]; }

  [[noreturn]] void Fail(const std::string& what,
                         const std::string& expected) const {
    plumbline::Fail(name_, line_, what, expected);
  }

  std::int64_t Integer(std::string_view field, const std::string& what,
                       std::int64_t minimum, std::int64_t maximum) const {
    std::int64_t value = 0;
    if (!ParseNumber(field, &value) || value < minimum || value > maximum) {
      Fail(what + " is \"" + std::string(field) + "\"",
           "a whole number from " + std::to_string(minimum) + " to " +
               std::to_string(maximum));
    }
    return value;
  }

  std::int64_t Id(std::string_view field) const {
    return Integer(field, "id", 0, kLargestG2oId);
  }

  double Number(std::string_view field) const {
    double value = 0.0;
    if (!ParseNumber(field, &value) || !std::isfinite(value)) {
      Fail("\"" + std::string(field) + "\"", "a finite number");
    }
    return value;
  }

  std::string Source(std::string_view field) const {
    std::string source;
    if (!ParseG2oSource(field, &source)) {
      Fail("source \"" + std::string(field) + "\"",
           "two hexadecimal digits after each %");
    }
    return source;
  }

  // `what()` says what they are.
  template <typename What>
  void ExpectFields(std::size_t count, const What& what) const {
    if (fields_.size() == count + 1) return;
    Fail(std::string(fields_[0]) + " has " +
             std::to_string(fields_.size() - 1) + " fields",
         std::to_string(count) + " (" + what() + ")");
  }

 private:
  const std::string& name_;
  int line_ = 0;
  std::vector<std::string_view> fields_;
};

// What the lines of a file say.
struct Records {
  std::vector<Feature> features;
  // Position in `features` by the id in the file.
  std::unordered_map<std::int64_t, std::size_t> index;
  // Ids of vertices with unknown tags.
  std::unordered_set<std::int64_t> unknown_ids;
  UnknownLine first_unknown;
  std::vector<FixLine> fix_lines;
  std::vector<ExtraFields> extra_fields;
  std::vector<FeatureLine> feature_lines;
  std::vector<Edge> edges;
};

// Reads lines one by one into records.
class LineReader {
 public:
  LineReader(const std::string& name, const Registry& registry,
             FeatureId first_feature, G2oFile* file, Records* records)
      : first_feature_(first_feature),
        file_(file),
        records_(records),
        fields_(name) {
    for (const FeatureType* type : registry.features()) {
      vertex_tags_[type->g2o_tag] = {type, nullptr};
      for (const G2oVertexFormat& format : type->other_g2o_formats) {
        vertex_tags_[format.tag] = {type, &format};
      }
    }
    for (const RelationType* type : registry.relations()) {
      edge_tags_[type->g2o_tag] = {type, nullptr};
      for (const G2oEdgeFormat& format : type->other_g2o_formats) {
        edge_tags_[format.tag] = {type, &format};
      }
    }
  }

  // The last line that was read, when it is the beginning of a known tag.
  std::string CutTag() const {
    if (fields_.size() != 1 || above_ != Above::kUnknown) return "";
    const std::string tag(fields_[0]);
    const auto begins = [&tag](const std::string& known) {
      return known.compare(0, tag.size(), tag) == 0;
    };
    const auto begins_one = [&begins](const auto& tags) {
      return std::any_of(
          tags.begin(), tags.end(),
          [&begins](const auto& known) { return begins(known.first); });
    };
    const bool is_cut = begins_one(vertex_tags_) || begins_one(edge_tags_) ||
                        begins(kG2oFixTag) || begins(kG2oFeatureTag) ||
                        begins(kG2oConstraintTag) || begins(kLaserTag);
    return is_cut ? tag : "";
  }

  // The line `number`, the last of G2oFile::lines.
  void Read(int number, std::string_view line) {
    fields_.Set(number, line);
    if (fields_.empty() || fields_[0][0] == '#') return;
    // Mostly lines of one kind follow each other.
    if (last_vertex_ != nullptr && fields_[0] == last_tag_) {
      above_ = Above::kNothing;
      ReadVertex(*last_vertex_);
      return;
    }
    if (last_edge_ != nullptr && fields_[0] == last_tag_) {
      above_ = Above::kNothing;
      ReadEdge(*last_edge_);
      above_ = Above::kEdge;
      return;
    }
    const std::string tag(fields_[0]);
    const Above above = above_;
    above_ = Above::kNothing;
    if (tag == kG2oConstraintTag) {
      if (above == Above::kEdge) {
        ReadConstraintLine();
      } else if (above != Above::kUnknown) {
        fields_.Fail(tag + " without an edge", "an edge above it");
      }
      return;
    }
    if (tag == kG2oFixTag) {
      if (fields_.size() < 2) {
        fields_.Fail("FIX without an id", "ids of vertices");
      }
      Line().kind = G2oLine::Kind::kFix;
      for (std::size_t i = 1; i < fields_.size(); ++i) {
        records_->fix_lines.push_back({fields_.line(), fields_.Id(fields_[i])});
      }
      return;
    }
    if (tag == kG2oFeatureTag) {
      ReadFeatureLine();
      return;
    }
    if (tag == kLaserTag) {
      ReadLaser();
      return;
    }
    const auto vertex = vertex_tags_.find(tag);
    if (vertex != vertex_tags_.end()) {
      last_tag_ = vertex->first;
      last_vertex_ = &vertex->second;
      last_edge_ = nullptr;
      ReadVertex(vertex->second);
      return;
    }
    const auto edge = edge_tags_.find(tag);
    if (edge != edge_tags_.end()) {
      last_tag_ = edge->first;
      last_vertex_ = nullptr;
      last_edge_ = &edge->second;
      ReadEdge(edge->second);
      above_ = Above::kEdge;
      return;
    }
    if (records_->first_unknown.tag.empty())
      records_->first_unknown = {fields_.line(), tag};
    ++file_->unknown_tags[tag];
    std::int64_t id = 0;
    if (MayBeVertex(tag) && fields_.size() > 1 &&
        ParseNumber(fields_[1], &id)) {
      records_->unknown_ids.insert(id);
    }
    above_ = Above::kUnknown;
  }

 private:
  enum class Above { kNothing, kEdge, kUnknown };

  // The line that is being read.
  G2oLine& Line() { return file_->lines.back(); }

  static std::string FieldsOf(const VertexTag& tag) {
    std::string what = "id";
    if (tag.format == nullptr) {
      for (const Quantity& parameter : tag.type->parameters) {
        what += ", " + parameter.label();
      }
    } else {
      what += ", " + std::to_string(tag.type->size) + " numbers";
      for (const std::string& name : tag.format->extra_fields) {
        what += ", " + name;
      }
    }
    return what;
  }

  void ReadVertex(const VertexTag& tag) {
    const FeatureType& type = *tag.type;
    const std::size_t extra =
        tag.format == nullptr ? 0 : tag.format->extra_fields.size();
    fields_.ExpectFields(static_cast<std::size_t>(type.size) + 1 + extra,
                         [&tag] { return FieldsOf(tag); });
    const std::int64_t id = fields_.Id(fields_[1]);
    if (!records_->index.emplace(id, records_->features.size()).second) {
      fields_.Fail("id " + std::to_string(id) + " is taken",
                   "each vertex once");
    }
    Feature feature;
    feature.type = &type;
    feature.source = kG2oSource;
    for (int i = 0; i < type.size; ++i) {
      feature.parameters[i] = fields_.Number(fields_[i + 2]);
    }
    if (tag.format != nullptr && tag.format->read) {
      tag.format->read(feature.parameters.data());
    }
    if (extra > 0) {
      ExtraFields fields = {records_->features.size(), tag.format, {}};
      for (std::size_t i = 0; i < extra; ++i) {
        const std::string_view field =
            fields_[static_cast<std::size_t>(type.size) + 2 + i];
        if (tag.format->extra_fields_are_ids) {
          fields.numbers.push_back(fields_.Integer(
              field, tag.format->extra_fields[i], -1, kLargestG2oId));
        } else {
          fields_.Number(field);
        }
      }
      if (tag.format->read_extra)
        records_->extra_fields.push_back(std::move(fields));
    }
    Line().kind = G2oLine::Kind::kVertex;
    Line().id =
        first_feature_ + static_cast<FeatureId>(records_->features.size());
    records_->features.push_back(std::move(feature));
    file_->file_ids.push_back(id);
  }

  void ReadFeatureLine() {
    // The vertex, which says how many coordinates an anchor has, may come
    // later.
    const int anchor_size =
        fields_.size() == 8 + kMaxAnchorSize ? kMaxAnchorSize : 2;
    fields_.ExpectFields(static_cast<std::size_t>(7 + anchor_size), [] {
      return "id, level, virtual, anchor_x, anchor_y, extent_begin, "
             "extent_end, observations, source";
    });
    FeatureLine own;
    own.anchor_size = anchor_size;
    own.line = fields_.line();
    own.file_id = fields_.Id(fields_[1]);
    Feature& feature = own.attributes;
    feature.level =
        static_cast<int>(fields_.Integer(fields_[2], "level", 0, kMaxLevel));
    feature.is_virtual = fields_.Integer(fields_[3], "virtual", 0, 1) == 1;
    std::size_t field = 4;
    for (int i = 0; i < anchor_size; ++i) {
      feature.anchor[i] = fields_.Number(fields_[field++]);
    }
    feature.extent_begin = fields_.Number(fields_[field++]);
    feature.extent_end = fields_.Number(fields_[field++]);
    feature.observations = static_cast<int>(fields_.Integer(
        fields_[field++], "observations", 0, std::numeric_limits<int>::max()));
    feature.source = fields_.Source(fields_[field]);
    records_->feature_lines.push_back(std::move(own));
  }

  // type start_angle field_of_view resolution maximum_range accuracy
  // remission_mode, the ranges and the remissions with their numbers before
  // them, poses of laser and robot and more.
  void ReadLaser() {
    constexpr std::size_t kBefore = 7;
    constexpr std::size_t kPoses = 6;
    if (records_->features.empty()) {
      fields_.Fail(std::string(kLaserTag) + " before all vertices",
                   "the vertex that it belongs to above it");
    }
    std::size_t field = kBefore + 1;
    for (int list = 0; list < 2; ++list) {
      if (field >= fields_.size()) break;
      field += 1 + static_cast<std::size_t>(
                       fields_.Integer(fields_[field], "number of readings", 0,
                                       std::numeric_limits<int>::max()));
    }
    if (field + kPoses > fields_.size()) {
      fields_.Fail(
          std::string(kLaserTag) + " has " +
              std::to_string(fields_.size() - 1) + " fields",
          "7 numbers, ranges and remissions each with their number before "
          "them, and two poses");
    }
    for (std::size_t i = 1; i < field + kPoses; ++i) fields_.Number(fields_[i]);
    ++file_->laser_scans;
  }

  void ReadEdge(const EdgeTag& tag) {
    const RelationType& type = *tag.type;
    const int arity = static_cast<int>(type.feature_types.size());
    const int size = type.residual_size;
    fields_.ExpectFields(
        static_cast<std::size_t>(arity + size + size * (size + 1) / 2), [&] {
          return std::to_string(arity) + (arity == 1 ? " id, " : " ids, ") +
                 std::to_string(size) +
                 (size == 1 ? " expected value" : " expected values") +
                 ", the upper triangle of the information";
        });
    Edge& edge = records_->edges.emplace_back();
    edge.line = fields_.line();
    Constraint& constraint = edge.constraint;
    constraint.features.resize(static_cast<std::size_t>(arity));
    for (int i = 0; i < arity; ++i) {
      constraint.features[static_cast<std::size_t>(i)] =
          fields_.Id(fields_[1 + FeaturePlace(tag.format, i)]);
    }
    constraint.type = &type;
    constraint.source = kG2oSource;
    constraint.expected.resize(size);
    for (int i = 0; i < size; ++i) {
      constraint.expected[i] =
          fields_.Number(fields_[1 + arity + RowPlace(tag.format, i)]);
    }
    if (tag.format != nullptr && tag.format->read) {
      tag.format->read(constraint.expected.data());
    }
    constraint.information.resize(size, size);
    int field = 1 + arity + size;
    ForInformation(tag.format, size, [&](int row, int column) {
      constraint.information(row, column) = fields_.Number(fields_[field++]);
      constraint.information(column, row) = constraint.information(row, column);
    });
    if (tag.format != nullptr && !tag.format->row_places.empty()) {
      const Eigen::MatrixXd entries = constraint.information;
      for (int i = 0; i < size; ++i) {
        for (int j = 0; j < size; ++j) {
          constraint.information(i, j) =
              entries(RowPlace(tag.format, i), RowPlace(tag.format, j));
        }
      }
    }
    if (IsTurned(file_->options, constraint)) {
      TurnInformation(constraint.expected[2], &constraint.information);
    }
    Line().kind = G2oLine::Kind::kEdge;
  }

  // `above_` was an edge.
  void ReadConstraintLine() {
    const bool has_threshold = fields_.size() == 6;
    fields_.ExpectFields(has_threshold ? 5 : 4,
                         [] { return "class, state, delta, source"; });
    Line().kind = G2oLine::Kind::kConstraintAttributes;
    records_->edges.back().has_attributes = true;
    Constraint& constraint = records_->edges.back().constraint;
    if (fields_[1] == "structure") {
      constraint.kind = ConstraintClass::kStructure;
    } else if (fields_[1] != "measurement") {
      fields_.Fail("class \"" + std::string(fields_[1]) + "\"",
                   "measurement or structure");
    }
    if (fields_[2] == "broken") {
      constraint.state = ConstraintState::kBroken;
    } else if (fields_[2] != "live") {
      fields_.Fail("state \"" + std::string(fields_[2]) + "\"",
                   "live or broken");
    }
    constraint.delta = PValue("delta", 3);
    constraint.source = fields_.Source(fields_[4]);
    if (has_threshold) constraint.break_below = PValue("break_below", 5);
  }

  double PValue(const std::string& what, std::size_t field) const {
    const double value = fields_.Number(fields_[field]);
    if (value < 0.0 || value > 1.0) {
      fields_.Fail(what + " " + std::string(fields_[field]),
                   "a number in [0, 1]");
    }
    return value;
  }

  // Whether the first field after an unknown tag can be the id of a vertex.
  static bool MayBeVertex(const std::string& tag) {
    return tag.find("EDGE") == std::string::npos &&
           tag.find("LASER") == std::string::npos &&
           tag.rfind("PARAMS", 0) != 0;
  }

  const FeatureId first_feature_;
  G2oFile* const file_;
  Records* const records_;
  LineFields fields_;
  std::unordered_map<std::string, VertexTag> vertex_tags_;
  std::unordered_map<std::string, EdgeTag> edge_tags_;
  // Of the last line that was a vertex or an edge.
  std::string_view last_tag_;
  const VertexTag* last_vertex_ = nullptr;
  const EdgeTag* last_edge_ = nullptr;
  Above above_ = Above::kNothing;
};

// Makes the graph of the records of all lines.
class GraphAssembler {
 public:
  GraphAssembler(const std::string& name, const Registry& registry,
                 G2oFile* file, Records* records, Graph* graph)
      : name_(name),
        registry_(registry),
        first_feature_(graph->feature_id_end()),
        first_constraint_(graph->constraint_id_end()),
        file_(file),
        records_(records),
        graph_(graph) {}

  void Assemble() {
    if (records_->features.empty() && records_->unknown_ids.empty()) {
      NameVertices();
    }
    if (records_->features.empty() && !records_->first_unknown.tag.empty()) {
      Fail(name_, records_->first_unknown.line,
           "no vertex or edge of the file has a known tag; the first is " +
               records_->first_unknown.tag,
           "a graph of the plane (VERTEX_SE2, EDGE_SE2 and others); graphs "
           "in three dimensions are not solved");
    }
    Transaction transaction;
    AddFeatures(&transaction);
    const std::vector<const Edge*> added = AddConstraints(&transaction);
    try {
      graph_->Apply(std::move(transaction));
    } catch (const Error&) {
      // The graph knows what is wrong but not where. It has taken nothing.
      for (std::size_t i = 0; i < added.size(); ++i) {
        const ConstraintFault fault =
            FindFault(transaction.added_constraints()[i], transaction);
        if (!fault.what.empty()) {
          Fail(name_, added[i]->line, fault.what, fault.expected);
        }
      }
      throw;
    }
    TakeFingerprints();
  }

 private:
  // Makes the vertices of a file that has edges only.
  void NameVertices() {
    // What each may be, the likeliest first.
    std::map<std::int64_t, std::vector<std::string>> types;
    for (const Edge& edge : records_->edges) {
      const RelationType& type = *edge.constraint.type;
      const std::vector<FeatureId>& file_ids = edge.constraint.features;
      for (std::size_t i = 0; i < file_ids.size(); ++i) {
        const std::vector<std::string>& fitting = type.feature_types[i];
        const auto [known, is_new] = types.emplace(file_ids[i], fitting);
        if (is_new) continue;
        std::vector<std::string> both;
        for (const std::string& name : known->second) {
          if (std::count(fitting.begin(), fitting.end(), name) > 0) {
            both.push_back(name);
          }
        }
        if (both.empty()) {
          Fail(name_, edge.line,
               "vertex " + std::to_string(file_ids[i]) + " is a " + fitting[0] +
                   " here and a " + known->second[0] + " above",
               "one type");
        }
        known->second = both;
      }
    }
    for (const auto& [file_id, names] : types) {
      records_->index.emplace(file_id, records_->features.size());
      Feature feature;
      feature.type = &registry_.GetFeature(names[0]);
      feature.source = kG2oSource;
      file_->named_by_edges.push_back(
          first_feature_ + static_cast<FeatureId>(records_->features.size()));
      file_->file_ids.push_back(file_id);
      records_->features.push_back(std::move(feature));
    }
  }

  // The index of the vertex with this id; their number when its tag is unknown.
  std::size_t FindVertex(int line, std::int64_t file_id) const {
    const auto found = records_->index.find(file_id);
    if (found != records_->index.end()) return found->second;
    if (records_->unknown_ids.count(file_id) == 0) {
      Fail(name_, line, "no vertex " + std::to_string(file_id),
           "the id of a vertex in the file");
    }
    return records_->index.size();
  }

  void AddFeatures(Transaction* transaction) {
    for (const FixLine& fix : records_->fix_lines) {
      const std::size_t index = FindVertex(fix.line, fix.file_id);
      if (index < records_->features.size()) {
        records_->features[index].fixed = true;
      }
    }
    for (const ExtraFields& fields : records_->extra_fields) {
      std::vector<const Feature*> named;
      for (const std::int64_t number : fields.numbers) {
        const auto found = records_->index.find(number);
        named.push_back(found == records_->index.end()
                            ? nullptr
                            : &records_->features[found->second]);
      }
      fields.format->read_extra(named, &records_->features[fields.feature]);
    }
    std::unordered_set<std::int64_t> seen;
    for (const FeatureLine& own : records_->feature_lines) {
      if (!seen.insert(own.file_id).second) {
        Fail(name_, own.line,
             "a second " + std::string(kG2oFeatureTag) + " of vertex " +
                 std::to_string(own.file_id),
             "one a vertex");
      }
      const std::size_t index = FindVertex(own.line, own.file_id);
      if (index == records_->features.size()) continue;
      G2oLine& line = file_->lines[static_cast<std::size_t>(own.line - 1)];
      line.kind = G2oLine::Kind::kFeatureAttributes;
      line.id = first_feature_ + static_cast<FeatureId>(index);
      Feature& feature = records_->features[index];
      const int anchor_size = feature.type->written_anchor_size();
      if (own.anchor_size != anchor_size) {
        Fail(name_, own.line,
             std::string(kG2oFeatureTag) + " has an anchor of " +
                 std::to_string(own.anchor_size) + " coordinates",
             std::to_string(anchor_size) + " for a " + feature.type->name);
      }
      feature.level = own.attributes.level;
      feature.is_virtual = own.attributes.is_virtual;
      feature.anchor = own.attributes.anchor;
      feature.extent_begin = own.attributes.extent_begin;
      feature.extent_end = own.attributes.extent_end;
      feature.observations = own.attributes.observations;
      feature.source = own.attributes.source;
      if (feature.is_virtual) {
        feature.maker = registry_.FindDetector(feature.source);
      }
    }
    num_features_ = records_->features.size();
    transaction->added_features() = std::move(records_->features);
  }

  // After AddFeatures. Returns the edge of each constraint that it added.
  std::vector<const Edge*> AddConstraints(Transaction* transaction) {
    std::vector<const Edge*> added;
    added.reserve(records_->edges.size());
    transaction->added_constraints().reserve(records_->edges.size());
    for (Edge& edge : records_->edges) {
      const std::size_t index = static_cast<std::size_t>(edge.line - 1);
      bool known = true;
      for (FeatureId& feature : edge.constraint.features) {
        const std::size_t vertex = FindVertex(edge.line, feature);
        known = known && vertex < num_features_;
        feature = Transaction::ProvisionalId(vertex);
      }
      ConstraintId id = kNoId;
      if (known) {
        id = first_constraint_ + static_cast<ConstraintId>(added.size());
        transaction->AddConstraint(std::move(edge.constraint));
        added.push_back(&edge);
      } else {
        file_->lines[index].kind = G2oLine::Kind::kText;
      }
      file_->lines[index].id = id;
      if (edge.has_attributes) SetAttributesLine(index + 1, id);
    }
    return added;
  }

  // Comments and blank lines may stand between an edge and its own line.
  void SetAttributesLine(std::size_t index, ConstraintId id) {
    while (file_->lines[index].kind != G2oLine::Kind::kConstraintAttributes) {
      ++index;
    }
    file_->lines[index].id = id;
    if (id == kNoId) file_->lines[index].kind = G2oLine::Kind::kText;
  }

  void TakeFingerprints() {
    const Graph& graph = *graph_;
    file_->feature_fingerprints.resize(
        static_cast<std::size_t>(graph.feature_id_end()));
    file_->was_fixed.resize(file_->feature_fingerprints.size());
    for (const Feature* feature : graph.Features()) {
      const auto id = static_cast<std::size_t>(feature->id);
      file_->feature_fingerprints[id] = G2oFingerprintOf(*feature);
      file_->was_fixed[id] = feature->fixed;
    }
    file_->constraint_fingerprints.resize(
        static_cast<std::size_t>(graph.constraint_id_end()));
    for (const Constraint* constraint : graph.Constraints()) {
      file_->constraint_fingerprints[static_cast<std::size_t>(constraint->id)] =
          G2oFingerprintOf(*constraint, file_->file_ids);
    }
  }

  const std::string& name_;
  const Registry& registry_;
  const FeatureId first_feature_;
  const ConstraintId first_constraint_;
  std::size_t num_features_ = 0;
  G2oFile* const file_;
  Records* const records_;
  Graph* const graph_;
};

}  // namespace

G2oFile ReadG2o(std::istream& input, const std::string& name,
                const Registry& registry, Graph* graph,
                const G2oOptions& options) {
  std::string text;
  std::array<char, 1 << 16> block;
  while (input.read(block.data(), block.size()) || input.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(input.gcount()));
  }
  if (input.bad()) {
    const auto lines = std::count(text.begin(), text.end(), '\n');
    throw Error(name, static_cast<int>(lines), "cannot read on", "");
  }
  return ReadG2o(std::move(text), name, registry, graph, options);
}

G2oFile ReadG2o(std::string text, const std::string& name,
                const Registry& registry, Graph* graph,
                const G2oOptions& options) {
  if (graph->num_features() > 0 || graph->num_constraints() > 0) {
    throw PLUMBLINE_ERROR("the graph holds features already", "an empty graph");
  }
  G2oFile file;
  file.options = options;
  RemoveByteOrderMark(&text);
  file.text = std::make_shared<const std::string>(std::move(text));
  const FeatureId first_feature = graph->feature_id_end();
  file.file_ids.assign(static_cast<std::size_t>(first_feature), kNoId);
  Records records;
  LineReader reader(name, registry, first_feature, &file, &records);
  const std::string_view all = *file.text;
  // Few are shorter.
  constexpr std::size_t kUsualLine = 64;
  file.lines.reserve(all.size() / kUsualLine + 1);
  std::size_t begin = 0;
  for (int number = 1; begin < all.size(); ++number) {
    const std::size_t end = std::min(all.find('\n', begin), all.size());
    const std::string_view line = all.substr(begin, end - begin);
    begin = end + 1;
    file.ends_with_line_feed = end < all.size();
    file.lines.push_back({G2oLine::Kind::kText, line, kNoId});
    reader.Read(number, line);
    if (!file.ends_with_line_feed) file.cut_tag = reader.CutTag();
  }
  GraphAssembler(name, registry, &file, &records, graph).Assemble();
  return file;
}

}  // namespace plumbline
