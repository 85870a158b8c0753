#ifndef PLUMBLINE_OUTPUTS_FLOOR_PLAN_SVG_H_
#define PLUMBLINE_OUTPUTS_FLOOR_PLAN_SVG_H_

#include <plumbline/outputs/floor_plan.h>

#include <ostream>
#include <string>

namespace plumbline {

/// Writes a plan as SVG to scale: an A3 sheet (user unit: 1 mm of paper), at
/// the largest customary scale (1 : 20 to 1 : 500 000) at which the plan fits,
/// turned so that the direction with most wall is level, with overall
/// dimensions, a scale bar and the scale in words. Printed without fitting it
/// to the page, lengths can be taken off with a ruler. The group "plan" has
/// coordinates in metres of the map, a group per direction (FloorPlanLayerName)
/// in it, and faces carry the ids of their features.
void WriteFloorPlanSvg(const FloorPlan& plan, std::ostream& output);

/// Writes it to a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteFloorPlanSvg(const FloorPlan& plan, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_FLOOR_PLAN_SVG_H_
