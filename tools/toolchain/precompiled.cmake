# Precompiled headers: the compiler reads the headers that most files include once instead of in every file, which halves
# the time of the host's build. Every file must also compile without them:
#   -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON

# precompiled_headers(NAME [LIBS target...] HEADERS header...): a set of precompiled headers. All targets that use it need
# the same compiler options.
function(precompiled_headers name)
  cmake_parse_arguments(arg "" "" "LIBS;HEADERS" ${ARGN})
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/generated/${name}.cpp CONTENT "")  # a target needs a source
  add_library(${name} OBJECT ${CMAKE_BINARY_DIR}/generated/${name}.cpp)
  target_link_libraries(${name} PRIVATE ballast_options ${arg_LIBS})
  target_precompile_headers(${name} PRIVATE ${arg_HEADERS})
endfunction()

# use_precompiled_headers(NAME folder...): gives the set to every program and library that the CMakeLists.txt of these
# folders declare, unless it has another set.
function(use_precompiled_headers name)
  foreach(folder ${ARGN})
    get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
    foreach(target ${targets})
      get_target_property(type ${target} TYPE)
      get_target_property(other ${target} PRECOMPILE_HEADERS_REUSE_FROM)
      if(NOT other AND type MATCHES "^(EXECUTABLE|STATIC_LIBRARY)$")
        target_precompile_headers(${target} REUSE_FROM ${name})
      endif()
    endforeach()
    get_property(below DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
    if(below)
      use_precompiled_headers(${name} ${below})
    endif()
  endforeach()
endfunction()

# The headers that most files of a room include.
set(standard_headers <algorithm> <array> <cmath> <cstdint> <cstdio> <filesystem> <fstream> <functional> <iostream> <limits>
  <map> <memory> <numbers> <optional> <random> <span> <sstream> <string> <string_view> <utility> <vector>)
set(program_headers <Eigen/Core> <Eigen/Geometry> <lcm/lcm-cpp.hpp> ${standard_headers})
