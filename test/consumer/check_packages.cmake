# Makes the Debian packages of BUILD and reads their control fields and contents.
file(REMOVE_RECURSE ${WORK})
execute_process(COMMAND ${CPACK} -G DEB --config ${BUILD}/CPackConfig.cmake -B ${WORK}
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)

# read_package(<name>) sets control and contents.
function(read_package name)
  file(GLOB package ${WORK}/${name}_${VERSION}-1_*.deb)
  list(LENGTH package count)
  if(NOT count EQUAL 1)
    message(FATAL_ERROR "${WORK}: '${package}': expected one ${name}_${VERSION}-1_*.deb")
  endif()
  execute_process(COMMAND dpkg-deb --field ${package} OUTPUT_VARIABLE control
    COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND dpkg-deb --contents ${package} OUTPUT_VARIABLE contents
    COMMAND_ERROR_IS_FATAL ANY)
  set(control "${control}" PARENT_SCOPE)
  set(contents "${contents}" PARENT_SCOPE)
endfunction()

function(expect text what)
  foreach(pattern ${ARGN})
    if(NOT text MATCHES "${pattern}")
      message(FATAL_ERROR "${what}: expected '${pattern}' in\n${text}")
    endif()
  endforeach()
endfunction()

read_package(plumbline)
# Found by dpkg-shlibdeps: what the binaries link; given: what they load late.
expect("${control}" "control of plumbline" "Package: plumbline\n" "Version: ${VERSION}-1\n"
  "Section: science\n" "Depends: [^\n]*libgoogle-glog0" "Depends: [^\n]*libcairo2[, ]"
  "Depends: [^\n]*(libcholmod|libblas3)" "Depends: [^\n]*libsqlite3-0[, ]"
  "Depends: [^\n]*libgeos-c1v5[, ]" "Depends: [^\n]*libarchive13[, ]"
  "Depends: [^\n]*libc6 " "Description: [a-z]")
expect("${contents}" "plumbline" "/usr/bin/plumbline_solve\n" "/usr/bin/plumbline_evaluate\n"
  "/usr/share/doc/plumbline/copyright\n")
if(contents MATCHES "\\.(h|a|cmake)\n")
  message(FATAL_ERROR "plumbline: ${contents}: expected binaries only")
endif()

read_package(libplumbline-dev)
expect("${control}" "control of libplumbline-dev" "Package: libplumbline-dev\n"
  "Section: libdevel\n" "Depends: libceres-dev \\(>= 2\\.1\\), libeigen3-dev")
expect("${contents}" "libplumbline-dev" "/usr/include/plumbline/factors/line_orientation\\.h\n"
  "/libplumbline_core\\.a\n" "/cmake/plumbline/plumblineConfig\\.cmake\n"
  "/pkgconfig/plumbline-factors\\.pc\n" "/usr/share/doc/libplumbline-dev/copyright\n"
  "/usr/share/doc/libplumbline-dev/core/method\\.md\n"
  "/usr/share/doc/libplumbline-dev/README\\.md\n"
  "/usr/share/doc/libplumbline-dev/examples/consumer/bare_problem/bare_problem\\.cc\n"
  "/usr/share/doc/libplumbline-dev/examples/consumer/plugin/CMakeLists\\.txt\n")
if(contents MATCHES "/bin/")
  message(FATAL_ERROR "libplumbline-dev: ${contents}: expected no binaries")
endif()
