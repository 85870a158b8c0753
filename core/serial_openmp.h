#ifndef PLUMBLINE_CORE_SERIAL_OPENMP_H_
#define PLUMBLINE_CORE_SERIAL_OPENMP_H_

namespace plumbline {

/// While one lives, OpenMP regions that its thread comes to run on that thread
/// alone. CHOLMOD, as Debian builds it, opens several for each supernode, for a
/// hard-coded number of threads. With one thread, GCC's OpenMP library would
/// still allocate a team for each region and make a system call at its end: a
/// third of the time of factorizations with many small supernodes. To avoid
/// that, GOMP_parallel is defined here as well, before the library's own, to
/// which it passes on what other threads ask for. Where the linear algebra
/// library does without OpenMP, there is nothing to do.
class SerialOpenMp {
 public:
  SerialOpenMp();
  SerialOpenMp(const SerialOpenMp&) = delete;
  SerialOpenMp& operator=(const SerialOpenMp&) = delete;
  ~SerialOpenMp();

  /// Whether one lives on this thread.
  static bool IsInForce();

 private:
  int old_levels_ = 0;
};

/// Address of a function of GCC's OpenMP library, which is loaded when it is
/// not there; null where that cannot be done.
void* FindOpenMp(const char* function);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SERIAL_OPENMP_H_
