#include <plumbline/core/plugin.h>

#include "equal_radius.h"
#include "equal_radius_detector.h"

//! [plugin]
PLUMBLINE_PLUGIN(registry) {
  registry->Register(mine::EqualRadiusType());
  registry->Register(mine::EqualRadiusDetectorType());
}
//! [plugin]
