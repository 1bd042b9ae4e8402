// Feeds ballast-live, the server of the live page, with the run on the bus and with what is said about it in words.
//
// Events for the server, beside the messages of the bus (for Foxglove):
//   robot.json, scenario.toml   the robot of a run that is shown from now on
//   live.run                    JSON: its name, the names of a frame's columns, masses, limits
//   live.frame                  JSON: a list of numbers, one per column; null where there is none. Others replace lost
//                               ones
//   live.state                  JSON: phase of the run, the controller's mode and flags, trip and faults in words
//   live.course                 JSON: the course that the masses follow: number, path of [x, y] as planned, its end
//   `to`
//                               and the places `via` on the way as far as they are known; null: none
//   live.wish                   JSON: the place that a course is planned to: who, to, via; null: none
//   live.said                   JSON: one line in words, with its kind, its run's number and its time
// Frames are complete ticks, at most 60 per second of the wall clock and the run's last.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/lcm/messages.h"
#include "sim/plant/local_floor.h"
#include "sim/scenario/scenario.h"
#include "tools/ballast/event_pipe.h"
#include "tools/ballast/live_courses.h"
#include "tools/ballast/live_go.h"
#include "tools/ballast/shown_run.h"
#include "tools/recording/scenario_beacon.h"

namespace ballast {

class LiveFeed {
 public:
  // The pipe must outlive the feed.
  explicit LiveFeed(EventPipe& pipe) : pipe_(pipe) {}
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  // Takes valid messages with the wall clock's seconds.
  void observe(const contact_t& message, double now_s);
  void observe(const plant_state_t& message, double now_s);
  void observe(const controller_status_t& message, double now_s);
  void observe(const trip_t& message, double now_s);
  void observe(const scenario_piece_t& message, double now_s);
  // Operators' commands of which courses consist, as they are given or as the run repeats them for observers.
  void observe(const operator_t& message, double now_s);

  // The place that a course is planned to; null: none.
  void set_wish(const GoWish* wish);

  // Sends state, wish and course if they have changed. To be called often.
  void update();

  enum class Kind : std::uint8_t { kRun, kMode, kPlan, kCommand, kRefusal, kTrip };
  void say(Kind kind, const std::string& text);

  // The newest status of the shown run's controller; null: there is none, or the run has ended.
  [[nodiscard]] const controller_status_t* controller() const { return status_ && !run_.ended() ? &*status_ : nullptr; }
  [[nodiscard]] bool ended() const { return run_.ended(); }
  // The shown run has a governor. False while its scenario is not known.
  [[nodiscard]] bool has_governor() const { return scenario_ && scenario_->control.governor; }
  // The duration of its scenario; 0: that is not known.
  [[nodiscard]] double duration_s() const { return scenario_ ? scenario_->duration_s : 0; }

 private:
  // Whether the message belongs to the run that is shown.
  bool is_shown(std::int64_t run_id, double now_s);
  void adopt(const std::string& scenario_text);
  void end_run(double time_s);
  void say_what_changed(const controller_status_t& before, const controller_status_t& after);
  void say_plan(const controller_status_t& status);
  [[nodiscard]] std::string line(Kind kind, const std::string& text) const;
  // Changes of the controller are said with the next update(), after the command that made them.
  void say_soon(Kind kind, const std::string& text) { soon_ += line(kind, text); }
  void say_now();
  void pass_on(double now_s);
  [[nodiscard]] std::string frame() const;
  [[nodiscard]] std::string state() const;
  void send_if_changed(const char* channel, std::string now, std::string& sent);
  void send_course();

  EventPipe& pipe_;
  ShownRun run_;
  sil::ScenarioPieces pieces_;
  std::int64_t text_run_id_ = 0;           // run of text_
  std::string text_;                       // the newest whole scenario file
  std::optional<sim::Scenario> scenario_;  // of the shown run; none: not known yet
  std::string scenario_trouble_;
  mutable std::optional<sim::LocalFloor> floor_;
  double passed_s_ = 0;
  std::int64_t events_ = 0;
  std::string soon_;  // lines of say_soon(), as events
  std::string sent_state_, sent_wish_;
  std::optional<GoWish> wish_;       // whose course is not there yet
  std::optional<GoWish> last_wish_;  // the newest, also after its course has begun
  LiveCourses courses_;
  std::optional<std::int64_t> sent_course_;     // its number; 0: that there is none; none: nothing since the run began
  std::optional<std::int64_t> said_plan_tick_;  // of the newest plan that has been told
  bool plan_moves_ = false;                     // the newest plan is a move's; else a stop's
  std::optional<contact_t> contact_;
  std::optional<plant_state_t> state_;
  std::optional<controller_status_t> status_;
  std::optional<trip_t> trip_;
};

}  // namespace ballast
