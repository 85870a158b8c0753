#ifndef PLUMBLINE_APPS_EVALUATION_CLOSURE_TRUTH_H_
#define PLUMBLINE_APPS_EVALUATION_CLOSURE_TRUTH_H_

#include <plumbline/apps/evaluation/map_evaluation.h>
#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/factors/pose2.h>

#include <cstdint>
#include <utility>
#include <vector>

namespace plumbline {

/// Faces that look the same way and lie this close in depth are one wall to a
/// person, m: doors stand a few centimetres behind their walls.
constexpr double kSameWallOffset = 0.1;

/// Closures of a map against the truth.
struct ClosureEvaluation {
  /// Live closures that join two segments of one face of a true wall ...
  int right = 0;
  /// ... of faces side by side that lie no farther apart than kSameWallOffset,
  /// as a shut door and the wall that it is in ...
  int near = 0;
  /// ... and of faces that are not one wall.
  int wrong = 0;
  /// Broken ones, likewise; those of near faces count as right.
  int broken_right = 0;
  int broken_wrong = 0;
  /// Ids of the segments that the wrong live ones join.
  std::vector<std::pair<std::int64_t, std::int64_t>> wrong_pairs;
  /// Where n segments of at least the minimum length lie side by side on one
  /// face, it was visited again n - 1 times.
  int revisits = 0;
  /// How many of these ended as one wall, also by way of other segments.
  int closed_revisits = 0;
};

/// Compares the closures of a map, moved by `alignment`, with the truth. A
/// segment belongs to the face that most of it lies on, within the options'
/// offset and direction: of the faces that look its way (the room is on the
/// left of a segment, and on the right of a true wall) the nearest, of others
/// only where there is none; of a door and its wall, the one that has more of
/// it. Faces in line are one face: doors cut walls into
/// pieces. A segment that lies on nothing makes its closures wrong.
ClosureEvaluation EvaluateClosures(
    const StraightMap& map, const MapTruth& truth, const Pose2& alignment,
    const MapTruthOptions& options = MapTruthOptions());

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_CLOSURE_TRUTH_H_
