#ifndef PLUMBLINE_FRONTEND_AGREEING_VISITS_H_
#define PLUMBLINE_FRONTEND_AGREEING_VISITS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/track_placement_options.h>

#include <functional>
#include <vector>

namespace plumbline {

/// Bends the way of a robot so that what it saw on different visits to a place
/// agrees. Scans are matched with each other only where they lie within some
/// 0.3 m: after a long way along which nothing was seen twice the poses may be
/// a metre off, and stay so. Here short stretches of the way (windows of
/// options.window_keys key scans) are held against each other visit, where they
/// are and, where they do not agree, within 6 m and 10 degrees; the poses then
/// go where least is bent between them.
///
/// `views`: key scans in the order of the way, map frame; `follows`: for each,
/// whether the way from the one before is known, so that it may not tear.
/// `stop` (may be null) is asked now and then. Returns one pose per view, to
/// begin an adjustment with, or nothing where no stretch agrees better
/// elsewhere or `stop` has returned true. Cost: linear in the views times those
/// near each. The result does not depend on `num_threads`. Throws Error when
/// the numbers of views and `follows` differ.
std::vector<Pose2> PosesOfAgreeingVisits(
    const std::vector<KeyView>& views, const std::vector<bool>& follows,
    const TrackPlacementOptions& options, int num_threads,
    const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_AGREEING_VISITS_H_
