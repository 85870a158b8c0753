#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <set>
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

// `size` is what the caller thinks, 0 for nothing.
void CheckQuantities(const std::string& who, const std::string& field,
                     const std::vector<Quantity>& quantities, int size) {
  Check(!quantities.empty(), who + " has no " + field,
        field + ": the name and unit of each");
  Check(size == 0 || static_cast<std::size_t>(size) == quantities.size(),
        who + " describes " + std::to_string(quantities.size()) + " " + field +
            " of " + std::to_string(size),
        field + " to describe all");
  for (const Quantity& quantity : quantities) {
    Check(!quantity.name.empty(), who + " has " + field + " without a name",
          "a name for each");
  }
}

// What a role says that parameters begin with.
Leading LeadingOf(FeatureRole role) {
  switch (role) {
    case FeatureRole::kPoint:
    case FeatureRole::kCircle:
      return Leading::kPosition;
    case FeatureRole::kPose:
    case FeatureRole::kRectangle:
      return Leading::kFrame;
    default:
      return Leading::kOther;
  }
}

int LeastSize(FeatureRole role) {
  switch (role) {
    case FeatureRole::kPoint:
      return 2;
    case FeatureRole::kPose:
    case FeatureRole::kCircle:
      return 3;
    case FeatureRole::kRectangle:
      return 5;
    default:
      return 1;
  }
}

int LeastSize(Leading leading) {
  return leading == Leading::kFrame ? 3 : leading == Leading::kPosition ? 2 : 1;
}

}  // namespace

bool RelationType::Accepts(std::size_t place, const FeatureType& type) const {
  if (place >= feature_types.size()) return false;
  const std::vector<std::string>& fitting = feature_types[place];
  return std::find(fitting.begin(), fitting.end(), type.name) != fitting.end();
}

std::string RelationType::AcceptedNames(std::size_t place) const {
  std::string names;
  for (const std::string& name : feature_types.at(place)) {
    names += (names.empty() ? "" : " or ") + name;
  }
  return names;
}

bool DetectorType::Reads(const FeatureType& type) const {
  return std::count(reads.begin(), reads.end(), type.name) > 0;
}

DetectorParameters DetectorType::defaults() const {
  DetectorParameters values;
  for (const DetectorParameter& parameter : parameters) {
    if (!parameter.is_list) values[parameter.name] = parameter.default_value;
  }
  return values;
}

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
  const std::string who = "feature type '" + type.name + "'";
  CheckTags(TagsOf(type));
  CheckQuantities(who, "parameters", type.parameters, type.size);
  type.size = static_cast<int>(type.parameters.size());
  Check(type.size <= kMaxFeatureSize,
        who + " has " + std::to_string(type.size) + " parameters",
        "1 to " + std::to_string(kMaxFeatureSize));
  Check(type.anchor_size >= 0 && type.anchor_size <= kMaxAnchorSize,
        who + " has an anchor_size of " + std::to_string(type.anchor_size),
        "0 to " + std::to_string(kMaxAnchorSize));
  const Leading leading = LeadingOf(type.traits.role);
  Check(leading == Leading::kOther || type.traits.leading == leading,
        who + " has a role that its parameters do not fit",
        leading == Leading::kFrame ? "traits.leading to be Leading::kFrame"
                                   : "traits.leading to be Leading::kPosition");
  const int least_size =
      std::max(LeastSize(type.traits.role), LeastSize(type.traits.leading));
  Check(type.size >= least_size,
        who + " has " + std::to_string(type.size) +
            " parameters, too few for its traits",
        "at least " + std::to_string(least_size));
  if (type.frame == nullptr && type.traits.leading == Leading::kFrame) {
    type.frame = [](const Feature& feature) {
      return Eigen::Vector3d(feature.data());
    };
  }
  Check(type.frame != nullptr || !type.Is(FeatureRole::kWall),
        who + " is a wall and has no frame", "frame");
  return features_.Add(std::move(type));
}

const RelationType& Registry::Register(RelationType type) {
  const std::string who = "relation '" + type.name + "'";
  CheckTags(TagsOf(type));
  CheckQuantities(who, "rows", type.rows, type.residual_size);
  type.residual_size = static_cast<int>(type.rows.size());
  Check(!type.feature_types.empty() &&
            std::none_of(type.feature_types.begin(), type.feature_types.end(),
                         [](const auto& names) { return names.empty(); }),
        who + " does not say what it relates",
        "feature_types: the names of those that fit, for each feature");
  Check(!type.Is(RelationRole::kPose) || type.residual_size == 3,
        who + " has the role kPose and " + std::to_string(type.residual_size) +
            " rows",
        "3: x, y, theta");
  Check(!type.Is(RelationRole::kPosition) ||
            (type.residual_size == 2 && type.feature_types.size() == 2),
        who + " has the role kPosition and other rows or features",
        "2 rows, x and y, and 2 features");
  Check(type.place_second == nullptr || type.feature_types.size() == 2,
        who + " has place_second and " +
            std::to_string(type.feature_types.size()) + " features",
        "2");
  for (const G2oEdgeFormat& format : type.other_g2o_formats) {
    Check(IsOrderOf(format.feature_places, type.feature_types.size()) &&
              IsOrderOf(format.row_places,
                        static_cast<std::size_t>(type.residual_size)) &&
              IsTriangle(format.information_order, type.residual_size),
          "the order of fields of g2o tag '" + format.tag + "' does not fit",
          "every feature, row and entry of the upper triangle once");
  }
  Check(type.make_cost != nullptr, who + " makes no cost function",
        "make_cost");
  return relations_.Add(std::move(type));
}

const LossType& Registry::Register(LossType type) {
  Check(type.make_loss != nullptr, "loss '" + type.name + "' makes nothing",
        "make_loss");
  return losses_.Add(std::move(type));
}

const DetectorType& Registry::Register(DetectorType type) {
  const std::string who = "detector '" + type.name + "'";
  Check(type.make != nullptr, who + " makes nothing", "make");
  Check(!type.reads.empty(), who + " does not say what it reads",
        "reads: the names of the feature types that it looks at");
  std::set<std::string> names;
  for (const DetectorParameter& parameter : type.parameters) {
    internal::CheckNewName("parameter", parameter.name,
                           !names.insert(parameter.name).second);
  }
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

const RelationType* Registry::FindRelation(RelationRole role,
                                           const FeatureType& first,
                                           const FeatureType& second) const {
  return relations_.FindIf([&](const RelationType& type) {
    return type.Is(role) && type.feature_types.size() == 2 &&
           type.Accepts(0, first) && type.Accepts(1, second);
  });
}

const RelationType& Registry::GetRelation(RelationRole role,
                                          const FeatureType& first,
                                          const FeatureType& second) const {
  const RelationType* type = FindRelation(role, first, second);
  if (type != nullptr) return *type;
  std::string known;
  for (const RelationType* relation : relations()) {
    if (!relation->Is(role)) continue;
    known += (known.empty() ? "" : ", ") + relation->name;
  }
  throw PLUMBLINE_ERROR("no relation says this of features of the types " +
                            first.name + " and " + second.name,
                        known.empty() ? "one with this role to be registered"
                                      : "what one of these relates: " + known);
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
