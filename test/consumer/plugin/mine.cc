#include <plumbline/core/add_types.h>
#include <plumbline/core/plugin.h>

#include "columns_writer.h"
#include "equal_radius.h"
#include "equal_radius_detector.h"
#include "ranges_reader.h"

//! [plugin]
PLUMBLINE_PLUGIN(registry) {
  plumbline::AddRelation<mine::EqualRadius>(registry);
  registry->Register(mine::EqualRadiusDetectorType());
  registry->Register(mine::RangesReaderType());
  registry->Register(mine::ColumnsWriterType());
}
//! [plugin]
