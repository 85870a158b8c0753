# Fails when a public header in FOLDERS (below ROOT) names something of the
# standard library, Eigen or Ceres and includes nothing that brings it, itself or
# by way of other headers of the project. The compiler checks all else that a
# header has to include, but with a precompiled header of those three.
cmake_minimum_required(VERSION 3.21)

# What is named, and what brings it.
set(rules
  "std::(vector) => vector"
  "std::(string|to_string) => string"
  "std::(string_view) => string_view|string"
  "std::(map|multimap) => map"
  "std::(set|multiset) => set"
  "std::(array) => array"
  "std::(deque) => deque"
  "std::(unordered_map) => unordered_map"
  "std::(optional|nullopt) => optional"
  "std::(tuple|tie|make_tuple) => tuple"
  "std::(pair|move|exchange|forward|make_pair|swap|as_const) => utility|map|vector|array|memory|deque"
  "std::(unique_ptr|shared_ptr|weak_ptr|make_unique|make_shared) => memory"
  "std::(function) => functional"
  "std::(min|max|clamp|sort|find|any_of|all_of|count|count_if|copy|fill|equal|lower_bound) => algorithm"
  "std::(istream|ostream) => iosfwd|istream|ostream|iostream|fstream|sstream"
  "std::(sqrt|cos|sin|tan|atan2|abs|hypot|isfinite|isnan|floor|ceil|exp|log|pow|fmod|remainder|lround|isinf|erfc|tgamma|log1p) => cmath"
  "std::(u?int(8|16|32|64)_t) => cstdint"
  "std::(size_t|ptrdiff_t) => cstddef|string|vector|map|set|array|deque|functional|memory"
  "std::(numeric_limits) => limits"
  "std::(runtime_error|invalid_argument|logic_error) => stdexcept"
  "std::(exception|exception_ptr|current_exception) => exception|stdexcept"
  "std::(errc|system_error) => system_error|charconv"
  "std::(to_chars|from_chars|chars_format|to_chars_result|from_chars_result) => charconv"
  "std::(memcpy) => cstring"
  "std::(iota) => numeric"
  "std::(filesystem) => filesystem"
  "std::(chrono) => chrono"
  "std::(mutex|lock_guard|unique_lock) => mutex"
  "std::(condition_variable) => condition_variable"
  "std::(thread) => thread"
  "std::(atomic) => atomic"
  "std::(is_[a-z_]+|enable_if[a-z_]*|decay_t|conditional_t|remove_[a-z_]+) => type_traits"
  "Eigen::([A-Za-z0-9]+) => Eigen/.*"
  "Eigen::(LLT|LDLT) => Eigen/Cholesky"
  "Eigen::(SelfAdjointEigenSolver) => Eigen/Eigenvalues"
  "Eigen::(FullPivLU|PartialPivLU) => Eigen/LU"
  "Eigen::(SparseMatrix) => Eigen/Sparse.*"
  "ceres::(AutoDiffCostFunction) => ceres/(ceres|autodiff_cost_function).h"
  "ceres::(CostFunction) => ceres/(ceres|[a-z_]*cost_function).h"
  "ceres::([A-Za-z]*Loss|LossFunction) => ceres/(ceres|loss_function).h"
  "ceres::([A-Za-z]*Manifold) => ceres/(ceres|[a-z_]*manifold).h"
  "ceres::(Problem) => ceres/(ceres|problem).h"
  "ceres::(Solver) => ceres/(ceres|solver).h"
  "ceres::([A-Za-z]+) => ceres/.*")

# brought(<header> <variable>): what it includes of other projects, by way of
# headers of this one.
function(brought header variable)
  get_property(is_known GLOBAL PROPERTY "brought ${header}" SET)
  if(NOT is_known)
    # Also ends the search where headers include each other.
    set_property(GLOBAL PROPERTY "brought ${header}" "")
    set(found)
    file(STRINGS ${header} includes REGEX "^#include <")
    foreach(include IN LISTS includes)
      string(REGEX REPLACE "^#include <([^>]*)>.*" "\\1" include "${include}")
      if(include MATCHES "^plumbline/(.*)$")
        set(path ${ROOT}/${CMAKE_MATCH_1})
        if(NOT EXISTS ${path})
          set(path ${ROOT}/apps/${CMAKE_MATCH_1})
        endif()
        brought(${path} more)
        list(APPEND found ${more})
      else()
        list(APPEND found ${include})
      endif()
    endforeach()
    list(REMOVE_DUPLICATES found)
    set_property(GLOBAL PROPERTY "brought ${header}" "${found}")
  endif()
  get_property(known GLOBAL PROPERTY "brought ${header}")
  set(${variable} "${known}" PARENT_SCOPE)
endfunction()

set(count 0)
set(missing)
foreach(folder IN LISTS FOLDERS)
  file(GLOB_RECURSE headers ${ROOT}/${folder}/*.h)
  foreach(header IN LISTS headers)
    math(EXPR count "${count} + 1")
    file(READ ${header} text)
    string(REGEX REPLACE "//[^\n]*" "" text "${text}")
    brought(${header} includes)
    foreach(rule IN LISTS rules)
      string(REGEX MATCH "^([a-zA-Z]+::)([^ ]+) => (.*)$" rule "${rule}")
      set(bringing ${includes})
      list(FILTER bringing INCLUDE REGEX "^(${CMAKE_MATCH_3})$")
      if(bringing)
        continue()
      endif()
      set(expected "${CMAKE_MATCH_3}")
      if(text MATCHES "[^A-Za-z0-9_:](${CMAKE_MATCH_1}${CMAKE_MATCH_2})[^A-Za-z0-9_]")
        string(APPEND missing
          "${header}: ${CMAKE_MATCH_1}: expected an #include of <${expected}>\n")
      endif()
    endforeach()
  endforeach()
endforeach()
if(count LESS 150)
  message(FATAL_ERROR "${ROOT}: ${count} headers: expected those of all components")
endif()
if(missing)
  message(FATAL_ERROR "${missing}")
endif()
