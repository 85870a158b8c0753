#ifndef PLUMBLINE_PIPELINE_BENT_MAP_H_
#define PLUMBLINE_PIPELINE_BENT_MAP_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>

#include <vector>

namespace plumbline {

/// Poses of the records by refined odometry alone: the first of `keys`, which
/// has one for each, and what follows from their motions, in its frame.
std::vector<Pose2> PosesByMotions(const std::vector<KeyScanRecord>& records,
                                  const std::vector<Pose2>& keys);

/// Whether the poses of a map turn otherwise than refined odometry (or than
/// poses adjusted by scans alone) on a quarter of the ways of 10 m, by more
/// than 3 degrees: over such a way refined odometry is good to a degree or
/// less, so what was taken for one wall was many, as in a round corridor. Each
/// of `map` belongs to the one of `odometry` at its place; their frames may
/// differ. A way shorter than 10 m bends nothing.
bool IsBent(const std::vector<Pose2>& map, const std::vector<Pose2>& odometry);

/// Whether they turn otherwise than refined odometry by more than 3 degrees
/// over any way of 10 m: matches of scans with a place beside the right one, as
/// all places of a round corridor look alike, put one such kink into a map that
/// is right everywhere else. Poses adjusted by scans alone are up to 2.9
/// degrees off refined odometry on real logs. Arguments as above.
bool HasKink(const std::vector<Pose2>& map, const std::vector<Pose2>& odometry);

/// Whether poses that were adjusted together with walls turn otherwise than the
/// same poses adjusted by scans alone, at the median by more than 0.45 degrees
/// over ways of 30 m, or by more than 0.6 over 60 m: a corridor that bends by a
/// little everywhere, which straight walls have drawn straight. Each of them
/// fits such a bend to a centimetre, and matches of scans that are nearer to
/// each other than the walls are long do not tell, so no residual shows it.
bool AreBentByWalls(const std::vector<Pose2>& with_walls,
                    const std::vector<Pose2>& by_scans);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_BENT_MAP_H_
