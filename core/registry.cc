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

Registry& Registry::Global() {
  static Registry registry;
  return registry;
}

const FeatureType& Registry::Register(FeatureType type) {
  CheckWord(type.g2o_tag, "g2o tag");
  Check(FindFeatureByTag(type.g2o_tag) == nullptr &&
            FindRelationByTag(type.g2o_tag) == nullptr,
        "g2o tag '" + type.g2o_tag + "' is registered already",
        "a tag that is not taken");
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
  CheckWord(type.g2o_tag, "g2o tag");
  Check(FindFeatureByTag(type.g2o_tag) == nullptr &&
            FindRelationByTag(type.g2o_tag) == nullptr,
        "g2o tag '" + type.g2o_tag + "' is registered already",
        "a tag that is not taken");
  Check(type.residual_size >= 1,
        "relation '" + type.name + "' has " +
            std::to_string(type.residual_size) + " rows",
        "at least 1");
  Check(!type.feature_types.empty() &&
            std::none_of(type.feature_types.begin(), type.feature_types.end(),
                         [](const auto& names) { return names.empty(); }),
        "relation '" + type.name + "' does not say what it relates",
        "the names of the feature types that fit, for each feature");
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
    if (entry.second->g2o_tag == tag) return entry.second.get();
  }
  return nullptr;
}

const RelationType* Registry::FindRelationByTag(const std::string& tag) const {
  for (const auto& entry : relations_) {
    if (entry.second->g2o_tag == tag) return entry.second.get();
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
