#ifndef PLUMBLINE_TEST_FRONTEND_LONG_HALL_H_
#define PLUMBLINE_TEST_FRONTEND_LONG_HALL_H_

#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/track_search.h>

#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline::testing {

/// A hall in which something else stands every 2 m.
inline std::vector<WallEnds> LongHall() {
  std::vector<WallEnds> walls = Room(40.0, 6.0);
  Noise layout(7);
  for (double x = -18.0; x < 19.0; x += 2.0) {
    const Pose2 place(x + 0.3 * layout.Normal(1.0),
                      layout.Normal(1.0) > 0.0 ? 1.8 : -1.8,
                      0.5 * layout.Normal(1.0));
    for (const WallEnds& side :
         Moved(Room(0.5 + 0.2 * std::abs(layout.Normal(1.0)), 0.8), place)) {
      walls.push_back(side);
    }
  }
  return walls;
}

/// `count` key scans along the hall from `x` on, as part `part`; their poses
/// are off by `shift`. Scans are ten times the number of the key scan.
inline void SeeHall(double x, int count, int part, const Pose2& shift, double y,
                    TrackSearch* search) {
  static const std::vector<WallEnds> hall = LongHall();
  Laser laser = FullCircle();
  laser.angle_step = DegToRad(1.0);
  laser.beams = 360;
  for (int k = 0; k < count; ++k) {
    const Pose2 truth(x + 0.3 * k, y, 0.0);
    search->Add(
        {static_cast<int>(10 * search->seen().size()), Compose(shift, truth),
         PointsOf(MakeScan(hall, truth, laser), ScanPointsOptions()),
         Eigen::Vector2d::Zero()},
        part);
  }
}

}  // namespace plumbline::testing

#endif  // PLUMBLINE_TEST_FRONTEND_LONG_HALL_H_
