#include "tools/ballast/foxglove_feed.h"

#include "tools/ballast/tick_events.h"
#include "tools/recording/black_box.h"
#include "tools/sil/robot.h"

namespace ballast {

namespace {

constexpr double kEvery_s = 1.0 / 60;

}  // namespace

std::string FoxgloveFeed::start(const std::string& host, int port) {
  const std::string why = pipe_.start("ballast-foxglove", {"--host=" + host, "--port=" + std::to_string(port)}, false);
  if (!why.empty()) return why;
  pipe_.send(text_event("robot.json", sil::robot_json(scenario_)) +
             text_event("scenario.toml", sil::scenario_file(scenario_)));
  return "";
}

void FoxgloveFeed::observe(const contact_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  contact_ = message;
  if (message.last != 0) run_.end();
  pass_on(now_s);
}

void FoxgloveFeed::observe(const plant_state_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  state_ = message;
  if (message.last != 0) run_.end();
  pass_on(now_s);
}

void FoxgloveFeed::observe(const sensors_t& message, double now_s) {
  if (is_shown(message.run_id, now_s)) recognise(message.scenario_id);
}

void FoxgloveFeed::observe(const controller_status_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  recognise(message.scenario_id);
  status_ = message;
}

void FoxgloveFeed::observe(const trip_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  recognise(message.scenario_id);
  trip_ = message;
}

bool FoxgloveFeed::is_shown(std::int64_t run_id, double now_s) {
  const ShownRun::Heard heard = run_.hear(run_id, now_s);
  if (heard == ShownRun::Heard::kFirst) {
    known_ = ours_ = false;
    contact_.reset();
    state_.reset();
    status_.reset();
    trip_.reset();
    passed_s_ = now_s - kEvery_s;
  }
  return heard != ShownRun::Heard::kOther;
}

void FoxgloveFeed::recognise(std::int64_t scenario_id) {
  known_ = true;
  ours_ = scenario_id == scenario_id_;
}

void FoxgloveFeed::pass_on(double now_s) {
  if (!contact_ || !state_ || contact_->tick != state_->tick) return;
  const bool last = contact_->last != 0 || state_->last != 0;
  if (!ours_ || (!last && now_s - passed_s_ < kEvery_s)) return;
  passed_s_ = now_s;
  pipe_.offer(tick_events(*contact_, *state_, status_, trip_, events_));
}

}  // namespace ballast
