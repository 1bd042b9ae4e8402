// Checks a scenario's tree and makes the Scenario.
#pragma once

#include "sim/scenario/reader.h"

namespace ballast::sim {

// A name that can be that of a folder of results.
inline constexpr const char* kFolderNames =
    "1 to 64 of letters, digits, - _ . and no . at the start (it names a folder)";
bool usable_as_folder(const std::string& name);
// The file's name with `_` for every character that such a name may not have.
std::string default_name(const std::string& source_name);

// Adds every fault to the context's errors; the result is meaningful only if there is none. Its id is not set.
Scenario check_scenario(const Node& root, ReadContext& context);

}  // namespace ballast::sim
