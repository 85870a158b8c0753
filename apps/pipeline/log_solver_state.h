#ifndef PLUMBLINE_PIPELINE_LOG_SOLVER_STATE_H_
#define PLUMBLINE_PIPELINE_LOG_SOLVER_STATE_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/frontend/frontend_state.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/loop_closures.h>
#include <plumbline/pipeline/map_state.h>

// What a LogSolver has between two stages, for a StateWriter or StateReader
// (core/state_archive.h), without its map (map_state.h).

namespace plumbline {

template <typename Archive>
void Exchange(Archive& archive, LoopClosure& closure) {
  auto& [scan, place, holds, delta] = closure;
  ExchangeAll(archive, scan, place, holds, delta);
}

template <typename Archive>
void Exchange(Archive& archive, Mirror& mirror) {
  auto& [wall, returns, share] = mirror;
  ExchangeAll(archive, wall.position, wall.angle, wall.direction, wall.begin,
              wall.end, returns, share);
}

template <typename Archive>
void Exchange(Archive& archive, LogSolverResult& result) {
  auto& [trajectory, em, initial_cost, final_cost, frontend_seconds,
         detect_seconds, solve_seconds, relocalization_seconds,
         completion_seconds, adjustment_seconds, glimpsed_walls, scan_relations,
         wall_votes, scan_seconds, key_scans, wide_searches, refused_matches,
         lost_tracks, loose, feature_matches, features_created,
         second_map_refused, loose_walls, interrupted, refined, records,
         mirrors, breaks, range_sigma, noise_scale, odometry_scale,
         odometry_course, notes, closures] = result;
  ExchangeAll(
      archive, trajectory, em, initial_cost, final_cost, frontend_seconds,
      detect_seconds, solve_seconds, relocalization_seconds, completion_seconds,
      adjustment_seconds, glimpsed_walls, scan_relations, wall_votes,
      scan_seconds, key_scans, wide_searches, refused_matches, lost_tracks,
      loose, feature_matches, features_created, second_map_refused, loose_walls,
      interrupted, refined, records, mirrors, breaks, range_sigma, noise_scale,
      odometry_scale, odometry_course, notes, closures);
}

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_LOG_SOLVER_STATE_H_
