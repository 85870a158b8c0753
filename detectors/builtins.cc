#include <plumbline/core/builtins.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/center_cluster.h>
#include <plumbline/detectors/circle_ransac.h>
#include <plumbline/detectors/corridor.h>
#include <plumbline/detectors/line_ransac.h>
#include <plumbline/detectors/orientation_mixture.h>
#include <plumbline/detectors/orientation_relation.h>
#include <plumbline/detectors/rectangle.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/detectors/visibility.h>
#include <plumbline/detectors/wall_thickness.h>

#include <utility>

namespace plumbline {

void RegisterBuiltinDetectors(Registry* registry) {
  for (DetectorType type :
       {CenterClusterType(), CircleCenterType(), CircleRansacType(),
        CorridorType(), LineRansacType(), OrientationMixtureType(),
        OrientationRelationType(), RectangleType(), SameWallType(),
        VisibilityType(), WallThicknessType()}) {
    if (registry->FindDetector(type.name) == nullptr) {
      registry->Register(std::move(type));
    }
  }
}

void RegisterBuiltins(Registry* registry) {
  RegisterBuiltinRelations(registry);
  RegisterBuiltinDetectors(registry);
}

}  // namespace plumbline
