// A run's summary as a tree, for programs that take single values of it.
#pragma once

#include <nlohmann/json.hpp>

#include "tools/sil/run.h"

namespace ballast::sil {

// summary.json before it is written.
nlohmann::ordered_json summary_tree(const sim::Scenario& scenario, const RunResult& result);

}  // namespace ballast::sil
