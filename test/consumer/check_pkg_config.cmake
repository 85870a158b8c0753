# Compiles SOURCE to PROGRAM with what pkg-config says in PREFIX, and runs it.
# The example of the factors gets nothing but plumbline-factors.
if(SOURCE MATCHES "bare_problem")
  set(package plumbline-factors)
else()
  set(package plumbline)
endif()
set(ENV{PKG_CONFIG_PATH} ${PREFIX}/${LIBDIR}/pkgconfig)
execute_process(COMMAND ${PKG_CONFIG} --cflags --libs ${package}
  OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${flags}")
execute_process(COMMAND ${CXX} -std=c++17 -O1 ${SOURCE} -o ${PROGRAM} ${flags}
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${PROGRAM} COMMAND_ERROR_IS_FATAL ANY)
