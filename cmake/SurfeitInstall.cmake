# Installs the headers, static libraries of all rooms and a shared one, and what finds them:
# find_package(surfeit COMPONENTS engine clouds sample view) and pkg-config.
include(CMakePackageConfigHelpers)

install(DIRECTORY include/surfeit DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(TARGETS ${SURFEIT_ENGINE_TARGETS} EXPORT surfeitEngineTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
if(SURFEIT_BUILD_CLOUDS)
  install(TARGETS ${SURFEIT_CLOUD_TARGETS} surfeit EXPORT surfeitCloudsTargets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endif()
if(SURFEIT_BUILD_SAMPLE)
  install(TARGETS surfeit_sample EXPORT surfeitSampleTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endif()
if(SURFEIT_BUILD_VIEW)
  install(TARGETS surfeit_view EXPORT surfeitViewTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endif()
install(TARGETS surfeit_shared EXPORT surfeitSharedTargets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
if(SURFEIT_BUILD_TOOLS)
  install(TARGETS surfeit_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

set(surfeit_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/surfeit)
install(EXPORT surfeitEngineTargets NAMESPACE surfeit:: DESTINATION ${surfeit_package_dir})
install(EXPORT surfeitSharedTargets NAMESPACE surfeit:: DESTINATION ${surfeit_package_dir})
if(SURFEIT_BUILD_CLOUDS)
  install(EXPORT surfeitCloudsTargets NAMESPACE surfeit:: DESTINATION ${surfeit_package_dir})
endif()
if(SURFEIT_BUILD_SAMPLE)
  install(EXPORT surfeitSampleTargets NAMESPACE surfeit:: DESTINATION ${surfeit_package_dir})
endif()
if(SURFEIT_BUILD_VIEW)
  install(EXPORT surfeitViewTargets NAMESPACE surfeit:: DESTINATION ${surfeit_package_dir})
endif()
configure_package_config_file(cmake/surfeitConfig.cmake.in surfeitConfig.cmake
  INSTALL_DESTINATION ${surfeit_package_dir})
write_basic_package_version_file(surfeitConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  ${CMAKE_CURRENT_BINARY_DIR}/surfeitConfig.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/surfeitConfigVersion.cmake
  cmake/FindBlosc.cmake
  cmake/Findstb.cmake
  cmake/FindxxHash.cmake
  DESTINATION ${surfeit_package_dir})

file(RELATIVE_PATH SURFEIT_PREFIX_FROM_PC "/prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/prefix")
configure_file(cmake/surfeit.pc.in surfeit.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/surfeit.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
