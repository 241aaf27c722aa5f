# Installs the headers, the layer libraries and a package configuration: find_package(surfeit).
include(CMakePackageConfigHelpers)

install(DIRECTORY include/surfeit DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(TARGETS surfeit surfeit_core surfeit_io surfeit_cache surfeit_octree surfeit_gather surfeit_brick
  EXPORT surfeitTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
if(SURFEIT_BUILD_TOOLS)
  install(TARGETS surfeit_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

set(surfeit_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/surfeit)
install(EXPORT surfeitTargets NAMESPACE surfeit:: DESTINATION ${surfeit_package_dir})
configure_package_config_file(cmake/surfeitConfig.cmake.in surfeitConfig.cmake
  INSTALL_DESTINATION ${surfeit_package_dir})
write_basic_package_version_file(surfeitConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  ${CMAKE_CURRENT_BINARY_DIR}/surfeitConfig.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/surfeitConfigVersion.cmake
  cmake/FindBlosc.cmake
  cmake/FindxxHash.cmake
  DESTINATION ${surfeit_package_dir})
