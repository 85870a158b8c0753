#include <plumbline/core/constraint_fault.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/utf8.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <istream>
#include <limits>
#include <map>
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
constexpr char kLaserTag[] = "ROBOTLASER1";
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

int FeaturePlace(const G2oEdgeFormat* format, int feature) {
  return format == nullptr || format->feature_places.empty()
             ? feature
             : format->feature_places[feature];
}

int RowPlace(const G2oEdgeFormat* format, int row) {
  return format == nullptr || format->row_places.empty()
             ? row
             : format->row_places[row];
}

// Rows and columns of the entries of an information matrix in the order of the
// line.
std::vector<std::pair<int, int>> InformationOrder(const G2oEdgeFormat* format,
                                                  int size) {
  if (format != nullptr && !format->information_order.empty()) {
    return format->information_order;
  }
  std::vector<std::pair<int, int>> order;
  for (int i = 0; i < size; ++i) {
    for (int j = i; j < size; ++j) order.emplace_back(i, j);
  }
  return order;
}

// Information of a relative pose, turned by the angle.
void TurnInformation(double angle, Eigen::MatrixXd* information) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  turn(0, 0) = turn(1, 1) = std::cos(angle);
  turn(1, 0) = std::sin(angle);
  turn(0, 1) = -turn(1, 0);
  const Eigen::Matrix3d turned = turn * *information * turn.transpose();
  *information = 0.5 * (turned + turned.transpose());
}

bool IsTurned(const G2oOptions& options, const Constraint& constraint) {
  return options.information_at_second &&
         constraint.type->Is(RelationRole::kPose) &&
         constraint.type->feature_types.size() == 2;
}

// -- Writing elements ---------------------------------------------------------

// What follows the parameters of a vertex in a file: "458 460".
using ExtraText = std::string_view;

void AppendVertex(const Feature& feature, const G2oVertexFormat* format,
                  std::int64_t file_id, ExtraText extra, std::string* text) {
  *text += format == nullptr ? feature.type->g2o_tag : format->tag;
  *text += ' ';
  AppendNumber(file_id, text);
  std::array<double, kMaxFeatureSize> numbers = feature.parameters;
  if (format != nullptr && format->write) format->write(numbers.data());
  for (int i = 0; i < feature.type->size; ++i) {
    *text += ' ';
    AppendNumber(numbers[i], text);
  }
  if (!extra.empty()) {
    *text += ' ';
    *text += extra;
  }
}

void AppendFix(std::int64_t file_id, std::string* text) {
  *text += kFixTag;
  *text += ' ';
  AppendNumber(file_id, text);
}

bool IsPlain(const Feature& feature) {
  return feature.level == 0 && !feature.is_virtual &&
         std::all_of(feature.anchor.begin(), feature.anchor.end(),
                     [](double coordinate) { return coordinate == 0.0; }) &&
         feature.extent_begin == 0.0 && feature.extent_end == 0.0 &&
         feature.observations == 0 && feature.source == kDefaultSource;
}

void AppendAttributes(const Feature& feature, std::int64_t file_id,
                      std::string* text) {
  *text += kFeatureTag;
  *text += ' ';
  AppendNumber(file_id, text);
  *text += ' ';
  AppendNumber(static_cast<std::int64_t>(feature.level), text);
  *text += feature.is_virtual ? " 1" : " 0";
  for (int i = 0; i < feature.type->written_anchor_size(); ++i) {
    *text += ' ';
    AppendNumber(feature.anchor[i], text);
  }
  for (const double number : {feature.extent_begin, feature.extent_end}) {
    *text += ' ';
    AppendNumber(number, text);
  }
  *text += ' ';
  AppendNumber(static_cast<std::int64_t>(feature.observations), text);
  *text += ' ';
  AppendSource(feature.source, text);
}

void AppendEdge(const Constraint& constraint, const G2oEdgeFormat* format,
                const G2oOptions& options,
                const std::vector<std::int64_t>& file_ids, std::string* text) {
  const int size = constraint.type->residual_size;
  const int arity = static_cast<int>(constraint.features.size());
  *text += format == nullptr ? constraint.type->g2o_tag : format->tag;
  std::vector<std::int64_t> ids(constraint.features.size());
  for (int i = 0; i < arity; ++i) {
    ids[FeaturePlace(format, i)] = file_ids[constraint.features[i]];
  }
  for (const std::int64_t id : ids) {
    *text += ' ';
    AppendNumber(id, text);
  }
  Eigen::VectorXd expected = constraint.expected;
  Eigen::MatrixXd information = constraint.information;
  if (IsTurned(options, constraint)) {
    TurnInformation(-expected[2], &information);
  }
  if (format != nullptr && format->write) format->write(expected.data());
  Eigen::VectorXd values(size);
  Eigen::MatrixXd entries(size, size);
  for (int i = 0; i < size; ++i) {
    values[RowPlace(format, i)] = expected[i];
    for (int j = 0; j < size; ++j) {
      entries(RowPlace(format, i), RowPlace(format, j)) = information(i, j);
    }
  }
  for (int i = 0; i < size; ++i) {
    *text += ' ';
    AppendNumber(values[i], text);
  }
  for (const auto& [row, column] : InformationOrder(format, size)) {
    *text += ' ';
    AppendNumber(entries(row, column), text);
  }
}

bool IsPlain(const Constraint& constraint) {
  return constraint.kind == ConstraintClass::kMeasurement &&
         constraint.state == ConstraintState::kLive &&
         constraint.delta == 1.0 && constraint.source == kDefaultSource;
}

void AppendAttributes(const Constraint& constraint, std::string* text) {
  *text += kConstraintTag;
  *text += constraint.kind == ConstraintClass::kStructure ? " structure"
                                                          : " measurement";
  *text += constraint.state == ConstraintState::kBroken ? " broken " : " live ";
  AppendNumber(constraint.delta, text);
  *text += ' ';
  AppendSource(constraint.source, text);
}

// What an element says, whatever its format.
G2oFile::Fingerprint FingerprintOf(const Feature& feature) {
  std::string element;
  AppendVertex(feature, nullptr, 0, {}, &element);
  std::string attributes;
  AppendAttributes(feature, 0, &attributes);
  return {std::hash<std::string>()(element),
          std::hash<std::string>()(attributes)};
}

G2oFile::Fingerprint FingerprintOf(const Constraint& constraint,
                                   const std::vector<std::int64_t>& file_ids) {
  std::string element;
  AppendEdge(constraint, nullptr, {}, file_ids, &element);
  std::string attributes;
  AppendAttributes(constraint, &attributes);
  return {std::hash<std::string>()(element),
          std::hash<std::string>()(attributes)};
}

// -- Reading ------------------------------------------------------------------

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
  std::vector<std::int64_t> file_ids;
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
  void Set(int line, const std::string& text) {
    line_ = line;
    Split(text, &fields_);
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
    return Integer(field, "id", 0, kLargestFileId);
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
    if (!ParseSource(field, &source)) {
      Fail("source \"" + std::string(field) + "\"",
           "two hexadecimal digits after each %");
    }
    return source;
  }

  void ExpectFields(std::size_t count, const std::string& what) const {
    if (fields_.size() != count + 1) {
      Fail(std::string(fields_[0]) + " has " +
               std::to_string(fields_.size() - 1) + " fields",
           std::to_string(count) + " (" + what + ")");
    }
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

  // The line `number`, the last of G2oFile::lines.
  void Read(int number, const std::string& line) {
    fields_.Set(number, line);
    if (fields_.empty() || fields_[0][0] == '#') return;
    const std::string tag(fields_[0]);
    const Above above = above_;
    above_ = Above::kNothing;
    if (tag == kConstraintTag) {
      if (above == Above::kEdge) {
        ReadConstraintLine();
      } else if (above != Above::kUnknown) {
        fields_.Fail(tag + " without an edge", "an edge above it");
      }
      return;
    }
    if (tag == kFixTag) {
      if (fields_.size() < 2) {
        fields_.Fail("FIX without an id", "ids of vertices");
      }
      Line().kind = G2oLine::Kind::kFix;
      for (std::size_t i = 1; i < fields_.size(); ++i) {
        records_->fix_lines.push_back({fields_.line(), fields_.Id(fields_[i])});
      }
      return;
    }
    if (tag == kFeatureTag) {
      ReadFeatureLine();
      return;
    }
    if (tag == kLaserTag) {
      ReadLaser();
      return;
    }
    const auto vertex = vertex_tags_.find(tag);
    if (vertex != vertex_tags_.end()) {
      ReadVertex(vertex->second);
      return;
    }
    const auto edge = edge_tags_.find(tag);
    if (edge != edge_tags_.end()) {
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

  void ReadVertex(const VertexTag& tag) {
    const FeatureType& type = *tag.type;
    std::string what = "id";
    if (tag.format == nullptr) {
      for (const Quantity& parameter : type.parameters) {
        what += ", " + parameter.label();
      }
    } else {
      what += ", " + std::to_string(type.size) + " numbers";
      for (const std::string& name : tag.format->extra_fields) {
        what += ", " + name;
      }
    }
    const std::size_t extra =
        tag.format == nullptr ? 0 : tag.format->extra_fields.size();
    fields_.ExpectFields(static_cast<std::size_t>(type.size) + 1 + extra, what);
    const std::int64_t id = fields_.Id(fields_[1]);
    if (!records_->index.emplace(id, records_->features.size()).second) {
      fields_.Fail("id " + std::to_string(id) + " is taken",
                   "each vertex once");
    }
    Feature feature;
    feature.type = &type;
    feature.source = kDefaultSource;
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
              field, tag.format->extra_fields[i], -1, kLargestFileId));
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
    fields_.ExpectFields(
        static_cast<std::size_t>(7 + anchor_size),
        "id, level, virtual, anchor_x, anchor_y, extent_begin, "
        "extent_end, observations, source");
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
        static_cast<std::size_t>(arity + size + size * (size + 1) / 2),
        std::to_string(arity) + (arity == 1 ? " id, " : " ids, ") +
            std::to_string(size) +
            (size == 1 ? " expected value" : " expected values") +
            ", the upper triangle of the information");
    Edge edge;
    edge.line = fields_.line();
    for (int i = 0; i < arity; ++i) {
      edge.file_ids.push_back(
          fields_.Id(fields_[1 + FeaturePlace(tag.format, i)]));
    }
    Constraint& constraint = edge.constraint;
    constraint.type = &type;
    constraint.source = kDefaultSource;
    constraint.expected.resize(size);
    for (int i = 0; i < size; ++i) {
      constraint.expected[i] =
          fields_.Number(fields_[1 + arity + RowPlace(tag.format, i)]);
    }
    if (tag.format != nullptr && tag.format->read) {
      tag.format->read(constraint.expected.data());
    }
    Eigen::MatrixXd entries(size, size);
    int field = 1 + arity + size;
    for (const auto& [row, column] : InformationOrder(tag.format, size)) {
      entries(row, column) = fields_.Number(fields_[field++]);
      entries(column, row) = entries(row, column);
    }
    constraint.information.resize(size, size);
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        constraint.information(i, j) =
            entries(RowPlace(tag.format, i), RowPlace(tag.format, j));
      }
    }
    if (IsTurned(file_->options, constraint)) {
      TurnInformation(constraint.expected[2], &constraint.information);
    }
    Line().kind = G2oLine::Kind::kEdge;
    records_->edges.push_back(std::move(edge));
  }

  // `above_` was an edge.
  void ReadConstraintLine() {
    fields_.ExpectFields(4, "class, state, delta, source");
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
    constraint.delta = fields_.Number(fields_[3]);
    if (constraint.delta < 0.0 || constraint.delta > 1.0) {
      fields_.Fail("delta " + std::string(fields_[3]), "a number in [0, 1]");
    }
    constraint.source = fields_.Source(fields_[4]);
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
      graph_->Apply(transaction);
    } catch (const Error&) {
      // The graph knows what is wrong but not where.
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
      for (std::size_t i = 0; i < edge.file_ids.size(); ++i) {
        const std::vector<std::string>& fitting = type.feature_types[i];
        const auto [known, is_new] = types.emplace(edge.file_ids[i], fitting);
        if (is_new) continue;
        std::vector<std::string> both;
        for (const std::string& name : known->second) {
          if (std::count(fitting.begin(), fitting.end(), name) > 0) {
            both.push_back(name);
          }
        }
        if (both.empty()) {
          Fail(name_, edge.line,
               "vertex " + std::to_string(edge.file_ids[i]) + " is a " +
                   fitting[0] + " here and a " + known->second[0] + " above",
               "one type");
        }
        known->second = both;
      }
    }
    for (const auto& [file_id, names] : types) {
      records_->index.emplace(file_id, records_->features.size());
      Feature feature;
      feature.type = &registry_.GetFeature(names[0]);
      feature.source = kDefaultSource;
      file_->named_by_edges.push_back(
          first_feature_ + static_cast<FeatureId>(records_->features.size()));
      file_->file_ids.push_back(file_id);
      records_->features.push_back(std::move(feature));
    }
  }

  // The index of the vertex with this id; records_->features.size() when its
  // tag is unknown.
  std::size_t FindVertex(int line, std::int64_t file_id) const {
    const auto found = records_->index.find(file_id);
    if (found != records_->index.end()) return found->second;
    if (records_->unknown_ids.count(file_id) == 0) {
      Fail(name_, line, "no vertex " + std::to_string(file_id),
           "the id of a vertex in the file");
    }
    return records_->features.size();
  }

  void AddFeatures(Transaction* transaction) {
    for (const FixLine& fix : records_->fix_lines) {
      const std::size_t index = FindVertex(fix.line, fix.file_id);
      if (index < records_->features.size())
        records_->features[index].fixed = true;
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
             "a second " + std::string(kFeatureTag) + " of vertex " +
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
             std::string(kFeatureTag) + " has an anchor of " +
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
    for (const Feature& feature : records_->features)
      transaction->AddFeature(feature);
  }

  // Returns the edge of each constraint that it added.
  std::vector<const Edge*> AddConstraints(Transaction* transaction) {
    std::vector<const Edge*> added;
    for (Edge& edge : records_->edges) {
      const std::size_t index = static_cast<std::size_t>(edge.line - 1);
      bool known = true;
      for (const std::int64_t file_id : edge.file_ids) {
        const std::size_t vertex = FindVertex(edge.line, file_id);
        known = known && vertex < records_->features.size();
        edge.constraint.features.push_back(Transaction::ProvisionalId(vertex));
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
      file_->feature_fingerprints[id] = FingerprintOf(*feature);
      file_->was_fixed[id] = feature->fixed;
    }
    file_->constraint_fingerprints.resize(
        static_cast<std::size_t>(graph.constraint_id_end()));
    for (const Constraint* constraint : graph.Constraints()) {
      file_->constraint_fingerprints[static_cast<std::size_t>(constraint->id)] =
          FingerprintOf(*constraint, file_->file_ids);
    }
  }

  const std::string& name_;
  const Registry& registry_;
  const FeatureId first_feature_;
  const ConstraintId first_constraint_;
  G2oFile* const file_;
  Records* const records_;
  Graph* const graph_;
};

G2oFile ReadG2oFile(std::istream& input, const std::string& name,
                    const Registry& registry, const G2oOptions& options,
                    Graph* graph) {
  if (graph->num_features() > 0 || graph->num_constraints() > 0) {
    throw PLUMBLINE_ERROR("the graph holds features already", "an empty graph");
  }
  G2oFile file;
  file.options = options;
  const FeatureId first_feature = graph->feature_id_end();
  file.file_ids.assign(static_cast<std::size_t>(first_feature), kNoId);
  Records records;
  LineReader reader(name, registry, first_feature, &file, &records);
  std::string line;
  int number = 0;
  while (std::getline(input, line)) {
    // The last line counts as ended unless the input ended before.
    file.ends_with_line_feed = !input.eof();
    ++number;
    if (number == 1) RemoveByteOrderMark(&line);
    file.lines.push_back({G2oLine::Kind::kText, line, kNoId});
    reader.Read(number, line);
  }
  if (input.bad()) throw Error(name, number, "cannot read on", "");
  GraphAssembler(name, registry, &file, &records, graph).Assemble();
  return file;
}

// -- Writing ------------------------------------------------------------------

// Ids in the file for all features of the graph, by feature id.
std::vector<std::int64_t> FileIds(const Graph& graph, const G2oFile* file) {
  std::vector<std::int64_t> ids;
  std::int64_t next = 0;
  if (file != nullptr) {
    ids = file->file_ids;
    for (const std::int64_t id : ids) next = std::max(next, id + 1);
    std::vector<std::string_view> fields;
    for (const G2oLine& line : file->lines) {
      if (line.kind != G2oLine::Kind::kText) continue;
      std::int64_t id = 0;
      Split(line.text, &fields);
      if (fields.size() > 1 && ParseNumber(fields[1], &id) &&
          id <= kLargestFileId) {
        next = std::max(next, id + 1);
      }
    }
  }
  ids.resize(static_cast<std::size_t>(graph.feature_id_end()), kNoId);
  for (const Feature* feature : graph.Features()) {
    if (ids[feature->id] == kNoId) ids[feature->id] = next++;
  }
  return ids;
}

class Writer {
 public:
  Writer(const Graph& graph, const G2oFile* file)
      : graph_(graph), file_(file), file_ids_(FileIds(graph, file)) {}

  std::string Write() {
    if (file_ != nullptr) {
      MarkAttributes();
      AppendNamedVertices();
      for (const G2oLine& line : file_->lines) AppendLine(line);
      if (!file_->ends_with_line_feed && !text_.empty()) text_.pop_back();
    }
    const bool is_open = !text_.empty() && text_.back() != '\n';
    const std::size_t end = text_.size();
    for (const Feature* feature : graph_.Features()) {
      if (IsOfFile(*feature)) continue;
      AppendVertex(*feature, nullptr, file_ids_[feature->id], {}, &text_);
      EndLine();
      if (feature->fixed) {
        AppendFix(file_ids_[feature->id], &text_);
        EndLine();
      }
      if (!IsPlain(*feature)) AppendAttributeLine(*feature);
    }
    for (const Constraint* constraint : graph_.Constraints()) {
      if (IsOfFile(*constraint)) continue;
      AppendEdge(*constraint, nullptr, Options(), file_ids_, &text_);
      EndLine();
      if (!IsPlain(*constraint)) AppendAttributeLine(*constraint);
    }
    if (is_open && text_.size() > end) text_.insert(end, "\n");
    return std::move(text_);
  }

 private:
  G2oOptions Options() const {
    return file_ == nullptr ? G2oOptions() : file_->options;
  }

  bool IsOfFile(const Feature& feature) const {
    return file_ != nullptr && static_cast<std::size_t>(feature.id) <
                                   file_->feature_fingerprints.size();
  }
  bool IsOfFile(const Constraint& constraint) const {
    return file_ != nullptr && static_cast<std::size_t>(constraint.id) <
                                   file_->constraint_fingerprints.size();
  }

  // Which elements have a line of attributes in the file.
  void MarkAttributes() {
    feature_has_attributes_.resize(file_->feature_fingerprints.size());
    constraint_has_attributes_.resize(file_->constraint_fingerprints.size());
    for (const G2oLine& line : file_->lines) {
      if (line.kind == G2oLine::Kind::kFeatureAttributes) {
        feature_has_attributes_[static_cast<std::size_t>(line.id)] = true;
      } else if (line.kind == G2oLine::Kind::kConstraintAttributes) {
        constraint_has_attributes_[static_cast<std::size_t>(line.id)] = true;
      }
    }
  }

  // All or none, so that readers which want a vertex above its edges get it.
  void AppendNamedVertices() {
    bool has_changed = false;
    for (const FeatureId id : file_->named_by_edges) {
      const Feature* feature = graph_.FindFeature(id);
      if (feature == nullptr) continue;
      const G2oFile::Fingerprint now = FingerprintOf(*feature);
      const G2oFile::Fingerprint& before = FingerprintInFile(*feature);
      has_changed = has_changed || now.element != before.element ||
                    now.attributes != before.attributes;
    }
    if (!has_changed) return;
    for (const FeatureId id : file_->named_by_edges) {
      const Feature* feature = graph_.FindFeature(id);
      if (feature == nullptr) continue;
      AppendVertex(*feature, nullptr, file_ids_[id], {}, &text_);
      EndLine();
      if (feature->fixed && !file_->was_fixed[static_cast<std::size_t>(id)]) {
        AppendFix(file_ids_[id], &text_);
        EndLine();
      }
      if (!IsPlain(*feature)) AppendAttributeLine(*feature);
    }
  }

  void EndLine() { text_ += '\n'; }

  void AppendAttributeLine(const Feature& feature) {
    AppendAttributes(feature, file_ids_[feature.id], &text_);
    EndLine();
  }
  void AppendAttributeLine(const Constraint& constraint) {
    AppendAttributes(constraint, &text_);
    EndLine();
  }

  void AppendText(const G2oLine& line) {
    text_ += line.text;
    EndLine();
  }

  void AppendLine(const G2oLine& line) {
    switch (line.kind) {
      case G2oLine::Kind::kText:
        AppendText(line);
        break;
      case G2oLine::Kind::kVertex:
        AppendVertexLine(line);
        break;
      case G2oLine::Kind::kFix:
        AppendFixLine(line);
        break;
      case G2oLine::Kind::kEdge:
        AppendEdgeLine(line);
        break;
      case G2oLine::Kind::kFeatureAttributes: {
        const Feature* feature = graph_.FindFeature(line.id);
        if (feature == nullptr) break;
        if (FingerprintOf(*feature).attributes ==
            FingerprintInFile(*feature).attributes) {
          AppendText(line);
        } else {
          AppendAttributeLine(*feature);
        }
        break;
      }
      case G2oLine::Kind::kConstraintAttributes: {
        const Constraint* constraint = graph_.FindConstraint(line.id);
        if (constraint == nullptr) break;
        if (FingerprintOf(*constraint, file_ids_).attributes ==
            FingerprintInFile(*constraint).attributes) {
          AppendText(line);
        } else {
          AppendAttributeLine(*constraint);
        }
        break;
      }
    }
  }

  const G2oFile::Fingerprint& FingerprintInFile(const Feature& feature) const {
    return file_->feature_fingerprints[static_cast<std::size_t>(feature.id)];
  }
  const G2oFile::Fingerprint& FingerprintInFile(
      const Constraint& constraint) const {
    return file_
        ->constraint_fingerprints[static_cast<std::size_t>(constraint.id)];
  }

  void AppendVertexLine(const G2oLine& line) {
    const Feature* feature = graph_.FindFeature(line.id);
    if (feature == nullptr) return;
    const auto index = static_cast<std::size_t>(line.id);
    const G2oFile::Fingerprint fingerprint = FingerprintOf(*feature);
    if (fingerprint.element == FingerprintInFile(*feature).element) {
      AppendText(line);
    } else {
      Split(line.text, &fields_);
      const G2oVertexFormat* format = nullptr;
      for (const G2oVertexFormat& other : feature->type->other_g2o_formats) {
        if (other.tag == fields_[0]) format = &other;
      }
      // The extra fields as they stand there.
      const std::size_t extra =
          format == nullptr ? 0 : format->extra_fields.size();
      ExtraText extra_text;
      if (extra > 0) {
        const char* begin = fields_[fields_.size() - extra].begin();
        extra_text = ExtraText(
            begin, static_cast<std::size_t>(fields_.back().end() - begin));
      }
      AppendVertex(*feature, format, file_ids_[feature->id], extra_text,
                   &text_);
      EndLine();
    }
    if (feature->fixed && !file_->was_fixed[index]) {
      AppendFix(file_ids_[feature->id], &text_);
      EndLine();
    }
    if (!feature_has_attributes_[index] &&
        fingerprint.attributes != FingerprintInFile(*feature).attributes) {
      AppendAttributeLine(*feature);
    }
  }

  void AppendFixLine(const G2oLine& line) {
    if (feature_of_id_.empty()) {
      for (std::size_t id = 0; id < file_->file_ids.size(); ++id) {
        if (file_->file_ids[id] != kNoId) {
          feature_of_id_[file_->file_ids[id]] = static_cast<FeatureId>(id);
        }
      }
    }
    Split(line.text, &fields_);
    std::string kept;
    bool is_changed = false;
    for (std::size_t i = 1; i < fields_.size(); ++i) {
      std::int64_t file_id = 0;
      ParseNumber(fields_[i], &file_id);
      const auto found = feature_of_id_.find(file_id);
      // Vertices with unknown tags stay fixed.
      bool is_fixed = true;
      if (found != feature_of_id_.end()) {
        const Feature* feature = graph_.FindFeature(found->second);
        is_fixed = feature != nullptr && feature->fixed;
      }
      if (is_fixed) {
        kept += ' ';
        kept += fields_[i];
      } else {
        is_changed = true;
      }
    }
    if (!is_changed) {
      AppendText(line);
    } else if (!kept.empty()) {
      text_ += kFixTag + kept;
      EndLine();
    }
  }

  void AppendEdgeLine(const G2oLine& line) {
    const Constraint* constraint = graph_.FindConstraint(line.id);
    if (constraint == nullptr) return;
    const G2oFile::Fingerprint fingerprint =
        FingerprintOf(*constraint, file_ids_);
    if (fingerprint.element == FingerprintInFile(*constraint).element) {
      AppendText(line);
    } else {
      Split(line.text, &fields_);
      const G2oEdgeFormat* format = nullptr;
      for (const G2oEdgeFormat& other : constraint->type->other_g2o_formats) {
        if (other.tag == fields_[0]) format = &other;
      }
      AppendEdge(*constraint, format, Options(), file_ids_, &text_);
      EndLine();
    }
    if (!constraint_has_attributes_[static_cast<std::size_t>(line.id)] &&
        fingerprint.attributes != FingerprintInFile(*constraint).attributes) {
      AppendAttributeLine(*constraint);
    }
  }

  const Graph& graph_;
  const G2oFile* file_;
  std::vector<std::int64_t> file_ids_;
  std::vector<bool> feature_has_attributes_;
  std::vector<bool> constraint_has_attributes_;
  std::unordered_map<std::int64_t, FeatureId> feature_of_id_;
  std::vector<std::string_view> fields_;
  std::string text_;
};

}  // namespace

G2oFile ReadG2o(std::istream& input, const std::string& name,
                const Registry& registry, Graph* graph,
                const G2oOptions& options) {
  return ReadG2oFile(input, name, registry, options, graph);
}

void WriteG2o(const Graph& graph, const G2oFile* file, std::ostream& output) {
  const std::string text = Writer(graph, file).Write();
  output.write(text.data(), static_cast<std::streamsize>(text.size()));
}

}  // namespace plumbline
