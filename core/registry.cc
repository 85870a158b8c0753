#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <cctype>
#include <utility>

namespace plumbline {
namespace {

// Levenshtein's edit distance: insertions, deletions and substitutions.
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] != b[j - 1] ? 1 : 0);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

template <typename T>
using ByName = std::map<std::string, std::unique_ptr<T>>;

template <typename T>
std::string NamesNearestFirst(const ByName<T>& types, const std::string& name) {
  if (types.empty()) return "one that is registered, and none is";
  std::vector<std::pair<std::size_t, std::string>> names;
  for (const auto& entry : types) {
    names.emplace_back(EditDistance(name, entry.first), entry.first);
  }
  std::sort(names.begin(), names.end());
  std::string list;
  for (const auto& entry : names) {
    if (!list.empty()) list += ", ";
    list += entry.second;
  }
  return "one of " + list;
}

template <typename T>
const T* Find(const ByName<T>& types, const std::string& name) {
  const auto it = types.find(name);
  return it == types.end() ? nullptr : it->second.get();
}

template <typename T>
const T& Get(const ByName<T>& types, const std::string& name,
             const std::string& kind) {
  const T* type = Find(types, name);
  if (type == nullptr) {
    throw PLUMBLINE_ERROR("unknown " + kind + " '" + name + "'",
                          NamesNearestFirst(types, name));
  }
  return *type;
}

template <typename T>
std::vector<const T*> All(const ByName<T>& types) {
  std::vector<const T*> all;
  all.reserve(types.size());
  for (const auto& entry : types) all.push_back(entry.second.get());
  return all;
}

// Names and tags are single words: they stand in flags and in g2o text.
void CheckWord(const std::string& word, const std::string& what) {
  const bool has_space =
      std::any_of(word.begin(), word.end(),
                  [](unsigned char c) { return std::isspace(c); });
  if (word.empty() || has_space) {
    throw PLUMBLINE_ERROR("bad " + what + " '" + word + "'",
                          "a word without white space");
  }
}

void Check(bool holds, const std::string& what_is_wrong,
           const std::string& expected) {
  if (!holds) throw PLUMBLINE_ERROR(what_is_wrong, expected);
}

template <typename T>
const T& Add(ByName<T>* types, T type, const std::string& kind) {
  CheckWord(type.name, kind + " name");
  Check(types->count(type.name) == 0,
        kind + " '" + type.name + "' is registered already",
        "a name that is not taken");
  auto owned = std::make_unique<T>(std::move(type));
  const T& reference = *owned;
  types->emplace(reference.name, std::move(owned));
  return reference;
}

}  // namespace

namespace {

// All tags of a feature type or relation.
template <typename T>
std::vector<std::string> TagsOf(const T& type) {
  std::vector<std::string> tags = {type.g2o_tag};
  for (const auto& format : type.other_g2o_formats) tags.push_back(format.tag);
  return tags;
}

template <typename T>
bool HasTag(const T& type, const std::string& tag) {
  return type.g2o_tag == tag ||
         std::any_of(type.other_g2o_formats.begin(),
                     type.other_g2o_formats.end(),
                     [&tag](const auto& format) { return format.tag == tag; });
}

// True for an order of 0 to size - 1, or none.
bool IsOrderOf(std::vector<int> places, std::size_t size) {
  if (places.empty()) return true;
  std::sort(places.begin(), places.end());
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i] != static_cast<int>(i)) return false;
  }
  return places.size() == size;
}

// True for every entry of an upper triangle once, or none.
bool IsTriangle(std::vector<std::pair<int, int>> entries, int size) {
  if (entries.empty()) return true;
  std::sort(entries.begin(), entries.end());
  std::size_t i = 0;
  for (int row = 0; row < size; ++row) {
    for (int column = row; column < size; ++column, ++i) {
      if (i >= entries.size() || entries[i] != std::make_pair(row, column)) {
        return false;
      }
    }
  }
  return i == entries.size();
}

}  // namespace

Registry& Registry::Global() {
  static Registry registry;
  return registry;
}

void Registry::CheckTags(std::vector<std::string> tags) const {
  for (const std::string& tag : tags) {
    CheckWord(tag, "g2o tag");
    Check(FindFeatureByTag(tag) == nullptr && FindRelationByTag(tag) == nullptr,
          "g2o tag '" + tag + "' is registered already",
          "a tag that is not taken");
  }
  std::sort(tags.begin(), tags.end());
  const auto twice = std::adjacent_find(tags.begin(), tags.end());
  Check(twice == tags.end(),
        "g2o tag '" + (twice == tags.end() ? "" : *twice) + "' is given twice",
        "each format with a tag of its own");
}

const FeatureType& Registry::Register(FeatureType type) {
  CheckTags(TagsOf(type));
  Check(type.size >= 1 && type.size <= kMaxFeatureSize,
        "feature type '" + type.name + "' has " + std::to_string(type.size) +
            " parameters",
        "1 to " + std::to_string(kMaxFeatureSize));
  Check(type.parameter_names.size() == static_cast<std::size_t>(type.size),
        "feature type '" + type.name + "' names " +
            std::to_string(type.parameter_names.size()) + " parameters",
        std::to_string(type.size));
  return Add(&features_, std::move(type), "feature type");
}

const RelationType& Registry::Register(RelationType type) {
  CheckTags(TagsOf(type));
  Check(type.residual_size >= 1,
        "relation '" + type.name + "' has " +
            std::to_string(type.residual_size) + " rows",
        "at least 1");
  Check(!type.feature_types.empty() &&
            std::none_of(type.feature_types.begin(), type.feature_types.end(),
                         [](const auto& names) { return names.empty(); }),
        "relation '" + type.name + "' does not say what it relates",
        "the names of the feature types that fit, for each feature");
  for (const G2oEdgeFormat& format : type.other_g2o_formats) {
    Check(IsOrderOf(format.feature_places, type.feature_types.size()) &&
              IsOrderOf(format.row_places,
                        static_cast<std::size_t>(type.residual_size)) &&
              IsTriangle(format.information_order, type.residual_size),
          "the order of fields of g2o tag '" + format.tag + "' does not fit",
          "every feature, row and entry of the upper triangle once");
  }
  Check(type.make_cost != nullptr,
        "relation '" + type.name + "' makes no cost function", "make_cost");
  return Add(&relations_, std::move(type), "relation");
}

const LossType& Registry::Register(LossType type) {
  Check(type.make_loss != nullptr, "loss '" + type.name + "' makes nothing",
        "make_loss");
  return Add(&losses_, std::move(type), "loss");
}

const DetectorType& Registry::Register(DetectorType type) {
  Check(type.make != nullptr, "detector '" + type.name + "' makes nothing",
        "make");
  return Add(&detectors_, std::move(type), "detector");
}

const FeatureType* Registry::FindFeature(const std::string& name) const {
  return Find(features_, name);
}
const RelationType* Registry::FindRelation(const std::string& name) const {
  return Find(relations_, name);
}
const LossType* Registry::FindLoss(const std::string& name) const {
  return Find(losses_, name);
}
const DetectorType* Registry::FindDetector(const std::string& name) const {
  return Find(detectors_, name);
}

const FeatureType& Registry::GetFeature(const std::string& name) const {
  return Get(features_, name, "feature type");
}
const RelationType& Registry::GetRelation(const std::string& name) const {
  return Get(relations_, name, "relation");
}
const LossType& Registry::GetLoss(const std::string& name) const {
  return Get(losses_, name, "loss");
}
const DetectorType& Registry::GetDetector(const std::string& name) const {
  return Get(detectors_, name, "detector");
}

const FeatureType* Registry::FindFeatureByTag(const std::string& tag) const {
  for (const auto& entry : features_) {
    if (HasTag(*entry.second, tag)) return entry.second.get();
  }
  return nullptr;
}

const RelationType* Registry::FindRelationByTag(const std::string& tag) const {
  for (const auto& entry : relations_) {
    if (HasTag(*entry.second, tag)) return entry.second.get();
  }
  return nullptr;
}

std::vector<const FeatureType*> Registry::features() const {
  return All(features_);
}
std::vector<const RelationType*> Registry::relations() const {
  return All(relations_);
}
std::vector<const LossType*> Registry::losses() const { return All(losses_); }
std::vector<const DetectorType*> Registry::detectors() const {
  return All(detectors_);
}

}  // namespace plumbline
