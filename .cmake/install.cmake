# Install tree, export with components, pkg-config files.
#
# A component is a target (plumbline::<component>) with an export file of its
# own, so that whoever wants one component needs only what that one needs.
include(CMakePackageConfigHelpers)

set(cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/plumbline)

foreach(component ${PLUMBLINE_COMPONENTS})
  install(TARGETS plumbline_${component} EXPORT plumbline-${component}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
  install(EXPORT plumbline-${component} NAMESPACE plumbline::
    FILE plumbline-${component}-targets.cmake
    DESTINATION ${cmake_folder} COMPONENT development)
  # Users of the build tree set plumbline_DIR to the build folder.
  export(EXPORT plumbline-${component} NAMESPACE plumbline::
    FILE ${PROJECT_BINARY_DIR}/plumbline-${component}-targets.cmake)
  if(NOT component STREQUAL plumbline)
    plumbline_component_folder(${component} folder)
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder}/
      DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/plumbline/${component}
      COMPONENT development FILES_MATCHING PATTERN "*.h")
  endif()
endforeach()

configure_file(${CMAKE_CURRENT_LIST_DIR}/plumblineConfig.cmake.in
  ${PROJECT_BINARY_DIR}/plumblineConfig.cmake @ONLY)
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/plumblineConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  ${PROJECT_BINARY_DIR}/plumblineConfig.cmake
  ${PROJECT_BINARY_DIR}/plumblineConfigVersion.cmake
  DESTINATION ${cmake_folder} COMPONENT development)

# Ceres has no pkg-config file of its own in Debian.
function(plumbline_pkg_config name description requires libraries)
  cmake_path(IS_ABSOLUTE CMAKE_INSTALL_LIBDIR is_absolute)
  if(is_absolute)
    message(FATAL_ERROR "CMAKE_INSTALL_LIBDIR is ${CMAKE_INSTALL_LIBDIR}: "
      "expected a path relative to the prefix, or the package could not be moved")
  endif()
  file(RELATIVE_PATH up /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
  string(REGEX REPLACE "/$" "" up "${up}")
  configure_file(${PROJECT_SOURCE_DIR}/.cmake/plumbline.pc.in
    ${PROJECT_BINARY_DIR}/pkgconfig/${name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/pkgconfig/${name}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endfunction()

plumbline_pkg_config(plumbline-factors "Relations, manifolds and losses for a ceres::Problem"
  "eigen3 >= 3.3 libglog" "-lceres")
plumbline_pkg_config(plumbline-core "Graph, plug-in registry, solver session, EM"
  "plumbline-factors" "-L\${libdir} -lplumbline_core -lcholmod -lnettle")
plumbline_pkg_config(plumbline-detectors "Structure detectors"
  "plumbline-core" "-L\${libdir} -lplumbline_detectors")
plumbline_pkg_config(plumbline-frontend "Log readers and laser front-end"
  "plumbline-core" "-L\${libdir} -lplumbline_frontend")
plumbline_pkg_config(plumbline-pipeline "From scans or a graph to a map"
  "plumbline-detectors plumbline-frontend" "-L\${libdir} -lplumbline_pipeline")
set(all plumbline-pipeline)
if(PLUMBLINE_BUILD_OUTPUTS)
  plumbline_pkg_config(plumbline-plan "Rooms, doors and walls of what a robot saw"
    "plumbline-core" "-L\${libdir} -lplumbline_plan")
  plumbline_pkg_config(plumbline-outputs "Floor plans, grids, pictures and reports of a map"
    "plumbline-detectors plumbline-frontend plumbline-plan" "-L\${libdir} -lplumbline_outputs")
  string(APPEND all " plumbline-outputs")
endif()
plumbline_pkg_config(plumbline "All libraries of plumbline" "${all}" "")
