// Starts lcm-spy with Ballast's message types. Debian's launcher does not know them and does not support Java after 8.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/program/finding.h"

namespace ballast::spy {

struct SpyOptions {
  std::string url;
  std::filesystem::path types_jar;  // empty: the one built with this program
  int heap_mb = 512;                // limit of the Java heap; an hour of plots needs a fraction of it
};

// Checks that Java, the jars of LCM and of the plots, the launcher and the types jar are installed. Starts Java once,
// for its version.
std::vector<program::Finding> check_parts(const SpyOptions& options);

// Checks that the types that lcm-spy finds in the jar are those of this build. Starts Java; needs all parts.
program::Finding check_types(const SpyOptions& options);

// Replaces this process with lcm-spy. Returns only if Java cannot be started, with the reason. Without types or a
// display the launcher prints that and ends with status 2.
std::string become_spy(const SpyOptions& options);

}  // namespace ballast::spy
