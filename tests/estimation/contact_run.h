// Runs of a scenario in this process, recorded tick by tick as the estimation on board sees them, with the truth.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/control/inputs.h"
#include "firmware/estimation/estimate.h"
#include "firmware/model/ball.h"
#include "sim/scenario/scenario.h"

namespace ballast::contact_test {

struct RecordedTick {
  firmware::Sensors sensors;
  firmware::MassMotion commanded;  // at the start of the tick
  Eigen::Quaterniond orientation;  // true
  double normal_force_n;
  double static_friction_n;
  Eigen::Vector2d friction_force_W_n;
  double slip_mps;  // speed of the contact point, 0 where it rolls
  int regime;       // contact_t::REGIME_
};

struct RecordedRun {
  firmware::BallParams ball;
  firmware::EstimationParams params;
  double control_period_s = 0;
  double static_friction = 0;
  std::vector<RecordedTick> ticks;
};

// What the estimation knows of a scenario's sensors.
firmware::EstimationParams estimation_params(const sim::Scenario& scenario);

// Reads sim/scenarios/NAME.toml with overrides and faults, and runs it. A run that cannot be read or does not work has
// no ticks, and `error` says why.
RecordedRun record(const std::string& name, const std::vector<std::string>& overrides,
                   const std::vector<std::string>& faults, std::string& error);

}  // namespace ballast::contact_test
