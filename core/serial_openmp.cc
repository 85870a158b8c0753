#include <dlfcn.h>
#include <plumbline/core/serial_openmp.h>

namespace plumbline {
namespace {

thread_local int num_serial = 0;

// The functions of OpenMP, null where no library has brought it along. Where
// regions do not pass by GOMP_parallel below, levels keep them on one thread.
using GetLevels = int (*)();
using SetLevels = void (*)(int);

GetLevels FindGetLevels() {
  static const auto get = reinterpret_cast<GetLevels>(
      dlsym(RTLD_DEFAULT, "omp_get_max_active_levels"));
  return get;
}

SetLevels FindSetLevels() {
  static const auto set = reinterpret_cast<SetLevels>(
      dlsym(RTLD_DEFAULT, "omp_set_max_active_levels"));
  return set;
}

}  // namespace

SerialOpenMp::SerialOpenMp() {
  ++num_serial;
  if (FindGetLevels() == nullptr || FindSetLevels() == nullptr) return;
  old_levels_ = FindGetLevels()();
  FindSetLevels()(0);
}

SerialOpenMp::~SerialOpenMp() {
  --num_serial;
  if (FindGetLevels() == nullptr || FindSetLevels() == nullptr) return;
  FindSetLevels()(old_levels_);
}

bool SerialOpenMp::IsInForce() { return num_serial > 0; }

void* FindOpenMp(const char* function) {
  // Not the one of this name that a program may have of its own.
  if (void* const linked = dlsym(RTLD_NEXT, function)) return linked;
  static void* const library = dlopen("libgomp.so.1", RTLD_LAZY | RTLD_LOCAL);
  return library == nullptr ? nullptr : dlsym(library, function);
}

}  // namespace plumbline

// What GCC makes of `#pragma omp parallel`: run `region` with `data` on
// `num_threads` threads. Outside of any region there is one thread, of number
// 0, to the code within.
extern "C" __attribute__((visibility("default"))) void GOMP_parallel(
    void (*region)(void*), void* data, unsigned num_threads, unsigned flags) {
  using Parallel = void (*)(void (*)(void*), void*, unsigned, unsigned);
  if (plumbline::num_serial > 0) {
    region(data);
    return;
  }
  static const auto next =
      reinterpret_cast<Parallel>(plumbline::FindOpenMp("GOMP_parallel"));
  if (next == nullptr) {
    region(data);
  } else {
    next(region, data, num_threads, flags);
  }
}
