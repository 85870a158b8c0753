#ifndef PLUMBLINE_DETECTORS_TIE_FORECAST_H_
#define PLUMBLINE_DETECTORS_TIE_FORECAST_H_

#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_ties.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// A tie that could be made: of a wall to a direction, or of two directions.
struct TieCandidate {
  std::size_t wall = 0;
  /// Direction; of a wall at a right angle to a direction without such a
  /// companion a new one is made.
  std::size_t direction = 0;
  bool is_across = false;
  /// Of two directions, in place of a wall and one.
  bool is_relation = false;
  std::size_t other = 0;
  /// What the network predicts for it.
  DirectionInnovation innovation;
};

/// Ties that could be made at the present state of a network.
struct TieForecast {
  /// Of walls without a direction in their order, then of pairs of directions.
  std::vector<TieCandidate> candidates;
  /// By wall: it contradicts every direction there is of which enough is known.
  /// Where there is none, all do.
  std::vector<bool> is_rejected;
};

/// Predicts every tie that could be made: those within the gate whose direction
/// wins clearly over the others, a quarter turn off them included
/// (AssignDirections). The network must be solved. `innovations`: by wall; that
/// of each wall without a direction becomes the one against the nearest. Cost:
/// walls times directions, and a covariance column for each direction.
TieForecast PredictTies(const DirectionTies& ties,
                        const std::vector<DirectionWall>& walls,
                        const DirectionAssignmentOptions& options,
                        std::vector<DirectionInnovation>* innovations);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_TIE_FORECAST_H_
