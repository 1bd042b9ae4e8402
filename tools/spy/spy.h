// lcm-spy with Ballast's message types. Debian's own launcher knows neither these nor any Java after 8.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/program/finding.h"

namespace ballast::spy {

struct SpyOptions {
  std::string url;
  std::filesystem::path types_jar;  // empty: the one that was built with this program
  int heap_mb = 512;                // the Java heap at most; an hour of plots takes a fraction of it
};

// Java, LCM's and the plots' jars, launcher and types jar: whether they are there. Starts Java once, for its version.
std::vector<program::Finding> look_for_parts(const SpyOptions& options);

// Whether the types in the jar, as lcm-spy finds them, are those of this build; starts Java. Only if all parts are
// there.
program::Finding look_at_types(const SpyOptions& options);

// Becomes lcm-spy. Returns only if Java cannot be started, with the reason; that there are no types, or no display, is
// said by the launcher, which then ends with status 2.
std::string become_spy(const SpyOptions& options);

}  // namespace ballast::spy
