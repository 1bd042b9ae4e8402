# The Debian packages of the components, by CPack: `tools/package` makes them.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "Ballast <ballast@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Firmware, simulation and monitor for rolling-ball robots")
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)  # a package for each component
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_COMPONENTS_ALL programs development)
set(same_version "ballast (= ${PROJECT_VERSION})")

# dpkg-shlibdeps names the libraries that programs are linked with, but not the one that is loaded when it is needed.
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME ballast)
set(CPACK_COMPONENT_PROGRAMS_DESCRIPTION "The program ballast, scenarios, manual pages and shell completion.")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
file(REAL_PATH ${BALLAST_NETCDF} netcdf_file)
execute_process(COMMAND dpkg-query --search ${netcdf_file} OUTPUT_VARIABLE owner ERROR_QUIET)
string(REGEX REPLACE "[:,].*" "" netcdf_package "${owner}")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_DEPENDS "python3, python3-numpy")
if(netcdf_package)
  string(APPEND CPACK_DEBIAN_PROGRAMS_PACKAGE_DEPENDS ", ${netcdf_package}")
endif()
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS "python3-matplotlib, python3-websockets")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS "default-jre, libjchart2d-java, liblcm-java, qemu-system-arm")  # ballast spy, --firmware

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME ballast-dev)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Headers, static libraries and examples for find_package(ballast).")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${same_version}, libeigen3-dev, libfmt-dev, libglib2.0-dev, liblcm-dev, \
libtomlplusplus-dev, nlohmann-json3-dev, pkg-config")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "gcc-arm-none-eabi, libstdc++-arm-none-eabi-newlib")

if(TARGET ballast_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-ballast)
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "The package ballast for Python.")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  set(Python_EXECUTABLE /usr/bin/python3)  # the one that the package is built for
  find_package(Python COMPONENTS Interpreter Development.Module REQUIRED)
  math(EXPR next_minor "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "${same_version}, python3 (>= 3.${Python_VERSION_MINOR}), \
python3 (<< 3.${next_minor}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "python3-matplotlib")
  # Compiled modules are not in the package, so it makes and removes them itself.
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_SOURCE_DIR}/python/postinst ${CMAKE_CURRENT_SOURCE_DIR}/python/prerm)
endif()

if(TARGET ballast-sweep)
  list(APPEND CPACK_COMPONENTS_ALL cluster)
  set(CPACK_DEBIAN_CLUSTER_PACKAGE_NAME ballast-cluster)
  set(CPACK_COMPONENT_CLUSTER_DESCRIPTION "The program ballast-sweep, a sweep on the ranks of an MPI program.")
  set(CPACK_DEBIAN_CLUSTER_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_CLUSTER_PACKAGE_DEPENDS "${same_version}, openmpi-bin")
  if(netcdf_package)
    string(APPEND CPACK_DEBIAN_CLUSTER_PACKAGE_DEPENDS ", ${netcdf_package}")
  endif()
endif()

include(CPack)
