#ifndef PLUMBLINE_CORE_REGISTRY_H_
#define PLUMBLINE_CORE_REGISTRY_H_

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <plumbline/core/constraint.h>
#include <plumbline/core/feature.h>
#include <plumbline/core/named_types.h>
#include <plumbline/factors/quantity.h>
#include <plumbline/factors/roles.h>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

class StructureDetector;  // core/detector.h

/// Named numbers handed to a detector (flags, structure priors). Unknown names
/// are refused by the detector's factory with an Error.
using DetectorParameters = std::map<std::string, double>;

/// Another way to write a feature in g2o text, for files that use it.
struct G2oVertexFormat {
  std::string tag;
  /// Names of numbers that follow the parameters; kept as they are.
  std::vector<std::string> extra_fields;
  /// They are ids of vertices, -1 for none.
  bool extra_fields_are_ids = false;
  /// Turns the numbers of the file into parameters, and back, in place; null
  /// when they are the same.
  std::function<void(double* numbers)> read;
  std::function<void(double* parameters)> write;
  /// Called when all vertices are there, with the features that the ids among
  /// the extra fields name (null where there is none); may set attributes
  /// (extent). Null when the fields say nothing.
  std::function<void(const std::vector<const Feature*>& named,
                     Feature* feature)>
      read_extra;
};

/// Another way to write a relation in g2o text, for files that use it.
struct G2oEdgeFormat {
  std::string tag;
  /// For each feature its place among the ids of the line; empty: in order.
  std::vector<int> feature_places;
  /// For each row its place among the values of the line, and in the
  /// information matrix; empty: in order.
  std::vector<int> row_places;
  /// Rows and columns (places in the line's order of values, row <= column) of
  /// the entries of the information, as they follow each other; empty: the
  /// upper triangle by rows.
  std::vector<std::pair<int, int>> information_order;
  /// Turns the values of the file (already in the order of rows) into the
  /// expected value, and back, in place; null when they are the same.
  std::function<void(double* values)> read;
  std::function<void(double* expected)> write;
};

/// A kind of node. AddFeature (core/add_types.h) makes one of a struct that
/// describes itself.
struct FeatureType {
  static constexpr char kKind[] = "feature type";
  static constexpr char kTitle[] = "Feature types";

  /// Name in files and flags: "segment".
  std::string name;
  /// The parameters, in order, 1 to kMaxFeatureSize of them.
  std::vector<Quantity> parameters;
  /// How many there are; set by Registry::Register.
  int size = 0;
  /// Its role, and the parameters that its own begin with.
  FeatureTraits traits;
  /// Number of coordinates of Feature::anchor that the parameters refer to.
  int anchor_size = 0;
  /// Tag of the vertex in g2o text; a tag of our own starts with PLUMBLINE_.
  std::string g2o_tag;
  std::vector<G2oVertexFormat> other_g2o_formats;
  std::string description;
  /// Makes the manifold on which the parameters live; null when they are
  /// Euclidean. One instance may serve every block of the type.
  std::function<std::unique_ptr<ceres::Manifold>()> make_manifold;
  /// Recomputes where the visible part of a virtual feature begins and ends
  /// (Feature::extent_*) from the features of lower levels that live structure
  /// constraints tie to it. Called after solves, which move both. Null when the
  /// type has no such part.
  std::function<void(const std::vector<const Feature*>& support,
                     Feature* feature)>
      update_extent;
  /// The frame of a feature in the plane: x, y (m), theta (rad), in the map
  /// frame. That of a wall lies on it, with x along it, and the extents count
  /// from there. Register sets it for types whose parameters begin with it;
  /// null when the type has none. Walls have to have one.
  std::function<Eigen::Vector3d(const Feature& feature)> frame;

  /// Whether features of the type stand for this.
  bool Is(FeatureRole role) const { return traits.role == role; }
  /// Number of coordinates of an anchor in files: two where it has fewer.
  int written_anchor_size() const { return anchor_size > 2 ? anchor_size : 2; }
  /// Whether the parameters begin with a position of the plane (x, y).
  bool HasPosition() const { return traits.leading != Leading::kOther; }
};

/// Arguments of a relation's factory.
struct RelationArguments {
  /// Expected value u.
  Eigen::VectorXd expected;
  /// Square root of the information: r = sqrt_information * (f(x) (-) u).
  Eigen::MatrixXd sqrt_information;
  /// The features in the constraint's order: types (block sizes) and anchors.
  /// Parameters must not be copied from here.
  std::vector<const Feature*> features;
};

/// A kind of edge. AddRelation (core/add_types.h) makes one of a functor that
/// describes itself.
struct RelationType {
  static constexpr char kKind[] = "relation";
  static constexpr char kTitle[] = "Relations";

  /// Name in files and flags: "segment_orientation".
  std::string name;
  /// Tag of the edge in g2o text.
  std::string g2o_tag;
  std::vector<G2oEdgeFormat> other_g2o_formats;
  /// For each feature in order the names of the types that fit there.
  std::vector<std::vector<std::string>> feature_types;
  /// Rows of the residual before whitening, which are also those of `expected`
  /// and of the information.
  std::vector<Quantity> rows;
  /// How many there are; set by Registry::Register.
  int residual_size = 0;
  RelationRole role = RelationRole::kOther;
  /// Formula, units and source in one or two lines.
  std::string description;
  /// Makes the cost function; throws Error when the arguments do not fit.
  std::function<std::unique_ptr<ceres::CostFunction>(const RelationArguments&)>
      make_cost;
  /// For a relation of two features whose expected value tells all of the
  /// second, given the first: sets the second's parameters so that the residual
  /// is zero. Null for every other relation.
  std::function<void(const Eigen::VectorXd& expected, const Feature& first,
                     Feature* second)>
      place_second;

  /// Whether the relation has this role.
  bool Is(RelationRole asked) const { return role == asked; }
  /// Whether a feature of the type fits in a place, from 0.
  bool Accepts(std::size_t place, const FeatureType& type) const;
  /// What fits there, for messages: "point or pose".
  std::string AcceptedNames(std::size_t place) const;
};

/// A weighting of structure constraints, by the name used in --delta_mode.
struct LossType {
  static constexpr char kKind[] = "loss";
  static constexpr char kTitle[] = "Losses (--delta_mode)";

  std::string name;
  std::string description;
  /// Makes the loss of one structure constraint. `delta` points at the
  /// constraint's frozen weight and outlives the loss; `degrees_of_freedom` is
  /// the rank of its information. Null means no loss.
  std::function<std::unique_ptr<ceres::LossFunction>(const double* delta,
                                                     int degrees_of_freedom)>
      make_loss;
};

/// A numeric parameter of a detector.
struct DetectorParameter {
  /// "sigma_deg".
  std::string name;
  double default_value = 0.0;
  /// "m", "deg"; empty for a pure number.
  std::string unit = {};
  /// Meaning, in one line.
  std::string description = {};
  /// The name is that of a list, and a number from 0 follows it: "angle_0",
  /// "angle_1", ... Empty by default.
  bool is_list = false;
};

/// A kind of structure detector.
struct DetectorType {
  static constexpr char kKind[] = "detector";
  static constexpr char kTitle[] = "Detectors (--hierarchy)";

  /// Name in --hierarchy: "orientation_mixture".
  std::string name;
  std::string description;
  /// Names of the feature types that it reads, at least one, and of those that
  /// it makes (empty when it proposes constraints only).
  std::vector<std::string> reads;
  std::vector<std::string> makes;
  std::vector<DetectorParameter> parameters;
  /// Makes a detector with these parameters, the others at their defaults.
  /// Throws Error for unknown names and values out of range.
  std::function<std::unique_ptr<StructureDetector>(const DetectorParameters&)>
      make;

  /// The parameters other than lists, at their defaults.
  DetectorParameters defaults() const;
  /// Whether it reads features of the type.
  bool Reads(const FeatureType& type) const;
};

/// The plug-ins by name: the kinds that core works with, and any other that a
/// layer above brings (log readers, output writers), of which core knows only
/// that they have names. One instance per process is the usual thing (Global),
/// but a test or a program may have its own. Not thread safe while registering.
class Registry {
 public:
  Registry() = default;
  Registry(const Registry&) = delete;
  Registry& operator=(const Registry&) = delete;

  /// The registry of the process; empty until something registers.
  static Registry& Global();

  /// Adds a plug-in. Throws Error when the name or tag is empty, has white
  /// space, or is taken, and when a field is missing or does not fit, which it
  /// names. The returned reference is stable.
  const FeatureType& Register(FeatureType type);
  const RelationType& Register(RelationType type);
  const LossType& Register(LossType type);
  const DetectorType& Register(DetectorType type);
  /// The same for a kind of which core knows nothing (see NamedTypes for what
  /// `Type` has to have).
  template <typename Type>
  const Type& Register(Type type) {
    return MutableList<Type>().Add(std::move(type));
  }

  /// Look-ups. Find* return null when there is none; Get* throw an Error that
  /// lists the known names, nearest first.
  const FeatureType* FindFeature(const std::string& name) const;
  const RelationType* FindRelation(const std::string& name) const;
  const LossType* FindLoss(const std::string& name) const;
  const DetectorType* FindDetector(const std::string& name) const;
  const FeatureType& GetFeature(const std::string& name) const;
  const RelationType& GetRelation(const std::string& name) const;
  const LossType& GetLoss(const std::string& name) const;
  const DetectorType& GetDetector(const std::string& name) const;
  /// The same for a kind of which core knows nothing.
  template <typename Type>
  const Type* Find(const std::string& name) const {
    return List<Type>().Find(name);
  }
  /// The same for a kind of which core knows nothing.
  template <typename Type>
  const Type& Get(const std::string& name) const {
    return List<Type>().Get(name);
  }
  /// The relation that says this of features of two types, the first in the
  /// order of names; null when there is none, or an Error.
  const RelationType* FindRelation(RelationRole role, const FeatureType& first,
                                   const FeatureType& second) const;
  const RelationType& GetRelation(RelationRole role, const FeatureType& first,
                                  const FeatureType& second) const;
  /// By g2o tag, that of another format included; null when there is none.
  const FeatureType* FindFeatureByTag(const std::string& tag) const;
  const RelationType* FindRelationByTag(const std::string& tag) const;

  /// Everything, in the order of names.
  std::vector<const FeatureType*> features() const;
  std::vector<const RelationType*> relations() const;
  std::vector<const LossType*> losses() const;
  std::vector<const DetectorType*> detectors() const;

  /// The same for a kind of which core knows nothing.
  template <typename Type>
  std::vector<const Type*> All() const {
    return List<Type>().All();
  }

  /// Every kind for lists: core's own, then the others in the order of their
  /// titles.
  std::vector<const PluginList*> lists() const;

 private:
  /// Throws Error when one of them is not a word, or is taken.
  void CheckTags(std::vector<std::string> tags) const;

  // The list of a kind that is not core's, made when it is missing. Two kinds
  // must not have the same title.
  template <typename Type>
  NamedTypes<Type>& MutableList() {
    std::unique_ptr<PluginList>& list = other_lists_[Type::kTitle];
    if (list == nullptr) list = std::make_unique<NamedTypes<Type>>();
    return dynamic_cast<NamedTypes<Type>&>(*list);
  }
  template <typename Type>
  const NamedTypes<Type>& List() const {
    static const NamedTypes<Type> empty{};
    const auto it = other_lists_.find(Type::kTitle);
    return it == other_lists_.end()
               ? empty
               : dynamic_cast<const NamedTypes<Type>&>(*it->second);
  }

  NamedTypes<FeatureType> features_;
  NamedTypes<RelationType> relations_;
  NamedTypes<LossType> losses_;
  NamedTypes<DetectorType> detectors_;
  std::map<std::string, std::unique_ptr<PluginList>> other_lists_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_REGISTRY_H_
