// What CHOLMOD, SPQR and Ceres call of BLAS, LAPACK, METIS and OpenMP, for
// binaries into which those are linked whole: each function is looked for when
// it is first called. A small graph is solved without any of them, and the
// libraries that they are in, and bring along, would take as long to load as
// the graph takes to be solved. The symbols stay within the binary, so that the
// libraries go on calling their own.
//
// All arguments are pointers. Lengths of texts, which Fortran adds at the end,
// are given by none of the callers either.

#include <plumbline/core/error.h>
#include <plumbline/core/late_library.h>
#include <plumbline/core/serial_openmp.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <utility>

namespace plumbline {
namespace {

LateLibrary blas("libblas.so.3");
LateLibrary lapack("liblapack.so.3");
LateLibrary metis("libmetis.so.5");

template <std::size_t>
using Pointer = void *;

template <typename Result, typename Indices>
struct PointerFunction;
template <typename Result, std::size_t... kIndices>
struct PointerFunction<Result, std::index_sequence<kIndices...>> {
  using Type = Result(Pointer<kIndices>...);
};

// A function of `kCount` pointers.
template <typename Result, std::size_t kCount>
using FunctionOf =
    typename PointerFunction<Result, std::make_index_sequence<kCount>>::Type;

// Exceptions must not pass through C and Fortran, and none of the callers can
// go on without the function.
template <typename Function, typename... Arguments>
auto Call(const LateFunction<Function> &function, Arguments... arguments) {
  try {
    return function(arguments...);
  } catch (const Error &error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::abort();
  }
}

}  // namespace
}  // namespace plumbline

#define PLUMBLINE_PARAMETERS_3 void *a, void *b, void *c
#define PLUMBLINE_PARAMETERS_5 PLUMBLINE_PARAMETERS_3, void *d, void *e
#define PLUMBLINE_PARAMETERS_7 PLUMBLINE_PARAMETERS_5, void *f, void *g
#define PLUMBLINE_PARAMETERS_8 PLUMBLINE_PARAMETERS_7, void *h
#define PLUMBLINE_PARAMETERS_9 PLUMBLINE_PARAMETERS_8, void *i
#define PLUMBLINE_PARAMETERS_10 PLUMBLINE_PARAMETERS_9, void *j
#define PLUMBLINE_PARAMETERS_11 PLUMBLINE_PARAMETERS_10, void *k
#define PLUMBLINE_PARAMETERS_13 PLUMBLINE_PARAMETERS_11, void *l, void *m
#define PLUMBLINE_PARAMETERS_15 PLUMBLINE_PARAMETERS_13, void *n, void *o
#define PLUMBLINE_ARGUMENTS_3 a, b, c
#define PLUMBLINE_ARGUMENTS_5 PLUMBLINE_ARGUMENTS_3, d, e
#define PLUMBLINE_ARGUMENTS_7 PLUMBLINE_ARGUMENTS_5, f, g
#define PLUMBLINE_ARGUMENTS_8 PLUMBLINE_ARGUMENTS_7, h
#define PLUMBLINE_ARGUMENTS_9 PLUMBLINE_ARGUMENTS_8, i
#define PLUMBLINE_ARGUMENTS_10 PLUMBLINE_ARGUMENTS_9, j
#define PLUMBLINE_ARGUMENTS_11 PLUMBLINE_ARGUMENTS_10, k
#define PLUMBLINE_ARGUMENTS_13 PLUMBLINE_ARGUMENTS_11, l, m
#define PLUMBLINE_ARGUMENTS_15 PLUMBLINE_ARGUMENTS_13, n, o

// Defines `name`, of `count` pointers, which calls the function of that name in
// `library`.
#define PLUMBLINE_PASS_ON(library, result, name, count)                        \
  extern "C" __attribute__((visibility("hidden"))) result name(                \
      PLUMBLINE_PARAMETERS_##count) {                                          \
    static const plumbline::LateFunction<plumbline::FunctionOf<result, count>> \
        function(&plumbline::library, #name);                                  \
    return plumbline::Call(function, PLUMBLINE_ARGUMENTS_##count);             \
  }

PLUMBLINE_PASS_ON(blas, void, dgemm_, 13)
PLUMBLINE_PASS_ON(blas, void, dgemv_, 11)
PLUMBLINE_PASS_ON(blas, double, dnrm2_, 3)
PLUMBLINE_PASS_ON(blas, void, dsyrk_, 10)
PLUMBLINE_PASS_ON(blas, void, dtrsm_, 11)
PLUMBLINE_PASS_ON(blas, void, dtrsv_, 8)
PLUMBLINE_PASS_ON(blas, double, dznrm2_, 3)
PLUMBLINE_PASS_ON(blas, void, zgemm_, 13)
PLUMBLINE_PASS_ON(blas, void, zgemv_, 11)
PLUMBLINE_PASS_ON(blas, void, zherk_, 10)
PLUMBLINE_PASS_ON(blas, void, ztrsm_, 11)
PLUMBLINE_PASS_ON(blas, void, ztrsv_, 8)

PLUMBLINE_PASS_ON(lapack, void, dgeqrf_, 8)
PLUMBLINE_PASS_ON(lapack, void, dlarf_, 9)
PLUMBLINE_PASS_ON(lapack, void, dlarfb_, 15)
PLUMBLINE_PASS_ON(lapack, void, dlarfg_, 5)
PLUMBLINE_PASS_ON(lapack, void, dlarft_, 9)
PLUMBLINE_PASS_ON(lapack, void, dormqr_, 13)
PLUMBLINE_PASS_ON(lapack, void, dpotrf_, 5)
PLUMBLINE_PASS_ON(lapack, void, dpotrs_, 8)
PLUMBLINE_PASS_ON(lapack, void, dtrtrs_, 10)
PLUMBLINE_PASS_ON(lapack, void, zlarf_, 9)
PLUMBLINE_PASS_ON(lapack, void, zlarfb_, 15)
PLUMBLINE_PASS_ON(lapack, void, zlarfg_, 5)
PLUMBLINE_PASS_ON(lapack, void, zlarft_, 9)
PLUMBLINE_PASS_ON(lapack, void, zpotrf_, 5)

PLUMBLINE_PASS_ON(metis, int, METIS_ComputeVertexSeparator, 7)
PLUMBLINE_PASS_ON(metis, int, METIS_NodeND, 7)

// Within a region of OpenMP (core/serial_openmp.h): how many threads run it,
// and which one this is.
extern "C" __attribute__((visibility("hidden"))) int omp_get_num_threads() {
  if (plumbline::SerialOpenMp::IsInForce()) return 1;
  static const auto function =
      reinterpret_cast<int (*)()>(plumbline::FindOpenMp("omp_get_num_threads"));
  return function == nullptr ? 1 : function();
}

extern "C" __attribute__((visibility("hidden"))) int omp_get_thread_num() {
  if (plumbline::SerialOpenMp::IsInForce()) return 0;
  static const auto function =
      reinterpret_cast<int (*)()>(plumbline::FindOpenMp("omp_get_thread_num"));
  return function == nullptr ? 0 : function();
}
