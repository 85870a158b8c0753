#ifndef PLUMBLINE_CORE_LATE_LIBRARY_H_
#define PLUMBLINE_CORE_LATE_LIBRARY_H_

#include <atomic>
#include <utility>

namespace plumbline {

/// A shared library that is loaded when one of its functions is first called.
///
/// Loading and linking a library at the start of a process costs 1 ms where it
/// brings others along (cairo 18, libarchive 7): as long as a graph of a
/// thousand poses takes to be solved. What few runs need is therefore loaded by
/// those that do. A LateLibrary is a variable of namespace scope; functions of
/// it are declared with PLUMBLINE_LATE_FUNCTION.
class LateLibrary {
 public:
  /// `file`: the library as the dynamic loader knows it, with the version of
  /// its interface ("libcairo.so.2"). The text has to outlive the object.
  constexpr explicit LateLibrary(const char* file) : file_(file) {}
  LateLibrary(const LateLibrary&) = delete;
  LateLibrary& operator=(const LateLibrary&) = delete;

  /// Address of a function, for any thread. Loads the library if that has not
  /// happened; it stays loaded until the process ends. Throws Error with what
  /// the loader says when the library or the function is not there.
  void* Find(const char* function);

 private:
  const char* const file_;
  std::atomic<void*> handle_{nullptr};
};

/// A function of a library that is loaded late. `Function` is its type as the
/// library's header declares it, and a call converts arguments as that says.
template <typename Function>
class LateFunction {
 public:
  /// Both have to outlive the object.
  constexpr LateFunction(LateLibrary* library, const char* name)
      : library_(library), name_(name) {}
  LateFunction(const LateFunction&) = delete;
  LateFunction& operator=(const LateFunction&) = delete;

  /// Calls it. Throws as LateLibrary::Find.
  template <typename... Arguments>
  auto operator()(Arguments&&... arguments) const {
    Function* function = function_.load(std::memory_order_acquire);
    if (function == nullptr) {
      function = reinterpret_cast<Function*>(library_->Find(name_));
      function_.store(function, std::memory_order_release);
    }
    return function(std::forward<Arguments>(arguments)...);
  }

 private:
  LateLibrary* const library_;
  const char* const name_;
  mutable std::atomic<Function*> function_{nullptr};
};

}  // namespace plumbline

/// Declares, within namespace plumbline, the variable `name` that stands for
/// the function of the same name: what is called there by that name is found in
/// `library`, a LateLibrary, and the program need not be linked with it.
#define PLUMBLINE_LATE_FUNCTION(library, name) \
  inline const LateFunction<decltype(::name)> name(&library, #name)

#endif  // PLUMBLINE_CORE_LATE_LIBRARY_H_
