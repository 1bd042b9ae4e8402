// Parts shared by the commands that send to a controller on a bus.
#pragma once

#include <string>

#include "tools/sil/bus_operator.h"

namespace ballast {

// Prints the operator's trouble. Returns the exit status.
int bus_trouble(const sil::BusOperator& operator_end);

// Sends an operator's command. nullopt: the controller has obeyed, and status() is its answer. Otherwise the exit
// status; the reason is printed.
std::optional<int> tell(sil::BusOperator& operator_end, const firmware::OperatorInput& input, const std::string& what);

}  // namespace ballast
