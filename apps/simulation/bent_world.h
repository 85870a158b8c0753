#ifndef PLUMBLINE_APPS_SIMULATION_BENT_WORLD_H_
#define PLUMBLINE_APPS_SIMULATION_BENT_WORLD_H_

#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/world.h>

#include <cstdint>

namespace plumbline {

/// Two corridors that meet at a small angle: a building that structure, or a
/// wall taken for its neighbour's continuation, bends straight.
struct BentOptions {
  /// Direction of the second corridor against the first, degrees, -60 to 60.
  double bend_deg = 5.0;
  /// Length of each corridor, and width of both, m.
  WorldInterval length{20.0, 24.0};
  WorldInterval width{2.0, 2.4};
  /// Length of a piece between the two at half the angle, m; 0: the corridors
  /// meet in a mitre.
  double joint_length = 0.0;
  /// Niches on both sides of the corridors: distance from one to the next,
  /// width and depth, m. A depth of 0 leaves the walls plain.
  WorldInterval niche_spacing{2.5, 5.0};
  WorldInterval niche_width{1.0, 1.6};
  double niche_depth = 0.0;
};

/// What the length of corridors has to be at least, m.
constexpr double kLeastCorridorLength = 5.0;

/// Options of corridors with niches, joined by a piece of 1.6 m at half the
/// angle.
BentOptions NichesOptions();

/// Builds it; `seed` draws the dimensions. The first corridor runs along x. The
/// path leads from the beginning of the first corridor to the end of the
/// second. Throws Error on options out of range.
World MakeBentWorld(const BentOptions& options, std::uint64_t seed);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_BENT_WORLD_H_
