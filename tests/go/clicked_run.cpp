#include "tests/go/clicked_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <memory>
#include <stdexcept>
#include <utility>

#include "firmware/governor/halt.h"
#include "tools/go/go_plan.h"
#include "tools/go/standpoint.h"
#include "tools/program/params.h"
#include "tools/sil/lap_sink.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast::go_test {

namespace {

constexpr std::int64_t kSender = 1;

class ClickingPeers final : public sil::Peer {
 public:
  ClickingPeers(sil::Peer& peers, const sim::Scenario& scenario, const firmware::ControllerParams& params,
                const std::vector<Click>& clicks, int latency, double time_limit_s, ClickedRun& out)
      : peers_(peers),
        scenario_(scenario),
        params_(params),
        clicks_(clicks),
        latency_(latency),
        time_limit_s_(time_limit_s),
        out_(out) {
    out_.clicked.resize(clicks.size());
  }

  hal::Status connect() override { return peers_.connect(); }
  hal::Status send(sil::Lap& lap) override {
    const std::int64_t tick = lap.tick();
    plant_ = lap.plant.state;
    watch_halt(tick);
    const bool due = status_ && !sending_ && next_ < clicks_.size() && tick >= clicks_[next_].tick;
    if (due && clicks_[next_].halt) {
      halt(lap);
    } else if (due && !halts_first(lap)) {
      plan(tick, next_++);
    } else if (!due && is_at_rest_on_the_way(tick)) {
      plan(tick, next_ - 1);
    }
    if (sending_ && tick >= send_from_ && !parts_.empty()) {
      const operator_t message = message_of(parts_.front(), tick);
      const bool lost = message.course_first / firmware::kCoursePart == clicks_[next_ - 1].lost_part;
      if (!lost) lap.heard.push_back(message);
      parts_.pop_front();
    }
    return peers_.send(lap);
  }
  hal::Status receive(sil::Lap& lap) override {
    const hal::Status status = peers_.receive(lap);
    if (lap.answer) observe(lap.answer->status);
    return status;
  }
  [[nodiscard]] std::string trouble() const override { return peers_.trouble(); }
  [[nodiscard]] sil::PeerFailure failure() const override { return peers_.failure(); }
  [[nodiscard]] sil::RefusedMessages refused() const override { return peers_.refused(); }

  // How far the ball is from the place of click k.
  void look_at_place(std::size_t k, const Eigen::Vector2d& place_m, std::int64_t tick) {
    Clicked& clicked = out_.clicked[k];
    clicked.off_m = (place_m - clicks_[k].to_m).norm();
    const double course_s = static_cast<double>(tick - clicked.decided_tick) * params_.control_period_s;
    clicked.over = clicked.in_force && !clicked.on_the_way && course_s >= clicked.duration_s;
  }

 private:
  template <class Input>
  operator_t message_of(const Input& input, std::int64_t tick) {
    operator_t message = hal::to_message(firmware::OperatorInput(input), tick, ++sequence_, params_.control_period_s);
    message.sender = kSender;
    return message;
  }

  // A ball that is lost is halted before a course is planned from there, as `operate go` does.
  bool halts_first(sil::Lap& lap) {
    if (go::needs_halt(heard())) {
      if (!halts_) lap.heard.push_back(message_of(firmware::OperatorCommand::kHalt, lap.tick()));
      out_.halts += halts_ ? 0 : 1;
      halts_ = true;
      return true;
    }
    halts_ = halts_ && status_->mode != controller_status_t::MODE_ARMED;
    return halts_;
  }

  void halt(sil::Lap& lap) {
    ++next_;
    if (speed_mps() < rest_mps()) return;
    lap.heard.push_back(message_of(firmware::OperatorCommand::kHalt, lap.tick()));
    out_.halted.push_back({});
    out_.halted.back().tick = lap.tick();
    halt_path_m_.clear();
    watches_ = true;
  }

  // How far the ball has rolled in the halt that is under way, tick by tick: what is said names the tick from which its
  // distance counts.
  void watch_halt(std::int64_t tick) {
    const Eigen::Vector2d place_m(plant_.position_W_m[0], plant_.position_W_m[1]);
    const Eigen::Vector2d before_m = std::exchange(place_m_, place_m);
    if (!watches_) return;
    Halted& halted = out_.halted.back();
    halt_path_m_.push_back((halt_path_m_.empty() ? 0 : halt_path_m_.back()) + (place_m - before_m).norm());
    if (status_->halt_said != 0 && status_->mode == controller_status_t::MODE_HALTING) {
      if (!halted.said || status_->halt_tick != halted.from_tick) halted.said_tick = tick;
      halted.said = true;
      halted.from_tick = status_->halt_tick;
      halted.said_m = status_->halt_distance_m;
    }
    if (speed_mps() >= rest_mps()) {
      const auto from = static_cast<std::size_t>(std::max<std::int64_t>(0, halted.from_tick - halted.tick));
      halted.rolled_m = halt_path_m_.back() - (from < halt_path_m_.size() ? halt_path_m_[from] : halt_path_m_.back());
      halted.rest_s = static_cast<double>(tick - halted.tick) * params_.control_period_s;
    }
    const bool over =
        status_->mode == controller_status_t::MODE_STOPPING || status_->mode == controller_status_t::MODE_ARMED;
    halted.rests = over && speed_mps() < rest_mps();  // a halt may be given up
    watches_ = tick < halted.tick + 2 || status_->mode == controller_status_t::MODE_HALTING;
  }

  [[nodiscard]] double speed_mps() const { return std::hypot(plant_.velocity_W_mps[0], plant_.velocity_W_mps[1]); }
  [[nodiscard]] double rest_mps() const { return static_cast<double>(firmware::rest_speed_mps(params_.ball)); }

  [[nodiscard]] go::Heard heard() const {
    return {scenario_, *status_, plant_, status_->course == 0 ? std::nullopt : followed_};
  }

  [[nodiscard]] bool is_at_rest_on_the_way(std::int64_t tick) const {
    if (!status_ || sending_ || next_ == 0 || status_->mode != controller_status_t::MODE_RUNNING) return false;
    const Clicked& clicked = out_.clicked[next_ - 1];
    const double course_s = static_cast<double>(tick - status_->course_tick) * params_.control_period_s;
    return clicked.on_the_way && clicked.in_force && status_->course == number_ &&
           course_s - status_->motion_delay_s > clicked.duration_s && go::ball_rests(heard());
  }

  // Plans for click k, from where the ball is or from a rest on the way.
  void plan(std::int64_t tick, std::size_t k) {
    Clicked& clicked = out_.clicked[k];
    const Click& click = clicks_[k];
    const bool goes_on = clicked.on_the_way;
    const auto here = go::now(heard());
    const Eigen::Vector2d place(here.place_m[0], here.place_m[1]);
    if (!goes_on && k > 0) look_at_place(k - 1, place, tick);
    if (!goes_on) clicked.way_m = (click.to_m - place).norm();
    constexpr int kMostParts = 100;
    const double search_ticks = go::kFirstSearch * firmware::governor_params(params_).search_ticks;
    const std::int64_t from_tick = tick + latency_ + kMostParts + static_cast<std::int64_t>(search_ticks);
    const auto at = go::standpoint_at(heard(), from_tick, clicked.why);
    if (!at) return;
    go::GoTask task;
    task.to_m = click.to_m;
    task.sets_out = click.sets_out && !goes_on;
    if (click.duration_s > 0) task.duration_s = click.duration_s;
    const auto start = std::chrono::steady_clock::now();
    const auto planning_s = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    const go::GoOutcome outcome = go::plan_course(
        scenario_, params_, at->at, task, [&] { return planning_s() > time_limit_s_; }, [](const std::string&) {});
    if (!goes_on) clicked.plan_s = planning_s();
    clicked.why = outcome.why;
    clicked.planned = outcome.plan.has_value();
    clicked.on_the_way = clicked.planned && outcome.plan->on_the_way;
    if (!outcome.plan) return;
    clicked.duration_s = outcome.plan->moved.duration_s;
    if (!goes_on) clicked.rolling = !at->rests;
    const bool armed = status_->mode == controller_status_t::MODE_ARMED;
    coming_ =
        go::make_course(++number_, at->rests && armed ? 0 : from_tick, outcome.plan->moved, outcome.plan->reference);
    const auto parts = go::parts_of(coming_);
    clicked.parts = static_cast<int>(parts.size());
    parts_.assign(parts.begin(), parts.end());
    sending_ = true;
    send_from_ = clicked.sent_tick = tick + latency_ + click.delayed_ticks;
  }

  void observe(const controller_status_t& status) {
    if (status_) look_at_jerk(*status_, status);
    status_ = status;
    if (!sending_ || !parts_.empty() || status.course_coming == number_) return;
    Clicked& clicked = out_.clicked[next_ - 1];
    sending_ = false;
    clicked.in_force = status.course == number_;
    clicked.refusal = clicked.in_force ? 0 : status.refusal;
    clicked.decided_tick = status.tick;
    if (!clicked.in_force) return;
    ++clicked.courses;
    followed_ = coming_;
  }

  void look_at_jerk(const controller_status_t& before, const controller_status_t& after) {
    if (after.mode != controller_status_t::MODE_RUNNING || before.mode != controller_status_t::MODE_RUNNING) return;
    for (int i = 0; i < after.motor_count; ++i) {
      const double change = std::fabs(after.next_acceleration[i] - before.next_acceleration[i]);
      const double most = params_.motor[static_cast<std::size_t>(i)].max_jerk * params_.control_period_s;
      out_.greatest_jerk_use = std::max(out_.greatest_jerk_use, change / most);
    }
  }

  sil::Peer& peers_;
  const sim::Scenario& scenario_;
  const firmware::ControllerParams& params_;
  const std::vector<Click>& clicks_;
  int latency_;
  double time_limit_s_;
  ClickedRun& out_;
  std::size_t next_ = 0;
  std::int64_t sequence_ = 0, number_ = 0, send_from_ = 0;
  bool sending_ = false, halts_ = false, watches_ = false;
  Eigen::Vector2d place_m_ = Eigen::Vector2d::Zero();
  std::vector<double> halt_path_m_;
  std::deque<firmware::CoursePart> parts_;
  plant_state_t plant_{};
  std::optional<controller_status_t> status_;
  go::HostCourse coming_;
  std::optional<go::HostCourse> followed_;
};

}  // namespace

sim::Scenario clickable(double duration_s, const std::vector<std::string>& overrides) {
  std::vector<std::string> all{"duration=" + std::to_string(duration_s), "control.governor=true"};
  all.insert(all.end(), overrides.begin(), overrides.end());
  const auto read = sim::read_scenario(BALLAST_SCENARIO_DIR "/desk_ball.toml", all);
  if (!read.ok()) throw std::runtime_error(to_string(read.errors.front()));
  return read.scenario;
}

ClickedRun run_clicked(const sim::Scenario& scenario, const std::vector<Click>& clicks, int latency,
                       double time_limit_s) {
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto why = program::to_controller_params(scenario, *params)) throw std::runtime_error(*why);
  sil::InProcessPeers inner(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
  ClickedRun out;
  ClickingPeers peers(inner, scenario, *params, clicks, latency, time_limit_s, out);
  if (peers.connect() != hal::Status::kOk) throw std::runtime_error(peers.trouble());
  sil::NoRecord sink;
  sil::RunOptions options;
  options.by_hand = true;
  out.result = sil::run(scenario, peers, sink, options);
  if (!clicks.empty())
    peers.look_at_place(clicks.size() - 1, out.result.final_sample.position_W_m.head<2>(), out.result.ticks);
  return out;
}

}  // namespace ballast::go_test
