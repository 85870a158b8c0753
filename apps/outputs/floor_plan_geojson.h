#ifndef PLUMBLINE_OUTPUTS_FLOOR_PLAN_GEOJSON_H_
#define PLUMBLINE_OUTPUTS_FLOOR_PLAN_GEOJSON_H_

#include <plumbline/outputs/floor_plan.h>

#include <ostream>
#include <string>

namespace plumbline {

/// Writes a plan as a GeoJSON FeatureCollection: LineString a wall (layer,
/// direction_deg, length_m, features), Polygon what stands between two faces
/// (layer), Point a round thing (layer, radius_m).
///
/// Coordinates are metres of the map, while RFC 7946 wants degrees on the
/// globe: the member "coordinate_reference" says so ("type": "local"), and a
/// program that does not look there will put the building into the Gulf of
/// Guinea.
void WriteFloorPlanGeoJson(const FloorPlan& plan, std::ostream& output);

/// The same into a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteFloorPlanGeoJson(const FloorPlan& plan, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_FLOOR_PLAN_GEOJSON_H_
