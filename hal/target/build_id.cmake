# Writes a header with a number that is the same for the same sources: of everything that decides what the firmware
# computes and says. cmake -DROOT=... -DOUTPUT=... -P build_id.cmake
cmake_minimum_required(VERSION 3.25)
file(GLOB_RECURSE sources RELATIVE ${ROOT} ${ROOT}/firmware/*.h ${ROOT}/firmware/*.cpp ${ROOT}/hal/target/*.h
     ${ROOT}/hal/target/*.cpp)
list(APPEND sources hal/control_loop.h)
list(SORT sources)
set(all "")
foreach(source ${sources})
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
