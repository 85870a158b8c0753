// A plug-in built for an interface that never was: it must not be called.
#include <cstdlib>

namespace plumbline {
class Registry;
}

extern "C" int PlumblinePluginInterfaceVersion() { return 12345; }
extern "C" void PlumblineRegisterPlugin(plumbline::Registry*) { std::abort(); }
