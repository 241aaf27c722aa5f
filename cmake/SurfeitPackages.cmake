# Debian packages, one per component: `cpack -G DEB` in a build folder. So far the package of Python.
set(CPACK_COMPONENTS_ALL "")
if(SURFEIT_BUILD_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()

set(CPACK_PACKAGE_NAME surfeit)
set(CPACK_PACKAGE_VENDOR "Surfeit")
set(CPACK_PACKAGE_CONTACT "Surfeit <surfeit@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)

# A module of one minor version of Python alone
if(SURFEIT_BUILD_PYTHON)
  math(EXPR surfeit_next_python "${Python3_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-surfeit)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
    "python3 (>= 3.${Python3_VERSION_MINOR}), python3 (<< 3.${surfeit_next_python}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-tqdm, python3-matplotlib")
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Out-of-core gathers over huge surfel clouds, from numpy arrays")
endif()
include(CPack)
