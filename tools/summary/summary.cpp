#include "tools/summary/summary.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "tools/summary/controller_words.h"
#include "tools/summary/required_friction.h"

namespace ballast::sil {

namespace {

using Json = nlohmann::ordered_json;

struct Floor {
  const char* name;
  double static_friction;
};

// mu_s of an aluminium shell on these, as the paper lists them (PHYSICS.md section 6).
constexpr Floor kFloors[] = {{"aluminium", .42}, {"steel", .35},    {"titanium", .34}, {"nickel", .33},
                             {"copper", .28},    {"chromium", .27}, {"glass", .17},    {"graphite", .16}};

const char* regime_name(sim::Regime regime) {
  switch (regime) {
    case sim::Regime::kRolling:
      return "rolling";
    case sim::Regime::kSliding:
      return "sliding";
    case sim::Regime::kFlight:
      return "flight";
  }
  return "";
}

// Of an end_switch trip: the mass that was commanded on over an end of its rail; -1 for other trips.
int mass_at_its_end(const ControllerTrip& trip) {
  if ((static_cast<std::uint32_t>(trip.faults) & static_cast<std::uint32_t>(firmware::Fault::kEndSwitch)) == 0) {
    return -1;
  }
  for (int i = 0; i < trip.status.motor_count; ++i) {
    const int switches = trip.sensors.limit_switch[i];
    const double velocity = trip.status.commanded_velocity[i];
    if (((switches & 1) != 0 && velocity < 0) || ((switches & 2) != 0 && velocity > 0)) return i;
  }
  return -1;
}

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

const char* overload_unit(int error) {
  switch (error) {
    case controller_status_t::OVERLOAD_TOO_MANY_STEPS:
      return "microsteps in the tick";
    case controller_status_t::OVERLOAD_TOO_MANY_BURSTS:
      return "bursts in the tick";
    default:
      return "microsteps/s";
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

bool asked(const MoveEnd& move, std::size_t mass) { return (move.asked.masses >> mass & 1u) != 0; }

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

// Null where nothing was commanded.
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

// Whether the ball of a run that started rolling rolls on such a floor, as far as this run can tell: up to where
// rolling was lost. One that slipped did not hold on its own floor, nor on a smoother.
bool holds(const sim::Scenario& scenario, const RunResult& result, double static_friction) {
  // The floor it slipped on may be worse than the scenario's: a fault has made it so.
  const double slipped_on = std::min(scenario.surface.static_friction, result.final_sample.floor_static_friction);
  if (result.end_reason == EndReason::kSlipped && static_friction <= slipped_on) return false;
  return result.extrema.normal_force_min.value > 0 && result.extrema.mu_required_max.value <= static_friction;
}

// What this run gives for a quantity somebody has published.
double measured(const RunResult& result, const std::string& quantity) {
  if (quantity == "mu_required.max") return result.extrema.mu_required_max.value;
  if (quantity == "normal_force.min") return result.extrema.normal_force_min.value;
  return result.final_sample.time_s;  // end.time; the scenario reader allows no other
}

Json step_timing_json(const StepTimingRecord& record) {
  std::int64_t checked = 0, structural = 0;
  double max_error_us = 0;
  Json motors = Json::array();
  for (const auto& m : record.motors) {
    checked += m.checked_steps;
    structural += m.structural_steps;
    max_error_us = std::max(max_error_us, m.max_error_us);
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
  json["checked_steps"] = checked;
  json["plan_steps"] = record.plan_steps;
  json["steps_outside_the_motion"] = structural;
  json["motion_left_tick"] = record.motion_left_tick ? Json(*record.motion_left_tick) : Json(nullptr);
  json["max_error_us"] = max_error_us;
  json["motors"] = motors;
  json["violations"] = violations;
  return json;
}

// Of a motor without a winding only the mechanical side is known.
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

std::string format(const char* pattern, auto... values) {
  const int size = std::snprintf(nullptr, 0, pattern, values...);
  std::string text(static_cast<std::size_t>(size), '\0');
  std::snprintf(text.data(), text.size() + 1, pattern, values...);
  return text;
}

// Where the masses of a move ended: those that were asked, then those that were to hold.
std::string move_end_text(const sim::Scenario& scenario, const RunResult& result) {
  std::string moved, held;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const double position = result.final_sample.mass_position[i];
    const double target = result.move_end->asked.target_position[i];
    if (asked(*result.move_end, i))
      moved += format("%smass %zu at %.6g (asked: %.6g, %.2g to go)", moved.empty() ? "" : ", ", i, position, target,
                      target - position);
    else
      held += format("%smass %zu at %.6g", held.empty() ? "; held: " : ", ", i, position);
  }
  if (result.masses_rested || !result.move) return moved + held;
  return moved + held + (result.move_end->steps_made ? "; still swinging in their motors" : "; still moving");
}

// Which masses were outside the ball, and what to do about it; empty: none.
std::string outside_ball_text(const sim::Scenario& scenario, const RunResult& result) {
  std::string who;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::EndStopRecord& stop = result.end_stops[i];
    if (stop.outside_ball_m > 0) {
      who += format("%smass %zu was outside the ball by up to %.3g m, first seen at t = %.6g s",
                    who.empty() ? "" : ", ", i, stop.outside_ball_m, stop.outside_ball_s);
    }
  }
  if (who.empty()) return "";
  return who +
         ": its end stop gave way, and there is no shell in the model to hold it; give it a stiffer stop "
         "(rail.end_stop_stiffness) or stops further in (rail.end_stops)";
}

// The faults that motor had been made to suffer by the end of the run; empty: none.
std::string motor_faults_text(const sim::Scenario& scenario, std::size_t motor, double end_s) {
  std::string text;
  for (const sim::Fault& fault : scenario.faults) {
    if (!fault.of(sim::FaultLayer::kMotor) || fault.mass != static_cast<int>(motor) || !fault.begun(end_s)) continue;
    text += (text.empty() ? "" : ", and ") + to_string(fault);
  }
  return text;
}

// What was seen, and what was allowed: as the .lcm file says, in words.
std::string trip_values_text(const trip_t& trip) {
  switch (trip.cause) {
    case trip_t::CAUSE_NORMAL_FORCE:
      return format(": N was %.6g N; allowed: > %.6g N", trip.value, trip.limit);
    case trip_t::CAUSE_FRICTION:
      // A limit that is just passed, at an instant that was located, differs in no digit that says anything.
      if (trip.value > trip.limit * (1 + 1e-6))
        return format(": f_s/N was %.6g; allowed: <= %.6g", trip.value, trip.limit);
      if (trip.value > trip.limit) return format(": f_s/N came to the allowed %.6g and grew", trip.limit);
      return format(": the ball slid at f_s/N = %.6g, on a floor that was to hold up to %.6g", trip.value, trip.limit);
    case trip_t::CAUSE_DISAGREEMENT:
      return format(": what was said of N and f_s was %.6g N apart; allowed: <= %.6g N", trip.value, trip.limit);
    case trip_t::CAUSE_MISSING:
    case trip_t::CAUSE_REPEATED:
      return format(": the newest tick was %.0f where %.0f was due", trip.value, trip.limit);
    case trip_t::CAUSE_STALE:
      if (trip.value < 0) return ": the controller spoke of a tick that was still to come";
      return format(": silent for %.6g ticks; allowed: %.6g", trip.value, trip.limit);
    default:
      return "";
  }
}

// What the plant then showed of a plan.
std::string seen_text(const RunResult& result, const PlanRecord& plan) {
  // Added 0: of what rounds to none no sign is left.
  if (plan.seen_margin_min) return format("seen %.4f", std::round(1e4 * *plan.seen_margin_min) / 1e4 + 0.0);
  const double end_s = result.final_sample.time_s;
  if (end_s > plan.start_s) return "nothing seen of it: the ball was in the air";
  return std::string("never begun: the run ") + (result.end_reason == EndReason::kSlipped ? "slipped" : "ended") +
         format(" at t = %.6g s", end_s);
}

}  // namespace

const char* trip_cause(int cause) {
  switch (cause) {
    case trip_t::CAUSE_NORMAL_FORCE:
      return "normal_force";
    case trip_t::CAUSE_FRICTION:
      return "friction";
    case trip_t::CAUSE_NONFINITE:
      return "nonfinite";
    case trip_t::CAUSE_STALE:
      return "stale";
    case trip_t::CAUSE_MISSING:
      return "missing";
    case trip_t::CAUSE_REPEATED:
      return "repeated";
    case trip_t::CAUSE_DISAGREEMENT:
      return "disagreement";
    default:
      return "none";
  }
}

const char* fault_cause(std::int32_t faults) {
  using firmware::Fault;
  constexpr std::pair<Fault, const char*> kNames[] = {{Fault::kSensorNotFinite, "sensor_not_finite"},
                                                      {Fault::kSensorStale, "sensor_stale"},
                                                      {Fault::kMonitorStale, "monitor_stale"},
                                                      {Fault::kStepOverload, "step_overload"},
                                                      {Fault::kTickOutOfOrder, "tick_out_of_order"},
                                                      {Fault::kEndSwitch, "end_switch"},
                                                      {Fault::kInternal, "internal"}};
  for (const auto& [fault, name] : kNames) {
    if ((static_cast<std::uint32_t>(faults) & static_cast<std::uint32_t>(fault)) != 0) return name;
  }
  return "controller";
}

std::string summary_json(const sim::Scenario& scenario, const RunResult& result) {
  const auto& x = result.extrema;
  const auto& f = result.final_sample;
  const bool stepper = scenario.run.actuation == sim::Actuation::kStepper;
  Json j;
  j["scenario"] = scenario.name;
  j["actuation"] = stepper ? "stepper" : "prescribed";
  j["seed"] = scenario.seed;
  j["duration"] = scenario.duration_s;
  j["control_period"] = scenario.run.control_period_s;
  j["surface"] = {{"static_friction", finite_or_null(scenario.surface.static_friction)},
                  {"kinetic_friction", finite_or_null(scenario.surface.kinetic_friction)}};
  j["envelope"] = {{"min_normal_force", scenario.envelope.min_normal_force_n},
                   {"friction_use", scenario.envelope.friction_use}};
  // Only of runs made to suffer, so that the others' summaries stay what they were.
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

  Json positions = Json::array(), velocities = Json::array(), motors = Json::array();
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    positions.push_back(f.mass_position[i]);
    velocities.push_back(f.mass_velocity[i]);
    if (!scenario.masses[i].trajectory.times_s.empty()) {
      motors.push_back(nullptr);  // moved, not driven
      continue;
    }
    const sim::Motor& motor = scenario.masses[i].motor;
    motors.push_back({{"steps", result.motors[i].steps},
                      {"lost_steps", f.lost_steps[i]},
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
  j["final"] = {{"mass_position", positions},
                {"mass_velocity", velocities},
                {"orientation", {f.orientation[0], f.orientation[1], f.orientation[2], f.orientation[3]}},
                {"angular_velocity",
                 {f.angular_velocity_B_radps[0], f.angular_velocity_B_radps[1], f.angular_velocity_B_radps[2]}},
                {"position", {f.position_W_m[0], f.position_W_m[1], f.position_W_m[2]}},
                {"velocity", {f.velocity_W_mps[0], f.velocity_W_mps[1], f.velocity_W_mps[2]}}};
  j["regimes"] = Json::array();
  for (std::size_t i = 0; i < result.regimes.size(); ++i) {
    const double regime_end_s = i + 1 < result.regimes.size() ? result.regimes[i + 1].time_s : f.time_s;
    j["regimes"].push_back({{"regime", regime_name(result.regimes[i].regime)},
                            {"start", result.regimes[i].time_s},
                            {"end", regime_end_s}});
  }
  j["impacts"] = Json::array();
  for (const auto& impact : result.impacts) {
    j["impacts"].push_back({{"time", impact.time_s},
                            {"normal_impulse", impact.normal_impulse_ns},
                            {"friction_impulse", impact.friction_impulse_ns},
                            {"sticking", impact.sticking}});
  }
  j["trip"] = nullptr;
  if (result.trip.tripped != 0) {
    j["trip"] = {{"cause", trip_cause(result.trip.cause)},
                 {"time", result.trip.trip_time_s},
                 {"tick", result.trip.trip_tick},
                 {"value", finite_or_null(result.trip.value)},
                 {"limit", finite_or_null(result.trip.limit)},
                 {"latency_ticks", result.latency_ticks ? Json(*result.latency_ticks) : Json(nullptr)}};
  } else if (result.controller_trip) {
    j["trip"] = {{"cause", fault_cause(result.controller_trip->faults)},
                 {"time", result.controller_trip->time_s},
                 {"tick", result.controller_trip->tick},
                 {"value", result.controller_trip->faults},
                 {"limit", 0},
                 {"latency_ticks", nullptr}};
    if (const auto& status = result.controller_trip->status; status.overload_error != 0) {
      j["trip"]["value"] = finite_or_null(status.overload_value);
      j["trip"]["limit"] = status.overload_limit;
      j["trip"]["motor"] = status.overload_motor;
      j["trip"]["error"] = overload_error(status.overload_error);
      j["trip"]["steps_of_tick"] = status.overload_tick;
    }
    if (const int mass = mass_at_its_end(*result.controller_trip); mass >= 0) j["trip"]["motor"] = mass;
    j["trip"]["history"] = Json::array();
    for (const auto& command : result.controller_trip->history) {
      Json steps = Json::array();
      for (int i = 0; i < command.motor_count; ++i) steps.push_back(command.steps[i]);
      j["trip"]["history"].push_back({{"tick", command.tick}, {"steps", steps}, {"bursts", command.burst_count}});
    }
  }
  j["move"] = plan_json(result.move);
  j["stop"] = plan_json(result.stop);
  j["move_end"] = move_end_json(scenario, result);
  j["surfaces"] = Json::array();
  for (const FloorVerdict& floor : floor_verdicts(scenario, result)) {
    j["surfaces"].push_back({{"name", floor.name}, {"mu_s", floor.static_friction}, {"holds", floor.holds}});
  }
  j["required_friction"] = required_friction_json(result, floor_verdicts(scenario, result));
  j["motors"] = motors;
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
  const hal::LinkCounters& refused = result.refused.here;
  j["refused_messages"] = {{"malformed", refused.malformed}, {"foreign", refused.foreign},
                           {"repeated", refused.repeated},   {"old", refused.old},
                           {"dropped", refused.dropped},     {"by_controller", result.refused.by_controller}};
  j["wall_time"] = result.wall_time_s;
  j["speed"] = result.wall_time_s > 0 ? f.time_s / result.wall_time_s : 0.0;
  return j.dump(2) + "\n";
}

std::string summary_text(const sim::Scenario& scenario, const RunResult& result,
                         const std::filesystem::path& directory) {
  const auto& x = result.extrema;
  const double end_s = result.final_sample.time_s;
  const bool stepper = scenario.run.actuation == sim::Actuation::kStepper;
  std::string text = format("%s, %s masses\n", scenario.name.c_str(), stepper ? "stepper-driven" : "prescribed");

  switch (result.end_reason) {
    case EndReason::kCompleted:
      text += format("  ended       completed at t = %.6g s", end_s);
      break;
    case EndReason::kSlipped:
      text += format("  ended       slipped at t = %.10g s: f_s reached mu_s N (mu_s = %g)", end_s,
                     result.final_sample.floor_static_friction);
      break;
    case EndReason::kDetached:
      text += format("  ended       detached at t = %.10g s: N fell to 0, the floor no longer carries the ball", end_s);
      break;
    case EndReason::kTripped:
      if (result.masses_rested) {
        text += format("  ended       tripped; the masses were at rest at t = %.6g s", end_s);
      } else {
        // Its steps are all made, or it would not have ended so; what still moves has slipped, or swings.
        text += format("  ended       tripped and stopped; at t = %.6g s, the run's end, the masses still %s", end_s,
                       lost_steps_text(scenario, result).empty() ? "swung in their motors" : "moved");
      }
      break;
    case EndReason::kInconsistent:
      text += format("  ended       inconsistent at t = %.10g s: %s", end_s, result.end_text.c_str());
      break;
    case EndReason::kStepTiming:
      text +=
          format("  ended       at t = %.10g s: a step pulse in the wrong place, which is a bug of ours; motor %d, %s",
                 end_s, result.step_timing->violation_motor, result.step_timing->violation->text().c_str());
      break;
  }
  text += "\n";
  for (const sim::Fault& fault : scenario.faults)
    text += (fault.begun(end_s) ? "  suffered    " : "  not reached ") + to_string(fault) + "\n";
  if (result.missing_commands > 0) {
    text += format("  WARNING     in %lld ticks no step command reached the motors: they stood\n",
                   static_cast<long long>(result.missing_commands));
  }
  if (result.regimes.size() > 1 || result.regimes.front().regime != sim::Regime::kRolling) {
    constexpr std::size_t kShown = 8;
    text += "  regimes     ";
    for (std::size_t i = 0; i < std::min(result.regimes.size(), kShown); ++i) {
      text += format("%s%s from %.6g s", i == 0 ? "" : ", ", regime_name(result.regimes[i].regime),
                     result.regimes[i].time_s);
    }
    if (result.regimes.size() > kShown) text += format(", ... (%zu in all)", result.regimes.size());
    text += "\n";
  }
  if (!result.impacts.empty()) {
    double hardest = 0;
    for (const auto& impact : result.impacts) hardest = std::max(hardest, impact.normal_impulse_ns);
    text += format("  impacts     %zu, the first at t = %.6g s, the hardest %.6g N s\n", result.impacts.size(),
                   result.impacts.front().time_s, hardest);
  }
  if (result.trip.tripped != 0) {
    text += format("  trip        %s at t = %.6f s%s", trip_cause(result.trip.cause), result.trip.trip_time_s,
                   trip_values_text(result.trip).c_str());
    const bool physics_ended = result.end_reason != EndReason::kCompleted && result.end_reason != EndReason::kTripped;
    if (stepper && result.latency_ticks.value_or(-1) >= 0 && !physics_ended) {
      text += format("; the stop began %lld tick%s later", static_cast<long long>(*result.latency_ticks),
                     *result.latency_ticks == 1 ? "" : "s");
    }
    text += "\n";
  } else if (result.controller_trip) {
    text += format("  trip        by the controller itself at t = %.6f s: %s", result.controller_trip->time_s,
                   fault_cause(result.controller_trip->faults));
    if (const auto& status = result.controller_trip->status; status.overload_error != 0) {
      text += format(": motor %d in tick %lld, %.6g %s, limit %.6g", status.overload_motor,
                     static_cast<long long>(status.overload_tick), status.overload_value,
                     overload_unit(status.overload_error), status.overload_limit);
    }
    if (const int mass = mass_at_its_end(*result.controller_trip); mass >= 0) {
      text += format(": mass %d is at an end of its rail and is commanded on", mass);
    }
    text += "\n";
  } else {
    text += "  trip        none\n";
  }
  for (const auto& [name, plan] : {std::pair("move", &result.move), std::pair("stop", &result.stop)}) {
    if (!*plan) continue;
    const PlanRecord& p = **plan;
    text += format("  %s        from t = %.6g s, %.6g s; %s; %s\n", name, p.start_s, p.predicted.duration_s,
                   predicted_text(p.predicted).c_str(), seen_text(result, p).c_str());
  }
  if (const auto& move = result.move; move && move->seen_margin_min) {
    const std::string missed = far_below_text(move->predicted, *move->seen_margin_min);
    if (!missed.empty()) text += "  WARNING     " + missed + " (how much: share)\n";
  }
  if (result.move_end)
    text += (arrived(result) ? "  arrived     " : "  NOT THERE   ") + move_end_text(scenario, result) + "\n";
  text += format("  least N     %.6g N at t = %.4f s\n", x.normal_force_min.value, x.normal_force_min.time_s);
  if (std::isfinite(x.mu_required_max.value)) {
    text += format("  most f_s/N  %.6f at t = %.4f s", x.mu_required_max.value, x.mu_required_max.time_s);
    if (std::isfinite(scenario.surface.static_friction)) {
      text += format(" (this floor gives mu_s = %g)", scenario.surface.static_friction);
    }
  } else {
    text += format("  most f_s/N  unbounded: N = 0 at t = %.4f s", x.mu_required_max.time_s);
  }
  std::string holds_on, slips_on;
  const auto floors = floor_verdicts(scenario, result);
  for (const FloorVerdict& floor : floors) {
    std::string& list = floor.holds ? holds_on : slips_on;
    list += format("%s%s %.2f", list.empty() ? "" : ", ", floor.name, floor.static_friction);
  }
  if (result.end_reason != EndReason::kCompleted) {
    text += "; what follows speaks of the time up to the end";
  } else if (result.rolling_lost) {
    text += "; rolling was lost, so what follows says nothing of other floors after that";
  }
  if (!floors.empty()) text += "\n  holds on    " + (holds_on.empty() ? "none of the paper's floors" : holds_on);
  if (!slips_on.empty()) text += "\n  not on      " + slips_on;
  text += "\n  in short    " + required_friction_text(result, floors) + "\n";
  for (const auto& published : scenario.published) {
    if (result.end_reason != EndReason::kCompleted && published.quantity != "end.time")
      continue;  // not the whole story
    const double here = measured(result, published.quantity);
    text += format("  published   %s = %g (%s); here %s\n", published.quantity.c_str(), published.value,
                   published.source.c_str(), std::isfinite(here) ? format("%.6g", here).c_str() : "unbounded");
  }
  if (stepper) {
    text += "  steps       ";
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      text += format("%s%lld", i == 0 ? "" : " + ", static_cast<long long>(result.motors[i].steps));
    }
    std::int64_t lost = 0, slips = 0;
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      lost += result.final_sample.lost_steps[i];
      slips += result.motors[i].slips;
    }
    text += format("%s issued, %lld lost", scenario.masses.empty() ? "0" : "", static_cast<long long>(lost));
    if (slips > 0) text += format(" (%lld slips, forth and back)", static_cast<long long>(slips));
    text += "\n";
  }
  for (const std::string& warning : {lost_steps_text(scenario, result), outside_ball_text(scenario, result)}) {
    if (!warning.empty()) text += "  WARNING     " + warning + "\n";
  }
  if (result.step_timing) {
    std::int64_t checked = 0, structural = 0;
    double max_error_us = 0, tolerance_us = 0;
    for (const auto& m : result.step_timing->motors) {
      checked += m.checked_steps;
      structural += m.structural_steps;
      max_error_us = std::max(max_error_us, m.max_error_us);
      tolerance_us = m.tolerance_us;
    }
    text += format("  step timing %lld steps checked, the worst %.3f us from its crossing (allowed %.3g)",
                   static_cast<long long>(checked), max_error_us, tolerance_us);
    if (result.step_timing->plan_steps > 0) {
      text += format("; %lld of them of stops and moves", static_cast<long long>(result.step_timing->plan_steps));
    }
    if (structural > 0)
      text += format("; %lld more by spacing, set-up and counts only", static_cast<long long>(structural));
    text += "\n";
  }
  double margin = 1, electrical_j = 0, copper_j = 0;
  bool any_motor = false;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    margin = std::min(margin, result.motor_extrema[i].torque_margin);
    electrical_j += result.motor_energy[i].electrical_j;
    copper_j += result.motor_energy[i].copper_j;
    any_motor = any_motor || scenario.masses[i].trajectory.times_s.empty();
  }
  if (any_motor) {
    text += format("  motors      least torque margin %.0f %%", 100 * margin);
    if (electrical_j != 0)
      text += format("; %.3g J from the supply, %.3g J of it heat in the windings", electrical_j, copper_j);
    text += "\n";
  }
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::EndStopRecord& stop = result.end_stops[i];
    if (stop.touches == 0) continue;
    text += format("  end stop    mass %zu touched it first at t = %.6g s (touches: %d), pushed back by up to %.4g N\n",
                   i, stop.first_s, stop.touches, stop.max_force_n);
  }
  if (const MotorShare& share = result.motor_share; share.seen()) {
    const auto part = [](const Deviation& d) {
      return std::isfinite(d.difference()) ? format("%.3g", std::abs(d.difference())) : std::string("any bound");
    };
    const double commanded = share.commanded_mu_required_max.value;
    text += format("  share       the motors move N by up to %s N, f_s by %s N, f_s/N by %s; commanded most f_s/N %s\n",
                   part(share.normal_force_n).c_str(), part(share.static_friction_n).c_str(),
                   part(share.mu_required).c_str(),
                   std::isfinite(commanded) ? format("%.6f", commanded).c_str() : "unbounded");
  }
  if (const hal::LinkCounters& refused = result.refused.here; refused.refused() + result.refused.by_controller > 0) {
    text += format(
        "  bus         not used of what came: %lld malformed, %lld of another run, %lld repeated, %lld old, "
        "%lld dropped",
        static_cast<long long>(refused.malformed), static_cast<long long>(refused.foreign),
        static_cast<long long>(refused.repeated), static_cast<long long>(refused.old),
        static_cast<long long>(refused.dropped));
    text += format("; by the controller %lld\n", static_cast<long long>(result.refused.by_controller));
  }
  const double speed = end_s / std::max(result.wall_time_s, 1e-9);
  text += format(speed < 9.95 ? "  speed       %.2g times real time" : "  speed       %.0f times real time", speed);
  if (result.ticks > 0)
    text += format(", %.2f us per tick", 1e6 * result.wall_time_s / static_cast<double>(result.ticks));
  // A pace is kept to a tick; what is late by more than a person would see was not.
  if (result.asked_speed > 0 && speed < 0.95 * result.asked_speed &&
      result.wall_time_s > end_s / result.asked_speed + 0.2) {
    text += format("; it was to be %.6g, which was not kept", result.asked_speed);
  }
  text += "\n";
  text += "  results     " + directory.string() + "\n";
  return text;
}

std::vector<FloorVerdict> floor_verdicts(const sim::Scenario& scenario, const RunResult& result) {
  std::vector<FloorVerdict> verdicts;
  if (result.regimes.front().regime != sim::Regime::kRolling) return verdicts;
  for (const Floor& floor : kFloors) {
    verdicts.push_back({floor.name, floor.static_friction, holds(scenario, result, floor.static_friction)});
  }
  return verdicts;
}

std::string lost_steps_text(const sim::Scenario& scenario, const RunResult& result) {
  std::string who, suffered, stopped;
  bool in_free_motion = false;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const auto lost = static_cast<long long>(result.final_sample.lost_steps[i]);
    if (lost == 0) continue;
    who += format("%smotor %zu lost %lld", who.empty() ? "" : ", ", i, lost);
    // Of steps that a fault took the motion's limits say nothing.
    if (const std::string faults = motor_faults_text(scenario, i, result.final_sample.time_s); !faults.empty())
      suffered += format(" Motor %zu was made to suffer %s.", i, faults.c_str());
    else if (const sim::EndStopRecord& stop = result.end_stops[i]; stop.touches > 0)
      stopped +=
          format(" Mass %zu met its end stop at t = %.6g s: which steps were lost there is not told.", i, stop.first_s);
    else
      in_free_motion = true;
  }
  if (who.empty()) return "";
  const std::string text =
      who + " microsteps: its mass is not where the controller believes it is." + suffered + stopped;
  if (!in_free_motion && stopped.empty()) return text.substr(0, text.size() - 1);
  return text + (in_free_motion ? " The torque did not carry the motion" : " If the torque did not carry the motion") +
         ": allow it less speed, acceleration or jerk (motor.max_step_rate, max_acceleration, max_jerk, or "
         "ballast move --speed-fraction), or give it more torque";
}

bool arrived(const RunResult& result) {
  const auto& lost = result.final_sample.lost_steps;
  return result.move_end && result.move_end->steps_made &&
         std::all_of(lost.begin(), lost.end(), [](std::int64_t steps) { return steps == 0; });
}

std::vector<std::string> warnings(const sim::Scenario& scenario, const RunResult& result) {
  std::vector<std::string> texts{lost_steps_text(scenario, result), outside_ball_text(scenario, result)};
  if (result.move_end && !arrived(result))
    texts.push_back("the move did not arrive: " + move_end_text(scenario, result));
  std::erase(texts, "");
  return texts;
}

int exit_status(const RunResult& result) {
  if (result.end_reason == EndReason::kStepTiming) return 2;
  const bool completed = result.end_reason == EndReason::kCompleted && !result.rolling_lost;
  if (!completed || result.trip.tripped != 0 || result.controller_trip) return 3;
  return result.move_end && !arrived(result) ? 2 : 0;
}

}  // namespace ballast::sil
