#include <plumbline/frontend/map_without_structure.h>

#include <utility>

namespace plumbline {

MapWithoutStructure Moved(const Pose2& by, MapWithoutStructure map) {
  for (auto& [id, feature] : map.features) {
    feature = Moved(by, std::move(feature));
  }
  for (Pose2& pose : map.path) pose = Compose(by, pose);
  return map;
}

}  // namespace plumbline
