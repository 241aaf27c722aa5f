# cmake -D SURFEIT_BINARY_DIR=... -D PROJECT_DIR=... -D WORK_DIR=... -P run_consumer.cmake
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}: exit status ${result}")
  endif()
endfunction()

# What a sanitized library needs at link time
set(flags "")
if(SANITIZE)
  set(flags -fsanitize=${SANITIZE})
endif()

file(REMOVE_RECURSE ${WORK_DIR})
file(MAKE_DIRECTORY ${WORK_DIR}/scene)
run(${CMAKE_COMMAND} --install ${SURFEIT_BINARY_DIR} --config ${BUILD_TYPE} --prefix ${WORK_DIR}/prefix)
set(settings
  -D CMAKE_BUILD_TYPE=${BUILD_TYPE}
  -D CMAKE_CXX_COMPILER=${CXX_COMPILER}
  -D CMAKE_CXX_COMPILER_LAUNCHER=${CXX_LAUNCHER}
  -D CMAKE_CXX_FLAGS=${flags}
  -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix)
run(${CMAKE_COMMAND} -S ${PROJECT_DIR} -B ${WORK_DIR}/build -G ${GENERATOR} ${settings})
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build --config ${BUILD_TYPE})
run(${WORK_DIR}/build/consumer ${WORK_DIR}/scene)
run(${WORK_DIR}/build/shared_consumer ${WORK_DIR}/scene)
run(${WORK_DIR}/build/engine_consumer ${WORK_DIR}/scene/ceiling.sft)
file(GLOB sample_targets ${WORK_DIR}/prefix/*/cmake/surfeit/surfeitSampleTargets.cmake
  ${WORK_DIR}/prefix/*/*/cmake/surfeit/surfeitSampleTargets.cmake)
if(sample_targets)
  run(${WORK_DIR}/build/sample_consumer ${WORK_DIR}/scene)
endif()

# The engine alone links no formats of files
execute_process(COMMAND ldd ${WORK_DIR}/build/engine_consumer OUTPUT_VARIABLE libraries)
if(libraries MATCHES "OpenEXR|blosc|Imath|embree|png")
  message(FATAL_ERROR "the engine links formats of files:\n${libraries}")
endif()

# and a host that wants the engine alone needs none of them, nor what the program needs, whether it
# finds the library or builds it
set(without "")
foreach(package OpenEXR Blosc CLI11 embree PNG)
  list(APPEND without -D CMAKE_DISABLE_FIND_PACKAGE_${package}=ON)
endforeach()
run(${CMAKE_COMMAND} -S ${PROJECT_DIR} -B ${WORK_DIR}/engine_consumer -G ${GENERATOR} ${settings} ${without}
  -D ENGINE_ONLY=ON)
run(${CMAKE_COMMAND} -S ${PROJECT_DIR}/../../.. -B ${WORK_DIR}/engine_only -G ${GENERATOR} ${without}
  -D SURFEIT_BUILD_CLOUDS=OFF -D SURFEIT_BUILD_TOOLS=OFF -D SURFEIT_BUILD_TESTS=OFF
  -D SURFEIT_BUILD_BENCH=OFF)

# From C, as a Makefile would build it
file(GLOB_RECURSE pc ${WORK_DIR}/prefix/*/surfeit.pc)
get_filename_component(pc_dir ${pc} DIRECTORY)
get_filename_component(lib_dir ${pc_dir} DIRECTORY)
set(ENV{PKG_CONFIG_PATH} ${pc_dir})
execute_process(COMMAND pkg-config --cflags --libs surfeit OUTPUT_VARIABLE pkg_flags RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "pkg-config does not find surfeit in ${pc_dir}")
endif()
separate_arguments(pkg_flags UNIX_COMMAND ${pkg_flags})
separate_arguments(c_flags UNIX_COMMAND "${flags}")
run(gcc -std=c99 -pedantic -Wall -Wextra -Werror ${c_flags} ${PROJECT_DIR}/consumer.c ${pkg_flags} -lm
  -Wl,-rpath,${lib_dir} -o ${WORK_DIR}/c_consumer)
run(${WORK_DIR}/c_consumer ${WORK_DIR}/scene)

# What the shared library shows to C: functions may come, none may go or be forgotten here
execute_process(COMMAND nm -D --defined-only ${lib_dir}/libsurfeit.so OUTPUT_VARIABLE symbols)
string(REGEX MATCHALL " T surfeit_[a-z_]+" functions "${symbols}")
list(TRANSFORM functions REPLACE " T " "")
list(SORT functions)
file(STRINGS ${PROJECT_DIR}/c_functions.txt expected)
if(NOT functions STREQUAL expected)
  message(FATAL_ERROR "C functions of the shared library: ${functions}\nexpected (c_functions.txt): ${expected}")
endif()
# and nothing of what is inside
if(symbols MATCHES "PacketGatherer|PageCache")
  message(FATAL_ERROR "the shared library shows what is inside")
endif()
