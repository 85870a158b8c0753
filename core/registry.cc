#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <utility>

namespace plumbline {
namespace {

void Check(bool holds, const std::string& what_is_wrong,
           const std::string& expected) {
  if (!holds) throw PLUMBLINE_ERROR(what_is_wrong, expected);
}

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
    internal::CheckNewName(
        "g2o tag", tag,
        FindFeatureByTag(tag) != nullptr || FindRelationByTag(tag) != nullptr);
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
  return features_.Add(std::move(type));
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
  return relations_.Add(std::move(type));
}

const LossType& Registry::Register(LossType type) {
  Check(type.make_loss != nullptr, "loss '" + type.name + "' makes nothing",
        "make_loss");
  return losses_.Add(std::move(type));
}

const DetectorType& Registry::Register(DetectorType type) {
  Check(type.make != nullptr, "detector '" + type.name + "' makes nothing",
        "make");
  return detectors_.Add(std::move(type));
}

const FeatureType* Registry::FindFeature(const std::string& name) const {
  return features_.Find(name);
}
const RelationType* Registry::FindRelation(const std::string& name) const {
  return relations_.Find(name);
}
const LossType* Registry::FindLoss(const std::string& name) const {
  return losses_.Find(name);
}
const DetectorType* Registry::FindDetector(const std::string& name) const {
  return detectors_.Find(name);
}

const FeatureType& Registry::GetFeature(const std::string& name) const {
  return features_.Get(name);
}
const RelationType& Registry::GetRelation(const std::string& name) const {
  return relations_.Get(name);
}
const LossType& Registry::GetLoss(const std::string& name) const {
  return losses_.Get(name);
}
const DetectorType& Registry::GetDetector(const std::string& name) const {
  return detectors_.Get(name);
}

const FeatureType* Registry::FindFeatureByTag(const std::string& tag) const {
  return features_.FindIf([&](const auto& type) { return HasTag(type, tag); });
}

const RelationType* Registry::FindRelationByTag(const std::string& tag) const {
  return relations_.FindIf([&](const auto& type) { return HasTag(type, tag); });
}

std::vector<const FeatureType*> Registry::features() const {
  return features_.All();
}
std::vector<const RelationType*> Registry::relations() const {
  return relations_.All();
}
std::vector<const LossType*> Registry::losses() const { return losses_.All(); }
std::vector<const DetectorType*> Registry::detectors() const {
  return detectors_.All();
}

std::vector<const PluginList*> Registry::lists() const {
  std::vector<const PluginList*> lists = {&features_, &relations_, &losses_,
                                          &detectors_};
  for (const auto& entry : other_lists_) lists.push_back(entry.second.get());
  return lists;
}

}  // namespace plumbline
