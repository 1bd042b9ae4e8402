// Processors that a thread may run on.
#pragma once

namespace ballast::program {

// Lets the calling thread run on all processors that this process was given at its start. A new thread otherwise keeps
// to those of the thread that starts it. Where the system refuses, nothing changes but the speed.
void use_all_processors();

}  // namespace ballast::program
