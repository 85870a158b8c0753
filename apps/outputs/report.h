#ifndef PLUMBLINE_OUTPUTS_REPORT_H_
#define PLUMBLINE_OUTPUTS_REPORT_H_

#include <plumbline/core/break_log.h>
#include <plumbline/core/flag_value.h>
#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/map_without_structure.h>
#include <plumbline/outputs/em_trace.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/report_grid.h>
#include <plumbline/outputs/summary.h>
#include <plumbline/plan/building_plan.h>

#include <cstdint>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

namespace plumbline {

/// Content of report.html.
struct Report {
  /// Never null while it is written.
  const Graph* graph = nullptr;
  /// Raw features, and one pose for each of the path; without features there is
  /// no before and after.
  MapWithoutStructure before;
  /// Map frame; what lies nearer than 10 cm to the one before is left out.
  std::vector<Pose2> path;
  /// Null when rooms were not looked for: the section on them is left out.
  const BuildingPlan* building = nullptr;
  std::vector<EmTraceRow> trace;
  Summary summary;
  /// All of them, not only those that were changed.
  std::vector<FlagValue> flags;
  double delta_threshold = 0.0;
  std::string title;
  /// A layer under the walls: what is free and occupied; none where there is no
  /// grid.
  std::optional<ReportGrid> grid;
  /// Those of a first map that another one stands for.
  std::vector<PlacedClosure> closures;
  /// How what is broken was broken, as far as it is known.
  BreakRecords breaks;
  /// Of a run that is still under way: what it is at, and after how many
  /// seconds the page loads itself anew. 0: it stays as it is.
  std::string stage;
  int reload_seconds = 0;
  /// When a page of such a run was written, s since 1970: one that is old says
  /// that the run no longer renews it.
  std::int64_t written_at = 0;
};

/// Writes one page that needs nothing but a browser: the map with and without
/// structure, over the grid and the rooms, what supports each wall, closures,
/// the levels of structure, delta, costs by phase of EM, broken constraints
/// (when, and what they would be now), times, flags. Names and paths are data
/// in it, never markup. The same report gives the same bytes; what differs
/// between two runs of the same input (times, memory, flags) stands on one
/// line, in the element with the id "run".
void WriteReport(const Report& report, std::ostream& output);

/// Writes it to a file, whole or not at all. Throws Error when it cannot be
/// written.
void WriteReport(const Report& report, const std::string& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_REPORT_H_
