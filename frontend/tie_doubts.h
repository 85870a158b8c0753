#ifndef PLUMBLINE_FRONTEND_TIE_DOUBTS_H_
#define PLUMBLINE_FRONTEND_TIE_DOUBTS_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/frontend/track_search.h>

#include <map>
#include <vector>

namespace plumbline {

/// A tie of a track by one match with all that had been seen before.
struct FoundTie {
  /// First scan of the track, and the one before it that it hangs on.
  int scan = 0;
  int since = 0;
  /// Its entry among the loose tracks.
  int loose = 0;

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, FoundTie& tie) {
    auto& [scan, since, loose] = tie;
    ExchangeAll(archive, scan, since, loose);
  }
};

/// What was cut (CutDoubtfulTies).
struct CutTies {
  /// Share of what was compared that contradicts each tie, by its entry among
  /// the loose tracks.
  std::map<int, double> doubts;
  /// By part as they are numbered now, its number before. Empty where nothing
  /// was cut.
  std::vector<int> before;
};

/// Cuts ties that much of what was seen speaks against (PartEvidence::Doubt):
/// where the robot was carried, the right place need not be among those that it
/// had seen then, and the next corridor looks like this one. What hung on such
/// a tie is a part by itself, to be looked for once more in all the rest; its
/// poses stay as they were. The most doubtful tie goes first, until none is:
/// what lies wrong contradicts what hangs right as well.
///
/// `search` has all key scans. `loose_of`: by part but the first, its entry
/// among the loose tracks. Parts are renumbered in the order in which they
/// begin. Nothing is cut once `search` was stopped. Cost: linear in the way for
/// each pair of tracks that meet.
CutTies CutDoubtfulTies(std::vector<FoundTie> ties, TrackSearch* search,
                        std::vector<int>* loose_of);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TIE_DOUBTS_H_
