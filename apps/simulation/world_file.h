#ifndef PLUMBLINE_APPS_SIMULATION_WORLD_FILE_H_
#define PLUMBLINE_APPS_SIMULATION_WORLD_FILE_H_

#include <plumbline/apps/simulation/world.h>

#include <istream>
#include <ostream>
#include <string>

namespace plumbline {

/// Reads the text format of world files. `name` is what errors call the file.
/// A line is empty, a comment from `#` on, or one of (m, degrees)
///
///     wall x1 y1 x2 y2 [thickness]      centre line; thickness 0 if not given
///     door x y width                    gap in the walls that pass through x y
///     doorway x1 y1 x2 y2 [thickness]   gap that is there already: its jambs
///     opening x1 y1 x2 y2 [thickness]   the same where a corridor ends
///     circle x y radius                 round column
///     arc x y radius begin_deg end_deg  curved wall, counter-clockwise
///     box x y length width angle_deg    furniture, clutter
///     path x1 y1 [x2 y2 ...]            way points; lines add up
///
/// Doors apply to all walls of the file wherever they stand. Throws Error with
/// the line on anything else, and on a door that meets no wall.
World ReadWorld(std::istream& input, const std::string& name);

/// Writes the format of ReadWorld, with doors as doorways between walls and 6
/// digits after the point.
void WriteWorld(const World& world, std::ostream& output);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_WORLD_FILE_H_
