# Fails when the link interface of plumbline::factors (INTERFACE_FILE) names
# anything but Ceres and Eigen, or when a header in FOLDER includes another
# folder of the project, or a library that is not one of the two.
set(expected "Ceres::ceres;Eigen3::Eigen")
file(READ ${INTERFACE_FILE} interface)
if(NOT interface STREQUAL expected)
  message(FATAL_ERROR
    "plumbline::factors links '${interface}': expected '${expected}'")
endif()

file(GLOB headers ${FOLDER}/*.h)
if(NOT headers)
  message(FATAL_ERROR "${FOLDER}: no headers: expected those of the factors")
endif()
foreach(header ${headers})
  file(STRINGS ${header} includes REGEX "^#include ")
  foreach(include ${includes})
    # Headers of the standard library have neither a folder nor an ending.
    if(NOT include MATCHES "^#include <([a-z_]+|(ceres|Eigen|plumbline/factors)/[A-Za-z0-9_.]+)>$")
      message(FATAL_ERROR
        "${header}: '${include}': expected the standard library, Ceres, Eigen or plumbline/factors")
    endif()
  endforeach()
endforeach()
