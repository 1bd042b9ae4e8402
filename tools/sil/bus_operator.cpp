#include "tools/sil/bus_operator.h"

#include <fmt/format.h>

#include "tools/sil/least_margin.h"

namespace ballast::sil {

using hal::Status;

namespace {

constexpr hal::Seconds kRepeatAfter{0.1};

// A number that counts up per sender.
std::int64_t sequence_now() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

operator_t operator_message(const firmware::OperatorInput& input, const controller_status_t& status,
                            std::int64_t sender) {
  operator_t message = hal::to_message(input, status.tick, sequence_now(), 0);
  message.utime = status.utime;
  message.sender = sender;
  return message;
}

BusOperator::BusOperator(hal::Bus& bus, hal::Seconds silence) : bus_(bus), silence_(silence) {
  bus_.subscribe<controller_status_t>(hal::kChannelControllerStatus, [this](const controller_status_t& m) {
    // The countdown before tick 0 is the run's own.
    if (m.tick < 0) {
      waiting_ = true;
      return;
    }
    if (bus_.run_id() == 0) bus_.join(m.run_id);
    status_ = m;
    fresh_ = true;
  });
  bus_.subscribe<contact_t>(hal::kChannelContact, [this](const contact_t& m) {
    lower_margin(m, least_margin_);
    if (m.last != 0) last_tick_ = m.tick;
  });
}

Status BusOperator::fail(Status status, const std::string& text) {
  trouble_ = text;
  if (status == Status::kInterrupted) trouble_ = "interrupted";
  if (status == Status::kIo) trouble_ = "the LCM bus failed";
  return status;
}

Status BusOperator::connect() {
  const Status status = bus_.receive_until(hal::after(hal::WallClock::now(), silence_), [this] { return fresh_; });
  if (status == Status::kOk) return status;
  if (status != Status::kEmpty) return fail(status, "");
  return fail(Status::kPeerLost, fmt::format("{} (listened on {} for {:g} s)",
                                             waiting_ ? "the controller on this bus waits for its plant"
                                                      : "no controller is at work on this bus",
                                             bus_.url(), silence_.count()));
}

Status BusOperator::tell(const firmware::OperatorInput& input) {
  const operator_t message = operator_message(input, *status_, sender_);
  const std::int64_t before = status_->operator_commands;
  least_margin_.reset();
  const auto deadline = hal::after(hal::WallClock::now(), silence_);
  for (;;) {
    if (bus_.publish(hal::kChannelOperator, message) != Status::kOk) return fail(Status::kIo, "");
    const auto repeat_at = hal::after(hal::WallClock::now(), kRepeatAfter);
    const Status status = bus_.receive_until(std::min(deadline, repeat_at),
                                             [&] { return status_->operator_commands > before || last_tick_; });
    if (status_->operator_commands > before) return Status::kOk;
    if (status == Status::kOk) return fail(Status::kEnded, "the run ended before the controller heard the command");
    if (status != Status::kEmpty) return fail(status, "");
    if (hal::WallClock::now() >= deadline) {
      return fail(Status::kPeerLost, "the controller on this bus did not take the command");
    }
  }
}

Status BusOperator::follow(const std::function<bool(const controller_status_t&)>& done) {
  while (!done(*status_)) {
    fresh_ = false;
    if (last_tick_ && status_->tick >= *last_tick_) return fail(Status::kEnded, "the run ended before that");
    const Status status = bus_.receive_until(hal::after(hal::WallClock::now(), silence_), [this] { return fresh_; });
    if (status == Status::kEmpty && last_tick_) return fail(Status::kEnded, "the run ended before that");
    if (status == Status::kEmpty) return fail(Status::kPeerLost, "the controller on this bus has gone silent");
    if (status != Status::kOk) return fail(status, "");
  }
  return Status::kOk;
}

}  // namespace ballast::sil
