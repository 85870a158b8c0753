#include <plumbline/core/g2o_lines.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/number_text.h>

#include <algorithm>
#include <ostream>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

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
      SplitG2oLine(line.text, &fields);
      if (fields.size() > 1 && ParseNumber(fields[1], &id) &&
          id <= kLargestG2oId) {
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

// The one of a type's formats that has the tag; null when it is its own.
template <typename Format>
const Format* FormatOf(const std::vector<Format>& formats,
                       std::string_view tag) {
  const auto format =
      std::find_if(formats.begin(), formats.end(),
                   [tag](const Format& other) { return other.tag == tag; });
  return format == formats.end() ? nullptr : &*format;
}

// The first field of a line that has one.
std::string_view TagOf(std::string_view line) {
  constexpr char kBlanks[] = " \t\r\v\f";
  const std::size_t begin = line.find_first_not_of(kBlanks);
  return line.substr(begin, line.find_first_of(kBlanks, begin) - begin);
}

class Writer {
 public:
  Writer(const Graph& graph, const G2oFile* file)
      : graph_(graph), file_(file), file_ids_(FileIds(graph, file)) {}

  std::string Write() {
    if (file_ != nullptr) {
      // Numbers that have changed have more digits than before.
      text_.reserve(file_->text == nullptr ? 0 : file_->text->size() * 3 / 2);
      MarkAttributes();
      AppendNamedVertices();
      for (const G2oLine& line : file_->lines) AppendLine(line);
      if (!file_->ends_with_line_feed && !text_.empty()) text_.pop_back();
    }
    const bool is_open = !text_.empty() && text_.back() != '\n';
    const std::size_t end = text_.size();
    for (const Feature* feature : graph_.Features()) {
      if (IsOfFile(*feature)) continue;
      AppendG2oVertex(*feature, nullptr, file_ids_[feature->id], {}, &text_);
      EndLine();
      if (feature->fixed) {
        AppendG2oFix(file_ids_[feature->id], &text_);
        EndLine();
      }
      if (!IsPlainG2o(*feature)) AppendAttributeLine(*feature);
    }
    for (const Constraint* constraint : graph_.Constraints()) {
      if (IsOfFile(*constraint)) continue;
      AppendG2oEdge(*constraint, nullptr, Options(), file_ids_, &text_);
      EndLine();
      if (!IsPlainG2o(*constraint)) AppendAttributeLine(*constraint);
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
      const G2oFile::Fingerprint now = G2oFingerprintOf(*feature);
      const G2oFile::Fingerprint& before = FingerprintInFile(*feature);
      has_changed = has_changed || now.element != before.element ||
                    now.attributes != before.attributes;
    }
    if (!has_changed) return;
    for (const FeatureId id : file_->named_by_edges) {
      const Feature* feature = graph_.FindFeature(id);
      if (feature == nullptr) continue;
      AppendG2oVertex(*feature, nullptr, file_ids_[id], {}, &text_);
      EndLine();
      if (feature->fixed && !file_->was_fixed[static_cast<std::size_t>(id)]) {
        AppendG2oFix(file_ids_[id], &text_);
        EndLine();
      }
      if (!IsPlainG2o(*feature)) AppendAttributeLine(*feature);
    }
  }

  void EndLine() { text_ += '\n'; }

  void AppendAttributeLine(const Feature& feature) {
    AppendG2oAttributes(feature, file_ids_[feature.id], &text_);
    EndLine();
  }
  void AppendAttributeLine(const Constraint& constraint) {
    AppendG2oAttributes(constraint, &text_);
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
        if (G2oFingerprintOf(*feature).attributes ==
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
        if (G2oFingerprintOf(*constraint, file_ids_).attributes ==
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
    const G2oFile::Fingerprint fingerprint = G2oFingerprintOf(*feature);
    if (fingerprint.element == FingerprintInFile(*feature).element) {
      AppendText(line);
    } else {
      const G2oVertexFormat* format =
          FormatOf(feature->type->other_g2o_formats, TagOf(line.text));
      // The extra fields as they stand there.
      const std::size_t extra =
          format == nullptr ? 0 : format->extra_fields.size();
      std::string_view extra_text;
      if (extra > 0) {
        SplitG2oLine(line.text, &fields_);
        const char* begin = fields_[fields_.size() - extra].begin();
        extra_text = std::string_view(
            begin, static_cast<std::size_t>(fields_.back().end() - begin));
      }
      AppendG2oVertex(*feature, format, file_ids_[feature->id], extra_text,
                      &text_);
      EndLine();
    }
    if (feature->fixed && !file_->was_fixed[index]) {
      AppendG2oFix(file_ids_[feature->id], &text_);
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
    SplitG2oLine(line.text, &fields_);
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
      text_ += kG2oFixTag + kept;
      EndLine();
    }
  }

  void AppendEdgeLine(const G2oLine& line) {
    const Constraint* constraint = graph_.FindConstraint(line.id);
    if (constraint == nullptr) return;
    const G2oFile::Fingerprint fingerprint =
        G2oFingerprintOf(*constraint, file_ids_);
    if (fingerprint.element == FingerprintInFile(*constraint).element) {
      AppendText(line);
    } else {
      const G2oEdgeFormat* format =
          FormatOf(constraint->type->other_g2o_formats, TagOf(line.text));
      AppendG2oEdge(*constraint, format, Options(), file_ids_, &text_);
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

void WriteG2o(const Graph& graph, const G2oFile* file, std::ostream& output) {
  const std::string text = Writer(graph, file).Write();
  output.write(text.data(), static_cast<std::streamsize>(text.size()));
}

}  // namespace plumbline
