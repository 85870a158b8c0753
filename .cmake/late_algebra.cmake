# Binaries that start fast. Ceres is a static library; SuiteSparse, which it
# calls, would be shared and bring a dozen of libraries along, to load which takes
# 2 ms, as a graph of a thousand poses takes to be solved. With
# PLUMBLINE_STATIC_ALGEBRA a binary has SuiteSparse (and nettle, which is small)
# within, and what that calls of others is looked for when it is called
# (apps/linking/late_algebra.cc).
#
# plumbline_static_algebra(<target>): links an executable so, where the static
# libraries are there.
option(PLUMBLINE_STATIC_ALGEBRA "Link SuiteSparse into the binaries" ON)

set(PLUMBLINE_STATIC_LIBRARIES)
foreach(library spqr cholmod amd camd colamd ccolamd suitesparseconfig cxsparse nettle)
  find_library(PLUMBLINE_STATIC_${library} lib${library}.a)
  mark_as_advanced(PLUMBLINE_STATIC_${library})
  if(NOT PLUMBLINE_STATIC_${library})
    set(PLUMBLINE_STATIC_ALGEBRA OFF)
  endif()
  list(APPEND PLUMBLINE_STATIC_LIBRARIES ${PLUMBLINE_STATIC_${library}})
endforeach()
get_target_property(links Ceres::ceres INTERFACE_LINK_LIBRARIES)
get_target_property(type Ceres::ceres TYPE)
if(NOT links MATCHES "SuiteSparse::CHOLMOD" OR NOT type STREQUAL STATIC_LIBRARY)
  set(PLUMBLINE_STATIC_ALGEBRA OFF)
endif()

if(PLUMBLINE_STATIC_ALGEBRA)
  set(late $<BOOL:$<TARGET_PROPERTY:PLUMBLINE_HAS_STATIC_ALGEBRA>>)
  set(new_links)
  foreach(link IN LISTS links)
    if(link MATCHES "SuiteSparse|CXSparse|lapack|blas|atlas")
      list(APPEND new_links "$<$<NOT:${late}>:${link}>")
    else()
      list(APPEND new_links "${link}")
    endif()
  endforeach()
  foreach(library IN LISTS PLUMBLINE_STATIC_LIBRARIES)
    list(APPEND new_links "$<${late}:${library}>")
  endforeach()
  set_target_properties(Ceres::ceres PROPERTIES INTERFACE_LINK_LIBRARIES "${new_links}")
endif()

function(plumbline_static_algebra target)
  if(NOT PLUMBLINE_STATIC_ALGEBRA)
    return()
  endif()
  set_target_properties(${target} PROPERTIES PLUMBLINE_HAS_STATIC_ALGEBRA ON)
  set(source ${PROJECT_SOURCE_DIR}/apps/linking/late_algebra.cc)
  target_sources(${target} PRIVATE ${source})
  # Others declare the functions with types of their own.
  set_property(SOURCE ${source} TARGET_DIRECTORY ${target} PROPERTY SKIP_UNITY_BUILD_INCLUSION ON)
  # Else the shared libraries come along with those that name them.
  target_link_options(${target} PRIVATE LINKER:--as-needed)
endfunction()
