#include <plumbline/frontend/scan_sweep.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace plumbline {
namespace {

// Motion that is not worth undoing: m and rad.
constexpr double kStill = 5e-4;
constexpr double kStraight = DegToRad(0.02);

}  // namespace

bool UndoSweep(const std::vector<Pose2>& places, Scan* scan) {
  const bool moved =
      std::any_of(places.begin(), places.end(), [](const Pose2& place) {
        return place.head<2>().norm() > kStill ||
               std::abs(place[2]) > kStraight;
      });
  const std::size_t n = scan->ranges.size();
  if (!moved || n < 2) return false;
  const std::size_t parts = places.size() - 1;
  scan->bearings.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double at =
        static_cast<double>(i * parts) / static_cast<double>(n - 1);
    const std::size_t k = std::min(static_cast<std::size_t>(at), parts - 1);
    const double share = at - static_cast<double>(k);
    const Pose2 place = (1.0 - share) * places[k] + share * places[k + 1];
    const double bearing = scan->start_angle +
                           static_cast<double>(i) * scan->angle_step + place[2];
    const double range = scan->ranges[i];
    if (!(range > 0.0)) {
      scan->bearings[i] = static_cast<float>(bearing);
      continue;
    }
    const double x = place[0] + range * std::cos(bearing);
    const double y = place[1] + range * std::sin(bearing);
    scan->ranges[i] = static_cast<float>(std::hypot(x, y));
    // Near the beam's own direction, whichever turn that is in.
    scan->bearings[i] = static_cast<float>(
        bearing + NormalizeAngle(std::atan2(y, x) - bearing));
  }
  return true;
}

}  // namespace plumbline
