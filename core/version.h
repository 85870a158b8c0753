#ifndef PLUMBLINE_CORE_VERSION_H_
#define PLUMBLINE_CORE_VERSION_H_

namespace plumbline {

/// Version of the project, from the top-level CMakeLists.txt.
extern const char* const kVersion;

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_VERSION_H_
