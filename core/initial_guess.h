#ifndef PLUMBLINE_CORE_INITIAL_GUESS_H_
#define PLUMBLINE_CORE_INITIAL_GUESS_H_

#include <plumbline/core/graph.h>

#include <cstdint>

namespace plumbline {

/// Sources of the poses that a graph starts from.
enum class InitialGuessMethod {
  /// Everything stays as it is.
  kFile,
  /// Poses one from the other in the order of ids: the path that odometry alone
  /// tells. Where no relation binds neighbours, the relation that spans the
  /// fewest poses does (Prim's tree).
  kOdometry,
  /// Every pose along the way from the start of its part on which the least
  /// variance of heading adds up (Dijkstra's tree).
  kSpanningTree,
  /// Two sparse linear least-squares problems: headings as points of the plane
  /// in place of the unit circle, from relative headings alone, then positions
  /// at these headings (Carlone et al. 2015, "Initialization techniques for 3D
  /// SLAM"). Where landmarks close the loops, headings and positions are also
  /// solved for together, and the start with the lower objective is taken.
  /// The method needs no start of its own and takes all closures into account
  /// at once.
  kChordal,
};

/// Options of MakeInitialGuess.
struct InitialGuessOptions {
  InitialGuessMethod method = InitialGuessMethod::kChordal;
};

/// Figures of a start.
struct InitialGuessReport {
  /// Connected parts with poses.
  int parts = 0;
  /// Features that were given a place, fixed ones not counted.
  std::int64_t poses = 0;
  std::int64_t landmarks = 0;
  /// Raw features that are not fixed and stayed as they were because no
  /// relation tells their place.
  std::int64_t kept = 0;
};

/// Sets the parameters of raw features from live measurements alone. Poses (and
/// segments) come from relations with RelationRole::kPose, as the method says;
/// landmarks seen as positions (RelationRole::kPosition) from the mean of where
/// they are seen, or with kChordal from the linear solve; what else
/// RelationType::place_second can place from the first relation, in the order
/// of ids, whose other feature has a place. The two roles are those of the
/// plane, and so are the methods: in space place_second alone is used.
///
/// Fixed features stay. In a connected part without any, the pose with the
/// lowest id that has a prior is put there; without a prior the pose with the
/// lowest id stays, as the file has it. Parameters that no measurement speaks
/// of and virtual features stay as they are; angles come out in (-pi, pi].
/// Costs sparse factorizations of the size of the graph at most. Throws Error
/// when numbers overflow; the graph is as it was then.
InitialGuessReport MakeInitialGuess(const InitialGuessOptions& options,
                                    Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_INITIAL_GUESS_H_
