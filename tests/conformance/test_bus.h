// A bus of a test's own.
#pragma once

#include <unistd.h>

#include <string>

namespace ballast::hal::test {

// Tests run at the same time, each in its own process: the pid keeps their ports apart, below those
// the system hands out itself, and apart from those of tests/sil/shell.h.
inline std::string test_bus_url() {
  return "udpm://239.255.76.67:" + std::to_string(12000 + getpid() % 8000) + "?ttl=0";
}

}  // namespace ballast::hal::test
