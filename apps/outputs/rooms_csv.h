#ifndef PLUMBLINE_OUTPUTS_ROOMS_CSV_H_
#define PLUMBLINE_OUTPUTS_ROOMS_CSV_H_

#include <plumbline/plan/building_plan.h>

#include <ostream>
#include <string>

namespace plumbline {

/// Writes a table of rooms with a line of names above it:
///
///     room          number, from 1, the same as in floorplan.geojson
///     kind          room or corridor
///     area_m2
///     x_m, y_m      a point well inside of it, map frame
///     entered       1 when the robot was in it
///     doors         how many lead out of it
///     neighbors     rooms behind doors, separated by blanks
void WriteRoomsCsv(const BuildingPlan& plan, std::ostream& output);

/// The same into a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteRoomsCsv(const BuildingPlan& plan, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_ROOMS_CSV_H_
