// Reads a sweep file. Every error is reported with file, line, key, value and what is allowed.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/sweep/spec.h"

namespace ballast::sweep {

// Reads the sweep file and the scenario that it names: a file beside it, or one that ships. nullopt: `errors` says why.
[[nodiscard]] std::optional<Spec> read_spec(const std::filesystem::path& file, std::vector<sim::ScenarioError>& errors);

// The same from a text. `folder` is where the scenario may lie.
[[nodiscard]] std::optional<Spec> parse_spec(const std::string& toml, const std::string& source,
                                             const std::filesystem::path& folder,
                                             std::vector<sim::ScenarioError>& errors);

// Reads the scenario of a sweep with its settings, and reports what no row can have: keys and values that the
// scenario's check refuses, distributions of numbers for texts.
void complete_spec(const std::string& scenario_file, Spec& spec, std::vector<sim::ScenarioError>& errors);

}  // namespace ballast::sweep
