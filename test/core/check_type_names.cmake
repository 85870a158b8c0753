# Fails when a source file of the libraries, apps or examples in FOLDER asks a
# feature or a relation for its name to find out what it is, or takes a unit
# apart: that is what traits, roles and quantities say. Readers and writers of files are left
# out, and so is the registry, where names are looked up.
cmake_minimum_required(VERSION 3.21)
set(may_compare
  core/graph_g2o.cc core/graph_json.cc core/named_types.h core/registry.cc)
set(patterns
  # type->name == "segment", kName != feature.type->name
  "type(->|\\.)name *[!=]="
  "[!=]= *[A-Za-z0-9_.>*&()-]*type(->|\\.)name[^A-Za-z0-9_(]"
  # const std::string& type = feature->type->name;
  "std::string& *[a-z_]+ *=[^;]*type(->|\\.)name;"
  # GetRelation(feature.type->name + "_orientation")
  "(Get|Find)(Relation|Feature)\\([^)]*type(->|\\.)name"
  # count(feature->type->name), std::find(..., feature.type->name)
  "count\\([a-z_.>()*-]*type(->|\\.)name\\)"
  "std::find\\([^;]*type(->|\\.)name"
  # types.insert(feature->type->name), to ask for the set of names later
  "(types|raw)\\.insert\\([a-z_.>()*-]*type(->|\\.)name\\)"
  # unit == "rad"
  "unit *[!=]= *\"")

file(GLOB_RECURSE sources RELATIVE ${FOLDER}
  ${FOLDER}/core/*.cc ${FOLDER}/core/*.h ${FOLDER}/detectors/*.cc ${FOLDER}/detectors/*.h
  ${FOLDER}/frontend/*.cc ${FOLDER}/frontend/*.h ${FOLDER}/apps/*.cc ${FOLDER}/apps/*.h
  ${FOLDER}/test/consumer/*.cc ${FOLDER}/test/consumer/*.h)
list(LENGTH sources count)
if(count LESS 100)
  message(FATAL_ERROR "${FOLDER}: ${count} source files: expected those of core, detectors, frontend, apps and test/consumer")
endif()
set(found)
foreach(source ${sources})
  if(source IN_LIST may_compare)
    continue()
  endif()
  # One line, so that a comparison broken by the formatter is found; brackets
  # and semicolons would part and join the elements of a list.
  file(READ ${FOLDER}/${source} text)
  string(REGEX REPLACE "\n *(//[^\n]*)?" "\n" text "${text}")
  string(REGEX REPLACE "([=(,!&|.]|->)\n" "\\1 " text "${text}")
  string(REGEX REPLACE "\n([!=&|.+]|->)" " \\1" text "${text}")
  foreach(pattern ${patterns})
    string(REGEX MATCHALL "${pattern}" matches "${text}")
    foreach(match IN LISTS matches)
      string(APPEND found "${source}: '${match}'\n")
    endforeach()
  endforeach()
endforeach()
if(found)
  message(FATAL_ERROR "${found}expected a trait, a role or a quantity (core/registry.h)")
endif()

# core knows no relation but in the list of those that are built in.
file(GLOB relations RELATIVE ${FOLDER} ${FOLDER}/factors/*.h)
foreach(relation ${relations})
  file(STRINGS ${FOLDER}/${relation} blocks REGEX "using Blocks =")
  if(NOT blocks)
    continue()
  endif()
  foreach(source ${sources})
    if(NOT source MATCHES "^core/" OR source STREQUAL "core/builtins.cc")
      continue()
    endif()
    file(STRINGS ${FOLDER}/${source} includes REGEX "#include <plumbline/${relation}>")
    if(includes)
      message(FATAL_ERROR "${source} includes ${relation}: expected no relation in core but in builtins.cc")
    endif()
  endforeach()
endforeach()
