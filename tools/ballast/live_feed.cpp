#include "tools/ballast/live_feed.h"

#include <fmt/core.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <tuple>
#include <utility>
#include <vector>

#include "tools/ballast/tick_events.h"
#include "tools/program/short_number.h"
#include "tools/sil/robot.h"
#include "tools/summary/controller_words.h"

namespace ballast {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kEvery_s = 1.0 / 60;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

const char* kind_name(LiveFeed::Kind kind) {
  constexpr const char* kNames[] = {"run", "mode", "plan", "command", "refusal", "trip"};
  return kNames[static_cast<int>(kind)];
}

// Time on the run's clock, which goes up from below 0 in the countdown.
double time_of(const plant_state_t& state) {
  return state.tick < 0 ? 1e-6 * static_cast<double>(state.utime) : state.time_s;
}

// Calls add(name, value) for every column of a frame. `status` may be null.
template <class Add>
void for_each_column(const contact_t& contact, const plant_state_t& state, const controller_status_t* status,
                     double floor_friction, const Add& add) {
  const auto several = [&](const std::string& name, const double* values, int count) {
    for (int j = 0; j < count; ++j) add(name + "_" + std::to_string(j), values[j]);
  };
  const bool in_contact = contact.regime != contact_t::REGIME_FLIGHT;
  add("time", time_of(state));
  add("normal_force", contact.normal_force_n);
  add("static_friction", contact.static_friction_n);
  add("mu_required", contact.mu_required);
  add("margin", in_contact ? contact.margin : kNone);
  add("regime", static_cast<double>(contact.regime));
  add("floor_friction", floor_friction);
  several("friction_force", contact.friction_force_W_n, 2);
  several("position", state.position_W_m, 3);
  several("orientation", state.orientation, 4);
  several("center_of_mass", state.center_of_mass_B_m, 3);
  add("speed", std::hypot(state.velocity_W_mps[0], state.velocity_W_mps[1]));
  several("mass_position", state.mass_position, state.mass_count);
  several("mass_B", &state.mass_position_B_m[0][0], 3 * state.mass_count);
  for (int i = 0; i < state.mass_count; ++i) {
    const bool commanded = status != nullptr && i < status->motor_count;
    add("commanded_" + std::to_string(i), commanded ? status->commanded_position[i] : kNone);
  }
  const bool governed = status != nullptr && status->governed != 0;
  const bool estimated = status != nullptr && status->estimate_valid != 0;
  const bool measured = status != nullptr && status->measured_valid != 0;
  add("backup_margin", governed ? status->backup_margin : kNone);
  for (int j = 0; j < 2; ++j)
    add("estimated_position_" + std::to_string(j), estimated ? status->estimated_position_W_m[j] : kNone);
  add("position_sigma", estimated ? status->position_sigma_m : kNone);
  add("tilt_sigma", estimated ? status->tilt_sigma_rad : kNone);
  add("yaw_sigma", estimated ? status->yaw_sigma_rad : kNone);
  add("measured_mu_required", measured ? status->measured_mu_required : kNone);
  add("measured_mu_sigma", measured ? status->measured_mu_sigma : kNone);
  add("measured_normal_force", measured ? status->measured_normal_force_n : kNone);
  add("measured_normal_sigma", measured ? status->measured_normal_sigma_n : kNone);
}

Json wish_json(const GoWish& wish) {
  Json via = Json::array();
  for (const FloorPlace& place : wish.via) via.push_back(place);
  return {{"who", wish.who}, {"to", wish.to}, {"via", via}};
}

// The number of a run or a course.
std::string number_text(std::int64_t number) { return fmt::format("{:x}", static_cast<std::uint64_t>(number)); }

Json finite_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::string run_json(const sim::Scenario& scenario, const contact_t& contact, const plant_state_t& state) {
  std::vector<std::string> columns;
  for_each_column(contact, state, nullptr, 0, [&](const std::string& name, double) { columns.push_back(name); });
  Json masses = Json::array();
  for (const sim::Mass& mass : scenario.masses) {
    const bool on_circle = mass.rail.shape == firmware::RailShape::kCircle;
    masses.push_back({{"unit", on_circle ? "rad" : "m"},
                      {"lower_end", finite_or_null(mass.rail.lower_end)},
                      {"upper_end", finite_or_null(mass.rail.upper_end)}});
  }
  return Json{
      {"run", number_text(contact.run_id)},
      {"name", scenario.name},
      {"duration", scenario.duration_s},
      {"actuation", to_string(scenario.run.actuation)},
      {"columns", columns},
      {"masses", masses},
      {"friction_changes", !scenario.surface.patches.empty()},
      {"envelope",
       {{"friction_use", scenario.envelope.friction_use}, {"min_normal_force", scenario.envelope.min_normal_force_n}}}}
      .dump();
}

// The controller has looked for a halt in vain: the masses hold, and the ball rolls on. An older refusal stays in the
// status.
bool gives_halt_up(const controller_status_t& before, const controller_status_t& after) {
  const bool over = after.mode == controller_status_t::MODE_STOPPING || after.mode == controller_status_t::MODE_ARMED;
  const auto refusal = [](const controller_status_t& status) {
    return std::tuple(status.refusal, status.refusal_value, status.refusal_time_s);
  };
  return before.mode == controller_status_t::MODE_HALTING && over &&
         after.refusal != controller_status_t::REFUSAL_NONE && refusal(after) != refusal(before);
}

}  // namespace

bool LiveFeed::is_shown(std::int64_t run_id, double now_s) {
  const ShownRun::Heard heard = run_.hear(run_id, now_s);
  if (heard == ShownRun::Heard::kFirst) {
    say_now();
    contact_.reset();
    state_.reset();
    status_.reset();
    trip_.reset();
    said_plan_tick_.reset();
    scenario_.reset();
    scenario_trouble_.clear();
    courses_.clear();
    last_wish_.reset();
    passed_s_ = now_s - kEvery_s;
  }
  return heard != ShownRun::Heard::kOther;
}

void LiveFeed::observe(const contact_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  contact_ = message;
  pass_on(now_s);
}

void LiveFeed::observe(const plant_state_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  state_ = message;
  pass_on(now_s);
}

void LiveFeed::observe(const controller_status_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s) || message.tick < 0) return;  // the countdown is the run's own
  controller_status_t before{};
  before.mode = -1;  // none: the first status of a run
  if (status_) before = *status_;
  status_ = message;
  say_what_changed(before, message);
}

void LiveFeed::observe(const trip_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  const bool tripped = trip_ && trip_->tripped != 0;
  trip_ = message;
  if (message.tripped != 0 && !tripped) say(Kind::kTrip, "tripped by the monitor: " + sil::verdict_text(message));
}

void LiveFeed::observe(const scenario_piece_t& message, double) {
  const bool wanted = !run_.run_id() || message.run_id != run_.run_id() || !scenario_;
  if (!wanted) return;
  std::string text = pieces_.take(message);
  if (text.empty()) return;
  text_ = std::move(text);
  text_run_id_ = message.run_id;
}

void LiveFeed::observe(const operator_t& message, double) {
  if (message.run_id == run_.run_id()) courses_.take(message);
}

void LiveFeed::set_wish(const GoWish* wish) {
  wish_ = wish != nullptr ? std::optional(*wish) : std::nullopt;
  if (wish_) last_wish_ = wish_;
}

// The scenario comes from the bus, so it is read as strictly as one from a file.
void LiveFeed::adopt(const std::string& scenario_text) {
  if (!scenario_trouble_.empty()) return;
  sim::ScenarioResult read = sim::parse_scenario(scenario_text, "the scenario on the bus");
  if (!read.ok()) {
    scenario_trouble_ = "the scenario on the bus is of another version of Ballast: " + to_string(read.errors.front());
    return;
  }
  if (static_cast<int>(read.scenario.masses.size()) != state_->mass_count) {
    scenario_trouble_ = "the scenario on the bus is that of another robot";
    return;
  }
  scenario_ = std::move(read.scenario);
  floor_.emplace(scenario_->surface);
  pipe_.send(text_event("robot.json", sil::robot_json(*scenario_)) + text_event("scenario.toml", scenario_text) +
             text_event("live.run", run_json(*scenario_, *contact_, *state_)));
  sent_wish_.clear();
  sent_course_.reset();
  say(Kind::kRun, "run of " + scenario_->name);
}

void LiveFeed::end_run(double time_s) {
  if (run_.ended()) return;
  run_.end();
  say_now();
  say(Kind::kRun, fmt::format("the run ended at t = {} s", program::short_time(time_s)));
}

void LiveFeed::say_what_changed(const controller_status_t& before, const controller_status_t& after) {
  const bool tripped_itself = after.mode == controller_status_t::MODE_TRIPPED && after.faults != 0;
  if (after.mode != before.mode) {
    if (tripped_itself) say_soon(Kind::kTrip, "tripped by the controller itself: " + sil::fault_text(after));
    say_soon(Kind::kMode, sil::status_text(after));
  }
  if (gives_halt_up(before, after))
    say_soon(Kind::kRefusal, sil::refused_text("halt", sil::refusal_text(after, nullptr)));
  say_plan(after);
  if (after.halt_said != 0 && before.halt_said == 0 && before.mode >= 0) say_soon(Kind::kPlan, sil::halt_text(after));
}

// The prediction of a stop or a move, which may be complete before it begins or after its end.
void LiveFeed::say_plan(const controller_status_t& status) {
  if (!said_plan_tick_) said_plan_tick_ = status.plan_tick;  // a plan before the first status is not told
  const bool moves =
      status.mode == controller_status_t::MODE_PENDING || status.mode == controller_status_t::MODE_MOVING;
  if (moves) plan_moves_ = true;
  if (status.mode == controller_status_t::MODE_RUNNING || status.mode == controller_status_t::MODE_STOPPING)
    plan_moves_ = false;
  const bool told = status.planned != 0 && status.plan_tick != *said_plan_tick_;
  if (!told || status.mode == controller_status_t::MODE_PENDING) return;
  said_plan_tick_ = status.plan_tick;
  say_soon(Kind::kPlan, std::string(plan_moves_ ? "moving, " : "stopping, ") + sil::plan_text(status));
}

std::string LiveFeed::line(Kind kind, const std::string& text) const {
  Json line{{"kind", kind_name(kind)}, {"text", text}, {"run", number_text(run_.run_id())}};
  if (state_) line["time"] = std::round(1e6 * time_of(*state_)) / 1e6;
  return text_event("live.said", line.dump(-1, ' ', false, Json::error_handler_t::replace));
}

void LiveFeed::say(Kind kind, const std::string& text) { pipe_.send(line(kind, text)); }

void LiveFeed::say_now() {
  if (!soon_.empty()) pipe_.send(std::exchange(soon_, ""));
}

void LiveFeed::pass_on(double now_s) {
  if (!contact_ || !state_ || contact_->tick != state_->tick) return;
  const bool last = contact_->last != 0 || state_->last != 0;
  if (!last && now_s - passed_s_ < kEvery_s) return;
  passed_s_ = now_s;
  if (!scenario_ && text_run_id_ == run_.run_id()) adopt(text_);
  if (scenario_) {
    pipe_.offer(tick_events(*contact_, *state_, status_, trip_, events_));
    pipe_.offer(text_event("live.frame", frame()));
  }
  if (last) end_run(time_of(*state_));
}

std::string LiveFeed::frame() const {
  std::string text = "[";
  floor_->stand_at({state_->position_W_m[0], state_->position_W_m[1]});
  for_each_column(*contact_, *state_, status_ ? &*status_ : nullptr, floor_->static_friction(),
                  [&](const std::string&, double value) {
                    if (text.size() > 1) text += ',';
                    text += std::isfinite(value) ? fmt::format("{:.7g}", value) : "null";
                  });
  return text + "]";
}

std::string LiveFeed::state() const {
  const char* phase = run_.run_id() == 0 ? "none" : run_.ended() ? "ended" : scenario_ ? "running" : "unknown";
  Json state{{"phase", phase}, {"trouble", scenario_trouble_}};
  if (run_.run_id() == 0) return state.dump();
  const bool has_controller = status_.has_value();
  state["mode"] = has_controller ? sil::mode_text(status_->mode) : "";
  state["trip"] = trip_ && trip_->tripped != 0 ? sil::verdict_text(*trip_) : "";
  state["faults"] = has_controller && status_->faults != 0 ? sil::fault_text(*status_) : "";
  if (has_controller) {
    state["at_rest"] = status_->at_rest != 0;
    state["governor"] = has_governor();
    state["governed"] = status_->governed != 0;
    state["bent"] = status_->command_bent != 0;
    state["backup"] = status_->backup_active != 0;
    state["slip"] = status_->slip_detected != 0;
    state["light"] = status_->light_detected != 0;
    state["estimated"] = status_->estimate_valid != 0;
    state["measured"] = status_->measured_valid != 0;
  }
  return state.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void LiveFeed::update() {
  say_now();
  send_if_changed("live.state", state(), sent_state_);
  if (!scenario_) return;  // the page draws nothing yet
  send_if_changed("live.wish", wish_ ? wish_json(*wish_).dump() : "null", sent_wish_);
  send_course();
}

void LiveFeed::send_if_changed(const char* channel, std::string now, std::string& sent) {
  if (now == sent) return;
  pipe_.send(text_event(channel, now));
  sent = std::move(now);
}

void LiveFeed::send_course() {
  const LiveCourses::Path* path = status_ ? courses_.path(status_->course) : nullptr;
  const std::int64_t number = path != nullptr ? status_->course : 0;
  if (number == sent_course_) return;
  sent_course_ = number;
  if (path == nullptr) {
    pipe_.send(text_event("live.course", "null"));
    return;
  }
  Json course{{"number", number_text(number)}, {"path", *path}, {"to", path->back()}, {"via", Json::array()}};
  // A course ends where it was wished to, up to the plan's error.
  constexpr double kSamePlace = 0.1;  // ball radii
  if (last_wish_ && std::hypot(last_wish_->to[0] - path->back()[0], last_wish_->to[1] - path->back()[1]) <
                        kSamePlace * scenario_->ball.radius_m) {
    course["to"] = last_wish_->to;
    course["via"] = last_wish_->via;
  }
  pipe_.send(text_event("live.course", course.dump()));
}

}  // namespace ballast
