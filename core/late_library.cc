#include <dlfcn.h>
#include <plumbline/core/error.h>
#include <plumbline/core/late_library.h>

#include <string>

namespace plumbline {
namespace {

std::string LoaderMessage() {
  const char* const message = dlerror();
  return message != nullptr ? message : "the loader does not say why";
}

}  // namespace

void* LateLibrary::Find(const char* function) {
  void* handle = handle_.load(std::memory_order_acquire);
  if (handle == nullptr) {
    // Threads that come here together get the same handle.
    handle = dlopen(file_, RTLD_LAZY | RTLD_LOCAL);
    if (handle == nullptr) {
      throw PLUMBLINE_ERROR(
          "loading " + std::string(file_) + ": " + LoaderMessage(),
          "the library, installed where the dynamic loader looks");
    }
    handle_.store(handle, std::memory_order_release);
  }
  void* const address = dlsym(handle, function);
  if (address == nullptr) {
    throw PLUMBLINE_ERROR(
        "looking for " + std::string(function) + ": " + LoaderMessage(),
        std::string(file_) + " with this function");
  }
  return address;
}

}  // namespace plumbline
