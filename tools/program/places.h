// The files that programs need at run time. An installation has them in a folder at a fixed place relative to the
// programs, usually ../share/ballast, so it may be moved as a whole. A build tree has them among its sources and in its
// build folder.
#pragma once

#include <filesystem>
#include <string>

namespace ballast::program {

// That folder. Empty: this program runs in a build tree.
[[nodiscard]] std::filesystem::path installed_data();

// The folder of the scenarios that ship.
[[nodiscard]] std::filesystem::path shipped_scenarios();

// The folder of the jars for lcm-spy.
[[nodiscard]] std::filesystem::path built_jars();

// "1.0.0".
[[nodiscard]] std::string version();

// "1.0.0 (commit 0123456789ab)". The commit is "unknown" where the sources were no clone of the repository. It is that
// of the last build of any program and stands in a file of its own, so that a commit changes no program and no log.
[[nodiscard]] std::string version_text();

}  // namespace ballast::program
