#ifndef PLUMBLINE_CORE_PLUGIN_H_
#define PLUMBLINE_CORE_PLUGIN_H_

#include <plumbline/core/registry.h>

#include <string>

namespace plumbline {

/// Version of the plug-in interface: changes whenever core/registry.h,
/// core/detector.h or what they include changes its layout.
constexpr int kPluginInterfaceVersion = 6;

/// What a plug-in's shared object exports, with C linkage, under the names
/// below:
///
///   extern "C" int PlumblinePluginInterfaceVersion();
///   extern "C" void PlumblineRegisterPlugin(plumbline::Registry*);
///
/// PLUMBLINE_PLUGIN(registry) { ... } writes both.
#define PLUMBLINE_PLUGIN(registry_argument)                        \
  extern "C" int PlumblinePluginInterfaceVersion() {               \
    return ::plumbline::kPluginInterfaceVersion;                   \
  }                                                                \
  extern "C" void PlumblineRegisterPlugin(::plumbline::Registry*); \
  extern "C" void PlumblineRegisterPlugin(                         \
      ::plumbline::Registry* registry_argument)

/// Loads a shared object and lets it register. It stays loaded until the
/// process ends. Throws Error when it cannot be opened, exports no plug-in, or
/// was built for another interface version (both versions are named).
void LoadPlugin(const std::string& path, Registry* registry);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_PLUGIN_H_
