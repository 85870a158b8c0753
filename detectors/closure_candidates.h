#ifndef PLUMBLINE_DETECTORS_CLOSURE_CANDIDATES_H_
#define PLUMBLINE_DETECTORS_CLOSURE_CANDIDATES_H_

#include <plumbline/core/detector.h>
#include <plumbline/detectors/place_match.h>
#include <plumbline/detectors/wall_graph.h>

#include <map>
#include <vector>

namespace plumbline {

/// Two walls that may be one.
struct ClosureCandidate {
  WallPair pair;
  /// Point of the second wall, m along it, at which offset and direction are
  /// independent.
  double along = 0.0;
  /// Half width of the search that found it, m; 0 when the relative place of
  /// the walls was known.
  double search = 0.0;
  /// Against chance: nats, or in a search of width 0 the length, m, over which
  /// the walls lie side by side.
  double evidence = 0.0;
};

/// The candidates that were found, the best for each pair of walls, and the
/// choice of those that are proposed together.
class ClosureCandidates {
 public:
  /// The walls are not owned and must outlive the candidates.
  explicit ClosureCandidates(const WallGraph* walls) : walls_(walls) {}

  /// Adds the candidate that the walls `first` and `second` are one;
  /// `match.along` is along the second. Of two candidates for a pair the one
  /// from the narrower search stays, or with equal widths the one with more
  /// evidence. False when the walls are one already.
  bool Add(int first, int second, const WallMatch& match, double search,
           double evidence);

  /// The half width, m, up to which searches are proposed together: `width`, or
  /// twice that of the narrowest where that is more; infinite without
  /// candidates. Pairs that were broken before do not count.
  double Widest(double width) const;

  /// The candidates of searches up to Widest, the largest evidence first.
  /// Candidates whose walls earlier ones have already made one are left out.
  /// Pairs that were broken before neither hold up wider searches nor make
  /// other candidates redundant. Counts into `scope`.
  std::vector<ClosureCandidate> Choose(double width,
                                       const DetectionScope& scope) const;

 private:
  const WallGraph* walls_;
  std::map<WallPair, ClosureCandidate> candidates_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CLOSURE_CANDIDATES_H_
