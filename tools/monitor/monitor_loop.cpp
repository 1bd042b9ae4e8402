#include "tools/monitor/monitor_loop.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hal/lcm/channels.h"

namespace ballast::monitor {

using hal::Status;

namespace {

constexpr std::chrono::milliseconds kWaitingPeriod{50};

std::string lost(const char* peer, const char* what, hal::Seconds silence, std::optional<std::int64_t> last_tick) {
  return fmt::format("lost {}: no {} for {:g} s {}", peer, what, silence.count(),
                     last_tick ? fmt::format("after tick {}", *last_tick) : "before the first tick");
}

}  // namespace

std::int64_t MonitorLoop::TickMessages::tick() const {
  return contact ? contact->tick : plant_state ? plant_state->tick : sensors->tick;
}

MonitorLoop::MonitorLoop(hal::Bus& bus, Monitor& monitor, const MonitorLimits& limits,
                         const MonitorLoopOptions& options)
    : bus_(bus), monitor_(monitor), limits_(limits), options_(options) {
  if (!options_.judge) options_.judge = [this](const Samples& samples) { monitor_.judge(samples); };
  bus_.subscribe<contact_t>(hal::kChannelContact,
                            [this](const contact_t& message) { on_plant(message, &TickMessages::contact); });
  bus_.subscribe<plant_state_t>(
      hal::kChannelPlantState, [this](const plant_state_t& message) { on_plant(message, &TickMessages::plant_state); });
  bus_.subscribe<sensors_t>(hal::kChannelSensors, [this](const sensors_t& message) {
    if (!is_foreign(message.scenario_id, "plant")) on_plant(message, &TickMessages::sensors);
  });
  if (limits_.controller_expected) {
    bus_.subscribe<controller_status_t>(hal::kChannelControllerStatus, [this](const controller_status_t& message) {
      // A controller that still waits names no run, and is no part of a run under way.
      if (message.run_id == 0 && last_tick_) return;
      if (is_foreign(message.scenario_id, "controller")) return;
      if (!status_ || message.tick >= status_->tick) status_ = message;
    });
  }
}

hal::LinkCounters MonitorLoop::counters() const {
  hal::LinkCounters counters = counters_;
  counters.malformed = bus_.malformed();
  counters.foreign += bus_.foreign();
  return counters;
}

bool MonitorLoop::is_foreign(std::int64_t scenario_id, const char* sender) {
  if (scenario_id == limits_.scenario_id) return false;
  ++counters_.foreign;
  if (failure_ == Status::kOk) complain(std::string(sender) + " runs another scenario");
  failure_ = Status::kForeignScenario;
  return true;
}

// Keeps repetitions and gaps: they must reach the monitor, which trips on them.
template <class M>
void MonitorLoop::on_plant(const M& message, std::optional<M> TickMessages::*slot) {
  if (message.run_id == 0) {
    ++counters_.foreign;
    return;
  }
  if (bus_.run_id() == 0) bus_.join(message.run_id);
  TickMessages& messages = current_.empty() || current_.tick() == message.tick ? current_ : next_;
  if (messages.*slot) {
    ++counters_.repeated;
    messages.repeated = true;
  } else {
    messages.*slot = message;
  }
}

bool MonitorLoop::controller_heard() const {
  if (!limits_.controller_expected || controller_lost_ || !last_tick_) return true;
  return status_ && status_->tick >= *last_tick_;
}

// The tick is complete, or it never will be: the plant has gone on, or it repeats a tick already judged.
bool MonitorLoop::ready() const {
  if (failure_ != Status::kOk) return true;
  if (current_.empty()) return false;
  return (current_.complete() && controller_heard()) || !next_.empty() ||
         (last_tick_ && current_.tick() <= *last_tick_);
}

// kOk: there is a tick to judge.
Status MonitorLoop::wait() {
  const auto some = [this] { return failure_ != Status::kOk || !current_.empty(); };
  const hal::WallClock::time_point start = hal::WallClock::now();
  Status status = Status::kEmpty;
  if (last_tick_) {
    status = bus_.receive_until(hal::after(start, options_.peer_timeout), some);
  } else {
    const hal::WallClock::time_point deadline = hal::after(start, options_.start_timeout);
    do {
      if (const Status sent = bus_.publish(hal::kChannelTrip, monitor_.verdict()); sent != Status::kOk) return sent;
      status = bus_.receive_until(std::min(deadline, hal::WallClock::now() + kWaitingPeriod), some);
    } while (status == Status::kEmpty && hal::WallClock::now() < deadline);
  }
  if (status == Status::kOk) {
    status =
        bus_.receive_until(hal::after(hal::WallClock::now(), options_.peer_timeout / 2), [this] { return ready(); });
    if (status == Status::kEmpty) status = Status::kOk;
  } else if (status == Status::kEmpty) {
    return plant_silent(hal::WallClock::now() - start);
  }
  return failure_ != Status::kOk ? failure_ : status;
}

Status MonitorLoop::plant_silent(hal::Seconds silence) {
  if (!last_tick_) {
    const bool both = limits_.controller_expected && !status_;
    complain(lost(both ? "plant and controller" : "plant", "message", options_.start_timeout, last_tick_));
    return Status::kPeerLost;
  }
  // The plant waits for the controller, so if the controller has not answered a whole tick, it went first. A plant that
  // ends while sending leaves part of a tick, which a controller cannot answer.
  if (controller_heard() || !last_complete_) {
    complain(lost("plant", "contact", options_.peer_timeout, last_tick_));
  } else {
    complain(lost("controller", "status", options_.peer_timeout, last_tick_));
  }
  const double period_s = options_.control_period_s;
  const trip_t verdict = monitor_.silence(silence.count() / period_s, options_.peer_timeout.count() / period_s);
  if (const Status sent = bus_.publish(hal::kChannelTrip, verdict); sent != Status::kOk) return sent;
  return Status::kPeerLost;
}

Status MonitorLoop::judge() {
  if (current_.complete() && !controller_heard()) {
    controller_lost_ = true;
    complain(lost("controller", "status", options_.peer_timeout / 2, last_tick_));
  }
  const auto address = [](const auto& message) { return message ? &*message : nullptr; };
  const Samples samples{address(current_.contact), address(current_.plant_state), address(current_.sensors),
                        address(status_)};
  const std::int64_t tick = current_.tick();
  if (last_tick_ && tick <= *last_tick_) ++counters_.repeated;
  options_.judge(samples);
  if (current_.repeated) options_.judge(samples);
  last_complete_ = current_.complete();
  last_tick_ = std::max(tick, last_tick_.value_or(tick));
  return bus_.publish(hal::kChannelTrip, monitor_.verdict());
}

Status MonitorLoop::run() {
  for (;;) {
    if (const Status status = wait(); status != Status::kOk) return status;
    if (const Status status = judge(); status != Status::kOk) return status;
    const bool last = (current_.contact && current_.contact->last == 1) ||
                      (current_.plant_state && current_.plant_state->last == 1) ||
                      (current_.sensors && current_.sensors->last == 1);
    if (last) return Status::kEnded;
    current_ = std::exchange(next_, TickMessages{});
  }
}

void MonitorLoop::complain(const std::string& line) {
  if (!trouble_.empty()) trouble_ += '\n';
  trouble_ += line;
}

}  // namespace ballast::monitor
