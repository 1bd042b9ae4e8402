// Checks of the machine. They need no privileges.
#pragma once

#include <string>

#include "tools/program/finding.h"

namespace ballast::doctor {

// Checks the route to the group of a "udpm://GROUP:PORT..." URL and that messages sent there come back. It uses a port
// of its own in that group, so it disturbs no run. A URL of another kind is only opened.
program::Finding check_multicast(const std::string& url);

// Checks the largest receive buffer that a program may use.
program::Finding check_receive_buffer();

// Checks the C++20 compiler for the Cortex-M7, including its headers and specs.
program::Finding check_cross_compiler();

// Checks that QEMU is installed and has the target's machine.
program::Finding check_qemu();

// Checks that there is an X display for lcm-spy.
program::Finding check_display();

}  // namespace ballast::doctor
