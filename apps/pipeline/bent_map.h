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

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_BENT_MAP_H_
