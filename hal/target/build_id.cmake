# The number of the firmware's sources, which both ends of a link compare: a hash of all files a microcontroller's program
# is built from and of the files with its compile options. All boards share one number, because a host's program talks to
# any of them.
#
# Included, this file sets build_id_sources. As a script (cmake -DROOT=... -DOUTPUT=... -P build_id.cmake) it writes a
# header with the number.
cmake_minimum_required(VERSION 3.25)

if(CMAKE_SCRIPT_MODE_FILE)
  set(watch "")
else()
  set(ROOT ${PROJECT_SOURCE_DIR})
  set(watch CONFIGURE_DEPENDS)
endif()

# Every folder of hal/ except the host's backends belongs to boards.
file(GLOB_RECURSE build_id_sources RELATIVE ${ROOT} ${watch} ${ROOT}/firmware/*.h ${ROOT}/firmware/*.cpp ${ROOT}/hal/*.h
     ${ROOT}/hal/*.cpp ${ROOT}/hal/*.ld ${ROOT}/hal/*.cmake ${ROOT}/hal/CMakeLists.txt ${ROOT}/firmware/CMakeLists.txt
     ${ROOT}/firmware/*.cmake)
list(FILTER build_id_sources EXCLUDE REGEX "^hal/(lcm|lockstep)/")
# The files with compile options.
list(APPEND build_id_sources CMakeLists.txt tools/toolchain/arm-none-eabi.cmake)
list(SORT build_id_sources)

if(CMAKE_SCRIPT_MODE_FILE)
  set(all "")
  foreach(source ${build_id_sources})
    file(SHA256 ${ROOT}/${source} hash)
    string(APPEND all "${source} ${hash}\n")
  endforeach()
  string(SHA256 id "${all}")
  string(SUBSTRING ${id} 0 16 id)
  file(WRITE ${OUTPUT}
"// Made by build_id.cmake.
#pragma once

#include <cstdint>

namespace ballast::hal::target {

inline constexpr std::uint64_t kSourcesId = 0x${id};

}  // namespace ballast::hal::target
")
endif()
