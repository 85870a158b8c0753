#ifndef PLUMBLINE_FRONTEND_PART_EVIDENCE_H_
#define PLUMBLINE_FRONTEND_PART_EVIDENCE_H_

#include <plumbline/frontend/track_search.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// How key scans of two parts of a track, as they lie to each other, agree on
/// what is solid and what is free: one of either for each 1.2 m of its way that
/// has key scans of the other around it, by the defaults of MapCheckOptions.
struct PartEvidence {
  int agreeing = 0;
  int contradicting = 0;

  void Add(const PartEvidence& other) {
    agreeing += other.agreeing;
    contradicting += other.contradicting;
  }
  /// Share of those compared that contradict; 0 where too few do to be no
  /// chance.
  double Doubt() const;
};

/// Of these key scans of `search`, indices ascending; the poses of both are in
/// one frame. Nothing is compared once the search was stopped.
PartEvidence CompareParts(const TrackSearch& search,
                          const std::vector<std::size_t>& a,
                          const std::vector<std::size_t>& b);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_PART_EVIDENCE_H_
