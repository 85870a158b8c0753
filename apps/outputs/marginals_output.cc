#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/number_text.h>
#include <plumbline/outputs/marginals_output.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>

namespace plumbline {
namespace {

// A variance of this size is the prior on what nothing is known of.
constexpr double kLargestVariance = 1e-2 * Marginals::kUndeterminedVariance;

bool HasLiveConstraint(const Graph& graph, FeatureId id) {
  for (const ConstraintId constraint : graph.ConstraintsOf(id)) {
    if (graph.GetConstraint(constraint).state == ConstraintState::kLive) {
      return true;
    }
  }
  return false;
}

// What of the selection has no covariance: types of which nothing was found, in
// the order of their names, and numbers that are not among `ids`, which ascend.
std::vector<std::string> WithoutFeatures(
    const Graph& graph, const MarginalsSelection& selection,
    const std::set<const FeatureType*>& found,
    const std::vector<FeatureId>& ids) {
  std::vector<std::string> missing;
  for (const FeatureType* type : selection.types) {
    if (found.count(type) == 0) {
      missing.push_back("no " + type->name + " that was measured");
    }
  }
  // Pointers have no order that is the same in every run.
  std::sort(missing.begin(), missing.end());
  if (selection.all && ids.empty()) {
    missing.push_back("nothing that was measured");
  }
  for (const FeatureId id : selection.ids) {
    if (std::binary_search(ids.begin(), ids.end(), id)) continue;
    const Feature* feature = graph.FindFeature(id);
    missing.push_back(feature == nullptr
                          ? "no feature " + std::to_string(id)
                          : "no live constraint on " + feature->type->name +
                                " " + std::to_string(id));
  }
  return missing;
}

}  // namespace

MarginalsSelection ParseMarginalsSelection(const std::string& list,
                                           const Registry& registry) {
  MarginalsSelection selection;
  std::istringstream words(list);
  std::string word;
  while (std::getline(words, word, ',')) {
    std::int64_t id = 0;
    if (word.empty() || word == "none") continue;
    if (word == "all") {
      selection.all = true;
    } else if (ParseNumber(word, &id)) {
      selection.ids.insert(id);
    } else if (const FeatureType* type = registry.FindFeature(word)) {
      selection.types.insert(type);
    } else {
      std::string names = "all, none";
      for (const FeatureType* type : registry.features()) {
        names += ", " + type->name;
      }
      throw Error(
          "--marginals", 0, "unknown word '" + word + "'",
          "numbers of features and words separated by commas: " + names);
    }
  }
  return selection;
}

void CheckGauge(const Graph& graph, const MarginalsSelection& selection) {
  if (selection.empty()) return;
  const auto size = static_cast<std::size_t>(graph.feature_id_end());
  DisjointSets parts(size);
  std::vector<bool> is_tied(size, false);
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->state != ConstraintState::kLive) continue;
    const auto first = static_cast<std::size_t>(constraint->features[0]);
    // A relation of one feature refers to the plane itself.
    if (constraint->features.size() == 1) is_tied[first] = true;
    for (const FeatureId id : constraint->features) {
      parts.Join(first, static_cast<std::size_t>(id));
    }
  }
  const std::vector<const Feature*> features = graph.Features();
  std::vector<bool> has_gauge(size, false);
  for (const Feature* feature : features) {
    const auto id = static_cast<std::size_t>(feature->id);
    if (feature->fixed || is_tied[id]) has_gauge[parts.Find(id)] = true;
  }
  for (const Feature* feature : features) {
    const bool is_selected = selection.all ||
                             selection.types.count(feature->type) > 0 ||
                             selection.ids.count(feature->id) > 0;
    if (is_selected && HasLiveConstraint(graph, feature->id) &&
        !has_gauge[parts.Find(static_cast<std::size_t>(feature->id))]) {
      throw Error("--marginals", 0,
                  "the gauge of " + feature->type->name + " " +
                      std::to_string(feature->id) +
                      " is not fixed: nothing ties it, or what it is connected "
                      "with, to the plane",
                  "a FIX line or a prior there, or --marginals_hold_gauge");
    }
  }
}

FeatureCovariances ComputeMarginals(const Graph& graph,
                                    const SolverSession* session,
                                    const MarginalsSelection& selection,
                                    bool hold_gauge,
                                    std::vector<std::string>* missing) {
  FeatureCovariances covariances;
  if (selection.empty()) return covariances;
  std::vector<FeatureId> ids;
  std::set<const FeatureType*> found;
  for (const Feature* feature : graph.Features()) {
    const bool is_selected = selection.all ||
                             selection.types.count(feature->type) > 0 ||
                             selection.ids.count(feature->id) > 0;
    // A fixed feature is known without any constraint.
    const bool is_known =
        HasLiveConstraint(graph, feature->id) ||
        (feature->fixed && selection.ids.count(feature->id) > 0);
    if (!is_selected || !is_known) continue;
    ids.push_back(feature->id);
    found.insert(feature->type);
  }
  *missing = WithoutFeatures(graph, selection, found, ids);
  if (ids.empty()) return covariances;
  MarginalsOptions options;
  options.hold_gauge = hold_gauge;
  Marginals marginals = session == nullptr
                            ? Marginals(graph, options)
                            : Marginals(graph, *session, options);
  marginals.Compute(ids);
  for (const FeatureId id : ids) covariances[id] = marginals.Covariance(id);
  return covariances;
}

std::vector<DrawnEllipse> EllipsesOf(const Graph& graph,
                                     const FeatureCovariances& covariances,
                                     double sigmas) {
  std::vector<DrawnEllipse> ellipses;
  for (const auto& [id, covariance] : covariances) {
    const Feature& feature = graph.GetFeature(id);
    if (!feature.type->HasPosition()) continue;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(
        Eigen::Matrix2d(covariance.topLeftCorner<2, 2>()));
    // Ascending; a fixed feature has none.
    if (!(axes.eigenvalues()[1] > 0.0) ||
        axes.eigenvalues()[1] > kLargestVariance) {
      continue;
    }
    DrawnEllipse ellipse;
    ellipse.x = feature.parameters[0];
    ellipse.y = feature.parameters[1];
    ellipse.major = sigmas * std::sqrt(axes.eigenvalues()[1]);
    ellipse.minor = sigmas * std::sqrt(std::max(axes.eigenvalues()[0], 0.0));
    ellipse.direction =
        std::atan2(axes.eigenvectors()(1, 1), axes.eigenvectors()(0, 1));
    ellipse.id = id;
    ellipses.push_back(ellipse);
  }
  return ellipses;
}

}  // namespace plumbline
