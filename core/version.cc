#include <plumbline/core/version.h>

namespace plumbline {

const char* const kVersion = PLUMBLINE_VERSION;

}  // namespace plumbline
