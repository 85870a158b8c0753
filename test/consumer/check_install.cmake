# Installs BUILD into a fresh prefix, moves it to PREFIX, and looks at what is
# exported: nothing may name the folders of this build, or pass on its flags.
file(REMOVE_RECURSE ${PREFIX} ${WORK}/staging)
execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/staging
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
file(RENAME ${WORK}/staging ${PREFIX})

file(GLOB_RECURSE exported ${PREFIX}/*.cmake ${PREFIX}/*.pc)
list(LENGTH exported count)
# 7 components with a file for each configuration where there is an archive,
# config, version, 7 for pkg-config.
if(count LESS 21)
  message(FATAL_ERROR "${PREFIX}: exported ${exported}: expected at least 21 files")
endif()
foreach(file ${exported})
  file(READ ${file} text)
  foreach(unwanted ${SOURCE} ${BUILD} ${WORK} "/usr/" "-march" "-fpch" "cmake_pch" "-W" "plumbline_warnings")
    string(FIND "${text}" "${unwanted}" position)
    if(NOT position EQUAL -1)
      string(SUBSTRING "${text}" ${position} 80 excerpt)
      message(FATAL_ERROR "${file}: '${unwanted}' in '${excerpt}...': expected nothing of this build")
    endif()
  endforeach()
endforeach()

# Every public header, and no other.
foreach(component factors core detectors frontend pipeline plan outputs)
  set(folder ${component})
  if(NOT EXISTS ${SOURCE}/${component})
    set(folder apps/${component})
  endif()
  file(GLOB_RECURSE in_tree RELATIVE ${SOURCE}/${folder} ${SOURCE}/${folder}/*.h)
  file(GLOB_RECURSE installed RELATIVE ${PREFIX}/include/plumbline/${component}
    ${PREFIX}/include/plumbline/${component}/*)
  if(NOT in_tree STREQUAL installed)
    message(FATAL_ERROR "${component}: installed ${installed}: expected ${in_tree}")
  endif()
endforeach()
