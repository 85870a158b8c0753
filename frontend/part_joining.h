#ifndef PLUMBLINE_FRONTEND_PART_JOINING_H_
#define PLUMBLINE_FRONTEND_PART_JOINING_H_

#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/match_drift.h>
#include <plumbline/frontend/tie_doubts.h>
#include <plumbline/frontend/track_search.h>
#include <plumbline/frontend/tracking_options.h>

#include <string>
#include <vector>

namespace plumbline {

/// A part of the track that is weakly tied to the rest.
struct LooseTrack {
  /// Last scan before it that is sure, and its own last one, or the first one
  /// that was found again.
  int begin = 0;
  int end = 0;
  std::string why;
  /// It was found again on what had been seen earlier: the tie is one match,
  /// not a guess.
  bool found = false;
  /// It may as well be in another place of the map: that it fits here confirms
  /// nothing.
  bool is_ambiguous = false;
};

/// A way that nothing in sight could be matched on, and nothing speaks against
/// odometry: neither a gap in the log of which it does not tell nor a
/// contradiction or a jump.
struct BlindWay {
  /// The last key scan before it and the first one after it.
  int from = 0;
  int to = 0;
  /// From one to the other by odometry.
  UncertainPose2 motion;
  /// By so much it may have turned wrongly, rad.
  double most_wrong_turn = DegToRad(180.0);

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, BlindWay& way) {
    auto& [from, to, motion, most_wrong_turn] = way;
    ExchangeAll(archive, from, to, motion, most_wrong_turn);
  }
};

/// A tie found once all scans were in, for a part of the track that was settled
/// as loose or by a tie that proved doubtful.
struct LateTie {
  /// First scan of the part.
  int scan = 0;
  /// What RefinedScan::since and since_key of it are now.
  int since = 0;
  UncertainPose2 since_key;
  /// The part's entry among the loose tracks.
  int loose = 0;
};

/// Looks for the parts of a track that hang loose in each other, once all scans
/// are in (core/method.md, section 7, step 0). The largest one takes in others,
/// largest first, until none is found. A part is taken where one of its windows
/// of key scans was found and another one says the same, unless half of what
/// both saw of the same places contradicts it; or where three windows may lie,
/// each with rivals, and what both saw speaks for that place and no other. It
/// does not lie where odometry of a blind way between the two cannot have it.
///
/// `search` has the key scans of all parts; they are moved and renumbered as
/// parts are joined. `loose_of`: by part but the first, its entry in `loose`,
/// which says in the end what was found. `blind`: ways between parts. `cut`: of
/// parts that hang on a doubtful tie and were looked for before it was cut.
/// Another place of theirs must be clearly less doubtful, and the other parts
/// are looked for once more only when there is one. Returns the ties in the
/// order of scans; none, with `loose` as it was, when `search` was stopped.
std::vector<LateTie> JoinParts(const TrackingOptions& tracking,
                               const MatchDrift& drift,
                               const std::vector<int>& loose_of,
                               const std::vector<BlindWay>& blind,
                               TrackSearch* search,
                               std::vector<LooseTrack>* loose,
                               const CutTies& cut = {});

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_PART_JOINING_H_
