# Reads the headers that most files include once instead of in every file: half of what the host's build costs. With
#   -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON
# there are none, as in the preset of the fuzzers; every file must compile so, too.

# precompiled_headers(NAME [LIBS target...] HEADERS header...): a set of them, for targets with the same options.
function(precompiled_headers name)
  cmake_parse_arguments(arg "" "" "LIBS;HEADERS" ${ARGN})
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/generated/${name}.cpp CONTENT "")  # a target needs a source
  add_library(${name} OBJECT ${CMAKE_BINARY_DIR}/generated/${name}.cpp)
  target_link_libraries(${name} PRIVATE ballast_options ${arg_LIBS})
  target_precompile_headers(${name} PRIVATE ${arg_HEADERS})
endfunction()

# use_precompiled_headers(NAME folder...): for every program and library that these folders' CMakeLists.txt
# declare and that has none of its own.
function(use_precompiled_headers name)
  foreach(folder ${ARGN})
    get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
    foreach(target ${targets})
      get_target_property(type ${target} TYPE)
      get_target_property(own ${target} PRECOMPILE_HEADERS)
      if(NOT own AND type MATCHES "^(EXECUTABLE|STATIC_LIBRARY)$")
        target_precompile_headers(${target} REUSE_FROM ${name})
      endif()
    endforeach()
    get_property(below DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
    if(below)
      use_precompiled_headers(${name} ${below})
    endif()
  endforeach()
endfunction()

# What most files of each room include.
set(standard_headers <algorithm> <array> <cmath> <cstdint> <cstdio> <filesystem> <fstream> <functional> <iostream> <limits>
  <map> <memory> <numbers> <optional> <random> <span> <sstream> <string> <string_view> <utility> <vector>)
set(program_headers <Eigen/Core> <Eigen/Geometry> <lcm/lcm-cpp.hpp> ${standard_headers})
