# Debian packages: cpack -G DEB makes plumbline (binaries) and libplumbline-dev
# (headers, static libraries, CMake and pkg-config files).
set(CPACK_PACKAGE_NAME plumbline)
# Who builds a package answers for it.
set(CPACK_PACKAGE_CONTACT "plumbline authors <plumbline@localhost>" CACHE STRING
  "Maintainer of the packages: Name <mail address>")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
# Each package has a first line of its own.
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL runtime development)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME plumbline)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION science)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
# Loaded late (core/late_library.h), which dpkg-shlibdeps cannot see.
set(late_libraries
  "libarchive13, libbz2-1.0, libcairo2, libgeos-c1v5, liblz4-1, libsqlite3-0, libzstd1, zlib1g")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS "${late_libraries}")
if(PLUMBLINE_STATIC_ALGEBRA)
  string(APPEND CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS
    ", libblas3 | libblas.so.3, libgomp1, liblapack3 | liblapack.so.3, libmetis5")
endif()
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION
"find the structure of buildings in laser maps of robots
Batch solver that turns a robot's log or a pose graph into a map in which walls
are straight, parallel and at right angles where the building is, with tools
that simulate buildings and measure how good a map is.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libplumbline-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libceres-dev (>= 2.1), libeigen3-dev (>= 3.3), libsuitesparse-dev, nettle-dev, ${late_libraries}")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
"relations between walls, points and directions for Ceres Solver
Cost functions, manifolds and losses for use in a ceres::Problem, and the
libraries around them: graph, detectors of structure, expectation maximization,
laser front-end, the way from a log to a map, and floor plans and grids of it,
with CMake and pkg-config files.")

# Copyright and changelog, where Debian's policy wants them.
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
foreach(component runtime development)
  string(TOUPPER ${component} upper)
  set(package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  set(documents ${PROJECT_BINARY_DIR}/packaging/${package})
  set(version ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})
  file(CONFIGURE OUTPUT ${documents}/changelog.Debian @ONLY CONTENT
"@package@ (@version@) unstable; urgency=medium

  * Version @PROJECT_VERSION@.

 -- @CPACK_PACKAGE_CONTACT@  @date@
")
  file(ARCHIVE_CREATE OUTPUT ${documents}/changelog.Debian.gz
    PATHS ${documents}/changelog.Debian FORMAT raw COMPRESSION GZip COMPRESSION_LEVEL 9)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE RENAME copyright
    DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package} COMPONENT ${component})
  install(FILES ${documents}/changelog.Debian.gz
    DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package} COMPONENT ${component})
endforeach()

# Pages, under each other as in the source so that their links hold, and
# examples: projects that build against the installed package.
set(documents ${CMAKE_INSTALL_DATAROOTDIR}/doc/libplumbline-dev)
foreach(page README.md core/graph_files.md core/house.md core/method.md core/plugins.md factors/relations.md
        frontend/bags.md apps/pipeline/known_beforehand.md apps/plan/plan.md
        apps/evaluation/evaluation.md
        datasets/README.md datasets/RESULTS.md datasets/HISTORY.md datasets/sweeps/README.md)
  get_filename_component(folder ${page} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/${page}
    DESTINATION ${documents}/${folder} COMPONENT development)
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/datasets/pictures
  DESTINATION ${documents}/datasets COMPONENT development)
install(FILES ${PROJECT_SOURCE_DIR}/datasets/office.clf.gz
  DESTINATION ${documents}/datasets COMPONENT development)
foreach(example bare_problem log_to_floor_plan orchestrator plugin scan_by_scan)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/test/consumer/${example}
    DESTINATION ${documents}/examples/consumer COMPONENT development)
endforeach()
install(FILES ${PROJECT_SOURCE_DIR}/test/consumer/CMakeLists.txt
  DESTINATION ${documents}/examples/consumer COMPONENT development)

include(CPack)
