#ifndef PLUMBLINE_OUTPUTS_FLOOR_PLAN_GEOJSON_H_
#define PLUMBLINE_OUTPUTS_FLOOR_PLAN_GEOJSON_H_

#include <plumbline/outputs/floor_plan.h>

#include <ostream>
#include <string>

namespace plumbline {

/// Writes a plan as a GeoJSON FeatureCollection. The property `kind` says what
/// a feature is:
///
///     room, corridor  Polygon: id (from 1), area_m2, entered, neighbors (ids)
///     door            LineString from jamb to jamb: id (from 1), width_m,
///     rooms
///                     (two ids, null for what is no room), driven
///     wall            Polygon: length_m, thickness_m
///     face            LineString, a face of a wall as the map has it: layer,
///                     direction_deg, length_m, features
///     solid           Polygon between two of these faces: layer
///     column          Point: layer, radius_m
///
/// Coordinates are metres of the map, while RFC 7946 wants degrees on the
/// globe: the member "coordinate_reference" says so ("type": "local"), and a
/// program that does not look there will put the building into the Gulf of
/// Guinea.
void WriteFloorPlanGeoJson(const FloorPlan& plan, std::ostream& output);

/// Writes it to a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteFloorPlanGeoJson(const FloorPlan& plan, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_FLOOR_PLAN_GEOJSON_H_
