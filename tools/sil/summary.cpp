#include "tools/sil/summary.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

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
    default:
      return "none";
  }
}

// The controller's own reason to trip, where the monitor had none: the first of firmware/safety/fault.h.
const char* fault_cause(std::int32_t faults) {
  using firmware::Fault;
  constexpr std::pair<Fault, const char*> kNames[] = {
      {Fault::kSensorNotFinite, "sensor_not_finite"}, {Fault::kSensorStale, "sensor_stale"},
      {Fault::kMonitorStale, "monitor_stale"},        {Fault::kStepOverload, "step_overload"},
      {Fault::kTickOutOfOrder, "tick_out_of_order"},  {Fault::kInternal, "internal"}};
  for (const auto& [fault, name] : kNames) {
    if ((static_cast<std::uint32_t>(faults) & static_cast<std::uint32_t>(fault)) != 0) return name;
  }
  return "controller";
}

Json finite_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

// Whether the ball rolls on such a floor, as far as this run can tell: up to where rolling was lost, and never if the
// run did not start rolling. One that slipped did not hold on its own floor, nor on a smoother.
bool holds(const sim::Scenario& scenario, const RunResult& result, double static_friction) {
  if (result.end_reason == EndReason::kSlipped && static_friction <= scenario.surface.static_friction) return false;
  return result.regimes.front().regime == sim::Regime::kRolling && result.extrema.normal_force_min.value > 0 &&
         result.extrema.mu_required_max.value <= static_friction;
}

// What this run gives for a quantity somebody has published.
double measured(const RunResult& result, const std::string& quantity) {
  if (quantity == "mu_required.max") return result.extrema.mu_required_max.value;
  if (quantity == "normal_force.min") return result.extrema.normal_force_min.value;
  return result.final_sample.time_s;  // end.time; the scenario reader allows no other
}

std::string format(const char* pattern, auto... values) {
  const int size = std::snprintf(nullptr, 0, pattern, values...);
  std::string text(static_cast<std::size_t>(size), '\0');
  std::snprintf(text.data(), text.size() + 1, pattern, values...);
  return text;
}

}  // namespace

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
  j["end"] = {{"reason", to_string(result.end_reason)}, {"time", f.time_s}};
  if (!result.end_text.empty()) j["end"]["text"] = result.end_text;
  if (result.end_reason == EndReason::kTripped) j["end"]["masses_at_rest"] = result.masses_rested;
  j["mu_required"] = {{"max", finite_or_null(x.mu_required_max.value)}, {"time", x.mu_required_max.time_s}};
  j["normal_force"] = {{"min", x.normal_force_min.value},
                       {"min_time", x.normal_force_min.time_s},
                       {"max", x.normal_force_max.value},
                       {"max_time", x.normal_force_max.time_s}};
  j["static_friction"] = {{"max", x.static_friction_max.value}, {"time", x.static_friction_max.time_s}};

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
                      {"max_step_rate", result.motors[i].max_step_rate_hz},
                      {"max_torque", result.motor_extrema[i].max_torque_nm},
                      {"torque_margin", result.motor_extrema[i].torque_margin},
                      {"parameters",
                       {{"shaft_ratio", motor.shaft_ratio},
                        {"steps_per_revolution", motor.steps_per_revolution},
                        {"holding_torque", motor.holding_torque_nm},
                        {"detent_torque", motor.detent_torque_nm},
                        {"viscous_damping", motor.viscous_damping_nms},
                        {"corner_speed", motor.corner_speed_radps}}}});
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
  }
  j["surfaces"] = Json::array();
  for (const Floor& floor : kFloors) {
    j["surfaces"].push_back({{"name", floor.name},
                             {"mu_s", floor.static_friction},
                             {"holds", holds(scenario, result, floor.static_friction)}});
  }
  j["motors"] = motors;
  j["published"] = Json::array();
  for (const auto& published : scenario.published) {
    j["published"].push_back({{"quantity", published.quantity},
                              {"published", published.value},
                              {"here", finite_or_null(measured(result, published.quantity))},
                              {"source", published.source}});
  }
  j["ticks"] = result.ticks;
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
                     scenario.surface.static_friction);
      break;
    case EndReason::kDetached:
      text += format("  ended       detached at t = %.10g s: N fell to 0, the floor no longer carries the ball", end_s);
      break;
    case EndReason::kTripped:
      text += format(result.masses_rested ? "  ended       tripped; the masses were at rest at t = %.6g s"
                                          : "  ended       tripped; the masses were still moving at t = %.6g s",
                     end_s);
      break;
    case EndReason::kInconsistent:
      text += format("  ended       inconsistent at t = %.10g s: %s", end_s, result.end_text.c_str());
      break;
  }
  text += "\n";
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
    text += format("  trip        %s at t = %.6f s: %.6g, limit %.6g", trip_cause(result.trip.cause),
                   result.trip.trip_time_s, result.trip.value, result.trip.limit);
    const bool physics_ended = result.end_reason != EndReason::kCompleted && result.end_reason != EndReason::kTripped;
    if (stepper && result.latency_ticks && !physics_ended) {
      text += format("; the stop began %lld tick%s later", static_cast<long long>(*result.latency_ticks),
                     *result.latency_ticks == 1 ? "" : "s");
    }
    text += "\n";
  } else if (result.controller_trip) {
    text += format("  trip        by the controller itself at t = %.6f s: %s\n", result.controller_trip->time_s,
                   fault_cause(result.controller_trip->faults));
  } else {
    text += "  trip        none\n";
  }
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
  for (const Floor& floor : kFloors) {
    std::string& list = holds(scenario, result, floor.static_friction) ? holds_on : slips_on;
    list += format("%s%s %.2f", list.empty() ? "" : ", ", floor.name, floor.static_friction);
  }
  if (result.end_reason != EndReason::kCompleted) {
    text += "; what follows speaks of the time up to the end";
  } else if (result.rolling_lost) {
    text += "; rolling was lost, so what follows says nothing of other floors after that";
  }
  text += "\n  holds on    " + (holds_on.empty() ? "none of the paper's floors" : holds_on);
  if (!slips_on.empty()) text += "\n  not on      " + slips_on;
  text += "\n";
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
    std::int64_t lost = 0;
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) lost += result.final_sample.lost_steps[i];
    text += format("%s issued, %lld lost\n", scenario.masses.empty() ? "0" : "", static_cast<long long>(lost));
  }
  double margin = 1;
  bool any_motor = false;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    margin = std::min(margin, result.motor_extrema[i].torque_margin);
    any_motor = any_motor || scenario.masses[i].trajectory.times_s.empty();
  }
  if (any_motor) text += format("  motors      least torque margin %.0f %%\n", 100 * margin);
  text += format("  speed       %.0f times real time", end_s / std::max(result.wall_time_s, 1e-9));
  if (result.ticks > 0)
    text += format(", %.2f us per tick", 1e6 * result.wall_time_s / static_cast<double>(result.ticks));
  text += "\n";
  text += "  results     " + directory.string() + "\n";
  return text;
}

int exit_status(const RunResult& result) {
  const bool inside = result.end_reason == EndReason::kCompleted && !result.rolling_lost;
  return inside && result.trip.tripped == 0 && !result.controller_trip ? 0 : 3;
}

}  // namespace ballast::sil
