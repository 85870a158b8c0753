#include <dlfcn.h>
#include <plumbline/core/error.h>
#include <plumbline/core/plugin.h>

#include <filesystem>

namespace plumbline {
namespace {

std::string LoaderMessage() {
  const char* message = dlerror();
  return message != nullptr ? message : "no reason given";
}

}  // namespace

void LoadPlugin(const std::string& path, Registry* registry) {
  // The loader searches the system's folders only for a name without a slash;
  // a file of that name here is what the user means.
  std::string file = path;
  std::error_code ignored;
  if (path.find('/') == std::string::npos &&
      std::filesystem::exists(path, ignored)) {
    file = "./" + path;
  }
  // The loader would wait for who writes to a pipe.
  if (std::filesystem::exists(file, ignored) &&
      !std::filesystem::is_regular_file(file, ignored)) {
    throw Error(path, 0, "cannot load plug-in: it is no regular file",
                "a shared object built for this program");
  }
  void* const handle = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    throw plumbline::Error(path, 0, "cannot load plug-in: " + LoaderMessage(),
                           "a shared object built for this program");
  }
  using VersionFunction = int (*)();
  using RegisterFunction = void (*)(Registry*);
  const auto version = reinterpret_cast<VersionFunction>(
      dlsym(handle, "PlumblinePluginInterfaceVersion"));
  const auto register_plugin = reinterpret_cast<RegisterFunction>(
      dlsym(handle, "PlumblineRegisterPlugin"));
  if (version == nullptr || register_plugin == nullptr) {
    dlclose(handle);
    throw plumbline::Error(path, 0, "is not a plug-in of plumbline",
                           "PlumblinePluginInterfaceVersion and "
                           "PlumblineRegisterPlugin (see PLUMBLINE_PLUGIN)");
  }
  const int plugin_version = version();
  if (plugin_version != kPluginInterfaceVersion) {
    dlclose(handle);
    throw plumbline::Error(
        path, 0,
        "was built for plug-in interface version " +
            std::to_string(plugin_version),
        "version " + std::to_string(kPluginInterfaceVersion));
  }
  // Never closed from here on: the registry may hold its functions, also when
  // registering ends early with an exception.
  register_plugin(registry);
}

}  // namespace plumbline
