// Texts for the terminal about a controller's status.
#pragma once

#include <ballast/controller_status_t.hpp>
#include <cstdint>
#include <string>

#include "firmware/control/inputs.h"
#include "firmware/control/status.h"

namespace ballast::sil {

// "armed", "running", ..
std::string mode_text(std::int8_t mode);

// Why the operator's last command was not obeyed; empty: it was. `move`: what it asked for, if that is known and it was
// a move.
std::string refusal_text(const controller_status_t& status, const firmware::MoveRequest* move = nullptr);

// The first of the monitor's limits (monitor::MonitorLimits) that a plan is predicted to break: "least margin -0.2,
// allowed: >= 0"; empty: none.
std::string breach_text(const firmware::Prediction& plan, double friction_use, double min_normal_force_n);

// A plan's prediction: "predicted, ..: least N ..".
std::string predicted_text(const firmware::Prediction& plan);

// A line for a plan that left a margin far below the predicted one, with the reason; empty: it did not.
std::string far_below_text(const firmware::Prediction& plan, double seen_margin_min);

}  // namespace ballast::sil
