#ifndef PLUMBLINE_CORE_SERIAL_OPENMP_H_
#define PLUMBLINE_CORE_SERIAL_OPENMP_H_

namespace plumbline {

/// While one lives, OpenMP regions that its thread comes to run on that thread
/// alone. CHOLMOD, as Debian builds it, opens several for each supernode, for a
/// hard-coded number of threads; even of one thread each would allocate a team
/// and make a system call, which takes as long as half the factorization. To
/// avoid that the library stands before GOMP_parallel of GCC's OpenMP library,
/// and passes on what other threads ask for. Where the linear algebra library
/// does without OpenMP, there is nothing to do.
class SerialOpenMp {
 public:
  SerialOpenMp();
  SerialOpenMp(const SerialOpenMp&) = delete;
  SerialOpenMp& operator=(const SerialOpenMp&) = delete;
  ~SerialOpenMp();

 private:
  int old_levels_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SERIAL_OPENMP_H_
