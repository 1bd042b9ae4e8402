// What the commands that speak to a controller on a bus have in common.
#pragma once

#include <string>

#include "tools/sil/bus_operator.h"

namespace ballast {

// Prints the trouble and gives the exit status for it.
int bus_trouble(const sil::BusOperator& operator_end);

// Tells it; nullopt: obeyed, and status() is the controller's answer. Otherwise the exit status, and why is printed.
std::optional<int> tell(sil::BusOperator& operator_end, const firmware::OperatorInput& input, const std::string& what);

// Says how long the plan in the status takes and what is predicted of it: "1.2 s; predicted, ..".
std::string plan_text(const controller_status_t& status);

// "0.1, 2.2", the commanded positions.
std::string positions_text(const controller_status_t& status);

}  // namespace ballast
