// Texts for the terminal about a controller's status.
#pragma once

#include <ballast/controller_status_t.hpp>
#include <ballast/plant_state_t.hpp>
#include <ballast/trip_t.hpp>
#include <cstdint>
#include <string>

#include "firmware/control/inputs.h"
#include "firmware/control/status.h"

namespace ballast::sil {

// "armed", "running", ..
std::string mode_text(std::int8_t mode);

// The monitor's verdict: "friction at t = 1.2 s: f_s/N was 0.36; allowed: <= 0.35". `where` comes after the values.
std::string verdict_text(const trip_t& trip, const std::string& where = "");

// The first of the controller's own faults: "step_overload: motor 1 in tick 4, ..". There must be one.
std::string fault_text(const controller_status_t& status);

// Why the operator's last command was not obeyed; empty: it was. `move`: what it asked for, if that is known and it was
// a move.
std::string refusal_text(const controller_status_t& status, const firmware::MoveRequest* move = nullptr);

// "the controller refuses the start: .."
std::string refused_text(const std::string& what, const std::string& refusal);

// "armed, masses at rest at 0, 2.04, 0.704 in tick 3764, the ball at (0.4, 0.2) m, 0 m/s". Masses in rail units; the
// ball where the plant has it, or where it is estimated, without its speed.
std::string status_text(const controller_status_t& status, const plant_state_t* plant = nullptr);

// Duration and prediction of the plan in the status: "1.2 s; predicted, ..".
std::string plan_text(const controller_status_t& status);

// How far the ball still rolls in a halt, once the controller has said it.
std::string halt_text(const controller_status_t& status);

// The commanded positions: "0.1, 2.2".
std::string positions_text(const controller_status_t& status);

// The first of the monitor's limits (monitor::MonitorLimits) that a plan is predicted to break: "least margin -0.2,
// allowed: >= 0"; empty: none.
std::string breach_text(const firmware::Prediction& plan, double friction_use, double min_normal_force_n);

// A plan's prediction: "predicted, ..: least N ..".
std::string predicted_text(const firmware::Prediction& plan);

// A line for a plan that left a margin far below the predicted one, with the reason; empty: it did not.
std::string far_below_text(const firmware::Prediction& plan, double seen_margin_min);

}  // namespace ballast::sil
