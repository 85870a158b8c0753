#ifndef PLUMBLINE_CORE_WALL_PAIR_H_
#define PLUMBLINE_CORE_WALL_PAIR_H_

#include <plumbline/core/wall.h>
#include <plumbline/factors/pose2.h>

namespace plumbline {

/// On the first of two walls, with its direction: the middle of the part where
/// the second lies beside it, or of the gap between them.
Pose2 MiddleOfCommonPart(const Wall& first, const Wall& second);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_WALL_PAIR_H_
