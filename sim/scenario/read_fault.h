// The [[fault]] tables of a scenario, and --fault, which adds one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/scenario/reader.h"

namespace ballast::sim {

inline constexpr const char* kFaultOption = "--fault";

// Adds "KIND@TIME[:PARAM]" to the tree as one more [[fault]]. PARAM is VALUE, KEY=VALUE, or several of these separated
// by commas. An error leaves the tree unchanged.
void add_fault(const std::string& text, Node& root, std::vector<ScenarioError>& errors);

// Reads one [[fault]] of a scenario whose other tables have been read. nullopt: an error was reported.
std::optional<Fault> read_fault(TableReader& table, const Scenario& scenario);

}  // namespace ballast::sim
