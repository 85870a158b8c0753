#ifndef PLUMBLINE_OUTPUTS_MAP_JSON_H_
#define PLUMBLINE_OUTPUTS_MAP_JSON_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/frontend/key_scan_archive.h>
#include <plumbline/plan/building_plan.h>

#include <ostream>
#include <string>

namespace plumbline {

/// Writes what WriteGraphJson writes and, after "features" and "constraints",
/// the rooms and doors of the map's plan:
///
///     "rooms": id (from 1), kind ("room" or "corridor"), area_m2, entered (the
///              robot was in it), outline (inner faces of its walls, against
///              the clock), holes (outlines of what stands in it), neighbors
///              (ids of the rooms that a door leads to), doors (ids)
///     "doors": id (from 1), begin, end (the jambs), width_m, thickness_m (of
///              the wall), rooms (two ids, left and right of begin to end, null
///              for what is no room), driven (the robot drove through it)
///
/// Positions are [x, y], m, map frame; numbers are those of floorplan.geojson
/// and rooms.csv. Without a plan (null) there is neither "rooms" nor "doors";
/// both are empty when rooms were looked for and there are none. ReadGraphJson
/// reads the file and passes over both. Last come the key scans
/// (AppendKeyScans), from which another run goes on; without them (null)
/// they are left out.
void WriteMapJson(const Graph& graph, const FeatureCovariances* covariances,
                  const BuildingPlan* plan, const KeyScanArchive* key_scans,
                  std::ostream& output);

/// Writes it to a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteMapJson(const Graph& graph, const FeatureCovariances* covariances,
                  const BuildingPlan* plan, const KeyScanArchive* key_scans,
                  const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_MAP_JSON_H_
