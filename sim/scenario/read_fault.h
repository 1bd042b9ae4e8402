// The [[fault]] tables of a scenario, and --fault, which adds one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/scenario/reader.h"

namespace ballast::sim {

inline constexpr const char* kFaultOption = "--fault";

// "KIND@TIME[:PARAM]": PARAM is VALUE, or KEY=VALUE of a [[fault]], or several of these between commas. Added to the
// tree as one more [[fault]]; an error leaves the tree as it was.
void add_fault(const std::string& text, Node& root, std::vector<ScenarioError>& errors);

// Of a scenario that is read but for its faults. Nothing if the table is faulty.
std::optional<Fault> read_fault(TableReader& table, const Scenario& scenario);

}  // namespace ballast::sim
