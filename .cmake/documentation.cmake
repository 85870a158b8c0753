# Reference of the public headers and the pages, where Doxygen is installed.
find_package(Doxygen QUIET)
if(DOXYGEN_FOUND)
  set(DOXYGEN_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/documentation)
  set(DOXYGEN_USE_MDFILE_AS_MAINPAGE ${PROJECT_SOURCE_DIR}/README.md)
  # What a type says of itself is told once, at DescribedBlock, AddRelation and
  # NamedTypes (aliases: see documentation.awk).
  set(DOXYGEN_EXCLUDE_SYMBOLS *::internal::* plumbline::internal
    *::kName *::kG2oTag *::kDescription *::kRole *::kRows
    *::kTraits *::kParameters *::kAnchorSize)
  set(DOXYGEN_IMAGE_PATH ${PROJECT_SOURCE_DIR}/datasets)
  set(DOXYGEN_MACRO_EXPANSION YES)
  set(DOXYGEN_FILTER_PATTERNS "*.h=awk -f ${CMAKE_CURRENT_LIST_DIR}/documentation.awk")
  set(DOXYGEN_HAVE_DOT NO)
  set(DOXYGEN_GENERATE_LATEX NO)
  set(DOXYGEN_QUIET YES)
  set(DOXYGEN_WARN_LOGFILE ${PROJECT_BINARY_DIR}/documentation/warnings.txt)
  # Headers by the path by which they are included.
  set(DOXYGEN_STRIP_FROM_PATH ${PLUMBLINE_INCLUDE_ROOT} ${PROJECT_SOURCE_DIR})
  set(DOXYGEN_STRIP_FROM_INC_PATH ${PLUMBLINE_INCLUDE_ROOT})
  set(headers)
  foreach(component factors core detectors frontend pipeline plan outputs)
    file(GLOB_RECURSE component_headers CONFIGURE_DEPENDS
      ${PLUMBLINE_INCLUDE_ROOT}/plumbline/${component}/*.h)
    list(APPEND headers ${component_headers})
  endforeach()
  doxygen_add_docs(documentation README.md core/method.md core/house.md core/graph_files.md core/plugins.md
    factors/relations.md frontend/bags.md apps/pipeline/known_beforehand.md datasets/README.md datasets/RESULTS.md datasets/HISTORY.md
    datasets/sweeps/README.md
    apps/plan/plan.md apps/evaluation/evaluation.md
    test/benchmark/README.md ${headers}
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set(PLUMBLINE_DOXYFILE ${PROJECT_BINARY_DIR}/Doxyfile.documentation)
endif()
