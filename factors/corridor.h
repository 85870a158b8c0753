#ifndef PLUMBLINE_FACTORS_CORRIDOR_H_
#define PLUMBLINE_FACTORS_CORRIDOR_H_

#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Corridors (d, alpha, half_width), in m, rad, m.
class CorridorManifold final : public WrappedAngleManifold<3, 1> {};

/// A corridor by its axis, a directed line relative to an anchor (see
/// PointLineDistance), and half the distance of its two sides.
struct CorridorBlock : DescribedBlock {
  static constexpr char kName[] = "corridor";
  static constexpr char kG2oTag[] = "PLUMBLINE_CORRIDOR";
  static constexpr char kDescription[] =
      "Corridor: signed distance of its axis from its anchor, direction, half "
      "its width";
  static constexpr Quantity kParameters[] = {Quantity::Length("d"),
                                             Quantity::Angle("alpha"),
                                             Quantity::Length("half_width")};
  static constexpr int kAnchorSize = 2;
  using Manifold = CorridorManifold;

  /// The foot point of the anchor on the axis and the axis' direction:
  /// (x, y, theta), m and rad, in the map frame. `corridor`: (d, alpha, ...).
  static Eigen::Vector3d Frame(const double* corridor, const double* anchor) {
    return LineBlock::Frame(corridor, anchor);
  }
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_CORRIDOR_H_
