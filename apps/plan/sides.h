#ifndef PLUMBLINE_PLAN_SIDES_H_
#define PLUMBLINE_PLAN_SIDES_H_

#include <plumbline/plan/arrangement.h>

#include <vector>

namespace plumbline {

/// What lies along a drawn line, for each sample of its profile.
struct Sides {
  /// Where both sides are one: no border.
  static constexpr int kNone = -2;
  /// The number of the room or region on the left, -1 for none of them.
  std::vector<int> left;
  /// The same on the right.
  std::vector<int> right;
};

/// The sides of each drawn line. `room_of_face`: the room or region of each
/// face of the arrangement, -1 for none.
std::vector<Sides> SidesOf(const Arrangement& arrangement,
                           const std::vector<int>& room_of_face,
                           const std::vector<DrawnLine>& drawn);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_SIDES_H_
