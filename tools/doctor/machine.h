// What Ballast needs of the machine, looked at without privileges.
#pragma once

#include <string>

#include "tools/program/finding.h"

namespace ballast::doctor {

// A route to the group of a "udpm://GROUP:PORT..." URL, and whether what is sent there comes back. Talks on the same
// group but a port of its own, so that no run is disturbed. Other URLs need neither, and are only opened.
program::Finding look_at_multicast(const std::string& url);

// The largest receive buffer a program may ask for.
program::Finding look_at_receive_buffer();

// C++20 for the Cortex-M7 of the emulated target, headers and specs included.
program::Finding look_at_cross_compiler();

// QEMU, and that it knows the target's machine.
program::Finding look_at_qemu();

// An X display for lcm-spy.
program::Finding look_at_display();

}  // namespace ballast::doctor
