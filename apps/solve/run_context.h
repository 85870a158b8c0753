#ifndef PLUMBLINE_APPS_SOLVE_RUN_CONTEXT_H_
#define PLUMBLINE_APPS_SOLVE_RUN_CONTEXT_H_

#include <plumbline/apps/solve/live_map.h>
#include <plumbline/apps/solve/run_clock.h>
#include <plumbline/core/registry.h>
#include <plumbline/outputs/output_folder.h>

namespace plumbline {

/// What every part of a run needs. All have to outlive the run.
struct RunContext {
  const Registry& registry;
  RunClock* clock;
  LiveMap* live;
  /// That of --output_dir.
  OutputFolder* folder;
};

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_RUN_CONTEXT_H_
