#include "tools/ballast/live_operator.h"

#include "hal/lcm/messages.h"
#include "tools/sil/bus_operator.h"
#include "tools/summary/controller_words.h"

namespace ballast {

namespace {

using firmware::OperatorCommand;

// A bus may lose a message. An exact copy is not obeyed twice.
constexpr hal::Seconds kRepeatEvery{0.05}, kPatience{2};

bool is_brake(OperatorCommand command) {
  return command == OperatorCommand::kStop || command == OperatorCommand::kHalt;
}

bool moves_on(const controller_status_t& status) {
  return status.mode == controller_status_t::MODE_RUNNING || status.mode == controller_status_t::MODE_MOVING ||
         status.mode == controller_status_t::MODE_PENDING;
}

}  // namespace

std::optional<LiveOperator::Answer> LiveOperator::tell(const std::string& who, const std::string& what,
                                                       const firmware::OperatorInput& input,
                                                       const controller_status_t& status) {
  if (pending_ && !is_brake(input.command)) {
    return Answer{who, false, "the " + what + " is not sent: the " + pending_->what + " has no answer yet"};
  }
  const auto now = hal::WallClock::now();
  pending_ = Pending{who,
                     what,
                     input,
                     sil::operator_message(input, status, sender_),
                     status.run_id,
                     status.operator_commands,
                     hal::after(now, kRepeatEvery),
                     hal::after(now, kPatience)};
  publish(pending_->message, pending_->run_id);
  return std::nullopt;
}

std::optional<LiveOperator::Answer> LiveOperator::poll(const controller_status_t& status) {
  if (!pending_) return std::nullopt;
  if (status.run_id != pending_->run_id) return end();
  if (status.operator_commands > pending_->commands_before) {
    const bool moves = pending_->input.command == OperatorCommand::kMove;
    const std::string refusal = sil::refusal_text(status, moves ? &pending_->input.move : nullptr);
    // The command that was counted may be another operator's, such as a part of a course. A stop is repeated until it
    // works.
    if (is_brake(pending_->input.command) && refusal.empty() && moves_on(status)) {
      pending_->commands_before = status.operator_commands;
      return std::nullopt;
    }
    const Pending answered = *pending_;
    pending_.reset();
    if (refusal.empty()) return Answer{answered.who, true, answered.what, moves};
    return Answer{answered.who, false, sil::refused_text(answered.what, refusal)};
  }
  const auto now = hal::WallClock::now();
  if (now >= pending_->deadline) {
    const Pending lost = *pending_;
    pending_.reset();
    return Answer{lost.who, false, "the controller on this bus did not take the " + lost.what};
  }
  if (now >= pending_->repeat_at) {
    pending_->repeat_at = hal::after(now, kRepeatEvery);
    publish(pending_->message, pending_->run_id);
  }
  return std::nullopt;
}

std::optional<LiveOperator::Answer> LiveOperator::end() {
  if (!pending_) return std::nullopt;
  const Pending lost = *pending_;
  pending_.reset();
  return Answer{lost.who, false, "the run ended before the controller heard the " + lost.what};
}

bool LiveOperator::brakes() const { return pending_ && is_brake(pending_->input.command); }

// The bus hears all runs. It joins this one for as long as it publishes, so that the message carries the run's number.
void LiveOperator::publish(const operator_t& message, std::int64_t run_id) {
  bus_.join(run_id);
  (void)bus_.publish(hal::kChannelOperator, message);  // a bus that fails ends the program where it is read
  bus_.join(0);
}

}  // namespace ballast
