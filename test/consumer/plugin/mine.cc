#include <plumbline/core/plugin.h>

#include "columns_writer.h"
#include "equal_radius.h"
#include "equal_radius_detector.h"

//! [plugin]
PLUMBLINE_PLUGIN(registry) {
  registry->Register(mine::EqualRadiusType());
  registry->Register(mine::EqualRadiusDetectorType());
  registry->Register(mine::ColumnsWriterType());
}
//! [plugin]
