#ifndef PLUMBLINE_DETECTORS_DIRECTION_FOUNDER_H_
#define PLUMBLINE_DETECTORS_DIRECTION_FOUNDER_H_

#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_ties.h>

#include <cstddef>
#include <optional>
#include <vector>

namespace plumbline {

/// The wall that a new direction is best founded on: among those that
/// contradict all directions there are (`is_rejected`, by wall), the one with
/// the greatest length of rejected walls that agree with it, along it or
/// across. They have to be min_support walls of min_support_length, and more
/// than so many walls in random directions would have by chance
/// (DirectionAssignmentOptions::significance). Walls that were tried before
/// (`is_refused`, by wall) found none, but speak for others. The network must
/// be solved. The longest kEnoughFounders walls are tried, and shorter ones
/// until one founds a direction when none of these does. Cost: rejected walls,
/// times those that are tried.
std::optional<std::size_t> FindFounder(
    const DirectionTies& ties, const std::vector<DirectionWall>& walls,
    const std::vector<bool>& is_rejected, const std::vector<bool>& is_refused,
    const DirectionAssignmentOptions& options);

/// Walls among which FindFounder chooses, and those that it tries at most where
/// each of them stands alone: what bounds its cost in a map of many thousands.
constexpr std::size_t kEnoughFounders = 12;
constexpr std::size_t kMostFounders = 1000;

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_DIRECTION_FOUNDER_H_
