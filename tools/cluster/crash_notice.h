// Says, when this process crashes, which rows it was computing.
#pragma once

#include <cstdint>

namespace ballast::cluster {

// Catches SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT; after the notice the signal ends the process as before.
void announce_crashes(int rank);
// The rows that are computed now.
void set_rows_at_work(std::uint64_t first, std::uint64_t count);

}  // namespace ballast::cluster
