#ifndef PLUMBLINE_FRONTEND_MAP_WITHOUT_STRUCTURE_H_
#define PLUMBLINE_FRONTEND_MAP_WITHOUT_STRUCTURE_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/rigid_motion.h>
#include <plumbline/factors/pose2.h>

#include <map>
#include <vector>

namespace plumbline {

/// A map as it would be without structure.
struct MapWithoutStructure {
  /// Where the features of the map with structure lie, by their ids; those that
  /// no counterpart was found for are not there.
  std::map<FeatureId, Feature> features;
  /// One pose per scan (map frame).
  std::vector<Pose2> path;
  /// Empty because somebody said that it was time to stop.
  bool interrupted = false;
};

/// The map moved rigidly. Throws Error as Moved of a feature does.
MapWithoutStructure Moved(const Pose2& by, MapWithoutStructure map);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MAP_WITHOUT_STRUCTURE_H_
