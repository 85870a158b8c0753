#include <plumbline/core/g2o_lines.h>
#include <plumbline/core/number_text.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>

namespace plumbline {
namespace {

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

// Hash of numbers and texts, one after the other. Whichever one of them
// changes, the hash does.
class Hash {
 public:
  template <typename Number>
  void Add(Number number) {
    static_assert(std::is_arithmetic_v<Number> || std::is_enum_v<Number>);
    static_assert(sizeof(Number) <= sizeof(std::uint64_t));
    std::uint64_t bits = 0;
    std::memcpy(&bits, &number, sizeof number);
    Mix(bits);
  }
  template <typename Count>
  void Add(const double* numbers, Count count) {
    for (Count i = 0; i < count; ++i) Add(numbers[i]);
  }
  void Add(const std::string& text) {
    Add(text.size());
    for (const char c : text) Add(c);
  }

  // Of what was added since it was last asked for.
  std::size_t Take() { return std::exchange(hash_, kStart); }

 private:
  // Each step can be undone, for any bits.
  void Mix(std::uint64_t bits) {
    constexpr std::uint64_t kOdd = 0x9e3779b97f4a7c15;
    hash_ = (hash_ ^ bits) * kOdd;
    hash_ ^= hash_ >> 32;
  }

  static constexpr std::uint64_t kStart = 0x2545f4914f6cdd1d;

  std::uint64_t hash_ = kStart;
};

}  // namespace

void SplitG2oLine(std::string_view line,
                  std::vector<std::string_view>* fields) {
  const auto is_blank = [](char c) {
    if (static_cast<unsigned char>(c) > ' ') return false;
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
  };
  fields->clear();
  std::size_t begin = 0;
  while (true) {
    while (begin < line.size() && is_blank(line[begin])) ++begin;
    if (begin == line.size()) return;
    std::size_t end = begin + 1;
    while (end < line.size() && !is_blank(line[end])) ++end;
    fields->push_back(line.substr(begin, end - begin));
    begin = end;
  }
}

bool ParseG2oSource(std::string_view text, std::string* source) {
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

void TurnInformation(double angle, Eigen::MatrixXd* information) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  turn(0, 0) = turn(1, 1) = std::cos(angle);
  turn(1, 0) = std::sin(angle);
  turn(0, 1) = -turn(1, 0);
  const Eigen::Matrix3d given = *information;
  const Eigen::Matrix3d turned = turn * given * turn.transpose();
  *information = 0.5 * (turned + turned.transpose());
}

bool IsTurned(const G2oOptions& options, const Constraint& constraint) {
  return options.information_at_second &&
         constraint.type->Is(RelationRole::kPose) &&
         constraint.type->feature_types.size() == 2;
}

void AppendG2oVertex(const Feature& feature, const G2oVertexFormat* format,
                     std::int64_t file_id, std::string_view extra,
                     std::string* text) {
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

void AppendG2oFix(std::int64_t file_id, std::string* text) {
  *text += kG2oFixTag;
  *text += ' ';
  AppendNumber(file_id, text);
}

bool IsPlainG2o(const Feature& feature) {
  return feature.level == 0 && !feature.is_virtual &&
         std::all_of(feature.anchor.begin(), feature.anchor.end(),
                     [](double coordinate) { return coordinate == 0.0; }) &&
         feature.extent_begin == 0.0 && feature.extent_end == 0.0 &&
         feature.observations == 0 && feature.source == kG2oSource;
}

void AppendG2oAttributes(const Feature& feature, std::int64_t file_id,
                         std::string* text) {
  *text += kG2oFeatureTag;
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

void AppendG2oEdge(const Constraint& constraint, const G2oEdgeFormat* format,
                   const G2oOptions& options,
                   const std::vector<std::int64_t>& file_ids,
                   std::string* text) {
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
  ForInformation(format, size, [&](int row, int column) {
    *text += ' ';
    AppendNumber(entries(row, column), text);
  });
}

bool IsPlainG2o(const Constraint& constraint) {
  return constraint.kind == ConstraintClass::kMeasurement &&
         constraint.state == ConstraintState::kLive &&
         constraint.delta == 1.0 && constraint.break_below == 1.0 &&
         constraint.source == kG2oSource;
}

void AppendG2oAttributes(const Constraint& constraint, std::string* text) {
  *text += kG2oConstraintTag;
  *text += constraint.kind == ConstraintClass::kStructure ? " structure"
                                                          : " measurement";
  *text += constraint.state == ConstraintState::kBroken ? " broken " : " live ";
  AppendNumber(constraint.delta, text);
  *text += ' ';
  AppendSource(constraint.source, text);
  if (constraint.break_below == 1.0) return;
  *text += ' ';
  AppendNumber(constraint.break_below, text);
}

G2oFile::Fingerprint G2oFingerprintOf(const Feature& feature) {
  G2oFile::Fingerprint fingerprint;
  Hash hash;
  hash.Add(feature.parameters.data(), feature.type->size);
  fingerprint.element = hash.Take();
  if (IsPlainG2o(feature)) return fingerprint;
  hash.Add(feature.level);
  hash.Add(feature.is_virtual);
  hash.Add(feature.anchor.data(), feature.type->written_anchor_size());
  hash.Add(feature.extent_begin);
  hash.Add(feature.extent_end);
  hash.Add(feature.observations);
  hash.Add(feature.source);
  fingerprint.attributes = hash.Take();
  return fingerprint;
}

G2oFile::Fingerprint G2oFingerprintOf(
    const Constraint& constraint, const std::vector<std::int64_t>& file_ids) {
  G2oFile::Fingerprint fingerprint;
  Hash hash;
  for (const FeatureId id : constraint.features) hash.Add(file_ids[id]);
  hash.Add(constraint.expected.data(), constraint.expected.size());
  hash.Add(constraint.information.data(), constraint.information.size());
  fingerprint.element = hash.Take();
  if (IsPlainG2o(constraint)) return fingerprint;
  hash.Add(constraint.kind);
  hash.Add(constraint.state);
  hash.Add(constraint.delta);
  hash.Add(constraint.source);
  hash.Add(constraint.break_below);
  fingerprint.attributes = hash.Take();
  return fingerprint;
}

}  // namespace plumbline
