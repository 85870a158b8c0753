#ifndef PLUMBLINE_APPS_EXPERIMENTS_CONCENTRICITY_H_
#define PLUMBLINE_APPS_EXPERIMENTS_CONCENTRICITY_H_

#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

namespace plumbline {

/// How S6 says that circles have one centre.
enum class Concentricity {
  /// Each circle and the next.
  kChain = 1,
  /// The first circle and each other.
  kStar = 2,
  kAllPairs = 3,
  /// A virtual centre and each circle.
  kCommonCenter = 4,
};

/// Adds live coincidence constraints between the circles (level 0) of a graph;
/// `sigma` in m.
void AddConcentricity(Concentricity method, double sigma,
                      const Registry& registry, Graph* graph);

/// What S6 asks of a result.
struct ConcentricityResult {
  /// No live structure constraint is on an outlier.
  bool is_isolated = false;
  /// Live structure constraints connect all other circles.
  bool is_intact = false;
};
ConcentricityResult CheckConcentricity(const Graph& graph,
                                       const SyntheticTruth& truth);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_CONCENTRICITY_H_
