// summary.json.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tools/summary/coast.h"
#include "tools/summary/required_friction.h"
#include "tools/summary/summary_parts.h"
#include "tools/summary/summary_tree.h"

namespace ballast::sil {

namespace {

using Json = nlohmann::ordered_json;

Json end_stop_json(const sim::EndStopRecord& record) {
  if (record.touches == 0) return nullptr;
  Json outside = nullptr;
  if (record.outside_ball_m > 0) outside = {{"depth", record.outside_ball_m}, {"first_time", record.outside_ball_s}};
  return {{"touches", record.touches},
          {"first_time", record.first_s},
          {"max_force", record.max_force_n},
          {"outside_ball", outside}};
}

const char* overload_error(int error) {
  switch (error) {
    case controller_status_t::OVERLOAD_TOO_MANY_STEPS:
      return "too_many_steps";
    case controller_status_t::OVERLOAD_TOO_MANY_BURSTS:
      return "too_many_bursts";
    case controller_status_t::OVERLOAD_TOO_FAST:
      return "too_fast";
    default:
      return "none";
  }
}

Json fault_json(const sim::Fault& fault) {
  const sim::FaultKindInfo& kind = info(fault.kind);
  Json j{{"kind", kind.name}, {"layer", to_string(kind.layer)}, {"time", fault.time_s}};
  j["end"] = std::isfinite(fault.end_s) ? Json(fault.end_s) : Json(nullptr);
  j["value"] = kind.value_means[0] != '\0' ? Json(fault.value) : Json(nullptr);
  if (!fault.channel.empty()) j["channel"] = fault.channel;
  if (fault.peer) j["peer"] = to_string(*fault.peer);
  if (kind.layer == sim::FaultLayer::kSensor) {
    j["sensor"] = to_string(fault.sensor);
    if (fault.axis >= 0) j["axis"] = fault.axis;
  }
  if (kind.layer == sim::FaultLayer::kMotor) j["mass"] = fault.mass;
  if (fault.kind == sim::FaultKind::kPush) {
    j["direction"] = {fault.direction_W[0], fault.direction_W[1], fault.direction_W[2]};
  }
  return j;
}

Json finite_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json plan_json(const std::optional<PlanRecord>& plan) {
  if (!plan) return nullptr;
  return {{"start", plan->start_s},
          {"duration", plan->predicted.duration_s},
          {"predicted_for", plan->predicted.horizon_s},
          {"predicted_normal_force_min", finite_or_null(plan->predicted.normal_force_min_n)},
          {"predicted_mu_required_max", finite_or_null(plan->predicted.mu_required_max)},
          {"predicted_margin_min", finite_or_null(plan->predicted.margin_min)},
          {"margin_min", plan->seen_margin_min ? finite_or_null(*plan->seen_margin_min) : Json(nullptr)}};
}

Json move_end_json(const sim::Scenario& scenario, const RunResult& result) {
  if (!result.move_end) return nullptr;
  Json masses = Json::array();
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const double target = result.move_end->asked.target_position[i];
    masses.push_back({{"asked", asked(*result.move_end, i) ? Json(target) : Json(nullptr)},
                      {"position", result.final_sample.mass_position[i]}});
  }
  return {{"arrived", arrived(result)}, {"masses", masses}};
}

Json deviation_json(const Deviation& deviation) {
  return {{"difference", finite_or_null(deviation.difference())},
          {"time", deviation.time_s},
          {"real", finite_or_null(deviation.real)},
          {"commanded", finite_or_null(deviation.commanded)}};
}

// null where nothing was commanded.
Json motor_share_json(const RunResult& result) {
  const MotorShare& share = result.motor_share;
  if (!share.seen()) return nullptr;
  const sim::Extremum &real = result.extrema.mu_required_max, &commanded = share.commanded_mu_required_max;
  return {{"normal_force", deviation_json(share.normal_force_n)},
          {"static_friction", deviation_json(share.static_friction_n)},
          {"mu_required", deviation_json(share.mu_required)},
          {"mu_required_max",
           {{"real", finite_or_null(real.value)},
            {"real_time", real.time_s},
            {"commanded", finite_or_null(commanded.value)},
            {"commanded_time", commanded.time_s}}}};
}

Json step_timing_json(const StepTimingRecord& record) {
  const CheckedSteps sums = checked_steps(record);
  Json motors = Json::array();
  for (const auto& m : record.motors) {
    const auto steps = static_cast<double>(std::max<std::int64_t>(m.checked_steps, 1));
    motors.push_back({{"checked_steps", m.checked_steps},
                      {"steps_outside_the_motion", m.structural_steps},
                      {"touches", m.touches / 2},
                      {"tolerance_us", m.tolerance_us},
                      {"max_error_us", m.max_error_us},
                      {"rms_error_us", std::sqrt(m.sum_square_us2 / steps)},
                      {"least_spacing_us", m.least_spacing_us > 0 ? Json(m.least_spacing_us) : Json(nullptr)},
                      {"least_turn_us", m.least_turn_us > 0 ? Json(m.least_turn_us) : Json(nullptr)},
                      {"histogram", m.histogram}});
  }
  Json violations = Json::array();
  if (record.violation) {
    const auto& v = *record.violation;
    violations.push_back({{"kind", stepcheck::to_string(v.kind)},
                          {"motor", record.violation_motor},
                          {"tick", v.tick},
                          {"timer_ticks", v.timer_ticks},
                          {"value", v.value},
                          {"limit", v.limit},
                          {"text", v.text()}});
  }
  Json json;
  json["checked_steps"] = sums.checked;
  json["plan_steps"] = record.plan_steps;
  json["steps_outside_the_motion"] = sums.structural;
  json["motion_left_tick"] = record.motion_left_tick ? Json(*record.motion_left_tick) : Json(nullptr);
  json["max_error_us"] = sums.max_error_us;
  json["motors"] = motors;
  json["violations"] = violations;
  return json;
}

// A motor without a winding has only the mechanical fields.
Json energy_json(const sim::Motor& motor, const sim::MotorEnergy& energy) {
  const bool known = motor.has_winding();
  return {{"electrical", known ? Json(energy.electrical_j) : Json(nullptr)},
          {"copper_loss", known ? Json(energy.copper_j) : Json(nullptr)},
          {"friction_loss", energy.friction_j},
          {"work", energy.work_j},
          {"stored", energy.stored_j}};
}

Json parameters_json(const sim::Motor& motor) {
  const auto of_winding = [&](double value) { return motor.has_winding() ? Json(value) : Json(nullptr); };
  return {{"shaft_ratio", motor.shaft_ratio},
          {"steps_per_revolution", motor.steps_per_revolution},
          {"microsteps", motor.microsteps},
          {"holding_torque", motor.holding_torque_nm},
          {"detent_torque", motor.detent_torque_nm},
          {"rotor_inertia", motor.rotor_inertia_kgm2},
          {"viscous_damping", motor.viscous_damping_nms},
          {"corner_speed", motor.corner_speed_radps},
          {"rated_current", of_winding(motor.rated_current_a)},
          {"resistance", of_winding(motor.resistance_ohm)},
          {"inductance", of_winding(motor.inductance_h)},
          {"supply_voltage", of_winding(motor.supply_voltage_v)}};
}

// One entry per mass; null for a mass on a trajectory, which has no motor.
Json motors_json(const sim::Scenario& scenario, const RunResult& result) {
  const bool stepper = scenario.run.actuation == sim::Actuation::kStepper;
  Json motors = Json::array();
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    if (!scenario.masses[i].trajectory.times_s.empty()) {
      motors.push_back(nullptr);
      continue;
    }
    const sim::Motor& motor = scenario.masses[i].motor;
    motors.push_back({{"steps", result.motors[i].steps},
                      {"lost_steps", result.final_sample.lost_steps[i]},
                      {"slips", result.motors[i].slips},
                      {"steps_behind", stepper ? Json(result.motors[i].steps_behind) : Json(nullptr)},
                      {"max_step_rate", result.motors[i].max_step_rate_hz},
                      {"max_torque", result.motor_extrema[i].max_torque_nm},
                      {"torque_margin", result.motor_extrema[i].torque_margin},
                      {"energy", stepper ? energy_json(motor, result.motor_energy[i]) : Json(nullptr)},
                      {"end_stop", end_stop_json(result.end_stops[i])},
                      {"parameters", parameters_json(motor)}});
    if (!scenario.faults.empty()) motors.back()["undelivered_steps"] = result.motors[i].undelivered_steps;
  }
  return motors;
}

Json final_json(const sim::Scenario& scenario, const sim::Plant::Sample& f) {
  Json positions = Json::array(), velocities = Json::array();
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    positions.push_back(f.mass_position[i]);
    velocities.push_back(f.mass_velocity[i]);
  }
  return {{"mass_position", positions},
          {"mass_velocity", velocities},
          {"orientation", {f.orientation[0], f.orientation[1], f.orientation[2], f.orientation[3]}},
          {"angular_velocity",
           {f.angular_velocity_B_radps[0], f.angular_velocity_B_radps[1], f.angular_velocity_B_radps[2]}},
          {"position", {f.position_W_m[0], f.position_W_m[1], f.position_W_m[2]}},
          {"velocity", {f.velocity_W_mps[0], f.velocity_W_mps[1], f.velocity_W_mps[2]}}};
}

Json regimes_json(const RunResult& result) {
  Json regimes = Json::array();
  for (std::size_t i = 0; i < result.regimes.size(); ++i) {
    const bool last = i + 1 == result.regimes.size();
    regimes.push_back({{"regime", regime_name(result.regimes[i].regime)},
                       {"start", result.regimes[i].time_s},
                       {"end", last ? result.final_sample.time_s : result.regimes[i + 1].time_s}});
  }
  return regimes;
}

Json impacts_json(const RunResult& result) {
  Json impacts = Json::array();
  for (const auto& impact : result.impacts) {
    impacts.push_back({{"time", impact.time_s},
                       {"normal_impulse", impact.normal_impulse_ns},
                       {"friction_impulse", impact.friction_impulse_ns},
                       {"sticking", impact.sticking}});
  }
  return impacts;
}

Json controller_trip_json(const ControllerTrip& trip) {
  Json json = {{"cause", fault_cause(trip.faults)},
               {"time", trip.time_s},
               {"tick", trip.tick},
               {"value", trip.faults},
               {"limit", 0},
               {"latency_ticks", nullptr}};
  if (const auto& status = trip.status; status.overload_error != 0) {
    json["value"] = finite_or_null(status.overload_value);
    json["limit"] = status.overload_limit;
    json["motor"] = status.overload_motor;
    json["error"] = overload_error(status.overload_error);
    json["steps_of_tick"] = status.overload_tick;
  }
  if (const int mass = mass_at_its_end(trip); mass >= 0) json["motor"] = mass;
  json["history"] = Json::array();
  for (const auto& command : trip.history) {
    Json steps = Json::array();
    for (int i = 0; i < command.motor_count; ++i) steps.push_back(command.steps[i]);
    json["history"].push_back({{"tick", command.tick}, {"steps", steps}, {"bursts", command.burst_count}});
  }
  return json;
}

Json monitor_trip_json(const trip_t& trip) {
  return {{"cause", trip_cause(trip.cause)},
          {"time", trip.trip_time_s},
          {"tick", trip.trip_tick},
          {"value", finite_or_null(trip.value)},
          {"limit", finite_or_null(trip.limit)}};
}

Json trip_json(const RunResult& result) {
  const bool monitor_tripped = result.trip.tripped != 0;
  if (controller_tripped_first(result)) {
    Json json = controller_trip_json(*result.controller_trip);
    if (monitor_tripped) json["monitor"] = monitor_trip_json(result.trip);
    return json;
  }
  if (!monitor_tripped) return nullptr;
  Json json = monitor_trip_json(result.trip);
  json["latency_ticks"] = result.latency_ticks ? Json(*result.latency_ticks) : Json(nullptr);
  return json;
}

// null where the controller has estimated nothing.
Json estimate_json(const RunResult& result) {
  if (!result.estimate) return nullptr;
  const EstimateErrors& e = *result.estimate;
  const auto measured = [](const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); };
  return {{"tilt_rms", e.tilt_rms_rad},
          {"gyro_bias_error", e.gyro_bias_error_radps},
          {"position_rms", e.position_rms_m},
          {"yaw_error", e.yaw_error_rad},
          {"friction_rms", measured(e.friction_rms)},
          {"friction_error", measured(e.friction_error)}};
}

Json refused_json(const RefusedMessages& refused) {
  return {{"malformed", refused.here.malformed}, {"foreign", refused.here.foreign},
          {"repeated", refused.here.repeated},   {"old", refused.here.old},
          {"dropped", refused.here.dropped},     {"by_controller", refused.by_controller}};
}

}  // namespace

namespace {

// Only runs of a scenario with [believed] have it.
Json belief_json(const RunResult& result) {
  const BeliefPrediction& p = *result.belief;
  const sim::ContactExtrema& x = p.extrema;
  const Eigen::Vector3d off_m = result.final_sample.position_W_m - p.position_W_m;
  return {{"time", p.time_s},
          {"holds", p.end == sim::PhysicsEnd::kNone},
          {"mu_required", {{"max", finite_or_null(x.mu_required_max.value)}, {"time", x.mu_required_max.time_s}}},
          {"normal_force", {{"min", x.normal_force_min.value}, {"min_time", x.normal_force_min.time_s}}},
          {"static_friction", {{"max", x.static_friction_max.value}, {"time", x.static_friction_max.time_s}}},
          {"position", {p.position_W_m[0], p.position_W_m[1], p.position_W_m[2]}},
          {"position_error", off_m.norm()}};
}

// null where the scenario has no plan.
Json tracking_json(const RunResult& result) {
  if (!result.tracking) return nullptr;
  const TrackingRecord& t = *result.tracking;
  return {{"rms", t.rms_m},
          {"max", t.max_m},
          {"final", t.final_m},
          {"cross_track_rms", t.cross_track_rms_m},
          {"path_length", t.path_length_m},
          {"delay", t.delay_s}};
}

// null where the controller is not governed.
Json governor_json(const RunResult& result) {
  if (!result.governor) return nullptr;
  const GovernorRecord& g = *result.governor;
  return {{"bent", g.share(g.bent_ticks)},
          {"largest_bend", g.largest_bend},
          {"backup", g.share(g.backup_ticks)},
          {"motor_allowance", g.motor_allowance},
          {"least_margin", g.least_margin}};
}

}  // namespace

Json summary_tree(const sim::Scenario& scenario, const RunResult& result) {
  const auto& x = result.extrema;
  const auto& f = result.final_sample;
  Json j;
  j["scenario"] = scenario.name;
  j["actuation"] = to_string(scenario.run.actuation);
  j["seed"] = scenario.seed;
  j["duration"] = scenario.duration_s;
  j["control_period"] = scenario.run.control_period_s;
  j["surface"] = {{"static_friction", finite_or_null(scenario.surface.static_friction)},
                  {"kinetic_friction", finite_or_null(scenario.surface.kinetic_friction)}};
  j["envelope"] = {{"min_normal_force", scenario.envelope.min_normal_force_n},
                   {"friction_use", scenario.envelope.friction_use}};
  // Only runs with faults have these fields.
  if (!scenario.faults.empty()) {
    j["faults"] = Json::array();
    for (const sim::Fault& fault : scenario.faults) j["faults"].push_back(fault_json(fault));
    j["missing_commands"] = result.missing_commands;
  }
  j["end"] = {{"reason", to_string(result.end_reason)}, {"time", f.time_s}};
  if (!result.end_text.empty()) j["end"]["text"] = result.end_text;
  if (result.end_reason == EndReason::kTripped) j["end"]["masses_at_rest"] = result.masses_rested;
  j["mu_required"] = {{"max", finite_or_null(x.mu_required_max.value)}, {"time", x.mu_required_max.time_s}};
  j["normal_force"] = {{"min", x.normal_force_min.value},
                       {"min_time", x.normal_force_min.time_s},
                       {"max", x.normal_force_max.value},
                       {"max_time", x.normal_force_max.time_s}};
  j["static_friction"] = {{"max", x.static_friction_max.value}, {"time", x.static_friction_max.time_s}};
  j["motor_share"] = motor_share_json(result);
  if (result.belief) j["belief"] = belief_json(result);
  j["estimate"] = estimate_json(result);
  j["final"] = final_json(scenario, f);
  j["travel"] = {{"position", {f.position_W_m[0], f.position_W_m[1], f.position_W_m[2]}},
                 {"distance", result.distance_m},
                 {"speed", f.velocity_W_mps.norm()}};
  j["tracking"] = tracking_json(result);
  j["governor"] = governor_json(result);
  j["courses"] = result.courses;
  j["coast"] = coast_json(scenario, result);
  j["regimes"] = regimes_json(result);
  j["impacts"] = impacts_json(result);
  j["trip"] = trip_json(result);
  j["move"] = plan_json(result.move);
  j["stop"] = plan_json(result.stop);
  j["move_end"] = move_end_json(scenario, result);
  j["surfaces"] = Json::array();
  for (const FloorVerdict& floor : floor_verdicts(scenario, result)) {
    j["surfaces"].push_back({{"name", floor.name}, {"mu_s", floor.static_friction}, {"holds", floor.holds}});
  }
  j["required_friction"] = required_friction_json(result, floor_verdicts(scenario, result));
  j["motors"] = motors_json(scenario, result);
  if (result.step_timing) j["step_timing"] = step_timing_json(*result.step_timing);
  j["published"] = Json::array();
  for (const auto& published : scenario.published) {
    j["published"].push_back({{"quantity", published.quantity},
                              {"published", published.value},
                              {"here", finite_or_null(measured(result, published.quantity))},
                              {"source", published.source}});
  }
  j["ticks"] = result.ticks;
  j["log_bytes"] = result.log_bytes > 0 ? Json(result.log_bytes) : Json(nullptr);
  j["refused_messages"] = refused_json(result.refused);
  j["wall_time"] = result.wall_time_s;
  j["speed"] = result.wall_time_s > 0 ? (scenario.run.hold_s + f.time_s) / result.wall_time_s : 0.0;
  return j;
}

std::string summary_json(const sim::Scenario& scenario, const RunResult& result) {
  return summary_tree(scenario, result).dump(2) + "\n";
}

}  // namespace ballast::sil
