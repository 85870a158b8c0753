# Installs into a fresh prefix and uses plumbline from there as somebody else's
# project would. Run by ctest; the folder's own CMakeLists.txt is that project.
set(work ${CMAKE_CURRENT_BINARY_DIR}/consumer)
set(prefix ${work}/prefix)
set(consumer ${CMAKE_CURRENT_LIST_DIR})
set(toolchain
  -G ${CMAKE_GENERATOR} -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER})
# What the environment hands to inner projects.
string(REPLACE ";" "\\;" launcher "CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER}")

add_test(NAME install.tree
  COMMAND ${CMAKE_COMMAND} -D BUILD=${PROJECT_BINARY_DIR} -D SOURCE=${PROJECT_SOURCE_DIR}
    -D WORK=${work} -D PREFIX=${prefix} -P ${consumer}/check_install.cmake)
set_tests_properties(install.tree PROPERTIES FIXTURES_SETUP prefix)

# consumer_project(<name> <source folder> <arguments of cmake...>): configured,
# built, and its own tests run.
function(consumer_project name source)
  add_test(NAME consumer.${name}
    COMMAND ${CMAKE_CTEST_COMMAND} --build-and-test ${source} ${work}/${name}
      --build-generator ${CMAKE_GENERATOR} --build-noclean
      --build-options -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER} ${ARGN}
      --test-command ${CMAKE_CTEST_COMMAND} --output-on-failure --no-tests=error)
  set_tests_properties(consumer.${name} PROPERTIES
    FIXTURES_REQUIRED prefix ENVIRONMENT "${launcher}" TIMEOUT 600)
endfunction()
consumer_project(installed ${consumer} -DCMAKE_PREFIX_PATH=${prefix})
consumer_project(build_tree ${consumer}/bare_problem -Dplumbline_DIR=${PROJECT_BINARY_DIR})

# says_why(<name> <what is said> <arguments of cmake...>)
function(says_why name message)
  add_test(NAME find_package.${name}
    COMMAND ${CMAKE_COMMAND} -S ${consumer}/says_why -B ${work}/${name} ${toolchain} ${ARGN})
  # CMake breaks the lines of messages.
  string(REPLACE " " "[ \n]+" pattern "${message}")
  set_tests_properties(find_package.${name} PROPERTIES
    FIXTURES_REQUIRED prefix PASS_REGULAR_EXPRESSION "${pattern}")
endfunction()
says_why(finds_all "found all of factors;core;detectors;frontend;pipeline;plan;outputs;plumbline"
  "-DCOMPONENTS=factors\;core\;detectors\;frontend\;pipeline\;plan\;outputs\;plumbline" -DCMAKE_PREFIX_PATH=${prefix})
says_why(unknown_component
  "there is no component 'walls': expected one of factors, core, detectors, frontend, pipeline, plan, outputs, plumbline"
  "-DCOMPONENTS=factors\;walls" -DCMAKE_PREFIX_PATH=${prefix})
says_why(missing_dependency "component 'frontend' needs Ceres 2.1, which was not found"
  -DCOMPONENTS=frontend -DCMAKE_DISABLE_FIND_PACKAGE_Ceres=ON -DCMAKE_PREFIX_PATH=${prefix})
# What is loaded late is not needed to link.
says_why(only_what_a_component_needs "found all of frontend"
  -DCOMPONENTS=frontend -DCMAKE_DISABLE_FIND_PACKAGE_BZip2=ON
  -DCMAKE_DISABLE_FIND_PACKAGE_ZLIB=ON -DCMAKE_PREFIX_PATH=${prefix})
says_why(other_version "compatible with requested version"
  -DCOMPONENTS=factors -DVERSION=0.0.1 -DCMAKE_PREFIX_PATH=${prefix})

find_program(PLUMBLINE_PKG_CONFIG pkg-config)
if(PLUMBLINE_PKG_CONFIG)
  foreach(example bare_problem orchestrator)
    add_test(NAME pkg_config.${example}
      COMMAND ${CMAKE_COMMAND} -D PKG_CONFIG=${PLUMBLINE_PKG_CONFIG}
        -D CXX=${CMAKE_CXX_COMPILER} -D PREFIX=${prefix}
        -D LIBDIR=${CMAKE_INSTALL_LIBDIR} -D SOURCE=${consumer}/${example}/${example}.cc
        -D PROGRAM=${work}/pkg_config_${example} -P ${consumer}/check_pkg_config.cmake)
    set_tests_properties(pkg_config.${example} PROPERTIES FIXTURES_REQUIRED prefix)
  endforeach()
endif()

find_program(PLUMBLINE_DPKG_DEB dpkg-deb)
find_program(PLUMBLINE_DPKG_SHLIBDEPS dpkg-shlibdeps)
if(PLUMBLINE_DPKG_DEB AND PLUMBLINE_DPKG_SHLIBDEPS AND PLUMBLINE_BUILD_APPS)
  add_test(NAME package.deb
    COMMAND ${CMAKE_COMMAND} -D BUILD=${PROJECT_BINARY_DIR} -D WORK=${work}/packages
      -D VERSION=${PROJECT_VERSION} -D CPACK=${CMAKE_CPACK_COMMAND}
      -P ${consumer}/check_packages.cmake)
endif()
