# OpenVDB's own library, which tests and benches compare with: OpenVDB::openvdb where it is installed.
# Debian ships a find module but no package configuration. The thread sanitizer does not see into it.
macro(surfeit_find_openvdb)
  find_path(OpenVDB_MODULE_DIR FindOpenVDB.cmake
    PATHS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB /usr/lib/cmake/OpenVDB
      /usr/lib64/cmake/OpenVDB /usr/local/lib/cmake/OpenVDB
    NO_CMAKE_FIND_ROOT_PATH)
  mark_as_advanced(OpenVDB_MODULE_DIR)
  if(OpenVDB_MODULE_DIR AND NOT SURFEIT_SANITIZE MATCHES "thread")
    list(APPEND CMAKE_MODULE_PATH ${OpenVDB_MODULE_DIR})
    find_package(OpenVDB REQUIRED COMPONENTS openvdb)
  endif()
endmacro()
