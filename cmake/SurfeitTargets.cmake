# One static library per layer, with the warnings and sanitizers that the whole project uses.

# The install interface carries no warnings: they are for our code, not for our users' code.
add_library(surfeit_build_options INTERFACE)
target_compile_options(surfeit_build_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast -Wcast-align
  $<$<BOOL:${SURFEIT_WARNINGS_AS_ERRORS}>:-Werror>)
if(SURFEIT_SANITIZE)
  target_compile_options(surfeit_build_options INTERFACE -fsanitize=${SURFEIT_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(surfeit_build_options INTERFACE -fsanitize=${SURFEIT_SANITIZE})
endif()

# The include root of the rooms: each library has it to itself, whoever links one sees include/ alone. Tests
# and bench/internal, which look inside, link this as well.
add_library(surfeit_internals INTERFACE)
add_library(surfeit::internals ALIAS surfeit_internals)
target_include_directories(surfeit_internals INTERFACE ${PROJECT_SOURCE_DIR}/src)

# surfeit_join_sources(<target>): a unity build. Most of the time of a source goes into headers of others. Names
# at file scope must differ within a target, and from those of its headers, which they would hide from the
# sources after them. Sources with options of their own stay alone.
function(surfeit_join_sources target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${SURFEIT_UNITY_BUILD} UNITY_BUILD_BATCH_SIZE 8)
  if(SURFEIT_UNITY_BUILD)
    # Takes the sources that are joined for headers, where their classes may not use what only they see
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()

# surfeit_add_layer(<name> SOURCES ... LINKS ... [PRIVATE_LINKS ...])
function(surfeit_add_layer name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  add_library(surfeit_${name} STATIC ${ARG_SOURCES})
  add_library(surfeit::${name} ALIAS surfeit_${name})
  set_target_properties(surfeit_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  target_compile_features(surfeit_${name} PUBLIC cxx_std_20)
  target_include_directories(surfeit_${name}
    PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(surfeit_${name}
    PUBLIC ${ARG_LINKS}
    PRIVATE $<BUILD_INTERFACE:surfeit_build_options> $<BUILD_INTERFACE:surfeit::internals> ${ARG_PRIVATE_LINKS})
  surfeit_join_sources(surfeit_${name})
endfunction()

# surfeit_add_test(<layer> SOURCES ... LINKS ...): one GoogleTest program per layer.
function(surfeit_add_test layer)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(${layer}_test ${ARG_SOURCES})
  surfeit_join_sources(${layer}_test)
  # -O2 takes half as long again to compile and saves nothing: what takes time is in the libraries
  target_compile_options(${layer}_test PRIVATE -O1)
  target_include_directories(${layer}_test PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${layer}_test PRIVATE ${ARG_LINKS} surfeit::internals GTest::gmock GTest::gtest_main surfeit_build_options)
  target_compile_definitions(${layer}_test PRIVATE
    SURFEIT_TEST_SOURCE_DIR="${PROJECT_SOURCE_DIR}/tests"
    SURFEIT_SHARED_DATA_DIR="${PROJECT_SOURCE_DIR}/../shared/data")
  gtest_discover_tests(${layer}_test TEST_PREFIX "${layer}." DISCOVERY_TIMEOUT 60
    PROPERTIES TIMEOUT 600
    ENVIRONMENT "TSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/cmake/tsan.supp:atexit_sleep_ms=0")
endfunction()
