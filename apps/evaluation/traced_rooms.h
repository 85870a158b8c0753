#ifndef PLUMBLINE_APPS_EVALUATION_TRACED_ROOMS_H_
#define PLUMBLINE_APPS_EVALUATION_TRACED_ROOMS_H_

#include <plumbline/apps/evaluation/plan_evaluation.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/plan/space_grid.h>

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// Rooms of a real building as somebody traced them, in a frame of their own.
struct TracedRooms {
  std::string name;
  /// Side of a pixel, m (> 0), as far as it is known.
  double metres_per_pixel = 0.0;
  int width = 0;
  int height = 0;
  int count = 0;
  /// The room of every pixel, from 1; 0: none. Row by row from the bottom.
  std::vector<std::uint16_t> labels;
};

/// Reads `{"name", "metres_per_pixel", "size": [rows, columns], "rooms":
/// [{"runs": [[row, first, last], ...]}]}`, rows from the top. Throws Error
/// that names the file and the entry that is missing or wrong: runs outside of
/// the picture, rooms without pixels, a pixel of two rooms.
TracedRooms ReadTracedRooms(const std::string& path);
TracedRooms ReadTracedRooms(InputStream* input);

/// Where traced rooms lie in a map.
struct TracedPlacement {
  /// Of the middle of the picture, m, map frame.
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  /// Against the clock, rad.
  double turn = 0.0;
  /// Of metres_per_pixel.
  double scale = 1.0;
  /// Area in common of the rooms and of what was seen free, twice over the sum
  /// of both areas (Dice).
  double overlap = 0.0;
};

/// The placement in which rooms and free space overlap most: any turn (found to
/// half a degree) and place (to 0.1 m), scales from 0.93 to 1.07. Throws Error
/// when nothing was seen free.
TracedPlacement PlaceTracedRooms(const TracedRooms& rooms,
                                 const SpaceGrid& space);

/// A plan against traced rooms.
struct TracedEvaluation {
  TracedPlacement placement;
  /// Rooms traced, those of them that were seen (60 % of them free), and those
  /// found (overlap over union of half and more).
  int traced = 0;
  int seen = 0;
  int found = 0;
  /// Rooms of the plan.
  int drawn = 0;
  /// Mean overlap over union of the rooms seen with the room of the plan that
  /// covers most of them.
  double mean_iou = 0.0;
  /// Share of a room of the plan in its best partner, of what lies in rooms
  /// seen (1 m^2 and more), and share of a room seen in its best partner;
  /// means.
  double precision = 0.0;
  double recall = 0.0;
  /// Rooms of the plan that `precision` is the mean over.
  int judged = 0;
  /// Overlap over union of every traced room, -1 for those not seen.
  std::vector<double> iou;
};

/// Compares the rooms of a plan (map frame) with traced ones, placed over the
/// grid of the same map, on a raster of 0.1 m.
TracedEvaluation EvaluateTracedRooms(const BuildingPlan& plan,
                                     const TracedRooms& rooms,
                                     const SpaceGrid& space);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_TRACED_ROOMS_H_
