#ifndef PLUMBLINE_OUTPUTS_FLOOR_PLAN_DXF_H_
#define PLUMBLINE_OUTPUTS_FLOOR_PLAN_DXF_H_

#include <plumbline/outputs/floor_plan.h>

#include <ostream>
#include <string>

namespace plumbline {

/// Writes a plan as a DXF drawing (ASCII, AutoCAD 2000: the oldest version that
/// carries units) in metres, map frame: walls as LINE on one layer per
/// direction (FloorPlanLayerName), what stands between two faces as SOLID on
/// WALL-SOLID, round things as CIRCLE on COLUMNS, the robot's way as LWPOLYLINE
/// on ROBOT-PATH, which is frozen. The same plan gives the same bytes.
///
/// A plan with rooms has them as closed LWPOLYLINE with their number and area
/// as TEXT on ROOMS, walls as closed LWPOLYLINE on WALLS, doors as LINE and ARC
/// on DOORS, and length and width of each room as DIMENSION on DIMENSIONS; the
/// faces that the map has are frozen then.
///
/// Debian's DXF library would do, but is under the GPL, which the binaries
/// would inherit; the tests read the drawing with it.
void WriteFloorPlanDxf(const FloorPlan& plan, std::ostream& output);

/// Writes it to a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteFloorPlanDxf(const FloorPlan& plan, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_FLOOR_PLAN_DXF_H_
