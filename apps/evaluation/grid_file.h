#ifndef PLUMBLINE_APPS_EVALUATION_GRID_FILE_H_
#define PLUMBLINE_APPS_EVALUATION_GRID_FILE_H_

#include <plumbline/plan/space_grid.h>

#include <string>

namespace plumbline {

/// Reads a map of ROS's map_server, as plumbline_solve writes it: a YAML file
/// (`image`, `resolution` in m, `origin`, `negate`, `occupied_thresh`,
/// `free_thresh`) and the binary PGM of at most 255 grey levels that it names,
/// beside it. Throws Error that names the file and line, also for an origin
/// that is turned.
SpaceGrid ReadSpaceGrid(const std::string& yaml_path);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_GRID_FILE_H_
