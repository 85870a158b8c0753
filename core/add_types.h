#ifndef PLUMBLINE_CORE_ADD_TYPES_H_
#define PLUMBLINE_CORE_ADD_TYPES_H_

#include <ceres/autodiff_cost_function.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace plumbline {
namespace internal {

// What of the optional members a struct has.
template <typename, typename = void>
struct HasFrame : std::false_type {};
template <typename T>
struct HasFrame<T, std::void_t<decltype(&T::Frame)>> : std::true_type {};
template <typename, typename = void>
struct HasAlong : std::false_type {};
template <typename T>
struct HasAlong<T, std::void_t<decltype(&T::Along)>> : std::true_type {};
template <typename, typename = void>
struct HasPlaceSecond : std::false_type {};
template <typename T>
struct HasPlaceSecond<T, std::void_t<decltype(&T::PlaceSecond)>>
    : std::true_type {};

// A place of a relation: the kinds of block that fit there.
template <typename BlockType>
struct Place {
  static constexpr int kAnchorSize = BlockType::kAnchorSize;
  static constexpr std::array<int, 1> kSizes = {kBlockSize<BlockType>};
  static std::vector<std::string> Names() { return {BlockType::kName}; }
};
template <typename First, typename... Others>
struct Place<AnyOf<First, Others...>> {
  static_assert(((Others::kAnchorSize == First::kAnchorSize) && ...),
                "kinds that fit in one place have anchors of one size");
  static constexpr int kAnchorSize = First::kAnchorSize;
  static constexpr std::array<int, 1 + sizeof...(Others)> kSizes = {
      kBlockSize<First>, kBlockSize<Others>...};
  static std::vector<std::string> Names() {
    return {First::kName, Others::kName...};
  }
};

// The anchor of a feature as an argument of a functor, nothing when its type
// has none.
template <typename PlaceType>
auto AnchorArgument(const Feature& feature) {
  constexpr int kSize = PlaceType::kAnchorSize;
  if constexpr (kSize > 0) {
    return std::make_tuple(Eigen::Matrix<double, kSize, 1>(
        Eigen::Map<const Eigen::Matrix<double, kSize, 1>>(
            feature.anchor.data())));
  } else {
    return std::make_tuple();
  }
}

// Numbers as an argument of a functor: one as it is, more as a vector or matrix
// of fixed size.
template <int kRows, int kColumns>
auto NumbersArgument(const Eigen::Ref<const Eigen::MatrixXd>& numbers) {
  if constexpr (kRows == 1 && kColumns == 1) {
    return numbers(0, 0);
  } else {
    return Eigen::Matrix<double, kRows, kColumns>(numbers);
  }
}

template <typename Relation, typename BlockListType>
class CostMaker;

// Makes the cost functions of a relation.
template <typename Relation, typename... Places>
class CostMaker<Relation, BlockList<Places...>> {
 public:
  static constexpr int kRows = static_cast<int>(std::size(Relation::kRows));
  static constexpr std::size_t kArity = sizeof...(Places);

  static std::vector<std::vector<std::string>> FeatureTypes() {
    return {Place<Places>::Names()...};
  }

  static std::unique_ptr<ceres::CostFunction> Make(const RelationArguments& a) {
    if (a.features.size() != kArity || a.expected.size() != kRows ||
        a.sqrt_information.rows() != kRows ||
        a.sqrt_information.cols() != kRows) {
      throw PLUMBLINE_ERROR(
          std::string("arguments do not fit ") + Relation::kName,
          std::to_string(kArity) + " features and " + std::to_string(kRows) +
              " rows");
    }
    return MakeOfSizes(a, std::index_sequence<>());
  }

 private:
  // The first of the sizes of the next place that is that of the feature, and
  // so on for the places after it.
  template <std::size_t... kSizes>
  static std::unique_ptr<ceres::CostFunction> MakeOfSizes(
      const RelationArguments& a, std::index_sequence<kSizes...>) {
    constexpr std::size_t kNext = sizeof...(kSizes);
    if constexpr (kNext == kArity) {
      return MakeFunctor<static_cast<int>(kSizes)...>(
          a, std::index_sequence_for<Places...>());
    } else {
      using Next = Place<std::tuple_element_t<kNext, std::tuple<Places...>>>;
      return TrySizes<Next, 0, kSizes...>(a);
    }
  }

  template <typename Next, std::size_t kChoice, std::size_t... kSizes>
  static std::unique_ptr<ceres::CostFunction> TrySizes(
      const RelationArguments& a) {
    constexpr std::size_t kNext = sizeof...(kSizes);
    const int size = a.features[kNext]->type->size;
    if constexpr (kChoice == Next::kSizes.size()) {
      throw PLUMBLINE_ERROR("feature " + std::to_string(kNext + 1) + " of " +
                                Relation::kName + " has " +
                                std::to_string(size) + " parameters",
                            "the size of a type that fits there");
    } else {
      constexpr int kSize = Next::kSizes[kChoice];
      if (size == kSize) {
        return MakeOfSizes(a, std::index_sequence<kSizes..., kSize>());
      }
      return TrySizes<Next, kChoice + 1, kSizes...>(a);
    }
  }

  template <int... kSizes, std::size_t... kIndices>
  static std::unique_ptr<ceres::CostFunction> MakeFunctor(
      const RelationArguments& a, std::index_sequence<kIndices...>) {
    auto relation = MakeRelation(
        NumbersArgument<kRows, 1>(a.expected),
        std::tuple_cat(AnchorArgument<Place<Places>>(*a.features[kIndices])...),
        NumbersArgument<kRows, kRows>(a.sqrt_information));
    if constexpr (std::is_base_of_v<ceres::CostFunction, Relation>) {
      return relation;
    } else {
      return std::make_unique<
          ceres::AutoDiffCostFunction<Relation, kRows, kSizes...>>(
          relation.release());
    }
  }

  // With the anchors if the functor takes them; it need not depend on them.
  template <typename Expected, typename... Anchors, typename SqrtInformation>
  static std::unique_ptr<Relation> MakeRelation(
      const Expected& expected, const std::tuple<Anchors...>& anchors,
      const SqrtInformation& sqrt_information) {
    if constexpr (std::is_constructible_v<Relation, Expected, Anchors...,
                                          SqrtInformation>) {
      return std::apply(
          [&](const Anchors&... anchor) {
            return std::make_unique<Relation>(expected, anchor...,
                                              sqrt_information);
          },
          anchors);
    } else {
      return std::make_unique<Relation>(expected, sqrt_information);
    }
  }
};

}  // namespace internal

/// The feature type that a struct describes (factors/blocks.h). Beyond what
/// DescribedBlock lists, it may have
///
///   static Eigen::Vector3d Frame(const double* parameters,
///                                const double* anchor);
///     FeatureType::frame, where the parameters do not begin with it
///   static double Along(const double* parameters, const double* anchor,
///                       const double* point);
///     where a point (x, y) lies along something straight, m: when it is made
///     by a detector, its visible part ends with the points, poses and circles
///     (by their centres) that carry it; carried by none, it keeps its extent
template <typename BlockType>
FeatureType DescribeFeature() {
  FeatureType type;
  type.name = BlockType::kName;
  type.g2o_tag = BlockType::kG2oTag;
  type.description = BlockType::kDescription;
  type.parameters.assign(std::begin(BlockType::kParameters),
                         std::end(BlockType::kParameters));
  type.traits = BlockType::kTraits;
  type.anchor_size = BlockType::kAnchorSize;
  if constexpr (!std::is_void_v<typename BlockType::Manifold>) {
    type.make_manifold = []() -> std::unique_ptr<ceres::Manifold> {
      return std::make_unique<typename BlockType::Manifold>();
    };
  }
  if constexpr (internal::HasFrame<BlockType>::value) {
    type.frame = [](const Feature& feature) {
      return BlockType::Frame(feature.data(), feature.anchor.data());
    };
  }
  if constexpr (internal::HasAlong<BlockType>::value) {
    type.update_extent = [](const std::vector<const Feature*>& support,
                            Feature* feature) {
      double begin = std::numeric_limits<double>::infinity();
      double end = -begin;
      for (const Feature* point : support) {
        if (!point->type->Is(FeatureRole::kPoint) &&
            !point->type->Is(FeatureRole::kPose) &&
            !point->type->Is(FeatureRole::kCircle)) {
          continue;
        }
        const double along = BlockType::Along(
            feature->data(), feature->anchor.data(), point->data());
        if (!std::isfinite(along)) continue;
        begin = std::min(begin, along);
        end = std::max(end, along);
      }
      if (begin > end) return;
      feature->extent_begin = begin;
      feature->extent_end = end;
    };
  }
  return type;
}

/// Registers the feature type that a struct describes, with further formats in
/// g2o text. Throws Error as Registry::Register does.
template <typename BlockType>
const FeatureType& AddFeature(
    Registry* registry, std::vector<G2oVertexFormat> other_g2o_formats = {}) {
  FeatureType type = DescribeFeature<BlockType>();
  type.other_g2o_formats = std::move(other_g2o_formats);
  return registry->Register(std::move(type));
}

/// The relation that a functor describes. The functor has
///
///   static constexpr char kName[], kG2oTag[], kDescription[]
///     name in files and flags, tag of the edge in g2o text, formula with
///     units and source in one or two lines
///   static constexpr RelationRole kRole
///     what it says, for those that look it up; else RelationRole::kOther
///   static constexpr Quantity kRows[]
///     the rows of the residual before whitening
///   using Blocks = BlockList<...>
///     what it takes, in the order of operator()'s arguments
///   a constructor from the expected value, the anchor of each block that has
///     one (none of them when it depends on none), and the square root of the
///     information: vectors and matrices of fixed size, or double when there is
///     one row
///   operator() templated on the scalar (Ceres differentiates it); or the
///     functor is a ceres::CostFunction, with derivatives of its own
///
/// and, where the expected value tells all of the second block given the first,
///
///   static void PlaceSecond(const double* expected, const double* first,
///                           const double* second_anchor, double* second)
///     which sets the second so that the residual is zero
template <typename Relation>
RelationType DescribeRelation() {
  using Maker = internal::CostMaker<Relation, typename Relation::Blocks>;
  RelationType type;
  type.name = Relation::kName;
  type.g2o_tag = Relation::kG2oTag;
  type.description = Relation::kDescription;
  type.role = Relation::kRole;
  type.rows.assign(std::begin(Relation::kRows), std::end(Relation::kRows));
  type.feature_types = Maker::FeatureTypes();
  type.make_cost = &Maker::Make;
  if constexpr (internal::HasPlaceSecond<Relation>::value) {
    type.place_second = [](const Eigen::VectorXd& expected,
                           const Feature& first, Feature* second) {
      Relation::PlaceSecond(expected.data(), first.data(),
                            second->anchor.data(), second->data());
    };
  }
  return type;
}

/// Registers the relation that a functor describes, with further formats in g2o
/// text. Throws Error as Registry::Register does.
template <typename Relation>
const RelationType& AddRelation(
    Registry* registry, std::vector<G2oEdgeFormat> other_g2o_formats = {}) {
  RelationType type = DescribeRelation<Relation>();
  type.other_g2o_formats = std::move(other_g2o_formats);
  return registry->Register(std::move(type));
}

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_ADD_TYPES_H_
